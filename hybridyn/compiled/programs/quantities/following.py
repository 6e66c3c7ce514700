"""Rates and accelerations of all joints from independent coordinates, in C: dq/du and its drift.

The program is that of "close", for the chosen joints. Modules do not depend on each other, so the columns of
equal number of all modules are computed in one lane.
"""

from __future__ import annotations

import logging
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ....dynamics.quantities.engine import blocks
from ....dynamics.quantities.independent import Coordinates
from ....dynamics.quantities.joint_map import side_motions
from ....errors import CompileError, HybridynError
from ....spatial import Array, Mask
from ....structure.robot import HybridRobot
from ...code.scalars import Scalar
from ...failures import as_compile_error
from ...library.cache import Built, cached
from ...library.calls import Library, Numbers, loaded
from ...library.compilers import best_lanes
from ...needs import needs_casadi
from ..sources import robot_key

if TYPE_CHECKING:
    from ...code.library_source import Source

log = logging.getLogger("hybridyn.compiled")

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

    def __init__(self, robot: HybridRobot, u: Coordinates, dtype: str) -> None:
        """Load the program from the cache, or build it and compare it with the general path.

        Raises:
            CompileError: It cannot be built, or differs from the general path.
        """
        self.robot, self.u = robot, u
        scalar = Scalar(dtype, best_lanes(dtype))
        key = f"following {u.columns.tolist()} {robot_key(robot, None)} {scalar!r}"
        parts = blocks(robot, u)
        self._units = np.zeros((max((len(own) for own in u.own), default=0), robot.nv))
        for _, own, at in parts:
            self._units[at, u.columns[own]] = 1.0
        self._columns, self._entries = (
            np.concatenate([(place * robot.nv + index).ravel() for index, place in pairs])
            for pairs in (((i, own) for i, own, _ in parts), ((i, at) for i, _, at in parts))
        )
        source = partial(_source, robot, u, scalar)
        self._calls = loaded(lambda: cached(key, source, accept=self._accept)).programs["following"]

    def _accept(self, built: Built) -> None:
        """Compare dq/du and the drift of a new library with the general path at random states.

        Raises:
            CompileError: They differ, can be trusted nowhere, or the general path refuses the coordinates: a
                program has to choose which freedoms depend on the others, and may have to choose some of u.
        """
        from ...equations.states import moving_states

        self._calls, name = Library(built).programs["following"], self.robot.description.name
        limit = FOLLOWING_AGREES[str(self._calls.dtype)]
        for seed in range(ROUNDS):
            q, v, _ = moving_states(self.robot, SAMPLES, seed)
            (E, mapped), (a, trusted) = self.map(q), self.drift(q, v)
            good = mapped & trusted
            if good.any():
                break
        else:
            raise CompileError(
                f"the compiled motion map of the robot '{name}' can be trusted at none of "
                f"{ROUNDS * SAMPLES} random states: it is not used"
            )
        try:
            right, drift = side_motions(self.robot, q[good], v[good], self.u)
        except HybridynError as error:
            raise CompileError(f"the motion map of the robot '{name}' is not compiled: {error}") from error
        pairs = (E, right, right), (a, drift, np.hstack([drift, v[good]]))  # a drift may be zero
        off = max(
            float(np.abs(found[good] - wanted).max(initial=0.0) / (1e-300 + np.abs(scale).max(initial=0.0)))
            for found, wanted, scale in pairs
        )
        if not off <= limit:
            raise CompileError(
                f"the compiled motion map of the robot '{name}' differs from the general path by {off:.2g} "
                f"of its largest entry (limit {limit:g}): it is not used. "
                "This is a bug: report it with the robot's files; the general path is right"
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
    try:
        with as_compile_error(robot):
            return Following(robot, u, dtype)
    except CompileError as error:
        log.warning("quantities: the general path computes them (%s)", error)
        return None


def _source(robot: HybridRobot, u: Coordinates, scalar: Scalar) -> Source:
    """Generate the C source of the program "following"."""
    needs_casadi()
    from ...code.library_source import library_source
    from ...equations.request import request
    from ..close import following_program

    wanted = request(robot, None, dtype=scalar.name)
    return library_source([following_program(wanted, "following", set(u.columns.tolist()))], scalar)
