"""Refuse what changes the motion of a USD robot and has no place in the records; note what does not.

Schemas and types of physics that are not known here are refused: nothing is dropped in silence.
"""

from __future__ import annotations

import numpy as np

from ..names import listed
from .stage import Prim, Stage

#: Beginnings of names of schemas and types of physics: of USD, PhysX, Newton and MuJoCo.
PHYSICS = ("Physics", "Physx", "Newton", "Mjc")

#: Types that are read.
TYPES = {
    "PhysicsScene", "PhysicsCollisionGroup", "PhysicsJoint", "PhysicsFixedJoint", "PhysicsRevoluteJoint",
    "PhysicsPrismaticJoint", "PhysicsSphericalJoint", "PhysicsDistanceJoint",
}  # fmt: skip

#: Types that are left out with a note.
NOTED = {
    "MjcActuator": "of actuators only the joints that they drive are read",
    "NewtonActuator": "actuators are not read",
    "MjcKeyframe": "keyframes are not read",
}

#: Parts of the names of schemas and types of what may lie beside a robot.
BESIDE = ("Deformable", "Particle")

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

#: Attributes that change the motion, with the value that does not, and the correction.
NEUTRAL: dict[str, tuple[float, str]] = {
    "physxRigidBody:disableGravity": (0, "set it to false, or set gravity of the whole robot"),
    "physxRigidBody:linearDamping": (0, "set it to 0, or put friction on the joints"),
    "physxRigidBody:enableGyroscopicForces": (1, "set it to true"),
    "physxRigidBody:lockedPosAxis": (0, "set it to 0, and write a joint"),
    "physxRigidBody:lockedRotAxis": (0, "set it to 0, and write a joint"),
    "newton:jointsAddMobility": (0, "set it to false, and write bodies between the joints"),
    **dict.fromkeys(
        (
            "newton:damping", "newton:springStiffness", "newton:springDamping", "newton:stiffness",
            "mjc:stiffness", "mjc:springdamper", "mjc:gravcomp",
        ),
        (0, "set it to 0; springs may stand in model.toml"),
    ),
}  # fmt: skip

#: Damping of bodies that PhysX has by default, and that converters write.
DAMPING = "physxRigidBody:angularDamping"

#: Attributes of MuJoCo's scene that drag bodies.
FLUID = ("mjc:option:density", "mjc:option:viscosity")

#: Attributes of joints and bodies that are read, or that concern contacts, solvers and drawing alone.
READ = (
    "physics:body", "physics:local", "physics:axis", "physics:lowerLimit", "physics:upperLimit",
    "physics:jointEnabled", "physics:collisionEnabled", "physics:excludeFromArticulation", "physics:break",
    "physics:mass", "physics:density", "physics:centerOfMass", "physics:diagonalInertia",
    "physics:principalAxes", "physics:rigidBodyEnabled", "physics:kinematicEnabled",
    "physics:simulationOwner", "physics:startsAsleep", "physics:approximation", "physics:coneAngle",
    "physics:velocity", "physics:angularVelocity", "physxJoint:", "physxJointAxis:", "physxMimicJoint:",
    "newton:mimic", "newton:armature", "newton:friction", "mjc:armature", "mjc:damping", "mjc:frictionloss",
    "mjc:coef", "newton:selfCollision", "physxArticulation:", "physxCollision", "physxConvex",
    "physxTriangle", "physxSDF", "physxLimit:", "physxRigidBody:sleep", "physxRigidBody:solver",
    "physxRigidBody:max", "physxRigidBody:stabilization", "physxRigidBody:enable", "physxRigidBody:cfm",
)  # fmt: skip

#: Schemas of several instances, by the beginning of the names of their attributes.
SPACES = {"drive": "PhysicsDriveAPI", "limit": "PhysicsLimitAPI", "physxMimicJoint": "PhysxMimicJointAPI"}

#: Attributes of PhysicsMassAPI.
MASSES = (
    "physics:mass", "physics:density", "physics:centerOfMass", "physics:diagonalInertia",
    "physics:principalAxes",
)  # fmt: skip


def screen(stage: Stage, notes: list[str]) -> None:
    """Refuse what cannot be read.

    Args:
        notes: Remarks for the user, to which unread attributes are added.

    Raises:
        ModelError: A prim has a type, a schema or an attribute that changes the motion and is not read.
    """
    unread: dict[str, None] = {}
    noted: dict[str, list[str]] = {}
    for prim in stage.prims.values():
        names = [prim.kind, *prim.schemas]
        if prim.kind in NOTED:
            noted.setdefault(NOTED[prim.kind], []).append(prim.path)
            continue
        if any(part in name for part in BESIDE for name in names) and not _in_body(prim):
            noted.setdefault("deformable bodies and particles are not read", []).append(prim.path)
            continue
        if prim.kind.startswith(PHYSICS) and prim.kind not in TYPES:
            raise prim.error(_advice(f"a {prim.kind}"))
        for schema in prim.schemas:
            name = schema.partition(":")[0]
            known = name in SCHEMAS or any(part in name for part in OF_CONTACTS)
            if name.startswith(PHYSICS) and not known:
                raise prim.error(_advice(f"schema {schema}"))
        for name, (neutral, correction) in NEUTRAL.items():
            if prim.states(name) and np.any(np.not_equal(prim.values[name], neutral)):
                raise prim.error(f"'{name}' = {prim.values[name]} is not read; {correction}")
        if prim.states(DAMPING) and prim.number(DAMPING, 0.0):
            noted.setdefault(f"{DAMPING}, which holds bodies back in PhysX alone, is not read", []).append(
                prim.path
            )
        if any(prim.values.get(name) for name in FLUID):
            noted.setdefault("the fluid around the robot is not read", []).append(prim.path)
        unread |= dict.fromkeys(_unread(prim))
    notes += [f"{reason}: {listed(paths)}" for reason, paths in noted.items()]
    if unread:
        notes.append(f"attributes that other engines may use are not read: {listed(unread)}")


def _in_body(prim: Prim | None) -> bool:
    """Return whether a prim is part of a rigid body."""
    while prim is not None and not prim.has("PhysicsRigidBodyAPI"):
        prim = prim.parent
    return prim is not None


def _advice(what: str) -> str:
    mend = {
        "Mimic": "PhysxMimicJointAPI and NewtonMimicAPI are read",
        "Gear": "couple the two joints by PhysxMimicJointAPI",
        "RackAndPinion": "couple the two joints by PhysxMimicJointAPI",
        "Tendon": "couple the joints by PhysxMimicJointAPI",
    }
    advice = next(
        (text for word, text in mend.items() if word in what), "remove it if the motion needs it not"
    )
    return f"{what} is not read; {advice}"


def _unread(prim: Prim) -> list[str]:
    """Return the names of attributes of joints and bodies that are neither read nor known to be harmless.

    Attributes of schemas that are not applied are not read, since USD leaves them out.
    """
    if not (
        prim.has("PhysicsRigidBodyAPI") or prim.kind in TYPES - {"PhysicsScene", "PhysicsCollisionGroup"}
    ):
        return []
    spaces = ("physics:", "physx", "newton:", "mjc:", "mujoco:")
    names = [*prim.values, *prim.animated]
    out = [
        name for name in names
        if name.startswith(spaces) and not name.startswith(READ) and name not in (*NEUTRAL, DAMPING)
    ]  # fmt: skip
    applied = {*prim.schemas, *(["PhysicsMassAPI"] if prim.has("NewtonMassAPI") else [])}
    return out + [name for name in names if (schema := _schema_of(name)) and schema not in applied]


def _schema_of(name: str) -> str:
    """Return the schema that an attribute needs, "" for none of those that hybridyn reads."""
    space, _, rest = name.partition(":")
    if space in SPACES and rest:
        return f"{SPACES[space]}:{rest.partition(':')[0]}"
    return "PhysicsMassAPI" if name in MASSES else ""
