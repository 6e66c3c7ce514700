"""What `test_beside.py` lets other processes build; they import this file, and no robots."""

import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

from hybridyn.compiled.code.library_source import Source, library_source
from hybridyn.compiled.code.scalars import Scalar
from hybridyn.compiled.library.artifact import Artifact
from hybridyn.compiled.library.cache import Built
from hybridyn.compiled.library.current import Current
from hybridyn.errors import CompileError
from tests.compiled.toys import numbered, toy


def source() -> Source:
    return library_source([toy(4, 2)], Scalar("float64", 1))


def artifact(
    check: Callable[[Built], None] | None = None, key: str = "a toy", write: Callable[[], Source] = source
) -> Artifact:
    return Artifact(None, key, write, check)


class Model(Current):
    """Models that no library has, until it is built."""

    def __init__(self, *asked: Any) -> None:
        nowhere: Any = SimpleNamespace(built=None)
        super().__init__(nowhere, lambda models: None, artifact(*asked))


class Witness:
    """What is asked for; it notes the thread in which it is pickled."""

    threads: ClassVar[list[str]] = []

    def __reduce__(self) -> tuple[type, tuple[()]]:
        """Note the thread."""
        self.threads.append(threading.current_thread().name)
        return Witness, ()

    def __call__(self) -> Source:
        """Write the source."""
        return numbered(1)


def refuse(built: Built) -> None:
    """Refuse every library."""
    raise CompileError("it is wrong")


def alone(folder: Path, built: Built) -> None:
    """Fail where another process does so at the same time."""
    folder.mkdir()
    time.sleep(0.2)
    folder.rmdir()
