"""Arrays that come from Warp, NumPy, or any library with DLPack, and results of the same kind."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import numpy as np

from ..errors import ModelError, TrajectoryError
from .functions import wp

#: Threads that a multiprocessor runs at once where each takes all the registers that it may: 65,536 by 255.
AT_ONCE = 256


def device_of(name: Any) -> Any:
    """Return a device of Warp by its name; None for the one that Warp prefers.

    Raises:
        ModelError: There is no such device.
    """
    wp.init()
    try:
        return wp.get_device(name)
    except (ValueError, RuntimeError) as error:
        hint = "" if wp.is_cuda_available() else "; Warp finds no driver of CUDA"
        raise ModelError(
            f"there is no device {name!r}: Warp has {', '.join(map(str, wp.get_devices()))}{hint}"
        ) from error


class Arrays:
    """Arrays on one device with one number type.

    Attributes:
        device: The device of Warp.
        dtype: Type of the numbers, "float64" or "float32".
    """

    def __init__(self, device: Any, dtype: str) -> None:
        self.device, self.dtype = device, dtype
        self._number = getattr(wp, dtype)

    def given(self, name: str, x: Any, width: int) -> Any:
        """Return an array as one of Warp: without a copy but for NumPy and what else is no array of a device.

        Args:
            x: Shape (N, width), or (width,) for the same numbers at every sample.

        Raises:
            TrajectoryError: Its shape, type or device is wrong.
        """
        if not _has_dlpack(x):
            try:
                numbers = np.asarray(x, dtype=self.dtype)
                numbers = np.full(width, numbers) if numbers.ndim == 0 else numbers
                found = wp.array(numbers, dtype=self._number, device=self.device)
            except RuntimeError as error:
                raise self._full(f"the array {name}") from error
            except (TypeError, ValueError) as error:
                raise TrajectoryError(f"{name} is no array of numbers ({_line(error)})") from error
        else:
            found = self._shared(name, x)
        if found.ndim not in (1, 2) or found.shape[-1] != width:
            raise TrajectoryError(f"{name} has shape {tuple(found.shape)}; wanted (N, {width})")
        return found

    def _shared(self, name: str, x: Any) -> Any:
        """Return an array of a device as one of Warp."""
        try:
            found = x if isinstance(x, wp.array) else wp.from_dlpack(x)
        except Exception as error:
            raise TrajectoryError(f"{name} cannot be read through DLPack: {_line(error)}") from error
        if found.device != self.device:
            raise TrajectoryError(
                f"{name} is on the device '{found.device}', the batch on '{self.device}': move it there"
            )
        if found.dtype != self._number:
            raise TrajectoryError(
                f"{name} has numbers of type {found.dtype.__name__}, the batch has {self.dtype}: convert it"
            )
        return found

    def rows(self, name: str, x: Any, count: int) -> Any:
        """Return an array of some samples; one row stands for all.

        Raises:
            TrajectoryError: It has another number of rows.
        """
        if x.ndim == 2 and x.shape[0] == count:
            return x
        if x.ndim == 2:
            raise TrajectoryError(f"{name} has {x.shape[0]} samples; wanted {count}")
        layout = {"shape": (count, x.shape[0]), "strides": (0, x.strides[0])}
        row = wp.array(ptr=x.ptr, dtype=x.dtype, device=x.device, **layout)
        row.kept = x  # the memory is its own
        return row

    def empty(self, *shape: int, number: Any = None) -> Any:
        """Return new memory, which is zero for counters.

        Raises:
            TrajectoryError: The device is full.
        """
        try:
            make = wp.empty if number is None else wp.zeros
            return make(shape, dtype=number or self._number, device=self.device)
        except (RuntimeError, MemoryError, ValueError) as error:  # or longer than an array can be
            size = np.prod(shape, dtype=float) * np.dtype(self.dtype).itemsize
            raise self._full(f"an array of {size / 1e9:.3g} GB") from error

    def threads(self, items: int) -> int:
        """Return how many threads share items of unequal length: as many as run at once."""
        return min(items, AT_ONCE * max(int(self.device.sm_count), 1))

    def launch(self, kernel: Any, count: int, inputs: Sequence[Any]) -> None:
        """Launch a kernel for each sample, or so many threads of it; it is not recorded on a tape.

        Raises:
            TrajectoryError: The device is full.
        """
        try:
            wp.launch(kernel, dim=count, inputs=inputs, device=self.device, record_tape=False)
        except Exception as error:  # of Warp: RuntimeError at the launch, Exception where a module is loaded
            if "out of memory" in str(error).lower().replace("_", " "):
                raise self._full("what its kernel needs") from error
            raise

    def _full(self, what: str) -> TrajectoryError:
        return TrajectoryError(
            f"the device '{self.device}' is full: {what} does not fit; take fewer samples at once"
        )

    def back(self, like: Any) -> Callable[[Any], Any]:
        """Return the function that gives results the kind of an array."""
        if isinstance(like, wp.array):
            return lambda x: x
        if not _has_dlpack(like):
            return lambda x: x.numpy()
        space = getattr(like, "__array_namespace__", None)
        module = space() if space else sys.modules[type(like).__module__.split(".")[0]]
        return module.from_dlpack  # type: ignore[no-any-return]

    def stream(self, like: Any) -> AbstractContextManager[Any]:
        """Return the context in which kernels run on the stream of the library of an array."""
        torch = sys.modules.get("torch")
        if self.device.is_cuda and torch is not None and isinstance(like, torch.Tensor):
            return wp.ScopedStream(wp.stream_from_torch(like.device))  # type: ignore[no-any-return]
        return nullcontext()


def requires_gradient(x: Any) -> bool:
    """Return whether an input is an array of Warp that requires a gradient."""
    return isinstance(x, wp.array) and x.requires_grad


def tape_of(given: Mapping[str, Any]) -> Any:
    """Return the tape of Warp that records, if an input requires a gradient; None otherwise."""
    tape = wp._src.context.runtime.tape  # Warp has no public name for it
    return tape if tape is not None and any(map(requires_gradient, given.values())) else None


def _has_dlpack(x: Any) -> bool:
    """Return whether an array is read through DLPack; those of NumPy are copied to the device."""
    return isinstance(x, wp.array) or (
        hasattr(x, "__dlpack__") and not isinstance(x, np.ndarray | np.generic)
    )


def _line(error: BaseException) -> str:
    """Return the first line of what an error says."""
    return (str(error).splitlines() or [type(error).__name__])[0]
