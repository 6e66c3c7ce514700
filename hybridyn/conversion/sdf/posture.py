"""Count the positions of joints from the posture in which an SDF file states its links.

SDF has no home posture: joints are at zero where the links stand. Loops have to be closed there. A robot with
closures therefore stands at home, and a tree at zero, but for its free bodies.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ...description.placement import angle_of, motion_of
from ...description.records import Coupling, Description
from ..request import Losses


def counted_from_home(d: Description, losses: Losses) -> Description:
    """Return the same robot, whose joints are at zero where its links stand in the file.

    Args:
        losses: Receives the joints whose zero moves.
    """
    home = {
        joint.name: d.home[joint.name]
        for joint in d.joints
        if joint.name in d.home and (d.closures or joint.kind == "floating")
    }
    joints = []
    for joint in d.joints:
        motion = motion_of(joint, home)
        if not np.array_equal(motion, np.eye(4)):
            if joint.kind != "floating":
                losses.add("positions of joints count from home, where the loops are closed", joint.name)
            joint = replace(joint, placement=joint.placement @ motion)
        shift = _shift(joint.name, home)
        joints.append(replace(joint, lower=joint.lower - shift, upper=joint.upper - shift))
    moved = replace(
        d,
        joints=tuple(joints),
        couplings=tuple(_shifted(coupling, home) for coupling in d.couplings),
        effects=tuple((name, _effect(numbers, home)) for name, numbers in d.effects),
        home={name: x for name, x in d.home.items() if name not in home},
    )
    springs = [replace(spring, rest=spring.rest - _shift(spring.name, home)) for spring in d.springs]
    return moved.with_springs(springs) if springs else moved


def _shift(name: str, home: Mapping[str, tuple[float, ...]]) -> float:
    """Return the home position of a joint with one freedom [m or rad], 0 of any other."""
    x = home.get(name, ())
    return angle_of(x) if len(x) in (1, 2) else 0.0


def _shifted(coupling: Coupling, home: Mapping[str, tuple[float, ...]]) -> Coupling:
    moved = sum(factor * _shift(name, home) for name, factor in coupling.terms)
    return replace(coupling, offset=coupling.offset - moved)


def _effect(numbers: dict[str, Any], home: Mapping[str, tuple[float, ...]]) -> dict[str, Any]:
    """Return the numbers of an effect, whose limits by joint count from home."""
    limits = {
        key: {name: x - _shift(name, home) for name, x in numbers[key].items()}
        for key in ("lower", "upper") if key in numbers
    }  # fmt: skip
    return numbers | limits
