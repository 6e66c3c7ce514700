"""The standard parameters of a robot: the numbers on which its motors' efforts depend linearly.

They are the ten numbers of each moving body with mass, then the numbers of the laws of joints (rotor inertia,
friction, springs), then the ten numbers of payloads, then constant offsets of the motors' efforts. Equal
legs share their parameters: they were made from the same drawings.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..description.names import did_you_mean
from ..effects.choice import FROM_FILES, Choice, Effects, choose, listed_units
from ..effects.choice import JOINTS as LAWS
from ..effects.joints import JointEffect, OnJoints, placed
from ..errors import ModelError
from ..spatial import Array, Index
from ..structure.bodies import Payload
from ..structure.building import rebuilt
from ..structure.module import Module
from ..structure.robot import HybridRobot
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
    "ball_spring": ("k",),
}
#: Effects of which no number is identified.
WITHOUT_NUMBERS = (
    "wrench", "ground_contact", "base_motion", "polynomial_spring", "polynomial_damper", "tendons",
    "gravity_compensation", "line_springs", "bushings",
)  # fmt: skip
#: What laws' numbers are called in `HybridRobot.with_parameters`.
FIELDS = {
    "viscous_friction": "viscous_friction",
    "coulomb_friction": "coulomb_friction",
    "spring": "spring_stiffness",
}
#: Numbers of two legs are equal if they differ by less than this part.
EQUAL_LEGS = 1e-9
#: A leg: its joints and the numbers of its bodies, and what must be the same without any tolerance.
Leg = tuple[tuple[str, ...], Array, tuple[object, ...]]


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
        loads: The payloads themselves, in the order of `payloads`.
        centres: By the first of ten parameters, the centre of mass in the file of what these belong to: the
            payload, or the link that a body is called by; in the body's frame, shape (3,), [m].
    """

    names: tuple[str, ...]
    values: Array
    effects: Effects
    bodies: dict[int, Index]
    payloads: tuple[tuple[int, Index], ...] = ()
    terms: tuple[Term, ...] = ()
    loads: tuple[Payload, ...] = ()
    centres: dict[int, Array] = field(default_factory=dict)

    @property
    def tens(self) -> list[Index]:
        """The ten parameters of each body and of each payload, shape (10,); those that are shared once."""
        every = (*self.bodies.values(), *(at for _, at in self.payloads))
        return list({tuple(at): at for at in every}.values())

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
            if name not in self.names:
                raise ModelError(f"there is no parameter '{name}'{did_you_mean(name, self.names)}")
            out[self.names.index(name)] = value
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
    links = {link.name: link for link in robot.description.links}
    names: list[str] = []
    values: list[Array] = []
    bodies, payloads, terms = dict[int, Index](), list[tuple[int, Index]](), list[Term]()
    loads, centres = list[Payload](), dict[int, Array]()

    def add(new: Sequence[str], numbers: Any) -> Index:
        """Append parameters and return their places."""
        names.extend(new)
        values.append(np.asarray(numbers, dtype=float))
        return np.arange(len(names) - len(new), len(names))

    for body in _heavy_bodies(robot, on):
        own = robot.bodies.bodies[body]
        ten = ten_numbers(own.mass, own.com, own.inertia) - sum(
            (placed_ten for at, placed_ten, _ in _payloads(robot) if at == body), np.zeros(10)
        )
        bodies[body] = add([f"{number} of {own.name}" for number in OF_BODY], ten)
        centres[int(bodies[body][0])] = _centre(robot, own.name, links[own.name].com)
    for body, ten, load in _payloads(robot):
        if body in bodies:
            at = add([f"{number} of payload on {load.link}" for number in OF_BODY], ten)
            payloads.append((body, at))
            loads.append(load)
            centres[int(at[0])] = _centre(robot, load.link, load.com)
    for law in (law for law in (*on.rotors, *on.joints) if isinstance(law, OnJoints)):
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
    out = StandardParameters(
        tuple(names), every, on, bodies, tuple(payloads), tuple(terms), tuple(loads), centres
    )
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
    lost = [name for name in on.names if name in WITHOUT_NUMBERS]
    if lost:
        raise ModelError(
            f"the effect '{lost[0]}' has no number to identify: leave it out, and subtract its efforts from "
            "the measured ones", element=lost[0],
        )  # fmt: skip
    stated = [
        _on_motors(robot, unit) if unit.name in FROM_FILES else unit
        for unit in listed_units(robot, words)
        if isinstance(unit, LAWS) and isinstance(unit, JointEffect)
    ]
    laws = [law for unit in stated if (law := placed(unit, robot))]
    rotors = tuple(law for law in laws if law.effect.name == "rotor_inertia")
    joints = tuple(law for law in laws if law.effect.name != "rotor_inertia")
    return replace(on, rotors=rotors, joints=joints), offsets


def _on_motors(robot: HybridRobot, unit: Any) -> Any:
    """Return a law with a number for each motor, zero where it had none."""
    numbers = {name: values[0] for name, values in unit.numbers(robot).items()}
    return replace(unit, **{unit.by_joint[0]: dict.fromkeys(robot.motors, 0.0) | numbers})


def _heavy_bodies(robot: HybridRobot, on: Effects) -> Iterator[int]:
    """Yield the numbers of the bodies with inertial parameters."""
    for body, (module, number) in sorted(robot.body_owner.items()):
        if module < 0 or robot.bodies.bodies[body].massless:
            continue
        spec = robot.modules[module].mechanism.spec
        if on.leg_inertia is not None or number in [spec.tree_body[o] for o in spec.outputs]:
            yield body


def _payloads(robot: HybridRobot) -> Iterator[tuple[int, Array, Payload]]:
    """Yield the body of each payload, its ten numbers in that body's frame, shape (10,), and itself."""
    for load in robot.payloads:
        body, R, p = robot.bodies.place[load.link]
        ten = ten_numbers(load.mass, np.array(load.com), np.array(load.inertia))
        yield body, moved(ten, R, p), load


def _centre(robot: HybridRobot, link: str, com: ArrayLike) -> Array:
    """Return a point of a link, shape (3,), in the frame of its body."""
    _, R, p = robot.bodies.place[link]
    return np.asarray(p + R @ np.asarray(com))


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
    changed = new != parameters.values
    loads, named = dict[str, Any](), dict[str, Any]()
    for (_, at), load in zip(parameters.payloads, parameters.loads, strict=True):
        if changed[at].any():
            loads |= _named(robot, load.link, new[at], "payload_")
    robot = robot.with_parameters(loads) if loads else robot
    for body, at in parameters.bodies.items():
        carried = [new[places] for loaded_body, places in parameters.payloads if loaded_body == body]
        if changed[at].any():
            named |= _of_heaviest(robot, body, sum(carried, new[at]))
    rotors: dict[str, float] = {}
    for term in parameters.terms:
        if term.law is None or not changed[term.columns].any():
            continue
        numbers = zip(term.joints, new[term.columns].tolist(), strict=True)
        if term.symbol == "Ia":
            rotors = dict(numbers)
        elif term.law.effect.name not in FIELDS:
            raise ModelError(f"the robot's files have no place for '{term.symbol} of {term.joints[0]}'")
        else:
            named |= {f"{FIELDS[term.law.effect.name]}:{joint}": number for joint, number in numbers}
    if wrong := [name for name, number in rotors.items() if number < 0]:
        raise ModelError(f"'Ia of {wrong[0]}' would be {rotors[wrong[0]]:g}: it cannot be negative")
    joints = tuple(
        replace(joint, rotor_inertia=rotors[joint.name] / joint.gear_ratio**2)
        if joint.name in rotors
        else joint
        for joint in robot.description.joints
    )
    return rebuilt(robot, replace(robot.description, joints=joints), like=robot).with_parameters(named)


def _of_heaviest(robot: HybridRobot, body: int, ten: Array) -> dict[str, Any]:
    """Return the numbers of the link that a body is called by, by name: what the other links leave."""
    name = robot.bodies.bodies[body].name
    for link in robot.description.links:
        at, R, p = robot.bodies.place[link.name]
        if at == body and link.name != name:
            ten = ten - moved(ten_numbers(link.mass, link.com, link.inertia), R, p)
    return _named(robot, name, ten)


def _named(robot: HybridRobot, link: str, ten: Array, prefix: str = "") -> dict[str, Any]:
    """Return the numbers of a link, given in its body's frame, named as in `robot.with_parameters`."""
    _, R, p = robot.bodies.place[link]
    mass, com, inertia = mass_centre_inertia(moved(ten, R.T, -R.T @ p))
    if mass <= 0 and ten.any():
        raise ModelError(
            f"'{link}' would have a mass of {mass:g} kg: a robot needs positive masses. Base parameters "
            "predict efforts without them", element=link,
        )  # fmt: skip
    numbers = {"mass": mass, "centre": com, "inertia": inertia[np.triu_indices(3)]}
    return {f"{prefix}{kind}:{link}": number for kind, number in numbers.items()}


def shared_by_legs(robot: HybridRobot, parameters: StandardParameters) -> StandardParameters:
    """Return the parameters of a robot whose equal legs share theirs; those of the first leg stand for all.

    Legs of one module or of several are equal if joints and bodies are alike one by one: kinds, axes, frames
    within the leg, masses, centres and inertias. A module with one leg has none that is equal. Friction and
    rotors are shared if they are equal too; offsets are not, since each motor's amplifier has its own.
    """
    first = _first_alike(robot)
    into = np.arange(len(parameters.names))
    for body, at in parameters.bodies.items():
        joint = robot.bodies.joints[body - 1].joint.name if body else ""
        into[at] = parameters.bodies[robot.body_of_joint[first.get(joint, joint)]] if body else at
    for term in parameters.terms:
        place = dict(zip(term.joints, term.columns.tolist(), strict=True))
        for joint, at in place.items():
            like = place.get(first.get(joint, joint), at)
            own, others = parameters.values[[at, like]].tolist()
            if term.law is not None and math.isclose(own, others, rel_tol=EQUAL_LEGS):
                into[at] = like
    kept, number, count = np.unique(into, return_inverse=True, return_counts=True)
    starts = [int(i) for i in kept if int(i) in parameters.centres]
    names = tuple(
        parameters.names[i] + (f" (and {n - 1} equal)" if n > 1 else "")
        for i, n in zip(kept.tolist(), count.tolist(), strict=True)
    )
    return replace(
        parameters,
        names=names,
        values=parameters.values[kept],
        bodies={body: number[at] for body, at in parameters.bodies.items()},
        centres={int(number[first]): parameters.centres[int(first)] for first in starts},
        payloads=tuple((body, number[at]) for body, at in parameters.payloads),
        terms=tuple(replace(term, columns=number[term.columns]) for term in parameters.terms),
    )


def _first_alike(robot: HybridRobot) -> dict[str, str]:
    """Return the corresponding joint of the first leg that is equal, by joint name."""
    out: dict[str, str] = {}
    kinds: list[Leg] = []
    for module in robot.modules:
        for leg in _legs(robot, module):
            joints, numbers, structure = leg
            like = next(
                (
                    other
                    for other in kinds
                    if other[2] == structure and np.allclose(other[1], numbers, EQUAL_LEGS, EQUAL_LEGS)
                ),
                leg,
            )
            if like is leg:
                kinds.append(leg)
            out |= dict(zip(joints, like[0], strict=True))
    return out


def _legs(robot: HybridRobot, module: Module) -> list[Leg]:
    """Return the legs of a module that may have equals."""
    m = module.mechanism
    out: list[Leg] = []
    for bodies in m.spec.legs if len(m.spec.legs) > 1 else ():
        place = {body: i for i, body in enumerate(bodies)}
        joints = [m.tree.joints[body - 1] for body in bodies]
        names = tuple(module.joints[i] for i in (m.spec.tree_joint[b - 1] for b in bodies) if i is not None)
        own = [robot.bodies.bodies[robot.body_of_joint[name]] for name in names]
        tens = [ten_numbers(body.mass, body.com, body.inertia) for body in own]
        frames = [np.append(j.R, j.p) if j.parent in place else np.zeros(12) for j in joints]
        axes = [np.append(joint.axis, joint.pitch) for joint in joints]
        structure = tuple((joint.kind, place.get(joint.parent, -1)) for joint in joints)
        if len(names) == len(bodies):
            out.append((names, np.concatenate([np.zeros(0), *tens, *frames, *axes]), structure))
    return out
