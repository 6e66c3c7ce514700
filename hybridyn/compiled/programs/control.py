"""Control steps of compiled models: from what the motors do to their efforts."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from ...dynamics.quantities.independent import located
from ...effects.choice import Effects
from ...spatial import Array
from ...structure.robot import HybridRobot
from ..library.calls import Library, Numbers
from ..library.direct_calls import DOUBLE, REFUSED, again, refuse
from .model_calls import ModelCalls
from .postures import Postures
from .quantities.following import artifact_of
from .sources import robot_key


def torque_programs(models: Library, closing: Library | None) -> dict[str, int]:
    """Return the addresses of the functions of computed torque, by what `Law.tracking` calls them.

    Args:
        closing: Gives all accelerations from those of the motors, for the inverse model; None where the
            direct model is inverted.
    """
    if closing is None:
        return {"ddm": models.programs["ddm"].address}
    return {"close": closing.programs["following"].address, "idm": models.programs["idm"].address}


def closing_of_motors(robot: HybridRobot) -> Library | None:
    """Return the library of the motions over the motors from the cache, or build it.

    Returns:
        The library; None if motors do not determine the motion, or, with a warning, if it cannot be built.
    """
    u = located(robot, robot.motors, chosen=False)
    if any(len(own) != m.mobility for m, own in zip(robot.modules, u.own, strict=True)):
        return None
    return artifact_of(robot, u, "float64").tried(Library, "computed torque takes longer")


def same_without_limits(robot: HybridRobot, first: Effects, second: Effects) -> bool:
    """Return whether two choices of effects give the same inverse model, limits apart."""
    return len({robot_key(robot, on.without("limits")) for on in (first, second)}) == 1


class ControlSteps:
    """The control steps of a `CompiledRobot`."""

    def __init__(self, models: ModelCalls, postures: Postures) -> None:
        """Join the closing of loops with the inverse model."""
        self.robot, self._models, self._postures = models.robot, models, postures

    def idm_from_motors(
        self,
        position: ArrayLike,
        rate: ArrayLike | None = None,
        acceleration: ArrayLike | None = None,
        *,
        last: Array | None = None,
    ) -> tuple[Numbers, Array, Array, Array]:
        """Compute the efforts of the motors from what they do: `close`, then `idm`, in one call of C.

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
        start, still = self.robot.home if last is None else last, self._postures.still
        speed, change = still if rate is None else rate, still if acceleration is None else acceleration
        status = self._models.control_at_once(start, position, speed, change, out)
        if status == REFUSED:
            status = again(self._models.control_at_once, (start, position, speed, change), out)
        q, v, a = out[:nq], out[nq : nq + nv], out[nq + nv : nq + 2 * nv]
        if status == 0:
            return out[nq + 2 * nv :], q, v, a
        if status == REFUSED:
            q, v, a = self._postures.close(position, rate, acceleration, last=last)
            self._models.control_at_once = self._control()
        return self._models.run("idm", {"q": q, "v": v, "a": a}), q, v, a

    def _control(self) -> Callable[..., int]:
        """Return the call of a control step in C; one that refuses where there is none."""
        models, follower = self._models, self._postures.follower
        if follower is None or models.idm_at_once is refuse or models.dtype != DOUBLE:
            return refuse
        return follower.control(models.current.program("idm"))
