"""Check that the records that parameters name are there, and that their numbers are possible."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...description.names import did_you_mean
from ...description.records import Description
from ...errors import ModelError
from ...spatial import Array
from ..payload import loaded
from .slots import NUMBERS, Slot

#: Fields whose numbers must not be negative, in parameters as in files.
NOT_NEGATIVE = ("mass", "stiffness", "damping", "friction")


def check_known(name: str, of: str, names: Sequence[str], what: str) -> None:
    """Check that a record exists."""
    if of not in names:
        hint = did_you_mean(of, names)
        raise ModelError(f"parameter '{name}': there is no {what} '{of}'{hint}", element=of)


def check_one(name: str, of: str, names: Sequence[str], what: str) -> None:
    """Check that there is exactly one record of a name."""
    check_known(name, of, names, what)
    if names.count(of) > 1:
        raise ModelError(
            f"parameter '{name}': there are {names.count(of)} of {what} '{of}': state one instead", element=of
        )


def check_load(name: str, description: Description, of: str) -> None:
    """Check that a link has the numbers of its own and of its payload."""
    link = next(link for link in description.links if link.name == of)
    own = loaded(link, next(load for load in description.loads if load.name == of))
    if not all(np.array_equal(getattr(link, field), getattr(own, field)) for field in NUMBERS["links"]):
        raise ModelError(
            f"parameter '{name}': the numbers of link '{of}' were changed after its payload was added: add "
            "the payload last",
            element=of,
        )


def check_signs(slots: Sequence[Slot], numbers: Array) -> None:
    """Check that no number is negative that must not be.

    Args:
        numbers: Numbers in the slots of a design, shape (slots,), or of each design, shape (designs, slots).
    """
    for slot, own in zip(slots, np.atleast_2d(numbers).T, strict=True):
        if slot.field in NOT_NEGATIVE and (own < 0).any():
            first = int(np.flatnonzero(own < 0)[0])
            wrong = f"cannot be {own[0]:g}" if numbers.ndim == 1 else f"is negative in design {first}"
            raise ModelError(f"{slot} {wrong}", element=slot.name)
