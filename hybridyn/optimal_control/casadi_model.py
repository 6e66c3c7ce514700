"""`hybridyn.casadi_model`: a model over the motors as a CasADi function with exact first two derivatives.

CasADi differentiates what calls the function, and asks it for its Jacobian, for products with weights of its
results, and for the Jacobian of these products: the Hessian.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from ..compiled import needs_casadi
from ..effects.choice import Choice
from ..errors import ModelError
from ..spatial import Array
from ..structure.robot import HybridRobot
from .closed_model import ClosedModel, ClosedState, first_posture, or_no_numbers

needs_casadi()
import casadi as ca  # noqa: E402


def casadi_model(
    robot: HybridRobot, model: str = "idm", samples: int = 1, *, effects: Choice = None,
    start: Array | None = None,
) -> ca.Function:  # fmt: skip
    """Return a model over the motors as a CasADi function, for IPOPT and other solvers.

    Its arguments are positions, rates, and accelerations ("idm") or efforts ("ddm") of the motors, each of
    shape (motors, samples); its result are their efforts or accelerations, likewise. All other joints follow:
    the motors move straight from `start` to the first sample and from sample to sample. First and second
    derivatives are exact, through the closed loops. Where no posture follows, all results are NaN, from which
    solvers step back, and the logger "hybridyn" says why. Keep the function as long as what calls it.

    Args:
        robot: The robot, with a fixed base.
        model: "idm" or "ddm".
        samples: Number of samples, such as those of a trajectory.
        effects: Effects to include, as for `hybridyn.idm`.
        start: Posture that closes the loops, shape (nq,); the home posture by default.

    Raises:
        ModelError: There is no sample, `model` is unknown, the motors are not coordinates of the robot, or an
            effect has no second derivative.
        CompileError: CasADi is not installed, or the models cannot be generated.
        TrajectoryError: `start` has a wrong shape or is not finite.

    Example:
        >>> import casadi as ca
        >>> inverse = hybridyn.casadi_model(hybridyn.load("five_bar"), "idm")
        >>> a = ca.MX.sym("a", 2)
        >>> inertia = ca.Function("inertia", [a], [ca.jacobian(inverse([0.1, 0.2], [1.0, 0.0], a), a)])
        >>> inertia([0.0, 0.0]).full().round(3)
        array([[0.081, 0.021],
               [0.021, 0.07 ]])
    """
    if samples < 1:
        raise ModelError(f"samples must be at least 1, not {samples}")
    return _function(_Table(ClosedModel(robot, model, effects), samples, first_posture(robot, start)))


class _Table:
    """Samples of a model; what CasADi asks for again at the same samples is computed once."""

    def __init__(self, model: ClosedModel, samples: int, start: Array) -> None:
        self.model, self.samples, self.start = model, samples, start
        self.motors = len(model.robot.motors)
        self._given, self._known = b"", dict[str, Array]()

    def value(self, given: Array) -> Array:
        """Return the results, shape (T, motors); the samples are rows of positions, rates and x."""
        return self._at(given, "value", self.model.value, (self.motors,))

    def jacobian(self, given: Array) -> Array:
        """Return the derivatives, shape (T, motors, 3 motors)."""
        return self._at(given, "jacobian", self.model.jacobian, (self.motors, 3 * self.motors))

    def hessian(self, given: Array, weights: Array) -> Array:
        """Return those of second order of the weighted results, shape (T, 3 motors, 3 motors)."""
        weighted = partial(self.model.hessian, weights=weights)
        return self._at(given, f"hessian {weights.tobytes()!r}", weighted, (3 * self.motors,) * 2)

    def _at(
        self, given: Array, what: str, of: Callable[[ClosedState], Array], shape: tuple[int, ...]
    ) -> Array:
        """Return numbers of the samples, or none."""
        if given.tobytes() != self._given:
            self._given, self._known = given.tobytes(), {}
        if what not in self._known:
            position, rate, x = np.split(given, 3, axis=1)
            self._known[what] = or_no_numbers(
                lambda: of(self.model.close(position, rate, x, self.start)), (self.samples, *shape)
            )
        return self._known[what]


class _Kind(NamedTuple):
    """A function that CasADi calls.

    Attributes:
        inputs, outputs: Patterns of its arguments and results.
        numbers: Returns the entries of each result.
        patterns: Those of its Jacobian, over each argument, of one result after the other.
        jacobian, reverse: How it is differentiated, if that is asked for.
    """

    inputs: Sequence[ca.Sparsity]
    outputs: Sequence[ca.Sparsity]
    numbers: Callable[[Sequence[Array]], Sequence[Array]]
    patterns: Sequence[ca.Sparsity] = ()
    jacobian: Callable[[], _Kind] | None = None
    reverse: Callable[[], _Kind] | None = None


class _Called(ca.Callback):
    """A kind of function as CasADi wants it."""

    def __init__(self, name: str, kind: _Kind) -> None:
        ca.Callback.__init__(self)
        self._kind, self._kept = kind, list[ca.Callback]()  # CasADi does not keep them
        self.construct(name, {})

    def get_n_in(self) -> int:
        """Return the number of arguments."""
        return len(self._kind.inputs)

    def get_n_out(self) -> int:
        """Return the number of results."""
        return len(self._kind.outputs)

    def get_sparsity_in(self, i: int) -> ca.Sparsity:
        """Return the pattern of an argument."""
        return self._kind.inputs[i]

    def get_sparsity_out(self, i: int) -> ca.Sparsity:
        """Return the pattern of a result."""
        return self._kind.outputs[i]

    def eval(self, given: Sequence[ca.DM]) -> list[ca.DM]:
        """Return the results."""
        numbers = self._kind.numbers([x.full().T for x in given])
        return [ca.DM(pattern, x) for pattern, x in zip(self._kind.outputs, numbers, strict=True)]

    def has_jac_sparsity(self, result: int, argument: int) -> bool:
        """Return whether the pattern of a derivative is known."""
        return bool(self._kind.patterns)

    def get_jac_sparsity(self, result: int, argument: int, symmetric: bool) -> ca.Sparsity:
        """Return the pattern of a derivative."""
        return self._kind.patterns[result * len(self._kind.inputs) + argument]

    def has_jacobian(self) -> bool:
        """Return whether there is a Jacobian."""
        return self._kind.jacobian is not None

    def get_jacobian(self, name: str, *_: object) -> ca.Function:
        """Return the Jacobian."""
        return self._keep(name, self._kind.jacobian)

    def has_reverse(self, directions: int) -> bool:
        """Return whether there are products with weights of the results."""
        return self._kind.reverse is not None and directions == 1

    def get_reverse(self, directions: int, name: str, *_: object) -> ca.Function:
        """Return the function of such a product."""
        return self._keep(name, self._kind.reverse)

    def _keep(self, name: str, make: Callable[[], _Kind] | None) -> ca.Function:
        """Return a function that CasADi calls and hybridyn keeps."""
        assert make is not None
        self._kept.append(_Called(name, make()))
        return self._kept[-1]


def blocks(found: Array) -> Array:
    """Return the entries of square blocks of the samples, column by column."""
    return found.transpose(0, 2, 1).ravel()


def _function(table: _Table) -> ca.Function:
    """Return the function of a table: its result, products with weights, and both Jacobians."""
    m, T = table.motors, table.samples
    each, none = ca.Sparsity.dense(m, T), ca.Sparsity(m, T)
    within = ca.diagcat(*[ca.Sparsity.dense(m, m)] * T)
    apart, thrice = ca.Sparsity(m * T, m * T), [slice(k * m, (k + 1) * m) for k in range(3)]

    def value(given: Sequence[Array]) -> list[Array]:
        return [table.value(np.hstack(given)).ravel()]

    def jacobian(given: Sequence[Array]) -> list[Array]:
        found = table.jacobian(np.hstack(given[:3]))
        return [blocks(found[:, :, k]) for k in thrice]

    def weighted(given: Sequence[Array]) -> list[Array]:
        found = np.einsum("tij,ti->tj", table.jacobian(np.hstack(given[:3])), given[4])
        return [found[:, k].ravel() for k in thrice]

    def second(given: Sequence[Array]) -> list[Array]:
        x = np.hstack(given[:3])
        H, J = table.hessian(x, given[4]), table.jacobian(x)
        no = np.zeros(0)
        rows = [
            [*(blocks(H[:, k, other]) for other in thrice), no, blocks(J[:, :, k].transpose(0, 2, 1))]
            for k in thrice
        ]
        return [*rows[0], *rows[1], *rows[2]]

    patterns = [within] * 3
    again = [*patterns, apart, within]

    def product() -> _Kind:
        given = [each] * 3 + [none, each]
        hessian = _Kind([*given, *[none] * 3], again * 3, second)
        return _Kind(given, [each] * 3, weighted, again * 3, lambda: hessian)

    slopes = _Kind([*[each] * 3, none], patterns, jacobian)
    return _Called("model", _Kind([each] * 3, [each], value, patterns, lambda: slopes, product))
