"""Workspaces of links that several modules move: an excavator against triangles, redundant stacks."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import label

import hybridyn
from hybridyn import HybridRobot
from hybridyn.assembly.redundancy import LEAST, MIDDLE
from hybridyn.spatial import Array
from hybridyn.studies.sweep.compiled_chunks import evaluate_chunk
from hybridyn.studies.sweep.designs import designs_of
from hybridyn.studies.sweep.evaluation import Chunk
from hybridyn.studies.sweep.reading import read_study
from hybridyn.studies.workspace.link_sweep import find_sweep
from hybridyn.studies.workspace.workspace import Workspace, workspace
from tests.oracle import Oracle
from tests.robots.excavator import (
    BOOM,
    BUCKET,
    COUPLER,
    HOME,
    LONG,
    MOTORS,
    ROCKER,
    STICK,
    TEETH,
    cylinders,
    teeth,
    text,
    turned,
)
from tests.robots.posing import of_link
from tests.support.command_line import call
from tests.support.comparing import close_to
from tests.support.files import save
from tests.support.samples import slow

EXACT = 1e-9
STEPPED = 1e-2  # of postures whose rule goes from pose to pose, on ways of other steps
BOUNDARY = 1e-6  # m, rad: nearer to an edge, rounding decides
DIFFERENCE = 1e-5  # rad: step of the central differences; their error is its square
DIFFERENCED = 1e-7  # relative
#: Nearer to where rocker and coupler fold [m], Newton need not arrive.
FOLDED = 1e-3
#: How far the rods of the fast case go from home [m].
STROKE = 0.1


def machine(folder: Path, stroke: float) -> HybridRobot:
    """Return the excavator whose rods go so far to either side of home."""
    limits = text().replace('lower="-1.5" upper="1.5"', f'lower="{-stroke}" upper="{stroke}"')
    return hybridyn.load(save(folder, limits, "excavator.urdf"))


def angles_of(pose: Array) -> Array | None:
    """Compute the angles of boom, stick and bucket from x, z, pitch of the teeth, the elbow up, or None."""
    pin = pose[:2] - turned(pose[2], TEETH)
    reach, first, second = np.hypot(*pin), BOOM[0], STICK[0]
    bend = (reach**2 - first**2 - second**2) / (2 * first * second)
    if abs(bend) >= 1:
        return None
    stick = np.arccos(bend)
    inner = np.arctan2(second * np.sin(stick), first + second * np.cos(stick))
    boom = np.arctan2(-pin[1], pin[0]) - inner
    boom = HOME[0] + (boom - HOME[0] + np.pi) % (2 * np.pi) - np.pi
    return np.array([boom, stick, pose[2] - boom - stick])


def margin(pose: Array, stroke: float) -> float:
    """Return how far a pose is inside the reach of rods and bucket linkage [m], negative outside."""
    angles = angles_of(pose)
    if angles is None:
        return -1.0
    apart = float(np.linalg.norm(STICK + turned(angles[2], BUCKET) - ROCKER))
    folded = min(apart - abs(LONG - COUPLER), LONG + COUPLER - apart)
    if folded < 0:
        return folded
    return min(folded, stroke - float(np.abs(cylinders(angles) - cylinders(HOME)).max()))


@pytest.mark.parametrize(("stroke", "step"), [(STROKE, (0.2, 0.2, 0.1)), slow(0.4, (0.2, 0.2, 0.2))])
def test_the_teeth_of_an_excavator_reach_what_its_cylinders_allow(
    stroke: float, step: tuple[float, float, float], tmp_path: Path
) -> None:
    """The poses of the lattice that paths within the limits of the rods lead to, and no other one."""
    robot = machine(tmp_path, stroke)
    found = workspace(robot, link="teeth", steps=dict(zip(("x", "z", "pitch"), step, strict=True)))
    assert (found.sweep.modules, found.sweep.names, found.spare) == ((0, 1, 2), ("x", "z", "pitch"), 0)
    close_to(found.start, teeth(HOME), EXACT)
    n = np.abs(found.index).max(axis=0) + 1
    inside = np.full(2 * n + 1, -np.inf)
    for at in np.ndindex(*inside.shape):
        away = (np.array(at) - n) * step
        if abs(away[2]) <= np.pi:  # the lattice ends half a turn from its origin
            inside[at] = margin(teeth(HOME) + away, stroke)
    assert np.abs(inside).min() > BOUNDARY
    parts = label(inside > 0)[0]
    reached = np.zeros(inside.shape, dtype=bool)
    reached[tuple((found.index + n).T)] = True
    within = parts == parts[tuple(n)]
    assert not (reached & ~within).any()
    assert inside[within & ~reached].max(initial=0.0) < FOLDED
    assert len(found.index) > 20
    assert set(found.blocked) - {"reach", "half a turn"} == set(MOTORS)  # each ends the region somewhere
    for number, name in enumerate(MOTORS):
        for _, to in found.rejected[name]:
            beyond = np.abs(cylinders(angles_of(teeth(HOME) + to * step)) - cylinders(HOME))
            assert beyond.argmax() == number
            assert beyond.max() > stroke
    edges = [found.ended(axis, side) for axis in found.sweep.axes for side in (-1, 1)]
    assert all(edge and set(edge) <= set(found.blocked) for edge in edges)
    for pose, *rods in zip(found.coordinates, *(found.motors[name] for name in MOTORS), strict=True):
        close_to(np.array(rods), cylinders(angles_of(pose)) - cylinders(HOME), EXACT, least=1.0)


def slopes(of: Callable[[Array], Array], at: Array) -> Array:
    """Compute derivatives of a function of three angles, shape (3, 3), by central differences."""
    steps = DIFFERENCE * np.eye(3)
    return np.stack([(of(at + step) - of(at - step)) / (2 * DIFFERENCE) for step in steps], axis=1)


def test_efforts_and_conditioning_go_from_the_motors_to_the_teeth(tmp_path: Path) -> None:
    robot = machine(tmp_path, STROKE)
    found = workspace(robot, link="teeth", steps={"x": 0.3, "z": 0.3, "pitch": 0.3})
    length = max(module.mechanism.length for module in robot.modules)
    for i, pose in enumerate(found.coordinates):
        angles = angles_of(pose)
        J = slopes(cylinders, angles) @ np.linalg.inv(slopes(teeth, angles))  # rods over the teeth
        scaled = J / length * np.array([length, length, 1.0])
        s = np.linalg.svd(scaled, compute_uv=False)
        assert found.measures["conditioning"][i] == pytest.approx(s[2] / s[0], rel=DIFFERENCED)
        efforts = np.linalg.inv(J.T)  # J^T tau = F
        wanted = np.linalg.norm(efforts[:, :2], axis=1).max()
        assert found.measures["effort_per_force"][i] == pytest.approx(wanted, rel=DIFFERENCED)
        assert found.measures["effort_per_torque"][i] == pytest.approx(
            np.abs(efforts[:, 2]).max(), rel=DIFFERENCED
        )
    rest = np.zeros((2, len(found.q), robot.nv))
    tau = hybridyn.idm(robot, found.q, *rest)
    for column, name in enumerate(robot.motors):
        close_to(found.measures[f"{name}/effort"], tau[:, column], EXACT)


def test_studies_measure_the_region_of_a_tool(tmp_path: Path) -> None:
    """Largest efforts, least conditioning, and reach are those of the poses that `workspace` finds."""
    robot, steps = machine(tmp_path, STROKE), {"x": 0.3, "z": 0.3, "pitch": 0.4}
    found, words = workspace(robot, link="teeth", steps=steps), ["poses", "size", "reach", "min_conditioning"]
    words += ["max_effort_per_force", "max_effort_per_torque"]
    task = (
        f"workspace = {{ link = 'teeth', steps = {{ x = 0.3, z = 0.3, pitch = 0.4 }} }}\nmeasure = {words}\n"
    )
    study = "[robot]\nfile = 'excavator.urdf'\n[designs]\nmethod = 'grid'\n[parameters]\n"
    study += f"mass = {{ scale_inertia = 'bucket', values = [1.0] }}\n[tasks.reach]\n{task}"
    source = read_study(save(tmp_path, study, "study.toml"))
    (row,) = evaluate_chunk(source, Chunk(0, designs_of(source)), None).rows
    m, far = found.measures, np.linalg.norm(found.coordinates[:, :2], axis=1).max()
    wanted = [len(found.index), len(found.index) * 0.3**2 * 0.4, far, m["conditioning"].min()]
    wanted += [m["effort_per_force"].max(), m["effort_per_torque"].max()]
    assert row.measures == pytest.approx(wanted, rel=EXACT)


def check_of_motions(robot: HybridRobot, found: Workspace) -> None:
    """Compare measures with the oracle's motions: R of the motors, T of the link; R^T tau = T^T F."""
    sweep, length = found.sweep, max(robot.modules[k].mechanism.length for k in found.sweep.modules)
    motors = [robot.motors.index(name) for k in sweep.modules for name in robot.modules[k].motors]
    kinds = [robot.kinds[robot.joint_index[robot.motors[i]]] for i in motors]
    units = np.array([length if kind == "prismatic" else 1.0 for kind in kinds])
    rows = [("x", "y", "z", "roll", "pitch", "yaw").index(name) for name in sweep.names]
    for i in (0, len(found.q) - 1):
        q = found.q[i]
        Z = Oracle(robot.description).motions(q)
        Z = Z @ np.linalg.pinv(Z[robot.motor_v])  # one motor each
        Z = Z[:, motors]
        still = np.zeros_like(Z.T)
        T = of_link(robot, np.tile(q, (len(motors), 1)), Z.T, still, sweep.link, sweep.base)[1].T
        holding = T.T  # tau = T^T F
        scaled = np.array([length] * 3 + [1.0] * 3)
        s = np.linalg.svd((T / scaled[:, None] * units)[rows], compute_uv=False)
        close_to(found.measures["conditioning"][i], s[len(rows) - 1] / s[0], EXACT)
        close_to(found.measures["effort_per_force"][i], np.linalg.norm(holding[:, :3], axis=1).max(), EXACT)
        close_to(found.measures["effort_per_torque"][i], np.linalg.norm(holding[:, 3:], axis=1).max(), EXACT)


@pytest.mark.parametrize(
    ("name", "names", "spare", "steps"),
    [
        ("scara_delta", "x y z yaw", 3, {"yaw": 1.0}),
        slow("stewart_ur5", "x y z roll pitch yaw", 6, {"x": 0.4, "y": 0.4}),
        slow("lx4", "x y z roll pitch yaw", 18, {"x": 0.2, "z": 0.2}),
    ],
)
def test_a_redundant_stack_moves_least_from_pose_to_pose(
    name: str, names: str, spare: int, steps: dict[str, float]
) -> None:
    robot = hybridyn.load(name)
    link = robot.modules[-1].outputs[0]
    found = workspace(robot, link=link, axes=list(steps), steps=steps)
    assert (" ".join(found.sweep.names), found.spare) == (names, spare)
    assert found.sweep.base == robot.description.root
    assert len(found.index) > 3
    assert hybridyn.closure_residual(robot, found.q).max() < EXACT
    rest = np.zeros((2, len(found.q), robot.nv))
    pose = of_link(robot, found.q, *rest, link, found.sweep.base)[0]
    columns = [found.sweep.names.index(axis) for axis in "xyz"]
    close_to(pose[:, :3], found.coordinates[:, columns], EXACT)
    assert np.ptp(found.q[:, robot.modules[0].q_index], axis=0).max() > 0  # the first module moves, too
    check_of_motions(robot, found)


def test_the_other_link_holds_the_modules_before_it() -> None:
    robot, steps = hybridyn.load("scara_delta"), {"z": 0.2}
    wanted = workspace(robot, 5, axes=["z"], steps=steps)
    found = workspace(robot, link="m1_platform@scara_flange", axes=["z"], steps=steps)
    assert (found.spare, found.blocked, found.sweep.modules) == (0, wanted.blocked, (4,))
    close_to(found.q, wanted.q, EXACT)


@pytest.mark.parametrize(
    ("module", "link", "modules", "base"),
    [
        (None, "m1_platform", (0, 1, 2, 3, 4), "scara_base"),
        (5, "m1_platform", (4,), "scara_flange"),
        (None, "scara_upper", (0,), "scara_base"),
        (None, "scara_upper@m1_platform", (1, 2, 3, 4), "m1_platform"),
        (None, "m1_platform@scara_quill", (3, 4), "scara_quill"),
        (None, "m1_platform@world", (0, 1, 2, 3, 4), "scara_base"),
        (None, "scara_upper@world", (0,), "scara_base"),
    ],
)
@pytest.mark.parametrize("fixed", [True, False])
def test_the_modules_between_two_links_move(
    module: int | None, link: str, modules: tuple[int, ...], base: str, fixed: bool
) -> None:
    """A base that moves stays at home, where its frame is the world's."""
    robot = hybridyn.load("scara_delta", base="fixed" if fixed else "moving")
    assert fixed or robot.home[:7].tolist() == [0, 0, 0, 0, 0, 0, 1]
    sweep = find_sweep(robot, module, link, None, robot.home)
    assert (sweep.modules, sweep.base) == (modules, base)


@pytest.mark.parametrize("rule", [slow(LEAST), MIDDLE])
def test_a_link_that_one_of_two_motors_moves_leaves_the_other_to_the_rule(rule: str) -> None:
    """The other motor of a five-bar stays, or goes to where `assemble` has it by the same rule."""
    robot, link = hybridyn.load("five_bar"), "m1_left_upper"
    found = workspace(robot, link=link, redundancy=rule, steps={"pitch": 0.8})
    assert (found.sweep.names, found.spare, len(found.index)) == (("pitch",), 1, 3)
    given = {link: ({"pitch": found.coordinates[:, 0]},)}
    q = hybridyn.assemble(robot, platforms=given, guess=found.q[0], redundancy=rule)[0]
    close_to(found.q, q, STEPPED if rule == LEAST else EXACT)


def test_the_command_says_what_moves(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    machine(tmp_path, STROKE / 10)
    path = tmp_path / "excavator.urdf"
    said = call(capsys, "workspace", path, "--link", "teeth", "--step", "x=0.05,z=0.05,pitch=0.1")
    assert said.out.splitlines()[1 if said.out.startswith("#") else 0].startswith("teeth@cab/pose/x,")
    assert "modules 1, 2, 3: " in said.err
    assert "boom_rod (" in said.err
    assert re.search(r"  coordinate +from +ended by +to +ended by +step +unit\n  x  ", said.err)
    words = ["--link", "m1_left_upper", "--sweep", "pitch", "--step", "pitch=1.3"]
    said = call(capsys, "workspace", "five_bar", *words)
    assert "1 further freedom of the motors: the motors move least from " in said.err
