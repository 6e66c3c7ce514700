"""Mechanisms whose modules repeat, mirrored and turned, and modules whose legs do.

Copies share code: their joints, closures and axes are the same, the rest are numbers. What is no number must
not be taken from the first of them, as the lines of rods in their bodies, which point elsewhere in a mirror.
"""

import numpy as np

from hybridyn.description.records import Description
from tests.compiled import rods
from tests.oracle import Oracle
from tests.robots.any_mechanism import any_mechanism
from tests.robots.mechanisms import home_posture, random_mechanism
from tests.robots.mirrors import MIRRORS, Mounted, image, joined, renamed, with_axes
from tests.robots.sketch import Sketch, placement, turn, unit

FEET: tuple[rods.Foot, ...] = ("ball", "ball", "universal", "revolutes", "floating", "floating aside")
#: Modules of random mechanisms with one loop or more.
LOOPS = (
    "four_bar", "four_bar_point", "slider_crank", "five_bar", "rssr", "planar_rpr", "star_three", "rps3",
    "central", "delta_rods", "delta_bars", "gear_two", "gear_inside", "loop_cylindrical", "loop_universal",
    "sps",
)  # fmt: skip
#: Freedoms of all joints, and of those of a module: larger ones take minutes, so that one in so many is.
MOST_FREEDOMS, MOST_OF_ONE, LARGE, LARGE_OF_ONE, LARGE_OF = 30, 14, 50, 25, 10


def repeated(seed: int) -> Description:
    """Draw a mechanism and copies of it, side by side or one on the other."""
    rng = np.random.default_rng([seed, 52])
    most, most_of_one = (MOST_FREEDOMS, MOST_OF_ONE) if seed % LARGE_OF else (LARGE, LARGE_OF_ONE)
    first = one_module(seed, rng)
    while (size := sum(joint.kind.nv for joint in first.joints)) > most_of_one:
        first = one_module(seed, rng)
    first = coordinate_axes(first, rng)
    parts = [Mounted(renamed(first, "a"), "", np.eye(4))]
    for stem in "bcd"[: rng.integers(1, min(max(2, most // max(1, size)), 4))]:
        S = MIRRORS[rng.integers(len(MIRRORS))]
        parts.append(Mounted(renamed(copy_of(first, rng, S), stem), mount(parts, rng), somewhere(rng)))
    return joined(f"repeated_{seed}_{first.name}", parts)


def one_module(seed: int, rng: np.random.Generator) -> Description:
    """Draw the mechanism that repeats: machines of rods, legs that mirror each other, or any loops."""
    family, foot = rng.random(), FEET[rng.integers(len(FEET))]
    if family < 0.35:
        name = rng.choice(["crank", "crank", "ball_delta", "ball_gough", "slides"])
        return getattr(rods, name)(seed, foot, thin=bool(rng.random() < 0.3))  # type: ignore[no-any-return]
    if family < 0.45:
        return rods.cylinder(seed)
    if family < 0.7:
        return mirrored_legs(seed)
    if family < 0.9:
        return random_mechanism(seed % 100, kind=str(rng.choice(LOOPS)))
    return any_mechanism(seed)[0]


def coordinate_axes(description: Description, rng: np.random.Generator) -> Description:
    """Turn the frames of links so that axes are those of coordinates, or leave them, by chance."""
    if rng.random() < 0.3:
        return description
    names = sorted(joint.name for joint in description.joints)
    return with_axes(description, {name: np.eye(3)[rng.integers(3)] for name in names}, None)


def copy_of(description: Description, rng: np.random.Generator, S: np.ndarray) -> Description:
    """Draw a copy in a mirror: its frames have the same axes, also turned about them, or opposite ones."""
    frames = rng.choice(["same", "same", "turned", "turned", "opposite"])
    axes = {joint.name: joint.axis for joint in description.joints if joint.kind.single}
    mirrored = image(description, S, {})
    own = {joint.name: joint.axis for joint in mirrored.joints}
    flipped = {
        name: bool(rng.random() < 0.3 if frames == "opposite" else own[name] @ axis < 0)
        for name, axis in axes.items()
    }
    mirrored = image(description, S, flipped)
    if frames == "opposite":
        return mirrored
    return with_axes(mirrored, axes, rng if frames == "turned" else None)


def mount(parts: list[Mounted], rng: np.random.Generator) -> str:
    """Draw the link that the next copy stands on: the base, or one of the copy before, mostly a platform."""
    if rng.random() < 0.4:
        return parts[0].description.root
    names = [link.name for link in parts[-1].description.links]
    platforms = [name for name in names if "platform" in name]
    return str(rng.choice(platforms if platforms and rng.random() < 0.7 else names))


def somewhere(rng: np.random.Generator) -> np.ndarray:
    """Draw a placement: along the axes, turned about one of them by quarters, or anywhere."""
    t, way = rng.uniform(-1.0, 1.0, 3), rng.random()
    if way < 0.3:
        return placement(np.eye(3), t)
    if way < 0.6:
        return placement(np.round(turn(np.eye(3)[rng.integers(3)], np.pi / 2 * rng.integers(1, 4))), t)
    return placement(turn(unit(rng.normal(size=3)), rng.uniform(-3.0, 3.0)), t)


def mirrored_legs(seed: int) -> Description:
    """Draw a leg and its mirror images, perhaps a little out of the mirror, and a platform on their ends.

    The platform is mostly guided, so that rods and slides determine how it moves.
    """
    rng, s = np.random.default_rng([seed, 53]), rods.plain(seed)
    kind, foot = str(rng.choice(["rod", "rod", "slide", "chain"])), FEET[rng.integers(len(FEET))]
    P = np.array([0.3, 0.2, 0.7]) + rng.uniform(-0.08, 0.08, 3)
    end = leg(s, kind, foot, np.array([0.5, 0.4, 0.0]) + rng.uniform(-0.08, 0.08, 3), P)
    first = coordinate_axes(s.description("leg"), rng)
    legs, points = [Mounted(renamed(first, "a"), "", np.eye(4))], [P]
    for stem, S in zip("bcd"[: rng.integers(1, 4)], MIRRORS[1:], strict=False):
        off = rng.choice([0.0, 0.03])
        at = placement(turn(unit(rng.normal(size=3)), off), off * rng.normal(size=3))
        legs.append(Mounted(renamed(copy_of(first, rng, S), stem), "abase", at))
        points.append(at[:3, :3] @ S @ P + at[:3, 3])
    s = sketch_of(joined("legs", legs), rng)
    ends = [f"{stem}{end}" for stem, _ in zip("abcd", points, strict=False)]
    platform, closure = "", "spherical"
    if kind != "chain" and rng.random() < 0.7:
        platform = guided(s, len(legs), np.array([0.0, 0.0, 0.6]) + 0.05 * rng.normal(size=3))
    elif kind != "rod":
        closure = str(rng.choice(["spherical", "universal", "revolute"]))
    if not platform:
        platform = s.joint(
            "spherical" if closure == "spherical" else "revolute", ends.pop(0), points.pop(0), stem="platform"
        )
    for link, point in zip(ends, points, strict=True):
        s.close(closure, link, platform, point)
    return s.description(f"legs_{kind}_{foot}_{len(legs)}")


def guided(s: Sketch, freedoms: int, at: np.ndarray) -> str:
    """Draw a platform of two to four freedoms on the base: a cross, a ball, or a ball on a slide."""
    if freedoms == 2:
        cross = s.joint("revolute", "abase", at, np.array([0.0, 1.0, 0.0]), massless=True)
        return s.joint("revolute", cross, at, np.array([1.0, 0.0, 0.0]), stem="platform")
    post = "abase" if freedoms == 3 else s.joint("prismatic", "abase", at, np.array([0.0, 0.0, 1.0]))
    return s.joint("spherical", post, at, stem="platform")


def leg(s: Sketch, kind: str, foot: rods.Foot, B: np.ndarray, P: np.ndarray) -> str:
    """Draw an open leg from B to P (crank and rod, foot and driven slide, or a chain); give its end."""
    d = unit(P - B)
    if kind == "chain":
        link = "base"
        for i in range(int(s.rng.integers(2, 5))):
            joint = str(s.rng.choice(["revolute", "revolute", "prismatic", "continuous"]))
            link = s.joint(joint, link, B + 0.2 * i * d + s.jitter(), motor=i == 0)  # type: ignore[arg-type]
        return link
    if kind == "rod":
        E = B + 0.25 * s.direction()
        crank = s.joint("revolute", "base", B, motor=True, stem="crank")
        rod = rods.footed(s, crank, E, unit(P - E), foot, "rod")
        rods.rod_body(s, rod, E, unit(P - E), float(np.linalg.norm(P - E)), thin=bool(s.rng.random() < 0.3))
        return rod
    lower = rods.footed(s, "base", B, d, foot, "lower")
    rods.rod_body(s, lower, B, d, 0.4)
    upper = s.joint("prismatic", lower, B + 0.3 * d, d, motor=True, stem="slide")
    rods.rod_body(s, upper, B + 0.3 * d, d, 0.4)
    return upper


def sketch_of(description: Description, rng: np.random.Generator) -> Sketch:
    """Return a mechanism at its home posture, to which joints and closures can be added."""
    s = Sketch(rng)
    s.fixed_links = 0.0
    s.links, s.joints, s.closures = (
        [*x] for x in (description.links, description.joints, description.closures)
    )
    s.motors, s.home = [*description.motors], dict(description.home)
    frames = Oracle(description).posture(home_posture(description, "fixed")).links
    s.poses = {name: placement(frame.E, frame.x) for name, frame in frames.items()}
    return s
