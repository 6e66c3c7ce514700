"""`hybridyn.SecondDerivatives`: second derivatives of both models, over joints or over motors, and rates."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property, partial

import numpy as np
from numpy.typing import ArrayLike

from ...effects.choice import Choice, Effects
from ...errors import ModelError
from ...spatial import Array
from ...structure.robot import HybridRobot
from ...structure.samples import as_batch, as_efforts, as_positions, as_rates, same_samples
from ..equations.request import Request, request
from ..failures import as_compile_error
from ..program import Program
from ..programs.derivatives.coordinates import check_coordinates
from ..programs.general import GENERAL
from .asking import AlongPath, Product, check_following, check_trusted, everywhere, three
from .paths import A_NEAR, DELTA, V_NEAR, along_joints, along_motors
from .prepared import Prepared
from .products import product_program
from .rates import rate_program
from .smooth import smooth_effects


class SecondDerivatives:
    """Second derivatives of one model of one robot, through its closed loops, in C.

    Over joints they are those of the model's equations over all freedoms; they hold along motions that keep
    the loops closed, as `hybridyn.idm_jacobian` does. Positions move as by Pinocchio's `integrate`. Over
    motors all joints follow the motors, such that the loops stay closed. Without a C compiler, and until a
    library is built that takes it long, CasADi runs the programs.

    Attributes:
        robot: The robot.
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
        threads: int = 1,
    ) -> None:
        """Check what is asked for; programs are written and built at their first use.

        Args:
            robot: The robot.
            model: "idm" or "ddm".
            effects: Effects to include, as for `hybridyn.idm`.
            coordinates: "joints" or "motors", as for `hybridyn.idm_jacobian`.
            threads: Number of threads that share a batch.

        Raises:
            ModelError: `model` or `coordinates` is unknown or not possible for this robot, `threads` is less
                than one, or an effect has no second derivative.
        """
        if model not in GENERAL:
            raise ModelError(f"there are second derivatives of 'idm' and 'ddm', not of '{model}'")
        if threads < 1:
            raise ModelError(f"threads must be at least 1, not {threads}")
        self._effects = smooth_effects(robot, effects)
        check_coordinates(robot, model, coordinates)
        self.robot, self.threads = robot, threads
        self._model, self._motors = model, coordinates == "motors"
        third = "a" if model == "idm" else "tau"
        self._of = "tau" if model == "idm" else "a"
        names = (DELTA, V_NEAR, A_NEAR if third == "a" else third) if self._motors else (DELTA, "v", third)
        self._inputs = dict(zip(("q", "v", third), names, strict=True))
        self._joints = robot.motor_v if self._motors else np.arange(robot.nv)

    def product(
        self, q: ArrayLike, v: ArrayLike, x: ArrayLike, weights: ArrayLike, direction: Sequence[ArrayLike]
    ) -> Product:
        """Compute weights^T d^2 f / d(q, v, x)^2 times a direction.

        Args:
            q: Positions of closed loops, shape (nq,) or (T, nq).
            v: Rates, shape (nv,) or (T, nv), [m/s, rad/s].
            x: Accelerations, shape (nv,) or (T, nv), [m/s^2, rad/s^2]; for "ddm" efforts, shape (motors,) or
                (T, motors), [N or N m].
            weights: Weights of the results, shape (n,) or (T, n): motors for efforts, nv for accelerations,
                over motors those of the motors.
            direction: Changes of q, along its freedoms, of v and of x, shapes ([T,] nv) and, of efforts,
                ([T,] motors); over motors, changes of their positions, rates and accelerations or efforts,
                shapes ([T,] motors).

        Raises:
            TrajectoryError: An array has a wrong shape or is not finite; over motors, or v or a are not those
                that the motors cause.
            SingularityError: A pivot of the compiled model vanishes.
            HybridynError: As the general path raises for a sample.
        """
        given, single = self._given(q, v, x)
        T = len(given[0])
        spread = [
            self._spread(name, one, T) for name, one in zip(self._inputs, three(direction), strict=True)
        ]
        rows, _ = as_batch(weights, self._size, "weights")
        found = self._run(self._products, given, *spread, self._on_results(everywhere(rows, T)))
        first = 0 if single else slice(None)
        slope, product = (
            {name: self._of_input(name, found[f"{of}_{what}"])[first] for name, of in self._inputs.items()}
            for what in ("slope", "product")
        )
        return Product(self._results(found[self._of])[first], slope, product)

    def hessian(self, q: ArrayLike, v: ArrayLike, x: ArrayLike, weights: ArrayLike) -> Array:
        """Compute the matrix weights^T d^2 f / d(q, v, x)^2, symmetric, shape (n, n) or (T, n, n).

        Rows and columns are those of q, v and x, one after the other. Each column is one product.

        Args:
            q: As in `product`.
            v: As in `product`.
            x: As in `product`.
            weights: As in `product`.

        Raises:
            HybridynError: As `product`.
        """
        given, single = self._given(q, v, x)
        T, sizes = len(given[0]), [self._width(name) for name in self._inputs]
        n = sum(sizes)
        many = [np.repeat(one, n, axis=0) for one in given]
        rows, _ = as_batch(weights, self._size, "weights")
        units = np.split(np.tile(np.eye(n), (T, 1)), np.cumsum(sizes)[:-1], axis=1)
        weighted = np.repeat(everywhere(rows, T), n, axis=0)
        found = self.product(many[0], many[1], many[2], weighted, units).product
        out = np.concatenate([*found.values()], axis=1).reshape(T, n, n)
        return out[0] if single else out

    def along(self, q: ArrayLike, v: ArrayLike, x: ArrayLike, direction: Sequence[ArrayLike]) -> AlongPath:
        """Compute the first two derivatives of all results along a direction.

        Args:
            q: As in `product`.
            v: As in `product`.
            x: As in `product`.
            direction: As in `product`.

        Raises:
            HybridynError: As `product`.
        """
        given, single = self._given(q, v, x)
        T = len(given[0])
        spread = [
            self._spread(name, one, T) for name, one in zip(self._inputs, three(direction), strict=True)
        ]
        return self._path(given, single, spread, [np.zeros(one.shape) for one in spread])

    def rates(self, q: ArrayLike, v: ArrayLike, a: ArrayLike, jerk: ArrayLike, snap: ArrayLike) -> AlongPath:
        """Compute efforts with their rates and second rates in time, of "idm".

        Args:
            q: As in `product`.
            v: As in `product`.
            a: Accelerations, shape (nv,) or (T, nv), [m/s^2, rad/s^2].
            jerk: Rates of accelerations, shape (nv,) or (T, nv), [m/s^3, rad/s^3]; over motors those of the
                motors, shape (motors,) or (T, motors).
            snap: Rates of the jerk, likewise, [m/s^4, rad/s^4].

        Raises:
            ModelError: The model is "ddm".
            HybridynError: As `product`.
        """
        if self._model != "idm":
            raise ModelError("rates in time are those of efforts: take SecondDerivatives(robot, 'idm')")
        given, single = self._given(q, v, a)
        T = len(given[0])
        j, s = (self._spread(name, one, T, "a") for name, one in (("jerk", jerk), ("snap", snap)))
        own = np.zeros((2, T, self.robot.nv))
        for out, full in zip(own, given[1:], strict=True):
            out[:, self._joints] = full[:, self._joints]
        return self._path(given, single, [own[0], own[1], j], [own[1], j, s])

    def _path(
        self, given: Sequence[Array], single: bool, first: Sequence[Array], second: Sequence[Array]
    ) -> AlongPath:
        """Return results along a path with given derivatives of the inputs."""
        found = self._run(self._rates, given, *first, *second)
        at = 0 if single else slice(None)
        return AlongPath(*(self._results(found[f"{self._of}{o}"])[at] for o in ("", "_dot", "_ddot")))

    @property
    def _size(self) -> int:
        """Number of results."""
        return len(self.robot.motors) if self._of == "tau" or self._motors else self.robot.nv

    def _width(self, name: str) -> int:
        """Return the number of coordinates of an input."""
        return len(self.robot.motors) if name == "tau" else len(self._joints)

    def _given(self, q: ArrayLike, v: ArrayLike, x: ArrayLike) -> tuple[list[Array], bool]:
        """Return checked arguments, and whether they are a single sample."""
        third = as_rates(self.robot, x, "a") if self._of == "tau" else as_efforts(self.robot, x)
        pairs = [as_positions(self.robot, q), as_rates(self.robot, v), third]
        same_samples(**dict(zip(self._inputs, (array for array, _ in pairs), strict=True)))
        return [array for array, _ in pairs], pairs[0][1]

    def _spread(self, name: str, given: ArrayLike, samples: int, of: str = "") -> Array:
        """Return changes of an input as its program reads them, shape (T, n)."""
        own, _ = as_batch(given, self._width(of or name), f"direction of {name}" if not of else name)
        own = everywhere(own, samples)
        if (of or name) == "tau":
            return own
        out = np.zeros((samples, self.robot.nv))
        out[:, self._joints] = own
        return out

    def _of_input(self, name: str, found: Array) -> Array:
        """Return derivatives over an input."""
        return found if name == "tau" else found[:, self._joints]

    def _on_results(self, weights: Array) -> Array:
        """Return weights as a program reads them."""
        if self._of == "tau":
            return weights
        out = np.zeros((len(weights), self.robot.nv))
        out[:, self._joints] = weights
        return out

    def _results(self, found: Array) -> Array:
        """Return results of a program."""
        return found if self._of == "tau" else found[:, self._joints]

    def _run(self, prepared: Prepared, given: Sequence[Array], *more: Array) -> dict[str, Array]:
        """Run a program, and check its guards and that the motion follows the motors."""
        found, guard = prepared.run(*given, *more, threads=self.threads)
        names = ("q", "v", "a" if self._of == "tau" else "tau")
        arrays = dict(zip(names, given, strict=True))
        check_trusted(self.robot, self._effects, self._model, arrays, guard)
        for name in ("v", "a") if self._motors else ():
            if name in arrays:
                check_following(name, arrays[name], found[name])
        return found

    @cached_property
    def _products(self) -> Prepared:
        """The program of products."""
        return self._prepared("product", partial(product_program, of=self._of))

    @cached_property
    def _rates(self) -> Prepared:
        """The program along paths."""
        return self._prepared("path", rate_program)

    def _prepared(self, what: str, write: Callable[..., Program]) -> Prepared:
        """Return a program over these coordinates."""
        name = f"{self._model}_{'motor_' * self._motors}{what}"
        along = partial(along_motors if self._motors else along_joints, model=self._model)
        make = partial(write, name=name, over=[*self._inputs.values()], zero=[DELTA])
        written = partial(_written, self.robot, self._effects, along, make)
        return Prepared(self.robot, self._effects, name, written)


def _written(
    robot: HybridRobot,
    effects: Effects,
    along: Callable[[Request], Program],
    make: Callable[[Program], Program],
) -> Program:
    """Write a program of second derivatives."""
    with as_compile_error(robot):
        return make(along(request(robot, effects, contacts=True)))
