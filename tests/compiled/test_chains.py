"""Poses through several modules in C: rows, rates and accelerations of the general path's least motion."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn import AssemblyError, HybridRobot
from hybridyn.assembly.assemble import assemble_requests
from hybridyn.assembly.requests import gather_requests
from hybridyn.compiled.programs.closing.assembling import Assembler
from hybridyn.compiled.programs.closing.libraries import ClosingLibraries
from hybridyn.spatial import Array
from hybridyn.structure.building import build_robot
from hybridyn.structure.robot import joint_position
from tests.assembly.test_angles import arm
from tests.robots.excavator import excavator
from tests.robots.mechanisms import random_mechanism
from tests.robots.posing import Triple, of_joints, of_link
from tests.support.comparing import close_to
from tests.support.samples import slow

SAME = 1e-10  # relative to the largest entry: rounding, through the condition of loops and targets
ROWS = 60
BENT = 0.5  # of the joints of arms, which are straight at home [rad]
#: Names of coordinates, by what they are in a pose and a twist.
NAMES = ("x", "y", "z")


def swing(robot: HybridRobot, size: float, rows: int = ROWS, seed: int = 1) -> tuple[Array, Array, Array]:
    """Return states of a smooth motion from home in which all motors swing."""
    rng, turn = np.random.default_rng(seed), 2 * np.pi
    home = np.array([float(joint_position(robot, robot.home, name)) for name in robot.motors])
    home += BENT * (-1.0) ** np.arange(len(home)) if robot.name == "arm" else 0.0
    lengths = {name: module.mechanism.length for module in robot.modules for name in module.motors}
    unit = [lengths[name] if robot.records[name].kind == "prismatic" else 1.0 for name in robot.motors]
    wide = size * rng.uniform(0.5, 1.0, len(home)) * unit * rng.choice([-1.0, 1.0], len(home))
    t, late = np.linspace(0.0, 1.0, rows)[:, None], rng.uniform(0.0, 6.0, len(home))
    x = home + wide * (np.sin(turn * t + late) - np.sin(late))
    x_dot, x_ddot = wide * turn * np.cos(turn * t + late), -wide * turn**2 * np.sin(turn * t + late)
    return hybridyn.assemble(robot, motors=(x, x_dot, x_ddot))


def some_of(levels: Triple, names: str) -> tuple[dict[str, Array], ...]:
    """Return some coordinates of a pose: x, y, z, and the pitch of a link in the plane of x and z."""
    pose, twist, change = levels
    out = []
    pitch = np.unwrap(2.0 * np.arctan2(pose[:, 4], pose[:, 6]))
    for level, turn in ((pose, pitch), (twist, twist[:, 4]), (change, change[:, 4])):
        out.append({name: turn if name == "pitch" else level[:, NAMES.index(name)] for name in names.split()})
    return tuple(out)


def compare(
    robot: HybridRobot,
    start: Array,
    platforms: Mapping[str, object],
    motors: Mapping[str, object] | None = None,
    rest: int = 0,
) -> Assembler:
    """Compare rows in C with those of the general path; all but `rest` are computed in C."""
    requests = gather_requests(robot, motors, platforms)
    assembler = Assembler(robot)
    found, right = assembler.assemble(requests, start), assemble_requests(robot, requests, start)
    assert assembler.recomputed <= rest
    for x, y in zip(found, right, strict=True):
        close_to(x, y, SAME)
    return assembler


def load(name: str, folder: Path) -> HybridRobot:
    """Return a robot: a serial arm of some axes, a random stack, an excavator, or a shipped robot."""
    kind, _, what = name.partition(" ")
    if kind == "arm":
        return arm(folder, what)
    if kind == "excavator":
        return hybridyn.load(excavator(folder))
    return build_robot(random_mechanism(int(what), kind=kind)) if what else hybridyn.load(name)


@pytest.mark.parametrize(
    ("name", "link", "names", "size"),
    [
        slow("arm yyyy", "l3", "x z", 0.05),
        slow("arm yyyy", "l3", "x z pitch", 0.05),
        slow("arm zyxyzyx", "l6", "", 0.05),
        slow("excavator", "teeth", "x z", 0.01),
        slow("excavator", "teeth", "x z pitch", 0.01),
        slow("chain_of_bars 1", "", "x", 0.02),
        slow("stack 3", "", "", 0.01),
        slow("scara_delta 2", "", "x y z", 0.01),
        slow("stewart_ur5", "wrist_3_link", "", 0.02),
        slow("stewart_ur5", "wrist_3_link", "x y z", 0.02),
        slow("lx4", "m4_platform", "", 0.01),
        slow("snake", "", "x y", 0.003),  # it is straight at home, along z
    ],
)
def test_rows_are_those_of_the_general_path(
    name: str, link: str, names: str, size: float, tmp_path: Path
) -> None:
    robot = load(name, tmp_path)
    link = link or robot.modules[-1].outputs[0]
    states = swing(robot, size)
    levels = of_link(robot, *states, link, robot.description.root)
    compare(robot, states[0][0], {link: some_of(levels, names) if names else levels})


def test_what_c_cannot_decide_is_left_to_the_general_path(tmp_path: Path) -> None:
    """More rows than an arm in a plane can move: of an orientation by itself, and of a whole pose."""
    robot = arm(tmp_path, "yyy")
    libraries = ClosingLibraries(robot)
    point, turn = {"x": 1.2, "z": -0.1}, {"rx": 0.0, "ry": 0.3, "rz": 0.0}
    for pose, known in (((point,), True), ((turn,), False), ([1.2, 0.0, -0.1, 0.0, 0.0, 0.0, 1.0], False)):
        found = libraries.artifact(gather_requests(robot, None, {"l2": pose}))
        assert (found is not None) == known, pose


@pytest.mark.slow
def test_what_else_is_given_may_be_mixed_with_poses() -> None:
    """Two motors of the platform and the tool in the root; then the platform, and the tool in a link."""
    robot = hybridyn.load("stewart_ur5")
    states, root = swing(robot, 0.01), robot.description.root
    motors = of_joints(robot, *states, robot.motors[:2])
    compare(robot, states[0][0], {"wrist_3_link": of_link(robot, *states, "wrist_3_link", root)}, motors)
    seen = some_of(of_link(robot, *states, "wrist_3_link", "upper_arm_link"), "x z")
    platform = of_link(robot, *states, "m1_platform", root)
    given = {"wrist_3_link@upper_arm_link": seen, "m1_platform": platform}
    compare(robot, states[0][0], given, of_joints(robot, *states, robot.motors[6:8]))


@pytest.mark.slow
def test_weights_and_held_joints_are_those_of_the_rule(tmp_path: Path) -> None:
    robot = arm(tmp_path, "yyyyy")
    states, compiled = swing(robot, 0.05), hybridyn.compile(robot)
    given = {"l3": some_of(of_link(robot, *states, "l3", "root"), "x z")}
    rows, start = [], states[0][0]
    for weight in (1.0, 5.0):
        weights, hold = {"j0": weight}, ["j4"]
        found = compiled.assemble(platforms=given, guess=start, weights=weights, hold=hold)
        wanted = hybridyn.assemble(robot, platforms=given, guess=start, weights=weights, hold=hold)
        rows.append(found[0])
        for one, other in zip(found, wanted, strict=True):
            close_to(one, other, SAME)
        assert (found[0][:, 4] == start[4]).all()
    assert not compiled.recomputed
    assert np.abs(rows[0] - rows[1]).max() > 1e-4


@pytest.mark.slow
def test_steps_that_are_too_long_are_left_to_the_general_path(tmp_path: Path) -> None:
    """Five rows of a swing: the general path divides the steps; out of reach it says so."""
    robot = arm(tmp_path, "yyy")
    states = swing(robot, 0.3, 5)
    levels = some_of(of_link(robot, *states, "l2", "root"), "x z")
    assert compare(robot, states[0][0], {"l2": levels}, rest=5).recomputed
    far = {"l2": ({"x": np.linspace(1.0, 9.0, 5), "z": np.zeros(5)},)}
    with pytest.raises(AssemblyError, match="out of reach"):
        Assembler(robot).assemble(gather_requests(robot, None, far), states[0][0])
