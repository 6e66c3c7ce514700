"""The batched sweep over a tree of every kind of joint, against Pinocchio."""

import numpy as np
import pinocchio as pin
import pytest

from hybridyn.linkage.motion import Motion
from hybridyn.linkage.tree import Tree, TreeJoint
from hybridyn.structure.bodies import merge_fixed_joints
from tests.judges.peers import Peer
from tests.robots.mechanisms import random_mechanism
from tests.support.comparing import ROUNDING, close_to

SAMPLES = 12
KINDS = ("serial_all", "legged", "scara_delta")  # every joint; two branches; fixed joints in between
MANIFOLD = 1e-12  # quaternion and half-angle formulas on both sides


@pytest.fixture(params=KINDS)
def case(request: pytest.FixtureRequest) -> tuple[Tree, Peer, np.ndarray, np.ndarray, np.ndarray]:
    description = random_mechanism(1, kind=request.param)
    bodies = merge_fixed_joints(description)
    tree = Tree(
        [TreeJoint(j.joint.name, j.joint.kind, j.parent, j.R, j.p, j.joint.axis) for j in bodies.joints]
    )
    peer = Peer(description)
    rng = np.random.default_rng(3)
    q = np.array(
        [pin.integrate(peer.model, pin.neutral(peer.model), rng.normal(size=tree.nv)) for _ in range(SAMPLES)]
    )
    v, a = rng.normal(size=(2, SAMPLES, tree.nv))
    return tree, peer, q, v, a


def frames(peer: Peer, tree: Tree) -> list[tuple[int, np.ndarray]]:
    """Return Pinocchio's joint and the turn of our body's axes in it (the peer aligns joints with z)."""
    turns = {
        index: placement.rotation
        for index, placement in peer.links.values()
        if not placement.translation.any()
    }
    return [
        (peer.model.getJointId(joint.name), turns[peer.model.getJointId(joint.name)]) for joint in tree.joints
    ]


def test_sizes_and_neutral_position(case: tuple) -> None:
    tree, peer, *_ = case
    assert (tree.nq, tree.nv) == (peer.model.nq, peer.model.nv)
    close_to(tree.neutral(), pin.neutral(peer.model), ROUNDING)
    assert tree.q_slices[-1].stop == tree.nq
    assert np.array_equal(
        tree.dof_body,
        np.repeat(np.arange(1, len(tree.joints) + 1), [s.stop - s.start for s in tree.v_slices]),
    )


def test_sweep_is_pinocchios_forward_kinematics(case: tuple) -> None:
    tree, peer, q, v, a = case
    motion = tree.sweep(q, v, a)
    at = frames(peer, tree)
    for t in range(SAMPLES):
        pin.forwardKinematics(peer.model, peer.data, q[t], v[t], a[t])
        for body, (index, turn) in enumerate(at, start=1):
            M = peer.data.oMi[index]
            M = pin.SE3(M.rotation @ turn, M.translation)
            inside = pin.SE3(turn, np.zeros(3))
            close_to(motion.R[t, body], M.rotation, ROUNDING)
            assert np.abs(motion.p[t, body] - M.translation).max() < ROUNDING
            close_to(motion.of_body(body).twist()[t], inside.actInv(peer.data.v[index]).vector, ROUNDING)
            close_to(
                motion.of_body(body).acceleration()[t], inside.actInv(peer.data.a[index]).vector, ROUNDING
            )


def test_accelerations_left_out_leave_what_the_rates_cause(case: tuple) -> None:
    tree, _, q, v, a = case
    none, zero, whole = tree.sweep(q, v), tree.sweep(q, v, np.zeros_like(a)), tree.sweep(q, v, a)
    only = tree.sweep(q, np.zeros_like(v), a)
    close_to(none.p_ddot, zero.p_ddot, ROUNDING)
    close_to(none.w_dot, zero.w_dot, ROUNDING)
    close_to(none.p_ddot + only.p_ddot, whole.p_ddot, ROUNDING)
    still = tree.sweep(q)
    assert not still.w.any()
    assert not still.p_ddot.any()


def test_jacobian_is_what_the_rates_do(case: tuple) -> None:
    tree, _, q, v, _ = case
    motion = tree.sweep(q, v)
    rng = np.random.default_rng(1)
    for body in range(len(tree.joints) + 1):
        moved = np.einsum("tij,tj->ti", tree.jacobian(motion, body), v)
        close_to(np.concatenate([motion.p_dot[:, body], motion.w[:, body]], axis=1), moved, ROUNDING)
        arm = rng.normal(size=(SAMPLES, 3))
        at_point = np.einsum("tij,tj->ti", tree.jacobian(motion, body, motion.p[:, body] + arm), v)[:, :3]
        close_to(at_point, motion.p_dot[:, body] + np.cross(motion.w[:, body], arm), ROUNDING)


def test_a_batch_gives_what_its_samples_give_alone(case: tuple) -> None:
    tree, _, q, v, a = case
    whole = tree.sweep(q, v, a)
    for t in (0, SAMPLES - 1):
        one = tree.sweep(q[t : t + 1], v[t : t + 1], a[t : t + 1])
        for name in Motion._fields:
            close_to(getattr(one, name)[0], getattr(whole, name)[t], ROUNDING)
    mask = np.arange(SAMPLES) % 3 == 0
    taken = whole.take(mask)
    assert all(np.array_equal(getattr(taken, n), getattr(whole, n)[mask]) for n in Motion._fields)


@pytest.mark.parametrize("size", [1e-9, 0.5, 3.1])
def test_difference_undoes_integrate(case: tuple, size: float) -> None:
    """Steps of nearly half a turn come back, and those of joints that only turn or slide are Pinocchio's."""
    tree, peer, q, _, _ = case
    rng = np.random.default_rng(7)
    dq = rng.normal(size=(SAMPLES, tree.nv))
    for at in tree.v_slices:
        dq[:, at] *= size / np.linalg.norm(dq[:, at], axis=1, keepdims=True)
    end = tree.integrate(q, dq)
    assert np.abs(tree.difference(q, end) - dq).max() < MANIFOLD * max(size, 1e-2)
    expected = np.array([pin.integrate(peer.model, x, d) for x, d in zip(q, dq, strict=True)])
    for joint, at in zip(tree.joints, tree.q_slices, strict=True):
        if joint.kind not in ("planar", "floating"):
            sign = (
                np.sign(np.sum(end[:, at] * expected[:, at], axis=1))[:, None]
                if joint.kind == "spherical"
                else 1
            )
            close_to(sign * end[:, at], expected[:, at], MANIFOLD)


def test_bodies_joined_by_fixed_joints_keep_mass_and_inertia(case: tuple) -> None:
    peer = case[1]
    bodies = merge_fixed_joints(peer.description)
    for body in bodies.bodies[1:]:
        index = peer.model.getJointId(bodies.joints[body.joint].joint.name)
        turn = dict(
            frames(
                peer,
                Tree(
                    [
                        TreeJoint(j.joint.name, j.joint.kind, j.parent, j.R, j.p, j.joint.axis)
                        for j in bodies.joints
                    ]
                ),
            )
        )[index]
        expected = peer.model.inertias[index]
        close_to(np.array(body.mass), np.array(expected.mass), ROUNDING)
        close_to(turn @ body.com, expected.lever, ROUNDING)
        close_to(turn @ body.inertia @ turn.T, expected.inertia, ROUNDING)
