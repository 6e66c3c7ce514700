"""Read a USD file in a process of its own: OpenUSD is C++, so a hostile file could end it or fill its memory.

One process serves many files, because importing OpenUSD takes half a second. A file that ends it is an error,
and the next file gets a new one.
"""

from __future__ import annotations

import contextlib
import functools
import gc
import importlib.util
import os
import pickle
import resource
import signal
import sys
import threading
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context, parent_process
from types import ModuleType

from ...errors import ModelError, install_advice
from ..bounds import BOUNDS, Bound, record, said
from ..records import RobotFile

_LOCK = threading.Lock()


def read_usd(file: str, package_dirs: Sequence[str | os.PathLike[str]] = ()) -> RobotFile:
    """Read a USD file with the layers that it names.

    Args:
        file: Path of the file.
        package_dirs: Folders, beside the robot's own, in which layers may be.

    Raises:
        ModelError: usd-core is not installed, OpenUSD refuses the file, the file names layers elsewhere, it
            takes too much time or memory, or it states something that hybridyn does not have.
    """
    if importlib.util.find_spec("pxr") is None:
        advice = install_advice("usd")
        raise ModelError(f"this is USD, for which hybridyn needs the package usd-core; {advice}", file=file)
    with _LOCK:
        answer = _answer(file, [os.fspath(folder) for folder in package_dirs])
    record(f"{os.path.abspath(file)}/stage", answer)  # with all layers, which only OpenUSD reads
    robot: RobotFile | ModelError = pickle.loads(answer)
    if isinstance(robot, ModelError):
        raise robot
    return robot


def _answer(file: str, package_dirs: list[str]) -> bytes:
    """Return what the process of OpenUSD makes of a file."""
    for _ in range(2):  # the process may have ended before, while it waited
        try:
            pool, process = _started(os.getpid())
        except (OSError, AssertionError, BrokenProcessPool) as error:
            raise ModelError(f"USD: no process could be started for OpenUSD: {error}", file=file) from None
        try:
            return pool.submit(read_in_process, os.getcwd(), file, package_dirs, BOUNDS).result()
        except BrokenProcessPool:
            _started.cache_clear()
        except BaseException:  # interrupted: its answer must not be waited for
            _started.cache_clear()
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)
            raise
    raise ModelError(
        "OpenUSD ended while it read the file; the file is damaged, or needs more than "
        f"{said('seconds')} or {said('memory')}",
        file=file,
    )


@functools.cache
def _started(process: int) -> tuple[ProcessPoolExecutor, int]:
    """Start the process of OpenUSD.

    Args:
        process: Number of this process; a fork of it starts its own.

    Returns:
        The executor that asks it, and its number.
    """
    pool = ProcessPoolExecutor(1, get_context("spawn"), _begin, (BOUNDS["memory"].most,))
    main = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")  # or the process would run the caller's script again
    try:
        answer = pool.submit(os.getpid)
    finally:
        sys.modules["__main__"] = main
    return pool, answer.result()


def _begin(memory: int) -> None:
    """Limit the process of OpenUSD, before it imports it. `memory`: most memory that it may take [bytes]."""
    os.environ.clear()  # plugins and search paths come from it
    os.environ["PXR_WORK_THREAD_LIMIT"] = "1"
    nothing = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(nothing, stream)
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    for what, most in ((resource.RLIMIT_CORE, 0), (resource.RLIMIT_AS, memory)):
        with contextlib.suppress(OSError, ValueError):  # not every system has them
            resource.setrlimit(what, (most, resource.getrlimit(what)[1]))
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """End this process when the one that started it was killed, and cannot ask it to end."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def read_in_process(folder: str, file: str, package_dirs: list[str], bounds: dict[str, Bound]) -> bytes:
    """Return a pickled `RobotFile`, or the pickled `ModelError` that refuses the file.

    Args:
        folder: Working directory of the process that asks.
        file: Path of the file.
        package_dirs: As for `read_usd`.
        bounds: Those of the process that asks.
    """
    BOUNDS.update(bounds)
    signal.alarm(BOUNDS["seconds"].most)
    answer: RobotFile | ModelError
    try:
        os.chdir(folder)
        from .usd import read_stage

        gc.collect()  # layers that are still in use would be those of the file before
        gc.freeze()  # what stays, such as OpenUSD, needs no look again
        answer = read_stage(file, package_dirs)
    except ModelError as error:
        answer = error
    except (ImportError, UnicodeDecodeError) as error:
        answer = ModelError(f"OpenUSD: {error}", file=file)
    except MemoryError:
        answer = ModelError("OpenUSD needs too much memory", file=file)
    signal.alarm(0)
    return pickle.dumps(answer)
