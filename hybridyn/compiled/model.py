"""`CompiledRobot`, the result of `hybridyn.compile`: compiled models with the calls of the general path."""

from __future__ import annotations

import logging
from collections import Counter
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..effects.choice import Effects, names_on
from ..errors import ModelError
from ..spatial import Array
from ..structure.parameters.entries import Parameters
from ..structure.robot import HybridRobot
from .equations.coefficients import at_robot
from .interpreted import at_once
from .library.artifact import Artifact
from .library.cache import Built
from .library.calls import Calls, Library, Numbers
from .library.current import Current, Models
from .library.direct_calls import refuse
from .library.steps import Steps
from .programs.control import ControlSteps
from .programs.designs import DesignsInSlots
from .programs.general import (
    as_batches,
    check_batches,
    everywhere,
    general,
    general_rows,
    named,
    reasons,
    samples_of,
)

if TYPE_CHECKING:
    import casadi as ca

    from .program import Program

log = logging.getLogger("hybridyn.compiled")


class CompiledRobot(ControlSteps):
    """Compiled models of one robot with one choice of effects.

    Results equal those of `hybridyn.idm` and `hybridyn.ddm` up to rounding. The general path computes samples
    whose closures are open, and samples at which a preselected pivot of the elimination is small.

    Attributes:
        robot: The robot.
        effects: Effects in the models.
        parameters: Numbers that calls may change.
        dtype: Type of the arithmetic and of the results.
        threads: Number of threads that share a batch.
        handed_over: How many samples the general path has computed so far, by call and reason.
    """

    def __init__(
        self,
        robot: HybridRobot,
        effects: Effects,
        models: Models,
        threads: int,
        parameters: Parameters,
        whole: Artifact,
        *,
        builds: bool = True,
    ) -> None:
        """Use models; the library of `whole` replaces those that CasADi runs if it `builds`."""
        self.robot, self.effects, self.threads, self.parameters = robot, effects, threads, parameters
        self._designs = DesignsInSlots(robot, self.parameters)
        self.handed_over: Counter[str] = Counter()
        self._tables: set[str] = set()
        self._followings = {}
        self._begin_postures()
        self._moving = robot.base == "moving"
        self._motors, self._rates = len(robot.motors), robot.nv
        self._current = Current(models, self._use, whole, builds=builds)

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

    def hand_over(self, call: str, count: int, why: str = "") -> None:
        """Count samples that the general path computes."""
        if count:
            self.handed_over[f"{call} ({why})" if why else call] += count

    def say_of_table(self, call: str, count: int, samples: int) -> None:
        """Log how many samples the general path computes; warn where they are most of the first table."""
        first = samples > 1 and call not in self._tables
        if first:
            self._tables.add(call)
        if count:
            log.log(
                logging.WARNING if first and 2 * count > samples else logging.INFO,
                "robot '%s', %s: %d of %d samples computed by the general path",
                self.robot.name, call, count, samples,
            )  # fmt: skip

    def _use(self, models: Models) -> None:
        """Take the programs of models; another thread may do this between two calls."""
        self.dtype = models.dtype
        plain = self.effects.limits is None and not self.parameters.size
        idm, ddm = (models.programs.get(name) for name in ("idm", "ddm"))
        self._control_at_once = refuse  # the next call asks for that of these models
        self._idm_at_once = (plain and idm and idm.at_once) or refuse
        self._ddm_at_once = (plain and not self._moving and ddm and ddm.at_once) or refuse

    @property
    def library(self) -> Library:
        """The loaded library of all models; this waits until it is built."""
        return self._current.library()

    @property
    def interpreted(self) -> bool:
        """Whether CasADi runs the models: until the library is built, or for good where none can be."""
        return self._current.models.built is None

    @property
    def steps(self) -> Steps | None:
        """Time steps in C, or None where there are none; this waits until the library is built."""
        self.wait_until_optimised()
        return self._current.models.steps

    def wait_until_optimised(self) -> None:
        """Wait until the library is in use, or cannot be built."""
        self._current.wait()

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the path of the library's file, if there is one, and what leads to it."""
        built, whole = self._current.models.built, self._current.artifact
        return _restored, (
            self.robot, self.effects, built, self.threads, self.parameters, whole, str(self.dtype)
        )  # fmt: skip

    def idm(
        self, q: ArrayLike, v: ArrayLike, a: ArrayLike, *, parameters: ArrayLike | None = None
    ) -> Numbers:
        """Compute motor efforts, like `hybridyn.idm`.

        Args:
            q: Positions, shape (nq,) or (T, nq).
            v: Rates, shape (nv,) or (T, nv), [m/s, rad/s].
            a: Accelerations, shape (nv,) or (T, nv), [m/s^2, rad/s^2].
            parameters: Numbers in the order of `parameters.labels`, shape (k,) or (T, k); None for those of
                the robot.

        Returns:
            Efforts in the order of `robot.motors`, shape (motors,) or (T, motors), [N or N m].

        Raises:
            HybridynError: The same errors with the same messages as `hybridyn.idm`.
        """
        out = np.empty(self._motors, self.dtype)
        if parameters is None and self._idm_at_once(q, v, a, out) == 0:  # every tenth of a microsecond counts
            return out
        return self._run("idm", {"q": q, "v": v, "a": a}, parameters)

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
        if base_acceleration is None and parameters is None:
            out = np.empty(self._rates, self.dtype)
            if self._ddm_at_once(q, v, tau, out) == 0:
                return out
        given = {"q": q, "v": v, "tau": tau}
        if self._moving or base_acceleration is not None:
            given["base_acceleration"] = everywhere(base_acceleration, samples_of(q, "q"), self.dtype)
        return self._run("ddm", given, parameters)

    def accelerations(self, q: Array, v: Array, tau: Array, base: Array) -> Array | None:
        """Compute accelerations for `simulate`, whose states are closed and whose efforts are within limits.

        Args:
            q: Positions, shape (T, nq).
            v: Rates, shape (T, nv).
            tau: Efforts, shape (T, motors).
            base: Accelerations of a moving base, shape (T, 6); not read for another base.

        Returns:
            Accelerations, shape (T, nv), or None if the general path must compute some sample.
        """
        calls = self._current.program("ddm")
        arguments = self._arguments(calls, None, (len(q),))
        if len(q) == 1 and calls.at_once is not None and not self._moving and not arguments:
            out = np.empty(calls.size, self.dtype)
            if calls.at_once(q[0], v[0], tau[0], out) == 0:
                return out[None]
        states = [q, v, tau, base] if self._moving else [q, v, tau]
        (result,), guard = calls.batch([*states, *arguments.values()], self.threads)
        doubtful = np.count_nonzero(~(guard <= calls.trusted))
        self.hand_over("simulate", len(q) if doubtful else 0)
        return None if doubtful else result

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

    def _arguments(
        self, calls: Calls, parameters: ArrayLike | None, shape: tuple[int, ...]
    ) -> dict[str, Array]:
        """Return the input "parameters" of a program, shape (*shape, slots), or nothing if it has none."""
        if parameters is None and not self.parameters.size:
            return {}
        return {"parameters": self._designs.numbers(parameters, shape)}

    def _run(self, name: str, given: dict[str, ArrayLike], parameters: ArrayLike | None = None) -> Numbers:
        """Run a model for one sample or many."""
        calls = self._current.program(name)
        result: Numbers
        sizes = dict(calls.inputs)
        given = named(self.robot, given)
        samples = samples_of(given["q"], "q")
        given = given | self._arguments(calls, parameters, samples)
        if given.keys() != sizes.keys():  # a base_acceleration for a base that does not move
            return general(self.robot, self.effects, name, given)
        batches = many = as_batches(given, sizes)
        limits = self.effects.limits
        if limits is not None and name == "ddm":
            many = batches | {"tau": limits.clip(self.robot, batches["tau"])}
        (result, *_), guard = calls.batch(list(many.values()), self.threads)
        doubtful = np.flatnonzero(~(guard <= calls.trusted))
        self.say_of_table(name, len(doubtful), len(result))
        if len(doubtful):
            check_batches(batches, sizes)
            for why, count in reasons(self.robot, many["q"][doubtful], guard[doubtful]).items():
                self.hand_over(name, count, why)
            numbers = many.pop("parameters", np.zeros((len(result), 0)))
            for robot, rows in self._designs.by_design(numbers, doubtful):
                effects = self.effects if robot is self.robot else at_robot(self.effects, robot)
                result[rows] = general_rows(robot, effects, name, many, rows)
        if limits is not None and name == "idm":
            limits.check(self.robot, result)
        return result if samples else result[0]


def _restored(
    robot: HybridRobot, effects: Effects, built: Built | None, threads: int, parameters: Parameters,
    whole: Artifact, dtype: str,
) -> CompiledRobot:  # fmt: skip
    """Restore a pickled compiled robot; its library is built again where its file is gone."""
    try:
        models = Library(built) if built else at_once(whole, robot, effects, parameters, dtype)
    except OSError:
        models = whole.loaded(Library)
    return CompiledRobot(robot, effects, models, threads, parameters, whole)
