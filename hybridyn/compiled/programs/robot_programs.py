"""The programs of one robot, for rooms that run them in code of their own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ...effects.choice import Effects
from ...spatial import Array
from ...structure.parameters.slots import Slot
from ...structure.robot import HybridRobot
from ..code.scalars import GUARD_LIMIT
from ..equations.arguments import ChosenNumbers, decided_alike
from ..equations.request import Request, request
from ..program import Program
from .close import freedoms_of, lift_program, turning_program
from .closed_motion import ClosedMotion, PrescribedLink, closed_motion, link_motion
from .loop_kernels import loop_kernels
from .map_programs import map_programs
from .module_loops import ModuleLoops, module_loops
from .walking import joints_text, module_walk_text, walk_text
from .whole_robot import function_of, programs_of

if TYPE_CHECKING:
    import casadi as ca


@dataclass(frozen=True, eq=False)
class RobotPrograms:
    """The programs of a robot, written when they are asked for.

    Attributes:
        robot: The robot.
        effects: Effects in the models.
        slots: Numbers of the description that are arguments ("parameters").
        dtype: Type of the arithmetic, "float64" or "float32".
        wrenches: Links on which wrenches are an input of "idm" and "ddm" ("wrenches", six numbers of each).
    """

    robot: HybridRobot
    effects: Effects
    slots: Sequence[Slot] = ()
    dtype: str = "float64"
    wrenches: Sequence[str] = ()

    @cached_property
    def _asked(self) -> Request:
        return request(
            self.robot, self.effects, parameters=self.slots, dtype=self.dtype, wrenches=self.wrenches,
            contacts=True,
        )  # fmt: skip

    def second(self, model: str, what: str, coordinates: str) -> Program:
        """Return a program of second derivatives, as `second.programs.second_program`."""
        from ..second.programs import second_program  # which other calls need not

        return second_program(
            self.robot, self.effects, model, what, coordinates=coordinates, slots=self.slots
        )

    @property
    def parameter_inputs(self) -> list[tuple[str, int]]:
        """The input "parameters" and its size, or nothing."""
        return self._asked.parameter_inputs

    def model(self, name: str, *, compared: bool = True) -> Program:
        """Write "idm", "ddm", "kinematics" or "close".

        Args:
            compared: Whether guards compare both ends of each loop; what closes them has done so.

        Raises:
            ModelError: An effect is not available in compiled models.
        """
        asked = self._asked if compared else replace(self._asked, compared=False)
        return programs_of(asked, (name,))[name]

    def function(self, name: str) -> ca.Function:
        """Write a model as one CasADi function, with the output "guard" last.

        Raises:
            ModelError: An effect is not available in compiled models.
        """
        return function_of(self.model(name))

    def other_structure(self, slots: Array) -> Array:
        """Return whether numbers in slots, shape (T, slots), decide a comparison otherwise, shape (T,)."""
        chosen = self._asked.arguments
        if not isinstance(chosen, ChosenNumbers) or not chosen.traced.decisions:
            return np.zeros(len(slots), dtype=bool)
        import casadi as ca

        guard = ca.Function("alike", [chosen.column], [decided_alike(chosen.traced.decisions)])
        out: Array = guard(slots.T).full()[0] > GUARD_LIMIT
        return out

    def closed_motion(self, links: Sequence[tuple[str, str, tuple[str, ...]]]) -> ClosedMotion:
        """Write what stays zero while loops are closed, and coordinates of links, as `PrescribedLink`."""
        return closed_motion(self._asked, [PrescribedLink(*one) for one in links])

    def link_motion(self, link: str) -> ca.Function:
        """Write the motion of a link in the world, see `closed_motion.link_motion`."""
        return link_motion(self._asked, link)

    @cached_property
    def lift(self) -> Program | None:
        """Newton's step onto the assembled postures; None if the robot has no such program."""
        return lift_program(self._asked)

    def maps(self, joints: Sequence[str]) -> list[Program]:
        """Write the maps between output joints and motors, "map_to_joints" and "map_to_motors".

        Raises:
            HybridynError: As `map_programs` raises.
        """
        return map_programs(self._asked, joints)

    def turning(self, side: Sequence[str]) -> Program:
        """Write what compares the branches of two postures that some joints determine."""
        return turning_program(self._asked, side)

    def check_independent(self, side: Sequence[str], what: str, why: str) -> None:
        """Refuse joints that depend on each other.

        Args:
            side: The joints.
            what: What the message calls them.
            why: What it says of them.

        Raises:
            SingularityError: They do, in some module.
        """
        for _, _, kernel in loop_kernels(self._asked, freedoms_of(self.robot, side)):
            kernel.check_independent(what, why)

    def walk(self, program: Program, side: Sequence[str]) -> str:
        """Return the C of the walk along a branch to joints that are an input, see `walking.walk_text`."""
        return walk_text(self._asked, program, side, posed=True)

    def modules(self, side: Sequence[str]) -> list[ModuleLoops]:
        """Write what closes the loops of one module at a time, for the modules of each shape."""
        return module_loops(self._asked, side)

    def module_walk(self, loops: ModuleLoops) -> str:
        """Return the C of the walk of one module, see `walking.module_walk_text`."""
        return module_walk_text(self._asked, loops)

    def joints(self, side: Sequence[str]) -> str:
        """Return the C that says where joints are in q and v, see `walking.joints_text`."""
        return joints_text(self.robot, side)
