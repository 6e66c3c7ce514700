"""Make a robot of the joints and closures that MuJoCo has, which refuses links without mass.

All joints that a closure leaves free lead to a *follower*, a body of its own that is welded to the other
link. It has half of that link's inertia. Together they are the same rigid body, so that the motion stays the
same; a body of small mass would be a soft weld.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np

from ..description.closure_forms import FULL
from ..description.joint_words import WORDS
from ..description.loop_signs import WeldedBodies
from ..description.names import unique
from ..description.records import Closure, Description
from ..joints.kinds import JointKind
from .parts import RobotParts
from .renamed import held_links
from .request import Losses
from .small_bodies import Sizes, is_solid, is_weightless


def of_mujoco(d: Description, sizes: Sizes, losses: Losses) -> Description:
    """Return a robot each of whose joints and closures has an equal in MuJoCo.

    Args:
        d: The robot.
        sizes: Its size and the least inertia of its links.
        losses: Receives what is changed.
    """
    welded = {link for link, body in WeldedBodies(d).of.items() if body == d.root}
    still = welded if d.base == "fixed" else set()
    parts, closures, ends = RobotParts(d, losses), [], _weightless_ends(d, still)
    for closure in d.closures:
        if {closure.link_a, closure.link_b} & ends or (
            closure.translations != FULL or closure.rotation == "perpendicular"
        ):
            losses.add("closures are a weld to a body of their own, which follows one link", closure.name)
            closure = _followed(parts, closure, ends, still, sizes)
        closures.append(closure)
    followers, parts.joints = parts.joints, []
    ending = {end for closure in closures for end in (closure.link_a, closure.link_b)} | held_links(d)
    carrying = Counter(joint.parent for joint in (*d.joints, *followers))
    for joint in d.joints:
        link = joint.child
        is_body = not is_weightless(parts.links[link]) or carrying[link] != 1 or link in ending
        hangs_free = joint.parent == d.root and np.array_equal(joint.placement, np.eye(4))
        is_free = hangs_free and d.base == "fixed" and is_body
        has = is_free if joint.kind is JointKind.FLOATING else WORDS[joint.kind].mjcf
        if joint.kind.nv and not has:
            parts.split(joint)
        else:
            parts.joints.append(joint)
    parts.joints += followers
    return parts.described(closures)


def _followed(parts: RobotParts, closure: Closure, ends: set[str], still: set[str], sizes: Sizes) -> Closure:
    """Add the follower of a closure, which takes its inertia from a link, and return its weld.

    Args:
        ends: The links that only end a closure and have no inertia.
        still: The links that do not move.
    """
    links = closure.link_a, closure.link_b
    solid = [is_solid(parts.links[link]) and link not in still for link in links]
    first = links[0] in ends or (links[1] not in ends and (solid[1] or not solid[0]))
    frames = closure.frame_a, closure.frame_b
    (on, welded), (own, other) = (links, frames) if first else (links[::-1], frames[::-1])
    name = unique(f"{closure.name}_follower", parts.taken)
    if any(solid):
        half = parts.links[welded]
        half = replace(half, mass=half.mass / 2, inertia=half.inertia / 2)
        parts.links[welded], turn = half, other[:3, :3]
        parts.followers.setdefault(welded, []).append(name)
        com = turn.T @ (half.com - other[:3, 3])
        body = replace(half, name=name, com=com, inertia=turn.T @ half.inertia @ turn)
    else:
        body = replace(sizes.light, name=name)
        if welded not in still:
            reason = "closures between links without mass: a body of small mass follows them"
            parts.losses.add(reason, closure.name)
    parts.links[name] = body
    place, steps = parts.free(closure, first)
    named = {f"{closure.name}_{number}": step for number, step in enumerate(steps, 1)}
    parts.chain(named, (on, name), own @ place)
    weld = replace(closure, translations=FULL, rotation="fixed")
    if first:
        return replace(weld, link_a=name, frame_a=np.eye(4))
    return replace(weld, link_b=name, frame_b=np.eye(4))


def _weightless_ends(d: Description, still: set[str]) -> set[str]:
    """Return the moving links that have no inertia and only end a closure.

    MuJoCo refuses bodies without mass: the follower of the closure takes their place.
    """
    carrying = {joint.parent for joint in d.joints} | still | held_links(d)
    light = {link.name for link in d.links if is_weightless(link)} - carrying
    pairs = [(closure.link_a, closure.link_b) for closure in d.closures]
    counted = Counter(end for pair in pairs for end in pair)
    alone = [{*pair} & light for pair in pairs if not {*pair} <= light]
    return {end for ends in alone for end in ends if counted[end] == 1}
