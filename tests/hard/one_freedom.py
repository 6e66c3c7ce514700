"""Mechanisms of one freedom in closed form: no closures, no Pinocchio, no rank decision.

A *law* gives every joint position of the spanning tree, and its derivative, as analytic functions of one
coordinate s. With the links placed by it, virtual power gives

    A(s) s_ddot + A'(s) s_dot^2 / 2 + V'(s) = sum of efforts x d(joint)/ds,    A = sum m c'.c' + w'.I w'

where c', w' are the rates of a link's centre and its angular velocity at s_dot = 1. Everything is written
without absolute values or comparisons, so that s may be complex: f'(s) = Im f(s + ih) / h is exact to
rounding. The links' numbers are those of the Description; the loops' are those of the law.
"""

from collections.abc import Callable, Mapping

import numpy as np
from scipy.integrate import solve_ivp

from hybridyn import HybridRobot

Array = np.ndarray
Law = Callable[[complex], Mapping[str, tuple[complex, complex]]]

COMPLEX_STEP = 1e-30
REFERENCE = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-13}


def turned(axis: Array, angle: complex) -> Array:
    """Return the rotation about a unit axis, shape (3, 3)."""
    x, y, z = axis
    S = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * S + (1 - np.cos(angle)) * (S @ S)


def crossed(a: Array, b: Array) -> Array:
    """Return the vector product of two vectors; numpy's own is slow."""
    (x, y, z), (u, v, w) = a.tolist(), b.tolist()
    return np.array([y * w - z * v, z * u - x * w, x * v - y * u])


class OneFreedom:
    """A mechanism whose every posture is known.

    Attributes:
        robot: The robot, for tests; only its names, gravity and description are used here.
        description: Its links and joints; revolute, prismatic and fixed ones.
        law: Positions and derivatives of the joints over s; joints not named stay at zero.
        joints: Names of the joints in the order wanted in `state`.
        gravity: Acceleration of gravity, shape (3,).
    """

    def __init__(self, robot: HybridRobot, law: Law) -> None:
        self.robot = robot
        self.description, self.law, self.gravity = robot.description, law, np.array(robot.gravity)
        self.joints = robot.joints
        self._links = {link.name: link for link in self.description.links}

    def links(self, s: complex) -> dict[str, tuple[Array, Array, Array, Array]]:
        """Give every link's axes and origin, and its angular and its origin's velocity at s_dot = 1."""
        at = self.law(s)
        zero = np.zeros(3, dtype=complex)
        out = {self.description.root: (np.eye(3, dtype=complex), zero, zero, zero)}
        waiting = list(self.description.joints)
        while waiting:
            joint = next(j for j in waiting if j.parent in out)
            waiting.remove(joint)
            R, p, w, v = out[joint.parent]
            offset = R @ joint.placement[:3, 3]
            R, p, v = R @ joint.placement[:3, :3], p + offset, v + crossed(w, offset)
            position, rate = at.get(joint.name, (0.0, 0.0))
            if joint.kind == "prismatic":
                slide = R @ joint.axis
                p, v = p + slide * position, v + crossed(w, slide * position) + slide * rate
            elif joint.kind != "fixed":
                w = w + R @ joint.axis * rate
                R = R @ turned(joint.axis, position)
            out[joint.child] = R, p, w, v
        return out

    def energies(self, s: complex) -> tuple[complex, complex]:
        """Return A(s), and V(s) of gravity."""
        A: complex = 0.0
        V: complex = 0.0
        for name, (R, p, w, v) in self.links(s).items():
            link = self._links[name]
            arm, body = R @ link.com, R.T @ w
            centre = v + crossed(w, arm)
            A += link.mass * (centre @ centre) + body @ link.inertia @ body
            V -= link.mass * (self.gravity @ (p + arm))
        return A, V

    def terms(self, s: float) -> tuple[float, float, float]:
        """Return A, A' and V' at s."""
        A, V = self.energies(s + 1j * COMPLEX_STEP)
        return A.real, A.imag / COMPLEX_STEP, V.imag / COMPLEX_STEP

    def effort(self, s: float, s_dot: float, s_ddot: float, motor: str) -> float:
        """Return the effort of the one motor."""
        A, slope, weight = self.terms(s)
        along = self.law(s)[motor][1].real
        return (A * s_ddot + slope * s_dot**2 / 2 + weight) / along

    def acceleration(self, s: float, s_dot: float, effort: float = 0.0, motor: str = "") -> float:
        """Return s_ddot under the effort of the one motor."""
        A, slope, weight = self.terms(s)
        along = self.law(s)[motor][1].real if motor else 0.0
        return (effort * along - slope * s_dot**2 / 2 - weight) / A

    def state(self, s: float, s_dot: float, s_ddot: float = 0.0) -> tuple[Array, Array, Array]:
        """Return positions, rates and accelerations of the joints, each in the order of `joints`."""
        at = self.law(s + 1j * COMPLEX_STEP)
        q = np.array([complex(at[name][0]).real for name in self.joints])
        slope = np.array([complex(at[name][1]).real for name in self.joints])
        curve = np.array([complex(at[name][1]).imag / COMPLEX_STEP for name in self.joints])
        return q, slope * s_dot, slope * s_ddot + curve * s_dot**2

    def motion(self, s: float, s_dot: float, times: Array) -> Array:
        """Return s and s_dot at times under weights alone, shape (T, 2)."""
        return solve_ivp(
            lambda t, x: [x[1], self.acceleration(x[0], x[1])],
            (times[0], times[-1]), [s, s_dot], t_eval=times, **REFERENCE,
        ).y.T  # fmt: skip


def slope_error(mechanism: OneFreedom, s: float) -> float:
    """Say by how much a law's derivatives miss those of its positions, relative to the largest."""
    at = mechanism.law(s + 1j * COMPLEX_STEP)
    numeric = np.array([complex(x).imag / COMPLEX_STEP for x, _ in at.values()])
    stated = np.array([complex(rate).real for _, rate in at.values()])
    return float(np.abs(numeric - stated).max() / np.abs(stated).max())
