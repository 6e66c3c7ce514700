"""Selection of the effects of one call, from names and objects."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..description.names import did_you_mean, listed
from ..errors import ModelError, TrajectoryError
from ..linkage.motion import Motion
from ..spatial import Array
from ..structure.bodies import Payload
from ..structure.module import ModuleState
from ..structure.robot import HybridRobot
from ..structure.samples import as_numbers
from .catalogue import DEFAULT, FROM_FILES, JOINTS, UNITS, class_of, made, names
from .gears import GearEfficiency, OnGears, on_gears
from .inputs import BaseMotion, Limits
from .joint_laws import RotorInertia
from .joints import OnJoints, placed
from .link_effect import LinkEffect
from .load_friction import LoadFriction, OnLoads, on_loads
from .others import check_class, check_law, check_link_law, is_other, needs_nothing
from .tendons import OnTendons, Tendons, on_tendons
from .terms import Gravity, Inertia, LegInertia, MasslessLegs, VelocityTerms


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
            self.loaded if LoadFriction.name in names else None,
            self.gears if GearEfficiency.name in names else None,
        )  # fmt: skip
        return replace(out, names=out.named({*self.names} & {*names}))

    def named(self, names: Collection[str]) -> tuple[str, ...]:
        """Return names of effects in the order of `UNITS`, then others, and whether legs are massless."""
        massless = self.leg_inertia is None and (self.gravity or self.inertia) is not None
        every = {*names} - {MasslessLegs.name} | ({MasslessLegs.name} if massless else set())
        return tuple(name for name in (*UNITS, *sorted(every.difference(UNITS))) if name in every)

    @property
    def losses(self) -> tuple[str, ...]:
        """Names of the losses that grow with load, which the general path alone computes."""
        return tuple(law.effect.name for law in (self.loaded, self.gears) if law is not None)

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
    if effects is None:
        return STANDARD
    return effects if isinstance(effects, Effects) else _chosen(robot, effects)


def without_losses(on: Effects, what: str) -> Effects:
    """Return effects, for those who do not compute losses that grow with load.

    Args:
        on: The effects.
        what: Who asks, for the message: "compiled models do not compute".

    Raises:
        ModelError: There are such losses.
    """
    if on.losses:
        raise ModelError(
            f"{what} the effect '{on.losses[0]}', whose losses grow with load: hybridyn.idm, ddm, power and "
            "simulate do, on the general path. Leave it out here", element=on.losses[0],
        )  # fmt: skip
    return on


def _chosen(robot: HybridRobot, effects: Choice) -> Effects:
    """Select the effects of names and objects."""
    units = listed_units(robot, effects)
    names = {unit.name for unit in units}
    _check(robot, units, names)
    links = tuple(unit.bound(robot) for unit in units if isinstance(unit, LinkEffect))
    for unit in links:
        if is_other(type(unit)):
            check_link_law(unit)
    laws = [law for unit in units if isinstance(unit, JOINTS) and (law := _placed(unit, robot))]

    def one(kind: type[Any]) -> Any:
        """Return the only effect of a class, or None."""
        found = [unit for unit in units if isinstance(unit, kind)]
        if len(found) > 1:
            raise ModelError(f"the effect '{kind.name}' is named {len(found)} times")
        return found[0] if found else None

    out = Effects(
        one(Gravity), one(Inertia), one(LegInertia), one(VelocityTerms),
        tuple(law for law in laws if not isinstance(law.effect, RotorInertia)),
        tuple(law for law in laws if isinstance(law, OnJoints) and isinstance(law.effect, RotorInertia)),
        links, one(Limits), one(BaseMotion),
        None if (load := one(LoadFriction)) is None else on_loads(load, robot),
        None if (gears := one(GearEfficiency)) is None else on_gears(gears, robot),
    )  # fmt: skip
    return replace(out, names=out.named(names))


def _check(robot: HybridRobot, units: Sequence[Any], names: Collection[str]) -> None:
    """Check that the effects have what they need: inertia, the payload on the robot, links."""
    for part in ("velocity", "rotor_inertia"):
        if part in names and "inertia" not in names:
            raise ModelError(f"the effect '{part}' needs 'inertia': without inertia there is only statics")
    for payload in (unit for unit in units if isinstance(unit, Payload)):
        if payload not in robot.payloads:
            raise ModelError(
                f"the robot does not carry the payload on '{payload.link}' yet: take it from "
                "hybridyn.with_effects(robot, effects)", element=payload.link,
            )  # fmt: skip
    for unit in units:
        for link in unit.links if isinstance(unit, LinkEffect) else ():
            if link not in robot.bodies.place:
                raise ModelError(
                    f"{unit.name}: no such link '{link}'{did_you_mean(link, robot.bodies.place)}",
                    element=link,
                )


def _placed(unit: Any, robot: HybridRobot) -> OnJoints | OnTendons | None:
    """Find the joints of a law in a robot; None if it has none."""
    if isinstance(unit, Tendons):
        return on_tendons(unit, robot)
    law = placed(unit, robot)
    if law is not None and is_other(type(unit)):
        check_law(law, robot)
    return law


def listed_units(robot: HybridRobot, effects: Choice) -> list[Any]:
    """Return the effect objects selected by names and objects, each name once.

    Gravity and inertia are those of every body: the legs' part is among them, unless legs are massless.

    Raises:
        ModelError: A name is unknown, or the robot's files do not state its parameters.
    """
    words = [effects] if isinstance(effects, str) else list(effects or DEFAULT)  # type: ignore[arg-type]
    units: list[Any] = []
    names: list[str] = []
    for word in words:
        if type(word) in UNITS.values():
            units.append(word)
        elif is_other(type(word)):
            check_class(type(word), UNITS)
            units.append(word)
        elif isinstance(word, str):
            names += _meaning(robot, word)
        else:
            raise ModelError(f"{word!r} is no effect: give names, or objects of hybridyn.effects")
    for name in dict.fromkeys(names):
        units += _stated(robot, name)
    kinds = {type(unit) for unit in units}
    if MasslessLegs in kinds:
        return [unit for unit in units if not isinstance(unit, LegInertia)]
    return [*units, LegInertia()] if kinds & {Gravity, Inertia} and LegInertia not in kinds else units


def _meaning(robot: HybridRobot, word: str) -> tuple[str, ...]:
    """Return the effect names that a word selects."""
    of_files = (*FROM_FILES, *(name for name, _ in robot.description.effects))
    meanings = {"default": DEFAULT, "model": (*DEFAULT, *of_files), "none": ()}
    if word not in meanings and class_of(word) is None:
        raise ModelError(
            f"there is no effect '{word}'{did_you_mean(word, names())}; known: {', '.join(names())}",
            element=word,
        )
    return meanings.get(word, (word,))


def names_on(robot: HybridRobot, effects: Effects) -> str:
    """Return the names of the effects that are on, also of a payload that the robot carries, for people."""
    felt = effects.gravity is not None or effects.inertia is not None
    carried = {Payload.name} if felt and robot.payloads else set()
    return ", ".join(effects.named({*effects.names} | carried)) or "none"


def stated_names(robot: HybridRobot) -> tuple[str, ...]:
    """Return the names of the effects with parameters in the robot's files."""
    joints = [joint for joint in robot.description.joints if joint.kind != "fixed"]
    named = [name for name in FROM_FILES if any(getattr(j, UNITS[name].from_files) for j in joints)]
    return tuple(dict.fromkeys([*named, *(name for name, _ in robot.description.effects)]))


def _stated(robot: HybridRobot, name: str) -> list[Any]:
    """Build the objects of a named effect with the parameters of the robot's files."""
    tables = [values for stated, values in robot.description.effects if stated == name]
    if tables:
        return [made(name, values) for values in tables]
    if name == Payload.name and robot.payloads:
        return list(robot.payloads)
    if name in (*DEFAULT, *FROM_FILES, "limits", MasslessLegs.name):
        return [UNITS[name]()]
    kind = class_of(name)
    assert kind is not None  # other words are refused before, or are stated by the files
    if name not in UNITS and needs_nothing(kind):
        return [made(name, {})]
    from ..description.side_cars.tables import EFFECTS  # it takes pydantic

    stated = name in EFFECTS or name not in UNITS
    table = f", or a table [effects.{name}] in {listed(['model.toml'])}" if stated else ""
    place = "hybridyn.effects" if name in UNITS else kind.__module__
    raise ModelError(
        f"the robot's files state no numbers for the effect '{name}': give an object, "
        f"{place}.{kind.__name__}(...){table}", element=name,
    )  # fmt: skip
