"""How many designs a search evaluates, with gradients and without: a five-bar leg with its gears' mass.

After a published case: the leg's foot goes along an ellipse, and the objective is the RMS effort of the
motors and the mass of their gears, which grows with the largest effort. SciPy's SLSQP takes the gradients of
the study; SciPy's differential evolution takes none. At equal work it may evaluate `TIMES` as many designs.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from scipy.optimize import Bounds, differential_evolution, minimize

from benchmarks.results import Row
from hybridyn.spatial import Array
from hybridyn.studies.sweep.evaluation import Designer
from hybridyn.studies.sweep.gradients import StudyGradients
from hybridyn.studies.sweep.reading import read_study

#: Cost of a design with its gradients over one without, in operations: the most that tests allow.
TIMES = 6
#: Mass of a gear by its largest effort [kg/(N m)], and what a kilogram counts [N m].
GEAR, KILOGRAM = 0.08, 2.0
#: Objective of what cannot be assembled.
IMPOSSIBLE = 1e3
STUDY = """[robot]
file = "five_bar"
[designs]
method = "sobol"
count = 1
[parameters]
upper_length = { range = [0.20, 0.30] }
lower_length = { range = [0.35, 0.45] }
spacing = { range = [0.10, 0.30] }
left = { range = [-0.05, 0.05] }
right = { range = [-0.05, 0.05] }
[numbers]
"position:m1_left_drive.z" = "left"
"position:m1_right_drive.z" = "right"
[tasks.step]
trajectory = "step.csv"
measure = ["rms_effort", "peak_effort"]
"""
WEIGHTS = np.array([1.0, 2 * GEAR * KILOGRAM])  # two gears


def searches(most: int, rows: int) -> list[Row]:
    """Search with gradients, then without, and return the objective by the number of designs.

    Args:
        most: Designs that the search without gradients may evaluate.
        rows: Rows of the foot's trajectory.
    """
    with tempfile.TemporaryDirectory() as place:
        t = np.linspace(0.0, 1.0, rows)
        x, z = -0.1 * np.cos(2 * np.pi * t), -0.5 + 0.04 * np.sin(2 * np.pi * t)
        header = "time,m1_tool/pose/x,m1_tool/pose/z"
        np.savetxt(
            Path(place, "step.csv"), np.column_stack([t, x, z]), "%.9f", ",", header=header, comments=""
        )
        Path(place, "study.toml").write_text(STUDY)
        source = read_study(str(Path(place, "study.toml")))
        ranges = np.array([one.range for one in source.study.parameters.values()], dtype=float)
        with_gradients, without = (
            _along(StudyGradients(source), ranges),
            _blind(Designer(source), ranges, most),
        )
    best = min(min(with_gradients), min(without))
    few = len(with_gradients)
    return [
        _row("SLSQP", "with gradients", few, with_gradients, best),
        _row("differential evolution", "as many designs", few, without, best),
        _row("differential evolution", f"{TIMES} times as many designs", TIMES * few, without, best),
        _row("differential evolution", "all designs", len(without), without, best),
    ]


def _row(method: str, setting: str, designs: int, values: list[float], best: float) -> Row:
    """Return the least objective of some designs, and its excess over the best one."""
    least = min(values[:designs])
    row = Row("five_bar", "search", method, setting, at=designs, error=least / best - 1)
    return row._replace(value=least, unit="N m")


def _along(study: StudyGradients, ranges: Array) -> list[float]:
    """Search by SLSQP from the middle of the ranges; return the objective of each design."""
    values: list[float] = []
    low, span = ranges[:, 0], np.ptp(ranges, axis=1)

    def objective(x: Array) -> tuple[float, Array]:
        """Return the objective and its gradient over parameters from 0 to 1."""
        found = study(low + span * x)
        values.append(float(WEIGHTS @ found.row.measures))
        return values[-1], WEIGHTS @ found.gradient * span

    unit = [(0.0, 1.0)] * len(ranges)
    minimize(objective, np.full(len(ranges), 0.5), jac=True, method="SLSQP", bounds=unit, tol=1e-8)
    return values


def _blind(designer: Designer, ranges: Array, most: int) -> list[float]:
    """Search by differential evolution; return the objective of each design."""
    values: list[float] = []

    def objective(x: Array) -> float:
        """Return the objective."""
        row = designer(len(values), x)
        values.append(float(WEIGHTS @ row.measures) if row.status == "ok" else IMPOSSIBLE)
        return values[-1]

    rounds = max(most // (8 * len(ranges)) - 1, 0)
    differential_evolution(
        objective, Bounds(*ranges.T), popsize=8, maxiter=rounds, rng=1, polish=False, tol=0.0
    )
    return values
