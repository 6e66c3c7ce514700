"""The speed goals as data: a number of a section, or its ratio to another, and what it may be."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

from benchmarks.fronts import chosen
from benchmarks.results import GOOD, Row

OURS = "hybridyn, compiled"
GUARD = "operations with the guard over those without"


class Goal(NamedTuple):
    """A goal.

    Attributes:
        what: What is compared, in words.
        limit: Largest number that meets it, or smallest.
        section: Where it is measured.
        rows: What the rows have in their fields; without a case the goal is one of each robot.
        over: What the rows have that it is a ratio to.
        field: The number; of several rows the least counts, of those that are good to `GOOD` if any is.
        times: A factor.
        at_least: True where the limit is the smallest number.
    """

    what: str
    limit: float
    section: str
    rows: Mapping[str, Any]
    over: Mapping[str, Any] | None = None
    field: str = "us"
    times: float = 1.0
    at_least: bool = False


class Reached(NamedTuple):
    """A goal of a robot, with what was measured, NaN for nothing."""

    case: str
    goal: Goal
    value: float

    @property
    def met(self) -> bool:
        """Whether it is met."""
        return self.value >= self.goal.limit if self.goal.at_least else self.value <= self.goal.limit


def _model(section: str, model: str, case: str, batch: int, peer: str, limit: float) -> Goal:
    """Return a goal of a model against a peer that takes as many samples."""
    how = "a call" if batch == 1 else f"batch of {batch:,}"
    rows = {"case": case, "model": model, "batch": batch, "threads": 1}
    return Goal(
        f"{model}, {how}: time over {peer}",
        limit,
        section,
        {**rows, "method": OURS},
        {**rows, "method": peer},
    )


def _derivative(case: str, model: str, batch: int, limit: float) -> Iterator[Goal]:
    """Yield a goal of derivatives over all joints, and over the motors, against Pinocchio's of a sample."""
    how = "a call" if batch == 1 else "batch"
    peer = {"case": case, "model": model, "method": "pin."}
    for name in (model, f"{model} over motors"):
        rows = {"case": case, "model": name, "batch": batch, "method": "hybridyn"}
        yield Goal(f"{name}, {how}: time over Pinocchio's", limit, "derivatives", rows, peer)


def _program(model: str, setting: str, limit: float, unit: str = "", case: str = "") -> Goal:
    """Return a goal of what stands around the models."""
    rows = {"model": model, "setting": setting, "unit": unit} | ({"case": case} if case else {})
    return Goal(f"{model}: {setting}", limit, "programs", rows, field="value")


_BATCH = {"case": "lx4", "model": "ddm", "method": OURS, "batch": 10_000}
_FLIGHT = {"case": "lx4, hanging, 1 s", "setting": "step 0.0001"}
GOALS: tuple[Goal, ...] = (
    _model("ddm", "ddm", "lx4", 1, "pin.lcaba", 1 / 4),
    _model("ddm", "ddm", "lx4", 1, "pin.constraintDynamics", 1 / 10),
    _model("ddm", "ddm", "stack 16", 1, "pin.constraintDynamics", 1 / 90),
    _model("ddm", "ddm", "stack 16", 1, "pin.lcaba", 1 / 4),
    _model("throughput", "ddm", "lx4", 10_000, "pin.lcaba", 1 / 25),
    Goal(
        "ddm, batch of 10,000: time of four threads over a quarter of that of one", 1 / 0.8, "throughput",
        _BATCH | {"threads": 4}, _BATCH | {"threads": 1}, times=4.0,
    ),
    _model("idm", "idm", "lx4", 1, "pin.rnea, loops open", 3 / 4),
    _model("throughput", "idm", "lx4", 10_000, "pin.rnea, loops open", 1 / 6),
    Goal(
        "RK4, 10,000 steps: time over the same on pin.constraintDynamics", 1 / 8, "simulation",
        _FLIGHT | {"method": f"{OURS}, rk4"},
        _FLIGHT | {"method": "rk4 on constraintDynamics, held by nothing"}, field="seconds",
    ),
    _program("idm", GUARD, 1.2),
    _program("idm_from_motors", GUARD, 1.2),
    _program("control step", "from Python, median", 30.0, "us", "lx4"),
    _program("control step", "in C", 12.0, "us", "lx4"),
    _program("control step", "from Python, median", 5.0, "us", "five_bar"),
    _program("control step", "in C", 1.0, "us", "five_bar"),
    _program("simulate, RK4", "a step with PD", 3.0, "bare steps"),
    _program("simulate, RK4", "a step with computed torque", 3.0, "bare steps"),
    _program("simulate, RK4", "a law in Python, beyond its own call", 5.0, "us"),
    _program("hybridyn idm", "3 rows", 0.4, "s"),
    _program("hybridyn idm", "10,000 rows, beyond 3", 0.5, "s"),
    _program("compile, quick", "from the loaded robot to its first efforts, empty cache", 2.0, "s"),
    _program("hybridyn idm, whole program", "10,000 rows on 2 cores", 5.0, "s"),
    *(
        Goal(
            f"{model}, batch: share of the peak rate", 0.6, "peak",
            {"model": model, "setting": "share of the peak rate"}, field="value", at_least=True,
        )
        for model in ("ddm", "idm")
    ),
    *_derivative("lx4", "ddm_jacobian", 1, 1 / 15),
    *_derivative("lx4", "ddm_jacobian", 100, 1 / 60),
    *_derivative("gough_stewart", "ddm_jacobian", 1, 1 / 8),
    *_derivative("ur5", "idm_jacobian", 1, 1.0),
)  # fmt: skip


def reached(results: Mapping[str, list[Row]]) -> Iterator[Reached]:
    """Yield every goal of every robot that it is one of."""
    for goal in GOALS:
        rows = chosen(results[goal.section], **goal.rows)
        cases = [goal.rows["case"]] if "case" in goal.rows else dict.fromkeys(row.case for row in rows)
        for case in cases:
            value = goal.times * _least((row for row in rows if row.case == case), goal.field)
            if goal.over is not None:
                value /= _least(chosen(results[goal.section], **goal.over), goal.field)
            yield Reached(case, goal, value)


def _least(rows: Iterable[Row], field: str) -> float:
    """Return the least number of some rows, of those that are good if any is; NaN for none."""
    found = [(row, getattr(row, field)) for row in rows if math.isfinite(getattr(row, field))]
    good = [value for row, value in found if row.error <= GOOD]
    return min(good or [value for _, value in found], default=math.nan)
