"""What second derivatives are given and return, and the checks of both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ...errors import AT_SAMPLE, SingularityError, TrajectoryError
from ...spatial import Array
from ..code.scalars import GUARD_LIMIT
from ..programs.designs import DesignsInSlots
from ..programs.general import GENERAL

#: Largest difference of rates and accelerations from those that the motors cause, of the largest or of one:
#: above rounding, and that of tables with seven digits.
CAUSED = 1e-6


class Product(NamedTuple):
    """A product of a second derivative with weights and a direction.

    Attributes:
        value: The model's result, shape (n,) or (T, n).
        slope: Derivative of the weighted sum of results, over "q", "v" and "a" or "tau", shapes ([T,] n).
        product: Derivative of this slope along the direction, likewise.
    """

    value: Array
    slope: dict[str, Array]
    product: dict[str, Array]


class AlongPath(NamedTuple):
    """Results along a path, shapes (n,) or (T, n).

    Attributes:
        value: The model's results.
        first: Their first derivative along the path.
        second: Their second derivative along the path.
    """

    value: Array
    first: Array
    second: Array


def three(direction: Sequence[ArrayLike]) -> Sequence[ArrayLike]:
    """Return the parts of a direction.

    Raises:
        TrajectoryError: There are not three.
    """
    if len(direction) != 3:
        raise TrajectoryError(
            f"direction has {len(direction)} parts; wanted three: changes of q, of v, and accelerations or "
            "efforts"
        )
    return direction


def everywhere(rows: Array, samples: int) -> Array:
    """Return one row for every sample.

    Raises:
        TrajectoryError: There are other numbers of rows.
    """
    if len(rows) not in (1, samples):
        raise TrajectoryError(f"weights or direction have {len(rows)} samples; wanted 1 or {samples}")
    return np.broadcast_to(rows, (samples, rows.shape[1]))


def check_trusted(designs: DesignsInSlots, model: str, given: dict[str, Array], guard: Array) -> None:
    """Check the guards of samples.

    Args:
        designs: Computes samples by the general path.
        given: The model's arguments, shape (T, n) each.

    Raises:
        SingularityError: A pivot of the compiled model vanishes.
        HybridynError: As the general path raises for a sample.
    """
    bad = np.flatnonzero(~(guard <= GUARD_LIMIT))
    if not len(bad):
        return
    t = int(bad[0])
    if model in GENERAL:
        designs.general(model, given, bad)
    raise SingularityError(
        f"second derivatives of '{model}' are not to be trusted{AT_SAMPLE}: a pivot of the compiled model "
        f"nearly vanishes (guard {guard[t]:.1e}, limit {GUARD_LIMIT:g}). Move away from that posture",
        what="the compiled model",
        sample=t,
    )


def check_following(given: Mapping[str, Array], found: Mapping[str, Array]) -> None:
    """Check that rates and accelerations are those that the motors cause, with any idle motions.

    Args:
        given: Arguments by name.
        found: The motion that the motors cause, by name.

    Raises:
        TrajectoryError: They are not.
    """
    for name in [x for x in ("v", "a") if x in given]:
        off = np.abs(found[name] - given[name]).max(axis=1, initial=0.0)
        size = CAUSED * np.maximum(np.abs(given[name]).max(axis=1, initial=0.0), 1.0)
        if (off > size).any():
            t = int(np.argmax(off / size))
            raise TrajectoryError(
                f"{name} differs by {off[t]:.1e} from what the motors cause{AT_SAMPLE} (limit "
                f"{size[t]:.1e}): over motors all joints follow them, but for idle motions; take "
                "q, v, a = hybridyn.assemble(robot, motors=...)",
                sample=t,
            )
