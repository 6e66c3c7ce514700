"""Newton-Euler equations of every link, in world axes about the body's origin."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from hybridyn.description.records import Description

from .arithmetic import Arithmetic, Numbers, cross
from .tree import Posture

Wrenches = Mapping[str, Any]

#: Pivots of an inertia below this part of its trace are rounding: six numbers, three in a product, 18 eps.
DATA_ROUNDING = 4e-15


class Bodies:
    """The inertias of a robot's links and the wrenches that they need.

    Args:
        description: The robot.
        gravity: Acceleration of gravity, shape (3,), [m/s^2], world.
        arithmetic: The arithmetic of all computations.
    """

    def __init__(self, description: Description, gravity: Numbers, arithmetic: Arithmetic) -> None:
        array = arithmetic.array
        self.gravity, self.arithmetic = gravity, arithmetic
        self.links = [(x.name, array(x.mass)[()], array(x.com), array(x.inertia)) for x in description.links]
        self.mass = sum(x.mass for x in description.links)
        self.inertia = sum(float(np.trace(x.inertia)) for x in description.links)

    def needed(self, posture: Posture, V: Numbers, V_dot: Numbers, wrenches: Wrenches) -> Numbers:
        """Compute the wrench W that the motion of each body needs beyond gravity and external wrenches.

        Args:
            posture: Placement of the bodies.
            V: Body velocities, shape (bodies, 6), [m/s, rad/s], world axes, body origins.
            V_dot: Body accelerations, classical, shape (bodies, 6).
            wrenches: Link name to external wrench [force; moment], shape (6,), link frame at its origin.

        Returns:
            [force; moment] about each body's origin, shape (bodies, 6), world axes; the world is body 0.

        Raises:
            KeyError: A wrench names an unknown link.
        """
        W = self.arithmetic.array(np.zeros(V.shape))
        for name, mass, com, inertia in self.links:
            link = posture.links[name]
            omega, alpha, lever = V[link.body][3:], V_dot[link.body][3:], link.r + link.E @ com
            c_ddot = V_dot[link.body][:3] + cross(alpha, lever) + cross(omega, cross(omega, lever))
            force = mass * (c_ddot - self.gravity)
            J = link.E @ inertia @ link.E.T
            moment = J @ alpha + cross(omega, J @ omega) + cross(lever, force)
            W[link.body] = W[link.body] + np.concatenate([force, moment])
        for name, wrench in wrenches.items():
            link, wrench = posture.links[name], self.arithmetic.array(wrench)
            force, moment = link.E @ wrench[:3], link.E @ wrench[3:]
            W[link.body] = W[link.body] - np.concatenate([force, moment + cross(link.r, force)])
        return W

    def inertia_root(self, posture: Posture, motions: Numbers) -> Numbers:
        """Compute C with `C^T C = motions^T G^T M G motions`: link velocities times roots of masses."""
        count = motions.shape[1]
        moved = (posture.G @ motions).reshape(len(posture.G) // 6, 6, count)
        blocks = [self.arithmetic.array(np.zeros((0, count)))]
        for name, mass, com, inertia in self.links:
            link = posture.links[name]
            lever, omega = link.r + link.E @ com, moved[link.body][3:]
            c_dot = (
                moved[link.body][:3]
                - np.array([cross(lever, omega[:, j]) for j in range(count)]).reshape(-1, 3).T
            )
            blocks += [self.arithmetic.sqrt(mass) * c_dot, self.root(inertia) @ link.E.T @ omega]
        return np.concatenate(blocks)

    def root(self, inertia: Numbers) -> Numbers:
        """Compute X with `X^T X = inertia` by pivoted Cholesky; the inertia may be zero or singular.

        A pivot within the rounding of the data, which are doubles in any arithmetic, counts as zero.
        """
        left, rows = inertia.copy(), []
        for _ in range(3):
            i = max(range(3), key=lambda j: left[j, j])
            if left[i, i] <= DATA_ROUNDING * (inertia[0, 0] + inertia[1, 1] + inertia[2, 2]):
                break
            rows.append(left[i] / self.arithmetic.sqrt(left[i, i]))
            left = left - np.outer(rows[-1], rows[-1])
            left[i, :] = left[:, i] = 0
        return self.arithmetic.array(rows).reshape(-1, 3)
