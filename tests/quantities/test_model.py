"""Quantities of closed-loop models: their definitions, what follows from them, and what is refused."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn.errors import SingularityError, TrajectoryError
from hybridyn.structure.building import build_robot
from hybridyn.structure.robot import HybridRobot
from tests.dynamics.test_guards import parallelogram
from tests.dynamics.test_idm import flat_five_bar
from tests.judges.peers import describe, example_urdf
from tests.oracle import Base, Oracle
from tests.quantities.reduced import (
    DIFFERENCE,
    columns_of,
    neighbours,
    oracle_bias,
    oracle_drift,
    oracle_map,
    oracle_mass,
    rate_along,
)
from tests.robots.mechanisms import random_mechanism, random_states
from tests.robots.shipped import ROBOTS, shipped, states_near_home
from tests.support.comparing import SOLVED, close_to, refused, same_words
from tests.support.samples import slow

#: Identity of the inverse model: rounding of its largest term.
BALANCE = 1e-12


def five_bar() -> HybridRobot:
    return build_robot(shipped("five_bar"))


def drawn(kind: str) -> HybridRobot:
    return build_robot(random_mechanism(0, kind=kind))


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_a_serial_robot_against_pinocchio(base: Base) -> None:
    robot = build_robot(describe(example_urdf("ur5_robot.urdf")), base=base)
    rng = np.random.default_rng(0)
    q = np.array([pin.integrate(robot.model, robot.home, rng.normal(size=robot.nv)) for _ in range(3)])
    v, data = rng.normal(size=(3, robot.nv)), robot.model.createData()
    M, force, weight = hybridyn.mass_matrix(robot, q), hybridyn.bias(robot, q, v), hybridyn.gravity(robot, q)
    columns = [c for m in robot.motors for c in [robot.v_slices[robot.joint_index[m]].start]]
    columns = list(range(6)) * (base == "floating") + columns
    link, along = robot.description.links[-1].name, {"world": pin.LOCAL_WORLD_ALIGNED, "link": pin.LOCAL}
    frame = robot.model.getFrameId(link, pin.BODY)
    for axes, J in ((axes, hybridyn.link_jacobian(robot, q, link, axes=axes)) for axes in along):
        for t in range(3):
            of_tree = pin.computeFrameJacobian(robot.model, data, q[t], frame, along[axes])
            close_to(J[t], of_tree[:, columns], SOLVED)
    for t in range(3):
        upper = np.triu(pin.crba(robot.model, data, q[t]))
        close_to(M[t], (upper + np.triu(upper, 1).T)[np.ix_(columns, columns)], SOLVED)
        close_to(force[t], pin.nonLinearEffects(robot.model, data, q[t], v[t])[columns], SOLVED)
        close_to(weight[t], pin.computeGeneralizedGravity(robot.model, data, q[t])[columns], SOLVED)


@pytest.mark.parametrize(
    ("name", "base"), [("five_bar", "fixed"), ("five_bar", "moving"), ("rps3", "moving")]
)
def test_the_model_is_idm(name: str, base: Base) -> None:
    description = shipped(name)
    robot = build_robot(description, base=base)
    q, v, a = states_near_home(description, base, 1, 2)
    columns = columns_of(Oracle(description, base), robot.motors)
    given = {"base_acceleration": a[:, :6]} if base == "moving" else {}
    for effects in (None, "model"):
        M = hybridyn.mass_matrix(robot, q, effects=effects)
        force = hybridyn.bias(robot, q, v, effects=effects, **given)
        tau = hybridyn.idm(robot, q, v, a, effects=effects)
        close_to(np.einsum("tij,tj->ti", M, a[:, columns]) + force, tau, BALANCE)


def test_rods_that_spin_idly_take_no_part() -> None:
    description = random_mechanism(0, kind="sps_thin")
    robot = build_robot(description)
    rng = np.random.default_rng(0)
    home = {m: float(robot.home[robot.q_slices[robot.joint_index[m]].start]) for m in robot.motors}
    given = {m: (home[m] + 0.01 * rng.normal(), *rng.normal(size=2)) for m in robot.motors}
    q, v, a = hybridyn.assemble(robot, motors=given)
    u_dot = np.array([given[m][2] for m in robot.motors])
    tau = hybridyn.mass_matrix(robot, q) @ u_dot + hybridyn.bias(robot, q, v)
    close_to(tau, hybridyn.idm(robot, q, v, a), SOLVED)
    refused(
        lambda: hybridyn.motion_map(robot, q, v),
        SingularityError,
        r"6 motors for 12 freedoms leave idle motions open",
    )


@pytest.mark.parametrize("kind", ["gough_floating", "planar_rpr", "on_leg", "central"])
def test_the_rate_of_the_map_by_differences_along_the_flow(kind: str) -> None:
    description = random_mechanism(0, kind=kind)
    robot = build_robot(description)
    q, v, _ = random_states(description, "fixed", 0, 1)
    difference = rate_along(hybridyn.motion_map(robot, neighbours(robot, q[0], v[0])))
    close_to(hybridyn.motion_map(robot, q, v)[1][0], difference, DIFFERENCE)


def test_any_independent_joints_will_do() -> None:
    description = random_mechanism(0, kind="four_bar_two_motors")
    robot = build_robot(description)
    q, v, _ = random_states(description, "fixed", 0, 2)
    oracle = Oracle(description)
    chosen = tuple(name for name, kind in zip(robot.joints, robot.kinds, strict=True) if kind == "revolute")[
        -1:
    ]
    E = hybridyn.motion_map(robot, q, joints=chosen)
    close_to(E[0], oracle_map(oracle, q[0], columns_of(oracle, chosen)), SOLVED)
    M = hybridyn.mass_matrix(robot, q, joints=chosen)
    close_to(M[1], oracle_mass(oracle, q[1], columns_of(oracle, chosen)), SOLVED)
    force = hybridyn.bias(robot, q, v, joints=chosen)
    close_to(force[1], oracle_bias(oracle, q[1], v[1], columns_of(oracle, chosen)), SOLVED)


def test_joints_of_cut_wrists_are_coordinates_too() -> None:
    robot = hybridyn.load("gough_stewart")
    q, v, _ = states_near_home(robot.description, "fixed", 0, 1)
    cut = next(j for j in robot.joints if j in robot.cut_joints)
    joints = (*robot.motors[1:], cut)
    oracle = Oracle(robot.description)
    E, E_dot = hybridyn.motion_map(robot, q, v, joints=joints)
    close_to(E[0], oracle_map(oracle, q[0], columns_of(oracle, joints)), SOLVED)
    drift = oracle_drift(oracle, q[0], v[0], columns_of(oracle, joints))
    close_to(E_dot[0] @ v[0, columns_of(oracle, joints)], drift, SOLVED)


#: Joints of a robot that are no coordinates, the error, and what it says.
REFUSALS: dict[str, tuple[Callable[[], HybridRobot], list[str] | None, type[Exception], str]] = {
    "unknown": (five_bar, ["nowhere", "m1_left_drive"], TrajectoryError, "unknown joint 'nowhere'"),
    "twice": (five_bar, ["m1_left_drive"] * 2, TrajectoryError, "is named twice"),
    "few": (
        five_bar,
        ["m1_left_drive"],
        SingularityError,
        "1 chosen joints for 2 freedoms leave the motion of",
    ),
    "many": (
        partial(drawn, "four_bar_two_motors"),
        None,
        SingularityError,
        "2 motors for 1 freedom cannot be independent",
    ),
    "ball": (partial(drawn, "serial_all"), ["spherical"], TrajectoryError, "is spherical and has 3 freedoms"),
}


@pytest.mark.parametrize("what", REFUSALS)
def test_bad_coordinates_are_refused(what: str) -> None:
    make, joints, error, words = REFUSALS[what]
    robot = make()
    if joints == ["spherical"]:
        joints = [robot.joints[robot.kinds.index("spherical")]]
    refused(lambda: hybridyn.mass_matrix(robot, robot.home, joints=joints), error, words)


#: Of the largest entry: a few sums of rounded terms.
EXACT = 1e-12


def moving_state(case: str, base: Base) -> tuple[HybridRobot, np.ndarray, np.ndarray, np.ndarray]:
    """Return a drawn or a shipped robot, one state of it and u."""
    drawn = not case.startswith("shipped")
    description = random_mechanism(0, kind=case) if drawn else shipped(case.removeprefix("shipped "))
    q, v, _ = (x[0] for x in (random_states if drawn else states_near_home)(description, base, 0, 1))
    if not drawn:
        v = v / 4  # the error of the differences grows with the fifth power, C with the first
    return (
        build_robot(description, base=base),
        q,
        v,
        v[columns_of(Oracle(description, base), description.motors)],
    )


@pytest.mark.parametrize(
    ("case", "base"),
    [("serial", "floating"), ("planar_rpr", "fixed"), ("central", "floating"), ("on_leg", "fixed"),
     *(slow(f"shipped {name}", "fixed") for name in ROBOTS)],
)  # fmt: skip
def test_the_coriolis_matrix_and_the_power_of_the_bias(case: str, base: Base) -> None:
    """C u = c; M_dot less 2C is skew; at u_dot = 0, u . (c + g) is the rate of energy."""
    within, least = (SOLVED, 1.0) if case.startswith("shipped") else (EXACT, 0.0)
    robot, q, v, u = moving_state(case, base)
    C, near = hybridyn.coriolis_matrix(robot, q, v), neighbours(robot, q, v)
    close_to(C @ u, hybridyn.coriolis(robot, q, v), within)
    skew = rate_along(hybridyn.mass_matrix(robot, near)) - 2 * C
    assert np.abs(skew + skew.T).max() <= DIFFERENCE * max(np.abs(C).max(), least)
    if base == "fixed":
        rates = np.einsum("tij,j->ti", hybridyn.motion_map(robot, near), u)
        supplied, energy = u @ hybridyn.bias(robot, q, v), hybridyn.energy(robot, near, rates).total
        assert abs(rate_along(energy) - supplied) <= DIFFERENCE * (abs(supplied) + np.abs(energy).max())


@pytest.mark.parametrize(
    ("name", "base"), [("rps3", "fixed"), ("rps3", "moving"), ("scara_delta", "floating")]
)
def test_the_jacobian_of_any_link(name: str, base: Base) -> None:
    """Twists are those of `kinematics`, for links in legs, in cut wrists, platforms and the root link."""
    description = shipped(name)
    robot = build_robot(description, base=base)
    q, v, _ = states_near_home(description, base, 0, 2)
    u = v[:, columns_of(Oracle(description, base), robot.motors)]
    carried = v * (np.arange(robot.nv) < 6) if base == "moving" else 0 * v
    every = hybridyn.kinematics(robot, q, v)
    only_base = hybridyn.kinematics(robot, q, carried)
    size = max(np.abs(motion.twist).max() for motion in every.values())
    for link in [*list(every)[::6], description.root]:
        twist = np.einsum("tij,tj->ti", hybridyn.link_jacobian(robot, q, link), u)
        assert np.abs(twist + only_base[link].twist - every[link].twist).max() <= SOLVED * size


@pytest.mark.parametrize(("name", "base"), [("rps3", "fixed"), ("five_bar", "floating")])
def test_delassus_is_j_over_m_over_j(name: str, base: Base) -> None:
    description = shipped(name)
    robot = build_robot(description, base=base)
    q, _, _ = states_near_home(description, base, 0, 2)
    links = [list(robot.bodies.place)[-1], description.root, list(robot.bodies.place)[2]]
    M = hybridyn.mass_matrix(robot, q, effects="model")
    for axes in ("world", "link"):
        J = np.concatenate([hybridyn.link_jacobian(robot, q, link, axes=axes) for link in links], axis=1)
        D = hybridyn.delassus(robot, q, links, axes=axes, effects="model")
        close_to(D, J @ np.linalg.solve(M, np.swapaxes(J, 1, 2)), SOLVED)
        np.testing.assert_array_equal(D, np.swapaxes(D, 1, 2))


def test_operational_inertia() -> None:
    description = shipped("gough_stewart")
    robot = build_robot(description)
    q, _, _ = states_near_home(description, "fixed", 0, 1)
    platform = robot.modules[0].outputs[0]
    inertia = hybridyn.operational_inertia(robot, q, platform)[0]
    close_to(inertia @ hybridyn.delassus(robot, q, platform)[0], np.eye(6), SOLVED)
    assert np.linalg.eigvalsh(inertia)[0] > 0
    flat = build_robot(shipped("rps3"))
    refused(
        lambda: hybridyn.operational_inertia(flat, flat.home, flat.modules[0].outputs[0]),
        SingularityError,
        r"cannot be moved in every direction at sample 0",
    )


def test_delassus_of_robots_without_a_motor_for_each_freedom() -> None:
    """A free body beside the mechanism: its inertia is its own, whatever the motors."""
    description = random_mechanism(0, kind="five_bar_one_motor")
    robot = build_robot(description)
    q, _, _ = random_states(description, "fixed", 0, 1)
    link = list(robot.bodies.place)[-1]
    wrench = np.array([1.0, -2.0, 0.5, 0.3, 0.2, -0.1])
    D = hybridyn.delassus(robot, q[0], link, axes="link")
    rest, none = np.zeros(robot.nv), np.zeros(len(robot.motors))
    still = ["inertia", "leg_inertia"]
    a = Oracle(description, gravity=(0.0, 0.0, 0.0)).ddm(q[0], rest, none, wrenches={link: wrench})
    close_to(hybridyn.ddm(robot, q[0], rest, none, wrenches={link: wrench}, effects=still), a, SOLVED)
    motion = hybridyn.kinematics(robot, q[0], a, links=[link])[link]
    R = pin.Quaternion(motion.pose[3:]).matrix()
    close_to(D @ wrench, np.concatenate([R.T @ motion.twist[:3], R.T @ motion.twist[3:]]), SOLVED)


def test_bad_questions_are_refused() -> None:
    robot = build_robot(shipped("five_bar"), base="moving")
    q, v, _ = states_near_home(robot.description, "moving", 0, 1)
    for call, words in (
        (lambda: hybridyn.coriolis_matrix(robot, q, v), r"the moving base has a twist"),
        (lambda: hybridyn.link_jacobian(robot, q, "nothing"), r"unknown link 'nothing'"),
        (
            lambda: hybridyn.delassus(robot, q, robot.description.root, axes="local"),
            r"axes must be 'world' or 'link', not 'local'",
        ),
    ):
        refused(call, TrajectoryError, words)


def test_singular_postures_are_refused_in_the_words_of_the_inverse_model(tmp_path: Path) -> None:
    """At a change point of a parallelogram and in a flat five-bar, alone and third in a batch."""
    robot = parallelogram(tmp_path)
    asked = partial(hybridyn.bias, robot, np.zeros(3), np.array([1.0, -1.0, 1.0]))
    refused(asked, SingularityError, "closures lose rank at sample 0", what="closures")
    q, _, _ = hybridyn.assemble(robot, motors={"a": (np.array([0.4, 0.5, 0.6]), 0.0, 0.0)})
    q[2] = 0.0
    rest, link = np.zeros((3, robot.nv)), list(robot.bodies.place)[-1]
    of_idm = partial(hybridyn.idm, robot, q, rest, rest)
    for call in (
        lambda: hybridyn.mass_matrix(robot, q),
        lambda: hybridyn.delassus(robot, q, link),
        lambda: hybridyn.operational_inertia(robot, q, link),
        lambda: hybridyn.joint_map(robot, q, robot.joints[1:2]),
    ):
        assert "closures lose rank at sample 2" in same_words(call, of_idm)
    robot, flat = flat_five_bar()
    words = r"motors lose a direction at sample 0 \(parallel"
    for compute in (hybridyn.mass_matrix, hybridyn.motion_map, hybridyn.gravity):
        assert refused(partial(compute, robot, flat), SingularityError, words, what="motors").condition > 1e10
    chosen = partial(hybridyn.mass_matrix, robot, flat, joints=robot.motors)
    refused(chosen, SingularityError, r"chosen joints lose a direction .*not independent")
    q, rest = np.array([robot.home, robot.home, flat]), np.zeros((3, robot.nv))
    words = (
        r"its motors lose a direction at sample 2 \(parallel singularity; .* motor 'left' is affected most\)"
    )
    for call in (lambda: hybridyn.idm(robot, q, rest, rest), lambda: hybridyn.bias(robot, q, rest)):
        refused(call, SingularityError, words)
