"""Compare written programs with the general path on drawn mechanisms, without a C compiler.

    python -m tests.compiled.fuzzing 1000 0             a thousand mechanisms, from seed 0 on
    python -m tests.compiled.fuzzing 300 0 repeated     whose modules and legs repeat, mirrored and turned
    python -m tests.compiled.fuzzing 200 0 second       second derivatives alone, along paths of the oracle
    python -m tests.compiled.fuzzing 50 0 second_repeated

Both models at trusted states, and the derivatives of both, over joints and motors, along random motions that
keep the loops closed: against differences of the general path, as new libraries are checked. The program that
closes the loops, the joint map, and of every `STEP_OF` mechanisms the exported control step, in C. What is
refused in one line is left out. Rods on balls, cylinders, redundant rows, gears and all bases are among them.
Of every four repeated mechanisms three have friction, springs and dampers, two of these friction by load too.
The general path is compared with the oracle, without effects.
"""

import os
import sys
from dataclasses import replace
from itertools import product
from typing import Any
from unittest.mock import patch

import numpy as np

import hybridyn
from hybridyn.compiled.code.scalars import GUARD_LIMIT
from hybridyn.compiled.equations.options import inverse_options
from hybridyn.compiled.equations.request import request
from hybridyn.compiled.equations.states import random_states
from hybridyn.compiled.export_reference import rates_read
from hybridyn.compiled.failures import difference
from hybridyn.compiled.programs.derivatives import evaluation
from hybridyn.compiled.programs.map_programs import map_programs
from hybridyn.compiled.programs.whole_robot import function_of, programs
from hybridyn.description.records import Description
from hybridyn.effects import LoadFriction
from hybridyn.manifold.manifold import Manifold
from hybridyn.structure.building import build_robot
from tests.compiled import rods
from tests.compiled.copies import FEET, repeated
from tests.compiled.drawn_effects import drawn_effects
from tests.compiled.found import CLOSED, SOLVED, Found
from tests.compiled.second_order import compare_second
from tests.compiled.stepping import compare_steps
from tests.oracle import Base, Oracle
from tests.robots.any_mechanism import BASES, any_mechanism
from tests.robots.mechanisms import random_mechanism

AGREE = 1e-10  # the claim of compiled models
#: Newton steps that close the loops, from a posture so far away [rad, module lengths].
CALLS, AWAY = 6, 1e-4
#: Derivatives; of every other one of repeated mechanisms, which are larger, one of them.
DERIVED = [*product(("idm", "ddm"), ("joints", "motors"))]
STEP_OF = 2  # one of so many mechanisms has its control steps exported
SAMPLES = 3
#: Machines of rods, and how often each is drawn.
MACHINES = {"crank": 0.6, "cylinder": 0.1, "slides": 0.1, "ball_gough": 0.1, "ball_delta": 0.1}
SHAPES = ("round", "thin", "askew", "beside")


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


def compare(seed: int, found: Found, family: str) -> None:
    """Compare the programs of a mechanism; what is refused in one line is counted."""
    of_copies = family.endswith("repeated")
    description, base = (repeated(seed), BASES[seed % len(BASES)]) if of_copies else drawn(seed)
    case = f"seed {seed}, {description.name}, base {base}"
    try:
        robot = build_robot(description, base=base)
        states = random_states(robot, SAMPLES, seed)
    except hybridyn.HybridynError:
        found.count["refused"] += 1
        return
    if family.startswith("second"):
        compare_second(robot, seed, case, found)
        return
    effects = compilable_effects(robot, seed, found) if family == "repeated" else ["default"]
    compare_models(robot, effects, states, case, found)
    state = states[0][0], states[1][0], states[2][0]
    compare_oracle(robot, state, case, found)
    compare_closing(robot, state, case, found)
    compare_map(robot, state[0], seed, case, found)
    if seed // len(BASES) % STEP_OF == 0:
        compare_steps(robot, state[0], seed, case, found)
    for number, (model, coordinates) in enumerate(DERIVED):
        if family == "any" or seed % (2 * len(DERIVED)) == 2 * number + 1:
            compare_derivatives(robot, without_load_friction(effects), model, coordinates, case, found)


def compilable_effects(robot: hybridyn.HybridRobot, seed: int, found: Found) -> list[Any]:
    """Draw effects, without friction by load where it cannot be compiled."""
    effects = drawn_effects(robot, seed)
    try:
        asked = request(robot, effects)
        for k in range(len(robot.modules)):
            inverse_options(asked, k)
    except hybridyn.HybridynError:
        found.count["refused effects"] += 1
        return without_load_friction(effects)
    return effects


def without_load_friction(effects: list[Any]) -> list[Any]:
    """Return effects of which derivatives are compiled, too."""
    return [one for one in effects if not isinstance(one, LoadFriction)]


def compare_models(
    robot: hybridyn.HybridRobot, effects: list[Any], states: tuple[np.ndarray, ...], case: str, found: Found
) -> None:
    """Compare both models at the states that they trust."""
    q, v, a, tau = states
    for name, program in programs(robot, effects, models=("idm", "ddm")).items():
        function, third = function_of(program), a if name == "idm" else tau
        more = [np.zeros((len(q), 6))] if name == "ddm" and robot.base == "moving" else []
        for row in zip(q, v, third, *more, strict=True):
            result, guard = function(*row)
            if not float(guard) <= GUARD_LIMIT:
                found.count["not trusted"] += 1
                continue
            wanted = getattr(hybridyn, name)(robot, *row[:3], effects=effects)
            found.compare(name, case, result.full(), wanted, AGREE)


def compare_derivatives(
    robot: hybridyn.HybridRobot, effects: list[Any], model: str, coordinates: str, case: str, found: Found
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
        derive = evaluation.Derivatives(robot, model, effects, coordinates=coordinates)
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


def compare_closing(
    robot: hybridyn.HybridRobot, state: tuple[np.ndarray, ...], case: str, found: Found
) -> None:
    """Compare the program that closes the loops with the oracle: at a closed posture, and from one nearby.

    Rods may have turned about themselves; positions, rates and accelerations must hold the loops' rows.
    """
    q, v, a = state
    program = programs(robot, models=("close",))["close"]
    function, manifold, read = function_of(program), Manifold(robot), rates_read(program)
    xi = AWAY * manifold.unit * np.random.default_rng(3).choice([-1.0, 1.0], size=robot.nv)
    near = manifold.retraction.move(q, np.where(read > 0, 0.0, xi))
    for start, calls in ((q, 1), (near, CALLS)):
        for _ in range(calls):
            start, rates, change, guard = (x.full().ravel() for x in function(start, v, a))
        if not guard[0] <= GUARD_LIMIT:
            if calls > 1:
                found.wrong.append(f"{case}: the loops do not close")
            found.count["closing not trusted"] += 1
            return
        compare_closed(robot, (start, rates, change), case, found)
        held = read[robot.motor_v] > 0
        for x, y in ((rates, v), (change, a)):
            off = np.abs(x - y)[robot.motor_v[held]].max(initial=0.0)
            found.add("motors", case, off, SOLVED * np.abs(y).max())


def compare_closed(
    robot: hybridyn.HybridRobot, state: tuple[np.ndarray, ...], case: str, found: Found
) -> None:
    """Compare positions, rates and accelerations with the oracle's rows of the loops."""
    oracle, (q, v, a) = Oracle(robot.description, robot.base), state
    found.add("close", case, np.abs(oracle.residual(q)).max(initial=0.0), CLOSED)
    right = oracle.project_velocity(q, v), oracle.consistent_acceleration(q, v, a)
    for power, name, x, y in zip((1, 2), ("rates", "accelerations"), (v, a), right, strict=True):
        sizes = (
            np.abs(y / oracle.unit),
            np.abs(v / oracle.unit) ** power,
        )  # a locked module has none of its own
        size = max(float(x.max(initial=1e-300)) for x in sizes)
        found.add(name, case, np.abs((x - y) / oracle.unit).max(initial=0.0) / size, SOLVED)


def compare_oracle(
    robot: hybridyn.HybridRobot, state: tuple[np.ndarray, ...], case: str, found: Found
) -> None:
    """Compare efforts of the general path with the oracle's."""
    try:
        tau = hybridyn.idm(robot, *state)
    except hybridyn.HybridynError:
        found.count["refused efforts"] += 1
        return
    wanted = Oracle(robot.description, robot.base).idm(*state)
    found.compare("oracle", case, tau, wanted, SOLVED)


def compare_map(robot: hybridyn.HybridRobot, q: np.ndarray, seed: int, case: str, found: Found) -> None:
    """Compare the map between motors and as many other joints of the modules."""
    rng, joints = np.random.default_rng(seed), list[str]()
    for module in robot.modules[robot.base == "floating" :]:
        others = [x for x in module.joints if x not in module.motors and robot.records[x].kind.single]
        if len(module.motors) == module.mobility <= len(others) and module.mechanism.spec.closures:
            joints += [str(x) for x in rng.choice(others, size=module.mobility, replace=False)]
    if not joints:
        return
    try:
        written = map_programs(request(robot, None), joints)
        right = hybridyn.joint_map(robot, q, joints)
    except hybridyn.HybridynError:
        found.count["refused maps"] += 1
        return
    for side, matrix in zip(
        ("motor", "joint"), (right.joints_per_motors, right.motors_per_joints), strict=True
    ):
        position = getattr(right, f"{side}_positions")
        program = next(x for x in written if x.inputs[1][0] == f"{side}_position")
        *results, guard = function_of(program)(q, position, *np.zeros((2, len(joints))))
        if float(guard) <= GUARD_LIMIT:
            found.compare("joint map", case, results[-1].full(), matrix, SOLVED)


def main(count: int, first: int, family: str = "any") -> Found:
    """Compare mechanisms, and print what is wrong and, from time to time, how far it is."""
    found = Found()
    for seed in range(first, first + count):
        before = len(found.wrong)
        try:
            compare(seed, found, family)
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

    os.environ["CC"] = "none"
    logging.disable(logging.CRITICAL)
    sys.exit(bool(main(int(sys.argv[1]), int(sys.argv[2]), *sys.argv[3:]).wrong))
