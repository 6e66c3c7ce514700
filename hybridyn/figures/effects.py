"""Bar chart of the contribution of each effect to the efforts, by motor."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..structure.robot import HybridRobot
from ..studies.effect_worth import Contribution
from .motion import groups
from .panels import Chart, Line, Panel


def chart_of_effects(robot: HybridRobot, contributions: Sequence[Contribution], *, title: str = "") -> Chart:
    """Build a chart of the RMS contribution of each effect to each motor's effort, one panel per module."""
    number = {motor: i for i, motor in enumerate(robot.motors)}
    panels = []
    for group in groups(robot, "effort"):
        at = [number[motor] for motor in group.motors]
        # A contribution is nan where a passive motion would need an effort without the effect: draw zero.
        lines = tuple(
            Line(effect.name, np.nan_to_num(np.asarray(effect.rms, dtype=float)[at]))
            for effect in contributions
        )
        label = f"RMS of what it adds [{group.unit}]"
        panels.append(Panel(group.title, label, lines, group.colour, group.unit, ticks=group.motors))
    return Chart(title, np.zeros(0), "", tuple(panels))
