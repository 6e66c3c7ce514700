"""Stacks of 1 to 1,000 modules, spatial and planar, against the same equations in extended precision.

Claims: backward error at most 1e-13 n, and forward error at most 100 eps times the condition number, n the
number of modules (the issue's numbers); and errors grow no faster than linearly with n: the exponent of the
power of n that fits them best, from 1 to 1,000, is at most 1. Under drawn efforts nothing cancels; their
condition number is taken as 1, the least there is, which makes the claim flat in n. Near rest, where efforts
carry the stack and what is left of them moves it, the condition number is measured, by changing the efforts
in the reference; it grows with the cube of n.

Peers get the same state and efforts, and the best that any setting gives them.
"""

from collections.abc import Iterator
from typing import Any

import mpmath
import numpy as np
import pinocchio as pin
import pytest

from benchmarks.reference import LongDouble
from hybridyn import ddm
from tests.hard.claims import BACKWARD, EPS, FORWARD, Claim, apart
from tests.hard.extended_stack import Stack
from tests.hard.stacks import DOWN, PLANAR, SPATIAL, State, drawn, module
from tests.judges.peers import Peer
from tests.oracle import Extended, Oracle
from tests.oracle.arithmetic import Arithmetic
from tests.support.samples import slow

LINEAR = 1.0  # exponent of n
REFERENCE = 1e-30  # of 40 digits, condition numbers of 1e4 leave 35
LONG_DOUBLE = 1e-15  # what the reference may miss in the states where condition numbers are 1e3
CHANGE = 1e-9  # of the efforts: linear to 18 - 9 digits, and known to 9
LUCK = 2.0  # of the peer's best setting among a dozen, where both are at the last digit
DRAWS = 4  # of efforts: of one alone, either has a half or twice its usual error
SIZES = (1, 4, 16, 64, 256)


LONG = LongDouble()
needs_long_double = pytest.mark.skipif(
    LONG.epsilon > 2e-19, reason="long double is no longer than double on this machine"
)


def reference(kind: str, count: int, s: State, on: Arithmetic = LONG, **state: Any) -> Stack:
    """Return the extended model of a stack in a state, or in another one."""
    return Stack(module(kind), count, on, DOWN[kind], s.joints, s.motors, **({"q": s.q, "v": s.v} | state))


def drawn_efforts(seed: int, state: State) -> np.ndarray:
    """Draw efforts that balance nothing."""
    return 100 * np.random.default_rng(seed).normal(size=len(state.motors))


# -------------------------------------------------------------------- the reference itself


@pytest.mark.parametrize(
    ("kind", "count"), [slow(SPATIAL, 1), (PLANAR, 1), slow(PLANAR, 2), slow(SPATIAL, 2)]
)
def test_the_reference_agrees_with_the_oracle(kind: str, count: int, claim: Claim) -> None:
    """Forty digits on both sides, at a state that is closed in all of them."""
    with mpmath.workdps(40):
        s = drawn(kind, count)
        oracle = Oracle(s.robot.description, arithmetic=Extended(mpmath.mp), gravity=DOWN[kind])
        q = oracle.close(s.q)
        v = oracle.project_velocity(q, s.v)
        a = oracle.consistent_acceleration(q, v, s.a)
        stack = reference(kind, count, s, oracle.arithmetic, q=q, v=v)
        moved, efforts = stack.ddm(s.tau), stack.idm(a)
        case = f"{kind}, {count} modules"
        claim(case, "reference against oracle, ddm", apart(moved, oracle.ddm(q, v, s.tau)), REFERENCE)
        claim(case, "reference against oracle, idm", apart(efforts, oracle.idm(q, v, a)), REFERENCE)


@needs_long_double
@pytest.mark.parametrize(("kind", "count"), [slow(SPATIAL, 4), slow(PLANAR, 4), (PLANAR, 2)])
def test_long_double_is_long_enough(kind: str, count: int, claim: Claim) -> None:
    """The same code with forty digits: nothing cancels in one that does not in the other."""
    with mpmath.workdps(40):
        s = drawn(kind, count)
        exact, own = reference(kind, count, s, Extended(mpmath.mp)), reference(kind, count, s)
        for what, tau in (("near rest", s.tau), ("drawn efforts", drawn_efforts(count, s))):
            error = apart(own.ddm(tau), exact.ddm(tau).astype(np.longdouble))
            case = f"{kind}, {count} modules, {what}"
            claim(case, "long double against forty digits, ddm", error, LONG_DOUBLE)


# -------------------------------------------------------------------- growth


def exponent(errors: dict[int, float]) -> float:
    """Return the power of n that fits errors best."""
    n, size = np.log(list(errors)), np.log([max(x, EPS / 8) for x in errors.values()])
    return float(np.polyfit(n, size, 1)[0])


@needs_long_double
@pytest.mark.parametrize(
    ("kind", "sizes"),
    [
        (PLANAR, SIZES[:3]),
        *(slow(kind, sizes) for kind in (SPATIAL, PLANAR) for sizes in (SIZES, (*SIZES, 1000))),
    ],
)
def test_errors_grow_no_faster_than_the_stack(kind: str, sizes: tuple[int, ...], claim: Claim) -> None:
    """Up to a thousand moving modules; of the planar ones' closure rows three in five are redundant."""
    errors: dict[str, dict[int, float]] = {"ddm": {}, "idm": {}}
    for count in sizes:
        s, case = drawn(kind, count), f"{kind}, {count} modules"
        exact, tau = reference(kind, count, s), drawn_efforts(count, s)
        errors["ddm"][count] = apart(ddm(s.robot, s.q, s.v, tau), exact.ddm(tau))
        errors["idm"][count] = apart(s.tau, exact.idm(s.a))
        claim(case, "forward error of ddm, drawn efforts", errors["ddm"][count], FORWARD)
        claim(case, "backward error of idm", errors["idm"][count], BACKWARD * count)
    case = f"{kind}, {sizes[0]} to {sizes[-1]} modules"
    for model, each in errors.items():
        claim(case, f"growth of {model}'s error, power of n", exponent(each), LINEAR)


@needs_long_double
@pytest.mark.parametrize("counts", [(4, 16), slow((64, 1000))], ids=str)
@pytest.mark.parametrize("kind", [SPATIAL, PLANAR])
def test_a_stack_near_rest_loses_what_its_condition_takes(
    kind: str, counts: tuple[int, ...], claim: Claim
) -> None:
    """The condition number reaches 1e6 at 64 modules, 1e10 at a thousand: every method loses these digits."""
    for count in counts:
        s, case = drawn(kind, count), f"{kind}, {count} modules near rest"
        exact, tau = reference(kind, count, s), s.tau
        a, wanted = ddm(s.robot, s.q, s.v, tau), exact.ddm(tau)
        signs = np.random.default_rng(count).choice([-1.0, 1.0], len(tau))
        change = LONG.array(CHANGE * np.abs(tau).max() * signs)
        condition = apart(exact.ddm(LONG.array(tau) + change), wanted) / CHANGE
        claim(
            case, f"forward error of ddm (condition {condition:.0e})", apart(a, wanted), FORWARD * condition
        )
        left = apart(exact.idm(a), tau)
        claim(case, "backward error of ddm, as efforts", left, BACKWARD * count)


# -------------------------------------------------------------------- peers


def lcaba(s: State, tau: np.ndarray) -> Iterator[np.ndarray]:
    """Return what `pin.lcaba` computes, by mu and iterations."""
    peer = Peer(s.robot.description)
    models = peer.constraint_models()
    data = peer.model.createData()
    pin.computeJointMinimalOrdering(peer.model, data, models)
    for mu in (1e-3, 1e-2, 1e-1, 1.0):
        for iterations in (2, 5, 10, 20, 40):
            datas = pin.StdVec_RigidConstraintData()
            for model in models:
                datas.append(model.createData())
            settings = pin.ProximalSettings(1e-15, mu, iterations)
            yield pin.lcaba(peer.model, data, s.q, s.v, peer.efforts(tau), models, datas, settings).copy()


def constraint_dynamics(s: State, tau: np.ndarray) -> Iterator[np.ndarray]:
    """Return what `pin.constraintDynamics` computes, by mu."""
    peer = Peer(s.robot.description)
    for mu in 10.0 ** np.arange(-13, -3):
        yield peer.constraint_dynamics(s.q, s.v, tau, mu)


@needs_long_double
@pytest.mark.parametrize("count", [1, 2, 4, *(pytest.param(n, marks=pytest.mark.slow) for n in (8, 16))])
def test_no_peer_is_closer_at_its_best_setting(count: int, claim: Claim) -> None:
    """6-UPS stacks under drawn efforts: our error over that of Pinocchio's two algorithms, each at its best.

    The largest of some draws counts, on both sides.

    Above 16 modules Pinocchio's Data takes more memory than a machine has; at 16 it takes 2.5 GB.
    """
    s = drawn(SPATIAL, count)
    stack = reference(SPATIAL, count, s)
    draws = [(tau, stack.ddm(tau)) for tau in (drawn_efforts(count + k, s) for k in range(DRAWS))]
    ours = max(apart(ddm(s.robot, s.q, s.v, tau), exact) for tau, exact in draws)
    for name, peer in (("lcaba", lcaba), ("constraintDynamics", constraint_dynamics)):
        theirs = max(min(apart(a, exact) for a in peer(s, tau)) for tau, exact in draws)
        what = f"our error of ddm ({ours:.1e}) over {name}'s best ({theirs:.1e})"
        claim(f"{SPATIAL}, {count} modules", what, ours / theirs, LUCK)
