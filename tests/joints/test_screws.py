"""Screws: one freedom that turns about an axis and slides along it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn.compiled.equations.states import random_states
from hybridyn.joints.kinds import JointKind
from hybridyn.structure.building import build_robot
from tests.judges.generated_judge import judge
from tests.robots.generated import Case, generated, threaded
from tests.robots.sketch import Sketch
from tests.support.comparing import SOLVED, close_to
from tests.support.engines import engine_of
from tests.support.extras import needs
from tests.support.samples import slow

STATES = 4
WRITTEN = 1e-6  # USD holds single numbers
SEEDS = [*range(8), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(8, 200))]


def case_of(seed: int) -> Case:
    """Draw a mechanism whose revolute joints are screws, and that has some."""
    case = generated(seed, screws=True)
    while not any(joint.kind == JointKind.SCREW for joint in case.description.joints):
        seed += 1000
        case = generated(seed, screws=True)
    return case


@pytest.mark.parametrize("seed", SEEDS)
def test_models_of_mechanisms_with_screws_are_the_oracles(seed: int) -> None:
    """Loops, gears, floating and moving bases."""
    case = case_of(seed)
    judge(case, case.states(STATES))


@pytest.mark.parametrize("axis", [(0, 0, 1), (0, -1, 0), (0.6, 0, 0.8)])
def test_a_screw_is_pinocchios(axis: tuple[float, ...]) -> None:
    rng, pitch, unit = np.random.default_rng(3), -0.17, np.array(axis, dtype=float)
    model = pin.Model()
    for number in range(3):
        kind = pin.JointModelHelicalUnaligned(unit, pitch) if number else pin.JointModelRX()
        joint = model.addJoint(number, kind, pin.SE3.Random(), f"j{number}")
        model.appendBodyToJoint(joint, pin.Inertia.Random(), pin.SE3.Identity())
    robot = hybridyn.from_pinocchio(model)
    assert robot.kinds == (JointKind.REVOLUTE, JointKind.SCREW, JointKind.SCREW)
    q, v, a = rng.normal(size=(3, 3))
    close_to(hybridyn.idm(robot, q, v, a), pin.rnea(model, model.createData(), q, v, a), SOLVED)


@pytest.mark.parametrize(
    ("seed", "engine"),
    [
        *((seed, "written") for seed in range(3)),
        (4, "compiled"),  # which has the fewest joints
        *(slow(seed, "compiled") for seed in range(3)),
    ],
)
def test_engines_agree(seed: int, engine: str) -> None:
    needs("compiled")
    robot = build_robot(case_of(seed).description, base="floating")
    q, v, _, tau = random_states(robot, STATES, seed=seed)
    close_to(engine_of(engine, robot).ddm(q, v, tau), hybridyn.ddm(robot, q, v, tau), SOLVED)


@pytest.mark.parametrize("ending", ["sdf", "urdf", "xml", "usda"])
def test_a_screw_is_written_and_read(ending: str, tmp_path: Path) -> None:
    """As itself where the format has it, else as a hinge and a slide that follows it."""
    needs({"xml": "mjcf", "usda": "usd"}.get(ending, "compiled"))
    s = Sketch(np.random.default_rng(2))
    arm = s.joint("revolute", "base", np.zeros(3), motor=True)
    s.joint("prismatic", arm, np.array([0.2, 0.1, 0.3]), motor=True)
    threaded(s, s.rng)
    d = s.description("jack")
    links = tuple(replace(link, inertia=0.05 * np.eye(3)) for link in d.links)
    robot = build_robot(replace(d, links=links), base="fixed")
    hybridyn.convert(robot, tmp_path / f"robot.{ending}")
    again = hybridyn.load(tmp_path / f"robot.{ending}")
    assert (JointKind.SCREW in again.kinds) == (ending == "sdf")
    first, second = (hybridyn.mass_matrix(x, x.home, joints=robot.motors) for x in (robot, again))
    close_to(second, first, WRITTEN)
