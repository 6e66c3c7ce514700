"""Closed states drawn on the device: motors at random, the loops closed along the way from home.

The samples that fail are drawn again, all at once, until none is left.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..scenes.references import MotorAxes
from ..spatial import Array
from ..structure.robot import HybridRobot
from .arrays import Arrays
from .functions import InWarp, defined, wp
from .launching import launch

#: Python of the kernel that draws the motors' motion. The last try is the home posture at rest.
DRAW = """@wp.kernel(module="unique", enable_backward=False)
def draw(
    seed: int, trial: int, tries: int, start: row, low: row, high: row, speed: row, chosen: numbers,
    random: wp.array(dtype=wp.uint32), position: rows, rate: rows,
):
    k = wp.tid()
    if trial == 0:
        chosen[k] = k
        random[k] = wp.rand_init(seed, k)
    i = chosen[k]
    state = wp.uint32(random[i])
    for m in range(start.shape[0]):
        x = S(wp.randf(state))
        y = S(2.0) * S(wp.randf(state)) - S(1.0)
        position[k, m] = low[m] + x * (high[m] - low[m])
        rate[k, m] = y * speed[m]
        if trial == tries:
            position[k, m] = start[m]
            rate[k, m] = S(0.0)
    random[i] = state
"""
#: Python of the kernel that keeps closed motions, and chooses the samples that are drawn again.
KEEP = """@wp.kernel(module="unique", enable_backward=False)
def keep(
    last: bool, low_q: row, high_q: row, fastest: row, chosen: numbers, found: rows, found_v: rows,
    found_a: rows, guard: row, q: rows, v: rows, a: rows, again: numbers, failed: numbers,
):
    n = wp.tid()
    i = chosen[n]
    worst = guard[n]
    for k in range(low_q.shape[0]):
        if not last and (found[n, k] < low_q[k] or found[n, k] > high_q[k]):
            worst = S(2.0)
        q[i, k] = found[n, k]
    if not last and worst <= S(1.0):
        worst = wp.max(worst, S(2.0) * regular(found[n], found_v[n]))
    share = S(1.0)
    for k in range(fastest.shape[0]):
        if wp.abs(found_v[n, k]) * share > fastest[k]:
            share = fastest[k] / wp.abs(found_v[n, k])
    for k in range(fastest.shape[0]):
        v[i, k] = share * found_v[n, k]
        a[i, k] = share * share * found_a[n, k]
    if not (worst <= S(1.0)):
        again[wp.atomic_add(failed, 0, 1)] = i
"""


class Draw:
    """Draws closed states of a robot."""

    def __init__(self, robot: HybridRobot, close: InWarp, regular: InWarp, arrays: Arrays) -> None:
        """Write the kernels.

        Args:
            close: The model "close".
            regular: The guard of postures by their pivots.
        """
        self._robot, self._arrays = robot, arrays
        number = getattr(wp, arrays.dtype)
        scope = {"S": number, "row": wp.array(dtype=number), "rows": wp.array(dtype=number, ndim=2)}
        scope |= {"numbers": wp.array(dtype=wp.int32), "regular": regular.function}
        self._close, self._draw = close, defined(DRAW, "draw", scope)
        self._keep = defined(KEEP, "keep", scope)

    def states(self, count: int, seed: int, tries: int) -> tuple[Any, Any, Any, int]:
        """Draw states, see `Batch.random_states`."""
        robot, arrays, motors = self._robot, self._arrays, len(self._robot.motors)
        given = (robot.home, np.zeros(motors), *self._limits())
        home, still, start, low, high, speed, *limits = (arrays.given("limits", x, len(x)) for x in given)
        position, rate = (arrays.empty(count, motors) for _ in range(2))
        widths = (robot.nq, robot.nv, robot.nv)
        states, found = ([arrays.empty(count, width) for width in widths] for _ in range(2))
        read = [arrays.rows("near", home, count), position, rate, arrays.rows("acceleration", still, count)]
        chosen, again, failed = (arrays.empty(n, number=wp.int32) for n in (count, count, 1))
        random, guard, left, failures = arrays.empty(count, number=wp.uint32), arrays.empty(count), count, 0
        for trial in range(tries + 1):
            inputs = [seed, trial, tries, start, low, high, speed, chosen, random, position, rate]
            arrays.launch(self._draw, left, inputs)
            launch(arrays, self._close, read, found, guard[:left], failed)
            failed.zero_()
            inputs = [trial == tries, *limits, chosen, *found, guard, *states, again, failed]
            arrays.launch(self._keep, left, inputs)
            left, chosen, again = int(failed.numpy()[0]), again, chosen
            failures += left
            if not left:
                break
        return (*states, failures)

    def _limits(self) -> list[Array]:
        """Return positions of the motors at home, their range and speed; limits of q, and those of v."""
        robot = self._robot
        low_q, high_q = np.full(robot.nq, -np.inf), np.full(robot.nq, np.inf)
        fastest, reach = np.full(robot.nv, np.inf), np.full(robot.nv, np.pi)
        for i, name in enumerate(robot.joints):
            at, to, kind = robot.q_slices[i].start, robot.v_slices[i], robot.kinds[i]
            record = robot.records.get(name)
            if record is None or to.stop - to.start != 1:
                continue
            fastest[to] = record.speed_limit
            if not kind.endless and record.lower < record.upper:
                low_q[at], high_q[at] = record.lower, record.upper
            if kind.slides:
                reach[to] = robot.modules[robot.module_of(name)].mechanism.length
        in_q, in_v, home = robot.motor_q, robot.motor_v, MotorAxes.of(robot).positions(robot.home)
        low, high = (
            np.where(np.isfinite(x[in_q]), x[in_q], home + s * reach[in_v])
            for x, s in ((low_q, -1), (high_q, 1))
        )
        speed = np.where(np.isfinite(fastest[in_v]), fastest[in_v], 1.0)
        return [home, low, high, speed, low_q, high_q, fastest]
