"""Read positions, rates, accelerations and efforts from a table with named columns (pandas, polars).

A row of such a table (a pandas Series with named entries) is a single sample.

The columns are those of hybridyn's own tables: `<joint>/position`, `<joint>/velocity`,
`<joint>/acceleration` and `<motor>/effort`, by components where a joint has several freedoms
(`columns.py`). One table may therefore stand for several arguments: `idm(robot, table, table, table)`.
A table of one quantity may name its columns by the joints alone.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..description.names import did_you_mean, listed
from ..errors import TrajectoryError
from ..spatial import Array
from .columns import ENERGIES, RESIDUAL
from .signals import JOINT_COMPONENTS, joint_columns

#: Columns of hybridyn's tables that belong to no joint.
OTHERS = ("time", RESIDUAL, *ENERGIES)
QUANTITIES = ("position", "velocity", "acceleration", "effort")


def is_table(array: object) -> bool:
    """Return whether an argument is a table with named columns, or a row of one."""
    return hasattr(array, "columns") or is_row(array)


def is_row(array: object) -> bool:
    """Return whether an argument is a row of a table, whose entries have names."""
    labels = getattr(array, "index", None)
    return not (labels is None or callable(labels)) and any(isinstance(x, str) for x in labels)


def of_joints(table: Any, quantity: str, joints: Sequence[str], kinds: Sequence[str]) -> Array:
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
        TrajectoryError: A column is missing or unknown.
    """
    names: list[str] = []
    for joint, kind in zip(joints, kinds, strict=True):
        names += joint_columns(joint, kind, quantity)
    values = _chosen(table, names, quantity, joints)
    values = _with_cosines(kinds, values) if quantity == "position" else values
    return values[0] if is_row(table) else values


def of_motors(table: Any, motors: Sequence[str], joints: Sequence[str]) -> Array:
    """Return the efforts in the order of the motors, shape (T, motors), or (motors,) for a row of a table.

    Raises:
        TrajectoryError: A column is missing or unknown.
    """
    values = _chosen(table, [f"{motor}/effort" for motor in motors], "effort", joints)
    return values[0] if is_row(table) else values


def _with_cosines(kinds: Sequence[str], values: Array) -> Array:
    """Replace the angles of continuous and planar joints by their cosines and sines, shape (T, nq)."""
    columns: list[Array] = []
    at = 0
    for kind in kinds:
        count = len(JOINT_COMPONENTS[kind][0]) if kind in JOINT_COMPONENTS else 1
        own = list(values[:, at : at + count].T)
        at += count
        if kind in ("continuous", "planar"):
            angle = own.pop()
            own += [np.cos(angle), np.sin(angle)]
        columns += own
    return np.array(columns).T.reshape(len(values), len(columns))


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
