"""The robot with other standard parameters."""

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from ..effects.choice import Choice
from ..effects.gears import GearEfficiency
from ..effects.load_friction import LoadFriction
from ..errors import ModelError
from ..spatial import Array, Mask
from ..structure.building import described, rebuilt
from ..structure.robot import HybridRobot
from .inertial import mass_centre_inertia, moved, ten_numbers
from .parameters import standard_parameters
from .standard import Term

#: What laws' numbers are called in `HybridRobot.with_parameters`.
FIELDS = {
    "viscous_friction": "viscous_friction",
    "coulomb_friction": "coulomb_friction",
    "spring": "spring_stiffness",
}


def with_parameters(
    robot: HybridRobot, values: Mapping[str, float] | Array, *, effects: Choice = None,
    symmetric: bool = False,
) -> HybridRobot:  # fmt: skip
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
    rotors, laws = _of_laws(parameters.terms, changed, new)
    joints = tuple(
        replace(joint, rotor_inertia=rotors[joint.name] / joint.gear_ratio**2)
        if joint.name in rotors
        else joint
        for joint in robot.description.joints
    )
    description = described(replace(robot.description, joints=joints), named | laws)
    return rebuilt(robot, description, like=robot)


def with_losses(robot: HybridRobot, effects: Sequence[LoadFriction | GearEfficiency]) -> HybridRobot:
    """Build the robot whose files state effects of losses that grow with load, in the place of others."""
    names = {effect.name for effect in effects}
    stated = [(name, values) for name, values in robot.description.effects if name not in names]
    for effect in effects:
        values = {one.name: getattr(effect, one.name) for one in fields(effect)}
        stated.append((effect.name, {key: x for key, x in values.items() if x not in (None, {})}))
    return rebuilt(robot, replace(robot.description, effects=tuple(stated)), like=robot)


def _of_laws(terms: Sequence[Term], changed: Mask, new: Array) -> tuple[dict[str, float], dict[str, float]]:
    """Return the changed numbers of laws: rotor inertias by joint, others as `with_parameters` names them.

    Args:
        changed: Parameters that change, shape (p,).
        new: Their numbers, shape (p,).
    """
    rotors, named = dict[str, float](), dict[str, float]()
    for term in terms:
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
    return rotors, named


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
