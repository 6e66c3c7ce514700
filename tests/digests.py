"""Write down what the core computes, and compare: the record of what a change must not change.

    OMP_NUM_THREADS=1 python -m tests.digests record FILE.npz      on the code before, ten minutes on one core
    OMP_NUM_THREADS=1 python -m tests.digests compare FILE.npz     on the code after, five
    ... --only shipped|random|times                                one part
    ... --first 200                                                fewer of the random mechanisms

The record holds the states and the numbers of every result, and what each call raises or warns. It depends on
the machine's linear algebra, so it is not kept with the code. A difference is stated as part of the result's
largest entry, and in terms of its conditioning: how far roundings of the inputs move the result.
"""

import argparse
import contextlib
import json
import re
import sys
import time
import timeit
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

import hybridyn
from hybridyn.compiled.equations.states import moving_states
from hybridyn.errors import HybridynError
from hybridyn.structure.building import build_robot
from tests.any_mechanism import any_mechanism
from tests.digest_calls import FEW, MODELS, Model, positions_of_motors
from tests.shipped import ROBOTS, shipped, states_near_home

MECHANISMS, SAMPLES, SEED = 2000, 2, 26
#: A result is the same up to rounding below so many times what roundings of its inputs do.
ROUNDINGS = 100.0
EPS = float(np.finfo(float).eps)


def numbers(found: Any) -> Iterator[np.ndarray]:
    """Yield the arrays of a result, whatever record holds them."""
    if isinstance(found, np.ndarray | float | int) or np.isscalar(found):
        if not isinstance(found, str):
            yield np.ravel(np.asarray(found, dtype=float))
    elif isinstance(found, Mapping):
        for name in sorted(found):
            yield from numbers(found[name])
    elif isinstance(found, tuple | list):
        for part in found:
            yield from numbers(part)
    elif type(found).__name__ == "Result":  # of a simulation
        yield from numbers((found.t, found.q, found.v))
    elif is_dataclass(found):
        yield from numbers([getattr(found, field.name) for field in fields(found)])


def said(error: Exception | warnings.WarningMessage) -> str:
    """Return the kind of an error or a warning, and its first words without numbers."""
    kind = type(error.message if isinstance(error, warnings.WarningMessage) else error).__name__
    text = str(error.message if isinstance(error, warnings.WarningMessage) else error)
    return f"{kind}: " + re.sub(r"[-+]?[\d.]+(e[-+]?\d+)?", "#", text)[:100]


def called(model: Callable[[], Any]) -> tuple[np.ndarray, str]:
    """Call a model; return its numbers, and what it raised or warned."""
    with warnings.catch_warnings(record=True) as heard, np.errstate(all="ignore"):
        warnings.simplefilter("always")
        try:
            out, verdict = list(numbers(model())), ""
        except (HybridynError, np.linalg.LinAlgError, KeyError) as error:
            out, verdict = [], said(error)
    verdict += "".join(sorted({f" | {said(one)}" for one in heard if "1,000 calls" not in str(one.message)}))
    return np.concatenate([np.zeros(0), *out]), verdict


def moved(model: Callable[..., Any], given: list[np.ndarray], found: np.ndarray, draws: int) -> float:
    """Return how far relative roundings of the inputs move a result, the largest of some draws."""
    rng, out = np.random.default_rng(SEED), 0.0
    for _ in range(draws):
        near = [x * (1 + EPS * rng.choice([-1.0, 1.0], size=x.shape)) for x in given]
        again, _ = called(partial(model, *near))
        if again.shape == found.shape:
            out = max(out, float(np.abs(again - found).max(initial=0.0)))
    return out


def robot_of(case: str) -> hybridyn.HybridRobot:
    """Build the robot of a case, "lx4/floating" or "random/7"."""
    name, which = case.split("/")
    description, base = any_mechanism(int(which)) if name == "random" else (shipped(name), which)
    return build_robot(description, base=base)


def states(case: str, robot: hybridyn.HybridRobot) -> list[np.ndarray]:
    """Draw q, v, a, tau: of the oracle for a shipped robot, of the library's own states for any mechanism."""
    name, which = case.split("/")
    if name != "random":
        q, v, a = states_near_home(shipped(name), which, SEED, SAMPLES)
        return [q, v, a, 20 * np.random.default_rng(SEED).normal(size=(SAMPLES, len(robot.motors)))]
    with np.errstate(all="ignore"):
        q, v, tau = moving_states(robot, SAMPLES, int(which))
        try:
            a = hybridyn.ddm(robot, q, v, tau)
        except HybridynError:
            a = np.zeros_like(v)
    return [q, v, a, tau]


def cases(only: str, first: int) -> Iterator[tuple[str, dict[str, Model]]]:
    """Yield the name and the models of each case."""
    for name in ROBOTS if only in ("", "shipped") else ():
        yield f"{name}/fixed", MODELS
        for base in ("moving", "floating"):
            yield f"{name}/{base}", FEW
    for seed in range(first if only in ("", "random") else 0):
        yield f"random/{seed}", FEW


def record(only: str, first: int) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Compute all results; return numbers, inputs and spreads by name, and what calls raised or warned."""
    kept: dict[str, np.ndarray] = {}
    verdicts: dict[str, str] = {}
    for case, models in cases(only, first):
        try:
            robot = robot_of(case)
            given = states(case, robot)
        except HybridynError as error:
            verdicts[case] = said(error)
            continue
        kept |= {f"{case}/input {i}": x for i, x in enumerate(given)}
        for name, model in models.items():
            this = f"{case}/{name}"
            kept[this], verdicts[this] = called(partial(model, robot, *given))
            draws = 0 if not kept[this].size or name == "simulate" else 1 if case[:6] == "random" else 2
            kept[f"{this}/moved"] = np.array(moved(partial(model, robot), given, kept[this], draws))
    return kept, verdicts


def compare(before: Mapping[str, np.ndarray], verdicts: dict[str, str], only: str, first: int) -> bool:
    """Compute all results at the recorded states, print what differs, tell whether it is only rounding."""
    counts, worst = Counter[str](), dict[str, tuple[float, float, str]]()
    for case, models in cases(only, first):
        try:
            robot = robot_of(case)
        except HybridynError as error:
            counts["same refusals"] += report(case, verdicts.get(case, ""), said(error), counts)
            continue
        if f"{case}/input 0" not in before:
            counts["without states"] += 1
            continue
        given = [before[f"{case}/input {i}"] for i in range(4)]
        for name, model in models.items():
            this = f"{case}/{name}"
            found, verdict = called(partial(model, robot, *given))
            report(this, verdicts[this], verdict, counts)
            old = before[this]
            if found.tobytes() == old.tobytes():
                counts["same bits"] += 1
            elif found.shape != old.shape:
                counts["other shapes"] += 1
                print(f"SHAPE    {this}: {old.shape} before, {found.shape} now")
            else:
                off, size = np.nanmax(np.abs(found - old)), np.nanmax(np.abs(old))
                roundings = off / max(float(before[f"{this}/moved"]), EPS * size)
                known = name != "simulate" and not np.isnan(found - old).any()
                within = known and roundings <= ROUNDINGS
                counts["same to rounding" if within else "MORE THAN ROUNDING"] += 1
                worst[name] = max(worst.get(name, (0.0, 0.0, "")), (roundings, off / size, this))
                if not within:
                    print(
                        f"DIFFERS  {this}: {off / size:.1e} of the largest entry, {roundings:.1f} roundings"
                    )
    for name, (roundings, off, this) in worst.items():
        print(f"worst of {name}: {roundings:.1f} roundings, {off:.1e} of the largest entry, {this}")
    print(", ".join(f"{count} {what}" for what, count in counts.items()))
    return not counts["MORE THAN ROUNDING"] + counts["other shapes"] + counts["OTHER VERDICTS"]


def report(case: str, before: str, now: str, counts: Counter[str]) -> bool:
    """Print and count what a call raised or warned, if it is something else than before."""
    if before == now:
        return True
    kinds = [re.findall(r"\w+(?=: )", text)[:1] for text in (before, now)]
    what = "other words" if kinds[0] == kinds[1] else "OTHER VERDICTS"
    counts[what] += 1
    print(f"{what} {case}: {before or 'no error'} -> {now or 'no error'}")
    return False


def timed(name: str) -> dict[str, Callable[[], Any]]:
    """Return calls on a shipped robot, by name."""
    robot = hybridyn.load(name)
    q, v, a, tau = states(f"{name}/fixed", robot)
    Q, V, A, Tau = (np.tile(x, (100, 1)) for x in (q, v, a, tau))
    idm = partial(hybridyn.idm, robot, passive="solved")
    return {
        "load": lambda: hybridyn.load(name),
        "assemble": lambda: hybridyn.assemble(robot, motors=positions_of_motors(robot, Q, V, A), guess=q[0]),
        "idm": lambda: idm(q[0], v[0], a[0]),
        "ddm": lambda: hybridyn.ddm(robot, q[0], v[0], tau[0]),
        "idm of 200": lambda: idm(Q, V, A),
        "ddm of 200": lambda: hybridyn.ddm(robot, Q, V, Tau),
    }


def times() -> dict[str, float]:
    """Return the processor time of calls on the shipped robots, the median of repeats [s]."""
    out = {}
    for name in ROBOTS:
        for what, call in timed(name).items():
            with warnings.catch_warnings(), contextlib.suppress(HybridynError):
                warnings.simplefilter("ignore")
                call()
                out[f"{name} {what}"] = median(
                    timeit.repeat(call, number=1, repeat=7, timer=time.process_time)
                )
    return out


def main() -> int:
    """Record or compare."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=["record", "compare"])
    parser.add_argument("file", type=Path)
    parser.add_argument("--only", choices=["shipped", "random", "times"], default="")
    parser.add_argument("--first", type=int, default=MECHANISMS)
    asked = parser.parse_args()
    spent = times() if asked.only in ("", "times") else {}
    if asked.what == "record":
        kept, verdicts = record(asked.only, asked.first)
        said_too = np.array(json.dumps({"verdicts": verdicts, "times": spent}))
        np.savez_compressed(asked.file, words=said_too, **kept)
        print(f"{len(verdicts)} results, {sum(map(bool, verdicts.values()))} of them refusals or warnings")
        return 0
    before = dict(np.load(asked.file))
    words = json.loads(str(before.pop("words")))
    same = asked.only == "times" or compare(before, words["verdicts"], asked.only, asked.first)
    ratios = {name: spent[name] / words["times"][name] for name in spent if name in words["times"]}
    for name, ratio in sorted(ratios.items(), key=lambda pair: -pair[1]):
        print(f"time {name}: {1e3 * spent[name]:.2f} ms, {ratio:.2f} times before")
    if ratios:
        print(f"times: {median(ratios.values()):.2f} times before at the median")
    return 0 if same else 1


if __name__ == "__main__":
    sys.exit(main())
