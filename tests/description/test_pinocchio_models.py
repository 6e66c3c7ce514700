"""`from_pinocchio` against Pinocchio: the numbers of trees and of closed loops, and what is refused."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn import HybridRobot
from hybridyn.errors import ModelError
from hybridyn.structure.building import build_robot
from tests.description.pin_models import JOINTS, Drawn, drawn, seeded
from tests.description.reading import holds
from tests.robots.robot_texts import FOUR_BAR, read_text
from tests.support.comparing import close_to, refused
from tests.support.samples import slow

#: Largest relative difference of two exact computations of an acceleration or an effort.
EQUAL = 1e-11
ROTORS = ("default", "rotor_inertia")

#: Chains, closures, whether the base floats, joints of the second chain: all kinds of joint and constraint.
CLOSED = {
    "3D": (["RX", "R", "P", "RUBZ", "R", "RX"], ["3D"], False, 3),
    "6D": (["R", "U", "R", "S", "RX", "RUB"], ["6D"], False, 2),
    "two points": (["S", "R", "C", "R", "T"], ["point", "3D"], False, 2),
    "world": (["RX", "R", "PZ", "R", "S", "E"], ["6D"], False, 0),
    "floating": (["R", "RX", "ZYX", "R", "P"], ["frame"], True, 2),
    "foot on the ground": (["R", "RX", "R", "R"], ["3D"], True, 0),
}


def close(a: np.ndarray, b: np.ndarray) -> None:
    """Compare relative to the largest entry."""
    close_to(a, b, EQUAL, 1.0)


def driven(robot: HybridRobot, rng: np.random.Generator) -> np.ndarray:
    """Return efforts of all joints that only motors have."""
    tau = np.zeros(robot.nv)
    tau[robot.motor_v] = rng.normal(size=len(robot.motors))
    return tau


def compare(case: Drawn, rng: np.random.Generator) -> None:
    """Compare efforts and accelerations, closure rows and residual with Pinocchio's."""
    robot = hybridyn.from_pinocchio(case.model, case.constraints, home=case.q, motors=single(case))
    assert (robot.nq, robot.nv) == (case.model.nq, case.model.nv)
    assert np.allclose(robot.home, case.q, atol=1e-15)
    v, tau = case.velocity(rng), driven(robot, rng)
    close(hybridyn.ddm(robot, case.q, v, tau[robot.motor_v], effects=ROTORS), case.acceleration(v, tau))
    assert np.abs(hybridyn.closure_residual(robot, case.q)).max(initial=0.0) < 1e-12
    assert robot.mobility == case.model.nv - np.linalg.matrix_rank(case.rows(), tol=1e-9)


def single(case: Drawn) -> list[str]:
    """Return the names of the joints with one freedom that may be motors."""
    robot = hybridyn.from_pinocchio(case.model, home=case.q)
    return [
        n
        for n, kind in zip(robot.joints, robot.kinds, strict=True)
        if kind in "revolute continuous prismatic"
    ]


@pytest.mark.parametrize("floating", [slow(False), True])
def test_every_joint_of_a_tree(floating: bool) -> None:
    rng = seeded(1)
    case = drawn(rng, [*JOINTS], branch=5, floating=floating)
    model, robot = case.model, hybridyn.from_pinocchio(case.model)
    assert robot.base == ("floating" if floating else "fixed")
    v, tau = rng.normal(size=model.nv), driven(robot, rng)
    data, own = model.createData(), robot.model.createData()
    a = pin.aba(model, data, case.q, v, tau)
    close(hybridyn.ddm(robot, case.q, v, tau[robot.motor_v]), a)
    close(hybridyn.idm(robot, case.q, v, a), tau[robot.motor_v])
    close(pin.rnea(robot.model, own, case.q, v, v), pin.rnea(model, data, case.q, v, v))
    close(pin.crba(robot.model, own, case.q), pin.crba(model, data, case.q))
    pin.framesForwardKinematics(model, data, case.q)
    motion = hybridyn.kinematics(robot, case.q, v, links=["body1", "body4"])
    for name, found in motion.items():
        assert np.allclose(found.pose[:3], data.oMf[model.getFrameId(name)].translation, atol=1e-12)


@pytest.mark.parametrize("name", [*CLOSED])
def test_closed_loops(name: str) -> None:
    rng = seeded(3)
    joints, closures, floating, branch = CLOSED[name]
    compare(drawn(rng, joints, closures, floating=floating, branch=branch, armature=0.1), rng)


def test_efforts_of_a_closed_loop_give_back_its_accelerations() -> None:
    rng = seeded(5)
    case = drawn(rng, ["RX", "R", "P", "RUBZ", "R", "RX", "R"], ["3D"], branch=3)
    robot = hybridyn.from_pinocchio(case.model, case.constraints, home=case.q, motors=single(case)[:4])
    v, tau = case.velocity(rng), driven(robot, rng)
    a = case.acceleration(v, tau)
    close(hybridyn.idm(robot, case.q, v, a), tau[robot.motor_v])


def test_each_part_of_a_composite_has_its_own_numbers() -> None:
    """A ball in front of a hinge takes three numbers; the hinge has the fourth."""
    joint = pin.JointModelComposite(2)
    joint.addJoint(pin.JointModelSpherical(), pin.SE3.Identity())
    joint.addJoint(pin.JointModelRX(), pin.SE3.Random())
    model = alone(joint)
    model.appendBodyToJoint(1, pin.Inertia.Random(), pin.SE3.Identity())
    model.armature[:], model.damping[:] = [0.3, 0.3, 0.3, 2.0], [0.1, 0.1, 0.1, 0.7]
    robot = hybridyn.from_pinocchio(model)
    rng = seeded(2)
    q, v = pin.integrate(model, pin.neutral(model), rng.normal(size=4)), rng.normal(size=4)
    a = pin.aba(model, model.createData(), q, v, -model.damping * v)
    tau = np.zeros(len(robot.motors))
    close(hybridyn.ddm(robot, q, v, tau, effects=(*ROTORS, "viscous_friction")), a)


MIMIC = """<robot name="mimic"><link name="a"/><link name="b">{0}</link><link name="c">{0}</link>
  <joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="1 2 0"/>
    <limit lower="-1" upper="1" effort="3" velocity="2"/></joint>
  <joint name="k" type="revolute"><parent link="b"/><child link="c"/><origin xyz="0 0 1" rpy="0.3 0 0"/>
    <axis xyz="1 0 2"/><limit lower="-1" upper="1" effort="3" velocity="2"/>
    <mimic joint="j" multiplier="-2" offset="0.3"/></joint></robot>""".format(
    '<inertial><origin xyz="0.1 0.2 0"/><mass value="1"/>'
    '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["delta", "lx4"])
def test_a_shipped_robot_goes_there_and_back(name: str) -> None:
    robot = hybridyn.load(name)
    model, place = robot.model, robot.bodies.place
    constraints = []
    for closure in robot.description.closures:
        ends = []
        for link, frame in ((closure.link_a, closure.frame_a), (closure.link_b, closure.frame_b)):
            body, R, p = place[link]
            joint = model.getJointId(robot.bodies.joints[body - 1].joint.name) if body else 0
            ends += [joint, pin.SE3(R, p) * pin.SE3(frame)]
        constraints.append(pin.RigidConstraintModel(pin.ContactType.CONTACT_3D, model, *ends))
    again = hybridyn.from_pinocchio(model, constraints, home=robot.home, motors=robot.motors)
    assert again.joints == robot.joints
    rng = np.random.default_rng(1)
    wanted = {motor: (0.01, *rng.normal(size=2)) for motor in robot.motors}
    q, v, a = hybridyn.assemble(robot, motors=wanted, guess=robot.home)
    close(hybridyn.idm(again, q, v, a), hybridyn.idm(robot, q, v, a))
    tau = rng.normal(size=len(robot.motors))
    close(hybridyn.ddm(again, q, v, tau), hybridyn.ddm(robot, q, v, tau))


def test_constraints_in_any_list() -> None:
    """`buildModelAndConstraintsFromMJCF` returns its anchors in lists of Pinocchio's own."""
    case = drawn(seeded(2), ["RX", "R", "S", "R", "RY", "R"], ["point"], branch=3)
    anchors = pin.StdVec_PointAnchorConstraintModel()
    anchors.append(case.constraints[0])
    for many in (case.constraints, [anchors, pin.StdVec_FrameAnchorConstraintModel()], case.constraints[0]):
        robot = hybridyn.from_pinocchio(case.model, many, home=case.q, motors=[])
        holds(robot.description, {"closures": [{"kind": "point"}]})


@pytest.mark.slow
def test_the_frame_of_a_hinge(tmp_path: Path) -> None:
    """A weld with `kinds` is the hinge about the third axis of its frames."""
    text = FOUR_BAR.replace("</robot>", '<transmission name="t"><joint name="drive"/></transmission></robot>')
    ours = build_robot(read_text(tmp_path, text))
    model, (pin_closure,) = ours.model, ours.description.closures
    joints = [model.getJointId(name) for name in ("elbow", "swing")]
    frames = (pin.SE3(pin_closure.frame_a), pin.SE3(pin_closure.frame_b))
    weld = pin.RigidConstraintModel(
        pin.ContactType.CONTACT_6D, model, joints[0], frames[0], joints[1], frames[1]
    )
    weld.name = "knee"
    for key in ("knee", 0):
        robot = hybridyn.from_pinocchio(model, weld, kinds={key: "revolute"}, motors=["drive"])
        q, v, a = hybridyn.assemble(ours, motors={"drive": (0.3, 1.0, 2.0)}, guess=ours.home)
        close(hybridyn.idm(robot, q, v, a), hybridyn.idm(ours, q, v, a))
        close(hybridyn.closure_residual(robot, q), hybridyn.closure_residual(ours, q))


def test_notes_and_homes() -> None:
    model = drawn(seeded(0), ["RX", "RY"]).model
    model.addJoint(1, pin.JointModelRX(), pin.SE3.Identity(), "late")
    model.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), "other")
    model.addJoint(3, pin.JointModelRX(), pin.SE3.Identity(), "out_of_order")
    model.referenceConfigurations["folded"] = np.arange(5.0)
    robot = hybridyn.from_pinocchio(model)
    holds(robot, {"notes": {"not numbered depth-first", "'folded'"}})
    assert robot.joints == ("j2_RX", "j1_RY", "late", "out_of_order", "other")
    assert list(robot.home) == [0, 1, 2, 4, 3]
    assert not hybridyn.from_pinocchio(model, home=np.zeros(5)).home.any()


def changed(**values: object) -> pin.Model:
    """Return a model of a hinge and a ball, with numbers of its freedoms changed."""
    model = drawn(seeded(0), ["RX", "S"]).model
    for name, value in values.items():
        getattr(model, name)[:] = value
    return model


def moving(word: str) -> pin.PointAnchorConstraintModel:
    """Return a constraint that asks for a motion between its points."""
    constraint = pin.PointAnchorConstraintModel(changed(), 2)
    setattr(constraint, word, np.array([0.1, 0.2, 0.3]))
    return constraint


def alone(joint: object) -> pin.Model:
    """Return a model of one joint."""
    model = pin.Model()
    model.addJoint(0, joint, pin.SE3.Identity(), "alone")
    return model


@pytest.mark.parametrize(
    ("make", "options", "message"),
    [
        (lambda: alone(pin.JointModelEllipsoid(1.0, 2.0, 3.0)), {}, "moves on an ellipsoid"),
        (lambda: changed(armature=np.arange(4.0)), {}, "different armature"),
        (lambda: changed(rotorInertia=0.1), {}, "rotorInertia of a joint with several freedoms"),
        (lambda: changed(friction=np.arange(4.0)), {}, "different friction"),
        (lambda: changed(damping=np.arange(4.0)), {}, "different damping"),
        (lambda: changed(damping=-1.0), {}, "negative damping"),
        (lambda: "robot.urdf", {}, "the model is a str, not a pinocchio.Model"),
        (changed, {"home": "folded"}, "no reference configuration 'folded'"),
        (changed, {"home": [0.0]}, "5 finite coordinates"),
        (changed, {"kinds": {"knee": "revolute"}}, "no constraint is called 'knee'"),
        (changed, {"constraint_models": [3]}, "holds a int"),
        (changed, {"constraint_models": moving("desired_constraint_velocity")}, "is not zero"),
        (changed, {"constraint_models": moving("desired_constraint_acceleration")}, "is not zero"),
        (
            changed,
            {"constraint_models": [pin.PointContactConstraintModel(changed(), 2, pin.SE3.Identity())]},
            "PointContactConstraintModel, which closes no loop",
        ),
        (
            changed,
            {
                "constraint_models": pin.RigidConstraintModel(pin.ContactType.CONTACT_6D, changed(), 2),
                "kinds": {0: "hinge"},
            },
            "unknown kind 'hinge'",
        ),
    ],
)
def test_is_refused_by_name(make: Callable[[], object], options: dict[str, object], message: str) -> None:
    caught = refused(lambda: hybridyn.from_pinocchio(make(), **options), ModelError, "")
    assert message in str(caught)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_random_closed_models(seed: int) -> None:
    """Two chains of any joints, tied by one or two constraints of any kind, on a fixed or floating base."""
    rng = seeded(seed, 9)
    joints = [str(kind) for kind in rng.choice([*JOINTS], size=rng.integers(6, 10))]
    joints += ["R", "S", "RX"]  # enough freedoms to close
    closures = [str(kind) for kind in rng.choice(["3D", "6D", "point", "frame"], size=rng.integers(1, 3))]
    if closures[0] in ("6D", "frame"):
        closures = closures[:1]  # two chains have one weld at most
    branch = int(rng.integers(0, len(joints) - 2))
    floating = bool(rng.integers(2))
    compare(drawn(rng, joints, closures, floating=floating, branch=branch, armature=0.1), rng)
