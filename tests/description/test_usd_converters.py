"""USD as the converters of MuJoCo, Newton and Isaac Sim write it, against MuJoCo and values by hand."""

from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.description import read
from tests.description.reading import holds, refused
from tests.description.usd_texts import at, body, joint, prim, usda
from tests.support.comparing import close_to
from tests.support.extras import needs
from tests.support.files import save

needs("usd")

#: Two engines whose rotations pass through quaternions of 7 digits.
AGAINST_MUJOCO = 1e-7

#: A wrist that turns about y and carries two fingers; the right one follows the left one by -0.5. Names,
#: schemas and attributes are those of mujoco-usd-converter and Isaac Sim's importer.
JOINT = ("MjcJointAPI",)
FINGER = 'uniform token physics:axis = "X"'
GRIPPER = (
    body("palm", "float physxRigidBody:angularDamping = 0.05", at="0, 0, 1"),
    body("left", at="-0.1, 0, 1.2", m=0.3),
    body("right", at="0.1, 0, 1.2", m=0.4),
    joint("Revolute", "wrist", "", "palm", at(0, "0, 0, 1"), 'uniform token physics:axis = "Y"',
          "uniform double mjc:armature = 0.02", "uniform double mjc:damping = 0.3",
          "uniform double[] mjc:solreflimit = [0.02, 1]", "uniform int mjc:group = 1", schemas=JOINT),
    joint("Prismatic", "left_finger", "palm", "left", at(0, "-0.1, 0, 0.2"), FINGER,
          "uniform double mjc:armature = 0.1", "uniform double mjc:damping = 4",
          "uniform double mjc:frictionloss = 0.5", schemas=JOINT),
    joint("Prismatic", "right_finger", "palm", "right", at(0, "0.1, 0, 0.2"), FINGER,
          "uniform double mjc:armature = 0.2", "rel mjc:target = </robot/left_finger>",
          "uniform double mjc:coef0 = 0.01", "uniform double mjc:coef1 = -0.5",
          "uniform double[] mjc:solref = [0.005, 1]", schemas=(*JOINT, "MjcEqualityJointAPI")),
    prim("MjcActuator", "turn", "rel mjc:target = </robot/wrist>", "double[] mjc:gear = [1, 0, 0, 0, 0, 0]"),
    prim("MjcActuator", "grip", "rel mjc:target = </robot/left_finger>"),
    prim("PhysicsScene", "scene", "double mjc:option:density = 1.2", schemas=("MjcSceneAPI",)),
    prim("MjcKeyframe", "home", "double[] mjc:qpos = [0, 0, 0.01]"),
    prim("Xform", "cloth", schemas=("PhysxParticleClothAPI", "PhysxAutoParticleClothAPI")),
    prim("Mesh", "sponge", schemas=("PhysxDeformableBodyAPI", "PhysicsCollisionAPI")),
)  # fmt: skip
SIDE = '<inertial pos="0.1 0.01 0" quat=".8 0 .6 0" mass="{m}" diaginertia=".02 .05 .06"/>'
MJCF = f"""<mujoco><compiler angle="radian"/><worldbody><body name="palm" pos="0 0 1">
<joint name="wrist" axis="0 1 0" armature="0.02" damping="0.3"/>{SIDE.format(m=1)}
<body name="left" pos="-0.1 0 0.2"><joint name="left_finger" type="slide" axis="1 0 0" armature="0.1"
 damping="4" frictionloss="0.5"/>{SIDE.format(m=0.3)}</body>
<body name="right" pos="0.1 0 0.2"><joint name="right_finger" type="slide" axis="1 0 0" armature="0.2"/>
{SIDE.format(m=0.4)}</body></body></worldbody></mujoco>"""


def test_a_gripper_of_mujoco_has_its_efforts(tmp_path: Path) -> None:
    """Of the tree in MuJoCo, whose right finger moves as the equality says; dry friction is apart."""
    mujoco = needs("mjcf")
    robot = hybridyn.load(save(tmp_path, usda(*GRIPPER), "gripper.usda"))
    model = mujoco.MjModel.from_xml_string(MJCF)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    data = mujoco.MjData(model)
    draw = np.random.default_rng(1)
    assert robot.motors == ("wrist", "left_finger")
    follow = np.array([[1.0, 0.0], [0.0, 1.0], [0.0, -0.5]])  # of wrist, left and right finger
    order = [
        robot.v_slices[robot.joints.index(name)].start for name in ("wrist", "left_finger", "right_finger")
    ]
    for _ in range(3):
        u, u_dot, u_ddot = draw.normal(size=(3, 2))
        data.qpos[:] = follow @ u + [0, 0, 0.01]
        data.qvel[:], data.qacc[:] = follow @ u_dot, follow @ u_ddot
        mujoco.mj_inverse(model, data)
        q, v, a = (np.zeros(3) for _ in range(3))
        q[order], v[order], a[order] = data.qpos, data.qvel, data.qacc
        tau = hybridyn.idm(robot, q, v, a, effects=["default", "rotor_inertia", "viscous_friction"])
        close_to(tau, follow.T @ data.qfrc_inverse, AGAINST_MUJOCO)


def pair(*content: str, schemas: tuple[str, ...]) -> str:
    """Return two hinges, of which the second has some content."""
    hinges = joint("Revolute", "j_a", "", "a"), joint("Revolute", "j_b", "", "b", *content, schemas=schemas)
    return usda(body("a"), body("b"), *hinges)


def mimic(gearing: float) -> str:
    """Return a mimic of two engines: position + gearing x leader = 0 is position = -gearing x leader."""
    return pair(
        "rel physxMimicJoint:rotX:referenceJoint = </robot/j_a>", "float newton:mimicCoef1 = 2",
        f"float physxMimicJoint:rotX:gearing = {gearing}", "rel newton:mimicJoint = </robot/j_a>",
        schemas=("PhysxMimicJointAPI:rotX", "NewtonMimicAPI"),
    )  # fmt: skip


def hinge(*content: str, kind: str = "Revolute", schemas: tuple[str, ...] = (), meters: float = 1) -> str:
    """Return a pendulum whose joint has some content."""
    return usda(body("a"), joint(kind, "j", "", "a", *content, schemas=schemas), meters=meters)


def about(x: float) -> object:
    return pytest.approx(x, rel=1e-15)


EQUALITY = ("MjcEqualityJointAPI",)
ARMATURES = ("float physxJoint:armature = .1", "float newton:armature = .2", "double mjc:armature = .3")
ABOUT_Y = 'uniform token physics:axis = "Y"'
#: A connect is a spherical joint outside the articulation; other programs read only the joint.
TIED = usda(
    body("a"), body("b", at="1, 0, 0"),
    joint("Revolute", "j", "", "a", ABOUT_Y), joint("Revolute", "k", "", "b", ABOUT_Y, at(0, "1, 0, 0")),
    joint("Spherical", "tie", "a", "b", at(0, "0.5, 0, 1"), at(1, "-0.5, 0, 1"),
          "bool physics:excludeFromArticulation = true", "uniform double[] mjc:solref = [0.005, 1]",
          schemas=("MjcEqualityConnectAPI",)),
)  # fmt: skip
#: A text, and what is read.
READ: dict[str, tuple[str, dict[str, object]]] = {
    "a gripper": (usda(*GRIPPER), {
        "joints": {
            "wrist": {"rotor_inertia": 0.02, "damping": 0.3, "friction": 0.0},
            "left_finger": {"rotor_inertia": 0.1, "damping": 4.0, "friction": 0.5},
            "right_finger": {"rotor_inertia": 0.2, "damping": 0.0, "friction": 0.0},
        },
        "couplings": [{"terms": (("right_finger", 1.0), ("left_finger", 0.5)), "offset": 0.01}],
        "notes": {
            "of actuators only the joints that they drive are read: '/robot/turn', '/robot/grip'",
            "keyframes are not read: '/robot/home'",
            "deformable bodies and particles are not read: '/robot/cloth', '/robot/sponge'",
            "drops physxRigidBody:angularDamping of "
            "'/robot/palm'",
            "drops the forces of the fluid around the robot, of '/robot/scene'",
            "'mjc:solreflimit'",
        },
    }),
    # An equality of joints is a mimic of Newton, too, as in MuJoCo 3.12, where MjcEqualityJointAPI has
    # NewtonMimicAPI built in. Newton's coefficients are in degrees, MuJoCo's in radians; each of MuJoCo's
    # ranks above Newton's.
    **{
        f"an equality that is a mimic, {content}": (
            pair("rel newton:mimicJoint = </robot/j_a>", *content, schemas=EQUALITY),
            {"couplings": [{"terms": (("j_b", 1.0), ("j_a", -factor)), "offset": about(offset)}]},
        )
        for content, factor, offset in (
            ((), 1.0, 0.0),
            (("float newton:mimicCoef0 = 18", "float newton:mimicCoef1 = 2"), 2.0, np.pi / 10),
            (
                ("float newton:mimicCoef0 = 18", "double mjc:coef0 = 0.5", "float newton:mimicCoef1 = 2"),
                2.0, 0.5,
            ),
            (("float newton:mimicCoef0 = 18", "double mjc:coef1 = 3"), 3.0, np.pi / 10),
        )
    },
    "a mimic of two engines counts once": (
        mimic(-2), {"couplings": [{"terms": (("j_b", 1.0), ("j_a", -2.0))}]},
    ),
    "an equality of higher order is a coupling with a curve": (
        pair("rel mjc:target = </robot/j_a>", "double mjc:coef2 = .5", "double mjc:coef3 = -.2",
             schemas=EQUALITY),
        {"couplings": [{"terms": (("j_b", 1.0), ("j_a", -1.0)), "curve": {
            "terms": (("j_a", 1.0),), "coefficients": (-0.5, 0.2),
        }}]},
    ),
    "coefficients of a second engine are noted": (
        pair("rel newton:mimicJoint = </robot/j_a>", "float newton:mimicCoef1 = 2", "double mjc:coef1 = 3",
             schemas=EQUALITY),
        {"notes": {"where another engine states other ones: 'newton:mimicCoef1 of /robot/j_b'"}},
    ),
    "an equality without a leader holds a joint": (
        hinge("double mjc:coef0 = .3", schemas=EQUALITY),
        {"couplings": [{"terms": (("j", 1.0),), "offset": 0.3}]},
    ),
    "an equality of bodies is a closure": (
        TIED, {"closures": [{"name": "tie", "translations": (0, 1, 2), "rotation": "free"}]},
    ),
    # Armature of several engines counts once: PhysX's ranks above Newton's, and that above MuJoCo's.
    **{
        f"armature {expected}": (
            hinge(*ARMATURES[first:], "float newton:friction = .4"),
            {"joints": [{"rotor_inertia": expected, "friction": 0.4}]},
        )
        for first, expected in enumerate((0.1, 0.2, 0.3))
    },
    "damping of Newton is per degree, and joints that add mobility are joints": (
        usda(
            body("a", "bool newton:jointsAddMobility = true"),
            joint("Revolute", "j", "", "a", "float newton:damping = 0.25"),
        ),
        {"joints": [{"damping": about(45 / np.pi)}]},
    ),
    "a drive of a ball is no motor": (
        hinge(kind="Spherical", schemas=("PhysicsDriveAPI:rotX",)),
        {"motors": (), "left_out": ("/robot/j",), "notes": {"</robot/j> is driven, but has several"}},
    ),
    "dry friction of a ball is about each axis": (
        hinge("double mjc:frictionloss = 1", kind="Spherical", schemas=JOINT),
        {"joints": [{"kind": "spherical", "friction": 1}]},
    ),
    "numbers of a second engine are noted": (
        hinge("float physxJoint:armature = 1", "double mjc:armature = 2", "double mjc:damping = 0"),
        {"joints": [{"rotor_inertia": 1}], "notes": {"engine states other ones: 'mjc:armature of /robot/j'"}},
    ),
    "equal numbers of two engines are not": (
        hinge("float physxJoint:armature = 0.1", "double mjc:armature = 0.1"),
        {"joints": [{"rotor_inertia": 0.1}], "notes": ()},
    ),
    "a number of an engine that is not known is noted": (
        hinge("float physxJoint:newNumber = 1", "float physxJointAxis:angular:other = 1"),
        {"notes": {"'physxJoint:newNumber'", "'physxJointAxis:angular:other'"}},
    ),
    "damping of MuJoCo knows no degrees": (
        hinge("double mjc:damping = 3", meters=0.1), {"joints": [{"damping": about(0.03)}]},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", READ)
def test_what_is_read(name: str, tmp_path: Path) -> None:
    text, expected = READ[name]
    holds(read(save(tmp_path, text, "robot.usda")), expected)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            usda(
                body("a", "bool newton:jointsAddMobility = true"),
                *(joint("Revolute", name, "", "a", schemas=JOINT) for name in "xy"),
            ),
            "</robot/x>: 'newton:jointsAddMobility' = True is not read where several joints join two bodies",
        ),
        (mimic(2), "</robot/j_b>: PhysxMimicJointAPI couples it otherwise than NewtonMimicAPI"),
        (
            hinge(
                "float physxJointAxis:rotY:armature = 1",
                kind="Spherical",
                schemas=("PhysxJointAxisAPI:rotY",),
            ),
            "'physxJointAxis:rotY:armature' is about one axis of a ball joint, which is not read",
        ),
    ],
)
def test_it_is_refused_by_name(text: str, message: str, tmp_path: Path) -> None:
    refused(save(tmp_path, text, "robot.usda"), message)


def test_armature_and_damping_of_a_ball_are_those_of_its_mjcf(tmp_path: Path) -> None:
    needs("mjcf")
    numbers = {"kind": "spherical", "rotor_inertia": 0.02, "damping": 0.3, "friction": 0.0}
    stated = "double mjc:armature = 0.02", "double mjc:damping = 0.3"
    ball = '<mujoco><worldbody><body name="a"><joint type="ball" armature="0.02" damping="0.3"/>'
    for name, text in {
        "leg.usda": hinge(*stated, kind="Spherical", schemas=JOINT),
        "leg.xml": f"{ball}{SIDE.format(m=1)}</body></worldbody></mujoco>",
    }.items():
        holds(read(save(tmp_path, text, name)), {"joints": [numbers]})
