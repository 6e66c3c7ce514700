"""Effects of a written file act as those of the robot, also on links, joints and bodies that are added."""

from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.description import Description
from hybridyn.structure.building import build_robot
from tests.conversion.drawn import with_drawn_effects
from tests.conversion.features import FEATURES
from tests.conversion.judge import SAME, SINGLE, bodily, read_back
from tests.robots.mechanisms import KINDS, random_mechanism
from tests.support.samples import some

#: Effects that store no energy.
WITHOUT_ENERGY = {
    "damper",
    "coulomb_friction",
    "stribeck_friction",
    "directed_friction",
    "load_friction",
    "gear_efficiency",
    "dc_motors",
}
#: Robots with an effect that stores energy or adds mass, or that names what is written under another name.
NAMES = [
    name for name, (_, robot) in FEATURES.items() if {effect for effect, _ in robot.effects} - WITHOUT_ENERGY
]


@pytest.mark.parametrize("ending", [".xml", ".sdf", ".usda"])
@pytest.mark.parametrize("name", NAMES)
def test_energy_is_that_of_the_robot_at_home(name: str, ending: str, tmp_path: Path) -> None:
    same_energy(FEATURES[name][1], tmp_path / f"robot{ending}")


@pytest.mark.parametrize("kind", some(KINDS, ("serial_all", "loop_universal", "star_five")))
@pytest.mark.parametrize("ending", [".urdf", ".xml", ".sdf", ".usda"])
def test_drawn_effects_keep_their_energy(kind: str, ending: str, tmp_path: Path) -> None:
    d = with_drawn_effects(bodily(random_mechanism(3, kind=kind)), 3)
    same_energy(d, tmp_path / f"{kind}{ending}")


def same_energy(d: Description, target: Path) -> None:
    """Compare what the effects of a robot store at home with what those of the written file do."""
    other, _ = read_back(d, target)
    stored = []
    for one in (other, d):
        robot = build_robot(one)
        rest = np.zeros(robot.nv)
        each = [
            hybridyn.energy(robot, robot.home, rest, effects=effects).potential
            for effects in ("model", ["gravity"])
        ]
        stored.append(each[0] - each[1])
    tolerance = SINGLE if target.suffix == ".usda" else SAME
    np.testing.assert_allclose(*stored, rtol=0, atol=tolerance * max(abs(each[0]), abs(stored[1])))


@pytest.mark.parametrize(("kind", "parts"), [("planar", ["x", "y", "turn"]), ("floating", [])])
def test_dampers_stand_at_each_joint_that_is_written_for_one(
    kind: str, parts: list[str], tmp_path: Path
) -> None:
    _, d = FEATURES[f"damper, {kind}"]
    other, _ = read_back(d, tmp_path / "robot.sdf")
    expected = {f"two_{part}": 5.0 for part in parts}
    assert dict(other.effects).get("damper", {}).get("coefficient", {}) == expected
