"""Write down what the core computes, and compare: the record of what a change must not change.

    OMP_NUM_THREADS=1 python -m tests.digests record FILE.npz      on the code before, ten minutes on one core
    OMP_NUM_THREADS=1 python -m tests.digests compare FILE.npz     on the code after, five

The record holds the states and the numbers of every result, and what each call raises or warns. It depends on
the machine's linear algebra, so it is not kept with the code. A difference is stated as part of the result's
largest entry, and in terms of its conditioning: how far roundings of the inputs move the result.
"""

import json
import re
import sys
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from functools import partial
from typing import Any

import numpy as np

import hybridyn
from hybridyn.compiled.equations.states import moving_states
from hybridyn.errors import HybridynError
from hybridyn.structure.building import build_robot
from tests.any_mechanism import any_mechanism
from tests.digest_calls import FEW, MODELS, Model
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


def cases() -> Iterator[tuple[str, dict[str, Model]]]:
    """Yield the name and the models of each case."""
    for name in ROBOTS:
        yield f"{name}/fixed", MODELS
        yield from ((f"{name}/{base}", FEW) for base in ("moving", "floating"))
    yield from ((f"random/{seed}", FEW) for seed in range(MECHANISMS))


def record(before: Mapping[str, np.ndarray] | None = None) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Compute all results; return numbers by name, and what calls raised or warned.

    Args:
        before: An earlier record, whose states are taken; else they are drawn, and kept with the numbers, and
            so is how far roundings of them move each result.
    """
    kept: dict[str, np.ndarray] = {}
    verdicts: dict[str, str] = {}
    for case, models in cases():
        try:
            robot = robot_of(case)
            if f"{case}/input 0" in (before or {}):
                given = [before[f"{case}/input {i}"] for i in range(4)]
            else:
                given = states(case, robot)
        except HybridynError as error:
            verdicts[case] = said(error)
            continue
        kept |= {f"{case}/input {i}": x for i, x in enumerate(given)}
        for name, model in models.items():
            this = f"{case}/{name}"
            kept[this], verdicts[this] = called(partial(model, robot, *given))
            if before is None:
                draws = 0 if not kept[this].size or name == "simulate" else 2
                kept[f"{this}/moved"] = np.array(moved(partial(model, robot), given, kept[this], draws))
    return kept, verdicts


def judged(this: str, old: np.ndarray, now: np.ndarray, spread: float) -> str:
    """Say how a result differs from the recorded one, and print it where that is more than rounding."""
    if now.tobytes() == old.tobytes():
        return "same bits"
    roundings = np.inf
    if now.shape == old.shape and not np.isnan(now - old).any() and not this.endswith("simulate"):
        roundings = np.abs(now - old).max() / max(spread, EPS * np.abs(old).max())
    if roundings <= ROUNDINGS:
        return "same to rounding"
    print(f"DIFFERS  {this}: {roundings:.1f} roundings, shape {old.shape} before, {now.shape} now")
    return "MORE THAN ROUNDING"


def main(what: str, file: str) -> int:
    """Record or compare; give 1 where a result or a verdict is another one."""
    if what == "record":
        kept, verdicts = record()
        np.savez_compressed(file, words=np.array(json.dumps(verdicts)), **kept)
        print(f"{len(verdicts)} results, {sum(map(bool, verdicts.values()))} of them refusals or warnings")
        return 0
    before = dict(np.load(file))
    words = json.loads(str(before.pop("words")))
    kept, verdicts = record(before)
    counts = Counter(
        judged(this, before[this], now, float(before[f"{this}/moved"]))
        for this, now in kept.items()
        if f"{this}/moved" in before
    )
    for case in words.keys() | verdicts.keys():
        if (was := words.get(case, "")) != (now := verdicts.get(case, "")):
            kinds = [re.findall(r"\w+(?=: )", text)[:1] for text in (was, now)]
            counts["other words" if kinds[0] == kinds[1] else "OTHER VERDICTS"] += 1
            print(f"SAYS     {case}: {was or 'no error'} -> {now or 'no error'}")
    print(", ".join(f"{count} {how}" for how, count in counts.items()))
    return int(bool(counts["MORE THAN ROUNDING"] + counts["OTHER VERDICTS"]))


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
