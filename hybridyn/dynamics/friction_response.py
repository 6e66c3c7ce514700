"""How the wrenches of joints answer to friction in the direct model, module by module.

Friction n of a module's joints has the efforts D n. With the change beta_o of the bias of each output, which
outer modules hand on, and V_dot of the base, Eqs. (40) to (53) change linearly:

    u_dot   = A_t^-1 Q - G V_dot,  Q = Psi^T D n - sum a_o^T beta_o
    beta    = G^T Q + sum X_o^T beta_o                                inwards
    V_dot_o = X_o V_dot + a_o u_dot                                   outwards

So the answer to any friction takes one sweep inwards and one outwards over matrices that are computed once.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..effects.choice import Effects
from ..effects.load_friction import OnLoads
from ..spatial import Array, Index, motion_matrix
from ..structure.module import ModuleState
from ..structure.robot import HybridRobot
from .articulated_module import ArticulatedModule
from .backward import reactions_of
from .direct_recursion import accelerate, articulate
from .inverse_recursion import output_jacobians
from .joint_wrenches import heavy_bodies, joint_wrenches, needed_of_closures
from .loads import Loads
from .reactions import Reactions, multipliers_of


class Response(NamedTuple):
    """What one module's wrenches, base and outputs feel of z = [beta of every output; n], and of V_dot.

    Attributes:
        parent, parent_output: Where it stands, as in `Module`.
        joints: Numbers of the law's joints that it has.
        inward: beta of its base per z, shape (T, 6, 6 outputs + joints).
        carried: V_dot of its outputs per V_dot, shape (T, 6 outputs, 6).
        driven: V_dot of its outputs per z, shape (T, 6 outputs, 6 outputs + joints).
        of_base: Wrenches of the law's joints per V_dot, shape (T, joints, 6, 6).
        of_z: The same per z, shape (T, joints, 6, 6 outputs + joints).
    """

    parent: int
    parent_output: int
    joints: Index
    inward: Array
    carried: Array
    driven: Array
    of_base: Array
    of_z: Array


def answering(
    robot: HybridRobot, law: OnLoads, D: Array, states: list[ModuleState], q: Array, v: Array, a: Array,
    tau: Array, loads: Loads, *, passing: bool = False,
) -> tuple[Reactions, list[Response]]:  # fmt: skip
    """Compute the reactions of the direct model without load friction, and how every module answers to it.

    Args:
        robot: The robot.
        law: The law and its joints.
        D: Efforts per unit of each joint's friction, shape (T, nv, joints).
        states: States of its modules before accelerations are known; they close the loops.
        q, v, a: Shapes (T, nq), (T, nv), (T, nv); of accelerations, those of a moving base are read.
        tau: Efforts behind the gears, shape (T, motors).
        loads: External wrenches and effects.
        passing: As in `articulate`.

    Raises:
        SingularityError: As `articulate`.
    """
    moved, modules = a.copy(), articulate(robot, states, loads, tau, None, passing=passing)
    accelerate(robot, modules, v, moved)
    owner = np.array([robot.module_of(name) for name in law.joints])
    answers = [_response(x, loads.on, law, np.flatnonzero(owner == k), D) for k, x in enumerate(modules)]
    return reactions_of(robot, q, v, moved, tau, loads), answers


def _response(x: ArticulatedModule, on: Effects, law: OnLoads, joints: Index, D: Array) -> Response:
    """Compute how one module answers to unit columns of [V_dot; beta of every output; n]."""
    s, m, module = x.state, x.state.mechanism, x.state.module
    T, outputs = len(D), len(module.outputs)
    count = 6 + 6 * outputs + len(joints)
    V, beta, n = np.split(np.tile(np.eye(count), (T, 1, 1)), [6, 6 + 6 * outputs], axis=1)
    beta = beta.reshape(T, outputs, 6, count)
    friction = np.matmul(m.cut.to_tree(D[:, module.v_index][:, :, joints]), n)
    a_T, X_T = np.swapaxes(x.a_maps, 2, 3), np.swapaxes(x.X, 2, 3)
    Q = np.matmul(np.swapaxes(x.basis.Psi, 1, 2), friction) - np.matmul(a_T, beta).sum(axis=1)
    u_dot = x.inertia.solve(Q)[0] - np.matmul(x.G, V)
    inward = np.matmul(np.swapaxes(x.G, 1, 2), Q) + np.matmul(X_T, beta).sum(axis=1)
    V_o = np.matmul(x.X, V[:, None]) + np.matmul(x.a_maps, u_dot[:, None])
    W = np.matmul(x.I_star, V_o) + beta
    x_ddot = np.matmul(x.basis.Psi, u_dot)
    H = np.matmul(x.legs.M[:, 6:], np.concatenate([V, x_ddot], axis=1)) - friction
    H += np.matmul(np.swapaxes(output_jacobians(s), 2, 3), W).sum(axis=1)
    needed = needed_of_closures(s, multipliers_of(s, H)[0])
    needed[:, list(m.spec.outputs)] += np.matmul(X_T, W)
    for body, inertia in heavy_bodies(s, on):
        X = motion_matrix(s.whole.R[:, body], s.whole.p[:, body])
        moved = np.matmul(X, V) + np.matmul(m.jacobian(s.motion, body), x_ddot)
        needed[:, body] += np.matmul(np.swapaxes(X, 1, 2), np.matmul(inertia, moved))
    at = [m.spec.source.index(module.joints.index(law.joints[j])) for j in joints]
    wrenches = joint_wrenches(s, needed)[:, at]
    V_o = V_o.reshape(T, -1, count)
    return Response(
        module.parent, module.parent_output, joints, inward[..., 6:], V_o[..., :6], V_o[..., 6:],
        wrenches[..., :6], wrenches[..., 6:],
    )  # fmt: skip


def answer(modules: Sequence[Response], n: Array) -> Array:
    """Compute the wrenches that friction causes.

    Args:
        modules: How every module answers.
        n: Columns of the friction of each joint, shape (T, joints, k).

    Returns:
        Shape (T, joints, 6, k).
    """
    T, joints, k = n.shape
    betas = [np.zeros((T, x.carried.shape[1], k)) for x in modules]
    inputs: list[Array] = []
    for x, beta in zip(reversed(modules), reversed(betas), strict=True):
        inputs.insert(0, np.concatenate([beta, n[:, x.joints]], axis=1))
        if x.parent >= 0:
            betas[x.parent][:, rows_of_base(x)] += np.matmul(x.inward, inputs[0])
    out, outputs = np.zeros((T, joints, 6, k)), list[Array]()
    for x, z in zip(modules, inputs, strict=True):
        V_dot = np.zeros((T, 6, k)) if x.parent < 0 else outputs[x.parent][:, rows_of_base(x)]
        outputs.append(np.matmul(x.carried, V_dot) + np.matmul(x.driven, z))
        out[:, x.joints] = np.matmul(x.of_base, V_dot[:, None]) + np.matmul(x.of_z, z[:, None])
    return out


def rows_of_base(x: Response) -> slice:
    """Return the rows of a module's base among those of its parent's outputs."""
    return slice(6 * x.parent_output, 6 * x.parent_output + 6)
