"""Which elements and attributes SDFormat has, so that none is dropped by a spelling mistake."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..names import closest, did_you_mean, listed
from ..urdf.foreign import LEGACY_FORMS
from ..urdf.xml_node import Node

#: Attributes of each element that is read.
ATTRIBUTES: dict[str, tuple[str, ...]] = {
    "sdf": ("version",),
    "world": ("name", "namespace"),
    "model": ("name", "canonical_link", "namespace"),
    "frame": ("name", "attached_to"),
    "link": ("name",),
    "inertial": ("auto",),
    "joint": ("name", "type"),
    "mimic": ("joint", "axis"),
    "pose": ("relative_to", "frame", "rotation_format", "degrees"),
    "xyz": ("expressed_in",),
}

#: Children of each element that are read.
READ: dict[str, tuple[str, ...]] = {
    "sdf": ("model", "world"),
    "world": ("model", "include", "joint", "frame", "gravity", "physics"),
    "model": ("static", "pose", "frame", "link", "joint", "include", "model"),
    "include": ("uri", "name", "pose", "static"),
    "frame": ("pose",),
    "link": ("pose", "inertial", "gravity", "kinematic", "velocity_decay"),
    "velocity_decay": ("linear", "angular"),
    "inertial": ("mass", "pose", "inertia", "fluid_added_mass"),
    "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"),
    "joint": (
        "parent", "child", "pose", "axis", "axis2", "physics", "drake:rotor_inertia", "drake:gear_ratio",
    ),
    "axis": ("xyz", "dynamics", "limit", "mimic", "use_parent_model_frame", "initial_position"),
    "dynamics": ("damping", "friction", "spring_reference", "spring_stiffness"),
    "limit": ("lower", "upper", "effort", "velocity", "stiffness", "dissipation"),
    "mimic": ("multiplier", "offset", "reference"),
}  # fmt: skip
READ |= {tag: () for tags in [*READ.values()] for tag in tags if tag not in READ}

#: What SDFormat has and hybridyn does not read, and what to write in its place.
REFUSED = {
    "placement_frame": "a pose of the model itself",
    "merge": "an include without it, whose links are named model::link",
    "screw_thread_pitch": "a revolute and a prismatic joint, and <mimic>",
    "thread_pitch": "a revolute and a prismatic joint, and <mimic>",
    "gearbox_ratio": "<mimic>",
    "gearbox_reference_body": "<mimic>",
}

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


@dataclass
class Unread:
    """What is left out and noted.

    Attributes:
        repaired: What is not well-formed in included files.
        custom: Elements with a namespace.
        unknown: Elements that SDFormat does not have, and where they stand.
    """

    repaired: list[str] = field(default_factory=list)
    custom: list[str] = field(default_factory=list)
    plugins: list[str] = field(default_factory=list)
    unknown: list[str] = field(default_factory=list)

    def notes(self) -> list[str]:
        """Return the remarks in words."""
        words = {"elements of other programs": self.custom, "plugins": self.plugins}
        left_out = [f"{what} are not read: {listed(dict.fromkeys(of))}" for what, of in words.items() if of]
        return [*self.repaired, *left_out, *(f"{one} is ignored, as Gazebo does" for one in self.unknown)]


def check(node: Node, unread: Unread) -> None:
    """Refuse what SDFormat does not have there where it resembles what it has, and note the rest.

    Attributes, joints, links, inertias and numbers that are read elsewhere may not be misplaced, either.

    Args:
        node: An element; `axis2` counts as `axis`, `velocity` etc. by their own names.
        unread: Takes what is left out and noted.

    Raises:
        ModelError: Something is unknown, or stands where it is not read.
    """
    kind = "axis" if node.tag == "axis2" else node.tag
    attributes = ATTRIBUTES.get(kind, ())
    for name in node.attributes():
        if name in REFUSED:
            raise node.error(f"{name} is not read; write {REFUSED[name]}")
        if name not in attributes:
            known = listed(attributes) or "none"
            raise node.error(f"unknown attribute '{name}'{did_you_mean(name, attributes)}; known: {known}")
    read, left_out = READ[kind], LEFT_OUT.get(kind, ())
    for child in node.children():
        if child.tag in left_out:
            refuse_lost(child)
            if child.tag == "plugin":
                unread.plugins.append(
                    str(child.xml.get("name") or child.xml.get("filename") or "plugin")[:80]
                )
        elif child.tag not in read:
            _refuse_unknown(child, node, (*read, *left_out), unread)


def _refuse_unknown(child: Node, node: Node, known: tuple[str, ...], unread: Unread) -> None:
    if child.tag in REFUSED:
        raise child.error(f"is not read; write {REFUSED[child.tag]}")
    if child.tag in LEGACY_FORMS:
        raise child.error(f"{LEGACY_FORMS[child.tag].split(';')[0]}, which is not read in SDF; remove it")
    if ":" in child.tag and child.tag not in NAMESPACED and not child.tag.startswith("hybridyn:"):
        refuse_lost(child)
        unread.custom.append(child.tag)
        return
    elsewhere = child.tag in READ and child.tag != "static"
    if elsewhere or child.tag.startswith("hybridyn:") or closest(child.tag, known):
        hint = did_you_mean(child.tag, known)
        raise child.error(f"unknown in {node.label}{hint}; known: {listed(known) or 'nothing'}")
    refuse_lost(child)
    unread.unknown.append("{}:{}: ".format(*child.place) + f"<{child.tag}> in {node.label}")


def refuse_lost(node: Node) -> None:
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
