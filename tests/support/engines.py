"""The engines of the library behind the same calls, so that one test says of all of them what must hold.

engine_of("general", robot).idm(q, v, a)      the functions of `hybridyn`
engine_of("written", robot).idm(q, v, a)      the programs of compiled models, run by CasADi; idm and ddm
engine_of("compiled", robot).idm(q, v, a)     `hybridyn.compile(robot)`
"""

import inspect
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

import hybridyn
from hybridyn.compiled.equations.states import random_states
from tests.support.comparing import close_to
from tests.support.written_out import Interpreted

TRUSTED = 1.0  # guards up to this are trusted


class General:
    """The functions of `hybridyn` for one robot and its effects, called as methods of `CompiledRobot`."""

    recomputed = 0

    def __init__(self, robot: hybridyn.HybridRobot, effects: Any = "default") -> None:
        self.robot, self.effects = robot, effects

    def __getattr__(self, name: str) -> Callable[..., Any]:
        """Return a function of `hybridyn` without the arguments that the engine has."""
        function = getattr(hybridyn, name)
        known = inspect.signature(function).parameters
        bound = {"effects": self.effects} if "effects" in known and self.effects != "default" else {}
        return partial(function, self.robot, **bound)


class Written:
    """Both models of a robot, written out; they must trust themselves at every sample."""

    def __init__(self, robot: hybridyn.HybridRobot, effects: Any = "default") -> None:
        self.robot, self.library = robot, Interpreted(robot, ("idm", "ddm"), effects)
        self.idm, self.ddm = partial(self._run, "idm"), partial(self._run, "ddm")

    def _run(self, name: str, *given: np.ndarray, base_acceleration: Any = None) -> np.ndarray:
        if name == "ddm" and self.robot.base == "moving":
            given += (
                np.broadcast_to(0.0 if base_acceleration is None else base_acceleration, (len(given[0]), 6)),
            )
        (result,), guard = self.library.batch(name, *given)
        assert (guard <= TRUSTED).all()
        return result


def engine_of(name: str, robot: hybridyn.HybridRobot, effects: Any = "default") -> Any:
    """Return an engine for a robot."""
    engines = {"general": General, "written": Written, "compiled": hybridyn.compile}
    return engines[name](robot, effects)


def written_agrees(
    robot: hybridyn.HybridRobot, samples: int = 4, effects: Any = "default", within: float = 1e-10
) -> None:
    """Compare the written-out models of a robot with the general path; they must trust themselves."""
    q, v, _, tau = random_states(robot, samples)
    on, general = Written(robot, effects), General(robot, effects)
    a = general.ddm(q, v, tau)
    close_to(on.ddm(q, v, tau), a, within)
    close_to(on.idm(q, v, a), general.idm(q, v, a), within)
