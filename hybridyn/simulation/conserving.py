"""A step that conserves energy: a discrete gradient in canonical coordinates of the constraint manifold.

About the middle of a step, with the joints' displacement x from there (x_0 = -xi/2, x_1 = xi/2) and the
scaled tangent spaces Z_0, Z_1 of the closures at both ends, their mean Z gives canonical coordinates of the
manifold:

    y = Z^T x / unit,    v = B(y) y_dot,    A = B^T M B,    p = A y_dot,    H = p^T A^-1 p / 2 + V

The step from (y_0, p_0) to (y_1, p_1) solves

    y_1 - y_0 =  h D_p,    D_p = g_p + r W_p (p_1 - p_0),    g_p = (A_0^-1 + A_1^-1)/2 (p_0 + p_1)/2
    p_1 - p_0 = -h D_y,    D_y = g_y + r W_y (y_1 - y_0),    g_y = an average of dH/dy at the ends
    r = (H_1 - H_0 - g . (z_1 - z_0)) / |z_1 - z_0|_W^2

so that D . (z_1 - z_0) = H_1 - H_0, a discrete gradient (Gonzalez), and H_1 = H_0 whatever g_y is. The
equations do not change when the ends are exchanged: the method is symmetric, of order 2, and reversible.
Forces that are no part of H enter as their mean Q over the ends, and then H_1 - H_0 is exactly their discrete
work.

The reduced mass A of the whole robot is assembled from Pinocchio's `crba` on `robot.model`: one evaluation
costs O(nv^2 N) and memory O(nv^3), so robots above `MOST_FREEDOMS` are refused.

Source:
    Gonzalez (1996), Time integration and discrete Hamiltonian systems, J. Nonlinear Sci. 6, in its
    unpartitioned form. The charts and the mean tangent space are not from there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from ..dynamics.energy import effective_model
from ..errors import ModelError, SingularityError
from ..manifold.manifold import Chart
from ..manifold.module_chart import AmbiguousBranchError
from ..spatial import Array
from .motion_law import MotionLaw, StepError
from .system import State, Stepped, System

#: Pinocchio's Data grows with the cube of the number of freedoms: 0.6 GB at 200.
MOST_FREEDOMS = 250
#: Largest residual of a step's equations (scaled) once iterations stop improving it.
SOLVED = 1e-12
#: Residuals (scaled) below this are rounding.
STEP_ROUNDING = 3e-16
#: Residuals below this (rad, module lengths, per unit of the positions) may be rounding of the positions.
FLOOR = 2e-15
#: Iterations without improvement after which a solved step stops.
STALLED_ITERATIONS = 2
#: Maximum number of iterations of a step; a step that needs more is too long.
MOST_ITERATIONS = 60
#: Reciprocal condition of the reduced mass below which a motion counts as massless.
MASSLESS_CONDITION = 1e-13


@dataclass(frozen=True, eq=False)
class _End:
    """One end of a step.

    Attributes:
        q: Positions, shape (nq,).
        v: Rates, shape (nv,).
        B: Rates of unit independent velocities, shape (nv, N).
        M: Mass matrix of the spanning tree, rotors included, shape (nv, nv).
        V: Potential energy [J].
        elastic: Efforts of the elastic part of V (springs and stops), shape (nv,).
        other: Forces that are no part of the energy, shape (nv,), or None where there are none.
    """

    q: Array
    v: Array
    B: Array
    M: Array
    V: float
    elastic: Array
    other: Array | None


@dataclass(frozen=True, eq=False)
class _Attempt:
    """The step's equations, evaluated at a trial of the new state.

    Attributes:
        F: Scaled residual, shape (2 N,).
        end: The trial.
    """

    F: Array
    end: _End

    @property
    def size(self) -> float:
        """Largest absolute entry of the residual."""
        return float(np.abs(self.F).max(initial=0.0))


class Conserving:
    """The energy-conserving method, with Pinocchio's data of one robot."""

    def __init__(self, law: MotionLaw) -> None:
        """Build the model of the robot's energy from the effects: gravity, leg inertia, rotors, springs.

        Raises:
            ModelError: The robot is too large, or its base is prescribed.
        """
        robot = law.robot
        if robot.base == "moving":
            raise ModelError(
                "method 'conserving' needs base='fixed' or 'floating': a prescribed base does work"
            )
        if robot.nv > MOST_FREEDOMS:
            raise ModelError(
                f"method 'conserving' assembles the mass of the whole robot: {robot.nv} freedoms are too "
                f"many (limit {MOST_FREEDOMS}); use 'rk4', 'dopri5' or 'implicit'"
            )
        self._law = law
        self._model = effective_model(law.robot, law.on)
        self._data = self._model.createData()
        self._rotors = law.on.rotor_diagonal(robot)

    def step(self, system: System, state: State, h: float) -> Stepped:
        """Advance a state by h [s]; a negative h runs backwards.

        Raises:
            AssemblyError: The new posture is out of reach.
            SingularityError: A motion has no inertia.
            StepError: The equations were not solved to rounding.
        """
        chart = system.manifold.chart(state.q, state.v)
        N = chart.size
        start = self._end(state.t, state.q, state.v, chart.at_origin(np.eye(N)))
        _check_inertia(start)
        u0, u_dot = chart.independent(state.v), chart.independent(state.a)
        z = np.concatenate([h * u0 + h * h / 2 * u_dot, h * u0 + h * h * u_dot])
        near = h * state.v + h * h / 2 * state.a
        best, spent = self._solve(system, chart, start, z, state.t, h, near)
        end = best.end
        a = (end.v - state.v) / h
        return Stepped(State(state.t + h, end.q, end.v, a), None, None, spent, chart.pivot)

    def _solve(
        self, system: System, chart: Chart, start: _End, z: Array, t: float, h: float, near: Array
    ) -> tuple[_Attempt, int]:
        """Solve the step's equations by Broyden's method, until rounding stops the residual from falling.

        The first trial is assembled near the displacement `near`, shape (nv,).

        Raises:
            AssemblyError: A trial is out of reach.
            AmbiguousBranchError: The equations were not solved, and closures lose rank there.
            StepError: The equations were not solved.
        """
        scale = float(np.abs(z).max(initial=0.0))
        # Near rest the step is short, and the rounding of positions is all that counts.
        farthest = float(np.abs(start.q / system.manifold.position_unit).max(initial=0.0))
        limit = max(SOLVED * scale, FLOOR * max(1.0, farthest))
        inverse, attempt = np.eye(len(z)), self._attempt(system, chart, start, z, t, h, near)
        inverse[: chart.size, chart.size :] = np.eye(chart.size) / 2  # y_1 moves by half of what h u_1 does
        best, lowest, idle, spent = attempt, attempt.size, 0, 0
        while spent < MOST_ITERATIONS and lowest > STEP_ROUNDING * scale and idle < STALLED_ITERATIONS:
            spent += 1
            dz = -inverse @ attempt.F
            try:
                new = self._attempt(system, chart, start, z + dz, t, h)
            except np.linalg.LinAlgError:
                break
            if not np.isfinite(new.size):
                break
            if new.size < lowest:
                best, lowest, idle = new, new.size, 0
            elif lowest <= limit:
                idle += 1
            inverse = _broyden(inverse, dz, new.F - attempt.F)
            z, attempt = z + dz, new
        if lowest > limit:
            raise _unsolved(chart, t, lowest, limit, spent)
        return best, spent

    def _end(self, t: float, q: Array, v: Array, B: Array) -> _End:
        """Compute mass and potential energy at one end, and other forces where there are any."""
        upper = np.triu(pin.crba(self._model, self._data, q))
        M = upper + np.triu(upper, 1).T
        M[np.diag_indices_from(M)] += self._rotors
        V = float(pin.computePotentialEnergy(self._model, self._data, q))
        for law in self._law.on.joints:
            V += float(law.energy(q[None])[0])
        # At rest: springs and stops, no friction.
        elastic = self._law.on.joint_efforts(self._law.robot, q[None], np.zeros((1, len(v))))[0]
        other = None
        if not self._law.conserves:
            a = self._law.acceleration(t, q, v)
            other = pin.rnea(self._model, self._data, q, v, a) + self._rotors * a - elastic
        return _End(q, v, B, M, V, elastic, other)

    def _attempt(
        self,
        system: System,
        chart: Chart,
        start: _End,
        z: Array,
        t: float,
        h: float,
        near: Array | None = None,
    ) -> _Attempt:
        """Evaluate the step's equations at y = z[:N], u = z[N:] / h of the chart at the step's start."""
        N = chart.size
        posture = chart.lift(z[:N], z[N:] / h, near)
        end = self._end(t + h, posture.q, posture.v, chart.rates(np.eye(N)))
        retraction, unit = system.manifold.retraction, system.manifold.unit[:, None]
        x1 = retraction.centred(posture.xi) / 2
        # An orthonormal basis halfway between that of the start and the one of the end closest to it.
        Z = _orthonormal(start.B / unit + _orthonormal(end.B / unit))
        to_y = (Z / unit).T
        D0, D1 = to_y @ retraction.pull(-x1, start.B), to_y @ retraction.pull(x1, end.B)
        B0, B1 = start.B @ np.linalg.inv(D0), end.B @ np.linalg.inv(D1)
        w0, w1 = to_y @ retraction.pull(-x1, start.v), to_y @ retraction.pull(x1, end.v)
        A0, A1 = B0.T @ start.M @ B0, B1.T @ end.M @ B1
        p0, p1 = A0 @ w0, A1 @ w1
        dy, dp = 2 * to_y @ x1, p1 - p0
        cross0, cross1 = np.linalg.solve(A0, p1), np.linalg.solve(A1, p0)  # A_0^-1 p_1, A_1^-1 p_0
        mean, drift = (w0 + w1) / 2, (B1 - B0) @ ((w0 + w1) / 2) / h
        g_p = (w0 + w1 + cross0 + cross1) / 4
        g_y = (self._force(start, B0, drift) + self._force(end, B1, drift)) / 2 - (A1 - A0) @ mean / h
        by_y = (p1 @ w1 - p1 @ cross0 + p0 @ cross1 - p0 @ w0) / 4 + (end.V - start.V)
        along_y, along_p = (A0 + A1) @ dy / (2 * h * h), (w1 - cross1 + cross0 - w0) / 2
        length = dy @ along_y + dp @ along_p
        r = (by_y - g_y @ dy) / length if length > 0 else 0.0
        Q = np.zeros(N)
        if start.other is not None and end.other is not None:
            Q = (B0.T @ start.other + B1.T @ end.other) / 2
        F_y = dy - h * (g_p + r * along_p)
        F_p = dp + h * (g_y + r * along_y) - h * Q
        F = np.concatenate([F_y, h * np.linalg.solve(D1, np.linalg.solve(A1, F_p))])
        return _Attempt(F, end)

    def _force(self, end: _End, B: Array, drift: Array) -> Array:
        """Compute B^T (M drift + c + gravity - elastic), shape (N,)."""
        force = pin.rnea(self._model, self._data, end.q, end.v, drift) + self._rotors * drift - end.elastic
        out: Array = B.T @ force
        return out


def _orthonormal(B: Array) -> Array:
    """Compute B (B^T B)^-1/2, the closest orthonormal basis of the same space."""
    square, turn = np.linalg.eigh(B.T @ B)
    out: Array = B @ (turn / np.sqrt(square)) @ turn.T
    return out


def _broyden(inverse: Array, dz: Array, dF: Array) -> Array:
    """Compute Broyden's update of an inverse Jacobian."""
    moved = inverse @ dF
    scale = dz @ moved
    if scale == 0.0 or not np.isfinite(scale):
        return inverse
    return inverse + np.outer(dz - moved, dz @ inverse) / scale


def _check_inertia(end: _End) -> None:
    """Check that every motion has inertia.

    Raises:
        SingularityError: The reduced mass is singular.
    """
    if not end.B.shape[1]:
        return
    s = np.linalg.eigvalsh(end.B.T @ end.M @ end.B)
    if s[0] <= MASSLESS_CONDITION * s[-1]:
        raise SingularityError(
            f"method 'conserving': a motion has no inertia (its mass is {max(s[0], 0):.2g} where the largest "
            f"is {s[-1]:.2g}, limit {MASSLESS_CONDITION:.0e} of it), so it has no momentum to conserve. Give "
            "its bodies mass, or use 'rk4'",
            what="inertia", condition=float(s[-1] / s[0]) if s[0] > 0 else np.inf,
        )  # fmt: skip


def _unsolved(
    chart: Chart, t: float, residual: float, limit: float, spent: int
) -> AmbiguousBranchError | StepError:
    """Return the error that says why the equations of the step at a time [s] were not solved."""
    if chart.narrow:
        return AmbiguousBranchError(
            f"the conserving step at t = {t:g} s ends where closures lose rank, and rounding there "
            f"leaves a residual of {residual:.2g} in its equations (limit {limit:.0e})"
        )
    return StepError(
        f"the equations of the conserving step at t = {t:g} s were not solved: residual "
        f"{residual:.2g} after {spent} iterations (limit {limit:.0e}); take a shorter step"
    )
