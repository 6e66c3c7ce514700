"""`hybridyn.DesignGradients`: gradients of a robot's models over its parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from ..compiled import as_compile_error, asked_for, needs_casadi
from ..effects.choice import Choice, without_losses
from ..errors import ModelError
from ..spatial import Array
from ..structure.parameters.slots import Slot
from ..structure.robot import HybridRobot
from ..structure.samples import as_accelerations, as_batch, as_efforts, as_positions, as_rates, one_of
from .adjoint import Bars, ClosedAdjoint
from .alike import programs_alike
from .blocks import Factored, condition_of
from .gradient import Gradient, MeasureBars, MeasureGradients
from .kept import Kept, check_held, check_motors_kept, kept_by_name
from .model_sweeps import ModelSweeps
from .over_parameters import over_parameters
from .samples import Samples, samples_of, wrench_columns


class DesignGradients:
    """Gradients of a robot's models over its parameters, through its closed loops.

    While a parameter changes, the motion that `keep` names stays, with its rates and accelerations, and the
    loops stay closed. A weighted sum of results costs a few times the model, whatever the number of
    parameters. The equations are those of compiled models; CasADi runs them.

    Attributes:
        robot: The robot.
        parameters: Its parameters, as those of a compiled model.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> gradients = hybridyn.DesignGradients(robot, ["upper_length", "mass:m1_tool"])
        >>> q, v, a = hybridyn.assemble(robot, motors=([0.1, 0.2], [1.0, 0.0], [0.0, 0.0]))
        >>> gradients.idm(q, v, a).over.round(3)
        array([[10.079,  1.392],
               [-7.034, -1.007]])
    """

    def __init__(
        self,
        robot: HybridRobot,
        parameters: Sequence[str | Slot],
        *,
        keep: Sequence[str] | Kept | None = None,
        effects: Choice = None,
        wrenches: Sequence[str] = (),
    ) -> None:
        """Write the models and their sweeps back.

        Args:
            robot: The robot.
            parameters: Numbers of the robot, as those of `hybridyn.compile`.
            keep: What stays: joints, and coordinates of links seen from the root link, such as
                "m1_tool/pose/x"; by default the motors. Joints that no loop moves stay, too.
            effects: Effects to include, as for `hybridyn.idm`.
            wrenches: Links on which wrenches act; they stay in the axes of their links.

        Raises:
            ModelError: There are no parameters, one is unknown or no number, or moves a frame of a closure
                that is written for the numbers of the robot's file; an effect is not available, or limits
                efforts, which has no derivative; or `keep` names what is not there.
            CompileError: CasADi is not installed, or the models cannot be written.
        """
        if isinstance(parameters, str) or not parameters:
            raise ModelError("gradients need parameters: a list of names such as ['mass:LINK']")
        needs_casadi()
        with as_compile_error(robot):
            self.robot, on, self.parameters = asked_for(robot, effects, parameters, "float64")
            self._effects = on
            if on.limits is not None:
                why = "the effect 'limits' has no derivative: leave it out, and take margins as constraints"
                raise ModelError(why, element="limits")
            words = robot.motors if keep is None else keep
            self._kept = words if isinstance(words, Kept) else kept_by_name(robot, words)
            self._pushed = tuple(wrenches)
            programs = programs_alike(self.robot, on, self.parameters, effects, self._pushed)
            self._closed = ClosedAdjoint(programs, self._kept)
            self._models = ModelSweeps(programs, self._closed)

    def idm(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        *,
        parameters: ArrayLike | None = None,
        weights: ArrayLike | None = None,
        wrenches: Mapping[str, ArrayLike] | None = None,
        passive: str = "given",
    ) -> Gradient:
        """Compute motor efforts, and their derivatives over the parameters.

        Args:
            q: Positions of closed loops, shape (nq,) or (T, nq).
            v: Rates, shape (nv,) or (T, nv), [m/s, rad/s].
            a: Accelerations, shape (nv,) or (T, nv), [m/s^2, rad/s^2].
            parameters: Numbers in the order of `parameters.labels`, shape (k,), for which the motion was
                assembled; by default those of the robot.
            weights: Derivatives of one number over the efforts, shape (motors,) or (T, motors): its
                derivative is then returned, in one sweep.
            wrenches: Wrenches on links that were named at first, as for `hybridyn.idm`; zero by default.
            passive: As for `hybridyn.idm`. With "solved" accelerations without a motor are those of zero
                effort. Their derivatives are the same with "given": they follow the parameters.

        Raises:
            ModelError: A motor does not stay beside motions that have none.
            ActuationError: Motors share a load, and have different units and no effort limits.
            AssemblyError: The loops are not closed.
            SingularityError: What stays does not determine the motion, or a pivot of the model vanishes.
            TrajectoryError: An array has a wrong shape, or is not finite.
        """
        return self._gradient("idm", (q, v, a, parameters, wrenches), weights, passive)

    def ddm(
        self,
        q: ArrayLike,
        v: ArrayLike,
        tau: ArrayLike,
        *,
        parameters: ArrayLike | None = None,
        weights: ArrayLike | None = None,
        wrenches: Mapping[str, ArrayLike] | None = None,
    ) -> Gradient:
        """Compute accelerations of constant efforts, and their derivatives over the parameters.

        Args:
            q: As in `idm`.
            v: As in `idm`.
            tau: Efforts in the order of `robot.motors`, shape (motors,) or (T, motors), [N or N m].
            parameters: As in `idm`.
            weights: Derivatives of one number over the accelerations, shape (nv,) or (T, nv).
            wrenches: As in `idm`.

        Raises:
            HybridynError: As `idm`.
        """
        return self._gradient("ddm", (q, v, tau, parameters, wrenches), weights)

    def motion(
        self, q: ArrayLike, v: ArrayLike, a: ArrayLike, *, parameters: ArrayLike | None = None
    ) -> tuple[Array, Array, Array]:
        """Compute the derivatives of the motion itself over the parameters.

        Args:
            q: As in `idm`.
            v: As in `idm`.
            a: As in `idm`.
            parameters: As in `idm`.

        Returns:
            Those of positions, over the freedoms, of rates and of accelerations, shape (nv, k) or (T, nv, k);
            NaN for freedoms that nothing determines, such as the spin of a rod between balls.

        Raises:
            HybridynError: As `idm`.
        """
        at = self._state(q, v, as_accelerations(self.robot, a), parameters)
        T, nv = len(at.q), self.robot.nv
        many, factors = at.repeated(nv), self._factors(at)
        unknown = self._closed.undetermined(factors)
        each, zero = np.tile(np.diag(1.0 - unknown), (T, 1)), np.zeros((T * nv, nv))
        repeated = [one for one in factors for _ in range(nv)]
        out = []
        for bars in (Bars(each, zero, zero), Bars(zero, each, zero), Bars(zero, zero, each)):
            found = self._over(self._closed.back(repeated, many.numbers, bars), at, factors)
            found = found.reshape(T, nv, -1)
            found[:, unknown] = np.nan
            out.append(found[0 if at.single else slice(None)])
        return out[0], out[1], out[2]

    def mass_matrix(self, q: ArrayLike, *, parameters: ArrayLike | None = None) -> Gradient:
        """Compute the mass matrix over the motors, row by row, and its derivatives over the parameters.

        Args:
            q: As in `idm`.
            parameters: As in `idm`.

        Raises:
            ModelError: The motors of the robot are not its independent coordinates, or something else stays.
            HybridynError: As `idm`.
        """
        without_losses(self._effects, "the mass matrix does not take")
        check_motors_kept(self.robot, self._kept)
        rest = np.zeros((*np.shape(q)[:-1], self.robot.nv))
        at = self._state(q, rest, as_accelerations(self.robot, rest), parameters)
        factors = self._factors(at)
        M, over = self._models.mass_matrix(at, factors)
        first = 0 if at.single else slice(None)
        return Gradient(M[first], self._over(over, at, factors)[first], condition_of(factors))

    def of_measures(
        self,
        motion: tuple[Array, Array, Array],
        parameters: Array,
        along: Array,
        measures: Sequence[MeasureBars],
        wrenches: Mapping[str, ArrayLike] | None = None,
        passive: str = "given",
    ) -> MeasureGradients:
        """Return the gradients of sums over a motion, one sweep for each of them.

        Args:
            motion: q, v, a, shapes (T, nq), (T, nv), (T, nv).
            parameters: Parameters of the design, shape (k,).
            along: Their derivative over other numbers, shape (k, n), which move them together.
            measures: Derivatives of each sum over the motion and the efforts.
            wrenches: As in `idm`.
            passive: As in `idm`. With "solved" measures of accelerations are those of a as it stands.

        Raises:
            HybridynError: As `idm`.
        """
        q, v, a = motion
        at = self._state(q, v, as_accelerations(self.robot, a), parameters, wrenches)
        factors = self._factors(at)
        (closing, of_closing), (part, of_part) = self._closed.closing(factors, at.numbers)
        check_held(self.robot, self._kept)
        whole = self._models.solved(at) if passive == "solved" else at
        caused = self._models.caused(whole, "idm") if measures else None
        rows, tau = [of_closing, of_part], np.zeros((len(at.q), len(self.robot.motors)))
        for one in measures:
            tau, row = self._of_measure(one, at, whole, factors, caused)
            rows.append(row)
        of_all = self._over(np.array(rows), at, factors, along)
        return MeasureGradients(tau, of_all[2:], closing, of_all[0], part, of_all[1])

    def _of_measure(
        self, one: MeasureBars, at: Samples, whole: Samples, factors: list[Factored], caused: Array | None
    ) -> tuple[Array, Array]:
        """Return efforts, (T, motors), and a sum's gradient over the slots; `whole` may be `at` solved."""
        bars, direct = Bars(one.q, one.v, one.a), np.zeros(at.slots.shape)
        for link, weights in one.links.items():
            moved, own = self._models.of_link(at, link, weights)
            bars, direct = Bars(*map(np.add, bars, moved)), direct + own
        if whole is not at:
            direct = direct + self._closed.back(factors, at.numbers, bars)
        added = bars if whole is at else None
        tau, found = self._models.summed(whole, factors, one.tau, "idm", added, caused)
        return tau, (found + direct).sum(axis=0)

    def _gradient(
        self,
        name: str,
        given: tuple[ArrayLike, ArrayLike, ArrayLike, ArrayLike | None, Mapping[str, ArrayLike] | None],
        weights: ArrayLike | None,
        passive: str = "given",
    ) -> Gradient:
        """Return the gradient of a model, see `idm`; given are its state, parameters and wrenches."""
        q, v, x, p, wrenches = given
        one_of("passive", passive, "given", "solved")
        if name == "idm":
            check_held(self.robot, self._kept)
        third = as_accelerations(self.robot, x) if name == "idm" else as_efforts(self.robot, x)
        at = self._state(q, v, third, p, wrenches)
        at = self._models.solved(at) if passive == "solved" else at
        factors, first = self._factors(at), 0 if at.single else slice(None)
        if weights is None:
            found = self._models.each(at, factors, name)
        else:
            width = self._models.size(name)
            rows, _ = as_batch(weights, width, "weights")
            found = self._models.summed(at, factors, np.broadcast_to(rows, (len(at.q), width)), name)
        over = self._over(found.over, at, factors)
        return Gradient(found.value[first], over[first], condition_of(factors))

    @property
    def operations(self) -> float:
        """Number of operations of the gradient of one weighted sum of efforts, a sample.

        It counts those of CasADi's graphs, and of the factors of the loops' rows.
        """
        return self._closed.operations + self._models.model("idm").n_instructions()

    def _state(
        self,
        q: ArrayLike,
        v: ArrayLike,
        third: tuple[Array, bool],
        parameters: ArrayLike | None,
        wrenches: Mapping[str, ArrayLike] | None = None,
    ) -> Samples:
        """Return checked arguments and the numbers in slots."""
        given = as_positions(self.robot, q), as_rates(self.robot, v), third
        pushed = wrench_columns(self._pushed, wrenches or {}, len(given[0][0]))
        return samples_of(self.parameters, given, parameters, pushed, moving=self.robot.base == "moving")

    def _factors(self, at: Samples) -> list[Factored]:
        """Return the factored rows of loops at samples."""
        return self._closed.factored(at.q, at.slots)

    def _over(self, over: Array, at: Samples, factors: list[Factored], along: Array | None = None) -> Array:
        """Return derivatives over parameters from those over slots, as `over_parameters` does."""
        return over_parameters(self.parameters, self._closed, over, at, factors, along)
