"""Models as CasADi functions: values, two orders of derivatives, and IPOPT with exact Hessians."""

import logging
from functools import partial

import casadi as ca
import numpy as np
import pytest

import hybridyn
from hybridyn.structure.building import build_robot
from tests.optimal_control.collocation import solved
from tests.robots.shipped import shipped
from tests.support.comparing import close_to, refused
from tests.support.samples import slow

#: Of central differences: rounding over STEP, and STEP^2.
DIFFERENCES, STEP = 1e-7, 1e-5
#: Of the same equations in another order.
ROUNDING = 1e-10
#: Bound of efforts where weight takes most of them.
HANGING = 1.2
#: Both upper bars outwards, at rest: the elbows are 0.7 m apart.
FAR = [1.5, -1.5], [0.0, 0.0], [0.0, 0.0]
#: IPOPT's tolerance of 1e-8, of problems whose curvature is of order one.
OPTIMUM = 1e-6


@pytest.mark.parametrize("model", ["idm", slow("ddm")])
def test_values_and_derivatives_follow_the_motors(model: str, interpreted: None) -> None:
    """The slow tests below call what the compiler builds."""
    robot = build_robot(shipped("five_bar"))
    m, T = 2, 3
    random = np.random.default_rng(0)
    given = random.normal(size=(3, m, T)) * [[[0.1]], [[1.0]], [[1.0]]]
    function = hybridyn.casadi_model(robot, model, T)
    motors = [x.T for x in given[:2]] + ([given[2].T] if model == "idm" else [np.zeros((T, m))])
    q, v, a = hybridyn.assemble(robot, motors=tuple(motors))
    if model == "idm":
        wanted = hybridyn.idm(robot, q, v, a)
    else:
        wanted = hybridyn.ddm(robot, q, v, given[2].T)[:, robot.motor_v]
    close_to(function(*given).full(), wanted.T, ROUNDING)

    x = ca.MX.sym("x", 3 * m * T)
    parts = [ca.reshape(part, m, T) for part in ca.vertsplit(x, m * T)]
    found = function(*parts)
    total = ca.sumsqr(found) + ca.sum1(ca.sum2(found[:, 1:] * found[:, :-1]))
    H, slope = ca.hessian(total, x)
    orders = ca.Function("orders", [x], [total, slope, H])
    at = np.concatenate([part.T.ravel() for part in given])
    gradient, hessian = (y.full() for y in orders(at)[1:])
    ways = random.normal(size=(2, len(at)))
    steps = [[orders(at + sign * STEP * way) for sign in (1, -1)] for way in ways]
    slopes = [[(y[k] - z[k]).full().ravel() / (2 * STEP) for y, z in steps] for k in (0, 1)]
    close_to(ways @ gradient, np.array(slopes[0]), DIFFERENCES)
    close_to(ways @ hessian, np.array(slopes[1]), DIFFERENCES)


def test_samples_stay_apart(interpreted: None) -> None:
    """Solvers see blocks of single samples: of the Jacobian, and of the Hessian of a sum."""
    function = hybridyn.casadi_model(build_robot(shipped("five_bar")), "idm", 4)
    x = [ca.MX.sym(name, 2, 4) for name in "qva"]
    found, every = function(*x), ca.veccat(*x)
    assert ca.jacobian(found, every).nnz() == 4 * 2 * 6
    assert ca.hessian(ca.sumsqr(found), every)[0].nnz() == 4 * 6 * 6


def test_exact_hessians_save_iterations() -> None:
    robot, way = build_robot(shipped("five_bar")), np.array([0.6, 0.5])
    exact, approximate = (solved(robot, way, 8, x) for x in ("exact", "limited-memory"))
    assert exact.success
    assert approximate.success
    close_to(exact.least, approximate.least, OPTIMUM)
    close_to(exact.motion, approximate.motion, np.sqrt(OPTIMUM))  # the least is flat: half as many digits
    assert exact.iterations < approximate.iterations


@pytest.mark.slow
def test_exact_hessians_solve_the_lx4() -> None:
    """Twenty-four motors: without them IPOPT is not done after ten times as many iterations."""
    robot = build_robot(shipped("lx4"))
    way = 0.02 * np.random.default_rng(1).uniform(-1.0, 1.0, size=24)
    hybridyn.compile(robot)  # the tests wait for it
    exact = solved(robot, way, 8, "exact", share=HANGING)
    assert exact.success
    assert not solved(robot, way, 8, "limited-memory", 10 * exact.iterations, HANGING).success
    q, v, a = (x.T for x in exact.motion)
    efforts = hybridyn.idm(robot, *hybridyn.assemble(robot, motors=(q, v, a)))
    found = hybridyn.casadi_model(robot, "idm", 8)(*exact.motion).full()
    close_to(efforts.T, found, ROUNDING)


def test_where_no_posture_follows_solvers_get_no_number(
    interpreted: None, caplog: pytest.LogCaptureFixture
) -> None:
    robot = hybridyn.load("five_bar").with_parameters({"lower_length": 0.3})
    function = hybridyn.casadi_model(robot, "ddm")
    with caplog.at_level(logging.WARNING, "hybridyn"):
        assert np.isnan(function(*FAR).full()).all()
    assert "no numbers for the solver: module 'm1_right_lower', closure 'm1_tip'" in caplog.text
    assert np.isfinite(function([0.1, 0.2], [0.0, 0.0], [0.0, 0.0]).full()).all()


def test_what_is_no_model_over_motors_is_refused(interpreted: None) -> None:
    robot = build_robot(shipped("five_bar"))
    make = partial(hybridyn.casadi_model, robot)
    refused(partial(make, samples=0), hybridyn.ModelError, "samples must be at least 1, not 0")
    refused(partial(make, "kinematics"), hybridyn.ModelError, "not of 'kinematics'")
    refused(partial(make, effects=["default", "limits"]), hybridyn.ModelError, "each limit is a kink")
    refused(partial(make, start=np.zeros(3)), hybridyn.TrajectoryError, "start")
    floating = partial(hybridyn.casadi_model, build_robot(shipped("five_bar"), base="floating"))
    refused(floating, hybridyn.ModelError, "base")
