"""coriolis_matrix, link_jacobian, delassus, operational_inertia: identities, other engines, refusals."""

from functools import partial
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn.errors import SingularityError, TrajectoryError
from hybridyn.structure.building import build_robot
from hybridyn.structure.robot import HybridRobot
from tests.comparing import SOLVED, close_to, refused, same_words
from tests.dynamics.test_idm import flat_five_bar
from tests.dynamics.test_lost_rank import parallelogram
from tests.mechanisms import random_mechanism, random_states
from tests.oracle import Base, Oracle
from tests.quantities.flow import DIFFERENCE, neighbours, rate_along
from tests.quantities.reduced import columns_of
from tests.samples import slow
from tests.shipped import ROBOTS, shipped, states_near_home

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
    with pytest.raises(SingularityError, match=r"cannot be moved in every direction at sample 0"):
        hybridyn.operational_inertia(flat, flat.home, flat.modules[0].outputs[0])


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


def test_a_parallel_singularity_is_refused_in_the_words_of_idm() -> None:
    robot, q = flat_five_bar()
    words = r"motors lose a direction at sample 0 \(parallel"
    for compute in (hybridyn.mass_matrix, hybridyn.motion_map, hybridyn.gravity):
        assert refused(partial(compute, robot, q), SingularityError, words, what="motors").condition > 1e10
    with pytest.raises(SingularityError, match=r"chosen joints lose a direction .*not independent"):
        hybridyn.mass_matrix(robot, q, joints=robot.motors)


def test_closures_that_lose_rank_are_refused_in_the_words_of_idm(tmp_path: Path) -> None:
    robot = parallelogram(tmp_path)
    asked = partial(hybridyn.bias, robot, np.zeros(3), np.array([1.0, -1.0, 1.0]))
    refused(asked, SingularityError, "closures lose rank at sample 0", what="closures")


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


def test_the_words_of_the_inverse_model_with_the_samples_number(tmp_path: Path) -> None:
    """At a change point of a parallelogram and in a flat five-bar, in the third sample of a batch."""
    robot = parallelogram(tmp_path)
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
    q, rest = np.array([robot.home, robot.home, flat]), np.zeros((3, robot.nv))
    words = (
        r"its motors lose a direction at sample 2 \(parallel singularity; .* motor 'left' is affected most\)"
    )
    for call in (lambda: hybridyn.idm(robot, q, rest, rest), lambda: hybridyn.bias(robot, q, rest)):
        refused(call, SingularityError, words)
