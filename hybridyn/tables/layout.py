"""The meaning of a table's columns."""

from __future__ import annotations

from typing import NamedTuple

from .signals import Signal


class Layout(NamedTuple):
    """The meaning of a table's columns.

    Attributes:
        file: Path of the table, for messages.
        time: Column of the time, or None, where rows are independent samples.
        joints: Joints by name.
        poses: Poses by name.
        wrenches: Columns of the wrenches by link.
        efforts: Column of the efforts by joint.
        full_state: Whether every joint of the tree is given, so that nothing needs to be assembled.
    """

    file: str | None
    time: int | None
    joints: dict[str, Signal]
    poses: dict[str, Signal]
    wrenches: dict[str, tuple[int, ...]]
    efforts: dict[str, int]
    full_state: bool

    @property
    def signals(self) -> tuple[Signal, ...]:
        """Every joint and pose."""
        return (*self.joints.values(), *self.poses.values())
