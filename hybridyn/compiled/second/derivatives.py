"""`hybridyn.SecondDerivatives`: second derivatives of both models and of closed motions, and rates."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, partial

import numpy as np
from numpy.typing import ArrayLike

from ...effects.choice import Choice
from ...errors import ModelError
from ...spatial import Array
from ...structure.parameters.slots import Slot
from ...structure.robot import HybridRobot
from ...structure.samples import as_positions, as_rates, same_samples
from ..programs.designs import DesignsInSlots
from ..programs.sources import asked_for
from .asking import AlongPath, Product, check_following, check_trusted, three
from .models import MODELS
from .paths import MOTION
from .places import places_of
from .prepared import Prepared
from .programs import name_of, second_program
from .smooth import check_smooth


class SecondDerivatives:
    """Second derivatives of one model of one robot, through its closed loops, in C.

    Over joints they are those of the model's equations over all freedoms; they hold along motions that keep
    the loops closed, as `hybridyn.idm_jacobian` does. Positions move as by Pinocchio's `integrate`. Over
    motors all joints follow the motors, such that the loops stay closed. Those of "close" are of the motion
    of all joints over the motors': results are q as it stands, v and a, one after the other, and joints that
    no motor moves stay as they are. Without a C compiler, and until a library is built that takes it long,
    CasADi runs the programs.

    Attributes:
        robot: The robot.
        parameters: Numbers that calls may change.
        threads: Number of threads that share a batch.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> q, v, a = hybridyn.assemble(robot, motors=([0.1, 0.2], [1.0, 0.0], [0.0, 0.0]))
        >>> second = hybridyn.SecondDerivatives(robot, "idm", coordinates="motors")
        >>> first = [1.0, 0.0], [0.0, 0.0], [0.0, 0.0]  # the position of the first motor
        >>> second.product(q, v, a, weights=[1.0, 0.0], direction=first).product["q"].round(3)
        array([-1.564,  0.277])
    """

    def __init__(
        self,
        robot: HybridRobot,
        model: str = "idm",
        effects: Choice = None,
        *,
        coordinates: str = "joints",
        parameters: Sequence[str | Slot] = (),
        threads: int = 1,
    ) -> None:
        """Check what is asked for; programs are written and built at their first use.

        Args:
            robot: The robot.
            model: "idm", "ddm" or "close".
            effects: Effects to include, as for `hybridyn.idm`.
            coordinates: "joints" or "motors", as for `hybridyn.idm_jacobian`; "motors" for "close", whose
                base may float.
            parameters: Numbers of the robot that calls may change, as for `hybridyn.compile`.
            threads: Number of threads that share a batch.

        Raises:
            ModelError: `model` or `coordinates` is unknown or not possible for this robot, `threads` is less
                than one, a parameter is unknown, or an effect has no second derivative.
        """
        if model not in MODELS:
            raise ModelError(f"there are second derivatives of 'idm', 'ddm' and 'close', not of '{model}'")
        if threads < 1:
            raise ModelError(f"threads must be at least 1, not {threads}")
        check_smooth(robot, effects)
        self._model, self._coordinates = MODELS[model], coordinates
        self._model.check(robot, model, coordinates)
        self.robot, self._effects, self.parameters = asked_for(robot, effects, parameters, "float64")
        self._designs, self.threads = DesignsInSlots(self.robot, self._effects, self.parameters), threads
        self._inputs, self._places = self._model.inputs(coordinates), places_of(robot, coordinates)

    def product(
        self,
        q: ArrayLike,
        v: ArrayLike,
        x: ArrayLike,
        weights: ArrayLike,
        direction: Sequence[ArrayLike],
        *,
        parameters: ArrayLike | None = None,
    ) -> Product:
        """Compute weights^T d^2 f / d(q, v, x)^2 times a direction.

        Args:
            q: Positions of closed loops, shape (nq,) or (T, nq).
            v: Rates, shape (nv,) or (T, nv), [m/s, rad/s].
            x: Accelerations, shape (nv,) or (T, nv), [m/s^2, rad/s^2]; for "ddm" efforts, shape (motors,) or
                (T, motors), [N or N m].
            weights: Weights of the results, shape (n,) or (T, n): motors for efforts, nv for accelerations,
                over motors those of the motors; nq + 2 nv for "close".
            direction: Changes of q, along its freedoms, of v and of x, shapes ([T,] nv) and, of efforts,
                ([T,] motors); over motors, changes of their positions, rates and accelerations or efforts,
                shapes ([T,] motors).
            parameters: Numbers in the order of `parameters.labels`, shape (k,) or (T, k); None for those of
                the robot.

        Raises:
            TrajectoryError: An array has a wrong shape or is not finite; over motors, or v or a are not those
                that the motors cause.
            SingularityError: A pivot of the compiled model vanishes.
            HybridynError: As the general path raises for a sample.
        """
        given, single = self._given(q, v, x, parameters)
        T = len(given[0])
        return self._product(given, self._weighted(weights, T), self._spread(direction, T), single=single)

    def _product(
        self, given: Sequence[Array], weighted: Array, spread: Sequence[Array], *, single: bool
    ) -> Product:
        """Return a product from checked arguments, with weights and a direction as the program reads them."""
        found, first = self._run(self._products, given, *spread, weighted), 0 if single else slice(None)
        slope, product = (
            {x: self._places.own(x, found[f"{of}_{what}"])[first] for x, of in self._inputs.items()}
            for what in ("slope", "product")
        )
        of = self._model.result
        return Product(self._places.own(of, found[of])[first], slope, product)

    def hessian(
        self,
        q: ArrayLike,
        v: ArrayLike,
        x: ArrayLike,
        weights: ArrayLike,
        *,
        parameters: ArrayLike | None = None,
    ) -> Array:
        """Compute the matrix weights^T d^2 f / d(q, v, x)^2, symmetric, shape (n, n) or (T, n, n).

        Rows and columns are those of q, v and x, one after the other. Each column is one product.

        Args:
            q: As in `product`.
            v: As in `product`.
            x: As in `product`.
            weights: As in `product`.
            parameters: As in `product`.

        Raises:
            HybridynError: As `product`.
        """
        given, single = self._given(q, v, x, parameters)
        T, sizes = len(given[0]), [self._places.width(name) for name in self._inputs]
        n = sum(sizes)
        many = [np.repeat(one, n, axis=0) for one in given]
        weighted = np.repeat(self._weighted(weights, T), n, axis=0)
        units = np.split(np.tile(np.eye(n), (T, 1)), np.cumsum(sizes)[:-1], axis=1)
        found = self._product(many, weighted, self._spread(units, n * T), single=False).product
        out = np.concatenate([*found.values()], axis=1).reshape(T, n, n)
        return out[0] if single else out

    def along(
        self,
        q: ArrayLike,
        v: ArrayLike,
        x: ArrayLike,
        direction: Sequence[ArrayLike],
        *,
        parameters: ArrayLike | None = None,
    ) -> AlongPath:
        """Compute the first two derivatives of all results along a direction.

        Args:
            q: As in `product`.
            v: As in `product`.
            x: As in `product`.
            direction: As in `product`.
            parameters: As in `product`.

        Raises:
            HybridynError: As `product`.
        """
        given, single = self._given(q, v, x, parameters)
        spread = self._spread(direction, len(given[0]))
        return self._path(given, single, spread, [np.zeros(one.shape) for one in spread])

    def rates(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        jerk: ArrayLike,
        snap: ArrayLike,
        *,
        parameters: ArrayLike | None = None,
    ) -> AlongPath:
        """Compute efforts with their rates and second rates in time, of "idm".

        Args:
            q: As in `product`.
            v: As in `product`.
            a: Accelerations, shape (nv,) or (T, nv), [m/s^2, rad/s^2].
            jerk: Rates of accelerations, shape (nv,) or (T, nv), [m/s^3, rad/s^3]; over motors those of the
                motors, shape (motors,) or (T, motors).
            snap: Rates of the jerk, likewise, [m/s^4, rad/s^4].
            parameters: As in `product`.

        Raises:
            ModelError: The model is "ddm".
            HybridynError: As `product`.
        """
        if self._model.result != "tau":
            raise ModelError("rates in time are those of efforts: take SecondDerivatives(robot, 'idm')")
        given, single = self._given(q, v, a, parameters)
        T = len(given[0])
        j, s = (self._places.spread("a", x, T, name) for name, x in (("jerk", jerk), ("snap", snap)))
        return self._path(given, single, [*given[1:3], j], [given[2], j, s])

    def _path(
        self, given: Sequence[Array], single: bool, first: Sequence[Array], second: Sequence[Array]
    ) -> AlongPath:
        """Return results along a path with given derivatives of the inputs."""
        found, at = self._run(self._rates, given, *first, *second), 0 if single else slice(None)
        of = self._model.result
        return AlongPath(*(self._places.own(of, found[of + o])[at] for o in ("", "_dot", "_ddot")))

    def _given(
        self, q: ArrayLike, v: ArrayLike, x: ArrayLike, parameters: ArrayLike | None
    ) -> tuple[list[Array], bool]:
        """Return checked arguments, and whether they are a single sample."""
        pairs = [as_positions(self.robot, q), as_rates(self.robot, v), self._model.read(self.robot, x)]
        same_samples(**dict(zip(self._inputs, (array for array, _ in pairs), strict=True)))
        given, single = [array for array, _ in pairs], pairs[0][1]
        if self.parameters.size or parameters is not None:
            given.append(np.atleast_2d(self._designs.numbers(parameters, () if single else (len(given[0]),))))
        return given, single

    def _weighted(self, weights: ArrayLike, samples: int) -> Array:
        """Return weights of results as programs read them, for every sample."""
        return self._places.spread(self._model.result, weights, samples, "weights")

    def _spread(self, direction: Sequence[ArrayLike], samples: int) -> list[Array]:
        """Return a direction as programs read it, for every sample."""
        pairs = zip(self._inputs, three(direction), strict=True)
        return [self._places.spread(x, one, samples, f"direction of {x}") for x, one in pairs]

    def _run(self, prepared: Prepared, given: Sequence[Array], *more: Array) -> dict[str, Array]:
        """Run a program, and check its guards and that the motion follows the motors."""
        found, guard = prepared.run(*given, *more, threads=self.threads)
        arrays = dict(zip((*self._inputs, "parameters"), given, strict=False))
        check_trusted(self._designs, self._model.name, arrays, guard)
        if MOTION in found:
            parts = np.split(found[MOTION], np.cumsum([self.robot.nq, self.robot.nv]), axis=1)
            found = found | dict(zip("qva", parts, strict=True))
        if self._coordinates == "motors":
            check_following(arrays, found)
        return found

    @cached_property
    def _products(self) -> Prepared:
        """The program of products."""
        return self._prepared("product")

    @cached_property
    def _rates(self) -> Prepared:
        """The program along paths."""
        return self._prepared("path")

    def _prepared(self, what: str) -> Prepared:
        """Return a program over these coordinates."""
        name = name_of(self._model.name, what, self._coordinates)
        write = partial(
            second_program, self.robot, self._effects, self._model.name, what,
            coordinates=self._coordinates, slots=self.parameters.slots,
        )  # fmt: skip
        return Prepared(self.robot, self._effects, name, write, self.parameters)
