"""Loops closed from what the motors do, as exported C does it: the states that the general path assembles."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.compiled.equations.request import request
from hybridyn.compiled.equations.states import random_states
from hybridyn.compiled.export_reference import rates_read
from hybridyn.compiled.programs.closing.platform_program import (
    close_platforms_program,
    platform_motions,
    posed_modules,
)
from hybridyn.compiled.programs.whole_robot import function_of, programs
from hybridyn.manifold.manifold import Manifold
from hybridyn.structure.building import build_robot
from hybridyn.structure.parameters.chosen import Parameters
from tests.linkage.test_winding import OFFSET, gear
from tests.oracle import Base
from tests.robots.mechanisms import KINDS, random_mechanism
from tests.support.comparing import close_to
from tests.support.samples import slow

#: A number that is an argument of the program, and its value in another design.
DESIGN = "position:m1_left_elbow", (0.27, 0.0, 0.0)
AWAY = 1e-3  # rad, module lengths: how far the others were at the last tick
CALLS = 6  # Newton needs four from there
AGREE = 1e-9  # of the largest rate and acceleration: closures closed to 1e-11, times their condition
CLOSED = 1e-11
SLIPPING = 1e-10  # rates are those of the posture before a step that is no longer than `CLOSED`


def followed(function: Any, near: np.ndarray, *given: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Call a program until it may be trusted; return the posture, rates and accelerations."""
    for _ in range(CALLS):
        near, rates, accelerations, guard = (np.array(x).ravel() for x in function(near, *given))
        if guard <= 1:
            break
    assert guard <= 1
    return near, rates, accelerations


@pytest.mark.parametrize(
    ("kind", "base"),
    [
        (kind, base) if (kind, base) == ("serial_all", "moving") else slow(kind, base)
        for kind in sorted(KINDS)
        for base in ("fixed", "moving", "floating")
    ],
)
def test_motors_tell_what_all_joints_do(kind: str, base: Base) -> None:
    """What is off is in units of what may be, from a posture nearby."""
    robot = build_robot(random_mechanism(1, kind=kind, base=base), base=base)
    program = programs(robot, models=("close",))["close"]
    function, manifold, read = function_of(program), Manifold(robot), rates_read(program)
    driven = robot.motor_v.tolist()
    q, v, a, _ = (x[0] for x in random_states(robot, 1, seed=2))
    xi = AWAY * manifold.unit * np.random.default_rng(3).choice([-1.0, 1.0], size=robot.nv)
    near = manifold.retraction.move(q, np.where(read > 0, 0.0, xi))
    given = [np.where(read > 0, x, 99.0) for x in (v, a)]
    near, rates, accelerations = followed(function, near, *given)
    redundant = any(len(m.motors) > m.mobility for m in robot.modules)
    assert set(np.flatnonzero(read)) >= set(driven) or redundant
    held = [i for i in driven if read[i]]
    moved = manifold.retraction.difference(q, near)
    off = [
        manifold.residual(near)[0] / CLOSED,
        moved[held] / CLOSED,
        manifold.opening(near, rates)[0] / SLIPPING,
    ]
    if np.abs(moved).max(initial=0.0) < CLOSED:
        off += [(rates - v) / np.abs(v).max() / AGREE, (accelerations - a) / np.abs(a).max() / AGREE]
    else:  # a rod has turned about itself, which no motor tells
        hybridyn.idm(
            robot, near, rates, accelerations, passive="solved"
        )  # refuses accelerations that open loops
    assert max(float(np.abs(x).max(initial=0.0)) for x in off) <= 1.0


@pytest.mark.parametrize(
    ("kind", "base"), [("star_three", "fixed"), slow("gough", "fixed"), ("stack", "moving")]
)
def test_poses_tell_what_all_joints_do(kind: str, base: Base) -> None:
    """Newton's method from a posture nearby, by poses of the platforms and by the other modules' motors."""
    robot = build_robot(random_mechanism(1, kind=kind, base=base), base=base)
    program = close_platforms_program(request(robot, None))
    function, manifold = function_of(program), Manifold(robot)
    q, v, a, _ = random_states(robot, 1, seed=2)
    told = platform_motions(robot, q, v, a)
    posed = {i for k in posed_modules(robot) for i in robot.modules[k].v_index.tolist()}
    driven = {*robot.motor_v.tolist(), *range(0 if base == "fixed" else 6)} - posed
    read = np.array([i in driven for i in range(robot.nv)])
    xi = AWAY * manifold.unit * np.random.default_rng(3).choice([-1.0, 1.0], size=robot.nv)
    near = manifold.retraction.move(q[0], np.where(read, 0.0, xi))
    given = [x[0] for x in told.values()] + [np.where(read, x[0], 99.0) for x in (v, a)]
    near, rates, accelerations = followed(function, near, *given)
    assert manifold.residual(near)[0] <= CLOSED
    assert np.abs(manifold.retraction.difference(q[0], near)).max() <= CLOSED
    close_to((rates, accelerations), (v[0], a[0]), AGREE)


@pytest.mark.parametrize("ratio", [1.5, 3.14, 0.558])
def test_motors_of_gears_turn_as_far_between_calls_as_they_like(ratio: float, tmp_path: Path) -> None:
    """The follower is where the file says for steps of any size: positions count whole turns."""
    robot = gear(tmp_path, ratio)
    function = function_of(programs(robot, models=("close",))["close"])
    drive, follower = (robot.q_slices[robot.joint_index[name]] for name in ("drive", "follower"))

    def off(step: float) -> float:
        q = hybridyn.assemble(robot, motors={"drive": 0.0})[0]
        for at in step * np.arange(1, 8):
            q[drive] = at
            for _ in range(3):
                q, _, _, guard = (np.array(x).ravel() for x in function(q, np.zeros(2), np.zeros(2)))
            assert guard <= 1
        wanted = ratio * 7 * step + OFFSET
        return float(np.abs(q[follower] - wanted).max())

    assert off(1.0) < 1e-12
    assert off(10.0) < 1e-12 * 105  # radians, in which rounding grows with the position


def test_loops_of_a_design_are_closed_by_one_program() -> None:
    """The rows of another design's posture; a design whose loops do not close is refused."""
    robot = hybridyn.load("five_bar")
    parameters = Parameters(robot.description, [DESIGN[0]])
    function = function_of(programs(robot, models=("close",), parameters=parameters.slots)["close"])
    other = robot.with_parameters(dict([DESIGN]))
    q, v, a, _ = (x[0] for x in random_states(other, 1, seed=2))
    off = np.array([2e-4 if name not in robot.motors else 0.0 for name in robot.joints])
    near = q + off
    near, rates, accelerations = followed(function, near, v, a, DESIGN[1])
    close_to(near, q, CLOSED, 1.0)
    close_to((rates, accelerations), (v, a), AGREE)
    with pytest.raises(AssertionError):  # out of the plane: rows that were redundant do not close
        followed(function, near, v, a, (0.27, 0.01, 0.0))
