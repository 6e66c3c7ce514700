"""energy: against Pinocchio's model of the spanning tree, and what a moving base supplies."""

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn.spatial import rotation_from_quaternion
from hybridyn.structure.building import build_robot
from tests.judges.peers import Peer
from tests.oracle import Base
from tests.robots.effect_cases import every, rate_of
from tests.robots.mechanisms import random_mechanism, random_states
from tests.robots.shipped import shipped, states_near_home
from tests.support.comparing import close_to, refused

EXACT = 1e-12
BALANCE = 1e-9  # of the largest power: rounding of the difference
BASES: tuple[Base, ...] = ("fixed", "moving", "floating")


def against_pinocchio(robot: hybridyn.HybridRobot, q: np.ndarray, v: np.ndarray) -> None:
    """Compare energy, momentum and centre of mass of states with Pinocchio's."""
    peer = Peer(robot.description, robot.base)
    actual = hybridyn.energy(robot, q, v)
    lever = 9.81 * sum(link.mass for link in robot.description.links)  # [J], one metre up
    motion, centre = hybridyn.momentum(robot, q, v), hybridyn.centre_of_mass(robot, q)
    for t in range(len(q)):
        kinetic = pin.computeKineticEnergy(peer.model, peer.data, q[t], v[t])
        potential = pin.computePotentialEnergy(peer.model, peer.data, q[t])
        assert actual.kinetic[t] == pytest.approx(kinetic, rel=EXACT)
        assert actual.potential[t] == pytest.approx(potential, rel=EXACT, abs=EXACT * lever)
        close_to(centre[t], pin.centerOfMass(peer.model, peer.data, q[t]), 1e-11)
        close_to(motion[t], pin.computeCentroidalMomentum(peer.model, peer.data, q[t], v[t]).vector, 1e-11)
    against_links(robot, hybridyn.kinematics(robot, q, v), motion, centre)


def against_links(
    robot: hybridyn.HybridRobot, links: dict[str, Any], motion: np.ndarray, centre: np.ndarray
) -> None:
    """Compare momentum and centre of mass with sums over the links that move."""
    mass, moment, momentum = 0.0, np.zeros_like(centre), np.zeros_like(centre)
    for link in robot.description.links:
        if robot.base != "fixed" or robot.bodies.place[link.name][0]:
            pose, twist = links[link.name].pose, links[link.name].twist
            arm = rotation_from_quaternion(pose[:, 3:]) @ link.com
            mass += link.mass
            moment += link.mass * (pose[:, :3] + arm)
            momentum += link.mass * (twist[:, :3] + np.cross(twist[:, 3:], arm))
    close_to(centre, moment / mass, 1e-11)
    close_to(motion[:, :3], momentum, 1e-11)


DRAWN = ["on_leg", "branched", "gear_two", "loop_planar"]
CASES = [(name, base) for name in ("five_bar", "scara_delta", "gough_stewart") for base in BASES]


@pytest.mark.parametrize(("name", "base"), [*CASES, *((kind, "floating") for kind in DRAWN)])
def test_closed_robots_against_pinocchio(name: str, base: Base) -> None:
    description = random_mechanism(0, kind=name) if name in DRAWN else shipped(name)
    q, v, _ = (random_states if name in DRAWN else states_near_home)(description, base, 0, 2)
    against_pinocchio(build_robot(description, base=base), q, v)


def test_what_does_not_count_is_left_out() -> None:
    description = shipped("gough_stewart")
    robot = build_robot(description)
    q, v, _ = states_near_home(description, "fixed", 0, 2)
    platform = robot.bodies.bodies[robot.bodies.place[robot.modules[0].outputs[0]][0]]
    bare = tuple(
        link if link.name == platform.name else replace(link, mass=0.0, inertia=np.zeros((3, 3)))
        for link in description.links
    )
    alone = build_robot(replace(description, links=bare))
    actual = hybridyn.energy(robot, q, v, effects=["default", "massless_legs"])
    close_to(actual.total, hybridyn.energy(alone, q, v).total, EXACT)
    weightless = hybridyn.energy(robot, q, v, effects=["inertia", "leg_inertia"])
    assert not weightless.potential.any()
    np.testing.assert_array_equal(weightless.kinetic, hybridyn.energy(robot, q, v).kinetic)
    assert not hybridyn.energy(robot, q, v, effects=["gravity", "leg_inertia"]).kinetic.any()


def test_a_moving_base_supplies_what_is_missing() -> None:
    description = shipped("five_bar")
    robot = build_robot(description, base="moving")
    q, v, a = states_near_home(description, "moving", 0, 3)
    effects, wrenches = ["default", *every(robot)], {description.root: np.array([3.0, 2, 1, 0.3, 0.2, 0.1])}
    # Gravity and the legs stand in `every` too; a name counts once.
    given = {"effects": effects, "time": 0.7, "wrenches": wrenches}
    tau, reactions = hybridyn.idm(robot, q, v, a, reactions=True, **given)
    supplied = hybridyn.power(robot, q, v, tau, **given)
    base = np.sum(reactions.base * v[:, :6], axis=1)
    gained = rate_of(robot, lambda q, v: hybridyn.energy(robot, q, v, effects=effects).total, q, v, a)
    missing = supplied.motors + supplied.wrenches - supplied.lost + base - gained
    assert np.abs(missing).max() < BALANCE * np.abs(gained).max()


def test_mistakes() -> None:
    description = shipped("five_bar")
    robot = build_robot(description)
    q, v, _ = states_near_home(description, "fixed", 0, 2)
    refused(lambda: hybridyn.energy(robot, q, v[:1]), hybridyn.TrajectoryError, "samples")
    pushed = partial(hybridyn.power, robot, q, v, np.zeros((2, 2)), wrenches={"nowhere": np.zeros(6)})
    refused(pushed, hybridyn.TrajectoryError, "unknown link")
    empty = tuple(replace(link, mass=0.0, inertia=np.zeros((3, 3))) for link in description.links)
    bare = build_robot(replace(description, links=empty))
    refused(lambda: hybridyn.centre_of_mass(bare, q), hybridyn.TrajectoryError, "no moving mass")
