"""The direct model, judged by the oracle, by Pinocchio's `aba` and by the inverse model."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from hybridyn import HybridRobot, ddm, idm
from hybridyn.dynamics.forward import forward
from hybridyn.structure.building import build_robot
from tests.comparing import ROUNDING, close_to
from tests.judging import BACKWARD, BASES, ORACLE, drawn, efforts, judged
from tests.mechanisms import KINDS
from tests.oracle import Base, Oracle
from tests.peers import describe, example_urdf
from tests.samples import slow, some
from tests.shipped import ROBOTS, shipped, states_near_home

FREE = 1e-12  # of the robot's weight: what a floating base may still feel
SEEDS = [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2, 3))]


# -------------------------------------------------------------------- trees, against aba

ARMS = {
    "ur5_robot": "fixed",
    "panda": "fixed",
    "talos_reduced": "floating",
    "allegro_left_hand": "floating",
    "pr2": "fixed",
}


@pytest.mark.parametrize("name", ARMS)
def test_serial_robots_against_aba(name: str) -> None:
    robot = build_robot(describe(example_urdf(f"{name}.urdf")), base=ARMS[name])
    model, data, rng = robot.model, robot.model.createData(), np.random.default_rng(3)
    q = np.array([pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv)) for _ in range(3)])
    v, tau = rng.normal(size=(3, model.nv)), 10 * rng.normal(size=(3, len(robot.motors)))
    spread = np.zeros_like(v)
    spread[:, [model.joints[model.getJointId(motor)].idx_v for motor in robot.motors]] = tau
    actual = ddm(robot, q, v, tau)
    for t in range(3):
        expected = pin.aba(model, data, q[t], v[t], spread[t])
        inertia = np.triu(pin.crba(model, data, q[t]))
        inertia += np.triu(inertia, 1).T
        unit = 1 / np.sqrt(
            np.diagonal(inertia)
        )  # aba's own error follows the condition of the scaled inertia
        condition = np.linalg.cond(inertia * unit * unit[:, None])
        close_to(actual[t] / unit, expected / unit, max(1e-12, 8 * np.finfo(float).eps * condition))
        terms = np.abs(inertia) @ np.abs(actual[t])
        assert np.abs(pin.rnea(model, data, q[t], v[t], actual[t]) - spread[t]).max() < BACKWARD * terms.max()


# -------------------------------------------------------------------- there and back


def driven(robot: HybridRobot, q: np.ndarray, v: np.ndarray, tau: np.ndarray) -> list[np.ndarray]:
    """Return B tau of every module, B = (S_a Psi)^T from the module's own motions."""
    out = []
    for state in forward(robot, q, v, None):
        m = state.mechanism
        Psi = m.basis(m.closures.matrix(state.motion)).Psi
        B = np.swapaxes(Psi[:, state.module.motor_columns], 1, 2)
        out.append(np.einsum("tij,tj->ti", B, tau[:, state.module.motor_index]))
    return out


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("kind", some(KINDS))
def test_efforts_come_back(kind: str, seed: int) -> None:
    description, _, (q, v, _) = drawn(kind, "fixed", seed)
    robot, tau = build_robot(description), efforts(description, 2, seed)
    a, result = ddm(robot, q, v, tau, reactions=True)
    weights = np.ones(len(robot.motors))
    back = idm(robot, q, v, a, weights=weights)
    pairs = zip(robot.modules, driven(robot, q, v, tau), driven(robot, q, v, back), strict=True)
    for module, there, again in pairs:
        carried = np.linalg.norm(result.modules[module.name], axis=1) * max(module.mechanism.length, 1.0)
        largest = np.maximum(np.abs(there).max(axis=1, initial=0.0), carried)
        assert (np.abs(again - there).max(axis=1, initial=0.0) <= BACKWARD * largest).all(), module.name
    if KINDS[kind].motors == "square":
        B = Oracle(description)
        condition = max(np.linalg.cond(B.motor_map(B.posture(x))) for x in q)
        close_to(back, tau, BACKWARD * condition * 10)


@pytest.mark.parametrize("name", [slow(name) if name == "snake" else name for name in ROBOTS])
def test_accelerations_come_back(name: str) -> None:
    robot = build_robot(shipped(name))
    q, v, a = states_near_home(robot.description, "fixed", 4, 1 if name == "snake" else 3)
    close_to(ddm(robot, q, v, idm(robot, q, v, a)), a, ORACLE)


# -------------------------------------------------------------------- motors, bases, reactions


@pytest.mark.parametrize("kind", ["four_bar_two_motors", "five_bar_four_motors", "gough_eight_motors"])
def test_efforts_that_cancel_move_nothing(kind: str) -> None:
    description, _, ((q, _), (v, _), _) = drawn(kind, "fixed")
    robot, oracle = build_robot(description), Oracle(description)
    B = oracle.motor_map(oracle.posture(q))
    idle = np.linalg.svd(B)[2][-1]
    assert np.abs(B @ idle).max() < ROUNDING
    tau = efforts(description, 1)[0]
    close_to(ddm(robot, q, v, tau + 50 * idle), ddm(robot, q, v, tau), ORACLE)


@pytest.mark.parametrize("base", BASES)
def test_robots_without_motors_fall(base: Base) -> None:
    whole, _, (q, v, _) = drawn("five_bar", base)
    description = replace(whole, motors=())
    tau = np.zeros((2, 0))
    actual = ddm(build_robot(description, base=base), q, v, tau)
    close_to(actual, judged(description, base, q, v, tau), ORACLE)


@pytest.mark.parametrize("kind", ["serial", "gough", "branched", "on_leg"])
def test_a_base_moved_as_it_would_float_feels_nothing(kind: str) -> None:
    description, _, (q, v, _) = drawn(kind, "floating")
    floating, moving = (build_robot(description, base=base) for base in ("floating", "moving"))
    tau = efforts(description, 2)
    a, free = ddm(floating, q, v, tau, reactions=True)
    again, held = ddm(moving, q, v, tau, base_acceleration=a[:, :6], reactions=True)
    close_to(again, a, ORACLE)
    weight = 9.81 * sum(link.mass for link in description.links) + np.abs(tau).max()
    assert np.abs(free.base).max() < FREE * weight * 10
    assert np.abs(held.base).max() < FREE * weight * 10


@pytest.mark.parametrize("kind", ["serial", "gough", "stack", "branched", "on_leg", "legged", "gear_across"])
def test_reactions_are_those_of_the_inverse_model(kind: str) -> None:
    description, wrenches, (q, v, _) = drawn(kind, "fixed")
    robot, tau = build_robot(description), efforts(description, 2)
    a, direct = ddm(robot, q, v, tau, wrenches=wrenches, reactions=True)
    inverse = idm(robot, q, v, a, wrenches=wrenches, reactions=True)[1]
    close_to(direct.base, inverse.base, ORACLE)
    assert direct.modules.keys() == inverse.modules.keys()
    assert direct.closures.keys() == inverse.closures.keys()
    scale = max(np.abs(w).max() for w in direct.modules.values())
    for ours, theirs in ((direct.modules, inverse.modules), (direct.closures, inverse.closures)):
        for name, wrench in ours.items():
            assert np.abs(wrench - theirs[name]).max() < ORACLE * scale, name
    oracle = Oracle(description)
    carried = [oracle.support(*s, wrenches=wrenches) for s in zip(q, v, a, strict=True)]
    close_to(direct.base, np.array(carried), ORACLE)
