"""Couplings that curves bend: their numbers against powers, their rows and drift against differences."""

import numpy as np
import pytest

from hybridyn.description.records import Coupling, Curve
from hybridyn.joints.kinds import JointKind
from hybridyn.linkage.couplings import CouplingRows, TreeCoupling
from hybridyn.linkage.joints import TreeJoint
from hybridyn.linkage.tree import Tree
from tests.support.comparing import close_to

ROUNDING = 1e-13  # a few products of doubles
DIFFERENCED = 1e-8  # central differences over STEP
STEP = 1e-5


def random_curve(rng: np.random.Generator, joints: list[int]) -> Curve:
    """Return a curve of one to three joints, of order two to seven."""
    used = rng.permutation(joints)[: rng.integers(1, 4)]
    coefficients = tuple(rng.normal(size=rng.integers(1, 7)))
    return Curve(tuple((int(j), rng.normal()) for j in used), coefficients, rng.normal())


def random_rows(seed: int) -> tuple[CouplingRows, list[TreeCoupling], Tree, np.random.Generator]:
    """Return three couplings of hinges and slides, one of them linear."""
    rng = np.random.default_rng(seed)
    kinds = ("revolute", "prismatic", "revolute", "prismatic", "revolute")
    joints = [
        TreeJoint("", JointKind(k), i, np.eye(3), np.zeros(3), np.eye(3)[i % 3]) for i, k in enumerate(kinds)
    ]
    couplings = []
    for bent in (True, False, True):
        terms = tuple((int(j), rng.normal()) for j in rng.permutation(5)[:2])
        couplings.append(
            TreeCoupling("", terms, rng.normal(), random_curve(rng, [0, 1, 2, 3, 4]) if bent else None)
        )
    tree = Tree(joints)
    return CouplingRows(tree, couplings), couplings, tree, rng


@pytest.mark.parametrize("seed", range(5))
def test_a_curve_is_a_sum_of_powers(seed: int) -> None:
    rng = np.random.default_rng(seed)
    curve, q = random_curve(rng, [0, 1, 2]), rng.normal(size=3)
    s = sum(factor * q[j] for j, factor in curve.terms) - curve.reference
    poly = np.polynomial.Polynomial([0.0, 0.0, *curve.coefficients])
    close_to(np.array(curve.at(curve.argument(q))), np.array([poly.deriv(k)(s) for k in range(3)]), ROUNDING)


@pytest.mark.parametrize("seed", range(5))
def test_rows_and_drift_are_derivatives(seed: int) -> None:
    rows, couplings, tree, rng = random_rows(seed)
    q, v, a = rng.normal(size=(3, 4, tree.nv))
    ahead, behind = (rows.residual(q + h * v + h * h / 2 * a) for h in (STEP, -STEP))
    first, second = rows.rates(q, v, a)
    scale = max(np.abs(first).max(), np.abs(second).max(), 1.0)
    assert np.abs((ahead - behind) / (2 * STEP) - first).max() < DIFFERENCED * scale
    along = [rows.rates(q + h * v + h * h / 2 * a, v + h * a, None)[0] for h in (STEP, -STEP)]
    assert np.abs((along[0] - along[1]) / (2 * STEP) - second).max() < DIFFERENCED * scale
    close_to(np.einsum("tij,tj->ti", rows.matrix(q), v), first, ROUNDING)
    free = np.arange(tree.nv) % 2 == 0
    close_to(rows.moved_by(free).matrix(q), rows.matrix(q) * free, ROUNDING)
    assert not (rows.rates(q, v, a)[1] - np.einsum("tij,tj->ti", rows.matrix(q), a))[:, 1].any()
    assert couplings[1].form == couplings[1].of({j: j for j in range(5)}).form


@pytest.mark.parametrize("seed", range(5))
def test_a_coupling_counts_from_other_zeros(seed: int) -> None:
    rng = np.random.default_rng(seed)
    names = "abcd"
    terms = tuple((names[j], rng.normal()) for j in rng.permutation(4)[:2])
    curve = random_curve(rng, [0, 1, 2, 3]).of(dict(enumerate(names)))
    coupling = Coupling("c", terms, rng.normal(), None, curve)
    shift, at = ({name: rng.normal() for name in names} for _ in range(2))
    whole = {name: at[name] + shift[name] for name in names}
    close_to(coupling.moved(shift).open_by(at), coupling.open_by(whole), 1e-11)
    rates = coupling.rates(whole)
    assert {*rates} == {name for name, _ in (*terms, *curve.terms)}
    for name, rate in rates.items():
        there, here = (coupling.open_by(whole | {name: whole[name] + h}) for h in (STEP, -STEP))
        assert abs((there - here) / (2 * STEP) - rate) < DIFFERENCED * max(
            1.0, abs(coupling.open_by(whole)), abs(rate)
        )
