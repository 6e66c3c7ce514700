"""How many sweeps over modules friction that grows with load takes to settle."""

from __future__ import annotations

import numpy as np

from ...dynamics.direct import states_before
from ...dynamics.friction_bound import feedback
from ...dynamics.friction_response import answer, answering
from ...dynamics.load_friction import wrenches_of
from ...dynamics.loads import all_loads
from ...effects.choice import Effects
from ...errors import SingularityError
from ...structure.robot import HybridRobot
from .settling import NO_LOAD, OWN_PART, SETTLED
from .states import moving_states

#: Generic postures that tell.
POSTURES = 4
#: Factor on rates, at which joints slide.
SLIDING = 1e6
#: Sweeps beyond which the general path is left with what does not settle.
MOST = 32
#: Factor by which frictions are settled better than asked at these postures, for others.
BETTER = 16.0


def friction_sweeps(robot: HybridRobot, on: Effects, dtype: str) -> int:
    """Return after how many sweeps n -> N friction is settled at generic postures.

    Args:
        on: Effects with friction that grows with load.
        dtype: Type of the arithmetic.
    """
    least, limit = 2, SETTLED * float(np.finfo(dtype).eps) / BETTER
    q, v, tau = moving_states(robot, POSTURES)
    for t in range(POSTURES):
        try:
            least = max(least, _needed(robot, on, (q[[t]], v[[t]], tau[[t]]), limit))
        except SingularityError:
            continue
    return least


def _needed(robot: HybridRobot, on: Effects, at: tuple[np.ndarray, ...], limit: float) -> int:
    """Return the number of sweeps at one posture."""
    (q, v, tau), law = at, on.loaded
    assert law is not None
    loads, a = all_loads(robot, on, q, v, None, None), np.zeros_like(v)
    D, states = law.directions(SLIDING * v) * (1.0 + law.rise), states_before(robot, on, q, v, a)
    start, modules = answering(robot, law, D, states, q, v, a, tau, loads)
    w, B = wrenches_of(law, start), answer(modules, np.eye(len(law.joints))[None])
    L, n = law.between(np.arange(len(law.joints)), B)[0], law.sizes(w)
    x = OWN_PART * n[0] + L @ n[0] + NO_LOAD
    length = max(module.mechanism.length for module in robot.modules)
    ratio = max(float((L @ x / x).max()), float(feedback(law, modules, length)[0][0]))
    for sweeps in range(1, MOST):
        last, n = n, law.sizes(w + np.einsum("tikj,tj->tik", B, n))
        if (ratio * np.abs(n - last) <= limit * (OWN_PART * n + n @ L.T)).all():
            return sweeps
    return MOST
