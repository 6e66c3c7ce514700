"""Call built programs: single samples with little overhead, batches in blocks and threads."""

from __future__ import annotations

import ctypes
import os
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..code.scalars import GUARD_LIMIT, Scalar
from ..program import stored
from .artifact import Artifact
from .building import best_lanes
from .cache import Built
from .direct_calls import function_of, knows_arrays
from .steps import Steps

if TYPE_CHECKING:
    from ..program import Program

Numbers = NDArray[Any]

#: Types of input and output arrays.
BORDER = {
    "float64": np.float64,
    "float32": np.float32,
    "float128": np.float64,  # NumPy has no such type: inputs are exact, outputs are rounded
}

#: Unit of a thread's share of a batch [samples], a multiple of every vector width.
BLOCK = 512
#: Least work of a thread [s]; waking a thread for less does not pay.
WORTH_WAKING = 2e-4
#: Approximate time of a vector statement [s].
STATEMENT = 2.5e-10


class Library:
    """A loaded library of programs.

    Attributes:
        built: The library's file.
        about: Description of its programs (`Source.about`).
        dtype: Type of input and output arrays.
        programs: The programs by name.
        steps: Time steps in C, or None if the library has none.
    """

    def __init__(self, built: Built) -> None:
        self.built: Built | None = built
        self.about = built.about
        self.dtype = np.dtype(BORDER[built.about["number"]])
        free = ctypes.CDLL(str(built.path))  # releases the interpreter's lock during a call
        held = ctypes.PyDLL(str(built.path))  # holds it: releasing does not pay for a microsecond
        alone = getattr(sys, "_is_gil_enabled", lambda: True)()  # single calls share one workspace
        cpython = sys.implementation.name == "cpython"
        plain = alone and cpython and built.about["lanes"] > 1 and knows_arrays(held, self.dtype)
        self.programs = {
            name: Calls(name, about, built.about["number"], built.about["lanes"], free, held, plain)
            for name, about in built.about["programs"].items()
        }
        steps = alone and built.about["steps"]
        self.steps: Steps | None = None
        if steps:
            lift, ddm = self.programs["lift"], self.programs["ddm"]
            self.steps = Steps(held, lift.outputs, dict(ddm.inputs)["tau"])

    def program(self, name: str) -> Calls | None:
        """Return the calls of a program, or None if there is none of this name."""
        return self.programs.get(name)

    def batch(self, name: str, *inputs: ArrayLike, threads: int = 1) -> tuple[tuple[Numbers, ...], Numbers]:
        """Run a program for many samples.

        Args:
            inputs: Its inputs, shapes (T, n).
            threads: Number of threads.

        Returns:
            Its outputs, shapes (T, n), and the samples' guards, shape (T,).
        """
        return self.programs[name].batch(inputs, threads)


class Calls:
    """The calls of one program.

    Attributes:
        block: Number of samples that a thread takes at once.
        address: Address of the function for one sample and other C; 0 where there is none.
    """

    def __init__(
        self,
        name: str,
        about: dict[str, Any],
        number: str,
        lanes: int,
        free: ctypes.CDLL,
        held: ctypes.PyDLL,
        plain: bool,
    ) -> None:
        dtype = np.dtype(BORDER[number])
        self.name, self.dtype = name, dtype
        self.inputs: list[tuple[str, int]] = [(n, size) for n, size in about["inputs"]]
        self.outputs: list[tuple[str, int]] = [(n, size) for n, size in about["outputs"]]
        self.size = sum(size for _, size in self.outputs)
        self._work = about["work"]
        sample = max(about["statements"], 1) * STATEMENT / lanes
        self.block = -(-int(WORTH_WAKING / sample + 1) // BLOCK) * BLOCK
        self._batch = getattr(free, f"{name}_batch")
        self._batch.restype = None
        self._batch.argtypes = [ctypes.c_longlong] * 2 + [ctypes.c_void_p] * 4
        self._memory = threading.local()
        self.trusted = GUARD_LIMIT
        self.at_once: Callable[..., int] | None = None
        single = getattr(held, f"{name}_single_at", 0)
        self.address = ctypes.cast(single, ctypes.c_void_p).value or 0
        if plain:
            self.at_once = function_of(held, f"{name}_call")

    def split(self, out: Numbers) -> tuple[Numbers, ...]:
        """Split an array of all outputs."""
        return tuple(out[at : at + size] for _, size, at in stored(self.outputs))

    def batch(self, inputs: Any, threads: int) -> tuple[tuple[Numbers, ...], Numbers]:
        """Run many samples.

        Args:
            inputs: Inputs, shapes (T, n).
            threads: Number of threads.

        Returns:
            Outputs, shapes (T, n), and guards, shape (T,).
        """
        arrays = [np.ascontiguousarray(x, self.dtype) for x in inputs]
        samples = len(arrays[0])
        for array, (name, size) in zip(arrays, self.inputs, strict=True):
            if array.shape != (samples, size):
                raise ValueError(f"{name} has shape {array.shape}; wanted ({samples}, {size})")
        if samples == 1 and self.at_once is not None:  # the same bits, without unused lanes
            rows, out = [array[0] for array in arrays], np.empty(self.size, self.dtype)
            guard = np.empty(1, self.dtype)
            if self.at_once(*rows, out, guard) == 0:
                return tuple(part[None] for part in self.split(out)), guard
        outs = tuple(np.empty((samples, size), self.dtype) for _, size in self.outputs)
        guard = np.empty(samples, self.dtype)
        pointers = [(ctypes.c_void_p * len(x))(*map(_address, x)) for x in (arrays, outs)]
        guard_at = _address(guard)

        def run(start: int, stop: int) -> None:
            """Run one block of samples."""
            self._batch(start, stop, pointers[0], pointers[1], guard_at, self._workspace())

        in_blocks(run, samples, self.block, threads)
        return outs, guard

    def _workspace(self) -> int:
        """Return the address of this thread's workspace, aligned for the widest vectors."""
        if not hasattr(self._memory, "array"):
            self._memory.array = np.zeros(self._work + 64, np.uint8)
            self._memory.at = -(-self._memory.array.ctypes.data // 64) * 64
        at: int = self._memory.at
        return at


def _address(array: Numbers) -> int:
    """Return the address of an array's numbers; `array.ctypes.data` takes five times as long."""
    at: int = array.__array_interface__["data"][0]
    return at


@cache
def pool(threads: int) -> ThreadPoolExecutor:
    """Return the thread pool, whose threads sleep between calls."""
    return ThreadPoolExecutor(threads, thread_name_prefix="hybridyn")


def in_blocks(run: Callable[[int, int], None], count: int, block: int, threads: int) -> None:
    """Call `run` with start and stop of each block of `count` samples, in threads; with one thread, once."""
    if threads <= 1 or count <= block:
        run(0, count)
    else:
        starts = range(0, count, block)
        list(pool(threads).map(run, starts, [min(start + block, count) for start in starts]))


if hasattr(os, "register_at_fork"):  # a forked child has none of the threads and must not wait for them
    os.register_at_fork(after_in_child=pool.cache_clear)


def load(
    programs: list[Program], *, dtype: str = "float64", lanes: int | None = None, key: str | None = None
) -> Library:
    """Load programs from the cache, or build and load them.

    Args:
        programs: The programs.
        dtype: "float64" or "float32"; for studies, with one lane, also "float128".
        lanes: Numbers in a vector; None chooses what suits this machine.
        key: Text that determines the programs; None takes the hash of their source.
    """
    from ..code.library_source import library_source

    if lanes is None:
        lanes = best_lanes(dtype) if dtype in ("float64", "float32") else 1
    scalar = Scalar(dtype, lanes)
    source = library_source(programs, scalar)
    libraries = ("-lquadmath",) if dtype == "float128" else ()
    return Artifact(None, key or source.digest, lambda: source, libraries=libraries).loaded(Library)
