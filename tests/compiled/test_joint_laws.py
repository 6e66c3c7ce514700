"""`gravity` and `coriolis` have no joint laws: each of the catalogue, and one of another package."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
import pytest

import hybridyn
from hybridyn.compiled.compiling import interpreted_model
from hybridyn.compiled.equations.states import moving_states
from hybridyn.effects import JointEffect, PolynomialDamper
from hybridyn.effects.catalogue import JOINTS, UNITS
from hybridyn.effects.choice import choose
from hybridyn.structure.building import build_robot
from tests.robots.effect_cases import CASES
from tests.robots.sketch import Sketch
from tests.support.comparing import SOLVED, close_to
from tests.support.engines import General
from tests.support.samples import slow


@dataclass(frozen=True)
class Cam(JointEffect):
    """tau = k cos x + c v^2: neither zero at rest nor odd in the rate."""

    lift: Mapping[str, float] = field(default_factory=dict)
    name: ClassVar[str] = "cam"
    by_joint = ("lift",)

    def effort(self, p: Any, x: Any, v: Any) -> Any:
        """Compute the effort."""
        return p[0] * (np.cos(x) + v * v)


STEEP = [0.0, 0.0, 0.0, 40.0]  # damping that exceeds inertial forces at the speeds of `coriolis`
LAWS = {name: case for name, case in CASES.items() if issubclass(UNITS[name], JOINTS)} | {
    "cam": lambda robot: [Cam(dict.fromkeys(robot.motors, 3.0))],
    "steep_damper": lambda robot: [PolynomialDamper(dict.fromkeys(robot.motors, STEEP))],
}


#: Of a ball, and of another law's name.
APART = ("ball_spring", "steep_damper")


def together(robot: hybridyn.HybridRobot) -> list[Any]:
    """Return all other laws: no effort of any of them may be left in."""
    return [unit for name, law in LAWS.items() if name not in APART for unit in law(robot)]


def slider_crank() -> hybridyn.HybridRobot:
    """Build a crank that drives a slider by a rod, on the crank by a ball and on the slider by a cross."""
    s = Sketch(np.random.default_rng(3))
    crank = s.joint("revolute", "base", np.zeros(3), np.array([0.0, 0.0, 1.0]), motor=True)
    rod = s.joint("spherical", crank, np.array([0.3, 0.0, 0.1]))
    slider = s.joint("prismatic", "base", np.array([0.9, 0.2, 0.0]), np.array([1.0, 0.0, 0.0]))
    s.close("universal", rod, slider, np.array([0.9, 0.2, 0.05]))
    return build_robot(s.description("slider_crank"))


@pytest.mark.parametrize("law", ["together", *APART, *(slow(x) for x in LAWS if x not in APART)])
def test_joint_laws_are_neither_weights_nor_coriolis_forces(law: str) -> None:
    robot = slider_crank() if law == "ball_spring" else hybridyn.load("five_bar")
    q, v, _ = moving_states(robot, 5, 3)
    effects = choose(robot, ["default", *(together if law == "together" else LAWS[law])(robot)])
    assert effects.joints or effects.rotors
    compiled, general = interpreted_model(robot, effects, "idm"), General(robot, effects)
    close_to(compiled.gravity(q), general.gravity(q), SOLVED)
    close_to(compiled.coriolis(q, v), general.coriolis(q, v), SOLVED)
    close_to(compiled.coriolis_matrix(q, v), general.coriolis_matrix(q, v), SOLVED)


def test_friction_and_springs_leave_coriolis_forces_to_compiled_models() -> None:
    robot = hybridyn.load("five_bar")
    q, v, _ = moving_states(robot, 5, 3)
    friction, spring = (
        choose(robot, ["default", *CASES[law](robot)]) for law in ("coulomb_friction", "spring")
    )
    for effects, by_general in ((friction, 0), (spring, 5)):
        compiled = interpreted_model(robot, effects, "idm")
        compiled.gravity(q)
        compiled.coriolis(q, v)
        assert compiled.handed_over.total() == by_general
