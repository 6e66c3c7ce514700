"""Other processes that do blocks of a table: started afresh, fed through pipes, gone when we are.

Each is a Python of its own that knows nothing of this one: no fork of a process with threads or of
Pinocchio's memory, no signal that reaches both (Ctrl-C is for us, we end them), and where this process dies,
whatever the reason, they find their pipe closed and end.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from ..errors import HybridynError

START = "import sys; sys.path.insert(0, sys.argv[1]); from hybridyn.streams.workers import serve; serve()"
ENVIRONMENT = {
    "OMP_NUM_THREADS": "1",  # the processes are the threads
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "MALLOC_MMAP_THRESHOLD_": str(2**30),  # large arrays come and go: memory once had is kept,
    "MALLOC_TRIM_THRESHOLD_": str(2**31),  # or a quarter of the time goes into page faults (glibc)
}


@dataclass(frozen=True)
class Failure:
    """A task that ended in an error.

    Attributes:
        error: The error.
    """

    error: Exception


class Workers:
    """Processes that take tasks in turn and give results in the same order. Use it in `with`."""

    def __init__(self, count: int) -> None:
        """Start the processes; they import what they need while the caller goes on.

        Args:
            count: How many, 0 for none.
        """
        package = str(Path(__file__).parents[2])
        environment = ENVIRONMENT | os.environ
        self._processes: list[subprocess.Popen[bytes]] = []
        self._given = self._taken = 0
        try:
            for _ in range(count):
                process = subprocess.Popen(
                    [sys.executable, "-c", START, package],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    env=environment,
                    process_group=0,  # a Ctrl-C of the terminal is not for them
                )
                self._processes.append(process)
        except BaseException:
            self.close()
            raise

    def __len__(self) -> int:
        return len(self._processes)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def prepare(self, work: object) -> None:
        """Hand every process the function that it is to call on its tasks."""
        text = pickle.dumps(work, protocol=pickle.HIGHEST_PROTOCOL)
        for process in self._processes:
            self._send(process, text)

    def give(self, arguments: tuple[Any, ...]) -> None:
        """Give the next process a task; it must have none (as many may be under way as there are processes).

        Args:
            arguments: Arguments of the function.
        """
        assert self._given - self._taken < len(self)
        text = pickle.dumps(arguments, protocol=pickle.HIGHEST_PROTOCOL)
        self._send(self._processes[self._given % len(self)], text)
        self._given += 1

    def take(self) -> Any:
        """Return the result of the oldest task, or its `Failure`.

        Raises:
            HybridynError: The process is gone.
        """
        process = self._processes[self._taken % len(self)]
        assert process.stdout is not None
        try:
            result = pickle.load(process.stdout)
        except (EOFError, pickle.UnpicklingError):
            raise self._gone(process) from None
        self._taken += 1
        return result

    def close(self) -> None:
        """End the processes, whatever they are doing."""
        for process in self._processes:
            process.kill()
        for process in self._processes:
            process.wait()
            for pipe in (process.stdin, process.stdout):
                try:
                    if pipe is not None:
                        pipe.close()
                except BrokenPipeError:  # what was not sent yet
                    pass
        self._processes = []

    def _send(self, process: subprocess.Popen[bytes], text: bytes) -> None:
        assert process.stdin is not None
        try:
            process.stdin.write(text)
            process.stdin.flush()
        except BrokenPipeError:
            raise self._gone(process) from None

    def _gone(self, process: subprocess.Popen[bytes]) -> HybridynError:
        try:
            status = process.wait(timeout=10.0)
        except subprocess.TimeoutExpired:  # it lives and sends what is no result
            process.kill()
            status = process.wait()
        reason = signal.Signals(-status).name if status < 0 else f"status {status}"
        return HybridynError(
            f"a worker process ended without a result ({reason}); if memory ran out, use fewer --jobs"
        )


def serve() -> None:
    """Work for a `Workers` at the other end of standard input and output, until it is gone."""
    tasks = os.fdopen(os.dup(0), "rb")
    results = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever prints must not write between results
    import hybridyn.assembly.assemble
    import hybridyn.dynamics.direct  # noqa: F401 - imported while the other end still reads the robot

    try:
        work = pickle.load(tasks)
        while True:
            arguments = pickle.load(tasks)
            pickle.dump(_done(work, arguments), results, protocol=pickle.HIGHEST_PROTOCOL)
            results.flush()
    except (EOFError, pickle.UnpicklingError, BrokenPipeError):  # in the middle of a task, or after it
        os._exit(0)  # nobody waits for what is left in buffers


def _done(work: Any, arguments: tuple[Any, ...]) -> Any:
    try:
        return work(*arguments)
    except Exception as error:
        try:
            pickle.loads(pickle.dumps(error))
        except Exception:
            return Failure(RuntimeError(f"{type(error).__name__}: {error}"))
        return Failure(error)
