"""Write an MJCF file: bodies, closures, couplings, forces, motors, home.

a point        one connect between sites         two joints     a joint equality
fixed          one weld between sites            more joints    an equality of a fixed tendon
revolute       two connects, at two points of the axis

MuJoCo counts positions in equalities from those at `qpos0`.

A massless link that only carries one joint has no body: its joint stands in the body of the next link, before
that link's own, as MuJoCo writes universal joints.

Bodies stand where hinges and slides are at home and all other joints at zero: that is MuJoCo's `qpos0`, where
it weighs equalities, and home is `ref`. Positions and axes of joints are in the frame of their body there.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable
from dataclasses import replace
from xml.etree import ElementTree as ET

import numpy as np
from numpy.polynomial import Polynomial

from ..description.names import unique
from ..description.placement import inverse, motion_of, placement_from, turned
from ..description.records import FREEDOMS, ZERO, Array, Curve, Description, Joint, JointKind, Link
from ..description.shape_files import Shape
from ..description.side_cars.model_toml import model_file
from ..errors import ModelError
from .parts import AXES, LEAST_MOMENT, POINT_INERTIA, Sizes, is_solid, is_weightless, of_mujoco, sizes_of
from .request import (
    FORCES,
    USUAL_GRAVITY,
    Losses,
    Request,
    Written,
    add,
    add_of_several,
    home_of,
    numeral,
    principal,
    put,
    quaternion_of,
)

#: Most bodies one inside the other; XML readers stop at 256 elements.
DEEPEST = 240
#: Acceleration at which closures stay as tight as asked, relative to gravity: a robot that falls freely.
FREE_FALL = 10.0
#: Impedance of equalities, the largest that MuJoCo takes.
HARDEST = 0.9999
#: Numbers of `polycoef`.
MOST_POWERS = 5
#: Longest time step [s]; slower motions than those of the closures need to be followed, too.
LONGEST_STEP = 1e-3


#: Excess of the largest principal moment over the sum of the others that is rounding, relative to it.
MOMENT_ROUNDING = 1e-12
#: Name of MuJoCo's own body, which does not move.
WORLD = "world"
#: MuJoCo's words for kinds of joints in a body.
WORDS: dict[JointKind, str] = {
    "revolute": "hinge", "continuous": "hinge", "prismatic": "slide", "spherical": "ball",
}  # fmt: skip

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
        root, todo = self._d.root, list[tuple[ET.Element, int, Joint, Array, tuple[Carried, ...]]]()
        first = self._children.get(root, [])
        if root == WORLD and self._d.base == "fixed":
            self.bodies[root] = self.worldbody
            if not is_weightless(self._links[root]):
                self._losses.add("mass and inertia of the world's link, which do not move", root)
        else:
            kind: JointKind = "floating" if self._d.base == "floating" else "fixed"
            taken = {joint.name for joint in self._d.joints}
            first = [Joint(unique(f"{root}:free", taken), kind, "", root, np.eye(4), AXES[0])]
        todo += [(self.worldbody, 1, joint, np.eye(4), ()) for joint in reversed(_last_free(first))]
        while todo:
            element, depth, joint, M, carried = todo.pop()
            if depth > DEEPEST:
                raise ModelError(
                    f"more than {DEEPEST} bodies one inside the other, up to '{joint.child}'; XML readers "
                    "go no deeper",
                    element=joint.child,
                )
            step = joint.placement
            if joint.kind in WORDS and joint.kind != "spherical":
                step = step @ motion_of(joint, {joint.name: home_of(self._d, joint)})
            at, here = M @ step, tuple((j, frame @ step) for j, frame in carried)
            if joint.kind != "fixed":
                here = (*here, (joint, np.eye(4)))
            children = _last_free(self._children.get(joint.child, []))
            massless = is_weightless(self._links[joint.child]) and joint.child not in self._closed
            if here and massless and len(children) == 1 and joint.kind != "floating":
                todo.append((element, depth, children[0], at, here))
                continue
            body = self._add_body(element, joint.child, at, here)
            todo += [(body, depth + 1, child, np.eye(4), ()) for child in reversed(children)]

    def _add_body(self, parent: ET.Element, link: str, at: Array, carried: tuple[Carried, ...]) -> ET.Element:
        free = carried and carried[0][0].kind == "floating"
        name = unique(f"{WORLD}_", {*self._links}) if link == WORLD else link
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
    possible = np.maximum(moments, 0.0)
    if moving and moments.min() < LEAST_MOMENT:
        losses.add(
            "links without inertia about an axis, which MuJoCo refuses: written with a small one", link.name
        )
        possible = np.maximum(moments, max(LEAST_MOMENT, POINT_INERTIA * mass * sizes.size**2))
    largest = int(np.argmax(possible))
    most = np.delete(possible, largest).sum()
    if possible[largest] > most * (1 + MOMENT_ROUNDING) or moments.min() < 0:
        losses.add("inertias that no body can have: principal moments are changed", link.name)
    possible[largest] = min(possible[largest], most)
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
#: What is told of shapes that MuJoCo does not read.
UNREADABLE = (
    "visual shapes without extent, and meshes that are not found or none of .stl (binary), .obj, .msh"
)


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
        forces = FORCES[1:2] if joint.kind == "spherical" else FORCES[1:3]
        add_of_several(old, losses, ("lower", "upper", "effort_limit"), forces)


def add_visuals(root: ET.Element, request: Request, tree: Tree, losses: Losses) -> None:
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


def write_mjcf(request: Request, losses: Losses) -> Written:
    """Write a robot as MJCF.

    Raises:
        ModelError: The robot is too deep for nested bodies.
    """
    d = request.description
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
    parts = of_mujoco(with_effects(d), sizes, losses)
    tree = Tree(parts, sizes, losses)
    root.append(tree.worldbody)
    list_losses(d, tree, losses)
    if d.closures or d.couplings:
        equality = add(root, "equality")
        taken = {closure.name for closure in parts.closures}
        _add_closures(equality, parts, tree, sizes.size, taken, losses)
        _add_couplings(root, equality, parts, taken, losses)
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
    equality: ET.Element, d: Description, tree: Tree, arm: float, taken: set[str], losses: Losses
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


def _add_couplings(
    root: ET.Element, equality: ET.Element, d: Description, taken: set[str], losses: Losses
) -> None:
    """Add the couplings of a robot.

    Args:
        root: The root element, which receives `<tendon>`.
        equality: The element `<equality>`.
        d: The robot.
        taken: Names of equalities.
    """
    at = {joint.name: home_of(d, joint)[0] for joint in d.joints if joint.kind != "fixed"}

    def tendon(name: str, terms: Iterable[tuple[str, float]]) -> None:
        """Add a fixed tendon."""
        every = root.find("tendon")
        fixed = add(add(root, "tendon") if every is None else every, "fixed", name=name)
        for joint, coefficient in terms:
            add(fixed, "joint", joint=joint, coef=coefficient)

    for coupling in d.couplings:
        name, coupling = unique(coupling.name, taken), coupling.moved(at)
        (first, factor), *others = coupling.terms
        if coupling.curve:
            bent = _powers(coupling.curve, coupling.offset)
            factors = dict(coupling.terms)
            leaders = [joint for joint, _ in coupling.curve.terms]
            if len(bent) > MOST_POWERS:
                losses.add("couplings of an order above four, which are left out", name)
            elif len(leaders) == 1 and len({*factors} - {*leaders}) == 1:
                (follower,), (leader,) = {*factors} - {*leaders}, leaders
                ratio = [coupling.curve.terms[0][1] ** k for k in range(MOST_POWERS)]
                own = [x * by / factors[follower] for x, by in zip(bent, ratio, strict=False)]
                own[1] -= factors[leader] / factors[follower]
                add(equality, "joint", name=name, joint1=follower, joint2=leader, polycoef=tuple(own))
            else:
                lead = unique(f"{name}:leader", taken)
                tendon(name, [term for term in coupling.terms if term[1]])
                tendon(lead, coupling.curve.terms)
                add(equality, "tendon", name=name, tendon1=name, tendon2=lead, polycoef=tuple(bent))
        elif len(others) > 1:
            tendon(name, coupling.terms)
            add(equality, "tendon", name=name, tendon1=name, polycoef=(coupling.offset, 0, 0, 0, 0))
        else:
            second, coefficient = others[0] if others else (None, 0.0)
            line = (coupling.offset / factor, -coefficient / factor, 0, 0, 0)
            add(equality, "joint", name=name, joint1=first, joint2=second, polycoef=line)


def _powers(curve: Curve, offset: float) -> list[float]:
    """Return offset - curve as numbers times powers of the sum of its terms, lowest first, at least five."""
    rest = Polynomial([-curve.reference, 1.0])
    whole = Polynomial([offset]) - Polynomial([0.0, 0.0, *curve.coefficients])(rest)
    out: list[float] = whole.trim().coef.tolist()
    return out + [0.0] * (MOST_POWERS - len(out))
