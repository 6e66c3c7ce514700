"""Mechanisms of clear rank, of which the oracle knows everything: random trees, loops, gears and motors.

Unlike those of `mechanisms.py`, their mobility is not known beforehand: the oracle finds it, and draws of
unclear rank are thrown away (`any_mechanism.py` keeps them). Motors may be too many, too few, or held by
loops. Every mechanism is drawn assembled, in a posture stored as `home`; states are drawn by the oracle.

    case = generated(seed)
    case.description, case.base, case.oracle, case.states(5)
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from hybridyn.description.records import Closure, Description, JointKind, RotationKind
from tests.oracle import Base, Oracle
from tests.robots.mechanisms import CLOSED, home_posture, near
from tests.robots.sketch import CLOSURES, Sketch, unit

ONE: tuple[JointKind, ...] = ("revolute", "continuous", "prismatic")
FREEDOMS: dict[JointKind, int] = {
    "revolute": 1, "continuous": 1, "prismatic": 1, "spherical": 3, "planar": 3, "floating": 6,
}  # fmt: skip
BASES: tuple[Base, ...] = ("fixed", "fixed", "moving", "floating")
RATIOS = (1.0, -1.0, 2.0, 0.5, -1.5, 3.14, 2.37, 1.234, 0.558, -0.1, 20.0)
#: Relative singular values between which the rank of closure rows is unclear: draws there are left out.
DROPPED, KEPT = 1e-11, 1e-3
STEP = 0.6  # how far a random state is from home, in the oracle's scaled coordinates


# -------------------------------------------------------------------- the layout


class Layout:
    """A mechanism that grows by random parts, up to a number of freedoms of its tree."""

    def __init__(self, rng: np.random.Generator, freedoms: int) -> None:
        self.rng, self.sketch, self.left = rng, Sketch(rng), freedoms
        self.ends = ["base"]

    def pick(self, choices: Sequence[str]) -> str:
        """Draw one of several names."""
        return choices[int(self.rng.integers(len(choices)))]

    def kinds(self, least: int, most: int, of: Sequence[JointKind]) -> list[JointKind]:
        """Draw joint kinds with `least` to `most` freedoms together, as far as freedoms are left."""
        wanted = min(int(self.rng.integers(least, most + 1)), self.left)
        out: list[JointKind] = []
        while wanted:
            kind = of[int(self.rng.integers(len(of)))]
            if FREEDOMS[kind] <= wanted:
                out.append(kind)
                wanted -= FREEDOMS[kind]
        self.left -= sum(FREEDOMS[kind] for kind in out)
        return out

    def any_kinds(self, least: int = 1, most: int = 6) -> list[JointKind]:
        """Draw kinds, most of one freedom."""
        rich = self.rng.random() < 0.4
        return self.kinds(least, most, (*ONE, "spherical", "planar", "floating") if rich else ONE)

    def grow(
        self,
        link: str,
        kinds: Sequence[JointKind],
        axis: Callable[[np.ndarray, JointKind], np.ndarray] | None = None,
        plane: np.ndarray | None = None,
    ) -> str:
        """Add a chain of joints, each driven or not; return its last link."""
        s, at = self.sketch, self.at(link)
        for kind in kinds:
            along = None if axis is None else axis(at, kind)
            link = s.joint(kind, link, at, along, motor=kind in ONE and bool(self.rng.random() < 0.6))
            step = s.direction() if plane is None else s.perpendicular(plane)
            at = at + 0.3 * step
        return link

    def at(self, link: str) -> np.ndarray:
        """Draw a point near a link's origin."""
        place: np.ndarray = self.sketch.poses[link][:3, 3] + self.rng.uniform(-0.2, 0.2, 3)
        return place

    # ---------------------------------------------------------------- parts

    def branch(self) -> None:
        """Add an open chain."""
        self.ends.append(self.grow(self.pick(self.ends), self.any_kinds(1, 4)))

    def door(self) -> None:
        """Add one joint with a second bearing on its axis, or with one that locks it."""
        s, base = self.sketch, self.pick(self.ends)
        at, axis, kind = self.at(base), s.direction(), self.kinds(1, 1, ONE)[0]
        leaf = s.joint(kind, base, at, axis, motor=bool(self.rng.random() < 0.7))
        locked = self.rng.random() < 0.3
        by = {"prismatic": ["prismatic", "cylindrical"]}.get(kind, ["revolute", "cylindrical", "planar"])
        how = self.pick(list(CLOSURES)) if locked else self.pick(by)
        s.close(how, base, leaf, at + 0.7 * axis, None if locked else axis)
        self.ends.append(leaf)

    def loop(self) -> None:
        """Add two legs of any joints, and close them by any rows."""
        base = self.pick(self.ends)
        one = self.grow(base, self.any_kinds())
        other = self.grow(base, self.any_kinds()) if self.left and self.rng.random() < 0.8 else base
        self.close(one, other)
        self.ends += [one, other]

    def star(self) -> None:
        """Add a platform on one leg, to which more legs are closed."""
        base = self.pick(self.ends)
        platform = self.grow(base, self.any_kinds(2, 6))
        for _ in range(int(self.rng.integers(1, 4))):
            if self.left:
                self.close(self.grow(base, self.any_kinds(1, 6)), platform)
        self.ends.append(platform)

    def planar(self) -> None:
        """Add a loop that moves in a plane, with too many rows."""
        s, base = self.sketch, self.pick(self.ends)
        normal = s.direction()

        def axis(at: np.ndarray, kind: JointKind) -> np.ndarray:
            return s.perpendicular(normal) if kind == "prismatic" else normal

        legs = [self.grow(base, self.kinds(1, 3, ONE), axis, normal) for _ in range(2) if self.left]
        one, other = (*legs, base)[:2]
        self.close(one, other, normal, self.pick(["revolute", "cylindrical", "fixed", "spherical", "planar"]))
        self.ends += legs

    def round(self) -> None:
        """Add a loop of hinges whose axes meet in one point, with too many rows."""
        s, base = self.sketch, self.pick(self.ends)
        centre = self.at(base)

        def axis(at: np.ndarray, kind: JointKind) -> np.ndarray:
            return unit(at - centre)

        legs = [
            self.grow(base, self.kinds(1, 3, ("revolute", "continuous")), axis) for _ in range(2) if self.left
        ]
        one, other = (*legs, base)[:2]
        z = s.direction()
        closure = self.pick(["revolute", "spherical", "fixed"])
        s.close(closure, one, other, centre + (0.0 if closure == "spherical" else 0.4) * z, z)
        self.ends += legs

    def close(self, a: str, b: str, z: np.ndarray | None = None, kind: str | None = None) -> None:
        """Close a loop between two links, by default with any rows."""
        s = self.sketch
        s.close(kind or self.pick(list(CLOSURES)), a, b, self.at(a), z)
        if kind is None and self.rng.random() < 0.3:
            s.closures[-1] = fewer_rows(s.closures[-1], self.rng)

    def couple(self) -> None:
        """Couple two or three joints of one freedom, by any ratios."""
        s = self.sketch
        links = [j.child for j in s.joints if j.kind in ONE]
        count = min(int(self.rng.integers(2, 4)), len(links))
        if count < 2:
            return
        ratios = [1.0, *self.rng.choice(RATIOS, count - 1)]
        if self.rng.random() < 0.3:
            ratios[-1] *= float(self.rng.uniform(0.3, 3.0))
        s.couple([links[i] for i in self.rng.permutation(len(links))[:count]], ratios)


def fewer_rows(closure: Closure, rng: np.random.Generator) -> Closure:
    """Drop rows of a closure, so that at least one is left."""
    kept = tuple(i for i in closure.translations if rng.random() < 0.6)
    weaker: dict[RotationKind, tuple[RotationKind, ...]] = {
        "fixed": ("fixed", "parallel", "free"), "parallel": ("parallel", "free"),
        "perpendicular": ("perpendicular", "free"), "free": ("free",),
    }  # fmt: skip
    rotation = weaker[closure.rotation][int(rng.integers(len(weaker[closure.rotation])))]
    if not kept and rotation == "free":
        return closure
    return replace(closure, translations=kept, rotation=rotation, kind="rows")


# -------------------------------------------------------------------- the cases


def remembered(compute: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function of arrays and postures that computes every answer once."""
    known: dict[bytes, Any] = {}

    def call(*given: Any) -> Any:
        key = b"".join(np.asarray(getattr(x, "G", x)).tobytes() for x in given)
        if key not in known:
            known[key] = compute(*given)
        return known[key]

    return call


@dataclass(frozen=True)
class Case:
    """A mechanism, what carries it, and the oracle of both."""

    seed: int
    description: Description = field(repr=False)
    base: Base
    oracle: Oracle = field(repr=False)
    mobility: int | None
    parts: tuple[str, ...] = ()

    def states(self, count: int) -> list[tuple[np.ndarray, ...]]:
        """Draw q, v, a that the loops allow, and efforts; two states at each posture, the first at home.

        Only at clear ranks: there are fewer where few are clear.
        """
        rng, oracle = np.random.default_rng([self.seed, 1]), self.oracle
        out: list[tuple[np.ndarray, ...]] = []
        for number in range(2 * count):
            q = near(oracle, home_posture(self.description, self.base), rng, STEP if number else 0.0)
            if q is None or mobility_of(oracle, q) != self.mobility:
                continue
            for _ in range(2):
                v = oracle.project_velocity(q, rng.normal(size=oracle.nv))
                a = oracle.consistent_acceleration(q, v, 3 * rng.normal(size=oracle.nv))
                out.append((q, v, a, 20 * rng.normal(size=len(oracle.motors))))
            if len(out) >= count:
                break
        return out[:count]


def mobility_of(oracle: Oracle, q: np.ndarray) -> int | None:
    """Return the freedoms at a posture, also of a free base; None where rank or closing is unclear."""
    if np.abs(oracle.residual(q)).max(initial=0.0) > CLOSED * 10:
        return None
    posture = oracle.posture(q)
    K = (posture.K * oracle.unit / posture.scale[:, None])[:, oracle.tree.free]
    s = np.linalg.svd(K, compute_uv=False) if K.size else np.zeros(0)
    largest = s.max(initial=1.0)
    if ((s > DROPPED * largest) & (s < KEPT * largest)).any():
        return None
    return int(posture.Z.shape[1])


#: What a mechanism grows by; loops twice as often.
PARTS = ("branch", "door", "loop", "loop", "star", "planar", "round")


def generated(seed: int, freedoms: int = 9, *, screws: bool = False) -> Case:
    """Draw a mechanism whose tree has up to so many freedoms, at a home of clear rank.

    Args:
        seed: Same seed, same mechanism.
        freedoms: Most freedoms.
        screws: Whether every revolute joint becomes a screw.
    """
    for draw in range(100):
        rng = np.random.default_rng([seed, draw, freedoms])
        layout = Layout(rng, int(rng.integers(1, freedoms + 1)))
        while layout.left > 0:
            getattr(layout, PARTS[int(rng.integers(len(PARTS)))])()
        for _ in range(int(rng.choice([0, 0, 1, 2]))):
            layout.couple()
        if screws:
            threaded(layout.sketch, rng)
        case = case_of(layout, BASES[int(rng.integers(len(BASES)))], seed)
        if case.mobility is not None:
            return case
    raise RuntimeError(f"no mechanism of clear rank for seed {seed}")


def threaded(s: Sketch, rng: np.random.Generator) -> None:
    """Make every revolute joint a screw of the same placement at home."""
    for i, joint in enumerate(s.joints):
        if joint.kind == "revolute":
            pitch, place = float(rng.uniform(-0.2, 0.2)), np.eye(4)
            place[:3, 3] = -pitch * s.home[joint.name][0] * joint.axis
            s.joints[i] = replace(joint, kind=JointKind.SCREW, pitch=pitch, placement=joint.placement @ place)


def case_of(layout: Layout, base: Base, seed: int, parts: Sequence[str] = ()) -> Case:
    """Return a mechanism with its oracle; its mobility is None where its rank is unclear."""
    description = layout.sketch.description(f"generated_{seed}")
    oracle = Oracle(description, base)
    oracle.posture = remembered(oracle.posture)  # type: ignore[method-assign]
    oracle.tree.drifts = remembered(oracle.tree.drifts)  # type: ignore[method-assign]
    return Case(
        seed, description, base, oracle, mobility_of(oracle, home_posture(description, base)), tuple(parts)
    )
