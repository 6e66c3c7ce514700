"""What a robot is, fact by fact, and which facts of a robot did not come back equal from a file."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from hybridyn.conversion.request import home_of
from hybridyn.description import Closure, Description
from hybridyn.description.placement import inverse, poses_at, turned

#: More than the numbers of any coupling of the tests.
POSTURES = 16
#: A pose passes through angles, quaternions and degrees once.
SAME = 1e-12
#: USD states numbers in single precision, some of them in degrees.
SINGLE = 1e-6
GRAVITY, AT_ORIGIN = (0.0, 0.0, -9.81), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
OF_JOINTS = (
    "kind", "parent", "child", "lower", "upper", "speed_limit", "effort_limit", "damping", "friction",
    "rotor_inertia", "gear_ratio", "placement",
)  # fmt: skip


def facts(d: Description, of: Description) -> dict[str, Any]:
    """Return what a robot is, by words; massless links and fixed joints only if another one has them, too."""
    out: dict[str, Any] = {
        "base": (d.base, d.base_home or AT_ORIGIN if d.base == "floating" else ()),
        "gravity": d.gravity or GRAVITY, "motors": d.motors, "name": d.name or "robot",
        "crossed": d.crossed, "added bodies": [load.name for load in d.loads],
        "springs": {spring.name: (spring.stiffness, spring.rest) for spring in d.springs},
        "effects": {name: numbers for name, numbers in d.effects if name != "spring"},
        "couplings": [terms for _, terms in _couplings(d)],
        "names of couplings": [name for name, _ in _couplings(d)],
        "closures": {c.name: _of_closure(c) for c in d.closures},
    }  # fmt: skip
    names = {one.name for one in (*of.links, *of.joints)}
    for link in d.links:
        if link.name in names or link.mass or link.inertia.any():
            out[f"link {link.name}"] = (link.mass, link.com, link.inertia)
    for joint in d.joints:
        if joint.name in names or joint.kind != "fixed":
            out |= {f"{word} of {joint.name}": getattr(joint, word) for word in OF_JOINTS}
            out[f"home of {joint.name}"] = () if joint.kind == "fixed" else home_of(d, joint)
            if joint.kind in ("revolute", "continuous", "prismatic"):
                out[f"axis of {joint.name}"] = joint.axis
    for word, posture in (("zero", {}), ("home", d.home)):
        poses = poses_at(d, posture)
        root = inverse(poses.get(of.root, np.eye(4)))
        out[f"poses at {word}"] = {name: root @ pose for name, pose in poses.items() if name in names}
    return out


def _couplings(d: Description) -> Iterator[tuple[str, dict[str, float]]]:
    """Yield the name of each coupling, its joints, and what it misses at postures, of which the most is 1."""
    for coupling in d.couplings:
        bent = coupling.curve.terms if coupling.curve else ()
        names = sorted({name for name, factor in (*coupling.terms, *bent) if factor})
        draw, still = np.random.default_rng(3), {name: 0.0 for name, _ in coupling.terms}
        missed = [
            coupling.open_by(still | dict(zip(names, x, strict=True)))
            for x in draw.uniform(-1, 1, size=(POSTURES, len(names)))
        ]
        most = max(missed, key=abs)
        yield coupling.name, {str(n): x / most for n, x in enumerate(missed)} | dict.fromkeys(names, 0.0)


def _of_closure(c: Closure) -> list[Any]:
    """Return the rows of a closure in its author's axes, and what they see of the frame on the other link."""
    locked = c.turn[:, c.translations] @ c.turn[:, c.translations].T
    axis = c.turn[:, 2] if c.rotation in ("parallel", "perpendicular") else ()
    other, place = turned(c.frame_b, c.turn.T)[:3, :3], c.frame_b[:3, 3]
    if c.rotation == "fixed":  # a shift along a free axis changes no row
        place = other @ locked @ other.T @ place
    seen = {"fixed": other, "free": (), "parallel": c.frame_b[:3, 2], "perpendicular": c.frame_b[:3, 2]}
    return [
        c.link_a,
        c.link_b,
        c.rotation,
        locked,
        axis,
        turned(c.frame_a, c.turn.T),
        seen[c.rotation],
        place,
    ]


def same(a: Any, b: Any, tolerance: float) -> bool:
    """Say whether two facts are equal, numbers to rounding."""
    if isinstance(a, dict):
        return (
            isinstance(b, dict) and a.keys() == b.keys() and all(same(a[key], b[key], tolerance) for key in a)
        )
    if isinstance(a, list | tuple):
        return (
            isinstance(b, list | tuple)
            and len(a) == len(b)
            and all(same(x, y, tolerance) for x, y in zip(a, b, strict=True))
        )
    if isinstance(a, str) or isinstance(b, str):
        return type(a) is type(b) and bool(a == b)
    x, y = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    if np.array_equal(x, y):  # most are, which is told in a tenth of the time
        return True
    return x.shape == y.shape and np.allclose(x, y, rtol=tolerance, atol=tolerance)


def changed(before: Description, after: Description, tolerance: float = SAME) -> list[str]:
    """Return the words of what did not come back equal."""
    ours, theirs = facts(before, before), facts(after, before)
    words = sorted(ours.keys() | theirs.keys())
    return [word for word in words if not same(ours.get(word, ""), theirs.get(word, ""), tolerance)]
