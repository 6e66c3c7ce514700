"""Compute energy, power, momentum and centre of mass in one pass over the bodies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..effects.choice import Choice, Effects, choose, times
from ..errors import ModelError, TrajectoryError
from ..spatial import Array
from ..structure.robot import HybridRobot
from ..structure.samples import as_efforts, as_positions, same_samples
from .direct import states_before, with_load_friction
from .link_motion import link_motions
from .loads import all_loads
from .state_checks import check_closed, checked_state

if TYPE_CHECKING:
    import pinocchio as pin


@dataclass(frozen=True, eq=False)
class Energy:
    """Energy of a robot, shape () or (T,), [J].

    Attributes:
        kinetic: Kinetic energy of bodies and, if the effect is chosen, of rotors.
        potential: Potential energy of weights (zero at the world's origin), springs, stops and the ground.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> q, v, a = hybridyn.assemble(robot, motors=([0.1, 0.2], [1.0, 0.0], [0.0, 0.0]))
        >>> found = hybridyn.energy(robot, q, v)
        >>> bool(found.total == found.kinetic + found.potential)
        True
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
        lost: Power that friction, gears, dampers, stops and the ground dissipate.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> q, v, a = hybridyn.assemble(robot, motors=([0.1, 0.2], [1.0, 0.0], [0.0, 0.0]))
        >>> found = hybridyn.power(robot, q, v, tau=[2.0, -1.0])
        >>> float(found.wrenches), float(found.lost)
        (0.0, 0.0)
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
        effects: Effects that contribute, as in `idm`: weights with "gravity", legs unless "massless_legs",
            rotors, springs, stops, ground.

    Raises:
        ModelError: Effects are unknown or lack parameters.
        TrajectoryError: An array has the wrong shape or is not finite.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> q, v, a = hybridyn.assemble(robot, motors=([0.1, 0.2], [1.0, 0.0], [0.0, 0.0]))
        >>> found = hybridyn.energy(robot, q, v)
        >>> round(float(found.kinetic), 4), round(float(found.potential), 3)
        (0.0403, -8.146)
    """
    q, v, single = checked_state(robot, q, v)
    on = choose(robot, effects)
    kinetic, potential = _of_bodies(robot, q, v, on)
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
    motions = link_motions(robot, q, v, on.observed_links)
    for link_law in on.links:
        potential += link_law.energy(motions)


def _of_bodies(robot: HybridRobot, q: Array, v: Array, on: Effects) -> tuple[Array, Array]:
    """Compute the kinetic and potential energy of the bodies, each of shape (T,)."""
    import pinocchio as pin

    model = effective_model(robot, on)
    data = model.createData()
    out = np.zeros((2, len(q)))
    for t in range(len(q)):
        pin.computeMechanicalEnergy(model, data, q[t], v[t])
        out[:, t] = data.kinetic_energy if on.inertia is not None else 0.0, data.potential_energy
    return out[0], out[1]


def effective_model(robot: HybridRobot, on: Effects) -> pin.Model:
    """Return the Pinocchio model without the weights or leg inertias that the effects leave out.

    Callers must not change the model: it may be that of the robot.
    """
    import pinocchio as pin

    if on.gravity is not None and on.leg_inertia is not None:
        return robot.unchanged_model
    model = pin.Model(robot.unchanged_model)
    if on.gravity is None:
        model.gravity.linear = np.zeros(3)
    if on.leg_inertia is None:
        legs = leg_bodies(robot)
        for joint in robot.bodies.joints:
            if joint.child in legs:
                model.inertias[model.getJointId(joint.joint.name)] = pin.Inertia.Zero()
    return model


def power(
    robot: HybridRobot, q: Array, v: Array, tau: Array, *, wrenches: Mapping[str, Array] | None = None,
    effects: Choice = None, time: ArrayLike | None = None,
) -> Power:  # fmt: skip
    """Compute the power that motors and wrenches supply and that friction dissipates.

    Args:
        robot: The robot.
        q: Positions, shape (nq,) or (T, nq).
        v: Rates, shape (nv,) or (T, nv).
        tau: Efforts, shape (motors,) or (T, motors); clipped by "limits" and "dc_motors".
        wrenches: External wrench on each link, by link name, shape (6,) or (T, 6), as in `idm`.
        effects: As in `idm`.
        time: Time of each sample, shape () or (T,), [s], for wrenches that follow a table.

    Raises:
        ModelError: Effects are unknown or lack parameters. With friction that grows with load: the motion
            does not determine a load on which it depends, or the base moves as no effect states, or an effect
            states the motion of a base that does not move.
        ActuationError: A gear locks itself, or friction that grows with load may jam joints.
        AssemblyError: The state does not close the loops; friction that grows with load alone asks this.
        SingularityError: As `ddm`, where friction that grows with load needs its model.
        TrajectoryError: An array has the wrong shape or is not finite, a link is unknown, or a table is too
            short.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> q, v, a = hybridyn.assemble(robot, motors=([0.1, 0.2], [1.0, 0.0], [0.0, 0.0]))
        >>> round(float(hybridyn.power(robot, q, v, tau=[2.0, -1.0]).motors), 6)
        2.0
    """
    q, v, single = checked_state(robot, q, v)
    tau = as_efforts(robot, tau)[0]
    same_samples(q=q, v=v, tau=tau)
    on, clock = choose(robot, effects), times(time, len(q))
    tau = on.within_bounds(robot, tau, v)
    columns, given_by_motors = robot.motor_v, tau
    if on.gears is not None:
        tau = on.gears.behind(robot, tau, v)
    supplied, lost = np.zeros((2, len(q)))
    outer = replace(on, links=tuple(law for law in on.links if not law.of_motion))
    loads = all_loads(robot, on, q, v, clock, wrenches)  # raises the same errors as idm
    lost += np.sum((given_by_motors - tau) * v[:, columns], axis=1)
    if on.loaded is not None:
        a = _with_base(robot, on, clock, q, v)
        states = states_before(robot, on, q, v, a)
        check_closed(robot, states, q, v)
        rubbing = with_load_friction(robot, states, q, v, a, tau, loads)
        lost -= np.sum((rubbing.joints - loads.joints) * v, axis=1)
    motions = link_motions(robot, q, v, on.observed_links)
    for given in (wrenches or {}, *outer.wrenches(motions, clock, len(q))):
        for link, motion in link_motions(robot, q, v, list(given)).items():
            supplied += np.sum(given[link] * motion.twist(), axis=1)
    for joint_law in on.joints:
        lost += joint_law.power(q, v)
    for link_law in on.links:
        lost += link_law.power(motions)
    out = (np.sum(given_by_motors * v[:, columns], axis=1), supplied, lost)
    return Power(*(x[0] for x in out)) if single else Power(*out)


def _with_base(robot: HybridRobot, on: Effects, clock: Array | None, q: Array, v: Array) -> Array:
    """Return accelerations, shape (T, nv), with those of a prescribed base and zeros.

    Raises:
        ModelError: The base moves as no effect states, or an effect moves one that does not.
    """
    out = np.zeros_like(v)
    if on.base is not None:
        return on.base.into(robot, clock, q, v, out)[2]
    if robot.base == "moving" and on.loaded is not None:
        name = on.loaded.effect.name
        raise ModelError(
            f"power: the effect '{name}' needs the acceleration of the moving base: name 'base_motion'",
            element=name,
        )
    return out


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

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> q, v, a = hybridyn.assemble(robot, motors=([0.1, 0.2], [1.0, 0.0], [0.0, 0.0]))
        >>> hybridyn.momentum(robot, q, v)[:3].round(3)
        array([-0.324,  0.   ,  0.215])
    """
    q, v, single = checked_state(robot, q, v)
    out = _by_pinocchio(robot, "computeCentroidalMomentum", 6, q, v)
    return out[0] if single else out


def centre_of_mass(robot: HybridRobot, q: Array) -> Array:
    """Compute the centre of mass in the world, shape (3,) or (T, 3), [m].

    Args:
        robot: The robot.
        q: Positions, shape (nq,) or (T, nq). The root link of a fixed base is excluded, as in Pinocchio.

    Raises:
        TrajectoryError: An array has the wrong shape or is not finite, or the robot has no moving mass.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> hybridyn.centre_of_mass(robot, [0.1, 0.0, 0.1, 0.0])[2].round(3)
        np.float64(-0.256)
    """
    q, single = as_positions(robot, q)
    out = _by_pinocchio(robot, "centerOfMass", 3, q)
    return out[0] if single else out


def _by_pinocchio(robot: HybridRobot, algorithm: str, width: int, *states: Array) -> Array:
    """Compute a quantity of all that moves by an algorithm of Pinocchio, shape (T, width).

    Raises:
        TrajectoryError: Nothing that moves has mass.
    """
    import pinocchio as pin

    model = robot.unchanged_model
    if not pin.computeTotalMass(model):
        raise TrajectoryError(f"robot '{robot.name}' has no moving mass, and so no centre of mass")
    compute = partial(getattr(pin, algorithm), model, model.createData())
    found = [np.array(compute(*state)) for state in zip(*states, strict=True)]
    return np.array(found).reshape(len(found), width)


def leg_bodies(robot: HybridRobot) -> set[int]:
    """Return the numbers of the bodies whose inertia belongs to the legs."""
    out = set()
    for module in robot.modules:
        spec = module.mechanism.spec
        for i, inertia in enumerate(spec.leg_bodies):
            if inertia is not None:
                out.add(robot.body_of_joint[module.joints[spec.tree_body[i + 1] - 1]])
    return out
