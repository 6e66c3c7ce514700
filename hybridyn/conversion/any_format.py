"""What no format says, so that writers need not ask for it."""

from __future__ import annotations

from dataclasses import replace

from ..description.closure_forms import words_of_rows
from ..description.records import Closure, Coupling, Description
from .losses import Losses


def sayable(d: Description, losses: Losses) -> Description:
    """Return a robot with a name, without closures that have no row and terms of couplings that are zero.

    Args:
        losses: Receives what is left out.
    """
    for name in d.crossed:
        losses.add("position limits of which the lower is above the upper", name)
    for load in d.loads:
        losses.add("which part of a link is an added body", load.name)
    return replace(
        d,
        name=d.name or "robot",
        closures=tuple(closure for closure in d.closures if _has_rows(closure, losses)),
        couplings=tuple(_without_zeros(coupling) for coupling in d.couplings),
    )


def _has_rows(closure: Closure, losses: Losses) -> bool:
    rows = words_of_rows(closure.translations, closure.rotation)
    if not rows:
        losses.add("closures left out, since they have no row", closure.name)
    return bool(rows)


def _without_zeros(coupling: Coupling) -> Coupling:
    return replace(coupling, terms=tuple((name, factor) for name, factor in coupling.terms if factor))
