"""Closed-loop quantities of compiled models, with the names and the errors of the general path."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, partial
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike

from ....dynamics.direct import acceleration_of_base
from ....dynamics.energy import Energy, energy
from ....dynamics.quantities.engine import rate_of_map
from ....dynamics.quantities.independent import Coordinates, independent_coordinates
from ....dynamics.quantities.model import bias, coriolis, coriolis_matrix, gravity, mass_matrix, motion_map
from ....dynamics.state_checks import checked_state
from ....effects.choice import Effects
from ....effects.joint_laws import Spring, Stop
from ....errors import HybridynError
from ....spatial import Array
from ....structure.robot import HybridRobot
from ...library.calls import Calls, Numbers
from ...library.current import Current
from .following import Following, following, in_parts
from .held_base import HeldBase, held_base
from .rows import Computed, QuantityRows, energy_rows

log = logging.getLogger("hybridyn.compiled")

#: Largest difference, of the largest rate in the robot's units, between given rates and those that follow
#: from the independent coordinates: a hundred times how far `idm` lets loops be open.
FOLLOWS = {"float64": 1e-9, "float32": 3e-1}

Joints = Sequence[str] | None


class Quantities:
    """The closed-loop quantities of a `CompiledRobot`.

    Arguments, results and errors are those of the functions with the same names, effects those of the
    compiled models. The general path computes samples that cannot be trusted, and what no program computes.
    """

    robot: HybridRobot
    effects: Effects
    threads: int
    dtype: np.dtype[Any]
    hand_over: Callable[..., None]
    _current: Current
    _followings: dict[tuple[str, ...], Following | None]
    _arguments: Callable[[Calls, ArrayLike | None, tuple[int, ...]], dict[str, Array]]
    _posture_at: Callable[[Mapping[str, ArrayLike]], Array]
    _run: Callable[[str, dict[str, ArrayLike]], Numbers]

    def mass_matrix(self, q: ArrayLike, *, joints: Joints = None) -> Numbers:
        """Compute M(q), shape (N, N) or (T, N, N), like `hybridyn.mass_matrix`."""
        q, _, single = checked_state(self.robot, q, None)
        rows = self._rows(joints)
        general = partial(mass_matrix, self.robot, joints=joints, effects=self.effects)
        return self._finished(
            "mass_matrix", rows.mass if rows else None, general, rows.moves.u.size if rows else 1, single, q
        )

    def bias(
        self, q: ArrayLike, v: ArrayLike, *, joints: Joints = None, base_acceleration: ArrayLike | None = None
    ) -> Numbers:
        """Compute c(q, v) + g(q), shape (N,) or (T, N), like `hybridyn.bias`."""
        q, v, single = checked_state(self.robot, q, v)
        rows = self._rows(joints)
        base = np.zeros((len(q), 6))
        if base_acceleration is not None:
            base = acceleration_of_base(self.robot, base_acceleration, len(q))

        def general(q: Array, v: Array, base: Array) -> Array:
            """Compute it by the general path."""
            given = base if self.robot.base == "moving" else None
            return bias(self.robot, q, v, joints=joints, effects=self.effects, base_acceleration=given)

        return self._finished("bias", rows.bias if rows else None, general, 1, single, q, v, base)

    def coriolis(self, q: ArrayLike, v: ArrayLike, *, joints: Joints = None) -> Numbers:
        """Compute c(q, v), shape (N,) or (T, N), like `hybridyn.coriolis`."""
        q, v, single = checked_state(self.robot, q, v)
        rows = None if self._has(Stop) else self._rows(joints)  # a stop's damping is not odd in the rates
        general = partial(coriolis, self.robot, joints=joints, effects=self.effects)
        return self._finished("coriolis", rows.coriolis if rows else None, general, 3, single, q, v)

    def coriolis_matrix(self, q: ArrayLike, v: ArrayLike, *, joints: Joints = None) -> Numbers:
        """Compute C(q, v) with c = C u, shape (N, N) or (T, N, N), like `hybridyn.coriolis_matrix`."""
        q, v, single = checked_state(self.robot, q, v)
        rows = None if self._has(Stop) else self._rows(joints)
        if self.robot.base == "moving" and v[:, :6].any():
            rows = None  # the general path refuses it
        general = partial(coriolis_matrix, self.robot, joints=joints, effects=self.effects)
        lanes = 6 * rows.moves.u.size if rows else 1
        compute = rows.coriolis_matrix if rows else None
        return self._finished("coriolis_matrix", compute, general, lanes, single, q, v)

    def gravity(self, q: ArrayLike, *, joints: Joints = None) -> Numbers:
        """Compute g(q), shape (N,) or (T, N), like `hybridyn.gravity`."""
        q, _, single = checked_state(self.robot, q, None)
        rows = None if self._has(Spring, Stop) else self._rows(joints)  # they act at rest, too
        general = partial(gravity, self.robot, joints=joints, effects=self.effects)
        return self._finished("gravity", rows.gravity if rows else None, general, 1, single, q)

    @overload
    def motion_map(self, q: ArrayLike, v: None = None, *, joints: Joints = None) -> Numbers: ...
    @overload
    def motion_map(self, q: ArrayLike, v: ArrayLike, *, joints: Joints = None) -> tuple[Numbers, Numbers]: ...
    def motion_map(
        self, q: ArrayLike, v: ArrayLike | None = None, *, joints: Joints = None
    ) -> Numbers | tuple[Numbers, Numbers]:
        """Compute dq/du, and with rates also its rate, (nv, N) or (T, nv, N), like `hybridyn.motion_map`."""
        moves = self._following(joints)
        q, rates, single = checked_state(self.robot, q, v)
        if v is None:
            general = partial(motion_map, self.robot, joints=joints)
            return self._finished("motion_map", moves.map if moves else None, general, 6, single, q)

        def both(q: Array, v: Array) -> Array:
            """Compute dq/du and its rate by the general path, side by side."""
            return np.concatenate(motion_map(self.robot, q, v, joints=joints), axis=2)

        def compiled(q: Array, v: Array) -> Computed:
            """Compute it in C, and where it can be trusted."""
            assert moves is not None
            return _map_and_rate(moves, q, v, FOLLOWS[str(self.dtype)])

        compute = compiled if moves else None
        out = self._finished("motion_map", compute, both, 2 * self.robot.nv, single, q, rates)
        E, E_dot = np.split(out, 2, axis=-1)
        return E, E_dot

    def energy(self, q: ArrayLike, v: ArrayLike) -> Energy:
        """Compute kinetic and potential energy, shape () or (T,), like `hybridyn.energy`."""
        q, v, single = checked_state(self.robot, q, v)
        compute = partial(energy_rows, self._trusted, self.robot, self.effects)

        def general(q: Array, v: Array) -> Array:
            """Compute it by the general path."""
            found = energy(self.robot, q, v, effects=self.effects)
            return np.stack([found.kinetic, found.potential], axis=1)

        out = self._finished("energy", compute, general, 1, single, q, v)
        return Energy(out[..., 0], out[..., 1])

    def _trusted(self, name: str, q: Array, v: Array, given: Array) -> Computed:
        """Compute a model of the robot as it is, and which samples can be trusted.

        Accelerations or, of "ddm", efforts are given; a moving base does not accelerate in "ddm".
        """
        calls = self._current.program(name)
        base = [np.zeros((len(q), 6))] if name == "ddm" and self.robot.base == "moving" else []
        outputs, guard = calls.batch(
            [q, v, given, *base, *self._arguments(calls, None, (len(q),)).values()], self.threads
        )
        return outputs[0], np.asarray(guard <= calls.trusted)

    def _has(self, *laws: type[Any]) -> bool:
        """Return whether a law of these kinds is among the effects."""
        return any(isinstance(law.effect, laws) for law in self.effects.joints)

    def _following(self, joints: Joints) -> Following | None:
        """Return the motions over some joints; None if the general path computes them."""
        u = independent_coordinates(self.robot, joints)
        whole = all(len(own) == m.mobility for m, own in zip(self.robot.modules, u.own, strict=True))
        return self._over(u) if whole else None

    def _over(self, u: Coordinates) -> Following | None:
        """Return the motions over coordinates; None if the general path computes them."""
        if u.joints not in self._followings:
            self._followings[u.joints] = following(self.robot, u, str(self.dtype))
        return self._followings[u.joints]

    def _rows(self, joints: Joints) -> QuantityRows | None:
        """Return what computes forces along some joints; None if the general path does.

        The inverse model needs a motor for each freedom, and on a floating base a model on a held one.
        """
        moves = self._following(joints)
        if moves is None or not all(motors >= freedoms for motors, freedoms in self._driven):
            return None
        if self.robot.base != "floating":
            driven = self.robot.motor_v
            return QuantityRows(self.robot, partial(self._trusted, "idm"), driven, moves)
        held = self._held_base
        return None if held is None else QuantityRows(self.robot, held.forces, held.columns, moves)

    @property
    def _driven(self) -> list[tuple[int, int]]:
        """Number of motors and of freedoms of each module; a floating base has no motors and is left out."""
        modules = self.robot.modules[self.robot.base == "floating" :]
        return [(len(module.motors), module.mobility) for module in modules]

    @cached_property
    def _held_base(self) -> HeldBase | None:
        """Models of a floating robot with its base held; None if the general path computes forces."""
        return held_base(self.robot, self.effects, str(self.dtype), self._trusted, self.threads)

    def _finished(
        self,
        name: str,
        compute: Callable[..., Computed] | None,
        general: Callable[..., Array],
        lanes: int,
        single: bool,
        *arrays: Array,
    ) -> Numbers:
        """Compute a quantity, by the general path at samples that cannot be trusted or where it alone can.

        Args:
            compute: Computes results of shape (T, ...) and which samples can be trusted, or None.
            general: Computes results of the general path.
            lanes: Rows of models for each sample.
            single: Whether to drop the axis of samples.
            arrays: Arguments of both, shape (T, n) each.

        Raises:
            HybridynError: As the general path raises.
        """
        if compute is None or not len(arrays[0]):  # no samples: the general path knows the result's shape
            self.hand_over(name, len(arrays[0]), "which it alone computes")
            out = general(*arrays).astype(self.dtype)
            return out[0] if single else out
        out, good = in_parts(compute, lanes, *arrays)
        doubtful = np.flatnonzero(~good)
        if len(doubtful):
            self.hand_over(name, len(doubtful))
            log.info("%s: %d of %d samples computed by the general path", name, len(doubtful), len(out))
            try:
                out[doubtful] = general(*(x[doubtful] for x in arrays))
            except HybridynError:
                out = general(*arrays)  # its message has the sample's number in the batch
        out = out.astype(self.dtype, copy=False)
        return out[0] if single else out


def _map_and_rate(moves: Following, q: Array, v: Array, limit: float) -> Computed:
    """Compute dq/du and its rate side by side, shape (T, nv, 2 N), and which samples can be trusted."""
    robot, u = moves.robot, moves.u
    u.fit(robot, "the rate of dq/du")
    E, good = moves.map(q)
    base = v * (np.arange(robot.nv) < 6) if robot.base == "moving" else 0.0
    off = np.abs((np.einsum("tij,tj->ti", E, v[:, u.columns]) + base - v) / robot.unit).max(
        axis=1, initial=0.0
    )
    good &= off <= limit * np.abs(v / robot.unit).max(axis=1, initial=0.0)
    E_dot = rate_of_map(robot, q, v, E, u, lambda x, y: moves.drift(x, y)[0])
    return np.concatenate([E, E_dot], axis=2), good
