"""Read positions, rates, accelerations and efforts from a table with named columns (pandas, polars).

A row of such a table (a pandas Series with named entries) is a single sample.

The columns are those of hybridyn's own tables: `<joint>/position`, `<joint>/velocity`,
`<joint>/acceleration` and `<motor>/effort`, by components where a joint has several freedoms
(`columns.py`). One table may therefore stand for several arguments: `idm(robot, table, table, table)`.
A table of one quantity may name its columns by the joints alone.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..description.names import did_you_mean
from ..errors import TrajectoryError
from ..joints.kinds import JointKind
from ..spatial import Array
from .signals import joint_columns, on_circles


def is_table(array: object) -> bool:
    """Return whether an argument is a table with named columns, or a row of one."""
    return hasattr(array, "columns") or is_row(array)


def is_row(array: object) -> bool:
    """Return whether an argument is a row of a table, whose entries have names."""
    labels = getattr(array, "index", None)
    return not (labels is None or callable(labels)) and any(isinstance(x, str) for x in labels)


def of_joints(table: Any, quantity: str, joints: Sequence[str], kinds: Sequence[JointKind]) -> Array:
    """Return positions, rates or accelerations in the order of a robot's coordinates.

    Args:
        table: The table, with T rows.
        quantity: "position", "velocity" or "acceleration".
        joints: Names of the robot's joints.
        kinds: Kind of each joint.

    Returns:
        Shape (T, nq) for positions, else (T, nv); without T for a row of a table. The angle of a continuous
        joint becomes its cosine and sine.

    Raises:
        TrajectoryError: A column is missing or there twice.
    """
    names = [joint_columns(joint, kind, quantity) for joint, kind in zip(joints, kinds, strict=True)]
    values = _chosen(table, [*itertools.chain(*names)], quantity)
    if quantity == "position":
        parts = np.split(values, np.cumsum([len(own) for own in names]), axis=1)
        values = np.hstack([on_circles(kind, part) for kind, part in zip(kinds, parts, strict=False)])
    return values[0] if is_row(table) else values


def of_motors(table: Any, motors: Sequence[str]) -> Array:
    """Return the efforts in the order of the motors, shape (T, motors), or (motors,) for a row of a table.

    Raises:
        TrajectoryError: A column is missing or there twice.
    """
    values = _chosen(table, [f"{motor}/effort" for motor in motors], "effort")
    return values[0] if is_row(table) else values


def named_motion(table: Any, motors: Sequence[str] = ()) -> dict[str, Any]:
    """Return the columns of a table, or the entries of a row, by name; the column "time" is left out.

    In a table with columns `<joint>/position`, those of motors are read, with rates and accelerations where
    it has them: (position, rate, acceleration).

    Args:
        motors: Names of the robot's motors.
    """
    labels = [x for x in (table.index if is_row(table) else table.columns) if x != "time"]
    if not any(str(x).endswith("/position") for x in labels):
        return {str(x): table[x] for x in labels}
    kinds = ("position", "velocity", "acceleration")
    names = [[f"{motor}/{kind}" for kind in kinds] for motor in motors]
    return {
        motor: tuple(table[x] if x in labels else None for x in own)
        for motor, own in zip(motors, names, strict=True)
        if own[0] in labels
    }


def _chosen(table: Any, names: Sequence[str], quantity: str) -> Array:
    """Return the named columns of a table, shape (T, names)."""
    there = Counter(map(str, table.index if is_row(table) else table.columns))
    if not any(f"/{quantity}" in column for column in there):
        names = [name.removesuffix(f"/{quantity}") for name in names]
    for name in names:
        if there[name] != 1:
            says = f"has {there[name]} columns" if there[name] else "lacks the column"
            hint = "" if there[name] else did_you_mean(name, there)
            raise TrajectoryError(f"{quantity}: the table {says} '{name}'{hint}")
    try:
        columns = [np.asarray(table[name]) for name in names]
        if any(x.dtype.kind == "c" for x in columns):
            raise TypeError("they are complex")
        return np.array([x.astype(float) for x in columns]).T.reshape(-1, len(names))
    except (TypeError, ValueError, OverflowError) as error:
        raise TrajectoryError(f"{quantity}: a column does not hold numbers: {error}") from None
