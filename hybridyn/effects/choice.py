"""Selection of the effects of one call, from names and objects."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ModelError, TrajectoryError
from ..linkage.motion import Motion
from ..spatial import Array
from ..structure.bodies import Payload
from ..structure.module import ModuleState
from ..structure.robot import HybridRobot
from ..structure.samples import as_numbers
from .terms import Gravity, Inertia, LegInertia, MasslessLegs, VelocityTerms
from .words import BOUNDS, DEFAULT, FROM_FILES, NAMES

if TYPE_CHECKING:  # the default effects do without
    from .dc_motors import OnDcMotors
    from .gears import OnGears
    from .inputs import BaseMotion, Limits
    from .joints import OnJoints
    from .link_effect import LinkEffect
    from .load_friction import OnLoads
    from .tendons import OnTendons


@dataclass(frozen=True)
class Effects:
    """The effects of one call for one robot; those that are None or empty are not computed.

    Attributes:
        gravity: Weights, or None.
        inertia: Inertial forces, or None for statics.
        leg_inertia: The legs' part of gravity and inertia, or None for massless legs.
        velocity: Velocity terms, or None.
        joints: Laws of joint efforts.
        rotors: Rotors' inertia.
        links: Laws of wrenches on links.
        limits: Effort limits, or None.
        base: The base's prescribed motion, or None.
        loaded: Friction that grows with load, or None.
        gears: Losses of gears, or None.
        dc: DC motors, or None.
        names: Names of the selected effects, including payloads.
    """

    gravity: Gravity | None = None
    inertia: Inertia | None = None
    leg_inertia: LegInertia | None = None
    velocity: VelocityTerms | None = None
    joints: tuple[OnJoints | OnTendons, ...] = ()
    rotors: tuple[OnJoints, ...] = ()
    links: tuple[LinkEffect, ...] = ()
    limits: Limits | None = None
    base: BaseMotion | None = None
    loaded: OnLoads | None = None
    gears: OnGears | None = None
    dc: OnDcMotors | None = None
    names: tuple[str, ...] = ()

    def only(self, names: Collection[str]) -> Effects:
        """Return the effects restricted to some names; gravity and inertia without the legs' part stay so."""

        def kept(unit: Any) -> Any:
            """Return an effect if it is among the names, else None."""
            return unit if unit is not None and unit.name in names else None

        out = Effects(
            kept(self.gravity), kept(self.inertia), kept(self.leg_inertia), kept(self.velocity),
            tuple(law for law in self.joints if law.effect.name in names),
            tuple(law for law in self.rotors if law.effect.name in names),
            tuple(law for law in self.links if law.name in names), kept(self.limits), kept(self.base),
            self.loaded if self.loaded is not None and kept(self.loaded.effect) else None,
            self.gears if self.gears is not None and kept(self.gears.effect) else None,
            self.dc if self.dc is not None and kept(self.dc.effect) else None,
        )  # fmt: skip
        return replace(out, names=out.named({*self.names} & {*names}))

    def named(self, names: Collection[str]) -> tuple[str, ...]:
        """Return names of effects in the order of `NAMES`, then others, and whether legs are massless."""
        massless = self.leg_inertia is None and (self.gravity or self.inertia) is not None
        every = {*names} - {MasslessLegs.name} | ({MasslessLegs.name} if massless else set())
        return tuple(name for name in (*NAMES, *sorted(every.difference(NAMES))) if name in every)

    @property
    def losses(self) -> tuple[str, ...]:
        """Names of losses that grow with load, and of DC motors."""
        return tuple(law.effect.name for law in (self.loaded, self.gears, self.dc) if law is not None)

    @property
    def uncompiled(self) -> tuple[str, ...]:
        """Names of those among them that the general path alone computes."""
        return () if self.dc is None else (self.dc.effect.name,)

    @property
    def ends(self) -> tuple[tuple[str, str], ...]:
        """Joints, and which of their limits stops take from the robot's files: "lower" or "upper"."""
        stops: list[Any] = [law.effect for law in self.joints if law.effect.name == "stop"]
        return tuple(
            (joint, word)
            for stop in stops
            for joint in stop.stiffness
            for word in ("lower", "upper")
            if joint not in getattr(stop, word)
        )

    @property
    def unbounded(self) -> Effects:
        """The effects but for those that bound what motors give."""
        return self.without(*BOUNDS)

    def within_bounds(self, robot: HybridRobot, tau: Array, v: Array) -> Array:
        """Clip efforts, shape (T, motors), to limits and to what DC motors give at rates, shape (T, nv)."""
        if self.limits is not None:
            tau = self.limits.clip(robot, tau)
        return tau if self.dc is None else self.dc.clip(tau, v[:, robot.motor_v])

    def check_bounds(self, robot: HybridRobot, tau: Array, v: Array) -> None:
        """Check efforts, shape (T, motors), against what `within_bounds` clips them to.

        Raises:
            ActuationError: One exceeds them; the message names motor and sample.
        """
        if self.limits is not None:
            self.limits.check(robot, tau)
        if self.dc is not None:
            self.dc.check(robot, tau, v[:, robot.motor_v])

    def without(self, *names: str) -> Effects:
        """Return the effects but for some names."""
        return self.only([name for name in self.names if name not in names])

    def leg_forces(self, s: ModuleState, *, bias: bool = False) -> tuple[Array, Array]:
        """Compute F_b, shape (T, 6), and H, shape (T, n), of a module's legs; p and h if `bias`."""
        if self.leg_inertia is None:
            return np.zeros_like(s.V), np.zeros_like(s.v)
        V, v = self.velocity.twists(s) if self.velocity else (np.zeros_like(s.V), np.zeros_like(s.v))
        return self.leg_inertia.forces(s, V, v, bias)

    def leg_matrix(self, s: ModuleState) -> Array:
        """Compute M_leg, shape (T, 6 + n, 6 + n)."""
        if self.leg_inertia is None:
            n = 6 + s.mechanism.tree.nv
            return np.zeros((len(s.V), n, n))
        return self.leg_inertia.matrix(s)

    def body_bias(self, V: Array, inertia: Array) -> Array:
        """Compute crf(V) (I V) of bodies, shape (..., 6)."""
        return self.velocity.of_body(V, inertia) if self.velocity and V.size else np.zeros_like(V)

    def joint_efforts(self, robot: HybridRobot, q: Array, v: Array) -> Array:
        """Compute the efforts of joint laws on the spanning tree, shape (T, nv)."""
        out = np.zeros((len(q), robot.nv))
        for law in self.joints:
            out[:, law.columns] += law.effort(q, v)  # a law acts on each joint once
        return out

    def rotor_diagonal(self, robot: HybridRobot) -> Array:
        """Compute the rotors' part of the diagonal of the spanning tree's inertia, shape (nv,)."""
        out = np.zeros(robot.nv)
        for law in self.rotors:
            out[law.columns] += law.p[0]
        return out

    @property
    def of_motion(self) -> tuple[LinkEffect, ...]:
        """Laws of wrenches that depend on the motion of links alone."""
        return tuple(law for law in self.links if law.of_motion)

    @property
    def observed_links(self) -> tuple[str, ...]:
        """Links whose motion a law needs."""
        return tuple(link for law in self.links if law.needs_motion for link in law.links)

    def wrenches(
        self, motions: Mapping[str, Motion], time: Array | None, samples: int
    ) -> Iterator[dict[str, Array]]:
        """Compute each law's wrenches by link, shape (T, 6), [N, N m], in the links' frames at their origins.

        Args:
            motions: Motion in the world of the links in `observed_links`.
            time: Times, shape (T,), [s], or None.
            samples: Number of samples T.

        Raises:
            TrajectoryError: A law depends on a table and there is no time, or its table is too short.
        """
        return (law.wrenches(time, motions, samples) for law in self.links)


def times(time: object, samples: int) -> Array | None:
    """Return the time of each sample, shape (samples,), from one time, one per sample, or None.

    Raises:
        TrajectoryError: The shape is wrong, or a time is not finite.
    """
    if time is None:
        return None
    out = as_numbers(time, "time")
    if out.shape not in ((), (samples,)) or not np.isfinite(out).all():
        raise TrajectoryError(f"time has shape {out.shape}; wanted one finite number or ({samples},)")
    return np.broadcast_to(out, (samples,))


#: The effects selected by `effects=None`.
STANDARD = Effects(Gravity(), Inertia(), LegInertia(), VelocityTerms(), names=DEFAULT)

Choice = str | Iterable[Any] | Effects | None


def choose(robot: HybridRobot, effects: Choice) -> Effects:
    """Select the effects of a call for a robot.

    Args:
        effects: None or "default" for gravity, inertia, the legs' inertia and velocity terms; "model" for
            those and all effects stated in the robot's files; "none"; or a list of names (including these
            words) and effect objects. Only named effects are computed: `["default", Spring({"elbow": 40.0})]`
            adds a spring.

    Raises:
        ModelError: A name is unknown, an effect lacks parameters, or effects contradict each other.
    """
    if isinstance(effects, Effects):
        return effects
    asked = [effects] if isinstance(effects, str) else [*(effects or ())]
    if all(isinstance(word, str) and word == "default" for word in asked):
        return STANDARD
    from .listing import on_robot  # the classes of all effects

    found = on_robot(robot, asked)
    out = Effects(
        *found.terms,
        found.joints,
        found.rotors,
        found.links,
        *found.inputs,
        found.loaded,
        found.gears,
        found.dc,
    )
    return replace(out, names=out.named(found.names))


def without_losses(on: Effects, what: str, *, compiled: bool = False) -> Effects:
    """Return effects, for those who do not compute losses that grow with load, nor DC motors.

    Args:
        on: The effects.
        what: Who asks, for the message: "compiled models do not compute".
        compiled: Whether they compute what compiled models do.

    Raises:
        ModelError: There are such effects.
    """
    if names := on.uncompiled if compiled else on.losses:
        raise ModelError(
            f"{what} the effect '{names[0]}': hybridyn.idm, ddm, power and simulate do, on the general "
            "path. Leave it out here", element=names[0],
        )  # fmt: skip
    return on


def names_on(robot: HybridRobot, effects: Effects) -> str:
    """Return the names of the effects that are on, also of a payload that the robot carries, for people."""
    felt = effects.gravity is not None or effects.inertia is not None
    carried = {Payload.name} if felt and robot.payloads else set()
    return ", ".join(effects.named({*effects.names} | carried)) or "none"


def stated_names(robot: HybridRobot) -> tuple[str, ...]:
    """Return the names of the effects with parameters in the robot's files."""
    joints = [joint for joint in robot.description.joints if joint.kind != "fixed"]
    named = [name for name, of in FROM_FILES.items() if any(getattr(j, of) for j in joints)]
    return tuple(dict.fromkeys([*named, *(name for name, _ in robot.description.effects)]))
