"""Joints with several freedoms, as the hinges and slides that stand for them in ROS."""

import numpy as np
import pinocchio as pin
import pytest

from hybridyn.joints.kinds import JointKind
from hybridyn.ros.joint_numbers import SeveralNumbers, ros_names
from hybridyn.spatial import Array

#: What a joint of each kind with several freedoms is as a chain, and its models in Pinocchio.
SLIDES = [pin.JointModelPX(), pin.JointModelPY(), pin.JointModelPZ()]
HINGES = [pin.JointModelRX(), pin.JointModelRY(), pin.JointModelRZ()]
CHAINS = {
    JointKind.SPHERICAL: (pin.JointModelSpherical(), HINGES, ["j_x", "j_y", "j_z"]),
    JointKind.PLANAR: (pin.JointModelPlanar(), [*SLIDES[:2], HINGES[2]], ["j_x", "j_y", "j_turn"]),
    JointKind.FLOATING: (
        pin.JointModelFreeFlyer(),
        [*SLIDES, *HINGES],
        ["j_x", "j_y", "j_z", "j_turn_x", "j_turn_y", "j_turn_z"],
    ),
}  # fmt: skip


def moved(joints: list[pin.JointModel], q: Array, v: Array) -> tuple[Array, Array]:
    """Return place and twist of the end of a chain of joints, by Pinocchio."""
    model, at = pin.Model(), 0
    for i, joint in enumerate(joints):
        at = model.addJoint(at, joint, pin.SE3.Identity(), f"j{i}")
    data = model.createData()
    pin.forwardKinematics(model, data, q, v)
    return data.oMi[at].homogeneous, data.v[at].vector


@pytest.mark.parametrize("kind", CHAINS, ids=str)
def test_the_chain_moves_as_the_joint(kind: JointKind) -> None:
    joint, chain, names = CHAINS[kind]
    assert ros_names("j", kind) == names
    model = pin.Model()
    model.addJoint(0, joint, pin.SE3.Identity(), "j")
    random = np.random.default_rng(0)
    for _ in range(20):
        q, v = pin.normalize(model, random.uniform(-1, 1, model.nq)), random.uniform(-1, 1, model.nv)
        part = SeveralNumbers(kind, slice(0, 0), slice(0, model.nq), slice(0, model.nv), 0.0)
        place, twist = moved([joint], q, v)
        same, also = moved(chain, part.position(q), part.rate(q, v))
        np.testing.assert_allclose(same, place, rtol=0, atol=1e-14)
        np.testing.assert_allclose(also, twist, rtol=0, atol=1e-12)  # over the cosine of the middle hinge


def test_a_screw_is_a_hinge_and_a_slide_behind_it() -> None:
    part = SeveralNumbers(JointKind.SCREW, slice(0, 2), slice(0, 1), slice(0, 1), 0.1)
    assert ros_names("j", JointKind.SCREW) == ["j", "j_slide"]
    np.testing.assert_allclose(part.position(np.array([2.0])), [2.0, 0.2])
    np.testing.assert_allclose(part.rate(np.array([2.0]), np.array([3.0])), [3.0, 0.3])


def test_an_endless_joint_has_its_angle() -> None:
    part = SeveralNumbers(JointKind.CONTINUOUS, slice(0, 1), slice(0, 2), slice(0, 1), 0.0)
    assert ros_names("j", JointKind.CONTINUOUS) == ["j"]
    np.testing.assert_allclose(part.position(np.array([np.cos(3.0), np.sin(3.0)])), [3.0])
    np.testing.assert_allclose(part.rate(np.array([np.cos(3.0), np.sin(3.0)]), np.array([0.5])), [0.5])
