"""What each effect is worth along a trajectory, and which can be spared."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial

from ...description.names import listed
from ...errors import HybridynError
from ..compare.methods import Method
from .measured import Measured
from .points import CostPoint, Worth
from .ways import GENERAL, IN_C, Way, model_fragment, set_up, share_left_out, solver

#: Effects that are never omitted: those of platforms and serial links.
KEPT = ("gravity", "inertia", "massless_legs")


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

    Errors without an effect are those of the general path; `share_left_out` says what it takes.
    """
    quantity, robot, on = run.quantity, run.robot, run.effects
    worth = list[Worth]()

    def error(gone: Sequence[str]) -> float:
        """Return the error without some effects, infinite for a motion without mass."""
        try:
            return run.errors(solver(quantity, robot, on.without(*gone)))[0]
        except HybridynError:
            return float("inf")

    for name in (name for name in on.names if name not in KEPT):
        share = share_left_out(robot, on, on.without(name), quantity, run.motions[0])
        change = error([name])
        if change or share:  # else it acts on nothing, as rotors of a robot without
            worth.append(Worth(name, change, share, computed=True))
            yield worth[-1]
    if gone := spared(worth, target, error):
        left = on.without(*gone)
        name, engine, dtype = (GENERAL, "general", "") if left.uncompiled else (IN_C, "compiled", "float64")
        method = Method(name, quantity, partial(set_up, quantity, left, dtype), batches=True)
        what = f"drop {worded(gone)}" + " and compute in C" * (not left.uncompiled)
        lines = model_fragment(left.names, engine, quantity)
        yield from run.by_way(Way(method, "command", what, lines, f"without {worded(gone)}"))
