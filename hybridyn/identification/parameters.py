"""The standard parameters of a robot: the numbers on which its motors' efforts depend linearly.

They are the ten numbers of each moving body with mass, then the numbers of the laws of joints (rotor inertia,
friction, springs), then the ten numbers of payloads, then constant offsets of the motors' efforts.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..description.names import did_you_mean
from ..description.records import Description, Link
from ..effects.choice import FROM_FILES, Choice, Effects, choose, listed_units
from ..effects.choice import JOINTS as LAWS
from ..effects.joints import OnJoints, placed
from ..errors import ModelError
from ..spatial import Array, Index
from ..structure.bodies import loaded
from ..structure.building import rebuilt
from ..structure.robot import HybridRobot
from .equal_legs import shared_by_legs
from .inertial import OF_BODY, mass_centre_inertia, moved, ten_numbers

#: The word among `effects` that adds an offset to each motor's effort.
OFFSETS = "offsets"
#: Symbols of the numbers in which a law is linear, in the order of the law's parameters.
SYMBOLS = {
    "rotor_inertia": ("Ia",),
    "viscous_friction": ("Fv",),
    "coulomb_friction": ("Fc",),
    "stribeck_friction": ("Fc", "Fs"),
    "spring": ("k",),
    "damper": ("d",),
    "stop": ("k_stop",),
}
#: What a friction or a rotor's inertia is called in the description of a joint.
FIELDS = {"Ia": "rotor_inertia", "Fv": "damping", "Fc": "friction"}


@dataclass(frozen=True, eq=False)
class Term:
    """A number of a law, for each of the law's joints.

    Attributes:
        symbol: Symbol of the number.
        law: The law on its joints, or None for offsets of motors.
        number: Which of the law's numbers it is.
        joints: Joint of each freedom.
        columns: Parameter of each freedom, shape (k,).
        freedoms: Index of each freedom in v, shape (k,).
    """

    symbol: str
    law: OnJoints | None
    number: int
    joints: tuple[str, ...]
    columns: Index
    freedoms: Index

    def efforts(self, q: Array, v: Array, a: Array) -> Array:
        """Compute the effort along each freedom per unit of its number, shape (T, k)."""
        if self.law is None:
            return np.ones((len(q), len(self.freedoms)))
        if self.symbol == "Ia":
            return a[:, self.freedoms]
        linear = len(SYMBOLS[self.law.effect.name])
        p = [
            np.full(len(self.freedoms), float(i == self.number)) if i < linear else numbers
            for i, numbers in enumerate(self.law.p)
        ]
        return -self.law.effect.effort(p, self.law.positions(q), v[:, self.freedoms])


@dataclass(frozen=True, eq=False)
class StandardParameters:
    """The standard parameters of a robot under some effects.

    Attributes:
        names: Name of each, such as "m of rod1"; of several equal legs, that of the first.
        values: The robot's own numbers, shape (p,), SI units.
        effects: The effects, as the models compute them.
        bodies: The ten parameters of each body, by the body's number, shape (10,).
        payloads: The ten parameters of each payload of `robot.payloads`, and its body.
        terms: The numbers of laws and the offsets.
    """

    names: tuple[str, ...]
    values: Array
    effects: Effects
    bodies: dict[int, Index]
    payloads: tuple[tuple[int, Index], ...] = ()
    terms: tuple[Term, ...] = ()

    @cached_property
    def at(self) -> dict[str, int]:
        """Number of each parameter by name."""
        return {name: i for i, name in enumerate(self.names)}

    def vector(self, values: Mapping[str, float] | Array) -> Array:
        """Return all parameters, shape (p,), from some by name or from all.

        Raises:
            ModelError: A name is unknown, or the number of values is wrong.
        """
        if not isinstance(values, Mapping):
            out = np.asarray(values, dtype=float)
            if out.shape != self.values.shape or not np.isfinite(out).all():
                raise ModelError(f"values must be {len(self.values)} finite numbers, one per parameter")
            return out
        out = self.values.copy()
        for name, value in values.items():
            if name not in self.at:
                raise ModelError(f"there is no parameter '{name}'{did_you_mean(name, self.names)}")
            out[self.at[name]] = value
        return out


def standard_parameters(
    robot: HybridRobot, *, effects: Choice = None, symmetric: bool = False
) -> StandardParameters:
    """Return the standard parameters of a robot, in one fixed order.

    Bodies come in the order of q: links that fixed joints connect are one body, called by its heaviest link,
    in the frame of its topmost link. Bodies without mass and the base of a robot on a fixed base have none.
    Rotor inertia and friction have a number for each motor, and for each other joint with a number.

    Args:
        robot: The robot.
        effects: As in `hybridyn.idm`; the word "offsets" among them adds a constant to each motor's effort.
        symmetric: Whether legs with equal numbers share their parameters.

    Raises:
        ModelError: Effects are unknown, or depend on numbers that cannot be identified.
    """
    on, offsets = _selected(robot, effects)
    names: list[str] = []
    values: list[Array] = []
    bodies, payloads, terms = dict[int, Index](), list[tuple[int, Index]](), list[Term]()

    def add(new: Sequence[str], numbers: Any) -> Index:
        """Append parameters and return their places."""
        names.extend(new)
        values.append(np.asarray(numbers, dtype=float))
        return np.arange(len(names) - len(new), len(names))

    for body in _heavy_bodies(robot, on):
        own = robot.bodies.bodies[body]
        ten = ten_numbers(own.mass, own.com, own.inertia) - sum(
            (placed_ten for at, placed_ten in _payloads(robot) if at == body), np.zeros(10)
        )
        bodies[body] = add([f"{number} of {own.name}" for number in OF_BODY], ten)
    for body, ten in _payloads(robot):
        if body in bodies:
            name = f"payload on {robot.payloads[len(payloads)].link}"
            payloads.append((body, add([f"{number} of {name}" for number in OF_BODY], ten)))
    for law in (*on.rotors, *on.joints):
        freedoms = [robot.v_slices[robot.joint_index[joint]] for joint in law.joints]
        widths = [at.stop - at.start for at in freedoms]
        each = np.repeat(np.arange(len(law.joints)), widths)
        for number, symbol in enumerate(SYMBOLS[law.effect.name]):
            first = np.concatenate([[0], np.cumsum(widths)[:-1]])
            at = add([f"{symbol} of {joint}" for joint in law.joints], law.p[number][first])
            joints = tuple(law.joints[i] for i in each)
            terms.append(Term(symbol, law, number, joints, at[each], law.columns))
    if offsets:
        at = add([f"offset of {motor}" for motor in robot.motors], np.zeros(len(robot.motors)))
        terms.append(Term("offset", None, 0, tuple(robot.motors), at, robot.motor_v))
    every = np.concatenate([np.zeros(0), *values])
    out = StandardParameters(tuple(names), every, on, bodies, tuple(payloads), tuple(terms))
    return shared_by_legs(robot, out) if symmetric else out


def _selected(robot: HybridRobot, effects: Choice) -> tuple[Effects, bool]:
    """Return the effects of a call, with laws from the robot's files on every motor, and whether offsets.

    Raises:
        ModelError: Effects are unknown, or no number of theirs is linear in the efforts.
    """
    if effects is None or isinstance(effects, Effects):
        return choose(robot, effects), False
    words = [effects] if isinstance(effects, str) else list(effects)
    offsets = OFFSETS in words
    words = [word for word in words if not (isinstance(word, str) and word == OFFSETS)]
    on = choose(robot, words)
    lost = [name for name in on.names if name in ("wrench", "ground_contact", "base_motion")]
    if lost:
        raise ModelError(
            f"the effect '{lost[0]}' has no number to identify: leave it out, and subtract its efforts from "
            "the measured ones", element=lost[0],
        )  # fmt: skip
    stated = [
        _on_motors(robot, unit) if unit.name in FROM_FILES else unit
        for unit in listed_units(robot, words)
        if isinstance(unit, LAWS)
    ]
    laws = [law for unit in stated if (law := placed(unit, robot))]
    rotors = tuple(law for law in laws if law.effect.name == "rotor_inertia")
    joints = tuple(law for law in laws if law.effect.name != "rotor_inertia")
    return replace(on, rotors=rotors, joints=joints), offsets


def _on_motors(robot: HybridRobot, unit: Any) -> Any:
    """Return a law with a number for each motor, zero where it had none."""
    numbers = {name: values[0] for name, values in unit.numbers(robot).items()}
    return replace(unit, **{unit.by_joint[0]: dict.fromkeys(robot.motors, 0.0) | numbers})


def _heavy_bodies(robot: HybridRobot, on: Effects) -> Iterable[int]:
    """Return the numbers of the bodies with inertial parameters."""
    for body, (module, number) in sorted(robot.body_owner.items()):
        if module < 0 or robot.bodies.bodies[body].massless:
            continue
        spec = robot.modules[module].mechanism.spec
        if on.leg_inertia is not None or number in [spec.tree_body[o] for o in spec.outputs]:
            yield body


def _payloads(robot: HybridRobot) -> list[tuple[int, Array]]:
    """Return the body of each payload, and its ten numbers in that body's frame, shape (10,)."""
    out = []
    for load in robot.payloads:
        body, R, p = robot.bodies.place[load.link]
        ten = ten_numbers(load.mass, np.array(load.com), np.array(load.inertia))
        out.append((body, moved(ten, R, p)))
    return out


def with_parameters(
    robot: HybridRobot,
    values: Mapping[str, float] | Array,
    *,
    effects: Choice = None,
    symmetric: bool = False,
) -> HybridRobot:
    """Build the robot with other standard parameters.

    The numbers of a body go to the link that it is called by; other links of the body keep theirs. Offsets
    belong to how efforts are measured, not to the robot: they are left out.

    Args:
        robot: The robot.
        values: Parameters by name, or all of them, shape (p,), in the order of `regressor(...).names`.
        effects: As in `regressor`.
        symmetric: As in `regressor`.

    Raises:
        ModelError: A name is unknown, or there is no such robot (a mass that is not positive, a negative
            friction).
    """
    parameters = standard_parameters(robot, effects=effects, symmetric=symmetric)
    new = parameters.vector(values)
    changed = np.flatnonzero(new != parameters.values)
    description = robot.description
    for (_, at), load in zip(parameters.payloads, robot.payloads, strict=False):
        if np.isin(at, changed).any():
            description = _with_load(robot, description, load.link, new[at])
    for body, at in parameters.bodies.items():
        if np.isin(at, changed).any():
            description = _with_body(robot, description, body, new[at])
    for term in parameters.terms:
        if np.isin(term.columns, changed).any():
            description = _with_term(description, term, new)
    return rebuilt(robot, description, like=robot)


def _with_link(description: Description, link: Link) -> Description:
    """Return a description with other numbers of a link."""
    links = tuple(link if own.name == link.name else own for own in description.links)
    return replace(description, links=links)


def _physical(name: str, ten: Array) -> tuple[float, Array, Array]:
    """Return mass, centre and inertia of a body; raise `ModelError` if its mass is not positive."""
    if ten.any() and not ten[0] > 0:
        raise ModelError(
            f"'{name}' would have a mass of {ten[0]:g} kg: a robot needs positive masses. Base parameters "
            "predict efforts without them", element=name,
        )  # fmt: skip
    return mass_centre_inertia(ten)


def _with_body(robot: HybridRobot, description: Description, body: int, ten: Array) -> Description:
    """Return a description in which a body has other numbers, payloads not counted."""
    name = robot.bodies.bodies[body].name
    loads = {load.name: load for load in description.loads}
    links = {link.name: link for link in description.links}
    for other, (at, R, p) in robot.bodies.place.items():
        if at == body and other != name:
            own, load = links[other], loads.get(other)
            mass, com, inertia = (
                (own.mass, own.com, own.inertia)
                if load is None
                else (load.own_mass, load.own_com, load.own_inertia)
            )
            ten = ten - moved(ten_numbers(mass, com, inertia), R, p)
    _, R, p = robot.bodies.place[name]
    mass, com, inertia = _physical(name, moved(ten, R.T, -R.T @ p))
    link = replace(links[name], mass=mass, com=com, inertia=inertia)
    if name in loads:
        load = replace(loads[name], own_mass=mass, own_com=com, own_inertia=inertia)
        changed = tuple(load if x.name == name else x for x in description.loads)
        description, link = replace(description, loads=changed), loaded(link, load)
    return _with_link(description, link)


def _with_load(robot: HybridRobot, description: Description, name: str, ten: Array) -> Description:
    """Return a description in which the payload on a link has other numbers."""
    _, R, p = robot.bodies.place[name]
    mass, com, inertia = _physical(f"payload on {name}", moved(ten, R.T, -R.T @ p))
    load = next(x for x in description.loads if x.name == name)
    load = replace(load, mass=mass, com=com, inertia=inertia)
    loads = tuple(load if x.name == name else x for x in description.loads)
    link = next(x for x in description.links if x.name == name)
    return _with_link(replace(description, loads=loads), loaded(link, load))


def _with_term(description: Description, term: Term, new: Array) -> Description:
    """Return a description in which the joints of a law have other numbers."""
    numbers = dict(zip(term.joints, new[term.columns].tolist(), strict=True))
    if term.law is None:
        return description
    wrong = next((name for name, x in numbers.items() if x < 0), None)
    if wrong is not None:
        raise ModelError(
            f"'{term.symbol} of {wrong}' would be {numbers[wrong]:g}; it cannot be negative", element=wrong
        )
    if term.symbol == "k":
        springs = {s.name: s for s in description.springs}
        return description.with_springs(
            replace(spring, stiffness=numbers.get(name, spring.stiffness)) for name, spring in springs.items()
        )
    if term.law.effect.name not in FROM_FILES:
        raise ModelError(f"the robot's files have no place for '{term.symbol} of {term.joints[0]}'")
    joints = tuple(
        replace(
            joint,
            **{
                FIELDS[term.symbol]: numbers[joint.name] / (joint.gear_ratio**2 if term.symbol == "Ia" else 1)
            },
        )
        if joint.name in numbers
        else joint
        for joint in description.joints
    )
    return replace(description, joints=joints)
