"""Write an MJCF file: bodies, closures, couplings, forces, motors, home.

a point        one connect between sites         two joints     a joint equality
fixed          one weld between sites            more joints    an equality of a fixed tendon
revolute       two connects, at two points of the axis

MuJoCo counts positions in equalities from those at `qpos0`.
"""

from __future__ import annotations

import math
import os
from dataclasses import replace
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
from numpy.polynomial import Polynomial

from ..description.names import noted, unique
from ..description.placement import placement_from, turned
from ..description.records import Coupling, Curve, Description
from ..description.residuals import Residual
from ..description.shape_files import Shape
from ..description.side_cars.model_toml import model_file
from .as_text import add, numeral, put
from .mjcf_bodies import MjcfTree, pose
from .mjcf_forces import SEEN, STIFF, add_effects, add_forces, add_tendon, list_losses, with_effects
from .mujoco_parts import of_mujoco
from .parts import without_screws
from .request import USUAL_GRAVITY, ConversionRequest, Losses, Written, home_of
from .small_bodies import sizes_of

#: Acceleration at which closures stay as tight as asked, relative to gravity: a robot that falls freely.
FREE_FALL = 10.0
#: Impedance of equalities, the largest that MuJoCo takes.
HARDEST = 0.9999
#: Numbers of `polycoef`.
MOST_POWERS = 5
#: Longest time step [s]; slower motions than those of the closures need to be followed, too.
LONGEST_STEP = 1e-3

#: Endings of the meshes that MuJoCo reads.
MESHES = (".stl", ".obj", ".msh")
#: What is told of shapes that MuJoCo does not read.
UNREADABLE = (
    "visual shapes without extent, and meshes that are not found or none of .stl (binary), .obj, .msh"
)


def add_visuals(root: ET.Element, request: ConversionRequest, tree: MjcfTree, losses: Losses) -> None:
    """Add the shapes of a robot.

    Args:
        root: The root element, which receives `<asset>`.
        losses: Receives the shapes that MuJoCo cannot read.
    """
    asset = ET.Element("asset")
    for shape in request.shapes:
        body = tree.bodies.get(shape.link)
        if body is None:
            losses.add("visual shapes of massless links that have no body", shape.link)
        elif not _is_readable(shape):
            losses.add(UNREADABLE, shape.file or shape.link)
        else:
            first, *others = shape.size  # of a box all edges, else the radius and perhaps a length
            size = first / 2 if shape.kind == "box" else first, *(other / 2 for other in others)
            mesh = None
            if shape.path is not None:
                mesh = f"{shape.path.stem}_{len(asset)}"
                file = os.path.relpath(shape.path.resolve(), request.target.resolve().parent)
                add(asset, "mesh", name=mesh, file=file, inertia="shell", scale=shape.size)
            add(
                body, "geom", type=shape.kind, group="2", contype="0", conaffinity="0", mass="0", mesh=mesh,
                size=None if mesh else size, rgba=shape.colour, **pose(shape.placement),
            )  # fmt: skip
    root.extend([asset] if len(asset) else [])


def _is_readable(shape: Shape) -> bool:
    """Say whether MuJoCo reads a shape, as far as sizes, the ending and the head of an STL file tell."""
    if shape.kind != "mesh":
        return all(size > 0 for size in shape.size)
    if shape.path is None or shape.path.suffix.lower() != ".stl":
        return shape.path is not None and shape.path.suffix.lower() in MESHES
    with open(shape.path, "rb") as content:
        faces = int.from_bytes(content.read(84)[80:], "little")
    return faces > 0 and shape.path.stat().st_size == 84 + 50 * faces


def write_mjcf(request: ConversionRequest, losses: Losses) -> Written:
    """Write a robot as MJCF.

    Raises:
        ModelError: The robot is too deep for nested bodies.
    """
    d = without_screws(request.description, losses)
    root, notes = ET.Element("mujoco", model=d.name), list[str]()
    add(root, "compiler", angle="radian", autolimits="false", inertiafromgeom="false")
    option = add(root, "option", gravity=d.gravity or USUAL_GRAVITY, integrator="implicitfast")
    if d.closures or d.couplings:
        tight = _add_softness(root, option, d, request.tightness)
        notes.append(tight)
        root.insert(0, ET.Comment(f" {tight} "))
        if any(name in STIFF for name, _ in d.effects):
            notes.append(
                "this does not count springs and dampers: stiff ones open the closures further, or break up "
                "the simulation; then convert with a smaller tightness"
            )
    tree, couplings, effects = _add_robot(root, d, losses)
    add_visuals(root, request, tree, losses)
    if tree.qpos:
        add(add(root, "keyframe"), "key", name="home", qpos=tree.qpos)
    ET.indent(root)
    notes += noted({
        "MuJoCo does not see these effects, which the model.toml holds: {}":
            [name for name, _ in effects if name not in SEEN],
        "MuJoCo does not see these couplings, which the model.toml holds: {}":
            [coupling.name for coupling in couplings],
    })  # fmt: skip
    beside = [name for name, _ in effects]
    d = replace(d, effects=tuple(effects))
    model = model_file(d, motors=not d.motors, effects=beside, couplings=couplings)
    text = ET.tostring(root, encoding="unicode") + "\n"
    return Written(text, tuple(notes), {".model.toml": model} if model else {})


def _add_robot(
    root: ET.Element, d: Description, losses: Losses
) -> tuple[MjcfTree, list[Coupling], list[tuple[str, dict[str, Any]]]]:
    """Add bodies, closures, couplings, forces and motors.

    Returns:
        The bodies, and the couplings and effects that MJCF does not state.
    """
    sizes = sizes_of(d)
    parts = of_mujoco(with_effects(d), sizes, losses)
    tree = MjcfTree(parts, sizes, losses)
    root.append(tree.worldbody)
    list_losses(d, tree, losses)
    effects, left = add_effects(root, parts, tree), list[Coupling]()
    if d.closures or d.couplings:
        equality = add(root, "equality")
        taken = {closure.name for closure in parts.closures}
        _add_closures(equality, parts, tree, sizes.size, taken, losses)
        left = _add_couplings(root, equality, parts, taken)
    add_forces(root, parts, tree)
    for link in d.links:
        if link.name not in tree.bodies:
            losses.add("names of massless links that only carry a joint or end a closure", link.name)
    for joint in d.joints:
        if joint.kind == "fixed" and joint.child in tree.bodies and joint.name != f"{joint.child}_fixed":
            losses.add("names of fixed joints, which MuJoCo does not have", joint.name)
    return tree, left, effects


def _add_softness(root: ET.Element, option: ET.Element, d: Description, tightness: float) -> str:
    """Add the time step and how equalities act, so that closures stay as tight as the user asks.

    MuJoCo pulls a closure shut like a critically damped spring with time constant T. Where the links of a
    closure would part with acceleration c without it, it opens by about c T^2. Equalities are as hard as
    MuJoCo allows, so that the load on a closure adds little to this. The time step is T / 2, the longest that
    MuJoCo takes.

    Args:
        root: The root element, which receives `<default>`.
        option: The element `<option>`.
        d: The robot.
        tightness: Distance by which closures may open [m].

    Returns:
        These numbers in words.
    """
    gravity = math.hypot(*(d.gravity or USUAL_GRAVITY)) or math.hypot(*USUAL_GRAVITY)
    acceleration = FREE_FALL * gravity
    step = min(math.sqrt(tightness / acceleration) / 2, LONGEST_STEP)
    put(option, timestep=step)
    add(add(root, "default"), "equality", solref=(2 * step, 1), solimp=(HARDEST, HARDEST, 0.001, 0.5, 2))
    return (
        f"closures stay within {numeral(tightness)} m up to accelerations of {acceleration:.3g} m/s^2: "
        f"time step {step:.2g} s, solref {2 * step:.2g} s"
    )


def _add_closures(
    equality: ET.Element, d: Description, tree: MjcfTree, arm: float, taken: set[str], losses: Losses
) -> None:
    """Add sites and equalities.

    Args:
        equality: The element `<equality>`.
        d: The robot; its closures are points, axes and welds.
        tree: The bodies, which receive sites.
        arm: Distance of the two points that hold an axis [m].
        taken: Names of equalities.
        losses: Receives closures that MuJoCo has no word for.
    """
    for closure in d.closures:
        word = "weld" if closure.rotation == "fixed" else "connect"
        ends = (("a", closure.link_a, closure.frame_a), ("b", closure.link_b, closure.frame_b))
        stems = {closure.name: (f"{closure.name}:", turned(np.eye(4), closure.turn.T))}
        if closure.rotation == "parallel":
            ahead = placement_from(np.eye(3), np.array([0.0, 0.0, arm]))
            stems[unique(f"{closure.name}:axis", taken)] = (f"{closure.name}:axis_", ahead)
            losses.add("closures with an axis are connects of two points on it", closure.name)
        for name, (stem, there) in stems.items():
            for end, link, frame in ends:
                add(tree.bodies[link], "site", name=stem + end, **pose(frame @ there))
            add(equality, word, name=name, site1=f"{stem}a", site2=f"{stem}b")


def _add_couplings(root: ET.Element, equality: ET.Element, d: Description, taken: set[str]) -> list[Coupling]:
    """Add the couplings of a robot, and return those of an order that MuJoCo does not have.

    Args:
        root: The root element, which receives `<tendon>`.
        equality: The element `<equality>`.
        d: The robot.
        taken: Names of equalities.
    """
    at = {joint.name: home_of(d, joint)[0] for joint in d.joints if joint.kind != "fixed"}
    left = []
    for stated in d.couplings:
        name, coupling = unique(stated.name, taken), stated.moved(at)
        (first, factor), *others = coupling.terms
        if coupling.curve:
            if isinstance(coupling.curve, Residual) or not _add_curve(
                root, equality, name, coupling, coupling.curve
            ):
                left.append(stated)
        elif len(others) > 1:
            own = add_tendon(root, name, coupling.terms)
            add(
                equality, "tendon", name=name, tendon1=own.get("name"), polycoef=(coupling.offset, 0, 0, 0, 0)
            )
        else:
            second, coefficient = others[0] if others else (None, 0.0)
            line = (coupling.offset / factor, -coefficient / factor, 0, 0, 0)
            add(equality, "joint", name=name, joint1=first, joint2=second, polycoef=line)
    return left


def _add_curve(root: ET.Element, equality: ET.Element, name: str, coupling: Coupling, curve: Curve) -> bool:
    """Add a coupling with a curve, between two joints or two tendons; return whether MuJoCo has its order."""
    bent, factors = _powers(curve, coupling.offset), dict(coupling.terms)
    if len(bent) > MOST_POWERS:
        return False
    leaders = [joint for joint, _ in curve.terms]
    if len(leaders) == 1 and len({*factors} - {*leaders}) == 1:
        (follower,), (leader,) = {*factors} - {*leaders}, leaders
        ratio = [curve.terms[0][1] ** k for k in range(MOST_POWERS)]
        powers = [x * by / factors[follower] for x, by in zip(bent, ratio, strict=False)]
        powers[1] -= factors[leader] / factors[follower]
        add(equality, "joint", name=name, joint1=follower, joint2=leader, polycoef=tuple(powers))
        return True
    own = add_tendon(root, name, [term for term in coupling.terms if term[1]]).get("name")
    lead = add_tendon(root, f"{name}:leader", curve.terms).get("name")
    add(equality, "tendon", name=name, tendon1=own, tendon2=lead, polycoef=tuple(bent))
    return True


def _powers(curve: Curve, offset: float) -> list[float]:
    """Return offset - curve as numbers times powers of the sum of its terms, lowest first, at least five."""
    rest = Polynomial([-curve.reference, 1.0])
    whole = Polynomial([offset]) - Polynomial([0.0, 0.0, *curve.coefficients])(rest)
    out: list[float] = whole.trim().coef.tolist()
    return out + [0.0] * (MOST_POWERS - len(out))
