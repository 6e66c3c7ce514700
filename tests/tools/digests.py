"""Write down what the core computes, and compare: the record of what a change must not change.

    OMP_NUM_THREADS=1 python -m tests.tools.digests record FILE.npz      on the code before
    OMP_NUM_THREADS=1 python -m tests.tools.digests compare FILE.npz     on the code after

The record holds every result at drawn states, and what each call raises. It depends on the machine's linear
algebra, so it is not kept with the code. A difference is stated as part of the result's largest entry, and in
terms of its conditioning: how far a rounding of the inputs moves the result.
"""

import contextlib
import re
import sys
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from itertools import product
from typing import Any, get_args

import numpy as np

import hybridyn
from hybridyn.compiled.equations.states import moving_states
from hybridyn.errors import HybridynError
from hybridyn.structure.building import build_robot
from tests.oracle import Base
from tests.robots.any_mechanism import any_mechanism
from tests.robots.posing import of_joints
from tests.robots.shipped import ROBOTS, shipped
from tests.support.comparing import arrays

MECHANISMS, SAMPLES = 2000, 2
#: A result is the same up to rounding below so many times what roundings of its inputs do.
ROUNDINGS = 100.0
EPS = float(np.finfo(float).eps)


#: What is asked of a robot at its q, v, and at efforts and accelerations that belong together.
CALLS: dict[str, Callable[..., Any]] = {
    "closures": lambda r, q, v, a, tau: hybridyn.closure_residual(r, q),
    "idm": lambda r, q, v, a, tau: hybridyn.idm(r, q, v, a),
    "idm solved": lambda r, q, v, a, tau: hybridyn.idm(r, q, v, a, passive="solved", effects="model"),
    "idm least": lambda r, q, v, a, tau: hybridyn.idm(r, q, v, a, on_singular="least-norm", reactions=True),
    "ddm": lambda r, q, v, a, tau: hybridyn.ddm(r, q, v, tau, reactions=True),
    "ddm effects": lambda r, q, v, a, tau: hybridyn.ddm(r, q, v, tau, effects="model"),
    "delassus": lambda r, q, v, a, tau: hybridyn.delassus(r, q, r.modules[-1].label),
    "kinematics": lambda r, q, v, a, tau: hybridyn.kinematics(r, q, v, a),
    "mass matrix": lambda r, q, v, a, tau: hybridyn.mass_matrix(r, q),
    "bias": lambda r, q, v, a, tau: hybridyn.bias(r, q, v),
    "motion map": lambda r, q, v, a, tau: hybridyn.motion_map(r, q, v),
    "coriolis matrix": lambda r, q, v, a, tau: hybridyn.coriolis_matrix(r, q, v),
    "energy": lambda r, q, v, a, tau: hybridyn.energy(r, q, v, effects="model"),
    "power": lambda r, q, v, a, tau: hybridyn.power(r, q, v, tau, effects="model"),
    "assemble": lambda r, q, v, a, tau: hybridyn.assemble(r, motors=of_joints(r, q, v, a), guess=q[0]),
    "momentum": lambda r, q, v, a, tau: hybridyn.momentum(r, q, v),
}


def called(call: Callable[[], Any]) -> tuple[np.ndarray, str]:
    """Return the numbers of a call, or the kind of its error and its first words without numbers."""
    try:
        return np.concatenate([np.zeros(0), *(np.ravel(x).astype(float) for x in arrays(call()))]), ""
    except (HybridynError, np.linalg.LinAlgError) as error:
        words = re.sub(r"[-+]?[\d.]+(e[-+]?\d+)?", "#", str(error))
        return np.zeros(0), f"{type(error).__name__}: {words[:100]}"


def cases() -> Iterator[tuple[str, hybridyn.HybridRobot]]:
    """Yield the shipped robots on every base, and the random mechanisms that can be built."""
    for name, base in product(ROBOTS, get_args(Base)):
        yield f"{name}/{base}", build_robot(shipped(name), base=base)
    for seed in range(MECHANISMS):
        description, base = any_mechanism(seed)
        with contextlib.suppress(HybridynError):
            yield f"random/{seed}", build_robot(description, base=base)


def results(robot: hybridyn.HybridRobot, given: list[np.ndarray]) -> Iterator[tuple[str, np.ndarray, str]]:
    """Yield the name of each call, and what `called` gives."""
    yield from ((name, *called(lambda: call(robot, *given))) for name, call in CALLS.items())  # noqa: B023


def drawn(robot: hybridyn.HybridRobot) -> list[np.ndarray]:
    """Draw q, v, and efforts with the accelerations that they cause, or none where they are refused."""
    q, v, tau = moving_states(robot, SAMPLES)
    a, _ = called(lambda: hybridyn.ddm(robot, q, v, tau))
    return [q, v, a.reshape(v.shape) if a.size else 0 * v, tau]


def record() -> dict[str, np.ndarray]:
    """Return states and results by name, errors as text, and how far roundings of the inputs move results."""
    kept, rng = dict[str, np.ndarray](), np.random.default_rng(0)
    for case, robot in cases():
        with contextlib.suppress(HybridynError):
            given = drawn(robot)
            near = [x * (1 + EPS * rng.choice([-1.0, 1.0], size=x.shape)) for x in given]
            kept |= {f"{case}/input {i}": x for i, x in enumerate(given)}
            for (name, found, said), (_, moved, _) in zip(
                results(robot, given), results(robot, near), strict=True
            ):
                kept |= {f"{case}/{name}": found, f"{case}/{name}/said": np.array(said)}
                kept[f"{case}/{name}/moved"] = moved if moved.shape == found.shape else found
    return kept


def compare(before: dict[str, np.ndarray]) -> bool:
    """Compute all results at the recorded states, print what differs, tell whether it is only rounding."""
    counts = Counter[str]()
    for case, robot in cases():
        if f"{case}/input 0" not in before:
            continue
        for name, now, said in results(robot, [before[f"{case}/input {i}"] for i in range(4)]):
            this = f"{case}/{name}"
            old, words, moved = (before[this + more] for more in ("", "/said", "/moved"))
            off, size = (
                float(np.abs(x).max(initial=0.0))
                for x in (now - old if now.shape == old.shape else np.inf, old)
            )
            roundings = off / max(float(np.abs(moved - old).max(initial=0.0)), EPS * size, 1e-300)
            what = (
                "same"
                if off == 0 and said == words
                else "rounding"
                if said == words and roundings <= ROUNDINGS
                else "OTHER"
            )
            counts[what] += 1
            if what == "OTHER":
                said = f"{words or 'no error'} -> {said or 'no error'}"
                print(f"{this}: {off:.1e} of {size:.1e}, {roundings:.1f} roundings; {said}")
    print(counts)
    return not counts["OTHER"]


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    what, file = sys.argv[1:]
    with np.errstate(all="ignore"):
        if what == "record":
            np.savez_compressed(file, **record())
        sys.exit(what != "record" and not compare(dict(np.load(file))))
