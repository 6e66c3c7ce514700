"""Closed states drawn on the device: motors at random, the loops closed along the way from home."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..scenes.references import MotorAxes
from ..spatial import Array
from ..structure.robot import HybridRobot
from .arrays import Arrays
from .functions import InWarp, defined, wp

#: Python of the kernel. The last try is the home posture at rest.
DRAW = """@wp.kernel(module="unique", enable_backward=False)
def draw(
    seed: int, tries: int, home: row, start: row, low: row, high: row, speed: row, low_q: row, high_q: row,
    fastest: row, position: rows, rate: rows, still: row, q: rows, v: rows, a: rows, guard: row,
    failed: wp.array(dtype=wp.int32),
):
    i = wp.tid()
    state = wp.rand_init(seed, i)
    worst = S(2.0)
    for trial in range(tries + 1):
        if not (worst <= S(1.0)):
            for m in range(start.shape[0]):
                x = S(wp.randf(state))
                y = S(2.0) * S(wp.randf(state)) - S(1.0)
                position[i, m] = low[m] + x * (high[m] - low[m])
                rate[i, m] = y * speed[m]
                if trial == tries:
                    position[i, m] = start[m]
                    rate[i, m] = S(0.0)
            worst = close(home, position[i], rate[i], still, q[i], v[i], a[i])
            for k in range(low_q.shape[0]):
                if trial < tries and (q[i, k] < low_q[k] or q[i, k] > high_q[k]):
                    worst = S(2.0)
            if trial < tries and worst <= S(1.0):
                worst = wp.max(worst, S(2.0) * regular(q[i], v[i]))
            share = S(1.0)
            for k in range(fastest.shape[0]):
                if wp.abs(v[i, k]) * share > fastest[k]:
                    share = fastest[k] / wp.abs(v[i, k])
            for k in range(fastest.shape[0]):
                v[i, k] = share * v[i, k]
                a[i, k] = share * share * a[i, k]
            if not (worst <= S(1.0)):
                wp.atomic_add(failed, 0, 1)
    guard[i] = worst
"""


class Draw:
    """Draws closed states of a robot."""

    def __init__(self, robot: HybridRobot, close: InWarp, regular: InWarp, arrays: Arrays) -> None:
        """Write the kernel.

        Args:
            close: The model "close".
            regular: The guard of postures by their pivots.
        """
        self._robot, self._arrays = robot, arrays
        number = getattr(wp, arrays.dtype)
        scope = {"S": number, "row": wp.array(dtype=number), "rows": wp.array(dtype=number, ndim=2)}
        scope |= {"close": close.function, "regular": regular.function}
        self._kernel = defined(DRAW, "draw", scope)

    def states(self, count: int, seed: int, tries: int) -> tuple[Any, Any, Any, int]:
        """Draw states, see `Batch.random_states`."""
        robot, empty, still = self._robot, self._arrays.empty, np.zeros(len(self._robot.motors))
        drawn = [empty(count, len(robot.motors)) for _ in range(2)]
        states = [empty(count, width) for width in (robot.nq, robot.nv, robot.nv)]
        failed = empty(1, number=wp.int32)
        given = [self._arrays.given("limits", x, len(x)) for x in (robot.home, *self._limits(), still)]
        inputs = [seed, tries, *given[:-1], *drawn, given[-1], *states, empty(count), failed]
        self._arrays.launch(self._kernel, count, inputs)
        return (*states, int(failed.numpy()[0]))

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
