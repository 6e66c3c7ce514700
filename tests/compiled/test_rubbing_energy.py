"""What frictions change, of two modules one on the other, is within the bound by energies, and near it."""

import numpy as np

from hybridyn.compiled.equations.factors import Definite
from hybridyn.compiled.equations.rubbing_energy import bias_within, measured, motion_within, taken_within

EPS = float(np.finfo(float).eps)
JOINTS, MOTIONS, ROWS = 2, 2, 3
ROUNDED = 1e-9  # of the bound; inertias of the draws have conditions below a million
REACHED = 0.4  # the part of the bound that the best of the draws reach at least: no term is much too large


def plain(x: np.ndarray) -> np.ndarray:
    return np.asarray(x, dtype=float).astype(object)


def inertia(rng: np.random.Generator, n: int) -> np.ndarray:
    root = rng.normal(size=(n, n)) * np.exp(rng.normal(size=n))
    return root @ root.T + 0.01 * np.eye(n)


def sizes_of(answers: dict[str, np.ndarray], base: np.ndarray | None, outputs: list[np.ndarray]) -> dict:
    """Return the sizes of answers in numbers, without rows that nothing feels."""
    A = answers.pop("A")
    factors, _ = Definite.of(plain(A))
    told = {name: plain(x) for name, x in answers.items()} | {
        "lower": factors.lower,
        "inverses": factors.inverses,
    }
    sizes, guard = measured(told, None if base is None else plain(base), [*map(plain, outputs)], EPS)
    assert float(guard) <= 1
    return sizes.again("sizes")[1]


def bound_and_truth(seed: int, rubs: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Return the bound of what the law takes of both modules, and that of the dense equations.

    Args:
        rubs: Size of the frictions in the lower and in the upper module.
    """
    rng = np.random.default_rng(seed)
    n = [plain(size * rng.uniform(size=JOINTS)) for size in rubs]
    a, M = rng.normal(size=(6, MOTIONS)), [inertia(rng, MOTIONS), inertia(rng, 6 + MOTIONS)]
    own, (Q_0, Q_1) = inertia(rng, 6), rng.normal(size=(2, MOTIONS, JOINTS))
    push, takes = rng.normal(size=(6, JOINTS)), rng.normal(size=(ROWS, 6 + MOTIONS))
    lower, of_bias = rng.normal(size=(ROWS, MOTIONS)), rng.normal(size=(ROWS, 6))
    E, A = M[1][6:, :6], M[1][6:, 6:]
    G = np.linalg.solve(A, E)
    star = own + M[1][:6, :6] - E.T @ G
    inward = push + G.T @ Q_1

    J = np.block([[a, np.zeros((6, MOTIONS))], [np.zeros((MOTIONS, MOTIONS)), np.eye(MOTIONS)]])
    K = J.T @ M[1] @ J
    K[:MOTIONS, :MOTIONS] += M[0] + a.T @ own @ a
    numbers = [x.astype(float) for x in n]
    x = np.linalg.solve(K, np.concatenate([Q_0 @ numbers[0] - a.T @ (push @ numbers[1]), Q_1 @ numbers[1]]))
    truth = [lower @ x[:MOTIONS] + of_bias @ inward @ numbers[1], takes @ J @ x]

    none, nothing = np.zeros(0, dtype=object), np.zeros((ROWS, JOINTS))
    below = {"A": M[0] + a.T @ star @ a, "of_u": lower, "of_z": np.c_[of_bias, nothing], "forced": Q_0}
    above = {
        "A": A, "of_u": takes[:, 6:], "of_z": nothing, "forced": Q_1, "inward": inward,
        "of_base": takes[:, :6] - takes[:, 6:] @ G,
    }  # fmt: skip
    below, above = sizes_of(below, None, [star]), sizes_of(above, star, [])
    bias = np.array([bias_within(above, none, n[1])], dtype=object)
    moved, w = motion_within(below, 0.0, bias, n[0])
    _, beyond = motion_within(above, moved, none, n[1])
    bound = [
        taken_within(below, plain(nothing), (0.0, w), bias, n[0]),
        taken_within(above, plain(nothing), (moved, beyond), none, n[1]),
    ]
    return np.concatenate(bound).astype(float), np.abs(np.concatenate(truth))


def test_what_frictions_change_is_within_the_bound() -> None:
    """Of the lower module, of the upper one, and of both."""
    for rubs in ((1.0, 0.0), (0.0, 1.0), (1.0, 1.0)):
        parts = []
        for seed in range(50):
            bound, truth = bound_and_truth(seed, rubs)
            assert (truth <= (1 + ROUNDED) * bound).all()
            parts.append(truth / bound)
        assert (np.max(parts, axis=0) > REACHED).all()
