"""Which effects a scene needs for an error: what each changes at the end, alone and together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ...compiled import operations
from ...effects.choice import Effects, choose, stated_names
from ...errors import HybridynError
from ...scenes.scene_file import SceneFile
from ...scenes.stage import SceneStage
from ...spatial import Array
from .points import SECOND, SLOWER, CostStudy, Worth
from .runner import Runner, errors
from .spared import spared, worded
from .ways import requested, share_left_out

#: Effects that a scene requests only by tables of their own.
TABLES = ("payload", "wrench", "base_motion")
#: Samples by which the general path is timed.
TIMED = 8
#: Effects that can be left out without changing the task of a scene.
DROPPABLE = (
    "leg_inertia", "velocity", "rotor_inertia", "viscous_friction", "coulomb_friction", "stribeck_friction",
    "directed_friction", "load_friction", "gear_efficiency",
)  # fmt: skip


def effects_fragment(source: SceneFile, names: Sequence[str]) -> str:
    """Write the table [effects] that requests some of the scene's effects."""
    own = {*source.scene.effects.stated()} - {"use"}
    use = [name for name in names if name not in own and name not in TABLES]
    gone = sorted(own - set(names) - set(TABLES))
    return "\n".join([requested(use), *(f"# without the table [effects.{name}]" for name in gone)])


def worth_at_end(runner: Runner, every: Effects, limit: float) -> Iterator[Worth]:
    """Measure what each effect changes at the end: those of the scene if left out, others if added.

    Args:
        every: The effects that act in the scene, or would by the robot's files.
        limit: Time of a run [s].

    Raises:
        HybridynError: The scene takes longer.
    """
    robot, on = runner.ready.robot, runner.ready.effects
    exact = runner.whole(limit, on)
    for name in (name for name in DROPPABLE if name in every.names):
        computed = name in on.names
        other = on.without(name) if computed else every.only([*on.names, name])
        spares = share_left_out(robot, on, other, "ddm", _start(runner))
        try:
            change = errors(robot, runner.whole(2.0 * limit, other), exact)["error"]
        except HybridynError:  # a motion without mass
            change = np.inf
        yield Worth(name, change, spares if computed else -spares, computed)


def _start(runner: Runner) -> tuple[Array, Array, Array]:
    """Return the start of a run, and no efforts, as many samples of `ddm`."""
    q, v = (np.tile(x, (TIMED, 1)) for x in runner.start)
    return q, v, np.zeros((TIMED, len(runner.ready.robot.motors)))


def checked_together(
    runner: Runner, every: Effects, needed: list[str], target: float, limit: float
) -> tuple[list[str], list[str]]:
    """Run the effects that seem needed and those of the scene against every effect.

    Returns:
        The effects that are needed: every effect, where fewer miss the target. And how far the ends are
        from that with every effect, in words.
    """
    robot, run = runner.ready.robot, partial(runner.whole, limit)
    gone = [name for name in every.names if name not in needed]
    sets = {f"without {worded(gone)}": every.only(needed)} if gone else {}
    sets["with those of the scene"] = runner.ready.effects
    try:
        exact = run(every)
        away = {words: errors(robot, run(on), exact)["error"] for words, on in sets.items()}
        said = [
            f"{words}, the end is {error:.1e} from that with every effect that is stated"
            for words, error in away.items()
        ]
        if not gone:
            return needed, said
        if away[f"without {worded(gone)}"] > target:
            return [*every.names], said
        runner.start = exact.state.q, SLOWER * exact.state.v
        elsewhere = errors(robot, run(every.only(needed)), run(every))["error"]
        if elsewhere > target:
            said.append(
                f"these do not carry over to {SECOND['per run']}: there the end is {elsewhere:.1e} away"
            )
        return needed, said
    except HybridynError as failure:
        return needed, [f"not compared with every effect that is stated: {failure}"]


def every_effect(ready: SceneStage) -> Effects:
    """Return the effects of a scene with those of `DROPPABLE` that the robot's files state besides.

    Those of `DROPPABLE` that take no operations act on nothing, as rotors of a robot without: they are left
    out.
    """
    robot, on = ready.robot, ready.effects
    stated = choose(robot, ["default", *stated_names(robot)])
    more = stated.only([name for name in DROPPABLE if name not in on.names])
    every = replace(
        on, leg_inertia=on.leg_inertia or more.leg_inertia, velocity=on.velocity or more.velocity,
        joints=(*on.joints, *more.joints), rotors=(*on.rotors, *more.rotors),
    )  # fmt: skip
    every = replace(every, names=every.named({*on.names, *more.names}))
    counted = every.without(*every.uncompiled)
    whole = operations(robot, counted, "ddm")
    some = [name for name in DROPPABLE if name in counted.names]
    return every.without(*(name for name in some if operations(robot, counted.without(name), "ddm") == whole))


def needed_effects(study: CostStudy, ready: SceneStage, every: Effects, target: float) -> list[str]:
    """Return the effects that a scene needs for an error, or nothing if it names them.

    Effects are left out, the least important first, as long as their changes together stay below the target.

    Args:
        every: As `every_effect` returns them.
    """
    more = [one.effect for one in study.worth if not one.computed and one.error > target]
    worth = {one.effect: one.error for one in study.worth}
    gone = spared(study.worth, target, lambda names: sum(worth[name] for name in names))
    if not more and not gone:
        return []
    return [*every.only({*ready.effects.names, *more} - {*gone}).names]
