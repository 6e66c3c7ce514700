"""Advice to compile a robot, for programs that compute one sample at a time without a compiled model."""

from __future__ import annotations

import itertools
import warnings

from ..errors import PerformanceWarning

#: Calls for a single sample after which a program is advised to compile: a few seconds of computing.
MANY_CALLS = 1000

_calls = itertools.count(1)


def count_single_call() -> None:
    """Count a call of `idm` or `ddm` for one sample, and warn once in a process after `MANY_CALLS` calls."""
    if next(_calls) == MANY_CALLS:
        warnings.warn(
            f"{MANY_CALLS:,} calls for a single sample: hybridyn.compile(robot) gives a model whose idm and "
            "ddm take microseconds a call, a thousandth of this; or pass all samples in one call",
            PerformanceWarning,
            stacklevel=3,
        )
