"""Poses in the world: those of a link of a robot whose base moves, and of one whose base does not."""

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn import HybridRobot, TrajectoryError
from hybridyn.assembly.chain.coupling import way_to_root
from hybridyn.assembly.requests import gather_requests
from hybridyn.cli import main
from hybridyn.compiled.library.building import best_lanes
from hybridyn.compiled.programs.closing.assembling import Assembler
from hybridyn.linkage.angles import angles_of, angular_drift, angular_map, plain_heading, rate_map
from hybridyn.spatial import Array, rotation_from_quaternion
from hybridyn.structure.building import build_robot
from tests.assembly.test_angles import arm
from tests.oracle import Base
from tests.robots.mechanisms import random_mechanism, random_states
from tests.robots.posing import Triple, far_apart, of_joints
from tests.robots.shipped import shipped, states_near_home
from tests.support.comparing import close_to, refused
from tests.support.samples import slow

REACHED = 1e-9  # of positions, rates and accelerations, relative to the largest
BASES: tuple[Base, ...] = ("moving", "floating", "fixed")
STACKS = ("stack", "stewart_arm", "serial", "legged")
POSE, TWIST = ("x", "y", "z", "qx", "qy", "qz", "qw"), ("x", "y", "z", "wx", "wy", "wz")


def of_world(robot: HybridRobot, q: Array, v: Array, a: Array, link: str) -> Triple:
    """Return a link's pose in the world, its velocity and classical acceleration, by Pinocchio."""
    data, frame, rows = robot.model.createData(), robot.model.getFrameId(link, pin.BODY), []
    for x, x_dot, x_ddot in zip(q, v, a, strict=True):
        pin.forwardKinematics(robot.model, data, x, x_dot, x_ddot)
        pose = pin.SE3ToXYZQUAT(pin.updateFramePlacement(robot.model, data, frame))
        levels = [
            get(robot.model, data, frame, pin.LOCAL_WORLD_ALIGNED).vector
            for get in (pin.getFrameVelocity, pin.getFrameClassicalAcceleration)
        ]
        rows.append((pose, *levels))
    pose, velocity, acceleration = (np.array(part) for part in zip(*rows, strict=True))
    return pose, velocity, acceleration


def in_parts(triple: Triple, kept: str, turn: str) -> tuple[dict[str, Array], ...]:
    """Return some lengths of a pose, with its quaternion ("q"), its pitch and yaw ("a"), or neither."""
    pose, *rates = triple
    places = {axis: pose[:, "xyz".index(axis)] for axis in kept}
    levels = [{axis: rate[:, "xyz".index(axis)] for axis in kept} for rate in rates]
    if turn == "q":
        places |= dict(zip(POSE[3:], pose.T[3:], strict=True))
        levels = [
            own | dict(zip(TWIST[3:], rate.T[3:], strict=True))
            for own, rate in zip(levels, rates, strict=True)
        ]
    if turn == "a":
        R = rotation_from_quaternion(pose[:, 3:])
        angles = angles_of(R, plain_heading(R))  # the triple that a guess there means
        to_rates = rate_map(angles)
        first = np.einsum("tij,tj->ti", to_rates, rates[0][:, 3:])
        own = rates[1][:, 3:] - angular_drift(angular_map(R, angles), first)
        second = np.einsum("tij,tj->ti", to_rates, own)
        for level, x in zip((places, *levels), (angles, first, second), strict=True):
            level |= {"pitch": x[:, 1], "yaw": x[:, 2]}
    return places, *levels


@pytest.mark.parametrize(
    ("kind", "base", "seed"),
    [
        ("stewart_arm", "moving", 1), ("serial", "floating", 2), ("serial", "fixed", 2),
        *(slow(kind, base, seed) for kind in STACKS for base in BASES for seed in range(3, 8)),
    ],
)  # fmt: skip
def test_a_pose_in_the_world_is_reached_in_the_world(kind: str, base: Base, seed: int) -> None:
    """Positions, rates and accelerations of a drawn state, whole and in parts, by the modules on the way."""
    description = random_mechanism(seed, kind=kind)
    robot, states = build_robot(description, base=base), random_states(description, base, seed, 1)
    link, root = robot.modules[-1].name, description.root
    way = {k for k, _ in way_to_root(robot, robot.bodies.place[link][0])}
    beside = [name for k, module in enumerate(robot.modules) if k not in way for name in module.motors]
    placed: dict[str, Any] = {}
    if base != "fixed":
        placed[f"{root}@world"] = of_world(robot, *states, root)
    whole = of_world(robot, *states, link)
    for parts in (None, ("xyz", "a"), ("z", "q"), ("xz", "")):
        given = whole if parts is None else in_parts(whole, *parts)
        q, v, a = hybridyn.assemble(
            robot, motors=of_joints(robot, *states, beside), platforms=placed | {f"{link}@world": given},
            guess=states[0][0],
        )  # fmt: skip
        assert far_apart(robot, q, states[0]) < REACHED
        found = of_world(robot, q, v, a, link)
        found = found if parts is None else in_parts(found, *parts)
        for one, wanted in zip(found, given, strict=True):
            if parts is None:
                close_to(one, wanted, REACHED)
                continue
            assert one.keys() == wanted.keys()
            close_to(np.array([*one.values()]), np.array([wanted[name] for name in one]), REACHED)


T = np.linspace(0, 0.5, 15)
#: Pelvis and foot of a leg with three joints in a plane: the pelvis sways, the foot stays.
PELVIS = {"x": 0.1 * np.sin(3 * T), "z": 0.05 * np.cos(2 * T), "ry": 0.2 * np.sin(4 * T)}
FOOT = {"x": 0.6, "z": -0.5, "pitch": 0.3}


def leg(folder: Path, base: Base) -> HybridRobot:
    arm(folder, "yyy")
    return hybridyn.load(folder / "arm.urdf", base=base)


def sway() -> Array:
    """Return poses of the pelvis, shape (T, 7)."""
    zero = np.zeros_like(T)
    half = PELVIS["ry"] / 2
    return np.stack([PELVIS["x"], zero, PELVIS["z"], zero, np.sin(half), zero, np.cos(half)], axis=1)


@pytest.mark.parametrize("base", ["moving", slow("floating")])
def test_a_foot_stays_in_the_world_while_the_pelvis_moves(tmp_path: Path, base: Base) -> None:
    """Some coordinates, and the whole pose of what they reach."""
    robot = leg(tmp_path, base)
    guess = np.concatenate([sway()[0], [-0.5, 1.2, -0.4]])
    kept = {name: np.full_like(T, value) for name, value in FOOT.items()}
    close = partial(hybridyn.assemble, robot, guess=guess)
    q, v, a = close(platforms={"root": (sway(),), "l2@world": (kept,)})
    pose, twist, change = of_world(robot, q, v, a, "l2")
    close_to(pose, np.tile(pose[0], (len(T), 1)), REACHED)
    wanted = {**FOOT, "pitch": 2 * np.arctan2(pose[0, 4], pose[0, 6])}
    assert [*pose[0, [0, 2]], wanted["pitch"]] == pytest.approx([*FOOT.values()], abs=REACHED)
    moving = np.zeros((len(T), 6)), np.zeros((len(T), 6))
    close_to(twist, moving[0], REACHED)
    close_to(change, moving[1], REACHED)
    whole = {"root@world": (sway(),), "l2@world": (pose,)}
    for one, other in zip(close(platforms=whole), (q, v, a), strict=True):
        close_to(one, other, 1e-7)


@pytest.mark.parametrize("base", ["moving", slow("floating")])
def test_a_base_turns_below_what_stays_in_the_world_within_one_row(tmp_path: Path, base: Base) -> None:
    """Far from the world's origin, which the base sees go along an arc: the first joint alone turns back."""
    robot, turn = arm(tmp_path, "zzz", base=base), 1.5
    guess = np.array([3.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.4, -0.9, 0.0])
    wanted = np.r_[guess[:5], np.sin(turn / 2), np.cos(turn / 2), 0.4 - turn, -0.9, 0.0]
    still = np.zeros((1, robot.nv))
    foot = dict(zip("xy", of_world(robot, guess[None], still, still, "l2")[0][0], strict=False))
    platforms = {"root": (wanted[:7],), "l2@world": (foot,)}
    q = hybridyn.assemble(robot, motors={"j2": 0.0}, platforms=platforms, guess=guess)[0]
    close_to(q, wanted, REACHED)


@pytest.mark.slow
def test_a_platform_is_posed_in_the_world_in_c_as_on_the_general_path() -> None:
    """Without lanes for C, both are the general path."""
    robot = build_robot(shipped("gough_stewart"), base="moving")
    states = states_near_home(robot.description, "moving", 1, 3)
    root, link = robot.description.root, robot.modules[0].outputs[0]
    given = {f"{name}@world": of_world(robot, *states, name) for name in (root, link)}
    requests, assembler = gather_requests(robot, None, given), Assembler(robot)
    in_c = assembler.assemble(requests, robot.home)
    assert assembler.recomputed == 0 or best_lanes() == 1
    for one, general in zip(in_c, hybridyn.assemble(robot, platforms=given), strict=True):
        close_to(one, general, REACHED)


def test_a_base_whose_pose_is_not_given_rests_at_the_guess(tmp_path: Path) -> None:
    robot = leg(tmp_path, "floating")
    guess = np.concatenate([[1.0, 2.0, 3.0, 0.0, 0.0, 0.6, 0.8], [-0.5, 1.2, -0.4]])
    still = np.zeros((1, robot.nv))
    pose = of_world(robot, guess[None], still, still, "l2")[0][0]
    for given in (pose, {"x": pose[0], "z": pose[2]}):
        q = hybridyn.assemble(robot, platforms={"l2@world": (given,)}, guess=guess)[0]
        close_to(q, guess, REACHED)


def test_a_table_may_say_what_stays_in_the_world(tmp_path: Path) -> None:
    """Against the same motion by its motors."""
    (tmp_path / "arm.model.toml").write_text("[home]\nj0 = -0.5\nj1 = 1.2\nj2 = -0.4\n")
    robot = leg(tmp_path, "moving")
    q = hybridyn.assemble(
        robot,
        platforms={"root": (sway(),), "l2@world": ({n: np.full_like(T, x) for n, x in FOOT.items()},)},
    )[0]
    world = {f"l2@world/pose/{name}": np.full_like(T, x) for name, x in FOOT.items()}
    joints = {f"{name}/position": q[:, 7 + i] for i, name in enumerate(robot.motors)}
    places = {"x": PELVIS["x"], "y": 0 * T, "z": PELVIS["z"], "rx": 0 * T, "ry": PELVIS["ry"], "rz": 0 * T}
    efforts, robot_file = [], str(tmp_path / "arm.urdf")
    for i, (columns, owner) in enumerate(((world, "root@world"), (joints, "root"))):
        table = {"time": T, **{f"{owner}/pose/{name}": x for name, x in places.items()}, **columns}
        files = str(tmp_path / f"{i}.csv"), str(tmp_path / f"{i}_tau.csv")
        rows = np.column_stack([*table.values()])
        np.savetxt(files[0], rows, "%.17g", ",", header=",".join(table), comments="")
        assert main(["idm", robot_file, files[0], "--base", "moving", "-o", files[1]]) == 0
        efforts.append(np.loadtxt(files[1], delimiter=",", skiprows=1)[:, 1:])
    close_to(efforts[1], efforts[0], 1e-3)  # rates are those of splines through different columns


def test_a_link_that_is_named_world_keeps_its_meaning(tmp_path: Path) -> None:
    arm(tmp_path, "yyy")
    path = tmp_path / "arm.urdf"
    path.write_text(path.read_text().replace('"l0"', '"world"'))
    robot = hybridyn.load(path, base="moving")
    pose = {"l2@world": ({"pitch": 0.3},)}
    q = hybridyn.assemble(robot, platforms=pose, motors={"j0": 0.7, "j1": 0.1})[0]
    assert q[-1] == pytest.approx(0.2)


# -------------------------------------------------------------------- wrong


@pytest.mark.parametrize(
    ("base", "key", "words"),
    [
        ("fixed", "root@world", "part of the base"),
        ("moving", "base@world", "part of the base"),
        ("moving", "l2@wrld", "unknown link 'wrld' .did you mean 'world'"),
        ("moving", "world", "unknown link 'world'"),
    ],
)
def test_what_has_no_pose_in_the_world_is_refused(tmp_path: Path, base: Base, key: str, words: str) -> None:
    given = {key: [0, 0, 0, 0, 0, 0, 1.0]}
    refused(partial(hybridyn.assemble, leg(tmp_path, base), platforms=given), TrajectoryError, words)


def test_a_base_is_given_once(tmp_path: Path) -> None:
    twice = {key: [0, 0, 0, 0, 0, 0, 1.0] for key in ("root", "root@world")}
    robot = leg(tmp_path, "moving")
    refused(partial(hybridyn.assemble, robot, platforms=twice), TrajectoryError, "given twice")
