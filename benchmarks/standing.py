"""Compare hybridyn's times with those of the fastest peer, and list where hybridyn is slower."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

from benchmarks.fronts import cheapest, grouped
from benchmarks.results import Controlled, Flight, Point
from benchmarks.tables import number, table
from benchmarks.texts import FLOWN, LOSSES, STANDING

Results = dict[str, list[Any]]
#: Method, setting, time [s] and error of a run.
Run = tuple[str, str, float, float]

#: What is hybridyn's own, its oracle included.
OWN = ("hybridyn", "dense null space")

ENGINES = ("hybridyn, compiled", "hybridyn, general")
#: Models and their derivatives.
MODELS = ("ddm", "idm", "ddm_jacobian", "idm_jacobian")
#: Errors of a simulation's final state.
WANTED = (1e-3, 1e-6, 1e-9)


def standing(results: Results) -> Iterator[str]:
    """Write the table of times of hybridyn and the fastest peer for each robot."""
    yield "## hybridyn against the fastest peer\n"
    yield STANDING
    rows = []
    for model, case, peer, own in _compared(results):
        name = f"{peer.method}, {peer.setting}" if peer.setting else peer.method
        row = [model, case, name, number(peer.error), number(peer.us)]
        for batch in (False, True):
            ours = _ours(own, "hybridyn", batch)
            row += [number(ours.us), _ratio(ours.us / peer.us)] if ours else ["not measured", ""]
        rows.append(row)
    one, many = ("hybridyn, one call, us", "ratio"), ("hybridyn, batch, us", "ratio")
    yield table(["model", "robot", "fastest peer", "error", "us", *one, *many], rows)


def losses(results: Results) -> Iterator[str]:
    """Write on which robots, and by how much, each engine is slower than the fastest peer."""
    rows = []
    for engine in ENGINES:
        for model in MODELS:
            for batch, words in ((False, "one call"), (True, "batch")):
                ratios = {
                    case: ours.us / peer.us
                    for _, case, peer, own in _compared(results, [model])
                    if (ours := _ours(own, engine, batch))
                }
                if ratios:
                    rows.append([engine, model, words, *_lost(ratios)])
    if rows:
        yield "## Where hybridyn is slower\n"
        yield LOSSES
        yield table(["engine", "model", "", "slower than the fastest peer", "largest ratio of times"], rows)


def flown(flights: Sequence[Flight]) -> Iterator[str]:
    """Write the fastest simulations that reach each error of the final state."""
    return _fastest([(f.method, f.setting, f.seconds, f.state) for f in flights], "time [s]")


def fastest(runs: Sequence[Controlled]) -> Iterator[str]:
    """Write the fastest runs of a scene that reach each error of the final state."""
    return _fastest([(r.method, r.setting, r.per_second, r.error) for r in runs], "time [s/s]")


def _fastest(runs: Sequence[Run], unit: str) -> Iterator[str]:
    """Write the fastest runs that reach each error."""
    rows = []
    for wanted in WANTED:
        good = [run for run in runs if run[3] <= wanted and math.isfinite(run[2])]
        sides = ([run for run in good if run[0].startswith("hybridyn") == own] for own in (True, False))
        ours, peer = (min(side, key=lambda run: run[2], default=None) for side in sides)
        ratio = _ratio(ours[2] / peer[2]) if ours and peer else ""
        rows.append([f"{wanted:.0e}", *_run(ours), *_run(peer), ratio])
    yield FLOWN
    yield table(["error", "hybridyn", unit, "fastest peer", unit, "ratio"], rows)


def _compared(
    results: Results, models: Sequence[str] = MODELS
) -> Iterator[tuple[str, str, Point, list[Point]]]:
    """Return model, robot, the fastest peer and everything measured of each robot that a peer can do."""
    rows = [row for section in ("ddm", "idm", "derivatives") for row in results.get(section, [])]
    for model in models:
        for case, own in grouped((row for row in rows if row.model == model), "case").items():
            peer = cheapest(p for p in own if not p.method.startswith(OWN))
            if peer is not None:
                yield model, case, peer, own


def _ours(points: Sequence[Point], engine: str, batch: bool) -> Point | None:
    """Return the fastest of an engine, one sample per call or in a batch."""
    return cheapest(p for p in points if p.method.startswith(engine) and (p.batch > 1) == batch)


def _lost(ratios: dict[str, float]) -> list[str]:
    """Return the robots on which an engine is slower, and the largest ratio of times."""
    worst = max(ratios, key=ratios.__getitem__)
    lost = [case for case, ratio in ratios.items() if ratio > 1]
    won = [case for case in ratios if case not in lost]
    if not won:
        where = f"all {len(lost)} robots"
    elif not lost:
        where = f"none of {len(won)} robots"
    elif len(lost) > len(won):
        where = f"all but {', '.join(won)}"
    else:
        where = ", ".join(lost)
    return [where, f"{_ratio(ratios[worst])} ({worst})"]


def _ratio(ratio: float) -> str:
    """Write a ratio of times; bold if hybridyn is slower."""
    return f"**{ratio:.3g}**" if ratio > 1 else f"{ratio:.3g}"


def _run(run: Run | None) -> list[str]:
    """Return method and setting of a run, and its time."""
    return ["none", ""] if run is None else [f"{run[0]}, {run[1]}", number(run[2])]
