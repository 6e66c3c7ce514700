"""Where the tree of an MJCF robot starts: at the world, or at the one body that floats in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..names import listed
from .compiling import Compiled


@dataclass(frozen=True)
class Root:
    """Where the tree starts.

    Attributes:
        body: Number of the root body; 0 is the world.
        joint: Number of the free joint that carries it, or None.
        left_out: Numbers of motionless bodies that are left out.
        note: What was left out, in words, or "".
    """

    body: int = 0
    joint: int | None = None
    left_out: frozenset[int] = frozenset()
    note: str = ""


def find_root(compiled: Compiled) -> Root:
    """Return the root: a free body whose tree is all that moves, and that no equality ties to the world.

    Otherwise the world is the root, and free bodies hang on it by floating joints.
    """
    model = compiled.model
    free = [n for n in range(model.njnt) if model.jnt_type[n] == compiled.code("mjJNT_FREE")]
    if len(free) != 1:
        return Root()
    body = int(model.jnt_bodyid[free[0]])
    top = _tops(model.body_parentid)
    others = [number for number in range(1, model.nbody) if top[number] != body]
    moving = any(model.body_jntnum[number] or model.body_mocapid[number] >= 0 for number in others)
    tied = {number for pair in tied_bodies(compiled).values() for number in pair}
    if moving or tied & {0, *others}:
        return Root()
    names = listed(compiled.bodies[number] for number in others)
    note = (
        f"bodies {names} do not move and have no joint; they are left out, because the base floats"
        if others
        else ""
    )
    return Root(body, free[0], frozenset(others), note)


def tied_bodies(compiled: Compiled) -> dict[int, tuple[int, int]]:
    """Return the numbers of the two bodies of every connect and weld, by its number."""
    model = compiled.model
    kinds = (compiled.code("mjEQ_CONNECT"), compiled.code("mjEQ_WELD"))
    out = {}
    for number in range(model.neq):
        if model.eq_type[number] not in kinds:
            continue
        pair = int(model.eq_obj1id[number]), int(model.eq_obj2id[number])
        if model.eq_objtype[number] == compiled.code("mjOBJ_SITE"):
            pair = int(model.site_bodyid[pair[0]]), int(model.site_bodyid[pair[1]])
        out[number] = pair
    return out


def _tops(parents: Sequence[int]) -> list[int]:
    """Return for each body the one below the world from which it hangs; 0 for the world."""
    out = [0]
    for body in range(1, len(parents)):
        above = int(parents[body])
        out.append(out[above] if above else body)
    return out
