"""Errors where code cannot be generated, CasADi is missing, or a library differs from the general path."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import CompileError, HybridynError, install_advice
from ..spatial import Array
from ..structure.robot import HybridRobot


@contextmanager
def as_compile_error(robot: HybridRobot | None) -> Iterator[None]:
    """Turn every exception inside that is no `HybridynError` into a `CompileError` with the robot's name.

    Raises:
        CompileError: Another exception was raised inside.
    """
    try:
        yield
    except HybridynError:
        raise
    except Exception as error:
        said = f"{type(error).__name__}: {error}".splitlines()[0]
        whose = f" of the robot '{robot.description.name}'" if robot else ""
        raise CompileError(
            f"the models{whose} cannot be compiled ({said}). This is a bug: report it with the robot's "
            "files; the general path works without them"
        ) from error


BUG = "it is not used. This is a bug: report it with the robot's files; the general path is right"


def difference(result: NDArray[Any], reference: Array) -> Array:
    """Compute the difference of each sample, shape (T, ...), relative to its largest entry, shape (T,)."""
    axes = tuple(range(1, reference.ndim))
    scale = np.abs(reference).max(axis=axes, initial=0.0)
    out: Array = np.abs(result - reference).max(axis=axes, initial=0.0) / np.where(scale > 0, scale, 1.0)
    return out


def check_agreement(robot: HybridRobot, what: str, off: Any, limit: Any) -> None:
    """Check that differences of something compiled from the general path are within their limits.

    Args:
        what: What is compiled.
        off: The differences, relative to the largest entry of a result.
        limit: The limits.

    Raises:
        CompileError: A difference is not; it may be NaN.
    """
    off, limit = (x.ravel() for x in np.broadcast_arrays(off, limit))
    if (off <= limit).all():
        return
    worst = int(np.argmax(np.where(np.isnan(off), np.inf, off / limit)))
    raise CompileError(
        f"the compiled {what} of the robot '{robot.description.name}' differs from the general path by "
        f"{off[worst]:.2g} of its largest entry (limit {limit[worst]:.2g}) at a random state: {BUG}"
    )


WITHOUT_CASADI = (
    f"compiling a model needs CasADi: {install_advice('compiled')}, "
    "or CasADi alone with `pip install casadi`; the general path works without it"
)


def needs_casadi() -> None:
    """Check that CasADi is installed.

    Raises:
        CompileError: CasADi is not installed; the message says how to install it.
    """
    if importlib.util.find_spec("casadi") is None:
        raise CompileError(WITHOUT_CASADI)
