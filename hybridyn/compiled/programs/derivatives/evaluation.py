"""Evaluate the derivatives of one model of one robot, in C or by CasADi."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import prod

import numpy as np
from numpy.typing import ArrayLike

from ....effects.choice import Choice, choose, without_losses
from ....errors import AT_SAMPLE, ModelError, SingularityError, TrajectoryError
from ....linkage.retraction import Retraction
from ....spatial import Array
from ....structure.robot import HybridRobot
from ...code.scalars import GUARD_LIMIT
from ...comparing import States, compare_at_states, random_states
from ...equations.guarded_elimination import TRUSTED_PIVOT
from ...equations.request import Request, request
from ...equations.states import any_accelerations
from ...failures import as_compile_error
from ...library.cache import Built
from ...library.calls import Library
from ...library.direct_calls import refuse
from ...program import Program
from ..built_beside import BuiltBeside
from ..general import GENERAL, as_batches, general, named, samples_of
from .coordinates import check_coordinates
from .models import direct_derivatives, inverse_derivatives, motor_inverse_derivatives

Jacobians = dict[str, Array]

#: Builders of the programs, by model and by whether the motors are the coordinates.
BUILDERS: dict[tuple[str, bool], Callable[[Request], Program]] = {
    ("idm", False): inverse_derivatives,
    ("ddm", False): direct_derivatives,
    ("idm", True): motor_inverse_derivatives,
    ("ddm", True): partial(direct_derivatives, motors=True),
}

#: Largest allowed difference from the general path of a model whose guard is above its limit, relative to the
#: largest entry.
DERIVATIVE_AGREES = 1e-6
#: Relative error of derivatives over the guard, which is the inverse square of the least pivot's ratio to
#: `TRUSTED_PIVOT`: they lose more digits than the model's result, whose errors cancel.
DERIVATIVE_ROUNDED = 5e-16 / TRUSTED_PIVOT**2

#: Largest difference of a new library's derivatives from a quotient of differences, of its largest entry; and
#: a factor on efforts, which would hide other terms, and on results, whose rounding hides smaller changes.
DERIVATIVE_CHECKED, BESIDE = 1e-5, 1e-3
#: Times of the quotient [s]: over shorter ones rounding counts.
TIMES = np.linspace(-2e-5, 2e-5, 5)
#: Weights of the quotient, of order four [1/s].
SLOPE = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12e-5


class Derivatives(BuiltBeside):
    """The derivatives of one model of one robot, prepared once and evaluated often.

    Attributes:
        robot: The robot.
    """

    meanwhile = "CasADi computes it meanwhile, slowly"

    def __init__(
        self,
        robot: HybridRobot,
        model: str,
        effects: Choice = None,
        *,
        coordinates: str = "joints",
    ) -> None:
        """Load the derivatives from the cache, or generate and build them.

        Without a C compiler CasADi runs them, and until one is done that takes longer than `patience`.

        Args:
            model: "idm" or "ddm".
            effects: Effects to include, as for `hybridyn.idm`.
            coordinates: "joints" or "motors", as for `idm_jacobian`.

        Raises:
            ModelError: `model` or `coordinates` is unknown, an effect is not available in compiled models or
                has no derivative, or as `check_coordinates`.
            SingularityError: The motors of a module do not determine its motion at any posture.
            CompileError: The derivatives cannot be generated or built.
        """
        if model not in GENERAL:
            raise ModelError(f"there are derivatives of 'idm' and 'ddm', not of '{model}'")
        self._effects = without_losses(choose(robot, effects), "derivatives do not take")
        if self._effects.limits is not None:
            raise ModelError(
                "the effect 'limits' has no derivative: clip the efforts before the call", element="limits"
            )
        check_coordinates(robot, model, coordinates)
        self.robot, self._model, self._motors = robot, model, coordinates == "motors"
        self._at_once: Callable[..., int] = refuse
        with as_compile_error(robot):
            self.find_library()
            about = self.program if self.library is None else self.library.programs[self._name]
        self._inputs, self._outputs = dict(about.inputs), dict(about.outputs)
        self._size, self._blocks = self._places()

    def _places(self) -> tuple[int, list[tuple[str, slice, tuple[int, int]]]]:
        """Return the size of all results, and the place and the shape of the derivative by each input."""
        motors, (values, *_) = len(self.robot.motors), self._outputs.values()
        rows = motors if self._motors else values
        widths = [
            motors if self._motors else self.robot.nv if x == "q" else n for x, n in self._inputs.items()
        ]
        shapes = [(rows, width) for width in widths]
        ends = np.cumsum([values, *map(prod, shapes)]).tolist()
        return ends[-1], [*zip(self._inputs, map(slice, ends, ends[1:]), shapes, strict=True)]

    @property
    def _name(self) -> str:
        """Name of the program."""
        return f"{self._model}_motor_jacobian" if self._motors else f"{self._model}_jacobian"

    def _use(self, library: Library) -> None:
        """Use a library from now on."""
        super()._use(library)
        self._at_once = library.programs[self._name].at_once or refuse

    def _check(self, built: Built) -> None:
        """Compare a new library with the general path at random states, and a moment before and after them.

        The loops stay closed on the way, since rates and accelerations are those of a motion. Efforts grow.
        Over motors there are no idle motions.

        Raises:
            CompileError: The model differs, or its change in time from what the derivatives say.
        """
        robot, model, direct = self.robot, GENERAL[self._model], self._model == "ddm"
        library, move = Library(built), Retraction(robot.kinds).move
        driven = robot.motor_v if self._motors else np.arange(robot.nv)
        rows, idle = len(driven) if direct else len(robot.motors), not self._motors

        def states(seed: int) -> States:
            """Draw arguments before, at and after a state, shapes (T, 5, n), and accelerations, (T, nv)."""
            q, v, tau, a = random_states(robot, seed, idle=idle)
            way = [(np.array(list(map(move, q, h * v))), v + h * a) for h in TIMES]
            x = [
                BESIDE * (1.0 + h) * tau if direct else any_accelerations(robot, *at, seed + 1, idle=idle)
                for h, at in zip(TIMES, way, strict=True)
            ]
            return [*(np.stack(y, axis=1) for y in (*zip(*way, strict=True), x)), a]

        def run(q: Array, v: Array, x: Array, a: Array) -> tuple[list[Array], Array]:
            """Compute the model and its change."""
            (value, *over), guard = library.batch(self._name, q[:, 2], v[:, 2], x[:, 2])
            x_dot = np.einsum("k,tkn->tn", SLOPE, x)
            rates = v[:, 2, driven], a[:, driven], x_dot if direct else x_dot[:, driven]
            pairs = zip(over, rates, strict=True)
            change = sum(np.einsum("tij,tj->ti", J.reshape(len(a), rows, y.shape[1]), y) for J, y in pairs)
            return [value, np.hstack([change, BESIDE * value])], guard

        def general(q: Array, v: Array, x: Array, _: Array) -> list[Array]:
            """Compute them by the general path."""
            found = [model(robot, q[:, i], v[:, i], x[:, i], effects=self._effects) for i in range(5)]
            change = np.einsum("k,ktn->tn", SLOPE, found)
            change = change[:, driven] if direct else change
            return [found[2], np.hstack([change, BESIDE * found[2]])]

        compare_at_states(
            robot, f"'{self._name}'", run, general, DERIVATIVE_CHECKED, states=states, told=False
        )

    def _write(self) -> Program:
        """Write the model and its derivatives as a program."""
        every = self._model == "idm" and not self._motors  # others go group by group (`models`)
        asked = request(self.robot, self._effects, contacts=every)
        return BUILDERS[self._model, self._motors](asked)

    def allocate(self) -> Jacobians:
        """Return arrays that calls of one sample fill: this takes half of a small robot's time."""
        return _Room(self, np.zeros(self._size))

    def split(self, flat: Array) -> Jacobians:
        """Return the derivatives within a program's outputs of one sample, without a copy."""
        return {name: flat[at].reshape(shape) for name, at, shape in self._blocks}

    def __call__(self, *given: ArrayLike, out: Jacobians | None = None) -> Jacobians:
        """Evaluate at one sample or many.

        Args:
            given: The model's arguments, shapes (n,) or (T, n).
            out: Arrays of `allocate`, which are filled and returned; None returns new arrays.

        Raises:
            TrajectoryError: An array is missing, has a wrong shape, or has a number that is not finite; or
                `out` is not from `allocate`, or there are many samples.
            HybridynError: The loops are open or rank is lost at a state (errors of the general path).
            SingularityError: The pivots of the elimination vanish at a state, so digits are lost.
        """
        if out is None:
            flat = np.empty(self._size)
            if self._at_once(*given, flat) == 0:
                return self.split(flat)
            return self._checked(*given)
        if not isinstance(out, _Room) or out.owner is not self:
            raise TrajectoryError("out must be what `allocate` of the same derivatives returned")
        if self._at_once(*given, out.flat) == 0:
            return out
        for name, block in self._checked(*given).items():
            if block.shape != out[name].shape:
                raise TrajectoryError(f"out is for a single sample, the arguments are {len(block)} rows")
            out[name][...] = block
        return out

    def _checked(self, *given: ArrayLike) -> Jacobians:
        """Check the arguments and evaluate."""
        if len(given) != len(self._inputs):
            raise TrajectoryError(f"expected the arrays {', '.join(self._inputs)}; {len(given)} were given")
        arguments = named(self.robot, dict(zip(self._inputs, given, strict=True)))
        arrays = as_batches(arguments, self._inputs)
        (values, *found), guard = (self.library or self._interpreted).batch(self._name, *arrays.values())
        self._check_doubtful(arrays, values, guard)
        samples = samples_of(arguments["q"], "q")
        pairs = zip(self._blocks, found, strict=True)
        return {name: block.reshape(*samples, *shape) for (name, _, shape), block in pairs}

    def _check_doubtful(self, arrays: dict[str, Array], values: Array, guard: Array) -> None:
        """Compare samples whose guard is above its limit with the general path.

        Raises:
            HybridynError: The general path cannot compute them either, the model differs from it there, or
                the pivots are so small that derivatives may have lost their digits.
        """
        doubtful = np.flatnonzero(~(guard <= GUARD_LIMIT)).tolist()
        wanted = general(self.robot, self._effects, self._model, arrays) if doubtful else values
        for t in doubtful:
            differs = np.abs(values[t] - wanted[t]).max(initial=0.0) / np.abs(wanted[t]).max(initial=1e-300)
            off = np.maximum(differs, DERIVATIVE_ROUNDED * guard[t])  # nan, if one is
            if not off <= DERIVATIVE_AGREES:
                raise SingularityError(
                    f"derivatives of '{self._model}' are not to be trusted{AT_SAMPLE}: the pivots of the "
                    f"compiled model vanish there, and rounding may reach {off:.2g} of the largest entry "
                    f"(limit {DERIVATIVE_AGREES:g}). Move away from that posture",
                    sample=t,
                )


class _Room(Jacobians):
    """Derivatives of one sample, which are views of one array."""

    def __init__(self, owner: Derivatives, flat: Array) -> None:
        super().__init__(owner.split(flat))
        self.owner, self.flat = owner, flat
