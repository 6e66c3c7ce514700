"""Compute energy, power, momentum and centre of mass in one pass over the bodies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ..effects.choice import STANDARD, Choice, Effects, choose, times
from ..effects.links import Wrench
from ..errors import TrajectoryError
from ..spatial import Array, cross, rotate, rotate_back
from ..structure.robot import HybridRobot
from ..structure.samples import as_efforts
from .link_motion import body_motions, link_motions, observed_motions
from .loads import gather_loads
from .state_checks import checked_state


@dataclass(frozen=True, eq=False)
class Energy:
    """Energy of a robot, shape () or (T,), [J].

    Attributes:
        kinetic: Kinetic energy of bodies and, if the effect is chosen, of rotors.
        potential: Potential energy of weights (zero at the world's origin), springs, stops and the ground.
    """

    kinetic: Array
    potential: Array

    @property
    def total(self) -> Array:
        """Kinetic and potential energy together."""
        return self.kinetic + self.potential


@dataclass(frozen=True, eq=False)
class Power:
    """Power balance of a robot, shape () or (T,), [W]: d(total energy)/dt = motors + wrenches - lost.

    The power of a prescribed base is not included: it is its reaction (`Reactions.base`) times its twist.

    Attributes:
        motors: Power of the motors.
        wrenches: Power of external wrenches.
        lost: Power that friction, dampers, stops and the ground dissipate.
    """

    motors: Array
    wrenches: Array
    lost: Array


def energy(robot: HybridRobot, q: Array, v: Array, *, effects: Choice = None) -> Energy:
    """Compute kinetic and potential energy.

    Args:
        robot: The robot.
        q: Positions, shape (nq,) or (T, nq).
        v: Rates, shape (nv,) or (T, nv).
        effects: Effects that contribute, as in `idm`: weights with "gravity", legs with "leg_inertia",
            rotors, springs, stops, ground.

    Raises:
        ModelError: Effects are unknown or lack parameters.
        TrajectoryError: An array has the wrong shape or is not finite.
    """
    q, v, single = checked_state(robot, q, v)
    on = choose(robot, effects)
    kinetic, potential = _masses_at(robot, on, q, v).energy(robot, on)
    add_energy_of_laws(robot, q, v, on, kinetic, potential)
    return Energy(kinetic[0], potential[0]) if single else Energy(kinetic, potential)


def add_energy_of_laws(
    robot: HybridRobot, q: Array, v: Array, on: Effects, kinetic: Array, potential: Array
) -> None:
    """Add the energy of rotors, springs, stops and the ground to that of the bodies, shape (T,) each."""
    for rotor in on.rotors:
        kinetic += 0.5 * np.sum(rotor.p[0] * v[:, rotor.columns] ** 2, axis=1)
    for joint_law in on.joints:
        potential += joint_law.energy(q)
    motions = observed_motions(robot, on, q, v)
    for link_law in on.links:
        potential += link_law.energy(motions)


def power(
    robot: HybridRobot, q: Array, v: Array, tau: Array, *, wrenches: Mapping[str, Array] | None = None,
    effects: Choice = None, time: ArrayLike | None = None,
) -> Power:  # fmt: skip
    """Compute the power that motors and wrenches supply and that friction dissipates.

    Args:
        robot: The robot.
        q: Positions, shape (nq,) or (T, nq).
        v: Rates, shape (nv,) or (T, nv).
        tau: Efforts, shape (motors,) or (T, motors); clipped if "limits" is among the effects.
        wrenches: External wrench on each link, by link name, shape (6,) or (T, 6), as in `idm`.
        effects: As in `idm`.
        time: Time of each sample, shape () or (T,), [s], for wrenches that follow a table.

    Raises:
        ModelError: Effects are unknown or lack parameters.
        TrajectoryError: An array has the wrong shape or is not finite, a link is unknown, or a table is too
            short.
    """
    q, v, single = checked_state(robot, q, v)
    tau = as_efforts(robot, tau)[0]
    on, clock = choose(robot, effects), times(time, len(q))
    if on.limits is not None:
        tau = on.limits.clip(robot, tau)
    columns = robot.motor_columns
    supplied, lost = np.zeros((2, len(q)))
    outer = replace(on, links=tuple(law for law in on.links if isinstance(law, Wrench)))
    gather_loads(robot, wrenches, len(q))  # raises the same errors as idm
    motions = observed_motions(robot, on, q, v)
    for given in (wrenches or {}, *outer.wrenches(motions, clock, len(q))):
        supplied += _work(robot, q, v, given)
    for joint_law in on.joints:
        lost += joint_law.power(q, v)
    for link_law in on.links:
        lost += link_law.power(motions)
    out = (np.sum(tau * v[:, columns], axis=1), supplied, lost)
    return Power(*(x[0] for x in out)) if single else Power(*out)


def momentum(robot: HybridRobot, q: Array, v: Array) -> Array:
    """Compute momentum and angular momentum about the centre of mass, world axes.

    Args:
        robot: The robot.
        q: Positions, shape (nq,) or (T, nq).
        v: Rates, shape (nv,) or (T, nv).

    Returns:
        Shape (6,) or (T, 6), [kg m/s, kg m^2/s]. The root link of a fixed base is excluded, as in Pinocchio.

    Raises:
        TrajectoryError: An array has the wrong shape or is not finite.
    """
    q, v, single = checked_state(robot, q, v)
    masses = _masses_at(robot, STANDARD, q, v)
    linear = masses.mass[:, None] * masses.velocity
    arm = masses.centre - masses.mean(robot)[:, None]
    out = np.concatenate([linear.sum(axis=1), (masses.spin + cross(arm, linear)).sum(axis=1)], axis=1)
    return out[0] if single else out


def centre_of_mass(robot: HybridRobot, q: Array) -> Array:
    """Compute the centre of mass in the world, shape (3,) or (T, 3), [m].

    Args:
        robot: The robot.
        q: Positions, shape (nq,) or (T, nq). The root link of a fixed base is excluded, as in Pinocchio.

    Raises:
        TrajectoryError: An array has the wrong shape or is not finite, or the robot has no moving mass.
    """
    q, v, single = checked_state(robot, q, None)
    out = _masses_at(robot, STANDARD, q, v).mean(robot)
    return out[0] if single else out


@dataclass(frozen=True, eq=False)
class Masses:
    """Bodies that have mass and can move, at samples; vectors in world axes.

    Attributes:
        mass: Masses, shape (k,), [kg].
        centre: Centres of mass, shape (T, k, 3), [m].
        velocity: Their velocities, shape (T, k, 3), [m/s].
        w: Angular velocities, shape (T, k, 3), [rad/s].
        spin: Angular momenta about these centres, shape (T, k, 3), [kg m^2/s].
    """

    mass: Array
    centre: Array
    velocity: Array
    w: Array
    spin: Array

    def energy(self, robot: HybridRobot, on: Effects) -> tuple[Array, Array]:
        """Compute the kinetic energy and that of the weights, shape (T,) each, [J]."""
        twice = self.mass * np.square(self.velocity).sum(axis=2) + (self.w * self.spin).sum(axis=2)
        height = (self.centre * (robot.gravity if on.gravity is not None else 0.0)).sum(axis=2)
        return twice.sum(axis=1) / 2 * (on.inertia is not None), -(self.mass * height).sum(axis=1)

    def mean(self, robot: HybridRobot) -> Array:
        """Compute the centre of mass of all, shape (T, 3), [m].

        Raises:
            TrajectoryError: There is no mass.
        """
        if not self.mass.any():
            raise TrajectoryError(f"robot '{robot.name}' has no moving mass, and so no centre of mass")
        out: Array = (self.mass[:, None] * self.centre).sum(axis=1) / self.mass.sum()
        return out


def moving_masses(robot: HybridRobot, on: Effects, R: Array, p: Array, w: Array, p_dot: Array) -> Masses:
    """Return the bodies whose inertia counts among some effects.

    Args:
        on: The effects; without the legs' inertia, the bodies of legs do not count.
        R: Axes of every body in the world, shape (T, bodies, 3, 3).
        p: Origins, shape (T, bodies, 3), [m].
        w: Angular velocities, shape (T, bodies, 3), [rad/s].
        p_dot: Velocities of the origins, shape (T, bodies, 3), [m/s].
    """
    numbers, mass, com, inertia = inertial_bodies(robot, on)
    R, p, w, p_dot = (x[:, numbers] for x in (R, p, w, p_dot))
    arm, spin = rotate(R, com), rotate(R, rotate(inertia, rotate_back(R, w)))
    return Masses(mass, p + arm, p_dot + cross(w, arm), w, spin)


def _masses_at(robot: HybridRobot, on: Effects, q: Array, v: Array) -> Masses:
    """Return the bodies whose inertia counts at positions q, shape (T, nq), and rates v, shape (T, nv)."""
    motions = body_motions(robot, q, v, np.zeros_like(v))
    parts = zip(*(motions[i].arrays[:4] for i in range(len(motions))), strict=True)
    return moving_masses(robot, on, *(np.stack(part, axis=1) for part in parts))


def inertial_bodies(robot: HybridRobot, on: Effects) -> tuple[list[int], Array, Array, Array]:
    """Return the bodies whose inertia counts: numbers, mass (k,), centre (k, 3), inertia there (k, 3, 3)."""
    legs = leg_bodies(robot) if on.leg_inertia is None else set()
    numbers = [
        i
        for i, body in enumerate(robot.bodies.bodies)
        if (i or robot.base != "fixed") and i not in legs and not body.massless
    ]
    bodies = [robot.bodies.bodies[i] for i in numbers]
    mass, com = np.array([body.mass for body in bodies]), np.array([body.com for body in bodies])
    inertia = np.array([body.inertia for body in bodies])
    return numbers, mass, com.reshape(-1, 3), inertia.reshape(-1, 3, 3)


def leg_bodies(robot: HybridRobot) -> set[int]:
    """Return the numbers of the bodies whose inertia belongs to the legs."""
    out = set()
    for module in robot.modules:
        spec = module.mechanism.spec
        for i, inertia in enumerate(spec.leg_bodies):
            if inertia is not None:
                out.add(robot.body_of_joint[module.joints[spec.tree_body[i + 1] - 1]])
    return out


def _work(robot: HybridRobot, q: Array, v: Array, wrenches: Mapping[str, Array]) -> Array:
    """Compute the power of wrenches on links, shape (T,)."""
    out = np.zeros(len(q))
    for link, m in link_motions(robot, q, v, list(wrenches)).items():
        W = np.broadcast_to(wrenches[link], (len(q), 6))
        out += np.sum(W[:, :3] * rotate_back(m.R, m.p_dot) + W[:, 3:] * rotate_back(m.R, m.w), axis=1)
    return out
