"""Models of a floating robot under a wrench on its base: they give and take forces on all coordinates."""

from __future__ import annotations

import logging
from functools import partial

import numpy as np
import pinocchio as pin

from ....dynamics.energy import effective_model
from ....effects.choice import Effects
from ....errors import CompileError
from ....structure.robot import HybridRobot
from ...code.scalars import GUARD_LIMIT, Scalar
from ...failures import as_compile_error
from ...library.cache import Built
from ...library.calls import Library, loaded
from ...library.compilers import best_lanes
from ..sources import library_of
from .following import FOLLOWING_AGREES, SAMPLES

log = logging.getLogger("hybridyn.compiled")

MODELS = ("idm_pushed", "ddm_pushed")


def pushed_models(robot: HybridRobot, on: Effects, dtype: str) -> Library | None:
    """Return the models of a floating robot under a wrench on its base, from the cache or built.

    Their efforts "tau" begin with the wrench, about the base's origin and in its axes.

    Returns:
        The models; None if the general path computes forces: without velocity terms, or where they cannot be
        built.
    """
    if on.velocity is None:
        return None
    try:
        with as_compile_error(robot):
            find = library_of(robot, on, Scalar(dtype, best_lanes(dtype)), models=MODELS)
            return loaded(lambda: find(accept=partial(_accept, robot, on, dtype)))
    except CompileError as error:
        log.warning("quantities: the general path computes them (%s)", error)
        return None


def _accept(robot: HybridRobot, on: Effects, dtype: str, built: Built) -> None:
    """Compare a new library with Pinocchio and with itself at random accelerations.

    Loops exert no force along the twist of the base, so its wrench is that of the open tree.

    Raises:
        CompileError: It differs.
    """
    from ...equations.states import any_accelerations, moving_states

    q, v, _ = moving_states(robot, SAMPLES)
    a, library = any_accelerations(robot, q, v), Library(built)
    (tau,), guard = library.batch("idm_pushed", q, v, a)
    (again,), other = library.batch("ddm_pushed", q, v, tau)
    good = (guard <= GUARD_LIMIT) & (other <= GUARD_LIMIT)
    model = effective_model(robot, on)
    wrench = np.array(
        [pin.rnea(model, model.createData(), *state)[:6] for state in zip(q, v, a, strict=True)]
    )
    for found, wanted in ((tau[:, :6], wrench), (again, a)):
        off = np.abs(found - wanted)[good].max(initial=0.0) / (1e-300 + np.abs(wanted).max(initial=0.0))
        if not off <= FOLLOWING_AGREES[dtype]:
            raise CompileError(
                f"the compiled models of the robot '{robot.description.name}' with a wrench on its base "
                f"differ from the general path by {off:.2g} of the largest entry (limit "
                f"{FOLLOWING_AGREES[dtype]:g}): they are not used. This is a bug: report it with the robot's "
                "files; the general path is right"
            )
