"""Friction that grows with load, from the multipliers of every row in maximal coordinates.

The unknowns are the multipliers of all rows of joints and closures, the efforts or the accelerations, and the
friction of each joint. All but the last follow from a linear system; the last from Newton's method.
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from .arithmetic import Numbers
from .models import Oracle
from .tree import Posture

#: Coefficients of each joint with friction: "radial", "axial", "tilt", "normal".
Coefficients = Mapping[str, Mapping[str, float]]
#: Axes, in the joint's triad, of the force (0 to 2) and the moment (3 to 5) that a coefficient multiplies.
OF_HINGE = {"radial": (0, 1), "axial": (2,), "tilt": (3, 4)}
OF_BALL, OF_SLIDE = {"radial": (0, 1, 2)}, {"normal": (0, 1), "tilt": (3, 4, 5)}
#: Coefficients of the factor by which friction is larger near rest.
NEAR_REST = ("static", "speed")
NEWTON = 40
#: Part of the largest wrench by which rows may fail to balance bodies: the given motion is rounded.
BALANCED = 1e-9


class Rubbed(NamedTuple):
    """What the models give: tau or a, shape (motors,) or (nv,), and the friction of each joint by name."""

    result: Numbers
    friction: dict[str, Numbers]


class Judge:
    """The inverse and the direct model with load friction, one sample a call.

    Args:
        oracle: The models without friction.
        law: Coefficients by joint; "static" and "speed" besides those of loads.
        width: Speed scale of the smoothed sign [m/s or rad/s].
    """

    def __init__(self, oracle: Oracle, law: Coefficients, width: float) -> None:
        self.oracle, self.law, self.width = oracle, law, width
        self.names = list(law)

    def idm(self, q: Numbers, v: Numbers, a: Numbers) -> Rubbed:
        """Compute the efforts of a motion, motors of equal weight."""
        oracle, posture = self.oracle, self.oracle.posture(q)
        a = oracle.arithmetic.array(a)
        W = self._needed(posture, v, a)
        Q, B = posture.G.T @ W, oracle.motor_map(posture)
        share = oracle.arithmetic.factor(B, oracle.rank_tolerance)

        def model(friction: Numbers) -> tuple[Numbers, Numbers, Numbers]:
            """Return efforts of motors and of all coordinates, and what bodies need."""
            tau = share.least_norm(posture.Z.T @ (oracle.unit * (Q - friction)))
            return tau, self._efforts(tau, friction), W

        return self._solved(posture, v, model)

    def ddm(self, q: Numbers, v: Numbers, tau: Numbers, base: Numbers | None = None) -> Rubbed:
        """Compute the accelerations under efforts; `base`: those of a prescribed base, shape (6,)."""
        oracle, posture = self.oracle, self.oracle.posture(q)
        V, g, k = oracle.tree.drifts(posture, oracle.arithmetic.array(v))
        a_p = oracle.tree.least_change(posture, -k)
        if base is not None:
            a_p[:6] = oracle.arithmetic.array(base)

        def model(friction: Numbers) -> tuple[Numbers, Numbers, Numbers]:
            """Return accelerations, efforts of all coordinates, and what bodies need."""
            efforts = self._efforts(oracle.arithmetic.array(tau), friction)
            a = oracle._unforced(posture, a_p, posture.Z, efforts, V, g, {})
            return a, efforts, self._needed(posture, v, a)

        return self._solved(posture, v, model)

    def _efforts(self, tau: Numbers, friction: Numbers) -> Numbers:
        """Sum the efforts of motors and of friction on the coordinates, shape (nv,)."""
        out: Numbers = friction.copy()
        for motor, value in zip(self.oracle.motors, tau, strict=True):
            out[motor] = out[motor] + value
        return out

    def _needed(self, posture: Posture, v: Numbers, a: Numbers) -> Numbers:
        """Compute the wrench that each body needs, one after another."""
        V, g, _ = self.oracle.tree.drifts(posture, self.oracle.arithmetic.array(v))
        return self.oracle.bodies.needed(posture, V, (posture.G @ a).reshape(-1, 6) + g, {}).reshape(-1)

    def _rows(self, posture: Posture) -> tuple[Numbers, Numbers, list[slice]]:
        """Return wrenches on all bodies per multiplier and per effort, and each joint's multipliers."""
        oracle, loops = self.oracle, [*posture.joints, *posture.closures]
        held: list[Numbers] = []
        free: list[Numbers] = []
        own: list[slice] = []
        for number, loop in enumerate(loops):
            is_joint, first = number < len(posture.joints), len(held)
            at = oracle.coordinates[oracle.joint_names[number]][2] if is_joint else slice(0, 0)
            for i, row in enumerate(loop.rows):
                column = oracle.arithmetic.array(np.zeros(len(posture.G)))
                for frame, part in ((loop.A, row.at_a), (loop.B, row.at_b)):
                    column[6 * frame.body : 6 * frame.body + 6] += part
                effort = i >= len(loop.rows) - (at.stop - at.start)
                if effort:
                    free.append(column)
                if not effort or (oracle.base == "moving" and number == 0):
                    held.append(column)
            own.append(slice(first, len(held)))
        efforts = np.array(free).T
        couplings = posture.K[sum(len(loop.rows) for loop in posture.closures) :]
        return np.array([*held, *(efforts @ row for row in couplings)]).T, efforts, own

    def _solved(
        self, posture: Posture, v: Numbers, model: Callable[[Numbers], tuple[Numbers, Numbers, Numbers]]
    ) -> Rubbed:
        """Solve for the frictions by Newton's method and return the model's result with them."""
        oracle, array = self.oracle, self.oracle.arithmetic.array
        held, efforts, own = self._rows(posture)
        factor = oracle.arithmetic.factor(held[6:], oracle.rank_tolerance)  # the world is held by nothing
        D = self.directions(array(v))

        def wrenches(n: Numbers) -> list[Numbers]:
            """Compute the wrench of each joint with friction, in its triad, under frictions n."""
            _, effort, W = model(D @ n)
            missing = W - efforts @ effort
            lam = factor.least_norm(missing[6:])
            left, size = (held @ lam - missing)[6:].astype(float), np.abs(W[6:].astype(float)).max()
            assert np.abs(left).max() <= BALANCED * size, "rows do not balance the bodies"
            out = []
            for name in self.names:
                number, at = oracle.joint_names.index(name), oracle.coordinates[name][2]
                B = posture.joints[number].B
                on_body = held[:, own[number]] @ lam[own[number]] + efforts[:, at] @ effort[at]
                wrench = on_body[6 * B.body : 6 * B.body + 6]
                out.append(np.concatenate([B.E.T @ wrench[:3], B.E.T @ wrench[3:]]))
            return out

        count = range(len(self.names))
        unit = array(np.eye(len(self.names)))
        n = unit[0] * 0 if self.names else array(np.zeros(0))
        start = wrenches(n)
        B = [[b - w for b, w in zip(wrenches(e), start, strict=True)] for e in unit]
        for _ in range(NEWTON):
            w = [start[i] + sum((B[j][i] * n[j] for j in count), start=0 * start[i]) for i in count]
            sizes = [self._size(name, x) for name, x in zip(self.names, w, strict=True)]
            left = array([size - x for (size, _), x in zip(sizes, n, strict=True)])
            if max(abs(left), default=0) <= 8 * oracle.arithmetic.epsilon * max(abs(n), default=0):
                break
            slope = array([[g @ B[j][i] for j in count] for i, (_, g) in enumerate(sizes)])
            n = n + oracle.arithmetic.solve(unit - slope, left[:, None])[:, 0]
        else:
            raise ValueError(f"friction does not settle: {left}")
        return Rubbed(model(D @ n)[0], dict(zip(self.names, n, strict=True)))

    def _size(self, name: str, wrench: Numbers) -> tuple[Numbers, Numbers]:
        """Compute the friction of a joint per unit of the sign, and its derivative by the wrench, (6,)."""
        kind = self.oracle.coordinates[name][0]
        takes = {"spherical": OF_BALL, "prismatic": OF_SLIDE}.get(kind, OF_HINGE)
        size, slope = 0 * wrench[0], 0 * wrench
        for word, factor in self.law[name].items():
            if word in NEAR_REST:
                continue
            at = list(takes[word])
            length = self.oracle.arithmetic.sqrt(wrench[at] @ wrench[at])
            size = size + factor * length
            if length > 0:
                slope[at] = slope[at] + factor * wrench[at] / length
        return size, slope

    def directions(self, v: Numbers) -> Numbers:
        """Compute the efforts of all coordinates per unit of each joint's friction, shape (nv, joints)."""
        D = self.oracle.arithmetic.array(np.zeros((len(v), len(self.names))))
        for j, name in enumerate(self.names):
            at = self.oracle.coordinates[name][2]
            speed = self.oracle.arithmetic.sqrt(v[at] @ v[at])
            if speed > 0:
                D[at, j] = -self.oracle.arithmetic.tanh(speed / self.width) * v[at] / speed
            if "static" in (own := self.law[name]):
                D[at, j] *= 1 + (own["static"] - 1) * self.oracle.arithmetic.exp(
                    -((speed / own["speed"]) ** 2)
                )
        return D
