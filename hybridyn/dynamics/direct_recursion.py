"""Equations (38)-(53) of the direct model: articulated inertias inwards, accelerations outwards.

A module whose base accelerates with V_dot moves with u_dot, and its outputs o with V_dot_o:

    A_t u_dot = Q_0 - E V_dot,      V_dot_o = X_o V_dot + a_o u_dot + c_o

`articulate` is the backward sweep, `accelerate` the forward one. Inertias have the congruence form of
Eqs. (45), (47), which keeps them positive semidefinite; the paper's S2, S3, K and alpha are not needed.
`rounding` bounds, from what a module keeps here, what rounding feigns in A_t; `guards` says what is refused.
"""

import numpy as np

from ..linkage.motion import Motion
from ..linkage.reduction import Basis
from ..spatial import Array, congruence, motion_matrix
from ..structure.module import ModuleState
from ..structure.robot import HybridRobot
from .articulated_module import ArticulatedModule
from .guards import check_closure_rank
from .inverse_recursion import output_jacobians
from .loads import LegTerms, Loads
from .possible_motions import least_norm, motions_of
from .rounding import Rounding, check_accelerations, check_massless


def articulate(
    robot: HybridRobot, states: list[ModuleState], loads: Loads, tau: Array, prescribed: Array | None,
    *, passing: bool = False,
) -> list[ArticulatedModule]:  # fmt: skip
    """Run the backward sweep: compute articulated inertias and biases, the outermost modules first.

    Args:
        states: States of the robot's modules.
        loads: External wrenches and effects.
        tau: Motor efforts, shape (T, motors).
        prescribed: Accelerations, shape (T, nv), whose entries for motors are prescribed, or None.
        passing: At postures of lost rank, use the motions of the branch that the velocity belongs to.

    Raises:
        SingularityError: Closures lose rank, or a force acts on a motion without inertia.
    """
    out: list[ArticulatedModule] = []
    I_star = [np.tile(s.mechanism.inertias, (len(tau), 1, 1, 1)) for s in states]
    beta_star = [
        loads.on.body_bias(s.outputs, s.mechanism.inertias) - load.on_outputs(s)  # Eq. (38)
        for s, load in zip(states, loads.modules, strict=True)
    ]
    rounding = Rounding(I_star)
    for k in reversed(range(len(states))):
        s, module = states[k], states[k].module
        basis, unforced = motions_of(s, prescribed, passing)
        check_closure_rank(module, basis)
        legs, efforts = loads.leg_terms(k, s), tau[:, module.motor_index]
        x = _equation_of_motion(s, basis, unforced, legs, I_star[k], beta_star[k], efforts)
        x.inertia = rounding.factor(k, x)
        solved, left = x.inertia.solve(np.concatenate([x.E, x.Q_0[..., None]], axis=-1))
        x.G, x.y = solved[..., :6], solved[..., 6]
        check_massless(x, left[..., 6])
        out.insert(0, x)
        if module.parent >= 0:
            inertia, bias = _onto_base(x)
            I_star[module.parent][:, module.parent_output] += inertia
            beta_star[module.parent][:, module.parent_output] += bias
            rounding.hand_on(k, x)
    return out


def _equation_of_motion(
    s: ModuleState, basis: Basis, unforced: Motion, legs: LegTerms, I_star: Array, beta_star: Array,
    tau: Array,
) -> ArticulatedModule:  # fmt: skip
    """Compute A_t, E and Q_0 of one module, summed over its legs and outputs."""
    Psi, A, D = basis.Psi, legs.M[:, 6:, 6:], legs.M[:, 6:, :6]
    f = legs.f - legs.h - np.einsum("tij,tj->ti", A, basis.drift)
    f[:, s.module.motor_columns] += tau
    A_t = congruence(Psi, A)  # Eqs. (43), (49): the legs
    E = np.einsum("tij,tik->tjk", Psi, D)  # Eq. (42): the legs
    Q_0 = np.einsum("tij,ti->tj", Psi, f)  # Eqs. (44), (50): the legs, and the motors of Eq. (40)
    J, X, bodies = output_jacobians(s), motion_matrix(*s.placements), list(s.mechanism.spec.outputs)
    a = np.matmul(J, Psi[:, None])
    c = (
        np.matmul(J, basis.drift[:, None, :, None])[..., 0]
        + unforced.acceleration()[:, bodies]
        + s.convective
    )
    b = np.einsum("toij,toj->toi", I_star, c) + beta_star  # Eq. (39) at u_dot = 0, V_dot = 0
    A_t += congruence(a, I_star).sum(axis=1)  # Eq. (43)
    E += np.matmul(np.swapaxes(a, 2, 3), np.matmul(I_star, X)).sum(axis=1)  # Eq. (42)
    Q_0 -= np.einsum("toij,toi->tj", a, b)  # Eq. (44)
    return ArticulatedModule(s, basis, legs, I_star, beta_star, tau, a, X, c, b, f, A_t, E, Q_0)


def _onto_base(x: ArticulatedModule) -> tuple[Array, Array]:
    """Compute what a module adds to the inertia, shape (T, 6, 6), and the bias, shape (T, 6), of its base."""
    Psi, G, legs = x.basis.Psi, x.G, x.legs
    with_base = np.concatenate([np.tile(np.eye(6), (len(G), 1, 1)), -np.matmul(Psi, G)], axis=1)
    inertia = congruence(with_base, legs.M)  # Eqs. (41), (45), (47)
    held = np.einsum("tij,ti->tj", legs.M[:, 6:, :6], x.basis.drift) + legs.p
    bias = held + np.einsum("tij,ti->tj", G, x.Q_0)  # Eqs. (41), (46), (48)
    inertia += congruence(x.X - np.matmul(x.a_maps, G[:, None]), x.I_star).sum(axis=1)
    bias += np.einsum("toij,toi->tj", x.X, x.b)
    return inertia, bias


def accelerate(robot: HybridRobot, modules: list[ArticulatedModule], v: Array, a: Array) -> None:
    """Run the forward sweep: compute the accelerations of the spanning tree.

    Args:
        modules: The robot's modules after `articulate`.
        v: Rates, shape (T, nv).
        a: Accelerations, shape (T, nv), filled in place.
    """
    outputs: list[Array] = []
    for x in modules:
        s, module = x.state, x.state.module
        V_dot = s.V_dot if module.parent < 0 else outputs[module.parent][:, module.parent_output]
        carried = np.einsum("tij,tj->ti", x.G, V_dot)
        u_dot = x.y - carried  # Eqs. (40), (51)
        least_norm(module, x.basis, x.inertia, u_dot)
        moved = np.einsum("toij,tj->toi", x.X, V_dot) + np.einsum("toij,tj->toi", x.a_maps, u_dot)
        outputs.append(moved + x.c)  # Eq. (53)
        x_ddot = np.einsum("tij,tj->ti", x.basis.Psi, u_dot) + x.basis.drift  # Eqs. (35), (36)
        check_accelerations(x, carried, x_ddot, robot.gravity)
        a[:, module.v_index] = s.spanning_accelerations(v, x_ddot)
