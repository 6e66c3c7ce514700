"""Compare hybridyn's times with those of the fastest peer."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from benchmarks.fronts import cheapest, chosen, grouped
from benchmarks.results import Row

Results = Mapping[str, list[Row]]

#: What is hybridyn's own, its oracle included.
OWN = ("hybridyn", "dense null space")
ENGINES = ("hybridyn, compiled", "hybridyn, general")
#: Models and their derivatives.
MODELS = ("ddm", "idm", "ddm_jacobian", "idm_jacobian")


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
