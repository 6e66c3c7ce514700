"""What the motors hold at u_dot = 0: Coriolis, centrifugal and gravity terms of tau = M u_dot + c + g.

One pass of the inverse model's recursion (Eqs. (30)-(32)) at the accelerations that u_dot = 0 leaves, the
drift of dq/du; Q along the independent coordinates is the result. Linear in the number of modules.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ...effects.choice import Choice, Effects, choose, times
from ...errors import ModelError
from ...spatial import Array
from ...structure.robot import HybridRobot
from ..direct import acceleration_of_base
from ..forward import forward
from ..inverse_recursion import module_forces
from ..loads import all_loads
from .coordinates import Coordinates, independent_coordinates
from .independent import independent_motions
from .motion_map import whole_drift
from .states import checked_state, closed_states

#: Effects that c is made of: what is quadratic in the rates.
QUADRATIC = ("inertia", "leg_inertia", "velocity", "rotor_inertia")
#: Effects that g is made of.
WEIGHTS = ("gravity", "inertia", "leg_inertia")


def bias(
    robot: HybridRobot,
    q: ArrayLike,
    v: ArrayLike,
    *,
    joints: Sequence[str] | None = None,
    effects: Choice = None,
    time: ArrayLike | None = None,
    base_acceleration: ArrayLike | None = None,
) -> Array:
    """Compute c(q, v) + g(q) of tau = M u_dot + c + g: the generalised force along u at u_dot = 0.

    Args:
        robot: The robot.
        q: Positions of the spanning tree, shape (nq,) or (T, nq).
        v: Rates, shape (nv,) or (T, nv), [m/s, rad/s].
        joints: Independent joints u, in each module as many as its degrees of freedom; the motors by default.
            The twist of a floating base comes first in u.
        effects: As in `idm`; friction, springs and contacts contribute if they are among these effects.
        time: Time of each sample, shape () or (T,), [s], for effects that follow a table.
        base_acceleration: Spatial acceleration of a "moving" base in its own frame, shape (6,) or (T, 6);
            zero by default.

    Returns:
        Shape (N,) or (T, N), [N or N m].

    Raises:
        AssemblyError: The state does not close the loops.
        SingularityError: Closures lose rank, or the joints are not independent.
        ModelError: Effects are unknown, lack parameters, or prescribe the base.
        TrajectoryError: An array has the wrong shape or is not finite, or a joint cannot be a coordinate.
    """
    u, on = independent_coordinates(robot, joints), chosen_effects(robot, effects)
    q, v, single = checked_state(robot, q, v)
    base = None if base_acceleration is None else acceleration_of_base(robot, base_acceleration, len(q))
    out = forces_at_rest(robot, q, v, u, on, times(time, len(q)), base)
    return out[0] if single else out


def coriolis(
    robot: HybridRobot,
    q: ArrayLike,
    v: ArrayLike,
    *,
    joints: Sequence[str] | None = None,
    effects: Choice = None,
) -> Array:
    """Compute c(q, v): the Coriolis and centrifugal part of `bias`, without weights and joint laws.

    Args:
        robot: The robot.
        q: Positions, shape (nq,) or (T, nq).
        v: Rates, shape (nv,) or (T, nv), [m/s, rad/s].
        joints: As in `bias`.
        effects: As in `bias`; of these, only inertia, legs, rotors and velocity terms contribute.

    Returns:
        Shape (N,) or (T, N), [N or N m].

    Raises:
        AssemblyError, SingularityError, ModelError, TrajectoryError: As `bias`.
    """
    u, on = independent_coordinates(robot, joints), chosen_effects(robot, effects).only(QUADRATIC)
    q, v, single = checked_state(robot, q, v)
    out = forces_at_rest(robot, q, v, u, on)
    return out[0] if single else out


def gravity(
    robot: HybridRobot, q: ArrayLike, *, joints: Sequence[str] | None = None, effects: Choice = None
) -> Array:
    """Compute g(q): the generalised force along u that balances the weights (gradient of their energy).

    Args:
        robot: The robot.
        q: Positions, shape (nq,) or (T, nq).
        joints: As in `bias`.
        effects: As in `bias`; of these, only the weights of bodies and legs contribute.

    Returns:
        Shape (N,) or (T, N), [N or N m].

    Raises:
        AssemblyError, SingularityError, ModelError, TrajectoryError: As `bias`.
    """
    u, on = independent_coordinates(robot, joints), chosen_effects(robot, effects).only(WEIGHTS)
    q, rest, single = checked_state(robot, q, None)
    out = forces_at_rest(robot, q, rest, u, on)
    return out[0] if single else out


def chosen_effects(robot: HybridRobot, effects: Choice) -> Effects:
    """Return the effects of a call.

    Raises:
        ModelError: They are unknown, without numbers, or prescribe the base's motion.
    """
    on = choose(robot, effects)
    if on.base is not None:
        raise ModelError(
            f"the effect '{on.base.name}' prescribes the base; here its motion is that of q, v and "
            "base_acceleration",
            element=on.base.name,
        )
    return on


def forces_at_rest(
    robot: HybridRobot,
    q: Array,
    v: Array,
    u: Coordinates,
    on: Effects,
    time: Array | None = None,
    base: Array | None = None,
) -> Array:
    """Compute the generalised force along u at u_dot = 0, shape (T, N), [N or N m].

    Args:
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv).
        on: What is computed.
        time: Times, shape (T,), [s], or None.
        base: Acceleration of a prescribed base, shape (T, 6), or None for zero.
    """
    loads = all_loads(robot, on, q, v, time, None)
    v = v if on.inertia else np.zeros_like(v)
    motions = independent_motions(closed_states(robot, q, v), q, v, u)
    a = whole_drift(robot, motions, len(q))
    if base is not None:
        a[:, :6] = base
    states = forward(robot, q, v, a, on.gravity, classical=on.velocity is not None)
    out = np.zeros((len(q), u.size))
    received = [np.zeros((len(q), len(s.module.outputs), 6)) for s in states]
    for k in reversed(range(len(states))):
        module = states[k].module
        needed = module_forces(states[k], loads, k, motions[k].basis, received[k])
        out[:, u.own[k]] = needed.Q
        if module.parent >= 0:
            received[module.parent][:, module.parent_output] += needed.F
    return out
