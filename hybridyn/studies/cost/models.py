"""Measure error and time of motor efforts along a trajectory: closing, effects, arithmetic, calls, rates.

The time of a sample is the sum of its stages: closing its loops from the sample before, and the model; a
setting replaces one of them. Compiled ways come first, since they are the ones to take.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ...assembly.assemble import assemble
from ...description.names import listed
from ...dynamics.inverse import idm
from ...effects.choice import Effects
from ...errors import HybridynError
from ...spatial import Array
from ...structure.robot import HybridRobot
from .fragments import model_fragment
from .generated import exact_efforts
from .operations import operations
from .points import Point, Study, Worth, timed
from .rates import by_rates

if TYPE_CHECKING:
    from ...compiled.model import CompiledRobot
    from ...tables.trajectory import Motion

#: Rows of the trajectory on which models are compared, evenly spread; and consecutive rows that are closed in
#: C, and by the general path, which takes a hundred times as long.
SAMPLES, CLOSED, CLOSED_SLOWLY = 400, 400, 40
#: Rows of the batch that threads share.
THREADED = 20_000
#: Calls for one sample each that are timed.
CALLS = 100
#: Error assumed for the general path if no reference of higher precision can be built.
UNJUDGED = 1e-9
#: Effects that are never omitted: those of platforms and serial links.
KEPT = ("gravity", "inertia")
#: Speed of the second motion, relative to the first, on the same path.
SLOWER = 0.7

GENERAL, IN_C, SINGLE = "general path", "compiled", "compiled, float32"


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
    def state(self) -> tuple[Array, Array, Array]:
        """Positions, rates and accelerations."""
        return self.q, self.v, self.a

    def thinned(self, samples: int = SAMPLES) -> Trajectory:
        """Return at most `samples` of its rows, evenly spread."""
        at = np.unique(np.linspace(0, len(self.q) - 1, min(samples, len(self.q))).round().astype(int))
        return Trajectory(self.q[at], self.v[at], self.a[at], None if self.time is None else self.time[at])

    def slower(self) -> Trajectory:
        """Return the motion at `SLOWER` times its speed: it closes the loops, too."""
        return Trajectory(self.q, SLOWER * self.v, SLOWER**2 * self.a, None)


def study_models(
    robot: HybridRobot,
    trajectory: Trajectory,
    effects: Effects,
    progress: Callable[[Point], None] = lambda point: None,
    study: Study | None = None,
) -> Study:
    """Measure the settings of the inverse model along a trajectory.

    The error of a setting is the largest difference of any effort from the reference, relative to the motor's
    largest effort. The reference is the model with all of `effects` in 113-bit arithmetic.

    Args:
        progress: Called with each point when it is measured.
        study: Filled as points are measured; a new one by default.

    Raises:
        HybridynError: The model cannot follow the trajectory.
    """
    study = Study("", "per sample") if study is None else study
    study.question = f"error of motor efforts against time per sample, {len(trajectory.q):,} rows"
    study.second = f"the same path at {SLOWER:g} times the speed"
    for point in _points(study, robot, trajectory, effects):
        study.points.append(point)
        progress(point)
    return study


def _points(study: Study, robot: HybridRobot, trajectory: Trajectory, effects: Effects) -> Iterator[Point]:
    """Yield the points of a study as they are measured, and fill in the rest of it."""
    if not robot.motors:
        raise HybridynError(f"robot '{robot.name}' has no motors, and so no efforts: name some (--motors)")
    some = trajectory.thinned()
    models = {dtype: compiled_model(robot, effects, dtype) for dtype in ("float64", "float32")}
    fast = models["float64"]
    general, seconds = timed(partial(idm, robot, *some.state, effects=effects), 2)
    seconds /= len(some.q)
    exact = exact_efforts(robot, effects, some.q, some.v, some.a)
    known = isinstance(exact, np.ndarray)
    study.reference = "the same model in 113-bit arithmetic" if known else f"the general path ({exact})"
    study.own_error = 2.0**-53 if known else UNJUDGED
    error = _errors(exact if isinstance(exact, np.ndarray) else general)
    closing = _closing(robot, trajectory, partial(assemble, robot), CLOSED_SLOWLY)
    yield Point(
        GENERAL, "every effect (usual)", error(general), closing + seconds,
        model_fragment(effects.names, "general"), use="usual",
        what="keep the general path and every effect", own=seconds,
    )  # fmt: skip
    close: Callable[..., tuple[Array, Array, Array]] = partial(assemble, robot)
    whole = seconds
    if isinstance(fast, str):
        study.remarks.append(f"no compiled models: {fast}")
    else:
        close = fast.assemble
        closing = _closing(robot, trajectory, close, CLOSED)
        for dtype, model in models.items():
            if isinstance(model, str):
                continue
            tau, seconds = timed(partial(model.idm, *some.state))
            point = _in_c(dtype, error(tau), seconds / len(some.q), closing, effects.names)
            whole = point.own if dtype == "float64" else whole
            yield point
        yield from _by_calls(fast, some, trajectory.motion, closing, error)
        yield from _in_threads(robot, effects, some, closing, error)
    yield from _by_effects(study, robot, effects, some, error, (closing, whole))
    for point in by_rates(robot, trajectory.time, *trajectory.state, effects, close):
        yield replace(point, seconds=point.seconds + closing + whole)


def compiled_model(robot: HybridRobot, effects: Effects, dtype: str) -> CompiledRobot | str:
    """Build the compiled models, without their warnings, or return why they cannot be built."""
    from ...compiled.compiling import compile

    log = logging.getLogger("hybridyn.compiled")
    before = log.level
    log.setLevel(logging.ERROR)  # without its legs' inertia, a robot may have massless motions
    try:
        return compile(robot, effects, dtype=dtype)
    except HybridynError as error:
        return str(error)
    finally:
        log.setLevel(before)


def _errors(reference: Array) -> Callable[[Array], float]:
    """Return a function that computes the largest error over a motor's peak effort."""
    peak = np.abs(reference).max(axis=0)
    unit = np.where(peak > 0, peak, 1.0)
    return lambda tau: float((np.abs(np.asarray(tau, dtype=float) - reference) / unit).max(initial=0.0))


def _closing(
    robot: HybridRobot, trajectory: Trajectory, close: Callable[..., tuple[Array, Array, Array]], most: int
) -> float:
    """Measure the time in which loops close, from row to row, for at most so many rows [s per row]."""
    if trajectory.motion is None:
        return 0.0
    part = trajectory.motion.part(0, most)
    call = partial(close, motors=part.joints, platforms=part.platforms, guess=trajectory.q[0])
    call()  # builds what it needs
    return timed(call, 2)[1] / part.size


def _in_c(dtype: str, error: float, own: float, closing: float, names: Sequence[str]) -> Point:
    """Return the point of the compiled model with every effect, many samples at once."""
    if dtype == "float64":
        what, fragment = "keep every effect and compute in C", model_fragment(names, "compiled")
        return Point(IN_C, "every effect", error, closing + own, fragment, what=what, own=own)
    call = 'hybridyn.compile(robot, effects, dtype="float32").idm'
    return Point(
        SINGLE, "every effect", error, closing + own, f"# {call}", use="program",
        what="compute in C (float32)", own=own,
    )  # fmt: skip


def _by_calls(
    model: CompiledRobot, some: Trajectory, motion: Motion | None, closing: float,
    error: Callable[[Array], float],
) -> Iterator[Point]:  # fmt: skip
    """Measure calls for one sample each, as a controller makes them: from the motors where they are given."""
    calls: Callable[[], None]
    line, states = "compiled, one call a sample", list(zip(*some.state, strict=True))
    if motion is not None and {*motion.joints} == {*model.robot.motors} and not motion.platforms:
        given = np.array([motion.joints[name] for name in model.robot.motors])[:, :, :CALLS]
        ticks = np.ascontiguousarray(given.transpose(2, 1, 0))
        rows, before, words = len(ticks), 0.0, "every effect, from the motors"
        fragment = "# hybridyn.compile(robot, effects).idm_from_motors"

        def calls() -> None:
            """Close and compute sample after sample."""
            last = some.q[0]
            for tick in ticks:
                last = model.idm_from_motors(*tick, last=last)[1]

    else:
        rows, before, words = len(states[:CALLS]), closing, "every effect"
        fragment = "# hybridyn.compile(robot, effects).idm"

        def calls() -> None:
            """Compute sample after sample."""
            for state in states[:CALLS]:
                model.idm(*state)

    calls()
    seconds = timed(calls)[1] / rows
    tau = np.array([model.idm(*state) for state in states])
    yield Point(
        line, words, error(tau), before + seconds, fragment, use="program", what="call it sample by sample",
        own=seconds, one_call=True,
    )  # fmt: skip


def _in_threads(
    robot: HybridRobot, effects: Effects, some: Trajectory, closing: float, error: Callable[[Array], float]
) -> Iterator[Point]:
    """Measure a batch that two threads share."""
    from ...compiled.compiling import compile

    model = compile(robot, effects, threads=2)
    copies = -(-THREADED // len(some.q))
    batch = [np.tile(x, (copies, 1)) for x in some.state]
    tau, seconds = timed(partial(model.idm, *batch), 3)
    own = seconds / len(batch[0])
    yield Point(
        IN_C, "every effect, 2 threads", error(tau[: len(some.q)]), closing + own,
        "# hybridyn.compile(robot, effects, threads=2).idm", use="program",
        what="let two threads share a batch", own=own,
    )  # fmt: skip


def _by_effects(
    study: Study,
    robot: HybridRobot,
    effects: Effects,
    some: Trajectory,
    error: Callable[[Array], float],
    times: tuple[float, float],
) -> Iterator[Point]:
    """Measure sets of effects: without each, then without the least important ones together.

    Errors are those of the general path; times follow from the operations of the compiled model.

    Args:
        some: The motion.
        error: Computes the error of efforts on it.
        times: Seconds per sample of closing, and of the compiled model with every effect.
    """
    (closing, whole), slower = times, some.slower()
    optional = [name for name in effects.names if name not in KEPT]
    every = operations(robot, effects, "idm")
    again = _errors(idm(robot, *slower.state, effects=effects))

    def measured(out: Sequence[str]) -> Point:
        """Measure the model without some effects."""
        names = tuple(name for name in effects.names if name not in out)
        on = effects.only(names)
        words = "without " + listed([name.replace("_", " ") for name in out])
        part = operations(robot, on, "idm") / every
        own = whole * (part if np.isfinite(part) else 1.0)
        return Point(
            IN_C, words, error(idm(robot, *some.state, effects=on)), closing + own,
            model_fragment(names, "compiled"), what=words.replace("without", "drop", 1) + " and compute in C",
            own=own, elsewhere=again(idm(robot, *slower.state, effects=on)), how="time by operations",
        )  # fmt: skip

    alone = {name: measured([name]) for name in optional}
    for name, point in alone.items():
        share = 1.0 - point.own / whole
        study.worth.append(Worth(name, point.error, share, computed=True))
        yield point
    order = sorted(optional, key=lambda name: alone[name].error)
    for count in range(2, len(order) + 1):
        yield measured(order[:count])
