"""The problem of a chain of modules at every sample of a trajectory; `follow` takes it like a module's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...description.names import listed
from ...linkage.motion import Motion
from ...linkage.newton import Closed, close
from ...linkage.targets import CoordinateTarget, PoseTarget, row_measures
from ...spatial import Array, Index, Mask, in_turn
from ..task import Freedom, Task, WeakRows, closed_samples, too_many
from .bodies import Carried, CarriedFrame
from .problem import ChainProblem, Relative
from .shortfall import chain_shortfall


@dataclass(frozen=True, eq=False)
class ChainTask:
    """A problem of several modules at every sample of a trajectory.

    Attributes:
        problem: Rows and free freedoms.
        parts: The tasks of the modules, by what is given in them alone.
        left: Number of freedoms that what is given leaves: each row then moves least from the one before.
        start: The problem where all other modules are at the guess, with one sample; None if they rest.
    """

    problem: ChainProblem
    parts: tuple[Task, ...]
    left: int
    start: ChainProblem | None = None

    @property
    def redundant(self) -> bool:
        """Whether what is given leaves freedoms to the rule."""
        return self.left > 0

    def predicted(self, q: Array, samples: Index) -> Array | None:
        """Return None: the least motion meets the rows and moves no further; see `Task.predicted`."""
        return None

    def surplus(self, q: Array) -> str:
        """Return what to say of poses that prescribe more than is left, as `Task.surplus`."""
        wanted = sum(len(one.target.units) for one in self.problem.relatives)
        left = {part.module: self.problem.left(part.problem) for part in self.parts}
        rank = self.problem.rank or 0
        return too_many(wanted, left, rank) if wanted > rank else ""

    @property
    def known(self) -> Array:
        """Positions, shape (T, nq), of which those of given joints are used."""
        return np.concatenate([part.known for part in self.parts], axis=1)

    @property
    def tolerance(self) -> float:
        """Largest scaled residual of a closed posture."""
        return self.parts[0].tolerance

    @property
    def module(self) -> str:
        """The name of the outermost module, for messages."""
        return self.parts[-1].module

    @property
    def label(self) -> str:
        """The modules, for messages."""
        return f"module{'s' * (len(self.parts) > 1)} {listed(part.module for part in self.parts)}"

    @property
    def row_names(self) -> Sequence[str]:
        """Name of each row, for messages."""
        own = [name for part in self.parts for name in part.row_names]
        return own + [name for one in self.problem.relatives for name in one.names]

    @property
    def row_measures(self) -> list[tuple[float, str] | None]:
        """What one is of each row of a target, as `Task.row_measures`."""
        own = [one for part in self.parts for one in part.row_measures]
        return own + [one for each in self.problem.relatives for one in row_measures(each.target)]

    @property
    def freedoms(self) -> Sequence[Freedom]:
        """What is told of each freedom, with its module."""
        return [
            one._replace(
                name=f"{one.name} of module '{part.module}'",
                at=None if one.at is None else one.at + first.start,
            )
            for part, first in zip(self.parts, self.problem.tree.q_of, strict=True)
            for one in part.freedoms
        ]

    def weak_rows(self, q: Array, samples: Index | None = None) -> list[WeakRows]:
        """Return the targets over all that may move, then each part's own rows, as `Task.weak_rows`."""
        problem = self.problem
        split = problem.split(problem.matrix(problem.tree.sweep(q), samples))
        rank = min(split.reach.shape[1:]) if problem.rank is None else problem.rank
        one = split._replace(bases=[np.repeat(N[:1], split.reach.shape[2], axis=0) for N in split.bases])
        out = [WeakRows(split.reach, rank, problem.spread(one, np.eye(split.reach.shape[2])).T)]
        for part, K, at in zip(problem.parts, split.rows.own, problem.tree.v_of, strict=True):
            if part.rank:
                own = np.eye(problem.tree.nv)[:, at][:, part.free]
                out.append(WeakRows(K[:, :, part.free], part.rank, own))
        return out

    def loose(self, q: Array) -> Array:
        """Return motions that keep the loops closed at a posture, as `Task.loose`."""
        own = [part.loose(x) for part, x in zip(self.parts, self.each(q), strict=True)]
        out = np.zeros((self.problem.tree.nv, sum(x.shape[1] for x in own)))
        at = 0
        for x, rows in zip(own, self.problem.tree.v_of, strict=True):
            out[rows, at : at + x.shape[1]] = x
            at += x.shape[1]
        return out

    def each(self, q: Array) -> list[Array]:
        """Return the positions of each part, shape (T, its nq)."""
        return [q[:, at] for at in self.problem.tree.q_of]

    def with_known(self, q: Array, samples: Index) -> Array:
        """Return positions with the given joints set to their values."""
        own = [part.with_known(x, samples) for part, x in zip(self.parts, self.each(q), strict=True)]
        return np.concatenate(own, axis=1)

    def solve(self, q: Array, samples: Index, *, enough: float = np.inf) -> Closed:
        """Close the loops and meet the targets from starts q; `enough` as in `close`."""
        return close(self.problem, self.with_known(q, samples), samples, enough=enough)

    def closed(self, result: Closed) -> Mask:
        """Check which samples converged and closed, shape (T,)."""
        problem = self.problem
        return closed_samples(result, self.tolerance, problem.rank, lambda q: self.weak_rows(q)[0].rows)

    def open_by(self, q: Array) -> float:
        """Return the largest scaled residual of the closures at postures, whatever is given."""
        return max(part.open_by(x) for part, x in zip(self.parts, self.each(q), strict=True))

    def closed_near(self, q: Array) -> Closed:
        """Close the loops near postures, whatever is given."""
        own = [part.closed_near(x) for part, x in zip(self.parts, self.each(q), strict=True)]
        residual, step = (np.max([getattr(x, name) for x in own], axis=0) for name in ("residual", "step"))
        return Closed(
            np.concatenate([x.q for x in own], axis=1), residual, step, max(x.iterations for x in own)
        )

    def lacking(self, q: Array, samples: Index) -> Array:
        """Return the length that chain and loops lack in any posture, see `chain_shortfall`."""
        return chain_shortfall(self.problem, self.parts, self.with_known(q, samples), samples)

    def mirrored(self, q: Array, samples: Index) -> Mask:
        """Check which samples take an angle in the other of its triples, as `Task.mirrored`."""
        out: Mask = np.any(
            [part.mirrored(x, samples) for part, x in zip(self.parts, self.each(q), strict=True)], axis=0
        )
        if any(map(_turns, self.problem.relatives)):
            frames = self.problem.frames(self.problem.tree.sweep(q), samples)
            for one in self.problem.relatives:
                if isinstance(one.target, CoordinateTarget) and one.target.turns:
                    seen = frames.seen(one.link, one.other)
                    out |= one.target.missed(seen, samples, self.tolerance)
        return out

    def headed(self, q: Array, samples: Index, *, done: float | None = None) -> ChainTask:
        """Return the task whose angles are told apart by postures, as `Task.headed`."""
        if not any(map(_turns, self.problem.relatives)) and all(
            part.headed(x[:1], samples[:1]) is part
            for part, x in zip(self.parts, self.each(q), strict=True)
        ):  # fmt: skip
            return self
        place, at, on = self.problem, samples, done is None
        if done is not None:  # what is known goes with the posture
            place, at = self.between(int(samples[0]), np.array([done])).problem, np.zeros_like(samples)
        elif self.start and not any(map(_headed, place.relatives)):  # at a guess, all modules are there
            place, at = self.start, np.zeros_like(samples)
        frames = place.frames(place.tree.sweep(q), at)
        relatives = tuple(
            replace(one, target=one.target.headed(frames.seen(there.link, there.other), samples, on=on))
            for one, there in zip(self.problem.relatives, place.relatives, strict=True)
        )
        parts = [part.headed(x, samples, done=done) for part, x in zip(self.parts, self.each(q), strict=True)]
        return self._with(parts, self.problem.carried, relatives)

    def headed_at(self, q: Array, values: Array) -> ChainTask:
        """Return the task of one pose with the headings of its coordinates there, as `Task.headed_at`."""
        frames = self.problem.frames(self.problem.tree.sweep(q), np.arange(len(q)))
        relatives = tuple(
            replace(one, target=one.target.headed_at(frames.seen(one.link, one.other), values))
            for one in self.problem.relatives
        )
        return replace(self, problem=replace(self.problem, relatives=relatives))

    def between(self, sample: int, fractions: Array) -> ChainTask:
        """Interpolate the task from a sample to the next, one new sample per fraction, shape (n,).

        Each known motion goes straight by itself: that of a joint is a turn, or a slide.
        """

        def moved(place: CarriedFrame) -> CarriedFrame:
            targets = [PoseTarget(0, way, np.ones(6)).between(sample, fractions) for way in place.ways]
            return replace(place, ways=tuple(target.goal for target in targets))

        relatives = tuple(
            replace(
                one,
                link=moved(one.link),
                other=moved(one.other),
                target=one.target.between(sample, fractions),
            )
            for one in self.problem.relatives
        )
        carried = Carried(tuple(map(moved, self.problem.carried.bases)))
        return self._with([part.between(sample, fractions) for part in self.parts], carried, relatives)

    def from_here(self, q: Array, samples: Index) -> ChainTask:
        """Return the way from postures to samples, two samples for each, one after the other.

        Where the task has a `start`, other modules go with it, from the guess.
        """
        start, here = self.start or self.problem, np.zeros_like(samples) if self.start else samples

        def way(place: CarriedFrame, before: CarriedFrame) -> CarriedFrame:
            """Return a place that moves from where it was to where it is at the samples."""
            ends = [
                (x.take(here).arrays, y.take(samples).arrays)
                for x, y in zip(before.ways, place.ways, strict=True)
            ]
            return replace(place, ways=tuple(Motion(*map(in_turn, *pair)) for pair in ends))

        frames = start.frames(start.tree.sweep(q), here)
        relatives = tuple(
            replace(
                one, link=way(one.link, before.link), other=way(one.other, before.other),
                target=one.target.from_here(frames.seen(before.link, before.other), samples),
            )
            for one, before in zip(self.problem.relatives, start.relatives, strict=True)
        )  # fmt: skip
        bases = tuple(map(way, self.problem.carried.bases, start.carried.bases))
        parts = [part.from_here(x, samples) for part, x in zip(self.parts, self.each(q), strict=True)]
        return self._with(parts, Carried(bases), relatives)

    def _with(self, parts: Sequence[Task], carried: Carried, relatives: tuple[Relative, ...]) -> ChainTask:
        """Return the task with other samples."""
        problem = replace(
            self.problem, parts=tuple(part.problem for part in parts), carried=carried, relatives=relatives
        )
        return replace(self, problem=problem, parts=tuple(parts))


def _turns(one: Relative) -> bool:
    """Return whether a target prescribes a lone angle."""
    return isinstance(one.target, CoordinateTarget) and one.target.turns


def _headed(one: Relative) -> bool:
    """Return whether it is told which triple of angles a target means."""
    return isinstance(one.target, CoordinateTarget) and one.target.heading is not None
