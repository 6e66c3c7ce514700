"""The general path behind the models: it computes samples in doubt, and says what is wrong with arrays."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...assembly.task import closure_residual
from ...dynamics.direct import ddm
from ...dynamics.inverse import idm
from ...dynamics.link_motion import all_bodies
from ...effects.choice import Effects
from ...errors import HybridynError
from ...linkage.motion import Motion
from ...spatial import Array, Index
from ...structure.robot import HybridRobot
from ...structure.samples import as_batch, as_numbers, as_positions, from_table, same_samples
from ...tables.named_columns import is_table

#: Numbers per body: axes row by row, origin, velocity, angular velocity, accelerations (classical).
WIDTH = 24


def body_rows(robot: HybridRobot, q: Array, v: Array, a: Array) -> Array:
    """Compute the motion of every body in the world frame by the general path, shape (T, WIDTH bodies)."""
    return rows_of_motion(all_bodies(robot, q, v, a)).reshape(len(q), -1)


def rows_of_motion(m: Motion) -> Array:
    """Return the numbers of bodies, shape (T, ..., WIDTH), also symbols."""
    R = m.R.reshape(*m.p.shape[:-1], 9)
    return np.concatenate([R, m.p, m.p_dot, m.w, m.p_ddot, m.w_dot], axis=-1)


def motion_of(rows: Array) -> Motion:
    """Return the motion of bodies from the numbers of `rows_of_motion`."""
    p, p_dot, w, p_ddot, w_dot = (rows[..., at : at + 3] for at in range(9, WIDTH, 3))
    R = rows[..., :9]
    return Motion(R.reshape(*R.shape[:-1], 3, 3), p, w, p_dot, w_dot, p_ddot)


#: Quantity of the columns of a table that stands for an argument.
QUANTITY_OF = {"q": "position", "v": "velocity", "a": "acceleration", "tau": "effort"}
#: Reasons for which a guard hands a sample over.
NOT_FINITE, OPEN = "not finite", "loops open by more than rounding"
SMALL = "a pivot nearly vanishes, rates leave the loops, no motor gives a force, or joints may jam"
#: Closure residual from which on open loops are the reason, as `equations.scales.GUARD_CLOSED`.
OPEN_LOOPS = 1e-11
GENERAL: dict[str, Callable[..., Any]] = {"idm": idm, "ddm": ddm}


def as_batches(given: Mapping[str, ArrayLike], sizes: dict[str, int]) -> dict[str, Array]:
    """Return the arguments of a model as batches of equal size; their numbers are not checked.

    Args:
        given: Arguments by name, shape (width,) or (T, width).
        sizes: Width of each.

    Raises:
        TrajectoryError: An array has a wrong shape, or is no array of numbers.
    """
    arrays = {key: as_numbers(value, key) for key, value in given.items()}
    if {array.ndim for array in arrays.values()} - {1, 2}:
        check_batches(arrays, sizes)
    many = {key: array if array.ndim == 2 else array[None] for key, array in arrays.items()}
    if any(array.shape[1] != sizes[key] for key, array in many.items()):
        check_batches(arrays, sizes)
    same_samples(**many)
    return many


def named(robot: HybridRobot, given: Mapping[str, ArrayLike]) -> dict[str, ArrayLike]:
    """Return the arguments of a model with tables of named columns turned into arrays in the robot's order.

    Raises:
        TrajectoryError: A column is missing or unknown, or an argument is no table of joints.
    """
    if not any(map(is_table, given.values())):
        return dict(given)
    return {
        key: from_table(robot, x, QUANTITY_OF[key]) if is_table(x) and key in QUANTITY_OF else x
        for key, x in given.items()
    }


def check_batches(arrays: Mapping[str, ArrayLike], sizes: dict[str, int]) -> None:
    """Check arrays as the general path does, with its error messages.

    Raises:
        TrajectoryError: An array has a wrong shape or a number that is not finite.
    """
    for key, array in arrays.items():
        as_batch(array, sizes[key], key)


def samples_of(given: ArrayLike, name: str) -> tuple[int, ...]:
    """Return the shape of an argument without its last axis: () for a single sample, (T,) for many.

    Raises:
        TrajectoryError: It is no array of numbers.
    """
    shape = np.shape(given) if isinstance(given, np.ndarray) else as_numbers(given, name).shape
    return tuple(shape[:-1])


def everywhere(acceleration: ArrayLike | None, samples: tuple[int, ...], dtype: np.dtype[Any]) -> ArrayLike:
    """Return the acceleration of a moving base at every sample, shape (*samples, 6); zero where left out."""
    if acceleration is None:
        return np.zeros((*samples, 6), dtype)
    given = as_numbers(acceleration, "base_acceleration")
    return np.tile(given, (*samples, 1)) if given.shape == (6,) and samples else given


def general_rows(
    robot: HybridRobot, effects: Effects, name: str, given: dict[str, Array], rows: Index
) -> Array:
    """Compute some samples of a batch by the general path.

    Args:
        name: Name of the model.
        given: Its arguments, shape (T, width) each.
        rows: Numbers of the samples.

    Raises:
        HybridynError: A sample is wrong; the message has its number in the batch.
    """
    try:
        return general(robot, effects, name, {key: array[rows] for key, array in given.items()})
    except HybridynError as error:
        if error.sample is not None:
            error.sample = int(rows[error.sample])
            raise
        if len(rows) == len(given["q"]):
            raise
        return np.asarray(general(robot, effects, name, given)[rows])


def reasons(robot: HybridRobot, q: Array, guard: Array) -> Counter[str]:
    """Count why guards hand samples over: the numbers, the loops, or what the guard cannot tell apart.

    Args:
        q: Positions, shape (T, nq).
        guard: Guards above their limit, shape (T,).
    """
    known = np.isfinite(q).all(axis=1)
    opened = np.zeros(len(q), dtype=bool)
    opened[known] = closure_residual(robot, q[known]) > OPEN_LOOPS
    words = np.where(np.isnan(guard), NOT_FINITE, np.where(opened, OPEN, SMALL))
    return Counter(words.tolist())


def general(robot: HybridRobot, effects: Effects, name: str, given: Mapping[str, Any]) -> Array:
    """Compute a model by the general path; arguments are those of `CompiledRobot`."""
    inputs = dict(given)
    more = {"base_acceleration": inputs.pop("base_acceleration")} if "base_acceleration" in inputs else {}
    if name == "kinematics":
        as_positions(robot, inputs["q"])
        return body_rows(robot, *inputs.values())
    found: Array = GENERAL[name](robot, *inputs.values(), effects=effects, **more)
    return found
