"""The rows of tau = Y values: the inverse model's recursion, with matrices in place of wrenches.

A body's parameters act on the motors of its own module and of the modules that carry it. The wrench of a body
is W ten (`inertial.wrench_matrix`). With the motions Phi = Psi B^-T of the module per unit work of each
motor, Eqs. (30)-(33) become

    Y[motors of the module, body]  = (J Phi)^T W       J: Jacobian of the body over x_dot
    F[body]                        = X^T W             what the module below receives, Eq. (32)
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from ..dynamics.actuation import Need, Sharing, least_norm, load_share, motion_size
from ..dynamics.backward import module_motions
from ..dynamics.forward import forward
from ..dynamics.guards import SINGULAR_MOTOR_MAP
from ..dynamics.inverse_recursion import output_jacobians
from ..dynamics.state_checks import check_closed
from ..effects.choice import Choice
from ..linkage.elimination import back_substitute, pivot_ratio, pivoted_qr
from ..linkage.motion import Motion
from ..spatial import Array, Index, cross, motion_matrix, rotate_back
from ..structure.module import ModuleState
from ..structure.robot import HybridRobot
from ..structure.samples import as_accelerations, as_positions, as_rates, same_samples
from .inertial import wrench_matrix
from .parameters import standard_parameters
from .standard import StandardParameters

#: Samples whose rows stay in the processor's cache.
IN_CACHE = 128

#: Columns of parameters, and per sample a matrix with a column for each.
Block = tuple[Index, Array]


@dataclass(frozen=True, eq=False)
class Regressor:
    """The motors' efforts as a linear function of the standard parameters: tau = Y values.

    Attributes:
        Y: Shape (motors, p), or (T, motors, p) for a batch.
        names: Name of each parameter, such as "m of rod1".
        values: The robot's own numbers, shape (p,), SI units.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> q, v, a = hybridyn.assemble(robot, motors=([0.1, 0.2], [1.0, 0.0], [0.0, 0.0]))
        >>> found = hybridyn.regressor(robot, q, v, a)
        >>> found.Y.shape, found.names[0]
        ((2, 40), 'm of m1_left_upper')
    """

    Y: Array
    names: tuple[str, ...]
    values: Array


def regressor(
    robot: HybridRobot,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    *,
    effects: Choice = None,
    symmetric: bool = False,
) -> Regressor:
    """Compute the matrix Y of tau = Y values, for every effect that is linear in its numbers.

    Args:
        robot: The robot.
        q: Positions of the spanning tree, shape (nq,) or (T, nq).
        v: Rates, shape (nv,) or (T, nv), [m/s, rad/s].
        a: Accelerations, shape (nv,) or (T, nv), [m/s^2, rad/s^2].
        effects: As in `hybridyn.idm`: "model" has rotor inertia and friction of every motor. The word
            "offsets" among them adds a constant to each motor's effort.
        symmetric: Whether legs with equal numbers share their parameters.

    Raises:
        AssemblyError: The state does not close the loops.
        SingularityError: The motors lose a direction, or closures lose rank.
        ModelError: Effects are unknown, or have no number to identify.
        TrajectoryError: An array has the wrong shape or is not finite.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> q, v, a = hybridyn.assemble(robot, motors=([0.1, 0.2], [1.0, 0.0], [0.0, 0.0]))
        >>> found = hybridyn.regressor(robot, q, v, a)
        >>> (found.Y @ found.values).round(3)
        array([ 2.128, -1.31 ])
    """
    parameters = standard_parameters(robot, effects=effects, symmetric=symmetric)
    q, single = as_positions(robot, q)
    v, a = as_rates(robot, v)[0], as_accelerations(robot, a)[0]
    same_samples(q=q, v=v, a=a)
    Y = effort_rows(robot, parameters, q, v, a)
    return Regressor(Y[0] if single else Y, parameters.names, parameters.values.copy())


def effort_rows(
    robot: HybridRobot, parameters: StandardParameters, q: Array, v: Array, a: Array, *,
    together: bool = False,
) -> Array:  # fmt: skip
    """Compute Y, shape (T, motors, p), from checked arrays of shapes (T, nq), (T, nv), (T, nv).

    Args:
        together: Whether redundant motors have the efforts that `done_together` leaves of theirs, not their
            share in the load.
    """
    on = parameters.effects
    usual = robot.base == "fixed" and all((on.gravity, on.inertia, on.velocity))
    if usual and not any(module.mechanism.closures.rows for module in robot.modules):
        return _rows_of_tree(robot, parameters, q, v, a)
    rates, a = on.inertia.motion(v, a) if on.inertia else (np.zeros_like(v), np.zeros_like(a))
    states = forward(robot, q, rates, a, on.gravity, classical=on.velocity is not None)
    check_closed(robot, states, q, rates, a)
    Y = np.zeros((len(q), len(robot.motors), len(parameters.names)))
    terms = [(term, term.efforts(q, v, a)) for term in parameters.terms]
    received: list[list[list[Block]]] = [[[] for _ in s.module.outputs] for s in states]
    for k in reversed(range(len(states))):
        s = states[k]
        Phi = motions_of_motors(robot, s, together=together)
        for term, efforts in terms:
            for i in np.flatnonzero(np.isin(term.freedoms, s.module.v_index)):
                own = np.zeros((1, len(s.module.v_index)))
                own[0, s.module.v_index == term.freedoms[i]] = 1.0
                along = Phi[:, np.flatnonzero(s.mechanism.cut.to_tree(own)[0])]
                Y[:, s.module.motor_index, term.columns[i]] += efforts[:, i, None] * along.sum(axis=1)
        passed, motors = [], s.module.motor_index
        for R, p, J, (columns, W) in _wrenches(s, parameters, robot, received[k]):
            onto = [np.matmul(J, Phi), *([motion_matrix(R, p)] if s.module.parent >= 0 else [])]
            moved = np.matmul(np.swapaxes(np.concatenate(onto, axis=2), 1, 2), W)
            Y[:, motors[:, None], columns] += moved[:, : len(motors)]
            passed.append((columns, moved[:, len(motors) :]))
        if s.module.parent >= 0:
            received[s.module.parent][s.module.parent_output] += passed
    return Y


def _rows_of_tree(robot: HybridRobot, parameters: StandardParameters, q: Array, v: Array, a: Array) -> Array:
    """Compute Y of a robot without loops by Pinocchio, one sample after the other."""
    model, Y = robot.unchanged_model, np.zeros((len(q), len(robot.motors), len(parameters.names)))
    data = model.createData()
    for at_once in (slice(first, first + IN_CACHE) for first in range(0, len(q), IN_CACHE)):
        states = zip(q[at_once], v[at_once], a[at_once], strict=True)
        tens = np.array([pin.computeJointTorqueRegressor(model, data, *state) for state in states])
        for body, at in (*parameters.bodies.items(), *parameters.payloads):
            Y[at_once][..., at] += tens[:, robot.motor_v, 10 * body - 10 : 10 * body]
    add_laws(Y, robot, parameters, np.arange(Y.shape[2]), q, v, a)
    return Y


def add_laws(
    Y: Array, robot: HybridRobot, parameters: StandardParameters, columns: Index, q: Array, v: Array, a: Array
) -> None:
    """Add what laws do at the motors' own joints to some columns of Y, shape (T, motors, k), in place."""
    place = {int(column): i for i, column in enumerate(columns)}
    motor = {int(freedom): i for i, freedom in enumerate(robot.motor_v)}
    for term in parameters.terms:
        for freedom, column, effort in zip(term.freedoms, term.columns, term.efforts(q, v, a).T, strict=True):
            if int(freedom) in motor and int(column) in place:
                Y[:, motor[int(freedom)], place[int(column)]] += effort


def _wrenches(
    s: ModuleState, parameters: StandardParameters, robot: HybridRobot, received: list[list[Block]]
) -> Iterable[tuple[Array, Array, Array, Block]]:
    """Yield the wrench matrix on each body of a module, with placement (R, p) and Jacobian of the body."""
    m, on = s.mechanism, parameters.effects
    rest = np.zeros_like(s.v)
    legs = s.motion if on.velocity else m.tree.sweep(s.q, rest, s.a)
    J_outputs = output_jacobians(s)
    for number, joint in enumerate(m.spec.tree_body):
        body = robot.body_of_joint[s.module.joints[joint - 1]] if joint else -1
        if number in m.spec.outputs:
            o = m.spec.outputs.index(number)
            J, blocks = J_outputs[:, o], list(received[o])
            V, V_dot = s.outputs[:, o], s.outputs_dot[:, o]
            w = V[:, 3:] if on.velocity else np.zeros_like(V[:, 3:])
            W_own = V_dot[:, :3] + cross(w, V[:, :3]), w, V_dot[:, 3:]
        else:
            J, blocks = m.jacobian(s.motion, number), []
            W_own = _of_leg(s, legs.of_body(number), on.velocity is not None)
        own = [at for loaded, at in (*parameters.bodies.items(), *parameters.payloads) if loaded == body]
        blocks += [(at, wrench_matrix(*W_own)) for at in own]
        for block in blocks:
            yield s.motion.R[:, number], s.motion.p[:, number], J, block


def _of_leg(s: ModuleState, body: Motion, velocity: bool) -> tuple[Array, Array, Array]:
    """Compute acceleration minus gravity, angular velocity and acceleration of a leg's body, body axes."""
    V = s.V if velocity else np.zeros_like(s.V)
    w0, wd0 = V[:, 3:], s.V_dot[:, 3:]
    start = s.V_dot[:, :3] + cross(w0, V[:, :3])
    swept = cross(wd0, body.p) + cross(w0, cross(w0, body.p)) + 2.0 * cross(w0, body.p_dot)
    vectors = start + swept + body.p_ddot, body.w + w0, body.w_dot + wd0 + cross(w0, body.w)
    acceleration, w, w_dot = (rotate_back(body.R, x) for x in vectors)
    return acceleration, w, w_dot


def redundant(robot: HybridRobot) -> bool:
    """Return whether some motors are more than the motions that they drive."""
    return any(len(module.moving_motors) > module.driven for module in robot.modules)


def done_together(robot: HybridRobot, q: Array) -> Array | None:
    """Compute Pi, shape (T, motors, motors): Pi tau is the part of efforts that motors do together.

    It is B^+ B of Eq. (33), B tau = Q, with a pseudo-inverse in units in which efforts compare [N m]. What it
    leaves out, redundant motors do against each other: no motion tells it.

    Args:
        q: Closed positions, shape (T, nq).

    Returns:
        Pi, or None where no motor is redundant.

    Raises:
        SingularityError: The motors lose a direction, or closures lose rank.
    """
    if not redundant(robot):
        return None
    rest, out = np.zeros((len(q), robot.nv)), np.tile(np.eye(len(robot.motors)), (len(q), 1, 1))
    for s in forward(robot, q, rest, rest, None):
        if len(s.module.moving_motors) > s.module.driven:
            Phi, at = motions_of_motors(robot, s, together=True), s.module.motor_index
            out[:, at[:, None], at] = np.swapaxes(Phi[:, s.module.motor_columns], 1, 2)
    return out


def motions_of_motors(robot: HybridRobot, s: ModuleState, *, together: bool = False) -> Array:
    """Compute Phi = Psi B^-T: generalised forces H along x need the efforts Phi^T H, shape (T, n, motors).

    Redundant motors share the load, and motors that are too few carry what they can, as in `idm`.

    Args:
        together: Whether redundant motors share alike in what they do together, in units that compare [N m].

    Raises:
        SingularityError: The motors lose a direction, or closures lose rank.
    """
    module, basis = s.module, module_motions(s, strict=True)
    columns = module.motor_columns[module.moving_motors]
    T, n, N = basis.Psi.shape
    out = np.zeros((T, n, len(module.motors)))
    if not len(columns):
        return out
    unit = module.mechanism.reduction.col_scale[columns]
    B, Psi_t = np.swapaxes(basis.Psi[:, columns], 1, 2) / unit, np.swapaxes(basis.Psi, 1, 2)
    solved, hard = np.zeros((T, len(columns), n)), np.arange(T)
    if len(columns) == N:
        R, order = pivoted_qr(np.concatenate([B, Psi_t], axis=2), N, N)
        np.put_along_axis(solved, order[..., None], back_substitute(R[..., :N], R[..., N:]), axis=1)
        hard = np.flatnonzero(pivot_ratio(R, N, motion_size(module, basis.Psi)) < SINGULAR_MOTOR_MAP * N)
    if len(hard):
        own_share = len(columns) > module.driven and not together
        share = load_share(robot, module, None) * unit if own_share else np.ones(len(columns))
        each = [
            Need(basis.Psi, np.tile(one, (T, 1)), np.zeros(T), np.zeros(T), s.motion) for one in np.eye(N)
        ]
        sharing = Sharing(None, "raise", "")
        inverse = [least_norm(module, B, need, share, sharing, hard) for need in each]
        solved[hard] = np.matmul(np.stack(inverse, axis=2), Psi_t[hard])
    out[:, :, module.moving_motors] = np.swapaxes(solved, 1, 2) / unit
    return out
