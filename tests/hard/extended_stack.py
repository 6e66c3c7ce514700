"""Both dynamic models of a stack of modules in more digits, in time and memory linear in its height.

The oracle gives the equations of each module on a base that turns and accelerates (`tests/oracle`); here they
are put on one another. The coordinates of a module are the acceleration A of its base, classical, less
gravity, in the base's axes, and those of its own motions. The equations are taken at the very numbers that
the core was given; nothing is refined. Long double is judged by more digits, and both by the oracle of the
whole stack, at small heights (`test_size.py`).
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from hybridyn.description import Description
from tests.oracle import Oracle
from tests.oracle.arithmetic import Arithmetic, Numbers, cross


class Module:
    """A module at one state, on a base without mass that turns.

    Args:
        oracle: Of the module alone on a moving base, without gravity.
        q, v: Of its joints.
        spin: Angular velocity of the base, own axes, shape (3,).

    Attributes:
        T: Accelerations of the tree over those of base and coordinates, shape (nv, 6 + n); `a` beside them.
        X, bias: The platform's acceleration in its own axes over that of the tree, and at none.
        M, F: Inertia and forces along T, at none of them.
        B: Map of the motors' efforts to forces along the coordinates.
        platform_spin: Angular velocity of the platform, own axes.
    """

    def __init__(self, oracle: Oracle, q: Numbers, v: Numbers, spin: Numbers) -> None:
        self.oracle, array = oracle, oracle.arithmetic.array
        self.p = p = oracle.posture(np.concatenate([array([0, 0, 0, 0, 0, 0, 1]), array(q)]))
        rates = np.concatenate([spin * 0, spin, array(v)])
        self.V, self.g, k = oracle.tree.drifts(p, rates)
        self.a = oracle.tree.least_change(p, -k)
        Z = oracle.unit[:, None] * p.Z
        self.T = np.concatenate([array(np.eye(oracle.nv, 6)), Z], axis=1)
        C = oracle.bodies.inertia_root(p, self.T)
        self.M, self.F, self.B = C.T @ C, self.T.T @ self.force(self.a), Z[oracle.motors].T
        platform = p.links["m1_platform"]
        at, w, E = 6 * platform.body, self.V[platform.body][3:], platform.E
        self.platform_spin = E.T @ w
        lever = np.array([cross(e, platform.r) for e in array(np.eye(3))]).T
        twist, drift = p.G[at : at + 6], self.g[platform.body]
        drift = drift + np.concatenate([cross(w, cross(w, platform.r)), w * 0])
        self.X, self.bias = (
            np.concatenate([E.T @ (x[:3] + lever @ x[3:]), E.T @ x[3:]]) for x in (twist, drift)
        )

    def force(self, a: Numbers) -> Numbers:
        """Return the forces of the tree at its accelerations a."""
        V_dot = (self.p.G @ a).reshape(-1, 6) + self.g
        return self.p.G.T @ self.oracle.bodies.needed(self.p, self.V, V_dot, {}).reshape(-1)


class Stack:
    """A stack of equal modules at one state.

    Args:
        one: The robot of one module.
        count: Number of modules.
        on: What to compute in.
        gravity: Acceleration of gravity, shape (3,), base axes.
        joints: Where each joint of the stack stands in q and v.
        motors: Where each motor stands in tau.
        q, v: The state, on the spanning tree.
    """

    def __init__(
        self, one: Description, count: int, on: Arithmetic, gravity: Any, joints: dict[str, int],
        motors: dict[str, int], q: Any, v: Any,
    ) -> None:  # fmt: skip
        links = [replace(x, mass=0.0, inertia=0 * x.inertia) if x.name == "m1_base" else x for x in one.links]
        oracle = Oracle(replace(one, links=tuple(links)), "moving", (0.0, 0.0, 0.0), arithmetic=on)
        self.on, self.first, self.modules = (
            on,
            np.concatenate([-on.array(gravity), on.array(np.zeros(3))]),
            [],
        )
        names = [name.removeprefix("m1_") for name in oracle.joint_names[1:]]
        driven = [name.removeprefix("m1_") for name in one.motors]
        numbers = range(1, count + 1)
        self.joints, self.motors = (
            np.array([[where[f"m{k}_{x}"] for x in some] for k in numbers])
            for where, some in ((joints, names), (motors, driven))
        )
        spin = on.array(np.zeros(3))
        for at in self.joints:
            self.modules.append(Module(oracle, q[at], v[at], spin))
            spin = self.modules[-1].platform_spin

    def upwards(self) -> Iterator[tuple[Module, np.ndarray, np.ndarray]]:
        """Yield each module with the places of its joints and motors."""
        return zip(self.modules, self.joints, self.motors, strict=True)

    def downwards(self) -> Iterator[tuple[Module, np.ndarray, np.ndarray]]:
        """Yield the same from the top."""
        return reversed([*self.upwards()])

    def ddm(self, tau: np.ndarray) -> Numbers:
        """Return the accelerations of the spanning tree, shape (nv,)."""
        tau, eye = self.on.array(tau), self.on.array(np.eye(6))
        inertia, wrench = 0 * np.outer(self.first, self.first), 0 * self.first
        steps, out = [], self.on.array(np.zeros(self.joints.size))
        for m, _, motors in self.downwards():
            X = m.X @ m.T
            M = m.M + X.T @ inertia @ X
            F = m.F + X.T @ (inertia @ (m.X @ m.a + m.bias) + wrench)
            effort = m.B @ tau[motors] - F[6:]
            both = self.on.solve(M[6:, 6:], np.concatenate([M[6:, :6], effort[:, None]], axis=1))
            # A difference of M and E^T A^-1 E would lose digits at every module, twice as many each time.
            follows = np.concatenate([eye, -both[:, :6]])
            inertia, wrench = follows.T @ M @ follows, F[:6] + both[:, :6].T @ effort
            steps.insert(0, both)
        A = self.first
        for (m, joints, _), both in zip(self.upwards(), steps, strict=True):
            a = m.a + m.T @ np.concatenate([A, both[:, 6] - both[:, :6] @ A])
            out[joints], A = a[6:], m.X @ a + m.bias
        return out

    def idm(self, a: np.ndarray) -> Numbers:
        """Return the motor efforts at accelerations of the spanning tree, shape (motors,)."""
        a, A, moved = self.on.array(a), self.first, []
        for m, joints, _ in self.upwards():
            moved.append(np.concatenate([A, a[joints]]))
            A = m.X @ moved[-1] + m.bias
        wrench, tau = 0 * self.first, self.on.array(np.zeros(self.motors.size))
        for (m, _, motors), rates in zip(self.downwards(), reversed(moved), strict=True):
            F = m.force(rates) + m.X.T @ wrench
            tau[motors] = self.on.solve(m.B, (m.T.T @ F)[6:, None])[:, 0]
            wrench = F[:6]
        return tau
