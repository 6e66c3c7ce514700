"""Gradients in JAX: `check_grads` of first and second order, and known derivatives."""

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridyn
from tests.learning.states import LIGHT, ROUNDING, accelerations, efforts, floating_ankle, near_home
from tests.quantities.ankle import JOINTS, ankle
from tests.support.comparing import close_to, refused
from tests.support.extras import needs
from tests.support.samples import slow

jax = needs("jax")
jnp, check_grads = jax.numpy, needs("jax", "jax.test_util").check_grads


@pytest.fixture(autouse=True)
def double() -> Iterator[None]:
    """Let JAX compute in double precision."""
    with jax.enable_x64(True):
        yield


@pytest.mark.parametrize(
    ("name", "function", "order"),
    [
        ("five_bar", efforts, 2),
        slow("five_bar", accelerations, 2),
        slow("gough_stewart", efforts, 2),
        slow("gough_stewart", accelerations, 2),
        slow("lx4", efforts, 1),
        slow("lx4", accelerations, 1),
    ],
)
def test_gradients_are_those_of_differences(name: str, function: Callable[..., Any], order: int) -> None:
    """Forward and reverse, and each inside the other."""
    robot, motion = near_home(name)
    check_grads(jax.jit(partial(function, hybridyn.jax(robot))), tuple(map(jnp.array, motion)), order)


@pytest.mark.parametrize("modes", [(), slow((jax.jacfwd, jax.jacrev))], ids=["one", "all"])
def test_transforms_of_functions(modes: tuple[Callable[..., Any], ...]) -> None:
    """Forward and reverse mode, in all orders, `vmap` and `jit` give one Hessian; a third one is refused."""
    robot, (position, rate, _) = near_home("five_bar")
    model, p, u = hybridyn.jax(robot), jnp.array(position), jnp.array(rate)

    def power(x: Any) -> Any:
        return efforts(model, x, u) @ u

    second = hybridyn.SecondDerivatives(robot, coordinates="motors")
    known = second.hessian(*hybridyn.assemble(robot, motors=(position, rate, 0 * rate)), rate)[:2, :2]
    both = jnp.stack([p, p + 0.01])
    for outer, inner in ((outer, inner) for outer in modes for inner in modes):
        close_to(outer(inner(power))(p), known, ROUNDING)
        close_to(jax.vmap(inner(power), in_axes=1)(both.T)[1], inner(power)(both[1]), ROUNDING)
    close_to(jax.jit(jax.vmap(jax.hessian(power)))(both)[0], known, ROUNDING)
    many = efforts(model, both[:, None], jnp.zeros((3, 2)), u)
    assert many.shape == (2, 3, 2)
    close_to(many[1, 0], efforts(model, both[1], 0 * u, u), ROUNDING)
    with pytest.raises(NotImplementedError, match="first and second order"):
        jax.jit(jax.jacrev(jax.hessian(power)))(p)


@pytest.mark.slow
def test_gradients_through_a_loop_of_steps() -> None:
    """Under `scan` they are those of the same steps written one after the other."""
    robot, (position, rate, tau) = near_home("five_bar")
    model = hybridyn.jax(robot)
    q, v, _ = model.close(position, rate)

    def scanned(tau: Any) -> Any:
        (q_end, _), _ = jax.lax.scan(lambda at, _: (model.step(*at, tau, 0.01), None), (q, v), length=2)
        return q_end

    def written(tau: Any) -> Any:
        return model.step(*model.step(q, v, tau, 0.01), tau, 0.01)[0]

    close_to(jax.jit(jax.jacrev(scanned))(tau), jax.jacfwd(written)(tau), ROUNDING)


@pytest.mark.slow
def test_an_ankle_on_a_floating_base(tmp_path: Path) -> None:
    """Its pose is a quaternion as it stands: differences leave its length, gradients do not see it."""
    robot, given = floating_ankle(tmp_path)
    model = hybridyn.jax(robot)

    def state(pose: Any, twist: Any, position: Any, rate: Any) -> tuple[Any, Any]:
        q, v, _ = model.close(position, rate)
        return jnp.concatenate([pose, q[7:]]), jnp.concatenate([twist, v[6:]])

    def pushed(*x: Any) -> Any:
        return LIGHT * model.ddm(*state(*x[:4]), x[4])

    def stepped(*x: Any) -> Any:
        return model.step(*state(*x[:4]), x[4], 1e-2)

    for function in (pushed, stepped):
        check_grads(jax.jit(function), tuple(map(jnp.array, given)), 2)


@pytest.mark.slow
def test_gradients_of_the_map_of_an_ankle(tmp_path: Path) -> None:
    robot = ankle(tmp_path)
    sides = hybridyn.jax(robot).joint_map(JOINTS)
    given = tuple(map(jnp.array, ([0.05, -0.02], [0.3, -0.2], [0.1, -0.2])))
    for way in (sides.to_joints, sides.to_motors):
        check_grads(jax.jit(way), given, 2)
    y = jnp.array([0.1, -0.05])
    known = hybridyn.joint_map(robot, dict(zip(JOINTS, np.array(y), strict=True)), JOINTS)
    close_to(jax.hessian(lambda x: sides.to_motors(x)[0])(y), known.curvature, ROUNDING)


def test_wrong_arrays_are_refused_in_one_line() -> None:
    robot, (position, _, _) = near_home("five_bar")
    model, x, home = hybridyn.jax(robot), jnp.array(position), jnp.array(robot.home)
    for call, words in (
        (lambda: model.close(x.astype("float32")), r"position has the type float32; wanted float64"),
        (lambda: model.close(x[:1]), r"position has shape \(1,\); wanted \(..., 2\)"),
        (lambda: model.close(1.0), r"position has shape \(\); wanted"),
        (lambda: model.close("x"), "position is not an array of numbers"),
        (lambda: jax.jacfwd(lambda near: model.close(x, near=near))(home), "near has no gradient, .*stop_"),
        (lambda: model.close(jnp.ones((3, 2)), jnp.ones((2, 2))), "leading axes do not fit each other: shap"),
        (lambda: jax.vmap(model.close)(jnp.stack([x, x * jnp.nan])), "position is not finite at sample 1"),
        (lambda: model.ddm(home + 0.1, 0 * home, x), "close the loops"),
    ):  # fmt: skip
        refused(call, hybridyn.HybridynError, words)
    with pytest.raises(Exception, match="TrajectoryError: position is not finite"):
        jax.jit(model.close)(x * jnp.nan)
    with jax.enable_x64(False):
        for call in (partial(hybridyn.jax, robot), partial(model.close, x)):
            refused(call, hybridyn.HybridynError, r'call jax.config.update\("jax_enable_x64", True\)')


def test_postures_that_carry_no_gradient_may_be_results() -> None:
    """Derivatives of `close` do not see where the search begins."""
    robot, (position, _, _) = near_home("five_bar")
    model = hybridyn.jax(robot)

    def twice(x: Any) -> Any:
        near = jax.lax.stop_gradient(model.close(x)[0])
        return model.close(x, near=near)[0]

    close_to(jax.jacrev(twice)(position), jax.jacrev(lambda x: model.close(x)[0])(position), ROUNDING)


def test_no_samples_are_no_error() -> None:
    model = hybridyn.jax(near_home("five_bar")[0])
    assert jax.grad(lambda x: efforts(model, x).sum())(jnp.zeros((0, 2))).shape == (0, 2)
