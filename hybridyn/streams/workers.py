"""Worker processes for the blocks of a table: newly started, fed through pipes, ended with this process.

Each is a new Python interpreter: no process with threads or with Pinocchio's memory is forked, and no signal
reaches both (this process handles Ctrl-C and ends the workers). If this process dies for any reason, the
workers find their pipe closed and end.
"""

from __future__ import annotations

import os
import pickle
import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, NamedTuple, Self

from ..errors import HybridynError

if TYPE_CHECKING:
    import subprocess

START = "import sys; sys.path.insert(0, sys.argv[1]); from hybridyn.streams.workers import serve; serve()"
ENVIRONMENT = {
    "OMP_NUM_THREADS": "1",  # the processes are the threads
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "MALLOC_MMAP_THRESHOLD_": str(2**30),  # glibc: keep freed memory for the next large array,
    "MALLOC_TRIM_THRESHOLD_": str(2**31),  # else a quarter of the time is spent on page faults
}


class Failure(NamedTuple):
    """The result of a task that raised an error."""

    error: Exception


class Workers:
    """Processes that take tasks in turn and return results in the same order. A context manager."""

    def __init__(self, count: int) -> None:
        """Start the processes; they import modules while the caller continues.

        Args:
            count: Number of processes, 0 for none.
        """
        self._processes: list[subprocess.Popen[bytes]] = []
        self._given = self._taken = 0
        self._work: object = None
        if not count:
            return
        import subprocess  # most tables need one process only

        package = str(Path(__file__).parents[2])
        environment = ENVIRONMENT | os.environ
        try:
            for _ in range(count):
                process = subprocess.Popen(
                    [sys.executable, "-c", START, package],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    env=environment,
                    process_group=0,  # Ctrl-C in the terminal does not reach them
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
        """Send the function for the tasks to every process."""
        if self._processes:
            text = pickle.dumps(work, protocol=pickle.HIGHEST_PROTOCOL)
            for process in self._processes:
                self._send(process, text)

    def give(self, arguments: tuple[Any, ...]) -> None:
        """Send a task to the next process, which is idle: there are at most as many tasks as processes."""
        assert self._given - self._taken < len(self)
        text = pickle.dumps(arguments, protocol=pickle.HIGHEST_PROTOCOL)
        self._send(self._processes[self._given % len(self)], text)
        self._given += 1

    def take(self) -> Any:
        """Wait for the result of the oldest task, or its `Failure`.

        Raises:
            HybridynError: The process has ended.
        """
        process = self._processes[self._taken % len(self)]
        assert process.stdout is not None
        try:
            result = pickle.load(process.stdout)
        except (EOFError, pickle.UnpicklingError):
            raise self._ended(process) from None
        self._taken += 1
        return result

    def over(self, work: Callable[..., Any], tasks: Iterable[tuple[Any, ...]]) -> Iterator[Any]:
        """Apply a function to tuples of arguments in all processes, and yield the results in order.

        Args:
            work: The function, the same one at every call.

        Raises:
            Exception: The first one that the function raises.
        """
        if self._work is None:
            self._work = work
            self.prepare(work)
        for task in tasks:
            if self._given - self._taken == len(self):
                yield self._result()
            self.give(task)
        while self._taken < self._given:
            yield self._result()

    def _result(self) -> Any:
        """Wait for the oldest result, and raise the error of a task that failed."""
        result = self.take()
        if isinstance(result, Failure):
            raise result.error
        return result

    def close(self) -> None:
        """End the processes, idle or not."""
        for process in self._processes:
            process.kill()
        for process in self._processes:
            process.wait()
            for pipe in (process.stdin, process.stdout):
                try:
                    if pipe is not None:
                        pipe.close()
                except BrokenPipeError:  # data not sent yet
                    pass
        self._processes = []

    def _send(self, process: subprocess.Popen[bytes], text: bytes) -> None:
        assert process.stdin is not None
        try:
            process.stdin.write(text)
            process.stdin.flush()
        except BrokenPipeError:
            raise self._ended(process) from None

    def _ended(self, process: subprocess.Popen[bytes]) -> HybridynError:
        import subprocess

        try:
            status = process.wait(timeout=10.0)
        except subprocess.TimeoutExpired:  # it runs and sends something other than a result
            process.kill()
            status = process.wait()
        reason = signal.Signals(-status).name if status < 0 else f"status {status}"
        return HybridynError(
            f"a worker process ended without a result ({reason}); if memory ran out, use fewer --jobs"
        )


def serve() -> None:
    """Run the tasks of a `Workers` at the other end of standard input and output, until it ends."""
    tasks = os.fdopen(os.dup(0), "rb")
    results = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # prints must not mix with results
    import hybridyn.assembly.assemble
    import hybridyn.dynamics.direct  # noqa: F401 - imported while the other end still reads the robot

    try:
        work = pickle.load(tasks)
        while True:
            arguments = pickle.load(tasks)
            pickle.dump(_done(work, arguments), results, protocol=pickle.HIGHEST_PROTOCOL)
            results.flush()
    except (EOFError, pickle.UnpicklingError, BrokenPipeError):  # in the middle of a task, or after it
        os._exit(0)  # nobody reads what is left in buffers


def _done(work: Any, arguments: tuple[Any, ...]) -> Any:
    try:
        return work(*arguments)
    except Exception as error:
        try:
            pickle.loads(pickle.dumps(error))
        except Exception:
            return Failure(RuntimeError(f"{type(error).__name__}: {error}"))
        return Failure(error)
