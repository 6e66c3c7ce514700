"""Arrays of JAX, and its own way to name derivatives. Only this file imports JAX."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from math import prod
from typing import Any

import jax
import numpy as np
from jax import numpy as jnp
from jax.extend.core import Primitive
from jax.interpreters import ad, batching, mlir

from ..errors import TrajectoryError
from ..spatial import Array
from .framework import Framework, check_width, leading_axes
from .functions import SmoothFunction, changed, check_order, weighed

DOUBLE = np.dtype(float)
#: A function of NumPy arrays, shapes (T, n), on arrays with equal leading axes, without derivatives.
numbers = Primitive("hybridyn_numbers")
#: y or a derivative of a `SmoothFunction`.
derivative = Primitive("hybridyn_derivative")


def _derivative(function: SmoothFunction, weighted: bool, given: Sequence[Any]) -> Any:
    """Compute y or a derivative.

    Raises:
        NotImplementedError: It is of third order.
    """
    check_order(given)
    return derivative.bind(*given, function=function, weighted=weighted)


def _now(call: Callable[..., Array], *given: Any) -> Any:
    """Compute a function at once; its errors are those of the model."""
    axes = given[0].shape[:-1]
    rows = (np.ascontiguousarray(x, dtype=float).reshape(prod(axes), x.shape[-1]) for x in given)
    found = call(*rows)
    return found.reshape(*axes, found.shape[-1])


def _later(call: Callable[..., Array], width: int, *given: Any) -> Any:
    """Compute a function where XLA runs."""
    shape = jax.ShapeDtypeStruct((*given[0].shape[:-1], width), float)
    return jax.pure_callback(lambda *given: _now(call, *given), shape, *given)


def _changed(given: Sequence[Any], changes: Sequence[Any], *, function: Any, weighted: bool) -> Any:
    """Compute a derivative, and its change with x and with what stands behind it."""
    _refuse(given, changes[:1])
    moved = [(i, change) for i, change in enumerate(changes) if not isinstance(change, ad.Zero)]
    first, *more = (_derivative(function, weighted, changed(given, i, change)) for i, change in moved)
    return _derivative(function, weighted, given), sum(more, first)


def _refuse(given: Sequence[Any], changes: Sequence[Any], **_: object) -> Any:
    """Refuse changes of postures that carry no gradient.

    Raises:
        TrajectoryError: There is one.
    """
    if not all(isinstance(change, ad.Zero) for change in changes):
        raise TrajectoryError("near has no gradient, but requires one: give jax.lax.stop_gradient(near)")


def _transposed(w: Any, *given: Any, function: SmoothFunction, weighted: bool) -> list[Any]:
    """Compute what weights of a derivative give for the argument in which it is linear."""
    i = next(i for i, x in enumerate(given) if ad.is_undefined_primal(x))
    found = _derivative(function, *weighed(weighted, given, i, ad.instantiate_zeros(w)))
    return [found if k == i else None for k in range(len(given))]


def _prepare(primitive: Primitive, call_of: Callable[..., tuple[Callable[..., Array], int]]) -> None:
    """Say how a primitive is computed, now and compiled, and under `jax.vmap`."""

    def shape(*given: Any, **words: Any) -> Any:
        """Return what is known of the result before it is computed."""
        return jax.core.ShapedArray((*given[0].shape[:-1], call_of(**words)[1]), DOUBLE)

    def many(given: Sequence[Any], axes: Sequence[Any], **words: Any) -> tuple[Any, int]:
        """Put the axis of samples first."""
        size = next(x.shape[axis] for x, axis in zip(given, axes, strict=True) if axis is not None)
        front = [
            jnp.broadcast_to(x, (size, *x.shape)) if axis is None else jnp.moveaxis(x, axis, 0)
            for x, axis in zip(given, axes, strict=True)
        ]
        return primitive.bind(*front, **words), 0

    primitive.def_impl(lambda *given, **words: jnp.asarray(_now(call_of(**words)[0], *given)))
    primitive.def_abstract_eval(shape)
    later = mlir.lower_fun(lambda *given, **words: _later(*call_of(**words), *given), multiple_results=False)
    mlir.register_lowering(primitive, later)
    batching.primitive_batchers[primitive] = many


def _of_derivative(function: SmoothFunction, weighted: bool) -> tuple[Callable[..., Array], int]:
    """Return the function of NumPy arrays that computes a derivative, and its width."""
    return partial(function.compute, weighted), function.width(weighted=weighted)


_prepare(numbers, lambda call, width: (call, width))
_prepare(derivative, _of_derivative)
ad.primitive_jvps[numbers], ad.primitive_jvps[derivative] = _refuse, _changed
ad.primitive_transposes[derivative] = _transposed


def _array(name: str, given: Any, width: int) -> Any:
    """Return an array.

    Raises:
        TrajectoryError: It is of another type or shape, or JAX computes in single precision.
    """
    if jax.dtypes.canonicalize_dtype(float) != DOUBLE:
        raise TrajectoryError(
            'JAX computes in single precision, wanted double: call jax.config.update("jax_enable_x64", True)'
        )
    if not isinstance(given, jax.Array):
        try:
            given = jnp.asarray(given, dtype=float)
        except (TypeError, ValueError):
            raise TrajectoryError(f"{name} is not an array of numbers") from None
    if given.dtype != DOUBLE:
        raise TrajectoryError(f"{name} has the type {given.dtype}; wanted float64: {name}.astype(float)")
    check_width(name, given, width)
    return given


def _alike(given: Sequence[Any]) -> list[Any]:
    """Return arrays with equal leading axes.

    Raises:
        TrajectoryError: They cannot be broadcast.
    """
    axes = leading_axes(given)
    return [jnp.broadcast_to(x, (*axes, x.shape[-1])) for x in given]


def _found(call: Callable[..., Array], width: int, *given: Any) -> Any:
    """Compute an array without derivatives."""
    return numbers.bind(*_alike(given), call=call, width=width)


def _apply(function: SmoothFunction, *given: Any) -> Any:
    """Compute a function."""
    near, *x = _alike(given)
    return _derivative(function, False, [near, jnp.concatenate(x, axis=-1)])


JAX = Framework(jnp, _array, _array, jax.lax.stop_gradient, _found, _apply)
