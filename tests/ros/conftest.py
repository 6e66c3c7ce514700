"""ROS models without a compiler: all is computed by the general path."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import NoReturn

import pytest

from hybridyn.errors import CompileError
from hybridyn.ros import ros_model


def without(*_: object, **__: object) -> NoReturn:
    """Have no compiler."""
    raise CompileError("no compiler")


@contextmanager
def no_compiler() -> Iterator[None]:
    """Let ROS models find no compiler."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ros_model, "compile", without)
        yield


@pytest.fixture
def slowly() -> Iterator[None]:
    with no_compiler():
        yield
