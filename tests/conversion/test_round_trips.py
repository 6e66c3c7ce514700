"""Robots of this repository and random mechanisms, written and read back, are the same robots."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.conversion.judge import read_back, same_robot, states
from tests.mechanisms import KINDS, random_mechanism, random_states
from tests.samples import some
from tests.shipped import ROBOTS, shipped

ENDINGS = (".urdf", ".usda")
QUICK = ("five_bar",)


@pytest.mark.parametrize("name", some(ROBOTS, QUICK))
@pytest.mark.parametrize("ending", ENDINGS)
def test_shipped_robots_come_back(name: str, ending: str, tmp_path: Path) -> None:
    description = shipped(name)
    other, out = read_back(description, tmp_path / f"{name}{ending}")
    assert out.losses == ()
    same_robot(description, other, states(description))


@pytest.mark.parametrize("kind", some(KINDS, ("loop_planar", "gear_three", "serial_all")))
@pytest.mark.parametrize("ending", ENDINGS)
def test_random_mechanisms_come_back(kind: str, ending: str, tmp_path: Path) -> None:
    description = random_mechanism(3, kind=kind)
    other, out = read_back(description, tmp_path / f"{kind}{ending}")
    assert out.losses == ()
    same_robot(description, other, random_states(description, "fixed", 3, 2))
