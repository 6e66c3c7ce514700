"""The paper's models as printed, in plain NumPy, for stacks of 6-UPS and 3-RPS modules on a fixed base.

Ibrahim & Khalil (2010), with its own conventions: twists and accelerations are *classical* (acceleration of
the origin, not Pinocchio's spatial one), in the axes of R_k; F_e is exerted BY the platform; gravity enters
through the base's acceleration. Legs are square here, J_i^-1 exists: an RPS leg hands on the two components
of its tip's velocity that lie in its plane, and the third gives a row of what a_k has to satisfy. Signs and
stars that print lost are from derivation: (40), (46), (51) hold J_r^-T.
"""

from dataclasses import dataclass, field

import numpy as np

from hybridyn.description import Description
from tests.dynamics.paper_legs import Leg, Rigid, both, screw, skew

HEAVE_ROLL_PITCH = [2, 3, 4]  # v_r of the 3-RPS among the components of v, base axes


@dataclass
class Module:
    """One module of a stack: its legs, its platform, and what a posture and a twist make of it.

    Attributes:
        legs, platform: The bodies.
        R, L: Axes and origin of R_k in R_{k-1}.
        p_dot, w: Twist of the platform relative to its base, axes of R_{k-1}.
    """

    legs: list[Leg]
    platform: Rigid
    R: np.ndarray = field(default_factory=lambda: np.eye(3))
    L: np.ndarray = field(default_factory=lambda: np.zeros(3))
    p_dot: np.ndarray = field(default_factory=lambda: np.zeros(3))
    w: np.ndarray = field(default_factory=lambda: np.zeros(3))

    def update(self, R: np.ndarray, L: np.ndarray, p_dot: np.ndarray, w: np.ndarray) -> None:
        """Take a posture and a twist; everything up to velocities follows."""
        self.R, self.L, self.p_dot, self.w = R, L, p_dot, w
        self.T = screw(R, L)
        turn = both(R.T)  # to the axes of R_k, in which v_k stands
        arms = [R @ leg.P for leg in self.legs]
        points = [np.hstack([np.eye(3), -skew(r)]) for r in arms]
        sweeps = [np.hstack([np.zeros((3, 3)), -skew(np.cross(w, r))]) for r in arms]
        a, a_dot = self._reduced(points, sweeps)
        self.a, self.a_dot = turn @ a, turn @ a_dot
        self.v = turn @ np.concatenate([p_dot, w])
        self.v_r = np.linalg.lstsq(self.a, self.v, rcond=None)[0]  # Eq. (2)
        self.J_v = [leg.plane @ x @ turn.T for leg, x in zip(self.legs, points, strict=True)]
        self.J_v_dot = [leg.plane @ x @ turn.T for leg, x in zip(self.legs, sweeps, strict=True)]
        self.q = [leg.positions(L + r) for leg, r in zip(self.legs, arms, strict=True)]
        self.J_inv, self.q_dot, self.gamma = [], [], []
        for leg, q, J_v, J_v_dot in zip(self.legs, self.q, self.J_v, self.J_v_dot, strict=True):
            J_inv = np.linalg.inv(leg.tip(q, 0 * q)[0])
            q_dot = J_inv @ J_v @ self.v  # Eq. (8)
            self.gamma.append(
                (J_v @ self.a_dot + J_v_dot @ self.a) @ self.v_r - leg.tip(q, q_dot)[1]
            )  # Eq. (36)
            self.J_inv.append(J_inv)
            self.q_dot.append(q_dot)
        slides = [J_inv[-1] @ J_v @ self.a for J_inv, J_v in zip(self.J_inv, self.J_v, strict=True)]
        self.J_r = np.linalg.inv(np.array(slides))  # Eq. (3)
        self.J = self.a @ self.J_r  # Eq. (4)

    def _reduced(self, points: list[np.ndarray], sweeps: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Return a_k and a_dot_k in base axes: constant for six freedoms, else from what the legs forbid."""
        normals = [leg.placements[0][:3, 1] for leg in self.legs if len(leg.names) == 2]
        if not normals:
            return np.eye(6), np.zeros((6, 6))
        C = np.array([n @ x for n, x in zip(normals, points, strict=True)])
        C_dot = np.array([n @ x for n, x in zip(normals, sweeps, strict=True)])
        rest = [i for i in range(6) if i not in HEAVE_ROLL_PITCH]
        a, a_dot = np.zeros((6, 3)), np.zeros((6, 3))
        a[HEAVE_ROLL_PITCH] = np.eye(3)
        a[rest] = -np.linalg.solve(C[:, rest], C[:, HEAVE_ROLL_PITCH])
        a_dot[rest] = -np.linalg.solve(C[:, rest], C_dot @ a)
        return a, a_dot

    def v_dot(self, v_r_dot: np.ndarray) -> np.ndarray:
        """Return the classical acceleration of the platform relative to its base, axes of R_k."""
        return self.a @ v_r_dot + self.a_dot @ self.v_r  # Eq. (6)

    def q_ddot(self, v_r_dot: np.ndarray) -> list[np.ndarray]:
        """Return the legs' joint accelerations."""
        return [
            J_inv @ (J_v @ self.a @ v_r_dot + gamma)
            for J_inv, J_v, gamma in zip(self.J_inv, self.J_v, self.gamma, strict=True)
        ]  # Eqs. (8)-(11)

    def base_moves(self, V_base: np.ndarray) -> None:
        """Take the base's twist, axes of R_{k-1}: V_k and xi_k follow."""
        self.V_base = V_base
        self.V = self.T @ V_base + self.v  # Eq. (25)
        W = V_base[3:]
        linear = np.cross(W, np.cross(W, self.L)) + 2 * np.cross(W, self.p_dot)
        self.xi = both(self.R.T) @ np.concatenate([linear, np.cross(W, self.w)])  # Eq. (29)


class Stack:
    """Modules m1, m2, ... of a description, one on the other.

    Attributes:
        modules: From the base outwards.
        platforms: Names of the platforms' links.
    """

    def __init__(self, description: Description) -> None:
        links = {link.name: link for link in description.links}
        joints = {joint.child: joint for joint in description.joints}
        closures = {closure.name: closure for closure in description.closures}
        self.modules, self.platforms = [], []
        while (platform := f"m{len(self.modules) + 1}_platform") in links:
            name, legs = platform.removesuffix("_platform"), []
            while (rod := f"{name}_leg{len(legs) + 1}_rod") in links:
                chain = [joints[rod]]
                while not chain[0].parent.endswith(("base", "platform")):
                    chain.insert(0, joints[chain[0].parent])
                ball = f"{rod.removesuffix('_rod')}_ball"
                mount = np.linalg.inv(joints[platform].placement)
                P = (closures[ball].frame_a if ball in closures else mount)[:3, 3]
                legs.append(
                    Leg(
                        [j.name for j in chain], [j.placement for j in chain], [j.axis for j in chain],
                        [j.kind == "prismatic" for j in chain], [Rigid.of(links[j.child]) for j in chain], P,
                    )
                )  # fmt: skip
            self.modules.append(Module(legs, Rigid.of(links[platform])))
            self.platforms.append(platform)

    def forward(self) -> None:
        """Run the first recursion's velocities, base at rest."""
        V = np.zeros(6)
        for m in self.modules:
            m.base_moves(V)
            V = m.V

    def inverse(
        self, v_r_dot: list[np.ndarray], V_dot: np.ndarray, F_e: list[np.ndarray]
    ) -> tuple[list[np.ndarray], list[np.ndarray], list[np.ndarray]]:
        """Return Gamma_k, F_k (in R_k) and V_dot_k of every module; V_dot is the base's, less gravity."""
        self.forward()
        F_p, H_b, F_b, V_dots = [], [], [], []
        for m, u_dot in zip(self.modules, v_r_dot, strict=True):
            legs = [
                leg.newton_euler(q, q_dot, q_ddot, m.V_base, V_dot)
                for leg, q, q_dot, q_ddot in zip(m.legs, m.q, m.q_dot, m.q_ddot(u_dot), strict=True)
            ]
            V_dot = m.T @ V_dot + m.v_dot(u_dot) + m.xi  # Eq. (28)
            F_p.append(m.platform.I @ V_dot + m.platform.quadratic(m.V[3:]))  # Eq. (30)
            H_b.append(
                sum(J_v.T @ J_inv.T @ H for J_v, J_inv, (H, _) in zip(m.J_v, m.J_inv, legs, strict=True))
            )  # Eq. (17)
            F_b.append(sum(f for _, f in legs))  # Eq. (60)
            V_dots.append(V_dot)
        Gamma, F, above = [], [], np.zeros(6)
        for k in reversed(range(len(self.modules))):
            m = self.modules[k]
            Gamma.insert(0, m.J.T @ (F_p[k] + above + F_e[k] + H_b[k]))  # Eq. (33)
            to_platform = np.linalg.inv(m.T)
            F.insert(0, F_p[k] + above + F_e[k] + to_platform.T @ F_b[k])  # Eqs. (31), (32)
            above = m.T.T @ F[0]
        return Gamma, F, V_dots

    def direct(
        self, Gamma: list[np.ndarray], V_dot: np.ndarray, F_e: list[np.ndarray], *, repaired: bool = False
    ) -> tuple[list[np.ndarray], list[np.ndarray], list[np.ndarray]]:
        """Return v_r_dot_k, F_k (in R_k) and V_dot_k of every module; `repaired` adds a_dot v_r to xi."""
        self.forward()
        I_star = [m.platform.I for m in self.modules]
        beta_star = [
            F + m.platform.quadratic(m.V[3:]) for F, m in zip(F_e, self.modules, strict=True)
        ]  # Eq. (38)
        kept: list[tuple[np.ndarray, ...]] = []
        for k in reversed(range(len(self.modules))):
            m, I_k, beta_k = self.modules[k], I_star[k], beta_star[k]
            xi = m.xi + m.a_dot @ m.v_r if repaired else m.xi
            down = np.linalg.inv(m.T)  # k-1 T_k
            on_platform, A_t, E, H_t = I_k.copy(), I_k.copy(), np.zeros((6, 6)), I_k @ xi + beta_k
            S1, S2, S3 = np.zeros((6, 6)), np.zeros((6, 6)), np.zeros(6)
            for leg, q, q_dot, J_v, J_inv, gamma in zip(
                m.legs, m.q, m.q_dot, m.J_v, m.J_inv, m.gamma, strict=True
            ):
                A, D, h, Ic, G, beta_c = leg.direct(q, q_dot, m.V_base)  # Eq. (34)
                A_x = J_inv.T @ A @ J_inv  # Eq. (49)
                h_x = J_inv.T @ h  # Eq. (50)
                E += J_v.T @ J_inv.T @ D @ down
                A_t += J_v.T @ A_x @ J_v
                H_t += J_v.T @ (A_x @ gamma + h_x)
                S1 += Ic  # Eq. (75)
                S2 += G @ J_inv @ J_v  # Eq. (76)
                S3 += G @ J_inv @ gamma + beta_c  # Eq. (77)
            E = m.a.T @ (on_platform + E)  # Eqs. (42), (80)
            A_t = m.a.T @ A_t @ m.a  # Eqs. (43), (81)
            H_t = m.a.T @ H_t  # Eqs. (44), (82)
            effort = np.linalg.inv(m.J_r).T @ Gamma[k]
            inverse = np.linalg.inv(A_t)
            across = (I_k + down.T @ S2) @ m.a
            K = I_k + down.T @ S1 @ down - across @ inverse @ E  # Eqs. (45), (85)
            alpha = across @ inverse @ (effort - H_t) + I_k @ xi + beta_k + down.T @ S3  # Eqs. (46), (86)
            kept.insert(0, (E, inverse, effort - H_t, K, alpha, xi))
            if k:
                I_star[k - 1] = I_star[k - 1] + m.T.T @ K @ m.T  # Eqs. (47), (88)
                beta_star[k - 1] = beta_star[k - 1] + m.T.T @ alpha  # Eqs. (48), (89)
        u_dot, F, V_dots = [], [], []
        for m, (E, inverse, known, K, alpha, xi) in zip(self.modules, kept, strict=True):
            u_dot.append(inverse @ (known - E @ m.T @ V_dot))  # Eqs. (40), (51)
            F.append(K @ m.T @ V_dot + alpha)  # Eqs. (41), (52)
            V_dot = m.T @ V_dot + m.a @ u_dot[-1] + xi  # Eq. (53)
            V_dots.append(V_dot)
        self.kept = kept
        return u_dot, F, V_dots
