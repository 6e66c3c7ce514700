"""Measure error and time of a quantity along a trajectory: effects, arithmetic, calls, rates, engines.

The time of a sample is the sum of its stages: closing its loops from the sample before, and the model; a
setting replaces one of them. Compiled ways come early, since they are the ones to take.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...assembly.assemble import assemble
from ...compiled.compiling import compile
from ...description.names import listed
from ...dynamics.inverse import idm
from ...effects.choice import Effects
from ...errors import HybridynError
from ...spatial import Array
from ...structure.robot import HybridRobot
from ...tables.rates import derivatives
from ..compare.engine import NotComparableError
from ..compare.methods import Method, each, methods_of, swept, written
from .points import ADVISED, ROUNDS, Point, Progress, Step, Study, Worth, fill, timed
from .quantities import (
    EVERY,
    GENERAL,
    IN_C,
    QUANTITIES,
    SLOWER,
    Way,
    blocks,
    exact,
    extrapolated,
    in_c,
    motors_of,
    off,
    operations,
    solver,
    ways,
)
from .settings import model_fragment

if TYPE_CHECKING:
    from ...tables.trajectory import Motion

#: Rows of the trajectory on which models are compared, evenly spread; of these, how many are computed one by
#: one; and consecutive rows that are closed in C, and by the general path, a hundred times as slow.
SAMPLES, ONE_BY_ONE, CLOSED, CLOSED_SLOWLY = 400, 20, 400, 40
#: Rows that are computed tick after tick.
TICKED = 100
#: Rows at which derivatives are compared, whose reference takes long.
DERIVED = 8
#: Rows of a batch of derivatives, and of that which threads share.
MANY, THREADED = 400, 20_000
#: Error assumed for the general path if no reference of higher precision can be built.
UNJUDGED = 1e-9
#: The usual setting in words, where no effects are in question.
USUAL = {
    "close": "the general path",
    "designs": "a robot for each design",
    "idm_jacobian": "all of them in C",
    "ddm_jacobian": "all of them in C",
}
#: Part of the time of the whole by which that of its stages together may differ.
ADDS_UP = 0.15
#: What a controller calls at each tick, from the motors, by quantity.
TICKS = {"idm": "idm_from_motors", "close": "close"}


class Trajectory(NamedTuple):
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


def study_models(
    robot: HybridRobot,
    trajectory: Trajectory,
    effects: Effects,
    progress: Progress = lambda result: None,
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
        progress: Called with each setting and each effect when it is measured.
        study: Filled as points are measured; a new one by default.
        quantity: One of `QUANTITIES`.
        engines: Names of `ENGINES`, whose settings are swept, too; they compute rigid bodies alone.
        target: Error for which a set of effects is built and run.

    Raises:
        ModelError: An engine is unknown.
        HybridynError: The model cannot follow the trajectory.
    """
    methods = {name: methods_of(name, quantity) for name in engines}
    study = Study("", "per sample") if study is None else study
    study.subject, study.usual = QUANTITIES[quantity], USUAL.get(quantity, study.usual)
    study.question = f"error of {study.subject} against time per sample, {len(trajectory.q):,} rows"
    study.second = f"the same path at {SLOWER:g} times the speed"
    if not robot.motors:
        raise HybridynError(
            f"robot '{robot.name}' has no motors, and so no {study.subject}: name some (--motors)"
        )
    run = Measured(study, robot, trajectory, effects, quantity)
    steps: list[Step] = [
        (way.method.name, len(way.method.settings), run.by_way(way)) for way in ways(quantity, effects)
    ]
    motion = trajectory.motion
    if quantity == "close" or (run.stages and motion and {*motion.joints} == {*robot.motors}):
        steps.append(("from the motors", 1, run.by_ticks()))
    if quantity in ("idm", "ddm"):
        steps.append(("effects", len(optional(effects)), by_effects(run, target)))
    if quantity == "idm":
        steps.append(("rates", 2, by_rates(run)))
    for name, own in methods.items():
        steps.append((name, sum(len(one.settings) for one in own), run.by_engine(own)))
    fill(study, steps, progress)
    return study


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
        self, study: Study, robot: HybridRobot, trajectory: Trajectory, effects: Effects, quantity: str
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
        try:
            found = [exact(*asked, state) for state in self.motions]
            return found, 2.0**-53, "the same model in 113-bit arithmetic"
        except (HybridynError, ImportError) as error:
            found = [blocks(solver(*asked)(*state)) for state in self.motions]
            return found, UNJUDGED, f"the general path (no C code: {error})"

    def errors(self, solve: Any, batches: bool = True) -> tuple[float, float]:
        """Return the errors of a solver on both motions: the largest of any number, relative to the peak.

        Args:
            solve: Computes the quantity for many samples, or for one.
            batches: Whether it takes many.
        """
        out = []
        for motion, wanted in zip(self.motions, self.exact, strict=True):
            if batches:
                out.append(max(map(off, blocks(solve(*motion)), wanted)))
                continue
            found = each(solve, [*zip(*(x[self.rows] for x in motion), strict=True)])
            stacked = map(np.array, zip(*map(blocks, found), strict=True))
            out.append(max(off(x, y, self.rows) for x, y in zip(stacked, wanted, strict=True)))
        return out[0], out[1]

    def by_way(self, way: Way) -> Iterator[Point]:
        """Measure a way at each of its settings: a batch; every effect in C by one call a sample, too."""
        method, states = way.method, self.motions[0]
        least = THREADED if way.threads > 1 else MANY if self.quantity.endswith("jacobian") else 1
        if method.batches:
            states = tuple(np.tile(x, (-(-least // len(x)), 1)) for x in states)  # type: ignore[assignment]
        singly = (way.method.name, way.setting, way.threads) == (IN_C, EVERY, 1)
        sizes = [len(states[0])] * method.batches + [1] * (singly or not method.batches)
        stage = GENERAL if method.name == GENERAL else IN_C
        for one in swept(method, self.robot, states, self.rows, sizes, way.threads):
            if self.stages and not self.closing[stage]:
                self.closing[stage] = self._stages(stage, one.solve)
            error, elsewhere = self.errors(one.solve, method.batches)
            own = timed(one.call, rounds=3, threads=way.threads)[0] / one.samples
            yield Point(
                f"{method.name}, one call a sample" if one.single and method.batches else method.name,
                written(one.setting) or way.setting, error, self.closing[stage] + own, way.fragment,
                use="program" if one.single and singly else way.use, what=way.what, own=own,
                one_call=one.single, elsewhere=elsewhere,
            )  # fmt: skip

    def _stages(self, stage: str, solve: Any) -> float:
        """Time closing, the model, and both in one, in turn; remark if the stages do not add up."""
        assert self.trajectory.motion is not None
        part = self.trajectory.motion.part(0, CLOSED_SLOWLY if stage == GENERAL else CLOSED)
        model = None if stage == GENERAL else compile(self.robot, self.effects)
        close: Any = model.assemble if model else partial(assemble, self.robot)
        given = {"motors": part.joints, "platforms": part.platforms, "guess": self.trajectory.q[0]}
        call = partial(close, **given)
        known = model.recomputed if model else 0
        state = call()
        handed = model.recomputed - known if model else 0
        if handed:
            self.study.remarks.append(
                f"closing: {handed} of {part.size} samples are closed in Python, since C hands them over"
            )
        rounds = ROUNDS if handed else max(ROUNDS, part.size // 8)  # calls in C are short
        closing, own, whole = timed(call, lambda: solve(*state), lambda: solve(*call()), rounds=rounds)
        if abs(closing + own - whole) > ADDS_UP * whole:
            apart, together = (1e6 * x / part.size for x in (closing + own, whole))
            self.study.remarks.append(
                f"{stage}: closing and model take {together:.3g} us together, {apart:.3g} us apart: the "
                "machine is busy, or its caches are full"
            )
        return closing / part.size

    def by_ticks(self) -> Iterator[Point]:
        """Measure calls from the motors, tick after tick, as a controller makes them."""
        model, name = compile(self.robot, self.effects), TICKS[self.quantity]
        motors = motors_of(self.robot, *(x[:TICKED] for x in self.trajectory[:3]))

        def calls() -> None:
            """Compute sample after sample."""
            last = self.trajectory.q[0]
            for sample in zip(*motors, strict=True):
                last = getattr(model, name)(*sample, last=last)[-3]

        own = timed(calls)[0] / len(motors[0])
        error, elsewhere = self.errors(solver(self.quantity, self.robot, self.effects, model))
        yield Point(
            f"{IN_C}, one call a sample", "from the motors", error, own,
            f"# hybridyn.compile(robot, effects).{name}", "program", "call it sample by sample", own,
            one_call=True, elsewhere=elsewhere,
        )  # fmt: skip

    def by_engine(self, methods: Sequence[Method]) -> Iterator[Point]:
        """Sweep what an engine has for the quantity.

        Raises:
            NotComparableError: It has nothing, or nothing that holds the robot's closures.
        """
        refusals = [] if methods else [f"has none of {self.study.subject} of robots with loops"]
        for method in methods:
            try:
                yield from self.by_way(Way(method, "comparison", setting=""))
            except NotComparableError as error:
                refusals.append(str(error))
        if len(refusals) >= len(methods):
            raise NotComparableError("; ".join(dict.fromkeys(refusals)))


#: Effects that are never omitted: those of platforms and serial links.
KEPT = ("gravity", "inertia")

#: Number of rows at either end that are ignored, since the rates of a spline are inaccurate there.
EDGE = 40

#: If efforts differ by less than this (relative), the table had no rates: its rates are those of the spline.
SAME_RULE = 1e-12


def optional(effects: Effects) -> list[str]:
    """Return the names of the effects that may be left out."""
    return [name for name in effects.names if name not in KEPT]


def without(effects: Effects, gone: Sequence[str]) -> Effects:
    """Return effects without some of them."""
    return effects.only([name for name in effects.names if name not in gone])


def spared(worth: Sequence[Worth], target: float, error: Callable[[list[str]], float]) -> list[str]:
    """Return the effects that an error allows to leave out, the least important first.

    Args:
        error: Gives the error without some effects together.
    """
    gone: list[str] = []
    for one in sorted((one for one in worth if one.computed), key=lambda one: one.error):
        if one.error > target or error([*gone, one.effect]) > target:
            break
        gone.append(one.effect)
    return gone


def by_effects(run: Measured, target: float) -> Iterator[Worth | Point]:
    """Measure what each effect is worth; then build and run the set that suffices for an error.

    Errors without an effect are those of the general path; its time follows from the operations of the
    compiled model.
    """
    quantity, robot, on = run.quantity, run.robot, run.effects
    every, worth = operations(robot, on, quantity), list[Worth]()

    def error(gone: Sequence[str]) -> float:
        """Return the error without some effects, infinite for a motion without mass."""
        try:
            return run.errors(solver(quantity, robot, without(on, gone)))[0]
        except HybridynError:
            return float("inf")

    for name in optional(on):
        share = 1.0 - operations(robot, without(on, [name]), quantity) / every
        worth.append(Worth(name, error([name]), share, computed=True))
        yield worth[-1]
    if gone := spared(worth, target, error):
        left = without(on, gone)
        method = Method(IN_C, quantity, partial(in_c, quantity, left, "float64"), batches=True)
        names = listed([name.replace("_", " ") for name in gone])
        what, lines = f"drop {names} and compute in C", model_fragment(left.names, "compiled", quantity)
        yield from run.by_way(Way(method, "command", what, lines, f"without {names}"))


def by_rates(run: Measured) -> Iterator[Point]:
    """Compare rates from a spline and from differences of the motors' positions with those of the table.

    Raises:
        HybridynError: There is nothing to compare.
    """
    robot, time, (q, v, a) = run.robot, run.trajectory.time, run.trajectory[:3]
    kinds = {robot.kinds[robot.joint_index[motor]] for motor in robot.motors}
    if time is None or len(time) < 3 * EDGE:
        raise HybridynError(f"not measured: needs times and {3 * EDGE} rows or more")
    if robot.base != "fixed" or kinds - {"revolute", "prismatic"}:
        raise HybridynError("not measured: needs a fixed base and motors on revolute and prismatic joints")
    x, inner = q[:, robot.motor_q], slice(EDGE, len(time) - EDGE)
    efforts, model = solver("idm", robot, run.effects), compile(robot, run.effects)
    (wanted,) = blocks(efforts(q[inner], v[inner], a[inner]))
    after = next(point.seconds for point in run.study.points if point.line == IN_C)
    rules = {
        "quintic spline": partial(derivatives, time, x, slice(0, len(time))),
        "central differences": partial(_differences, time, x),
    }
    for words, rule in rules.items():
        moved = model.assemble(motors=(x, *rule()), guess=q[0])
        error = off(efforts(*(one[inner] for one in moved)), wanted)
        if error < SAME_RULE:
            raise HybridynError("not measured: the table states none, so there is nothing to compare with")
        own = timed(rule)[0] / len(time)
        yield Point(
            "rates of the trajectory", words, error, own + after,
            f"# rates by {words} of the motors' positions", use="program", what=f"take rates by {words}",
            own=own,
        )  # fmt: skip


def _differences(time: Array, x: Array) -> tuple[Array, Array]:
    """Fit rates by central differences."""
    rate = np.gradient(x, time, axis=0)
    return rate, np.gradient(rate, time, axis=0)
