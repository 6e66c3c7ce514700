"""Check that the positions, rates and accelerations given to the dynamic models close the loops."""

from __future__ import annotations

import numpy as np

from ..errors import AT_SAMPLE, AssemblyError
from ..linkage.gimbal_lock import is_locked
from ..spatial import Array, cross, select
from ..structure.module import Module, ModuleState
from ..structure.robot import HybridRobot
from .natural_sizes import REST, NaturalSizes

#: Largest closure residual of given positions and rates, as a part of the module's length.
STATE_CLOSED = 1e-6


def check_closed(
    robot: HybridRobot, states: list[ModuleState], q: Array, v: Array, a: Array | None = None
) -> Array:
    """Check that states close the loops to `STATE_CLOSED`, or less precisely if the file itself is rounded.

    Args:
        states: States of its modules.
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv).
        a: Accelerations, shape (T, nv), or None to skip their check.

    Returns:
        Largest closure residual of each sample, as computed by `closure_residual`, shape (T,).

    Raises:
        AssemblyError: The message names module, closure and sample.
    """
    natural, worst = NaturalSizes.of(robot, v, a), np.zeros(len(q))
    for state in states:
        m = state.mechanism
        if not m.spanning_closures.rows:
            continue
        slack = STATE_CLOSED + m.rounding
        qk = q[:, state.module.q_index]
        open_by = np.abs(m.residual(qk, state.spanning))
        worst = np.maximum(worst, open_by.max(axis=1))
        _check_limit(state.module, open_by, np.full(len(q), slack), "positions", "open")
        first, second = m.closures.rates(state.motion, state.v, state.a)
        scale, unit = m.reduction.row_scale, m.reduction.col_scale
        speed = np.abs(state.v / unit).max(axis=1, initial=0.0)
        limit = np.maximum(slack * speed, REST * natural.rate(m.length))
        _check_limit(state.module, np.abs(first * scale), limit, "rates", "opening")
        if a is not None:
            size = np.abs(state.a / unit).max(axis=1, initial=0.0) + speed**2
            limit = np.maximum(slack * size, REST * natural.acceleration(m.length))
            _check_limit(state.module, np.abs(second * scale), limit, "accelerations", "accelerating apart")
        _check_wrists(state, slack, natural, a is not None)
    return worst


def _check_wrists(state: ModuleState, slack: float, natural: NaturalSizes, accelerations: bool) -> None:
    """Raise if the rates or accelerations of a cut wrist's end differ from those of its target.

    Wrists in gimbal lock are not checked, because their joints cannot follow every motion of the target.

    Raises:
        AssemblyError: The message names module and sample.
    """
    m, s = state.mechanism, state.spanning
    welded = [i for i, wrist in enumerate(m.spec.wrists) if not wrist.carries]
    if not welded:
        return
    end = np.array([m.spec.wrists[i].end for i in welded])
    target = np.array([m.spec.wrists[i].target for i in welded])
    p, p_dot, w, p_ddot, w_dot = (
        select(x, end) - select(x, target) for x in (s.p, s.p_dot, s.w, s.p_ddot, s.w_dot)
    )
    w0 = select(s.w, target)
    sweep = cross(w0, p)
    unit = m.reduction.col_scale
    speed = np.maximum(np.abs(state.v / unit).max(axis=1, initial=0.0), np.abs(s.w).max(axis=(1, 2)))
    limit = np.maximum(slack * speed, REST * natural.rate(m.length))
    misses = [("rates", "opening", p_dot - sweep, w, limit)]
    if accelerations:
        apart = p_ddot - cross(select(s.w_dot, target), p) - cross(w0, sweep)
        size = np.maximum(np.abs(state.a / unit).max(axis=1, initial=0.0), np.abs(s.w_dot).max(axis=(1, 2)))
        limit = np.maximum(slack * (size + speed**2), REST * natural.acceleration(m.length))
        misses.append(("accelerations", "accelerating apart", apart, w_dot, limit))
    unknown = m.wrists.near_gimbal_lock(s)  # there the wrist does not determine the rates of the platform
    for what, how, linear, angular, limit in misses:
        miss = np.abs(np.concatenate([linear / m.length, angular], axis=-1))
        miss[unknown] = 0.0
        for t, i in np.argwhere((miss > limit[:, None, None]).any(axis=-1)):
            if is_locked(m.wrists.jacobian(s.take(np.array([t])), welded[i]))[0]:
                miss[t, i] = 0.0
        _check_limit(state.module, miss.reshape(len(miss), 6 * len(welded)), limit, what, how)


def _check_limit(module: Module, value: Array, limit: Array, what: str, how: str) -> None:
    """Raise if an absolute residual, shape (T, rows), exceeds the limit of its sample, shape (T,)."""
    excess = np.where(value > limit[:, None], value, 0.0)
    if not excess.any():
        return
    sample, row = np.unravel_index(int(np.argmax(excess)), excess.shape)
    closures = module.mechanism.spanning_closures
    name = ""
    if what == "positions":
        index = next(i for i, at in enumerate(closures.row_slices) if at.start <= row < at.stop)
        name = f", closure '{module.closures[index]}'"
    raise AssemblyError(
        f"module '{module.name}'{name}: the {what} do not close the loops{AT_SAMPLE}: {how} by "
        f"{value[sample, row]:.2g} (limit {limit[sample]:.2g}, relative to the module's length "
        f"{module.mechanism.length:g} m). Take q, v, a from hybridyn.assemble",
        module=module.name,
        sample=int(sample),
        residual=float(value[sample, row]),
    )
