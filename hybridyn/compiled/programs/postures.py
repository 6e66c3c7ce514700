"""Closed postures of compiled models: of one robot row after row, and of many designs along one table."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...assembly.posture import holding
from ...assembly.posture import posture_at as assembled_at
from ...assembly.redundancy import LEAST
from ...assembly.requests import Requests, asked_requests, first_guess, gather_requests
from ...errors import HybridynError
from ...spatial import Array
from ...structure.given import by_name, motors_by_name
from ...structure.samples import as_positions, same_samples
from ..library.closed_rows import ClosedRows
from ..library.direct_calls import again, refuse
from .closing.apart import Apart
from .closing.assembling import Assembler
from .closing.own_requests import requests_of_motors
from .evaluating import DesignEvaluator, DesignTable
from .model_calls import ModelCalls
from .sources import kept


class Postures:
    """The closed postures of a `CompiledRobot`.

    The general path computes postures of which the C is not certain.
    """

    def __init__(self, models: ModelCalls) -> None:
        """Prepare the closing of the robot's loops; programs are built when they are first needed."""
        self.robot, self._models, self._handed = models.robot, models, models.handed
        self._assembler = Assembler(self.robot)
        self._assemblers = {frozenset[str](): self._assembler}
        self._close_at_once: Callable[..., int] = refuse
        self.follower: ClosedRows | None = None
        self.still = np.zeros(len(self.robot.motors))

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the models."""
        return Postures, (self._models,)

    def assemble(
        self,
        *,
        motors: Mapping[str, object] | ArrayLike | None = None,
        platforms: Mapping[str, object] | None = None,
        guess: Array | None = None,
        nearest: bool = False,
        hold: Iterable[str] = (),
        weights: Mapping[str, float] | None = None,
        redundancy: str = LEAST,
    ) -> tuple[Array, Array, Array]:
        """Compute postures that close all loops, like `hybridyn.assemble`, row after row in C.

        Newton's method starts from the row before; a row counts only if the step agrees with its prediction
        as the general path demands of a motion on one assembly branch. The general path computes other rows.
        The first call with a new choice of given motors and platforms builds a program for it, which is kept.

        Args:
            motors: As in `hybridyn.assemble`.
            platforms: As in `hybridyn.assemble`.
            guess: Initial posture, shape (nq,), such as the last one; the home posture by default.
            nearest: As in `hybridyn.assemble`.
            hold: As in `hybridyn.assemble`.
            weights: As in `hybridyn.assemble`.
            redundancy: As in `hybridyn.assemble`. Only the least motion is written in C.

        Returns:
            q, v, a as `hybridyn.assemble` returns them, equal up to rounding, in double precision. Rods that
            nothing keeps from turning about their line get the least rates there, too; how far they have
            turned depends on the steps, which are not those of the general path.

        Raises:
            HybridynError: The same errors with the same messages as `hybridyn.assemble`.
        """
        requests = asked_requests(self.robot, motors, platforms, guess, nearest, hold, weights, redundancy)
        return self.assemble_requests(requests, guess)

    def designs(
        self,
        parameters: ArrayLike,
        *,
        motors: Mapping[str, object] | ArrayLike | None = None,
        platforms: Mapping[str, object] | None = None,
        redundancy: str = LEAST,
    ) -> DesignTable:
        """Compute the motion and the efforts of many designs along one table, each from its home posture.

        Postures and efforts are computed in C, with a design in each lane. The general path computes designs
        of which the C is not certain, and finds what is wrong with those that cannot make the motion.

        Args:
            parameters: Numbers of each design in the order of `parameters.labels`, shape (designs, k).
            motors: As in `hybridyn.assemble`.
            platforms: As in `hybridyn.assemble`.
            redundancy: As in `assemble`.

        Returns:
            States, efforts, and the errors of designs that cannot make the motion; none is raised.

        Raises:
            TrajectoryError: The table or the parameters are wrong.
        """
        found = self._evaluator.table(
            parameters, motors_by_name(self.robot, motors), by_name(platforms), redundancy
        )
        self._handed.hand_over("designs", found.recomputed * found.q.shape[1])
        return found

    def close(
        self,
        position: ArrayLike,
        rate: ArrayLike | None = None,
        acceleration: ArrayLike | None = None,
        *,
        last: Array | None = None,
    ) -> tuple[Array, Array, Array]:
        """Compute the motion of all joints from the motors', as a controller needs it at every tick.

        Args:
            position: Positions in the order of `robot.motors`, shape (motors,) or (T, motors), [m or rad].
            rate: Their rates, of the same shape; zero by default.
            acceleration: Their accelerations, of the same shape; zero by default.
            last: Posture of the last tick, shape (nq,), as this function returned it, or one for each sample,
                (T, nq); home by default. C starts from any other that closes the loops, too; from one that
                does not, such as one in single precision, the general path does.

        Returns:
            q, v, a on the spanning tree. Motors move straight from `last` to the first sample, or each from
            its own, on its assembly branch, which must not end on the way. A base keeps its pose.

        Raises:
            HybridynError: The same errors with the same messages as `hybridyn.assemble`.
        """
        if last is not None and np.ndim(last) == 2:
            return self._close_each(position, rate, acceleration, last)
        nq, nv = self.robot.nq, self.robot.nv
        out = np.empty(nq + 2 * nv)
        start, still = self.robot.home if last is None else last, self.still
        speed, change = still if rate is None else rate, still if acceleration is None else acceleration
        status = self._close_at_once(start, position, speed, change, out)
        if (status and again(self._close_at_once, (start, position, speed, change), out)) == 0:
            return out[:nq], out[nq : nq + nv], out[nq + nv :]
        requests = requests_of_motors(self.robot, position, (rate, acceleration))
        q, v, a = self.assemble_requests(requests, start)
        if requests.samples:
            follower = self.follower = self._assembler.follow_motors(requests, np.atleast_2d(q)[-1])
            self._close_at_once = follower.from_motors if follower else refuse
        return q, v, a

    def _close_each(
        self, position: ArrayLike, rate: ArrayLike | None, acceleration: ArrayLike | None, starts: Array
    ) -> tuple[Array, Array, Array]:
        """Close the loops as `close`, each sample from its own posture; one in doubt is closed alone."""
        near, _ = as_positions(self.robot, starts, "last")
        requests = requests_of_motors(self.robot, position, (rate, acceleration))
        still = np.zeros((len(near), len(self.robot.motors)))
        given = [still if x is None else np.atleast_2d(x) for x in (position, rate, acceleration)]
        same_samples(position=given[0], last=near)
        found, doubtful = self._apart.close(requests, near, self._models.threads)
        for t in doubtful.tolist():
            try:
                alone = self.close(*(x[t] for x in given), last=near[t])
            except HybridynError as error:
                error.sample = t
                raise
            for rows, row in zip(found, alone, strict=True):
                rows[t] = row
        return found

    def closure_residual(self, q: Array) -> Array | None:
        """Compute the largest closure residual of each posture, like `hybridyn.closure_residual`.

        Args:
            q: Positions of nearly assembled postures, shape (nq,) or (T, nq).

        Returns:
            Residuals relative to the module's length, shape () or (T,), or None if the library has no
            program "lift".

        Raises:
            TrajectoryError: As `hybridyn.closure_residual`.
        """
        q, single = as_positions(self.robot, q)
        lift = self._models.current.program("lift")
        if lift is None:
            return None
        still = np.zeros((len(q), self.robot.nv))
        residuals = lift.batch([q, still, still], self._models.threads)[0][-1]
        out: Array = np.asarray(residuals.max(axis=1, initial=0.0), dtype=float)
        return out[0] if single else out

    @cached_property
    def _apart(self) -> Apart:
        """Close samples that do not follow each other."""
        return Apart(self.robot)

    @cached_property
    def _evaluator(self) -> DesignEvaluator:
        """Compute many designs in C."""
        models = self._models
        inverse = partial(models.current.program, "idm")  # it changes when the library is built
        return DesignEvaluator(models.designs, inverse, models.current.artifact, models.threads)

    def posture_at(self, positions: Mapping[str, ArrayLike]) -> Array:
        """Assemble a posture from positions of some modules' joints, also those of wrists that were cut."""
        cut = self.robot.cut_joints & set(positions)
        assembler = kept(self._assemblers, cut, lambda: Assembler(holding(self.robot, cut)))

        def close(motors: Mapping[str, object], guess: Array | None) -> tuple[Array, Array, Array]:
            """Close the loops in C."""
            return self.assemble_requests(gather_requests(assembler.robot, motors, {}), guess, assembler)

        return assembled_at(assembler.robot, positions, close=close)

    def assemble_requests(
        self, requests: Requests, guess: Array | None, assembler: Assembler | None = None
    ) -> tuple[Array, Array, Array]:
        """Assemble postures for requests that have been gathered, by default for `robot`."""
        assembler = assembler or self._assembler
        before = assembler.recomputed
        requests = requests._replace(strict=guess is not None)
        q, v, a = assembler.assemble(requests, first_guess(assembler.robot, guess))
        self._handed.hand_over("assemble", assembler.recomputed - before)
        self._handed.say_of_table("assemble", assembler.recomputed - before, requests.samples)
        return (q[0], v[0], a[0]) if requests.single else (q, v, a)
