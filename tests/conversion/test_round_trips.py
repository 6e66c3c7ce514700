"""Robots of this repository and random mechanisms, written and read back, are the same robots."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hybridyn.conversion.from_home import counted_from_home
from hybridyn.conversion.request import Losses
from hybridyn.description import Description
from hybridyn.structure.building import build_robot
from tests.conversion.judge import (
    SAME,
    SINGLE,
    States,
    bodily,
    read_back,
    same_mass,
    same_robot,
    same_structure,
    states,
)
from tests.robots.generated import generated
from tests.robots.mechanisms import KINDS, random_mechanism, random_states
from tests.robots.shipped import ROBOTS, shipped
from tests.support.comparing import SOLVED
from tests.support.samples import slow, some

ENDINGS = (".urdf", ".xml", ".usda", ".sdf")
QUICK = ("five_bar",)


#: What MuJoCo does not have, and what changes neither motion nor efforts.
HARMLESS = (
    "speed limits", "gear ratios", "names ", "dampers are read back as viscous friction", "continuous joints",
    "axes in which hybridyn reports", "effort limits of joints without a motor", "the name of the robot",
)  # fmt: skip
#: What changes efforts, but neither joints nor closures.
HEAVIER = (
    "moving links without mass",
    "links without inertia",
    "links with inertia but without mass",
    "closures between links without mass",
)
#: Losses of shipped robots as SDF, which keeps the name "world" for its own.
RENAMED = "names that SDF does not allow, or that two things have, are changed: 'world -> world_link'"


#: What SDF has no place for: a home posture beside that in which the links stand.
FROM_HOME = "positions of joints count from home"


def judge(description: Description, target: Path, drawn: Callable[[Description], States | None]) -> None:
    """Compare a robot with what is read back, as far as nothing was lost."""
    other, out = read_back(description, target)
    losses = [line for line in out.losses if not line.startswith(FROM_HOME)]
    if len(losses) < len(out.losses):
        description = counted_from_home(description, Losses())
        moving = [joint for joint in description.joints if joint.kind != "fixed"]
        description = replace(description, home={joint.name: joint.kind.zero for joint in moving})
    changed = [line for line in losses if not line.startswith(HARMLESS)]
    if target.suffix == ".sdf":
        harmless = {line for line in losses if not line.startswith("names of couplings")} - {*changed}
        assert harmless == ({RENAMED} if target.stem == "stewart_ur5" else set())
        assert sayable(description) == (not changed)
    if target.suffix == ".sdf" and changed:
        same_mass(description, other, SOLVED)
        return
    tolerance = SINGLE if target.suffix == ".usda" else SAME
    if not changed and (batch := drawn(description)) is not None:
        same_robot(description, other, batch, tolerance=tolerance)
    elif all(line.startswith(HEAVIER) for line in changed):
        same_structure(build_robot(description), build_robot(other), tolerance=tolerance)
    else:
        assert target.suffix in (".usda", ".xml")
        heavier = any(line.startswith(HEAVIER) for line in changed)  # by a thousandth of the lightest link
        same_mass(description, other, 1e-2 if heavier else SINGLE if target.suffix == ".usda" else SOLVED)


def sayable(description: Description) -> bool:
    """Return whether SDF has every joint and closure of a robot."""
    forms = {(closure.translations, closure.rotation) for closure in description.closures}
    others = {form for form in forms if form[0] != (0, 1, 2)} - {((0, 1), "fixed")}
    return not others and not {joint.kind for joint in description.joints} & {"planar", "floating"}


@pytest.mark.parametrize("name", some(ROBOTS, QUICK))
@pytest.mark.parametrize("ending", ENDINGS)
def test_shipped_robots_come_back(name: str, ending: str, tmp_path: Path) -> None:
    description = shipped(name)
    judge(description, tmp_path / f"{name}{ending}", states)


@pytest.mark.parametrize("kind", some(KINDS, ("gear_three", "loop_planar", "loop_rows_y_perpendicular")))
@pytest.mark.parametrize("ending", ENDINGS)
def test_random_mechanisms_come_back(kind: str, ending: str, tmp_path: Path) -> None:
    description = random_mechanism(3, kind=kind)
    if ending == ".xml":
        description = bodily(description)  # MuJoCo refuses inertias that no body can have
    judge(description, tmp_path / f"{kind}{ending}", lambda d: random_states(d, "fixed", 3, 2))


@pytest.mark.parametrize("seed", [1, *(slow(seed) for seed in range(2, 40))])
@pytest.mark.parametrize("ending", ENDINGS[:-1])
def test_generated_mechanisms_keep_their_structure(seed: int, ending: str, tmp_path: Path) -> None:
    case = generated(seed)
    description = bodily(case.description) if ending == ".xml" else case.description
    drawn = case.states(2) if case.base == "fixed" else []
    judge(
        description,
        tmp_path / f"generated{ending}",
        lambda _: tuple(np.array(part) for part in zip(*drawn, strict=True))[:3] or None,  # type: ignore[return-value]
    )
