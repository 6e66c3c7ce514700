"""What is compared, one small file each; `METHODS` is all of it.

A method whose package is absent, or that cannot do a robot, raises `NotMeasuredError` when it is set up, and
the report says so.
"""

from __future__ import annotations

from benchmarks.methods import Method, Model
from benchmarks.peers import (
    compiled,
    general,
    mujoco,
    oracle,
    proximal,
    rnea_projection,
    serial,
)

METHODS: tuple[Method, ...] = (
    *general.METHODS,
    *compiled.METHODS,
    *proximal.METHODS,
    *rnea_projection.METHODS,
    *mujoco.METHODS,
    *oracle.METHODS,
    *serial.METHODS,
)


def methods_of(model: Model) -> list[Method]:
    """Return the methods for one of the models."""
    return [method for method in METHODS if method.model == model]
