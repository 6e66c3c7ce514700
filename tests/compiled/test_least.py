"""What motors leave open has one meaning: exported C, Warp, compiled models and `assemble` take the least."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.compiled.exporting import export
from hybridyn.description.records import Description
from hybridyn.manifold.manifold import Manifold
from hybridyn.spatial import Array
from hybridyn.structure.building import build_robot
from hybridyn.structure.robot import HybridRobot
from tests.compiled import rods
from tests.compiled.test_export import Stepping
from tests.support.samples import slow
from tests.support.written_out import Interpreted

#: Of the largest: rounding, times the condition of the loops.
SAME = 1e-11
#: How far rods have turned depends on the steps: engines differ by the square of a tick's motion, at most.
SQUARED = 1.0
FEET: tuple[rods.Foot, ...] = ("ball", "universal", "revolutes", "floating", "floating aside")
#: Machines by their names: what draws each, and the part of its unit by which a motor swings.
MACHINES: dict[str, tuple[Callable[[], Description], float]] = {
    **{f"crank {foot}": (lambda foot=foot: rods.crank(1, foot), 0.1) for foot in FEET},
    **{f"delta {foot}": (lambda foot=foot: rods.ball_delta(1, foot), 0.1) for foot in FEET},
    **{f"gough {foot}": (lambda foot=foot: rods.ball_gough(1, foot), 0.01) for foot in FEET},
    "cylinder": (lambda: rods.cylinder(1), 0.1),
}
Ticks = list[tuple[Array, Array, Array]]
#: From the last posture and the motors' motion to efforts, q, v and a.
Step = Callable[..., tuple[Array, Array, Array, Array]]


def ticks_of(robot: HybridRobot, size: float, count: int = 6) -> Ticks:
    """Return positions, rates and accelerations of the motors, tick by tick; the first is at home."""
    motors = rods.swings(robot, 40, size)
    rows = [np.array([motors[name][i] for name in robot.motors]).T for i in range(3)]
    return list(zip(*(x[:count] for x in rows), strict=True))


def check(robot: HybridRobot, ticks: Ticks, step: Step) -> None:
    """Compare ticks with the general path, from where each step starts, and from where it has led."""
    difference = Manifold(robot).retraction.difference
    last = robot.home
    for tick in ticks:
        tau, *state = step(last, *tick)
        there = hybridyn.assemble(robot, motors=tick, guess=state[0])
        for one, other in zip(state, there, strict=True):
            assert np.abs(one - other).max() <= SAME * np.abs(other).max()
        wanted = hybridyn.idm(robot, *there)
        assert np.abs(tau - wanted).max() <= 100 * SAME * np.abs(wanted).max()
        here, *_ = hybridyn.assemble(robot, motors=tick, guess=last)
        moved = np.abs(difference(last, here) / robot.unit).max()
        assert np.abs(difference(here, state[0]) / robot.unit).max() <= SQUARED * moved**2 + SAME
        last = state[0]


def interpreted(robot: HybridRobot) -> Step:
    """Return the programs of exported C, called until the loops are closed."""
    models = Interpreted(robot, ("close", "idm"))

    def step(last: Array, position: Array, rate: Array, acceleration: Array) -> Any:
        v, a, q = np.zeros((1, robot.nv)), np.zeros((1, robot.nv)), last[None].copy()
        v[:, robot.motor_v], a[:, robot.motor_v] = rate, acceleration
        for _ in range(8):
            q[:, robot.motor_q] = position
            state, guard = models.batch("close", q, v, a)
            q = state[0]
        assert guard[0] <= 1.0
        (tau,), guard = models.batch("idm", *state)
        assert guard[0] <= 1.0
        return tau[0], *(x[0] for x in state)

    return step


@pytest.mark.parametrize(
    "name", [name if "crank" in name or name == "cylinder" else slow(name) for name in MACHINES]
)
def test_programs_take_the_least(name: str) -> None:
    draw, size = MACHINES[name]
    robot = build_robot(draw())
    check(robot, ticks_of(robot, size), interpreted(robot))


def exported(robot: HybridRobot, folder: Path) -> Step:
    """Return the control step of exported C."""
    export(robot, folder, name="bar")
    stepping = Stepping(robot, folder)

    def step(*given: Array) -> Any:
        guard, *found = stepping.step(*given)
        assert guard <= 1.0
        return found

    return step


def batched(robot: HybridRobot) -> Step:
    """Return the control step in Warp."""
    batch = hybridyn.warp(robot, device="cpu")

    def step(last: Array, *tick: Array) -> Any:
        found = batch.idm_from_motors(*(x[None] for x in tick), near=last[None])
        return [np.asarray(x)[0] for x in found[:4]]

    return step


@pytest.mark.slow
@pytest.mark.parametrize("name", MACHINES)
@pytest.mark.parametrize("engine", ["exported", "warp", "compiled"])
def test_engines_take_the_least(name: str, engine: str, tmp_path: Path) -> None:
    draw, size = MACHINES[name]
    robot = build_robot(draw())
    if engine == "exported":
        step = exported(robot, tmp_path)
    elif engine == "warp":
        pytest.importorskip("warp")
        step = batched(robot)
    else:
        compiled = hybridyn.compile(robot)
        step = lambda last, *tick: compiled.idm_from_motors(*tick, last=last)  # noqa: E731
    check(robot, ticks_of(robot, size), step)
