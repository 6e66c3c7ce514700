"""`CompiledRobot`, the result of `hybridyn.compile`: compiled models with the calls of the general path."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np
from numpy.typing import ArrayLike

from ..effects.choice import names_on
from ..errors import ModelError
from .library.calls import Library, Numbers
from .library.steps import Steps
from .offered import Offered
from .programs.control import ControlSteps
from .programs.general import everywhere, samples_of
from .programs.handed_over import HandedOver
from .programs.model_calls import ModelCalls
from .programs.postures import Postures
from .programs.quantities.calls import Joints, Quantities

if TYPE_CHECKING:
    import casadi as ca

    from ..dynamics.reactions import Reactions
    from .program import Program
    from .second.derivatives import SecondDerivatives


class CompiledRobot:
    """Compiled models of one robot with one choice of effects.

    Results equal those of `hybridyn.idm` and `hybridyn.ddm` up to rounding. The general path computes samples
    whose closures are open, and samples at which a preselected pivot of the elimination is small.

    Attributes:
        robot: The robot.
        effects: Effects in the models.
        parameters: Numbers that calls may change.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> q, v, a = hybridyn.assemble(robot, motors=([0.1, 0.2], [1.0, 0.0], [0.0, 0.0]))
        >>> fast = hybridyn.compile(robot)
        >>> tau = fast.idm(q, v, a)
        >>> (fast.ddm(q, v, tau) - a).round(6) + 0.0
        array([0., 0., 0., 0.])
        >>> fast.handed_over.total()
        0
    """

    def __init__(self, models: ModelCalls) -> None:
        """Put the calls of loops, quantities and control beside those of the models."""
        self.robot, self.effects, self.parameters = models.robot, models.effects, models.parameters
        self._models = models
        self._postures = Postures(self._models)
        self._quantities = Quantities(self._models, self._postures)
        self._control = ControlSteps(self._models, self._postures)
        self._handed = models.handed
        self._motors, self._rates = len(self.robot.motors), self.robot.nv

    accelerations = Offered("_models", ModelCalls.accelerations)

    assemble = Offered("_postures", Postures.assemble)
    assemble_requests = Offered("_postures", Postures.assemble_requests)
    designs = Offered("_postures", Postures.designs)
    close = Offered("_postures", Postures.close)
    closure_residual = Offered("_postures", Postures.closure_residual)
    idm_from_motors = Offered("_control", ControlSteps.idm_from_motors)

    mass_matrix = Offered("_quantities", Quantities.mass_matrix)
    bias = Offered("_quantities", Quantities.bias)
    coriolis = Offered("_quantities", Quantities.coriolis)
    coriolis_matrix = Offered("_quantities", Quantities.coriolis_matrix)
    gravity = Offered("_quantities", Quantities.gravity)
    energy = Offered("_quantities", Quantities.energy)
    kinematics = Offered("_quantities", Quantities.kinematics)
    link_jacobian = Offered("_quantities", Quantities.link_jacobian)
    delassus = Offered("_quantities", Quantities.delassus)
    operational_inertia = Offered("_quantities", Quantities.operational_inertia)
    joint_map = Offered("_quantities", Quantities.joint_map)

    hand_over = Offered("_handed", HandedOver.hand_over)
    say_of_table = Offered("_handed", HandedOver.say_of_table)

    @overload
    def motion_map(self, q: ArrayLike, v: None = None, *, joints: Joints = None) -> Numbers: ...
    @overload
    def motion_map(self, q: ArrayLike, v: ArrayLike, *, joints: Joints = None) -> tuple[Numbers, Numbers]: ...
    def motion_map(
        self, q: ArrayLike, v: ArrayLike | None = None, *, joints: Joints = None
    ) -> Numbers | tuple[Numbers, Numbers]:
        """Compute dq/du, and with rates also its rate, (nv, N) or (T, nv, N), like `hybridyn.motion_map`."""
        return self._quantities.motion_map(q, v, joints=joints)

    @overload
    def idm(
        self, q: ArrayLike, v: ArrayLike, a: ArrayLike, *, parameters: ArrayLike | None = None,
        reactions: Literal[False] = ...,
    ) -> Numbers: ...  # fmt: skip
    @overload
    def idm(
        self, q: ArrayLike, v: ArrayLike, a: ArrayLike, *, parameters: ArrayLike | None = None,
        reactions: Literal[True],
    ) -> tuple[Numbers, Reactions]: ...  # fmt: skip
    def idm(
        self, q: ArrayLike, v: ArrayLike, a: ArrayLike, *, parameters: ArrayLike | None = None,
        reactions: bool = False,
    ) -> Numbers | tuple[Numbers, Reactions]:  # fmt: skip
        """Compute motor efforts, like `hybridyn.idm`.

        Args:
            q: Positions, shape (nq,) or (T, nq).
            v: Rates, shape (nv,) or (T, nv), [m/s, rad/s].
            a: Accelerations, shape (nv,) or (T, nv), [m/s^2, rad/s^2].
            parameters: Numbers in the order of `parameters.labels`, shape (k,) or (T, k); None for those of
                the robot.
            reactions: Also return the wrenches of joints, closures and modules. The first call builds their
                code.

        Returns:
            Efforts in the order of `robot.motors`, shape (motors,) or (T, motors), [N or N m]; with
            `reactions=True` also a `hybridyn.Reactions`.

        Raises:
            HybridynError: The same errors with the same messages as `hybridyn.idm`.
            ModelError: Reactions are asked for with other numbers than the robot's.
        """
        if reactions:
            if parameters is not None:
                raise ModelError(
                    "reactions are those of the robot's own numbers: leave out 'parameters', or compile "
                    "robot.with_parameters({...})", element="parameters",
                )  # fmt: skip
            return self._quantities.reactions(q, v, a)
        models = self._models  # every tenth of a microsecond counts
        out = np.empty(self._motors, models.dtype)
        if parameters is None and models.idm_at_once(q, v, a, out) == 0:
            return out
        return models.run("idm", {"q": q, "v": v, "a": a}, parameters)

    def ddm(
        self,
        q: ArrayLike,
        v: ArrayLike,
        tau: ArrayLike,
        *,
        base_acceleration: ArrayLike | None = None,
        parameters: ArrayLike | None = None,
    ) -> Numbers:
        """Compute accelerations, like `hybridyn.ddm`.

        Args:
            q: Positions, shape (nq,) or (T, nq).
            v: Rates, shape (nv,) or (T, nv), [m/s, rad/s].
            tau: Efforts in the order of `robot.motors`, shape (motors,) or (T, motors), [N or N m].
            base_acceleration: Spatial acceleration of a "moving" base in its own frame, shape (6,) or (T, 6);
                default zero.
            parameters: As in `idm`.

        Returns:
            Accelerations of the spanning tree, shape (nv,) or (T, nv), [m/s^2, rad/s^2].

        Raises:
            HybridynError: The same errors with the same messages as `hybridyn.ddm`.
        """
        models = self._models
        if base_acceleration is None and parameters is None:
            out = np.empty(self._rates, models.dtype)
            if models.ddm_at_once(q, v, tau, out) == 0:
                return out
        given = {"q": q, "v": v, "tau": tau}
        if self.robot.base == "moving" or base_acceleration is not None:
            given["base_acceleration"] = everywhere(base_acceleration, samples_of(q, "q"), models.dtype)
        return models.run("ddm", given, parameters)

    def second_derivatives(self, model: str = "idm", *, coordinates: str = "joints") -> SecondDerivatives:
        """Return the second derivatives of a model with these effects, parameters and threads.

        They are in double precision, and programs of their own.

        Args:
            model: "idm", "ddm" or "close", as for `hybridyn.SecondDerivatives`.
            coordinates: "joints" or "motors", likewise.

        Raises:
            ModelError: As `hybridyn.SecondDerivatives`.
        """
        from .second.derivatives import SecondDerivatives  # which other calls need not

        return SecondDerivatives(
            self.robot, model, self.effects, coordinates=coordinates, parameters=self.parameters.names,
            threads=self.threads,
        )  # fmt: skip

    def __repr__(self) -> str:
        """Describe the models: the robot and what is computed, its coordinates, and what was handed over."""
        robot, coordinates = repr(self.robot).split("\n")
        kind = f"{self.dtype}; {names_on(self.robot, self.effects)}{'; run by CasADi' * self.interpreted}"
        text = f"Compiled models ({kind}) of {robot}\n{coordinates}"
        handed = [f"{count} of {what}" for what, count in self.handed_over.most_common()]
        return text + (f"\nhanded to the general path: {', '.join(handed)}" if handed else "")

    @property
    def recomputed(self) -> int:
        """Number of samples that the general path has computed so far."""
        return self.handed_over.total()

    @property
    def threads(self) -> int:
        """Number of threads that share a batch; it may be set."""
        return self._models.threads

    @threads.setter
    def threads(self, number: int) -> None:
        self._models.threads = number

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of the arithmetic and of the results."""
        return self._models.dtype

    @property
    def handed_over(self) -> Counter[str]:
        """How many samples the general path has computed so far, by call and reason."""
        return self._handed.counts

    @property
    def library(self) -> Library:
        """The loaded library of all models; this waits until it is built."""
        return self._models.current.library()

    @property
    def interpreted(self) -> bool:
        """Whether CasADi runs the models: until the library is built, or for good where none can be."""
        return self._models.current.models.built is None

    @property
    def steps(self) -> Steps | None:
        """Time steps in C, or None where there are none; this waits until the library is built."""
        self.wait_until_optimised()
        return self._models.current.models.steps

    def wait_until_optimised(self) -> None:
        """Wait until the library is in use, or cannot be built."""
        self._models.current.wait()

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the models; the other parts are made of them."""
        return CompiledRobot, (self._models,)

    @property
    def casadi(self) -> dict[str, ca.Function]:
        """The models as CasADi functions with the input and output names used here, and "guard" last.

        Raises:
            ModelError: The effect 'limits' is on. It clips efforts outside the models.
        """
        if self.effects.limits is not None:
            raise ModelError(
                "the effect 'limits' is not part of CasADi functions: compile without it, and clip the "
                "efforts yourself",
                element="limits",
            )
        from .programs.whole_robot import function_of

        return {name: function_of(program) for name, program in self.programs.items()}

    @property
    def programs(self) -> dict[str, Program]:
        """The models as programs."""
        from .programs.whole_robot import programs

        return programs(self.robot, self.effects, parameters=self.parameters.slots)
