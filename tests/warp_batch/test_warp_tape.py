"""Gradients on a tape of Warp are those of the derivatives in directions forward."""

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn.compiled.equations.states import random_states
from tests.support.comparing import close_to, refused
from tests.support.extras import needs
from tests.support.files import save
from tests.support.samples import slow

wp = needs("gpu")
wp.config.log_level = wp.LOG_WARNING

#: Rounding, and the condition of loops and of the mass matrix.
ROUNDING = 1e-9
INERTIA = (
    '<inertial><origin xyz="0 0.1 0.2"/><mass value="2"/>'
    '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'
)
#: A joint of a cosine and a sine, and one of two lengths beside.
HINGE = (
    '<joint name="hinge" type="continuous"><parent link="l0"/><child link="l1"/><axis xyz="0 1 0"/></joint>'
)
TABLE = '<joint name="table" type="planar"><parent link="l1"/><child link="l2"/><axis xyz="0 0 1"/></joint>'


def in_warp(x: np.ndarray, *, gradient: bool = True) -> Any:
    """Return an array of Warp on the processor."""
    return wp.array(x, dtype=wp.float64, device="cpu", requires_grad=gradient)


@pytest.fixture(scope="module")
def robot() -> hybridyn.HybridRobot:
    """Load a small robot."""
    return hybridyn.load("five_bar")


@wp.kernel
def spread(size: wp.array(dtype=wp.float64), position: wp.array2d(dtype=wp.float64)):
    """Move both motors, one half as far."""
    i = wp.tid()
    position[i, 0] = size[i]
    position[i, 1] = wp.float64(-0.5) * size[i]


@wp.kernel
def squares(tau: wp.array2d(dtype=wp.float64), loss: wp.array(dtype=wp.float64)):
    """Sum the squares of efforts."""
    i, k = wp.tid()
    wp.atomic_add(loss, 0, tau[i, k] * tau[i, k])


@pytest.mark.parametrize("model", ["idm", slow("ddm")])
def test_gradients_of_both_models_are_the_weighted_jacobians(robot: hybridyn.HybridRobot, model: str) -> None:
    """Rates of one row stand for all samples: their gradient is the sum."""
    q, v, a, tau = (x[:1] for x in random_states(robot, 1))
    x, result = (a, tau) if model == "idm" else (tau, a)
    jacobian = hybridyn.idm_jacobian if model == "idm" else hybridyn.ddm_jacobian
    weights = np.random.default_rng(0).normal(size=(3, result.shape[1]))
    given = [in_warp(np.repeat(q, 3, axis=0)), in_warp(v[0]), in_warp(np.repeat(x, 3, axis=0))]
    tape, masses = wp.Tape(), [f"mass:{link.name}" for link in robot.description.links if link.mass]
    batch = hybridyn.warp(robot, parameters=masses, device="cpu")
    with tape:
        found, _ = getattr(batch, model)(*given)
    for times in (1.0, 2.0):  # gradients add up, those of results are used up
        tape.backward(grads={found: in_warp(weights, gradient=False)})
        assert not found.grad.numpy().any()
        slopes = jacobian(robot, q[0], v[0], x[0])
        right = [times * weights @ slopes[name] for name in slopes]
        close_to(given[0].grad.numpy(), right[0], ROUNDING)
        close_to(given[1].grad.numpy(), right[1].sum(axis=0), ROUNDING)
        close_to(given[2].grad.numpy(), right[2], ROUNDING)


def test_gradients_go_through_kernels_before_and_behind(robot: hybridyn.HybridRobot) -> None:
    size, tape = np.array([0.1, 0.2]), wp.Tape()
    batch, way = hybridyn.warp(robot, device="cpu"), np.array([1.0, -0.5])
    given, position = in_warp(size), in_warp(np.zeros((2, 2)))
    rate, loss = in_warp(np.array([0.3, -0.7])), in_warp(np.zeros(1))
    with tape:
        wp.launch(spread, dim=2, inputs=[given, position], device="cpu")
        q, v, a, _ = batch.close(position, rate)
        tau, _ = batch.idm(q, v, a)
        wp.launch(squares, dim=(2, 2), inputs=[tau, loss], device="cpu")
    tape.backward(loss)
    q, v, a = hybridyn.assemble(
        robot, motors=(np.outer(size, way), np.tile(rate.numpy(), (2, 1)), np.zeros((2, 2)))
    )
    slopes, tau = hybridyn.idm_jacobian(robot, q, v, a, coordinates="motors"), hybridyn.idm(robot, q, v, a)
    close_to(given.grad.numpy(), 2.0 * np.einsum("ti,tij,j->t", tau, slopes["q"], way), ROUNDING)
    close_to(rate.grad.numpy(), 2.0 * np.einsum("ti,tij->j", tau, slopes["v"]), ROUNDING)


@pytest.mark.parametrize(("model", "joints"), [("idm", [HINGE]), slow("ddm", [HINGE, TABLE])])
def test_gradients_over_positions_are_over_their_numbers(
    tmp_path: Path, model: str, joints: list[str]
) -> None:
    """Those of a floating base, of cosines and sines: q changes along each freedom, by differences."""
    links = [f'<link name="l{k}">{INERTIA}</link>' for k in range(len(joints) + 1)]
    path = save(tmp_path, f'<robot name="turning">{"".join(links + joints)}</robot>', "turning.urdf")
    robot = hybridyn.load(path, base="floating", motors=["hinge"])
    assert robot.nq == robot.nv + 1 + len(joints)
    rng = np.random.default_rng(0)
    q = pin.integrate(robot.model, robot.home, rng.normal(size=robot.nv))
    v, x = rng.normal(size=robot.nv), rng.normal(size=1)
    x = hybridyn.ddm(robot, q, v, x) if model == "idm" else x
    given, tape = [in_warp(part[None]) for part in (q, v, x)], wp.Tape()
    with tape:
        found, _ = getattr(hybridyn.warp(robot, device="cpu"), model)(*given)
    weights = rng.normal(size=found.shape)
    tape.backward(grads={found: in_warp(weights, gradient=False)})
    h = 1e-5 * np.eye(robot.nv)
    moved = [(pin.integrate(robot.model, q, d) - pin.integrate(robot.model, q, -d)) / 2e-5 for d in h]
    jacobian = hybridyn.idm_jacobian if model == "idm" else hybridyn.ddm_jacobian
    right = weights @ jacobian(robot, q, v, x)["q"]
    close_to(np.array(moved) @ given[0].grad.numpy()[0], right[0], ROUNDING)


def test_calls_without_gradients_leave_no_trace(robot: hybridyn.HybridRobot) -> None:
    q, v, a, _ = (in_warp(x, gradient=False) for x in random_states(robot, 2))
    batch, tape = hybridyn.warp(robot, device="cpu"), wp.Tape()
    with tape:
        found, _ = batch.idm(q, v, a)
    q.requires_grad = True
    outside, _ = batch.idm(q, v, a)
    assert not tape.launches
    assert not found.requires_grad
    assert not outside.requires_grad


def test_what_has_no_gradient_is_refused_in_one_line(robot: hybridyn.HybridRobot) -> None:
    q, v, a, tau = (in_warp(x) for x in random_states(robot, 2))
    batch = hybridyn.warp(robot, device="cpu")
    single = hybridyn.warp(robot, device="cpu", dtype="float32")
    short = wp.array(q.numpy(), dtype=wp.float32, device="cpu", requires_grad=True)
    masses = hybridyn.warp(robot, device="cpu", parameters=[f"mass:{robot.description.links[1].name}"])
    numbers = masses.numbers(masses.parameters.nominal)
    numbers.requires_grad = True
    with wp.Tape():
        for call, words in (
            (lambda: batch.kinematics(q, v, a), "'kinematics' has no gradient on a tape: call it outside"),
            (
                lambda: single.ddm(short, v.numpy(), tau.numpy()),
                "need a batch of dtype='float64', not 'float32'",
            ),
            (
                lambda: masses.idm(q, v, a, parameters=numbers),
                "parameters of 'idm' has no gradient on a tape",
            ),
            (lambda: batch.idm(q.numpy(), v, a), "v requires a gradient, but q is no array of Warp"),
        ):
            refused(call, hybridyn.HybridynError, words)


def test_effects_with_kinks_are_refused_by_name(robot: hybridyn.HybridRobot) -> None:
    drive = robot.motors[0]
    stop = hybridyn.effects.Stop({drive: 10.0}, lower={drive: -1.0}, upper={drive: 1.0})
    batch = hybridyn.warp(robot, effects=["default", stop], device="cpu")
    q, v, a, _ = (in_warp(x) for x in random_states(robot, 2))
    with wp.Tape():
        refused(lambda: batch.idm(q, v, a), hybridyn.ModelError, "the effect 'stop' has no second derivative")
