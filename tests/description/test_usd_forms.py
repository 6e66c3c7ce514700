"""Every row of the table of USD forms on the page, as files: read, noted or refused as the row says."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hybridyn.description import read
from tests.description.reading import holds, refused, rows_of_page
from tests.description.test_usd_refusals import HELD, TRANS, d6, hinged, hinted, placed
from tests.description.usd_texts import DRIVE, at, body, joint, prim, usda
from tests.support.extras import needs
from tests.support.files import save

needs("usd")

A, B = body("a"), body("b", at="1, 0, 0")
SHAPE = prim("Cube", "shape", schemas=("PhysicsCollisionAPI",))
MIMIC = ("PhysxMimicJointAPI:rotZ", "NewtonMimicAPI", "MjcEqualityJointAPI")


def pair(*content: str, schemas: tuple[str, ...] = ()) -> str:
    """Return two hinges in a row, with content of the second one."""
    return usda(A, B, HELD, joint("Revolute", "k", "a", "b", *content, schemas=schemas))


def joined(kind: str, *content: str, schemas: tuple[str, ...] = ()) -> str:
    """Return two bodies on hinges, which a joint joins, too."""
    return usda(
        A, B, HELD, joint("Revolute", "k", "", "b", at(0, "1, 0, 0")),
        joint(kind, "g", "a", "b", at(0, "1, 0, 0"), *content, schemas=schemas),
    )  # fmt: skip


def bodied(*content: str, bar: bool = True) -> str:
    """Return a body on a hinge."""
    return usda(body("a", *content, bar=bar), HELD)


WELD = usda(A, B, HELD, joint("Fixed", "k", "a", "b", at(0, "1, 0, 0")))
CUT = "bool physics:excludeFromArticulation = true"
#: By the row's first cell, files: what a read robot has, or words of the note or of the error.
ROWS: dict[str, list[tuple[str, Any]]] = {
    "revolute, prismatic, spherical and fixed joints": [
        (usda(A, joint(kind, "j", "", "a")), {"joints": {"j": {"kind": name}}})
        for kind, name in (
            ("Revolute", "revolute"), ("Prismatic", "prismatic"), ("Spherical", "spherical"),
        )
    ] + [(WELD, {"joints": {"k": {"kind": "fixed"}}})],
    "`PhysicsJoint` with one free rotation at most, or three": [
        (
            usda(A, B, HELD, d6("transX", "transY", "rotX", "rotY")),
            {"joints": {"g_transZ": {}, "g_rotZ": {}}},
        )
    ],
    "`PhysicsJoint` with two free rotations": [
        (usda(A, B, HELD, d6(*TRANS, "rotX")), "one rotation is locked and two are free"),
    ],
    '`customData` with `dofs = "universal"`, `"cylindrical"`, `"cartesian"`': [
        (usda(A, B, HELD, hinted("universal", *TRANS)), {"joints": {"g_rotX": {}, "g_rotY": {}}}),
        (usda(A, B, HELD, hinted("cylindrical", "transY")), {"joints": {"g_transX": {}, "g_rotX": {}}}),
    ],
    "`physics:excludeFromArticulation`, joints that close loops": [
        (joined("Spherical", CUT), {"closures": [{"name": "g", "rotation": "free"}]}),
    ],
    "distance joints, axes that are locked away from zero": [
        (usda(A, joint("Distance", "j", "", "a")), "PhysicsDistanceJoint is not read"),
    ],
    "`physics:jointEnabled = false`": [(pair("bool physics:jointEnabled = false"), "it is not read")],
    "`PhysicsDriveAPI`, `MjcActuator`": [
        (pair("float drive:angular:physics:maxForce = 5", schemas=(DRIVE,)), {"motors": ("k",)}),
        (usda(A, HELD, prim("MjcActuator", "m", "rel mjc:target = </robot/j>")), {"motors": ("j",)}),
    ],
    "stiffness and damping of drives; drives of balls": [
        (pair("float drive:angular:physics:stiffness = 5", schemas=(DRIVE,)), "drives of '/robot/k' have"),
        (
            usda(A, joint("Spherical", "j", "", "a", schemas=("PhysicsDriveAPI:rotX",))),
            "its drive is no motor here",
        ),
    ],
    "limits of position, speed and effort": [
        (
            pair("float physics:lowerLimit = -90", "float physxJoint:maxJointVelocity = 180"),
            {"joints": {"k": {"lower": -np.pi / 2, "velocity": np.pi}}},
        )
    ],
    "limits of spherical joints and of closures; stiffness of stops": [
        (
            usda(A, joint("Spherical", "j", "", "a", "float physics:coneAngle0Limit = 30")),
            "limits of spherical",
        )
    ],
    "`PhysicsJointStateAPI` of balls and closures": [
        (
            joined(
                "Revolute", CUT, "float state:angular:physics:position = 9",
                schemas=("PhysicsJointStateAPI:angular",),
            ),
            "positions at the start of balls",
        ),
        (
            usda(A, joint("Spherical", "j", "", "a", "float state:rotX:physics:position = 9",
                          schemas=("PhysicsJointStateAPI:rotX",))),
            "positions at the start of balls",
        ),
        (joined("Revolute", CUT, "float physxJoint:maxJointVelocity = 9"), "limits of speed of joints that"),
    ],
    "`PhysicsJointStateAPI`": [
        (
            pair("float state:angular:physics:position = 90", schemas=("PhysicsJointStateAPI:angular",)),
            {"home": {"k": (np.pi / 2,)}},
        )
    ],
    "mass, centre of mass and inertia of bodies": [(bodied(), {"links": {"a": {"mass": 1}}})],
    "mass that follows from shapes": [(bodied(SHAPE, bar=False), "would follow from its colliders")],
    "bodies without mass": [
        (usda(A, body("b", bar=False), HELD, joint("Fixed", "k", "a", "b")), "state no mass"),
    ],
    "kinematic and disabled bodies": [
        (usda(A, HELD, body("b", "bool physics:kinematicEnabled = true")), "are kinematic or disabled"),
    ],
    "`PhysicsScene`": [
        (
            usda(A, HELD, prim("PhysicsScene", "s", "float physics:gravityMagnitude = 2")),
            {"gravity": (0, 0, -2)},
        )
    ],
    "armature, dry friction and damping of PhysX, Newton and MuJoCo, of balls too": [
        (pair(f"float {name} = 2"), {"joints": {"k": {what: 2}}})
        for name, what in (
            ("physxJoint:armature", "rotor_inertia"), ("newton:armature", "rotor_inertia"),
            ("mjc:armature", "rotor_inertia"), ("physxJoint:jointFriction", "friction"),
            ("newton:friction", "friction"), ("mjc:frictionloss", "friction"), ("mjc:damping", "damping"),
        )
    ],
    "numbers of one engine beside other ones of another": [
        (pair("float newton:armature = 2", "float mjc:armature = 3"), "another engine states other ones"),
    ],
    "static friction, angular damping": [
        (bodied("float physxRigidBody:angularDamping = 2"), "which holds bodies back in PhysX alone"),
        (
            pair("float physxJointAxis:angular:staticFrictionEffort = 2",
                 schemas=("PhysxJointAxisAPI:angular",)),
            "drops the static friction",
        ),
    ],
    "`physxRigidBody:linearDamping`, `enableGyroscopicForces = false`, locked axes of bodies": [
        (bodied("float physxRigidBody:linearDamping = .05"), "put friction on the joints"),
    ],
    "`physxRigidBody:disableGravity`, `mjc:gravcomp`": [
        (bodied("bool physxRigidBody:disableGravity = true"), {"a": 1.0}),
        (bodied("double mjc:gravcomp = 0.5"), {"a": 0.5}),
    ],
    "`PhysxMimicJointAPI`, `NewtonMimicAPI`, `MjcEqualityJointAPI` of any order": [
        (
            pair("rel physxMimicJoint:rotZ:referenceJoint = </robot/j>", schemas=MIMIC[:1]),
            {"couplings": [{"terms": (("k", 1.0), ("j", 1.0))}]},
        ),
        (pair("rel newton:mimicJoint = </robot/j>", schemas=MIMIC[1:2]), {"couplings": [{"name": "k"}]}),
        (
            pair("rel mjc:target = </robot/j>", "double mjc:coef4 = 2", schemas=MIMIC[2:]),
            {"couplings": [{"curve": {"coefficients": (0, 0, -2)}}]},
        ),
    ],
    "couplings that differ between engines": [
        (
            pair("rel physxMimicJoint:rotZ:referenceJoint = </robot/j>",
                 "float physxMimicJoint:rotZ:gearing = 3",
                 "rel newton:mimicJoint = </robot/j>", schemas=MIMIC[:2]),
            "couples it otherwise than",
        )
    ],
    "compliant mimics (`naturalFrequency`)": [
        (
            pair("rel physxMimicJoint:rotZ:referenceJoint = </robot/j>",
                 "float physxMimicJoint:rotZ:naturalFrequency = 3", schemas=MIMIC[:1]),
            "are compliant mimics",
        )
    ],
    "`MjcEqualityConnectAPI`, `MjcEqualityWeldAPI`": [
        (joined("Spherical", CUT, schemas=("MjcEqualityConnectAPI",)), {"closures": [{"rotation": "free"}]}),
        (joined("Fixed", CUT, schemas=("MjcEqualityWeldAPI",)), {"closures": [{"rotation": "fixed"}]}),
    ],
    "gears, racks, tendons": [
        (usda(A, HELD, prim("PhysxPhysicsGearJoint", "g")), "PhysxPhysicsGearJoint is not read"),
        (hinged(schemas=("PhysxTendonAxisAPI:t",)), "PhysxTendonAxisAPI:t is not"),
    ],
    "springs of joints of MuJoCo and Newton; `physics:breakForce`": [
        (hinged("double mjc:stiffness = 3"), "mjc:stiffness' = 3"),
        (hinged("float newton:springStiffness = 3"), "newton:springStiffness"),
        (hinged("float physics:breakForce = 3"), "joints do not break"),
    ],
    "contacts, velocities at the start, keyframes": [
        (
            usda(body("a", SHAPE), body("b", SHAPE, at="1, 0, 0"), HELD, joint("Fixed", "k", "a", "b")),
            "contacts",
        ),
        (bodied("vector3f physics:velocity = (1, 0, 0)"), "velocities at the start"),
        (usda(A, HELD, prim("MjcKeyframe", "home")), "keyframes are not read"),
    ],
    "soft bodies and particles beside the robot": [
        (
            usda(A, HELD, prim("Mesh", "s", schemas=("PhysxDeformableBodyAPI",))),
            "deformable bodies and particles",
        )
    ],
    "fluids, changes of MuJoCo's compiler to masses": [
        (usda(A, HELD, prim("PhysicsScene", "s", "double mjc:option:density = 1.2")), "forces of the fluid"),
    ],
    "other types and schemas of physics": [
        (usda(A, HELD, prim("MjcTendon", "t")), "a MjcTendon is not read"),
    ],
    "other attributes of engines; attributes whose schema is not applied": [
        (pair("float physxJoint:other = 1"), "'physxJoint:other'"),
        (pair("float drive:angular:physics:maxForce = 5"), "'drive:angular:physics:maxForce'"),
    ],
    "time samples, shear, mirrors": [
        (usda(body("a", placed("float3 xformOp:scale = (1, -1, 1)")), HELD), "its transform mirrors"),
    ],
}  # fmt: skip


def test_each_row_of_the_page_has_its_files() -> None:
    rows = rows_of_page("USD form by form")
    assert [*rows] == [*ROWS]
    assert {*rows.values()} == {"read", "noted", "dropped", "refused"}


@pytest.mark.parametrize("form", ROWS)
def test_a_form_is_as_its_row_says(form: str, tmp_path: Path) -> None:
    what = rows_of_page("USD form by form")[form]
    for text, expected in ROWS[form]:
        file = save(tmp_path, text, "robot.usda")
        if what == "refused":
            refused(file, expected)
            continue
        robot = read(file)
        if what == "read" and "gravcomp" in form:
            assert dict(robot.effects) == {"gravity_compensation": {"fraction": expected}}
        elif what == "read":
            holds(robot, expected)
        else:
            (note,) = [note for note in robot.notes if expected in note]
            assert ("drops" in note) == (what == "dropped")
