"""A serial leg as the paper's appendices A to C have it: classical accelerations, link frames, plain NumPy.

Of the two terms with gamma in (71) only I^c_j gamma_j stands here: with both, as the page reads, every gamma
but the first and the last would count twice.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hybridyn.description.records import Link


def skew(x: np.ndarray) -> np.ndarray:
    return np.array([[0, -x[2], x[1]], [x[2], 0, -x[0]], [-x[1], x[0], 0]])


def screw(R: np.ndarray, L: np.ndarray) -> np.ndarray:
    """Return kT_{k-1} from axes R and origin L of frame k in frame k-1."""
    return np.block([[R.T, -R.T @ skew(L)], [np.zeros((3, 3)), R.T]])  # Eq. (26)


def both(R: np.ndarray) -> np.ndarray:
    """Turn both halves of a screw."""
    return np.block([[R, np.zeros((3, 3))], [np.zeros((3, 3)), R]])


@dataclass(frozen=True)
class Rigid:
    """A rigid body: spatial inertia, first moments and inertia about the origin."""

    mass: float
    MS: np.ndarray
    U: np.ndarray

    @classmethod
    def of(cls, link: Link) -> Rigid:
        """Take a link of a description."""
        c = skew(link.com)
        return cls(link.mass, link.mass * link.com, link.inertia - link.mass * c @ c)

    @property
    def I(self) -> np.ndarray:  # noqa: E743
        """Spatial inertia about the origin, (6, 6)."""
        return np.block([[self.mass * np.eye(3), -skew(self.MS)], [skew(self.MS), self.U]])  # Eq. (13)

    def quadratic(self, w: np.ndarray) -> np.ndarray:
        """Return what of the Newton-Euler equation does not hold accelerations."""
        return np.concatenate([np.cross(w, np.cross(w, self.MS)), np.cross(w, self.U @ w)])  # Eqs. (58), (72)


@dataclass
class Leg:
    """A serial leg: joint j turns about, or slides along, `axes[j]` of its own frame."""

    names: list[str]
    placements: list[np.ndarray]
    axes: list[np.ndarray]
    slides: list[bool]
    links: list[Rigid]
    P: np.ndarray

    @property
    def plane(self) -> np.ndarray:
        """Directions of the tip's velocity that the leg hands on, rows, base axes."""
        root = self.placements[0][:3, :3].T
        return np.eye(3) if len(self.names) == 3 else root[[0, 2]]

    @property
    def b(self) -> list[np.ndarray]:
        """Joint axes, each in its own frame, (6,)."""
        zero = np.zeros(3)
        return [
            np.concatenate([z, zero] if s else [zero, z]) for z, s in zip(self.axes, self.slides, strict=True)
        ]

    def positions(self, tip: np.ndarray) -> np.ndarray:
        """Return the joint positions that bring the tip to a point of the base frame, in closed form."""
        root = self.placements[0]
        x, y, z = root[:3, :3].T @ (tip - root[:3, 3])
        turns = [np.arctan2(x, z)] + [np.arctan2(-y, np.hypot(x, z))] * (len(self.names) == 3)
        return np.array([*turns, np.sqrt(x * x + y * y + z * z) - self.placements[-1][2, 3]])

    def steps(self, q: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return axes and origin of every link's frame in the one before."""
        out = []
        for M, z, slide, x in zip(self.placements, self.axes, self.slides, q, strict=True):
            if slide:
                out.append((M[:3, :3], M[:3, 3] + M[:3, :3] @ z * x))
            else:
                K = skew(z)
                out.append((M[:3, :3] @ (np.eye(3) + np.sin(x) * K + (1 - np.cos(x)) * K @ K), M[:3, 3]))
        return out

    def tip(self, q: np.ndarray, q_dot: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return J_i (8) and J_dot_i q_dot_i (10), base axes, base at rest."""
        R, V, V_dot, columns = np.eye(3), np.zeros(6), np.zeros(6), []
        T = np.eye(6)
        for j in range(len(q)):
            step, V, V_dot = self.link(j, q, q_dot, 0 * q_dot, V, V_dot)
            R, T = R @ self.steps(q)[j][0], step @ T
            columns = [*(step @ column for column in columns), self.b[j]]
        J = R @ np.array(columns).T[:3]
        classical = R @ V_dot[:3]
        return self.plane @ J, self.plane @ classical

    def link(
        self, j: int, q: np.ndarray, q_dot: np.ndarray, q_ddot: np.ndarray, V: np.ndarray, V_dot: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return jT_{j-1}, V_j, V_dot_j."""
        R, L = self.steps(q)[j]
        T = screw(R, L)  # Eq. (54)
        return T, T @ V + q_dot[j] * self.b[j], T @ V_dot + q_ddot[j] * self.b[j] + self.gamma(j, q, q_dot, V)

    def gamma(self, j: int, q: np.ndarray, q_dot: np.ndarray, V: np.ndarray) -> np.ndarray:
        """Return what V_dot_j holds beside the accelerations of link j-1 and of joint j."""
        R, L = self.steps(q)[j]
        w, slide = V[3:], float(self.slides[j])
        turned = np.cross(R.T @ w, q_dot[j] * self.axes[j])
        linear = R.T @ np.cross(w, np.cross(w, L)) + 2 * slide * turned
        return np.concatenate([linear, (1 - slide) * turned])  # Eq. (57)

    def newton_euler(
        self, q: np.ndarray, q_dot: np.ndarray, q_ddot: np.ndarray, V: np.ndarray, V_dot: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return H_i, and the leg's share of F_b in the base frame."""
        F, T = [], []
        for j, body in enumerate(self.links):
            step, V, V_dot = self.link(j, q, q_dot, q_ddot, V, V_dot)  # Eqs. (55), (56)
            F.append(body.I @ V_dot + body.quadratic(V[3:]))  # Eq. (58)
            T.append(step)
        f, H = np.zeros(6), np.zeros(len(q))
        for j in reversed(range(len(q))):
            f = F[j] + f  # Eq. (59)
            H[j] = self.b[j] @ f  # Eq. (61)
            f = T[j].T @ f
        return H, f  # Eqs. (60), (62)

    def direct(self, q: np.ndarray, q_dot: np.ndarray, V: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return A, D, h of (34), and the leg's 1T^T Ic_1 1T, 1T^T G, 1T^T beta^c_1 of (73), base frame."""
        n, zero = len(q), np.zeros(6)
        A = np.array([self.newton_euler(q, 0 * q, e, zero, zero)[0] for e in np.eye(n)]).T
        h = self.newton_euler(q, q_dot, 0 * q, V, zero)[0]
        T, gammas, speeds = [], [], []
        for j in range(n):
            gammas.append(self.gamma(j, q, q_dot, V))
            step, V, _ = self.link(j, q, q_dot, 0 * q, V, zero)
            T.append(step)
            speeds.append(V)
        Ic, beta, D, G = np.zeros((6, 6)), zero, np.zeros((n, 6)), np.zeros((6, n))
        for j in reversed(range(n)):
            Ic = self.links[j].I + Ic  # Eq. (68)
            beta = self.links[j].quadratic(speeds[j][3:]) + beta + Ic @ gammas[j]  # Eqs. (71), (72)
            to_base = np.linalg.multi_dot([*T[j::-1], np.eye(6)])
            D[j] = self.b[j] @ Ic @ to_base  # Eqs. (66), (67)
            G[:, j] = to_base.T @ Ic @ self.b[j]  # Eq. (70), moved to the base
            Ic, beta = T[j].T @ Ic @ T[j], T[j].T @ beta
        return A, D, h, Ic, G, beta
