"""One robot on one trajectory: its reference, and error and time of a way."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from ...assembly.assemble import assemble
from ...assembly.redundancy import LEAST
from ...compiled import compile
from ...dynamics.inverse import idm
from ...effects.choice import Effects
from ...errors import HybridynError
from ...spatial import Array
from ...structure.robot import HybridRobot
from ...tables.trajectory import TableMotion
from ..compare.methods import each, swept, written
from .points import SLOWER, CostPoint, CostStudy, timed
from .reference import blocks, exact, extrapolated, off
from .ways import EVERY, GENERAL, IN_C, Way, motors_of, solver

#: Rows of the trajectory on which models are compared, evenly spread; of these, how many are computed one by
#: one; and consecutive rows that are closed in C, and by the general path, which takes longer.
SAMPLES, ONE_BY_ONE, CLOSED, CLOSED_SLOWLY = 400, 20, 400, 40
#: Rows at which derivatives are compared, whose reference takes long.
DERIVED = 8
#: Rows of a batch of derivatives, and of that which threads share.
MANY, THREADED = 400, 20_000
#: Error assumed for the general path if no reference of higher precision can be built.
UNJUDGED = 1e-9
#: Part of the time of the whole by which that of its stages together may differ.
ADDS_UP = 0.15


class Trajectory(NamedTuple):
    """A motion of a robot.

    Attributes:
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv).
        a: Accelerations, shape (T, nv).
        time: Times, shape (T,), [s], or None.
        motion: Rows of the table from which the postures were assembled; None if it states every joint.
        redundancy: The rule for freedoms that their poses leave, as in `hybridyn.assemble`.
    """

    q: Array
    v: Array
    a: Array
    time: Array | None
    motion: TableMotion | None = None
    redundancy: str = LEAST


class Measured:
    """A robot on a trajectory, and what is measured of it.

    Attributes:
        study: Receives the reference and remarks.
        robot, trajectory, effects, quantity: As `study_models` takes them.
        motions: States of the motion, and of the same path at another speed.
        exact: The quantity there, as blocks of shape (T, ...).
        rows: Numbers of the states that are computed one by one.
        stages: Whether loops are closed before: a row states its motion, which efforts follow.
        closing: Time to close the loops of a sample, by the general path and in C [s].
    """

    def __init__(
        self, study: CostStudy, robot: HybridRobot, trajectory: Trajectory, effects: Effects, quantity: str
    ) -> None:
        """Compute the states and the reference."""
        self.study, self.robot, self.trajectory = study, robot, trajectory
        self.effects, self.quantity = effects, quantity
        self.closing = dict.fromkeys((GENERAL, IN_C), 0.0)
        self.stages = quantity == "idm" and trajectory.motion is not None
        count = min(len(trajectory.q), DERIVED if quantity.endswith("jacobian") else SAMPLES)
        at = np.linspace(0, len(trajectory.q) - 1, count).astype(int)
        q, v, a = (x[at] for x in trajectory[:3])
        self.motions = [(q, v, a), (q, SLOWER * v, SLOWER**2 * a)]
        if quantity.startswith("ddm"):
            self.motions = [(*state[:2], idm(robot, *state, effects=effects)) for state in self.motions]
        self.exact, study.own_error, study.reference = self._reference()
        self.rows = np.unique(np.linspace(0, count - 1, min(count, ONE_BY_ONE)).astype(int))

    def _reference(self) -> tuple[list[list[Array]], float, str]:
        """Return the quantity at both motions, its own error, and how it was found."""
        asked = self.quantity, self.robot, self.effects
        if self.quantity.endswith("jacobian"):
            both = [extrapolated(*asked, state) for state in self.motions]
            return [x[0] for x in both], max(x[1] for x in both), "extrapolated central differences"
        said = "the same model in 113-bit arithmetic"
        try:
            return [exact(*asked, state) for state in self.motions], 2.0**-53, said
        except (HybridynError, ImportError) as error:
            found = [blocks(solver(*asked)(*state)) for state in self.motions]
            return found, UNJUDGED, f"the general path (no C code: {error})"

    def errors(self, solve: Any, batches: bool = True) -> tuple[float, float]:
        """Return the errors of a solver on both motions: the largest of any number, relative to the peak.

        Args:
            solve: Computes the quantity for many samples, or for one.
            batches: Whether it takes many.
        """
        out, rows = [], slice(None) if batches else self.rows
        for motion, wanted in zip(self.motions, self.exact, strict=True):
            states = [x[rows] for x in motion]
            found = [solve(*states)] if batches else each(solve, [*zip(*states, strict=True)])
            stack: Any = np.concatenate if batches else np.array
            stacked = map(stack, zip(*map(blocks, found), strict=True))
            compare = partial(off, rows=rows, efforts=self.quantity in ("idm", "designs"))
            out.append(max(map(compare, stacked, wanted)))
        return out[0], out[1]

    def by_way(self, way: Way) -> Iterator[CostPoint]:
        """Measure a way at each of its settings: a batch; every effect in C by one call a sample, too."""
        method, states = way.method, self.motions[0]
        least = THREADED if way.threads > 1 else MANY if self.quantity.endswith("jacobian") else 1
        states = tuple(np.tile(x, (-(-least // len(x)), 1)) for x in states)  # type: ignore[assignment]
        singly = (way.method.name, way.setting, way.threads) == (IN_C, EVERY, 1)
        sizes = [len(states[0])] * method.batches + [1] * (singly or not method.batches)
        stage = GENERAL if method.name == GENERAL else IN_C
        for one in swept(method, self.robot, states, self.rows, sizes, way.threads):
            if self.stages and not self.closing[stage]:
                self.closing[stage] = self._stages(stage, one.solve)
            error, elsewhere = self.errors(one.solve, method.batches)
            own = timed(one.call, threads=way.threads)[0] / one.samples
            yield CostPoint(
                f"{method.name}, one call a sample" if one.single and method.batches else method.name,
                written(one.setting) or way.setting, error, self.closing[stage] + own, way.fragment,
                use="program" if one.single and singly else way.use, what=way.what,
                one_call=one.single, elsewhere=elsewhere,
            )  # fmt: skip

    def _stages(self, stage: str, solve: Any) -> float:
        """Time closing, the model, and both in one, in turn; remark if the stages do not add up."""
        assert self.trajectory.motion is not None
        part = self.trajectory.motion.part(0, CLOSED_SLOWLY if stage == GENERAL else CLOSED)
        model = None if stage == GENERAL else compile(self.robot, self.effects, wait=True)
        close: Any = model.assemble if model else partial(assemble, self.robot)
        call = partial(
            close, motors=part.joints, platforms=part.platforms, guess=self.trajectory.q[0],
            redundancy=self.trajectory.redundancy,
        )  # fmt: skip
        state = call()
        if model and model.recomputed:
            self.study.remarks.append(
                f"closing: {model.recomputed} of {part.size} samples are closed in Python, since C hands "
                "them over"
            )
        closing, own, whole = timed(call, lambda: solve(*state), lambda: solve(*call()))
        if abs(closing + own - whole) > ADDS_UP * whole:
            apart, together = (1e6 * x / part.size for x in (closing + own, whole))
            self.study.remarks.append(
                f"{stage}: closing and model take {together:.3g} us together, {apart:.3g} us apart: the "
                "machine is busy, or its caches are full"
            )
        return closing / part.size

    def by_ticks(self) -> Iterator[CostPoint]:
        """Measure calls from the motors, tick after tick, as a controller makes them."""
        model, name = (
            compile(self.robot, self.effects, wait=True),
            {"idm": "idm_from_motors"}.get(self.quantity, "close"),
        )
        motors = motors_of(self.robot, *(x[:CLOSED] for x in self.trajectory[:3]))

        def calls() -> None:
            """Compute sample after sample."""
            last = self.trajectory.q[0]
            for sample in zip(*motors, strict=True):
                last = getattr(model, name)(*sample, last=last)[-3]

        error, elsewhere = self.errors(solver(self.quantity, self.robot, self.effects, model))
        yield CostPoint(
            f"{IN_C}, one call a sample", "from the motors", error, timed(calls)[0] / len(motors[0]),
            f"# hybridyn.compile(robot, effects).{name}", "program", "call it sample by sample",
            one_call=True, elsewhere=elsewhere,
        )  # fmt: skip
