"""Differential dynamic programming over a robot's motors, with exact second derivatives and without.

The motors move from rest towards a posture at rest, with small efforts, in steps of Crocoddyl's Euler scheme.
First derivatives are exact. Without those of second order the backward pass is that of Gauss and Newton
(iLQR), as in Crocoddyl's solvers; with them, the products of `SecondDerivatives` are added. Far from the end
a pass with them may have no minimum, or lead nowhere: it is made again without them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from hybridyn.errors import HybridynError, TrajectoryError
from hybridyn.optimal_control.closed_model import ClosedModel, ClosedState
from hybridyn.spatial import Array

#: Factors of a step that are tried, and the least share of the decrease that the quadratic model foretells.
FACTORS, SHARE = tuple(0.5**k for k in range(12)), 1e-4
#: Of a cost, relative: some hundred terms are summed up.
ROUNDING = 1e-14


class Problem(NamedTuple):
    """A motion of the motors from rest.

    Attributes:
        model: The direct model over the motors.
        start, goal: States at the ends: positions, then rates, shape (2 m,).
        size: Efforts that cost alike, shape (m,) [N m].
        step: Of time [s].
        steps: Number of steps.
        at_end: Cost of distances from the goal at the end, shape (2 m,).
    """

    model: ClosedModel
    start: Array
    goal: Array
    size: Array
    step: float
    steps: int
    at_end: Array

    @property
    def limits(self) -> Array:
        """Positions that the motors do not leave, shape (2, m)."""
        records = [self.model.robot.records[motor] for motor in self.model.robot.motors]
        return np.array([[one.lower for one in records], [one.upper for one in records]])


class Flight(NamedTuple):
    """A motion.

    Attributes:
        x, u: States, shape (T + 1, 2 m), and efforts, (T, m).
        closed: States of all joints at the steps.
        cost: Its cost.
    """

    x: Array
    u: Array
    closed: ClosedState
    cost: float


class Gains(NamedTuple):
    """What a backward pass finds: changes of the efforts, (T, m), and by the state, (T, m, 2 m).

    Attributes:
        slope: Derivative of the cost along the change.
    """

    change: Array
    by_state: Array
    slope: float


class Solved(NamedTuple):
    """A solution.

    Attributes:
        flights: The first motion, and that after each iteration.
        gradients: Their largest derivatives of the cost over an effort of unit size.
    """

    flights: list[Flight]
    gradients: list[float]


def fly(problem: Problem, u: Array, last: Flight | None = None, gains: Gains | None = None, share: float = 1.0
) -> Flight:  # fmt: skip
    """Integrate a motion under efforts, or under those of a flight with a share of changes.

    Raises:
        HybridynError: The loops do not close on the way.
    """
    h, m, model = problem.step, u.shape[1], problem.model
    low, high = problem.limits
    x, states = [problem.start], []
    q, u = model.robot.home, u.copy()
    for t in range(problem.steps):
        if last is not None and gains is not None:
            u[t] = last.u[t] + share * gains.change[t] + gains.by_state[t] @ (x[t] - last.x[t])
        state = model.close(x[t][:m], x[t][m:], u[t], q)
        rate = x[t][m:] + h * model.value(state)
        x.append(np.concatenate([x[t][:m] + h * rate, rate]))
        if not np.all((low < x[-1][:m]) & (x[-1][:m] < high)):
            raise TrajectoryError("a motor leaves its limits")
        states.append(state)
        q = state.q
    cost = h / 2 * np.sum((u / problem.size) ** 2) + problem.at_end / 2 @ (x[-1] - problem.goal) ** 2
    every = ClosedState(*(np.array([getattr(one, name) for one in states]) for name in ClosedState._fields))
    return Flight(np.array(x), u, every, float(cost))


def solve(problem: Problem, u: Array, *, exact: bool, most: int = 100, done: float = 1e-9) -> Solved:
    """Minimise the cost from efforts, until its derivatives are small.

    Args:
        problem: The problem.
        u: First efforts, shape (T, m).
        exact: Whether second derivatives of the dynamics count.
        most: Number of iterations.
        done: Largest derivative over an effort of unit size.
    """
    flight = fly(problem, u)
    flights, gradients = [flight], list[float]()
    for _ in range(most):
        slopes, better = _slopes(problem, flight), None
        gradients.append(_largest(problem, flight, slopes))
        if gradients[-1] <= done:
            break
        if exact and (gains := _backward(problem, flight, slopes, curved=True)) is not None:
            better = _forward(problem, flight, gains, FACTORS[:1])
        if better is None and (gains := _backward(problem, flight, slopes, curved=False)) is not None:
            better = _forward(problem, flight, gains, FACTORS)
        if better is None:
            break
        flight = better
        flights.append(flight)
    return Solved(flights, gradients)


def _slopes(problem: Problem, flight: Flight) -> tuple[Array, Array]:
    """Return the derivatives of the next states over states, (T, 2 m, 2 m), and over efforts, (T, 2 m, m)."""
    h, m = problem.step, flight.u.shape[1]
    J = problem.model.jacobian(flight.closed)
    step = np.concatenate([h**2 * J, h * J], axis=1)
    step[:, :m, : 2 * m] += np.hstack([np.eye(m), h * np.eye(m)])
    step[:, m:, m : 2 * m] += np.eye(m)
    return step[:, :, : 2 * m], step[:, :, 2 * m :]


def _largest(problem: Problem, flight: Flight, slopes: tuple[Array, Array]) -> float:
    """Return the largest derivative of the cost over an effort of unit size and over time."""
    weights, largest = problem.at_end * (flight.x[-1] - problem.goal), 0.0
    for by_state, by_effort, u in zip(*(reversed(x) for x in (*slopes, flight.u)), strict=True):
        slope = by_effort.T @ weights / problem.step + u / problem.size**2
        largest = max(largest, float(np.abs(slope * problem.size).max()))
        weights = by_state.T @ weights
    return largest


def _backward(problem: Problem, flight: Flight, slopes: tuple[Array, Array], *, curved: bool) -> Gains | None:
    """Find the changes of the efforts, with second derivatives or without; None where there is no minimum."""
    h, (T, m) = problem.step, flight.u.shape
    R = h / problem.size**2
    change, by_state = np.zeros((T, m)), np.zeros((T, m, 2 * m))
    V_x, V = problem.at_end * (flight.x[-1] - problem.goal), np.diag(problem.at_end)
    total = 0.0
    for t in reversed(range(T)):
        F = np.hstack([slopes[0][t], slopes[1][t]])
        Q_z, Q = F.T @ V_x, F.T @ V @ F
        Q_z[2 * m :] += R * flight.u[t]
        Q[2 * m :, 2 * m :] += np.diag(R)
        if curved:
            state = ClosedState(*(one[t] for one in flight.closed))
            Q += problem.model.hessian(state, h**2 * V_x[:m] + h * V_x[m:])
        x, u = slice(2 * m), slice(2 * m, None)
        try:
            factor = cho_factor(Q[u, u])
        except LinAlgError:
            return None
        change[t], by_state[t] = -cho_solve(factor, Q_z[u]), -cho_solve(factor, Q[u, x])
        total += float(Q_z[u] @ change[t])
        V_x = Q_z[x] + Q[x, u] @ change[t]
        V = Q[x, x] + Q[x, u] @ by_state[t]
        V = (V + V.T) / 2
    return Gains(change, by_state, total)


def _forward(problem: Problem, flight: Flight, gains: Gains, shares: Sequence[float]) -> Flight | None:
    """Return the first motion along the changes that costs less by its share, or None."""
    for share in shares:
        try:
            found = fly(problem, flight.u, flight, gains, share)
        except HybridynError:
            continue
        if found.cost <= flight.cost * (1 + ROUNDING) + SHARE * share * gains.slope:
            return found
    return None
