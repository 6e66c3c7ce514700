"""The models of a robot that CasADi runs: at once, and on machines without a C compiler."""

from __future__ import annotations

from functools import cached_property
from threading import RLock
from typing import TYPE_CHECKING, Any

import numpy as np

from ..effects.choice import Effects
from ..errors import CompileError
from ..structure.parameters.chosen import Parameters
from ..structure.robot import HybridRobot
from .equations.coefficients import at_robot
from .failures import as_compile_error, needs_casadi
from .library.artifact import Artifact
from .library.building import has_compiler
from .library.calls import Library
from .programs.designs import designs_to_verify
from .programs.sources import MODELS
from .verifying import verify

if TYPE_CHECKING:
    from .equations.request import Request
    from .programs.whole_robot import InterpretedCalls


class InterpretedModels:
    """Models that CasADi runs; each is written, and compared with the general path, when it is first called.

    Results differ from those of C by rounding: C fuses products and sums.

    Attributes:
        dtype: Type of the results, for which the guards are made.
        programs: Those that have been called.
    """

    built, steps = None, None

    def __init__(
        self,
        robot: HybridRobot,
        effects: Effects,
        parameters: Parameters,
        dtype: str,
        *,
        first: str = "idm",
        told: bool = True,
    ) -> None:
        """Write a first model; the others, too, if it serves nowhere.

        Args:
            told: Whether to log a warning where the general path has to compute most states.

        Raises:
            CompileError: CasADi is not installed; or as `hybridyn.compile` raises.
        """
        needs_casadi()
        self.dtype = np.dtype(dtype)
        self._asked_for, self._told = (robot, effects, parameters), told
        self._alone = RLock()
        self.programs: dict[str, InterpretedCalls | None] = {}
        try:
            self._write(first)
        except CompileError:  # perhaps the other models serve
            self._write(*MODELS)

    def program(self, name: str) -> InterpretedCalls | None:
        """Return the calls of a program, or None if the robot has no such program.

        Raises:
            CompileError: As `hybridyn.compile` raises.
        """
        if name not in self.programs:
            with self._alone:
                if name not in self.programs:
                    self._write(name, needed=False)
        return self.programs[name]

    @cached_property
    def _asked(self) -> Request:
        """What the equations are written from."""
        from .equations.request import request

        robot, effects, parameters = self._asked_for
        return request(robot, effects, parameters=parameters.slots, dtype=str(self.dtype), contacts=True)

    def _write(self, *names: str, needed: bool = True) -> None:
        """Write programs, and compare them with the general path.

        Args:
            needed: Whether one of them must compute some states itself.
        """
        from .programs.whole_robot import Interpreted, programs_of

        robot, effects, parameters = self._asked_for
        with as_compile_error(robot):
            found = Interpreted([*programs_of(self._asked, names).values()], str(self.dtype))
            accept(found, robot, effects, parameters, needed=needed, told=self._told)
        self.programs |= {name: found.programs.get(name) for name in names}


def accept(
    models: Any,
    robot: HybridRobot,
    effects: Effects,
    parameters: Parameters,
    *,
    needed: bool = True,
    told: bool = True,
) -> None:
    """Compare new models with the general path at each design to verify.

    Args:
        needed: Whether one of them must compute some states of the robot itself.
        told: As in `InterpretedModels`.

    Raises:
        CompileError: As in `hybridyn.compile`.
    """
    for numbers, like, own in designs_to_verify(robot, parameters):
        on = at_robot(effects, like) if parameters.size else effects
        design = numbers if parameters.size else None
        verify(models, like, on, required=own and needed, told=own and told, design=design)


def at_once(
    whole: Artifact, robot: HybridRobot, effects: Effects, parameters: Parameters, dtype: str
) -> Library | InterpretedModels:
    """Return the library of all models if it is in the cache, else models that CasADi runs.

    Raises:
        CompileError: As in `hybridyn.compile`.
    """
    if has_compiler() and whole.known() is not None:
        return whole.loaded(Library)
    return InterpretedModels(robot, effects, parameters, dtype)
