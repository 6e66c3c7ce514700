"""Tensors of PyTorch, and its own way to name derivatives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from math import prod
from typing import Any

import numpy as np
import torch
from torch.autograd import Function

from ..errors import TrajectoryError
from ..spatial import Array
from .framework import Framework, check_width, leading_axes
from .functions import SmoothFunction, changed, check_order, weighed


def _numbers(call: Callable[..., Array], *given: Any) -> Any:
    """Compute a function of NumPy arrays, shapes (T, n), from tensors with equal leading axes."""
    axes = given[0].shape[:-1]
    rows = (np.ascontiguousarray(x.numpy(force=True)).reshape(prod(axes), x.shape[-1]) for x in given)
    found = torch.from_numpy(np.ascontiguousarray(call(*rows))).to(given[0].device)
    return found.reshape(*axes, found.shape[-1])


def _in_place(function: SmoothFunction, weighted: bool, given: Sequence[Any]) -> Any:
    """Compute a function of tensors where they lie."""
    axes = given[0].shape[:-1]
    if not prod(axes):
        return given[0].new_zeros(*axes, function.width(weighted=weighted))
    rows = (x.detach().reshape(prod(axes), x.shape[-1]) for x in given)
    found = function.compute(weighted, *rows)
    return found.reshape(*axes, found.shape[-1])


class OnNumbers(Function):  # type: ignore[misc]
    """A function of NumPy arrays, shapes (T, n), on tensors with equal leading axes, without derivatives."""

    @staticmethod
    def forward(call: Callable[..., Array], *given: Any) -> Any:
        """Compute it."""
        return _numbers(call, *given)

    @staticmethod
    def setup_context(ctx: Any, inputs: Any, output: Any) -> None:
        """Keep nothing; what does not change has no change of zeros."""
        ctx.set_materialize_grads(False)

    @staticmethod
    def jvp(ctx: Any, *changes: Any) -> Any:
        """Refuse changes: what it computes has no derivatives."""
        _refuse("near", *changes[1:])

    @staticmethod
    def vmap(info: Any, in_dims: Any, call: Any, *given: Any) -> Any:
        """Put the axis of samples first."""
        return OnNumbers.apply(call, *_in_front(info, in_dims[1:], given)), 0


class Derivative(Function):  # type: ignore[misc]
    """y or a derivative of a `SmoothFunction`."""

    @staticmethod
    def forward(function: SmoothFunction, weighted: bool, *given: Any) -> Any:
        """Compute it."""
        if function.xp is torch:
            return _in_place(function, weighted, given)
        return _numbers(partial(function.compute, weighted), *given)

    @staticmethod
    def setup_context(ctx: Any, inputs: Any, output: Any) -> None:
        """Keep the arguments; what does not change has no change of zeros."""
        ctx.set_materialize_grads(False)
        ctx.function, ctx.weighted, *tensors = inputs
        ctx.save_for_backward(*tensors)
        ctx.save_for_forward(*tensors)

    @staticmethod
    def backward(ctx: Any, w: Any) -> Any:
        """Compute the gradients of w times it."""
        given, wanted = ctx.saved_tensors, ctx.needs_input_grad[2:]
        parts = (
            weighed(ctx.weighted, given, i, w) if i and wanted[i] and w is not None else None
            for i in range(len(given))
        )
        return None, None, *(part and _derivative(ctx.function, *part) for part in parts)

    @staticmethod
    def jvp(ctx: Any, *changes: Any) -> Any:
        """Compute its change with x and with what stands behind it."""
        _refuse("near", changes[2])
        given, moved = ctx.saved_tensors, enumerate(changes[2:])
        parts = [changed(given, i, change) for i, change in moved if change is not None]
        first, *more = (_derivative(ctx.function, ctx.weighted, part) for part in parts)
        return sum(more, first)

    @staticmethod
    def vmap(info: Any, in_dims: Any, function: Any, weighted: Any, *given: Any) -> Any:
        """Put the axis of samples first."""
        return Derivative.apply(function, weighted, *_in_front(info, in_dims[2:], given)), 0


def _derivative(function: SmoothFunction, weighted: bool, given: Sequence[Any]) -> Any:
    """Compute y or a derivative.

    Raises:
        NotImplementedError: It is of third order.
    """
    check_order(given)
    return Derivative.apply(function, weighted, *given)


def _in_front(info: Any, dims: Sequence[int | None], given: Sequence[Any]) -> list[Any]:
    """Return tensors whose first axis is that of `torch.vmap`."""
    return [
        x.expand(info.batch_size, *x.shape) if dim is None else x.movedim(dim, 0)
        for x, dim in zip(given, dims, strict=True)
    ]


def _array(device: Any, name: str, given: Any, width: int) -> Any:
    """Return a tensor on a device.

    Raises:
        TrajectoryError: It is of another type or shape, or on another device.
    """
    if not isinstance(given, torch.Tensor):
        given = torch.as_tensor(np.array(given, dtype=float), device=device)
    if given.dtype != torch.float64:
        raise TrajectoryError(f"{name} has the type {given.dtype}; wanted torch.float64: {name}.double()")
    if given.device != device:
        raise TrajectoryError(
            f"{name} is on the device '{given.device}', the models on '{device}': {name}.to('{device}')"
        )
    check_width(name, given, width)
    return given


def _still(device: Any, name: str, given: Any, width: int) -> Any:
    """Return a tensor that carries no gradient.

    Raises:
        TrajectoryError: It asks for one, or as `_array` raises.
    """
    found = _array(device, name, given, width)
    if found.requires_grad:
        _refuse(name, found)
    return found


def _refuse(name: str, *changes: Any) -> None:
    """Refuse changes of postures that carry no gradient.

    Raises:
        TrajectoryError: There is one.
    """
    if any(change is not None for change in changes):
        raise TrajectoryError(f"{name} has no gradient, but requires one: give {name}.detach()")


def _alike(given: Sequence[Any]) -> list[Any]:
    """Return tensors with equal leading axes.

    Raises:
        TrajectoryError: They cannot be broadcast.
    """
    axes = leading_axes(given)
    return [x.expand(*axes, x.shape[-1]) for x in given]


def _found(call: Callable[..., Array], width: int, *given: Any) -> Any:
    """Compute an array without derivatives."""
    return OnNumbers.apply(call, *_alike(given))


def _apply(function: SmoothFunction, *given: Any) -> Any:
    """Compute a function."""
    near, *x = _alike(given)
    return _derivative(function, False, [near, torch.cat(x, dim=-1)])


def framework_on(device: str) -> Framework:
    """Return the framework with its arrays on a device."""
    array, still = (partial(call, torch.device(device)) for call in (_array, _still))
    return Framework(torch, array, still, lambda x: x.detach(), _found, _apply)
