"""What goes wrong while a model is written out and is nobody's fault but ours, in one line."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from ..errors import CompileError, HybridynError
from ..structure.robot import HybridRobot


@contextmanager
def failing_as_ours(robot: HybridRobot) -> Iterator[None]:
    """Return a `CompileError` with the robot's name for whatever is raised inside and is no error of ours.

    Raises:
        CompileError: Something was.
    """
    try:
        yield
    except HybridynError:
        raise
    except Exception as error:
        said = f"{type(error).__name__}: {error}".splitlines()[0]
        raise CompileError(
            f"the models of the robot '{robot.description.name}' cannot be written out ({said}). This is a "
            "bug: report it with the robot's files; the general path works without them"
        ) from error
