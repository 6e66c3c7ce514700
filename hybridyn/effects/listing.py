"""The effects that names and objects select, with their laws in a robot: the classes of all effects."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import Any, NamedTuple

from ..description.names import did_you_mean, listed
from ..errors import ModelError
from ..structure.bodies import Payload
from ..structure.forms import check_form
from ..structure.robot import HybridRobot
from .catalogue import JOINTS, UNITS, class_of, made, names
from .dc_motors import DcMotors, OnDcMotors, on_dc_motors
from .gears import GearEfficiency, OnGears, on_gears
from .inputs import BaseMotion, Limits
from .joint_laws import RotorInertia
from .joints import OnJoints, placed
from .link_effect import LinkEffect
from .load_friction import LoadFriction, OnLoads, on_loads
from .others import check_class, check_law, check_link_law, is_other, needs_nothing
from .tendons import OnTendons, Tendons, on_tendons
from .terms import Gravity, Inertia, LegInertia, MasslessLegs, VelocityTerms
from .words import DEFAULT, FROM_FILES

#: Names, words, and effect objects; one name or word may stand alone.
Asked = str | Iterable[Any] | None


class OnRobot(NamedTuple):
    """Effects that names and objects select, with their laws in a robot; see `choice.Effects`.

    Attributes:
        names: Names of the effects.
        terms: Gravity, inertia, the legs' inertia and velocity terms, each or None.
        joints: Laws of joint efforts.
        rotors: Rotors' inertia.
        links: Laws of wrenches on links.
        inputs: Limits and the base's motion, each or None.
        loaded: Friction that grows with load, or None.
        gears: Losses of gears, or None.
        dc: DC motors, or None.
    """

    names: set[str]
    terms: tuple[Any, Any, Any, Any]
    joints: tuple[OnJoints | OnTendons, ...]
    rotors: tuple[OnJoints, ...]
    links: tuple[LinkEffect, ...]
    inputs: tuple[Any, Any]
    loaded: OnLoads | None
    gears: OnGears | None
    dc: OnDcMotors | None


def on_robot(robot: HybridRobot, effects: Asked) -> OnRobot:
    """Select the effects of names and objects, and find what they act on in a robot.

    Raises:
        ModelError: As in `choice.choose`.
    """
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

    return OnRobot(
        names,
        (one(Gravity), one(Inertia), one(LegInertia), one(VelocityTerms)),
        tuple(law for law in laws if not isinstance(law.effect, RotorInertia)),
        tuple(law for law in laws if isinstance(law, OnJoints) and isinstance(law.effect, RotorInertia)),
        links,
        (one(Limits), one(BaseMotion)),
        None if (load := one(LoadFriction)) is None else on_loads(load, robot),
        None if (gears := one(GearEfficiency)) is None else on_gears(gears, robot),
        None if (dc := one(DcMotors)) is None else on_dc_motors(dc, robot),
    )


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


def listed_units(robot: HybridRobot, effects: Asked) -> list[Any]:
    """Return the effect objects selected by names and objects, each name once.

    Gravity and inertia are those of every body: the legs' part is among them, unless legs are massless.

    Raises:
        ModelError: A name is unknown, or the robot's files do not state its parameters.
    """
    words = [effects] if isinstance(effects, str) else list(effects or DEFAULT)
    units: list[Any] = []
    names: list[str] = []
    for word in words:
        if type(word) in UNITS.values():
            check_form(word)
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
