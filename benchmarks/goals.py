"""The speed goals: ratios of times in one run on the same states at 1e-10, and times of users' programs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

from benchmarks.fronts import cheapest
from benchmarks.results import Flight, Point
from benchmarks.simulation import LONG

OURS = ("hybridyn, compiled", "hybridyn, general")
BATCH = 10_000
SIMULATED = (LONG, "rk4 on constraintDynamics, held by nothing", "step 0.0001")


class Goal(NamedTuple):
    """A goal with what was measured.

    Attributes:
        case, against: What is compared.
        goal: Largest ratio of times that meets it (smallest, for scaling with threads).
        measured: The ratio of each of hybridyn's engines, NaN where not measured.
        peer: What it is a ratio to, in words.
        at_least: True where the goal is a lower bound.
    """

    case: str
    against: str
    goal: float
    measured: tuple[float, ...]
    peer: str
    at_least: bool = False

    def verdict(self, engine: int) -> str:
        """Say whether an engine meets the goal."""
        value = self.measured[engine]
        if math.isnan(value):
            return "not measured"
        return "met" if (value >= self.goal if self.at_least else value <= self.goal) else "missed"


class ProgramGoal(NamedTuple):
    """A goal of what stands around the models, with what was measured.

    Attributes:
        case: Robot.
        what: What is measured.
        goal: Largest value that meets it (smallest, where it is a lower bound).
        value: What was measured.
        unit: Unit of both.
        at_least: True where the goal is a lower bound.
    """

    case: str
    what: str
    goal: float
    value: float
    unit: str
    at_least: bool = False

    def verdict(self) -> str:
        """Say whether the goal is met."""
        return "met" if (self.value >= self.goal if self.at_least else self.value <= self.goal) else "missed"


#: Largest value of each program's part by its unit.
PROGRAM_GOALS = {
    ("idm", "operations with the guard over those without", ""): 1.2,
    ("idm_from_motors", "operations with the guard over those without", ""): 1.2,
    ("simulate, RK4", "a step with PD", "bare steps"): 3.0,
    ("simulate, RK4", "a step with computed torque", "bare steps"): 3.0,
    ("simulate, RK4", "a law in Python, beyond its own call", "us"): 5.0,
    ("hybridyn idm", "3 rows", "s"): 0.4,
    ("hybridyn idm", "10,000 rows, beyond 3", "s"): 0.5,
    ("compile, quick", "from the loaded robot to its first efforts, empty cache", "s"): 2.0,
}
#: Largest time of a control step by robot [us].
STEP_GOALS = {
    ("lx4", "from Python, median"): 30.0,
    ("lx4", "in C"): 12.0,
    ("five_bar", "from Python, median"): 5.0,
    ("five_bar", "in C"): 1.0,
}
#: Largest time of derivatives over that of Pinocchio's, by robot, model and whether samples are batched.
DERIVATIVE_GOALS = {
    ("lx4", "ddm_jacobian", False): 1 / 15,
    ("lx4", "ddm_jacobian", True): 1 / 60,
    ("gough_stewart", "ddm_jacobian", False): 1 / 8,
    ("ur5", "idm_jacobian", False): 1.0,
}
#: Least share of the peak rate in a batch.
PEAK_GOAL = 0.6


def program_goals(results: dict[str, list[Any]]) -> list[ProgramGoal]:
    """Return the goals of what was measured around the models, of batches and of derivatives."""
    out = []
    for row in results["programs"]:
        goal = PROGRAM_GOALS.get((row.program, row.what, row.unit))
        if row.program == "control step":
            goal = STEP_GOALS.get((row.case, row.what))
        if goal is not None:
            out.append(ProgramGoal(row.case, f"{row.program}: {row.what}", goal, row.value, row.unit))
    for row in results["peak"]:
        what = f"{row.model}, batch: share of the peak rate"
        out.append(ProgramGoal(row.case, what, PEAK_GOAL, row.share, "", at_least=True))
    return [*out, *_derivatives(results["derivatives"])]


def _derivatives(points: Sequence[Point]) -> Iterator[ProgramGoal]:
    """Yield the goals of derivatives, over all joints and over the motors."""
    for (case, model, batched), goal in DERIVATIVE_GOALS.items():
        own = [p for p in points if p.case == case and math.isfinite(p.us)]
        peer = min((p.us for p in own if p.model == model and p.method.startswith("pin.")), default=math.nan)
        for name in (model, f"{model} over motors"):
            ours = [p.us for p in own if p.model == name and (p.batch > 1) == batched and _is_ours(p)]
            if ours:
                how = "batch" if batched else "a call"
                yield ProgramGoal(case, f"{name}, {how}: time over Pinocchio's", goal, min(ours) / peer, "")


def _is_ours(point: Point) -> bool:
    """Tell whether a point is of hybridyn."""
    return point.method.startswith("hybridyn")


def goals(results: dict[str, list[Any]]) -> list[Goal]:
    """Give every goal."""
    ddm, idm, batches = results["ddm"], results["idm"], results["throughput"]
    out = [
        _one("ddm, LX4, one sample per call", ddm, "lx4", 1, "pin.lcaba", 1 / 4),
        _one("ddm, LX4, one sample per call", ddm, "lx4", 1, "pin.constraintDynamics", 1 / 10),
        _one("ddm, 16 modules, one sample per call", ddm, "stack 16", 1, "pin.constraintDynamics", 1 / 90),
        _one("ddm, 16 modules, one sample per call", ddm, "stack 16", 1, "pin.lcaba", 1 / 4),
    ]
    ddm_batch, idm_batch = ([p for p in batches if p.model == model] for model in ("ddm", "idm"))
    out.append(_one(f"ddm, LX4, batch of {BATCH:,}", ddm_batch, "lx4", BATCH, "pin.lcaba", 1 / 25))
    out.append(_threads(ddm_batch, max((row.cores for row in results["peak"]), default=math.nan)))
    open_tree = "pin.rnea, loops open"
    out.append(_one("idm, LX4, one sample per call", idm, "lx4", 1, open_tree, 3 / 4))
    out.append(_one(f"idm, LX4, batch of {BATCH:,}", idm_batch, "lx4", BATCH, open_tree, 1 / 6))
    out.append(_simulation(results["simulation"]))
    return out


def _one(title: str, points: Sequence[Point], case: str, batch: int, against: str, goal: float) -> Goal:
    """Compare hybridyn's time per sample at a batch with a peer's cheapest setting."""
    own = [p for p in points if p.case == case]
    error = math.inf if against == "pin.rnea, loops open" else 1e-10
    peer = cheapest((p for p in own if p.method == against and p.batch == batch), error)
    if peer is None:
        return Goal(title, against, goal, (math.nan, math.nan), "not measured")
    ratios = tuple(_ratio(own, name, batch, peer.us) for name in OURS)
    setting = f"{peer.setting}, " if peer.setting else ""
    return Goal(title, against, goal, ratios, f"{setting}{peer.us:.3g} us, error {peer.error:.0e}")


def _ratio(points: Iterable[Point], name: str, batch: int, us: float) -> float:
    found = [p.us for p in points if (p.method, p.batch) == (name, batch) and p.threads <= 1]
    return min(found, default=math.nan) / us


def _threads(points: Sequence[Point], machine: float) -> Goal:
    """Return the rate of all threads over that of one, by the number of threads."""
    own = [p for p in points if p.case == "lx4" and p.method == OURS[0] and p.batch == BATCH]
    times = {p.threads: p.us for p in own if math.isfinite(p.us)}
    most = max(times, default=1)
    value = times[1] / (most * times[most]) if most > 1 and 1 in times else math.nan
    title = f"ddm, LX4, batch of {BATCH:,}, {most if most > 1 else 'all'} threads"
    said = f"rate over threads times that of one thread; the machine's own: {machine:.2f}"
    return Goal(title, "one thread", 0.8, (value, math.nan), said, at_least=True)


def _simulation(flights: Sequence[Flight]) -> Goal:
    """Compare RK4 at one step with the same on constraintDynamics."""
    case, method, setting = SIMULATED
    times = {f.method: f.seconds for f in flights if (f.case, f.setting) == (case, setting)}
    peer = times.get(method, math.nan)
    ratios = tuple(times.get(f"{name}, rk4, closed in stages", math.nan) / peer for name in OURS)
    said = "not measured" if math.isnan(peer) else f"{peer:.3g} s, closures not closed"
    title = "simulate, LX4, RK4, 10,000 steps"
    return Goal(title, "the same on pin.constraintDynamics", 1 / 8, ratios, said)
