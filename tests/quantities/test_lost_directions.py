"""What is lost altogether is refused, and not judged by what is left, which is rounding.

A part of a map is lost if its singular value is small. Where all are lost, the largest is rounding, too, and
a single one is always the largest: both are compared with what the map is in other postures.
"""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.errors import SingularityError, TrajectoryError
from hybridyn.simulation.events import near_singularity
from hybridyn.structure.robot import HybridRobot
from tests.dynamics.test_engines import QUANTITIES
from tests.robots.locked import hinged_five_bar, named
from tests.robots.robot_texts import INERTIAL
from tests.support.comparing import close_to, refused
from tests.support.engines import engine_of
from tests.support.files import save
from tests.support.samples import slow

#: How far from the posture a robot stands [rad]: nothing and rounding, and what the limit of 1e-10 allows.
NEAR, FAR = (0.0, 1e-16, 1e-13, 1e-12), (1e-8, 1e-4)
EPS = 1e-15  # of a posture; the rate of the slide is in proportion to the angle
CRANK, ROD = 1.0, 2.0


@pytest.mark.parametrize("engine", ["general", slow("compiled")])
@pytest.mark.parametrize("ends", [("jx", "jy"), ("jx", "ja"), ("jc", "jy")])
def test_joints_that_closures_lock_are_not_independent(engine: str, ends: tuple[str, str]) -> None:
    """All chosen joints locked, and one of two: every quantity refuses them."""
    robot = hinged_five_bar(both=True)
    on, joints = engine_of(engine, robot), named(robot, *ends)
    q, v = robot.home, np.zeros(robot.nv)
    calls = {name: partial(getattr(on, name), q) for name in ("mass_matrix", "motion_map", "gravity")}
    calls |= {
        name: partial(getattr(on, name), q, v)
        for name in ("bias", "coriolis", "coriolis_matrix", "motion_map")
    }
    calls["link_jacobian"] = partial(on.link_jacobian, q, robot.description.root)
    words = r"its chosen joints lose a direction at sample 0 \(they are not independent"
    for call in calls.values():
        assert refused(partial(call, joints=joints), SingularityError, words).condition > 1e12
    refused(lambda: on.joint_map(q, joints), SingularityError, words)


@pytest.mark.parametrize("engine", ["general", slow("compiled")])
def test_locked_motors_are_not_independent(engine: str) -> None:
    robot = hinged_five_bar(("jx", "jy"), both=True)
    on = engine_of(engine, robot)
    state = robot.home, np.zeros(robot.nv), np.zeros(robot.nv), np.zeros(2)
    for name, quantity in QUANTITIES.items():
        if name != "delassus":  # which includes motions without a motor
            refused(
                partial(quantity, on, *state), SingularityError, "its (motors|chosen joints) lose a direction"
            )


def piston(folder: Path, motors: Sequence[str]) -> HybridRobot:
    """Return a crank of length 1 that a slide moves through a rod of length 2, and a slide geared to it.

    Home is the dead centre, at which nothing that the slides do moves the crank.
    """
    bodies = "".join(
        f'<link name="{name}">{INERTIAL}</link>' for name in ("crank", "rod", "slider", "second")
    )
    hinge = (
        '<joint name="{}" type="continuous"><parent link="{}"/><child link="{}"/><origin xyz="{} 0 0"/>'
        '<axis xyz="0 0 1"/></joint>'
    )
    slide = (
        '<joint name="{}" type="prismatic"><parent link="ground"/><child link="{}"/><origin xyz="{} 0 0"/>'
        '<axis xyz="1 0 0"/><limit lower="-9" upper="9" velocity="9" effort="9"/>{}</joint>'
    )
    text = (
        f'<robot name="piston"><link name="ground"/>{bodies}{hinge.format("turn", "ground", "crank", 0)}'
        f"{hinge.format('knee', 'crank', 'rod', CRANK)}{slide.format('slide', 'slider', CRANK + ROD, '')}"
        f"{slide.format('other', 'second', 0, GEARED)}{PIN}</robot>"
    )
    return hybridyn.load(save(folder, text, "piston.urdf"), motors=list(motors))


GEARED = '<mimic joint="slide" multiplier="0.5"/>'
PIN = (
    f'<loop name="pin" type="revolute"><predecessor link="rod"><origin xyz="{ROD} 0 0"/></predecessor>'
    '<successor link="slider"/><axis xyz="0 0 1"/></loop>'
)


def at(robot: HybridRobot, angle: float) -> np.ndarray:
    """Return the posture of the piston at an angle of its crank."""
    lean = np.arcsin(CRANK * np.sin(angle) / ROD)
    slide = CRANK * (np.cos(angle) - 1.0) + ROD * (np.cos(lean) - 1.0)
    turns = {"turn": angle, "knee": -angle - lean}
    q = np.zeros(robot.nq)
    for name, where in zip(robot.joints, robot.q_slices, strict=True):
        x = turns.get(name)
        q[where] = (
            {"slide": slide, "other": slide / 2}.get(name, 0.0) if x is None else [np.cos(x), np.sin(x)]
        )
    return q


def slide_per_turn(angle: float) -> float:
    """Return how far the slide moves per angle of the crank."""
    lean = np.arcsin(CRANK * np.sin(angle) / ROD)
    return -CRANK * np.sin(angle) * (1.0 + CRANK * np.cos(angle) / (ROD * np.cos(lean)))


@pytest.mark.parametrize(
    ("engine", "motors"),
    [
        ("general", ("slide",)),
        ("general", ("slide", "other")),
        slow("compiled", ("slide",)),
        slow("compiled", ("slide", "other")),
    ],
)
def test_a_dead_centre_of_all_motors(tmp_path: Path, engine: str, motors: tuple[str, ...]) -> None:
    """One freedom, which no motor moves: efforts of 1e16 N are rounding."""
    robot = piston(tmp_path, motors)
    on, rest = engine_of(engine, robot), np.zeros(robot.nv)
    words = r"its motors lose a direction at sample 0 \(parallel singularity"
    for angle in (*NEAR, *(np.pi + x for x in NEAR)):
        q = at(robot, angle)
        idm = partial(on.idm, q, rest, rest)
        refused(idm, SingularityError, words)
        if engine == "general":
            assert not idm(on_singular="least-norm").any()
            refused(partial(idm, passive="solved"), SingularityError, "motors lose a direction")
        if len(motors) == 1:
            refused(partial(on.gravity, q), SingularityError, words)
    for angle in FAR:
        q = at(robot, angle)
        work = on.idm(q, rest, rest) @ [1.0, 0.5][: len(motors)] * slide_per_turn(angle)
        close_to(work, hybridyn.gravity(robot, q, joints=["turn"])[0], EPS / angle)


def test_the_event_sees_a_dead_centre(tmp_path: Path) -> None:
    """The least share of the motors in a motion, which falls in proportion to the angle."""
    robot = piston(tmp_path, ("slide",))
    event, rest = near_singularity(robot, 0.0, what="motors"), np.zeros(robot.nv)
    values = [event.function(0.0, at(robot, angle), rest) for angle in (0.02, 0.01, 1e-6)]
    assert values[0] > values[1] > values[2] > 0
    assert values[2] < 1e-5


@pytest.mark.parametrize("threshold", [np.zeros(4), [0.1], -0.1, 1.5, np.nan, "closures", None])
def test_the_threshold_of_the_event_is_a_number(tmp_path: Path, threshold: Any) -> None:
    """A posture in its place is no threshold."""
    robot = piston(tmp_path, ("slide",))
    refused(lambda: near_singularity(robot, threshold), TrajectoryError, "^threshold (must|is)")


def pendulum(folder: Path) -> HybridRobot:
    """Return a folded double pendulum whose tip keeps to a line through the first hinge: one closure row."""
    rest = '<axis xyz="0 0 1"/><limit lower="-9" upper="9" velocity="9" effort="9"/></joint>'
    text = f"""<robot name="folded"><link name="ground"/><link name="upper">{INERTIAL}</link>
    <link name="lower">{INERTIAL}</link><joint name="first" type="revolute"><parent link="ground"/>
      <child link="upper"/><origin rpy="0 0 {np.pi / 2}"/>{rest}<joint name="second" type="revolute">
      <parent link="upper"/><child link="lower"/><origin xyz="1 0 0" rpy="0 0 {np.pi}"/>{rest}
    <loop name="line" type="rows" rows="ty"><predecessor link="ground"/>
      <successor link="lower"><origin xyz="1 0 0"/></successor></loop></robot>"""
    return hybridyn.load(save(folder, text, "folded.urdf"), motors=["first"])


def test_the_only_row_of_a_closure_vanishes(tmp_path: Path) -> None:
    """Folded, the row is zero, and two branches meet: the tip rests on the hinge, or runs along the line."""
    robot, rest = pendulum(tmp_path), np.zeros(2)
    calls: list[Callable[[np.ndarray], Any]] = [
        lambda q: hybridyn.idm(robot, q, rest, rest),
        lambda q: hybridyn.ddm(robot, q, rest, [0.0]),
        lambda q: hybridyn.motion_map(robot, q),
    ]
    for call in calls:
        for angle in (0.0, 1e-16, 1e-14):
            refused(partial(call, np.array([angle, 0.0])), SingularityError, "closures lose rank at sample 0")
        call(np.array([0.01, 0.0]))
    event = near_singularity(robot, 0.0)
    values = [event.function(0.0, np.array([angle, 0.0]), rest) for angle in (0.02, 0.01, 1e-6)]
    assert values[0] > values[1] > values[2]
    assert values[2] < 1e-5
