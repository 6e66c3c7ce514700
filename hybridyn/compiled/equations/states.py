"""Draw assembled states of a robot, to choose pivots and to compare models."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ...assembly.spanning import spanning_positions
from ...dynamics.direct import ddm
from ...dynamics.forward import forward
from ...dynamics.load_friction import check_determined
from ...effects.choice import Effects
from ...effects.terms import LegInertia
from ...errors import ModelError, SingularityError
from ...spatial import Array
from ...structure.mechanism import Mechanism
from ...structure.module import Module
from ...structure.robot import HybridRobot
from .idle.motion import take_out_idle


def generic_positions(module: Module) -> Array:
    """Compute positions of a module's spanning tree at its generic postures, shape (samples, nq).

    Home is the first posture if its loops are closed.
    """
    m = module.mechanism
    postures = seen_postures(m)
    return spanning_positions(
        module, postures, m.tree.sweep(postures), np.tile(m.spec.home, (len(postures), 1))
    )


def seen_postures(mechanism: Mechanism) -> Array:
    """Return generic postures of the cut tree, shape (samples, nq); home is first if its loops are closed."""
    if not mechanism.home_closes:
        return mechanism.postures
    return np.concatenate([mechanism.home[None], mechanism.postures])


def random_states(robot: HybridRobot, count: int, seed: int = 0) -> tuple[Array, Array, Array, Array]:
    """Draw assembled states with rates and efforts, and compute their accelerations.

    Returns:
        q, v, a, tau, shapes (count, nq), (count, nv), (count, nv), (count, motors).
    """
    q, v, tau = moving_states(robot, count, seed)
    return q, v, ddm(robot, q, v, tau), tau


def check_shared_loads(robot: HybridRobot, on: Effects) -> None:
    """Check, at two generic postures, that the motion determines the loads on which friction depends.

    Which loads closures share does not depend on inertia: legs have theirs here, so that the direct model is
    regular.

    Raises:
        ModelError: Redundant closures share one, or both postures are singular.
    """
    assert on.loaded is not None
    without = replace(
        on.without("limits", on.loaded.effect.name, "gear_efficiency"), leg_inertia=LegInertia()
    )
    singular: list[SingularityError] = []
    for q, v, tau in zip(*moving_states(robot, 2), strict=True):
        try:
            check_determined(on.loaded, ddm(robot, q, v, tau, effects=without, reactions=True)[1])
        except SingularityError as error:
            singular.append(error)
    if len(singular) == 2:
        name = on.loaded.effect.name
        raise ModelError(
            f"the effect '{name}' cannot be compiled: no posture tells whether redundant closures share its "
            f"loads ({singular[0]}). Use the general path for it",
            element=name,
        ) from singular[0]


def seen_positions(module: Module, count: int, rng: np.random.Generator) -> Array:
    """Choose among the generic positions of a module's spanning tree, shape (count, nq)."""
    postures = len(module.mechanism.postures)
    return generic_positions(module)[-postures:][rng.integers(postures, size=count)]


def moving_states(
    robot: HybridRobot,
    count: int,
    seed: int = 0,
    positions: Callable[[Module, int, np.random.Generator], Array] = seen_positions,
    *,
    idle: bool = True,
) -> tuple[Array, Array, Array]:
    """Draw assembled states with rates and efforts.

    Args:
        positions: Draws positions of a module's spanning tree.
        idle: Whether there are idle motions.

    Returns:
        q, v, tau, shapes (count, nq), (count, nv), (count, motors).
    """
    rng = np.random.default_rng(seed)
    q, v = np.tile(robot.home, (count, 1)), np.zeros((count, robot.nv))
    if robot.base != "fixed":
        turn = rng.normal(size=(count, 4))
        q[:, :3], q[:, 3:7] = rng.normal(size=(count, 3)), turn / np.linalg.norm(turn, axis=1, keepdims=True)
        v[:, :6] = rng.normal(size=(count, 6))
    for module in robot.modules[robot.base == "floating" :]:
        m = module.mechanism
        own = q[:, module.q_index] = positions(module, count, rng)
        x = m.cut.positions(own)
        motion = m.tree.sweep(x)
        basis = m.basis(m.closures.matrix(motion))
        u = rng.normal(size=basis.Psi.shape[::2])
        rates = np.einsum(
            "tij,tj->ti", basis.Psi, u / np.linalg.norm(basis.Psi / m.reduction.col_scale[:, None], axis=1)
        )
        if not idle:
            take_out_idle(module, rates)
        v[:, module.v_index] = m.spanning_rates(own, x, rates, np.zeros_like(rates))[0]
    tau = rng.normal(size=(count, len(robot.motors))) * _weight(robot)
    return q, v, tau


def any_accelerations(robot: HybridRobot, q: Array, v: Array, seed: int = 0, *, idle: bool = True) -> Array:
    """Draw accelerations that keep the loops closed, whatever forces they need, shape (count, nv).

    Those of idle motions are zero without `idle`. Draws of one seed are a smooth function of the states: a
    projection, while the basis of the motions that it is computed with may turn between neighbours.
    """
    rng, out = np.random.default_rng(seed), np.zeros_like(v)
    for state in forward(robot, q, v, out):
        m, at = state.mechanism, state.module.v_index
        basis = m.basis(state.K, m.closures.rates(m.tree.sweep(state.q, state.v), state.v)[1])
        unit = m.reduction.col_scale
        Q, drift = np.linalg.qr(basis.Psi / unit[:, None])[0], basis.drift / unit
        left = np.einsum("tij,ti->tj", Q, rng.normal(size=drift.shape) - drift)
        x_ddot = unit * (np.einsum("tij,tj->ti", Q, left) + drift)
        if not idle:
            take_out_idle(state.module, x_ddot)
        out[:, at] = state.spanning_accelerations(v, x_ddot)
    if robot.base == "moving":
        out[:, :6] = np.random.default_rng(seed + 1).normal(size=(len(q), 6))
    return out


def _weight(robot: HybridRobot) -> Array:
    """Compute efforts of the magnitude of the robot's weight, shape (motors,), [N or N m]."""
    mass = sum(body.mass for body in robot.bodies.bodies)
    size = mass * max(float(np.linalg.norm(robot.gravity)), 1.0)
    arms = {
        name: m.mechanism.length if m.mechanism.reduction.col_scale[c] == 1.0 else 1.0
        for m in robot.modules
        for name, c in zip(m.motors, m.motor_columns, strict=True)
    }
    return np.array([size * arms[name] for name in robot.motors])
