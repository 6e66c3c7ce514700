"""The forward recursion over modules: placements, twists and accelerations of every output, Eqs. (25), (28).

Both dynamic models begin here. Gravity is carried by the base's acceleration and appears nowhere else.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ..effects.terms import Gravity
from ..errors import TrajectoryError
from ..linkage.tree import Motion
from ..spatial import Array, crm, cross, motion_to_body
from ..structure.mechanism import Mechanism
from ..structure.module import Module
from ..structure.robot import HybridRobot

GRAVITY = Gravity()


@dataclass
class ModuleState:
    """One module at every sample.

    Attributes:
        module: The module.
        spanning: Motion of its spanning tree relative to its base.
        motion: The same motion for the tree after the cuts.
        q: Positions on the tree after the cuts, shape (T, nq).
        v: Rates x_dot, shape (T, n).
        a: Accelerations x_ddot, shape (T, n); zero where none were given.
        V: Twist of the base, shape (T, 6), base frame.
        V_dot: Spatial acceleration of the base less gravity, shape (T, 6), base frame.
        outputs: Twists V_o of the outputs, shape (T, outputs, 6), own frames.
        outputs_dot: Their spatial accelerations less gravity, shape (T, outputs, 6), own frames.
        convective: The part of those that relative twists v_o bring, crm(V_o) v_o, shape (T, outputs, 6).

    With `forward(..., classical=True)` twists and accelerations are those that an observer sees who moves
    along with the origin of the frame concerned: V_lin = 0, and V_dot_lin is the classical acceleration.
    """

    module: Module
    spanning: Motion
    motion: Motion
    q: Array
    v: Array
    a: Array
    V: Array
    V_dot: Array
    outputs: Array
    outputs_dot: Array
    convective: Array

    @cached_property
    def K(self) -> Array:
        """Closure rows of the module, shape (T, rows, n)."""
        return self.mechanism.closures.matrix(self.motion)

    @property
    def mechanism(self) -> Mechanism:
        """The module's numbers."""
        return self.module.mechanism

    def placement(self, output: int) -> tuple[Array, Array]:
        """Give the placement (R, p) of an output in the base, shapes (T, 3, 3), (T, 3)."""
        body = self.mechanism.spec.outputs[output]
        return self.motion.R[:, body], self.motion.p[:, body]


def as_batch(array: ArrayLike, width: int, name: str) -> tuple[Array, bool]:
    """Give samples as (T, width) and say whether one single sample came in.

    Raises:
        TrajectoryError: Wrong shape, or a number that is not finite.
    """
    out = np.asarray(array, dtype=float)
    single = out.ndim == 1
    if single:
        out = out[None]
    if out.ndim != 2 or out.shape[1] != width:
        raise TrajectoryError(f"{name} has shape {np.shape(array)}; wanted ({width},) or (T, {width})")
    bad = np.flatnonzero(~np.isfinite(out).all(axis=1))
    if len(bad):
        raise TrajectoryError(f"{name} is not finite at sample {bad[0]}", row=int(bad[0]) + 1)
    return out, single


def same_samples(**arrays: Array) -> None:
    """Refuse batches of different sizes.

    Raises:
        TrajectoryError: With the sizes.
    """
    sizes = [len(x) for x in arrays.values()]
    if len(set(sizes)) > 1:
        raise TrajectoryError(f"{', '.join(arrays)} have {', '.join(map(str, sizes))} samples")


def base_motion(
    robot: HybridRobot,
    q: Array,
    v: Array,
    a: Array,
    gravity: Gravity | None = GRAVITY,
    *,
    classical: bool = False,
) -> tuple[Array, Array]:
    """Give V_0 and V_dot_0 - g of the body that the first modules stand on, shapes (T, 6).

    For "fixed" and "floating" that is the world; for "moving" the root body, whose motion is prescribed.
    `classical` as in `forward`.
    """
    T = len(q)
    V, V_dot = np.zeros((2, T, 6))
    if robot.base == "moving":
        V, V_dot = v[:, :6].copy(), a[:, :6].copy()
        if classical:
            V_dot[:, :3] += cross(V[:, 3:], V[:, :3])
            V[:, :3] = 0.0
    if gravity is not None:
        V_dot[:, :3] -= gravity.carried(robot, q)
    return V, V_dot


def forward(
    robot: HybridRobot,
    q: Array,
    v: Array,
    a: Array | None,
    gravity: Gravity | None = GRAVITY,
    *,
    classical: bool = False,
) -> list[ModuleState]:
    """Run the forward recursion.

    Args:
        robot: The robot.
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv).
        a: Accelerations, shape (T, nv); without them accelerations are those of a_o u_dot = 0 (not used).
        gravity: Weights, or None for none.
        classical: Whether every frame is seen by an observer who moves along with its origin. Forces and
            relative accelerations are the same (Galilei), but no digit is spent on w x v, which grows with
            the square of a chain's length.

    Returns:
        One state per module, in the order of `robot.modules`.
    """
    given = np.zeros_like(v) if a is None else a
    root = base_motion(robot, q, v, given, gravity, classical=classical)
    states: list[ModuleState] = []
    for module in robot.modules:
        m = module.mechanism
        V, V_dot = _base_of(states, module, root)
        qk, vk = q[:, module.q_index], v[:, module.v_index]
        ak = None if a is None else a[:, module.v_index]
        spanning = m.spanning.sweep(qk, vk, ak)
        x, x_dot, x_ddot = m.cut(qk, vk, ak, spanning)
        motion = m.cut_motion(spanning)
        locked = m.locked_carriers(spanning)
        if len(locked):
            m.platforms_from_legs(x, x_dot, None if a is None else x_ddot, motion, locked)
        outputs, outputs_dot, convective = np.zeros((3, len(q), len(m.spec.outputs), 6))
        for o, body in enumerate(m.spec.outputs):
            relative = motion.twist(body)
            R, p = motion.R[:, body], motion.p[:, body]
            outputs[:, o] = motion_to_body(R, p, V) + relative  # Eq. (25)
            convective[:, o] = crm(outputs[:, o], relative)
            if classical:
                convective[:, o, :3] += cross(outputs[:, o, 3:], outputs[:, o, :3])
                outputs[:, o, :3] = 0.0
            outputs_dot[:, o] = (
                motion_to_body(R, p, V_dot) + motion.acceleration(body) + convective[:, o]
            )  # Eq. (28)
        states.append(
            ModuleState(
                module, spanning, motion, x, x_dot, x_ddot, V, V_dot, outputs, outputs_dot, convective
            )
        )
    return states


def _base_of(states: list[ModuleState], module: Module, root: tuple[Array, Array]) -> tuple[Array, Array]:
    """Give twist and acceleration of the body that a module stands on."""
    if module.parent < 0:
        return root
    below = states[module.parent]
    return below.outputs[:, module.parent_output], below.outputs_dot[:, module.parent_output]


def residuals(robot: HybridRobot, q: Array) -> Iterator[tuple[Module, Array]]:
    """Give each looped module with its scaled closure residuals, shape (T, rows)."""
    for module in robot.modules:
        m = module.mechanism
        if m.spanning_closures.rows:
            qk = q[:, module.q_index]
            residual = m.spanning_closures.residual(qk, m.spanning.sweep(qk))
            yield module, residual * m.spanning_row_scale


def closure_residual(robot: HybridRobot, q: Array) -> Array:
    """Give the worst closure residual of each sample, relative to its module's length.

    Args:
        robot: The robot.
        q: Positions, shape (nq,) or (T, nq).

    Returns:
        Shape () or (T,): metres over the module's length, or radians, whichever is worst.
    """
    batch, single = as_batch(q, robot.nq, "q")
    worst = np.zeros(len(batch))
    for _, residual in residuals(robot, batch):
        worst = np.maximum(worst, np.abs(residual).max(axis=1))
    return worst[0] if single else worst
