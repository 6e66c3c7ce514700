"""State of one module at every sample, computed by the forward recursion and used by all others."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..linkage.tree import Motion
from ..spatial import Array
from .mechanism import Mechanism
from .module import Module


class RobotMotion(NamedTuple):
    """Motion of a whole robot on its spanning tree.

    Attributes:
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv), [m/s, rad/s].
        a: Accelerations, shape (T, nv), [m/s^2, rad/s^2].
    """

    q: Array
    v: Array
    a: Array


@dataclass(eq=False)
class ModuleState:
    """State of one module at every sample.

    Attributes:
        spanning: Motion of its spanning tree relative to its base.
        motion: The same motion on the tree after the cuts.
        q: Positions on the tree after the cuts, shape (T, nq).
        v: Rates x_dot, shape (T, n).
        a: Accelerations x_ddot, shape (T, n); zero if none were given.
        V: Twist of the base, shape (T, 6), base frame.
        V_dot: Spatial acceleration of the base minus gravity, shape (T, 6), base frame.
        outputs: Twists V_o of the outputs, shape (T, outputs, 6), own frames.
        outputs_dot: Spatial accelerations of the outputs minus gravity, shape (T, outputs, 6), own frames.
        convective: The velocity term crm(V_o) v_o of these accelerations, where v_o is the relative twist,
            shape (T, outputs, 6).

    With `forward(..., classical=True)`, twists and accelerations are relative to an observer who moves with
    the velocity of the frame's origin: V_lin = 0, and V_dot_lin is the classical acceleration.
    """

    module: Module
    spanning: Motion
    motion: Motion
    q: Array
    v: Array
    a: Array
    V: Array
    V_dot: Array
    outputs: Array
    outputs_dot: Array
    convective: Array

    @cached_property
    def K(self) -> Array:
        """Closure rows of the module, shape (T, rows, n)."""
        return self.mechanism.closures.matrix(self.motion)

    @property
    def mechanism(self) -> Mechanism:
        """The module's numbers."""
        return self.module.mechanism

    def placement(self, output: int) -> tuple[Array, Array]:
        """Return the placement (R, p) of an output in the base, shapes (T, 3, 3), (T, 3)."""
        body = self.mechanism.spec.outputs[output]
        return self.motion.R[:, body], self.motion.p[:, body]

    def spanning_accelerations(
        self, q: Array, v: Array, x_ddot: Array, unforced: Motion | None = None
    ) -> Array:
        """Compute accelerations of the module's spanning tree from those of the tree after the cuts.

        Args:
            q: Positions of the robot, shape (T, nq).
            v: Rates of the robot, shape (T, nv).
            x_ddot: Accelerations of the tree after the cuts, shape (T, n).
            unforced: Motion of this tree at x_ddot = 0, if it is known.

        Returns:
            Shape (T, nv of the module). The joints of wrists that were cut follow the bodies they connect.
        """
        m = self.mechanism
        out = np.zeros((len(x_ddot), m.spanning.nv))
        m.cut.to_spanning(x_ddot, out)
        if m.spec.wrists:
            target = m.tree.sweep(self.q, self.v, x_ddot, unforced)
            own = q[:, self.module.q_index], v[:, self.module.v_index]
            m.wrists.recover_accelerations(*own, out, target, self.spanning)
        return out
