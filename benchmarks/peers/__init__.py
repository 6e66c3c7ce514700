"""What is compared, one small file each; `METHODS` is all of it.

A method whose package is absent, or that cannot do a robot, raises `NotMeasuredError` when it is set up, and
the results say so. Robots come into Pinocchio and MuJoCo as in `hybridyn compare`.
"""

from __future__ import annotations

from benchmarks.methods import Method, Model
from benchmarks.peers import mujoco, ours, pinocchio_loops, trees

METHODS: tuple[Method, ...] = (*ours.METHODS, *pinocchio_loops.METHODS, *trees.METHODS, *mujoco.METHODS)


def methods_of(model: Model) -> list[Method]:
    """Return the methods for one of the models."""
    return [method for method in METHODS if method.model == model]
