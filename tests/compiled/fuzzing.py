"""Compare written programs with the general path on drawn mechanisms, without a C compiler.

    python -m tests.compiled.fuzzing 1000 0     a thousand mechanisms, from seed 0 on

Both models at trusted states, and the derivatives of both, over joints and motors, along random motions that
keep the loops closed: against differences of the general path, as new libraries are checked. What is refused
in one line is left out. Rods on balls, cylinders, redundant rows, gears and all bases are among them.
"""

import sys
from collections import Counter
from dataclasses import dataclass, field, replace
from unittest.mock import patch

import numpy as np

import hybridyn
from hybridyn.compiled.code.scalars import GUARD_LIMIT
from hybridyn.compiled.equations.states import random_states
from hybridyn.compiled.failures import difference
from hybridyn.compiled.programs.derivatives import evaluation
from hybridyn.compiled.programs.whole_robot import function_of, programs
from hybridyn.description.records import Description
from hybridyn.structure.building import build_robot
from tests.compiled import rods
from tests.oracle import Base
from tests.robots.any_mechanism import BASES, any_mechanism
from tests.robots.mechanisms import random_mechanism

AGREE = 1e-10  # the claim of compiled models
SAMPLES = 3
#: Machines of rods, and how often each is drawn.
MACHINES = {"crank": 0.6, "cylinder": 0.1, "slides": 0.1, "ball_gough": 0.1, "ball_delta": 0.1}
FEET: tuple[rods.Foot, ...] = ("ball", "ball", "universal", "revolutes", "floating", "floating aside")
SHAPES = ("round", "thin", "askew", "beside")


@dataclass
class Found:
    """What was compared: worst errors of models and derivatives, how many of each, and what is wrong."""

    worst: dict[str, float] = field(default_factory=dict)
    count: Counter[str] = field(default_factory=Counter)
    wrong: list[str] = field(default_factory=list)

    def add(self, what: str, case: str, off: float, limit: float) -> None:
        """Add a comparison."""
        self.worst[what] = float(np.nanmax([self.worst.get(what, 0.0), off]))
        self.count[what] += 1
        if not off <= limit:
            self.wrong.append(f"{case}: {what} {off:.1e}")


def drawn(seed: int) -> tuple[Description, Base]:
    """Draw a mechanism and a base; equal seeds draw the same."""
    rng = np.random.default_rng([seed, 51])
    base: Base = BASES[rng.integers(len(BASES))]
    family = rng.random()
    if family < 0.3:
        return any_mechanism(seed)
    if family < 0.6:
        return random_mechanism(seed), base
    name, shape = rng.choice([*MACHINES], p=[*MACHINES.values()]), rng.choice(SHAPES)
    foot = FEET[rng.integers(len(FEET))]
    if name == "cylinder":
        return rods.cylinder(seed), base
    description = getattr(rods, name)(seed, foot, thin=bool(shape == "thin"))
    return (shaped(description, rng, shape) if shape in ("askew", "beside") else description), base


def shaped(description: Description, rng: np.random.Generator, shape: str) -> Description:
    """Give rods products of inertia, or mass beside their lines."""
    links = []
    for link in description.links:
        if "rod" in link.name and link.mass:
            A = 0.02 * rng.normal(size=(3, 3))
            more = (A @ A.T) * link.mass if shape == "askew" else np.zeros((3, 3))
            off = 0.05 * rng.normal(size=3) if shape == "beside" else np.zeros(3)
            link = replace(link, inertia=link.inertia + more, com=link.com + off)
        links.append(link)
    return replace(description, links=tuple(links))


def compare(seed: int, found: Found) -> None:
    """Compare the models and derivatives of a mechanism; what is refused in one line is counted."""
    description, base = drawn(seed)
    case = f"seed {seed}, {description.name}, base {base}"
    try:
        robot = build_robot(description, base=base)
        states = random_states(robot, SAMPLES, seed)
    except hybridyn.HybridynError:
        found.count["refused"] += 1
        return
    compare_models(robot, states, case, found)
    for model in ("idm", "ddm"):
        for coordinates in ("joints", "motors"):
            compare_derivatives(robot, model, coordinates, case, found)


def compare_models(
    robot: hybridyn.HybridRobot, states: tuple[np.ndarray, ...], case: str, found: Found
) -> None:
    """Compare both models at the states that they trust."""
    q, v, a, tau = states
    for name, program in programs(robot, models=("idm", "ddm")).items():
        function, third = function_of(program), a if name == "idm" else tau
        more = [np.zeros((len(q), 6))] if name == "ddm" and robot.base == "moving" else []
        for row in zip(q, v, third, *more, strict=True):
            result, guard = function(*row)
            if not float(guard) <= GUARD_LIMIT:
                found.count["not trusted"] += 1
                continue
            wanted = getattr(hybridyn, name)(robot, *row[:3])
            off = difference(np.ravel(result)[None], wanted[None])
            found.add(name, case, float(off[0]), AGREE)


def compare_derivatives(
    robot: hybridyn.HybridRobot, model: str, coordinates: str, case: str, found: Found
) -> None:
    """Compare derivatives with differences, as a new library is checked, but by CasADi."""

    def record(robot: hybridyn.HybridRobot, what: str, run: object, general: object, limit: float,
               **options: object) -> None:  # fmt: skip
        """Record how far the derivatives are from the differences."""
        given = [x[:SAMPLES] for x in options["states"](0)]  # type: ignore[operator]
        results, guard = run(*given)  # type: ignore[operator]
        good = guard <= GUARD_LIMIT
        found.count["not trusted"] += int((~good).sum())
        if good.any():
            wanted = general(*(x[good] for x in given))  # type: ignore[operator]
            off = max(float(difference(x[good], y).max()) for x, y in zip(results, wanted, strict=True))
            found.add(f"{model} over {coordinates}", case, off, limit)

    try:
        derive = evaluation.Derivatives(robot, model, coordinates=coordinates)
    except hybridyn.CompileError as error:
        found.wrong.append(f"{case}: {model} over {coordinates} {error}")
        return
    except hybridyn.HybridynError:
        found.count["refused derivatives"] += 1
        return
    with (
        patch.object(evaluation, "compare_at_states", record),
        patch.object(evaluation, "Library", lambda built: derive._interpreted),
    ):
        derive._check(None)  # type: ignore[arg-type]


def main(count: int, first: int) -> Found:
    """Compare mechanisms, and print what is wrong and, from time to time, how far it is."""
    found = Found()
    for seed in range(first, first + count):
        before = len(found.wrong)
        try:
            compare(seed, found)
        except Exception as error:
            found.wrong.append(f"seed {seed}: {type(error).__name__} {error}")
        print(*found.wrong[before:], sep="\n", end="\n" if len(found.wrong) > before else "", flush=True)
        if (seed + 1 - first) % 10 == 0:
            worst = ", ".join(f"{name} {off:.1e} ({found.count[name]})" for name, off in found.worst.items())
            left = {name: n for name, n in found.count.items() if name not in found.worst}
            print(f"{seed + 1 - first} mechanisms: {worst}; {left}", flush=True)
    return found


if __name__ == "__main__":
    import logging
    import os

    os.environ["CC"] = "none"
    logging.disable(logging.CRITICAL)
    sys.exit(bool(main(int(sys.argv[1]), int(sys.argv[2])).wrong))
