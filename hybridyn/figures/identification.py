"""Measured and predicted efforts, and the spectrum of what is left, of the motors that fit worst."""

from __future__ import annotations

import numpy as np

from ..colours import ALARM, GOOD, MODULES
from ..identification.result import Identification, Residuals
from .panels import Mark, Panel, PanelFigure

#: Motors that are drawn.
MOST_MOTORS = 4


def chart_of_identification(found: Identification, *, title: str = "") -> PanelFigure:
    """Build a chart, a row per motor: efforts over time, and the cumulative spectrum of the residual.

    The second motion is drawn where there is one. White noise follows the straight line.
    """
    judged = found.validation or found.fit
    worst = np.sort(np.argsort(judged.probability, kind="stable")[:MOST_MOTORS])
    panels = [panel for i in worst for panel in _panels(found, judged, int(i))]
    return PanelFigure(title, panels, across=2)


def _panels(found: Identification, judged: Residuals, i: int) -> tuple[Panel, Panel]:
    """Return the two panels of a motor."""
    motor, unit = found.robot.motors[i], found.robot.effort_units[i]
    measured, residual = judged.measured[:, i], judged.residual[:, i]
    efforts = (
        Mark("measured", judged.time, measured, "dots", MODULES[0]),
        Mark("predicted", judged.time, measured - residual, "solid", MODULES[1]),
        Mark("residual", judged.time, residual, "solid", ALARM),
    )
    spectrum = (
        Mark("residual", judged.frequency, judged.cumulative[:, i], "solid", ALARM),
        Mark("white noise", judged.frequency[[0, -1]], np.array([0.0, 1.0]), "dashed", GOOD),
    )
    return (
        Panel(motor, f"effort [{unit}]", efforts, "time [s]"),
        Panel(f"probability {judged.probability[i]:.2g}", "share of the power", spectrum, "frequency [Hz]"),
    )
