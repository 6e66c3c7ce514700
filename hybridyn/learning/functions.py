"""Models as functions of three arrays, with the products of their derivatives, on NumPy arrays."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property, partial
from typing import Any

import numpy as np

from ..compiled import CompiledRobot, SecondDerivatives
from ..spatial import Array

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
    """

    def __init__(
        self,
        name: str,
        sizes: tuple[int, int, int, int, int],
        value: Callable[..., Array],
        state: Callable[..., Sequence[Array]],
        derivatives: Callable[[], SecondDerivatives],
    ) -> None:
        """Join a model with its derivatives.

        Args:
            value: Computes y from postures and the three arrays of x.
            state: Computes the state at which `derivatives` are asked, likewise.
            derivatives: Prepares the derivatives, which takes long; called at their first use.
        """
        self.name, self.sizes, self._prepare = name, sizes, derivatives
        self._value, self._state = value, state

    @cached_property
    def _derivatives(self) -> SecondDerivatives:
        return self._prepare()

    def width(self, *, weighted: bool) -> int:
        """Return the width of a derivative: of x if it has weights, else of y."""
        return sum(self.sizes[1:4]) if weighted else self.sizes[4]

    def compute(self, weighted: bool, near: Array, x: Array, *behind: Array) -> Array:
        """Compute y or a derivative, shape (T, n)."""
        if not weighted and not behind:
            return self._value(near, *self._three(x))
        q, v, third = state = self._state(near, *self._three(x))
        if weighted:
            w, *d = behind
            found = self._derivatives.product(q, v, third, w, self._three(d[0] if d else np.zeros_like(x)))
            out: Array = np.concatenate([*(found.product if d else found.slope).values()], axis=1)
            return out
        if len(behind) == 1:
            return self._derivatives.along(q, v, third, self._three(behind[0])).first
        return self._bent(state, *behind)

    def _bent(self, state: Sequence[Array], d: Array, e: Array) -> Array:
        """Compute f'' d e, from f'' along d + e and d - e, of unit length."""
        sizes = [np.linalg.norm(part, axis=1, keepdims=True) for part in (d, e)]
        d, e = (part / np.where(size, size, 1.0) for part, size in zip((d, e), sizes, strict=True))
        q, v, third = (np.tile(part, (2, 1)) for part in state)
        both = self._three(np.concatenate([d + e, d - e]))
        plus, minus = np.split(self._derivatives.along(q, v, third, both).second, 2)
        out: Array = 0.25 * sizes[0] * sizes[1] * (plus - minus)
        return out

    def _three(self, x: Array) -> list[Array]:
        """Return x, or a direction, as three arrays."""
        return np.split(x, np.cumsum(self.sizes[1:3]), axis=1)


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


def model_function(fast: CompiledRobot, name: str) -> SmoothFunction:
    """Return the model "idm" or "ddm" over a displacement from closed postures, rates, and a or tau.

    The displacement is zero: it carries derivatives. It moves joints as Pinocchio's `integrate` does.
    """
    robot, model = fast.robot, fast.idm if name == "idm" else fast.ddm
    third, out = (robot.nv, len(robot.motors)) if name == "idm" else (len(robot.motors), robot.nv)
    return SmoothFunction(
        name, (robot.nq, robot.nv, robot.nv, third, out),
        lambda near, delta, v, x: np.asarray(model(near, v, x), dtype=float),
        lambda near, delta, v, x: [near, v, x],
        partial(fast.second_derivatives, name),
    )  # fmt: skip


def closed_function(fast: CompiledRobot) -> SmoothFunction:
    """Return the motion of all joints over the motors' positions, rates and accelerations: q, v, a in a row.

    The motors of each sample move straight from its own posture on its assembly branch.
    """
    robot, motors = fast.robot, len(fast.robot.motors)
    nq, nv = robot.nq, robot.nv

    def value(near: Array, *motion: Array) -> Array:
        """Close the loops."""
        return np.concatenate(fast.close(*motion, last=near), axis=1)

    return SmoothFunction(
        "close", (nq, motors, motors, motors, nq + 2 * nv),
        value,
        lambda *given: np.split(value(*given), [nq, nq + nv], axis=1),
        partial(fast.second_derivatives, "close", coordinates="motors"),
    )  # fmt: skip
