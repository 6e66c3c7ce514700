"""Compiled motions over independent coordinates, compared with the general path."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ....dynamics.energy import effective_model
from ....dynamics.quantities.independent import IndependentCoordinates
from ....dynamics.quantities.joint_map import side_motions
from ....dynamics.quantities.polar_forms import blocks
from ....effects.choice import Effects
from ....spatial import Array, Mask
from ....structure.robot import HybridRobot
from ...code.scalars import Scalar
from ...comparing import States, compare_at_states, random_states, trusted_nowhere
from ...library.artifact import Artifact
from ...library.building import best_lanes
from ...library.cache import Built
from ...library.calls import Library, Numbers
from ..sources import library_of, robot_key

if TYPE_CHECKING:
    from ...code.library_source import Source

#: Largest difference of a new program from the general path, relative to the largest entry: rounding, through
#: the condition of loops at any posture.
FOLLOWING_AGREES = {"float64": 1e-9, "float32": 1e-2}


class Following:
    """Motions of all joints of a robot over independent coordinates.

    Attributes:
        u: The coordinates, as many in each module as it has freedoms, or none: it then stays.
        dtype: Type of the results.
    """

    def __init__(self, robot: HybridRobot, u: IndependentCoordinates, built: Built) -> None:
        """Load the program."""
        self.robot, self.u, self._calls = robot, u, Library(built).programs["following"]
        self.dtype, parts = self._calls.dtype, blocks(robot, u)
        self._units = np.zeros((max((len(own) for own in u.own), default=0), robot.nv))
        for _, own, at in parts:
            self._units[at, u.columns[own]] = 1.0
        self._columns, self._entries = (
            np.concatenate([(place * robot.nv + index).ravel() for index, place in pairs])
            for pairs in (((i, own) for i, own, _ in parts), ((i, at) for i, _, at in parts))
        )

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


def artifact_of(robot: HybridRobot, u: IndependentCoordinates, dtype: str) -> Artifact:
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

    model, library = effective_model(robot, on), Library(built)

    def run(q: Array, v: Array, _: Array, a: Array) -> tuple[list[Numbers], Array]:
        """Compute the wrench, and the accelerations that follow from all efforts."""
        (tau,), guard = library.batch("idm_pushed", q, v, a)
        (again,), other = library.batch("ddm_pushed", q, v, tau)
        return [tau[:, :6], again], np.maximum(guard, other)

    def wanted(q: Array, v: Array, _: Array, a: Array) -> list[Array]:
        """Compute the wrench by Pinocchio."""
        states = zip(q, v, a, strict=True)
        return [np.array([pin.rnea(model, model.createData(), *state)[:6] for state in states]), a]

    compare_at_states(robot, "models with a wrench on the base", run, wanted, FOLLOWING_AGREES[dtype])


#: What a warning says that is done without a library.
BY_GENERAL = "quantities: the general path computes them"


def check_following(moves: Following) -> None:
    """Compare dq/du and the drift of a new library with the general path at random states.

    Raises:
        CompileError: They differ, can be trusted nowhere, or the general path refuses the coordinates: a
            program has to choose which freedoms depend on the others, and may have to choose some of u.
    """
    robot = moves.robot
    still = [m.v_index for m, own in zip(robot.modules, moves.u.own, strict=True) if not len(own)]

    def states(seed: int) -> States:
        """Draw q and v; modules without coordinates stay."""
        q, v, *_ = random_states(robot, seed)
        v[:, [i for own in still for i in own]] = 0.0
        return q, v

    def run(q: Array, v: Array) -> tuple[list[Numbers], Array]:
        """Compute dq/du, and the drift, which may be zero, beside the rates."""
        (E, mapped), (a, trusted) = moves.map(q), moves.drift(q, v)
        return [E, np.hstack([a, v])], np.where(mapped & trusted, 0.0, np.inf)

    def general(q: Array, v: Array) -> list[Array]:
        """Compute them by the general path."""
        E, drift = side_motions(robot, q, v, moves.u)
        return [E, np.hstack([drift, v])]

    limit = FOLLOWING_AGREES[str(moves.dtype)]
    if not compare_at_states(robot, "motion map", run, general, limit, states=states):
        raise trusted_nowhere(robot, "motion map")
