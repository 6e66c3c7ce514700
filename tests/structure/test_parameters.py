"""Chosen numbers of a description as parameters: names, slots, and the numbers of modules that follow."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from hybridyn.errors import ModelError
from hybridyn.structure.building import build_robot
from hybridyn.structure.parameters.changed import changed
from hybridyn.structure.parameters.entries import Parameters
from hybridyn.structure.parameters.expressed import expressed
from hybridyn.structure.parameters.traced import Traced
from tests.samples import slow
from tests.shipped import shipped

ROUNDED = 1e-15  # the same formulas on other numbers

CASES = {
    "five_bar": (
        "mass:m1_left_upper", "centre:m1_left_lower", "inertia:m1_tool", "position:m1_left_elbow",
        "placement:m1_tool_mount", "position:m1_tip/predecessor",
    ),
    "gough_stewart": (
        "mass:m1_platform", "position:m1_leg1_wrist_y", "position:m1_leg2_cross_y",
        "position:m1_leg3_ball/successor",
    ),
    "delta": ("position:m1_arm1_drive", "placement:m1_arm1_rod_a_cross_y", "mass:m1_arm2_link"),
}  # fmt: skip


def at_the_other_design(x: Any) -> Any:
    """Return the numbers of a structure, traced ones as their expressions: numbers of the other design."""
    if isinstance(x, Traced):
        return [x.expression]
    if dataclasses.is_dataclass(x):
        return [y for field in dataclasses.fields(x) for y in at_the_other_design(getattr(x, field.name))]
    if isinstance(x, tuple) or (isinstance(x, np.ndarray) and x.ndim):
        return [z for y in x for z in at_the_other_design(y)]
    return [x] if isinstance(x, (int, float, np.floating)) else []


@pytest.mark.parametrize("name", ["five_bar", slow("gough_stewart"), slow("delta")])
def test_the_numbers_of_modules_follow_from_the_parameters(name: str) -> None:
    """A number's expression is here its value in another design: formulas run on both at once."""
    robot = build_robot(shipped(name))
    parameters = Parameters(robot.description, CASES[name])
    numbers = parameters.slot_values(1.07 * parameters.nominal[None])[0].tolist()
    found = expressed(robot, parameters.slots, numbers)
    other = changed(robot, parameters.slots, numbers)
    for spec, module in zip(found.specs, other.modules, strict=True):
        own, wanted = (
            at_the_other_design(dataclasses.replace(x, home=np.zeros(0)))
            for x in (spec, module.mechanism.spec)
        )
        assert len(own) == len(wanted) > 100
        np.testing.assert_allclose(own, wanted, rtol=ROUNDED, atol=ROUNDED)


def test_parameters_are_the_numbers_of_the_description() -> None:
    description = shipped("five_bar")
    parameters = Parameters(description, ["mass:m1_tool", "placement:m1_left_drive"])
    assert parameters.labels[:2] == ("mass:m1_tool", "placement:m1_left_drive.x")
    joint = next(j for j in description.joints if j.name == "m1_left_drive")
    slots = parameters.slot_values(parameters.nominal[None])[0]
    np.testing.assert_allclose(slots[1:4], joint.placement[:3, 3])
    np.testing.assert_allclose(slots[4:].reshape(3, 3), joint.placement[:3, :3], atol=ROUNDED)
    assert parameters.vector({"mass:m1_tool": 2.0})[0] == 2.0


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (["mass:m1_toll"], "there is no link 'm1_toll'.*m1_tool"),
        (["weight:m1_tool"], "there is no parameter 'weight:m1_tool'"),
        (["position:m1_tip"], "there is no joint or side of a closure 'm1_tip'"),
        (["offset:gear"], "there is no coupling 'gear'"),
        (["placement:m1_left_drive", "position:m1_left_drive"], "both set placement.*m1_left_drive"),
    ],
)
def test_wrong_parameters_are_named(names: list[str], message: str) -> None:
    with pytest.raises(ModelError, match=message):
        Parameters(shipped("five_bar"), names)
