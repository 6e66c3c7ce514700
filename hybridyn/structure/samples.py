"""Check arguments before anything is computed: arrays of samples, a single one or a batch, and choices."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import AT_SAMPLE, TrajectoryError
from ..joints.kinds import JointKind
from ..spatial import LARGEST, Array
from ..tables.named_columns import is_table, of_joints, of_motors
from .robot import HybridRobot

#: Largest deviation of the length of a quaternion, or of a cosine and sine, from one. It accepts files with
#: seven digits.
UNIT = 1e-6
#: Where arrays come from, by their names: what messages advise about a wrong shape.
ADVICE = dict.fromkeys("qva", ", all joints: take q, v, a = hybridyn.assemble(robot, motors=...)")
ADVICE |= dict.fromkeys(("tau", "position", "rate", "acceleration"), ", as robot.motors")


def as_numbers(given: object, name: str) -> Array:
    """Return an argument as an array.

    Raises:
        TrajectoryError: It is missing, or not an array of real numbers.
    """
    if given is None:
        raise TrajectoryError(f"{name} is missing: it is None")
    try:
        if np.asarray(given).dtype.kind == "c":
            raise TrajectoryError(f"{name} is not an array of real numbers: its numbers are complex")
        return np.asarray(given, dtype=float)
    except (TypeError, ValueError, OverflowError) as error:
        raise TrajectoryError(f"{name} is not an array of numbers: {error}") from None


def as_number(given: object, name: str, least: float, most: float = LARGEST, advice: str = "") -> float:
    """Return an argument that is one number between two others.

    Args:
        advice: What to do where it is none, for the message.

    Raises:
        TrajectoryError: It is not.
    """
    out = as_numbers(given, name)
    if out.ndim or not least <= out <= most:
        what = f"{float(out):g}" if not out.ndim else f"an array of shape {out.shape}"
        raise TrajectoryError(f"{name} must be one number from {least:g} to {most:g}, not {what}{advice}")
    return float(out)


def as_batch(array: ArrayLike, width: int, name: str) -> tuple[Array, bool]:
    """Return samples as an array of shape (T, width), and whether the input was a single sample.

    Args:
        name: Name of the argument, for messages; those of `ADVICE` say where such an array comes from.

    Raises:
        TrajectoryError: Wrong shape, a table with named columns, or a number that is not finite or
            larger than `LARGEST`.
    """
    if is_table(array):
        raise TrajectoryError(
            f"{name} is a table with named columns (a DataFrame), which is not read here: give an array in "
            "the robot's order, table[names].to_numpy()"
        )
    out = as_numbers(array, name)
    single = out.ndim == 1
    if single:
        out = out[None]
    if out.ndim != 2 or out.shape[1] != width:
        raise TrajectoryError(
            f"{name} has shape {np.shape(array)}; wanted ({width},) or (T, {width}){ADVICE.get(name, '')}"
        )
    check_numbers(out, name)
    return out, single


def check_numbers(array: Array, name: str) -> None:
    """Check that the numbers of samples, shape (T, n), are finite and at most `LARGEST`.

    Raises:
        TrajectoryError: A number is not; the message names the first such sample.
    """
    size = np.abs(array).max(axis=1, initial=0.0)
    wrong = np.flatnonzero(~(size <= LARGEST))
    if not len(wrong):
        return
    t = int(wrong[0])
    bad = np.flatnonzero(~np.isfinite(size))
    if len(bad):
        raise TrajectoryError(f"{name} is not finite{AT_SAMPLE}", sample=int(bad[0]))
    first = array[t][np.abs(array[t]) > LARGEST][0]
    raise TrajectoryError(f"{name} has the number {first:g}{AT_SAMPLE} (at most {LARGEST:.0e})", sample=t)


def from_table(robot: HybridRobot, table: Any, quantity: str) -> Any:
    """Return a quantity from a table with named columns, in the order of the robot's coordinates or motors.

    Other arguments are returned as they are.

    Args:
        quantity: "position", "velocity", "acceleration" or "effort".

    Raises:
        TrajectoryError: A column is missing or unknown, or the robot's base moves.
    """
    if not is_table(table):
        return table
    if quantity == "effort":
        return of_motors(table, robot.motors)
    if robot.base != "fixed":
        raise TrajectoryError(
            f"{quantity}: tables with named columns serve robots on a fixed base; give arrays in the order "
            "of q, v and a (the base's velocities are in its own frame)"
        )
    return of_joints(table, quantity, robot.joints, robot.kinds)


def as_positions(
    robot: HybridRobot, array: ArrayLike, name: str = "q", *, base_given: bool = True
) -> tuple[Array, bool]:
    """Return positions as an array of shape (T, nq), and whether the input was a single sample.

    Args:
        array: Positions, shape (nq,) or (T, nq), or a table with named columns (`tables/named_columns.py`).
        name: Name of the array in error messages.
        base_given: False if the pose of the base is not read, because an effect prescribes it.

    Raises:
        TrajectoryError: Wrong shape, a number that is not finite, or a quaternion or a cosine and sine
            whose length is not one.
    """
    out, single = as_batch(from_table(robot, array, "position"), robot.nq, name)
    for columns in robot.unit_coordinates:
        if not base_given:
            columns = columns[columns[:, 0] >= JointKind.FLOATING.nq]
        length = np.sqrt(np.square(out[:, columns]).sum(axis=2))
        wrong = np.argwhere(~(np.abs(length - 1.0) <= UNIT))
        if len(wrong):
            t, i = wrong[0]
            joint = next(j for j, at in enumerate(robot.q_slices) if at.stop > columns[i, 0])
            what = "quaternion" if columns.shape[1] == 4 else "cosine and sine"
            raise TrajectoryError(
                f"{name}: the {what} of joint '{robot.joints[joint]}'{AT_SAMPLE} has length "
                f"{length[t, i]:.9g} (must be 1 to {UNIT:g}); divide it by its length",
                sample=int(t),
            )
    return out, single


def as_rates(robot: HybridRobot, array: ArrayLike, name: str = "v") -> tuple[Array, bool]:
    """Return rates as an array of shape (T, nv), and whether the input was a single sample.

    Args:
        array: Rates, shape (nv,) or (T, nv), or a table with named columns (`tables/named_columns.py`).
        name: Name of the array in error messages.

    Raises:
        TrajectoryError: As for `as_batch`, or columns of a table are missing or unknown.
    """
    return as_batch(from_table(robot, array, "velocity"), robot.nv, name)


def as_accelerations(robot: HybridRobot, array: ArrayLike) -> tuple[Array, bool]:
    """Return accelerations as an array of shape (T, nv), and whether the input was a single sample.

    Args:
        array: Accelerations, shape (nv,) or (T, nv), or a table with named columns.

    Raises:
        TrajectoryError: As for `as_rates`.
    """
    return as_batch(from_table(robot, array, "acceleration"), robot.nv, "a")


def as_efforts(robot: HybridRobot, array: ArrayLike) -> tuple[Array, bool]:
    """Return efforts as an array of shape (T, motors), and whether the input was a single sample.

    Raises:
        TrajectoryError: As for `as_rates`.
    """
    return as_batch(from_table(robot, array, "effort"), len(robot.motors), "tau")


def same_samples(**arrays: Array) -> None:
    """Raise if batches have different numbers of samples.

    Raises:
        TrajectoryError: The numbers differ; the message names them.
    """
    sizes = [len(x) for x in arrays.values()]
    if len(set(sizes)) > 1:
        raise TrajectoryError(f"{', '.join(arrays)} have {', '.join(map(str, sizes))} samples")


def one_of(name: str, value: str, *allowed: str) -> None:
    """Raise if an argument does not have an allowed value.

    Raises:
        TrajectoryError: The message lists the allowed values.
    """
    if value not in allowed:
        raise TrajectoryError(f"{name} must be {' or '.join(map(repr, allowed))}, not {value!r}")
