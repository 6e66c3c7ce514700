"""Sweeps over the modules that settle friction which grows with load in the direct model.

Each module answers linearly (`equations.rubbing_moving`), so that a change of frictions takes one sweep
inwards and one outwards over small matrices. Frictions of one module follow by steps of Newton's method,
those of several modules by sweeps of such steps. The same sweeps over absolute values bound by how much
frictions feed on one another: from weights x > 0 they lead to rho x at most, and below 1 the only solution
is nearer than the residual over 1 - rho.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi as ca
import numpy as np

from ...symbols import Expression, dot, plus
from ..equations.expressions import pack, symbols
from ..equations.rubbing_joints import Rubbing, argued, rows_of_terms, with_arguments
from ..equations.settling import NEWTON, far_from_solution, friction_of, largest_over, newton_step, weights
from ..program import Add, Shared, Source, Target, Worst
from .module_calls import ModuleCalls
from .writer import Writer

#: Sweeps over several modules, whose frictions act on one another through accelerations.
SWEEPS = 6
#: Steps over absolute values.
BOUNDS = ("weigh", "bound")


class FrictionSweeps:
    """The sweeps over the modules of a robot, each of which has its answers among its ports.

    Attributes:
        w: The program under construction.
        modules: The calls of all modules.
        n: Places of the frictions of each.
    """

    def __init__(self, w: Writer, modules: Sequence[ModuleCalls]) -> None:
        """Allocate places."""
        self.w, self.modules = w, modules
        self.n = [w.shared(len(calls.options.rubbing)) for calls in modules]
        self._more = [{o: w.shared(6) for o in _carrying(calls)} for calls in modules]
        self._moved = [{o: w.shared(6) for o in _carrying(calls)} for calls in modules]

    def settle(self, eps: float) -> None:
        """Add the sweeps; the frictions and the biases that they cause become ports of the modules.

        Args:
            eps: Rounding of one number.
        """
        w, modules = self.w, self.modules
        for k in range(len(modules)):
            self._call(k, "first", {}, [self.n[k]])
        for _ in range(NEWTON if len(modules) == 1 else SWEEPS):
            self._sweep("newton", self.n, self.n)
        x, grown, found = ([w.shared(place.size) for place in self.n] for _ in range(3))
        self._sweep("weigh", self.n, x)
        self._sweep("bound", x, grown)
        self._sweep("last", self.n, found)
        worst = w.shared(2)
        w.start(worst, np.zeros(2))
        for own in zip(x, grown, self.n, found, strict=True):
            self._judge(worst, *own)
        column, (ratio, residual) = symbols("worst", 2)
        function = ca.Function("judged", [column], [far_from_solution(ratio, residual, eps)])
        w.call(w.kernel(("friction", "judged", eps), function, "effects"), 1, [worst], [Worst()])
        self.n = found
        self._inwards("last", self.n)
        for calls, n, more in zip(modules, self.n, self._more, strict=True):
            calls.ports |= {"n": n} | {f"more {o}": place for o, place in more.items()}

    def _judge(self, worst: Shared, *frictions: Shared) -> None:
        """Add the call that takes one module's frictions into the largest ratio and residual.

        Args:
            worst: Place of these.
            frictions: Weights, the bound that these lead to, frictions, and these after a step.
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
        for k, calls in enumerate(self.modules):
            below, output = calls.module.parent, calls.module.parent_output
            known = {f"more {o}": place for o, place in self._more[k].items()}
            if below >= 0:
                known["base"] = self._moved[below][output]
            known["n"] = n[k]
            self._call(k, what, known, [*self._moved[k].values(), to[k]])

    def _inwards(self, what: str, n: Sequence[Shared]) -> None:
        """Add the sweep of biases inwards that frictions n cause."""
        sums = [{o: self.w.start(place, np.zeros(6)) for o, place in more.items()} for more in self._more]
        for k, calls in reversed([*enumerate(self.modules)]):
            if calls.module.parent >= 0 and "inward" in calls.ports:  # else nothing rubs from there on
                target: Add = sums[calls.module.parent][calls.module.parent_output]
                known = {f"more {o}": place for o, place in self._more[k].items()} | {"n": n[k]}
                self._call(k, "inwards, bound" if what in BOUNDS else "inwards", known, [target])

    def _call(self, k: int, what: str, known: Mapping[str, Shared], targets: Sequence[Shared | Add]) -> None:
        """Add the call of one step of a sweep in one module.

        Args:
            k: Number of the module.
            what: The step: "first", "newton", "weigh", "bound" and "last" outwards, else inwards.
            known: Places of biases, of V_dot of the base, and of frictions.
            targets: Where results go, of which empty ones are left out.
        """
        calls = self.modules[k]
        names = [x for x in ("inward", "carried", "driven", "of_base", "of_z", "p_0") if x in calls.ports]
        sources: dict[str, Source] = {name: calls.ports[name] for name in names} | dict(known)
        widths = {name: place.size for name, place in sources.items() if isinstance(place, Shared)}
        if argued(calls.options.rubbing):
            sources["parameters"] = calls.ports["parameters"]
            widths["parameters"] = sum(size for _, size in calls.request.parameter_inputs)
        filled: list[Target] = [target for target in targets if target.size]
        if not filled:
            return
        columns, values = zip(*(symbols("x", size) for size in widths.values()), strict=True)
        given = dict(zip(widths, values, strict=True))
        step = _Step(with_arguments(calls.options.rubbing, columns[-1]), given)
        outputs = step.of(what)
        function = ca.Function("friction", [*columns], [pack(x) for x in outputs if len(x)])
        key = ("friction", what, tuple(widths.items()), calls.options.rubbing)
        self.w.call(self.w.kernel(key, function, "effects"), 1, [*sources.values()], filled)


def _carrying(calls: ModuleCalls) -> list[int]:
    """Return the outputs of a module that carry others."""
    return np.flatnonzero(calls.options.carries).tolist()


class _Step:
    """One step of a sweep in one module, in symbols."""

    def __init__(self, rubbing: Sequence[Rubbing], given: Mapping[str, Expression]) -> None:
        """Take the module's joints, and columns of symbols by name."""
        self._rubbing, self._given = rubbing, given
        self._more = [x for name, x in given.items() if name.startswith("more ")]
        self._z = 6 * len(self._more) + len(rubbing)
        self._absolute = False

    def of(self, what: str) -> list[Expression]:
        """Return the results of a step."""
        self._absolute = what in (*BOUNDS, "inwards, bound")
        if what == "first":
            return [friction_of(self._rubbing, rows_of_terms(self._rubbing, self._given["p_0"]))]
        z = np.concatenate([*self._more, self._given["n"]])
        if what.startswith("inwards"):
            return [dot(self._matrix("inward", self._z), z)]
        moved = self._linear("driven", z, "carried")
        return [*moved.reshape(-1, 6), self._frictions(what, z)]

    def _frictions(self, what: str, z: Expression) -> Expression:
        """Return the frictions after a step outwards."""
        if not self._rubbing:
            return np.zeros(0, dtype=object)
        taken = self._linear("of_z", z, "of_base")
        if what in BOUNDS:
            change = friction_of(self._rubbing, rows_of_terms(self._rubbing, taken))
            return change if what == "bound" else weights(self._given["n"], change)
        parts = rows_of_terms(self._rubbing, plus(self._given["p_0"], taken))
        if what == "last":
            return friction_of(self._rubbing, parts)
        own = self._matrix("of_z", self._z)[:, -len(self._rubbing) :]
        return newton_step(self._rubbing, parts, rows_of_terms(self._rubbing, own), self._given["n"])

    def _linear(self, of_z: str, z: Expression, of_base: str) -> Expression:
        """Return what follows from z and, where the base moves, from its acceleration."""
        if of_z not in self._given:
            return np.zeros(0, dtype=object)
        out = dot(self._matrix(of_z, self._z), z)
        return plus(out, dot(self._matrix(of_base, 6), self._given["base"])) if "base" in self._given else out

    def _matrix(self, name: str, columns: int) -> Expression:
        """Return a matrix, or its absolute values."""
        M = self._given[name].reshape(-1, columns)
        return np.vectorize(ca.fabs, otypes=[object])(M) if self._absolute else M
