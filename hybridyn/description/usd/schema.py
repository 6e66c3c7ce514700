"""Schemas, types and attributes of USD: what is read, noted or refused. It knows no OpenUSD.

Schemas and types of physics that are not known here are refused: nothing is dropped in silence.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from ...joints.kinds import JointKind
from ..joint_words import called
from ..rows import Row, names_in

if TYPE_CHECKING:
    pass

#: Schema of rigid bodies.
BODY = "PhysicsRigidBodyAPI"

#: Largest deviation of axes from right angles, and of scales from 1, that is rounding: transforms of many
#: files pass through single precision (6e-8) a few times.
SINGLE_PRECISION = 1e-5

#: Angles between the unit of a file and radians.
DEGREES = math.pi / 180

#: Axes of a generic joint, in the order in which a chain of joints moves along them.
AXES = ("transX", "transY", "transZ", "rotX", "rotY", "rotZ")

#: Kinds of joints by their types.
KINDS = {f"Physics{word}Joint": joint.chain[0] for word, joint in called("usd").items()}

#: Types of joints with one axis: how its name in `AXES` begins, and its name in schemas of several axes.
ONE_AXIS = {
    word: ("trans", "linear") if kind.slides else ("rot", "angular")
    for word, kind in KINDS.items() if kind.single
}  # fmt: skip

#: The type of a joint that states its axes, and the types of joints that are read.
GENERIC = "PhysicsJoint"
JOINTS = (*KINDS, GENERIC)

#: What a joint states about an axis, as numbers of `records.Joint`. "{}" in an attribute is the axis. Several
#: engines have attributes of their own.
NUMBERS = {
    "velocity": Row(math.inf, 0.0, math.inf, {
        "physxJointAxis:{}:maxJointVelocity": "speed", "physxJoint:maxJointVelocity": "speed",
    }),
    "effort": Row(math.inf, 0.0, math.inf, {"drive:{}:physics:maxForce": "effort"}),
    "rotor_inertia": Row(least=0.0, names={
        "physxJointAxis:{}:armature": "inertia", "physxJoint:armature": "inertia",
        "newton:armature": "inertia", "mjc:armature": "inertia",
    }),
    "friction": Row(least=0.0, names={
        "physxJointAxis:{}:dynamicFrictionEffort": "effort", "physxJoint:jointFriction": "effort",
        "newton:friction": "effort", "mjc:frictionloss": "effort",
    }),
    "damping": Row(least=0.0, names={
        "physxJointAxis:{}:viscousFrictionCoefficient": "effort at speed",
        "newton:damping": "effort at speed", "mjc:damping": "effort at one radian or metre a second",
    }),
}  # fmt: skip


def free_axes(kind: JointKind) -> tuple[str, ...]:
    """Return the axes along which a joint moves, some of `AXES`; its own axis is z."""
    return tuple(AXES[at] for at in kind.columns)


#: Beginnings of names of schemas and types of physics, and of attributes: of USD, PhysX, Newton and MuJoCo.
PHYSICS = ("Physics", "Physx", "Newton", "Mjc")
SPACES = ("physics:", "physx", "newton:", "mjc:", "mujoco:")

#: Types that are read.
TYPES = {*JOINTS, "PhysicsScene", "PhysicsCollisionGroup"}

#: Types that are left out, and what is noted.
NOTED = {
    "MjcActuator": "of actuators only the joints that they drive are read: {}",
    "NewtonActuator": "actuators are not read: {}",
    "MjcKeyframe": "keyframes are not read: {}",
}

#: Parts of the names of schemas and types of what may lie beside a robot, and what is noted.
BESIDE = dict.fromkeys(("Deformable", "Particle"), "deformable bodies and particles are not read: {}")

#: Schemas that are read, or that concern contacts, drawing and solvers alone.
SCHEMAS = {
    "PhysicsRigidBodyAPI", "PhysicsMassAPI", "PhysicsArticulationRootAPI", "PhysicsDriveAPI",
    "PhysicsLimitAPI", "PhysicsFilteredPairsAPI", "PhysicsJointStateAPI", "PhysxJointStateAPI",
    "PhysxRigidBodyAPI", "PhysxArticulationAPI", "PhysxJointAPI", "PhysxJointAxisAPI", "PhysxLimitAPI",
    "PhysxMimicJointAPI", "NewtonMimicAPI", "NewtonArticulationRootAPI", "NewtonMassAPI", "NewtonJointAPI",
    "NewtonSiteAPI", "MjcJointAPI", "MjcSiteAPI", "MjcImageableAPI", "MjcEqualityAPI", "MjcEqualityJointAPI",
    "MjcEqualityConnectAPI", "MjcEqualityWeldAPI", "PhysxDrivePerformanceEnvelopeAPI",
}  # fmt: skip

#: Parts of the names of schemas that concern contacts and solvers.
OF_CONTACTS = ("Collision", "Scene", "Material", "Report", "Trigger", "Cooked")

#: Attributes that change the motion: the values that do not ("{}" in a name is an axis), and the correction.
NEUTRAL: dict[str, tuple[tuple[float, ...], str]] = {
    "physics:breakForce": ((math.inf,), "joints do not break here; remove it"),
    "physics:breakTorque": ((math.inf,), "joints do not break here; remove it"),
    "physxRigidBody:linearDamping": ((0,), "set it to 0, or put friction on the joints"),
    "physxRigidBody:enableGyroscopicForces": ((1,), "set it to true"),
    "physxRigidBody:lockedPosAxis": ((0,), "set it to 0, and write a joint"),
    "physxRigidBody:lockedRotAxis": ((0,), "set it to 0, and write a joint"),
    "newton:inertia": ((), "author physics:diagonalInertia"),
    "newton:massModel": ((), "author physics:diagonalInertia"),
    **dict.fromkeys(
        (
            "newton:springStiffness", "newton:springDamping", "newton:stiffness",
            "mjc:stiffness", "mjc:springdamper",
        ),
        ((0,), "set it to 0; springs may stand in model.toml"),
    ),
}  # fmt: skip

#: Attributes that are left out: the values that change nothing, and what is noted of the prims with others.
IGNORED: dict[str, tuple[tuple[float | str, ...], str]] = {
    "physxRigidBody:angularDamping":
        ((0,), "drops physxRigidBody:angularDamping of {}, which holds bodies back in PhysX alone"),
    "physxJointAxis:{}:staticFrictionEffort":
        ((0,), "drops the static friction of {}: dry friction is that of sliding, dynamicFrictionEffort"),
    **dict.fromkeys(
        (
            "mjc:compiler:balanceInertia", "mjc:compiler:boundMass", "mjc:compiler:boundInertia",
            "mjc:compiler:inertiaFromGeom",
        ),
        ((0, "auto", "false"), "drops the changes that MuJoCo's compiler makes to masses, of {}"),
    ),
    "mjc:compiler:setTotalMass":
        ((-1, 0), "drops the changes that MuJoCo's compiler makes to masses, of {}"),
    **dict.fromkeys(
        ("physxLimit:{}:stiffness", "physxLimit:{}:damping"),
        ((0,), "stiffness and damping of the stops of {} are not read (the effect stop has them)"),
    ),
    **dict.fromkeys(
        ("mjc:option:density", "mjc:option:viscosity"),
        ((0,), "drops the forces of the fluid around the robot, of {}"),
    ),
    **dict.fromkeys(
        ("physics:velocity", "physics:angularVelocity"), ((0,), "velocities at the start are not read: {}")
    ),
    **dict.fromkeys(
        ("physics:coneAngle0Limit", "physics:coneAngle1Limit"),
        ((-1, math.inf), "limits of spherical joints are not read: {}"),
    ),
    **dict.fromkeys(
        ("drive:{}:physics:stiffness", "drive:{}:physics:damping"),
        ((0,), "drives of {} have stiffness or damping, which are not read: motor efforts are inputs of the "
         "models"),
    ),
    "physxMimicJoint:{}:naturalFrequency":
        ((0,), "{} are compliant mimics in PhysX (naturalFrequency); they are read as rigid"),
}  # fmt: skip

#: Attributes of joints and bodies that are read, or that concern contacts, solvers and drawing alone.
READ = (
    "physics:body", "physics:local", "physics:axis", "physics:lowerLimit", "physics:upperLimit",
    "physics:jointEnabled", "physics:collisionEnabled", "physics:excludeFromArticulation", "physics:break",
    "physics:mass", "physics:density", "physics:centerOfMass", "physics:diagonalInertia",
    "physics:principalAxes", "physics:rigidBodyEnabled", "physics:kinematicEnabled",
    "physics:simulationOwner", "physics:startsAsleep", "physics:approximation", "physics:coneAngle",
    "physics:velocity", "physics:angularVelocity", "physxJoint:enable", "physxMimicJoint:",
    "newton:mimic", "newton:jointsAddMobility", "mjc:coef", "mjc:gravcomp",
    "physxRigidBody:disableGravity", *names_in(NUMBERS),
    "newton:selfCollision", "physxArticulation:", "physxCollision", "physxConvex",
    "physxTriangle", "physxSDF", "physxLimit:", "physxRigidBody:sleep", "physxRigidBody:solver",
    "physxRigidBody:max", "physxRigidBody:stabilization", "physxRigidBody:enable", "physxRigidBody:cfm",
)  # fmt: skip

#: Schemas that attributes need, by the beginning of their names; USD leaves out those without their schema.
NEEDS = {
    "drive:": "PhysicsDriveAPI", "limit:": "PhysicsLimitAPI", "physxMimicJoint:": "PhysxMimicJointAPI",
    **dict.fromkeys(
        (
            "physics:mass", "physics:density", "physics:centerOfMass", "physics:diagonalInertia",
            "physics:principalAxes",
        ),
        "PhysicsMassAPI",
    ),
}  # fmt: skip

#: What is told of types, schemas and attributes that are not read, by a part of their names.
MENDS = {
    "Mimic": "PhysxMimicJointAPI and NewtonMimicAPI are read",
    "Gear": "couple the two joints by PhysxMimicJointAPI",
    "RackAndPinion": "couple the two joints by PhysxMimicJointAPI",
    "Tendon": "couple the joints by PhysxMimicJointAPI",
    "DistanceJoint": "write two spherical joints with a rod between them",
    "": "remove it if the motion needs it not",
}
