"""Motions of the community's benchmark mechanisms in few coordinates, derived by hand, and published values.

Each reference is an ordinary differential equation without constraints, integrated by scipy to 1e-12 or
better. None shares anything with hybridyn.
"""

import numpy as np
from scipy.integrate import solve_ivp

Array = np.ndarray
G = 9.81
TIGHT = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-13}


def n_four_bar(n: int, times: Array, theta: float = np.pi / 2, rate: float = -1.0) -> tuple[Array, Array]:
    """Return theta and its rate of the N-four-bar mechanism on its regular motion.

    All uprights lean alike, so the horizontal rods only translate, along the circle of the tops:

        T = ((N + 1) / 3 + N) theta_dot^2 / 2        N + 1 rods about their feet, N rods on the circle
        V = ((N + 1) / 2 + N) g sin(theta)

    and Lagrange's equation is ((N + 1) / 3 + N) theta_ddot = -((N + 1) / 2 + N) g cos(theta), flat or not.
    """
    ratio = ((n + 1) / 2 + n) * G / ((n + 1) / 3 + n)
    x = solve_ivp(
        lambda t, x: [x[1], -ratio * np.cos(x[0])],
        (times[0], times[-1]),
        [theta, rate],
        t_eval=times,
        **TIGHT,
    ).y
    return x[0], x[1]


def all_bars(theta: Array, joints: tuple[str, ...]) -> Array:
    """Give every joint position, or from rates every rate, of the N-four-bar mechanism, shape (..., joints).

    Joints `foot<k>` turn the uprights, from their zero at theta = pi/2; joints `top<k>` turn the rods back.
    """
    sign = np.array([1.0 if name.startswith("foot") else -1.0 for name in joints])
    return np.asarray(theta)[..., None] * sign


def heavy_top(times: Array) -> Array:
    """Return the orientation of the heavy top, shape (T, 3, 3).

    Euler's equations about the fixed point, J w_dot + w x J w = c x R^T m g, with Steiner's 15 m^2 kg on the
    two axes across, and R_dot = R hat(w).
    """
    J = np.diag([0.234375 + 15, 0.46875, 0.234375 + 15])

    def rates(t: float, x: Array) -> Array:
        R, w = x[:9].reshape(3, 3), x[9:]
        hat = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
        weight = np.cross([0, 1, 0], R.T @ [0, 0, -15 * G])
        return np.concatenate([(R @ hat).ravel(), np.linalg.solve(J, weight - np.cross(w, J @ w))])

    start = np.concatenate([np.eye(3).ravel(), [0, 150, -4.61538]])
    return solve_ivp(rates, (0, times[-1]), start, t_eval=times, **TIGHT).y[:9].T.reshape(-1, 3, 3)


def flyball_governor(times: Array) -> Array:
    """Return slider height, shaft rate, rod angle and their rates of the governor, shape (T, 5).

    Coordinates: shaft angle phi, slider height z, angle beta of both rods above the level (they move alike).
    A point at r along a rod is rho(r) = 0.05 + r cos(beta) from the axis and 1 + r sin(beta) high, so

        T = J(beta) phi_dot^2 / 2 + 3 z_dot^2 / 2 + B beta_dot^2
        J = J_shaft + J_slider + 2 (0.3 rho(1/2)^2 + 5 rho(1)^2 + I_t cos^2 beta + I_l sin^2 beta)
        B = I_t + 0.3 / 4 + 5
        V = 3 g z + 2 g (0.3 (1 + sin(beta) / 2) + 5 (1 + sin(beta)))
        L^2 = (cos(beta) / 2)^2 + (1 + sin(beta) / 2 - z)^2    a strut of tension K (L - l0) + C L_dot

    phi is cyclic: J phi_dot = p stays. The rest is Lagrange's equations with the struts' tensions.
    """
    K, C, l0 = 8e5, 4e4, 0.5
    bar, cube = 3000 * 1e-4, 3000 * 1e-3
    I_t, I_l = bar * (1 + 1e-4) / 12, bar * 2e-4 / 12
    J_0 = bar * 2e-4 / 12 + cube * 0.02 / 12
    B = I_t + bar / 4 + 5

    def inertia(b: float) -> tuple[float, float]:
        """Return J and dJ/dbeta."""
        c, s = np.cos(b), np.sin(b)
        half, full = 0.05 + c / 2, 0.05 + c
        J = J_0 + 2 * (bar * half**2 + 5 * full**2 + I_t * c * c + I_l * s * s)
        return J, 2 * (-bar * half * s - 10 * full * s - 2 * (I_t - I_l) * c * s)

    p = inertia(-np.pi / 6)[0] * 2 * np.pi

    def rates(t: float, x: Array) -> Array:
        z, b, z_dot, b_dot = x
        c, s = np.cos(b), np.sin(b)
        J, slope = inertia(b)
        drop = 1 + s / 2 - z
        L = np.sqrt(c * c / 4 + drop * drop)
        L_b, L_z = (-c * s / 4 + drop * c / 2) / L, -drop / L
        tension = K * (L - l0) + C * (L_b * b_dot + L_z * z_dot)
        return np.array(
            [
                z_dot,
                b_dot,
                -G - 2 * tension * L_z / cube,
                (slope * (p / J) ** 2 / 2 - 2 * tension * L_b - G * (bar + 10) * c) / (2 * B),
            ]
        )

    x = solve_ivp(
        rates, (0, times[-1]), [0.5, -np.pi / 6, 0, 0], t_eval=times, method="Radau", rtol=1e-12, atol=1e-14
    ).y.T  # fmt: skip
    rate = np.array([p / inertia(b)[0] for b in x[:, 1]])
    return np.column_stack([x[:, 0], rate, x[:, 1:]])


ANGLES = ("beta", "theta", "gamma", "phi", "delta", "omega", "epsilon")
#: Andrews' mechanism at t = 0.03 s: published reference solution (PSIDE), angles, rates, accelerations.
ANDREWS = np.array(
    [
        [15.81077119629904, -15.75637105984298, 0.04082224013073101, -0.5347301163226948, 0.5244099658805304,
         0.5347301163226948, 1.048080741042263],
        [1139.920302151208, -1424.379294994111, 11.03291221937134, 19.29337464421385, 0.5735699284790808,
         -19.29337464421385, 0.3231791658026955],
        [-24631.76316945196, 51850.37701610329, 324102.5686413781, 566749.3645176213, 16743.62929479361,
         -566749.3645176222, 9826.520791458422],
    ]
)  # fmt: skip
ANDREWS_START = np.array(
    [-0.0617138900142765, 0, 0.455279819163070, 0.222668390165886, 0.487364979543843, -0.222668390165886,
     1.23054744454982]
)  # fmt: skip


def andrews(time: float) -> Array:
    """Return angles, rates and accelerations of Andrews' mechanism, shape (3, 7), in the order of `ANGLES`.

    Lagrange's equations in the seven angles of the statement with multipliers of the three loops,
    differentiated twice: M a + G^T l = f, G a = -G' v. A body that turns about a fixed point at distance r
    has m r^2 + I; bodies 2, 4, 6 hang on another and couple. A loop is a sum of arms r exp(i (n . q + phase))
    in the plane.
    """
    m1, m2, m3, m4, m5, m6, m7 = 0.04325, 0.00365, 0.02373, 0.00706, 0.07050, 0.00706, 0.05498
    I1, I2, I3, I4, I5, I6, I7 = 2.194e-6, 4.41e-7, 5.255e-6, 5.667e-7, 1.169e-5, 5.667e-7, 1.912e-5
    xb, yb, xc, yc, c0, l0 = -0.03635, 0.03273, 0.014, 0.072, 4530, 0.07785
    d, da, e, ea, rr, ra, ss, sa, sb = 0.028, 0.0115, 0.02, 0.01421, 0.007, 9.2e-4, 0.035, 0.01874, 0.01043
    sc, sd, ta, tb, u, ua, ub, zf, zt, fa = (
        0.018, 0.02, 0.02308, 0.00916, 0.04, 0.01228, 0.00449, 0.02, 0.04, 0.01421
    )  # fmt: skip
    unit = np.eye(7)
    beta, theta, gamma, phi, delta, omega, epsilon = unit
    crank = [(rr, beta, 0.0), (-d, beta + theta, 0.0)]
    loops = [
        [*crank, (-ss, gamma, -np.pi / 2)],
        [*crank, (-e, phi + delta, -np.pi / 2), (-zt, delta, 0.0)],
        [*crank, (-zf, omega + epsilon, 0.0), (-u, epsilon, -np.pi / 2)],
    ]
    r4, r6 = e - ea, zf - fa

    def mass(q: Array) -> Array:
        c2, s4, s6 = np.cos(q[1]), np.sin(q[3]), np.sin(q[5])
        M = np.zeros((7, 7))
        M[0, 0] = m1 * ra**2 + m2 * (rr**2 - 2 * da * rr * c2 + da**2) + I1 + I2
        M[0, 1] = M[1, 0] = m2 * (da**2 - da * rr * c2) + I2
        M[1, 1] = m2 * da**2 + I2
        M[2, 2] = m3 * (sa**2 + sb**2) + I3
        M[3, 3] = m4 * r4**2 + I4
        M[3, 4] = M[4, 3] = m4 * (r4**2 + zt * r4 * s4) + I4
        M[4, 4] = m4 * (zt**2 + 2 * zt * r4 * s4 + r4**2) + m5 * (ta**2 + tb**2) + I4 + I5
        M[5, 5] = m6 * r6**2 + I6
        M[5, 6] = M[6, 5] = m6 * (r6**2 - u * r6 * s6) + I6
        M[6, 6] = m6 * (r6**2 - 2 * u * r6 * s6 + u**2) + m7 * (ua**2 + ub**2) + I6 + I7
        return M

    def force(q: Array, v: Array) -> Array:
        s2, c4, c6 = np.sin(q[1]), np.cos(q[3]), np.cos(q[5])
        c3, s3 = np.cos(q[2]), np.sin(q[2])
        x, y = sd * c3 + sc * s3 + xb - xc, sd * s3 - sc * c3 + yb - yc
        length = np.hypot(x, y)
        pull = -c0 * (length - l0) / length
        return np.array(
            [
                0.033 - m2 * da * rr * v[1] * (v[1] + 2 * v[0]) * s2,
                m2 * da * rr * v[0] ** 2 * s2,
                pull * (x * (sc * c3 - sd * s3) + y * (sd * c3 + sc * s3)),
                m4 * zt * r4 * v[4] ** 2 * c4,
                -m4 * zt * r4 * v[3] * (v[3] + 2 * v[4]) * c4,
                -m6 * u * r6 * v[6] ** 2 * c6,
                m6 * u * r6 * v[5] * (v[5] + 2 * v[6]) * c6,
            ]
        )

    def acceleration(q: Array, v: Array) -> Array:
        G, right = np.zeros((6, 7)), np.zeros(6)
        for i, arms in enumerate(loops):
            for r, n, phase in arms:
                along = r * np.array([np.cos(n @ q + phase), np.sin(n @ q + phase)])
                G[2 * i : 2 * i + 2] += np.outer([-along[1], along[0]], n)
                right[2 * i : 2 * i + 2] += along * (n @ v) ** 2
        size = 1e-5  # brings multipliers and masses to one order
        KKT = np.block([[mass(q) / size, G.T], [G, np.zeros((6, 6))]])
        return np.linalg.solve(KKT, np.concatenate([force(q, v) / size, right]))[:7]

    x = solve_ivp(
        lambda t, x: np.concatenate([x[7:], acceleration(x[:7], x[7:])]),
        (0, time), np.concatenate([ANDREWS_START, np.zeros(7)]), **TIGHT,
    ).y[:, -1]  # fmt: skip
    return np.array([x[:7], x[7:], acceleration(x[:7], x[7:])])
