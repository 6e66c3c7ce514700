"""Rates and accelerations of all joints from independent coordinates, in C: dq/du and its drift.

The program is that of "close", for the chosen joints. Modules do not depend on each other, so the columns of
equal number of all modules are computed in one lane.

Models of a floating robot under a wrench on its base give and take forces on all its coordinates.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ....dynamics.energy import effective_model
from ....dynamics.quantities.engine import blocks
from ....dynamics.quantities.independent import Coordinates
from ....dynamics.quantities.joint_map import side_motions
from ....effects.choice import Effects
from ....errors import CompileError, HybridynError
from ....spatial import Array, Mask
from ....structure.robot import HybridRobot
from ...code.scalars import GUARD_LIMIT, Scalar
from ...failures import check_agreement, part_of_all
from ...library.building import best_lanes
from ...library.cache import Built
from ...library.calls import Library, Numbers
from ..sources import Artifact, library_of, robot_key

if TYPE_CHECKING:
    from ...code.library_source import Source

#: What a warning says that is done without a library.
BY_GENERAL = "quantities: the general path computes them"
#: Number of random states that a new program is compared at, and the largest difference from the general
#: path, relative to the largest entry of them all: rounding, through the condition of loops at any posture.
SAMPLES, FOLLOWING_AGREES = 12, {"float64": 1e-9, "float32": 1e-2}
#: Most draws of random states, until the program can be trusted at one.
ROUNDS = 8


class Following:
    """Motions of all joints of a robot over independent coordinates.

    Attributes:
        u: The coordinates, as many in each module as it has freedoms, or none: it then stays.
    """

    def __init__(self, robot: HybridRobot, u: Coordinates, built: Built) -> None:
        """Load the program."""
        self.robot, self.u, self._calls = robot, u, Library(built).programs["following"]
        parts = blocks(robot, u)
        self._units = np.zeros((max((len(own) for own in u.own), default=0), robot.nv))
        for _, own, at in parts:
            self._units[at, u.columns[own]] = 1.0
        self._columns, self._entries = (
            np.concatenate([(place * robot.nv + index).ravel() for index, place in pairs])
            for pairs in (((i, own) for i, own, _ in parts), ((i, at) for i, _, at in parts))
        )

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of the results."""
        return self._calls.dtype

    def map(self, q: Array) -> tuple[Numbers, Mask]:
        """Compute dq/du, shape (T, nv, N), and which samples can be trusted, shape (T,).

        Args:
            q: Positions, shape (T, nq).
        """
        lanes = len(self._units)
        out = np.zeros((len(q), self.u.size * self.robot.nv), self._calls.dtype)
        if not lanes:
            return np.swapaxes(out.reshape(len(q), 0, -1), 1, 2), np.ones(len(q), dtype=bool)
        rates, good = self._follow(np.repeat(q, lanes, axis=0), np.tile(self._units, (len(q), 1)), 1)
        out[:, self._columns] = rates.reshape(len(q), -1)[:, self._entries]
        whole: Mask = np.asarray(good.reshape(len(q), lanes).all(axis=1))
        return np.swapaxes(out.reshape(len(q), -1, self.robot.nv), 1, 2), whole

    def drift(self, q: Array, v: Array) -> tuple[Numbers, Mask]:
        """Compute the accelerations at u_dot = 0, shape (T, nv), and which samples can be trusted.

        Args:
            q: Positions, shape (T, nq).
            v: Rates that keep the loops closed, shape (T, nv).
        """
        return self._follow(q, v, 2)

    def _follow(self, q: Array, v: Array, output: int) -> tuple[Numbers, Mask]:
        """Return an output at zero accelerations of u, shape (T, nv), and which samples can be trusted."""
        outputs, guard = self._calls.batch([q, v, np.zeros_like(v)], 1)
        good: Mask = np.asarray(guard <= self._calls.trusted)
        return outputs[output], good


def following(robot: HybridRobot, u: Coordinates, dtype: str) -> Following | None:
    """Return the motions over independent coordinates, or None if only the general path computes them.

    It alone computes idle motions, which take least-norm rates, and it alone explains joints that are never
    independent. Modules without coordinates stay.
    """
    if any(len(own) not in (0, m.mobility) for m, own in zip(robot.modules, u.own, strict=True)):
        return None
    return artifact_of(robot, u, dtype).tried(partial(Following, robot, u), BY_GENERAL)


def artifact_of(robot: HybridRobot, u: Coordinates, dtype: str) -> Artifact:
    """Return the library of the program "following"."""
    scalar = Scalar(dtype, best_lanes(dtype))

    def write() -> Source:
        """Generate the C source."""
        from ...code.library_source import library_source
        from ...equations.request import request
        from ..close import following_program

        asked = request(robot, None, dtype=dtype)
        return library_source([following_program(asked, "following", set(u.columns.tolist()))], scalar)

    key = f"following {u.columns.tolist()} {robot_key(robot, None)} {scalar!r}"
    return Artifact(robot, key, write, lambda built: check_following(Following(robot, u, built)))


def check_following(moves: Following) -> None:
    """Compare dq/du and the drift of a new library with the general path at random states.

    Raises:
        CompileError: They differ, can be trusted nowhere, or the general path refuses the coordinates: a
            program has to choose which freedoms depend on the others, and may have to choose some of u.
    """
    from ...equations.states import moving_states

    robot, name = moves.robot, moves.robot.description.name
    for seed in range(ROUNDS):
        q, v, _ = moving_states(robot, SAMPLES, seed)
        for module, own in zip(robot.modules, moves.u.own, strict=True):
            if not len(own):
                v[:, module.v_index] = 0.0  # it stays
        (E, mapped), (a, trusted) = moves.map(q), moves.drift(q, v)
        good = mapped & trusted
        if good.any():
            break
    else:
        raise CompileError(
            f"the compiled motion map of the robot '{name}' can be trusted at none of "
            f"{ROUNDS * SAMPLES} random states: it is not used"
        )
    try:
        right, drift = side_motions(robot, q[good], v[good], moves.u)
    except HybridynError as error:
        raise CompileError(f"the motion map of the robot '{name}' is not compiled: {error}") from error
    offs = [
        part_of_all(E[good], right, right),
        part_of_all(a[good], drift, np.hstack([drift, v[good]])),  # a drift may be zero
    ]
    check_agreement(robot, "motion map", offs, FOLLOWING_AGREES[str(moves.dtype)])


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
