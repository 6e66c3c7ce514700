"""Coordinates of balls whose bodies have other axes than in the file: in these axes, and back.

Positions, rates and accelerations of a branch are first those of the file. Its equations are written in
those of its own axes, in which the maps of a rod on a ball are sparse.
"""

from __future__ import annotations

from ...spatial import slices
from ...symbols import Expression, dot
from .expressions import numbers, pick
from .leg_groups import TreeBranch
from .rigid import Links, freedoms


def own_positions(links: Links, q: Expression) -> Expression:
    """Return positions of links from those of the file, shape (nq,)."""
    out, places = q.copy(), slices(link.kind.nq for link in links.values())
    for link, at in zip(links.values(), places, strict=True):
        if link.ball:
            out[at] = dot(numbers(link.ball.positions), q[at])
    return out


def own_rates(links: Links, v: Expression) -> Expression:
    """Return rates or accelerations of links from those of the file, shape (nv,)."""
    out = v.copy()
    for i, at in freedoms(links).items():
        if ball := links[i].ball:
            out[at] = dot(numbers(ball.rates), v[at])
    return out


def rates_in_file(links: Links, own: Expression) -> Expression:
    """Return rates or accelerations of the file from those of links, shape (nv,)."""
    out = own.copy()
    for i, at in freedoms(links).items():
        if ball := links[i].ball:
            out[at] = dot(numbers(ball.rates).T, own[at])
    return out


def own_motion(
    branch: TreeBranch, q: Expression, v: Expression, a: Expression | None = None
) -> tuple[Expression, Expression, Expression | None]:
    """Return positions, rates and, if they are given, accelerations of a branch from the spanning tree's."""
    links = branch.links
    own_a = None if a is None else own_rates(links, pick(a, branch.v))
    return own_positions(links, pick(q, branch.q)), own_rates(links, pick(v, branch.v)), own_a
