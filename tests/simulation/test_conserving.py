"""The conserving method: energy over long runs, reversal, discrete work; rough numbers in any method."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn import simulate
from hybridyn.effects import Damper, Payload, RotorInertia, Spring, ViscousFriction
from hybridyn.errors import ModelError, SingularityError, TrajectoryError
from hybridyn.simulation.conserving import Conserving
from hybridyn.simulation.motion_law import MotionLaw
from hybridyn.structure.building import build_robot
from tests.robots.robot_texts import door, save
from tests.robots.swings import Swing, begin, chain, equal_bits, hinge, rod, still_base, swing
from tests.support.comparing import refused
from tests.support.samples import slow

KEPT = 1e-9  # of the peak kinetic energy, the project's claim over 1e5 steps
SHORT = 2e-11  # the same over up to 2,000 steps
LOST = 1e-6  # what RK4 loses at the same step
BACK = 1e-9  # where time reversal must end
STEP = 0.004
SECOND_ORDER = 1e-6  # by what two steps of a method of the second order leave the exact motion
WORK = 1e-7  # of what friction takes in a step: how far the step's equations are solved


def springs(robot: hybridyn.HybridRobot) -> list[object]:
    """Return springs on the motors: a platform whose slides are free falls for ever, on springs it swings."""
    stiffness = dict.fromkeys(robot.motors, 3000.0)
    return ["default", Spring(stiffness, dict.fromkeys(robot.motors, 0.01))]


def swinging(name: str) -> tuple[Swing, list[object] | None]:
    """Return a bounded motion without friction."""
    of = swing(name)
    return of, springs(of[0]) if name == "gough_stewart" else None


def drift(result: hybridyn.simulation.result.SimulationResult) -> float:
    """Return the worst change of energy over the peak kinetic energy."""
    return float(np.abs(result.energy - result.energy[0]).max() / result.kinetic.max())


def swung(name: str, method: str, steps: int) -> hybridyn.simulation.result.SimulationResult:
    (robot, q, v), effects = swinging(name)
    times = STEP * np.arange(0, steps + 1, 10)
    return simulate(robot, q, v, times, method=method, step=STEP, effects=effects)


@pytest.mark.parametrize(
    ("name", "steps", "kept"),
    [
        ("five_bar", 40, SHORT),
        *(slow(name, 2000, SHORT) for name in ("five_bar", "gough_stewart")),
        *(slow(name, 100_000, KEPT) for name in ("five_bar", "gough_stewart")),
    ],
)
def test_energy_over_many_steps(name: str, steps: int, kept: float) -> None:
    result = swung(name, "conserving", steps)
    assert result.status == "finished", result.message
    assert drift(result) <= kept
    assert result.residual.max() <= 1e-10
    if steps > 200:
        assert drift(swung(name, "rk4", 200)) > LOST


@pytest.mark.parametrize("name", ["five_bar", "gough_stewart", "five_bar:floating", "serial_all:fixed"])
def test_time_reversal(name: str) -> None:
    (robot, q, v), effects = swinging(name)
    there = simulate(robot, q, v, (0.0, 20 * STEP), method="conserving", step=STEP, effects=effects)
    back = simulate(
        robot, there.q[-1], there.v[-1], (20 * STEP, 0.0), method="conserving", step=STEP, effects=effects
    )
    assert len(back.t) == 21
    scale = np.abs(there.v).max()
    assert np.abs(there.q[-1] - q).max() > 1e-3
    assert np.abs(back.q[-1] - q).max() <= BACK
    assert np.abs(back.v[-1] - v).max() <= BACK * scale
    assert drift(there) <= SHORT


def test_rotors_and_springs_count_as_energy() -> None:
    robot, q, v = swing("five_bar")
    rotors = RotorInertia(dict.fromkeys(robot.motors, 0.02))
    effects = ["default", rotors, Spring(dict.fromkeys(robot.motors, 5.0))]
    result = simulate(robot, q, v, (0, 30 * STEP), method="conserving", step=STEP, effects=effects)
    assert drift(result) <= SHORT
    assert result.kinetic[0] > simulate(robot, q, v, (0, STEP), method="conserving", step=STEP).kinetic[0]


def test_no_gravity_and_no_legs() -> None:
    robot, q, v = swing("gough_stewart")
    for effects in (["inertia", "leg_inertia", "velocity"], ["default", "massless_legs"]):
        result = simulate(robot, q, v, (0, 2 * STEP), method="conserving", step=STEP, effects=effects)
        assert drift(result) <= SHORT
        exact = simulate(robot, q, v, (0, 2 * STEP), method="rk4", step=STEP, effects=effects)
        assert np.abs(result.q[-1] - exact.q[-1]).max() < SECOND_ORDER


def test_forces_change_energy_by_their_discrete_work() -> None:
    robot, q, v = swing("five_bar")
    friction = ["default", ViscousFriction(dict.fromkeys(robot.motors, 0.3))]
    h = 2e-3
    result = simulate(robot, q, v, (0, 4 * h), method="conserving", step=h, effects=friction)
    force, way = -0.3 * result.v[:, robot.motor_v], np.diff(result.q[:, robot.motor_q], axis=0)
    work, gained = np.sum((force[1:] + force[:-1]) / 2 * way, axis=1), np.diff(result.energy)
    assert (gained < 0).all()
    assert np.abs(gained - work).max() < WORK * np.abs(gained).max()
    exact = simulate(robot, q, v, (0, 4 * h), effects=friction)
    assert np.abs(result.q[-1] - exact.q[-1]).max() < 1e-5


def test_it_needs_no_direct_model_where_nothing_acts() -> None:
    robot, q, v = swing("five_bar")
    result = simulate(robot, q, v, (0, 3 * STEP), method="conserving", step=STEP)
    assert result.counters.evaluations == 1  # the start's accelerations
    held = simulate(robot, q, v, (0, 3 * STEP), method="conserving", step=STEP, effort=np.array([1.0, 0]))
    assert held.counters.evaluations > 10


def test_a_body_at_rest_stays(tmp_path: Path) -> None:
    robot = chain(tmp_path, rod("arm", 1.0, "0 0 -0.5", (0.1, 0.1, 0.1)), hinge("turn", "base", "arm"))
    result = simulate(robot, np.zeros(1), np.zeros(1), (0, 1.0), method="conserving", step=0.1)
    assert result.status == "finished", result.message
    assert not result.q.any()


def test_what_it_refuses(tmp_path: Path) -> None:
    robot = swing("five_bar")[0]
    moving = build_robot(robot.description, base="moving")
    rest = still_base()
    pushed = {"effects": ["default", Damper({"turn": 0.0})]}
    massless = chain(tmp_path, '<link name="arm"/>', hinge("turn", "base", "arm"))
    system, state = begin((massless, np.zeros(1), np.ones(1)), **pushed)
    law = MotionLaw(moving, effects=["default", rest])
    refused(lambda: Conserving(law), ModelError, "prescribed base")
    refused(lambda: Conserving(system.law).step(system, state, 0.1), SingularityError, "no inertia")


FIXED = {"method": "rk4", "step": 1e-3}


def test_rounding_as_rates_of_a_locked_loop(tmp_path: Path) -> None:
    """A hinge that a second one across it locks: its rate is zero to rounding, which any solver gives."""
    text = door(2).replace('<axis xyz="0 1 0"/>\n  </loop>', '<axis xyz="1 0 0"/>\n  </loop>')
    robot = hybridyn.load(save(tmp_path, text, "door.urdf"))
    assert robot.mobility == 0
    run = hybridyn.simulate(robot, robot.home, np.array([3e-16]), (0, 2e-3), **FIXED)
    assert run.status == "finished"
    assert np.abs(run.v).max() <= 3e-16


def test_a_run_that_stops_after_one_row_goes_on_to_the_same_bits(tmp_path: Path) -> None:
    path = save(tmp_path, door(1).replace("revolute", "continuous"), "door.urdf")
    robot = hybridyn.load(path)
    for angle in np.linspace(0.1, 2.0, 7):
        start = np.array([np.cos(angle), np.sin(angle)]), np.array([0.3 + angle])
        whole = hybridyn.simulate(robot, *start, (0, 2e-3), **FIXED)
        half = hybridyn.simulate(robot, *start, (0, 1e-3), **FIXED)
        again = hybridyn.simulate(robot, None, None, (0, 2e-3), resume=half, **FIXED)
        assert equal_bits(again, whole)


def test_an_effort_on_a_massless_base_is_refused(tmp_path: Path) -> None:
    """A free base without mass turns about its only hinge: its inertia there is rounding squared."""
    robot = hybridyn.load(save(tmp_path, door(1), "door.urdf"), base="floating")
    rng = np.random.default_rng(0)
    q = np.array([*rng.normal(size=3), 0.5, 0.5, 0.5, 0.5, 0.3])
    refused(
        lambda: hybridyn.ddm(robot, q, rng.normal(size=robot.nv), np.array([0.4])),
        SingularityError,
        "has no inertia",
    )


@pytest.mark.parametrize("size", [1e51, 1e300])
def test_numbers_that_no_robot_has(tmp_path: Path, size: float) -> None:
    bodies = rod("arm", 1.0, "0 0 -0.5", (0.1, 0.1, 0.1))
    robot = chain(tmp_path, bodies, hinge("q1", "base", "arm"))
    for call, error, words in (
        (
            lambda: hybridyn.ddm(robot, np.zeros(1), np.array([size]), np.zeros(0)),
            TrajectoryError,
            "v has the number",
        ),
        (lambda: Payload("arm", size, (1.0, 0.0, 0.0)), ModelError, "at most 1e\\+50"),
        *(
            (
                partial(hybridyn.energy, robot, np.zeros(1), np.zeros(1), effects=[spring]),
                ModelError,
                "spring: joint 'q1' has",
            )
            for spring in (Spring({"q1": size}), Spring({"q1": 1.0}, {"q1": size}))
        ),
        (
            lambda: chain(tmp_path, bodies, hinge("q1", "base", "arm"), gravity=(size, 0.0, 0.0)),
            ModelError,
            "gravity must be three finite numbers",
        ),
    ):
        refused(call, error, words)
