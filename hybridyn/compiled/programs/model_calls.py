"""Calls of the models of a `CompiledRobot`: efforts, accelerations, and what its other parts ask of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...effects.choice import Effects
from ...spatial import Array
from ...structure.parameters.chosen import Parameters
from ...structure.robot import HybridRobot
from ..interpreted import at_once
from ..library.artifact import Artifact
from ..library.cache import Built
from ..library.calls import Calls, Library, Numbers
from ..library.current import Current, Models
from ..library.direct_calls import refuse
from .designs import DesignsInSlots
from .general import as_batches, check_batches, general, named, reasons, samples_of
from .handed_over import HandedOver


class ModelCalls:
    """The models in use, with what stands around their C: names, batches, and the general path.

    Attributes:
        robot: The robot.
        effects: Effects in the models.
        parameters: Numbers that calls may change.
        threads: Number of threads that share a batch.
        designs: The robot with other numbers.
        handed: The samples that the general path has computed.
        current: The models in use.
        dtype: Type of the arithmetic and of the results.
        idm_at_once: Call of the inverse model for one sample; it refuses where more is to do.
        ddm_at_once: Call of the direct model, likewise.
        control_at_once: Call of a control step with these models; it refuses until it is asked for.
    """

    def __init__(
        self, robot: HybridRobot, effects: Effects, parameters: Parameters, threads: int, models: Models,
        whole: Artifact, *, builds: bool = True,
    ) -> None:  # fmt: skip
        """Use models; the library of `whole` replaces those that CasADi runs if it `builds`."""
        self.robot, self.effects, self.threads, self.parameters = robot, effects, threads, parameters
        self.designs, self.handed = DesignsInSlots(robot, effects, parameters), HandedOver(robot.name)
        self._moving = robot.base == "moving"
        self.current = Current(models, self._use, whole, builds=builds)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the path of the library's file, if there is one, and what leads to it."""
        built, whole = self.current.models.built, self.current.artifact
        return _restored, (
            self.robot, self.effects, self.parameters, self.threads, built, whole, str(self.dtype)
        )  # fmt: skip

    def _use(self, models: Models) -> None:
        """Take the programs of models; another thread may do this between two calls."""
        self.dtype: np.dtype[Any] = models.dtype
        plain = self.effects.limits is None and not self.parameters.size
        idm, ddm = (models.programs.get(name) for name in ("idm", "ddm"))
        self.control_at_once: Callable[..., int] = refuse  # the next call asks for that of these models
        self.idm_at_once: Callable[..., int] = (plain and idm and idm.at_once) or refuse
        self.ddm_at_once = (plain and not self._moving and ddm and ddm.at_once) or refuse

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
        calls = self.current.program("ddm")
        arguments = self.arguments(calls, None, (len(q),))
        if len(q) == 1 and calls.at_once is not None and not self._moving and not arguments:
            out = np.empty(calls.size, self.dtype)
            if calls.at_once(q[0], v[0], tau[0], out) == 0:
                return out[None]
        states = [q, v, tau, base] if self._moving else [q, v, tau]
        (result,), guard = calls.batch([*states, *arguments.values()], self.threads)
        doubtful = np.count_nonzero(~(guard <= calls.trusted))
        self.handed.hand_over("simulate", len(q) if doubtful else 0)
        return None if doubtful else result

    def arguments(
        self, calls: Calls, parameters: ArrayLike | None, shape: tuple[int, ...]
    ) -> dict[str, Array]:
        """Return the input "parameters" of a program, shape (*shape, slots), or nothing if it has none."""
        if parameters is None and not self.parameters.size:
            return {}
        return {"parameters": self.designs.numbers(parameters, shape)}

    def run(self, name: str, given: dict[str, ArrayLike], parameters: ArrayLike | None = None) -> Numbers:
        """Run a model for one sample or many."""
        calls = self.current.program(name)
        result: Numbers
        sizes = dict(calls.inputs)
        given = named(self.robot, given)
        samples = samples_of(given["q"], "q")
        given = given | self.arguments(calls, parameters, samples)
        if given.keys() != sizes.keys():  # a base_acceleration for a base that does not move
            return general(self.robot, self.effects, name, given)
        batches = many = as_batches(given, sizes)
        limits = self.effects.limits
        if limits is not None and name == "ddm":
            many = batches | {"tau": limits.clip(self.robot, batches["tau"])}
        (result, *_), guard = calls.batch(list(many.values()), self.threads)
        doubtful = np.flatnonzero(~(guard <= calls.trusted))
        self.handed.say_of_table(name, len(doubtful), len(result))
        if len(doubtful):
            check_batches(batches, sizes)
            for why, count in reasons(self.robot, many["q"][doubtful], guard[doubtful]).items():
                self.handed.hand_over(name, count, why)
            result[doubtful] = self.designs.general(name, many, doubtful)
        if limits is not None and name == "idm":
            limits.check(self.robot, result)
        return result if samples else result[0]


def _restored(
    robot: HybridRobot, effects: Effects, parameters: Parameters, threads: int, built: Built | None,
    whole: Artifact, dtype: str,
) -> ModelCalls:  # fmt: skip
    """Restore pickled models; their library is built again where its file is gone."""
    try:
        models = Library(built) if built else at_once(whole, robot, effects, parameters, dtype)
    except OSError:
        models = whole.loaded(Library)
    return ModelCalls(robot, effects, parameters, threads, models, whole)
