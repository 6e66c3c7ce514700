"""Modules of a stack for the reference in extended precision: read from records, and how their legs move."""

from dataclasses import dataclass

import numpy as np

from hybridyn.description import Description
from hybridyn.description.records import Joint, Link
from tests.hard.extended import Arithmetic, Numbers, hat, mul, turned


@dataclass(frozen=True)
class Chain:
    """Legs of one shape, side by side: arrays over legs first, then over a leg's joints."""

    names: list[list[str]]
    slides: list[bool]
    R: Numbers
    t: Numbers
    axis: Numbers
    mass: Numbers
    com: Numbers
    inertia: Numbers


@dataclass(frozen=True)
class Kind:
    """A module of a stack: names are those of the first, "m1_".

    Attributes:
        legs: The legs, up to the body that holds the platform.
        wrist: The joints that carry the platform on the first leg (massless).
        mount: The platform's axes and origin in the last wrist body.
        tips: Where each leg holds the platform, in its last body.
        points: The same on the platform.
        mass, com, inertia: The platform's.
        plane: Components of a relative acceleration of the platform that are free, of (x, y, z, rx, ry, rz).
        motor: The number of the driven joint of every leg.
    """

    legs: Chain
    wrist: Chain
    mount: tuple[Numbers, Numbers]
    tips: Numbers
    points: Numbers
    mass: Numbers
    com: Numbers
    inertia: Numbers
    plane: list[int]
    motor: int


def read_kind(one: Description, on: Arithmetic, planar: bool = False) -> Kind:
    """Read a robot of one module: base "m1_base", platform "m1_platform", leg 1 carries it, others close."""
    above = {joint.child: joint for joint in one.joints}
    links = {link.name: link for link in one.links}

    def path(link: str) -> list[Joint]:
        return [] if link == "m1_base" else [*path(above[link].parent), above[link]]

    *carrier, mount = path("m1_platform")
    assert mount.kind == "fixed"
    length = len(path(one.closures[0].link_b))
    chains = [carrier[:length], *(path(c.link_b) for c in one.closures)]
    assert all(c.link_a == "m1_platform" for c in one.closures)
    wrist = carrier[length:]
    assert not any(links[j.child].mass for j in wrist)
    R, t = _placed(on, mount)
    platform = links["m1_platform"]
    # The wrist's axes meet in the origin of its first joint; the mount's origin is seen from there.
    first = on.array([-mul(turned(R), t)])
    others = on.array([c.frame_a[:3, 3] for c in one.closures])
    tips = on.array([wrist[0].placement[:3, 3], *(c.frame_b[:3, 3] for c in one.closures)])
    motors = [[j.name for j in chain].index(m) for chain, m in zip(chains, one.motors, strict=True)]
    assert len(set(motors)) == 1
    return Kind(
        _chain(on, chains, links), _chain(on, [wrist], links), (R, t), tips, np.concatenate([first, others]),
        on.array(platform.mass), on.array(platform.com), on.array(platform.inertia),
        [0, 1, 5] if planar else list(range(6)), motors[0],
    )  # fmt: skip


def _chain(on: Arithmetic, chains: list[list[Joint]], links: dict[str, Link]) -> Chain:
    placed = [[_placed(on, joint) for joint in chain] for chain in chains]
    bodies = [[links[joint.child] for joint in chain] for chain in chains]
    axis = on.array([[joint.axis for joint in chain] for chain in chains])
    axis = axis / np.sqrt((axis * axis).sum(axis=-1))[..., None]
    return Chain(
        [[joint.name for joint in chain] for chain in chains],
        [joint.kind == "prismatic" for joint in chains[0]],
        np.array([[R for R, _ in chain] for chain in placed]),
        np.array([[t for _, t in chain] for chain in placed]),
        axis,
        on.array([[body.mass for body in chain] for chain in bodies]),
        on.array([[body.com for body in chain] for chain in bodies]),
        on.array([[body.inertia for body in chain] for chain in bodies]),
    )


def _placed(on: Arithmetic, joint: Joint) -> tuple[Numbers, Numbers]:
    """Return a placement's axes, made orthonormal to the last digit, and origin."""
    M = on.array(joint.placement)
    R = M[:3, :3]
    for _ in range(3):
        R = (R @ (3 * np.eye(3, dtype=int) - (turned(R) @ R))) / 2
    return R, M[:3, 3]


# -------------------------------------------------------------------- how legs move


@dataclass(frozen=True)
class Moved:
    """Bodies of chains in their base's axes, arrays (modules, legs, joints, ...)."""

    R: list[Numbers]
    p: list[Numbers]
    z: list[Numbers]
    w: list[Numbers]
    wd: list[Numbers]
    pd: list[Numbers]
    pdd: list[Numbers]


def move(
    on: Arithmetic, chain: Chain, base: tuple[Numbers, ...], q: Numbers, v: Numbers, a: Numbers
) -> Moved:
    """Sweep chains from the motion of their base, (R, p, w, wd, pd, pdd), each (modules, legs, ...)."""
    R, p, w, wd, pd, pdd = base
    out = Moved([], [], [], [], [], [], [])
    for j, slides in enumerate(chain.slides):
        arm = mul(R, chain.t[:, j])
        p, pd = p + arm, pd + np.cross(w, arm)
        pdd = pdd + np.cross(wd, arm) + np.cross(w, np.cross(w, arm))
        R = R @ chain.R[:, j]
        z = mul(R, chain.axis[:, j])
        x, x_dot, x_ddot = (u[..., j, None] for u in (q, v, a))
        if slides:
            arm, along = z * x, z * x_dot
            p, pd = p + arm, pd + np.cross(w, arm) + along
            pdd = (
                pdd + np.cross(wd, arm) + np.cross(w, np.cross(w, arm)) + 2 * np.cross(w, along) + z * x_ddot
            )
        else:
            wd = wd + np.cross(w, z * x_dot) + z * x_ddot
            w = w + z * x_dot
            R = R @ rotation(on, np.broadcast_to(chain.axis[:, j], p.shape), x)
        for kept, now in zip(
            (out.R, out.p, out.z, out.w, out.wd, out.pd, out.pdd), (R, p, z, w, wd, pd, pdd), strict=True
        ):
            kept.append(now)
    return out


def rotation(on: Arithmetic, axis: Numbers, angle: Numbers) -> Numbers:
    """Return the rotations about axes (..., 3) by angles (..., 1)."""
    s, c = on.sin(angle)[..., None], on.cos(angle)[..., None]
    K = hat(axis)
    return np.eye(3, dtype=int) + s * K + (1 - c) * (K @ K)


def at_rest(on: Arithmetic, shape: tuple[int, ...]) -> tuple[Numbers, ...]:
    """Return the motion of a base that is the frame of reference."""
    zero = on.array(np.zeros((*shape, 3)))
    return (on.array(np.broadcast_to(np.eye(3), (*shape, 3, 3))), zero, zero, zero, zero, zero)


def jacobian(chain: Chain, moved: Moved, body: int, point: Numbers) -> Numbers:
    """Give the velocity of a point of a body and its angular velocity over joint rates, (..., 6, joints)."""
    columns = []
    for j, slides in enumerate(chain.slides):
        z = moved.z[j] * (1 if j <= body else 0)
        linear = z if slides else np.cross(z, point - moved.p[j])
        columns.append(np.concatenate([linear, z * (0 if slides else 1)], axis=-1))
    return np.stack(columns, axis=-1)
