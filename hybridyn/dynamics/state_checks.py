"""Check that positions, rates and accelerations close the loops, up to rounding.

In free fall, in motion without efforts and at rest, all terms of an effort or of a rate cancel. The result is
rounding. To recognise it as rounding, it is compared with sizes from the robot's weight, size and rates.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..spatial import Array
from ..structure.module import ModuleState
from ..structure.robot import HybridRobot
from ..structure.samples import as_positions, as_rates, same_samples
from ..structure.wrist_rows import is_locked
from .guards import NOT_CLOSED, check

#: Largest closure residual of given positions and rates, as a part of the module's length.
STATE_CLOSED = 1e-6
#: Rates and accelerations below this part of the reference ones count as zero: ten thousand roundings.
REST = 1e-12
#: Smallest reference rate [rad/s], for robots at rest without gravity; it depends on no length or mass.
SLOWEST = 1.0


def largest_rates(robot: HybridRobot, v: Array, a: Array) -> tuple[Array, Array]:
    """Compute a robot's largest rate and acceleration, divided by the units of its freedoms.

    Args:
        v: Rates, shape (T, nv); the linear velocity of the base is left out (Galilean invariance).
        a: Accelerations, shape (T, nv).

    Returns:
        Shapes (T,), [rad/s], and (T,), [rad/s^2].
    """
    relative = np.abs(v / robot.unit)
    if robot.base != "fixed":
        relative[:, :3] = 0.0
    return relative.max(axis=1, initial=0.0), np.abs(a / robot.unit).max(axis=1, initial=0.0)


def natural_sizes(robot: HybridRobot, largest: tuple[Array, Array], length: float) -> tuple[Array, Array]:
    """Compute the reference rate and acceleration for the rounding of rates and accelerations.

    The rate is the largest of the robot's rates, the rate of a pendulum and `SLOWEST`.

    Args:
        largest: The robot's `largest_rates`.
        length: Length of the pendulum [m].

    Returns:
        Shapes (T,), [rad/s], and (T,), [rad/s^2].
    """
    swing = np.sqrt(float(np.linalg.norm(robot.gravity)) / length)
    rate = np.maximum(largest[0], max(swing, SLOWEST))
    return rate, np.maximum(largest[1], rate**2)


def natural_force(robot: HybridRobot, v: Array, a: Array) -> Array:
    """Compute the reference size of forces, as work per scaled coordinate.

    It is the torque that gives the robot's mass the reference acceleration at the distance of its size.

    Args:
        v: Rates, shape (T, nv).
        a: Accelerations, shape (T, nv).

    Returns:
        Shape (T,), [N m].
    """
    length = robot.bodies.size
    return robot_mass(robot) * length**2 * natural_sizes(robot, largest_rates(robot, v, a), length)[1]


def robot_mass(robot: HybridRobot) -> float:
    """Return the mass of all bodies [kg]."""
    return sum(body.mass for body in robot.bodies.bodies)


def checked_state(robot: HybridRobot, q: ArrayLike, v: ArrayLike | None) -> tuple[Array, Array, bool]:
    """Return positions and rates (None: zero) as batches of equal size, and whether q was a single sample.

    Raises:
        TrajectoryError: An array has the wrong shape or is not finite.
    """
    q, single = as_positions(robot, q)
    rates = np.zeros((len(q), robot.nv)) if v is None else as_rates(robot, v)[0]
    same_samples(q=q, v=rates)
    return q, rates, single


def check_closed(
    robot: HybridRobot, states: list[ModuleState], q: Array, v: Array, a: Array | None = None
) -> Array:
    """Check that states close the loops to `STATE_CLOSED`, or less precisely if the file itself is rounded.

    Args:
        states: States of its modules.
        q, v: Positions, shape (T, nq), and rates, shape (T, nv).
        a: Accelerations, shape (T, nv), or None to skip their check.

    Returns:
        Largest closure residual of each sample, as computed by `closure_residual`, shape (T,).

    Raises:
        AssemblyError: The message names module, closure and sample.
    """
    worst, given = np.zeros(len(q)), np.zeros_like(v) if a is None else a
    largest = largest_rates(robot, v, given)
    levels = (("rates", "opening"), ("accelerations", "accelerating apart"))[: 1 if a is None else 2]
    for s in states:
        m = s.mechanism
        if not m.author_closures.rows:
            continue
        slack, unit = STATE_CLOSED + m.rounding, m.reduction.col_scale
        open_by = np.abs(m.author_closures.residual(s.z, s.whole)) * m.spanning_row_scale
        worst = np.maximum(worst, open_by.max(axis=1))
        every = list(zip(s.module.closures, m.author_closures.row_slices, strict=True))
        _check(s, "positions", "open", every, open_by, np.full(len(q), slack))
        natural = natural_sizes(robot, largest, m.length)
        speed, size = (np.abs(x / unit).max(axis=1, initial=0.0) for x in (s.v, s.a))
        rates = np.abs(m.closures.rates(s.motion, s.v, s.a)) * m.reduction.row_scale
        limits = _limits(natural, slack, speed, size)
        for (what, how), value, limit in zip(levels, rates, limits, strict=False):
            _check(s, what, how, s.module.named_rows(), value, limit)
        if not all(wrist.carries for wrist in m.spec.wrists):
            turning, turned = (np.abs(x).max(axis=(1, 2)) for x in (s.whole.w, s.whole.w_dot))
            limits = _limits(natural, slack, np.maximum(speed, turning), np.maximum(size, turned))
            for (what, how), value, limit in zip(levels, _rates_with_wrists(s), limits, strict=False):
                _check(s, what, how, every, _of_free_wrists(s, value, limit), limit)
    return worst


def _rates_with_wrists(s: ModuleState) -> Array:
    """Compute how fast the author's closures open, and accelerate apart, by the motion of all joints.

    Couplings alone read rates and accelerations, and hold no joint of a wrist: those of wrists may be zero.

    Returns:
        Scaled magnitudes, shape (2, T, rows).
    """
    m = s.mechanism
    own = m.author_closures.rates(s.whole, *(m.cut.with_still_wrists(x) for x in (s.v, s.a)))
    return np.abs(own) * m.spanning_row_scale


def _limits(natural: tuple[Array, Array], slack: float, speed: Array, size: Array) -> tuple[Array, Array]:
    """Return how fast closures may open, and accelerate apart, at rates and accelerations of these sizes."""
    return (
        np.maximum(slack * speed, REST * natural[0]),
        np.maximum(slack * (size + speed**2), REST * natural[1]),
    )


def _of_free_wrists(s: ModuleState, value: Array, limit: Array) -> Array:
    """Leave out what wrists in gimbal lock leave open: their joints cannot follow every motion of a platform.

    Args:
        s: State of the module.
        value: Rates of the author's closures, shape (T, rows).
        limit: The largest that is accepted, shape (T,).

    Returns:
        The rates, zero for a wrist in gimbal lock. A wrist that carries a platform opens no closure: near
        gimbal lock the rates of the platform are computed without it (`Mechanism.platforms_from_legs`).
    """
    m, motion = s.mechanism, s.whole
    for number, wrist in enumerate(m.spec.wrists):
        if wrist.carries:
            continue
        rows = m.author_closures.row_slices[wrist.closure]
        over = np.flatnonzero((value[:, rows] > limit[:, None]).any(axis=1))
        if len(over):
            value[over[is_locked(m.wrists.jacobian(motion.take(over), number))], rows] = 0.0
    return value


def _check(
    s: ModuleState, what: str, how: str, rows: list[tuple[str, slice]], value: Array, limit: Array
) -> None:
    """Raise if the absolute value of a closure's row exceeds the limit of its sample.

    Args:
        s: State of the module.
        rows: Name and rows of each closure.
        value: Absolute values, shape (T, rows).
        limit: Shape (T,).
    """

    def words(t: int) -> dict[str, Any]:
        """Name the closure that is farthest from closed."""
        row = int(np.argmax(value[t]))
        name = next(name for name, at in rows if at.start <= row < at.stop)
        return {"what": what, "how": how, "closure": name, "residual": float(value[t, row])}

    check(NOT_CLOSED, s.module, value.max(axis=1, initial=0.0), limit, words)
