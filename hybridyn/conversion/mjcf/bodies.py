"""Write links and joints as nested bodies, with limits, friction, rotors, springs, motors and shapes.

A massless link that only carries one joint has no body: its joint stands in the body of the next link, before
that link's own, as MuJoCo writes universal joints.

Bodies stand where hinges and slides are at home and all other joints at zero: that is MuJoCo's `qpos0`, where
it weighs equalities, and home is `ref`. Positions and axes of joints are in the frame of their body there.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree as ET

import numpy as np

from ...description.placement import inverse, motion_of
from ...description.records import FREEDOMS, ZERO, Array, Description, Joint, JointKind, Link
from ...description.shape_files import Shape
from ..home import home_of
from ..numerals import add, numeral, principal, put, quaternion_of
from ..request import Losses, Request, add_limits

AXES = np.eye(3)
#: Name of MuJoCo's own body, which does not move.
WORLD = "world"
#: MuJoCo's words for kinds of joints in a body.
WORDS: dict[JointKind, str] = {
    "revolute": "hinge", "continuous": "hinge", "prismatic": "slide", "spherical": "ball",
}  # fmt: skip

#: Mass and inertia of a moving link without any, relative to those of the lightest link. Smaller ones would
#: change the robot less, but make its closures softer.
LIGHT = 1e-3
#: Inertia of a point mass, relative to mass and size of the robot: far above MuJoCo's least one, 1e-15.
POINT_INERTIA = 1e-9
#: Least principal moment that MuJoCo takes, with a margin [kg m^2].
LEAST_MOMENT = 1e-14
#: Excess of the largest principal moment over the sum of the others that is rounding, relative to it.
MOMENT_ROUNDING = 1e-12


class Sizes(NamedTuple):
    """Sizes of a robot.

    Attributes:
        light: A link with the least mass and inertia.
        size: The median distance between joints [m].
    """

    light: Link
    size: float


def sizes_of(d: Description) -> Sizes:
    """Return the sizes of a robot."""
    steps = [float(np.linalg.norm(joint.placement[:3, 3])) for joint in d.joints]
    size = float(np.median([step for step in steps if step] or [1.0]))
    mass = min((link.mass for link in d.links if link.mass > 0), default=1.0)
    moments = [float(np.linalg.eigvalsh(link.inertia)[-1]) for link in d.links if link.mass > 0]
    moment = min((moment for moment in moments if moment > 0), default=mass * size**2)
    return Sizes(Link("", LIGHT * mass, np.zeros(3), LIGHT * moment * np.eye(3)), size)


def is_solid(link: Link) -> bool:
    """Say whether a link has mass and a positive definite inertia."""
    return link.mass > 0 and bool(np.linalg.eigvalsh(link.inertia)[0] > 4 * LEAST_MOMENT)


def is_weightless(link: Link) -> bool:
    """Say whether a link has neither mass nor inertia."""
    return not link.mass and not link.inertia.any()


#: A joint whose body is still to come, and the body's frame at `qpos0` in the joint's frame.
Carried = tuple[Joint, Array]


class Tree:
    """The bodies of a robot of `parts`.

    Args:
        d: The robot.
        sizes: Its size and the least inertia of its links.
        losses: Receives what is changed.

    Attributes:
        worldbody: The element of the world.
        bodies: Element of each link that has a body, by the link's name.
        joints: Element of each joint, by its name.
        qpos: Home positions of all joints, in MuJoCo's order.
    """

    def __init__(self, d: Description, sizes: Sizes, losses: Losses) -> None:
        self.worldbody = ET.Element("worldbody")
        self.bodies: dict[str, ET.Element] = {}
        self.joints: dict[str, ET.Element] = {}
        self.qpos: list[float] = []
        self._d, self._sizes, self._losses = d, sizes, losses
        self._links = {link.name: link for link in d.links}
        self._children: dict[str, list[Joint]] = {}
        for joint in d.joints:
            self._children.setdefault(joint.parent, []).append(joint)
        self._closed = {end for closure in d.closures for end in (closure.link_a, closure.link_b)}
        self._add_all()

    def _add_all(self) -> None:
        """Add all bodies, depth first, which is the order of MuJoCo's `qpos`."""
        root, todo = self._d.root, list[tuple[ET.Element, Joint, Array, tuple[Carried, ...]]]()
        first = self._children.get(root, [])
        if root == WORLD and self._d.base == "fixed":
            self.bodies[root] = self.worldbody
            if not is_weightless(self._links[root]):
                self._losses.add("mass and inertia of the world's link, which do not move", root)
        else:
            kind: JointKind = "floating" if self._d.base == "floating" else "fixed"
            first = [Joint(f"{root}:free", kind, "", root, np.eye(4), AXES[0])]
        todo += [(self.worldbody, joint, np.eye(4), ()) for joint in reversed(_last_free(first))]
        while todo:
            element, joint, M, carried = todo.pop()
            step = joint.placement
            if joint.kind in WORDS and joint.kind != "spherical":
                step = step @ motion_of(joint, {joint.name: home_of(self._d, joint)})
            at, here = M @ step, tuple((j, frame @ step) for j, frame in carried)
            if joint.kind != "fixed":
                here = (*here, (joint, np.eye(4)))
            children = _last_free(self._children.get(joint.child, []))
            massless = is_weightless(self._links[joint.child]) and joint.child not in self._closed
            if here and massless and len(children) == 1 and joint.kind != "floating":
                todo.append((element, children[0], at, here))
                continue
            body = self._add_body(element, joint.child, at, here)
            todo += [(body, child, np.eye(4), ()) for child in reversed(children)]

    def _add_body(self, parent: ET.Element, link: str, at: Array, carried: tuple[Carried, ...]) -> ET.Element:
        free = carried and carried[0][0].kind == "floating"
        name = f"{WORLD}_" if link == WORLD else link
        if name != link:
            self._losses.add("names that MuJoCo keeps for itself: written with an underscore", link)
        body = add(self.worldbody if free else parent, "body", name=name, **pose(at))
        for joint, frame in carried:
            if free:
                home = self._d.base_home or ZERO["floating"]
                if joint.parent:
                    self._losses.add(
                        "floating joints on a base at rest are free joints beside it", joint.name
                    )
                    home = home_of(self._d, joint)
                self.joints[joint.name] = add(body, "freejoint", name=joint.name)
                self.qpos += [*home[:3], home[6], *home[3:6]]
            else:
                self._add_joint(body, joint, inverse(frame))
        welded = (child.child for child in self._children.get(link, []) if child.kind == "fixed")
        moving = bool(carried) and not any(is_solid(self._links[other]) for other in welded)
        _add_inertial(body, self._links[link], self._sizes, moving, self._losses)
        self.bodies[link] = body
        return body

    def _add_joint(self, body: ET.Element, joint: Joint, frame: Array) -> None:
        """Add a joint with its positions; `frame` is its frame in the body at `qpos0`."""
        home, word, turn = home_of(self._d, joint), WORDS[joint.kind], frame[:3, :3]
        place = frame[:3, 3] if word != "slide" and frame[:3, 3].any() else None
        out = add(body, "joint", name=joint.name, type=word, pos=place)
        if word == "ball":
            self.qpos += [home[3], *(turn @ np.array(home[:3]))]
            if not np.array_equal(turn, np.eye(3)):
                self._losses.add("ball joints whose coordinates MuJoCo counts about other axes", joint.name)
        else:
            put(out, axis=turn @ joint.axis, ref=home[0] or None)
            self.qpos += home
        self.joints[joint.name] = out


def _last_free(joints: list[Joint]) -> list[Joint]:
    """Return joints in their order, but free ones last."""
    return sorted(joints, key=lambda joint: joint.kind == "floating")


def _add_inertial(body: ET.Element, link: Link, sizes: Sizes, moving: bool, losses: Losses) -> None:
    """Add `<inertial>` to a body, with principal moments and axes, which MuJoCo keeps as they are.

    Args:
        body: The body's element.
        sizes: Sizes of the robot.
        moving: Whether MuJoCo needs mass and inertia: the body has a joint.
        losses: Receives what is changed.
    """
    mass, inertia = link.mass or sizes.light.mass, link.inertia
    if not moving and is_weightless(link):
        return
    light = f"written with {numeral(sizes.light.mass)} kg"
    if is_weightless(link):
        losses.add(f"moving links without mass, which MuJoCo refuses: {light}", link.name)
        inertia = sizes.light.inertia
    elif not link.mass:
        losses.add(f"links with inertia but without mass: {light}", link.name)
    moments, axes = principal(inertia)
    possible = moments.copy()
    if moving and moments.min() < LEAST_MOMENT:
        losses.add(
            "links without inertia about an axis, which MuJoCo refuses: written with a small one", link.name
        )
        possible = np.maximum(moments, max(LEAST_MOMENT, POINT_INERTIA * mass * sizes.size**2))
    largest = int(np.argmax(possible))
    others = np.delete(possible, largest)
    if possible[largest] > others.sum() * (1 + MOMENT_ROUNDING):
        losses.add("inertias that no body can have: the largest principal moment is reduced", link.name)
    while possible[largest] > others.sum():
        possible[largest] = np.nextafter(others.sum(), 0)
    quat = None if np.array_equal(axes, np.eye(3)) else quaternion_of(axes)
    add(body, "inertial", pos=link.com, mass=mass, diaginertia=possible, quat=quat)


def pose(at: Array) -> dict[str, Iterable[float] | None]:
    """Return `pos` and `quat` of a placement (4, 4), None where it is the identity."""
    turned = not np.array_equal(at[:3, :3], np.eye(3))
    return {
        "pos": at[:3, 3] if at[:3, 3].any() else None, "quat": quaternion_of(at[:3, :3]) if turned else None
    }  # fmt: skip


#: Effects that stand in the file itself; the others go to model.toml.
SAID = ("spring", "damper")

#: Endings of the meshes that MuJoCo reads.
MESHES = (".stl", ".obj", ".msh")
#: Most triangles of an STL file that MuJoCo reads.
MOST_FACES = 200_000


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


def add_forces(root: ET.Element, d: Description, tree: Tree) -> None:
    """Add limits and forces to the joints of a robot of `parts`, and its motors to the root element.

    A motor has no gear: its control is the effort at the joint.
    """
    springs, driven = {spring.name: spring for spring in d.springs if spring.stiffness}, {*d.motors}
    limits = {joint.name: joint.effort_limit for joint in d.joints}
    for joint in (joint for joint in d.joints if joint.kind not in ("fixed", "floating")):
        put(tree.joints[joint.name], damping=joint.damping or None, armature=joint.armature or None)
        if joint.kind == "spherical":
            continue
        bounds, effort, spring = (joint.lower, joint.upper), limits[joint.name], springs.get(joint.name)
        limited = joint.lower < joint.upper and np.isfinite(bounds).any()
        weak = joint.name not in driven and effort < np.inf
        put(
            tree.joints[joint.name], frictionloss=joint.friction or None,
            range=bounds if limited else None, limited="true" if limited else None,
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


def list_losses(d: Description, tree: Tree, losses: Losses) -> None:
    """List what MuJoCo cannot say of the joints of a robot as it is, without its effects."""
    springs = {spring.name for spring in d.springs if spring.stiffness}
    for old, joint in zip(d.joints, with_effects(d).joints, strict=True):
        freedoms, endless = FREEDOMS[joint.kind], joint.kind == "continuous"
        lost = {
            "dampers are read back as viscous friction, to which they are added": old.damping - joint.damping,
            "damping of free joints": joint.damping
            and joint.kind == "floating"
            and joint.name in tree.joints,
            "dry friction and rotors of joints with several freedoms": freedoms > 1
            and (old.friction or (joint.armature and joint.kind != "spherical")),
            "continuous joints, which MuJoCo does not have: read back as hinges": endless,
            "speed limits, which MuJoCo does not have": freedoms and np.isfinite(joint.speed_limit),
            "gear ratios: the rotor's inertia is written as that at the joint": freedoms
            and joint.gear_ratio != 1,
            "position limits without room between them, which MuJoCo refuses": freedoms == 1
            and not joint.lower < joint.upper,
            "levels of coulomb_friction are read back as dry friction, too": freedoms == 1
            and old.friction != joint.friction,
            "springs of continuous joints: MuJoCo counts whole turns": endless and joint.name in springs,
        }
        for reason, is_lost in lost.items():
            if is_lost:
                losses.add(reason, joint.name)
        if freedoms:
            add_limits(joint, losses, ("lower", "upper", "effort_limit"))


def add_visuals(root: ET.Element, request: Request, tree: Tree, losses: Losses) -> None:
    """Add the shapes of a robot.

    Args:
        root: The root element, which receives `<asset>`.
        losses: Receives the shapes that MuJoCo cannot read.
    """
    assets: dict[tuple[str, tuple[float, ...]], str] = {}
    for shape in request.shapes:
        body = tree.bodies.get(shape.link)
        if body is None:
            losses.add("visual shapes of massless links that have no body", shape.link)
        elif shape.kind != "mesh" and any(size <= 0 for size in shape.size):
            losses.add("visual shapes without extent", shape.link)
        elif shape.kind != "mesh" or _is_readable(shape, losses):
            first, *others = shape.size  # of a box all edges, else the radius and perhaps a length
            size = first / 2 if shape.kind == "box" else first, *(other / 2 for other in others)
            mesh = None
            if shape.path is not None:
                file = os.path.relpath(shape.path.resolve(), request.target.resolve().parent)
                mesh = assets.setdefault((file, shape.size), f"{shape.path.stem}_{len(assets)}")
            add(
                body, "geom", type=shape.kind, group="2", contype="0", conaffinity="0", mass="0", mesh=mesh,
                size=None if mesh else size, rgba=shape.colour, **pose(shape.placement),
            )  # fmt: skip
    asset = add(root, "asset") if assets else root
    for (file, scale), name in assets.items():
        factors = scale if any(factor != 1 for factor in scale) else None
        add(asset, "mesh", name=name, file=file, inertia="shell", scale=factors)


def _is_readable(shape: Shape, losses: Losses) -> bool:
    """Say whether MuJoCo reads a mesh, as far as its ending and the head of an STL file tell."""
    if shape.path is None:
        losses.add("meshes that were not found", shape.file)
        return False
    ending = shape.path.suffix.lower()
    readable = ending in MESHES and (ending != ".stl" or _is_binary(shape.path))
    if not readable:
        losses.add(
            f"meshes that MuJoCo does not read (it takes {', '.join(MESHES)}; STL in binary)", shape.file
        )
    return readable


def _is_binary(file: Path) -> bool:
    """Say whether an STL file is a binary one that MuJoCo reads."""
    with open(file, "rb") as content:
        head = content.read(84)
    faces = int.from_bytes(head[80:84], "little")
    return 0 < faces <= MOST_FACES and file.stat().st_size == 84 + 50 * faces
