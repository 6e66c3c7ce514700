"""What the results say: fronts, the cheapest setting for an error, exponents, ratios to the fastest peer."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np

from benchmarks.results import GOOD, Row

#: Modules: below, what every call costs once hides the slope.
FITTED_FROM = 4
#: What is hybridyn's own, its oracle included.
OWN = ("hybridyn", "dense null space")
ENGINES = ("hybridyn, compiled", "hybridyn, general")
#: Models and their derivatives.
MODELS = ("ddm", "idm", "ddm_jacobian", "idm_jacobian")

Item = TypeVar("Item")
Results = Mapping[str, list[Row]]


def cheapest(rows: Iterable[Row], error: float = GOOD) -> Row | None:
    """Return the fastest row that reaches an error, else the most accurate one, None without any."""
    measured = [row for row in rows if math.isfinite(row.us)]
    good = [row for row in measured if row.error <= error]
    if good:
        return min(good, key=lambda row: row.us)
    return min(measured, key=lambda row: row.error, default=None)


def exponent(at: Sequence[float], values: Sequence[float]) -> float:
    """Fit value = c at^p and give p, over the larger cases."""
    pairs = [(x, y) for x, y in zip(at, values, strict=True) if x >= FITTED_FROM and 0 < y < math.inf]
    if len(pairs) < 2:
        return math.nan
    x, y = np.log(np.array(pairs)).T
    return float(np.polyfit(x, y, 1)[0])


def grouped(rows: Iterable[Item], *names: str) -> dict[Any, list[Item]]:
    """Group rows by some of their fields, in order of appearance; one field gives plain keys."""
    out: dict[Any, list[Item]] = {}
    for row in rows:
        key = tuple(getattr(row, name) for name in names)
        out.setdefault(key if len(names) > 1 else key[0], []).append(row)
    return out


def chosen(rows: Iterable[Row], method: str = "", **wanted: Any) -> list[Row]:
    """Return the rows with some values in their fields, whose method begins with a word."""
    return [
        row
        for row in rows
        if row.method.startswith(method) and all(getattr(row, name) == x for name, x in wanted.items())
    ]


class Standing(NamedTuple):
    """A model of a robot: the fastest peer, and everything that was measured."""

    model: str
    case: str
    peer: Row
    rows: list[Row]

    def ours(self, engine: str, batch: bool) -> Row | None:
        """Return the fastest of an engine, one sample per call or in a batch."""
        return cheapest(r for r in self.rows if r.method.startswith(engine) and (r.batch > 1) == batch)


def standings(results: Results, models: Sequence[str] = MODELS) -> Iterator[Standing]:
    """Yield each robot's, of the models that a peer can compute."""
    rows = [row for section in ("ddm", "idm", "derivatives") for row in results.get(section, [])]
    for model in models:
        for case, own in grouped((row for row in rows if row.model == model), "case").items():
            peer = cheapest(row for row in own if not row.method.startswith(OWN))
            if peer is not None:
                yield Standing(model, case, peer, own)


class Jacobian(NamedTuple):
    """Derivatives of a model of a robot: Pinocchio's, and hybridyn's.

    Attributes:
        model, case: Which.
        peer: The fastest of Pinocchio's, None where it has none.
        ours: The fastest over all joints of a call, of a batch, and the same over the motors.
    """

    model: str
    case: str
    peer: Row | None
    ours: list[Row | None]


def jacobians(results: Results) -> Iterator[Jacobian]:
    """Yield the derivatives of every robot."""
    rows = results["derivatives"]
    for case, model in grouped(rows, "case", "model"):
        if model in ("ddm_jacobian", "idm_jacobian"):
            joints, motors = (chosen(rows, case=case, model=model + over) for over in ("", " over motors"))
            ours = [
                cheapest(row for row in chosen(some, "hybridyn") if (row.batch > 1) == batch)
                for some in (joints, motors)
                for batch in (False, True)
            ]
            yield Jacobian(model, case, cheapest(chosen(joints, "pin.")), ours)


def ratios(results: Results, models: Sequence[str] = MODELS) -> list[Row]:
    """Return each engine's time over that of the fastest peer as values, by model, robot and batch."""
    return [
        Row(one.case, one.model, engine, batch=1 + batch, us=one.peer.us, value=ours.us / one.peer.us)
        for one in standings(results, models)
        for engine in ENGINES
        for batch in (False, True)
        if (ours := one.ours(engine, batch))
    ]


def fastest(rows: Sequence[Row], error: float) -> tuple[Row | None, Row | None]:
    """Return the fastest run that reaches an error, of hybridyn and of the peers."""
    good = [row for row in rows if row.error <= error and math.isfinite(row.seconds)]
    sides = ([row for row in good if row.method.startswith("hybridyn") == own] for own in (True, False))
    ours, peer = (min(side, key=lambda row: row.seconds, default=None) for side in sides)
    return ours, peer
