"""Linkages that can be set as near to a singular posture as wanted, and their mobility elsewhere.

Each is laid out in the world in the asked posture, its frames at random, with closures that hold there.
`mobility_far_from` is the judge: the oracle's rows in sixty digits, at a posture far from home.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise

import mpmath
import numpy as np

from hybridyn.description.records import Description
from tests.oracle import Extended, Oracle
from tests.robots.sketch import Place, Sketch, turn, unit

#: Far from home, rows depend on each other to the rounding of a mechanism drawn in doubles, or not at all.
RANK = 1e-12
#: Ways of the judge, their steps, and the length of a step in scaled coordinates.
WAYS, STEPS, STEP = 4, 6, 0.25
Point = Sequence[float]


# -------------------------------------------------------------------- the judge


def mobility_far_from(description: Description) -> int:
    """Count the motions at the posture that oracle's own walks from home reach with the clearest rank."""
    oracle, rng = Oracle(description), np.random.default_rng(1)
    home = np.concatenate([description.home[name] for name in oracle.joint_names])
    best, clearest = home, 0.0
    for _ in range(WAYS):
        q, heading = home, rng.normal(size=oracle.nv)
        for _ in range(STEPS):
            Z = oracle.posture(q).Z
            step = Z @ (Z.T @ heading)
            heading = step * np.sqrt(len(step)) / np.linalg.norm(step)
            try:
                after = oracle.close(oracle.integrate(q, oracle.unit * step * STEP / np.abs(step).max()))
            except ValueError:
                break
            posture = oracle.posture(after)
            if posture.Z.shape[1] > Z.shape[1]:
                break
            s = np.linalg.svd(posture.K * oracle.unit / posture.scale[:, None], compute_uv=False)
            clear = s[oracle.nv - posture.Z.shape[1] - 1] / s[0]
            q, best, clearest = (after, after, clear) if clear > clearest else (after, best, clearest)
    mp = mpmath.mp.clone()
    mp.dps = 60
    exact = Oracle(description, arithmetic=Extended(mp), rank_tolerance=RANK)
    return int(exact.posture(exact.close(best)).Z.shape[1])


# -------------------------------------------------------------------- in a plane


class Plane:
    """A planar linkage in the making."""

    def __init__(self, seed: int, sketch: Sketch | None = None, place: Place | None = None) -> None:
        self.sketch = sketch or Sketch(np.random.default_rng(seed))
        self.sketch.fixed_links = 0.0
        self.place = place or self.sketch.place()

    def hinge(self, parent: str, at: Point, motor: bool = False) -> str:
        """Add a hinge at a point; return its link."""
        return self.sketch.joint("revolute", parent, self.place(*at), self.place.normal, motor=motor)

    def slide(self, parent: str, at: Point, along: Point, motor: bool = False) -> str:
        """Add a slide through a point; return its link."""
        axis = self.place.axes @ [*along, 0.0]
        return self.sketch.joint("prismatic", parent, self.place(*at), unit(axis), motor=motor)

    def pin(self, a: str, b: str, at: Point) -> None:
        """Close a loop by a hinge at a point."""
        self.sketch.close("revolute", a, b, self.place(*at), self.place.normal)


def scissor_stages(plane: Plane, base: str, stages: int, angle: float) -> str:
    """Add scissors on a driven foot, their bars raised by an angle; return the link whose end is on top."""
    w, h = np.cos(angle), np.sin(angle)
    a, b = base, plane.slide(base, (w, 0), (1, 0), motor=True)
    for k in range(stages):
        left, right = (a, b) if k == 0 else (b, a)
        a, b = plane.hinge(left, (0, k * h)), plane.hinge(right, (w, k * h))
        plane.pin(a, b, (w / 2, (k + 0.5) * h))
    return b


def scissors(stages: int, angle: float) -> Description:
    """A scissor lift."""
    plane = Plane(stages)
    scissor_stages(plane, "base", stages, angle)
    return plane.sketch.description("scissors")


def pantograph(angle: float) -> Description:
    """Four bars, the long ones 2 m, in a parallelogram of sides 1 m; its corner at the joint of both."""
    plane = Plane(2)
    one, two = np.array([1.0, 0.0]), np.array([np.cos(angle), np.sin(angle)])
    first = plane.hinge("base", (0, 0), motor=True)
    second = plane.hinge(first, 2 * one, motor=True)
    short, other = plane.hinge(first, one), plane.hinge(second, 2 * one + two)
    plane.pin(short, other, one + two)
    return plane.sketch.description("pantograph")


def parallelograms(count: int, angle: float) -> Description:
    """A row of equal parallelograms, their cranks raised by an angle."""
    plane, top = Plane(3), np.array([np.cos(angle), np.sin(angle)])
    cranks = [plane.hinge("base", (k, 0), motor=k == 0) for k in range(count + 1)]
    for k, (one, two) in enumerate(pairwise(cranks)):
        plane.pin(plane.hinge(one, (k + top[0], top[1])), two, (k + 1 + top[0], top[1]))
    return plane.sketch.description("parallelograms")


def hoberman_ring(units: int, spread: float) -> Description:
    """A ring of angulated scissors; its inner and outer pins meet on every ray as `spread` goes to zero."""
    plane, half = Plane(4), np.pi / units
    m = np.cos(spread) / np.sin(half)

    def on(ray: float, radius: float) -> np.ndarray:
        return radius * np.array([np.cos(2 * half * ray), np.sin(2 * half * ray)])

    inner, outer = (m * np.cos(half) - np.sin(spread), m * np.cos(half) + np.sin(spread))
    first_a, first_b = "base", plane.hinge("base", on(0.5, m), motor=True)
    a, b = first_a, first_b
    for k in range(1, units):
        a, b = plane.hinge(b, on(k, inner)), plane.hinge(a, on(k, outer))
        plane.pin(a, b, on(k + 0.5, m))
    plane.pin(b, first_a, on(0, inner))
    plane.pin(a, first_b, on(0, outer))
    return plane.sketch.description("hoberman_ring")


def peaucellier(off: float) -> Description:
    """An inversor, bars 3 and 1 m, whose rhombus is open by an angle of its sides: zero at a stroke's end."""
    plane, long, side = Plane(5), 3.0, 1.0
    near = np.sqrt(long**2 - (side * np.sin(off)) ** 2) - side * np.cos(off)
    far = near + 2 * side * np.cos(off)
    A, C = (np.array([near + side * np.cos(off), sign * side * np.sin(off)]) for sign in (1, -1))
    B, D, r = np.array([near, 0.0]), np.array([far, 0.0]), 1.2
    Q = np.array([near / 2, np.sqrt(r * r - near * near / 4)])
    one, two = plane.hinge("base", (0, 0)), plane.hinge("base", (0, 0))
    crank = plane.hinge("base", Q, motor=True)
    sides = [plane.hinge(one, A), plane.hinge(two, C), plane.hinge(one, A), plane.hinge(two, C)]
    plane.pin(sides[0], crank, B)
    plane.pin(sides[1], crank, B)
    plane.pin(sides[2], sides[3], D)
    return plane.sketch.description("peaucellier")


# -------------------------------------------------------------------- in space


def sarrus(angle: float) -> Description:
    """Two legs of three parallel hinges each, their bars raised by an angle: flat at zero."""
    s = Sketch(np.random.default_rng(6))
    s.fixed_links = 0.0
    place, ends = s.place(), []
    for out, across in (((1, 0, 0), (0, 1, 0)), ((0, 1, 0), (-1, 0, 0))):
        out, axis = np.array(out, float), place.axes @ np.array(across, float)
        up = np.array([0.0, 0.0, np.sin(angle)])
        points = [out, out * (1 + np.cos(angle)) + up, out + 2 * up]
        link = "base"
        for k, point in enumerate(points):
            if k == 2 and ends:
                s.close("revolute", link, ends[0], place(*point), axis)
            else:
                link = s.joint("revolute", link, place(*point), axis, motor=k == 0 and not ends)
        ends.append(link)
    return s.description("sarrus")


def ring(
    name: str, lengths: Sequence[float], twists: Sequence[float], angles: Sequence[float]
) -> Description:
    """A loop of hinges by Denavit and Hartenberg's numbers, which have to close it."""
    s = Sketch(np.random.default_rng(7))
    s.fixed_links = 0.0
    place = s.place()
    R, p, link = place.axes, place.origin, "base"
    for k, (length, twist, angle) in enumerate(zip(lengths, twists, angles, strict=True)):
        z = R[:, 2]
        if k + 1 < len(angles):
            link = s.joint("revolute", link, p, z, motor=k == 0)
        else:
            s.close("revolute", link, "base", p, z)
        R = R @ turn(np.array([0.0, 0.0, 1.0]), angle)
        p, R = p + length * R[:, 0], R @ turn(np.array([1.0, 0.0, 0.0]), twist)
    assert np.allclose(p, place.origin, atol=1e-13)
    assert np.allclose(R, place.axes, atol=1e-13)
    return s.description(name)


def bennett(angle: float) -> Description:
    """Bennett's loop of four hinges, folded at zero."""
    alpha, beta = 0.5, 1.2
    half = np.sin((beta + alpha) / 2) / np.sin((beta - alpha) / 2) / np.tan(angle / 2)
    other = 2 * np.arctan(half)
    a, b = np.sin(alpha), np.sin(beta)
    return ring("bennett", (a, b, a, b), (alpha, beta, alpha, beta), (angle, other, -angle, -other))


def bricard(angle: float, twist: float = np.pi / 2) -> Description:
    """Bricard's loop of six hinges in its form of threefold symmetry, by one of its angles."""
    c, s = np.cos(twist), np.sin(twist)
    cosine = s * s + (1 + c * c) * np.cos(angle)
    sine, rest = -2 * c * np.sin(angle), c * c + s * s * np.cos(angle)
    other = np.arctan2(sine, cosine) + np.arccos(-rest / np.hypot(sine, cosine))
    return ring("bricard", (1.0,) * 6, (twist, -twist) * 3, (angle, other) * 3)


def delta(bend: float) -> Description:
    """Three legs of an arm and a forearm on universal joints, which are straight at a bend of zero."""
    s = Sketch(np.random.default_rng(8))
    s.fixed_links = 0.0
    place, platform = s.place(), ""
    down = 0.9
    for k in range(3):
        t = turn(np.array([0.0, 0.0, 1.0]), 2 * np.pi * k / 3)
        axis = place.axes @ t[:, 1]

        def at(r: float, z: float, t: np.ndarray = t) -> np.ndarray:
            return place(*(t @ np.array([r, 0.0, z])))

        arm, forearm = (np.array([np.cos(x), -np.sin(x)]) for x in (down, down + bend))
        elbow, wrist = np.array([0.5, 0.0]) + arm, np.array([0.5, 0.0]) + arm + 1.3 * forearm
        across = np.cross(axis, place.axes @ (t @ np.array([forearm[0], 0.0, forearm[1]])))
        link = s.joint("revolute", "base", at(0.5, 0.0), axis, motor=True)
        link = s.joint("revolute", link, at(*elbow), axis)
        link = s.joint("revolute", link, at(*elbow), across)
        link = s.joint("revolute", link, at(*wrist), across)
        if platform:
            s.close("revolute", link, platform, at(*wrist), axis)
        else:
            platform = s.joint("revolute", link, at(*wrist), axis)
    return s.description("delta")


def scissor_platform(stages: int, angle: float) -> Description:
    """A platform on three scissor lifts, each on a universal joint, with ball joints on top: six freedoms."""
    s = Sketch(np.random.default_rng(9))
    s.fixed_links = 0.0
    place, platform = s.place(), ""
    for k in range(3):
        R = place.axes @ turn(np.array([0.0, 0.0, 1.0]), 2 * np.pi * k / 3 + 0.2)
        origin = place.origin + 1.5 * R[:, 0]
        plane = Plane(0, s, Place(origin, np.column_stack([R[:, 1], R[:, 2], R[:, 0]])))
        carrier = s.joint("revolute", "base", origin, R[:, 0])
        carrier = s.joint("revolute", carrier, origin, R[:, 1])
        last = scissor_stages(plane, carrier, stages, angle)
        top = plane.place(0.0, stages * np.sin(angle))
        if platform:
            s.close("spherical", last, platform, top)
        else:
            platform = s.joint("spherical", last, top)
    return s.description("scissor_platform")


#: Name of each family to its layout by a distance from singular, and its mobility.
Family = tuple[Callable[[float], Description], int]
FAMILIES: dict[str, Family] = {
    **{f"scissors {n}": ((lambda d, n=n: scissors(n, np.pi / 2 - d)), 1) for n in range(2, 9)},
    **{f"low scissors {n}": ((lambda d, n=n: scissors(n, d)), 1) for n in (2, 3)},
    **{f"parallelograms {n}": ((lambda d, n=n: parallelograms(n, d)), 1) for n in (1, 2, 4, 8)},
    **{f"hoberman ring {n}": ((lambda d, n=n: hoberman_ring(n, d)), 1) for n in (4, 6, 8)},
    "pantograph": (pantograph, 2),
    "peaucellier": (peaucellier, 1),
    "sarrus": (sarrus, 1),
    "bennett": (bennett, 1),
    "bricard": (lambda d: bricard(2 * np.pi / 3 - d), 1),
    "bricard of tetrahedra": (lambda d: bricard(d, np.pi / 3), 1),
    "delta": (delta, 3),
    **{f"scissor platform {n}": ((lambda d, n=n: scissor_platform(n, np.pi / 2 - d)), 6) for n in (2, 3)},
}
