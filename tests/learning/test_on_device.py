"""Models and gradients by the kernels of Warp: those of compiled models, on the device "cpu"."""

from typing import Any

import numpy as np
import pytest

import hybridyn
from tests.learning.states import FORWARD_MODE, ROUNDING, near_home
from tests.support.comparing import close_to, refused
from tests.support.extras import needs

torch = needs("torch")
wp = needs("gpu")
wp.config.log_level = wp.LOG_WARNING

pytestmark = FORWARD_MODE


def found(model: Any, *motion: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return values, gradients and products of second derivatives of both models, and a step, of samples."""
    position, rate, x = (torch.tensor(part) for part in motion)
    position.requires_grad_()
    out: list[Any] = []
    for result in (
        model.idm(*model.close(position, rate, x)),
        model.ddm(*model.close(position, rate)[:2], x),
    ):
        (slope,) = torch.autograd.grad(result.pow(2).sum(), position, create_graph=True)
        out += [result, slope, torch.autograd.grad((slope * rate).sum(), position)[0]]
    q, v, _ = model.close(position, rate)
    out += model.step(q, v, x, 0.01)
    out.append(torch.func.jacfwd(lambda p: model.idm(*model.close(p, rate[0], x[0])))(position[0]))
    return tuple(x.detach().numpy() for x in out)


@pytest.mark.slow
def test_values_and_derivatives_are_those_of_compiled_models() -> None:
    robot, motion = near_home("five_bar")
    batch = [np.array([x, 0.9 * x, 1.1 * x]) for x in motion]
    close_to(
        found(hybridyn.torch(robot, device="cpu"), *batch), found(hybridyn.torch(robot), *batch), ROUNDING
    )


@pytest.mark.slow
def test_samples_in_doubt_are_those_of_compiled_models() -> None:
    """Where the guard of a kernel is above 1 they decide, and name the sample."""
    robot, (position, rate, _) = near_home("five_bar")
    model, many = hybridyn.torch(robot, device="cpu"), torch.tensor(np.array([position] * 3))
    q, v, _ = model.close(many, torch.tensor(rate))
    apart = q + 0.1 * torch.tensor([[0.0], [0.0], [1.0]])
    for call, words in (
        (lambda: model.close(many * torch.tensor([[1.0], [torch.nan], [1.0]])), "not finite at sample 1"),
        (lambda: model.ddm(apart, v, many), "do not close the loops at sample 2"),
    ):
        refused(call, hybridyn.HybridynError, words)
    assert model.close(many[:0])[0].shape == (0, 4)


def test_wrong_devices_are_refused_in_one_line() -> None:
    robot, (position, _, _) = near_home("five_bar")
    model = hybridyn.torch(robot, device="cpu")
    words = r"position is on the device 'meta', the models on 'cpu': position.to\('cpu'\)"
    refused(lambda: model.close(torch.tensor(position, device="meta")), hybridyn.TrajectoryError, words)
    refused(
        lambda: hybridyn.torch(robot, device="tpu"), hybridyn.ModelError, "there is no device 'tpu': Warp has"
    )
