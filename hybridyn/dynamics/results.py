"""What the two models return."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from ..spatial import Array

if TYPE_CHECKING:  # most calls want no reactions
    from .reactions import Reactions


class Result(NamedTuple):
    """Result of a model as a batch.

    Attributes:
        values: Efforts, shape (T, motors), [N or N m], or accelerations, shape (T, nv), [m/s^2, rad/s^2].
        residual: Largest closure residual of each sample, as computed by `closure_residual`, shape (T,).
        reactions: Wrenches between modules and in the closures, or None if they were not requested.
    """

    values: Array
    residual: Array
    reactions: Reactions | None

    def returned(self, single: bool) -> Array | tuple[Array, Reactions]:
        """Return what `idm` or `ddm` returns, for a single sample without the axis of samples."""
        values = self.values[0] if single else self.values
        if self.reactions is None:
            return values
        return values, self.reactions.sample(0) if single else self.reactions
