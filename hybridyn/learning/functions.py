"""Models as functions of three arrays, with the products of their derivatives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property, partial
from typing import Any

import numpy as np

from ..compiled import CompiledRobot
from ..spatial import Array
from ..structure.robot import HybridRobot

#: Arguments of a derivative, arrays of NumPy or of a framework, and how many those of second order have.
Given = Sequence[Any]
LAST = 4


class SmoothFunction:
    """A function y = f(x) beside postures `near` that carry no derivatives, with its derivatives.

    These are linear in all that stands behind x: f' d and f'' d e in directions d and e, w^T f' and w^T f'' d
    in weights w, too. They are known by whether they have weights, and by `near`, x, w, d, e, in this order.
    x, d and e are three arrays in a row; shapes are (T, n).

    Attributes:
        name: The model.
        sizes: Widths of the postures, of the three arrays, and of y.
        xp: Functions on its arrays, with the names of NumPy.
    """

    def __init__(
        self,
        name: str,
        sizes: tuple[int, int, int, int, int],
        value: Callable[..., Array],
        state: Callable[..., Sequence[Array]],
        derivatives: Callable[[], Any],
        xp: Any = np,
    ) -> None:
        """Join a model with its derivatives.

        Args:
            value: Computes y from postures and the three arrays of x.
            state: Computes the state at which `derivatives` are asked, likewise.
            derivatives: Prepares the derivatives, which takes long; called at their first use.
            xp: Functions on the arrays, with the names of NumPy.
        """
        self.name, self.sizes, self.xp, self._prepare = name, sizes, xp, derivatives
        self._value, self._state = value, state

    @cached_property
    def _derivatives(self) -> Any:
        return self._prepare()

    def width(self, *, weighted: bool) -> int:
        """Return the width of a derivative: of x if it has weights, else of y."""
        return sum(self.sizes[1:4]) if weighted else self.sizes[4]

    def compute(self, weighted: bool, near: Any, x: Any, *behind: Any) -> Any:
        """Compute y or a derivative, shape (T, n)."""
        if not weighted and not behind:
            return self._value(near, *self._three(x))
        q, v, third = state = self._state(near, *self._three(x))
        if weighted:
            w, *d = behind
            found = self._derivatives.product(q, v, third, w, self._three(d[0] if d else 0.0 * x))
            return self.xp.concatenate([*(found.product if d else found.slope).values()], axis=1)
        if len(behind) == 1:
            return self._derivatives.along(q, v, third, self._three(behind[0])).first
        return self._bent(state, *behind)

    def _bent(self, state: Sequence[Any], d: Any, e: Any) -> Any:
        """Compute f'' d e, from f'' along d + e and d - e, of unit length."""
        join, T = self.xp.concatenate, len(d)
        sizes = [(part * part).sum(1)[:, None] ** 0.5 for part in (d, e)]
        d, e = (part / (size + (size == 0.0)) for part, size in zip((d, e), sizes, strict=True))
        q, v, third = (join([part, part]) for part in state)
        second = self._derivatives.along(q, v, third, self._three(join([d + e, d - e]))).second
        return 0.25 * sizes[0] * sizes[1] * (second[:T] - second[T:])

    def _three(self, x: Any) -> list[Any]:
        """Return x, or a direction, as three arrays."""
        first, second = self.sizes[1], self.sizes[1] + self.sizes[2]
        return [x[:, :first], x[:, first:second], x[:, second:]]


def check_order(given: Given) -> None:
    """Check the order of a derivative with these arguments.

    Raises:
        NotImplementedError: It is of third order.
    """
    if len(given) > LAST:
        raise NotImplementedError("hybridyn's models have derivatives of first and second order")


def changed(given: Given, i: int, change: Any) -> list[Any]:
    """Return the arguments of a derivative's change with its argument i, x or one behind it."""
    return [*given, change] if i == 1 else [*given[:i], change, *given[i + 1 :]]


def weighed(weighted: bool, given: Given, i: int, w: Any) -> tuple[bool, list[Any]]:
    """Return which derivative is the gradient over argument i of w times a derivative, and its arguments."""
    behind = [x for k, x in enumerate(given) if k > 1 and k != i]
    if not weighted:
        return True, [*given[:2], w, *behind]
    return i != 2, [*given[:2], *behind, w]


def sizes_of(robot: HybridRobot, name: str) -> tuple[int, int, int, int, int]:
    """Return the sizes of a model, "idm", "ddm" or "close"."""
    nq, nv, motors = robot.nq, robot.nv, len(robot.motors)
    return {
        "idm": (nq, nv, nv, nv, motors),
        "ddm": (nq, nv, nv, motors, nv),
        "close": (nq, motors, motors, motors, nq + 2 * nv),
    }[name]


def functions_of(fast: CompiledRobot) -> dict[str, SmoothFunction]:
    """Return the models on NumPy arrays.

    "idm" and "ddm" are over a displacement from closed postures, rates, and a or tau. The displacement is
    zero: it carries derivatives. It moves joints as Pinocchio's `integrate` does. "close" is the motion of
    all joints over the motors' positions, rates and accelerations: q, v, a in a row. The motors of each
    sample move straight from its own posture on its assembly branch.
    """
    robot, nq, nv = fast.robot, fast.robot.nq, fast.robot.nv

    def value(near: Array, *motion: Array) -> Array:
        """Close the loops."""
        return np.concatenate(fast.close(*motion, last=near), axis=1)

    def model(call: Callable[..., Any], near: Array, _: Array, v: Array, x: Array) -> Array:
        """Compute efforts or accelerations."""
        return np.asarray(call(near, v, x), dtype=float)

    values: dict[str, Callable[..., Any]] = {
        "idm": partial(model, fast.idm),
        "ddm": partial(model, fast.ddm),
        "close": value,
    }
    states: dict[str, Callable[..., Any]] = dict.fromkeys(values, lambda near, delta, v, x: (near, v, x))
    states["close"] = lambda *given: np.split(value(*given), [nq, nq + nv], axis=1)
    return {
        name: SmoothFunction(
            name, sizes_of(robot, name), call, states[name],
            partial(fast.second_derivatives, name, coordinates="motors" if name == "close" else "joints"),
        )
        for name, call in values.items()
    }  # fmt: skip
