"""Machines whose rods end in two balls each, so that every rod spins idly; and the same with other feet.

A rod is a body without products of inertia about its line, as most people write it.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Literal

import numpy as np
import pinocchio as pin

import hybridyn
from hybridyn.compiled.equations.idle.motion import idle_motions
from hybridyn.description.records import Description, Link
from hybridyn.dynamics.forward import forward
from hybridyn.spatial import Array
from tests.robots.sketch import Place, Sketch, turn, unit

#: "floating": a body of six freedoms, held by a ball at each end. "revolutes": three that cross, as a ball.
Foot = Literal["ball", "universal", "revolutes", "floating", "floating aside"]


def plain(seed: int) -> Sketch:
    """Begin a mechanism without links that are fixed to others: these would put mass beside a rod's line."""
    s = Sketch(np.random.default_rng([seed, 28]))
    s.fixed_links = 0.0
    return s


def rod_body(
    s: Sketch, link: str, start: np.ndarray, along: np.ndarray, length: float, *, thin: bool = False
) -> None:
    """Make a link a round bar from a world point along a world vector; `thin`: without inertia about it."""
    at = next(i for i, entry in enumerate(s.links) if entry.name == link)
    back = s.poses[link][:3, :3].T
    d = back @ unit(along)
    mass, about = 0.3, np.outer(d, d)
    inertia = mass * (length**2 / 12 * (np.eye(3) - about) + (0.0 if thin else 0.01**2 / 2) * about)
    middle = back @ (start - s.poses[link][:3, 3]) + length / 2 * d
    s.links[at] = Link(link, mass, middle, (inertia + inertia.T) / 2)


def footed(s: Sketch, base: str, at: np.ndarray, d: np.ndarray, foot: Foot, stem: str) -> str:
    """Draw a link along d on a ball, on revolutes that cross, or free and on a closure; give it."""
    if foot == "ball":
        return s.joint("spherical", base, at, stem=stem)
    if "floating" in foot:  # the frame's origin is at the ball, or beside the rod's line
        link = s.joint("floating", base, at + ("aside" in foot) * np.array([0.1, -0.2, 0.05]), stem=stem)
        s.close("spherical", base, link, at)
        return link
    x = s.perpendicular(d)
    cross = s.joint("revolute", base, at, x, massless=True, stem="cross")
    if foot == "universal":
        return s.joint("revolute", cross, at, np.cross(d, x), stem=stem)
    cross = s.joint("revolute", cross, at, np.cross(d, x), massless=True, stem="cross")
    return s.joint("revolute", cross, at, d, stem=stem)


def rod(
    s: Sketch, arm: str, E: np.ndarray, platform: str | None, P: np.ndarray, foot: Foot, *, thin: bool = False
) -> str:
    """Draw a rod from E on an arm to P on the platform, which the rod carries if there is none; give it."""
    d = unit(P - E)
    link = footed(s, arm, E, d, foot, "rod")
    rod_body(s, link, E, d, float(np.linalg.norm(P - E)), thin=thin)
    if platform is None:
        return s.joint("spherical", link, P, stem="platform")
    s.close("spherical", link, platform, P)
    return platform


def ball_delta(seed: int = 0, foot: Foot = "ball", *, thin: bool = False) -> Description:
    """Draw a Delta with two rods on each of its three arms."""
    s = plain(seed)
    delta_on(s, "base", s.place(), foot, thin=thin)
    return s.description(f"{foot}_delta")


def delta_on(s: Sketch, base: str, p: Place, foot: Foot = "ball", *, thin: bool = False) -> str:
    """Draw a Delta on a link; give its platform."""
    platform, center = None, p(0.0, 0.0, 0.9)
    for i in range(3):
        angle = 2 * np.pi * i / 3 + s.jitter(0.02)
        r, t = p.axes @ [np.cos(angle), np.sin(angle), 0], p.axes @ [-np.sin(angle), np.cos(angle), 0]
        upper = s.joint("revolute", base, p.origin + 0.35 * r, t, motor=True, stem="arm")
        E, F = p.origin + 0.7 * r + 0.3 * p.normal, center + 0.15 * r
        for side in (-0.1, 0.1):
            platform = rod(s, upper, E + side * t, platform, F + side * t, foot, thin=thin)
    return platform


def six_legs(s: Sketch, p: Place) -> Iterator[tuple[Array, Array]]:
    """Yield the ends of six legs in pairs, on the base and on the platform."""
    for i in range(6):
        middle, side = 2 * np.pi * (i // 2) / 3, (-1) ** i
        low, high = middle + 0.35 * side, middle + side * (np.pi / 3 - 0.2)
        B = p(0.6 * np.cos(low), 0.6 * np.sin(low), s.jitter())
        yield B, p(0.3 * np.cos(high), 0.3 * np.sin(high), 0.8 + s.jitter())


def slides(seed: int = 0, foot: Foot = "ball", *, thin: bool = False, spare: bool = False) -> Description:
    """Draw a platform on six rods, each on a driven slide; `spare` adds a seventh."""
    s = plain(seed)
    p, platform = s.place(), None
    seventh = [(p(0.0, 0.05, 0.02), p(0.05, -0.1, 0.78))] * spare
    for B, P in [*six_legs(s, p), *seventh]:
        slide = s.joint("prismatic", "base", B, p.normal, motor=True, stem="slide")
        platform = rod(s, slide, B, platform, P, foot, thin=thin)
    return s.description(f"{foot}_slides")


def ball_gough(
    seed: int = 0, foot: Foot = "ball", *, thin: bool = False, second: Foot | None = None
) -> Description:
    """Draw a Gough-Stewart platform: a foot, a driven slide and a ball in each leg; `second` in that leg."""
    s = plain(seed)
    p, platform = s.place(), None
    feet = [foot, second or foot, *[foot] * 4]
    for (B, P), foot in zip(six_legs(s, p), feet, strict=True):
        d = unit(P - B)
        lower = footed(s, "base", B, d, foot, "lower")
        rod_body(s, lower, B, d, 0.4, thin=thin)
        upper = s.joint("prismatic", lower, B + 0.3 * d, d, motor=True, stem="slide")
        rod_body(s, upper, B + 0.3 * d, d, 0.4, thin=thin)
        if platform is None:
            platform = s.joint("spherical", upper, P, stem="platform")
        else:
            s.close("spherical", upper, platform, P)
    return s.description(f"{foot}_gough")


def crank(seed: int = 0, foot: Foot = "ball", *, thin: bool = False, beside: float = 0.0) -> Description:
    """Draw a driven crank whose rod pushes a slide; `beside` puts the rod's mass beside its line [m]."""
    s = plain(seed)
    p = s.place()
    E, P = p(0.15, 0.0, 0.0), p(0.1, 0.1, 0.5)
    upper = s.joint("revolute", "base", p(0.0, 0.0, 0.0), p.axes @ [0.0, 0.2, 1.0], motor=True, stem="crank")
    slide = s.joint("prismatic", "base", P, p.normal, stem="slide")
    rod(s, upper, E, slide, P, foot, thin=thin)
    if beside:
        at = next(i for i, link in enumerate(s.links) if "rod" in link.name)
        off = beside * s.perpendicular(s.links[at].com)
        s.links[at] = replace(s.links[at], com=s.links[at].com + off)
    return s.description(f"{foot}_crank")


def two_legs(seed: int, *, free: bool = False) -> Description:
    """Draw a carriage on two legs: a universal joint, a driven slide, a ball; and a ball, a slide, a ball.

    A free one is a floating body on a closure.
    """
    s = plain(seed)
    p = s.place()
    at, along = p(0.0, 0.0, 0.8), unit(p.axes @ [0.2, 0.9, 0.3])
    carriage = s.joint("floating" if free else "prismatic", "base", at, along, stem="carriage")
    if free:
        s.close("prismatic", "base", carriage, at, along)
    ends = (
        (p(0.4, 0.1, 0.0), p(0.1, 0.05, 0.7), "universal"),
        (p(-0.4, -0.2, 0.05), p(-0.1, 0.0, 0.75), "ball"),
    )
    for k, (B, P, own) in enumerate(ends):
        d = unit(P - B)
        lower = footed(s, "base", B, d, own, "lower")
        rod_body(s, lower, B, d, 0.4)
        upper = s.joint("prismatic", lower, B + 0.3 * d, d, motor=k == 0, stem="slide")
        rod_body(s, upper, B + 0.3 * d, d, 0.4)
        s.close("spherical", upper, carriage, P)
    return s.description("two_legs")


def mirrored_cranks() -> str:
    """Return URDF of two cranks, mirrored, whose rods push slides; all bodies in the axes of the base."""

    def link(name: str) -> str:
        return (
            f'<link name="{name}"><inertial><mass value="0.4"/>'
            '<inertia ixx="2e-3" iyy="2e-3" izz="2e-3" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        )

    def joint(kind: str, name: str, parent: str, at: str, axis: str = "1 0 0") -> str:
        return (
            f'<joint name="{name}" type="{kind}"><origin xyz="{at}"/><parent link="{parent}"/>'
            f'<child link="{name}"/><axis xyz="{axis}"/>'
            '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
        )

    def side(s: str, y: float) -> str:
        joints = (
            joint("revolute", f"crank_{s}", "base", f"0 {5 * y} 0", "0 1 0"),
            joint("spherical", f"rod_{s}", f"crank_{s}", "0.15 0 0"),
            joint("prismatic", f"slide_{s}", "base", f"0.55 {6 * y} -0.1"),
        )
        loop = (
            f'<loop name="end_{s}" type="spherical"><predecessor link="rod_{s}"><origin xyz="0.4 {y} -0.1"/>'
            f'</predecessor><successor link="slide_{s}"/></loop>'
        )
        return "".join(link(f"{part}_{s}") for part in ("crank", "rod", "slide")) + "".join(joints) + loop

    return f'<robot name="pair">{link("base")}{side("l", 0.1)}{side("r", -0.1)}</robot>'


def moved(robot: hybridyn.HybridRobot, samples: int, size: float) -> tuple[Array, Array, Array]:
    """Assemble a motion in which each motor swings by a part of a radian, or of its module's length.

    The rods of the motion spin, and their spins accelerate, which no motor can do.
    """
    rng = np.random.default_rng(samples)
    q, v, a = hybridyn.assemble(robot, motors=swings(robot, samples, size))
    tau = hybridyn.idm(robot, q, v, a)
    spin(robot, q, v, None, rng)
    a = hybridyn.ddm(robot, q, v, tau)
    spin(robot, q, v, a, rng)
    return q, v, a


def with_balls(description: Description) -> Description:
    """Write the universal joints at the feet of massive rods as balls, so that the rods spin idly."""
    links = {link.name: link for link in description.links}
    kept = dict(links)
    joints, home = {joint.name: joint for joint in description.joints}, dict(description.home)
    for first in description.joints:
        for second in description.joints:
            pair, cross = (first, second), links[first.child]
            crossed = (
                second.parent == first.child
                and np.abs(second.placement[:3, 3]).max() < 1e-15
                and not cross.mass
            )
            turning = {joint.kind for joint in pair} <= {"revolute", "continuous"}
            driven = {joint.name for joint in pair} & {*description.motors}
            if not (crossed and turning and links[second.child].mass) or driven:
                continue
            angles = [home.pop(joint.name, (0.0,))[0] for joint in pair]
            R = turn(first.axis, angles[0]) @ second.placement[:3, :3] @ turn(second.axis, angles[1])
            del joints[second.name]
            joints[first.name] = replace(
                first, kind="spherical", child=second.child, axis=np.array([1.0, 0.0, 0.0])
            )
            home[first.name] = tuple(pin.Quaternion(R).coeffs().tolist())
            del kept[cross.name]
    return replace(description, joints=tuple(joints.values()), links=tuple(kept.values()), home=home)


def stack(seed: int = 0) -> Description:
    """Draw a Delta on the platform of another: twelve rods in two modules of different numbers."""
    s = plain(seed)
    place = s.place()
    delta_on(s, delta_on(s, "base", place), Place(place(0.0, 0.0, 1.0), place.axes))
    return s.description("stack")


def swings(robot: hybridyn.HybridRobot, samples: int, size: float) -> dict[str, tuple[Array, Array, Array]]:
    """Return positions, rates and accelerations of motors that swing by a part of their unit."""
    rng, t, motors = np.random.default_rng(samples), np.linspace(0.0, 6.0, samples), {}
    for name in robot.motors:
        start, phase = robot.home[robot.q_slices[robot.joint_index[name]]][0], rng.uniform(0.0, 6.0)
        unit = size * robot.unit[robot.v_slices[robot.joint_index[name]].start]
        swing = np.sin(t + phase) - np.sin(phase), np.cos(t + phase), -np.sin(t + phase)
        motors[name] = (start + unit * swing[0], unit * swing[1], unit * swing[2])
    return motors


def spin(robot: hybridyn.HybridRobot, q: Array, v: Array, a: Array | None, rng: np.random.Generator) -> None:
    """Set the spins in the rates, or in the accelerations if these are given, in place."""
    changed = v if a is None else a
    for state in forward(robot, q, v, changed):
        m, at = state.mechanism, state.module.v_index
        tree = state.v if a is None else state.a
        for one in idle_motions(m, state.module.motor_columns):
            cols, axis, share = list(one.cols), one.axis.astype(float), one.share.astype(float)
            tree[:, cols] += (rng.normal(size=len(q)) - tree[:, cols] @ share)[:, None] * axis
        if a is None:
            still = np.zeros_like(tree)
            changed[:, at] = m.spanning_rates(q[:, state.module.q_index], state.q, tree, still)[0]
        else:
            changed[:, at] = state.spanning_accelerations(v, tree)


def cylinder(seed: int = 0) -> Description:
    """Draw a driven crank whose rod pushes a round bar that slides and turns in a bushing: both spin idly."""
    s = plain(seed)
    p = s.place()
    E, P = p(0.15, 0.0, 0.0), p(0.1, 0.1, 0.5)
    upper = s.joint("revolute", "base", p(0.0, 0.0, 0.0), p.axes @ [0.0, 0.2, 1.0], motor=True, stem="crank")
    bar = s.joint("floating", "base", P, stem="bar")
    rod_body(s, bar, P, p.normal, 0.4)
    s.close("cylindrical", "base", bar, P, p.normal)
    rod(s, upper, E, bar, P, "ball")
    return s.description("cylinder_crank")
