"""The law of forces along a length: a spring with a slack range, a damper and dry friction."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

from ..description.names import did_you_mean
from ..errors import ModelError
from ..spatial import LARGEST
from .joints import Numbers

#: Fields of a law that hold a number by tendon or line.
WORDS = ("stiffness", "damping", "friction", "lower", "upper")


def stretch(lower: Any, upper: Any, length: Any) -> Any:
    """Compute by how much a length is more than `upper`, or minus how much less than `lower`."""
    return np.maximum(length - upper, 0.0) - np.maximum(lower - length, 0.0)


def tension(numbers: Any, width: Any, length: Any, rate: Any) -> Any:
    """Compute the tension along a length: arrays or expressions.

    Args:
        numbers: Those of `WORDS`, in their order.
        width: Speed scale of the sign change of friction.
        length: The length.
        rate: Its rate.
    """
    k, c, f, lower, upper = numbers
    return k * stretch(lower, upper, length) + c * rate + f * np.tanh(rate / width)


def check_numbers(
    effect: str, thing: str, known: Collection[str], without: str, tables: Mapping[str, Numbers],
    signed: Collection[str] = (),
) -> None:  # fmt: skip
    """Check the numbers of a law by tendon or line.

    Args:
        effect: Name of the law.
        thing: What has a length: "tendon" or "line".
        known: Names of all of them.
        without: What one that is unknown has not.
        tables: The numbers by word of `WORDS`.
        signed: Words whose numbers may be negative.

    Raises:
        ModelError: A name is unknown, a number is out of its range, or a slack range is reversed.
    """
    for what, numbers in tables.items():
        for name, value in numbers.items():
            if name not in known:
                raise ModelError(
                    f"{effect}: '{what}' names the {thing} '{name}', which has no {without}"
                    f"{did_you_mean(name, known)}", element=name,
                )  # fmt: skip
            least, more = (-LARGEST, "") if what in signed else (0.0, " and not negative")
            if not least <= value <= LARGEST:
                raise ModelError(
                    f"{effect}: {what} of '{name}' is {value:g}; it must be finite{more}", element=name
                )
    for name in known:
        if tables["lower"].get(name, 0.0) > tables["upper"].get(name, 0.0):
            raise ModelError(f"{effect}: lower of '{name}' is above upper", element=name)
