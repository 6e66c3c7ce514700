"""A motion of all motors from rest to rest with the least efforts, by trapezoids."""

from typing import NamedTuple

import casadi as ca
import numpy as np

import hybridyn
from hybridyn.spatial import Array


class Solved(NamedTuple):
    """What IPOPT found: positions, rates, accelerations, shape (motors, T), with the weighted efforts."""

    motion: tuple[Array, Array, Array]
    least: float
    iterations: int
    success: bool


def solved(
    robot: hybridyn.HybridRobot, way: Array, T: int, hessian: str, most: int = 200, share: float = 0.9
) -> Solved:
    """Move the motors from home by `way` in half a second, with the Hessian of a word of IPOPT.

    Args:
        most: Number of iterations.
        share: Bound of the efforts, of the largest ones that the straight motion takes.
    """
    m, h, home = len(robot.motors), 0.5 / (T - 1), robot.home[robot.motor_q]
    inverse = hybridyn.casadi_model(robot, "idm", T)
    straight = trapezoids(home, way, T, h)
    size = np.abs(inverse(*straight).full()).max(axis=1, keepdims=True)
    q, v, a = (ca.MX.sym(name, m, T) for name in "qva")
    efforts = inverse(q, v, a) / np.tile(size, T)
    gaps = [x[:, 1:] - x[:, :-1] - h / 2 * (x_dot[:, 1:] + x_dot[:, :-1]) for x, x_dot in ((q, v), (v, a))]
    problem = {"x": ca.veccat(q, v, a), "f": h * ca.sumsqr(efforts), "g": ca.veccat(*gaps, efforts)}
    most_of_all = [np.abs(x).max(axis=1, keepdims=True) * np.ones(T) for x in straight[1:]]
    middle, half = home[:, None] + way[:, None] / 2, np.abs(way)[:, None] * np.ones(T)
    bounds = [(middle - half, middle + half), *((-4.0 * x, 4.0 * x) for x in most_of_all)]
    for own, first, last in zip(bounds[:2], (home, 0.0), (home + way, 0.0), strict=True):
        for bound in own:
            bound[:, 0], bound[:, -1] = first, last
    ipopt = {"hessian_approximation": hessian, "print_level": 0, "sb": "yes", "max_iter": most}
    solver = ca.nlpsol("least", "ipopt", problem, {"ipopt": ipopt, "print_time": False})
    zero, limit = np.zeros(2 * m * (T - 1)), share * np.ones(m * T)
    found = solver(
        x0=flat(straight), lbx=flat(x for x, _ in bounds), ubx=flat(x for _, x in bounds),
        lbg=np.append(zero, -limit), ubg=np.append(zero, limit),
    )  # fmt: skip
    stats = solver.stats()
    motion = found["x"].full().reshape(3, T, m).transpose(0, 2, 1)
    return Solved(tuple(motion), float(found["f"]), stats["iter_count"], stats["success"])


def trapezoids(home: Array, way: Array, T: int, h: float) -> tuple[Array, Array, Array]:
    """Return the straight motion: accelerations fall in line; rates and positions are sums of trapezoids."""
    a = np.linspace(1.0, -1.0, T)
    v = np.append(0.0, np.cumsum(h / 2 * (a[1:] + a[:-1])))
    q = np.append(0.0, np.cumsum(h / 2 * (v[1:] + v[:-1])))
    q, v, a = (np.outer(way, x / q[-1]) for x in (q, v, a))
    return home[:, None] + q, v, a


def flat(arrays: object) -> Array:
    """Return arrays of shape (motors, T) as CasADi's `veccat` puts them in one column."""
    return np.concatenate([np.asarray(x).T.ravel() for x in arrays])  # type: ignore[attr-defined]
