"""Both dynamic models of a stack of modules in extended precision, in time and memory linear in its height.

Written for the tests alone and shares nothing with the package but the Description: three-vectors in the axes
of each module's base, classical accelerations, Newton and Euler about centres of mass, the coordinates of a
module always its platform's acceleration relative to its base. A module is legs that hold one platform at
points: each leg's end and its point on the platform accelerate alike (in the plane, for planar modules).

The equations are taken at the very numbers that the core was given; nothing is refined. Long double is judged
by more digits, and both by the oracle, another formulation, at small heights (`test_size.py`).
"""

from typing import Any

import numpy as np

from hybridyn.description import Description
from tests.hard.extended import Arithmetic, Numbers, block, double, hat, mul, reach, solve, turned
from tests.hard.extended_legs import Chain, at_rest, jacobian, move, read_kind


class Stack:
    """A stack of equal modules at one state.

    Args:
        one: The robot of one module.
        count: Number of modules.
        on: What to compute in.
        gravity: Acceleration of gravity, shape (3,), base axes.
        planar: Whether the modules move in their x-y planes only.
    """

    def __init__(
        self, one: Description, count: int, on: Arithmetic, gravity: Any, *, planar: bool = False
    ) -> None:
        self.on, self.count, self.gravity = on, count, on.array(gravity)
        self.kind = read_kind(one, on, planar)
        self.planar = planar

    def names(self, chain: Chain, module: int) -> list[str]:
        """Return a module's joint names, leg after leg."""
        return [name.replace("m1_", f"m{module + 1}_", 1) for leg in chain.names for name in leg]

    def take(self, chain: Chain, joints: dict[str, int], x: np.ndarray) -> Numbers:
        """Return coordinates of chains, (modules, legs, joints), from those of the spanning tree."""
        at = [[joints[name] for name in self.names(chain, k)] for k in range(self.count)]
        return self.on.array(x[np.array(at)].reshape(self.count, len(chain.names), -1))

    def state(self, joints: dict[str, int], q: np.ndarray, v: np.ndarray) -> None:
        """Take a state on the spanning tree; `joints` says where each joint stands in q and v."""
        k, on = self.kind, self.on
        self.q, self.v = (self.take(k.legs, joints, x) for x in (q, v))
        self.q_w, self.v_w = (self.take(k.wrist, joints, x) for x in (q, v))
        legs = len(k.legs.names)
        none = self.v * 0
        self.relative = move(on, k.legs, at_rest(on, (self.count, legs)), self.q, self.v, none)
        self.R, self.p, self.w, self.pd = self._platform(none, self.v_w * 0)[:4]
        self.r = mul(self.R[:, None], k.points)
        end, last = self.relative, len(k.legs.slides) - 1
        arm = mul(end.R[-1], k.tips)
        tip = end.p[-1] + arm
        rows = [0, 1] if self.planar else [0, 1, 2]
        J = jacobian(k.legs, end, last, tip)[..., rows, :]
        bias = end.pdd[-1] + np.cross(end.wd[-1], arm) + np.cross(end.w[-1], np.cross(end.w[-1], arm))
        w = np.broadcast_to(self.w[:, None], self.r.shape)
        wanted = np.cross(w, np.cross(w, self.r)) - bias
        eye = np.broadcast_to(np.eye(3, dtype=int), (*self.r.shape, 3)) + 0 * self.r[..., None]
        points = np.concatenate([eye, -hat(self.r)], axis=-1)[..., rows, :][..., k.plane]
        both = solve(J, np.concatenate([points, wanted[..., rows, None]], axis=-1))
        self.Psi, self.drift = both[..., :-1], both[..., -1]
        self.w_base = self._spins()

    def _platform(self, a: Numbers, a_w: Numbers) -> tuple[Numbers, ...]:
        """Return R, p, w, pd, wd, pdd of the platforms in their bases, by the carrying leg, bases at rest."""
        k, on = self.kind, self.on
        legs = move(on, k.legs, at_rest(on, (self.count, len(k.legs.names))), self.q, self.v, a)
        first = [x[-1][:, :1] for x in (legs.R, legs.p, legs.w, legs.wd, legs.pd, legs.pdd)]
        end = move(on, k.wrist, tuple(first), self.q_w, self.v_w, a_w)
        R, p, w, wd, pd, pdd = (x[-1][:, 0] for x in (end.R, end.p, end.w, end.wd, end.pd, end.pdd))
        arm = mul(R, k.mount[1])
        return (
            (R @ k.mount[0]), p + arm, w, pd + np.cross(w, arm),
            wd, pdd + np.cross(wd, arm) + np.cross(w, np.cross(w, arm)),
        )  # fmt: skip

    def _spins(self) -> Numbers:
        """Return the angular velocity of every module's base in its own axes."""
        w, out = self.on.array(np.zeros(3)), []
        for R, relative in zip(self.R, self.w, strict=True):
            out.append(w)
            w = mul(turned(R), w + relative)
        return np.array(out)

    def _bodies(self, a: Numbers) -> tuple[Numbers, ...]:
        """Return of all leg bodies: maps from the base's acceleration and from joints, inertia, forces.

        The forces are those at joint accelerations a, the base turning but not accelerating.
        """
        k, on = self.kind, self.on
        R0, zero = at_rest(on, a.shape[:2])[:2]
        w0 = np.broadcast_to(self.w_base[:, None], zero.shape)
        moved = move(on, k.legs, (R0, zero, w0, zero, zero, zero), self.q, self.v, a)
        X, J, mass, force = [], [], [], []
        for b in np.flatnonzero(k.legs.mass.any(axis=0)):
            arm = mul(moved.R[b], k.legs.com[:, b])
            centre = moved.p[b] + arm
            w, wd = moved.w[b], moved.wd[b]
            pdd = moved.pdd[b] + np.cross(wd, arm) + np.cross(w, np.cross(w, arm))
            inertia = (moved.R[b] @ k.legs.inertia[:, b]) @ turned(moved.R[b])
            m = np.broadcast_to(k.legs.mass[:, b, None], zero.shape)
            X.append(reach(centre))
            J.append(jacobian(k.legs, self.relative, b, centre))
            mass.append(block(m, inertia))
            force.append(np.concatenate([m * pdd, mul(inertia, wd) + np.cross(w, mul(inertia, w))], axis=-1))
        return tuple(np.stack(x, axis=2) for x in (X, J, mass, force))

    def _platform_inertia(self) -> tuple[Numbers, Numbers]:
        """Return the platforms' 6-D inertia about their origins and gyroscopic forces, in their own axes."""
        k = self.kind
        c = np.broadcast_to(k.com, (self.count, 3))
        m = np.broadcast_to(k.mass, (self.count, 3))
        w = mul(turned(self.R), self.w_base + self.w)
        I_c = np.broadcast_to(k.inertia, (self.count, 3, 3))
        X = reach(c)
        inertia = turned(X) @ (block(m, I_c) @ X)
        force = np.concatenate([m * np.cross(w, np.cross(w, c)), np.cross(w, mul(I_c, w))], axis=-1)
        return inertia, mul(turned(X), force)

    def _along(self) -> tuple[Numbers, Numbers, Numbers]:
        """Give the platforms' accelerations in their own axes: maps from the base's and from u_dot; bias."""
        R6 = double(turned(self.R))
        w0 = self.w_base
        linear = np.cross(w0, np.cross(w0, self.p)) + 2 * np.cross(w0, self.pd)
        bias = np.concatenate([linear, np.cross(w0, self.w)], axis=-1)
        return (R6 @ reach(self.p)), R6[..., self.kind.plane], mul(R6, bias)

    def _first(self) -> Numbers:
        return np.concatenate([-self.gravity, self.gravity * 0])

    def ddm(self, joints: dict[str, int], tau: np.ndarray, motors: dict[str, int]) -> Numbers:
        """Return the accelerations of the spanning tree, shape (nv,)."""
        k = self.kind
        driven = np.array([[motors[leg[k.motor].replace("m1_", f"m{i + 1}_", 1)] for leg in k.legs.names]
                           for i in range(self.count)])  # fmt: skip
        tau = self.on.array(tau[driven])
        X, J, mass, force = self._bodies(self.drift)
        J = J @ self.Psi[:, :, None]
        T = np.concatenate([X, J], axis=-1)
        M = (turned(T) @ (mass @ T)).sum(axis=(1, 2))
        F = mul(turned(T), force).sum(axis=(1, 2))
        Q = (self.Psi[:, :, k.motor] * tau[..., None]).sum(axis=1)
        X_p, a_p, bias = self._along()
        T_p = np.concatenate([X_p, a_p], axis=-1)
        I_star, beta = (list(x) for x in self._platform_inertia())
        G, y, eye = [None] * self.count, [None] * self.count, self.on.array(np.eye(6))
        for i in reversed(range(self.count)):
            M_i = M[i] + (T_p[i].T @ (I_star[i] @ T_p[i]))
            F_i = F[i] + mul(T_p[i].T, mul(I_star[i], bias[i]) + beta[i])
            E, Q_0 = M_i[6:, :6], Q[i] - F_i[6:]
            both = solve(M_i[6:, 6:], np.concatenate([E, Q_0[:, None]], axis=-1))
            G[i], y[i] = both[:, :6], both[:, 6]
            if i:
                # A difference of M and E^T A^-1 E would lose digits at every module, twice as many each time.
                follows = np.concatenate([eye, -G[i]])
                I_star[i - 1] = I_star[i - 1] + (follows.T @ (M_i @ follows))
                beta[i - 1] = beta[i - 1] + F_i[:6] + mul(G[i].T, Q_0)
        A, u_dot = self._first(), []
        for i in range(self.count):
            u_dot.append(y[i] - mul(G[i], A))
            A = mul(X_p[i], A) + mul(a_p[i], u_dot[i]) + bias[i]
        return self._spanning(joints, np.array(u_dot))

    def _spanning(self, joints: dict[str, int], u_dot: Numbers) -> Numbers:
        """Return the accelerations of the spanning tree from those of the platforms, wrists last."""
        k = self.kind
        a = mul(self.Psi, u_dot[:, None]) + self.drift
        wd_without = self._platform(a, self.v_w * 0)[4]
        full = np.concatenate([u_dot * 0, u_dot * 0], axis=1)[:, :6]
        full[:, k.plane] = u_dot
        legs = move(self.on, k.legs, at_rest(self.on, a.shape[:2]), self.q, self.v, a)
        first = tuple(x[-1][:, :1] for x in (legs.R, legs.p, legs.w, legs.wd, legs.pd, legs.pdd))
        z = move(self.on, k.wrist, first, self.q_w, self.v_w, self.v_w * 0).z
        axes, missing = np.stack([x[:, 0] for x in z], axis=-1), full[:, 3:] - wd_without
        rows = [2] if self.planar else [0, 1, 2]
        a_w = solve(axes[:, rows], missing[:, rows, None])[..., 0]
        out = np.zeros(len(joints), dtype=a.dtype)
        for i in range(self.count):
            out[[joints[name] for name in self.names(k.legs, i)]] = a[i].reshape(-1)
            out[[joints[name] for name in self.names(k.wrist, i)]] = a_w[i]
        return out

    def idm(self, joints: dict[str, int], a: np.ndarray, motors: dict[str, int]) -> Numbers:
        """Return the motor efforts at accelerations of the spanning tree, shape (motors,)."""
        k = self.kind
        a_w, a = self.take(k.wrist, joints, a), self.take(k.legs, joints, a)
        X, J, mass, force = self._bodies(a)
        X_p, a_p, bias = self._along()
        wd, pdd = self._platform(a, a_w)[4:]
        u_dot = np.concatenate([pdd, wd], axis=-1)[:, k.plane]
        inertia, gyro = self._platform_inertia()
        A = [self._first()]
        for i in range(self.count):
            A.append(mul(X_p[i], A[i]) + mul(a_p[i], u_dot[i]) + bias[i])
        W, tau = self.on.array(np.zeros(6)), np.zeros(len(motors), dtype=a.dtype)
        for i in reversed(range(self.count)):
            W = W + mul(inertia[i], A[i + 1]) + gyro[i]
            F = force[i] + mul(mass[i], mul(X[i], A[i]))
            H = mul(turned(J[i]), F).sum(axis=1)
            Q = mul(turned(self.Psi[i]), H).sum(axis=0) + mul(a_p[i].T, W)
            own = [motors[leg[k.motor].replace("m1_", f"m{i + 1}_", 1)] for leg in k.legs.names]
            tau[own] = solve(self.Psi[i, :, k.motor].T, Q[:, None])[:, 0]
            W = mul(X_p[i].T, W) + mul(turned(X[i]), F).sum(axis=(0, 1))
        return tau
