"""The forward recursion over modules: placements, twists and accelerations of every output, Eqs. (25), (28).

Both dynamic models begin here. Gravity is carried by the base's acceleration and appears nowhere else.
"""

from __future__ import annotations

import numpy as np

from ..effects.terms import Gravity
from ..spatial import Array, crm, cross, motion_to_body
from ..structure.module import Module
from ..structure.robot import HybridRobot
from ..structure.state import ModuleState

GRAVITY = Gravity()


def base_motion(
    robot: HybridRobot,
    q: Array,
    v: Array,
    a: Array,
    gravity: Gravity | None = GRAVITY,
    *,
    classical: bool = False,
) -> tuple[Array, Array]:
    """Return V_0 and V_dot_0 - g of the body that the first modules stand on, shapes (T, 6).

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
        x, x_dot, x_ddot = m.cut.coordinates(qk, vk, ak, spanning)
        motion = m.cut.motion(spanning)
        locked = m.wrists.near_gimbal_lock(spanning)
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
    """Return twist and acceleration of the body that a module stands on."""
    if module.parent < 0:
        return root
    below = states[module.parent]
    return below.outputs[:, module.parent_output], below.outputs_dot[:, module.parent_output]
