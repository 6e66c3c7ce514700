"""Postures that make a value least, of all that meet the targets: judged by other means, and their rates."""

import itertools
import re
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize, minimize_scalar

import hybridyn
from hybridyn import AssemblyError, HybridRobot, TrajectoryError, closure_residual
from hybridyn.cli import main
from hybridyn.spatial import Array
from hybridyn.structure.building import build_robot
from tests.assembly.test_angles import arm
from tests.oracle import Oracle
from tests.robots.posing import far_apart, of_link
from tests.robots.shipped import shipped
from tests.support.comparing import close_to, refused
from tests.support.samples import slow

REACHED = 1e-10  # of positions, relative to the largest
SAME = 1e-10  # from other starts: slopes are known to 1e-13 of the value, and curvatures are not far from 1
LEVEL = 1e-9  # of slopes along open motions [1/rad, 1/module length]: order six at steps of 1e-2
SEARCHED = 1e-5  # SciPy's accuracy: the root of what it resolves of the value
STEP = 2e-3  # of time in central differences of order six [s]
DIFFERENCED = 1e-8  # relative, of rates: truncation (STEP / 0.1 s)^6 / 140, rounding 1e-13 / STEP
TWICE = 1e-7  # the same of accelerations, which are third derivatives of the value at steps of 1e-2
MIDDLE, AWAY = "middle of ranges", "away from singular"
DIRECTED = 10.0  # how much less exact differences of logarithms of singular values are
LIMITS = ((-1.0, 2.0), (-2.4, 2.0), (-1.5, 2.5), (-3.0, 1.0))


def limited(folder: Path, axes: str = "yyyy") -> HybridRobot:
    """Return the arm of `arm`, bent at home, with ranges whose middles differ."""
    home = "".join(f"j{i} = {0.4 + 0.1 * i}\n" for i in range(len(axes)))
    (folder / "arm.model.toml").write_text(f"[home]\n{home}")
    arm(folder, axes)
    path, ranges = folder / "arm.urdf", itertools.cycle(LIMITS)
    text = re.sub(
        'lower="[^"]*" upper="[^"]*"',
        lambda _: 'lower="{}" upper="{}"'.format(*next(ranges)),
        path.read_text(),
    )
    path.write_text(text)
    return hybridyn.load(path)


def ways(robot: HybridRobot, x: Array) -> Array:
    """Return how far motors are from the middle of their ranges, over half of these, shape (..., motors)."""
    lower, upper = (
        np.array([getattr(robot.records[m], k) for m in robot.motors]) for k in ("lower", "upper")
    )
    return (x - (lower + upper) / 2) / ((upper - lower) / 2)


def tool(robot: HybridRobot) -> tuple[str, Array]:
    """Return the last output of a robot and its pose at home."""
    still, link = np.zeros((1, robot.nv)), robot.modules[-1].outputs[0]
    return link, of_link(robot, robot.home[None], still, still, link, robot.description.root)[0][0]


def differences(x: Array) -> Array:
    """Return the derivatives at the middle row of seven."""
    return (45 * (x[4] - x[2]) - 9 * (x[5] - x[1]) + x[6] - x[0]) / (60 * STEP)


def check_derivatives(robot: HybridRobot, q: Array, v: Array, a: Array, rule: str) -> None:
    """Compare rates with differences of positions, and accelerations with those of rates, of seven rows."""
    more = DIRECTED if rule == AWAY else 1.0
    close_to(differences(q)[robot.motor_q], v[3][robot.motor_v], more * DIFFERENCED)
    close_to(differences(v), a[3], more * TWICE)


# ---------------------------------------------------------------- the value


@pytest.mark.parametrize(("rule", "weights"), [(MIDDLE, {}), (MIDDLE, {"j1": 3.0}), (AWAY, {})])
def test_a_planar_arm_has_the_best_of_its_free_angle(
    tmp_path: Path, rule: str, weights: dict[str, float]
) -> None:
    """Of three joints in a plane, the first is free; the elbow follows from the law of cosines."""
    robot = limited(tmp_path)
    x, z = 0.9, 0.35
    factors = np.array([weights.get(m, 1.0) for m in robot.motors])

    def joints(first: float, sign: float) -> Array:
        x1, z1 = x - 0.5 * np.cos(first), z + 0.5 * np.sin(first)
        elbow = sign * np.arccos(min((x1 * x1 + z1 * z1 - 0.5) / 0.5, 1.0))  # where it cannot reach, straight
        forearm = np.arctan2(-z1, x1) - np.arctan2(np.sin(elbow), 1.0 + np.cos(elbow))
        return np.array([first, forearm - first, elbow, -1.0])  # the last joint is in the middle

    def value(first: float, sign: float) -> float:
        off = np.hypot(x - 0.5 * np.cos(first), z + 0.5 * np.sin(first)) > 1.0
        found = joints(first, sign)
        way = factors * ways(robot, found)
        if off or rule == MIDDLE:
            return 1e9 if off else float(np.sum(way**2))
        angles = np.cumsum(found[:3])
        links = 0.5 * np.stack([-np.sin(angles), -np.cos(angles)])
        J = np.cumsum(links[:, ::-1], axis=1)[:, ::-1]
        return float(np.sum(way**2) - 0.5 * np.log(np.linalg.det(J @ J.T)))

    grid = [(first, sign) for first in np.linspace(-2.0, 2.0, 401) for sign in (1.0, -1.0)]
    best, sign = min(grid, key=lambda one: value(*one))
    near = (best - 0.01, best + 0.01)
    found = minimize_scalar(value, bounds=near, args=(sign,), method="bounded", options={"xatol": 1e-12})
    start = joints(best - 0.2, sign) + np.array([0.0, 0.0, 0.0, 0.3])
    given = partial(hybridyn.assemble, robot, platforms={"l3": ({"x": x, "z": z},)}, weights=weights)
    close_to(given(guess=start, redundancy=rule)[0], joints(found.x, sign), SEARCHED)


def test_a_five_bar_is_away_from_both_kinds_of_singular_postures() -> None:
    """Its tool keeps x; SciPy searches among positions of one motor, by the oracle's motions."""
    robot, link = build_robot(shipped("five_bar")), "m1_tool"
    oracle, x = Oracle(robot.description), 0.03

    def value(q: Array) -> float:
        Z = np.linalg.qr(oracle.motions(q))[0]
        many, zero = np.tile(q, (2, 1)), np.zeros((2, robot.nv))
        row = of_link(robot, many, Z.T, zero, link, robot.description.root)[1][:, 0]
        share = abs(np.linalg.det(Z[robot.motor_v]))
        return float(np.sum(ways(robot, q[robot.motor_q]) ** 2) - np.log(np.linalg.norm(row) * share))

    given = partial(hybridyn.assemble, robot, platforms={link: ({"x": x},)})
    q = given(redundancy=AWAY)[0]
    first, at = robot.motors[0], q[robot.motor_q][0]
    found = minimize_scalar(
        lambda a: value(given(motors={first: a}, guess=q)[0]), bounds=(at - 0.1, at + 0.15), method="bounded",
        options={"xatol": 1e-12},
    )  # fmt: skip
    assert abs(found.x - at) < SEARCHED
    assert value(q) < value(given()[0]) - 0.01  # the least motion is not as far


@pytest.mark.parametrize("name", ["stewart_ur5", slow("lx4")])
def test_no_open_motion_lowers_the_value(name: str) -> None:
    """Motions are those of the oracle."""
    robot = build_robot(shipped(name))
    link, pose = tool(robot)
    pose[:3] += [0.05, -0.03, -0.04]
    q, _, _ = hybridyn.assemble(robot, platforms={link: pose}, redundancy=MIDDLE)
    assert closure_residual(robot, q) < REACHED
    still = np.zeros((1, robot.nv))
    close_to(of_link(robot, q[None], still, still, link, robot.description.root)[0][0], pose, REACHED)
    Z = Oracle(robot.description).motions(q)
    many, zero = np.tile(q, (Z.shape[1], 1)), np.zeros_like(Z.T)
    J = of_link(robot, many, Z.T, zero, link, robot.description.root)[1].T
    kept = Z @ np.linalg.svd(J)[2][6:].T
    half = np.array([(robot.records[m].upper - robot.records[m].lower) / 2 for m in robot.motors])
    x = q[robot.motor_q]
    slope = 2 * (ways(robot, x) / half) @ kept[robot.motor_v]
    assert np.abs(slope / np.abs(kept).max(axis=0)).max() < LEVEL


@pytest.mark.slow
@pytest.mark.parametrize("name", ["stewart_ur5", "lx4"])
def test_no_search_lowers_the_value(name: str) -> None:
    """SciPy searches among positions of all motors, from which each module is assembled by itself."""
    robot = build_robot(shipped(name))
    link, pose = tool(robot)
    pose[:3] += [0.05, -0.03, -0.04]
    q, _, _ = hybridyn.assemble(robot, platforms={link: pose}, redundancy=MIDDLE)
    x = q[robot.motor_q]
    half = np.array([(robot.records[m].upper - robot.records[m].lower) / 2 for m in robot.motors])
    middle = x - half * ways(robot, x)

    def reached(u: Array) -> Array:
        rows = hybridyn.assemble(robot, motors=np.atleast_2d(middle + half * u), guess=q)[0]
        zero = np.zeros((len(rows), robot.nv))
        found = of_link(robot, rows, zero, zero, link, robot.description.root)[0]
        return np.squeeze(np.where(found[:, 3:] @ pose[3:, None] < 0, -1, 1) * found - pose)[..., :6]

    def slopes(u: Array) -> Array:
        eye = 1e-6 * np.eye(len(u))
        return (reached(u + eye) - reached(u - eye)).T / 2e-6

    start = ways(robot, x) + 1e-2 * np.sin(np.arange(len(x)))
    # Where the rotation is near its own, three parts of a quaternion determine it.
    targets = {"type": "eq", "fun": reached, "jac": slopes}
    found = minimize(
        lambda u: u @ u, start, jac=lambda u: 2 * u, method="SLSQP", constraints=targets, tol=1e-14
    )
    close_to(found.x, ways(robot, x), SEARCHED)


# -------------------------------------------------------------- derivatives


@pytest.mark.parametrize(
    ("name", "rule"),
    [("stewart_ur5", MIDDLE), ("scara_delta", AWAY)]
    + [
        slow(*one) for one in (("lx4", MIDDLE), ("lx4", AWAY), ("scara_delta", MIDDLE), ("stewart_ur5", AWAY))
    ],
)
def test_rates_and_accelerations_are_derivatives_of_the_least_postures(name: str, rule: str) -> None:
    robot = build_robot(shipped(name))
    link, home = tool(robot)
    t = 0.7 + STEP * np.arange(-3, 4)
    pose, zero = np.repeat(home[None], len(t), axis=0), np.zeros_like(t)
    pose[:, 0] += 0.04 * np.sin(3 * t)
    pose[:, 2] -= 0.02 * t * t
    twist = np.stack([0.12 * np.cos(3 * t), zero, -0.04 * t, zero, zero, zero], axis=1)
    change = np.stack([-0.36 * np.sin(3 * t), zero, zero - 0.04, zero, zero, zero], axis=1)
    q, v, a = hybridyn.assemble(robot, platforms={link: (pose, twist, change)}, redundancy=rule)
    check_derivatives(robot, q, v, a, rule)
    last = hybridyn.assemble(robot, platforms={link: pose[-1]}, redundancy=rule)[0]
    assert far_apart(robot, last[None], q[-1:]) < SAME  # a function of the target


def waves(base: float, size: float, speed: float) -> Callable[[Array], tuple[Array, Array, Array]]:
    """Return a function of time with its derivatives."""
    return lambda t: (
        base + size * np.sin(speed * t),
        size * speed * np.cos(speed * t),
        -size * speed**2 * np.sin(speed * t),
    )


@pytest.mark.parametrize(
    ("axes", "link", "names", "held"),
    [
        ("yyyy", "l3", {"distance": 1.1, "cx": 0.1, "cy": 0.02, "cz": -0.2}, ()),
        ("yyyy", "l3", {"x": 1.1, "pitch": 1.9}, ()),
        ("zyxzy", "l4", {"xx": 0.9, "xy": 0.3, "xz": -0.4}, ()),
        ("zyxzyx", "l5", {"x": 1.6, "y": 0.5, "z": -0.7}, ("j1",)),
        ("zyxzyx", "l5@l1", {"x": 1.3, "z": -0.4}, ("j0", "j1")),
    ],
)
def test_all_kinds_of_targets_have_derivatives(
    axes: str, link: str, names: dict[str, float], held: tuple[str, ...], tmp_path: Path
) -> None:
    """Distances from a point that moves, angles, directions; a joint between that moves as given."""
    robot = limited(tmp_path, axes)
    t = 0.3 + STEP * np.arange(-3, 4)
    moved = {name: waves(at, 0.05, 1.0 + i)(t) for i, (name, at) in enumerate(names.items())}
    levels = tuple({name: one[k] for name, one in moved.items()} for k in range(3))
    given = {name: waves(0.3, 0.1, 2.0)(t) for name in held}
    q, v, a = hybridyn.assemble(robot, motors=given, platforms={link: levels}, redundancy=MIDDLE)
    check_derivatives(robot, q, v, a, MIDDLE)


def test_long_steps_and_other_starts_end_in_the_same_postures(tmp_path: Path) -> None:
    robot = limited(tmp_path)
    s = np.linspace(0.0, 0.3, 7)
    path = {"x": 1.2 - 0.2 * s, "z": 0.2 * s}
    fine = hybridyn.assemble(robot, platforms={"l3": (path,)}, redundancy=MIDDLE)[0]
    coarse = {"l3": ({name: x[::3] for name, x in path.items()},)}
    q = hybridyn.assemble(robot, platforms=coarse, redundancy=MIDDLE)[0]
    assert far_apart(robot, q, fine[::3]) < SAME
    q = hybridyn.assemble(robot, platforms={"l3": (path,)}, guess=fine[2], redundancy=MIDDLE)[0]
    assert far_apart(robot, q, fine) < SAME


def test_held_joints_stay_where_the_guess_has_them(tmp_path: Path) -> None:
    robot = limited(tmp_path)
    start, way = robot.home, {"l3": ({"x": 1.1, "z": np.linspace(-0.9, -0.85, 2)},)}
    held = partial(hybridyn.assemble, robot, platforms=way, guess=start, redundancy=MIDDLE)
    close_to(held(hold=["j1"]), held(motors={"j1": float(start[1])}), REACHED)


def test_tables_follow_the_rule(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Rates in the table are those of the poses, so that the efforts are those of `idm`."""
    robot, t = limited(tmp_path), np.linspace(0.0, 0.1, 2)
    x, z = waves(1.0, 0.05, 1.0)(t), waves(-0.6, 0.05, 2.0)(t)
    names = [f"l3/{level}/{axis}" for axis in "xz" for level in ("pose", "velocity", "acceleration")]
    rows, (table, out) = np.column_stack([t, *x, *z]), (tmp_path / "t.csv", tmp_path / "tau.csv")
    np.savetxt(table, rows, "%.17g", ",", header=",".join(["time", *names]), comments="")
    given = ["idm", str(tmp_path / "arm.urdf"), str(table), "-o", str(out), "--redundancy"]
    assert main([*given, MIDDLE]) == 0
    assert "as near to the middle of their ranges as the targets allow" in capsys.readouterr().err
    levels = tuple({"x": one, "z": other} for one, other in zip(x, z, strict=True))
    states = hybridyn.assemble(robot, platforms={"l3": levels}, redundancy=MIDDLE)
    found = np.loadtxt(out, delimiter=",", skiprows=1)
    close_to(found[:, 1:], hybridyn.idm(robot, *states), REACHED)
    assert main([*given, "middle of range"]) == 1
    assert "unknown redundancy 'middle of range' (did you mean" in capsys.readouterr().err


# -------------------------------------------------------------------- wrong


@pytest.mark.parametrize(
    ("redundancy", "error", "words"),
    [
        ("middle of range", TrajectoryError, "unknown redundancy .* .did you mean 'middle of ranges'"),
        ("best", TrajectoryError, "unknown redundancy 'best'"),
    ],
)  # fmt: skip
def test_names_of_rules_are_checked(
    redundancy: str, error: type[Exception], words: str, tmp_path: Path
) -> None:
    given = partial(hybridyn.assemble, arm(tmp_path, "yyyy"), platforms={"l3": ({"x": 1.0},)})
    refused(partial(given, redundancy=redundancy), error, words)


def test_motors_without_a_range_have_no_middle(tmp_path: Path) -> None:
    robot = limited(tmp_path)
    path = tmp_path / "arm.urdf"
    endless = re.sub('"revolute"(>.{,150})lower="-2.4" upper="2.0" ', r'"continuous"\1', path.read_text())
    path.write_text(endless)
    robot = hybridyn.load(path)
    given = partial(hybridyn.assemble, robot, platforms={"l3": ({"x": 1.0, "z": -0.6},)}, redundancy=MIDDLE)
    refused(given, AssemblyError, "motors without a range: 'j1'; give them limits in the file, or hold them")
    assert len(given(hold=["j1"])) == 3


@pytest.mark.slow  # steps become as short as they may
def test_a_least_posture_that_ends_is_told(tmp_path: Path) -> None:
    """The value of the planar arm has two least ones at x = 0.96; one of them is gone at 0.95."""
    robot, s = limited(tmp_path), np.linspace(0.0, 1.0, 41)
    far = {"l3": ({"x": 1.2 - 0.5 * s, "z": 0.6 * s},)}
    given = partial(hybridyn.assemble, robot, platforms=far, redundancy=MIDDLE)
    refused(
        given, AssemblyError, "no continuous motion leads to a least posture at sample 20 from", sample=20
    )


def test_joints_without_a_motor_have_no_rule(tmp_path: Path) -> None:
    limited(tmp_path)
    robot = hybridyn.load(tmp_path / "arm.urdf", motors=["j0", "j2", "j3"])
    given = partial(hybridyn.assemble, robot, platforms={"l3": ({"x": 1.0, "z": 0.2},)}, redundancy=MIDDLE)
    refused(
        given, AssemblyError, "no motor drives some motions of module 'l1'; give them, or take 'least motion'"
    )


@pytest.mark.slow
def test_compiled_models_leave_the_rule_to_the_general_path(tmp_path: Path) -> None:
    robot = limited(tmp_path)
    compiled, s = hybridyn.compile(robot), np.linspace(0.0, 0.1, 20)
    given = {"platforms": {"l3": ({"x": 1.1 - s, "z": s},)}, "redundancy": MIDDLE}
    for one, other in zip(compiled.assemble(**given), hybridyn.assemble(robot, **given), strict=True):
        np.testing.assert_array_equal(one, other)
    assert compiled.recomputed == len(s)


@pytest.mark.slow
def test_designs_follow_the_rule(tmp_path: Path) -> None:
    """The general path computes them, each with its own robot."""
    robot, s = limited(tmp_path), np.linspace(0.0, 0.1, 5)
    compiled, given = hybridyn.compile(robot, parameters=["mass:l1"]), {"l3": ({"x": 1.1 - s, "z": s},)}
    found = compiled.designs([[1.0], [1.5]], platforms=given, redundancy=MIDDLE)
    q = hybridyn.assemble(robot, platforms=given, redundancy=MIDDLE)[0]
    assert not found.errors
    for one in found.q:
        close_to(one, q, SAME)
