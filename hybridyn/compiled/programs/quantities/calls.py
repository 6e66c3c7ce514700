"""Closed-loop quantities of compiled models, with the names and the errors of the general path."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ....dynamics.direct import acceleration_of_base
from ....dynamics.energy import Energy, energy
from ....dynamics.inverse import idm
from ....dynamics.link_motion import LinkMotion, motions_of, named_links
from ....dynamics.quantities.independent import IndependentCoordinates, independent_coordinates
from ....dynamics.quantities.joint_map import JointMap, related, side_motions
from ....dynamics.quantities.links import delassus, link_jacobian, link_jacobians, operational_inertia
from ....dynamics.quantities.model import (
    bias,
    christoffel,
    coriolis,
    coriolis_matrix,
    gravity,
    mass_matrix,
    motion_map,
)
from ....dynamics.quantities.polar_forms import rate_of_map
from ....dynamics.reactions import Reactions
from ....dynamics.state_checks import checked_state
from ....errors import HybridynError
from ....spatial import Array, Mask
from ....structure.samples import as_accelerations, one_of, same_samples
from ...code.scalars import GUARD_LIMIT
from ...library.calls import Library, Numbers
from ..general import WIDTH, motion_of, named, samples_of
from ..model_calls import ModelCalls
from ..postures import Postures
from ..sources import kept
from .engine import GONE_AT_SPEED, ZERO_AT_REST, CompiledEngine
from .following import BY_GENERAL, Following, artifact_of, pushed_models
from .transmitted import left_out, transmitted, transmitting

#: Rows of models for each sample, for matrices also for each coordinate.
ROWS = {"mass_matrix": 1, "bias": 1, "coriolis": 3, "coriolis_matrix": 6, "gravity": 1}
#: Those that do not depend on rates.
AT_REST = ("mass_matrix", "gravity")
#: Rows of lanes that are computed at once: their arrays stay in the processor's cache.
ROWS_AT_ONCE = 4096

Joints = Sequence[str] | None
#: Computes a quantity from an engine and the arguments of `Quantities._finished`.
Formula = Callable[..., Numbers]


class Quantities:
    """The closed-loop quantities of a `CompiledRobot`.

    Arguments, results and errors are those of the functions with the same names, effects those of the
    compiled models. The general path computes samples that cannot be trusted, and what no program computes.
    """

    def __init__(self, models: ModelCalls, postures: Postures) -> None:
        """Compute quantities by models; `postures` assembles those that are given by positions."""
        self.robot, self.effects, self.dtype = models.robot, models.effects, models.dtype
        self._models, self._postures, self._handed = models, postures, models.handed
        self._followings: dict[tuple[str, ...], Following | None] = {}

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the parts, of which maps of joints keep a method."""
        return Quantities, (self._models, self._postures)

    def mass_matrix(self, q: ArrayLike, *, joints: Joints = None) -> Numbers:
        """Compute M(q), shape (N, N) or (T, N, N), like `hybridyn.mass_matrix`."""
        return self._of_forces(mass_matrix, CompiledEngine.mass, joints, q)

    def bias(
        self,
        q: ArrayLike,
        v: ArrayLike | None,
        *,
        joints: Joints = None,
        base_acceleration: ArrayLike | None = None,
    ) -> Numbers:
        """Compute c(q, v) + g(q), shape (N,) or (T, N), like `hybridyn.bias`."""
        return self._of_forces(bias, CompiledEngine.bias, joints, q, v, base=base_acceleration)

    def coriolis(self, q: ArrayLike, v: ArrayLike, *, joints: Joints = None) -> Numbers:
        """Compute c(q, v), shape (N,) or (T, N), like `hybridyn.coriolis`."""
        return self._of_forces(coriolis, CompiledEngine.coriolis, joints, q, v, GONE_AT_SPEED)

    def coriolis_matrix(self, q: ArrayLike, v: ArrayLike, *, joints: Joints = None) -> Numbers:
        """Compute C(q, v) with c = C u, shape (N, N) or (T, N, N), like `hybridyn.coriolis_matrix`."""
        return self._of_forces(coriolis_matrix, christoffel, joints, q, v, GONE_AT_SPEED)

    def gravity(self, q: ArrayLike, *, joints: Joints = None) -> Numbers:
        """Compute g(q), shape (N,) or (T, N), like `hybridyn.gravity`."""
        return self._of_forces(gravity, CompiledEngine.gravity, joints, q, laws=ZERO_AT_REST)

    def _of_forces(
        self,
        function: Callable[..., Array],
        formula: Formula,
        joints: Joints,
        q: ArrayLike,
        v: ArrayLike | None = None,
        laws: Collection[type[Any]] | None = None,
        base: ArrayLike | None = None,
    ) -> Numbers:
        """Compute a quantity of the forces along some joints.

        Args:
            function: The general path's.
            formula: Computes the quantity by an engine.
            laws: As in `_driven_by`.
            base: Acceleration of a prescribed base.
        """
        positions, rates, single = checked_state(self.robot, q, v)
        name, moves = function.__name__, self._driven_by(joints, laws)
        given = {"q": positions} if name in AT_REST else {"q": positions, "v": rates}
        if base is not None:
            given["base_acceleration"] = acceleration_of_base(self.robot, base, len(positions))
        general = partial(function, self.robot, joints=joints, effects=self.effects)
        lanes = ROWS[name] * (moves.u.size if moves and "matrix" in name else 1)
        return self._finished(name, moves, formula, general, lanes, single, **given)

    def motion_map(
        self, q: ArrayLike, v: ArrayLike | None = None, *, joints: Joints = None
    ) -> Numbers | tuple[Numbers, Numbers]:
        """Compute dq/du, and with rates also its rate, (nv, N) or (T, nv, N), like `hybridyn.motion_map`."""
        moves, general = self._following(joints), partial(motion_map, self.robot, joints=joints)
        q, rates, single = checked_state(self.robot, q, v)
        if v is None:
            return self._finished("motion_map", moves, CompiledEngine.basis, general, 6, single, q=q)

        def both(q: Array, v: Array) -> Array:
            """Compute dq/du and its rate by the general path, side by side."""
            return np.concatenate(general(q, v), axis=2)

        def in_c(engine: CompiledEngine, q: Array, v: Array) -> Array:
            """Compute them by an engine, side by side."""
            E = engine.basis(q, v)
            return np.concatenate([E, rate_of_map(engine, q, v, E)], axis=2)

        out = self._finished("motion_map", moves, in_c, both, 2 * self.robot.nv, single, q=q, v=rates)
        E, E_dot = np.split(out, 2, axis=-1)
        return E, E_dot

    def energy(self, q: ArrayLike, v: ArrayLike) -> Energy:
        """Compute kinetic and potential energy, shape () or (T,), like `hybridyn.energy`."""
        q, v, single = checked_state(self.robot, q, v)

        def general(q: Array, v: Array) -> Array:
            """Compute it by the general path."""
            found = energy(self.robot, q, v, effects=self.effects)
            return np.stack([found.kinetic, found.potential], axis=1)

        formula = partial(CompiledEngine.energy, on=self.effects)
        out = self._finished("energy", None, formula, general, 1, single, q=q, v=v)
        return Energy(out[..., 0], out[..., 1])

    def reactions(self, q: ArrayLike, v: ArrayLike, a: ArrayLike) -> tuple[Numbers, Reactions]:
        """Compute motor efforts and `Reactions`, like `hybridyn.idm` with `reactions=True`."""
        positions, rates, single = checked_state(self.robot, q, v)
        states = positions, rates, as_accelerations(self.robot, a)[0]
        same_samples(q=positions, a=states[2])
        alone = left_out(self.robot, self.effects, str(self.dtype))
        if not alone and len(positions) and (library := self._transmitting) is not None:
            tau, good = self._model("idm", *states) if self.effects.loaded is None else (None, True)
            on, threads = self.effects, self._models.threads
            tau, found, guard = transmitted(self.robot, library, on, states, tau, threads)
            if (good & (guard <= GUARD_LIMIT)).all():
                return (tau[0], found.sample(0)) if single else (tau, found)
        self._handed.hand_over("reactions", len(positions), alone)
        given = (x[0] if single else x for x in states)
        return idm(self.robot, *given, effects=self.effects, reactions=True)

    @cached_property
    def _transmitting(self) -> Library | None:
        """The library of reactions; None if the general path computes them."""
        return transmitting(self.robot, self.effects)

    def _model(self, name: str, q: Array, *given: Array) -> tuple[Numbers, Mask]:
        """Compute a model of the robot as it is, and which samples can be trusted.

        A moving base does not accelerate in "ddm".
        """
        pushed = self._pushed_models if name.endswith("_pushed") else None
        calls = pushed.programs[name] if pushed else self._models.current.program(name)
        base = [np.zeros((len(q), 6))] if name == "ddm" and self.robot.base == "moving" else []
        arguments = {} if pushed else self._models.arguments(calls, None, (len(q),))
        outputs, guard = calls.batch([q, *given, *base, *arguments.values()], self._models.threads)
        return outputs[0], np.asarray(guard <= calls.trusted)

    def _following(self, joints: Joints) -> Following | None:
        """Return the motions over some joints; None if the general path computes them."""
        u = independent_coordinates(self.robot, joints)
        whole = all(len(own) == m.mobility for m, own in zip(self.robot.modules, u.own, strict=True))
        return self._over(u) if whole else None

    def _over(self, u: IndependentCoordinates) -> Following | None:
        """Return the motions over coordinates; None if the general path computes them.

        It alone computes idle motions, which take least-norm rates, and it alone explains joints that are
        never independent. Modules without coordinates stay.
        """
        if any(len(own) not in (0, m.mobility) for m, own in zip(self.robot.modules, u.own, strict=True)):
            return None

        def found() -> Following | None:
            """Load or build what computes them."""
            artifact = artifact_of(self.robot, u, str(self.dtype))  # its key takes a millisecond
            return artifact.tried(partial(Following, self.robot, u), BY_GENERAL)

        return kept(self._followings, u.joints, found)

    def _driven_by(
        self, joints: Joints, laws: Collection[type[Any]] | None = None, *, only: bool = False
    ) -> Following | None:
        """Return the motions over some joints, where compiled models compute the forces along them.

        Args:
            laws: Classes of joint laws that leave the quantity as it is; with any other, also one of another
                package, the general path computes it. None if all laws are part of the quantity.
            only: Whether no module may have more motors than freedoms.

        Returns:
            The motions; None if the general path computes the forces. The inverse model needs a motor for
            each freedom. A floating base has none, and its wrench is given.
        """
        if laws is not None and not {type(law.effect) for law in self.effects.joints} <= {*laws}:
            return None
        modules = self.robot.modules[self.robot.base == "floating" :]
        spare = [len(module.motors) - module.mobility for module in modules]
        if only and any(spare):
            return None
        if self.effects.losses or self.effects.of_motion:  # not linear in efforts; not odd in the rates
            return None
        moves = self._following(joints)
        ready = self.robot.base != "floating" or (moves and self._pushed_models)
        return moves if ready and min(spare, default=0) >= 0 else None

    @cached_property
    def _pushed_models(self) -> Library | None:
        """Models of a floating robot under a wrench on its base; None if the general path computes forces."""
        return pushed_models(self.robot, self.effects, str(self.dtype))

    def _finished(
        self,
        name: str,
        moves: Following | None,
        formula: Formula,
        general: Callable[..., Array],
        lanes: int,
        single: bool,
        **arrays: Array,
    ) -> Numbers:
        """Compute a quantity, by the general path at samples that cannot be trusted or where it alone can.

        Args:
            moves: Motions over the independent coordinates; None if the general path computes them, or if
                there are none ("energy").
            formula: Computes results of shape (T, ...) by an engine.
            general: Computes results of the general path.
            lanes: Rows of models for each sample.
            single: Whether to drop the axis of samples.
            arrays: Arguments of both by name, shape (T, n) each.

        Raises:
            HybridynError: As the general path raises.
        """
        samples = len(arrays["q"])
        if (moves is None and name != "energy") or not samples:  # without any, it knows the result's shape
            self._handed.hand_over(name, samples, "which it alone computes")
            out = general(**arrays).astype(self.dtype)
            return out[0] if single else out
        out, good = self._by_engines(moves, formula, lanes, arrays)
        doubtful = np.flatnonzero(~good)
        self._handed.say_of_table(name, len(doubtful), len(out))
        if len(doubtful):
            self._handed.hand_over(name, len(doubtful))
            try:
                out[doubtful] = general(**{key: x[doubtful] for key, x in arrays.items()})
            except HybridynError:
                out = general(**arrays)  # its message has the sample's number in the batch
        out = out.astype(self.dtype, copy=False)
        return out[0] if single else out

    def _by_engines(
        self, moves: Following | None, formula: Formula, lanes: int, arrays: Mapping[str, Array]
    ) -> tuple[Array, Mask]:
        """Compute a quantity by compiled models, and at which samples it can be trusted."""
        size = max(1, ROWS_AT_ONCE // max(lanes, 1))
        parts, good = [], []
        for start in range(0, len(arrays["q"]), size):
            some = {key: x[start : start + size] for key, x in arrays.items()}
            engine = CompiledEngine(self.robot, self._model, moves, len(some["q"]))
            parts.append(formula(engine, **some))
            good.append(engine.good)
        return np.concatenate(parts), np.concatenate(good)

    def kinematics(
        self, q: Array, v: Array, a: Array | None = None, links: Sequence[str] | None = None
    ) -> dict[str, LinkMotion]:
        """Compute poses, twists and accelerations of links, like `hybridyn.kinematics`."""
        given = named(self.robot, {"q": q, "v": v} | ({} if a is None else {"a": a}))
        if a is None:
            given["a"] = np.zeros((*samples_of(given["v"], "v"), self.robot.nv))
        rows = self._models.run("kinematics", given)
        places = self.robot.bodies.place
        wanted = list(named_links(self.robot, links))
        of_all = np.atleast_2d(rows)
        bodies = {
            body: motion_of(of_all[:, WIDTH * body : WIDTH * (body + 1)])
            for body in {places[x][0] for x in wanted}
        }
        return motions_of(self.robot, bodies, wanted, rows.ndim == 1)

    def link_jacobian(
        self, q: ArrayLike, link: str, *, joints: Joints = None, axes: str = "world"
    ) -> Numbers:
        """Compute the Jacobian of a link, shape (6, N) or (T, 6, N), like `hybridyn.link_jacobian`."""
        moves, general = self._following(joints), partial(link_jacobian, self.robot, link=link, joints=joints)
        return self._of_links(general, link_jacobians, moves, q, [link], axes)

    def delassus(self, q: ArrayLike, links: str | Sequence[str], *, axes: str = "world") -> Numbers:
        """Compute J M^-1 J^T of links, shape (6 k, 6 k) or (T, 6 k, 6 k), like `hybridyn.delassus`."""
        general = partial(delassus, self.robot, links=links, effects=self.effects)
        return self._of_links(
            general, CompiledEngine.delassus, self._driven_by(None, only=True), q, links, axes
        )

    def operational_inertia(
        self, q: ArrayLike, links: str | Sequence[str], *, axes: str = "world"
    ) -> Numbers:
        """Compute (J M^-1 J^T)^-1 of links, shape as `delassus`, like `hybridyn.operational_inertia`."""
        general = partial(operational_inertia, self.robot, links=links, effects=self.effects)
        formula = CompiledEngine.operational_inertia
        return self._of_links(general, formula, self._driven_by(None, only=True), q, links, axes)

    def _of_links(
        self,
        general: partial[Array],
        formula: Formula,
        moves: Following | None,
        q: ArrayLike,
        links: str | Sequence[str],
        axes: str,
    ) -> Numbers:
        """Compute a quantity of links; the arguments are those of `_finished`."""
        names = [links] if isinstance(links, str) else list(links)
        named_links(self.robot, names)
        one_of("axes", axes, "world", "link")
        q, _, single = checked_state(self.robot, q, None)
        name, compiled = general.func.__name__, partial(formula, links=names, axes=axes)
        return self._finished(name, moves, compiled, partial(general, axes=axes), 6 * len(names), single, q=q)

    def joint_map(self, q: ArrayLike | Mapping[str, ArrayLike], joints: Sequence[str]) -> JointMap:
        """Compute the map between output joints and motors, like `hybridyn.joint_map`."""
        q = self._postures.posture_at(q) if isinstance(q, Mapping) else q
        return related(self.robot, q, joints, self._side_motions)

    def _side_motions(self, q: Array, v: Array | None, side: IndependentCoordinates) -> tuple[Array, Array]:
        """Compute motions over one side of a map, and with rates its accelerations at rest of that side."""
        moves = self._over(side)

        def general(q: Array, v: Array | None = v) -> Array:
            """Compute it by the general path."""
            E, drift = side_motions(self.robot, q, v, side)
            return E if v is None else drift

        if v is None:
            E = self._finished("joint_map", moves, CompiledEngine.basis, general, 6, False, q=q)
            return E, np.zeros((len(q), self.robot.nv))
        drift = self._finished("joint_map", moves, CompiledEngine.drift, general, 1, False, q=q, v=v)
        return np.zeros((len(q), self.robot.nv, side.size)), drift
