"""Measure error and time of a quantity along a trajectory: effects, arithmetic, calls, rates, engines.

The time of a sample is the sum of its stages: closing its loops from the sample before, and the model; a
setting replaces one of them. Compiled ways come early, since they are the ones to take.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from ...assembly.assemble import assemble
from ...compiled.compiling import compile
from ...compiled.derivatives import Derivatives
from ...compiled.library.calls import load
from ...compiled.model import CompiledRobot
from ...compiled.program import Call
from ...description.names import listed
from ...dynamics.direct import ddm
from ...dynamics.inverse import idm
from ...effects.choice import Effects
from ...errors import HybridynError
from ...scenes.references import MotorAxes
from ...spatial import Array
from ...structure.robot import HybridRobot
from ...tables.rates import derivatives
from ...tables.trajectory import TableMotion
from ..compare.methods import Method, Setting, State, each, grid, methods_of, swept, written
from .points import ADVISED, QUANTITIES, SLOWER, CostPoint, CostStudy, Progress, Step, Use, Worth, fill, timed

GENERAL, IN_C, SINGLE, DIFFERENCES = "general path", "compiled", "compiled, float32", "central differences"
#: The setting that leaves no effect out.
EVERY = "every effect"
#: Steps of differences of the motors' positions, rates, and accelerations or efforts; and of those that are
#: extrapolated.
STEPS, EXTRAPOLATED = tuple(10.0**-k for k in range(1, 8)), (4e-4, 2e-4, 1e-4)
#: Mass of the heaviest link in a design, relative to its own.
HEAVIER = 1.1
#: Rows of the trajectory on which models are compared, evenly spread; of these, how many are computed one by
#: one; and consecutive rows that are closed in C, and by the general path, which takes longer.
SAMPLES, ONE_BY_ONE, CLOSED, CLOSED_SLOWLY = 400, 20, 400, 40
#: Rows at which derivatives are compared, whose reference takes long.
DERIVED = 8
#: Rows of a batch of derivatives, and of that which threads share.
MANY, THREADED = 400, 20_000
#: Least peak of a motor's efforts, relative to the largest of all.
LEAST_PEAK = 1e-6
#: Error assumed for the general path if no reference of higher precision can be built.
UNJUDGED = 1e-9
#: Part of the time of the whole by which that of its stages together may differ.
ADDS_UP = 0.15
#: Effects that are never omitted: those of platforms and serial links.
KEPT = ("gravity", "inertia", "massless_legs")
#: Number of rows at either end that are ignored, since the rates of a spline are inaccurate there.
EDGE = 40


class Way(NamedTuple):
    """A way of our own to compute a quantity.

    Attributes:
        method: The method.
        use, what, fragment: As in `CostPoint`.
        setting: What distinguishes it from others of its name.
        threads: Number of threads that share a batch.
    """

    method: Method
    use: Use
    what: str = ""
    fragment: str = ""
    setting: str = EVERY
    threads: int = 1


def ways(quantity: str, effects: Effects) -> list[Way]:
    """Return the ways to compute a quantity, the usual one first."""
    call = "# hybridyn.compile(robot, effects{}).{}"
    if quantity.endswith("jacobian"):
        derive = Method(IN_C, quantity, partial(set_up, quantity, effects, ""), batches=True, threads=True)
        swept = Method(DIFFERENCES, quantity, partial(differences, quantity, effects), grid(step=STEPS))
        return [
            Way(derive, "usual", "keep the derivatives in C", f'# hybridyn.{quantity}(coordinates="motors")'),
            Way(swept, "program", "take central differences", setting=""),
        ]
    slow, fast, single = (
        Method(line, quantity, partial(set_up, quantity, effects, dtype), batches=batches, threads=True)
        for line, dtype, batches in (
            (GENERAL, "", quantity != "designs"), (IN_C, "float64", True), (SINGLE, "float32", True),
        )
    )  # fmt: skip
    told, keep = partial(model_fragment, effects.names, command=quantity), "keep every effect and "
    number, shared = (call.format(x, quantity) for x in (', dtype="float32"', ", threads=2"))
    design = "# robot.with_parameters", call.format(", parameters=[...]", "idm")
    return {
        "close": [
            Way(slow, "usual", "keep the general path", "# hybridyn.assemble", "(usual)"),
            Way(fast, "command", "close the loops in C", call.format("", "assemble"), "a batch"),
        ],
        "designs": [
            Way(slow, "usual", "build the robot of each design", design[0], "a robot a design"),
            Way(fast, "command", "compute designs in C", design[1], "a batch"),
            Way(single, "program", "compute designs in C (float32)", setting="a batch"),
        ],
    }.get(quantity) or [
        Way(slow, "usual", f"{keep}the general path", told("general"), "every effect (usual)"),
        Way(fast, "command", f"{keep}compute in C", told("compiled")),
        Way(single, "program", "compute in C (float32)", number),
        Way(fast, "program", "let two threads share a batch", shared, f"{EVERY}, 2 threads", 2),
    ]


def model_fragment(names: Sequence[str], engine: str, command: str = "idm") -> str:
    """Write the table [effects] of some effects, and the options of a command that request them."""
    return f"{requested(names)}\n# hybridyn {command} --engine {engine} --effects {','.join(names)}"


def requested(names: Sequence[str]) -> str:
    """Write a table [effects] that requests effects by their names."""
    return "[effects]\nuse = [" + ", ".join(f'"{name}"' for name in names) + "]"


def solver(quantity: str, robot: HybridRobot, effects: Effects, model: CompiledRobot | None = None) -> Any:
    """Return the call that computes a quantity for many samples, by the general path without a model.

    Derivatives have compiled models of their own.
    """
    if quantity.endswith("jacobian"):
        return Derivatives(robot, quantity.removesuffix("_jacobian"), effects, coordinates="motors")
    if quantity == "close":
        return partial(_closed, model.assemble if model else partial(assemble, robot), robot)
    if quantity == "designs":
        design = design_of(robot)
        if model:
            return partial(model.idm, parameters=[*design.values()])
        return lambda *state: idm(robot.with_parameters(design), *state, effects=effects)
    if model:
        return getattr(model, quantity)
    return partial(idm if quantity == "idm" else ddm, robot, effects=effects)


def set_up(quantity: str, effects: Effects, dtype: str, robot: HybridRobot, threads: int = 1) -> Any:
    """Prepare a compiled model of some type of numbers, or the general path without one."""
    free = tuple(design_of(robot)) if quantity == "designs" else ()
    model = (
        compile(robot, effects, dtype=dtype, threads=threads, parameters=free, wait=True) if dtype else None
    )
    solve = solver(quantity, robot, effects, model)
    return lambda setting: solve


def design_of(robot: HybridRobot) -> dict[str, float]:
    """Return the design that is measured: another mass of the heaviest link."""
    heaviest = max(robot.description.links, key=lambda link: link.mass)
    return {f"mass:{heaviest.name}": HEAVIER * heaviest.mass}


def motors_of(robot: HybridRobot, q: Array, v: Array, a: Array) -> State:
    """Return positions, rates and accelerations of the motors, shapes (T, motors)."""
    axes = MotorAxes.of(robot)
    return axes.positions(q), v[..., axes.columns], a[..., axes.columns]


def _closed(close: Any, robot: HybridRobot, q: Array, v: Array, a: Array) -> State:
    """Close the loops of some rows from the motors' motion and the first posture."""
    found: State = close(motors=motors_of(robot, q, v, a), guess=q[0])
    return found


def differences(quantity: str, effects: Effects, robot: HybridRobot) -> Any:
    """Prepare central differences of the compiled model over the motors."""
    model, n = compile(robot, effects, wait=True), len(robot.motors)
    inverse = quantity == "idm_jacobian"

    def at_setting(setting: Setting) -> Any:
        shift = setting["step"] * np.vstack([np.eye(3 * n), -np.eye(3 * n)]).reshape(-1, 3, n)

        def solve(q: Array, v: Array, given: Array) -> list[Array]:
            """Close the loops around a sample, and compute there."""
            x, rate, change = motors_of(robot, q, v, given if inverse else v)
            x, rate, last = np.moveaxis(np.array([x, rate, change if inverse else given]) + shift, 1, 0)
            near = model.close(x, rate, last if inverse else None, last=q)
            found = model.idm(*near) if inverse else model.ddm(*near[:2], last)[:, robot.motor_v]
            ahead, behind = found.reshape(2, 3, n, n)
            return [*((ahead - behind) / (2 * setting["step"])).swapaxes(-1, -2)]

        return solve

    return at_setting


def exact(quantity: str, robot: HybridRobot, effects: Effects, state: State) -> list[Array]:
    """Compute a quantity in 113-bit arithmetic, rounded at the end, as blocks of shape (T, n).

    Raises:
        HybridynError: The C code cannot be built, or it is not certain of every sample.
        ImportError: CasADi is not installed.
    """
    from ...compiled.programs.whole_robot import programs

    if quantity == "designs":
        quantity, robot = "idm", robot.with_parameters(design_of(robot))
    program = programs(robot, effects, models=(quantity,))[quantity]
    base = [np.zeros((len(state[0]), size)) for _, size in program.inputs[3:]]  # that of a moving base
    found, guard = load([program], dtype="float128").batch(program.name, *state, *base)
    if not np.all(guard <= 1.0):
        raise HybridynError("the compiled model is not certain of every sample")
    return [np.asarray(x, dtype=float) for x in found]


def extrapolated(
    quantity: str, robot: HybridRobot, effects: Effects, state: State
) -> tuple[list[Array], float]:
    """Compute derivatives by central differences, extrapolated to a step of zero.

    Code of derivatives in 113 bits takes minutes to build.

    Returns:
        Blocks of shape (T, motors, motors), and their own error, relative to the largest number of each.
    """
    at, samples = differences(quantity, effects, robot), [*zip(*state, strict=True)]
    coarse, middle, fine = (np.array(each(at({"step": step}), samples)) for step in EXTRAPOLATED)
    less, best = ((4.0 * x - y) / 3.0 for x, y in ((middle, coarse), (fine, middle)))
    found = [*np.moveaxis(best, 1, 0)]
    return found, max(map(off, np.moveaxis(less, 1, 0), found))


def operations(robot: HybridRobot, effects: Effects, model: str) -> int:
    """Count the operations of a model without building code; effects of time and of contact count nothing."""
    from ...compiled.programs.whole_robot import programs

    on = effects.without(*(unit.name for unit in (*effects.links, *filter(None, [effects.base]))))
    program = programs(robot, on, models=(model,))[model]
    calls = (step for step in program.steps if isinstance(step, Call))
    return sum(program.kernels[c.kernel].function.n_instructions() * c.copies for c in calls)


def off(found: Array, exact: Array, rows: Any = slice(None), *, efforts: bool = False) -> float:
    """Compare a block with its largest number; efforts each with the peak of its motor.

    A peak is at least a part `LEAST_PEAK` of the largest: below, there is only rounding.
    """
    largest = np.abs(exact).max()
    peak = np.maximum(np.abs(exact).max(axis=0), LEAST_PEAK * largest) if efforts else largest
    error = float((np.abs(found - exact[rows]) / np.where(peak > 0, peak, 1.0)).max(initial=0.0))
    return error if np.isfinite(error) else np.inf


def blocks(found: Any) -> list[Array]:
    """Return a result as a list of arrays."""
    parts = [*found.values()] if isinstance(found, dict) else found
    return [np.asarray(x, dtype=float) for x in (parts if isinstance(parts, tuple | list) else [parts])]


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
    motion: TableMotion | None = None


def study_models(
    robot: HybridRobot,
    trajectory: Trajectory,
    effects: Effects,
    progress: Progress = lambda result: None,
    study: CostStudy | None = None,
    *,
    quantity: str = "idm",
    engines: Sequence[str] = (),
    target: float = ADVISED,
) -> CostStudy:
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
    study = CostStudy("", "per sample") if study is None else study
    study.subject = QUANTITIES[quantity]
    study.question = f"error of {study.subject} against time per sample, {len(trajectory.q):,} rows"
    if not robot.motors:
        raise HybridynError(
            f"robot '{robot.name}' has no motors, and so no {study.subject}: name some (--motors)"
        )
    run, motion = Measured(study, robot, trajectory, effects, quantity), trajectory.motion
    steps: list[Step] = [(way.method.name, run.by_way(way)) for way in ways(quantity, effects)]
    if quantity == "close" or (run.stages and motion and {*motion.joints} == {*robot.motors}):
        steps.append(("from the motors", run.by_ticks()))
    if quantity in ("idm", "ddm"):
        steps.append(("effects", by_effects(run, target)))
    if quantity == "idm":
        steps.append(("rates", by_rates(run)))
    steps += [
        (method.name, run.by_way(Way(method, "comparison", setting="")))
        for known in methods.values()
        for method in known
    ]
    fill(study, steps, progress)
    study.remarks += [
        f"{name}: has none of {study.subject} of robots with loops"
        for name, known in methods.items()
        if not known
    ]
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
        call = partial(close, motors=part.joints, platforms=part.platforms, guess=self.trajectory.q[0])
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


def worded(names: Sequence[str]) -> str:
    """Write the names of effects in a sentence."""
    return listed([name.replace("_", " ") for name in names])


def by_effects(run: Measured, target: float) -> Iterator[Worth | CostPoint]:
    """Measure what each effect is worth; then build and run the set that suffices for an error.

    Errors without an effect are those of the general path; its time follows from the operations of the
    compiled model.
    """
    quantity, robot, on = run.quantity, run.robot, run.effects
    every, worth = operations(robot, on, quantity), list[Worth]()

    def error(gone: Sequence[str]) -> float:
        """Return the error without some effects, infinite for a motion without mass."""
        try:
            return run.errors(solver(quantity, robot, on.without(*gone)))[0]
        except HybridynError:
            return float("inf")

    for name in (name for name in on.names if name not in KEPT):
        share = 1.0 - operations(robot, on.without(name), quantity) / every
        change = error([name])
        if change or share:  # else it acts on nothing, as rotors of a robot without
            worth.append(Worth(name, change, share, computed=True))
            yield worth[-1]
    if gone := spared(worth, target, error):
        left = on.without(*gone)
        method = Method(IN_C, quantity, partial(set_up, quantity, left, "float64"), batches=True)
        what = f"drop {worded(gone)} and compute in C"
        lines = model_fragment(left.names, "compiled", quantity)
        yield from run.by_way(Way(method, "command", what, lines, f"without {worded(gone)}"))


def by_rates(run: Measured) -> Iterator[CostPoint]:
    """Compare rates from a spline and from differences of the motors' positions with those of the table.

    Raises:
        HybridynError: There is nothing to compare.
    """
    robot, time, (q, v, a) = run.robot, run.trajectory.time, run.trajectory[:3]
    odd = not all(robot.kinds[robot.joint_index[motor]].additive for motor in robot.motors)
    if time is None or len(time) < 3 * EDGE or robot.base != "fixed" or odd:
        raise HybridynError(
            f"not measured: needs times, {3 * EDGE} rows or more, a fixed base, and motors on revolute and "
            "prismatic joints"
        )
    x, inner = q[:, robot.motor_q], slice(EDGE, len(time) - EDGE)
    efforts, model = solver("idm", robot, run.effects), compile(robot, run.effects, wait=True)
    (wanted,) = blocks(efforts(q[inner], v[inner], a[inner]))
    after = next(point.seconds for point in run.study.points if point.line == IN_C)
    rules = {
        "quintic spline": partial(derivatives, time, x, slice(0, len(time))),
        "central differences": partial(_differences, time, x),
    }
    for words, rule in rules.items():
        moved = model.assemble(motors=(x, *rule()), guess=q[0])
        yield CostPoint(
            "rates of the trajectory", words,
            off(efforts(*(one[inner] for one in moved)), wanted, efforts=True),
            timed(rule)[0] / len(time) + after, f"# rates by {words} of the motors' positions",
            use="program", what=f"take rates by {words}",
        )  # fmt: skip


def _differences(time: Array, x: Array) -> tuple[Array, Array]:
    """Fit rates by central differences."""
    rate = np.gradient(x, time, axis=0)
    return rate, np.gradient(rate, time, axis=0)
