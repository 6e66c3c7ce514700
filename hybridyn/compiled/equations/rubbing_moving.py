"""Friction that grows with load in the direct model of one module (see `dynamics.friction_response`).

Accelerations change with friction n, and so do those of other modules. All is linear in n, in the change
beta of the bias of every output, with z = [beta; n], and in that of V_dot of the base:

    u       = A_t^-1 (forced n - driven^T beta), what n and beta change of u_dot
    inward n + carried^T beta          handed to the module's base as its bias
    V_dot_o = carried V_dot + driven u handed to the modules on its outputs
    p       = p_0 + of_base V_dot + of_u u + of_z z

What joints of legs carry follows from few accelerations; of_u has these. Of joints of the core, where forces
of closures and biases would cancel much of it, and where Newton's method asks for it, of_z has all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import casadi as ca
import numpy as np

from ...spatial import motion_to_body
from ...symbols import Expression, dot, minus, plus
from .chains import carried, carriers, inertial_map, motion_map, wrench_map
from .core import Core, whole
from .expressions import eye, pack, plain, zeros
from .factors import Definite, Handed
from .module_plan import ModulePlan
from .rigid import classical
from .rubbing import seen_from, through_closures
from .rubbing_joints import of_core
from .rubbing_legs import LegAnswers
from .stages import GivenColumns

if TYPE_CHECKING:
    from .options import Options


class Needed(NamedTuple):
    """The wrench that an output needs at s, in the base: inertia J s + bias.

    Attributes:
        body: Its body.
        J: Its motion map, shape (6, 6 + nv).
        inertia, bias: Its own or articulated ones, shapes (6, 6), (6,).
    """

    body: int
    J: Expression
    inertia: Expression
    bias: Expression


class Solved(NamedTuple):
    """What a module is solved for: u_dot = u_0 - G V_dot_base + A_t^-1 Q z.

    Attributes:
        factors: Of A_t.
        G, u_0: Shapes (N, 6), (N,).
        Q: Forces along the motions per unit of z, shape (N, z).
    """

    factors: Definite
    G: Expression
    u_0: Expression
    Q: Expression


class TakenByLaw(NamedTuple):
    """What the terms of the law take from wrenches, p = of_s s + of_forces b + sum of of_biases x bias.

    Joints of legs add what accelerations take of them (`MovedModule`), what is alone, and what friction
    changes besides.

    Attributes:
        of_s: Of joints of the core, per acceleration, shape (their rows, 6 + nv).
        of_forces: Per force along y, shape (rows, nv).
        of_biases: Per bias of each output, in the base, shape (rows, 6).
        alone: Of joints of legs, shape (rows,).
        of_frictions: Of joints of legs, shape (rows, joints).
    """

    of_s: Expression
    of_forces: Expression
    of_biases: list[Expression]
    alone: Expression
    of_frictions: Expression


@dataclass(eq=False)
class MovedModule:
    """A module's direct model, with what further forces change.

    Attributes:
        core, plan, options: As in `write_direct`.
        form: M and b of the module.
        X: y over [V_dot_base, 1, u_dot].
        solved: What the module is solved for.
        pushed: Changes of b by z, shape (6 + nv, z).
        outputs: What each output needs.
        legs: What legs with joints that rub tell.
    """

    core: Core
    plan: ModulePlan
    options: Options
    form: tuple[Expression, Expression]
    X: Expression
    solved: Solved
    pushed: Expression
    outputs: list[Needed]
    legs: Sequence[LegAnswers]

    def answers(self) -> Handed:
        """Return how the module answers to changes; one that no other feels, only to its friction."""
        taken, rubbing, (factors, _, _, Q) = self._taken, self.options.rubbing, self.solved
        Psi, first = self.X[:, 7:], Q.shape[1] - len(rubbing)
        of_u = self._of_accelerations(np.concatenate([zeros(6, Psi.shape[1]), Psi]))
        of_z = dot(taken.of_forces, self.pushed[6:])
        for of_bias, bias in zip(taken.of_biases, self._of_biases(), strict=True):
            of_z = plus(of_z, dot(of_bias, bias))
        of_z[:, first:] = plus(of_z[:, first:], taken.of_frictions)
        alone = self.options.isolated
        whole = rubbing if alone else of_core(rubbing, self.plan.parts)
        rows = sum(len(term.part) for one in whole for term in one.terms)
        if rows:
            of_z[:rows] = plus(of_z[:rows], dot(of_u[:rows], factors.solve(Q)))
        if alone:
            return Handed(of_z=of_z)
        given = self._of_base(of_u, first) if self.options.base is None else {}
        of_u[:rows] = 0.0
        given |= {"lower": factors.lower, "inverses": factors.inverses, "forced": Q[:, first:]}
        return Handed(of_z=of_z, of_u=of_u, driven=-Q[:, :first].T, **given)

    def _of_base(self, of_u: Expression, first: int) -> dict[str, Expression]:
        """Return how the module answers to its base, and what this feels of friction.

        Args:
            of_u: What the law takes per acceleration along each motion.
            first: Where z has the frictions.
        """
        X_b, pushed, G, Q = self.X[:, :6], self.pushed[:, first:], self.solved.G, self.solved.Q
        with_base = np.concatenate([eye(6), X_b])
        return {
            "carried": plus(self._of_outputs(with_base), dot(Q[:, :first].T, G)),
            "of_base": self._of_accelerations(with_base) - dot(of_u, G),
            "inward": pushed[:6] + dot(X_b.T, pushed[6:]) + dot(G.T, Q[:, first:]),
        }

    def alone(self, back: GivenColumns) -> dict[str, ca.SX]:
        """Return the outputs' accelerations without this friction, and what the law takes from wrenches.

        Args:
            back: Filled with the base's acceleration.
        """
        options, chain, X = self.options, self.core.chain, self.X
        A = back.take("A0_base", 6) if options.base is None else plain(options.base)
        u_dot = self.solved.u_0 - dot(self.solved.G, A)
        s = np.concatenate([A, dot(X[:, :6], A) + X[:, 6] + dot(X[:, 7:], u_dot)])
        out: dict[str, ca.SX] = {}
        for o, body in enumerate(self.core.outputs):
            if options.carries[o]:
                at = whole(chain, body, s, motion_map(chain, body))
                out[f"A0 {o}"] = pack(classical(chain.V[body], at) if options.velocity else at)
        if options.rubbing:
            taken, turning = self._taken, carried(chain) if options.velocity else {}
            p = self._of_accelerations(s[:, None])[:, 0] + dot(taken.of_forces, self.form[1][6:])
            for of_bias, output in zip(taken.of_biases, self.outputs, strict=True):
                p = plus(p, dot(of_bias, output.bias))
            own = [zeros(0)] + [
                dot(plain(term.part), turning.get(one.joint + 1, zeros(6)))
                for one in of_core(options.rubbing, self.plan.parts)
                for term in one.terms
            ]
            own.append(zeros(len(p) - sum(map(len, own))))
            out["p_0"] = pack(p + np.concatenate(own) + taken.alone)
        return out

    def changed(self, settled: GivenColumns) -> Expression:
        """Return u, filled into what is known in the last sweep: n of a module that no other feels, or u."""
        factors, _, _, Q = self.solved
        if not self.options.isolated:
            return settled.take("u", len(Q))
        n = settled.take("n", len(self.options.rubbing))
        return factors.solve(dot(Q, n)[:, None])[:, 0]

    def _of_accelerations(self, s: Expression) -> Expression:
        """Return what the law takes by columns of s, without biases and forces, shape (rows, k)."""
        parts = [dot(self._taken.of_s, s)]
        for leg in self.legs:
            delta = minus(s[self.core.chain.columns_of(leg.platform + 1)], s[:6])
            parts.append(dot(leg.per_force, np.concatenate([s[:6], delta])))
        return np.concatenate(parts)

    def _of_outputs(self, s: Expression) -> Expression:
        """Return changes of V_dot of the outputs that carry modules, own frames, shape (6 outputs, k)."""
        chain, out = self.core.chain, [zeros(0, s.shape[1])]
        for o, body in enumerate(self.core.outputs):
            if self.options.carries[o]:
                at = chain.R0[body], chain.p0[body]
                moved = dot(motion_map(chain, body), s)
                out.append(np.stack([motion_to_body(*at, x) for x in moved.T], axis=1))
        return np.concatenate(out)

    def _of_biases(self) -> list[Expression]:
        """Return the change of each output's bias by z, in the base, shape (6, z)."""
        chain, at, out = self.core.chain, 0, list[Expression]()
        for o, body in enumerate(self.core.outputs):
            out.append(zeros(6, self.pushed.shape[1]))
            if self.options.carries[o]:
                out[o][:, at : at + 6] = wrench_map(chain, body)
                at += 6
        return out

    @cached_property
    def _taken(self) -> TakenByLaw:
        """What the law takes from wrenches."""
        chain, M = self.core.chain, self.form[0]
        rubbing = of_core(self.options.rubbing, self.plan.parts)
        through = through_closures(self.core, self.plan, rubbing)
        of_s, of_biases = dot(through, M[6:]), [zeros(len(through), 6) for _ in self.outputs]
        at = 0
        for one in rubbing:
            body, inertial = one.joint + 1, inertial_map(chain, one.joint)
            there = [one.joint in carriers(chain, output.body) for output in self.outputs]
            for term in one.terms:
                rows = slice(at, at + len(term.part))
                of_s[rows] = plus(of_s[rows], dot(plain(term.part), inertial))
                for o in np.flatnonzero(there):
                    output = self.outputs[o]
                    seen = np.stack([seen_from(chain, body, e) for e in eye(6)], axis=1)
                    of_biases[o][rows] = dot(plain(term.part), seen)
                    of_s[rows] = of_s[rows] + dot(of_biases[o][rows], dot(output.inertia, output.J))
                at = rows.stop
        return self._with_legs(of_s, through, of_biases)

    def _with_legs(self, of_s: Expression, through: Expression, of_biases: list[Expression]) -> TakenByLaw:
        """Return what the law takes, from what it takes from joints of the core."""
        rubbing = self.options.rubbing
        alone, of_frictions = [zeros(len(of_s))], [zeros(len(of_s), len(rubbing))]
        for leg in self.legs:
            per_unit = zeros(len(leg.alone), len(rubbing))
            per_unit[:, leg.at] = leg.per_unit
            alone, of_frictions = [*alone, leg.alone], [*of_frictions, per_unit]
        rows = sum(map(len, alone)) - len(of_s)
        padded = [np.concatenate([x, zeros(rows, x.shape[1])]) for x in (through, *of_biases)]
        return TakenByLaw(of_s, padded[0], padded[1:], np.concatenate(alone), np.concatenate(of_frictions))
