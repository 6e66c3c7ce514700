"""Check at which samples of a trajectory the loops do not close, for all samples at once."""

from collections.abc import Mapping

import numpy as np

from ..linkage.tree import Motion
from ..spatial import Array, Index, Mask
from ..structure.robot import HybridRobot
from ..threads import one_thread
from .assemble import place_base, spanning_positions
from .module_request import module_request, place_bodies
from .requests import first_guess, gather_requests
from .shortfall import shortfall
from .task import Task, module_task

#: Rounds in which open samples are started again from the nearest closed ones.
ROUNDS = 4


@one_thread()
def closed_postures(
    robot: HybridRobot,
    *,
    motors: Mapping[str, object],
    platforms: Mapping[str, object],
    guess: Array | None = None,
) -> tuple[Array, Mask]:
    """Find postures that close the loops, each sample for itself, on whatever assembly branch.

    Newton's method starts at the guess, and then at the postures of the nearest samples that closed.

    Args:
        motors: As in `assemble`.
        platforms: As in `assemble`.
        guess: Initial posture, shape (nq,); the home posture by default.

    Returns:
        Positions, shape (T, nq), and whether the loops are closed there, shape (T,). Open samples have the
        posture of a near closed one.

    Raises:
        AssemblyError: The posture is underdetermined.
        TrajectoryError: As in `assemble`.
    """
    requests = gather_requests(robot, motors, platforms)
    T = requests.samples
    q = np.tile(first_guess(robot, guess), (T, 1))
    place_base(robot, requests, q, *np.zeros((2, T, robot.nv)))
    bodies = {0: Motion.at_rest(T)}
    out: Mask = np.zeros(T, dtype=bool)
    for k in range(robot.base == "floating", len(robot.modules)):
        module, m = robot.modules[k], robot.modules[k].mechanism
        task = module_task(robot, module, module_request(requests, robot, k, bodies))
        x, closed = _solved(task, m.cut.positions(q[:1, module.q_index])[0])
        out |= ~closed
        if out.all():
            break  # no posture to place the next modules on
        q[:, module.q_index] = spanning_positions(module, x, m.tree.sweep(x), q[0, module.q_index])
        place_bodies(robot, module, m.spanning.sweep(q[:, module.q_index]), bodies)
    return q, ~out


def _solved(task: Task, guess: Array) -> tuple[Array, Mask]:
    """Close each sample; if any closes, open ones have the posture of a near closed one, (T, nq), (T,)."""
    x = np.tile(guess, (len(task.known), 1))
    within = shortfall(task, x, np.arange(len(x))) == 0
    closed = np.zeros(len(x), dtype=bool)
    left = np.flatnonzero(within)
    result = task.solve(x[left], left)
    x[left], closed[left] = result.q, task.closed(result)
    for _ in range(ROUNDS):
        good, bad = np.flatnonzero(closed), np.flatnonzero(within & ~closed)
        if not len(good) or not len(bad):
            break
        x[bad] = x[_nearest(good, bad)]
        result = task.solve(x[bad], bad)
        found = task.closed(result)
        x[bad[found]], closed[bad[found]] = result.q[found], True
        if not found.any():
            break
    return x, closed


def _nearest(good: Index, bad: Index) -> Index:
    """Return for each bad sample the nearest good one; both are sorted."""
    after = np.minimum(np.searchsorted(good, bad), len(good) - 1)
    before = np.maximum(after - 1, 0)
    return np.where(bad - good[before] <= np.abs(good[after] - bad), good[before], good[after])
