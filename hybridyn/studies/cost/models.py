"""What the inverse model's knobs cost along a trajectory: effects, arithmetic, closures, rates."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...dynamics.inverse import idm
from ...effects.choice import Effects
from ...errors import HybridynError
from ...spatial import Array
from ...structure.robot import HybridRobot
from .loops import by_closing
from .points import Point, Study, Use, timed
from .rates import by_rates
from .written import written_out

#: Rows of the trajectory that are looked at, spread over it.
SAMPLES = 400

#: What is claimed of the general path where nothing better is there to judge it.
UNJUDGED = 1e-9

#: Effects of platforms and serial links alone, which are never left out.
KEPT = ("gravity", "inertia")

GENERAL = "effects"
WORDS = {"float64": "C in float64", "float32": "C in float32"}


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
        """Return some of its rows, evenly spread."""
        at = np.unique(np.linspace(0, len(self.q) - 1, min(samples, len(self.q))).round().astype(int))
        return Trajectory(self.q[at], self.v[at], self.a[at], None if self.time is None else self.time[at])


def study_models(
    robot: HybridRobot, trajectory: Trajectory, effects: Effects, progress: Callable[[str], None]
) -> Study:
    """Measure the inverse model's configurations along a trajectory.

    A sample costs what its rates cost, what closing its loops costs from the sample before, and the model.
    Each configuration changes one of these (`Point.own`); the others are rates as given, loops closed to
    rounding, the general path with every effect (with loops closed to a tolerance: C).

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

    closing = keep(by_closing(robot, some.q, some.v, some.a, effects, error))
    exact = closing[-1].seconds if closing else 0.0  # of every other way: loops closed to rounding
    general = keep(_by_general(robot, some, effects, error))
    written = keep(_by_arithmetic(robot, some, effects, _chains(effects, general), error))
    usual = next((p.seconds for p in general if p.use == "usual"), 0.0)
    whole = {p.line: p.seconds for p in written if not p.failure and p.setting.endswith(EVERY)}
    rates = keep(by_rates(robot, trajectory.time, trajectory.q, trajectory.v, trajectory.a, effects))
    points = [
        *(replace(p, seconds=p.seconds + exact) for p in general + written),
        *(replace(p, seconds=p.seconds + _of_model(p, whole)) for p in closing),
        *(replace(p, seconds=p.seconds + exact + usual) for p in rates),
    ]
    question = f"error of motor efforts against time per sample, {len(some.q):,} at once"
    return Study(question, points, words, own, "per sample")


def _of_model(closing: Point, whole: dict[str, float]) -> float:
    """Return the time of the model that follows a way of closing [s]."""
    return next((seconds for line, seconds in whole.items() if closing.setting.endswith(line)), 0.0)


def _reference(robot: HybridRobot, some: Trajectory, effects: Effects) -> tuple[Array, float, str]:
    """Return the efforts to compare with, their own error, and what they are.

    Raises:
        HybridynError: The general path refuses the motion.
    """
    plain = idm(robot, some.q, some.v, some.a, effects=effects)
    exact, near = (written_out(robot, effects, dtype) for dtype in ("float128", "longdouble"))
    if isinstance(exact, str) or isinstance(near, str):
        reason = exact if isinstance(exact, str) else near
        return plain, UNJUDGED, f"the general path in float64, which nothing judges here ({reason})"
    tau = exact(some.q, some.v, some.a)[0]
    size = np.abs(tau).max(axis=0)
    off = np.abs(np.asarray(near(some.q, some.v, some.a)[0], dtype=tau.dtype) - tau)
    own = float((off / np.where(size > 0, size, 1.0)).max(initial=0.0))
    return np.asarray(tau, dtype=float), max(own, 2.0**-53), "the same model in 113-bit arithmetic"


EVERY = "every effect"

#: Words for a set of effects, and their names.
Choice = tuple[str, tuple[str, ...]]


def _rising(effects: Effects) -> Iterator[Choice]:
    """Return sets of effects, each with one more than the one before; then all without one."""
    order = [name for name in effects.names if name not in KEPT]
    names = [name for name in KEPT if name in effects.names]
    yield "platforms and serial links only" if order else EVERY, tuple(names)
    for name in order:
        names.append(name)
        yield f"+ {_said(name)}" + (f": {EVERY}" if name == order[-1] else ""), tuple(names)
    if len(order) > 1:
        for name in order[:-1]:
            yield f"all but {_said(name)}", tuple(x for x in effects.names if x != name)


def _falling(effects: Effects, worth: dict[str, float]) -> Iterator[Choice]:
    """Return sets of effects without the two that matter least, the three, and so on.

    Args:
        effects: All of them.
        worth: What leaving out one alone costs, by its name.
    """
    order = sorted(worth, key=lambda name: worth[name])
    for count in range(2, len(order)):
        out = order[:count]
        yield "all but " + ", ".join(map(_said, out)), tuple(x for x in effects.names if x not in out)


def _chains(effects: Effects, measured: Sequence[Point]) -> list[Choice]:
    """Give every set of effects that is worth a look, after the single ones were measured."""
    rising = list(_rising(effects))
    errors = {p.setting: p.error for p in measured}
    order = [name for name in effects.names if name not in KEPT]
    worth = {}
    for name in order:
        without = {x for x in effects.names if x != name}
        words = next((w for w, names in rising if set(names) == without), None)
        if words in errors:
            worth[name] = errors[str(words)]
    known = {frozenset(names) for _, names in rising}
    return rising + [x for x in _falling(effects, worth) if frozenset(x[1]) not in known]


def _said(name: str) -> str:
    return name.replace("_", " ")


def _dropped(effects: Effects, names: Sequence[str]) -> str:
    """Say which effects a set leaves out."""
    out = [_said(name) for name in effects.names if name not in names]
    if len(out) < 2:
        return f"drop {', '.join(out) or 'nothing'}"
    return f"drop {', '.join(out[:-1])} and {out[-1]}"


def _fragment(names: Sequence[str], how: str) -> str:
    """Return lines to paste into a scene, and the options of `hybridyn idm` that ask for the same."""
    listed = ", ".join(f'"{name}"' for name in names)
    return f"[effects]\nuse = [{listed}]\n# {how}".rstrip("# ")


def _by_general(
    robot: HybridRobot, some: Trajectory, effects: Effects, error: Callable[[Array], float]
) -> Iterator[Point]:
    """Measure sets of effects, by the general path: single ones first, then those that matter least."""
    found: list[Point] = []
    for setting, names in _rising(effects):
        found.append(_general(robot, some, effects, (setting, names), error))
        yield found[-1]
    for choice in _chains(effects, found)[len(found) :]:
        yield _general(robot, some, effects, choice, error)


def _general(
    robot: HybridRobot, some: Trajectory, effects: Effects, choice: Choice, error: Callable[[Array], float]
) -> Point:
    """Measure one set of effects by the general path."""
    setting, names = choice
    on = effects.only(names)
    whole = setting.endswith(EVERY)
    fragment = _fragment(names, f"hybridyn idm --engine general --effects {','.join(names)}")
    what = "keep the general path and every effect" if whole else _dropped(effects, names)
    try:
        tau, seconds = timed(lambda: idm(robot, some.q, some.v, some.a, effects=on))
    except HybridynError as failure:
        return Point(GENERAL, setting, np.inf, np.inf, fragment, str(failure))
    own = seconds / len(some.q)
    return Point(
        GENERAL, setting + " (usual)" * whole, error(tau), own, fragment,
        use="usual" if whole else "command", what=what, own=own,
    )  # fmt: skip


def _by_arithmetic(
    robot: HybridRobot,
    some: Trajectory,
    effects: Effects,
    choices: Sequence[Choice],
    error: Callable[[Array], float],
) -> Iterator[Point]:
    """Measure the written-out model, by widths of numbers and sets of effects."""
    for dtype, line in WORDS.items():
        for setting, names in choices:
            if setting.startswith("all but") and dtype == "float32":
                continue
            program = written_out(robot, effects.only(names), dtype)
            if isinstance(program, str):
                yield Point(line, setting, np.inf, np.inf, "", program)
                break
            (tau, _), seconds = timed(lambda program=program: program(some.q, some.v, some.a))  # type: ignore[misc]
            own = seconds / len(some.q)
            of_command = dtype == "float64"
            call = f'hybridyn.compile(robot, effects, dtype="{dtype}").idm'
            how = f"hybridyn idm --engine compiled --effects {','.join(names)}" if of_command else call
            what = f"{_dropped(effects, names)} and compute in C" + " (float32)" * (not of_command)
            use: Use = "command" if of_command else "program"
            yield Point(
                line, setting, error(tau), own, _fragment(names, how), use=use, what=what, own=own,
            )  # fmt: skip
