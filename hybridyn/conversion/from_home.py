"""A robot whose joints are at zero where it stands at home, as SDF has no home posture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..description.effect_names import acts_on, is_added, named_by
from ..description.placement import angle_of, motion_of
from ..description.records import Description
from ..joints.kinds import JointKind
from .request import Losses


def counted_from_home(d: Description, losses: Losses) -> Description:
    """Return the same robot, whose joints are at zero where its links stand in the file.

    Args:
        d: The robot.
        losses: Receives the joints whose zero moves.
    """
    moved = [joint for joint in d.joints if d.closures or joint.kind == "floating"]
    home = {joint.name: d.home[joint.name] for joint in moved if joint.name in d.home}
    shift = {name: angle_of(x) for name, x in home.items() if len(x) in (1, 2)}  # of those with one freedom
    joints = []
    for joint in d.joints:
        motion, by = motion_of(joint, home), shift.get(joint.name, 0.0)
        if not np.array_equal(motion, np.eye(4)):
            if joint.kind != "floating":
                losses.add("positions of joints count from home, where the loops are closed", joint.name)
            joint = replace(joint, placement=joint.placement @ motion)
        joints.append(replace(joint, lower=joint.lower - by, upper=joint.upper - by))
    couplings = [coupling.moved(shift) for coupling in d.couplings]
    for effect, numbers in d.effects:
        on_joints = is_added(effect) and acts_on(effect) == "joint"
        if on_joints and any(shift.get(name) for _, name in named_by(effect, numbers)):
            losses.add("effects of other packages, for which joints have another zero", effect)
    effects = tuple((name, _shifted(name, numbers, shift, home)) for name, numbers in d.effects)
    left = {name: x for name, x in d.home.items() if name not in home}
    out = replace(d, joints=tuple(joints), couplings=tuple(couplings), effects=effects, home=left)
    springs = [replace(spring, rest=spring.rest - shift.get(spring.name, 0.0)) for spring in d.springs]
    return out.with_springs(springs) if springs else out


def _shifted(
    name: str, numbers: dict[str, Any], shift: Mapping[str, float], home: Mapping[str, tuple[float, ...]]
) -> dict[str, Any]:
    """Return the numbers of an effect, whose positions count from home.

    Args:
        shift: Position of home by joint with one freedom.
        home: Positions of home.
    """
    if not any(shift.get(joint) or joint in home for values in numbers.values() for joint in _names(values)):
        return numbers
    if name == "tendons":
        by: dict[str, float] = {}
        for joint, arms in numbers["arms"].items():
            for tendon, arm in arms.items():
                by[tendon] = by.get(tendon, 0.0) + arm * shift.get(joint, 0.0)
        springs = numbers.get("stiffness", {})
        bounds = {
            key: {t: numbers.get(key, {}).get(t, 0.0) - by[t] for t in springs} for key in ("lower", "upper")
        }
        return numbers | (bounds if springs else {})
    if name == "polynomial_spring":
        rest = {joint: numbers.get("rest", {}).get(joint, 0.0) for joint in numbers["coefficients"]}
        return numbers | {"rest": {joint: x - shift.get(joint, 0.0) for joint, x in rest.items()}}
    if name == "ball_spring":
        return numbers | {"rest": numbers.get("rest", {}) | {
            joint: _turned_back(home[joint], numbers.get("rest", {}).get(joint, JointKind.SPHERICAL.zero))
            for joint in numbers["stiffness"] if joint in home
        }}  # fmt: skip
    limits = {
        key: {joint: x - shift.get(joint, 0.0) for joint, x in numbers[key].items()}
        for key in ("lower", "upper") if key in numbers and name == "stop"
    }  # fmt: skip
    return numbers | limits


def _names(values: Any) -> Sequence[str]:
    """Return the names that numbers of an effect are by, none of other values."""
    return [*values] if isinstance(values, dict) else []


def _turned_back(home: Sequence[float], rest: Sequence[float]) -> list[float]:
    """Return an orientation as seen from another one: quaternions x, y, z, w."""
    (x, y, z, w), (a, b, c, d) = home, rest
    return [
        w * a - x * d - y * c + z * b,
        w * b - y * d - z * a + x * c,
        w * c - z * d - x * b + y * a,
        w * d + x * a + y * b + z * c,
    ]
