"""The model in independent coordinates from the oracle's maximal ones: tau = M u_dot + c + g, v = E u."""

import numpy as np

from tests.oracle import Oracle


def columns_of(oracle: Oracle, joints: tuple[str, ...]) -> list[int]:
    """Return the entries of v that are the independent coordinates: a free base's six, then the joints."""
    base = list(range(6)) if oracle.base == "floating" else []
    return base + [oracle.coordinates[name][2].start for name in joints]


def oracle_map(oracle: Oracle, q: np.ndarray, columns: list[int]) -> np.ndarray:
    """Return dq/du at one posture, shape (nv, N)."""
    Z = oracle.motions(q)
    return Z @ np.linalg.solve(Z[columns], np.eye(len(columns)))


def oracle_mass(oracle: Oracle, q: np.ndarray, columns: list[int]) -> np.ndarray:
    """Return the mass matrix at one posture, shape (N, N)."""
    C = oracle.bodies.inertia_root(oracle.posture(q), oracle_map(oracle, q, columns))
    return np.asarray(C.T @ C)


def oracle_drift(oracle: Oracle, q: np.ndarray, v: np.ndarray, columns: list[int]) -> np.ndarray:
    """Return the accelerations at u_dot = 0, a prescribed base's zero, shape (nv,)."""
    posture = oracle.posture(q)
    k = oracle.tree.drifts(posture, v)[2]
    a = np.asarray(oracle.tree.least_change(posture, -k))
    return a - oracle_map(oracle, q, columns) @ a[columns]


def oracle_bias(oracle: Oracle, q: np.ndarray, v: np.ndarray, columns: list[int]) -> np.ndarray:
    """Return the generalised force along u at u_dot = 0, shape (N,)."""
    posture = oracle.posture(q)
    V, g, _ = oracle.tree.drifts(posture, v)
    a = oracle_drift(oracle, q, v, columns)
    W = oracle.bodies.needed(posture, V, (posture.G @ a).reshape(-1, 6) + g, {})
    return np.asarray(oracle_map(oracle, q, columns).T @ (posture.G.T @ W.reshape(-1)))
