"""Compare new code with the general path at random states, before it is used."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import CompileError, HybridynError
from ..spatial import Array
from ..structure.robot import HybridRobot
from .code.scalars import GUARD_LIMIT
from .failures import check_agreement, difference

log = logging.getLogger("hybridyn.compiled")

#: Number of random states that are drawn at once, and that new code must have computed itself.
SAMPLES = 12

#: Largest number of draws of `SAMPLES` states.
ROUNDS = 8

#: Arrays of one row for each state.
States = Sequence[Array]


def random_states(robot: HybridRobot, seed: int = 0, *, idle: bool = True) -> States:
    """Draw q, v, tau, a of `SAMPLES` assembled states, shapes (SAMPLES, n).

    The accelerations are any that keep the loops closed, as tables have them. Without `idle` there are
    no idle motions.
    """
    from .equations.states import any_accelerations, moving_states  # a start from the cache needs no CasADi

    q, v, tau = moving_states(robot, SAMPLES, seed, idle=idle)
    return q, v, tau, any_accelerations(robot, q, v, seed + 1, idle=idle)


def compare_at_states(
    robot: HybridRobot,
    what: str,
    run: Callable[..., tuple[Sequence[NDArray[Any]], Array]],
    general: Callable[..., Sequence[Array]],
    limit: float,
    *,
    states: Callable[[int], States] | None = None,
    excused: Callable[[States, Sequence[NDArray[Any]], Sequence[Array]], Array] | None = None,
    told: bool = True,
    why: Callable[[], str] | None = None,
) -> int:
    """Compare new code with the general path at random states that the code computes itself.

    States whose guard is above its limit are left out, and more are drawn; a guard that is NaN is a fault.

    Args:
        what: What is compiled.
        run: Computes results, shapes (T, ...), and guards, shape (T,), from states.
        general: Computes the results by the general path.
        limit: Largest difference, relative to the largest entry of each state's result.
        states: Draws states of a seed; None for `random_states`.
        excused: Computes the differences that rounding explains, shape (results, T), from states, the code's
            results and the general path's; asked where one exceeds `limit`.
        told: Whether to log a warning if the general path has to compute most states.
        why: Says why in this warning; asked where the general path refuses none of them.

    Returns:
        Number of states that the code has computed itself.

    Raises:
        CompileError: A result differs, or the general path refuses a state that the code computes.
    """
    draw, computed, handed, refused = states or partial(random_states, robot), 0, 0, list[HybridynError]()
    for seed in range(ROUNDS):
        drawn = draw(seed)
        found, guard = run(*drawn)
        good = ~(guard > GUARD_LIMIT)
        if good.any():
            given = [x[good] for x in drawn]
            try:
                wanted = general(*given)
            except HybridynError as error:
                raise CompileError(
                    f"the compiled {what} of the robot '{robot.description.name}' computes a state that the "
                    f"general path refuses ({error}): it is not used"
                ) from error
            own = [x[good] for x in found]
            offs = np.array([difference(x, y) for x, y in zip(own, wanted, strict=True)])
            offs = np.where(np.isnan(guard[good]), np.nan, offs)
            rounding = excused(given, own, wanted) if excused and not (offs <= limit).all() else 0.0
            check_agreement(robot, what, offs, np.maximum(limit, rounding))
        computed, handed = computed + int(good.sum()), handed + int((~good).sum())
        if told and seed == 0 and handed > computed:
            refused = refused_states(general, [x[~good] for x in drawn])
            told = not computed or 2 * (handed - len(refused)) > SAMPLES
        if computed >= len(good):
            break
    if told and handed > computed:
        log.warning(
            "robot '%s': the compiled %s hands %d of %d random states to the general path%s",
            robot.description.name, what, handed, handed + computed,
            ("" if computed else of_refused(refused)) or (why() if why else ""),
        )  # fmt: skip
    return computed


def refused_states(general: Callable[..., Any], states: States) -> list[HybridynError]:
    """Return the errors of states that the general path refuses, each on its own."""
    errors = []
    for t in range(len(states[0])):
        try:
            general(*(x[t : t + 1] for x in states))
        except HybridynError as error:
            errors.append(error)
    return errors


def trusted_nowhere(robot: HybridRobot, what: str, why: str = "") -> CompileError:
    """Return the error of code that has computed no random state itself; `why` begins with a space."""
    return CompileError(
        f"the compiled {what} of the robot '{robot.description.name}' would hand every one of "
        f"{ROUNDS * SAMPLES} random states to the general path{why}: this is of no use"
    )


def of_refused(refused: Sequence[HybridynError]) -> str:
    """Return what the general path says of the first states, or ""."""
    return f", which refuses {len(refused)} of the first {SAMPLES} ({refused[0]})" if refused else ""
