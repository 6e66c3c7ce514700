"""What is compared; `METHODS` is all of it. Engines are those of `hybridyn compare`.

A method whose package is absent, or that cannot do a robot, raises `NotComparableError` when it is set up,
and the results say so.
"""

from __future__ import annotations

from benchmarks.peers import ours
from hybridyn.studies.compare.engines import mujoco_engine, pinocchio_engine
from hybridyn.studies.compare.methods import Method, Model

METHODS: tuple[Method, ...] = (*ours.METHODS, *pinocchio_engine.METHODS, *mujoco_engine.METHODS)


def methods_of(model: Model) -> list[Method]:
    """Return the methods for one of the models."""
    return [method for method in METHODS if method.model == model]
