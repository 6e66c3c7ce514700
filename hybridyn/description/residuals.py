"""Closures that other packages state by a residual of joint positions: r(x1, x2, ...) = 0.

CasADi derives a residual, which is written on symbols once; its text is kept, and determines the closure.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..errors import required
from ..extensions import Extension, added, refused, running
from ..spatial import numpy_on_symbols

if TYPE_CHECKING:
    from numpy.typing import NDArray

#: Operations of CasADi without two derivatives.
NOT_SMOOTH = (
    "SIGN", "FLOOR", "CEIL", "FMOD", "REMAINDER", "LT", "LE", "EQ", "NE", "NOT", "AND", "OR", "IF_ELSE_ZERO",
    "FABS", "FMIN", "FMAX", "COPYSIGN",
)  # fmt: skip
#: Positions at which the size of a residual's slopes is taken: any that are no roots [m or rad].
GENERIC_PLACES = (0.0, 0.3819660113, -0.6180339887)


@dataclass(frozen=True)
class Residual:
    """A residual of joint positions, in place of the curve of a coupling.

    Attributes:
        terms: Pairs (joint, 1) in the order of the arguments: the joint's name, or its number in a tree.
        closure: Name of the closure.
        numbers: What its file states for it, from which the text was made.
        zeros: What is added to each position.
        written: CasADi's text of the residual and its derivatives.
    """

    terms: tuple[tuple[Any, float], ...]
    closure: str
    numbers: tuple[tuple[str, Any], ...] = field(compare=False)
    zeros: tuple[float, ...]
    written: str

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


class ResidualMaker(NamedTuple):
    """A closure that a package adds.

    Attributes:
        make: Computes the residual, from the joints' positions and the numbers of the file.
        package: Its package.
    """

    make: Callable[..., Any]
    package: str


def checked_closure(found: Extension) -> ResidualMaker:
    """Return the closure that a package adds.

    Raises:
        ModelError: It is no function.
    """
    if not callable(found.value):
        raise found.refused("closures", f"is {found.value!r}, no function of positions and numbers")
    return ResidualMaker(found.value, found.package)


def residual(
    closure: str, joints: Sequence[str], numbers: Mapping[str, Any], zeros: Mapping[str, float]
) -> Residual:
    """Write a closure of a package for some joints.

    Args:
        closure: Its name.
        joints: The joints whose positions it takes, in order.
        numbers: What its file states for it.
        zeros: By joint, what is added to its position.

    Raises:
        HybridynError: CasADi is not installed.
        ModelError: The closure's code fails on symbols, it is no smooth number, or lacks a joint.
    """
    maker: ResidualMaker = added("closures", closure)
    ca = required("casadi", "compiled", f"the closure '{closure}' of the package '{maker.package}'")
    x = [ca.SX.sym(joint) for joint in joints]
    found = _made(closure, maker, x, numbers)
    count = found.numel() if isinstance(found, ca.SX) else np.size(found)
    if count != 1:
        raise refused("closures", closure, maker.package, f"returns {count} numbers: a residual is one")
    r, column = ca.SX(found), ca.vertcat(*x)
    gradient = ca.densify(ca.gradient(r, column))
    for name, slope in zip(joints, ca.vertsplit(gradient), strict=True):
        if slope.is_zero():
            raise refused("closures", closure, maker.package, f"does not depend on joint '{name}'")
    hessian = ca.densify(ca.jacobian(gradient, column))
    entries = [hessian[i, j] for i in range(len(x)) for j in range(len(x))]
    _check_smooth(closure, maker.package, ca.Function("r", x, [r]))
    written = ca.Function("residual", x, [r, *ca.vertsplit(gradient), *entries]).serialize()
    return Residual(
        tuple((joint, 1.0) for joint in joints), closure, tuple(numbers.items()),
        tuple(zeros.get(joint, 0.0) for joint in joints), written,
    )  # fmt: skip


def _made(closure: str, maker: ResidualMaker, x: Sequence[Any], numbers: Mapping[str, Any]) -> Any:
    """Return what a closure of a package makes of the symbols x of its joints.

    Raises:
        ModelError: Its code fails on symbols.
    """
    with running("closures", closure, maker.package), numpy_on_symbols():
        return maker.make(x, **numbers)


def _check_smooth(closure: str, package: str, function: Any) -> None:
    """Check that a residual has two derivatives.

    Raises:
        ModelError: It has a kink or a jump.
    """
    import casadi as ca

    used = {function.instruction_id(i) for i in range(function.n_instructions())}
    if bent := [name for name in NOT_SMOOTH if getattr(ca, f"OP_{name}", None) in used]:
        raise refused(
            "closures", closure, package,
            f"is not smooth ({bent[0].lower()}): loops are followed by two derivatives of the residual",
        )  # fmt: skip
