"""Models as functions of three arrays, with the products of their derivatives, on NumPy arrays."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property, partial

import numpy as np

from ..compiled import CompiledRobot, SecondDerivatives
from ..errors import HybridynError
from ..spatial import Array


class SmoothFunction:
    """A function y = f(x) of three arrays, beside postures that carry no derivatives; shapes are (T, n).

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
            value: Computes y from postures and x.
            state: Computes the state at which `derivatives` are asked, likewise.
            derivatives: Prepares the derivatives, which takes long; called at their first use.
        """
        self.name, self.sizes, self._prepare = name, sizes, derivatives
        self._value, self._state = value, state

    @cached_property
    def _derivatives(self) -> SecondDerivatives:
        return self._prepare()

    def value(self, near: Array, *x: Array) -> tuple[Array, ...]:
        """Compute y."""
        return (self._value(near, *x),)

    def pulled(self, near: Array, *x: Array) -> tuple[Array, ...]:
        """Compute w^T f', three arrays; w stands behind x."""
        q, v, third = self._state(near, *x[:3])
        still = [np.zeros_like(part) for part in x[:3]]
        return (*self._derivatives.product(q, v, third, x[3], still).slope.values(),)

    def pushed(self, near: Array, *x: Array) -> tuple[Array, ...]:
        """Compute f' d; the three parts of d stand behind x."""
        q, v, third = self._state(near, *x[:3])
        return (self._derivatives.along(q, v, third, x[3:]).first,)

    def curved(self, near: Array, *x: Array) -> tuple[Array, ...]:
        """Compute f'' d e, from f'' along d + e and d - e, of unit length; d and e stand behind x."""
        q, v, third = (np.tile(part, (2, 1)) for part in self._state(near, *x[:3]))
        d, e = (np.concatenate(part, axis=1) for part in (x[3:6], x[6:9]))
        sizes = [np.linalg.norm(part, axis=1, keepdims=True) for part in (d, e)]
        d, e = (part / np.where(size, size, 1.0) for part, size in zip((d, e), sizes, strict=True))
        ends = np.cumsum(self.sizes[1:3])
        both = np.split(np.concatenate([d + e, d - e]), ends, axis=1)
        second = self._derivatives.along(q, v, third, both).second
        return (0.25 * sizes[0] * sizes[1] * (second[: len(d)] - second[len(d) :]),)

    def bent(self, near: Array, *x: Array) -> tuple[Array, ...]:
        """Compute w^T f'' d, three arrays; w and the three parts of d stand behind x."""
        q, v, third = self._state(near, *x[:3])
        return (*self._derivatives.product(q, v, third, x[3], x[4:]).product.values(),)


def model_function(fast: CompiledRobot, name: str) -> SmoothFunction:
    """Return the model "idm" or "ddm" over a displacement from closed postures, rates, and a or tau.

    The displacement is zero: it carries derivatives. It moves joints as Pinocchio's `integrate` does.
    """
    robot, model = fast.robot, fast.idm if name == "idm" else fast.ddm
    third, out = (robot.nv, len(robot.motors)) if name == "idm" else (len(robot.motors), robot.nv)
    derivatives = partial(SecondDerivatives, robot, name, fast.effects, threads=fast.threads)
    return SmoothFunction(
        name, (robot.nq, robot.nv, robot.nv, third, out),
        lambda near, delta, v, x: np.asarray(model(near, v, x), dtype=float),
        lambda near, delta, v, x: [near, v, x],
        derivatives,
    )  # fmt: skip


def closed_function(fast: CompiledRobot) -> SmoothFunction:
    """Return the motion of all joints over the motors' positions, rates and accelerations: q, v, a in a row.

    The motors of each sample move straight from its own posture on its assembly branch.
    """
    robot, motors = fast.robot, len(fast.robot.motors)
    nq, nv = robot.nq, robot.nv

    def value(near: Array, *motion: Array) -> Array:
        """Close the loops, sample by sample."""
        out = np.empty((len(near), nq + 2 * nv))
        for t, (start, *given) in enumerate(zip(near, *motion, strict=True)):
            try:
                out[t] = np.concatenate(fast.close(*given, last=start))
            except HybridynError as error:
                error.sample = t
                raise
        return out

    return SmoothFunction(
        "close", (nq, motors, motors, motors, nq + 2 * nv),
        value,
        lambda *given: np.split(value(*given), [nq, nq + nv], axis=1),
        partial(
            SecondDerivatives, robot, "close", fast.effects, coordinates="motors", threads=fast.threads
        ),
    )  # fmt: skip
