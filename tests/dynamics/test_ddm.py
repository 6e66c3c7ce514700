"""The direct model, judged by Pinocchio's `aba`, by the oracle and by the inverse model."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from hybridyn import ddm, idm
from hybridyn.structure.building import build_robot
from tests.comparing import close_to
from tests.judging import BACKWARD, BASES, ORACLE, drawn, efforts, judged
from tests.oracle import Base
from tests.peers import describe, example_urdf

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


# -------------------------------------------------------------------- motors, bases, reactions


@pytest.mark.parametrize("base", BASES)
def test_robots_without_motors_fall(base: Base) -> None:
    whole, _, (q, v, _) = drawn("five_bar", base)
    description = replace(whole, motors=())
    tau = np.zeros((2, 0))
    actual = ddm(build_robot(description, base=base), q, v, tau)
    close_to(actual, judged(description, base, q, v, tau), ORACLE)


@pytest.mark.parametrize("kind", ["serial", "gough", "stack", "branched", "on_leg", "legged", "gear_across"])
def test_reactions_are_those_of_the_inverse_model(kind: str) -> None:
    description, wrenches, (q, v, _) = drawn(kind, "fixed")
    robot, tau = build_robot(description), efforts(description, 2)
    a, direct = ddm(robot, q, v, tau, wrenches=wrenches, reactions=True)
    inverse = idm(robot, q, v, a, wrenches=wrenches, reactions=True)[1]
    assert direct.modules.keys() == inverse.modules.keys()
    assert direct.closures.keys() == inverse.closures.keys()
    scale = max(np.abs(w).max() for w in direct.modules.values())
    for ours in ("base", "modules", "closures"):
        close_to(getattr(direct, ours), getattr(inverse, ours), ORACLE, scale)
