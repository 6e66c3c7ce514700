"""Closures that other packages state by a residual, r(x1, x2, ...) = 0: what is kept of one, and computed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import required

if TYPE_CHECKING:
    from numpy.typing import NDArray

#: Positions at which the size of a residual's slopes is taken: any that are no roots [m or rad].
GENERIC_PLACES = (0.0, 0.3819660113, -0.6180339887)


@dataclass(frozen=True)
class Residual:
    """A residual of joint positions, in place of the curve of a coupling.

    Attributes:
        terms: Pairs (joint, 1) in the order of the arguments: the joint's name, or its number in a tree.
            Those that the file names come first, then those between the frames.
        closure: Name of the closure.
        numbers: What its file states for it, from which the text was made.
        zeros: What is added to each position.
        written: CasADi's text of the residual and its derivatives.
        frames: Links whose frames the residual sees, all in the first one; none for joint positions alone.
        stated: Number of the terms that the file names.
    """

    terms: tuple[tuple[Any, float], ...]
    closure: str
    numbers: tuple[tuple[str, Any], ...] = field(compare=False)
    zeros: tuple[float, ...]
    written: str
    frames: tuple[str, ...] = field(compare=False)
    stated: int = field(compare=False)

    def of(self, names: Mapping[Any, Any]) -> Residual:
        """Return the residual of joints of other names or numbers."""
        return replace(self, terms=tuple((names[joint], one) for joint, one in self.terms))

    def moved(self, shift: Mapping[Any, float]) -> Residual:
        """Return the residual of positions that count from other zeros, as `Coupling.moved`."""
        zeros = (
            zero + shift.get(joint, 0.0) for (joint, _), zero in zip(self.terms, self.zeros, strict=True)
        )
        return replace(self, zeros=tuple(zeros))

    @property
    def sizes(self) -> list[tuple[Any, float]]:
        """How strongly each joint counts: its largest slope at some positions."""
        x = {joint: np.roll(GENERIC_PLACES, i) for i, (joint, _) in enumerate(self.terms)}
        return [(joint, float(np.nanmax(np.abs(slope)))) for joint, slope in self.slopes(x).items()]

    def value(self, positions: Mapping[Any, Any]) -> Any:
        """Compute the residual from positions by joint: numbers, arrays of shape (T,), or expressions."""
        return self._parts(positions)[0]

    def slopes(self, positions: Mapping[Any, Any]) -> dict[Any, Any]:
        """Compute the derivative by each joint's position."""
        found, out = self._parts(positions)[1 : 1 + len(self.terms)], dict[Any, Any]()
        for (joint, _), slope in zip(self.terms, found, strict=True):
            out[joint] = out[joint] + slope if joint in out else slope
        return out

    def bend(self, positions: Mapping[Any, Any], rates: Mapping[Any, Any]) -> Any:
        """Compute the second derivative over time of joints with constant rates."""
        n, v = len(self.terms), [rates[joint] for joint, _ in self.terms]
        entries = self._parts(positions)[1 + n :]
        return sum(entries[i * n + j] * v[i] * v[j] for i in range(n) for j in range(n))

    def _parts(self, positions: Mapping[Any, Any]) -> list[Any]:
        """Compute residual, gradient and Hessian, row by row."""
        x = [positions[joint] + zero for (joint, _), zero in zip(self.terms, self.zeros, strict=True)]
        function = _function(self.written)
        if np.asarray(x[0]).dtype != object:
            shape = np.shape(x[0])
            if 0 in shape:  # CasADi takes no samples for one zero
                return [np.zeros(shape)] * function.n_out()
            return [
                np.array(part).reshape(shape) for part in function.call([np.atleast_2d(one) for one in x])
            ]
        if not np.shape(x[0]):
            return list(function.call(x))
        every = [function.call(list(one)) for one in zip(*x, strict=True)]
        return [_column(parts) for parts in zip(*every, strict=True)]


def _column(parts: Sequence[Any]) -> NDArray[Any]:
    """Return an array of expressions, shape (T,)."""
    out = np.empty(len(parts), dtype=object)
    out[:] = parts
    return out


@cache
def _function(written: str) -> Any:
    """Return the function of a text."""
    casadi = required("casadi", "compiled", "a closure that is stated by its residual")
    return casadi.Function.deserialize(written)
