"""Note what simulation engines read in a URDF and hybridyn does not: nothing that may move a robot is silent.

Every attribute and child of the elements below is read, known not to touch the dynamics (drawing, contacts,
planning, control, solvers), or dropped with a note. `KNOWN` lists the first two; so a word that no one has
thought of is noted. Engines: Gazebo, Drake, Bullet, RaiSim, Isaac Sim, MuJoCo, ros_control and ros2_control.
"""

from __future__ import annotations

import re

from ..names import DROPS, NOTHING, listed
from ..plugins import is_harmless, is_read, name_of
from .xml_node import XmlNode

#: Solver settings of Gazebo's joints.
_SOLVER = (
    "cfm erp cfm_damping implicit_spring_damper provide_feedback fudge_factor bounce limit/cfm limit/erp "
    "must_be_loop_joint"
)
_ROTOR = "rotor_inertia gear_ratio drake:rotor_inertia drake:gear_ratio rotorInertia mechanicalReduction"
_HARDWARE = (
    "role offset hardwareInterface motorTorqueConstant pulsesPerRevolution joint_position_offset "
    "ignoreTransmissionAbsoluteEncoder drake:controller_gains"
)

#: By place, the attributes (@) and children that are read or do not touch the dynamics. A child that is a
#: place of its own is looked into; of others nothing inside matters.
KNOWN: dict[str, str] = {
    "robot": "@name @version @xmlns @xsi:schemaLocation @xsi:noNamespaceSchemaLocation",
    "link": "@name @type @sensor visual collision sensor material audio_source collision_checking "
            "self_collision_checking self_filter surface",
    "link/inertial": "",
    "link/inertial/origin": "@xyz @rpy @quat_xyzw",
    "link/inertial/mass": "@value",
    "link/inertial/inertia": "@ixx @ixy @ixz @iyy @iyz @izz",
    "link/contact": "lateral_friction rolling_friction spinning_friction friction_anchor contact_cfm "
                    "contact_erp contact_stiffness contact_damping stiffness damping restitution",
    "joint": "@name @type @independent @dont_collapse origin axis mimic drake:mimic calibration "
             f"safety_controller safety sensor {_ROTOR}",
    "joint/parent": "@link",
    "joint/child": "@link",
    "joint/limit": "@lower @upper @velocity @effort @acceleration @deceleration @jerk @drake:acceleration "
                   "@drake:jerk @command_effort @current @gear_velocity",
    "joint/dynamics": "@damping @friction @rotor_inertia @armature @stiffness @spring_stiffness "
                      "@spring_mount @spring_reference",
    "drake:joint": "@name @type origin axis mimic drake:mimic calibration safety_controller "
                   f"drake:screw_thread_pitch {_ROTOR}",
    "drake:joint/parent": "@link",
    "drake:joint/child": "@link",
    "drake:joint/limit": "@lower @upper @velocity @effort @drake:acceleration @drake:jerk",
    "drake:joint/dynamics": "@damping @friction @stiffness @spring_stiffness @spring_mount "
                            "@spring_reference",
    "transmission": "@name @type type plugin hardwareInterface motorTorqueConstant "
                    f"use_simulated_gripper_joint mechanical_reduction {_ROTOR}",
    "transmission/joint": f"@name {_HARDWARE} mechanical_reduction {_ROTOR}",
    "transmission/flexJoint": f"@name @mechanicalReduction {_ROTOR}",
    "transmission/rollJoint": f"@name @mechanicalReduction {_ROTOR}",
    "transmission/leftActuator": "@name @mechanicalReduction",
    "transmission/rightActuator": "@name @mechanicalReduction",
    "transmission/actuator": f"@name {_HARDWARE} mechanical_reduction {_ROTOR}",
    "gazebo": "@reference joint frame self_collide allow_auto_disable "  # of the whole robot
              "kp kd mu mu1 mu2 fdir1 maxVel minDepth maxContacts max_contacts laserRetro selfCollide "
              "material visual collision sensor light projector audio_source audio_sink must_be_base_link "
              "stopCfm stopErp stopKp stopKd provideFeedback implicitSpringDamper cfmDamping fudgeFactor "
              "initialJointPosition disableFixedJointLumping preserveFixedJoint springStiffness "
              "springReference canonicalBody genTexCoord initial_joint_position",
    "gazebo/joint": "@name @type parent child pose sensor gearbox_ratio gearbox_reference_body "
                    "thread_pitch screw_thread_pitch",
    "gazebo/joint/axis": "xyz limit initial_position use_parent_model_frame",
    "gazebo/joint/axis/dynamics": "damping friction spring_stiffness spring_reference",
    "gazebo/joint/axis2": "xyz limit initial_position use_parent_model_frame",
    "gazebo/joint/axis2/dynamics": "damping friction spring_stiffness spring_reference",
    "gazebo/joint/physics": _SOLVER,
    "gazebo/joint/physics/ode": _SOLVER,
    "gazebo/joint/physics/ode/limit": "cfm erp",
    "gazebo/joint/physics/simbody": _SOLVER,
    "gazebo/physics": _SOLVER,
    "gazebo/physics/ode": _SOLVER,
    "gazebo/physics/ode/limit": "cfm erp",
    "gazebo/physics/simbody": _SOLVER,
    "ros2_control": "@name @type @rw_rate @is_async @thread_priority hardware sensor gpio",
    "ros2_control/joint": "@name @mimic command_interface state_interface param limits properties",
    "ros2_control/transmission": "@name plugin",
    "ros2_control/transmission/joint": "@name @role role mechanicalReduction mechanical_reduction offset",
    "ros2_control/transmission/actuator": "@name @role role mechanicalReduction mechanical_reduction offset",
    "mujoco": "size",
    "mujoco/compiler": "@meshdir @assetdir @texturedir @strippath @discardvisual @convexhull @fusestatic "
                       "@usethread @saveinertial @autolimits @angle @eulerseq @coordinate @alignfree "
                       "@fitaabb @conflict @passthrough",
    "mujoco/option": "@timestep @integrator @solver @iterations @tolerance @cone @jacobian @impratio "
                     "@ls_iterations @ls_tolerance @noslip_iterations @noslip_tolerance @ccd_iterations "
                     "@ccd_tolerance @sdf_iterations @sdf_initpoints @apirate @collision @o_margin "
                     "@o_solref @o_solimp @o_friction @magnetic",
}  # fmt: skip

_WORDS = {place: frozenset(words.split()) for place, words in KNOWN.items()}

#: Beginnings of elements of old Gazebo that measure and control.
OLD_GAZEBO = ("sensor:", "controller:")

#: Texts of elements that change nothing, beside zero, "false" and none.
NEUTRAL = {"gravity": ("true", "1"), "mechanical_reduction": ("1", "1.0")}

#: Notes by their text: the place of the first element, and the names of those that it concerns.
Dropped = dict[str, tuple[str, list[str]]]


def dropped(root: XmlNode) -> list[str]:
    """Return what of a URDF is not read though an engine may compute with it, as notes.

    Args:
        root: The element `<robot>`; its unknown children are left to `loop_signs.refuse_unread_loops`.
    """
    found: Dropped = {}
    _attributes(root, "robot", found)
    for top in root.children():
        if top.tag in KNOWN:
            _look(top, top.tag, found)
        elif top.tag == "plugin":
            _plugin(top, found)
    return [
        f"{where}: {text.replace('{}', listed(dict.fromkeys(names)))}"
        for text, (where, names) in found.items()
    ]


def _look(node: XmlNode, place: str, found: Dropped) -> None:
    """Add what is dropped of an element and of all in it."""
    _attributes(node, place, found)
    known = _WORDS[place]
    for child in node.children():
        tag = child.tag
        if (inside := f"{place}/{tag}") in KNOWN:
            _look(child, inside, found)
        elif tag == "plugin" and "plugin" not in known:
            _plugin(child, found)
        elif tag not in known and not tag.startswith(OLD_GAZEBO) and not _is_neutral(child):
            _add(f"<{tag}> in <{node.tag}>", child, found)


def _attributes(node: XmlNode, place: str, found: Dropped) -> None:
    """Add the attributes of an element that are dropped."""
    known = _WORDS[place]
    for name in node.attrib:
        word = str(name).rpartition("}")[2]
        if f"@{word}" in known or word.startswith(("xmlns", "xml:")):
            continue
        if not _is_zero(str(node.attrib.get(name))):
            _add(f"{word}= in <{node.tag}>", node, found)


def _plugin(node: XmlNode, found: Dropped) -> None:
    """Add a plugin, unless it is read, or its name says that it exerts no force of its own."""
    model = str(node.xml.getroottree().getroot().get("name", "")).strip()
    if not (is_harmless(node) or is_read(node, model)):
        _add(f"the plugin '{name_of(node)}'", node, found)


def _add(what: str, node: XmlNode, found: Dropped) -> None:
    file, line = node.place
    found.setdefault(f"{DROPS} {what} of {{}}; {NOTHING}, as in urdfdom", (f"{file}:{line}", []))[1].append(
        _owner(node)
    )


def _owner(node: XmlNode) -> str:
    """Return the name of an element, or of what it is in or about."""
    around = [xml for xml in (node.xml, *node.xml.iterancestors()) if xml.tag != "plugin"]
    names = (xml.get("reference") or xml.get("name") for xml in around)
    return str(next(filter(None, names), node.tag))[:80]


def _is_neutral(node: XmlNode) -> bool:
    """Return whether an element says that nothing changes."""
    text = node.content().lower()
    if node.tag in NEUTRAL:
        return text in NEUTRAL[node.tag]
    return bool(text) and not len(node.xml) and not node.attrib and _is_zero(text)


def _is_zero(text: str) -> bool:
    """Return whether a text is empty, false, or zeros."""
    words = text.lower().split()
    return all(word == "false" or re.fullmatch(r"[+-]?0*\.?0*(e[+-]?\d+)?", word) for word in words)
