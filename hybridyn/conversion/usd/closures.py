"""Closures as UsdPhysics joints that are excluded from the articulation.

A universal closure is no joint of USD. A massless body stands for it: it turns, and slides where the closure
lets it, on the first link, and holds the axis of the second one, about which the closing joint turns.
"""

from __future__ import annotations

import numpy as np

from ...description.closure_forms import ROWS
from ...description.placement import placement_from, turned
from ...description.records import Array, Closure, Link
from ...description.usd.schema import AXES
from ..request import Losses, rows_of
from .bodies import add_body
from .joints import add_ends, lock
from .prims import Prim

#: Axes of the closing joint of a universal closure in its second frame: it turns about x there.
ABOUT_X = np.eye(3)[:, [2, 0, 1]]


def add_closure(
    parent: Prim, closure: Closure, bodies: tuple[Prim, Prim], poses: tuple[Array, Array], losses: Losses
) -> None:
    """Add a closure.

    Args:
        parent: The prim that receives it.
        bodies: The bodies of its links.
        poses: Their poses in the world, shapes (4, 4).
        losses: Receives what USD cannot say.
    """
    if closure.rotation == "perpendicular":
        losses.add("universal closures are a hinge on a massless body, and a hinge that closes", closure.name)
        _add_behind_hinge(parent, closure, bodies, poses)
        return
    words, turn = rows_of(closure, losses)
    locked = [axis for row, axis in zip(ROWS, AXES, strict=True) if row in words.split()]
    frames = turned(closure.frame_a, turn.T), turned(closure.frame_b, turn.T)
    _add(parent, closure.name, locked, bodies, frames, closes=True)


def _add(
    parent: Prim, name: str, locked: list[str], bodies: tuple[Prim, Prim], frames: tuple[Array, Array],
    *, closes: bool,
) -> None:  # fmt: skip
    """Add a joint that locks some axes, of the type that says so."""
    free = [axis for axis in AXES if axis not in locked]
    kind = {0: "Fixed", 3: "Spherical" if free == list(AXES[3:]) else ""}.get(len(free), "")
    if len(free) == 1:
        kind = "Revolute" if free[0].startswith("rot") else "Prismatic"
    out = parent.child(f"Physics{kind}Joint", name)
    add_ends(out, bodies, frames)
    if closes:
        out.line("uniform bool physics:excludeFromArticulation = true")
    if len(free) == 1:
        out.line(f'uniform token physics:axis = "{free[0][-1]}"')
    if not kind:
        lock(out, locked)


def _add_behind_hinge(
    parent: Prim, closure: Closure, bodies: tuple[Prim, Prim], poses: tuple[Array, Array]
) -> None:
    """Add a massless body that moves along the free axes and about z of the first frame, and a hinge."""
    at_a, at_b = poses[0] @ closure.frame_a, poses[1] @ closure.frame_b
    shift = at_a[:3, :3].T @ (at_b[:3, 3] - at_a[:3, 3])
    shift[list(closure.translations)] = 0.0
    along = at_a[:3, :3].T @ at_b[:3, 2]
    cosine, sine = along[:2] / np.linalg.norm(along[:2])
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    massless = Link(f"{closure.name}_cross", 0.0, np.zeros(3), np.zeros((3, 3)))
    cross = add_body(parent, massless, at_a @ placement_from(turn, shift))
    locked = [AXES[i] for i in closure.translations] + ["rotX", "rotY"]
    name = f"{closure.name}_hinge"
    _add(parent, name, locked, (bodies[0], cross), (closure.frame_a, np.eye(4)), closes=False)
    locked = [axis for axis in AXES if axis != "rotX"]
    frames = np.eye(4), turned(closure.frame_b, ABOUT_X)
    _add(parent, closure.name, locked, (cross, bodies[1]), frames, closes=True)
