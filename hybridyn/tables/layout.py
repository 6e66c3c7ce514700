"""The meaning of a table's columns."""

from __future__ import annotations

from dataclasses import dataclass, field

from .signals import Signal


@dataclass(frozen=True, eq=False)
class Layout:
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
    joints: dict[str, Signal] = field(default_factory=dict)
    poses: dict[str, Signal] = field(default_factory=dict)
    wrenches: dict[str, tuple[int, ...]] = field(default_factory=dict)
    efforts: dict[str, int] = field(default_factory=dict)
    full_state: bool = False

    @property
    def signals(self) -> tuple[Signal, ...]:
        """Every joint and pose."""
        return (*self.joints.values(), *self.poses.values())
