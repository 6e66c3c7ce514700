"""Control steps of compiled models: from what the motors do to their efforts."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ...dynamics.quantities.independent import located
from ...effects.choice import Effects
from ...spatial import Array
from ...structure.parameters.entries import Parameters
from ...structure.robot import HybridRobot
from ..code.scalars import GUARD_LIMIT, Scalar, text_of
from ..failures import check_agreement, difference
from ..library.building import best_lanes
from ..library.cache import Built
from ..library.calls import Library, Numbers
from ..library.closed_rows import ClosedRows
from ..library.direct_calls import DOUBLE, REFUSED, function_of, readable, refuse
from .quantities.calls import Quantities
from .quantities.engine import artifact_of
from .sources import Artifact, library_key, robot_key

if TYPE_CHECKING:
    from ..code.library_source import Source


class Control:
    """The efforts of a control step from what the motors do.

    Attributes:
        library: The library, whose program "idm" does not compare the loops.
        at_once: Takes the last posture, positions, rates and accelerations of the motors, and room for q, v,
            a and the efforts. Gives 0 where all are certain, `REFUSED` where the loops are not closed, and
            else 2; None where single calls do not run in C.
    """

    def __init__(self, built: Built, rows: ClosedRows) -> None:
        """Load a library, and let `rows` close the loops."""
        self.library = Library(built)
        self.at_once: Callable[..., int] | None = None
        if self.library.programs["idm"].at_once is not None and rows.close_row is not None:
            held, self._rows = ctypes.PyDLL(str(built.path)), rows
            self.at_once = function_of(held, "control_call", np.array([rows.close_row], np.uintp))


class TorquePrograms:
    """Programs of computed torque.

    Attributes:
        at: Addresses of the functions that run them for one sample, by what `Law.tracking` calls them.
    """

    def __init__(self, models: Built, closing: Built | None) -> None:
        """Load the programs; they stay loaded as long as this object.

        Args:
            closing: Gives all accelerations from those of the motors, for the inverse model; None where the
                direct model is inverted.
        """
        programs = {"close": (closing, "following"), "idm": (models, "idm")}
        if closing is None:
            programs = {"ddm": (models, "ddm")}
        self._held = [ctypes.PyDLL(str(built.path)) for built, _ in programs.values() if built]
        found = zip(self._held, programs.items(), strict=True)
        functions = {name: getattr(held, f"{program}_single_at") for held, (name, (_, program)) in found}
        self.at = {name: ctypes.cast(x, ctypes.c_void_p).value or 0 for name, x in functions.items()}


def closing_of_motors(robot: HybridRobot) -> Built | None:
    """Return the library of the motions over the motors from the cache, or build it.

    Returns:
        The library; None if motors do not determine the motion, or, with a warning, if it cannot be built.
    """
    u = located(robot, robot.motors, chosen=False)
    if any(len(own) != m.mobility for m, own in zip(robot.modules, u.own, strict=True)):
        return None
    return artifact_of(robot, u, "float64").tried(lambda built: built, "computed torque takes longer")


def same_without_limits(robot: HybridRobot, first: Effects, second: Effects) -> bool:
    """Return whether two choices of effects give the same inverse model, limits apart."""
    one, other = (robot_key(robot, on.without("limits")) for on in (first, second))
    return one == other


#: Number of random states at which a new library is compared with the model that compares the loops.
STATES = 12
#: Largest difference between both, relative to the largest effort: they differ in rounding alone.
SAME_EFFORTS = 1e-10


class ControlSteps(Quantities):
    """The control steps of a `CompiledRobot`."""

    idm: Callable[..., Numbers]
    parameters: Parameters
    _control_at_once: Callable[..., int] = refuse
    _known_control: tuple[ClosedRows, Control | None] | None = None

    def idm_from_motors(
        self,
        position: ArrayLike,
        rate: ArrayLike | None = None,
        acceleration: ArrayLike | None = None,
        *,
        last: Array | None = None,
    ) -> tuple[Numbers, Array, Array, Array]:
        """Compute the efforts of the motors from what they do: `close`, then `idm`, in one call of C.

        The inverse model does not compare the loops that have just been closed; pivots are guarded as ever.

        Args:
            position: As in `close`.
            rate: As in `close`.
            acceleration: As in `close`.
            last: As in `close`, one posture.

        Returns:
            Efforts as of `idm`, then q, v, a as of `close`.

        Raises:
            HybridynError: The same errors with the same messages as `close` and `idm`.
        """
        nq, nv = self.robot.nq, self.robot.nv
        out = np.empty(nq + 2 * nv + len(self.robot.motors))
        speed = self._motors_still if rate is None else rate
        change = self._motors_still if acceleration is None else acceleration
        start = self.robot.home if last is None else last
        status = self._control_at_once(start, position, speed, change, out)
        if status == REFUSED and (copies := readable(start, position, speed, change)) is not None:
            status = self._control_at_once(*copies, out)
        q, v, a = out[:nq], out[nq : nq + nv], out[nq + nv : nq + 2 * nv]
        if status == 0:
            return out[nq + 2 * nv :], q, v, a
        if status == REFUSED:
            q, v, a = self.close(position, rate, acceleration, last=last)
            self._control_at_once = self._control()
        return self.idm(q, v, a), q, v, a

    def _control(self) -> Callable[..., int]:
        """Return the call of a control step in C; one that refuses where there is none."""
        rows = self._follower
        plain = self.effects.limits is None and not self.parameters.size and self.dtype == DOUBLE
        if rows is None or not plain or self._close_at_once is refuse:
            return refuse
        if self._known_control is None or self._known_control[0] is not rows:
            self._known_control = rows, self._load_control(rows)
        control = self._known_control[1]
        return (control and control.at_once) or refuse

    def _load_control(self, rows: ClosedRows) -> Control | None:
        """Load the library of a control step; build it if it is new; None if that cannot be done."""
        robot, scalar = self.robot, Scalar(str(DOUBLE), best_lanes())

        def write() -> Source:
            """Generate the C source."""
            from ..code.library_source import library_source
            from ..equations.request import request
            from .inverse import inverse_program

            asked = replace(request(robot, self.effects), compared=False)
            sizes = {"NQ": robot.nq, "NV": robot.nv, "EFFORTS": len(robot.motors)}
            lines = [f"#define {name} {size}" for name, size in sizes.items()]
            text = "\n".join([*lines, text_of("control.h")])
            return library_source([inverse_program(asked)], scalar, text)

        key = f"control {library_key(robot, self.effects, scalar)}"
        artifact = Artifact(robot, key, write, self._check_control)
        return artifact.tried(
            lambda built: Control(built, rows), "idm_from_motors: two calls compute the efforts"
        )

    def _check_control(self, built: Built) -> None:
        """Compare a new library with the inverse model at random states.

        Raises:
            CompileError: They differ.
        """
        from ..equations.states import random_states

        q, v, a, _ = random_states(self.robot, STATES)
        (tau,), guard = Library(built).batch("idm", q, v, a)
        (right,), compared = self._current.program("idm").batch([q, v, a], 1)
        good = (guard <= GUARD_LIMIT) & (compared <= GUARD_LIMIT)
        check_agreement(self.robot, "control step", difference(tau[good], right[good]), SAME_EFFORTS)
