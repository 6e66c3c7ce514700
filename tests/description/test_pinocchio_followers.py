"""Screws and joints that mimic others in Pinocchio models: efforts and accelerations are Pinocchio's."""

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn.description.pin_model import read_model
from hybridyn.errors import ModelError
from hybridyn.joints.kinds import JointKind
from tests.description.pin_models import pose, seeded, unit
from tests.description.test_pinocchio_models import MIMIC
from tests.support.comparing import close_to, refused

#: Largest relative difference of two exact computations of an acceleration or an effort.
EQUAL = 1e-11

Rng = np.random.Generator
SCREWS: dict[str, Callable[[Rng], pin.JointModel]] = {
    "HX": lambda rng: pin.JointModelHX(0.3),
    "left-handed": lambda rng: pin.JointModelHZ(-0.2),
    "unaligned": lambda rng: pin.JointModelHelicalUnaligned(unit(rng), 0.1),
    "without pitch": lambda rng: pin.JointModelHY(0.0),
}


def composite(rng: Rng) -> pin.JointModel:
    """Return a ball, a screw and a slide in one joint."""
    out = pin.JointModelComposite(3)
    for joint in (pin.JointModelSpherical(), pin.JointModelHX(0.2), pin.JointModelPZ()):
        out.addJoint(joint, pose(rng))
    return out


SCREWS["in a composite"] = composite

#: The joint that leads, the one that follows, factor and offset.
MIMICS: dict[str, tuple[Callable[[Rng], pin.JointModel], Callable[[Rng], pin.JointModel], float, float]] = {
    "hinges": (lambda rng: pin.JointModelRX(), lambda rng: pin.JointModelRZ(), -2.0, 0.3),
    "slide and hinge": (
        lambda rng: pin.JointModelPrismaticUnaligned(unit(rng)),
        lambda rng: pin.JointModelRevoluteUnaligned(unit(rng)), 0.5, -0.1,
    ),
    "hinge and slide": (
        lambda rng: pin.JointModelRevoluteUnaligned(unit(rng)), lambda rng: pin.JointModelPX(), 0.02, 0.1,
    ),
}  # fmt: skip


def build(rng: Rng, joints: list[pin.JointModel]) -> pin.Model:
    """Return a chain of joints with bodies."""
    model, tip = pin.Model(), 0
    for number, joint in enumerate(joints):
        tip = model.addJoint(tip, joint, pose(rng), f"j{number}")
        model.appendBodyToJoint(tip, pin.Inertia.FromEllipsoid(rng.uniform(1, 2), 0.1, 0.2, 0.3), pose(rng))
    model.armature[:] = 0.1
    return model


def rates(robot: hybridyn.HybridRobot, nv: int) -> np.ndarray:
    """Return the matrix of the robot's rates by the model's, whose followers have none of their own."""
    G, at = np.zeros((robot.nv, nv)), 0
    ties = {coupling.name: coupling for coupling in robot.description.couplings}
    for name, own in zip(robot.joints, robot.v_slices, strict=True):
        if name in ties:
            (_, (leader, factor)) = ties[name].terms
            G[own] = -factor * G[robot.v_slices[robot.joints.index(leader)]]
            continue
        G[own, at : at + own.stop - own.start] = np.eye(own.stop - own.start)
        at += own.stop - own.start
    assert at == nv
    return G


def compare(model: pin.Model, rng: Rng) -> hybridyn.HybridRobot:
    """Compare accelerations with Pinocchio's at a random posture, and efforts where motors drive all."""
    q = pin.integrate(model, pin.neutral(model), 0.7 * rng.normal(size=model.nv))
    robot = hybridyn.from_pinocchio(model, home=q)
    assert hybridyn.closure_residual(robot, robot.home).max(initial=0.0) < 1e-14
    G, v, tau = rates(robot, model.nv), *rng.normal(size=(2, model.nv))
    driven = np.abs(G[robot.motor_v].sum(axis=0)) > 0
    tau[~driven] = 0.0
    data = model.createData()
    M = pin.crba(model, data, q)
    a = np.linalg.solve(np.triu(M) + np.triu(M, 1).T, tau - pin.nle(model, data, q, v))
    effects = ("default", "rotor_inertia")
    close_to(hybridyn.ddm(robot, robot.home, G @ v, tau[driven], effects=effects), G @ a, EQUAL)
    close_to(hybridyn.idm(robot, robot.home, G @ v, G @ a, effects=effects), tau[driven], EQUAL)
    return robot


@pytest.mark.parametrize("name", SCREWS)
@pytest.mark.parametrize("seed", range(2))
def test_screws(name: str, seed: int) -> None:
    rng = seeded(seed, 4)
    robot = compare(build(rng, [pin.JointModelRX(), SCREWS[name](rng), pin.JointModelRY()]), rng)
    assert (JointKind.SCREW in robot.kinds) == (name != "without pitch")
    assert not robot.description.couplings


@pytest.mark.parametrize("name", MIMICS)
def test_joints_that_mimic_others(name: str) -> None:
    rng = seeded(3, 5)
    leader, follower, factor, offset = MIMICS[name]
    model = build(
        rng, [pin.JointModelRZ(), leader(rng), pin.JointModelRX(), follower(rng), pin.JointModelRY()]
    )
    compare(pin.transformJointIntoMimic(model, 2, 4, factor, offset), rng)


def test_mimics_of_a_urdf() -> None:
    robot = compare(pin.buildModelFromXML(MIMIC, mimic=True), seeded(1))
    assert robot.motors == ("j",)


def test_a_mimic_that_never_moves_is_refused() -> None:
    rng = seeded(1)
    model = build(rng, [pin.JointModelRX(), pin.JointModelRX()])
    still = pin.transformJointIntoMimic(model, 1, 2, 0.0, 0.3)
    refused(lambda: hybridyn.from_pinocchio(still), ModelError, "with a factor of 0")


def two_free() -> tuple[pin.Model, np.ndarray]:
    """Return a model of two hinges on slides in a plane, and a posture."""
    model = pin.Model()
    for side in range(2):
        slide = model.addJoint(
            0, pin.JointModelPX(), pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.4 * side])), f"s{side}"
        )
        hinge = model.addJoint(slide, pin.JointModelRY(), pin.SE3.Identity(), f"h{side}")
        model.appendBodyToJoint(slide, pin.Inertia.Random(), pin.SE3.Identity())
        model.appendBodyToJoint(hinge, pin.Inertia.Random(), pin.SE3.Identity())
    return model, np.array([0.1, 0.2, -0.1, 0.3])


def test_the_offset_of_a_point_is_read() -> None:
    """Pinocchio's own error of the constraint is zero where ours is."""
    model, q = two_free()
    first = pin.SE3(pin.Quaternion(0.9, 0.1, 0.3, -0.2).normalized().matrix(), np.array([0.1, 0.0, 0.2]))
    anchor = pin.PointAnchorConstraintModel(model, 2, first, 4, pin.SE3.Identity())
    data, own = model.createData(), anchor.createData()
    pin.forwardKinematics(model, data, q, np.zeros(4), np.zeros(4))
    anchor.calc(model, data, own)
    anchor.desired_constraint_offset = np.array(own.constraint_position_error)
    anchor.calc(model, data, own)
    assert np.abs(own.constraint_position_error).max() < 1e-15
    robot = hybridyn.from_pinocchio(model, anchor, home=q, motors=[])
    assert np.abs(hybridyn.closure_residual(robot, q)).max() < 1e-14
    assert not any("Baumgarte" in note for note in robot.notes)


@pytest.mark.parametrize("kind", [pin.ContactType.CONTACT_3D, pin.ContactType.CONTACT_6D])
def test_what_pinocchio_leaves_out_of_rigid_constraints_is_noted(kind: pin.ContactType) -> None:
    """Desired places and motions change nothing in `constraintDynamics`, and nothing here."""
    model, q = two_free()[0], np.array([0.1, 0.0, 0.1, 0.0])
    lower = pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.4]))
    stated = pin.RigidConstraintModel(kind, model, 2, pin.SE3.Identity(), 4, lower, pin.LOCAL)
    stated.setBaumgarteCorrectorParameters(pin.BaumgarteCorrectorParameters(10.0, 2.0))
    plain = pin.RigidConstraintModel(stated)
    stated.desired_contact_placement = pin.SE3(np.eye(3), np.array([0.1, 0.2, 0.3]))
    stated.desired_contact_velocity = stated.desired_contact_acceleration = pin.Motion(np.full(6, 0.3))
    theirs = []
    for one in (plain, stated):
        models, data = pin.StdVec_RigidConstraintModel([one]), model.createData()
        datas = pin.StdVec_RigidConstraintData([one.createData()])
        pin.initConstraintDynamics(model, data, models, datas)
        theirs.append(pin.constraintDynamics(model, data, q, q, q, models, datas).copy())
    np.testing.assert_array_equal(*theirs)
    ours = [read_model(model, one) for one in (plain, stated)]
    np.testing.assert_array_equal(*(robot.closures[0].frame_a for robot in ours))
    (note,) = {*ours[1].notes} - {*ours[0].notes}
    assert note.startswith("desired places and motions of constraints")


def test_dry_friction_of_balls_is_read() -> None:
    model = pin.Model()
    model.addJoint(0, pin.JointModelSpherical(), pin.SE3.Identity(), "ball")
    model.appendBodyToJoint(1, pin.Inertia.Random(), pin.SE3.Identity())
    model.friction = np.full(3, 0.2)
    (joint,) = hybridyn.from_pinocchio(model).description.joints
    assert joint.friction == 0.2


def test_what_constraints_say_besides_is_noted() -> None:
    model, q = two_free()[0], np.array([0.1, 0.2, 0.1, 0.0])
    lower = pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.4]))
    weld = pin.RigidConstraintModel(pin.ContactType.CONTACT_3D, model, 2, pin.SE3.Identity(), 4, lower)
    weld.name = "weld"
    weld.setBaumgarteCorrectorParameters(pin.BaumgarteCorrectorParameters(10.0, 2.0))
    soft = pin.PointAnchorConstraintModel(model, 2, pin.SE3.Identity(), 4, lower)
    soft.name = "soft"
    soft.setCompliance(np.full(3, 1e-3))
    joints = pin.JointLimitConstraintModel(model, [1]), pin.JointFrictionConstraintModel(model, [1])
    notes = " ".join(hybridyn.from_pinocchio(model, [weld, soft, *joints], home=q, motors=[]).notes)
    assert "constraints 'weld' have Baumgarte numbers" in notes
    assert "are limits or friction of joints" in notes
    assert "drops the compliance of constraints 'soft'" in notes
