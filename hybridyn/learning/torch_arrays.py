"""Tensors of PyTorch, and its own way to name derivatives. Only this file imports PyTorch."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import torch
from torch.autograd import Function

from ..errors import TrajectoryError
from ..spatial import Array
from .framework import Framework
from .functions import SmoothFunction


class OnNumbers(Function):  # type: ignore[misc]
    """A function of NumPy arrays, shapes (T, n), on tensors with equal leading axes, without derivatives."""

    @staticmethod
    def forward(call: Callable[..., Sequence[Array]], *given: Any) -> tuple[Any, ...]:
        """Compute it."""
        axes = given[0].shape[:-1]
        found = call(*(np.ascontiguousarray(x.numpy()).reshape(-1, x.shape[-1]) for x in given))
        return tuple(torch.from_numpy(np.ascontiguousarray(x)).reshape(*axes, x.shape[-1]) for x in found)

    @staticmethod
    def setup_context(ctx: Any, inputs: Any, output: Any) -> None:
        """Keep nothing."""

    @staticmethod
    def backward(ctx: Any, *weights: Any) -> Any:
        """Refuse it."""
        raise NotImplementedError("hybridyn's models have derivatives of first and second order")

    @staticmethod
    def vmap(info: Any, in_dims: Any, call: Any, *given: Any) -> Any:
        """Put the axis of samples first."""
        found = OnNumbers.apply(call, *_in_front(info, in_dims[1:], given))
        return found, (0,) * len(found)


class ModelValue(Function):  # type: ignore[misc]
    """The value of a `SmoothFunction`."""

    @staticmethod
    def forward(function: SmoothFunction, near: Any, *x: Any) -> Any:
        """Compute it."""
        return OnNumbers.apply(function.value, near, *x)[0]

    @staticmethod
    def setup_context(ctx: Any, inputs: Any, output: Any) -> None:
        """Keep the arguments."""
        _keep(ctx, inputs)

    @staticmethod
    def backward(ctx: Any, w: Any) -> Any:
        """Compute w^T f'."""
        return None, None, *ModelSlope.apply(ctx.function, *ctx.saved_tensors, w)

    @staticmethod
    def jvp(ctx: Any, *d: Any) -> Any:
        """Compute f' d."""
        x = ctx.saved_tensors
        return OnNumbers.apply(ctx.function.pushed, *x, *_full(d[2:], x[1:]))[0]

    @staticmethod
    def vmap(info: Any, in_dims: Any, function: Any, *given: Any) -> Any:
        """Put the axis of samples first."""
        return ModelValue.apply(function, *_in_front(info, in_dims[1:], given)), 0


class ModelSlope(Function):  # type: ignore[misc]
    """w^T f' of a `SmoothFunction`."""

    @staticmethod
    def forward(function: SmoothFunction, near: Any, *x: Any) -> Any:
        """Compute it; w stands behind x."""
        return OnNumbers.apply(function.pulled, near, *x)

    @staticmethod
    def setup_context(ctx: Any, inputs: Any, output: Any) -> None:
        """Keep the arguments."""
        _keep(ctx, inputs)

    @staticmethod
    def backward(ctx: Any, *d: Any) -> Any:
        """Compute d of its change with x, w^T f'' d, and with w, f' d."""
        near, *x, _ = given = ctx.saved_tensors
        along = _full(d, x)
        bent = OnNumbers.apply(ctx.function.bent, *given, *along)
        return None, None, *bent, OnNumbers.apply(ctx.function.pushed, near, *x, *along)[0]

    @staticmethod
    def jvp(ctx: Any, *d: Any) -> Any:
        """Compute its change along x and w."""
        near, *x, _ = given = ctx.saved_tensors
        *along, more = _full(d[2:], given[1:])
        bent = OnNumbers.apply(ctx.function.bent, *given, *along)
        slope = OnNumbers.apply(ctx.function.pulled, near, *x, more)
        return tuple(first + second for first, second in zip(bent, slope, strict=True))

    @staticmethod
    def vmap(info: Any, in_dims: Any, function: Any, *given: Any) -> Any:
        """Put the axis of samples first."""
        return ModelSlope.apply(function, *_in_front(info, in_dims[1:], given)), (0, 0, 0)


def _keep(ctx: Any, inputs: Sequence[Any]) -> None:
    """Keep the arguments of a function for its derivatives."""
    ctx.function, *tensors = inputs
    ctx.save_for_backward(*tensors)
    ctx.save_for_forward(*tensors)


def _full(given: Sequence[Any], like: Sequence[Any]) -> list[Any]:
    """Return changes or weights, zero where there are none."""
    return [torch.zeros_like(y) if x is None else x for x, y in zip(given, like, strict=True)]


def _in_front(info: Any, dims: Sequence[int | None], given: Sequence[Any]) -> list[Any]:
    """Return tensors whose first axis is that of `torch.vmap`."""
    return [
        x.expand(info.batch_size, *x.shape) if dim is None else x.movedim(dim, 0)
        for x, dim in zip(given, dims, strict=True)
    ]


def _array(name: str, given: Any, width: int) -> Any:
    """Return a tensor.

    Raises:
        TrajectoryError: It is of another type or shape, or on another device.
    """
    if not isinstance(given, torch.Tensor):
        given = torch.as_tensor(np.array(given, dtype=float))
    if given.dtype != torch.float64:
        raise TrajectoryError(f"{name} has the type {given.dtype}; wanted torch.float64: {name}.double()")
    if given.device.type != "cpu":
        raise TrajectoryError(
            f"{name} is on the device '{given.device}'; gradients are computed on the processor: {name}.cpu()"
        )
    if not given.ndim or given.shape[-1] != width:
        raise TrajectoryError(f"{name} has shape {tuple(given.shape)}; wanted (..., {width})")
    return given


def _still(name: str, given: Any, width: int) -> Any:
    """Return a tensor that carries no gradient.

    Raises:
        TrajectoryError: It asks for one, or as `_array` raises.
    """
    found = _array(name, given, width)
    if found.requires_grad:
        raise TrajectoryError(f"{name} has no gradient, but requires one: give {name}.detach()")
    return found


def _alike(given: Sequence[Any]) -> list[Any]:
    """Return tensors with equal leading axes.

    Raises:
        TrajectoryError: They cannot be broadcast.
    """
    try:
        axes = torch.broadcast_shapes(*(x.shape[:-1] for x in given))
    except RuntimeError:
        shapes = ", ".join(str(tuple(x.shape)) for x in given)
        raise TrajectoryError(f"leading axes do not fit each other: shapes {shapes}") from None
    return [x.expand(*axes, x.shape[-1]) for x in given]


def _found(call: Callable[..., Sequence[Array]], width: int, *given: Any) -> Any:
    """Compute an array without derivatives."""
    return OnNumbers.apply(call, *_alike(given))[0]


def _apply(function: SmoothFunction, *given: Any) -> Any:
    """Compute a function."""
    return ModelValue.apply(function, *_alike(given))


TORCH = Framework(torch, _array, _still, lambda x: x.detach(), _found, _apply)
