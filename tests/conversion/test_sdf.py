"""Robots written as SDF and read back: the same robots, or a list of what SDF cannot say."""

from __future__ import annotations

from pathlib import Path

import pytest

from hybridyn import mass_matrix
from hybridyn.description import Description
from hybridyn.structure.building import build_robot
from tests.comparing import SOLVED, close_to
from tests.conversion.judge import read_back, same_robot, states
from tests.mechanisms import KINDS, random_mechanism, random_states
from tests.samples import some
from tests.shipped import ROBOTS, shipped

#: Losses of shipped robots: SDF keeps the name "world" for its own.
RENAMED = {
    "stewart_ur5": (
        "names that SDF does not allow, or that two things have, are changed: 'world -> world_link'",
    )
}


@pytest.mark.parametrize("name", some(ROBOTS, ("five_bar",)))
def test_shipped_robots_come_back(name: str, tmp_path: Path) -> None:
    description = shipped(name)
    other, out = read_back(description, tmp_path / f"{name}.sdf")
    assert out.losses == RENAMED.get(name, ())
    same_robot(description, other, states(description))


@pytest.mark.parametrize("kind", some(KINDS, ("gear_three", "loop_planar")))
def test_random_mechanisms_come_back(kind: str, tmp_path: Path) -> None:
    description = random_mechanism(3, kind=kind)
    other, out = read_back(description, tmp_path / f"{kind}.sdf")
    if sayable(description):
        assert out.losses == ()
        same_robot(description, other, random_states(description, "fixed", 3, 2))
        return
    assert out.losses
    one, two = build_robot(description), build_robot(other)
    assert (two.mobility, two.motors) == (one.mobility, one.motors)
    if len(one.motors) == one.mobility:
        close_to(mass_matrix(two, two.home), mass_matrix(one, one.home), SOLVED)


def sayable(description: Description) -> bool:
    """Return whether SDF has every joint and closure of a robot."""
    forms = {(closure.translations, closure.rotation) for closure in description.closures}
    others = {form for form in forms if form[0] != (0, 1, 2)} - {((0, 1), "fixed")}
    return not others and not {joint.kind for joint in description.joints} & {"planar", "floating"}
