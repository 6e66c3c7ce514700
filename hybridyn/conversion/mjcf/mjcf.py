"""Write an MJCF file: bodies, closures, couplings, forces, motors, home."""

from __future__ import annotations

from collections import Counter
from xml.etree import ElementTree as ET

from ...description.poses import poses_at
from ...description.records import Description
from ...description.side_cars.model_text import model_file
from ...description.weightless import Bodies
from ..numerals import numeral, numerals
from ..request import USUAL_GRAVITY, Losses, Request, Written
from .bodies import Builder, Tree
from .checks import check_depth, check_names
from .closures import add_closures, needs_follower
from .couplings import add_couplings
from .followers import follower_of
from .forces import SAID, add_forces, add_motors
from .inertias import inertias_of
from .softness import acceleration, add_softness, softness
from .visuals import add_visuals


def write_mjcf(request: Request, losses: Losses) -> Written:
    """Write a robot as MJCF.

    Raises:
        ModelError: The robot is too deep for nested bodies, or names would occur twice.
    """
    d = request.description
    check_depth(d)
    root = ET.Element("mujoco", model=d.name)
    ET.SubElement(root, "compiler", angle="radian", autolimits="false", inertiafromgeom="false")
    option = ET.SubElement(root, "option", gravity=numerals(d.gravity or USUAL_GRAVITY))
    option.set("integrator", "implicitfast")
    chosen = softness(d, request.tightness)
    if d.closures or d.couplings:
        add_softness(root, option, chosen)
    tree = _add_robot(root, d, losses)
    add_visuals(root, request, tree, losses)
    add_motors(root, d)
    if tree.qpos:
        keyframe = ET.SubElement(root, "keyframe")
        ET.SubElement(keyframe, "key", name="home", qpos=numerals(tree.qpos))
    check_names(root)
    ET.indent(root)
    beside = [name for name, _ in d.effects if name not in SAID]
    notes = []
    if d.closures or d.couplings:
        tight = (
            f"closures stay within {numeral(request.tightness)} m up to accelerations of "
            f"{acceleration(d):.3g} m/s^2: time step {chosen.step:.2g} s, solref {chosen.constant:.2g} s"
        )
        notes.append(tight)
        root.insert(0, ET.Comment(f" {tight} "))
        if any(name in SAID for name, _ in d.effects):
            notes.append(
                "this does not count springs and dampers: stiff ones open the closures further, or break up "
                "the simulation; then convert with a smaller tightness"
            )
    if beside:
        notes.append(f"MuJoCo does not see these effects, which the model.toml holds: {', '.join(beside)}")
    model = model_file(d, motors=not d.motors, effects=beside)
    text = ET.tostring(root, encoding="unicode") + "\n"
    return Written(text, tuple(notes), {".model.toml": model} if model else {})


def _add_robot(root: ET.Element, d: Description, losses: Losses) -> Tree:
    """Add bodies, closures, couplings and forces."""
    inertias, poses, still = inertias_of(d), poses_at(d, d.home), _still(d)
    ends = _weightless_ends(d, still)
    followers = {
        closure.name: follower_of(closure, inertias, poses, still, losses)
        for closure in d.closures
        if needs_follower(closure) or closure.link_a in ends or closure.link_b in ends
    }
    tree = Builder(d, inertias, followers.values(), ends, losses).build()
    root.append(tree.worldbody)
    add_forces(d, tree, losses)
    if d.closures or d.couplings:
        equality = ET.SubElement(root, "equality")
        add_closures(equality, d.closures, followers, tree, inertias.size, losses)
        add_couplings(root, equality, d.couplings, tree.refs)
    _add_lost_names(d, {*tree.bodies}, losses)
    return tree


def _add_lost_names(d: Description, kept: set[str], losses: Losses) -> None:
    """List the fixed joints and the links whose names the file does not hold; `kept` are those of links."""
    for link in d.links:
        if link.name not in kept:
            losses.add("names of massless links that only carry a joint or end a closure", link.name)
    for joint in d.joints:
        if joint.kind == "fixed" and joint.child in kept and joint.name != f"{joint.child}_fixed":
            losses.add("names of fixed joints, which MuJoCo does not have", joint.name)


def _weightless_ends(d: Description, still: set[str]) -> dict[str, str]:
    """Return the moving links that have no inertia and only end a closure, each with that closure.

    MuJoCo refuses bodies without mass: the follower of the closure takes their place.
    """
    carrying = {joint.parent for joint in d.joints}
    ends = {
        link.name
        for link in d.links
        if not link.mass and not link.inertia.any() and link.name not in carrying | still
    }
    counted = Counter(end for closure in d.closures for end in (closure.link_a, closure.link_b))
    return {
        end: closure.name
        for closure in d.closures
        for end, other in ((closure.link_a, closure.link_b), (closure.link_b, closure.link_a))
        if end in ends and counted[end] == 1 and other not in ends
    }


def _still(d: Description) -> set[str]:
    """Return the names of the links that do not move."""
    return {link for link, body in Bodies(d).of.items() if body == d.root and d.base == "fixed"}
