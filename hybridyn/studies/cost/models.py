"""Measure error and time of the inverse model along a trajectory: effects, arithmetic, closures, rates."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...dynamics.inverse import idm
from ...effects.choice import Effects
from ...errors import HybridynError
from ...spatial import Array
from ...structure.robot import HybridRobot
from .generated import generated_idm
from .loops import by_closing
from .points import Point, Study, Use, timed
from .rates import by_rates

#: Number of rows of the trajectory that are used, evenly spread.
SAMPLES = 400

#: Error assumed for the general path if no reference of higher precision can be built.
UNJUDGED = 1e-9

#: Effects that are never omitted: those of platforms and serial links.
KEPT = ("gravity", "inertia")

GENERAL = "effects"
WORDS = {"float64": "C in float64", "float32": "C in float32"}


@dataclass(frozen=True, eq=False)
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
        """Return at most `samples` of its rows, evenly spread."""
        at = np.unique(np.linspace(0, len(self.q) - 1, min(samples, len(self.q))).round().astype(int))
        return Trajectory(self.q[at], self.v[at], self.a[at], None if self.time is None else self.time[at])


def study_models(
    robot: HybridRobot, trajectory: Trajectory, effects: Effects, progress: Callable[[str], None]
) -> Study:
    """Measure the inverse model's configurations along a trajectory.

    The time of a sample is the sum of three parts: computing its rates, closing its loops from the sample
    before, and the model. Each configuration changes one part (`Point.own`). The defaults of the others are
    given rates, loops closed to rounding, and the general path with every effect (C code where the closing
    tolerance varies).

    The error of a configuration is the largest difference of any effort from the reference, relative to the
    motor's largest effort. The reference is the model with all of `effects` in extended precision.

    Raises:
        HybridynError: The model cannot follow the trajectory.
    """
    some = trajectory.thinned()
    progress("reference")
    reference, own, words = _reference(robot, some, effects)
    peak = np.abs(reference).max(axis=0)
    peak = np.where(peak > 0, peak, 1.0)

    def error(tau: Array) -> float:
        """Compute the largest error over a motor's peak effort."""
        return float((np.abs(np.asarray(tau, dtype=float) - reference) / peak).max(initial=0.0))

    def keep(part: Iterator[Point]) -> list[Point]:
        """Collect the points of a part, and show each."""
        found = []
        for point in part:
            progress(f"{point.line}, {point.setting}")
            found.append(point)
        return found

    closing = keep(by_closing(robot, some.q, some.v, some.a, effects, error))
    exact = closing[-1].seconds if closing else 0.0  # for all other points: loops closed to rounding
    general = keep(_by_general(robot, some, effects, error))
    written = keep(_by_arithmetic(robot, some, effects, _effect_sets(effects, general), error))
    usual = next((p.seconds for p in general if p.use == "usual"), 0.0)
    whole = {p.line: p.seconds for p in written if not p.failure and p.setting.endswith(EVERY)}
    rates = keep(by_rates(robot, trajectory.time, trajectory.q, trajectory.v, trajectory.a, effects))
    points = [
        *(replace(p, seconds=p.seconds + exact) for p in general + written),
        *(  # after closing the loops, a model in C is evaluated
            replace(p, seconds=p.seconds + sum(x for line, x in whole.items() if p.setting.endswith(line)))
            for p in closing
        ),
        *(replace(p, seconds=p.seconds + exact + usual) for p in rates),
    ]
    question = f"error of motor efforts against time per sample, {len(some.q):,} at once"
    return Study(question, points, words, own, "per sample")


def _reference(robot: HybridRobot, some: Trajectory, effects: Effects) -> tuple[Array, float, str]:
    """Compute the reference efforts.

    Returns:
        Efforts, shape (T, motors), [N or N m], their relative error, and a description of the model.

    Raises:
        HybridynError: The general path cannot follow the motion.
    """
    plain = idm(robot, some.q, some.v, some.a, effects=effects)
    exact, near = (generated_idm(robot, effects, dtype) for dtype in ("float128", "longdouble"))
    if isinstance(exact, str) or isinstance(near, str):
        reason = exact if isinstance(exact, str) else near
        return plain, UNJUDGED, f"the general path in float64, as no higher precision is available ({reason})"
    tau = exact(some.q, some.v, some.a)[0]
    size = np.abs(tau).max(axis=0)
    off = np.abs(np.asarray(near(some.q, some.v, some.a)[0], dtype=tau.dtype) - tau)
    own = float((off / np.where(size > 0, size, 1.0)).max(initial=0.0))
    return np.asarray(tau, dtype=float), max(own, 2.0**-53), "the same model in 113-bit arithmetic"


EVERY = "every effect"

#: Label of a set of effects, and the names of these effects.
Choice = tuple[str, tuple[str, ...]]


def _growing_sets(effects: Effects) -> Iterator[Choice]:
    """Yield sets of effects that grow by one effect each, then the sets of all effects except one."""
    order = [name for name in effects.names if name not in KEPT]
    names = [name for name in KEPT if name in effects.names]
    yield "platforms and serial links only" if order else EVERY, tuple(names)
    for name in order:
        names.append(name)
        yield f"+ {_readable(name)}" + (f": {EVERY}" if name == order[-1] else ""), tuple(names)
    if len(order) > 1:
        for name in order[:-1]:
            yield f"all but {_readable(name)}", tuple(x for x in effects.names if x != name)


def _reduced_sets(effects: Effects, worth: dict[str, float]) -> Iterator[Choice]:
    """Yield the sets of all effects except the least important two, three, and so on.

    Args:
        effects: All effects.
        worth: Error without one effect alone, by its name.
    """
    order = sorted(worth, key=lambda name: worth[name])
    for count in range(2, len(order)):
        out = order[:count]
        yield "all but " + ", ".join(map(_readable, out)), tuple(x for x in effects.names if x not in out)


def _effect_sets(effects: Effects, measured: Sequence[Point]) -> list[Choice]:
    """Return all sets of effects to measure; the errors of `measured` decide which are omitted together."""
    growing = list(_growing_sets(effects))
    errors = {p.setting: p.error for p in measured}
    order = [name for name in effects.names if name not in KEPT]
    known = {frozenset(names): words for words, names in growing}
    without = {name: known.get(frozenset(effects.names) - {name}, "") for name in order}
    worth = {name: errors[words] for name, words in without.items() if words in errors}
    return growing + [x for x in _reduced_sets(effects, worth) if frozenset(x[1]) not in known]


def _readable(name: str) -> str:
    """Return an effect's name with spaces."""
    return name.replace("_", " ")


def _dropped(effects: Effects, names: Sequence[str]) -> str:
    """Describe in words which effects a set omits."""
    out = [_readable(name) for name in effects.names if name not in names]
    if len(out) < 2:
        return f"drop {', '.join(out) or 'nothing'}"
    return f"drop {', '.join(out[:-1])} and {out[-1]}"


def _fragment(names: Sequence[str], how: str) -> str:
    """Write lines to paste into a scene, and the equivalent options of `hybridyn idm` as a comment."""
    listed = ", ".join(f'"{name}"' for name in names)
    return f"[effects]\nuse = [{listed}]\n# {how}".rstrip("# ")


def _by_general(
    robot: HybridRobot, some: Trajectory, effects: Effects, error: Callable[[Array], float]
) -> Iterator[Point]:
    """Measure sets of effects with the general path; their errors select the last sets."""
    found: list[Point] = []
    for setting, names in _growing_sets(effects):
        found.append(_general(robot, some, effects, (setting, names), error))
        yield found[-1]
    for choice in _effect_sets(effects, found)[len(found) :]:
        yield _general(robot, some, effects, choice, error)


def _general(
    robot: HybridRobot, some: Trajectory, effects: Effects, choice: Choice, error: Callable[[Array], float]
) -> Point:
    """Measure one set of effects with the general path."""
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
    """Measure the generated C model by number type and set of effects."""
    for dtype, line in WORDS.items():
        for setting, names in choices:
            if setting.startswith("all but") and dtype == "float32":
                continue
            program = generated_idm(robot, effects.only(names), dtype)
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
