"""Closed states drawn on the device: motors at random, the loops closed along the way from home."""

from __future__ import annotations

from typing import Any

import numpy as np

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

    def __init__(self, robot: HybridRobot, close: InWarp, arrays: Arrays) -> None:
        """Write the kernel.

        Args:
            close: The model "close".
        """
        self._robot, self._arrays = robot, arrays
        number = getattr(wp, arrays.dtype)
        row, rows = wp.array(dtype=number), wp.array(dtype=number, ndim=2)
        scope = {"S": number, "row": row, "rows": rows, "close": close.function}
        self._kernel = defined(DRAW, "draw", scope)

    def states(self, count: int, seed: int, tries: int) -> tuple[Any, Any, Any, int]:
        """Draw states, see `Batch.random_states`."""
        robot, empty = self._robot, self._arrays.empty
        motors = len(robot.motors)
        drawn = [empty(count, motors), empty(count, motors)]
        states = [empty(count, width) for width in (robot.nq, robot.nv, robot.nv)]
        failed = empty(1, number=wp.int32)
        given = [self._arrays.given("limits", x, len(x)) for x in (robot.home, *self._limits())]
        still = self._arrays.given("still", np.zeros(motors), motors)
        inputs = [seed, tries, *given, *drawn, still, *states, empty(count), failed]
        wp.launch(self._kernel, dim=count, inputs=inputs, device=self._arrays.device)
        return (*states, int(failed.numpy()[0]))

    def _limits(self) -> list[Array]:
        """Return positions of the motors at home, their range and speed; limits of q, and those of v."""
        robot = self._robot
        low_q, high_q = np.full(robot.nq, -np.inf), np.full(robot.nq, np.inf)
        fastest, home = np.full(robot.nv, np.inf), np.zeros(robot.nv)
        length = np.ones(robot.nv)
        for module in robot.modules:
            length[module.v_index] = module.mechanism.length
        reach = np.full(robot.nv, np.pi)
        for i, name in enumerate(robot.joints):
            at, to, kind = robot.q_slices[i].start, robot.v_slices[i], robot.kinds[i]
            record = robot.records.get(name)
            if record is None or to.stop - to.start != 1:
                continue
            fastest[to] = record.speed_limit
            home[to] = robot.home[at]
            if kind == "continuous":
                home[to] = np.arctan2(robot.home[at + 1], robot.home[at])
                continue
            low_q[at], high_q[at] = record.lower, record.upper
            if kind == "prismatic":
                reach[to] = length[to]
        in_q, in_v = robot.motor_q, robot.motor_v
        low, high = (
            np.where(np.isfinite(x[in_q]), x[in_q], home[in_v] + s * reach[in_v])
            for x, s in ((low_q, -1), (high_q, 1))
        )
        speed = np.where(np.isfinite(fastest[in_v]), fastest[in_v], 1.0)
        return [home[in_v], low, high, speed, low_q, high_q, fastest]
