"""Report an internal error of code generation as a `CompileError` of one line."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from ..errors import CompileError, HybridynError
from ..structure.robot import HybridRobot


@contextmanager
def as_compile_error(robot: HybridRobot) -> Iterator[None]:
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
        raise CompileError(
            f"the models of the robot '{robot.description.name}' cannot be compiled ({said}). This is a "
            "bug: report it with the robot's files; the general path works without them"
        ) from error
