"""Kernels on arrays from anywhere: their launch, the samples in doubt, and who computes these instead."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from ..compiled import as_compile_error
from ..errors import ModelError, TrajectoryError
from ..structure.robot import HybridRobot
from .arrays import Arrays, tape_of
from .fallback import Fallback
from .functions import InWarp, wp


class Launcher:
    """Launches the kernels of a robot, and counts the samples whose guard is above 1."""

    def __init__(self, robot: HybridRobot, arrays: Arrays) -> None:
        self._robot, self._arrays = robot, arrays
        self._counters = defaultdict[str, Any](partial(arrays.empty, 1, number=wp.int32))

    @property
    def failed(self) -> dict[str, int]:
        """Number of samples so far whose guard was above 1, by call. Reading it waits for the device."""
        counts = {name: int(counter.numpy()[0]) for name, counter in self._counters.items()}
        return {name: count for name, count in counts.items() if count}

    def has_run(self, name: str) -> bool:
        """Return whether a kernel has run."""
        return name in self._counters

    def forget(self, name: str) -> None:
        """Forget the samples of a kernel so far."""
        self._counters[name].zero_()

    def run(
        self, made: InWarp, given: dict[str, Any], fallback: Fallback | None = None,
        record: Callable[..., None] | None = None,
    ) -> tuple[Any, ...]:  # fmt: skip
        """Launch a kernel; return its results and the guards.

        Args:
            given: Its inputs by name; the first one decides how many samples there are.
            fallback: Computes the samples whose guard is above 1; None leaves them NaN.
            record: Records the call on a tape, see `Taping`; None if it has no gradient.

        Raises:
            HybridynError: An array is wrong, the device is full, there is no gradient that a tape asks for,
                or what the fallback raises.
        """
        native, arrays, tape = made.native, self._arrays, tape_of(given)
        if tape is not None and record is None:
            raise _without_gradient(native.name)
        widths, (first, like) = dict(native.inputs), next(iter(given.items()))
        if given.keys() != widths.keys():
            raise ModelError(f"the base does not move: '{native.name}' takes no base_acceleration")
        with arrays.stream(like):
            read = {name: arrays.given(name, x, widths[name]) for name, x in given.items()}
            if read[first].ndim != 2 or not read[first].shape[0]:
                raise TrajectoryError(
                    f"{first} has shape {tuple(read[first].shape)}; wanted (N, {widths[first]}), N at least 1"
                )
            count = read[first].shape[0]
            read = {name: arrays.rows(name, read[name], count) for name in widths}
            results = [arrays.empty(count, width) for _, width in native.outputs]
            guard, counter = arrays.empty(count), self._counters[native.name]
            with as_compile_error(self._robot):
                launch(arrays, made, [*read.values()], results, guard, counter)
            if fallback is not None:
                _hand_over(read, results, guard, fallback)
            if tape is not None and record is not None:
                record(tape, given, read, results)
            back = arrays.back(like)
            return (*(back(x) for x in results), back(guard))


def _without_gradient(name: str) -> ModelError:
    return ModelError(f"'{name}' has no gradient on a tape: call it outside, or without requires_grad")


def launch(
    arrays: Arrays, made: InWarp, read: list[Any], results: list[Any], guard: Any, counter: Any
) -> None:
    """Launch the kernels of a model: first, if there is one, that of modules.

    Args:
        arrays: Of the device.
        read, results: Inputs and outputs, shapes (N, n).
        guard, counter: Guards, shape (N,), and the counter of those above 1.
    """
    parts, (count,) = made.native.by_modules, guard.shape
    if parts is not None:
        guards, threads = arrays.empty(count, parts.count), arrays.threads(count * parts.count)
        motion = results[: len(parts.each.outputs) - 1]
        arrays.launch(made.before, threads, [*read, *motion, guards, count, threads])
        read = [*read, guards]
    arrays.launch(made.kernel, count, [*read, *results, guard, counter])


def _hand_over(read: dict[str, Any], results: list[Any], guard: Any, fallback: Fallback) -> None:
    """Compute samples whose guard is above 1 by the general path, in the memory of this computer."""
    rows = np.flatnonzero(~(guard.numpy() <= 1.0))
    if not len(rows):
        return
    found = fallback(rows, {name: np.array(x.numpy(), dtype=float) for name, x in read.items()})
    for result, part in zip(results, found, strict=True):
        whole = np.array(result.numpy())
        whole[rows] = part
        result.assign(whole)
