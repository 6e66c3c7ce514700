"""Check arguments before anything is computed: arrays of samples, a single one or a batch, and choices."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..description.names import did_you_mean, listed
from ..errors import AT_SAMPLE, TrajectoryError
from ..linkage.joints import NQ
from ..spatial import LARGEST, Array
from ..tables.signals import JOINT_COMPONENTS
from .robot import HybridRobot

#: Columns of hybridyn's tables that belong to no joint.
OTHERS = ("time", "residual", "energy/kinetic", "energy/potential", "energy/total")
QUANTITIES = ("position", "velocity", "acceleration", "effort")


def is_table(array: object) -> bool:
    """Return whether an argument is a table with named columns, or a row of one."""
    return hasattr(array, "columns") or is_row(array)


def is_row(array: object) -> bool:
    """Return whether an argument is a row of a table, whose entries have names."""
    labels = getattr(array, "index", None)
    return not (labels is None or callable(labels)) and any(isinstance(x, str) for x in labels)


def of_joints(robot: HybridRobot, table: Any, quantity: str) -> Array:
    """Return positions, rates or accelerations in the order of the robot's coordinates.

    Args:
        robot: The robot, on a fixed base.
        table: The table, with T rows.
        quantity: "position", "velocity" or "acceleration".

    Returns:
        Shape (T, nq) for positions, else (T, nv); without T for a row of a table. The angle of a continuous
        joint becomes its cosine and sine.

    Raises:
        TrajectoryError: A column is missing or unknown, or the robot's base moves.
    """
    if robot.base != "fixed":
        raise TrajectoryError(
            f"{quantity}: tables with named columns serve robots on a fixed base; give arrays in the order "
            "of q, v and a (the base's velocities are in its own frame)"
        )
    names: list[str] = []
    for joint, kind in zip(robot.joints, robot.kinds, strict=True):
        places, rates = JOINT_COMPONENTS.get(kind, (("",), ("",)))
        parts = places if quantity == "position" else rates
        names += [f"{joint}/{quantity}/{part}" if part else f"{joint}/{quantity}" for part in parts]
    values = _chosen(table, names, quantity, robot.joints)
    values = _with_cosines(robot, values) if quantity == "position" else values
    return values[0] if is_row(table) else values


def of_motors(robot: HybridRobot, table: Any) -> Array:
    """Return the efforts in the order of the motors, shape (T, motors), or (motors,) for a row of a table.

    Raises:
        TrajectoryError: A column is missing or unknown.
    """
    names = [f"{motor}/effort" for motor in robot.motors]
    values = _chosen(table, names, "effort", robot.joints)
    return values[0] if is_row(table) else values


def _with_cosines(robot: HybridRobot, values: Array) -> Array:
    """Replace the angles of continuous and planar joints by their cosines and sines, shape (T, nq)."""
    columns: list[Array] = []
    at = 0
    for kind in robot.kinds:
        count = len(JOINT_COMPONENTS[kind][0]) if kind in JOINT_COMPONENTS else 1
        own = list(values[:, at : at + count].T)
        at += count
        if kind in ("continuous", "planar"):
            angle = own.pop()
            own += [np.cos(angle), np.sin(angle)]
        columns += own
    return np.array(columns).T.reshape(len(values), robot.nq)


def _chosen(table: Any, names: Sequence[str], quantity: str, joints: Sequence[str]) -> Array:
    """Return the named columns of a table, shape (T, names)."""
    there = [str(column) for column in (table.index if is_row(table) else table.columns)]
    for column, count in Counter(there).items():
        if count > 1:
            raise TrajectoryError(f"{quantity}: the table has {count} columns '{column}'")
    suffix = f"/{quantity}"
    short = {name: name.removesuffix(suffix) for name in names if name.endswith(suffix)}
    if not any(suffix in column for column in there):
        names = [short.get(name, name) for name in names]
    known = {*names, *OTHERS}
    for column in there:
        owner, slash, rest = column.partition("/")
        foreign = slash and owner in joints and rest.split("/")[0] in QUANTITIES
        if column not in known and not foreign:
            raise TrajectoryError(
                f"{quantity}: the table has an unknown column '{column}'{_alike(column, names)}"
            )
    missing = [name for name in names if name not in there]
    if missing:
        raise TrajectoryError(f"{quantity}: the table lacks the columns {listed(missing)}")
    try:
        return np.array([np.asarray(table[name], dtype=float) for name in names]).T.reshape(-1, len(names))
    except (TypeError, ValueError, OverflowError) as error:
        raise TrajectoryError(f"{quantity}: a column does not hold numbers: {error}") from None


def _alike(column: str, names: Sequence[str]) -> str:
    """Return a hint at a column of the same quantity whose name is alike."""
    quantity = next((word for word in QUANTITIES if f"/{word}" in column), "")
    owners = {name.partition("/")[0] for name in names}
    return did_you_mean(column, [f"{owner}/{quantity}" for owner in owners] if quantity else names)


#: Largest deviation of the length of a quaternion, or of a cosine and sine, from one. It accepts files with
#: seven digits.
UNIT = 1e-6


def as_numbers(given: object, name: str) -> Array:
    """Return an argument as an array.

    Raises:
        TrajectoryError: It is not an array of numbers.
    """
    try:
        return np.asarray(given, dtype=float)
    except (TypeError, ValueError, OverflowError) as error:
        raise TrajectoryError(f"{name} is not an array of numbers: {error}") from None


def as_batch(array: ArrayLike, width: int, name: str) -> tuple[Array, bool]:
    """Return samples as an array of shape (T, width), and whether the input was a single sample.

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
        raise TrajectoryError(f"{name} has shape {np.shape(array)}; wanted ({width},) or (T, {width})")
    bad = np.flatnonzero(~np.isfinite(out).all(axis=1))
    if len(bad):
        raise TrajectoryError(f"{name} is not finite{AT_SAMPLE}", sample=int(bad[0]))
    large = np.argwhere(np.abs(out) > LARGEST)
    if len(large):
        t, i = large[0]
        raise TrajectoryError(
            f"{name} has the number {out[t, i]:g}{AT_SAMPLE} (at most {LARGEST:.0e})", sample=int(t)
        )
    return out, single


def as_positions(
    robot: HybridRobot, array: ArrayLike, name: str = "q", *, base_given: bool = True
) -> tuple[Array, bool]:
    """Return positions as an array of shape (T, nq), and whether the input was a single sample.

    Args:
        array: Positions, shape (nq,) or (T, nq), or a table with named columns (`named_columns.py`).
        name: Name of the array in error messages.
        base_given: False if the pose of the base is not read, because an effect prescribes it.

    Raises:
        TrajectoryError: Wrong shape, a number that is not finite, or a quaternion or a cosine and sine
            whose length is not one.
    """
    given = of_joints(robot, array, "position") if is_table(array) else array
    out, single = as_batch(given, robot.nq, name)
    for columns in robot.unit_coordinates:
        if not base_given:
            columns = columns[columns[:, 0] >= NQ["floating"]]
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


def as_rates(
    robot: HybridRobot, array: ArrayLike, name: str = "v", quantity: str = "velocity"
) -> tuple[Array, bool]:
    """Return rates or accelerations as an array of shape (T, nv), and whether the input was a single sample.

    Args:
        array: Rates, shape (nv,) or (T, nv), or a table with named columns (`named_columns.py`).
        name: Name of the array in error messages.
        quantity: "velocity" or "acceleration": the columns of a table.

    Raises:
        TrajectoryError: As for `as_batch`, or columns of a table are missing or unknown.
    """
    return as_batch(of_joints(robot, array, quantity) if is_table(array) else array, robot.nv, name)


def as_efforts(robot: HybridRobot, array: ArrayLike) -> tuple[Array, bool]:
    """Return efforts as an array of shape (T, motors), and whether the input was a single sample.

    Raises:
        TrajectoryError: As for `as_rates`.
    """
    return as_batch(of_motors(robot, array) if is_table(array) else array, len(robot.motors), "tau")


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
