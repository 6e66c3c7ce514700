"""mass_matrix, bias and motion_map: against Pinocchio, the inverse model and the oracle; chosen joints."""

from collections.abc import Callable
from functools import partial

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn.errors import SingularityError, TrajectoryError
from hybridyn.structure.building import build_robot
from hybridyn.structure.robot import HybridRobot
from tests.comparing import SOLVED, close_to, refused
from tests.mechanisms import random_mechanism, random_states
from tests.oracle import Base, Oracle
from tests.peers import describe, example_urdf
from tests.quantities.flow import DIFFERENCE, neighbours, rate_along
from tests.quantities.reduced import columns_of, oracle_bias, oracle_drift, oracle_map, oracle_mass
from tests.shipped import shipped, states_near_home

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


def test_parts_of_the_bias() -> None:
    description = shipped("rps3")
    robot = build_robot(description)
    q, v, _ = states_near_home(description, "fixed", 2, 2)
    both = hybridyn.coriolis(robot, q, v) + hybridyn.gravity(robot, q)
    close_to(both, hybridyn.bias(robot, q, v), BALANCE)


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
    with pytest.raises(SingularityError, match=r"6 motors for 12 freedoms leave idle motions open"):
        hybridyn.motion_map(robot, q, v)


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
