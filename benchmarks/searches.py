"""How much work a search takes with gradients and without: a five-bar leg that jumps, with its gears' mass.

After a published case (`robots/monoped.urdf.xacro` says which numbers are published): lengths, stance and
gears of the leg that spends the least energy on a jump. From it are the bounds of the parameters, and
CMA-ES with its settings; ours are the push, which every design follows, and the energy: work of the motors,
and heat of their windings. SciPy's SLSQP takes the gradients of the study from the same starts. A design
with gradients counts as `TIMES` designs without.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from time import process_time
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from benchmarks.cases import ROOT
from benchmarks.results import Row
from hybridyn.spatial import Array
from hybridyn.studies.sweep.evaluation import Designer, DesignRow
from hybridyn.studies.sweep.gradients import StudyGradients
from hybridyn.studies.sweep.reading import read_study

#: Cost of a design with its gradients over one without, in operations: the most that tests allow.
TIMES = 6
#: The work after which searches are compared, in designs without gradients.
BUDGETS = (24, 48, 96, 144, 192, 384, 768)
#: Number of starts, and the published one: lengths [m] and ratios, in the order of the study's parameters.
STARTS, PUBLISHED = 5, (0.25, 0.25, 0.1, 0.35, 0.0, 10.0, 10.0)
#: Speed at take-off [m/s], 45 degrees upwards, after a way of [m], and rows of its table.
SPEED, WAY, ROWS = 2.0, 0.12, 21
TIME = 2 * WAY / SPEED
#: Resistance of a winding [ohm] and torque of a motor by its current [N m/A]: of the motor U8, as published.
RESISTANCE, TORQUE = 0.186, 60 / (2 * np.pi * 100)
#: Step of CMA-ES over parameters from 0 to 1, and designs of a generation, as published.
STEP, GENERATION = 0.1, 8
#: Objective of what cannot be assembled [J], as published.
IMPOSSIBLE = 1e6
STUDY = f"""[robot]
file = "{ROOT}/benchmarks/robots/monoped.urdf.xacro"
[designs]
method = "sobol"
count = 1
[parameters]
thigh = {{ range = [0.15, 0.35] }}
calf = {{ range = [0.15, 0.35] }}
width = {{ range = [0.05, 0.15] }}
height = {{ range = [0.30, 0.60] }}
ahead = {{ range = [-0.10, 0.10] }}
left_ratio = {{ range = [4, 35] }}
right_ratio = {{ range = [4, 35] }}
[tasks.push]
trajectory = "push.csv"
measure = {{ work = "energy", left = "rms left_hip/effort", right = "rms right_hip/effort" }}
"""
#: Where the ratios stand among the parameters.
RATIOS = slice(5, 7)


class Search(NamedTuple):
    """A search from one start.

    Attributes:
        values: Objective of each design [J].
        each: What a design counts for, in designs without gradients.
        seconds: Processor time of a design [s].
    """

    values: list[float]
    each: int
    seconds: float

    def least(self, budget: int) -> float:
        """Return the least objective after some work."""
        return min(self.values[: budget // self.each])


def searches(start: int, budgets: tuple[int, ...] = BUDGETS) -> list[Row]:
    """Search with gradients and without from one start; return the objective that is reached by work.

    Args:
        start: Number of the start: 0 is the published one, others are drawn from the bounds.
        budgets: The work after which searches are compared.
    """
    with tempfile.TemporaryDirectory() as place:
        _write(Path(place))
        source = read_study(str(Path(place, "study.toml")))
        ranges = np.array([one.range for one in source.study.parameters.values()], dtype=float)
        designer, low, span = Designer(source), ranges[:, 0], np.ptp(ranges, axis=1)

        def plain(x: Array) -> DesignRow:
            """Evaluate a design without gradients, from parameters from 0 to 1."""
            return designer(0, low + span * x)

        random, first = np.random.default_rng(start), (np.array(PUBLISHED) - low) / span
        while start and plain(first := random.uniform(size=len(span))).status != "ok":
            pass
        found = {
            "SLSQP": _along(StudyGradients(source), first, low, span, max(budgets)),
            "CMA-ES": _blind(plain, first, low, span, start + 1, max(budgets)),
        }
    return [
        Row("monoped", "search", method, f"start {start}", at=budget, seconds=run.seconds,
            value=run.least(budget), unit="J")
        for method, run in found.items()
        for budget in budgets
    ]  # fmt: skip


def _write(place: Path) -> None:
    """Write the study, and the table of a push whose acceleration grows from zero, and falls to zero."""
    t = np.linspace(0.0, TIME, ROWS)
    turn = 2 * np.pi * t / TIME
    s = SPEED * TIME * (turn**2 / 2 + np.cos(turn) - 1) / (2 * np.pi) ** 2 / np.sqrt(2)
    header = "time,torso/pose/x,torso/pose/z"
    table = np.column_stack([t, s, s])
    np.savetxt(place / "push.csv", table, "%.12g", ",", header=header, comments="")
    (place / "study.toml").write_text(STUDY)


def energy(measures: tuple[float, ...], ratios: Array) -> float:
    """Return the work of the motors and the heat of their windings [J]."""
    heat = RESISTANCE / TORQUE**2 * TIME * (np.array(measures[1:]) / ratios) ** 2
    return measures[0] + float(heat.sum())


def slope(measures: tuple[float, ...], gradient: Array, ratios: Array) -> Array:
    """Return its derivative over the parameters, from those of the measures, shape (3, parameters)."""
    torque = np.array(measures[1:]) / ratios
    heat = 2 * RESISTANCE / TORQUE**2 * TIME * torque / ratios
    out: Array = gradient[0] + heat @ gradient[1:]
    out[RATIOS] -= heat * torque
    return out


def _along(study: StudyGradients, start: Array, low: Array, span: Array, most: int) -> Search:
    """Search by SLSQP; return the objective of each design."""
    values: list[float] = []

    def objective(x: Array) -> tuple[float, Array]:
        """Return the objective and its gradient over parameters from 0 to 1."""
        p = low + span * x
        found = study(p)
        good = found.row.status == "ok"
        values.append(energy(found.row.measures, p[RATIOS]) if good else IMPOSSIBLE)
        if not good:
            return IMPOSSIBLE, np.zeros(len(x))
        return values[-1], slope(found.row.measures, found.gradient, p[RATIOS]) * span

    unit = [(0.0, 1.0)] * len(start)
    before = process_time()
    minimize(objective, start, jac=True, method="SLSQP", bounds=unit, tol=1e-8, options={"maxiter": most})
    return Search(values, TIMES, (process_time() - before) / len(values))


def _blind(
    plain: Callable[[Array], DesignRow], start: Array, low: Array, span: Array, seed: int, most: int
) -> Search:
    """Search by CMA-ES; return the objective of each design."""
    import cma

    values: list[float] = []

    def objective(x: Array) -> float:
        """Return the objective."""
        row = plain(x)
        ratios = (low + span * x)[RATIOS]
        values.append(energy(row.measures, ratios) if row.status == "ok" else IMPOSSIBLE)
        return values[-1]

    options = {"bounds": [0.0, 1.0], "popsize": GENERATION, "seed": seed, "maxfevals": most, "verbose": -9}
    search = cma.CMAEvolutionStrategy(start, STEP, options)
    before = process_time()
    search.optimize(objective)
    return Search(values, 1, (process_time() - before) / len(values))
