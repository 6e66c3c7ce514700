"""SDFormat's elements: what is read, noted and refused, and their texts and numbers.

Values are texts of children, not attributes; the writer asks `NUMBERS`, too.
"""

from __future__ import annotations

import math

import numpy as np

from ..loop_signs import LEGACY_FORMS
from ..names import DROPS, NOTHING, closest, did_you_mean, listed
from ..placement import placement_from, rotation_from_quaternion, rotation_from_rpy
from ..plugins import is_harmless, weld_of
from ..records import Array
from ..rows import Row, numbers_in
from ..urdf.drake import BALL
from ..urdf.drake_forces import BUSHING, ENDS, SPRING, THREES
from ..urdf.xml_node import OfChildren, XmlNode, unit

#: Remarks, each with the names that it concerns (see `names.noted`).
Notes = dict[str, list[str]]

#: Deviation of a quaternion's length from 1 that is rounding: files keep 4 digits and more. Programs disagree
#: on what longer and shorter ones mean.
QUATERNION_SLACK = 1e-3

#: Size from which a limit is none: SDFormat's defaults before version 1.9 are -1e16 and 1e16.
UNLIMITED = 1e16
NONE, ONE, UNSTATED = Row(), Row(1.0), Row(math.nan)
FORCE, LIMIT = Row(least=0.0), Row(math.inf, endless=UNLIMITED)

#: Children of each element that are numbers, with SDFormat's defaults.
NUMBERS: dict[str, dict[str, Row]] = {
    "velocity_decay": {"linear": NONE, "angular": NONE},
    "inertial": {"mass": Row(1.0, least=0.0)},
    "inertia": {"ixx": ONE, "ixy": NONE, "ixz": NONE, "iyy": ONE, "iyz": NONE, "izz": ONE},
    "joint": {
        "drake:rotor_inertia": FORCE, "drake:gear_ratio": ONE, "screw_thread_pitch": UNSTATED,
        "thread_pitch": UNSTATED, "gearbox_ratio": ONE,
    },
    "axis": {
        "initial_position": UNSTATED, "drake:rotor_inertia": Row(math.nan, least=0.0),
        "drake:gear_ratio": UNSTATED,
    },
    "limit": {
        "lower": Row(-math.inf, endless=UNLIMITED), "upper": LIMIT, "effort": LIMIT, "velocity": LIMIT,
        "stiffness": Row(1e8, endless=math.inf), "dissipation": Row(1.0, endless=math.inf),
    },
    "dynamics": {"damping": FORCE, "friction": FORCE, "spring_reference": NONE, "spring_stiffness": FORCE},
    "mimic": {"multiplier": ONE, "offset": NONE, "reference": NONE},
}  # fmt: skip

#: Attributes of each element that is read.
ATTRIBUTES: dict[str, tuple[str, ...]] = {
    "sdf": ("version",),
    "world": ("name", "namespace"),
    "model": ("name", "namespace", "canonical_link", "placement_frame"),
    "include": ("merge",),
    "frame": ("name", "attached_to"),
    "link": ("name",),
    "inertial": ("auto",),
    "joint": ("name", "type"),
    "mimic": ("joint", "axis"),
    "pose": ("relative_to", "rotation_format", "degrees"),
    "xyz": ("expressed_in",),
}

#: Children of each element that are read, beside its numbers.
READ: dict[str, tuple[str, ...]] = {
    "sdf": ("model", "world"),
    "world": ("model", "include", "gravity", "physics", "frame", "joint"),
    "model": ("static", "pose", "frame", "link", "joint", "include", "model", BALL, SPRING, BUSHING),
    "include": ("uri", "name", "pose", "static", "placement_frame"),
    "frame": ("pose",),
    "link": ("pose", "inertial", "gravity", "kinematic", "velocity_decay"),
    "inertial": ("pose", "inertia", "fluid_added_mass"),
    "joint": ("parent", "child", "pose", "axis", "axis2", "physics", "gearbox_reference_body"),
    "axis": ("xyz", "dynamics", "limit", "mimic", "use_parent_model_frame"),
}
READ |= {
    tag: tuple(f"{tag}_{word}" for word in ("body_A", "body_B", "p_AP", "p_BQ", *more))
    for tag, more in ((BALL, ()), (SPRING, ("free_length", "stiffness", "damping")))
}
READ[BUSHING] = (*ENDS, *(f"drake:bushing_{word}" for word in THREES))
READ = {tag: (*READ.get(tag, ()), *NUMBERS.get(tag, ())) for tag in [*READ, *NUMBERS]}
READ |= {tag: () for tags in [*READ.values()] for tag in tags if tag not in READ}

#: How SDFormat before version 1.7 wrote `relative_to`.
OLD_FRAME = "frame"

#: Children of each element that do not change the dynamics, or that others read or note.
LEFT_OUT: dict[str, tuple[str, ...]] = {
    "sdf": ("light", "actor"),
    "world": (
        "audio", "wind", "magnetic_field", "atmosphere", "gui", "scene", "light", "actor", "plugin", "road",
        "spherical_coordinates", "state", "population",
    ),
    "model": ("self_collide", "allow_auto_disable", "enable_wind", "plugin", "gripper", "model_state"),
    "include": ("plugin", "model_state"),
    "link": (
        "enable_wind", "self_collide", "must_be_base_link", "collision", "visual", "sensor", "projector",
        "audio_sink", "audio_source", "battery", "light", "particle_emitter", "plugin", "frame",
    ),
    "inertial": ("density", "auto_inertia_params", "frame"),
    "joint": ("sensor", "plugin", "frame"),
}  # fmt: skip

#: Elements that carry the dynamics: none may stand where it is not read.
DYNAMIC = {"link", "joint", "inertial", "axis", "axis2", "mimic"}

#: Elements of other programs with a namespace that are read.
NAMESPACED = {tag for tags in READ.values() for tag in tags if ":" in tag}

#: Elements that are left out with a note; "{}" stands for their names, or for those of what they are in.
NOTED = {
    "plugin": "plugins are not read: {}",
    "state": "the <state> of the world is not read: poses are those of the models",
    **dict.fromkeys(
        ("stiffness", "dissipation"),
        "joints {}: stiffness and dissipation of joint stops are not read (the effect stop has them)",
    ),
}

#: Elements that change the motion unless they are false or empty, by the element that they are in.
FORCES = {"model": ("enable_wind", "gripper"), "link": ("enable_wind",)}

#: Settings of joints in `<physics>` that concern solvers, stops, or a choice of the reader.
SOLVER = {
    "ode", "simbody", "limit", "cfm", "erp", "cfm_damping", "implicit_spring_damper", "provide_feedback",
    "fudge_factor", "bounce", "must_be_loop_joint",
}  # fmt: skip

#: What is noted of elements with a namespace.
CUSTOM = "elements of other programs are not read: {}"


def check(root: XmlNode, notes: Notes) -> None:
    """Refuse what SDFormat does not have where it stands and what resembles what it has; note the rest.

    Attributes, joints, links, inertias and numbers that are read elsewhere may not be misplaced, either.

    Args:
        root: Root element of a file; of `<physics>` nothing is checked.
        notes: Takes what is left out and noted.

    Raises:
        ModelError: Something is unknown, or stands where it is not read.
    """
    waiting = [root]
    while waiting:
        node = waiting.pop()
        kind = "axis" if node.tag == "axis2" else node.tag
        _check_attributes(node, ATTRIBUTES.get(kind, ()))
        read, left_out = READ[kind], LEFT_OUT.get(kind, ())
        for child in node.children():
            if child.tag in NOTED:
                name = (
                    child.attrib.get("name")
                    or child.attrib.get("filename")
                    or around(child).attrib.get("name")
                )
                harmless = child.tag != "plugin" or is_harmless(child)
                told = NOTED[child.tag] if harmless else f"{DROPS} the plugins {{}}; {NOTHING}, as in Drake"
                if child.tag != "plugin" or weld_of(child, node.attrib.get("name", "")) is None:
                    _note(child, told, str(name), notes)
            _note_forces(child, kind, notes)
            if child.tag in left_out:
                refuse_lost(child)
            elif child.tag not in read:
                _refuse_unknown(child, node, (*read, *left_out), notes)
            elif child.tag != "physics":
                waiting.append(child)


def _note_forces(child: XmlNode, kind: str, notes: Notes) -> None:
    """Note elements that exert forces in Gazebo, and are left out here."""
    on = child.tag in FORCES.get(kind, ()) and (len(child.xml) or child.content().lower() in ("true", "1"))
    inner = child.descendants() if child.tag == "physics" and kind == "joint" else ()
    unread = [one for one in inner if one.tag not in SOLVER and (len(one.xml) or one.content().strip("0."))]
    for node in (*([child] if on else ()), *unread):
        text = f"{DROPS} <{node.tag}> of {{}}; {NOTHING}, as in Drake"
        _note(node, text, str(around(node).attrib.get("name")), notes)


def _note(node: XmlNode, text: str, name: str, notes: Notes) -> None:
    """Note a name, at the place of the first element of which the text tells."""
    known = (key for key in notes if key.endswith(f": {text}"))
    notes.setdefault(next(known, f"{node.at}: {text}"), []).append(name[:80])


def _check_attributes(node: XmlNode, known: tuple[str, ...]) -> None:
    """Refuse attributes that SDFormat does not have, or that are not read."""
    for name in node.attributes():
        if name == OLD_FRAME and node.tag == "pose":
            root = node.xml.getroottree().getroot()
            if node.attrib.get(name, "").strip() and str(root.get("version")).strip() not in (
                "1.3",
                "1.4",
                "1.5",
                "1.6",
            ):
                raise node.error("frame ended with SDFormat 1.6; write relative_to")
        elif name not in known:
            hint = did_you_mean(name, known)
            raise node.error(f"unknown attribute '{name}'{hint}; known: {listed(known) or 'none'}")


def _refuse_unknown(child: XmlNode, node: XmlNode, known: tuple[str, ...], notes: Notes) -> None:
    if child.tag in LEGACY_FORMS:
        raise child.error(f"{LEGACY_FORMS[child.tag].split(';')[0]}, which is not read in SDF; remove it")
    others = ":" in child.tag and child.tag not in NAMESPACED and not child.tag.startswith("hybridyn:")
    if others and not closest(child.tag, [tag for tag in known if ":" in tag]):
        refuse_lost(child)
        _note(child, CUSTOM, child.tag, notes)
        return
    elsewhere = child.tag in READ and child.tag != "static"
    if elsewhere or child.tag.startswith("hybridyn:") or closest(child.tag, known):
        hint = did_you_mean(child.tag, known)
        raise child.error(f"unknown in {node.label}{hint}; known: {listed(known) or 'nothing'}")
    refuse_lost(child)
    file, line = child.place
    notes[f"{file}:{line}: <{child.tag}> in {node.label} is ignored, as Gazebo does"] = [child.tag]


def around(node: XmlNode) -> XmlNode:
    """Return an element, or the nearest one around it that has a name."""
    holders = (xml for xml in (node.xml, *node.xml.iterancestors()) if xml.get("name"))
    return XmlNode(next(holders, node.xml), node.file)


def refuse_lost(node: XmlNode) -> None:
    """Refuse joints, links and inertias inside an element that is left out; a plugin's own names are free.

    Raises:
        ModelError: There is one.
    """
    if node.tag in ("frame", "state", "population", "actor", "gripper", "gui", "model_state"):
        return
    for inner in node.descendants():
        lost = inner.tag in DYNAMIC
        if node.tag in ("plugin", "sensor"):
            lost = inner.tag == "joint" and {"parent", "child"} <= {child.tag for child in inner.children()}
        if lost:
            raise inner.error(f"is not read inside <{node.tag}>; move it to the place where SDFormat has it")


def word(node: XmlNode, tag: str) -> str:
    """Return the text of a child, "" if it is absent.

    Raises:
        ModelError: The child is stated twice.
    """
    child = node.child(tag)
    return "" if child is None else child.content()


def numbers(node: XmlNode | None, tag: str) -> dict[str, float]:
    """Return the numbers in the children of an element; absent and empty children have their defaults.

    Args:
        node: The element, or None where it is absent.
        tag: Its kind, a key of `NUMBERS`.

    Raises:
        ModelError: A text is no number, a number is negative that may not be, or a child is stated twice.
    """
    if node is None:
        return numbers_in(NUMBERS[tag], None)
    return numbers_in(NUMBERS[tag], OfChildren(node), f" of {around(node).label}")


def flag(node: XmlNode, tag: str, default: bool = False) -> bool:
    """Return a child as true or false; the default if it is absent or empty.

    Raises:
        ModelError: The text is neither, or the child is stated twice.
    """
    text = word(node, tag).lower() or str(default).lower()
    if text not in ("true", "false", "1", "0"):
        raise node.required_child(tag).error(f"text '{text[:40]}' instead of true or false")
    return text in ("true", "1")


def direction(node: XmlNode) -> Array:
    """Return the unit vector that an element states, shape (3,); ModelError if it is zero."""
    return unit(node, node.numbers("", 3), "<xyz>0 0 1</xyz>")


def pose(node: XmlNode | None) -> Array:
    """Return the placement that a `<pose>` states, shape (4, 4); the identity for None or an empty text.

    Raises:
        ModelError: A number does not parse, a quaternion is zero, or an attribute is unknown.
    """
    if node is None or not node.content():
        return np.eye(4)
    form = node.attrib.get("rotation_format", "").strip() or "euler_rpy"
    if form == "euler_rpy":
        numbers = node.numbers("", 6)
        angles = np.radians(numbers[3:]) if node.flag("degrees", False) else numbers[3:]
        return placement_from(rotation_from_rpy(*angles), numbers[:3])
    if form != "quat_xyzw":
        raise node.error(f"rotation_format '{form}' instead of 'euler_rpy' or 'quat_xyzw'")
    numbers = node.numbers("", 7)
    norm = float(np.linalg.norm(numbers[3:]))
    if abs(norm - 1) > QUATERNION_SLACK:
        raise node.error(f"its quaternion has length {norm:g}; a unit quaternion is needed")
    return placement_from(rotation_from_quaternion(*(numbers[3:] / norm)), numbers[:3])


def relative_to(node: XmlNode | None) -> str:
    """Return the name of the frame in which a `<pose>` is expressed, "" for the default."""
    if node is None:
        return ""
    return node.attrib.get("relative_to", "").strip() or node.attrib.get(OLD_FRAME, "").strip()


def screw_pitch(node: XmlNode) -> float:
    """Return the pitch of a screw [m/rad]; `thread_pitch` is minus the angle per way [rad/m].

    Without both it is 1 m per turn, as in sdformat.

    Raises:
        ModelError: The screw slides without turning.
    """
    stated = numbers(node, "joint")
    pitch, rate = stated["screw_thread_pitch"], stated["thread_pitch"]
    if rate == 0:
        raise node.error("a <thread_pitch> of 0 rad/m slides without turning; write a prismatic joint")
    if math.isnan(pitch) and not math.isnan(rate):
        return -1 / rate
    return (1.0 if math.isnan(pitch) else pitch) / (2 * math.pi)
