"""Where joints that mimic others in a URDF are at home: where those hold them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from .records import Coupling


def followers_at_home(
    couplings: Iterable[Coupling], home: Mapping[str, tuple[float, ...]]
) -> dict[str, tuple[float, ...]]:
    """Return the positions away from zero of the followers that a home posture does not state.

    Args:
        couplings: Those of two joints that have the name of the first are mimics: it follows the other.
        home: The positions that files state, as in `Description`; zero for those left out.
    """
    mimics = [
        one for one in couplings
        if len(one.terms) == 2 and one.name == one.terms[0][0] and one.name not in home
        and not (one.curve and one.name in dict(one.curve.terms))
    ]  # fmt: skip
    out: dict[str, tuple[float, ...]] = {}
    for _ in mimics:  # a leader may follow another
        before = dict(out)
        at = {name: _number(position) for name, position in ({**home} | out).items()}
        for one in mimics:
            (follower, ratio), (leader, _) = one.terms
            rest = -one.open_by({leader: at.get(leader, 0.0), follower: 0.0})
            if rest:
                out[follower] = (rest / ratio,)
        if out == before:
            break
    return out


def _number(position: tuple[float, ...]) -> float:
    """Return a position as one number: of a cosine and a sine the angle."""
    return math.atan2(position[1], position[0]) if len(position) == 2 else position[0]
