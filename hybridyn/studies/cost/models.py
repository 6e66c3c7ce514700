"""Measure error and time of a quantity along a trajectory: effects, arithmetic, calls, rates, engines.

The time of a sample is the sum of its stages: closing its loops from the sample before, and the model; a
setting replaces one of them. Compiled ways come early, since they are the ones to take.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from ...assembly.assemble import assemble
from ...description.names import did_you_mean, listed
from ...dynamics.inverse import idm
from ...effects.choice import Effects
from ...errors import HybridynError, ModelError
from ...spatial import Array
from ...structure.robot import HybridRobot
from ..compare.engine import NotComparableError
from ..compare.methods import Method, written
from .effect_sets import by_effects
from .points import ADVISED, Point, Study, timed
from .quantities import (
    DIFFERENCES,
    GENERAL,
    IN_C,
    QUANTITIES,
    SLOWER,
    Models,
    State,
    Task,
    Way,
    blocks,
    exact,
    extrapolated,
    general,
    motors_of,
    ways,
)
from .rates import by_rates

if TYPE_CHECKING:
    from ...tables.trajectory import Motion

#: Rows of the trajectory on which models are compared, evenly spread; of these, how many are computed one by
#: one; and consecutive rows that are closed in C, and by the general path, a hundred times as slow.
SAMPLES, ONE_BY_ONE, CLOSED, CLOSED_SLOWLY = 400, 20, 400, 40
#: Rows at which derivatives are compared, whose reference takes long.
DERIVED = 8
#: Rows of a batch of derivatives, and of that which threads share.
MANY, THREADED = 400, 20_000
#: Error assumed for the general path if no reference of higher precision can be built.
UNJUDGED = 1e-9
#: The usual setting in words, where no effects are in question.
USUAL = {"close": "the general path", "idm_jacobian": "all of them in C", "ddm_jacobian": "all of them in C"}
#: Part of the time of the whole by which that of its stages together may differ.
ADDS_UP = 0.15
#: Engines, and where what they compute at settings is listed.
ENGINES = {"pinocchio": "pinocchio_methods", "mujoco": "mujoco_engine"}


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A motion of a robot.

    Attributes:
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv).
        a: Accelerations, shape (T, nv).
        time: Times, shape (T,), [s], or None.
        motion: Rows of the table from which the postures were assembled; None if it states every joint.
    """

    q: Array
    v: Array
    a: Array
    time: Array | None
    motion: Motion | None = None

    @property
    def state(self) -> State:
        """Positions, rates and accelerations."""
        return self.q, self.v, self.a

    def thinned(self, samples: int = SAMPLES) -> State:
        """Return at most `samples` of its rows, evenly spread."""
        at = np.unique(np.linspace(0, len(self.q) - 1, min(samples, len(self.q))).round().astype(int))
        return self.q[at], self.v[at], self.a[at]


def study_models(
    robot: HybridRobot,
    trajectory: Trajectory,
    effects: Effects,
    progress: Callable[[Point], None] = lambda point: None,
    study: Study | None = None,
    *,
    quantity: str = "idm",
    engines: Sequence[str] = (),
    target: float = ADVISED,
) -> Study:
    """Measure the settings of a model along a trajectory.

    The error of a setting is the largest difference from the reference: of an effort, relative to the motor's
    largest effort; of another quantity, relative to its largest number. The reference is the model with all
    of `effects` in 113-bit arithmetic.

    Args:
        progress: Called with each point when it is measured.
        study: Filled as points are measured; a new one by default.
        quantity: One of `QUANTITIES`.
        engines: Names of `ENGINES`, whose settings are swept, too; they compute rigid bodies alone.
        target: Error for which a set of effects is built and run.

    Raises:
        ModelError: An engine is unknown.
        HybridynError: The model cannot follow the trajectory.
    """
    for name in engines:
        if name not in ENGINES:
            known = listed(ENGINES)
            raise ModelError(f"engine '{name}' is not swept{did_you_mean(name, ENGINES)}; known: {known}")
    study = Study("", "per sample") if study is None else study
    study.subject, study.usual = QUANTITIES[quantity], USUAL.get(quantity, study.usual)
    study.question = f"error of {study.subject} against time per sample, {len(trajectory.q):,} rows"
    study.second = f"the same path at {SLOWER:g} times the speed"
    for point in _points(study, Measured(robot, trajectory, effects, quantity), engines, target):
        study.points.append(point)
        progress(point)
    return study


class Measured:
    """A robot on a trajectory, and what is measured of it.

    Attributes:
        robot, trajectory, effects, quantity: As `study_models` takes them.
        task: The quantity at states of both motions.
        closing: Time to close the loops of a sample, by the general path and in C [s].
        whole: Time of the quantity with every effect, in C where it can be [s].
    """

    def __init__(self, robot: HybridRobot, trajectory: Trajectory, effects: Effects, quantity: str) -> None:
        self.robot, self.trajectory, self.effects, self.quantity = robot, trajectory, effects, quantity
        self.models = Models(robot)
        self.closing, self.whole = dict.fromkeys((GENERAL, IN_C), 0.0), 0.0

    @property
    def stages(self) -> bool:
        """Whether loops are closed before: a row states its motion, which efforts follow."""
        return self.quantity == "idm" and self.trajectory.motion is not None

    def begin(self, study: Study) -> None:
        """Compute the states and the reference."""
        derived = self.quantity.endswith("jacobian")
        q, v, a = self.trajectory.thinned(DERIVED if derived else SAMPLES)
        motions = [(q, v, a), (q, SLOWER * v, SLOWER**2 * a)]
        if self.quantity.startswith("ddm"):
            motions = [(*state[:2], idm(self.robot, *state, effects=self.effects)) for state in motions]
        if derived:
            both = [extrapolated(self.models, self.quantity, self.effects, state) for state in motions]
            study.reference, study.own_error = "extrapolated central differences", max(x[1] for x in both)
            self.task = Task(motions, [x[0] for x in both])
            return
        try:
            found = [exact(self.quantity, self.robot, self.effects, state) for state in motions]
            study.reference, study.own_error = "the same model in 113-bit arithmetic", 2.0**-53
        except (HybridynError, ImportError) as error:
            call = general(self.quantity, self.robot, self.effects)
            found = [blocks(call(*state)) for state in motions]
            study.reference, study.own_error = f"the general path (no C code: {error})", UNJUDGED
        self.task = Task(motions, found)

    def close(self, line: str, count: int) -> tuple[Any, int]:
        """Return the call that closes the loops of the first rows, and their number."""
        assert self.trajectory.motion is not None
        part = self.trajectory.motion.part(0, count)
        with_model = line != GENERAL
        call = self.models.compiled(self.effects).assemble if with_model else None
        options = {"motors": part.joints, "platforms": part.platforms, "guess": self.trajectory.q[0]}
        return partial(call or partial(assemble, self.robot), **options), part.size


def _points(study: Study, run: Measured, engines: Sequence[str], target: float) -> Iterator[Point]:
    """Yield the points of a study as they are measured, and fill in the rest of it."""
    if not run.robot.motors:
        raise HybridynError(
            f"robot '{run.robot.name}' has no motors, and so no {study.subject}: name some (--motors)"
        )
    run.begin(study)
    for way in ways(run.models, run.quantity, run.effects):
        try:
            yield from _by_way(study, run, way)
        except (HybridynError, ImportError) as error:
            said = f"no compiled models: {error}"
            study.remarks += [said] * (said not in study.remarks)
    if run.quantity in ("idm", "ddm"):
        yield from by_effects(study, run, target)
    if run.quantity == "idm":
        close = partial(assemble, run.robot)
        for point in by_rates(run.robot, run.trajectory.time, *run.trajectory.state, run.effects, close):
            yield replace(point, seconds=point.seconds + run.closing[IN_C] + run.whole)
    for name in engines:
        yield from _by_engine(study, run, name)


def _by_way(study: Study, run: Measured, way: Way) -> Iterator[Point]:
    """Measure one of our own ways: a batch; and in C one call a sample."""
    line = way.method.name
    if line == DIFFERENCES:
        yield from _one_by_one(run, way.method, way)
        return
    solve, states = way.method.prepare(run.robot, way.threads)({}), run.task.motions[0]
    error, elsewhere = run.task.errors(solve)
    least = THREADED if way.threads > 1 else MANY if run.quantity.endswith("jacobian") else 1
    copies = -(-least // len(states[0]))
    batch = [np.tile(x, (copies, 1)) for x in states]
    own = timed(partial(solve, *batch), 2 if line == GENERAL else 3)[1] / len(batch[0])
    stage = GENERAL if line == GENERAL else IN_C
    if run.stages and not run.closing[stage]:
        call, count = run.close(line, CLOSED_SLOWLY if line == GENERAL else CLOSED)
        call()  # builds what it needs
        run.closing[stage] = timed(call, 3)[1] / count
        _check_sum(study, run, line, own, lambda: solve(*call()), count)
    run.whole = own if way.threads == 1 and line in (GENERAL, IN_C) else run.whole
    point = Point(
        line, way.setting, error, run.closing[stage] + own, way.fragment, use=way.use, what=way.what, own=own,
        elsewhere=elsewhere,
    )  # fmt: skip
    yield point
    if line == IN_C and way.threads == 1:
        yield _in_single_calls(run, point, solve)


def _check_sum(
    study: Study, run: Measured, line: str, own: float, whole: Callable[[], object], count: int
) -> None:
    """Run closing and model together, and remark if the stages do not add up."""
    together = timed(whole, 3)[1] / count
    parts = run.closing[GENERAL if line == GENERAL else IN_C] + own
    if abs(parts - together) > ADDS_UP * together:
        study.remarks.append(
            f"{line}: closing and model take {1e6 * together:.3g} us together, {1e6 * parts:.3g} us apart: "
            "the machine is busy, or its caches are full"
        )


def _in_single_calls(run: Measured, batch: Point, solve: Any) -> Point:
    """Measure calls for one sample each, as a controller makes them: from the motors where they are given."""
    motion, robot, words, before = run.trajectory.motion, run.robot, batch.setting, run.closing[IN_C]
    model = None if batch.use == "usual" else run.models.compiled(run.effects)
    step: Any = None
    if run.stages and model and motion and {*motion.joints} == {*robot.motors} and not motion.platforms:
        step, words, before = model.idm_from_motors, f"{words}, from the motors", 0.0
    elif run.quantity == "close" and model:
        step, words = model.close, "tick after tick"
    states = [x[:ONE_BY_ONE] for x in run.task.motions[0]]
    if step:
        states = [*motors_of(robot, *(x[: 5 * ONE_BY_ONE] for x in run.trajectory.state))]
    samples = [*zip(*states, strict=True)]

    def calls() -> None:
        """Compute sample after sample."""
        last = run.trajectory.q[0]
        for sample in samples:
            if step is None:
                solve(*sample)
            else:
                last = step(*sample, last=last)[-3]

    calls()
    own = timed(calls)[1] / len(samples)
    name = run.quantity if step is None else step.__name__
    return replace(
        batch, line=f"{batch.line}, one call a sample", setting=words, seconds=before + own, own=own,
        use="program", what="call it sample by sample", one_call=True,
        fragment=f"# hybridyn.compile(robot, effects).{name}" if model else batch.fragment,
    )  # fmt: skip


def _one_by_one(run: Measured, method: Method, way: Way | None = None) -> Iterator[Point]:
    """Sweep a method that computes one sample at a time; without a way it is another engine's."""
    at = method.prepare(run.robot)
    count = len(run.task.motions[0][0])
    rows = np.unique(np.linspace(0, count - 1, min(count, ONE_BY_ONE)).astype(int))
    states = [*zip(*(np.ascontiguousarray(x[rows]) for x in run.task.motions[0]), strict=True)]
    for setting in method.settings:
        solve = at(setting)
        error, elsewhere = run.task.errors(solve, batches=False, rows=rows)

        def calls(solve: Any = solve) -> None:
            """Compute every sample."""
            for state in states:
                solve(*state)

        own = timed(calls, 3)[1] / len(states)
        yield Point(
            method.name, written(setting), error if np.isfinite(error) else np.inf, run.closing[IN_C] + own,
            way.fragment if way else "", use=way.use if way else "comparison", what=way.what if way else "",
            own=own, one_call=True, elsewhere=elsewhere,
        )  # fmt: skip


def _by_engine(study: Study, run: Measured, name: str) -> Iterator[Point]:
    """Sweep what an engine has for the quantity, where it holds the robot's closures."""
    place = f"{__package__.rpartition('.')[0]}.compare.engines.{ENGINES[name]}"
    methods: list[Method] = [one for one in import_module(place).METHODS if one.model == run.quantity]
    refusals = []
    for method in methods:
        try:
            yield from _one_by_one(run, method)
        except NotComparableError as error:
            refusals.append(str(error))
    if not methods:
        refusals = [f"has none of {study.subject} of robots with loops"]
    if len(refusals) >= len(methods):
        study.remarks += [f"{name}: {why}" for why in dict.fromkeys(refusals)]
