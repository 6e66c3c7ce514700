"""Rows, drifts and whole turns of joints, closures and couplings, by definition, differences and energy."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from hybridyn.description.records import Closure, Coupling, Description, Joint, Link
from tests.comparing import ROUNDING, close_to, refused
from tests.mechanisms import KINDS, drawn, home_posture, random_mechanism
from tests.oracle import Base, Oracle
from tests.peers import Peer
from tests.samples import in_turn
from tests.sketch import CLOSURES, Sketch

TAYLOR = 1e-9  # fourth-order integration at the steps used, relative to the energy in play
DIFFERENCES = 1e-7  # central differences with a step of 1e-5
LOOPS = [kind for kind, recipe in KINDS.items() if recipe.loops]


@pytest.mark.parametrize("kind", CLOSURES)
def test_closures_hold_what_their_record_says(kind: str) -> None:
    """Move B from a closed placement: something is missed except along what the record leaves free."""
    translations, rotation = CLOSURES[kind]
    rng, pi = np.random.default_rng(0), np.pi
    frames = [pin.exp6(rng.normal(size=6)).homogeneous for _ in range(2)]
    closure = Closure("c", kind, "base", frames[0], "body", frames[1], translations, rotation)
    links = tuple(Link(name, 1.0, np.zeros(3), np.eye(3)) for name in ("base", "body"))
    joint = Joint("j", "floating", "base", "body", np.eye(4), np.array([0.0, 0.0, 1.0]))
    oracle = Oracle(Description("two", links, (joint,), (closure,)))

    def missed(A_to_B: pin.SE3) -> float:
        body = pin.SE3(frames[0]) * A_to_B * pin.SE3(frames[1]).inverse()
        return float(np.abs(oracle.residual(pin.SE3ToXYZQUAT(body))).max(initial=0.0))

    z = np.array([0.0, 0.0, 1.0])
    start = {
        "free": pin.exp3(rng.normal(size=3)),
        "perpendicular": pin.exp3(0.7 * z) @ pin.exp3(np.array([pi / 2, 0, 0])) @ pin.exp3(0.4 * z),
        "parallel": pin.exp3(0.7 * z),
        "fixed": np.eye(3),
    }[rotation]
    z_B = start @ z
    turns = {
        "free": (list(np.eye(3)), []),
        "perpendicular": ([z, z_B], [np.cross(z, z_B)]),
        "parallel": ([z], [np.array([1.0, 0, 0]), np.array([0, 1.0, 0])]),
        "fixed": ([], list(np.eye(3))),
    }[rotation]
    at = np.array([0.0 if i in translations else 0.3 * i + 0.1 for i in range(3)])
    assert missed(pin.SE3(start, at)) <= ROUNDING
    for i in range(3):
        moved = missed(pin.SE3(start, at + 0.2 * np.eye(3)[i]))
        assert moved == pytest.approx(0.2) if i in translations else moved <= ROUNDING
    for free, axes in zip((True, False), turns, strict=True):
        for axis in axes:
            moved = missed(pin.SE3(pin.exp3(0.3 * axis) @ start, at))
            assert moved <= ROUNDING if free else moved == pytest.approx(np.sin(0.3))


@pytest.mark.parametrize(("kind", "base"), in_turn(LOOPS, ["fixed", "floating"]))
def test_rows_and_drift_are_derivatives_of_the_residual(kind: str, base: Base) -> None:
    description, q, v, _ = drawn(kind, base)
    oracle, rng, h = Oracle(description, base), np.random.default_rng(2), 1e-5
    v, a = (
        rng.normal(size=oracle.nv),
        rng.normal(size=oracle.nv),
    )  # any motion: rows hold off the closures too
    rows, drift = oracle.rows(q), oracle.tree.drifts(oracle.posture(q), v)[2]
    ahead, behind = (oracle.integrate(q, s * h * v + h * h / 2 * a) for s in (1, -1))
    count = len(rows)
    close_to(
        (oracle.residual(ahead)[:count] - oracle.residual(behind)[:count]) / (2 * h), rows @ v, DIFFERENCES
    )
    change = oracle.rows(ahead) @ (v + h * a) - oracle.rows(behind) @ (v - h * a)
    close_to(change / (2 * h), rows @ a + drift, DIFFERENCES)


@pytest.mark.parametrize(("kind", "base"), in_turn(LOOPS, ["fixed", "floating"]))
def test_the_motors_power_is_the_rate_of_energy(kind: str, base: Base) -> None:
    description, q, v, _ = drawn(kind, base)
    oracle, peer, h = Oracle(description, base), Peer(description, base), 1e-5
    tau = 5 * np.random.default_rng(4).normal(size=len(oracle.motors))
    a = oracle.ddm(q, v, tau)
    ahead, behind = (
        peer.energy(pin.integrate(peer.model, q, s * h * v + h * h / 2 * a), v + s * h * a) for s in (1, -1)
    )
    power = tau * v[oracle.motors]
    assert abs((ahead - behind) / (2 * h) - power.sum()) <= DIFFERENCES * max(abs(ahead), np.abs(power).max())


@pytest.mark.parametrize(
    "kind", ["five_bar", "loop_cylindrical", "loop_universal", "delta_bars", "gear_across"]
)
def test_a_free_motion_keeps_its_energy_and_its_loops(kind: str) -> None:
    """Integrate with RK4 under steady efforts: energy changes by the work, closures stay closed."""
    description, q, v, _ = drawn(kind)
    oracle, peer = Oracle(description), Peer(description)
    tau, h, work = np.random.default_rng(4).normal(size=len(oracle.motors)), 1e-3, 0.0
    start = peer.energy(q, v)
    for _ in range(10):
        rates: list[tuple[np.ndarray, np.ndarray]] = []
        for weight in (0.0, 0.5, 0.5, 1.0):
            v_at = v + weight * h * rates[-1][1] if rates else v
            q_at = pin.integrate(peer.model, q, weight * h * rates[-1][0]) if rates else q
            rates.append((v_at, oracle.ddm(q_at, v_at, tau)))
        mean = [(a + 2 * b + 2 * c + d) / 6 for a, b, c, d in zip(*rates, strict=True)]
        work += h * tau @ mean[0][oracle.motors]
        q, v = pin.integrate(peer.model, q, h * mean[0]), v + h * mean[1]
    assert abs(work) > 1e3 * TAYLOR
    assert abs(peer.energy(q, v) - start - work) <= TAYLOR * abs(start)
    assert np.abs(oracle.residual(q)).max() <= TAYLOR
    assert np.abs(oracle.rows(q) @ v).max() <= 100 * TAYLOR


def test_redundant_rows_are_found() -> None:
    description = random_mechanism(0, kind="four_bar")
    oracle = Oracle(description)
    rows = oracle.rows(home_posture(description, "fixed"))
    assert (len(rows), oracle.nv - oracle.motions(home_posture(description, "fixed")).shape[1]) == (5, 2)


def test_loops_out_of_reach_and_turned_axes_are_no_closure() -> None:
    description, q, _, _ = drawn("four_bar")
    closure, far = description.closures[0], np.eye(4)
    far[0, 3] = 5.0
    unreachable = replace(description, closures=(replace(closure, frame_b=closure.frame_b @ far),))
    refused(lambda: Oracle(unreachable).close(q), ValueError, "do not close")
    back = closure.frame_b @ np.diag([1.0, -1.0, -1.0, 1.0])
    turned = replace(description, closures=(replace(closure, frame_b=back),))
    assert np.abs(Oracle(description).residual(q)).max() <= ROUNDING
    assert Oracle(turned).residual(q).min() == pytest.approx(-1.0)
    refused(lambda: Oracle(turned).close(q), ValueError, "do not close")


# -------------------- whole turns


WOUND = 1e2 * ROUNDING  # angles of many turns lose digits


def geared(*ratios: float) -> Oracle:
    """Return the oracle of wheels on one shaft, coupled by ratios."""
    links = [Link("base", 0.0, np.zeros(3), np.zeros((3, 3)))]
    links += [Link(f"w{i}", 1.0, np.zeros(3), np.eye(3)) for i in range(len(ratios))]
    joints = [
        Joint(f"j{i}", "continuous", "base", f"w{i}", np.eye(4), np.array([0.0, 0.0, 1.0]))
        for i in range(len(ratios))
    ]
    terms = tuple((f"j{i}", ratio) for i, ratio in enumerate(ratios))
    return Oracle(Description("geared", tuple(links), tuple(joints), (), (Coupling("gear", terms, 0.3),)))


@pytest.mark.parametrize("ratios", [(1.0, 3.14), (0.558, 1.0), (2.0, 3.0), (1.0, 2.37, -0.4), (2.0,)])
def test_a_wound_posture_is_closed(ratios: tuple[float, ...]) -> None:
    rng = np.random.default_rng(1)
    oracle = geared(*ratios)
    for _ in range(10):
        angles = 20.0 * rng.uniform(-1.0, 1.0, len(ratios))
        angles[0] = (0.3 - np.dot(ratios[1:], angles[1:])) / ratios[0]
        assert abs(oracle.residual(angles)[0]) <= WOUND


def test_no_posture_on_another_turn_is_closed() -> None:
    oracle = geared(1.0, 3.14)
    for turns in range(-60, 61):
        q = np.array([0.3 + 0.06 + 2 * np.pi * turns, 0.0])
        assert abs(oracle.residual(q)[0] - 0.06 - 2 * np.pi * turns) <= WOUND


def test_bearings_that_hold_nothing_more_leave_every_motion() -> None:
    """Rows that are zero to rounding are dependent, though none is larger."""
    sketch = Sketch(np.random.default_rng(0))
    axis = sketch.direction()
    sliding = sketch.joint("prismatic", "base", np.zeros(3), axis)
    sketch.close("prismatic", "base", sliding, axis, axis)
    oracle = Oracle(sketch.description("drawer"))
    q = np.array(sketch.home[sliding.removesuffix("_link")])
    assert 0 < np.abs(oracle.rows(q)).max() < ROUNDING
    assert oracle.motions(q).shape == (1, 1)
