"""The oracle: kinematics of the closed loops, inverse and direct dynamics."""

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np

from hybridyn.description.records import Description

from .arithmetic import Arithmetic, Factor, Float64, Numbers, cross
from .bodies import Bodies, Wrenches
from .tree import Base, Posture, Tree

#: Relative singular value below which closure rows are dependent; the data of tests are exact.
ORACLE_RANK = 1e-9
#: Relative tolerance on square roots of masses, which is 1e-22 on masses.
INERTIA_TOLERANCE = 1e-11
#: Largest effort along a massless motion, relative to the largest effort.
FORCED_TOLERANCE = 1e-8
#: Largest residual that `close` accepts, relative to the robot's length.
CLOSED_TOLERANCE = 1e-9


def largest(x: Numbers) -> float:
    """Return the largest magnitude in an array, zero for none."""
    return max((abs(float(value)) for value in x.reshape(-1)), default=0.0)


class Oracle:
    """The reference models of one robot; every call takes one sample.

    Args:
        description: The robot.
        base: "fixed"; "moving" (prescribed) or "floating" (free), with a free-flyer `root_joint` first.
        gravity: Acceleration of gravity, shape (3,), [m/s^2], world.
        arithmetic: `Float64()` (default) or `Extended(mpmath.mp)`.
        rank_tolerance: Relative threshold for the rank of the closure rows and of the motors' map.
        inertia_tolerance: Relative threshold on C below which a motion counts as massless.

    Attributes:
        nq, nv, joint_names: The spanning tree's coordinates, in the order of `pin.buildModelFromXML`.
        coordinates: Joint name to (kind, slice of q, slice of v).
        unit: Unit of each scaled velocity coordinate, shape (nv,).
        motors: Index in v of each motor, in the description's order.
    """

    def __init__(
        self,
        description: Description,
        base: Base = "fixed",
        gravity: Sequence[float] = (0.0, 0.0, -9.81),
        *,
        arithmetic: Arithmetic | None = None,
        rank_tolerance: float = ORACLE_RANK,
        inertia_tolerance: float = INERTIA_TOLERANCE,
    ) -> None:
        self.description, self.base, self.arithmetic = description, base, arithmetic or Float64()
        self.rank_tolerance, self.inertia_tolerance = rank_tolerance, inertia_tolerance
        self.tree = Tree(description, base, self.arithmetic, rank_tolerance)
        self.bodies = Bodies(description, self.arithmetic.array(gravity), self.arithmetic)
        self.nq, self.nv, self.unit = self.tree.nq, self.tree.nv, self.tree.unit
        self.coordinates, self.joint_names = self.tree.coordinates, list(self.tree.coordinates)
        self.motors = [self.coordinates[name][2].start for name in description.motors]

    # ---------------------------------------------------------------- closing

    def posture(self, q: Numbers) -> Posture:
        """Compute the placement of every link and every row at q, shape (nq,)."""
        return self.tree.posture(q)

    def residual(self, q: Numbers) -> Numbers:
        """Compute the residuals of closures and couplings at q, shape (n,), all zero where they hold.

        First the residuals in the order of `rows`, slides in metres. Then one negative cosine for every pair
        of axes that should agree but differ by more than a right angle (rows vanish at opposite axes too).
        """
        posture = self.posture(q)
        return np.concatenate(
            [self.tree.values(posture, self.arithmetic.array(q)), self.tree.turned(posture)]
        )

    def rows(self, q: Numbers) -> Numbers:
        """Compute K, the rows of closures, then couplings, over tree velocities, shape (rows, nv)."""
        return self.posture(q).K

    def motions(self, q: Numbers) -> Numbers:
        """Compute a basis of the tree velocities that the closures allow, shape (nv, mobility)."""
        return self.unit[:, None] * self.posture(q).Z

    def integrate(self, q: Numbers, step: Numbers) -> Numbers:
        """Integrate a step of velocity x time from q, shape (nv,): first order, on each joint's manifold."""
        return self.tree.integrate(q, step)

    def close(self, q: Numbers, iterations: int = 60) -> Numbers:
        """Close the loops from a guess by Gauss-Newton steps of least norm and limited length.

        Raises:
            ValueError: The residual stays too large, or the loops close with opposite axes.
        """
        q = self.arithmetic.array(q)
        for _ in range(iterations):
            posture = self.posture(q)
            x = self.tree.least_change(posture, self.tree.values(posture, q))
            size = largest(x / self.unit)
            q = self.integrate(q, -x * min(1.0, 0.3 / size if size else 1.0))
            if size < 4 * self.arithmetic.epsilon:
                break
        posture = self.posture(q)
        left = largest(self.tree.values(posture, q) / posture.scale)
        if left > CLOSED_TOLERANCE or self.tree.turned(posture).size:
            raise ValueError(
                f"the loops do not close from this guess: residual {left:.1e} of the robot's length"
            )
        return q

    def project_velocity(self, q: Numbers, v: Numbers) -> Numbers:
        """Compute the nearest velocity that the closures allow."""
        posture, v = self.posture(q), self.arithmetic.array(v)
        return v - self.tree.least_change(posture, posture.K @ v)

    def consistent_acceleration(self, q: Numbers, v: Numbers, a: Numbers) -> Numbers:
        """Compute the nearest acceleration that keeps the loops closed, `K a + k = 0`."""
        posture, a = self.posture(q), self.arithmetic.array(a)
        k = self.tree.drifts(posture, self.arithmetic.array(v))[2]
        return a - self.tree.least_change(posture, posture.K @ a + k)

    # ---------------------------------------------------------------- dynamics

    def motor_map(self, posture: Posture) -> Numbers:
        """Compute the map from motor efforts to forces along Z, `Z^T S^T`, shape (mobility, motors)."""
        return (self.unit[self.motors, None] * posture.Z[self.motors]).T

    def idm(
        self,
        q: Numbers,
        v: Numbers,
        a: Numbers,
        wrenches: Wrenches | None = None,
        weights: Sequence[float] | None = None,
        passive: Literal["given", "solved"] = "given",
    ) -> Numbers:
        """Compute the motor efforts of a motion, (motors,), [N or N m], order `description.motors`.

        Args:
            q: Closed posture, shape (nq,).
            v: Velocity that the closures allow, shape (nv,).
            a: Acceleration that the closures allow, shape (nv,).
            wrenches: Link name to the wrench [force; moment] on it, shape (6,), link frame at its origin.
            weights: Weights of the sum of weight x effort^2 that redundant motors minimise; ones by default.
            passive: "given" uses all of `a`; "solved" uses the entries of motors and a prescribed base only.
        """
        return self.idm_and_missing(q, v, a, wrenches, weights, passive)[0]

    def idm_and_missing(
        self,
        q: Numbers,
        v: Numbers,
        a: Numbers,
        wrenches: Wrenches | None = None,
        weights: Sequence[float] | None = None,
        passive: Literal["given", "solved"] = "given",
    ) -> tuple[Numbers, Numbers]:
        """Compute the motor efforts, and the effort that no motor can produce, tree coordinates, (nv,)."""
        if passive == "solved":
            a = self.solve_passive(q, v, a, wrenches)
        posture, a = self.posture(q), self.arithmetic.array(a)
        V, g, _ = self.tree.drifts(posture, self.arithmetic.array(v))
        W = self.bodies.needed(posture, V, (posture.G @ a).reshape(-1, 6) + g, wrenches or {})
        Q = posture.G.T @ W.reshape(-1)
        w = self.arithmetic.array(np.ones(len(self.motors)) if weights is None else weights)
        w = self.arithmetic.array([1 / self.arithmetic.sqrt(x) for x in w])
        B, needed = self.motor_map(posture), posture.Z.T @ (self.unit * Q)
        size = largest(w * self.unit[self.motors])  # a map that is zero to rounding has no direction
        tau = w * self.arithmetic.factor(B * w, self.rank_tolerance, size).least_norm(needed)
        return tau, posture.Z @ (needed - B @ tau) / self.unit

    def support(self, q: Numbers, v: Numbers, a: Numbers, wrenches: Wrenches | None = None) -> Numbers:
        """Compute the wrench that supports the robot, [force; moment] on the root link, (6,), its frame.

        It is the sum over all bodies, in which internal forces cancel.
        """
        posture, a = self.posture(q), self.arithmetic.array(a)
        V, g, _ = self.tree.drifts(posture, self.arithmetic.array(v))
        W = self.bodies.needed(posture, V, (posture.G @ a).reshape(-1, 6) + g, wrenches or {})
        root = posture.links[self.description.root]
        total = [root.x * 0, root.x * 0]
        for wrench, origin in zip(W, posture.origins, strict=True):
            total[0] = total[0] + wrench[:3]
            total[1] = total[1] + wrench[3:] + cross(origin - root.x, wrench[:3])
        return np.concatenate([root.E.T @ part for part in total])

    def solve_passive(self, q: Numbers, v: Numbers, a: Numbers, wrenches: Wrenches | None = None) -> Numbers:
        """Compute the acceleration with the driven (motor and moving base) entries of `a`, rest unforced."""
        posture, a = self.posture(q), self.arithmetic.array(a)
        V, g, k = self.tree.drifts(posture, self.arithmetic.array(v))
        driven = self.motors + list(range(self.tree.free.start))
        S = self.arithmetic.array(np.eye(self.nv))[driven]
        factor = self.arithmetic.factor(
            np.concatenate([posture.K * self.unit / posture.scale[:, None], S]), self.rank_tolerance
        )
        a_p = self.unit * factor.least_norm(np.concatenate([-k / posture.scale, (a / self.unit)[driven]]))
        return self._unforced(posture, a_p, factor.Z, self.unit * 0, V, g, wrenches or {})

    def ddm(
        self,
        q: Numbers,
        v: Numbers,
        tau: Numbers,
        base_acceleration: Numbers | None = None,
        wrenches: Wrenches | None = None,
    ) -> Numbers:
        """Compute the tree accelerations under motor efforts, (nv,); least norm along massless motions.

        Args:
            q: Closed posture, shape (nq,).
            v: Velocity that the closures allow, shape (nv,).
            tau: Motor efforts, shape (motors,), [N or N m].
            base_acceleration: Rates of the base entries of v for a "moving" base, shape (6,); default zero.
            wrenches: As in `idm`.

        Raises:
            ValueError: A massless motion is forced.
        """
        posture = self.posture(q)
        V, g, k = self.tree.drifts(posture, self.arithmetic.array(v))
        effort = self.unit * 0
        for motor, value in zip(self.motors, self.arithmetic.array(tau), strict=True):
            effort[motor] = effort[motor] + value
        a_p = self.tree.least_change(posture, -k)
        if base_acceleration is not None:
            a_p[: self.tree.free.start] = self.arithmetic.array(base_acceleration)
        return self._unforced(posture, a_p, posture.Z, effort, V, g, wrenches or {})

    def _unforced(
        self,
        posture: Posture,
        a_p: Numbers,
        Z: Numbers,
        effort: Numbers,
        V: Numbers,
        g: Numbers,
        wrenches: Wrenches,
    ) -> Numbers:
        """Compute the `a = a_p + unit Z y` whose effort along Z is the given one."""
        W = self.bodies.needed(posture, V, (posture.G @ a_p).reshape(-1, 6) + g, wrenches)
        Q = posture.G.T @ W.reshape(-1)
        along = Z.T @ (self.unit * (effort - Q))
        C = self._inertia(posture, Z)
        left, all_efforts = largest(C.Z.T @ along), largest(self.unit * (abs(effort) + abs(Q)))
        if left > FORCED_TOLERANCE * all_efforts:
            raise ValueError(
                f"a motion without mass is forced by {left:.1e} (largest effort: {all_efforts:.1e})"
            )
        a: Numbers = a_p + self.unit * (Z @ C.least_norm_normal(along))
        return a

    def _inertia(self, posture: Posture, Z: Numbers) -> Factor:
        """Factor C for motions along Z, with a tolerance relative to the robot's total mass."""
        scale = math.sqrt(self.bodies.mass * self.tree.length**2 + self.bodies.inertia)
        C = self.bodies.inertia_root(posture, self.unit[:, None] * Z)
        return self.arithmetic.factor(C, self.inertia_tolerance, scale)

    def massless(self, q: Numbers) -> Numbers:
        """Compute a basis of the allowed tree accelerations without inertia, shape (nv, massless)."""
        posture = self.posture(q)
        C = self._inertia(posture, posture.Z)
        basis: Numbers = self.unit[:, None] * (posture.Z @ C.Z)
        return basis
