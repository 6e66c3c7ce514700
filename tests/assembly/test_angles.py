"""Prescribed angles mean what they say: lone ones stay on their branch, complete ones are a rotation."""

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn import HybridRobot, TrajectoryError
from hybridyn.assembly.assemble import assemble_requests
from hybridyn.assembly.requests import first_guess, gather_requests
from hybridyn.compiled.programs.closing.assembling import Assembler
from hybridyn.linkage.angles import (
    angles_of,
    angular_drift,
    angular_map,
    other_triple,
    plain_heading,
    rate_map,
    rotation_from_angles,
    wrapped,
)
from hybridyn.spatial import Array
from hybridyn.studies.workspace.workspace import workspace
from tests.oracle import Base
from tests.support.comparing import close_to, refused

ROUNDING = 1e-9  # relative, through the conditioning of these arms
STEP = 1e-4  # of time in central differences [s]
DIFFERENCED = 1e-5  # relative: truncation 1e-8, rounding 1e-12 / STEP^2 twice differentiated

AXES = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}


def arm(folder: Path, axes: str, heading: float = 0.0, base: Base = "fixed") -> HybridRobot:
    """Return a serial arm whose joints turn about these axes at home, on a link turned by a heading."""
    parts = [f'<link name="root"/><link name="base"/><joint name="turned" type="fixed"><parent link="root"/>'
             f'<child link="base"/><origin rpy="0 0 {heading!r}"/></joint>']  # fmt: skip
    below = "base"
    for i, axis in enumerate(axes):
        parts.append(
            f'<link name="l{i}"><inertial><origin xyz="0.3 0 0.1"/><mass value="1"/><inertia ixx="0.02" '
            f'iyy="0.03" izz="0.04" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="j{i}" '
            f'type="revolute"><parent link="{below}"/><child link="l{i}"/>'
            f'<origin xyz="{0.5 if i else 0} 0 0"/><axis xyz="{AXES[axis]}"/>'
            '<limit lower="-6.5" upper="6.5" effort="9" velocity="9"/></joint>'
        )
        below = f"l{i}"
    path = folder / "arm.urdf"
    path.write_text(f'<robot name="arm">{"".join(parts)}</robot>')
    return hybridyn.load(path, base=base)


def placed(robot: HybridRobot, q: Array, link: str) -> Array:
    """Return the rotations of a link in the root, shape (T, 3, 3), by Pinocchio."""
    data, frame, out = robot.model.createData(), robot.model.getFrameId(link), []
    for row in q:
        pin.framesForwardKinematics(robot.model, data, row)
        out.append(data.oMf[frame].rotation.copy())
    return np.array(out)


# -------------------------------------------------------------------- angles of rotations


def test_both_triples_are_the_same_rotation_and_the_heading_tells_them_apart() -> None:
    rng = np.random.default_rng(0)
    angles = rng.uniform(-3, 3, (200, 3))
    angles[:20, 1] = np.pi / 2  # the yaw is then the heading
    R = rotation_from_angles(angles)
    for one, wanted in zip(angles[20:], R[20:], strict=True):
        close_to(pin.rpy.rpyToMatrix(*one), wanted, 1e-14)
    close_to(rotation_from_angles(other_triple(angles)), R, 1e-14)
    found = angles_of(R, angles[:, 2] + rng.uniform(-1, 1, 200) * (np.abs(np.cos(angles[:, 1])) > 1e-9))
    assert np.abs(wrapped(found - angles)).max() < 1e-7
    close_to(rotation_from_angles(angles_of(R)), R, 1e-8)  # the upright triple near a pitch of a quarter turn
    assert np.abs(angles_of(R)[:, 1]).max() <= np.pi / 2 + 1e-15


def test_rates_of_angles_follow_those_of_the_rotation() -> None:
    """Maps of rates, and their drift, against differences of rotations, for both triples."""
    rng = np.random.default_rng(1)
    angles, rates = rng.uniform(-3, 3, (50, 3)), rng.normal(size=(50, 3))
    R, E = rotation_from_angles(angles), angular_map(rotation_from_angles(angles), angles)
    later, before = (rotation_from_angles(angles + s * STEP * rates) for s in (1, -1))
    spin = np.matmul((later - before) / (2 * STEP), R.swapaxes(1, 2))
    w = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
    close_to(np.einsum("tij,tj->ti", E, rates), w, DIFFERENCED)
    close_to(np.einsum("tij,tj->ti", rate_map(angles), w), rates, 1e-4)
    ways = [
        np.einsum("tij,tj->ti", angular_map(rotation_from_angles(x), x), rates)
        for x in (angles + STEP * rates, angles - STEP * rates)
    ]
    close_to(angular_drift(E, rates), (ways[0] - ways[1]) / (2 * STEP), DIFFERENCED)


@pytest.mark.parametrize(
    ("angles", "plain"),
    [((0, 2.0, 0), 0), ((0, -2.9, 0), 0), ((0.1, 0.2, 3.1), 3.1), ((3.0, 0.1, 0), 0), ((0, 1.0, 2.5), 2.5)],
)  # fmt: skip
def test_the_plainer_triple_is_the_one_that_a_person_would_name(
    angles: tuple[float, ...], plain: float
) -> None:
    assert float(wrapped(plain_heading(rotation_from_angles(np.array(angles))) - plain)) == pytest.approx(0)


# -------------------------------------------------------------------- lone angles


@pytest.mark.parametrize("heading", [0.0, 0.7, 2.5])
def test_a_lone_angle_is_not_mirrored(tmp_path: Path, heading: float) -> None:
    """The pitch was folded at a quarter turn: 2.14 was taken for 1.0, and its effort had the other sign."""
    robot = arm(tmp_path, "y", heading)
    for angle, guess in (
        (1.0, 2.0),
        (2.0, 1.0),
        (-1.4, -1.9),
        (np.pi / 2, 0.0),
        (3.0, np.pi / 2),
        (1.7, 0.0),
    ):
        q, v, a = hybridyn.assemble(robot, platforms={"l0@base": ({"pitch": angle},)}, guess=[guess])
        assert q[0] == pytest.approx(angle, abs=1e-12)
        assert hybridyn.idm(robot, q, v, a) == pytest.approx(
            -9.81 * (0.3 * np.cos(angle) + 0.1 * np.sin(angle))
        )


@pytest.mark.parametrize("axes", ["y", "zy", "xy", "yy"])
def test_a_lone_pitch_passes_quarter_turns_smoothly(tmp_path: Path, axes: str) -> None:
    """Through and through: up to 3 and back, with rates and accelerations; other joints turn meanwhile."""
    robot, link = arm(tmp_path, axes), f"l{len(axes) - 1}@base"
    t = np.linspace(0.0, 2.0, 121)
    angle, rate, acceleration = 3 * np.sin(3 * t), 9 * np.cos(3 * t), -27 * np.sin(3 * t)
    turning = {"zy": (2.5 * t, 2.5 + 0 * t, 0 * t)}.get(axes, (0.1 * t, 0.1 + 0 * t, 0 * t))
    motors = {} if len(axes) == 1 else {"j0": turning}
    if axes == "xy":  # a roll before the pitch has no simple pitch; it is held
        motors = {"j0": (0 * t, 0 * t, 0 * t)}
    goal = {link: ({"pitch": angle}, {"pitch": rate}, {"pitch": acceleration})}
    q, v, a = hybridyn.assemble(robot, motors=motors, platforms=goal)
    sum_of = motors["j0"] if axes == "yy" else (0 * t, 0 * t, 0 * t)
    for found, wanted, less in zip((q, v, a), (angle, rate, acceleration), sum_of, strict=True):
        close_to(found[:, -1], wanted - less, ROUNDING)


@pytest.mark.parametrize("rows", [[(2.0, 1.47)], [(1.0, 0.5), (2.0, 1.47)]])
def test_a_lone_pitch_is_not_mirrored_while_the_yaw_passes_a_quarter_turn(
    tmp_path: Path, rows: list[tuple[float, float]]
) -> None:
    """In one long step, or in two; the mirror image of the last row is so near that it is as predicted."""
    robot, wanted = arm(tmp_path, "zy"), np.array([(0.0, 0.2), *rows])
    goal = {"l1@base": ({"pitch": wanted[:, 1]},)}
    close_to(hybridyn.assemble(robot, motors={"j0": wanted[:, 0]}, platforms=goal)[0], wanted, ROUNDING)


def test_two_angles_pass_a_quarter_turn_of_the_third(tmp_path: Path) -> None:
    """A pan and tilt head whose camera rolls: yaw and roll are prescribed, the pitch goes from 1.2 to 1.9."""
    robot, t = arm(tmp_path, "zyx"), np.linspace(0, 1, 41)
    wanted = np.stack([0.3 * t, 1.2 + 0.7 * t, 0.2 - t], axis=1)
    goal = {"l2@base": ({"yaw": wanted[:, 0], "pitch": wanted[:, 1]},)}
    q, _, _ = hybridyn.assemble(robot, motors={"j2": wanted[:, 2]}, platforms=goal)
    assert np.abs(q - wanted).max() < 1e-7  # a quarter turn of pitch is a singular posture of yaw and roll


def test_two_angles_of_a_library_name_the_posture_of_the_guess(tmp_path: Path) -> None:
    """Libraries give the upright triple, also where the guess has a plainer one: (-0.4, 2.9, 0.3) here."""
    robot, wanted = arm(tmp_path, "zyx"), np.array([0.3, 2.9, -0.4])
    R = placed(robot, wanted[None], "l2")[0]
    roll, pitch, yaw = pin.rpy.matrixToRpy(R)
    for two in ({"roll": roll, "yaw": yaw}, {"roll": roll, "pitch": pitch}, {"pitch": pitch, "yaw": yaw}):
        held = (
            {"j1": wanted[1]}
            if "pitch" not in two
            else {"j0": wanted[0]}
            if "yaw" not in two
            else {"j2": wanted[2]}
        )
        q, _, _ = hybridyn.assemble(robot, motors=held, platforms={"l2@base": (two,)}, guess=wanted)
        close_to(q, wanted, ROUNDING)


def lone(folder: Path, name: str, yaw: float) -> tuple[HybridRobot, np.ndarray, dict[str, float], list[Any]]:
    """Return an arm, a tool that points down, its other joints, and steps of an angle with their goals.

    With a roll of half a turn, the plainer triple is often the other one.
    """
    start, at = np.array([yaw, 0.05, 3.1]), ("yaw", "pitch", "roll").index(name)
    steps = [start + step * np.eye(3)[at] for step in (0.0, 0.1, -0.2)]
    held = {f"j{i}": start[i] for i in range(3) if i != at}
    goals = [(wanted, {"l2@base": ({name: wanted[at]},)}) for wanted in steps]
    return arm(folder, "zyx"), start, held, goals


@pytest.mark.parametrize("yaw", [0.3, 1.57, 2.0, -2.8])
@pytest.mark.parametrize("name", ["yaw", "pitch", "roll"])
def test_a_lone_angle_near_that_of_the_guess_moves_little(tmp_path: Path, name: str, yaw: float) -> None:
    robot, start, held, goals = lone(tmp_path, name, yaw)
    for wanted, goal in goals:
        close_to(hybridyn.assemble(robot, motors=held, platforms=goal, guess=start)[0], wanted, ROUNDING)


def test_a_lone_roll_moves_little_in_c(tmp_path: Path) -> None:
    """Of one joint about the tool's axis, which points down: the plainer triple is the other one."""
    robot, start = arm(tmp_path, "x", 1.57), np.array([3.1])
    in_c = Assembler(robot)
    for wanted in (3.1, 3.2, 2.9):
        requests = gather_requests(robot, {}, {"l0": ({"roll": wanted},)})
        close_to(in_c.assemble(requests, start)[0][0], np.array([wanted]), ROUNDING)
    assert in_c.recomputed == 0


@pytest.mark.slow
@pytest.mark.parametrize("yaw", [0.3, 1.57, 2.0, -2.8])
@pytest.mark.parametrize("name", ["yaw", "pitch", "roll"])
def test_a_lone_angle_moves_little_in_c(tmp_path: Path, name: str, yaw: float) -> None:
    robot, start, held, goals = lone(tmp_path, name, yaw)
    in_c = Assembler(robot)
    for wanted, goal in goals:
        close_to(in_c.assemble(gather_requests(robot, held, goal), start)[0][0], wanted, ROUNDING)


def test_a_lone_angle_of_a_shipped_arm_at_home_moves_nothing() -> None:
    robot = hybridyn.load("stewart_ur5")
    pitch = pin.rpy.matrixToRpy(placed(robot, robot.home[None], "tool0")[0])[1]
    close_to(hybridyn.assemble(robot, platforms={"tool0": ({"pitch": pitch},)})[0], robot.home, ROUNDING)


def test_a_complete_orientation_is_a_rotation_for_any_numbers(tmp_path: Path) -> None:
    """By angles, quaternion and rotation vector; a pitch of 1.7 was "out of reach"."""
    robot = arm(tmp_path, "zyx")
    t = np.linspace(0, 1.5, 40)
    wanted = np.stack([0.8 * t, 2.2 + 0.5 * np.sin(t), -1.1 * t], axis=1)  # yaw, pitch, roll are the joints
    rates = np.stack([0.8 + 0 * t, 0.5 * np.cos(t), -1.1 + 0 * t], axis=1)
    still = np.stack([0 * t, -0.5 * np.sin(t), 0 * t], axis=1)
    names = ("yaw", "pitch", "roll")
    triple = tuple(dict(zip(names, x.T, strict=True)) for x in (wanted, rates, still))
    by_angles = hybridyn.assemble(robot, platforms={"l2@base": triple}, guess=wanted[0])
    for found, right in zip(by_angles, (wanted, rates, still), strict=True):
        close_to(found, right, ROUNDING)
    R = placed(robot, wanted, "l2")
    quaternions = np.array([pin.Quaternion(x).coeffs() for x in R])
    vectors = np.array([pin.log3(x) for x in R])
    data, twists = robot.model.createData(), []
    for q, v, a in zip(wanted, rates, still, strict=True):
        pin.forwardKinematics(robot.model, data, q, v, a)
        frame, axes = robot.model.getFrameId("l2"), pin.LOCAL_WORLD_ALIGNED
        of = (
            pin.getFrameVelocity(robot.model, data, frame, axes),
            pin.getFrameAcceleration(robot.model, data, frame, axes),
        )
        twists.append([x.angular.copy() for x in of])
    spins = [dict(zip(("wx", "wy", "wz"), x.T, strict=True)) for x in np.array(twists).swapaxes(0, 1)]
    for keys, numbers in ((("qx", "qy", "qz", "qw"), quaternions), (("rx", "ry", "rz"), vectors)):
        goal = (dict(zip(keys, numbers.T, strict=True)), *spins)
        found = hybridyn.assemble(robot, platforms={"l2@base": goal}, guess=wanted[0])
        for one, right in zip(found, (wanted, rates, still), strict=True):
            close_to(one, right, ROUNDING)


def test_six_coordinates_are_a_whole_pose() -> None:
    """Of a platform beyond a quarter turn of pitch, and of a moving base."""
    robot = hybridyn.load("gough_stewart", base="moving")
    root, platform = robot.description.root, robot.modules[-1].outputs[0]
    names, base = ("x", "y", "z", "roll", "pitch", "yaw"), np.array([0.1, 0.2, 0.3, 0.4, 1.9, -0.5])
    pose = np.array([0.0, 0.0, 0.6, 0.02, -0.03, 0.01])
    by_angles = {key: (dict(zip(names, x, strict=True)),) for key, x in ((root, base), (platform, pose))}
    whole = {
        key: (np.r_[x[:3], pin.Quaternion(pin.rpy.rpyToMatrix(*x[3:])).coeffs()],)
        for key, x in ((root, base), (platform, pose))
    }
    found, wanted = (hybridyn.assemble(robot, platforms=x)[0] for x in (by_angles, whole))
    found[3:7] *= np.sign(found[3:7] @ wanted[3:7])
    close_to(found, wanted, ROUNDING)


# -------------------------------------------------------------------- tables in C, workspaces


@pytest.mark.parametrize("way", ["over", "near", "from beyond"])
def test_rows_in_c_are_those_of_the_general_path(tmp_path: Path, way: str) -> None:
    """C knows the upright triples; rows that may mean another one are handed over."""
    robot = arm(tmp_path, "y", 0.7)
    t = np.linspace(0, 1, 60)
    angle = {"over": 0.5 + 2.0 * t, "near": 1.5 * np.sin(6 * t), "from beyond": 2.2 - 2.0 * t}[way]
    goal = {"l0@base": ({"pitch": angle}, {"pitch": np.gradient(angle, t)}, {"pitch": 1 + t})}
    requests = gather_requests(robot, {}, goal, nearest=True)
    guess = first_guess(robot, angle[:1])
    found = Assembler(robot).assemble(requests, guess)
    for one, wanted in zip(found, assemble_requests(robot, requests, guess), strict=True):
        close_to(one, wanted, 1e-8)
    close_to(found[0][:, 0], angle, ROUNDING)


def test_a_workspace_of_an_angle_is_as_wide_as_the_limits(tmp_path: Path) -> None:
    """It ended at 1.56 "by reach of the loops" of a robot without loops."""
    text = (path := tmp_path / "arm.urdf") and arm(tmp_path, "y") and path.read_text()
    path.write_text(text.replace('lower="-6.5" upper="6.5"', 'lower="-1" upper="3"'))
    found = workspace(hybridyn.load(path), 1, axes=["pitch"], steps={"pitch": 0.05})
    assert found.blocked == {"j0": 2}
    close_to(found.coordinates[:, 0], found.q[:, 0], ROUNDING)
    assert (found.q.min(), found.q.max()) == pytest.approx((-1.0, 3.0), abs=0.051)


# -------------------------------------------------------------------- wrong


@pytest.mark.parametrize(
    ("pose", "words"),
    [
        (({"qx": 0.0, "qy": 0.0},), "lacks qz, qw: it takes qx, qy, qz, qw"),
        (({"rx": 0.0, "ry": 0.0, "rz": 0.0, "yaw": 0.0},), "given twice, by roll, pitch, yaw and rx, ry, rz"),
        (({"qx": 0.0, "qy": 0.0, "qz": 0.0, "qw": 1.1},), "quaternion of length 1.1"),
        (({"rx": 0.0, "ry": 0.0, "rz": 0.0}, {"rx": 0.0}), r"must name .*\(wx, wy, wz\)"),
        (({"pitch": 0.0}, {"pitch": 0.0, "yaw": 1.0}), r"must name .*\(pitch\)"),
    ],
)  # fmt: skip
def test_bad_orientations_are_refused(tmp_path: Path, pose: tuple[object, ...], words: str) -> None:
    robot = arm(tmp_path, "y")
    refused(partial(hybridyn.assemble, robot, platforms={"l0": pose}), TrajectoryError, words)
