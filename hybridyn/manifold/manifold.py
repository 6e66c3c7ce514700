"""The constraint manifold of a robot: assembled postures and independent velocities.

Charts provide its coordinates (`chart.py`).
"""

from __future__ import annotations

import numpy as np

from ..linkage.elimination import least_squares
from ..linkage.joints import TRANSLATIONS
from ..linkage.retraction import Retraction
from ..spatial import Array
from ..structure.mechanism import Mechanism
from ..structure.robot import HybridRobot
from .chart import Chart, Space
from .loop_rows import LoopRows
from .module_chart import LoopedModule


class Manifold:
    """The manifold of all assembled postures of a robot.

    Attributes:
        looped: Modules with loops.
        retraction: Moves on the whole spanning tree.
        unit: Unit of each freedom, shape (nv,).
        space: Data shared by its charts.
        position_unit: Unit of each position coordinate, shape (nq,).
        mobility: Number of independent velocities.
    """

    def __init__(self, robot: HybridRobot) -> None:
        self.robot = robot
        self.retraction = Retraction(robot.kinds, robot.q_slices, robot.v_slices)
        self.unit = robot.unit
        self.looped: list[LoopedModule] = []
        self._shared: dict[int, LoopRows] = {}
        free = []
        for module in robot.modules:
            m, tree = module.mechanism, module.mechanism.spanning
            if m.spanning_closures.rows:
                own = Retraction([j.kind for j in tree.joints], tree.q_slices, tree.v_slices)
                self.looped.append(LoopedModule(module, self._rows(m), own))
            else:
                free += list(module.v_index)
        self.free = np.array(sorted(free), dtype=int)
        self.position_unit = np.ones(robot.nq)
        for kind, q, v in zip(robot.kinds, robot.q_slices, robot.v_slices, strict=True):
            slides = q.start + TRANSLATIONS.get(kind, 0)
            self.position_unit[q.start : slides] = self.unit[v.start]
        self.mobility = robot.mobility
        prescribed = 6 if robot.base == "moving" else 0
        self.space = Space(self.looped, self.free, self.unit, self.retraction, prescribed)

    def _rows(self, mechanism: Mechanism) -> LoopRows:
        """Return the rows of a module; equal modules share them."""
        if id(mechanism) not in self._shared:
            self._shared[id(mechanism)] = LoopRows(mechanism)
        return self._shared[id(mechanism)]

    def chart(self, q: Array, v: Array | None = None, *, bound: bool = True) -> Chart:
        """Build a chart about a posture.

        Args:
            q: Positions, shape (nq,); assembled, or close to it.
            v: Rates, shape (nv,), which select the branch where closures lose rank.
            bound: False for a chart of the whole tree, without closures.

        Raises:
            SingularityError: The rates are on none of the branches that meet at the posture.
        """
        return Chart(self.space, q, v, bound)

    def residual(self, q: Array) -> float:
        """Compute the largest scaled closure residual of a posture, shape (nq,)."""
        return self.worst(q)[0]

    def worst(self, q: Array) -> tuple[float, str]:
        """Compute the largest scaled closure residual of a posture, and the name of its module."""
        each = [(float(np.abs(m.rows.at(q[m.module.q_index])[0]).max()), m.module.name) for m in self.looped]
        return max(each, default=(0.0, ""))

    def pull_back(self, q: Array, v: Array, rate: float) -> Array:
        """Compute Baumgarte's accelerations, shape (nv,): K a = -2 rate K v - rate^2 residual."""
        out = np.zeros_like(v)
        for m in self.looped:
            index, unit = m.module.v_index, m.rows.unit
            residual, K = m.rows.at(q[m.module.q_index])
            wanted = -2 * rate * K @ (v[index] / unit) - rate**2 * residual
            out[index] = unit * least_squares(K[None], wanted[None], rank=m.rows.rank)[0]
        return out

    def opening(self, q: Array, v: Array, *, least: float = 0.0) -> tuple[float, str]:
        """Compute the largest closure rate relative to the joint rates, and the name of its module.

        The joint rates of a module count as at least `least` [rad/s].
        """
        worst, name = 0.0, ""
        for m in self.looped:
            x = v[m.module.v_index] / m.rows.unit
            rate = np.abs(m.rows.at(q[m.module.q_index])[1] @ x).max()
            size = max(np.abs(x).max(), least)
            if size > 0 and rate / size > worst:
                worst, name = float(rate / size), m.module.name
        return worst, name

    def project(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Project q on a closed posture, and v on rates that keep it closed (least scaled change).

        Raises:
            AssemblyError: No closed posture was found.
        """
        away = self.chart(q, v)
        closed = away.close()
        chart = self.chart(closed, v)
        return closed, self.with_base(v, chart.at_origin(chart.independent(v)))

    def with_base(self, v: Array, moved: Array) -> Array:
        """Return `moved` with the rates of a prescribed base taken from v."""
        if self.robot.base == "moving":
            moved[:6] = v[:6]
        return moved
