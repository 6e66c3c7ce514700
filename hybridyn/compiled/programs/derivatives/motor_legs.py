"""Wrenches of legs on base and platform, from the direct model's sums over them (`legs.leg_sums`).

With the acceleration A of the base less gravity, and that of the platform relative to it, delta,

    F_base  = S1 A + B delta + b_base
    F_delta = B^T A + L delta + b_delta

These calls replace the legs' inverse model in a balance, of which only derivatives at fixed A are needed:
those over A are S1 and B.
"""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np

from ...equations.expressions import dot, pack, symbols, symmetric
from ...equations.inverse_legs import LEG_SUMS
from ...equations.quadratic_form import LEG_SUMS as QUADRATIC
from ...equations.rigid import momentum
from ...program import Call, Constants, Source
from ..direct import DirectCalls
from ..inverse import Balance, InverseCalls
from ..module_calls import read
from ..writer import Writer
from .nodes import identity
from .sweeps import PART


def sum_legs(w: Writer, modules: list[DirectCalls], balance: Balance, start: int) -> list[Call]:
    """Replace the legs' calls of a balance, and return the calls to be differentiated.

    Args:
        w: The program under construction.
        modules: Calls of the direct model.
        balance: The balance; its modules receive the new calls.
        start: Number of its first step.
    """
    of = {id(call): calls for calls in balance.modules for call in calls.leg_calls}
    old, out = w.steps[start:], []
    del w.steps[start:]
    for step in old:
        calls = of.get(id(step))
        if calls is None or not isinstance(step, Call):
            w.steps.append(step)
            out += [step] if isinstance(step, Call) else []
            continue
        direct, new = modules[calls.k], []
        if step is calls.leg_calls[0]:
            first = len(w.steps)
            for i in sorted({group[0].platform for group in calls.groups}):
                _sum_platform(w, direct, calls, i)
            new = w.calls_from(first)
        A, fixed = (x.sources().get("A_base", Constants(np.zeros((1, 6)))) for x in (calls, direct))
        sources = tuple(fixed if identity(x) == identity(A) else x for x in step.sources)
        new.append(replace(step, sources=sources))
        out += new
        calls.calls += new
    return out


def _sum_platform(w: Writer, direct: DirectCalls, calls: InverseCalls, i: int) -> None:
    """Add the call that computes the wrenches of a platform's legs."""

    def function() -> ca.Function:
        """Return both wrenches."""
        columns = {name: symbols(name, size) for name, size in (*QUADRATIC, ("A", 6), ("delta", 6))}
        S1, B, L, b_base, b_delta, A, delta = (entries for _, entries in columns.values())
        B, L = B.reshape(6, 6), symmetric(L, 6)
        base, along = momentum(S1, A) + dot(B, delta) + b_base, dot(B.T, A) + dot(L, delta) + b_delta
        return ca.Function("legs", [column for column, _ in columns.values()], [pack(base), pack(along)])

    A = calls.sources().get("A_base", Constants(np.array([calls.options.base])))
    sums: list[Source] = [read(direct.sums[i, name]) for name, _ in QUADRATIC]
    targets = [calls.sums[i, name] for name, _ in LEG_SUMS]
    w.call(w.kernel("sums of legs", function, PART), 1, [*sums, A, direct.deltas[i]], list(targets))
