"""Rates and accelerations of a chain: those of the least motion, where what is given leaves freedoms.

In scaled coordinates, the rates x of the free freedoms are the least that meet K x = b, where W measures
them: W x + K^T mu = 0 for some multipliers mu. The time derivative of this condition, W x' + K'^T mu + K^T
mu' = 0, determines the accelerations x': along the motions that K leaves free, they are those of -K'^T mu.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...errors import AT_SAMPLE, AssemblyError, SingularityError
from ...linkage.elimination import least_squares
from ...linkage.pointing import DirectionTarget, DistanceTarget
from ...spatial import Array
from ...structure.module import Module
from ..module_request import ModuleRequest
from ..task import BOUNDED, CONTRADICTION, SINGULAR_ROWS, check_agreement, check_bounded
from .ahead import ahead, open_rates
from .bodies import ChainMotion
from .chart import SLOPE
from .lowest import LowestTask
from .problem import ChainProblem, ChainRows, Split, rates_of_twist
from .task import ChainTask

#: Way of one step of the differences along a motion [rad, module lengths]. Their error is the step to the
#: power of six, over 140, times the seventh derivative.
AHEAD = 1e-2
#: Rows of closures that rates miss by more than this part of the largest are met by all freedoms.
BENT = 1e-12


@dataclass(frozen=True, eq=False)
class ChainRates:
    """Solves the rows of a chain for rates and accelerations at postures.

    Attributes:
        task: The task, with the headings of its angles.
        modules: The modules.
        requests: What is given in each.
        x: Postures that meet the task, shape (T, nq).
        placed: Their motion.
        split: The rows there.
    """

    task: ChainTask
    modules: Sequence[Module]
    requests: Sequence[ModuleRequest]
    x: Array
    placed: ChainMotion
    split: Split

    def both(self) -> tuple[Array, Array]:
        """Compute rates and accelerations of the parts' trees, shapes (T, nv).

        Raises:
            SingularityError: They have no bound.
            AssemblyError: What is given contradicts itself.
        """
        task, scale = self.task, self.task.problem.col_scale
        rates = self._solve(self._asked("known_v"), self._wanted(self.placed, None), "rates")
        accelerations = self._accelerations(rates)
        if isinstance(task, LowestTask):
            chart = task.chart(self.x, np.arange(len(self.x)))
            rates = rates + open_rates(chart, self._hurry(rates, accelerations), rates)
            accelerations = self._accelerations(rates)
            hurry = self._hurry(rates, accelerations)
            accelerations += open_rates(chart, hurry, rates, accelerations)
        elif task.redundant:
            accelerations -= self._turning_of_the_rule(rates, self._hurry(rates, accelerations))
        return rates * scale, accelerations * scale

    def _accelerations(self, rates: Array) -> Array:
        """Compute the least accelerations, scaled, at scaled rates, shapes (T, nv)."""
        problem = self.task.problem
        motion = problem.tree.sweep(self.x, rates * problem.col_scale, at=self.placed)
        wanted = self._wanted(motion, rates * problem.col_scale)
        return self._solve(self._asked("known_a"), wanted, "accelerations")

    def _hurry(self, rates: Array, accelerations: Array) -> Array:
        """Return one over the time in which anything moves by one [rad, module lengths], shape (T,)."""
        out: Array = np.maximum(_pace(rates, accelerations), self._known_hurry())
        return out

    def _asked(self, level: str) -> Array:
        """Return given rates or accelerations of joints, scaled, shape (T, nv)."""
        known = np.concatenate([getattr(request, level) for request in self.requests], axis=1)
        out: Array = known / self.task.problem.col_scale
        return out

    def _wanted(self, motion: ChainMotion, rates: Array | None) -> Array:
        """Return the right-hand side of all rows: rates, or accelerations less the drift at given rates."""
        problem, samples, out = self.task.problem, np.arange(len(self.x)), []
        level = 0 if rates is None else 1
        for part, own, at in zip(problem.parts, motion.parts, problem.tree.v_of, strict=True):
            drift = np.zeros((len(self.x), part.closures.rows))
            if rates is not None:
                drift = part.closures.rates(own, rates[:, at])[1] * part.row_scale
            out += [-drift, *(t.rates(own, samples)[level] / t.units for t in part.targets)]
        frames = problem.frames(motion, samples, moving=True)
        for one in problem.relatives:
            seen = frames.seen(one.link, one.other)
            wanted = one.target.rates(seen, samples)[level]
            if rates is None:  # less what the known motion of other modules causes
                wanted = wanted - rates_of_twist(one.target, seen, samples)
            out.append(wanted / one.target.units)
        return np.concatenate(out, axis=1)

    def _solve(self, asked: Array, wanted: Array, what: str) -> Array:
        """Solve all rows for the free freedoms, scaled, shape (T, nv), and check the solution."""
        problem, rows, at = self.task.problem, self.split.rows, 0
        x = asked + problem.solve_split(self.split, wanted - _times(rows, problem, asked))
        nearest = what in self.requests[0].nearest
        parts = zip(self.modules, self.requests, problem.parts, rows.own, problem.tree.v_of, strict=True)
        for module, request, part, K, to in parts:
            right = wanted[:, at : at + K.shape[1]]
            at += K.shape[1]
            if part.rank:
                check_bounded(module, part, K, x[:, to], right, what)
            x[:, to] = _settled(module, part.closures.rows, K, x[:, to], right)
            if part.targets and not nearest:
                check_agreement(module, part, K, x[:, to], asked[:, to], right, what, request)
        self._check(x, asked, wanted, what, nearest)
        return x

    def _check(self, x: Array, asked: Array, wanted: Array, what: str, nearest: bool) -> None:
        """Check that the targets between links are met, by motions that have a bound."""
        task, reach = self.task, self.split.reach
        right = wanted[:, -reach.shape[1] :]
        size = np.maximum(np.abs(right).max(axis=1), np.abs(asked).max(axis=1, initial=0.0))
        missed = np.abs(_times(self.split.rows, task.problem, x)[:, -reach.shape[1] :] - right).max(axis=1)
        large = np.abs(x).max(axis=1, initial=0.0)
        suspect = np.flatnonzero((large > BOUNDED * size) | (BOUNDED * missed > size))
        if len(suspect) and task.problem.rank:
            s = np.linalg.svd(reach[suspect], compute_uv=False)
            least = s[:, task.problem.rank - 1]
            for i in np.flatnonzero(least < SINGULAR_ROWS * s[:, 0])[:1]:
                condition = float(s[i, 0] / least[i]) if least[i] else np.inf
                raise SingularityError(
                    f"{task.label}: the {what} of {self._links()} given{AT_SAMPLE} cannot be followed: "
                    f"together they lose a direction there (condition number {condition:.1e}, limit "
                    f"{1 / SINGULAR_ROWS:.0e}). Move the motion away from there",
                    module=self.modules[-1].name,
                    what="targets",
                    condition=condition,
                    sample=int(suspect[i]),
                )
        limit = CONTRADICTION * np.maximum(1.0, np.maximum(large, size))
        bad = np.flatnonzero(missed > limit)
        if len(bad) and not nearest:
            t = int(bad[0])
            off = _times(self.split.rows, task.problem, x)[t, -right.shape[1] :] - right[t]
            row = int(np.argmax(np.abs(off))) - right.shape[1]
            worst, measure = task.row_names[row], task.row_measures[row]
            scale, unit = measure or (1.0, "rad")
            unit += "/s" if what == "rates" else "/s^2"
            raise AssemblyError(
                f"{task.label}: the {what} of {self._links()} given{AT_SAMPLE} contradict what else is "
                f"given{task.surplus(self.x)}. {worst} is missed most, by {scale * missed[t]:.3g} {unit} "
                f"(limit {scale * limit[t]:.2g}). Leave some out",
                module=self.modules[-1].name,
                sample=t,
            )

    def _links(self) -> str:
        """Return the names of what the targets prescribe."""
        return ", ".join(dict.fromkeys(name for one in self.task.problem.relatives for name in one.names))

    def _turning_of_the_rule(self, rates: Array, hurry: Array) -> Array:
        """Compute the part of K'^T mu along the motions that all rows leave free, scaled, shape (T, nv).

        Args:
            rates: Scaled rates, shape (T, nv).
            hurry: One over the time in which anything moves by one, shape (T,).
        """
        problem, reach = self.task.problem, self.split.reach
        own, between = self._multipliers(np.where(problem.free, rates, 0.0))
        h = AHEAD / np.where(hurry > 0.0, hurry, 1.0)
        change = np.zeros_like(rates)
        for steps, weight in SLOPE:
            for sign in (1.0, -1.0):
                times = sign * steps * h
                change += (sign * weight / h)[:, None] * self._forces(rates, times, own, between)
        y = problem.gathered(self.split, np.where(problem.free, change, 0.0))
        y -= least_squares(reach, np.einsum("tij,tj->ti", reach, y), rank=problem.rank)
        return problem.spread(self.split, y)

    def _multipliers(self, least: Array) -> tuple[list[Array], Array]:
        """Compute mu with W x + K^T mu = 0: of the rows of each part, and of the targets between links."""
        problem, rows, reach = self.task.problem, self.split.rows, self.split.reach
        measured = least / np.concatenate(problem.ease) ** 2
        y = problem.gathered(self.split, measured)
        between = least_squares(np.swapaxes(reach, 1, 2), -y, rank=problem.rank)
        own = []
        each = zip(problem.parts, rows.own, rows.targets, problem.ease, problem.tree.v_of, strict=True)
        for part, K, J, ease, at in each:
            rest = -((measured[:, at] + np.einsum("tij,ti->tj", J, between)) * ease)[:, part.free]
            own.append(least_squares(np.swapaxes((K * ease)[:, :, part.free], 1, 2), rest, rank=part.rank))
        return own, between

    def _forces(self, rates: Array, times: Array, own: Sequence[Array], between: Array) -> Array:
        """Compute K^T mu ahead by small times, shape (T,), at the present rates, shape (T, nv)."""
        problem, samples = self.task.problem, np.arange(len(self.x))
        x = problem.tree.integrate(self.x, times[:, None] * rates * problem.col_scale)
        rows = ahead(problem, times).matrix(problem.tree.sweep(x), samples)
        return np.concatenate([
            np.einsum("tij,ti->tj", K, mu) + np.einsum("tij,ti->tj", J, between)
            for K, J, mu in zip(rows.own, rows.targets, own, strict=True)
        ], axis=1)  # fmt: skip

    def _known_hurry(self) -> Array:
        """Return one over the time in which anything that is known moves by one.

        It is what carries the parts and links, directions and points.

        Shape (T,), [rad/s, lengths/s].
        """
        problem = self.task.problem
        places = [*problem.carried.bases, *(x for one in problem.relatives for x in (one.link, one.other))]
        length = max(float(one.target.units.max()) for one in problem.relatives)
        known = [(p.inner.w, p.inner.w_dot) for p in places]
        known += [(p.inner.p_dot / length, p.inner.p_ddot / length) for p in places]
        for target in (one.target for one in problem.relatives):
            if isinstance(target, DirectionTarget):
                known.append((target.rate, target.acceleration))
            if isinstance(target, DistanceTarget):
                known.append((target.centre[1] / length, target.centre[2] / length))
        return np.asarray(np.max([_pace(*motion) for motion in known], axis=0))


def _pace(rates: Array, accelerations: Array) -> Array:
    """Return one over the time in which any of some motions, shapes (T, k), moves by one, shape (T,)."""
    out: Array = np.maximum(np.abs(rates), np.sqrt(np.abs(accelerations))).max(axis=1, initial=0.0)
    return out


def _times(rows: ChainRows, problem: ChainProblem, x: Array) -> Array:
    """Compute the product of all rows with scaled motions, shape (T, rows)."""
    own = [np.einsum("tij,tj->ti", K, x[:, at]) for K, at in zip(rows.own, problem.tree.v_of, strict=True)]
    between = sum(
        np.einsum("tij,tj->ti", J, x[:, at]) for J, at in zip(rows.targets, problem.tree.v_of, strict=True)
    )
    return np.concatenate([*own, between], axis=1)


def _settled(module: Module, closures: int, K: Array, x: Array, wanted: Array) -> Array:
    """Correct all freedoms of a module where its closures are still violated, scaled, shape (T, n)."""
    miss = wanted[:, :closures] - np.einsum("tij,tj->ti", K[:, :closures], x)
    scale = np.abs(x).max(axis=1, initial=0.0) + np.abs(wanted).max(axis=1, initial=0.0)
    bent = np.flatnonzero(np.abs(miss).max(axis=1, initial=0.0) > BENT * scale)
    if len(bent):
        x = x.copy()
        x[bent] += least_squares(K[bent][:, :closures], miss[bent], rank=module.mechanism.reduction.rank)
    return x
