"""Forward recursion over modules: compute placements, twists and accelerations of outputs, Eqs. (25), (28).

Both dynamic models start with this recursion. Gravity is included in the acceleration of the base and appears
nowhere else.
"""

import numpy as np

from ..effects.terms import Gravity
from ..linkage.motion import Motion
from ..spatial import Array, crm, cross, motion_to_body
from ..structure.mechanism import Mechanism
from ..structure.module import ModuleState
from ..structure.robot import HybridRobot

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
    """Compute V_0 and V_dot_0 - g of the base of the first modules, shapes (T, 6).

    This base is the world if `robot.base` is "fixed" or "floating", and the root body, whose motion is
    prescribed, if it is "moving". `classical` is defined in `forward`.
    """
    V, V_dot = np.zeros((2, len(q), 6))
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
    base: Array | None = None,
) -> list[ModuleState]:
    """Run the forward recursion.

    Args:
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv).
        a: Accelerations, shape (T, nv), or None if they are not needed; the accelerations in the states are
            then not meaningful.
        gravity: The effect of gravity, or None for no weights.
        classical: Whether to express each twist relative to an observer who moves with the velocity of the
            frame's origin. Forces and relative accelerations are the same (Galilean invariance). This avoids
            the rounding of w x v, which grows with the square of a chain's length.
        base: Accelerations, shape (T, nv), whose first six entries are those of a moving base, where `a` is
            None; zero by default.

    Returns:
        One state per module, in the order of `robot.modules`.
    """
    of_base = next(x for x in (a, base, np.zeros_like(v)) if x is not None)
    root = base_motion(robot, q, v, of_base, gravity, classical=classical)
    states: list[ModuleState] = []
    for module in robot.modules:
        m = module.mechanism
        below, o = states[module.parent] if module.parent >= 0 else None, module.parent_output
        V, V_dot = (below.outputs[:, o], below.outputs_dot[:, o]) if below else root
        swept = m.sweep(
            q[:, module.q_index], v[:, module.v_index], None if a is None else a[:, module.v_index]
        )
        states.append(ModuleState(module, *swept, V, V_dot, *_outputs(m, swept.motion, V, V_dot, classical)))
    return states


def _outputs(
    m: Mechanism, motion: Motion, V: Array, V_dot: Array, classical: bool
) -> tuple[Array, Array, Array]:
    """Compute twists and accelerations of a module's outputs, and their velocity terms (`ModuleState`)."""
    outputs, outputs_dot, convective = np.zeros((3, len(V), len(m.spec.outputs), 6))
    for o, body in enumerate(m.spec.outputs):
        relative = motion.of_body(body).twist()
        R, p = motion.R[:, body], motion.p[:, body]
        outputs[:, o] = motion_to_body(R, p, V) + relative  # Eq. (25)
        convective[:, o] = crm(outputs[:, o], relative)
        if classical:
            convective[:, o, :3] += cross(outputs[:, o, 3:], outputs[:, o, :3])
            outputs[:, o, :3] = 0.0
        outputs_dot[:, o] = (
            motion_to_body(R, p, V_dot) + motion.of_body(body).acceleration() + convective[:, o]
        )  # Eq. (28)
    return outputs, outputs_dot, convective
