"""Closures from Pinocchio's constraint models, and checks of models and constraints.

The fields of a `pinocchio.Model` can be set to anything; Pinocchio itself may then crash.

`RigidConstraintModel` and the point and frame anchors of Pinocchio 4 state that frame 1 on joint 1 and
frame 2 on joint 2 coincide, in their origins (3 rows) or altogether (6 rows). The reference frame is
where Pinocchio expresses the forces of a constraint; the constraint itself is the same in each.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from ...errors import ModelError
from ..closure_forms import FORMS, closure_of
from ..names import did_you_mean, listed
from ..records import Closure
from ..urdf.xml_node import LARGEST_NUMBER

#: Fields with a number for each freedom or coordinate: which of both, and whether it may be infinite.
NUMBERS = {
    "armature": ("nv", False), "damping": ("nv", False), "friction": ("nv", False),
    "rotorInertia": ("nv", False), "rotorGearRatio": ("nv", False), "effortLimit": ("nv", True),
    "velocityLimit": ("nv", True), "lowerPositionLimit": ("nq", True), "upperPositionLimit": ("nq", True),
}  # fmt: skip
#: Largest difference of R^T R from the identity for a rotation that was rounded in single precision.
ROTATION = 1e-5


def joint_error(model: pin.Model, joint: int, message: str) -> ModelError:
    """Return the error about a joint of a model."""
    name = str(model.names[joint])
    return ModelError(f"Pinocchio model '{model.name}': joint '{name}': {message}", element=name)


def check_model(model: pin.Model) -> None:
    """Check the tree, placements, inertias and numbers of a model.

    Raises:
        ModelError: A joint hangs on one that follows it, or a number is not finite, or out of its range.
    """
    name = f"Pinocchio model '{model.name}'"
    for joint in range(1, model.njoints):
        inertia, problem = model.inertias[joint], ""
        if not 0 <= int(model.parents[joint]) < joint:
            problem = f"hangs on joint {model.parents[joint]}, which does not come before it"
        elif not is_placement(model.jointPlacements[joint]):
            problem = "its placement is not a finite rigid motion"
        elif not is_finite([inertia.mass, *inertia.lever, *np.ravel(inertia.inertia)]) or inertia.mass < 0:
            problem = "mass, lever and inertia must be finite, and the mass not negative"
        if problem:
            raise joint_error(model, joint, problem)
    for frame in model.frames:
        if not is_placement(frame.placement) or not 0 <= int(frame.parentJoint) < model.njoints:
            raise ModelError(
                f"{name}: frame '{frame.name}': its placement is not a finite rigid motion on a joint"
            )
    for word, (count, endless) in NUMBERS.items():
        numbers = np.asarray(getattr(model, word), dtype=float)
        good = not np.isnan(numbers).any() if endless else is_finite(numbers)
        if numbers.shape != (getattr(model, count),) or not good:
            what = "numbers" if endless else "finite numbers"
            raise ModelError(f"{name}: model.{word} must have {getattr(model, count)} {what}")
    if not is_finite(model.gravity.linear):
        raise ModelError(f"{name}: its gravity is not finite")


def is_placement(placement: pin.SE3) -> bool:
    """Say whether a placement is finite and its rotation is one, up to single precision."""
    R = np.array(placement.rotation)
    if not is_finite(placement.homogeneous) or np.abs(R).max() > 2:
        return False
    return bool(np.abs(R.T @ R - np.eye(3)).max() < ROTATION and np.linalg.det(R) > 0)


def is_finite(values: Any) -> bool:
    """Say whether all numbers are as small as those of a file have to be."""
    return bool((np.abs(np.asarray(values, dtype=float)) <= LARGEST_NUMBER).all())


#: Kinds of closure by the names of Pinocchio's classes, those of its development branch included.
ANCHORS = {
    "PointAnchorConstraintModel": "point",
    "FrameAnchorConstraintModel": "fixed",
    "BilateralPointConstraintModel": "point",
    "WeldConstraintModel": "fixed",
}
#: What must be zero in a constraint that closes a loop for good.
OFFSETS = (
    "desired_contact_velocity", "desired_contact_acceleration", "desired_constraint_offset",
    "desired_constraint_velocity", "desired_constraint_acceleration",
)  # fmt: skip


def plain_constraints(constraints: Any) -> list[Any]:
    """Return the constraint models of a list, one alone or lists in a tuple, taken out of their variants."""
    word = type(constraints).__name__
    if word.endswith("ConstraintModel") and not word.startswith("StdVec"):
        return [constraints.extract() if hasattr(constraints, "extract") else constraints]
    if constraints is None:
        return []
    if not isinstance(constraints, Iterable):
        raise ModelError(f"constraint_models holds a {word}, which is not a constraint of Pinocchio")
    return [one for item in constraints for one in plain_constraints(item)]


def closures_of(
    model: pin.Model, constraints: Sequence[Any], links: Sequence[str], kinds: Mapping[str | int, str]
) -> list[Closure]:
    """Return a closure for each constraint model.

    Args:
        links: Name of the link of each joint of the model.
        kinds: Kinds of closure that replace those of the constraints, by the constraint's name or number;
            their axis is the third axis of the constraint's frames.

    Raises:
        ModelError: A constraint is soft, moves, is not a closure, or `kinds` names what does not exist.
    """
    names: list[str] = []
    for number, constraint in enumerate(constraints):
        stated = str(getattr(constraint, "name", ""))
        names.append(stated if stated and stated not in names else f"constraint{number}")
    for key, kind in kinds.items():
        if key not in names and not (isinstance(key, int) and 0 <= key < len(names)):
            raise ModelError(
                f"kinds: no constraint is called {key!r}{did_you_mean(str(key), names)}; "
                f"they are {listed(names)}"
            )
        if kind not in FORMS or kind == "universal":
            known = [form for form in FORMS if form != "universal"]
            raise ModelError(
                f"kinds: unknown kind {kind!r}{did_you_mean(kind, known)}; known: {listed(known)}"
            )
    return [
        _closure(model, constraint, name, links, kinds.get(name, kinds.get(number)))
        for number, (constraint, name) in enumerate(zip(constraints, names, strict=True))
    ]


def _closure(model: pin.Model, constraint: Any, name: str, links: Sequence[str], kind: str | None) -> Closure:
    word = type(constraint).__name__
    if isinstance(constraint, pin.RigidConstraintModel):
        own = {pin.ContactType.CONTACT_3D: "point", pin.ContactType.CONTACT_6D: "fixed"}.get(constraint.type)
    else:
        own = ANCHORS.get(word)
    if own is None:
        raise ModelError(
            f"constraint '{name}' is a {word}, which closes no loop; pass the point and frame constraints "
            "alone (limits and friction are taken from the model)",
            element=name,
        )
    if problem := _problem(constraint, model.njoints):
        raise ModelError(f"constraint '{name}': {problem}", element=name)
    frames = (constraint.joint1_placement, constraint.joint2_placement)
    ends = (links[number] for number in (constraint.joint1_id, constraint.joint2_id))
    sides = ((link, np.array(frame.homogeneous)) for link, frame in zip(ends, frames, strict=True))
    return closure_of(name, kind or own, sides)


def _problem(constraint: Any, joints: int) -> str:
    """Return why a constraint does not hold two frames of the model together, "" if it does."""
    placement = getattr(constraint, "desired_contact_placement", None)
    moved = ["desired_contact_placement"] if placement is not None and not placement.isIdentity(1e-12) else []
    values = {word: getattr(constraint, word, None) for word in OFFSETS}
    moved += [word for word, x in values.items() if x is not None and np.any(getattr(x, "vector", x))]
    if moved:
        return (
            f"{listed(moved)} is not zero, so its frames do not coincide; set it to zero and put the offset "
            "into joint1_placement"
        )
    for side in (1, 2):
        joint = getattr(constraint, f"joint{side}_id")
        if not 0 <= joint < joints:
            return f"joint {joint} does not exist; the model has {joints}"
        if not is_placement(getattr(constraint, f"joint{side}_placement")):
            return f"joint{side}_placement is not a finite rigid motion"
    return ""
