"""Write the forces of an MJCF file: limits, friction, springs and rotors of joints, motors, and effects.

Damping of several numbers and springs that are no straight lines stand in the model file: older versions of
MuJoCo do not read them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from ..description.loop_signs import WeldedBodies
from ..description.names import unique
from ..description.records import Description
from ..effects.joints import WIDTH
from ..effects.lengths import WORDS
from ..joints.kinds import JointKind
from .as_text import add, put
from .mjcf_bodies import WORLD, MjcfTree
from .renamed import effects_on
from .request import FORCES, Losses, add_of_several

#: Effects whose forces MuJoCo computes, even where the model file has to hold numbers of them.
SEEN = ("tendons", "line_springs")
#: Effects that a joint states.
OF_JOINTS = ("spring", "damper")
#: Effects that the tightness of closures does not count.
STIFF = (*OF_JOINTS, *SEEN, "ball_spring")
#: Length of a spring that MuJoCo takes for none stated, and the number next to it.
UNSTATED, NEXT_TO_UNSTATED = -1.0, float(np.nextafter(-1.0, 0.0))


def with_effects(d: Description) -> Description:
    """Return a robot whose joints have the damping of dampers and the friction of its effects, too."""
    effects = dict(d.effects)
    dampers = effects.get("damper", {}).get("coefficient", {})
    levels = effects.get("coulomb_friction", {}).get("level", {})
    joints = (
        replace(
            joint,
            damping=joint.damping + dampers.get(joint.name, 0.0),
            friction=levels.get(joint.name, joint.friction),
        )
        for joint in d.joints
    )
    return replace(d, joints=tuple(joints))


def add_forces(root: ET.Element, d: Description, tree: MjcfTree) -> None:
    """Add limits and forces to the joints of a robot of `parts`, and its motors to the root element.

    A motor has no gear: its control is the effort at the joint.
    """
    springs, driven = {spring.name: spring for spring in d.springs if spring.stiffness}, {*d.motors}
    limits = {joint.name: joint.effort_limit for joint in d.joints}
    for joint in (joint for joint in d.joints if joint.kind not in ("fixed", "floating")):
        put(
            tree.joints[joint.name], damping=joint.damping or None, armature=joint.armature or None,
            frictionloss=joint.friction or None,
        )  # fmt: skip
        if joint.kind is JointKind.SPHERICAL:
            continue
        bounds, effort, spring = (joint.lower, joint.upper), limits[joint.name], springs.get(joint.name)
        limited = joint.lower < joint.upper and np.isfinite(bounds).any()
        weak = joint.name not in driven and effort < np.inf
        put(
            tree.joints[joint.name], range=bounds if limited else None, limited="true" if limited else None,
            actuatorfrcrange=(-effort, effort) if weak else None,
            actuatorfrclimited="true" if weak else None,
            stiffness=spring.stiffness if spring else None, springref=spring.rest if spring else None,
        )  # fmt: skip
    actuator = add(root, "actuator") if d.motors else root
    for motor in d.motors:
        limit = (-limits[motor], limits[motor]) if limits[motor] < np.inf else None
        add(
            actuator, "motor", name=motor, joint=motor, ctrlrange=limit, ctrllimited="true" if limit else None
        )


def list_losses(d: Description, tree: MjcfTree, losses: Losses) -> None:
    """List what MuJoCo cannot say of the joints of a robot as it is, without its effects."""
    springs = {spring.name for spring in d.springs if spring.stiffness}
    for old, joint in zip(d.joints, with_effects(d).joints, strict=True):
        freedoms, endless = joint.kind.nv, joint.kind.endless
        lost = {
            "dampers are read back as viscous friction, to which they are added": old.damping - joint.damping,
            "damping of free joints": joint.damping
            and joint.kind == "floating"
            and joint.name in tree.joints,
            "continuous joints, which MuJoCo does not have: read back as hinges": endless,
            "speed limits, which MuJoCo does not have": freedoms and np.isfinite(joint.speed_limit),
            "gear ratios: the rotor's inertia is written as that at the joint": freedoms
            and joint.gear_ratio != 1,
            "position limits without room between them, which MuJoCo refuses": freedoms == 1
            and not joint.lower < joint.upper,
            "levels of coulomb_friction are read back as dry friction, too": joint.name in tree.joints
            and old.friction != joint.friction,
            "springs of continuous joints: MuJoCo counts whole turns": endless and joint.name in springs,
        }
        for reason, is_lost in lost.items():
            if is_lost:
                losses.add(reason, joint.name)
        forces = () if joint.kind is JointKind.SPHERICAL else FORCES[1:3]
        add_of_several(old, losses, ("lower", "upper", "effort_limit"), forces)


def add_effects(root: ET.Element, d: Description, tree: MjcfTree) -> list[tuple[str, dict[str, Any]]]:
    """Add what MuJoCo has of the effects of a robot of `parts`.

    Returns:
        The effects with numbers that the file does not say, on its own links and joints.
    """
    names = {link: element.get("name", WORLD) for link, element in tree.bodies.items()}
    left = []
    for effect, numbers in effects_on(d, names, {}):
        if effect == "ball_spring":
            numbers = _in_axes_of_bodies(numbers, tree)
            said = _add_ball_springs(numbers, tree)
        elif effect == "gravity_compensation":
            said = _add_compensation(dict(d.effects)[effect]["fraction"], d, tree)
        elif effect in SEEN:
            said = _add_lengths(root, effect, numbers, tree)
        else:
            said = effect in OF_JOINTS
        if not said:
            left.append((effect, numbers))
    return left


def _in_axes_of_bodies(numbers: Mapping[str, Any], tree: MjcfTree) -> dict[str, Any]:
    """Return the springs of balls, whose orientations MuJoCo counts in the axes of their bodies."""
    rest = {
        joint: [*(tree.turns[joint] @ np.array(turn[:3])).tolist(), turn[3]]
        for joint, turn in numbers.get("rest", {}).items()
    }
    return {**numbers, **({"rest": rest} if rest else {})}


def _add_ball_springs(numbers: Mapping[str, Any], tree: MjcfTree) -> bool:
    """Add springs of balls; return whether their rest is MuJoCo's, all joints at zero."""
    level = JointKind.SPHERICAL.zero
    turned = {joint for joint, rest in numbers.get("rest", {}).items() if tuple(rest) != level}
    for joint, stiffness in numbers["stiffness"].items():
        put(tree.joints[joint], stiffness=None if joint in turned else stiffness or None)
    return not turned


def _add_compensation(fractions: Mapping[str, float], d: Description, tree: MjcfTree) -> bool:
    """Add the part of its weight that each body is relieved of, which acts on bodies that move."""
    body, masses = WeldedBodies(d).of, {link.name: link.mass for link in d.links}
    for link, fraction in fractions.items():
        if masses[link] and (body[link] != d.root or d.base == "floating"):
            put(tree.bodies[link], gravcomp=fraction or None)
    return True


def _add_lengths(root: ET.Element, effect: str, numbers: Mapping[str, Any], tree: MjcfTree) -> bool:
    """Add tendons or lines with springs, dampers and dry friction; return whether the file says all."""
    arms, lines = numbers.get("arms", {}), numbers.get("ends", {})
    of_links = {element.get("name", WORLD): element for element in tree.bodies.values()}
    for name in lines or dict.fromkeys(name for own in arms.values() for name in own):
        tendon = add_tendon(root, name, [(joint, own[name]) for joint, own in arms.items() if name in own])
        if lines:
            shares = numbers.get("shares", {}).get(name) or [1.0] * (len(lines[name]) - 1)
            bodies = [of_links[link] for link in lines[name]]
            _add_path(tendon, bodies, numbers["points"][name], shares)
        k, damping, friction, *bounds = (numbers.get(word, {}).get(name, 0.0) for word in WORDS)
        if bounds == [UNSTATED, UNSTATED]:
            bounds = [NEXT_TO_UNSTATED, NEXT_TO_UNSTATED]
        put(
            tendon, stiffness=k or None, springlength=bounds if k else None, damping=damping or None,
            frictionloss=friction or None,
        )  # fmt: skip
    return bool(numbers.get("width", WIDTH) == WIDTH)


def _add_path(
    tendon: ET.Element, bodies: list[ET.Element], points: list[list[float]], shares: list[float]
) -> None:
    """Add the sites of a spatial tendon, and a pulley before each branch whose length counts by a share."""
    sites = [f"{tendon.get('name')}:{number}" for number in range(1, len(points) + 1)]
    for body, site, point in zip(bodies, sites, points, strict=True):
        add(body, "site", name=site, pos=point)
    last = 1.0
    for n, share in enumerate(shares):
        starts = n == 0 or share != last
        if share and share != last:
            add(tendon, "pulley", divisor=1.0 / share)
        for site in sites[n if starts else n + 1 : n + 2] if share else ():
            add(tendon, "site", site=site)
        last = share


def add_tendon(root: ET.Element, name: str, terms: Iterable[tuple[str, float]]) -> ET.Element:
    """Add a fixed tendon over joints, or a spatial one without sites; a name that is taken gets a number."""
    tendons = root.find("tendon")
    if tendons is None:
        tendons = add(root, "tendon")
    taken, terms = {one.get("name", "") for one in tendons}, [*terms]
    out = add(tendons, "fixed" if terms else "spatial", name=unique(name, taken))
    for joint, coefficient in terms:
        add(out, "joint", joint=joint, coef=coefficient)
    return out
