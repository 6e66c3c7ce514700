"""Settle friction that grows with load in the direct model, by sweeps over the modules.

Each module answers linearly (`equations.rubbing_moving`), so that a change of frictions takes one sweep
inwards and one outwards over small matrices. A module that no other feels settles its frictions by itself.
Those of the others follow by sweeps n -> N, as many as generic postures need (`sweeps_needed`). Sweeps over
sizes (`equations.rubbing_energy`) bound by how much frictions feed on one another: from weights x > 0 they
lead to rho x at most. Below 1 there is one solution, and the last N is nearer than rho / (1 - rho) of the
residual.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import casadi as ca
import numpy as np

from ..equations.expressions import pack, symbols, symmetric
from ..equations.factors import Handed
from ..equations.request import Request
from ..equations.rubbing import answers_of
from ..equations.rubbing_energy import measured
from ..equations.rubbing_joints import argued, with_arguments
from ..equations.rubbing_steps import RubbingStep
from ..equations.settling import far_from_solution, largest_over, settle
from ..equations.sweeps_needed import friction_sweeps
from ..program import Add, Shared, Target, Worst
from .module_calls import ModuleCalls, read
from .writer import Writer


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
    feeling = set[int]()  # modules that rub, or that carry such
    for calls in reversed(coupled):
        if calls.options.rubbing or calls.k in feeling:
            feeling |= {calls.k, calls.module.parent}
    for calls in coupled:
        calls.ports["u"] = w.shared(len(calls.request.plans[calls.k].motions))
        if calls.k not in feeling:
            w.start(calls.ports["u"], np.zeros(calls.ports["u"].size))
    if feeling:
        sweeps = friction_sweeps(request.robot, request.on, request.dtype)
        FrictionSweeps(w, [calls for calls in coupled if calls.k in feeling]).settle(eps, sweeps)


def _settle_alone(w: Writer, calls: ModuleCalls, eps: float) -> None:
    """Add the call that settles the frictions of a module that no other feels."""
    sources = _sources(calls, {})
    calls.ports["n"] = w.shared(len(calls.options.rubbing))
    function = partial(_settled_alone, calls, sources, eps)
    kernel = w.kernel(("friction", "settle", id(calls.written)), function, "effects")
    w.call(kernel, 1, [*sources.values()], [calls.ports["n"], Worst()])


def _settled_alone(calls: ModuleCalls, sources: Mapping[str, Any], eps: float) -> ca.Function:
    """Return the kernel that settles the frictions of a module that no other feels."""
    given = _Given(calls, sources, Handed())
    rows = np.concatenate([given.values["p_0"][:, None], given.answers["of_z"]], axis=1)
    n, guard = settle(given.rubbing, answers_of(given.rubbing, rows), eps)
    return ca.Function("settle", given.columns, [pack(n), ca.SX(guard)])


#: Steps over sizes.
OF_SIZES = ("bias", "weigh", "bound")


class FrictionSweeps:
    """The sweeps over the modules that feel frictions of others, or of their own.

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
        self._more, self._moved, self._biases = (
            [{o: w.shared(size) for o in _carrying(calls)} for calls in modules] for size in (6, 6, 1)
        )
        self._motions = [w.shared(int(any(calls.options.carries))) for calls in modules]
        self._sizes: list[tuple[Handed, Shared]] = []

    def settle(self, eps: float, sweeps: int) -> None:
        """Add the sweeps.

        Args:
            eps: Rounding of one number.
            sweeps: Their number.
        """
        w, modules = self.w, self.modules
        for i in range(len(modules)):
            self._call(i, "first", {}, [self.n[i]])
        for _ in range(sweeps - 1):
            self._sweep(self.n, self.n)
        x, grown, found = ([w.shared(place.size) for place in self.n] for _ in range(3))
        self._sweep(self.n, found)
        self._sizes = [self._measure(i, eps) for i in range(len(modules))]
        self._bound("weigh", found, x)
        self._bound("bound", x, grown)
        worst = w.shared(2)
        w.start(worst, np.zeros(2))
        for own in zip(x, grown, self.n, found, strict=True):
            self._judge(worst, *own)
        column, (ratio, residual) = symbols("worst", 2)
        function = ca.Function("judged", [column], [far_from_solution(ratio, residual, eps)])
        w.call(w.kernel(("friction", "judged", eps), function, "effects"), 1, [worst], [Worst()])
        self._inwards("inwards", self._more, found)
        for i, calls in enumerate(modules):
            self._call(i, "u", _above(self._more[i], found[i]), [calls.ports["u"]])

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

    def _measure(self, i: int, eps: float) -> tuple[Handed, Shared]:
        """Add the call that measures how a module answers; return the sizes and their place."""
        w, calls = self.w, self.modules[i]
        inertias = [read(calls.ports[f"I {o}"]) for o in _carrying(calls)]
        if (below := calls.module.parent) >= 0:
            inertias.append(read(self.modules[self._at[below]].ports[f"I {calls.module.parent_output}"]))

        def written() -> tuple[ca.Function, Handed]:
            """Return the kernel, and what it hands on."""
            column, answers = calls.written.held.again("answers")
            columns, each = zip(*(symbols("I", 21) for _ in inertias), strict=True) if inertias else ((), ())
            matrices = [symmetric(x, 6) for x in each]
            base = matrices.pop() if below >= 0 else None
            sizes, guard = measured(answers, base, matrices, eps)
            return ca.Function("sizes", [column, *columns], [sizes.pack(), ca.SX(guard)]), sizes

        key = ("friction", "sizes", below >= 0, id(calls.written))
        function, sizes = w.once(key, written)
        place = w.shared(sizes.size)
        w.call(w.kernel(key, function, "effects"), 1, [calls.ports["answers"], *inertias], [place, Worst()])
        return sizes, place

    def _sweep(self, n: Sequence[Shared], to: Sequence[Shared]) -> None:
        """Add a sweep inwards and one outwards, from frictions n to those in `to`."""
        self._inwards("inwards", self._more, n)
        for i, calls in enumerate(self.modules):
            known = _above(self._more[i], n[i])
            if (below := calls.module.parent) >= 0:
                known["base"] = self._moved[self._at[below]][calls.module.parent_output]
            self._call(i, "outwards", known, [*self._moved[i].values(), to[i]])

    def _bound(self, what: str, n: Sequence[Shared], to: Sequence[Shared]) -> None:
        """Add a sweep over sizes from frictions n to their weights ("weigh") or to a bound ("bound")."""
        self._inwards("bias", self._biases, n)
        for i, calls in enumerate(self.modules):
            known = _above(self._biases[i], n[i])
            if (below := calls.module.parent) >= 0:
                known["base"] = self._motions[self._at[below]]
            self._call(i, what, known, [self._motions[i], to[i]])

    def _inwards(self, what: str, more: list[dict[int, Shared]], n: Sequence[Shared]) -> None:
        """Add the sweep inwards of biases that frictions n cause, or of their sizes ("bias")."""
        sums = [{o: self.w.start(x, np.zeros(x.size)) for o, x in each.items()} for each in more]
        for i, calls in reversed([*enumerate(self.modules)]):
            if (below := calls.module.parent) >= 0:
                target = sums[self._at[below]][calls.module.parent_output]
                self._call(i, what, _above(more[i], n[i]), [target])

    def _call(self, i: int, what: str, known: Mapping[str, Shared], targets: Sequence[Shared | Add]) -> None:
        """Add the call of one step of a sweep in one module.

        Args:
            i: Number of the module among those of the sweeps.
            what: The step (`RubbingStep`).
            known: Places of biases, of V_dot of the base, and of frictions.
            targets: Where results go, of which empty ones are left out.
        """
        calls = self.modules[i]
        filled: list[Target] = [target for target in targets if target.size]
        if not filled:
            return
        sizes, place = self._sizes[i] if what in OF_SIZES else (Handed(), None)
        sources = _sources(calls, known if place is None else {**known, "sizes": place})
        key = ("friction", what, tuple(sources), id(calls.written))
        kernel = self.w.kernel(key, partial(_step_function, calls, sources, what, sizes), "effects")
        self.w.call(kernel, 1, [*sources.values()], filled)


def _above(more: Mapping[int, Shared], n: Shared) -> dict[str, Shared]:
    """Return the places of what a module's outputs, and its joints with frictions n, bring in."""
    return {f"more {o}": place for o, place in more.items()} | {"n": n}


def _sources(calls: ModuleCalls, known: Mapping[str, Shared]) -> dict[str, Any]:
    """Return the sources of a step of one module by name: its answers, `known`, and its arguments."""
    own: dict[str, Any] = {name: calls.ports[name] for name in ("answers", "p_0") if name in calls.ports}
    more = {"parameters": calls.ports["parameters"]} if argued(calls.options.rubbing) else {}
    return own | dict(known) | more


def _step_function(calls: ModuleCalls, sources: Mapping[str, Any], what: str, sizes: Handed) -> ca.Function:
    """Return the kernel of one step of a sweep in one module."""
    given = _Given(calls, sources, sizes)
    step = RubbingStep(given.rubbing, given.answers, given.sizes, given.values)
    return ca.Function("friction", given.columns, [pack(x) for x in step.of(what) if len(x)])


class _Given:
    """What a step of one module is given, in symbols.

    Attributes:
        columns: A column of symbols for each source.
        values: The same as arrays, by name, without the arguments.
        answers, sizes: How the module answers, and the sizes of that, in symbols.
        rubbing: Its joints that rub.
    """

    def __init__(self, calls: ModuleCalls, sources: Mapping[str, Any], sizes: Handed) -> None:
        """Take sources by name, the last of which are the arguments if coefficients are among them."""
        answers, self.answers = calls.written.held.again("answers")
        column, self.sizes = sizes.again("sizes")
        handed = {"answers": answers, "sizes": column}
        pairs = {name: symbols("x", place.size) for name, place in sources.items() if name != "parameters"}
        self.values = {name: values for name, (_, values) in pairs.items()}
        self.columns = [handed.get(name, x) for name, (x, _) in pairs.items()]
        self.rubbing = calls.options.rubbing
        if "parameters" in sources:
            size = sum(size for _, size in calls.request.parameter_inputs)
            self.columns.append(ca.SX.sym("parameters", size))
            self.rubbing = with_arguments(self.rubbing, self.columns[-1])


def _carrying(calls: ModuleCalls) -> list[int]:
    """Return the outputs of a module that carry others."""
    return np.flatnonzero(calls.options.carries).tolist()
