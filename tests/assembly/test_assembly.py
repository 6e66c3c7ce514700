"""Closing the loops: from motors, poses and mixtures to the posture that was meant, or to an error."""

import logging
import re
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn import AssemblyError, HybridRobot, TrajectoryError, closure_residual
from hybridyn.description.records import Description
from hybridyn.spatial import Array
from hybridyn.structure.building import build_robot
from hybridyn.structure.graph import find_modules
from hybridyn.structure.module_spec import module_spec
from tests.dynamics.test_idm import symmetric_five_bar
from tests.oracle import Base, Oracle
from tests.robots.mechanisms import KINDS, home_posture, random_mechanism, random_states
from tests.robots.posing import far_apart, of_joints, of_link, position
from tests.robots.shipped import shipped, states_near_home
from tests.robots.sketch import turn
from tests.support.comparing import close_to, refused
from tests.support.engines import engine_of
from tests.support.samples import in_turn, slow, some

CLOSED = 1e-12  # of the module's size, on the closures' generic range
SAME = 1e-9  # the same posture, through the conditioning of a mechanism of this collection
SAME_RATES = 1e-8  # rates and accelerations, relative to the largest
STEP = 1e-4  # of time in central differences [s]
DIFFERENCED = (
    1e-5  # relative: truncation 1e-8 of wiggly motions, rounding 1e-12 / STEP^2 twice differentiated
)
SQUARE = [k for k in KINDS if KINDS[k].motors != "few"]
SEED = 8

States = tuple[Array, Array, Array]


def drawn(kind: str, count: int = 3, base: Base = "fixed") -> tuple[HybridRobot, States]:
    description = random_mechanism(SEED, kind=kind)
    return build_robot(description, base=base), random_states(description, base, SEED, count)


def taken(robot: HybridRobot, count: int, base: Base = "fixed") -> States:
    return states_near_home(robot.description, base, SEED, count)


def same(robot: HybridRobot, got: States, wanted: States) -> None:
    q, v, a = got
    assert closure_residual(robot, q).max() <= CLOSED
    assert far_apart(robot, q, wanted[0]) < SAME
    close_to(v, wanted[1], SAME_RATES)
    close_to(a, wanted[2], SAME_RATES)


def base_pose(robot: HybridRobot, q: Array, v: Array, a: Array) -> States:
    """Return the root link's pose in the world and its rates, root axes turned to the world's."""
    R = np.array([pin.Quaternion(x[3:7] / np.linalg.norm(x[3:7])).matrix() for x in q])

    def turned(x: Array) -> Array:
        return np.concatenate(
            [np.einsum("tij,tj->ti", R, x[:, :3]), np.einsum("tij,tj->ti", R, x[:, 3:])], axis=1
        )

    classical = a[:, :6].copy()
    classical[:, :3] += np.cross(v[:, 3:6], v[:, :3])
    return q[:, :7], turned(v[:, :6]), turned(classical)


# -------------------------------------------------------------------- round trips


@pytest.mark.parametrize("kind", some(SQUARE))
def test_motors_give_the_posture_they_were_read_from(kind: str) -> None:
    """From a guess a few degrees and centimetres off, one by one."""
    robot, states = drawn(kind)
    rng = np.random.default_rng(SEED)
    for t in range(len(states[0])):
        one = tuple(x[t : t + 1] for x in states)
        guess = pin.integrate(robot.model, one[0][0], 0.03 * rng.normal(size=robot.nv))
        same(robot, hybridyn.assemble(robot, motors=of_joints(robot, *one), guess=guess), one)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("kind", "base"), in_turn(["gough", "stack", "on_leg", "gear_across"], ["moving", "floating"], None)
)
def test_motors_and_base_give_the_posture_they_were_read_from(kind: str, base: Base) -> None:
    robot, states = drawn(kind, base=base)
    root = {robot.description.root: base_pose(robot, *states)}
    got = hybridyn.assemble(robot, motors=of_joints(robot, *states), platforms=root)
    same(robot, got, states)
    q, v, a = hybridyn.assemble(robot, motors=of_joints(robot, *states))
    close_to(q[:, :7], np.tile([0, 0, 0, 0, 0, 0, 1.0], (3, 1)), 1e-15)
    assert not v[:, :6].any()
    assert not a[:, :6].any()


@pytest.mark.parametrize(
    "kind", ["gough", "gough_gimbals", "gough_floating", "star_three", "star_five", "stewart_arm"]
)
def test_platform_poses_give_the_posture_they_were_read_from(kind: str) -> None:
    """Any link of the platform's body stands for it: a tool on a fixed joint, turned and shifted, too."""
    robot, states = drawn(kind)
    module = next(m for m in robot.modules if m.mobility == 6)
    arm = [m for m in robot.motors if m not in module.motors]
    platform = next(link.name for link in robot.description.links if link.name.endswith("platform_link"))
    body = robot.bodies.place[platform][0]
    for name in [name for name, (b, *_) in robot.bodies.place.items() if b == body]:
        poses = {name: of_link(robot, *states, name, robot.description.root)}
        same(robot, hybridyn.assemble(robot, motors=of_joints(robot, *states, arm), platforms=poses), states)


@pytest.mark.parametrize("name", ["lx4", "tanev"])
def test_relative_poses_of_stacked_modules(name: str) -> None:
    """`link@other`: each platform as seen from the one below, which moves itself."""
    robot = build_robot(shipped(name))
    states = taken(robot, 3)
    poses, below = {}, robot.description.root
    for module in robot.modules:
        link = module.outputs[0]
        if module.mobility == 6:
            poses[f"{link}@{below}"] = of_link(robot, *states, link, below)
        below = link
    motors = [j for m in robot.modules if m.mobility != 6 for j in m.motors]
    same(robot, hybridyn.assemble(robot, motors=of_joints(robot, *states, motors), platforms=poses), states)


def test_absolute_and_relative_poses_agree() -> None:
    robot = build_robot(shipped("lx4", modules="3"))
    states = taken(robot, 1)
    links = [m.outputs[0] for m in robot.modules]
    root = robot.description.root
    absolute = {link: of_link(robot, *states, link, root) for link in links}
    same(robot, hybridyn.assemble(robot, platforms=absolute), states)
    mixed = {
        links[0]: absolute[links[0]],
        f"{links[1]}@{links[0]}": of_link(robot, *states, links[1], links[0]),
    }
    motors = of_joints(robot, *states, [m for module in robot.modules[2:] for m in module.motors])
    same(robot, hybridyn.assemble(robot, motors=motors, platforms=mixed), states)


def coordinates(
    robot: HybridRobot, states: States, link: str, other: str, names: list[str]
) -> tuple[dict, dict, dict]:
    """Return some of x, y, z, roll, pitch, yaw with rates and accelerations."""
    pose, velocity, acceleration = of_link(robot, *states, link, other)
    out: list[dict[str, Array]] = [{}, {}, {}]
    for t in range(len(pose)):
        R = pin.Quaternion(pose[t, 3:]).matrix()
        rpy = pin.rpy.matrixToRpy(R)
        J = pin.rpy.computeRpyJacobian(rpy, pin.WORLD)
        rate = np.linalg.solve(J, velocity[t, 3:])
        J_dot = pin.rpy.computeRpyJacobianTimeDerivative(rpy, rate, pin.WORLD)
        second = np.linalg.solve(J, acceleration[t, 3:] - J_dot @ rate)
        rows = (
            np.concatenate([pose[t, :3], rpy]),
            np.concatenate([velocity[t, :3], rate]),
            np.concatenate([acceleration[t, :3], second]),
        )
        for part, row in zip(out, rows, strict=True):
            for name, value in zip(("x", "y", "z", "roll", "pitch", "yaw"), row, strict=True):
                if name in names:
                    part[name] = np.append(part.get(name, np.zeros(0)), value)
    return out[0], out[1], out[2]


@pytest.mark.parametrize(
    ("name", "names", "motors"),
    [
        ("rps3", ["z", "roll", "pitch"], 0), ("delta", ["x", "y", "z"], 0), ("rps3", ["z"], 2),
        ("gough_stewart", ["x", "y", "z", "roll", "pitch", "yaw"], 0),
    ],
)  # fmt: skip
def test_partial_poses_with_and_without_motors(name: str, names: list[str], motors: int) -> None:
    """Two slides and the platform's height fix a 3-RPS as well as three slides, or three coordinates."""
    robot = build_robot(shipped(name))
    states = taken(robot, 4)
    platform = robot.modules[0].outputs[0]
    given = coordinates(robot, states, platform, robot.description.root, names)
    driven = of_joints(robot, *states, robot.motors[:motors])
    same(robot, hybridyn.assemble(robot, motors=driven, platforms={platform: given}), states)


@pytest.mark.parametrize("kind", ["gough_gimbals", "on_leg", "delta_bars"])
def test_passive_joints_may_be_given_instead_of_motors(kind: str) -> None:
    """Any joint that fixes the posture will do."""
    robot, states = drawn(kind)
    motors = list(robot.motors)
    module = next(m for m in robot.modules if m.closures and m.motors)
    leg = next(joints for _, joints in module.legs if set(joints) & set(module.motors))
    kinds = dict(zip(robot.joints, robot.kinds, strict=True))
    other = next(j for j in leg if j not in motors and kinds[j] in ("revolute", "continuous"))
    motors[motors.index(next(j for j in leg if j in motors))] = other
    got = hybridyn.assemble(robot, motors=of_joints(robot, *states, motors), guess=states[0][0])
    assert closure_residual(robot, got[0]).max() <= CLOSED
    close_to(position(robot, other, got[0]), position(robot, other, states[0]), 1e-9)


def test_single_samples_come_back_as_single_samples() -> None:
    robot, states = drawn("five_bar")
    one = [x[0] for x in states]
    motors = {m: tuple(float(x) for x in values) for m, values in of_joints(robot, *one).items()}
    q, v, a = hybridyn.assemble(robot, motors=motors)
    assert (q.shape, v.shape, a.shape) == ((robot.nq,), (robot.nv,), (robot.nv,))
    same(robot, (q[None], v[None], a[None]), tuple(x[:1] for x in states))  # type: ignore[arg-type]
    at_rest = hybridyn.assemble(robot, motors={m: x[0] for m, x in motors.items()})
    close_to(at_rest[0], q, SAME)
    assert not at_rest[1].any()
    batch = hybridyn.assemble(robot, motors={m: (np.full(3, x[0]), x[1]) for m, x in motors.items()})
    assert batch[0].shape == (3, robot.nq)
    close_to(batch[1], np.tile(v, (3, 1)), SAME_RATES)


# -------------------------------------------------------------------- along motions


def waves(robot: HybridRobot, time: Array, size: float) -> dict[str, tuple[Array, Array, Array]]:
    """Return motors moving about home, smooth, with exact rates."""
    out = {}
    for i, motor in enumerate(robot.motors):
        w, phase = 2.0 + 0.3 * i, 0.7 * i
        home = position(robot, motor, robot.home)
        wave = size * np.sin(w * time + phase) - size * np.sin(phase)
        out[motor] = (
            home + wave,
            size * w * np.cos(w * time + phase),
            -size * w * w * np.sin(w * time + phase),
        )
    return out


@pytest.mark.parametrize(
    "name", ["five_bar", "gough_stewart", "rps3", "delta", "tanev", "scara_delta", "stewart_ur5"]
)
def test_rates_and_accelerations_are_the_derivatives_of_positions(name: str) -> None:
    """Wrists that were cut among them: all joints of the spanning tree."""
    robot = build_robot(shipped(name))
    middle = np.linspace(0, 2, 12)
    time = (middle[:, None] + STEP * np.arange(-1, 2)).ravel()
    q, v, a = hybridyn.assemble(robot, motors=waves(robot, time, 0.02))
    assert closure_residual(robot, q).max() <= CLOSED
    q, v, a = (x.reshape(len(middle), 3, -1) for x in (q, v, a))
    steps = np.array([pin.difference(robot.model, x[0], x[2]) for x in q])
    close_to(steps / (2 * STEP), v[:, 1], DIFFERENCED)
    close_to((v[:, 2] - v[:, 0]) / (2 * STEP), a[:, 1], DIFFERENCED)


@pytest.mark.parametrize("name", ["gough_stewart", "rps3", "five_bar"])
def test_steps_ten_times_too_long_stay_on_the_branch(name: str) -> None:
    """Every tenth row of a motion gives every tenth posture."""
    robot = build_robot(shipped(name))
    time = np.linspace(0, 6, 241)
    motors = waves(robot, time, 0.04)
    q, v, a = hybridyn.assemble(robot, motors=motors)
    coarse = {m: tuple(x[::10] for x in values) for m, values in motors.items()}
    same(robot, hybridyn.assemble(robot, motors=coarse), (q[::10], v[::10], a[::10]))


def test_a_trajectory_does_not_depend_on_where_it_is_cut() -> None:
    """Blocks that begin where the last one ended give the same rows."""
    robot = build_robot(shipped("gough_stewart"))
    motors = waves(robot, np.linspace(0, 1, 26), 0.1)
    whole = hybridyn.assemble(robot, motors=motors)
    first = hybridyn.assemble(robot, motors={m: tuple(x[:9] for x in y) for m, y in motors.items()})
    rest = hybridyn.assemble(
        robot, motors={m: tuple(x[9:] for x in y) for m, y in motors.items()}, guess=first[0][-1]
    )
    same(robot, tuple(np.concatenate(pair) for pair in zip(first, rest, strict=True)), whole)  # type: ignore[arg-type]


def test_motors_that_turn_without_end() -> None:
    """A crank of a continuous joint over three turns; the gear at 1.5 turns of a second one with it."""
    robot, _ = drawn("gear_rack")
    crank = next(m for m in robot.motors if m in robot.description.endless_gears)
    others = {m: position(robot, m, robot.home) for m in robot.motors if m != crank}
    angle = position(robot, crank, robot.home) + np.linspace(0, 2.5, 40)
    q, _, _ = hybridyn.assemble(robot, motors={crank: angle, **others})
    assert closure_residual(robot, q).max() <= CLOSED


# -------------------------------------------------------------------- first postures


HALF_A_TURN = ("four_bar", "five_bar", "slider_crank", "gough", "rps3", "stack", "delta_rods", "on_leg")


@pytest.mark.parametrize(
    "kind", some(HALF_A_TURN, ("four_bar", "five_bar", "slider_crank", "gough", "on_leg"))
)
def test_a_guess_half_a_turn_away_still_closes(kind: str) -> None:
    """Every passive joint nearly half a turn off: some posture is found, with the motors where wanted."""
    robot, states = drawn(kind)
    rng = np.random.default_rng(3)
    step = np.pi * 0.97 * rng.choice([-1.0, 1.0], robot.nv)
    slides = [robot.v_slices[i].start for i, k in enumerate(robot.kinds) if k == "prismatic"]
    step[slides] = 0.2
    guess = pin.integrate(robot.model, robot.home, step)
    motors = of_joints(robot, *(x[0] for x in states))
    q, v, a = hybridyn.assemble(robot, motors=motors, guess=guess)
    assert closure_residual(robot, q) <= CLOSED
    for motor, (wanted, *_) in motors.items():
        assert abs(np.sin((position(robot, motor, q) - wanted) / 2)) < CLOSED
    oracle = Oracle(robot.description)
    assert np.abs(oracle.residual(q)).max() < 1e-9  # closed the right way round, too
    hybridyn.idm(robot, q, v, a)


@pytest.mark.parametrize("engine", ["general", slow("compiled")])
def test_the_guess_chooses_the_branch(engine: str) -> None:
    """Tip above or below the motors: each guess keeps its own."""
    robot = build_robot(symmetric_five_bar())
    on = engine_of(engine, robot)
    up, *_ = on.assemble(motors={"left": 2.0, "right": 1.1})
    mirrored = up.copy()
    for joint, i in (("left_elbow", 0), ("right_elbow", 1)):
        at = robot.q_slices[robot.joints.index(joint)]
        rods = position(robot, joint, up) + (2.0, 1.1)[i]
        B = np.array([0.4 * np.cos(2.0), 0.4 * np.sin(2.0)])
        D = np.array([0.5 + 0.4 * np.cos(1.1), 0.4 * np.sin(1.1)])
        across = np.arctan2(*(D - B)[::-1])
        angle = 2 * across - rods - (2.0, 1.1)[i]
        mirrored[at] = [np.cos(angle + 0.05), np.sin(angle + 0.05)]
    down, *_ = on.assemble(motors={"left": 2.0, "right": 1.1}, guess=mirrored)
    assert far_apart(robot, down[None], mirrored[None]) < 0.1
    assert far_apart(robot, up[None], down[None]) > 1.0


# -------------------------------------------------------------------- out of reach


def stretched(robot: HybridRobot, excess: float) -> dict[str, float]:
    """Return crank angles that hold the elbows 2 L2 + excess apart: the rods' line is stretched."""
    L1, L2, width = 0.4, 0.55, 0.5
    t = np.arccos((L2 + excess / 2 - width / 2) / L1)
    return {"left": np.pi - t, "right": t}


@pytest.mark.parametrize("excess", [1e-9, 1e-6, 1e-2])
def test_unreachable_targets_are_errors_with_the_best_residual(excess: float) -> None:
    """Beyond closure_tolerance; closer than that, the file might be rounded, and exact loops may not."""
    robot = build_robot(symmetric_five_bar(), closure_tolerance=min(1e-4, excess / 10))
    hybridyn.assemble(robot, motors=stretched(robot, -1e-3))
    asked = partial(hybridyn.assemble, robot, motors=stretched(robot, excess))
    words, module = r"do not close at sample 0: best residual.*out of reach", robot.modules[0].name
    error = refused(asked, AssemblyError, words, module=module, residual=pytest.approx(excess, rel=0.6))
    assert "tip" in str(error.leg)
    assert error.iterations


#: Rows from one distance of the elbows to another, relative to stretched rods, and the row that is refused.
TOO_FAR = {
    "out of the workspace and back": (-0.2, 0.1, [0.0, 0.03, 1.0, 0.0], 2),
    "past the end of a branch": (-0.02, 0.02, [0.0, 0.25, 2.0], 2),
}


@pytest.mark.parametrize("way", TOO_FAR)
def test_rows_out_of_reach_are_errors_at_their_row(way: str) -> None:
    """Cranks may spread until the rods are stretched, and not further."""
    robot = build_robot(symmetric_five_bar())
    first, last, parts, row = TOO_FAR[way]
    near, there = stretched(robot, first), stretched(robot, last)
    asked = partial(
        hybridyn.assemble, robot, motors={m: near[m] + np.array(parts) * (there[m] - near[m]) for m in near}
    )
    refused(asked, AssemblyError, f"at sample {row}", sample=row, module=robot.modules[0].name)


def test_a_crank_that_passes_all_around_comes_back_to_where_it_was() -> None:
    robot, _ = drawn("four_bar")
    angles = position(robot, robot.motors[0], robot.home) + np.linspace(0, 2 * np.pi, 60)
    path = hybridyn.assemble(robot, motors={robot.motors[0]: angles})[0]
    at = robot.q_slices[robot.joints.index(robot.motors[0])]
    assert robot.kinds[robot.joints.index(robot.motors[0])] == "revolute"
    end = path[-1:].copy()
    end[:, at] -= 2 * np.pi
    assert far_apart(robot, path[:1], end) < SAME


# -------------------------------------------------------------------- too little, too much, wrong


def test_missing_inputs_are_named() -> None:
    robot, (arm, states) = build_robot(shipped("five_bar")), drawn("serial")
    few = {m: position(robot, m, robot.home) for m in robot.motors[:1]}
    module = robot.modules[0].name
    for on, given, words, data in (
        (
            robot,
            {"motors": few},
            rf"leaves 1 of 2 freedoms of .* still move. Give positions of '{robot.motors[1]}', too, or ",
            {"module": module},
        ),
        (robot, {}, "leaves 2 of 2 freedoms", {}),
        (
            arm,
            {"motors": of_joints(arm, *states, arm.modules[0].motors)},
            "does not determine joint '.*'. Give its position, too, or the pose of a link that it moves",
            {},
        ),
    ):
        refused(partial(hybridyn.assemble, on, **given), AssemblyError, words, **data)


@pytest.mark.parametrize("name", ["five_bar", "rps3", "gough_stewart", "delta", "tanev"])
def test_the_joints_that_a_message_asks_for_determine_the_posture(name: str) -> None:
    """Whatever is missing, and also where the robot has fewer motors than freedoms."""
    robot = build_robot(shipped(name))
    for motors in (robot.motors, robot.motors[1:]):
        weak = build_robot(replace(shipped(name), motors=motors))
        given: dict[str, float] = {}
        for _ in weak.modules:
            try:
                hybridyn.assemble(weak, motors=given, guess=weak.home)
            except AssemblyError as error:
                asked = re.findall(r"'([^']*)'", str(error).partition("Give ")[2].partition(", too")[0])
                assert asked
                given |= {joint: position(weak, joint, weak.home) for joint in asked}
        hybridyn.assemble(weak, motors=given, guess=weak.home)


@pytest.mark.parametrize("name", ["rps3", "gough_stewart", "tanev"])
def test_a_joint_of_a_wrist_is_given_once_it_is_held(name: str) -> None:
    robot = build_robot(shipped(name))
    kept = {m.joints[i] for m in robot.modules for i in m.mechanism.spec.tree_joint if i is not None}
    joint = next(one for one in robot.joints if one not in kept)
    given = {one: position(robot, one, robot.home) for one in (*robot.motors, joint)}
    refused(partial(hybridyn.assemble, robot, motors=given), AssemblyError, rf"held=\['{joint}'\]")
    held = build_robot(shipped(name), held=[joint])
    q = hybridyn.assemble(held, motors=given, guess=held.home)[0]
    close_to(position(held, joint, q), given[joint], 1e-9)


def full_pose(robot: HybridRobot, count: int = 2) -> tuple[str, States, States]:
    states = taken(robot, count)
    platform = robot.modules[0].outputs[0]
    return platform, of_link(robot, *states, platform, robot.description.root), states


@pytest.mark.parametrize("off", [0.0, 1e-7, 1e-5])
def test_a_whole_pose_of_a_platform_with_fewer_freedoms_within_tolerance(off: float) -> None:
    """A 3-RPS given six coordinates, rounded: accepted, and loops closed to rounding all the same."""
    robot = build_robot(shipped("rps3"))
    platform, (pose, twist, acceleration), states = full_pose(robot)
    pose = pose + off * np.array([1, -1, 0, 0, 0, 0, 0.0])
    q, v, a = hybridyn.assemble(robot, platforms={platform: (pose, twist, acceleration)})
    assert closure_residual(robot, q).max() <= CLOSED
    assert far_apart(robot, q, states[0]) < 100 * off + 1e-8
    hybridyn.idm(robot, q, v, a)


@pytest.mark.parametrize(("off", "row"), [(1e-3, 0), (0.1, 0), (0.1, 2), (1.0, 0)])
def test_a_whole_pose_beyond_tolerance_is_an_error_at_its_row(off: float, row: int) -> None:
    robot = build_robot(shipped("rps3"))
    platform, (pose, twist, acceleration), _ = full_pose(robot, 3)
    pose[row:] += off * np.array([1, -1, 0, 0, 0, 0, 0.0])
    asked = partial(hybridyn.assemble, robot, platforms={platform: (pose, twist, acceleration)})
    error = refused(asked, AssemblyError, rf"do not close at sample {row}.*limit 1e-04", sample=row)
    assert error.residual > 1e-4


def test_motors_on_every_joint_may_miss_the_loops_within_tolerance() -> None:
    """Nothing is free then: positions and rates are corrected to the nearest that keep the loops closed."""
    robot = build_robot(random_mechanism(0, kind="five_bar_four_motors"))
    state = hybridyn.assemble(robot, motors=dict.fromkeys(robot.motors[:2], (0.1, 1.0, 0.0)))
    q, v = [position(robot, name, state[0]) for name in robot.motors], state[1][robot.motor_v]
    noise = 1e-6 * np.random.default_rng(0).normal(size=(2, 4))
    given = {name: (q[i] + noise[0, i], v[i] + noise[1, i], 0.0) for i, name in enumerate(robot.motors)}
    found = hybridyn.assemble(robot, motors=given, guess=state[0])
    assert closure_residual(robot, found[0]) < 1e-12
    close_to(found[0], state[0], 1e-5)
    close_to(found[1], state[1], 1e-5)


def redundant() -> tuple[HybridRobot, States]:
    """Return a five-bar with three motors and a motion of it."""
    robot = hybridyn.load("five_bar", motors=["m1_left_drive", "m1_right_drive", "m1_left_elbow"])
    t = np.linspace(0.0, 2.0, 41)
    wave = 0.1 * np.sin(3 * t), 0.3 * np.cos(3 * t), -0.9 * np.sin(3 * t)
    return robot, hybridyn.assemble(robot, motors=dict.fromkeys(robot.motors[:2], wave))


def of_motors(robot: HybridRobot, states: States) -> list[np.ndarray]:
    """Return positions, rates and accelerations of the motors, shape (T, motors) each."""
    return [x[:, at].copy() for x, at in zip(states, (robot.motor_q, *2 * [robot.motor_v]), strict=True)]


@pytest.mark.parametrize("engine", ["general", slow("compiled")])
@pytest.mark.parametrize(("level", "what"), [(1, "rates"), (2, "accelerations")])
def test_more_motors_than_freedoms_that_contradict_one_another_are_refused(
    engine: str, level: int, what: str
) -> None:
    """One of three motors has another number at one sample; within the limit the motion is the nearest."""
    robot, states = redundant()
    on, given = engine_of(engine, robot), of_motors(robot, states)
    for found, wanted in zip(on.assemble(motors=tuple(given)), states, strict=True):
        close_to(found, wanted, 1e-10)
    largest, number = np.abs(states[level]).max(), given[level][7, 2]
    given[level][7, 2] += 1e-3 * largest
    noisy = on.assemble(motors=tuple(given))
    assert 1e-5 * largest < np.abs(noisy[level] - states[level]).max() < 1e-2 * largest
    given[level][7, 2] = number + 0.5 * largest
    words = f"the {what} given at sample 7 contradict one another"
    error = refused(partial(on.assemble, motors=tuple(given)), AssemblyError, words, sample=7)
    for part in (
        "'m1_left_elbow'",
        f"{given[level][7, 2]:.6g}",
        "of the largest apart (limit 0.01)",
        "Give 2",
    ):
        assert part in str(error)


def test_rounding_at_rest_contradicts_nothing_whatever_else_moves() -> None:
    """A sample is judged by its own numbers, not by its neighbours, nor by rounding at rest."""
    robot = build_robot(shipped("rps3"))
    platform, (pose, twist, acceleration), _ = full_pose(robot, 3)
    twist[2], acceleration[2] = 1e-12 * twist[2][::-1], 1e-9 * acceleration[2][::-1]
    for samples in (slice(0, 3), slice(2, 3)):
        given = pose[samples], twist[samples], acceleration[samples]
        _, v, _ = hybridyn.assemble(robot, platforms={platform: given})
        assert np.abs(v[-1]).max() < 1e-10


def test_measured_motions_may_contradict_themselves() -> None:
    robot, states = redundant()
    given = of_motors(robot, states)
    given[1][7, 2] += 0.5
    _, v, _ = hybridyn.assemble(robot, motors=tuple(given), nearest=True)
    assert 0.05 < np.abs(v[7] - states[1][7]).max() < 0.5


def test_accelerations_that_are_left_out_are_the_nearest() -> None:
    robot, states = redundant()
    q, v, a = hybridyn.assemble(robot, motors=tuple(of_motors(robot, states)[:2]))
    close_to(v, states[1], 1e-10)
    assert np.isfinite(hybridyn.idm(robot, q, v, a)).all()  # which checks that they keep the loops closed


def test_a_twist_with_more_coordinates_than_freedoms_that_contradicts_itself_is_refused() -> None:
    robot = build_robot(shipped("rps3"))
    platform, (pose, twist, acceleration), _ = full_pose(robot, 3)
    twist[1, 0] += np.abs(twist).max()
    asked = partial(hybridyn.assemble, robot, platforms={platform: (pose, twist, acceleration)})
    refused(asked, AssemblyError, "the rates given at sample 1 contradict one another", sample=1)


def test_the_coordinate_whose_rate_contradicts_the_others_is_named() -> None:
    """Those of a five-bar's tool: its pitch follows from x and z."""
    robot = build_robot(shipped("five_bar"))
    near = hybridyn.assemble(robot, motors=np.array([0.1, 0.2]))[0]
    x, _, z, *turn = of_link(robot, near[None], *np.zeros((2, 1, robot.nv)), "m1_tool", "m1_base")[0][0]
    pose, still = {"x": x, "z": z, "pitch": 2 * np.arctan2(turn[1], turn[3])}, {"x": 0.0, "z": 0.0}
    asked = partial(hybridyn.assemble, robot, platforms={"m1_tool": (pose, {**still, "pitch": 1.0})})
    refused(asked, AssemblyError, "contradict one another: (x|z|pitch) of 'm1_tool' differs by")


def test_motors_may_be_arrays_in_their_order() -> None:
    robot, x = build_robot(symmetric_five_bar()), np.array([[2.0, 1.1], [2.1, 1.2], [2.2, 1.3]])
    by_name = {name: (x[:, i], 2 * x[:, i]) for i, name in enumerate(robot.motors)}
    wanted = hybridyn.assemble(robot, motors=by_name)
    for found, one in zip(hybridyn.assemble(robot, motors=(x, 2 * x)), wanted, strict=True):
        np.testing.assert_array_equal(found, one)
    np.testing.assert_array_equal(wanted[0][:, robot.motor_q], x)
    np.testing.assert_array_equal(wanted[1][:, robot.motor_v], 2 * x)
    for single in ([2.0, 1.1], (2.0, 1.1), x[0]):
        np.testing.assert_array_equal(hybridyn.assemble(robot, motors=single)[0], wanted[0][0])
    accelerated = hybridyn.assemble(robot, motors=(x[0], None, x[0]))
    np.testing.assert_array_equal(accelerated[1][robot.motor_v], [0.0, 0.0])
    np.testing.assert_array_equal(accelerated[2][robot.motor_v], x[0])


def test_poses_may_be_matrices_or_placements_of_pinocchio() -> None:
    robot = build_robot(shipped("rps3"))
    platform, (poses, twist, _), _ = full_pose(robot, 3)
    q, v, _ = hybridyn.assemble(robot, platforms={platform: (poses, twist)})
    placements = [pin.XYZQUATToSE3(pose) for pose in poses]
    matrices = np.array([placement.homogeneous for placement in placements])
    again = hybridyn.assemble(robot, platforms={platform: (matrices, twist)})
    close_to(again[0], q, 1e-14)
    close_to(again[1], v, 1e-14 * np.abs(v).max())
    for pose in (placements[0], matrices[0], poses[0].tolist()):
        close_to(hybridyn.assemble(robot, platforms={platform: pose})[0], q[0], 1e-14)


BAD: dict[str, tuple[dict, dict, str]] = {
    "joint": ({"nobody": 0.1}, {}, "unknown joint 'nobody'"),
    "near": ({"left_elbo": 0.1}, {}, r"unknown joint 'left_elbo' \(did you mean 'left_elbow'\?\)"),
    "link": ({}, {"nobody": np.zeros(7)}, "unknown link 'nobody'"),
    "nan": ({"left": np.nan, "right": 0.0}, {}, "joint 'left' needs finite numbers"),
    "shape": ({"left": np.zeros((2, 2)), "right": 0.0}, {}, "joint 'left' needs finite numbers of shape"),
    "samples": ({"left": np.zeros(2), "right": np.zeros(3)}, {}, r"different numbers of samples: \[2, 3\]"),
    "parts": ({"left": (0.0, 0.0, 0.0, 0.0), "right": 0.0}, {}, "give \\(position, rate, acceleration\\)"),
    "pose": ({}, {"left_rod": np.zeros(6)}, r"needs finite numbers of shape \(7,\)"),
    "quaternion": ({}, {"left_rod": np.array([0, 0, 0, 0, 0, 0, 1.01])}, "quaternion of length 1.01"),
    "matrix": ({}, {"left_rod": 2 * np.eye(4)}, "is no placement: three axes"),
    "transposed": ({}, {"left_rod": np.eye(4) + np.eye(4, k=-2)}, "is no placement: three axes"),
    "large": ({"left": (0.0, 1e60), "right": 0.0}, {}, r"'left' needs finite numbers .* at most 1e\+50"),
    "large twist": ({}, {"left_rod": (np.eye(4), [1e60] * 6)}, r"needs finite numbers .*, at most 1e\+50"),
    "complex": ({"left": 1j, "right": 0.0}, {}, "joint 'left' is not an array of real numbers"),
    "ragged": (([[0.1], [0.1, 0.2]], None), {}, "motors is not an array of numbers"),
    "array": (np.zeros(3), {}, r"motors has shape \(3,\); wanted \(2,\) or \(T, 2\), as robot.motors"),
    "coordinate": ({}, {"left_rod": {"X": 0.0}}, "unknown coordinate 'X'"),
    "self": ({}, {"left_rod@left_rod": np.array([0, 0, 0, 0, 0, 0, 1.0])}, "are one rigid body"),
    "rates": ({}, {"left_rod": ({"x": 0.0}, {"y": 0.0})}, "must name the coordinates"),
}  # fmt: skip


@pytest.mark.parametrize("what", BAD)
def test_bad_inputs_are_refused(what: str) -> None:
    motors, platforms, words = BAD[what]
    asked = partial(hybridyn.assemble, build_robot(symmetric_five_bar()), motors=motors, platforms=platforms)
    refused(asked, TrajectoryError, words)


@pytest.mark.parametrize(
    ("guess", "words"),
    [
        (lambda home: np.zeros(3), "guess has 3 entries, the robot's q has 6"),
        (lambda home: home * np.nan, "not finite"), (lambda home: home * 1e60, "above 1e"),
        (lambda home: home * 0.0, "all zero"),
    ],
)  # fmt: skip
def test_a_guess_that_is_no_posture_is_refused(guess: Callable[[Array], Array], words: str) -> None:
    """Linear algebra failed with errors of its own."""
    robot = build_robot(symmetric_five_bar())
    asked = partial(hybridyn.assemble, robot, motors={"left": 2.0, "right": 1.1}, guess=guess(robot.home))
    refused(asked, AssemblyError, words)


# -------------------------------------------------------------------- idle motions and gimbal lock


def test_idle_spins_take_least_norm_rates() -> None:
    """The platform does not fix the rods' spins: their rates are the least that follow."""
    robot, states = drawn("sps_thin")
    oracle = Oracle(robot.description)
    platform = next(link.name for link in robot.description.links if link.name.endswith("platform_link"))
    given = {platform: of_link(robot, *states, platform, robot.description.root)}
    q, v, a = hybridyn.assemble(robot, platforms=given, guess=states[0][0])
    assert closure_residual(robot, q).max() <= CLOSED
    data, frame = robot.model.createData(), robot.model.getFrameId(platform, pin.BODY)
    for t in range(len(q)):
        motions = oracle.motions(q[t])
        J = pin.computeFrameJacobian(robot.model, data, q[t], frame, pin.LOCAL)
        _, s, Vt = np.linalg.svd(J @ motions)
        idle = motions @ Vt[np.sum(s > 1e-9 * s[0]) :].T  # turns only: no unit of length in them
        assert idle.shape[1] == 6
        for rates in (v[t], a[t] - oracle.consistent_acceleration(q[t], v[t], np.zeros(robot.nv))):
            assert np.abs(idle.T @ rates).max() < SAME_RATES * np.abs(a[t]).max() * np.abs(idle).max()
        close_to(oracle.project_velocity(q[t], v[t]), v[t], SAME_RATES)
        close_to(oracle.consistent_acceleration(q[t], v[t], a[t]), a[t], SAME_RATES)
    hybridyn.idm(robot, q, v, a, passive="solved")


def with_aligned_wrist(description: Description, off: float, carries: bool) -> Description:
    """Turn a wrist's third axis, at home, into its first one but for an angle: gimbal lock there."""
    bodies, graphs = find_modules(description)
    spec = module_spec(bodies, graphs[0], np.zeros(0))
    wrist = next(w for w in spec.wrists if len(w.joints) == 3 and w.carries == carries)
    joints = [bodies.joints[graphs[0].joints[j]].joint for j in wrist.joints]
    links = Oracle(description).posture(home_posture(description, "fixed")).links
    first, second = (links[j.child].E @ j.axis for j in joints[:2])
    wanted = turn(second, off) @ first
    old = joints[2]
    axis = links[old.child].E.T @ wanted
    (angle,) = description.home[old.name]
    back = np.eye(4)
    back[:3, :3] = turn(old.axis, angle) @ turn(axis, angle).T
    new = replace(old, axis=axis, placement=old.placement @ back)
    return replace(description, joints=tuple(new if j.name == old.name else j for j in description.joints))


@pytest.mark.parametrize("carries", [False, True])
@pytest.mark.parametrize("off", [0.0, 1e-11, 1e-6, 1e-2])
def test_gimbal_lock_of_a_cut_wrist_touches_nothing_else(
    carries: bool, off: float, caplog: pytest.LogCaptureFixture
) -> None:
    """Another wrist in the same place makes the same robot: at lock its rates are least-norm and flagged."""
    plain = random_mechanism(1, kind="gough_gimbals")
    twist, acceleration = np.array([0.1, -0.2, 0.3, 0.5, -0.4, 0.3]), np.array([1.0, 2, -1, 0.5, 1, 2])
    efforts = []
    for description in (plain, with_aligned_wrist(plain, off, carries)):
        robot = build_robot(description)
        assert sum(len(w.joints) == 3 for w in robot.modules[0].mechanism.spec.wrists) >= 3
        platform, zero = robot.modules[0].outputs[0], np.zeros((1, robot.nv))
        home = home_posture(description, "fixed")
        pose = of_link(robot, home[None], zero, zero, platform, description.root)[0][0]
        with caplog.at_level(logging.WARNING):
            q, v, a = hybridyn.assemble(robot, platforms={platform: (pose, twist, acceleration)}, guess=home)
        assert closure_residual(robot, q) <= CLOSED
        assert np.isfinite(v).all()
        assert np.isfinite(a).all()
        efforts.append(hybridyn.idm(robot, q, v, a))
    assert ("gimbal lock" in caplog.text) == (off < 1e-9)
    assert (
        np.abs(efforts[1] - efforts[0]).max() < max(1e-9, 1e-13 / max(off, 1e-9)) * np.abs(efforts[0]).max()
    )
