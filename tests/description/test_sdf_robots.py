"""Robots written twice, as SDF and as URDF, have the same models."""

from dataclasses import replace
from pathlib import Path

import pinocchio as pin
import pytest

import hybridyn
from hybridyn.structure.robot import HybridRobot
from tests.conversion.judge import same_robot
from tests.description.reading import holds
from tests.description.sdf_texts import random_pair, sdf
from tests.robots.shipped import states_near_home
from tests.support.samples import slow

#: Two readers of the same numbers, whose rotations pass through angles on different ways.
TWO_READERS = 1e-11

VERSIONS = ("1.4", "1.5", "1.6", "1.7", "1.8", "1.9", "1.10", "1.11", "1.12")


def both(seed: int, version: str, folder: Path) -> tuple[HybridRobot, HybridRobot]:
    """Return a random robot, read from URDF and from SDF."""
    pin.seed(seed)
    texts = random_pair(seed, version)
    (folder / "one.urdf").write_text('<robot name="robot">' + "\n".join(texts.urdf) + "</robot>")
    (folder / "two.sdf").write_text(sdf(*texts.sdf, version=version))
    return tuple(hybridyn.load(folder / name, motors=texts.motors) for name in ("one.urdf", "two.sdf"))  # type: ignore[return-value]


@pytest.mark.parametrize(
    ("seed", "version"),
    [
        (1, "1.4"), (2, "1.6"), (3, "1.9"),
        *(slow(seed, version) for version in VERSIONS for seed in range(4, 14)),
    ],
)  # fmt: skip
def test_both_models_are_those_of_the_urdf(seed: int, version: str, tmp_path: Path) -> None:
    urdf, read = both(seed, version, tmp_path)
    numbers = ("lower", "upper", "velocity", "effort", "damping", "friction")
    stated = {one.name: {word: getattr(one, word) for word in numbers} for one in urdf.description.joints}
    holds(read.description, {"joints": stated})
    endless = {
        name: (1.0, 0.0) for name, kind in zip(urdf.joints, urdf.kinds, strict=True) if kind == "continuous"
    }
    batch = states_near_home(replace(urdf.description, home=endless), "fixed", seed, 2)
    same_robot(urdf.description, read.description, batch, links=False, tolerance=TWO_READERS)
