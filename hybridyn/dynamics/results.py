"""What the two models return, and the advice to compile for programs that compute one sample at a time."""

import itertools
import warnings
from typing import NamedTuple

from ..errors import PerformanceWarning
from ..spatial import Array
from .reactions import Reactions

#: Calls for a single sample after which a program is advised to compile: a few seconds of computing.
MANY_CALLS = 1000

_calls = itertools.count(1)


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
        """Return what `idm` or `ddm` returns, for a single sample without the axis of samples.

        After `MANY_CALLS` calls for a single sample, warn once in a process.
        """
        if single and next(_calls) == MANY_CALLS:
            warnings.warn(
                f"{MANY_CALLS:,} calls for a single sample: hybridyn.compile(robot) gives a model whose idm "
                "and ddm take microseconds a call, a thousandth of this; or pass all samples in one call",
                PerformanceWarning,
                stacklevel=4,  # the caller of `compiled.repeated`, which calls the model
            )
        values = self.values[0] if single else self.values
        if self.reactions is None:
            return values
        return values, self.reactions.sample(0) if single else self.reactions
