"""What the oracle's models promise: they undo each other, share by weights, tell what is missing, refuse."""

from __future__ import annotations

from dataclasses import replace

import mpmath
import numpy as np
import pytest

from hybridyn.description.records import Description, Joint, Link
from tests.comparing import SOLVED, close_to, refused
from tests.mechanisms import KINDS, drawn, random_mechanism, random_states, random_wrenches
from tests.oracle import Base, Extended, Float64, Oracle
from tests.samples import in_turn, slow

BASES: tuple[Base, ...] = ("fixed", "moving", "floating")


@pytest.mark.parametrize(("kind", "base"), in_turn([k for k in KINDS if not KINDS[k].massless], BASES))
def test_inverse_and_direct_model_undo_each_other(kind: str, base: Base) -> None:
    description = random_mechanism(1, kind=kind)
    wrenches = random_wrenches(description, 1)
    q, v, a = (x[0] for x in random_states(description, base, 1, 1, wrenches=wrenches))
    oracle = Oracle(description, base)
    tau, missing = oracle.idm_and_missing(q, v, a, wrenches)
    close_to(oracle.ddm(q, v, tau, a[:6] if base == "moving" else None, wrenches), a, SOLVED)
    needed = np.abs(oracle.idm(q, v, a, wrenches={description.root: 100 * np.ones(6)})).max()
    assert np.abs(missing).max() <= SOLVED * max(np.abs(tau).max(), needed)


def test_redundant_motors_share_by_weights() -> None:
    description, q, v, a = drawn("five_bar_four_motors")
    oracle, w = Oracle(description), np.array([1.0, 4.0, 0.25, 9.0])
    tau = oracle.idm(q, v, a, weights=w)
    B = oracle.motor_map(oracle.posture(q))
    needed = B @ oracle.idm(q, v, a)
    close_to(B @ tau, needed, SOLVED)
    close_to(tau, (B.T / w[:, None]) @ np.linalg.solve(B @ (B.T / w[:, None]), needed), SOLVED)


def test_what_no_motor_can_produce_is_told() -> None:
    description, q, v, a = drawn("five_bar_one_motor")
    oracle = Oracle(description)
    pushed = a + oracle.motions(q) @ np.array([1.0, -2.0])
    tau, missing = oracle.idm_and_missing(q, v, pushed)
    full = Oracle(replace(description, motors=tuple(oracle.joint_names)))
    needed = full.idm(q, v, pushed)
    Z = oracle.motions(q)
    produced = np.zeros(oracle.nv)
    produced[oracle.motors] = tau
    close_to(Z.T @ (produced + missing), Z.T[:, full.motors] @ needed, SOLVED)
    assert np.abs(missing).max() > 1e-3 * np.abs(tau).max()


def test_solved_passive_motion_needs_no_effort() -> None:
    description, q, v, a = drawn("five_bar_one_motor")
    oracle, rng = Oracle(description), np.random.default_rng(0)
    wrenches = {description.links[0].name: rng.normal(size=6)}
    asked = a + rng.normal(size=oracle.nv)
    solved = oracle.solve_passive(q, v, asked, wrenches)
    close_to(solved[oracle.motors], asked[oracle.motors], SOLVED)
    tau, missing = oracle.idm_and_missing(q, v, asked, wrenches, passive="solved")
    assert np.abs(missing).max() <= SOLVED * np.abs(tau).max()
    close_to(oracle.ddm(q, v, tau, wrenches=wrenches), solved, SOLVED)


def test_a_forced_motion_without_mass_is_refused_an_unforced_one_rests() -> None:
    base, rod = np.zeros((3, 3)), np.diag([0.0, 1.0, 1.0])
    links = (Link("base", 0.0, np.zeros(3), base), Link("rod", 1.0, np.array([0.3, 0, 0]), rod))
    joints = (Joint("spin", "revolute", "base", "rod", np.eye(4), np.array([1.0, 0, 0])),)
    oracle = Oracle(Description("spin", links, joints, motors=("spin",)))
    assert oracle.ddm([0.1], [0.2], [0.0]) == pytest.approx(0.0)
    refused(lambda: oracle.ddm([0.1], [0.2], [1.0]), ValueError, "without mass is forced")


def test_a_wrench_on_no_link_is_refused() -> None:
    description, q, v, a = drawn("serial")
    refused(lambda: Oracle(description).idm(q, v, a, wrenches={"nobody": np.zeros(6)}), KeyError, "")


@pytest.mark.parametrize(
    ("kind", "base"),
    [
        ("five_bar", "fixed"),
        ("gear_three", "floating"),
        ("planar_rpr", "moving"),
        ("rssr", "floating"),
        slow("sps_thin", "fixed"),
    ],
)
def test_fifty_digits_agree_with_sixteen(kind: str, base: Base) -> None:
    description, q, v, a = drawn(kind, base)
    with mpmath.workdps(50):
        short, long = Oracle(description, base), Oracle(description, base, arithmetic=Extended(mpmath.mp))
        exact = long.close(q)
        v_exact = long.project_velocity(exact, v)
        a_exact = long.consistent_acceleration(exact, v_exact, a)
        tau = long.idm(exact, v_exact, a_exact)
        close_to(short.idm(q, v, a), np.array(tau, float), SOLVED)
        base_acceleration = a_exact[:6] if base == "moving" else None
        again = long.ddm(exact, v_exact, tau, base_acceleration)
        free = np.array(long.massless(exact), float)  # along these an acceleration has no answer
        left = np.array(again - a_exact, float)
        left -= free @ np.linalg.lstsq(free, left, rcond=None)[0]
        assert np.abs(left).max() <= SOLVED * np.abs(a).max()


@pytest.mark.parametrize("shape", [(7, 4), (4, 7), (5, 5)])
@pytest.mark.parametrize("rank", [0, 2, 4])
def test_both_factorisations_are_what_they_say(shape: tuple[int, int], rank: int) -> None:
    rng = np.random.default_rng(rank)
    A = rng.normal(size=(shape[0], rank)) @ rng.normal(size=(rank, shape[1]))
    b = rng.normal(size=shape[0])
    with mpmath.workdps(30):
        for arithmetic in (Float64(), Extended(mpmath.mp)):
            factor = arithmetic.factor(arithmetic.array(A), 1e-9)
            U, inverse, V, Z = (np.array(x, float) for x in factor)
            assert (U.shape[1], Z.shape[1]) == (rank, shape[1] - rank)
            close_to(U.T @ A @ V @ inverse, np.eye(rank), SOLVED)
            close_to(
                np.array(factor.least_norm(arithmetic.array(b)), float), np.linalg.pinv(A, 1e-9) @ b, SOLVED
            )
            assert np.abs(A @ Z).max(initial=0.0) <= SOLVED
            close_to(Z.T @ Z, np.eye(Z.shape[1]), SOLVED)
