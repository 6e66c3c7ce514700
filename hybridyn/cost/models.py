"""What the inverse model's knobs cost along a trajectory: effects, arithmetic, closures, rates."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..closing import LoopProblem, close
from ..description.rates import derivatives
from ..effects.choice import Effects
from ..errors import HybridynError
from ..idm import idm
from ..module import Module
from ..robot import HybridRobot
from ..spatial import Array
from .points import Point, Study, timed

TOLERANCES = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13)
"""How far loops may stay open, over the module's length."""

SAMPLES = 400
"""Rows of the trajectory that are looked at, spread over it."""

SMALL = 1e-9
"""Errors below this are those of a model with every effect."""

EDGE = 40
"""Rows at either end whose rates a spline cannot know well."""

WORDS = {"float32": "C in float32", "float64": "C in float64"}


@dataclass(frozen=True)
class Trajectory:
    """A motion of a robot.

    Attributes:
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv).
        a: Accelerations, shape (T, nv).
        time: Times, shape (T,), [s], or None.
    """

    q: Array
    v: Array
    a: Array
    time: Array | None

    def thinned(self, samples: int = SAMPLES) -> Trajectory:
        """Give some of its rows, evenly spread."""
        at = np.unique(np.linspace(0, len(self.q) - 1, min(samples, len(self.q))).round().astype(int))
        return Trajectory(self.q[at], self.v[at], self.a[at], None if self.time is None else self.time[at])


def study_models(
    robot: HybridRobot, trajectory: Trajectory, effects: Effects, progress: Callable[[str], None]
) -> Study:
    """Measure the inverse model's configurations along a trajectory.

    A sample costs what its rates cost, what closing its loops costs from the sample before, and the model.
    Each configuration changes one of these; the others are rates as given, loops closed to rounding, the
    general path with every effect (with loops closed to a tolerance: C in float64).

    The error of a configuration is the largest departure of any effort from the reference, over the largest
    effort of its motor. The reference is the model with all of `effects`, in extended precision.

    Args:
        robot: The robot.
        trajectory: The motion.
        effects: Every effect that counts.
        progress: Told what is measured next.

    Raises:
        HybridynError: The model cannot follow the trajectory.
    """
    some = trajectory.thinned()
    progress("reference")
    reference, own, words = _reference(robot, some, effects)
    peak = np.abs(reference).max(axis=0)
    peak = np.where(peak > 0, peak, 1.0)

    def error(tau: Array) -> float:
        return float((np.abs(np.asarray(tau, dtype=float) - reference) / peak).max(initial=0.0))

    def keep(part: Iterator[Point]) -> list[Point]:
        found = []
        for point in part:
            progress(f"{point.line}, {point.setting}")
            found.append(point)
        return found

    closing = keep(_by_closing(robot, some, effects, error))
    exact = closing[-1].seconds if closing else 0.0  # of every other way: loops closed to rounding
    general = keep(_by_effects(robot, some, effects, error))
    written = keep(_by_arithmetic(robot, some, effects, error))
    usual = next((p.seconds for p in general if p.setting.endswith("(usual)")), 0.0)
    whole = next((p.seconds for p in written if p.line == WORDS["float64"] and p.error < SMALL), usual)
    rates = keep(_by_rates(robot, trajectory, effects))
    points = [
        *(replace(p, seconds=p.seconds + exact) for p in general + written),
        *(replace(p, seconds=p.seconds + whole) for p in closing),
        *(replace(p, seconds=p.seconds + exact + usual) for p in rates),
    ]
    return Study("error of motor efforts against time per sample", points, words, own, "per sample")


def _reference(robot: HybridRobot, some: Trajectory, effects: Effects) -> tuple[Array, float, str]:
    """Give the efforts to compare with, their own error, and what they are."""
    plain = idm(robot, some.q, some.v, some.a, effects=effects)
    try:
        from ..compiled.library import load
        from ..compiled.programs import programs

        program = programs(robot, effects, models=("idm",))["idm"]
        ((exact,), _) = load([program], dtype="float128").batch("idm", some.q, some.v, some.a)
        ((close_by,), _) = load([program], dtype="longdouble").batch("idm", some.q, some.v, some.a)
    except (HybridynError, ImportError):
        return (
            plain,
            float("nan"),
            "the general path in float64 (nothing better: no C compiler, or no such model)",
        )
    size = np.abs(exact).max(axis=0)
    own = (np.abs(np.asarray(close_by, dtype=float) - exact) / np.where(size > 0, size, 1.0)).max(initial=0.0)
    return np.asarray(exact, dtype=float), max(float(own), 2.0**-53), "the same model in 113-bit arithmetic"


def _chains(effects: Effects) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Give sets of effects, each with one more than the one before; then all without one."""
    order = [name for name in effects.names if name not in ("gravity", "inertia")]
    names: list[str] = [name for name in ("gravity", "inertia") if name in effects.names]
    yield "platforms and serial links only", tuple(names)
    for name in order:
        names.append(name)
        yield f"+ {name.replace('_', ' ')}", tuple(names)
    for name in order[:-1]:
        if name != "inertia":
            yield f"all but {name.replace('_', ' ')}", tuple(x for x in effects.names if x != name)


def _by_effects(
    robot: HybridRobot, some: Trajectory, effects: Effects, error: Callable[[Array], float]
) -> Iterator[Point]:
    """Measure sets of effects, by the general path."""
    for setting, names in _chains(effects):
        on = effects.only(names)
        option = f"--effects {','.join(names)}"
        whole = set(names) == set(effects.names)
        words = setting + (" (usual)" if whole else "")
        try:
            tau, seconds = timed(lambda on=on: idm(robot, some.q, some.v, some.a, effects=on))  # type: ignore[misc]
        except HybridynError as failure:
            yield Point("effects", words, np.inf, np.inf, option, str(failure))
            continue
        yield Point("effects", words, error(tau), seconds / len(some.q), option)


def _by_arithmetic(
    robot: HybridRobot, some: Trajectory, effects: Effects, error: Callable[[Array], float]
) -> Iterator[Point]:
    """Measure the written-out model, by sets of effects and widths of numbers."""
    for dtype, words in WORDS.items():
        for setting, names in _chains(effects):
            if setting.startswith("all but") and dtype == "float32":
                continue
            option = f"--engine compiled --effects {','.join(names)}"
            program = _unguarded(robot, effects.only(names), dtype)
            if program is None:
                yield Point(
                    words, setting, np.inf, np.inf, option, "not written out: no C compiler, or no such model"
                )
                return
            tau, seconds = timed(lambda program=program: program(some.q, some.v, some.a))  # type: ignore[misc]
            yield Point(words, setting, error(tau), seconds / len(some.q), option)


def _by_closing(
    robot: HybridRobot, some: Trajectory, effects: Effects, error: Callable[[Array], float]
) -> Iterator[Point]:
    """Measure loops closed by Newton from the sample before, up to a tolerance."""
    looped = [module for module in robot.modules if module.mechanism.closures.rows]
    if not looped or len(some.q) < 2:
        return
    program = _unguarded(robot, effects)
    if program is None:
        return
    for tolerance in TOLERANCES:
        q, seconds = some.q.copy(), 0.0
        for module in looped:
            own, spent = _closed_to(module, some.q[:, module.q_index], tolerance)
            q[:, module.q_index] = own
            seconds += spent
        tau = program(q, some.v, some.a)
        yield Point(
            "loops closed to a tolerance",
            f"{tolerance:.0e}",
            error(tau),
            seconds / len(q),
            f"# in a controller: close loops to {tolerance:.0e}, then hybridyn.compile(robot).idm",
        )


def _unguarded(
    robot: HybridRobot, effects: Effects, dtype: str = "float64"
) -> Callable[[Array, Array, Array], Array] | None:
    """Give the written-out inverse model, which computes on open loops too; None where there is none."""
    try:
        from ..compiled.library import load
        from ..compiled.programs import programs

        library = load([programs(robot, effects, models=("idm",))["idm"]], dtype=dtype)
    except (HybridynError, ImportError):
        return None
    return lambda q, v, a: np.asarray(library.batch("idm", q, v, a)[0][0], dtype=float)


def _closed_to(module: Module, q: Array, tolerance: float) -> tuple[Array, float]:
    """Close a module's loops from the posture of the sample before, motors held, until they are open by less.

    Returns:
        Positions of the spanning tree, shape (T, nq), and the time that the steps took [s].
    """
    m = module.mechanism
    x = m.cut(q, None, None, m.spanning.sweep(q))[0]
    start = np.concatenate([x[:1], x[:-1]])
    free = np.ones(m.tree.nv, dtype=bool)
    held = module.motor_columns if len(module.motor_columns) <= m.mobility else module.motor_columns[:0]
    free[held] = False
    for at, to in zip(m.tree.q_slices, m.tree.v_slices, strict=True):
        if to.start in held:
            start[:, at] = x[:, at]
    r = m.reduction
    problem = LoopProblem(m.closures, r.row_scale, r.col_scale, free, (), r.rank)
    spent, done, steps = 0.0, start, 0
    while steps < 12:
        open_by = np.abs(m.closures.residual(done, m.tree.sweep(done)) * r.row_scale).max(initial=0.0)
        if open_by <= tolerance:
            break
        steps += 1
        closed, seconds = timed(lambda s=steps: close(problem, start, np.arange(len(start)), iterations=s), 3)  # type: ignore[misc]
        done, spent = closed.q, seconds
    out = q.copy()
    m.take_leg_positions(done, out)
    return out, spent


def _by_rates(robot: HybridRobot, trajectory: Trajectory, effects: Effects) -> Iterator[Point]:
    """Measure rates from a spline and from differences of positions, against those of the table."""
    if trajectory.time is None or len(trajectory.q) < 3 * EDGE:
        return
    from ..assembly import assemble

    at = [robot.q_slices[robot.joint_index[motor]].start for motor in robot.motors]
    kinds = {robot.kinds[robot.joint_index[motor]] for motor in robot.motors}
    if kinds - {"revolute", "prismatic"} or robot.base != "fixed" or not at:
        return
    time, p = trajectory.time, trajectory.q[:, at]
    inner = slice(EDGE, len(time) - EDGE)
    wanted = idm(robot, trajectory.q[inner], trajectory.v[inner], trajectory.a[inner], effects=effects)
    peak = np.abs(wanted).max(axis=0)
    every = slice(0, len(time))

    def spline() -> tuple[Array, Array]:
        return derivatives(time, p, every)

    def differences() -> tuple[Array, Array]:
        rate = np.gradient(p, time, axis=0)
        return rate, np.gradient(rate, time, axis=0)

    for words, rule in (("quintic spline", spline), ("central differences", differences)):
        (rate, acceleration), seconds = timed(rule)
        try:
            motors = {m: (p[:, i], rate[:, i], acceleration[:, i]) for i, m in enumerate(robot.motors)}
            q, v, a = assemble(robot, motors=motors, guess=trajectory.q[0])
            tau = idm(robot, q[inner], v[inner], a[inner], effects=effects)
        except HybridynError as failure:
            yield Point("rates of the trajectory", words, np.inf, np.inf, "", str(failure))
            continue
        off = float((np.abs(tau - wanted) / np.where(peak > 0, peak, 1.0)).max(initial=0.0))
        yield Point(
            "rates of the trajectory",
            words,
            off,
            seconds / len(time),
            f"# rates by {words} of the motors' positions",
        )
