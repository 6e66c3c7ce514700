"""What a description states for a whole robot: its home position, and joints that must not be cut."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ..description.names import did_you_mean
from ..description.records import Description
from ..errors import ModelError
from ..linkage.joints import NEUTRAL, NQ
from ..spatial import Array
from .bodies import Bodies


def joints_to_keep(description: Description, held: Iterable[str]) -> frozenset[str]:
    """Return the joints that must not be cut: those in `held`, and those with an effect in the description.

    Raises:
        ModelError: A name in `held` is not a movable joint.
    """
    movable = [joint.name for joint in description.joints if joint.kind != "fixed"]
    for name in held:
        if name not in movable:
            raise ModelError(
                f"held: no such movable joint '{name}'{did_you_mean(name, movable)}", element=name
            )
    tables = [
        numbers
        for _, values in description.effects
        for numbers in values.values()
        if isinstance(numbers, dict)
    ]
    stated = {name for numbers in tables for name in numbers}
    stated |= {joint.name for joint in description.joints if joint.rotor_inertia}
    return frozenset(held) | (stated & set(movable)) - set(description.motors)


def home_of(description: Description, bodies: Bodies, kinds: list[str], base: str) -> Array:
    """Return the home position of the whole robot, shape (nq,)."""
    parts = [np.array(description.base_home or (0.0, 0, 0, 0, 0, 0, 1))] if base != "fixed" else []
    for joint, kind in zip(bodies.joints, kinds[len(parts) :], strict=True):
        value = np.asarray(description.home.get(joint.joint.name, (0.0,)), dtype=float)
        if len(value) == NQ[kind] and kind != "continuous":
            parts.append(value)
        elif kind == "continuous":
            angle = value[0] if len(value) == 1 else np.arctan2(value[1], value[0])
            parts.append(np.array([np.cos(angle), np.sin(angle)]))
        else:
            parts.append(np.array(NEUTRAL[kind]))
    return np.concatenate(parts) if parts else np.zeros(0)
