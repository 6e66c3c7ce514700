"""Random stacks: arms between, on and under parallel modules, planar ones and spatial ones; seeded.

    stack = random_stack(seed)
    stack.description, stack.base, stack.link, stack.other

A draw whose loops are ill conditioned, or whose freedoms are not those of its parts, is thrown away.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import cast

import numpy as np

from hybridyn.description.records import Description, JointKind
from tests.oracle import Base, Oracle
from tests.robots.mechanisms import HOME_MARGIN, home_posture, is_well_conditioned
from tests.robots.parts import central, delta, five_bar, four_bar, planar_rpr, rps3, six_bar, star
from tests.robots.recipes import Kind
from tests.robots.sketch import Place, Sketch

DRAWS = 200
#: Parts by name: what draws them, which of what it gives carries the next part, and their freedoms.
Drawn = Callable[[Sketch, str, Place], str]
PLANAR: dict[str, tuple[Drawn, int]] = {
    "four_bar": (lambda s, base, p: four_bar(s, base, p)[1], 1),
    "six_bar": (lambda s, base, p: six_bar(s, base, p)[1], 1),
    "five_bar": (lambda s, base, p: five_bar(s, base, p)[2], 2),
    "planar_rpr": (planar_rpr, 3),
}
SPATIAL: dict[str, tuple[Drawn, int]] = {
    **PLANAR,
    "rps3": (lambda s, base, p: rps3(s, base, p)[0], 3),
    "gough": (lambda s, base, p: star(s, base, p, "UUUUUU")[0], 6),
    "gough_floating": (lambda s, base, p: star(s, base, p, "UUUUUU", carried=False)[0], 6),
    "star": (lambda s, base, p: star(s, base, p, "UUU", turned=3)[0], 6),
    "delta_rods": (partial(delta, bars=False), 3),
    "delta_bars": (partial(delta, bars=True), 3),
    "central": (central, 3),
}
#: Of so many stacks one is planar; one has two branches, between which the pose is given; one moves its base.
PLANAR_EACH, BRANCHED_EACH, FLOATING_EACH = 3, 4, 5


@dataclass(frozen=True)
class Stack:
    """A robot, and the links between which a pose is given.

    Attributes:
        description: The robot.
        base: Its base.
        link: The outermost link.
        other: The root, the outermost link of the other branch, or "world".
        mobility: Its freedoms, without those of a base.
        parts: Names of its parts from the root up; those of the second branch after "|".
    """

    description: Description
    base: Base
    link: str
    other: str
    mobility: int
    parts: tuple[str, ...]


def _on(s: Sketch, link: str, axes: np.ndarray | None) -> Place:
    """Return a place on a link for the next part, in the plane of the stack where there is one."""
    at = s.poses[link][:3, 3] + (s.rng.uniform(-0.15, 0.15, 3) if axes is None else np.zeros(3))
    return s.place(at) if axes is None else Place(at, axes)


def _arm(s: Sketch, link: str, axes: np.ndarray | None, count: int) -> str:
    """Draw a serial arm; in a plane, its axes are normal to it, and its slides lie in it."""
    at = s.poses[link][:3, 3]
    kinds = s.rng.choice(["revolute", "continuous", "prismatic"], p=[0.6, 0.2, 0.2], size=count)
    for kind in map(str, kinds):
        way = s.direction() if axes is None else axes @ [*s.direction()[:2], 0.0]
        axis = None if axes is None else axes[:, 2] if kind != "prismatic" else way / np.linalg.norm(way)
        link = s.joint(cast(JointKind, kind), link, at, axis, motor=True)
        at = at + 0.3 * (s.direction() if axes is None else way)
    return link


def _branch(s: Sketch, link: str, axes: np.ndarray | None, count: int) -> tuple[str, list[str], int]:
    """Draw parts on a link; return the last one's link, the names of the parts, and their freedoms."""
    known, names, mobility = PLANAR if axes is not None else SPATIAL, [], 0
    for _ in range(count):
        serial = not names or (names[-1] != "arm" and s.rng.random() < 0.5)
        name = "arm" if serial and s.rng.random() < 0.7 else str(s.rng.choice([*known]))
        if name == "arm":
            more = int(s.rng.integers(1, 4))
            link = _arm(s, link, axes, more)
        else:
            draw, more = known[name]
            link = draw(s, link, _on(s, link, axes))
        names, mobility = [*names, name], mobility + more
    return link, names, mobility


def _draw(seed: int, draw: int) -> tuple[Sketch, str, str, int, tuple[str, ...]]:
    s = Sketch(np.random.default_rng([seed, draw, 48]))
    axes = s.random_rotation() if seed % PLANAR_EACH == 0 else None
    count = int(s.rng.integers(2, 5))
    if seed % BRANCHED_EACH:
        link, names, mobility = _branch(s, "base", axes, count)
        return s, link, "base", mobility, tuple(names)
    trunk, first, own = _branch(s, "base", axes, 1)
    left, right = (_branch(s, trunk, axes, int(s.rng.integers(1, 3))) for _ in range(2))
    names = [*first, "|", *left[1], "|", *right[1]]
    return s, right[0], left[0], own + left[2] + right[2], tuple(names)


@lru_cache(maxsize=256)
def random_stack(seed: int) -> Stack:
    """Draw a stack.

    Raises:
        RuntimeError: No draw was well conditioned.
    """
    for draw in range(DRAWS):
        s, link, other, mobility, parts = _draw(seed, draw)
        if not s.closures or link == other:
            continue
        description = s.description(f"stack_{seed}")
        oracle = Oracle(description)
        kind = Kind(lambda _: None, serial=mobility)
        if is_well_conditioned(oracle, home_posture(description, "fixed"), kind, HOME_MARGIN):
            floating = seed % FLOATING_EACH == 0
            if floating and other == "base":
                other = "world"
            return Stack(description, "floating" if floating else "fixed", link, other, mobility, parts)
    raise RuntimeError(f"no well conditioned stack in {DRAWS} draws")
