"""Gradients in PyTorch: `gradcheck` and `gradgradcheck` in double precision, and known derivatives."""

from collections.abc import Callable
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn.learning.charts import Charts
from hybridyn.structure.building import build_robot
from tests.learning.states import (
    FORWARD_MODE,
    LIGHT,
    ROUNDING,
    accelerations,
    efforts,
    floating_ankle,
    near_home,
)
from tests.quantities.ankle import JOINTS, ankle
from tests.robots.effect_cases import CASES
from tests.robots.shipped import shipped
from tests.support.comparing import close_to, refused
from tests.support.extras import needs
from tests.support.samples import slow

torch = needs("torch")
pytestmark = FORWARD_MODE
gradcheck, gradgradcheck = torch.autograd.gradcheck, torch.autograd.gradgradcheck


def asked(*given: np.ndarray) -> list[Any]:
    """Return tensors whose gradients are wanted."""
    return [torch.tensor(x, dtype=torch.float64, requires_grad=True) for x in given]


@pytest.mark.parametrize(
    ("name", "function", "twice"),
    [
        ("five_bar", efforts, True),
        slow("five_bar", accelerations, True),
        slow("gough_stewart", efforts, True),
        slow("gough_stewart", accelerations, True),
        slow("lx4", efforts, False),
        slow("lx4", accelerations, False),
    ],
)
def test_gradients_are_those_of_differences(name: str, function: Callable[..., Any], twice: bool) -> None:
    robot, motion = near_home(name)
    of = partial(function, hybridyn.torch(robot))
    assert gradcheck(of, asked(*motion))
    assert not twice or gradgradcheck(of, asked(*motion))


def test_gradients_are_those_of_other_programs() -> None:
    """The Jacobians over motors, and with a batch and leading axes that are broadcast."""
    robot, motion = near_home("five_bar")
    model, given = hybridyn.torch(robot), asked(*motion)
    J = torch.autograd.functional.jacobian(partial(efforts, model), tuple(given))
    known = hybridyn.idm_jacobian(
        robot, *hybridyn.assemble(robot, motors=tuple(motion)), coordinates="motors"
    )
    close_to([x.numpy() for x in J], [known[name] for name in "qva"], ROUNDING)
    position = torch.stack([given[0], given[0] + 0.01]).detach()
    many = efforts(model, position[:, None], torch.zeros(3, 2, dtype=torch.float64), given[2])
    assert many.shape == (2, 3, 2)
    close_to(
        many[0, 1].detach().numpy(),
        efforts(model, given[0], 0 * given[1], given[2]).detach().numpy(),
        ROUNDING,
    )


def test_transforms_of_functions() -> None:
    """Forward mode, reverse mode and `vmap`, one inside the other, give one Hessian."""
    robot, (position, rate, _) = near_home("five_bar")
    model, by = hybridyn.torch(robot), torch.func
    p, u = (torch.tensor(x) for x in (position, rate))

    def power(x: Any) -> Any:
        return efforts(model, x, u) @ u

    modes = product((by.jacfwd, by.jacrev), repeat=2)
    *others, H = (outer(inner(power))(p) for outer, inner in modes)
    second = hybridyn.SecondDerivatives(robot, coordinates="motors")
    known = second.hessian(*hybridyn.assemble(robot, motors=(position, rate, 0 * rate)), rate)[:2, :2]
    close_to(H.numpy(), known, ROUNDING)
    close_to([x.numpy() for x in others], [known] * 3, ROUNDING)
    both = torch.stack([p, p + 0.01])
    close_to(by.vmap(by.hessian(power))(both)[0].numpy(), known, ROUNDING)
    close_to(by.vmap(by.grad(power))(both)[1].numpy(), by.jacfwd(power)(both[1]).numpy(), ROUNDING)
    with pytest.raises(NotImplementedError, match="first and second order"):
        by.jacrev(by.jacrev(by.jacrev(power)))(p)


@pytest.mark.slow
def test_an_ankle_on_a_floating_base(tmp_path: Path) -> None:
    """Its pose is a quaternion as it stands: differences leave its length, gradients do not see it."""
    robot, given = floating_ankle(tmp_path)
    model = hybridyn.torch(robot)

    def state(pose: Any, twist: Any, position: Any, rate: Any) -> tuple[Any, Any]:
        q, v, _ = model.close(position, rate)
        return torch.cat([pose, q[7:]]), torch.cat([twist, v[6:]])

    def pushed(*x: Any) -> Any:
        return LIGHT * model.ddm(*state(*x[:4]), x[4])

    def stepped(*x: Any) -> Any:
        return model.step(*state(*x[:4]), x[4], 1e-2)

    for function in (pushed, stepped):
        assert gradcheck(function, asked(*given))
        assert gradgradcheck(function, asked(*given))


def test_steps_are_of_order_four() -> None:
    """Against fine steps of `hybridyn.simulate`; half the length has a thirty-second of the error."""
    robot, (position, rate, tau) = near_home("five_bar")
    model, (q, v, _) = hybridyn.torch(robot), hybridyn.assemble(robot, motors=(position, rate, 0 * rate))
    off = []
    for h in (0.04, 0.02):
        run = hybridyn.simulate(robot, q, v, [0.0, h], effort=tau, rtol=1e-12, atol=1e-13)
        q_end, v_end = (x.numpy() for x in model.step(q, v, tau, h))
        off.append(np.abs(np.concatenate([q_end - run.q[-1], v_end - run.v[-1]])).max())
    assert 20 < off[0] / off[1] < 50


def test_the_map_of_an_ankle(tmp_path: Path) -> None:
    """Derivatives are those of `hybridyn.joint_map`; there and back is where it began."""
    robot = ankle(tmp_path)
    sides, y = hybridyn.torch(robot).joint_map(JOINTS), torch.tensor([0.1, -0.05], dtype=torch.float64)
    known = hybridyn.joint_map(robot, dict(zip(JOINTS, y.numpy(), strict=True)), JOINTS)
    move, e = lambda x: sides.to_motors(x)[0], torch.tensor([3.0, -2.0], dtype=torch.float64)
    close_to(torch.func.jacrev(move)(y).numpy(), known.motors_per_joints, ROUNDING)
    motors = sides.to_motors(y, 0.1 * e, e)
    back = sides.to_joints(*motors)
    close_to([x.numpy() for x in back], [x.numpy() for x in (y, 0.1 * e, e)], ROUNDING)
    close_to((motors[1] @ motors[2]).item(), 0.1 * (e @ e).item(), ROUNDING)
    near, moved = torch.tensor(robot.home), torch.func.jacfwd(lambda near: sides.to_motors(y, near=near)[0])
    refused(lambda: moved(near), hybridyn.TrajectoryError, "near has no gradient, but requires one")


@pytest.mark.slow
def test_gradients_of_the_map_of_an_ankle(tmp_path: Path) -> None:
    sides = hybridyn.torch(ankle(tmp_path)).joint_map(JOINTS)
    given = [np.array(x) for x in ([0.05, -0.02], [0.3, -0.2], [0.1, -0.2])]
    for way in (sides.to_joints, sides.to_motors):
        assert gradcheck(way, asked(*given))
        assert gradgradcheck(way, asked(*given))
    y = torch.tensor([0.1, -0.05], dtype=torch.float64)
    H = torch.func.hessian(lambda x: sides.to_motors(x)[0])(y)
    known = hybridyn.joint_map(sides._robot, dict(zip(JOINTS, y.numpy(), strict=True)), JOINTS)
    close_to(H.numpy(), known.curvature, ROUNDING)


LINK = (
    '<link name="{0}"><inertial><mass value="1"/><origin xyz="0.1 0.2 0.3"/>'
    '<inertia ixx="1" iyy="2" izz="2.5" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    '<joint name="{1}" type="{1}"><parent link="{2}"/><child link="{0}"/><axis xyz="0 0 1"/>'
    '<limit effort="1" velocity="1" lower="-3" upper="3"/></joint>'
)


def test_displacements_and_rates_are_those_of_joints_of_all_kinds(tmp_path: Path) -> None:
    """Pinocchio moves a posture by a displacement, which is found again to second order; so is its rate."""
    kinds, links = ("floating", "planar", "continuous", "revolute", "spherical"), "abcde"
    chain = "".join(LINK.format(*each) for each in zip(links, kinds, ("base", *links), strict=False))
    (tmp_path / "all.urdf").write_text(f'<robot name="all"><link name="base"/>{chain}</robot>')
    robot = hybridyn.load(str(tmp_path / "all.urdf"), motors=[])
    charts, model = Charts(robot, torch, torch.tensor), robot.model
    random = np.random.default_rng(1)
    q, v = pin.integrate(model, robot.home, random.normal(size=robot.nv)), random.normal(size=robot.nv)
    off = []
    for size in (1e-2, 5e-3):
        moved = torch.tensor(pin.integrate(model, q, size * v))
        off.append(np.abs(charts.displacement(torch.tensor(q), moved).numpy() - size * v).max())
    assert 7.5 < off[0] / off[1] < 8.5  # of third order
    rate = (pin.integrate(model, q, 1e-5 * v) - pin.integrate(model, q, -1e-5 * v)) / 2e-5
    close_to(charts.rate(torch.tensor(q), torch.tensor(v)).numpy(), rate, 1e-9)
    stretched = q.copy()
    stretched[3:7] *= 2.0
    close_to(charts.normalized(torch.tensor(stretched)).numpy(), q, ROUNDING)


def test_wrong_tensors_are_refused_in_one_line() -> None:
    robot, (position, _, _) = near_home("five_bar")
    model, x = hybridyn.torch(robot), torch.tensor(position)
    home, jacfwd = torch.tensor(robot.home), torch.func.jacfwd
    for call, words in (
        (lambda: model.close(x.float()), r"position has the type torch.float32; wanted torch.float64"),
        (lambda: model.close(x[:1]), r"position has shape \(1,\); wanted \(..., 2\)"),
        (lambda: model.close(torch.tensor(1.0).double()), r"position has shape \(\); wanted"),
        (lambda: model.close(x.to("meta")), r"position is on the device 'meta', .*: position.to\('cpu'"),
        (lambda: model.close(x, near=home.clone().requires_grad_()), "near has no gradient, but requires"),
        (lambda: jacfwd(lambda near: model.close(x, near=near))(home), "near has no gradient, but requires"),
        (lambda: model.close(x.expand(3, 2), x.expand(2, 2)), "leading axes do not fit each other: shapes"),
        (lambda: model.close(x * torch.nan), "is not finite"),
        (lambda: model.close(torch.stack([x, x * torch.nan])), "position is not finite at sample 1"),
        (lambda: model.idm(home, home, home + torch.nan), "a is not finite"),
        (lambda: model.ddm(home + 0.1, 0 * home, x), "close the loops"),
    ):  # fmt: skip
        refused(call, hybridyn.HybridynError, words)


def test_effects_with_kinks_are_refused_by_name() -> None:
    robot = build_robot(shipped("five_bar"))
    for effects, name in ((["default", "limits"], "limits"), (CASES["stop"](robot), "stop")):
        refused(partial(hybridyn.torch, robot, effects), hybridyn.ModelError, f"'{name}' has no second deriv")


def test_results_without_a_gradient_leave_none() -> None:
    class Cut(torch.autograd.Function):  # type: ignore[misc]
        """Numbers on which nothing depends, as it says."""

        @staticmethod
        def forward(ctx: Any, x: Any) -> Any:
            """Return them."""
            return x.clone()

        @staticmethod
        def backward(ctx: Any, w: Any) -> None:
            """Return no gradient."""

    robot, (position, _, _) = near_home("five_bar")
    (x,) = asked(position)
    q = hybridyn.torch(robot).close(x)[0]
    assert torch.autograd.grad(Cut.apply(q).sum(), x, allow_unused=True) == (None,)


def test_no_samples_are_no_error() -> None:
    robot, _ = near_home("five_bar")
    none = torch.zeros(0, 2, dtype=torch.float64, requires_grad=True)
    tau = efforts(hybridyn.torch(robot), none)
    assert torch.autograd.grad(tau.sum(), none)[0].shape == (0, 2)
