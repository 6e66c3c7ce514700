"""USD as the converters of MuJoCo, Newton and Isaac Sim write it, against MuJoCo and values by hand."""

from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.description import read
from tests.comparing import close_to
from tests.description.reading import refused
from tests.extras import needs
from tests.files import save
from tests.usd_texts import BODY, at, body, joint, prim, usda

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


def test_numbers_and_notes_of_a_gripper(tmp_path: Path) -> None:
    found = read(save(tmp_path, usda(*GRIPPER), "gripper.usda"))
    numbers = {j.name: (j.rotor_inertia, j.damping, j.friction) for j in found.joints}
    assert numbers == {
        "wrist": (0.02, 0.3, 0.0), "left_finger": (0.1, 4.0, 0.5), "right_finger": (0.2, 0.0, 0.0),
    }  # fmt: skip
    (coupling,) = found.couplings
    assert (coupling.terms, coupling.offset) == ((("right_finger", 1.0), ("left_finger", 0.5)), 0.01)
    notes = "\n".join(found.notes)
    for words in (
        "of actuators only the joints that they drive are read: '/robot/turn', '/robot/grip'",
        "keyframes are not read: '/robot/home'",
        "deformable bodies and particles are not read: '/robot/cloth', '/robot/sponge'",
        "physxRigidBody:angularDamping, which holds bodies back in PhysX alone, is not read: '/robot/palm'",
        "the fluid around the robot is not read: '/robot/scene'",
        "'mjc:solreflimit'",
    ):
        assert words in notes, words


@pytest.mark.parametrize(
    ("content", "factor", "offset"),
    [
        # Newton's coefficients are in degrees, MuJoCo's in radians; each of MuJoCo's ranks above Newton's.
        ((), 1.0, 0.0),
        (("float newton:mimicCoef0 = 18", "float newton:mimicCoef1 = 2"), 2.0, np.pi / 10),
        (("float newton:mimicCoef0 = 18", "double mjc:coef0 = 0.5", "float newton:mimicCoef1 = 2"), 2.0, 0.5),
        (("float newton:mimicCoef0 = 18", "double mjc:coef1 = 3"), 3.0, np.pi / 10),
    ],
)
def test_an_equality_of_joints_is_a_mimic_of_newton_too(
    content: tuple[str, ...], factor: float, offset: float, tmp_path: Path
) -> None:
    """As in MuJoCo 3.12, where MjcEqualityJointAPI has NewtonMimicAPI built in."""
    hinges = [
        body(name) + "\n" + joint("Revolute", f"j_{name}", "", name, *more, schemas=schemas)
        for name, more, schemas in (
            ("a", (), ()),
            ("b", ("rel newton:mimicJoint = </robot/j_a>", *content), ("MjcEqualityJointAPI",)),
        )
    ]
    (coupling,) = read(save(tmp_path, usda(*hinges), "robot.usda")).couplings
    assert coupling.terms == (("j_b", 1.0), ("j_a", -factor))
    assert coupling.offset == pytest.approx(offset, rel=1e-15)


@pytest.mark.parametrize("gearing", [-2, 2])
def test_a_mimic_of_two_engines_counts_once(gearing: float, tmp_path: Path) -> None:
    """Converters write both: position + gearing x leader = 0 is position = -gearing x leader."""
    follower = joint(
        "Revolute", "k", "", "b", "rel physxMimicJoint:rotX:referenceJoint = </robot/j>",
        f"float physxMimicJoint:rotX:gearing = {gearing}", "rel newton:mimicJoint = </robot/j>",
        "float newton:mimicCoef1 = 2", schemas=("PhysxMimicJointAPI:rotX", "NewtonMimicAPI"),
    )  # fmt: skip
    text = usda(body("a"), body("b"), joint("Revolute", "j", "", "a"), follower)
    file = save(tmp_path, text, "robot.usda")
    if gearing > 0:
        refused(file, "</robot/k>: couples this joint otherwise for PhysX than for Newton; keep one")
        return
    (coupling,) = read(file).couplings
    assert coupling.terms == (("k", 1.0), ("j", -2.0))


def test_an_equality_without_a_leader_holds_a_joint(tmp_path: Path) -> None:
    held = joint("Revolute", "j", "", "a", "double mjc:coef0 = .3", schemas=("MjcEqualityJointAPI",))
    (coupling,) = read(save(tmp_path, usda(body("a"), held), "robot.usda")).couplings
    assert (coupling.terms, coupling.offset) == ((("j", 1.0),), 0.3)


def test_equalities_of_bodies_are_closures(tmp_path: Path) -> None:
    """A connect is a spherical joint outside the articulation; other programs read only the joint."""
    hinge = 'uniform token physics:axis = "Y"'
    bars = (
        body("a"), body("b", at="1, 0, 0"),
        joint("Revolute", "j", "", "a", hinge), joint("Revolute", "k", "", "b", hinge, at(0, "1, 0, 0")),
        joint("Spherical", "tie", "a", "b", at(0, "0.5, 0, 1"), at(1, "-0.5, 0, 1"),
              "bool physics:excludeFromArticulation = true", "uniform double[] mjc:solref = [0.005, 1]",
              schemas=("MjcEqualityConnectAPI",)),
    )  # fmt: skip
    found = read(save(tmp_path, usda(*bars), "robot.usda"))
    (closure,) = found.closures
    assert (closure.name, closure.translations, closure.rotation) == ("tie", (0, 1, 2), "free")


def test_armature_of_several_engines_counts_once(tmp_path: Path) -> None:
    """PhysX's ranks above Newton's, and that above MuJoCo's; damping of MuJoCo knows no degrees."""
    stated = ("float physxJoint:armature = .1", "float newton:armature = .2", "double mjc:armature = .3")
    for first, expected in enumerate((0.1, 0.2, 0.3)):
        hinge = joint(
            "Revolute", "j", "", "a", *stated[first:], "float newton:friction = .4", schemas=BODY[:0]
        )
        (found,) = read(save(tmp_path, usda(body("a"), hinge), "robot.usda")).joints
        assert (found.rotor_inertia, found.friction) == (expected, 0.4)
    grams = joint("Revolute", "j", "", "a", "double mjc:damping = 3")
    (found,) = read(save(tmp_path, usda(body("a"), grams, meters=0.1), "robot.usda")).joints
    assert found.damping == pytest.approx(0.03, rel=1e-15)


def test_armature_and_damping_of_a_ball_are_those_of_its_mjcf(tmp_path: Path) -> None:
    needs("mjcf")
    stated = "double mjc:armature = 0.02", "double mjc:damping = 0.3"
    ball = joint("Spherical", "hip", "", "thigh", *stated, schemas=JOINT)
    (ours,) = read(save(tmp_path, usda(body("thigh"), ball), "leg.usda")).joints
    mjcf = (
        '<mujoco><worldbody><body name="thigh"><joint name="hip" type="ball" armature="0.02" damping="0.3"/>'
    )
    text = f"{mjcf}{SIDE.format(m=1)}</body></worldbody></mujoco>"
    (theirs,) = read(save(tmp_path, text, "leg.xml")).joints
    words = "kind", "rotor_inertia", "damping", "friction"
    assert [getattr(ours, word) for word in words] == [getattr(theirs, word) for word in words]
    dry = joint("Spherical", "hip", "", "thigh", "double mjc:frictionloss = 1", schemas=JOINT)
    refused(save(tmp_path, usda(body("thigh"), dry), "leg.usda"), "dry friction of a joint with several")
