"""Settle friction that grows with load in the direct model, by sweeps over the modules.

Each module answers linearly (`equations.rubbing_moving`), so that a change of frictions takes one sweep
inwards and one outwards over small matrices. A module that no other feels settles its frictions by itself.
Those of the others follow by sweeps n -> N, as many as generic postures need (`sweeps_needed`). The same
sweeps over absolute values bound by how much frictions feed on one another: from weights x > 0 they lead to
rho x at most. Below 1 there is one solution, and the last N is nearer than rho / (1 - rho) of the residual.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import casadi as ca
import numpy as np

from ...symbols import Expression, dot, plus
from ..equations.expressions import pack, symbols
from ..equations.request import Request
from ..equations.rubbing import answers_of
from ..equations.rubbing_joints import Rubbing, argued, rows_of_terms, with_arguments
from ..equations.settling import far_from_solution, friction_of, largest_over, settle, weights
from ..equations.sweeps_needed import friction_sweeps
from ..program import Add, Shared, Target, Worst
from .module_calls import ModuleCalls
from .writer import Writer

#: Sweeps over absolute values.
BOUNDS = ("weigh", "bound")


def settle_frictions(request: Request, w: Writer, modules: Sequence[ModuleCalls]) -> None:
    """Add the calls that settle frictions; these and the biases that they cause become ports of the modules.

    Args:
        request: The robot and its effects.
        w: The program under construction.
        modules: The calls of all modules, each of which has its answers among its ports.
    """
    eps = request.plans[0].scale.eps
    coupled = [calls for calls in modules if not calls.options.isolated]
    for calls in modules:
        if calls.options.isolated and calls.options.rubbing:
            _settle_alone(w, calls, eps)
    rubs = any(calls.options.rubbing for calls in coupled)
    sweeps = friction_sweeps(request.robot, request.on, request.dtype) if rubs else 0
    FrictionSweeps(w, coupled).settle(eps, sweeps)


def _settle_alone(w: Writer, calls: ModuleCalls, eps: float) -> None:
    """Add the call that settles the frictions of a module that no other feels."""
    sources = _sources(calls, {})
    calls.ports["n"] = w.shared(len(calls.options.rubbing))
    function = partial(_settled_alone, calls, sources, eps)
    kernel = w.kernel(("friction", "settle", id(calls.written)), function, "effects")
    w.call(kernel, 1, [*sources.values()], [calls.ports["n"], Worst()])


def _settled_alone(calls: ModuleCalls, sources: Mapping[str, Any], eps: float) -> ca.Function:
    """Return the kernel that settles the frictions of a module that no other feels."""
    given = _Given(calls, sources)
    rows = np.concatenate([given.values["p_0"][:, None], given.answers["of_z"]], axis=1)
    n, guard = settle(given.rubbing, answers_of(given.rubbing, rows), eps)
    return ca.Function("settle", given.columns, [pack(n), ca.SX(guard)])


class FrictionSweeps:
    """The sweeps over the modules that feel one another.

    Attributes:
        w: The program under construction.
        modules: The calls of these modules.
        n: Places of the frictions of each.
    """

    def __init__(self, w: Writer, modules: Sequence[ModuleCalls]) -> None:
        """Allocate places."""
        self.w, self.modules = w, modules
        self.n = [w.shared(len(calls.options.rubbing)) for calls in modules]
        self._at = {calls.k: i for i, calls in enumerate(modules)}
        self._more = [{o: w.shared(6) for o in _carrying(calls)} for calls in modules]
        self._moved = [{o: w.shared(6) for o in _carrying(calls)} for calls in modules]

    def settle(self, eps: float, sweeps: int) -> None:
        """Add the sweeps.

        Args:
            eps: Rounding of one number.
            sweeps: Their number, 0 where nothing rubs.
        """
        w, modules, found = self.w, self.modules, self.n
        if sweeps:
            for i in range(len(modules)):
                self._call(i, "first", {}, [self.n[i]])
            for _ in range(sweeps - 1):
                self._sweep("settle", self.n, self.n)
            x, grown, found = ([w.shared(place.size) for place in self.n] for _ in range(3))
            self._sweep("settle", self.n, found)
            self._sweep("weigh", found, x)
            self._sweep("bound", x, grown)
            worst = w.shared(2)
            w.start(worst, np.zeros(2))
            for own in zip(x, grown, self.n, found, strict=True):
                self._judge(worst, *own)
            column, (ratio, residual) = symbols("worst", 2)
            function = ca.Function("judged", [column], [far_from_solution(ratio, residual, eps)])
            w.call(w.kernel(("friction", "judged", eps), function, "effects"), 1, [worst], [Worst()])
        self._inwards("settle", found)
        for calls, n, more in zip(modules, found, self._more, strict=True):
            calls.ports |= {"n": n} | {f"more {o}": place for o, place in more.items()}

    def _judge(self, worst: Shared, *frictions: Shared) -> None:
        """Add the call that takes one module's frictions into the largest ratio and residual.

        Args:
            worst: Place of these.
            frictions: Weights, the bound that these lead to, frictions, and these after a sweep.
        """
        if not frictions[0].size:
            return
        columns, (before, *each) = zip(*(symbols("f", x.size) for x in (worst, *frictions)), strict=True)
        x, grown, n, found = each
        quotients = (largest_over(value, x) for value in (grown, found - n))
        largest = [ca.fmax(a, b) for a, b in zip(before, quotients, strict=True)]
        function = ca.Function("judge", [*columns], [pack(largest)])
        kernel = self.w.kernel(("friction", "judge", len(x)), function, "effects")
        self.w.call(kernel, 1, [worst, *frictions], [worst])

    def _sweep(self, what: str, n: Sequence[Shared], to: Sequence[Shared]) -> None:
        """Add a sweep inwards and one outwards, from frictions n to those in `to`."""
        self._inwards(what, n)
        for i, calls in enumerate(self.modules):
            below, output = calls.module.parent, calls.module.parent_output
            known = {f"more {o}": place for o, place in self._more[i].items()}
            if below >= 0:
                known["base"] = self._moved[self._at[below]][output]
            known["n"] = n[i]
            self._call(i, what, known, [*self._moved[i].values(), to[i]])

    def _inwards(self, what: str, n: Sequence[Shared]) -> None:
        """Add the sweep of biases inwards that frictions n cause."""
        sums = [{o: self.w.start(place, np.zeros(6)) for o, place in more.items()} for more in self._more]
        rubs = set[int]()  # modules from which biases come
        for i, calls in reversed([*enumerate(self.modules)]):
            below = calls.module.parent
            if (not calls.options.rubbing and calls.k not in rubs) or below < 0:
                continue
            rubs.add(below)
            known = {f"more {o}": place for o, place in self._more[i].items()} | {"n": n[i]}
            target: Add = sums[self._at[below]][calls.module.parent_output]
            self._call(i, "inwards, bound" if what in BOUNDS else "inwards", known, [target])

    def _call(self, i: int, what: str, known: Mapping[str, Shared], targets: Sequence[Shared | Add]) -> None:
        """Add the call of one step of a sweep in one module.

        Args:
            i: Number of the module among those of the sweeps.
            what: The step: "first", "settle", "weigh" and "bound" outwards, else inwards.
            known: Places of biases, of V_dot of the base, and of frictions.
            targets: Where results go, of which empty ones are left out.
        """
        calls = self.modules[i]
        filled: list[Target] = [target for target in targets if target.size]
        if not filled:
            return
        sources = _sources(calls, known)
        key = ("friction", what, tuple(sources), id(calls.written))
        kernel = self.w.kernel(key, partial(_step_function, calls, sources, what), "effects")
        self.w.call(kernel, 1, [*sources.values()], filled)


def _sources(calls: ModuleCalls, known: Mapping[str, Shared]) -> dict[str, Any]:
    """Return the sources of a step of one module by name: its answers, `known`, and its arguments."""
    own: dict[str, Any] = {name: calls.ports[name] for name in ("answers", "p_0") if name in calls.ports}
    more = {"parameters": calls.ports["parameters"]} if argued(calls.options.rubbing) else {}
    return own | dict(known) | more


def _step_function(calls: ModuleCalls, sources: Mapping[str, Any], what: str) -> ca.Function:
    """Return the kernel of one step of a sweep in one module."""
    given = _Given(calls, sources)
    step = _Step(given.rubbing, given.answers, given.values)
    return ca.Function("friction", given.columns, [pack(x) for x in step.of(what) if len(x)])


class _Given:
    """What a step of one module is given, in symbols.

    Attributes:
        columns: A column of symbols for each source.
        values: The same as arrays, by name, without the arguments.
        answers: How the module answers, in symbols.
        rubbing: Its joints that rub.
    """

    def __init__(self, calls: ModuleCalls, sources: Mapping[str, Any]) -> None:
        """Take sources by name, the last of which are the arguments if coefficients are among them."""
        column, self.answers = calls.written.held.again("answers")
        pairs = {name: symbols("x", place.size) for name, place in sources.items() if name != "parameters"}
        self.values = {name: values for name, (_, values) in pairs.items()}
        self.columns = [column if name == "answers" else x for name, (x, _) in pairs.items()]
        self.rubbing = calls.options.rubbing
        if "parameters" in sources:
            size = sum(size for _, size in calls.request.parameter_inputs)
            self.columns.append(ca.SX.sym("parameters", size))
            self.rubbing = with_arguments(self.rubbing, self.columns[-1])


def _carrying(calls: ModuleCalls) -> list[int]:
    """Return the outputs of a module that carry others."""
    return np.flatnonzero(calls.options.carries).tolist()


class _Step:
    """One step of a sweep in one module, in symbols."""

    def __init__(
        self, rubbing: Sequence[Rubbing], matrices: Mapping[str, Expression], given: Mapping[str, Expression]
    ) -> None:
        """Take the module's joints, its answers, and columns of symbols by name."""
        self._rubbing, self._matrices, self._given = rubbing, matrices, given
        self._more = [x for name, x in given.items() if name.startswith("more ")]

    def of(self, what: str) -> list[Expression]:
        """Return the results of a step."""
        M, given = self._matrices, self._given
        if what == "first":
            return [friction_of(self._rubbing, rows_of_terms(self._rubbing, given["p_0"]))]
        if what in (*BOUNDS, "inwards, bound"):
            M = {name: _absolute(x) for name, x in M.items()}
        n, beta = given["n"], np.concatenate([*self._more, np.zeros(0, dtype=object)])
        if what.startswith("inwards"):
            return [plus(dot(M["inward"], n), dot(M["carried"].T, beta))]
        z = np.concatenate([beta, n])
        moved, taken = dot(M["driven"], z), dot(M["of_z"], z)
        if "base" in given:
            moved, taken = (
                plus(x, dot(M[name], given["base"])) for x, name in ((moved, "carried"), (taken, "of_base"))
            )
        out = [*moved.reshape(-1, 6)]
        return [*out, self._frictions(what, taken)] if self._rubbing else out

    def _frictions(self, what: str, taken: Expression) -> Expression:
        """Return the frictions after a step outwards, a bound of their change, or weights.

        Args:
            taken: Change of what the law takes, or a bound of that.
        """
        parts = taken if what in BOUNDS else plus(self._given["p_0"], taken)
        found = friction_of(self._rubbing, rows_of_terms(self._rubbing, parts))
        return weights(self._given["n"], found) if what == "weigh" else found


def _absolute(x: Expression) -> Expression:
    """Return absolute values."""
    return np.vectorize(ca.fabs, otypes=[object])(x) if x.size else x
