"""Write an MJCF file: bodies, closures, couplings, forces, motors, home.

a point        one connect between sites         two joints     a joint equality
fixed          one weld between sites            more joints    an equality of a fixed tendon
revolute       two connects, at two points of the axis

MuJoCo counts positions in equalities from those at `qpos0`.
"""

from __future__ import annotations

import math
from collections import Counter
from xml.etree import ElementTree as ET

import numpy as np

from ...description.names import listed, unique
from ...description.placement import outwards, placement_from, turned
from ...description.records import Description
from ...description.side_cars.model_toml import model_file
from ...errors import ModelError
from ..home import home_of
from ..numerals import add, numeral, put
from ..request import USUAL_GRAVITY, Losses, Request, Written
from .bodies import SAID, Tree, add_forces, add_visuals, list_losses, pose, sizes_of, with_effects
from .parts import Parts

#: Most bodies one inside the other; XML readers stop at 256 elements.
DEEPEST = 240
#: Element that holds elements, and those of them that share their names.
GROUPS = (
    ("worldbody", ("body",)), ("worldbody", ("joint", "freejoint")), ("worldbody", ("site",)),
    ("equality", ("connect", "weld", "joint", "tendon")), ("tendon", ("fixed",)),
)  # fmt: skip
#: Acceleration at which closures stay as tight as asked, relative to gravity: a robot that falls freely.
FREE_FALL = 10.0
#: Gravity where the robot has none [m/s^2].
EARTH = 9.81
#: Impedance of equalities, the largest that MuJoCo takes.
HARDEST = 0.9999
#: Longest time step [s]; slower motions than those of the closures need to be followed, too.
LONGEST_STEP = 1e-3
#: Part of a unit by which a step of two digits may miss it.
TWO_DIGITS = 1e-9


def write_mjcf(request: Request, losses: Losses) -> Written:
    """Write a robot as MJCF.

    Raises:
        ModelError: The robot is too deep for nested bodies, or names would occur twice.
    """
    d = request.description
    _check_depth(d)
    root, notes = ET.Element("mujoco", model=d.name), list[str]()
    add(root, "compiler", angle="radian", autolimits="false", inertiafromgeom="false")
    option = add(root, "option", gravity=d.gravity or USUAL_GRAVITY, integrator="implicitfast")
    if d.closures or d.couplings:
        tight = _add_softness(root, option, d, request.tightness)
        notes.append(tight)
        root.insert(0, ET.Comment(f" {tight} "))
        if any(name in SAID for name, _ in d.effects):
            notes.append(
                "this does not count springs and dampers: stiff ones open the closures further, or break up "
                "the simulation; then convert with a smaller tightness"
            )
    tree = _add_robot(root, d, losses)
    add_visuals(root, request, tree, losses)
    if tree.qpos:
        add(add(root, "keyframe"), "key", name="home", qpos=tree.qpos)
    _check_names(root)
    ET.indent(root)
    beside = [name for name, _ in d.effects if name not in SAID]
    if beside:
        notes.append(f"MuJoCo does not see these effects, which the model.toml holds: {', '.join(beside)}")
    model = model_file(d, motors=not d.motors, effects=beside)
    text = ET.tostring(root, encoding="unicode") + "\n"
    return Written(text, tuple(notes), {".model.toml": model} if model else {})


def _add_robot(root: ET.Element, d: Description, losses: Losses) -> Tree:
    """Add bodies, closures, couplings, forces and motors."""
    sizes = sizes_of(d)
    parts = Parts(with_effects(d), sizes, losses).described()
    tree = Tree(parts, sizes, losses)
    root.append(tree.worldbody)
    list_losses(d, tree, losses)
    if d.closures or d.couplings:
        equality = add(root, "equality")
        _add_closures(equality, parts, tree, sizes.size, losses)
        _add_couplings(root, equality, parts)
    add_forces(root, parts, tree)
    for link in d.links:
        if link.name not in tree.bodies:
            losses.add("names of massless links that only carry a joint or end a closure", link.name)
    for joint in d.joints:
        if joint.kind == "fixed" and joint.child in tree.bodies and joint.name != f"{joint.child}_fixed":
            losses.add("names of fixed joints, which MuJoCo does not have", joint.name)
    return tree


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
    acceleration = FREE_FALL * (math.hypot(*d.gravity) if d.gravity and any(d.gravity) else EARTH)
    step = min(math.sqrt(tightness / acceleration) / 2, LONGEST_STEP)
    unit = 10.0 ** (math.floor(math.log10(step)) - 1)
    step = float(f"{math.floor(step / unit * (1 + TWO_DIGITS)) * unit:.1e}")  # two digits, rounded down
    put(option, timestep=step)
    add(add(root, "default"), "equality", solref=(2 * step, 1), solimp=(HARDEST, HARDEST, 0.001, 0.5, 2))
    return (
        f"closures stay within {numeral(tightness)} m up to accelerations of {acceleration:.3g} m/s^2: "
        f"time step {step:.2g} s, solref {2 * step:.2g} s"
    )


def _add_closures(equality: ET.Element, d: Description, tree: Tree, arm: float, losses: Losses) -> None:
    """Add sites and equalities.

    Args:
        equality: The element `<equality>`.
        d: The robot; its closures are points, axes and welds.
        tree: The bodies, which receive sites.
        arm: Distance of the two points that hold an axis [m].
        losses: Receives closures that MuJoCo has no word for.
    """
    for closure in d.closures:
        word = "weld" if closure.rotation == "fixed" else "connect"
        ends = (("a", closure.link_a, closure.frame_a), ("b", closure.link_b, closure.frame_b))
        stems = {closure.name: (f"{closure.name}:", turned(np.eye(4), closure.turn.T))}
        if closure.rotation == "parallel":
            ahead = placement_from(np.eye(3), np.array([0.0, 0.0, arm]))
            stems[f"{closure.name}:axis"] = (f"{closure.name}:axis_", ahead)
            losses.add("closures with an axis are connects of two points on it", closure.name)
        for name, (stem, there) in stems.items():
            for end, link, frame in ends:
                add(tree.bodies[link], "site", name=stem + end, **pose(frame @ there))
            add(equality, word, name=name, site1=f"{stem}a", site2=f"{stem}b")


def _add_couplings(root: ET.Element, equality: ET.Element, d: Description) -> None:
    """Add the couplings of a robot.

    Args:
        root: The root element, which receives `<tendon>`.
        equality: The element `<equality>`; its names stay unique.
        d: The robot.
    """
    at, taken = {joint.name: home_of(d, joint)[0] for joint in d.joints if joint.kind != "fixed"}, set[str]()
    for closure in d.closures:
        taken |= {closure.name, f"{closure.name}:axis"}
    for coupling in d.couplings:
        name = unique(coupling.name, taken)
        offset = coupling.offset - sum(coefficient * at[joint] for joint, coefficient in coupling.terms)
        (first, factor), *others = coupling.terms
        if len(others) > 1:
            tendon = root.find("tendon")
            fixed = add(add(root, "tendon") if tendon is None else tendon, "fixed", name=name)
            for joint, coefficient in coupling.terms:
                add(fixed, "joint", joint=joint, coef=coefficient)
            add(equality, "tendon", name=name, tendon1=name, polycoef=(offset, 0, 0, 0, 0))
            continue
        second, coefficient = others[0] if others else (None, 0.0)
        polynomial = (offset / factor, -coefficient / factor, 0, 0, 0)
        add(equality, "joint", name=name, joint1=first, joint2=second, polycoef=polynomial)


def _check_depth(d: Description) -> None:
    """Refuse robots that are too deep to be written as nested bodies."""
    depth = {d.root: 1}
    for joint in outwards(d.joints, [d.root]):
        depth[joint.child] = depth[joint.parent] + 1
        if depth[joint.child] > DEEPEST:
            raise ModelError(
                f"more than {DEEPEST} joints one behind the other, up to link '{joint.child}'; bodies of "
                "MJCF stand inside one another, and XML readers go no deeper",
                element=joint.child,
            )


def _check_names(root: ET.Element) -> None:
    """Refuse names that would be mixed up."""
    for place, tags in GROUPS:
        found = [str(x.get("name")) for one in root.iterfind(place) for x in one.iter() if x.tag in tags]
        if twice := [name for name, count in Counter(found).items() if count > 1]:
            raise ModelError(
                f"in MJCF, <{tags[0]}> would have these names twice: {listed(twice)}; rename them in the "
                "robot's file",
                element=twice[0],
            )
