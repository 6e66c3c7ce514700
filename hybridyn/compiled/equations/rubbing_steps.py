"""Steps of the sweeps over modules that settle their frictions, each in one module."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...symbols import Expression, dot, minus, plus
from .factors import Definite
from .rubbing_energy import bias_within, motion_within, taken_within
from .rubbing_joints import Rubbing, rows_of_terms
from .settling import friction_of, weights


class RubbingStep:
    """One step of a sweep in one module, in symbols."""

    def __init__(
        self,
        rubbing: Sequence[Rubbing],
        answers: Mapping[str, Expression],
        sizes: Mapping[str, Expression],
        given: Mapping[str, Expression],
    ) -> None:
        """Take the module's joints, its answers and their sizes, and columns of symbols by name."""
        self._rubbing, self._answers, self._sizes, self._given = rubbing, answers, sizes, given
        more = [x for name, x in given.items() if name.startswith("more ")]
        self._more = np.concatenate([*more, np.zeros(0, dtype=object)])

    def of(self, what: str) -> list[Expression]:
        """Return the results of a step.

        Args:
            what: "first", frictions without what they change; "inwards", what they change of the bias of the
                base; "outwards", of V_dot of each output, and the frictions after it; "u", of u_dot. "bias"
                and "bound" are the same over sizes, and "weigh" returns weights for frictions.
        """
        match what:
            case "first":
                return [self._frictions(self._given["p_0"])]
            case "inwards":
                M = self._answers
                return [plus(dot(M["inward"], self._given["n"]), dot(M["carried"].T, self._more))]
            case "outwards":
                return self._outwards()
            case "u":
                return [self._changed()]
            case "bias":
                return [np.array([bias_within(self._sizes, self._more, self._given["n"])], dtype=object)]
        moved, grown = self._within()
        return [moved, weights(self._given["n"], grown) if what == "weigh" else grown]

    def _changed(self) -> Expression:
        """Return what frictions and biases change of u_dot."""
        M = self._answers
        forces = minus(dot(M["forced"], self._given["n"]), dot(M["driven"].T, self._more))
        return Definite(M["lower"], M["inverses"]).solve(forces[:, None])[:, 0]

    def _outwards(self) -> list[Expression]:
        """Return what changes of V_dot of each output, and the frictions after it."""
        M, u, z = self._answers, self._changed(), np.concatenate([self._more, self._given["n"]])
        moved, taken = dot(M["driven"], u), plus(dot(M["of_u"], u), dot(M["of_z"], z))
        if "base" in self._given:
            base = self._given["base"]
            moved, taken = plus(moved, dot(M["carried"], base)), plus(taken, dot(M["of_base"], base))
        found = [self._frictions(plus(self._given["p_0"], taken))] if len(taken) else []
        return [*moved.reshape(-1, 6), *found]

    def _within(self) -> tuple[Expression, Expression]:
        """Bound V_dot of the outputs, one number where it carries others, and the change of frictions."""
        n, sizes = self._given["n"], self._sizes
        base = self._given["base"][0] if "base" in self._given else 0.0
        moved, w = motion_within(sizes, base, self._more, n)
        of_n = self._answers["of_z"][:, self._answers["of_z"].shape[1] - len(n) :]
        taken = taken_within(sizes, of_n, (base, w), self._more, n)
        carries = len(self._answers["driven"]) > 0
        return np.array([moved] * carries, dtype=object), self._frictions(taken)

    def _frictions(self, parts: Expression) -> Expression:
        """Return the frictions from what the law takes, or a bound of their change from one of that."""
        return friction_of(self._rubbing, rows_of_terms(self._rubbing, parts)) if self._rubbing else parts
