"""Read the constraint models of Pinocchio that close loops.

`RigidConstraintModel` and the point and frame anchors of Pinocchio 4 state that frame 1 on joint 1 and
frame 2 on joint 2 coincide, in their origins (3 rows) or altogether (6 rows). The reference frame is
where Pinocchio expresses the forces of a constraint; the constraint itself is the same in each. Limits and
friction of joints are noted: the model states them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from ..errors import ModelError
from .closure_forms import FORMS, closure_of
from .joint_words import ANCHORS, UNIVERSAL
from .names import DROPS, did_you_mean, listed
from .records import Array, Closure
from .urdf.xml_node import LARGEST_NUMBER

#: Largest difference of R^T R from the identity for a rotation that was rounded in single precision.
ROTATION = 1e-5
#: Constraints that close no loop: limits and friction are taken from the model.
OF_JOINTS = ("JointLimitConstraintModel", "JointFrictionConstraintModel")
#: What a constraint may state of the place and the motion of one frame relative to the other.
DESIRED = (
    "desired_contact_placement", "desired_contact_velocity", "desired_contact_acceleration",
    "desired_constraint_offset", "desired_constraint_velocity", "desired_constraint_acceleration",
)  # fmt: skip
#: Constraints with which Pinocchio computes these; it leaves out those of all others. An offset is read.
WITH_OFFSET, OFFSET = (
    ("PointAnchorConstraintModel", "BilateralPointConstraintModel"), "desired_constraint_offset"
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
        if kind not in FORMS or kind == UNIVERSAL:
            known = [form for form in FORMS if form != UNIVERSAL]
            raise ModelError(
                f"kinds: unknown kind {kind!r}{did_you_mean(kind, known)}; known: {listed(known)}"
            )
    return [
        _closure(model, constraint, name, links, kinds.get(name, kinds.get(number)))
        for number, (constraint, name) in enumerate(zip(constraints, names, strict=True))
        if type(constraint).__name__ not in OF_JOINTS
    ]


def _closure(model: pin.Model, constraint: Any, name: str, links: Sequence[str], kind: str | None) -> Closure:
    word = type(constraint).__name__
    own = ANCHORS.get(word) or ANCHORS.get(getattr(getattr(constraint, "type", None), "name", ""))
    if own is None:
        raise ModelError(
            f"constraint '{name}' is a {word}, which closes no loop; pass the point and frame constraints "
            "alone, and state contacts as the effect ground_contact",
            element=name,
        )
    if problem := _problem(constraint, model.njoints):
        raise ModelError(f"constraint '{name}': {problem}", element=name)
    frames = [constraint.joint1_placement, constraint.joint2_placement]
    if word in WITH_OFFSET and (offset := getattr(constraint, OFFSET, None)) is not None:
        frames[0] = frames[0] * pin.SE3(np.eye(3), np.array(offset))  # point 2 is there in frame 1
    ends = (links[number] for number in (constraint.joint1_id, constraint.joint2_id))
    sides = ((link, np.array(frame.homogeneous)) for link, frame in zip(ends, frames, strict=True))
    return closure_of(name, kind or own, sides)


def _problem(constraint: Any, joints: int) -> str:
    """Return why a constraint does not hold two frames of the model together, "" if it does."""
    moved = [word for word in _desired(constraint) if word != OFFSET]
    if type(constraint).__name__ in WITH_OFFSET and moved:
        return f"{listed(moved)} is not zero, so that its points do not stay together; set it to zero"
    for side in (1, 2):
        joint = getattr(constraint, f"joint{side}_id")
        if not 0 <= joint < joints:
            return f"joint {joint} does not exist; the model has {joints}"
        if not is_placement(getattr(constraint, f"joint{side}_placement")):
            return f"joint{side}_placement is not a finite rigid motion"
    return ""


def _desired(constraint: Any) -> list[str]:
    """Return which of `DESIRED` a constraint states."""
    out = []
    for word in DESIRED:
        value = getattr(constraint, word, None)
        if isinstance(value, pin.SE3):
            value = pin.log6(value)
        if value is not None and np.any(getattr(value, "vector", value)):
            out.append(word)
    return out


def notes_on(constraints: Sequence[Any]) -> dict[str, list[str]]:
    """Return what is not read of constraints, as in `noted`."""
    names = [str(getattr(one, "name", "")) or type(one).__name__ for one in constraints]
    pairs = list(zip(names, constraints, strict=True))
    return {
        "constraints {} are limits or friction of joints, which are taken from the model":
            [name for name, one in pairs if type(one).__name__ in OF_JOINTS],
        "desired places and motions of constraints {} are not read: Pinocchio's dynamics leave them out, too "
        "(put an offset into joint1_placement)":
            [name for name, one in pairs if type(one).__name__ not in WITH_OFFSET and _desired(one)],
        "constraints {} have Baumgarte numbers, which are not read: loops stay closed exactly":
            [name for name, one in pairs if _baumgarte(one)],
        f"{DROPS} the compliance of constraints {{}}: they hold as rigid ones":
            [name for name, one in pairs if np.any(_compliance(one))],
    }  # fmt: skip


def _baumgarte(constraint: Any) -> bool:
    """Say whether a constraint that closes a loop states stiffness or damping against drift."""
    words = ("m_baumgarte_parameters", "baumgarte_corrector_parameters")
    numbers = [getattr(constraint, word) for word in words if hasattr(constraint, word)]
    return type(constraint).__name__ not in OF_JOINTS and any(x.Kp or x.Kd for x in numbers)


def _compliance(constraint: Any) -> Array:
    """Return the compliance of a constraint that closes a loop, none where the class has none."""
    if type(constraint).__name__ in OF_JOINTS or not hasattr(constraint, "retrieveCompliance"):
        return np.zeros(0)
    return np.asarray(constraint.retrieveCompliance(), dtype=float)


def is_placement(placement: pin.SE3) -> bool:
    """Say whether a placement is finite and its rotation is one, up to single precision."""
    R = np.array(placement.rotation)
    if not is_finite(placement.homogeneous) or np.abs(R).max() > 2:
        return False
    return bool(np.abs(R.T @ R - np.eye(3)).max() < ROTATION and np.linalg.det(R) > 0)


def is_finite(values: Any) -> bool:
    """Say whether all numbers are as small as those of a file have to be."""
    return bool((np.abs(np.asarray(values, dtype=float)) <= LARGEST_NUMBER).all())
