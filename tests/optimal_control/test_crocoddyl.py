"""DDP of Crocoddyl on a five-bar: exact derivatives, a motion from rest to rest, postures out of reach."""

import logging

import numpy as np
import pytest

import hybridyn
from tests.support.comparing import close_to
from tests.support.extras import needs

crocoddyl = needs("crocoddyl", "crocoddyl")
from hybridyn.optimal_control.crocoddyl_model import MotorAction  # noqa: E402

#: Of forward differences in double precision, which Crocoddyl takes.
DIFFERENCES = 1e-5


def test_ddp_moves_a_five_bar_from_rest_to_rest() -> None:
    robot = hybridyn.load("five_bar")
    home, T, dt = robot.home[robot.motor_q], 20, 0.025
    state = crocoddyl.StateVector(4)
    goal = np.append(home + np.array([0.3, 0.25]), [0.0, 0.0])
    effort = crocoddyl.CostModelResidual(state, crocoddyl.ResidualModelControl(state, 2))
    place = crocoddyl.CostModelResidual(state, crocoddyl.ResidualModelState(state, goal, 2))
    running, end = crocoddyl.CostModelSum(state, 2), crocoddyl.CostModelSum(state, 2)
    running.addCost("effort", effort, 1e-2)
    end.addCost("place", place, 1e2)
    action, last = MotorAction(robot, running), MotorAction(robot, end)

    x, u = np.array([0.1, 0.2, 1.0, -0.5]), np.array([1.0, -1.0])
    q, v, _ = hybridyn.assemble(robot, motors=(x[:2], x[2:], np.zeros(2)))
    judge = crocoddyl.DifferentialActionModelNumDiff(action, True)
    found, wanted = action.createData(), judge.createData()
    for model, data in ((action, found), (judge, wanted)):
        model.calc(data, x, u)
        model.calcDiff(data, x, u)
    close_to(found.xout, hybridyn.ddm(robot, q, v, u)[robot.motor_v], 1e-10)
    close_to(found.Fx, wanted.Fx, DIFFERENCES)
    close_to(found.Fu, wanted.Fu, DIFFERENCES)

    steps = [crocoddyl.IntegratedActionModelEuler(action, dt)] * T
    start = np.append(home, [0.0, 0.0])
    problem = crocoddyl.ShootingProblem(start, steps, crocoddyl.IntegratedActionModelEuler(last, 0.0))
    solver = crocoddyl.SolverDDP(problem)
    still = hybridyn.idm(robot, robot.home, np.zeros(robot.nv), np.zeros(robot.nv))
    assert solver.solve([start] * (T + 1), [still] * T, 50, False)
    assert solver.iter <= 20
    close_to(np.array(solver.xs[-1]), goal, 0.05)


def test_where_no_posture_follows_solvers_get_no_number_and_go_on(caplog: pytest.LogCaptureFixture) -> None:
    robot = hybridyn.load("five_bar").with_parameters({"lower_length": 0.3})
    costs = crocoddyl.CostModelSum(crocoddyl.StateVector(4), 2)
    action, near, far, u = MotorAction(robot, costs), np.zeros(4), np.array([1.5, -1.5, 0.0, 0.0]), np.ones(2)
    data, fresh = action.createData(), action.createData()
    for x in (far, near, far):
        with caplog.at_level(logging.WARNING, "hybridyn"):
            action.calc(data, x, u)
            action.calcDiff(data, x, u)
        assert all(np.isnan(part).all() == (x is far) for part in (data.xout, data.Fx, data.Fu))
        if x is near:
            action.calc(fresh, x, u)
            assert (data.xout == fresh.xout).all()
    assert caplog.text.count("no numbers for the solver: module 'm1_right_lower', closure 'm1_tip'") == 2
