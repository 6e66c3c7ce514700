"""Motions without a motor, idle ones, massless ones: named where they are, and nowhere else."""

from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn import ActuationError, HybridRobot
from hybridyn.assembly.free_motions import FreeMotions, free_motions
from hybridyn.spatial import Array
from hybridyn.structure.building import build_robot
from hybridyn.studies.check.remarks import free_motions_of
from tests import ROOT
from tests.comparing import refused
from tests.files import save
from tests.mechanisms import KINDS, random_mechanism
from tests.samples import some
from tests.shipped import ROBOTS, shipped
from tests.studies.test_check import crank_and_slide

NONE = FreeMotions((), (), ())


@pytest.mark.parametrize("name", ROBOTS)
def test_shipped_robots_have_none(name: str) -> None:
    robot = build_robot(shipped(name))
    assert all(free_motions(module) == NONE for module in robot.modules)
    assert free_motions_of(robot) == []
    assert free_motions_of(build_robot(shipped(name), base="floating")) == []  # a free base is no news


def test_a_five_bar_with_one_motor_has_a_passive_motion() -> None:
    robot = hybridyn.load(ROOT / "urdf/five_bar.urdf.xacro", motors=["m1_left_drive"])
    free = free_motions(robot.modules[0])
    assert len(free.uncontrolled) == 1
    assert "m1_left_drive" not in free.uncontrolled[0]
    assert (free.idle, free.massless) == ((), ())
    assert free_motions_of(robot) == [
        f"no motor drives the motion of {free.uncontrolled[0].replace(chr(39), '')}"
    ]


def test_a_link_with_mass_on_a_leg_is_not_idle() -> None:
    """The rods of a governor move no platform, but themselves and their balls."""
    robot = hybridyn.load(ROOT / "urdf/benchmarks/flyball_governor.urdf.xacro")
    free = free_motions(robot.modules[1])
    assert (len(free.uncontrolled), free.idle, free.massless) == (3, (), ())


@pytest.mark.parametrize("kind", some(KINDS))
def test_motions_and_motors_add_up(kind: str) -> None:
    """Motors, the motions they do not drive, and mobility: each module of each random mechanism."""
    robot = build_robot(random_mechanism(0, kind=kind))
    for module in robot.modules:
        free = free_motions(module)
        m = module.mechanism
        Psi = m.basis(m.closures.matrix(m.tree.sweep(m.postures[:1]))).Psi[0]
        driven = np.linalg.matrix_rank(
            Psi[module.motor_columns] / m.reduction.col_scale[module.motor_columns, None]
        )
        assert len(free.uncontrolled) + len(free.idle) == module.mobility - driven
        names = (*free.uncontrolled, *free.idle)
        assert not set(names) & {f"joint '{motor}'" for motor in module.motors}
        assert {*names, *free.massless} <= set(module.freedom_names())
    if KINDS[kind].massless:
        assert any(free_motions(module).massless for module in robot.modules)


def crank_and_rod(folder: Path) -> HybridRobot:
    """Return a crank that pushes a slide by a rod with a ball at either end: one motor, a motion to spare."""
    return hybridyn.load(save(folder, crank_and_slide("drive"), "r.urdf"))


def test_a_rod_that_spins_between_two_balls_is_idle(tmp_path: Path) -> None:
    robot = crank_and_rod(tmp_path)
    assert robot.mobility == 2
    free = free_motions(robot.modules[0])
    assert len(free.uncontrolled) + len(free.idle) == 1
    assert free.idle == ("joint 'ball_x'",)
    assert free.massless == ()
    assert "idle" in free_motions_of(robot)[0]


def swinging(robot: HybridRobot) -> tuple[Array, Array, Array]:
    t = np.linspace(0.0, 1.0, 40)
    swing = 0.4 * np.sin(5 * t), 2.0 * np.cos(5 * t), -10.0 * np.sin(5 * t)
    return hybridyn.assemble(robot, motors={"drive": swing})


def test_an_idle_motion_never_stops_a_model(tmp_path: Path) -> None:
    """The spin that closing leaves on the rod needs a moment that no motor gives: no reason to refuse."""
    robot = crank_and_rod(tmp_path)
    q, v, a = swinging(robot)
    tau = hybridyn.idm(robot, q, v, a)
    free = hybridyn.idm(robot, q, v, a, passive="solved")
    assert np.abs(tau - free).max() < 1e-3 * np.abs(free).max()  # the moment left out, a small one
    moving = hybridyn.ddm(robot, q, v, free)
    assert np.abs(hybridyn.idm(robot, q, v, moving) - free).max() < 1e-12 * np.abs(free).max()


def test_a_motion_that_moves_mass_needs_its_motor(tmp_path: Path) -> None:
    """Beside the idle one: with the slide as motor the crank's motion is told, without any it is refused."""
    robot = crank_and_rod(tmp_path)
    q, v, a = swinging(robot)
    bare = hybridyn.load(tmp_path / "r.urdf", motors=[])
    refused(lambda: hybridyn.idm(bare, q, v, a), ActuationError, "no motor can produce")
