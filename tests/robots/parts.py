"""Parts of mechanisms: an arm, a loop, a leg, a star.

A part takes a `Sketch`, the link it stands on and a `Place` in the world; it gives links that can carry more.
"""

from collections.abc import Sequence
from typing import Literal

import numpy as np

from hybridyn.description.records import JointKind
from tests.robots.sketch import CLOSURES, ROW_COUNT, Place, Sketch, unit

Wrist = Literal["point", "gimbal", "crossing", "ball", "universal", "two"]
WRISTS: tuple[Wrist, ...] = ("point", "gimbal", "crossing", "ball")


def arm(s: Sketch, base: str, at: np.ndarray, kinds: Sequence[JointKind]) -> str:
    """Draw a chain of joints of those kinds; those with one freedom are driven."""
    link = base
    for kind in kinds:
        link = s.joint(kind, link, at, motor=kind in ("revolute", "continuous", "prismatic"))
        at = at + 0.3 * s.direction()
    return link


# -------------------------------------------------------------------- one loop


def four_bar(
    s: Sketch, base: str, p: Place, *, closure: str = "revolute", motors: int = 1, end: JointKind = "revolute"
) -> list[str]:
    """Draw a planar four-bar; give crank, coupler, rocker."""
    A, B = p(s.jitter(), s.jitter()), p(0.1 + s.jitter(), 0.45 + s.jitter())
    D, C = p(0.9 + s.jitter(), s.jitter()), p(0.95 + s.jitter(), 0.75 + s.jitter())
    crank = s.joint("revolute", base, A, p.normal, motor=motors > 0, stem="crank")
    coupler = s.joint("continuous", crank, B, p.normal, stem="coupler")
    rocker = s.joint(end, base, D, p.normal, motor=motors > 1, stem="rocker")
    s.close(closure, coupler, rocker, C, p.normal)
    return [crank, coupler, rocker]


def slider_crank(s: Sketch, base: str, p: Place) -> list[str]:
    """Draw a slider-crank closed by its slider; give crank, rod, slider."""
    crank = s.joint("revolute", base, p(s.jitter(), s.jitter()), p.normal, motor=True)
    rod = s.joint("revolute", crank, p(0.3 + s.jitter(), 0.35), p.normal)
    slider = s.joint("revolute", rod, p(1.0, 0.1 + s.jitter()), p.normal)
    s.close("prismatic", base, slider, p(1.0, 0.1), unit(p(1.0, s.jitter()) - p(0, 0)))
    return [crank, rod, slider]


def five_bar(s: Sketch, base: str, p: Place, motors: int = 2) -> list[str]:
    """Draw a planar five-bar with 0 to 4 motors; give both cranks, both rods."""
    A, E = p(s.jitter(), s.jitter()), p(0.8 + s.jitter(), s.jitter())
    B, D = p(-0.25 + s.jitter(), 0.5 + s.jitter()), p(1.05 + s.jitter(), 0.5 + s.jitter())
    left = s.joint("revolute", base, A, p.normal, motor=motors > 0)
    right = s.joint("continuous", base, E, p.normal, motor=motors > 1)
    left_rod = s.joint("revolute", left, B, p.normal, motor=motors > 2)
    right_rod = s.joint("revolute", right, D, p.normal, motor=motors > 3)
    s.close("revolute", left_rod, right_rod, p(0.4 + s.jitter(), 0.95 + s.jitter()), p.normal)
    return [left, right, left_rod, right_rod]


def six_bar(s: Sketch, base: str, p: Place) -> list[str]:
    """Draw a six-bar: a four-bar with a dyad on coupler and rocker; give coupler and the dyad's links."""
    _, coupler, rocker = four_bar(s, base, p)
    one = s.joint("revolute", coupler, p(0.45 + s.jitter(), 0.95 + s.jitter()), p.normal)
    two = s.joint("revolute", rocker, p(1.35 + s.jitter(), 0.6 + s.jitter()), p.normal)
    s.close("revolute", one, two, p(1.0 + s.jitter(), 1.3 + s.jitter()), p.normal)
    return [coupler, one, two]


def spatial_loop(s: Sketch, base: str, closure: str, mobility: int = 2) -> list[str]:
    """Draw one loop in general position, with just the joints for its mobility, closed in the named way."""
    count = ROW_COUNT[closure] + mobility
    at, link = s.rng.uniform(-0.2, 0.2, 3), base
    second = s.rng.uniform(-0.2, 0.2, 3)
    moved = (
        0 if not CLOSURES[closure][0] else 1 if count < 6 else 2
    )  # slides that the closure's rows can feel
    slides = set(s.rng.choice(count, size=moved, replace=False).tolist())
    ends = [(base, second), (base, at)]
    for i in range(count):
        link, at = ends[i % 2]
        kind: JointKind = "prismatic" if i in slides else "continuous" if s.rng.random() < 0.3 else "revolute"
        link = s.joint(kind, link, at, motor=i < mobility)
        ends[i % 2] = (link, at + 0.35 * s.direction())
    s.close(closure, ends[0][0], ends[1][0], (ends[0][1] + ends[1][1]) / 2)
    return [ends[0][0], ends[1][0]]


def rssr(s: Sketch, base: str, p: Place) -> list[str]:
    """Draw crank, rod between two balls (it spins: idle), rocker."""
    crank = s.joint("revolute", base, p(0, 0, 0), motor=True)
    rod = s.joint("spherical", crank, p(0.2, 0.4, s.jitter()))
    rocker = s.joint("revolute", base, p(0.8, 0, 0.3))
    s.close("spherical", rod, rocker, p(0.7, 0.6 + s.jitter(), 0.3))
    return [crank, rod, rocker]


# -------------------------------------------------------------------- legs and stars


def wrist(s: Sketch, leg: str, platform: str | None, P: np.ndarray, d: np.ndarray, how: Wrist) -> str:
    """Join a leg to the platform at P in one of several writings; without platform, the leg carries it."""
    if platform is None and how in ("point", "ball"):
        return s.joint("spherical", leg, P, stem="platform")
    if platform is not None and how == "point":
        s.close("spherical", leg, platform, P)
        return platform
    if platform is not None and how == "ball":
        s.close("fixed", s.joint("spherical", leg, P, massless=True), platform, P)
        return platform
    x = s.perpendicular(d)
    if platform is not None and how == "universal":
        s.close("universal", leg, platform, P, x)
        return platform
    first = s.joint("revolute", leg, P, x, massless=True, stem="wrist")
    if how in ("universal", "two"):
        y = np.cross(d, x)
        if platform is None:
            return s.joint("revolute", first, P, y, stem="platform")
        s.close("fixed", s.joint("revolute", first, P, y, massless=True, stem="wrist"), platform, P)
        return platform
    second = s.joint("revolute", first, P, np.cross(d, x), massless=True, stem="wrist")
    if platform is None:
        return s.joint("revolute", second, P, d, stem="platform")
    if how == "gimbal":
        s.close("fixed", s.joint("revolute", second, P, d, massless=True, stem="wrist"), platform, P)
    else:
        s.close("revolute", second, platform, P, d)
    return platform


def leg(
    s: Sketch,
    base: str,
    B: np.ndarray,
    P: np.ndarray,
    platform: str | None,
    foot: str,
    how: Wrist,
    *,
    turned: bool = False,
) -> tuple[str, str]:
    """Draw a leg with a driven slide from B to P; give its upper rod and the platform.

    `foot` is "U" (two crossing revolutes, the cross massless or not), "R" (one revolute), or "S" (a ball: the
    leg then spins idly). `turned` drives the first revolute too.
    """
    d = unit(P - B)
    x = s.perpendicular(d)
    if foot == "S":
        lower = s.joint("spherical", base, B)
    else:
        lower = s.joint(
            "revolute", base, B, x, motor=turned, massless=foot == "U" and bool(s.rng.random() < 0.7)
        )
    if foot == "U":
        lower = s.joint("revolute", lower, B, np.cross(d, x))
    upper = s.joint("prismatic", lower, B + 0.3 * d, d, motor=True)
    return upper, wrist(s, upper, platform, P, d, how)


def star(
    s: Sketch,
    base: str,
    p: Place,
    feet: str,
    *,
    carried: bool = True,
    turned: int = 0,
    wrists: Sequence[Wrist] = WRISTS,
) -> tuple[str, list[str]]:
    """Draw legs (one letter of `feet` each) from a base ring to a platform; give it and the upper rods.

    The platform is carried by the first leg, or by a floating joint; the first `turned` legs have two motors.
    """
    n = len(feet)
    spread = 0.35 if n > 3 else 0.0
    platform = None if carried else s.joint("floating", base, p(0, 0, 0.8), stem="platform")
    rods = []
    for i, foot in enumerate(feet):
        middle, side = (2 * np.pi * (i // 2) / np.ceil(n / 2), (-1) ** i) if n > 3 else (2 * np.pi * i / n, 1)
        low = middle + side * spread + s.jitter()
        high = middle + side * (np.pi / 3 - spread / 2) * (n > 3) + s.jitter()
        B = p(0.6 * np.cos(low), 0.6 * np.sin(low), s.jitter())
        P = p(0.35 * np.cos(high) + s.jitter(), 0.35 * np.sin(high), 0.8 + s.jitter())
        how = wrists[int(s.rng.integers(len(wrists)))]
        rod, platform = leg(s, base, B, P, platform, foot, how, turned=i < turned)
        rods.append(rod)
    return platform, rods


def rps3(s: Sketch, base: str, p: Place) -> tuple[str, list[str]]:
    """Draw a 3-RPS: the revolute axes lie tangent to the ring."""
    platform, rods = None, []
    for i in range(3):
        angle = 2 * np.pi * i / 3 + s.jitter()
        B = p(0.5 * np.cos(angle), 0.5 * np.sin(angle))
        P = p(0.3 * np.cos(angle), 0.3 * np.sin(angle), 0.7 + s.jitter())
        d, t = unit(P - B), p.axes @ [-np.sin(angle), np.cos(angle), 0]
        lower = s.joint("revolute", base, B, t)
        rods.append(s.joint("prismatic", lower, B + 0.3 * d, d, motor=True))
        platform = wrist(s, rods[-1], platform, P, d, WRISTS[int(s.rng.integers(4))])
    return platform, rods


def central(s: Sketch, base: str, p: Place) -> str:
    """Draw a platform on a central ball, moved by three UPS legs; give it."""
    post = s.joint("spherical", base, p(0, 0, 0.6), stem="platform")
    for i in range(3):
        low, high = 2 * np.pi * i / 3 + s.jitter(0.2), 2 * np.pi * i / 3 + 0.5 + s.jitter(0.2)
        B, P = p(0.6 * np.cos(low), 0.6 * np.sin(low)), p(0.35 * np.cos(high), 0.35 * np.sin(high), 0.75)
        leg(s, base, B, P, post, "U", WRISTS[int(s.rng.integers(4))])
    return post


def delta(s: Sketch, base: str, p: Place, *, bars: bool) -> str:
    """Draw a Delta; give its platform.

    `bars`: every parallelogram has short bars and four revolutes (a loop inside the leg, overconstrained),
    else it is a pair of universal-spherical rods between arm and platform.
    """
    center, platform = p(s.jitter(), s.jitter(), 0.9 + s.jitter(0.05)), None
    if not bars:
        platform = s.joint("floating", base, center, stem="platform")
    for i in range(3):
        angle = 2 * np.pi * i / 3 + s.jitter()
        r, t = p.axes @ [np.cos(angle), np.sin(angle), 0], p.axes @ [-np.sin(angle), np.cos(angle), 0]
        E, F = p.origin + (0.7 + s.jitter()) * r + (0.3 + s.jitter()) * p.normal, center + 0.15 * r
        upper = s.joint("revolute", base, p.origin + 0.35 * r, t, motor=True, stem="arm")
        n = unit(np.cross(t, F - E))
        if platform is not None and not bars:
            for side in (-0.1, 0.1):
                d = unit(F - E)
                cross = s.joint("revolute", upper, E + side * t, t, massless=True)
                s.close(
                    "spherical",
                    s.joint("revolute", cross, E + side * t, np.cross(d, t)),
                    platform,
                    F + side * t,
                )
            continue
        top = s.joint("revolute", upper, E, t, stem="bar")
        rods = [s.joint("revolute", top, E + side * t, n, stem="rod") for side in (-0.1, 0.1)]
        bottom = s.joint("revolute", rods[0], F - 0.1 * t, n, stem="bar")
        s.close("revolute", bottom, rods[1], F + 0.1 * t, n)
        if platform is None:
            platform = s.joint("revolute", bottom, F, t, stem="platform")
        else:
            s.close("revolute", bottom, platform, F, t)
    return platform


def planar_rpr(s: Sketch, base: str, p: Place) -> str:
    """Draw a platform on a planar joint, moved by three planar R-P-R legs (overconstrained); give it."""
    platform = s.joint("planar", base, p(s.jitter(), s.jitter()), p.normal, stem="platform")
    for i in range(3):
        low, high = 2 * np.pi * i / 3 + s.jitter(), 2 * np.pi * i / 3 + 0.9 + s.jitter()
        B, P = p(0.8 * np.cos(low), 0.8 * np.sin(low)), p(0.3 * np.cos(high), 0.3 * np.sin(high))
        foot = s.joint("revolute", base, B, p.normal)
        rod = s.joint("prismatic", foot, B, unit(P - B), motor=True)
        s.close("revolute", rod, platform, P, p.normal)
    return platform
