"""Compute the wrenches that the joints of a module transmit, by balances of the bodies beyond each joint.

The sum of what these bodies need runs over the whole tree from its ends to the base. Closures act on two of
its bodies; the weld of a wrist that was cut acts on the wrist's end and on its target.
"""

from __future__ import annotations

import numpy as np

from ..effects.choice import Effects
from ..linkage.closure_rows import normals
from ..linkage.closures import TreeClosure
from ..linkage.motion import Motion
from ..spatial import (
    Array,
    crm,
    hat,
    motion_matrix,
    motion_to_body,
    rotate_back,
    spatial_inertia,
    wrench_to_base,
)
from ..structure.module import ModuleState
from .loads import ModuleLoad


def joint_wrenches(state: ModuleState, needed: Array) -> Array:
    """Compute the wrench that each joint of the whole tree exerts on its child.

    Args:
        state: State of the module.
        needed: Columns of the wrench that each body needs of its joints, shape (T, bodies, 6, k), base axes,
            about the base's origin.

    Returns:
        Shape (T, joints, 6, k), in the child's frame, at its origin.
    """
    R, p, total = state.whole.R[:, 1:], state.whole.p[:, 1:], needed.copy()
    for i, joint in reversed([*enumerate(state.mechanism.cut.whole.joints)]):
        total[:, joint.parent] += total[:, i + 1]
    to_child = motion_matrix(np.swapaxes(R, 2, 3), -rotate_back(R, p))  # of the base, seen from the child
    out: Array = np.matmul(np.swapaxes(to_child, 2, 3), total[:, 1:])
    return out


def needed_by_bodies(state: ModuleState, load: ModuleLoad, on: Effects, W: Array) -> Array:
    """Compute the wrench that each body of the whole tree needs of joints and closures.

    Args:
        state: State of the module.
        load: Wrenches on its bodies.
        on: The effects that are computed.
        W: Wrench that each output needs, shape (T, outputs, 6), output frames.

    Returns:
        Shape (T, bodies, 6), base axes, about the base's origin.
    """
    m, whole = state.mechanism, state.whole
    out = np.zeros((len(state.V), len(m.spec.bodies), 6))
    outputs = list(m.spec.outputs)
    out[:, outputs] = wrench_to_base(*state.placements, W)
    heavy, own = _of_leg_bodies(state, on)
    out[:, heavy] += wrench_to_base(whole.R[:, heavy], whole.p[:, heavy], own)
    for body, wrench in load.bodies:
        if (at := m.cut.whole_body(body)) not in outputs:
            out[:, at] -= wrench_to_base(whole.R[:, at], whole.p[:, at], wrench)
    for number, weld in enumerate(m.cut.welds):
        at = m.cut.whole_body(m.spec.wrists[number].end)
        through = load.inside_wrist(state, number)
        _act(out, weld, wrench_to_base(whole.R[:, at], whole.p[:, at], through))
    return out


def _of_leg_bodies(state: ModuleState, on: Effects) -> tuple[list[int], Array]:
    """Return the leg bodies that have mass, and the wrench that each needs for its own motion, own frame."""
    heavy = heavy_bodies(state, on)
    if not heavy:
        return [], np.zeros((len(state.V), 0, 6))
    bodies, inertias = [i for i, _ in heavy], np.array([inertia for _, inertia in heavy])
    V, motion = state.V, state.motion
    if on.velocity is None:
        still = np.zeros_like(state.v)
        V, motion = np.zeros_like(V), state.mechanism.tree.sweep(state.q, still, state.a, motion)
    motion = Motion(*(x[:, bodies] for x in motion.arrays))
    relative = motion.twist()
    twist = motion_to_body(motion.R, motion.p, V[:, None]) + relative  # Eq. (25)
    twist_dot = motion_to_body(motion.R, motion.p, state.V_dot[:, None]) + motion.acceleration()
    twist_dot += crm(twist, relative)  # Eq. (28)
    return bodies, np.einsum("tbi,bij->tbj", twist_dot, inertias) + on.body_bias(twist, inertias)


def heavy_bodies(state: ModuleState, on: Effects) -> list[tuple[int, Array]]:
    """Return the leg bodies that have mass, by their numbers in the whole tree, and their 6-D inertias."""
    legs = enumerate(state.mechanism.spec.leg_bodies, 1) if on.leg_inertia else ()
    return [(i, spatial_inertia(b.mass, b.com, b.inertia)) for i, b in legs if b and not b.massless]


def needed_of_closures(state: ModuleState, multipliers: Array) -> Array:
    """Compute the wrench that bodies of the whole tree need because closures act on them.

    Args:
        state: State of the module.
        multipliers: Those of its closure rows, columns of shape (T, rows, k).

    Returns:
        Shape (T, bodies, 6, k), base axes, about the base's origin.
    """
    m = state.mechanism
    out = np.zeros((len(state.V), len(m.spec.bodies), 6, multipliers.shape[2]))
    welds = {wrist.closure: weld for wrist, weld in zip(m.spec.wrists, m.cut.welds, strict=True)}
    for i, closure in enumerate(m.closures.closures):
        unit = unit_wrenches(state.motion, closure, np.zeros(3))
        _act(out, welds.get(i, closure), np.matmul(unit, multipliers[:, m.closures.row_slices[i]]))
    return out


def unit_wrenches(motion: Motion, closure: TreeClosure, about: Array) -> Array:
    """Compute the wrench on a closure's second body per unit of each multiplier of its rows.

    Args:
        motion: Motion of the tree of the closure.
        closure: The closure.
        about: Point about which moments are taken, shape (T, 3) or (3,), [m], base frame.

    Returns:
        Shape (T, 6, rows of the closure), base axes.
    """
    A, _, B, pb = closure_frames(motion, closure)
    turns = np.swapaxes(normals(closure.rotation, A, B[:, :, 2]), 1, 2)
    force = np.concatenate([A[:, :, closure.translations], np.zeros_like(turns)], axis=2)
    moment = np.matmul(hat(pb - about), force)
    moment[:, :, len(closure.translations) :] = turns
    return np.concatenate([force, moment], axis=1)


def closure_frames(motion: Motion, c: TreeClosure) -> tuple[Array, Array, Array, Array]:
    """Return axes (T, 3, 3) and origin (T, 3) of a closure's frame A, then of frame B, in the base frame."""
    Ra, Rb = motion.R[:, c.body_a], motion.R[:, c.body_b]
    return Ra @ c.R_a, motion.p[:, c.body_a] + Ra @ c.p_a, Rb @ c.R_b, motion.p[:, c.body_b] + Rb @ c.p_b


def _act(needed: Array, closure: TreeClosure, wrench: Array) -> None:
    """Let a wrench act on the second body of a closure, and its opposite on the first, in place."""
    needed[:, closure.body_a] += wrench
    needed[:, closure.body_b] -= wrench
