"""Models of a floating robot under a wrench on its base: they give and take forces on all coordinates."""

from __future__ import annotations

from functools import partial

import numpy as np

from ....dynamics.energy import effective_model
from ....effects.choice import Effects
from ....structure.robot import HybridRobot
from ...agreement import check_agreement, part_of_all
from ...code.scalars import GUARD_LIMIT, Scalar
from ...library.cache import Built
from ...library.calls import Library
from ...library.compilers import best_lanes
from ..sources import library_of
from .following import BY_GENERAL, FOLLOWING_AGREES, SAMPLES

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
    scalar, check = Scalar(dtype, best_lanes(dtype)), partial(_check, robot, on, dtype)
    return library_of(robot, on, scalar, models=MODELS, check=check).tried(Library, BY_GENERAL)


def _check(robot: HybridRobot, on: Effects, dtype: str, built: Built) -> None:
    """Compare a new library with Pinocchio and with itself at random accelerations.

    Loops exert no force along the twist of the base, so its wrench is that of the open tree.

    Raises:
        CompileError: It differs.
    """
    import pinocchio as pin  # a start with a model from the cache does without it

    from ...equations.states import any_accelerations, moving_states

    q, v, _ = moving_states(robot, SAMPLES)
    a, library = any_accelerations(robot, q, v), Library(built)
    (tau,), guard = library.batch("idm_pushed", q, v, a)
    (again,), other = library.batch("ddm_pushed", q, v, tau)
    good = (guard <= GUARD_LIMIT) & (other <= GUARD_LIMIT)
    model, states = effective_model(robot, on), zip(q[good], v[good], a[good], strict=True)
    wrench = np.array([pin.rnea(model, model.createData(), *state)[:6] for state in states]).reshape(-1, 6)
    for name, found, wanted in (("idm", tau[good, :6], wrench), ("ddm", again[good], a[good])):
        off = part_of_all(found, wanted, wanted)
        check_agreement(robot, f"'{name}' with a wrench on the base", off, FOLLOWING_AGREES[dtype])
