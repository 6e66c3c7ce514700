"""What hybridyn cannot say of a USD file is refused by name, with the prim's path and the mend."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.description.reading import refused
from tests.description.usd_texts import BODY, at, body, joint, prim, usda
from tests.support.extras import needs
from tests.support.files import save
from tests.support.samples import some

needs("usd")

A, B = body("a"), body("b", at="1, 0, 0")
HELD = joint("Revolute", "j", "", "a")


def d6(*locked: str, extra: str = "") -> str:
    limits = [f"float limit:{axis}:physics:low = 1\nfloat limit:{axis}:physics:high = -1" for axis in locked]
    schemas = tuple(f"PhysicsLimitAPI:{axis}" for axis in locked)
    return joint("", "g", "a", "b", *limits, extra, schemas=schemas)


def hinted(word: str, *locked: str) -> str:
    """Return a generic joint whose customData says what it is."""
    hint = f'"g" (customData = {{ string dofs = "{word}" }}\n  prepend'
    return d6(*locked).replace('"g" (prepend', hint)


def hinged(*content: str, schemas: tuple[str, ...] = ()) -> str:
    return usda(A, joint("Revolute", "j", "", "a", *content, schemas=schemas))


TRANS = ("transX", "transY", "transZ")


def placed(*ops: str) -> str:
    names = ", ".join(f'"{op.split()[1]}"' for op in ops)
    return "\n".join(ops) + f"\nuniform token[] xformOpOrder = [{names}]"


def collider(kind: str, *content: str) -> str:
    return prim(kind, "shape", *content, schemas=("PhysicsCollisionAPI",))


#: The cases of the default suite: one for each module of the reader.
QUICK = (
    "no body", "universal", "missing body", "sheared", "mesh", "gravity", "drag", "gear",
    "mimic of a body", "clips", "PhysicsRigidBodyAPI misspelt", "PhysicsMassAPI misspelt",
)  # fmt: skip

SCENE = prim("PhysicsScene", "t", "float physics:gravityMagnitude = 1")

CASES = {
    "no body": (usda(prim("Xform", "x")), "no prim has PhysicsRigidBodyAPI"),
    "a joint that is a body": (
        hinged(schemas=("PhysicsRigidBodyAPI",)),
        "</robot/j>: a joint is no body; remove PhysicsRigidBodyAPI",
    ),
    "a body without a place": (
        usda(A, HELD, prim("PhysicsScene", "s", schemas=("PhysicsRigidBodyAPI",))),
        "</robot/s>: PhysicsRigidBodyAPI is of prims that have a place, not of a PhysicsScene",
    ),
    "distance": (
        usda(A, joint("Distance", "j", "", "a", "float physics:maxDistance = 2")),
        "</robot/j>: a PhysicsDistanceJoint is not read; write two spherical joints with a rod",
    ),
    "universal": (
        usda(A, B, HELD, d6(*TRANS, "rotX")),
        "</robot/g>: one rotation is locked and two are free",
    ),
    "a universal joint of Kamino whose axis is locked": (
        usda(A, B, HELD, hinted("universal", *TRANS, "rotX")),
        "its axis rotX is locked",
    ),
    "distance axis": (usda(A, B, HELD, d6("distance")), "a limit of 'distance' is not read"),
    "locked away from zero": (
        usda(A, B, HELD, d6(*TRANS, "rotX", "rotY").replace("= 1", "= 2").replace("= -1", "= 2")),
        "locked at 2; lock it at 0",
    ),
    "itself": (usda(A, HELD, joint("Revolute", "k", "a", "a")), "joins </robot/a> to itself"),
    "nothing": (usda(A, HELD, joint("Revolute", "k", "", "")), "two parts of the world"),
    "missing body": (
        usda(A, joint("Revolute", "j", "", "b")),
        "physics:body1 names </robot/b>, which the stage",
    ),
    "limits": (
        hinged("float physics:lowerLimit = 2\nfloat physics:upperLimit = 1"),
        "exchange them",
    ),
    "axis": (hinged('token physics:axis = "W"'), "'W' is none of X, Y, Z"),
    "breaks": (hinged("float physics:breakForce = 3"), "joints do not break"),
    "zero quaternion": (hinged(at(0, "0,0,0", "0,0,0,0")), "zero quaternion"),
    "word for a number": (
        hinged('string physics:lowerLimit = "x"'),
        "is not a number",
    ),
    "value of another type": (
        usda(body("a", 'string physics:centerOfMass = "0"', bar=False), HELD),
        "'physics:centerOfMass' is not a vector",
    ),
    "value that OpenUSD does not understand": (
        usda(body("a", "teyCoord3f physics:velocity = (0.1, 0, 0)"), HELD),
        "'physics:velocity' is neither a number, a text nor a list of them",
    ),
    "up axis": (usda(A, HELD, up="W"), "upAxis 'W' is none of X, Y, Z"),
    "not finite": (hinged(at(0, "nan, 0, 0")), "localPos0' is not finite"),
    "animated": (
        hinged("point3f physics:localPos0.timeSamples = {0: (1,0,0)}"),
        "localPos0' is animated (time samples); give it one default",
    ),
    "animated transform": (
        usda(
            body(
                "a",
                "double3 xformOp:translate.timeSamples = {0: (1,0,0)}\n"
                'uniform token[] xformOpOrder = ["xformOp:translate"]',
            ),
            HELD,
        ),
        "its transform is animated",
    ),
    "step of a transform": (
        usda(body("a", 'uniform token[] xformOpOrder = ["xformOp:translate"]'), HELD),
        "xformOpOrder names 'xformOp:translate', which the prim does not state",
    ),
    "mirrored": (usda(body("a", placed("float3 xformOp:scale = (1, -1, 1)")), HELD), "its transform mirrors"),
    "flat": (usda(body("a", placed("float3 xformOp:scale = (1, 0, 1)")), HELD), "has no inverse"),
    "sheared": (
        usda(
            prim(
                "Xform",
                "up",
                placed("float3 xformOp:scale = (1, 2, 1)"),
                body("a", placed("float xformOp:rotateZ = 30")),
            ),
            joint("Fixed", "j", "", "up/a"),
        ),
        "</robot/up/a>: its transform shears",
    ),
    "negative mass": (usda(body("a", m=-1), HELD), "physics:mass' is negative"),
    "mass without inertia": (
        usda(body("a", "float physics:mass = 2", bar=False), HELD),
        "a mass but no inertia, and has no collider",
    ),
    "density without shape": (
        usda(body("a", "float physics:density = 2", bar=False), HELD),
        "a density but has no collider",
    ),
    "mesh": (
        usda(body("a", collider("Mesh"), bar=False), HELD),
        "</robot/a>: physics:mass and physics:centerOfMass and physics:diagonalInertia would follow from its "
        "colliders (</robot/a/shape>, a Mesh), which is not computed; author",
    ),
    "centre of a collider": (
        usda(
            body(
                "a",
                "float physics:mass = 2\nfloat3 physics:diagonalInertia = (1, 1, 1)",
                collider("Cube"),
                bar=False,
            ),
            HELD,
        ),
        "physics:centerOfMass would follow from its colliders (</robot/a/shape>, a Cube)",
    ),
    "mass of no body": (
        usda(body("a", prim("Xform", "m", schemas=("PhysicsMassAPI",))), HELD),
        "neither a body",
    ),
    "driven axis": (
        hinged(schemas=("PhysicsDriveAPI:rotX",)),
        "PhysicsDriveAPI:rotX drives no axis of this joint: its free axes are angular",
    ),
    "driven weld": (
        usda(A, joint("Fixed", "j", "", "a", schemas=("PhysicsDriveAPI:rotX",))),
        "it has no free axis; remove the drive",
    ),
    "limit of a hinge": (hinged(schemas=("PhysicsLimitAPI:angular",)), "is of PhysicsJoint alone"),
    "gravity": (
        usda(A, HELD, prim("PhysicsScene", "s"), SCENE),
        "</robot/t>: states another gravity than </robot/s>",
    ),
    "drag": (usda(body("a", "float physxRigidBody:linearDamping = .05"), HELD), "put friction on the joints"),
    "muscle of MuJoCo": (hinged("double mjc:stiffness = 3"), "mjc:stiffness' = 3"),
    "gear": (usda(A, HELD, prim("PhysxPhysicsGearJoint", "g")), "PhysxPhysicsGearJoint is not read; couple"),
    "tendon": (
        hinged(schemas=("PhysxTendonAxisAPI:t",)),
        "PhysxTendonAxisAPI:t is not",
    ),
    "soft body": (
        usda(body("a", prim("Xform", "s", schemas=("PhysxDeformableBodyAPI",))), HELD),
        "if the motion needs it",
    ),
    "springs of MuJoCo": (hinged("double[] mjc:springdamper = [.1, 1]"), "mjc:springdamper' = [0.1, 1"),
    "shifted zero": (
        hinged("double mjc:ref = .5", schemas=("MjcEqualityJointAPI",)),
        "whose 'mjc:ref' shifts its zero",
    ),
    "tendon of MuJoCo": (usda(A, HELD, prim("MjcTendon", "t")), "a MjcTendon is not read; couple"),
    "mimic of nothing": (
        hinged(schemas=("NewtonMimicAPI",)),
        "names 0 joints; name one",
    ),
    "mimic of a body": (
        hinged("rel newton:mimicJoint = </robot/a>", schemas=("NewtonMimicAPI",)),
        "couples </robot/a>, which is no joint",
    ),
    "mimic of a ball": (
        usda(
            A,
            B,
            HELD,
            joint(
                "Spherical", "k", "a", "b", "rel newton:mimicJoint = </robot/j>", schemas=("NewtonMimicAPI",)
            ),
        ),
        "couples </robot/k>, which does not have one freedom",
    ),
    **{
        f"{schema} misspelt": (
            usda(A, HELD, B.replace(schema, schema.replace("API", "Api"))),
            f"{schema[:-3]}Api is not read",
        )
        for schema in BODY
    },
    "units": (usda(A, HELD, meters=0), "must be positive"),
    "clips": (usda('def "x" (clips = {dictionary default = {}}) {}', A, HELD), "value clips"),
}


@pytest.mark.parametrize("case", some(CASES, QUICK))
def test_it_is_refused_by_name(case: str, tmp_path: Path) -> None:
    text, message = CASES[case]
    file = save(tmp_path, text, "robot.usda")
    assert str(file) in str(refused(file, message))


def test_xacro_arguments_are_refused(tmp_path: Path) -> None:
    refused(save(tmp_path, usda(A, HELD), "robot.usda"), "takes no arguments", xacro_args={"n": 1})


def test_without_usd_core_the_extra_is_named(tmp_path: Path) -> None:
    file = save(tmp_path, usda(A, HELD), "robot.usda")
    code = "import sys; sys.modules['pxr'] = None\nfrom hybridyn.description import read\nread(sys.argv[1])"
    done = subprocess.run([sys.executable, "-c", code, str(file)], capture_output=True, text=True)
    assert "usd-core; install it with `pip install -e '.[usd]'`" in done.stderr.splitlines()[-1]
