"""Loops closed in C row after row: the results, the errors and the warnings of the general path."""

from collections.abc import Callable
from functools import partial
from threading import Thread
from typing import Any

import casadi as ca
import numpy as np
import pytest

import hybridyn
from hybridyn.assembly.requests import Requests, first_guess, gather_requests
from hybridyn.compiled.equations.expressions import Folding, pack, unpack
from hybridyn.compiled.programs.closing import assembling, libraries
from hybridyn.compiled.programs.closing.assembling import Assembler
from hybridyn.compiled.programs.closing.extended import extended
from hybridyn.compiled.programs.closing.given import Given, GivenCoordinates
from hybridyn.compiled.programs.closing.rows import rows_at
from hybridyn.compiled.programs.closing.unknowns import Unknowns
from hybridyn.linkage import targets
from hybridyn.linkage.targets import CoordinateTarget
from hybridyn.logs import warn
from hybridyn.spatial import Array
from hybridyn.structure.building import build_robot
from tests.assembly.test_assembly import base_pose, stretched, waves
from tests.dynamics.test_idm import symmetric_five_bar
from tests.oracle import Base
from tests.robots.mechanisms import KINDS, random_mechanism, random_states
from tests.robots.posing import COORDINATES, of_joints, of_link, position, swaying
from tests.support.comparing import close_to, refused, same_words
from tests.support.samples import slow

SAME = 1e-12  # of the largest entry: rounding
SAME_AT_RANDOM = 1e-10  # the same, through the condition of a random mechanism
ROUNDED = (
    1e-15  # a few roundings: positions carry them times the condition, rates squared, accelerations cubed
)
CLOSED = 1e-12  # of the module's size

States = tuple[Array, Array, Array]


def in_c(assembler: Assembler, motors: Any = None, platforms: Any = None, guess: Any = None) -> States:
    """Assemble as `CompiledRobot.assemble` does, without models of the dynamics."""
    requests = gather_requests(assembler.robot, motors or {}, platforms or {})
    return assembler.assemble(requests, first_guess(assembler.robot, guess))


def compare(assembler: Assembler, within: float = SAME, **wanted: Any) -> States:
    """Assemble both ways and check that results are the same to `within`."""
    got = in_c(assembler, **wanted)
    right = hybridyn.assemble(assembler.robot, **wanted)
    close_to(got, right, within, 1.0)
    return got


def of_platforms(robot: hybridyn.HybridRobot, below: bool) -> tuple[States, Any]:
    """Return states and the poses of all platforms in them, as seen from the root or from the one below."""
    states = hybridyn.assemble(robot, motors=waves(robot, np.linspace(0, 0.5, 12), 0.03))
    root, links = robot.description.root, [module.outputs[0] for module in robot.modules]
    others = [root, *links] if below else [root] * len(links)
    pairs = zip(links, others, strict=False)
    return states, {f"{link}@{other}": of_link(robot, *states, link, other) for link, other in pairs}


def arm_and_platform(robot: hybridyn.HybridRobot) -> dict[str, Any]:
    """Return the pose of the first platform, and the motors of what stands on it."""
    states, poses = of_platforms(robot, False)
    arm = [motor for module in robot.modules[1:] for motor in module.motors]
    return {"motors": of_joints(robot, *states, arm), "platforms": dict([next(iter(poses.items()))])}


def some_coordinates(robot: hybridyn.HybridRobot) -> dict[str, Any]:
    """Return some coordinates of a platform; the rest of its pose follows, other modules have motors."""
    phase = np.linspace(0, 2 * np.pi, 40)
    rest = [motor for module in robot.modules[1:] for motor in module.motors]
    every = waves(robot, phase, 0.02)
    return {"motors": {motor: every[motor] for motor in rest}, "platforms": swaying(robot, phase)}


#: What is asked of a robot; larger waves lead tanev to a singularity.
ASKED: dict[str, Callable[[hybridyn.HybridRobot], dict[str, Any]]] = {
    "motors": lambda r: {"motors": waves(r, np.linspace(0, 1, 60), 0.02 if r.name == "tanev" else 0.04)},
    "relative poses": lambda r: {"platforms": of_platforms(r, True)[1]},
    "absolute poses": lambda r: {"platforms": of_platforms(r, False)[1]},
    "some coordinates": some_coordinates,
    "a pose and motors": arm_and_platform,
}
LATER = [
    *(("motors", name) for name in ("gough_stewart", "lx4", "rps3", "delta", "tanev", "stewart_ur5")),
    *((f"{x} poses", name) for x in ("relative", "absolute") for name in ("rps3", "gough_stewart", "lx4")),
    *(("some coordinates", name) for name in COORDINATES), ("a pose and motors", "stewart_ur5"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("what", "name"), [("motors", "five_bar"), ("relative poses", "rps3"), *(slow(*pair) for pair in LATER)]
)
def test_rows_are_those_of_the_general_path(what: str, name: str) -> None:
    robot = hybridyn.load(name)
    assembler = Assembler(robot)
    compare(assembler, **ASKED[what](robot))
    assert assembler.recomputed == 0


def test_rows_of_coordinates_are_those_of_the_general_path() -> None:
    """Residual and matrix of all six coordinates of the five-bar's tool, at any posture."""
    robot = hybridyn.load("five_bar")
    module, link = robot.modules[0], "m1_tool"
    tree, rng = module.mechanism.tree, np.random.default_rng(0)
    (body, *shift), (_, R, p) = robot.bodies.place[link], robot.bodies.place[module.base]
    number, zero = module.mechanism.cut.tree_body(robot.body_owner[body][1]), np.zeros((1, 6))
    place, units = (shift[0], shift[1]), np.array([module.mechanism.length] * 3 + [1.0] * 3)
    target = CoordinateTarget(
        number, (link, module.base), targets.COORDINATES, R, p, place, zero, zero, zero, units
    )
    given = Given((), (), (), (GivenCoordinates.of(target),))
    loops = Unknowns([module], given, (), (robot.bodies.place,) * 2).loops
    x = ca.SX.sym("x", tree.nq + 6)
    folding = Folding()
    trees, own = [extended(module.mechanism)], unpack(x)
    rows = rows_at(trees, given, folding, own[: tree.nq], own[tree.nq :], robot.bodies.place)
    last = slice(loops - 6, loops)
    written = ca.Function("rows", [x, folding.symbol()], [pack(rows.K[last]), pack(rows.residual[last])])
    for posture in rng.uniform(-1.0, 1.0, (5, tree.nq)):
        motion, wanted = tree.sweep(posture[None]), rng.uniform(-3.0, 3.0, 6)
        K, off = written(np.concatenate([posture, wanted]), folding.table(1)[0].astype(float))
        first = np.zeros(1, dtype=int)
        right = target._replace(value=wanted[None]).residual(motion, first)
        assert np.abs(np.array(off).ravel() - right).max() <= SAME
        assert np.abs(np.array(K).reshape(6, tree.nv) - target.matrix(tree, motion)).max() <= SAME


def test_rows_far_apart_stay_on_the_branch() -> None:
    """Steps that no prediction covers are divided into smaller ones."""
    robot = hybridyn.load("five_bar")
    motors = waves(robot, np.linspace(0, 6, 241), 0.5)
    whole = compare(Assembler(robot), motors=motors)
    coarse = Assembler(robot)
    far = {m: tuple(x[::10] for x in values) for m, values in motors.items()}
    close_to(compare(coarse, motors=far), tuple(x[::10] for x in whole), SAME, 1.0)
    assert coarse.recomputed == 0


# -------------------------------------------------------------------- branches, reach, singularities


def rows_towards(
    robot: hybridyn.HybridRobot, first: float, last: float, parts: list[float]
) -> dict[str, Array]:
    """Return cranks on their way from one distance of the elbows to another, relative to stretched rods."""
    near, there = stretched(robot, first), stretched(robot, last)
    return {m: near[m] + np.array(parts) * (there[m] - near[m]) for m in near}


@pytest.mark.parametrize(
    "rows",
    [
        ([-0.2, 0.1], [0.0, 0.1, 1.0, 0.0]),  # out of reach, and back
        ([-0.02, 0.02], [0.0, 0.25, 2.0]),  # past the end of a branch
        ([1e-2, 2e-2], [0.0, 1.0]),  # never in reach
        ([-0.2, -0.19], [0.0, *np.linspace(0, 1, 30), 30.0]),  # after many rows in reach
    ],
)
def test_rows_that_cannot_be_reached_are_refused_in_the_same_words(rows: Any) -> None:
    robot = build_robot(symmetric_five_bar())
    (first, last), parts = rows
    motors = rows_towards(robot, first, last, parts)
    same_words(lambda: in_c(Assembler(robot), motors=motors), lambda: hybridyn.assemble(robot, motors=motors))


def test_rows_near_a_singularity_are_the_general_paths() -> None:
    """Rods nearly stretched: the rows before and after are computed in C."""
    robot = build_robot(symmetric_five_bar())
    way = 1.0 - np.abs(np.linspace(-1, 1, 81)) ** 3
    assembler = Assembler(robot)
    q, _, _ = compare(assembler, 1e-6, motors=rows_towards(robot, -0.2, -1e-5, list(way)))
    assert 0 < assembler.recomputed < 100
    assert hybridyn.closure_residual(robot, q).max() <= CLOSED


def test_what_leaves_freedoms_open_is_refused_in_the_same_words() -> None:
    robot = build_robot(symmetric_five_bar())
    for motors in ({"left": 2.0}, {"left": np.nan, "right": 1.0}, {"left": 1e9, "right": 1.0}):
        ways = partial(in_c, Assembler(robot), motors), partial(hybridyn.assemble, robot, motors=motors)
        same_words(*ways)


def test_the_general_path_closes_loops_that_no_program_can(caplog: Any, monkeypatch: Any) -> None:
    """What goes wrong while a program is built or checked is said, and costs no result."""

    def fail(*_: object) -> None:
        raise ValueError("a wrong program")

    monkeypatch.setattr(libraries, "check_rows", fail)
    monkeypatch.setattr(libraries, "robot_key", lambda *_: "not built yet")
    robot = build_robot(symmetric_five_bar())
    assembler = Assembler(robot)
    for _ in range(2):
        compare(assembler, 0.0, motors=waves(robot, np.linspace(0, 0.1, 3), 0.04))
    assert assembler.recomputed == 6
    said = [record.message for record in caplog.records if "a wrong program" in record.message]
    assert len(said) == 1
    assert "the general path closes the loops" in said[0]


# -------------------------------------------------------------------- generated mechanisms

DEFAULT = {("gear_three", "fixed"), ("loop_planar", "floating")}


@pytest.mark.parametrize(
    ("kind", "base"),
    [
        (kind, base) if (kind, base) in DEFAULT else slow(kind, base)
        for kind in KINDS
        if KINDS[kind].motors != "few"
        for base in ("fixed", "moving", "floating")
    ],
)
def test_generated_mechanisms(kind: str, base: Base) -> None:
    """Gears, wrists, rods that spin, over-constrained loops, and bases that move."""
    description = random_mechanism(8, kind=kind)
    robot = build_robot(description, base=base)
    states = random_states(description, base, 8, 3)
    root = {} if base == "fixed" else {description.root: base_pose(robot, *states)}
    assembler = Assembler(robot)
    for count in (3, 1):
        some = tuple(x[:count] for x in states)
        poses = {name: tuple(x[:count] for x in pose) for name, pose in root.items()}
        wanted = {"motors": of_joints(robot, *some), "platforms": poses}
        try:
            hybridyn.assemble(robot, **wanted)
        except hybridyn.AssemblyError:  # states may lie on different branches
            same_words(partial(in_c, assembler, **wanted), partial(hybridyn.assemble, robot, **wanted))
        else:
            compare(assembler, max(SAME_AT_RANDOM, ROUNDED * condition_of(robot, some[0]) ** 3), **wanted)


def condition_of(robot: hybridyn.HybridRobot, q: Array) -> float:
    """Return the largest condition number of the rows that give the other freedoms from the motors'."""
    worst = 1.0
    for module in robot.modules:
        m = module.mechanism
        if m.closures.rows:
            x = m.cut.positions(q[:, module.q_index])
            K = m.reduction.scaled(m.closures.matrix(m.tree.sweep(x)))
            s = np.linalg.svd(np.delete(K, module.motor_columns, axis=2), compute_uv=False)
            if s.size:  # motors may leave no other freedom
                worst = max(worst, float((s[:, 0] / s[:, min(m.reduction.rank, s.shape[1]) - 1]).max()))
    return worst


# -------------------------------------------------------------------- the public call


def test_compiled_robots_assemble() -> None:
    robot = hybridyn.load("five_bar")
    compiled = hybridyn.compile(robot)
    motors = {m: (float(position(robot, m, robot.home)) + 0.1, 1.0) for m in robot.motors}
    states = compiled.assemble(motors=motors)
    close_to(states, hybridyn.assemble(robot, motors=motors), SAME, 1.0)
    close_to(compiled.idm(*states), hybridyn.idm(robot, *states), 1e-9)
    assert compiled.recomputed == 0
    short = partial(compiled.assemble, motors=motors, guess=np.zeros(3))
    refused(short, hybridyn.AssemblyError, "guess has 3 entries")


@pytest.fixture(scope="module")
def ticks() -> tuple[hybridyn.CompiledRobot, States]:
    """Return a compiled robot, and positions, rates and accelerations of its motors at every tick."""
    robot = hybridyn.load("five_bar")
    moved = waves(robot, np.linspace(0, 0.2, 40), 0.3)
    levels = [np.stack([moved[m][i] for m in robot.motors], axis=1) for i in range(3)]
    return hybridyn.compile(robot), (levels[0], levels[1], levels[2])


def test_a_controller_closes_the_loops_at_every_tick(ticks: Any) -> None:
    """Ticks one after the other give the rows of a table, and so does the whole table at once."""
    compiled, motors = ticks
    robot = compiled.robot
    right = hybridyn.assemble(
        robot, motors={m: tuple(x[:, i] for x in motors) for i, m in enumerate(robot.motors)}
    )
    rows, q = [], None
    for tick in zip(*motors, strict=True):
        rows.append(compiled.close(*tick, last=q))
        q = rows[-1][0]
    for got in (tuple(map(np.array, zip(*rows, strict=True))), compiled.close(*motors)):
        close_to(got, right, SAME, 1.0)
    assert compiled.recomputed == 0


def test_a_tick_from_any_other_posture_is_closed_too(ticks: Any) -> None:
    compiled, motors = ticks
    first = compiled.close(motors[0][0])[0]
    compiled.close(motors[0][10], last=first)
    again = compiled.close(motors[0][5], motors[1][5], last=first)
    right = compiled.close(motors[0][:6], motors[1][:6])
    assert np.abs(again[0] - right[0][5]).max() <= SAME * 10
    assert np.abs(again[1] - right[1][5]).max() <= SAME * 100


def closed_in_c(compiled: hybridyn.CompiledRobot, position: Array, last: Array) -> bool:
    """Return whether C alone closes a row from a posture that is not the last tick's."""
    robot, still = compiled.robot, np.zeros(len(position))
    out, at_once = np.empty(robot.nq + 2 * robot.nv), compiled._postures._close_at_once
    return at_once(last, position, still, still, out) == 0


def test_other_postures_that_close_the_loops_need_no_general_path(ticks: Any) -> None:
    compiled, motors = ticks
    robot = compiled.robot
    rows = compiled.close(motors[0])[0]
    assert closed_in_c(compiled, motors[0][20], rows[3].copy())
    assert closed_in_c(compiled, motors[0][0], robot.home)
    for some in (rows[3] + 1e-9, rows[3] * np.nan):  # open, and not a number
        assert not closed_in_c(compiled, motors[0][20], some)
    q = compiled.close(motors[0][20], last=rows[3] + 1e-9)[0]
    assert np.abs(q - rows[20]).max() <= SAME * 10


@pytest.mark.slow
@pytest.mark.parametrize("base", ["fixed", "moving", "floating"])
@pytest.mark.parametrize("kind", ["gough", "stack", "loop_planar"])
def test_rows_follow_from_any_closed_posture(kind: str, base: Base) -> None:
    """Postures with platforms anywhere, endless joints and bases: the rows of the general path."""
    description = random_mechanism(8, kind=kind)
    robot = build_robot(description, base=base)
    compiled, (q, _, _) = hybridyn.compile(robot), random_states(description, base, 8, 3)
    motors = [
        np.array([float(position(robot, m, x)) for m in robot.motors]) for x in (q[0], q[1], robot.home)
    ]
    compiled.close(motors[2])
    for start, to in ((q[0], motors[0]), (q[1], motors[1]), (q[0], motors[0] + 1e-3)):
        wanted = dict(zip(robot.motors, to, strict=True))
        ways = (
            partial(compiled.close, to, last=start),
            partial(hybridyn.assemble, robot, motors=wanted, guess=start),
        )
        try:
            right = ways[1]()
        except hybridyn.AssemblyError:
            same_words(*ways)
        else:
            close_to(ways[0](), right, SAME_AT_RANDOM, 1.0)


def test_a_tick_that_cannot_be_reached_is_refused(ticks: Any) -> None:
    compiled, motors = ticks
    q, _, _ = compiled.close(motors[0][0])
    for _ in range(2):
        far = partial(compiled.close, motors[0][0] + 1e5, last=q)
        refused(far, hybridyn.AssemblyError, "out of reach")
        q, _, _ = compiled.close(motors[0][1], last=q)
    shape = "position has shape .*as robot.motors"
    refused(lambda: compiled.close(np.zeros(3)), hybridyn.TrajectoryError, shape)
    refused(lambda: compiled.close(np.full(2, np.nan), last=q), hybridyn.TrajectoryError, "not finite")


def test_a_warning_of_some_rows_is_left_to_the_whole_table(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """It names a sample of the table; warnings of other threads are none of its business."""
    robot, asked = hybridyn.load("five_bar"), []
    assembler, right = Assembler(robot), assembling.assemble_requests
    motors = {name: np.linspace(0.0, 0.3, 20) for name in robot.motors}
    wanted = hybridyn.assemble(robot, motors=motors)

    def assembled(robot: hybridyn.HybridRobot, requests: Requests, guess: Array) -> States:
        """Assemble rows, and warn of them, here and in another thread."""
        asked.append(requests.samples)
        warn("here at %d rows", requests.samples)
        other = Thread(target=warn, args=["elsewhere"])
        other.start()
        other.join()
        return right(robot, requests, guess)

    in_c(assembler, motors=motors)
    monkeypatch.setattr(assembling, "assemble_requests", assembled)
    closing = assembler._libraries.asked(gather_requests(robot, motors, {}))
    assert closing is not None
    monkeypatch.setattr(closing[0].rows, "close", lambda *_, **__: np.zeros(1))
    close_to(in_c(assembler, motors=motors), wanted, SAME, 1.0)
    assert asked == [2 * assembling.AT_ONCE, 20]  # some rows, then the table
    assert [record.getMessage() for record in caplog.records] == ["elsewhere", "here at 20 rows", "elsewhere"]
