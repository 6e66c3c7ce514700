"""Collect what a format cannot say: one line for each reason, with all names that it concerns."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

from ..description.names import listed
from ..description.records import Coupling, Joint
from ..description.robot_file import FREEDOMS

#: Limits of a joint; a speed or effort of zero is none.
LIMITS = ("lower", "upper", "speed_limit", "effort_limit")


class Losses:
    """Reasons in the order in which they occur, each with its names."""

    def __init__(self) -> None:
        self._names: dict[str, dict[str, None]] = {}

    def add(self, reason: str, name: str = "") -> None:
        """Add a loss.

        Args:
            reason: What is lost and what is written in its place, in words that fit several names.
            name: Name of the joint, link or closure; "" if it concerns the whole robot.
        """
        names = self._names.setdefault(reason, {})
        if name:
            names[name] = None

    def lines(self) -> tuple[str, ...]:
        """Return one line for each reason: "speed limits of joints: 'elbow', 'wrist'"."""
        return tuple(
            f"{reason}: {listed(names)}" if names else reason for reason, names in self._names.items()
        )


def add_limits(joint: Joint, losses: Losses, words: Sequence[str] = LIMITS) -> None:
    """List the limits of a joint with several freedoms that are lost. `words`: attributes of the joint."""
    if FREEDOMS[joint.kind] > 1 and any(isfinite(getattr(joint, word)) for word in words):
        losses.add("limits of joints with several freedoms", joint.name)


def add_name(coupling: Coupling, follower: str, losses: Losses) -> None:
    """List the name of a coupling that is written as `<mimic>`, which has that of its joint."""
    if coupling.name != follower:
        losses.add("names of couplings, which are read back with those of joints", coupling.name)
