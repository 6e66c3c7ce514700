"""The standard parameters of a robot: the numbers on which its motors' efforts depend linearly.

They are the ten numbers of each moving body with mass, then the numbers of the laws of joints (rotor inertia,
friction, springs), then the ten numbers of payloads, then constant offsets of the motors' efforts. Equal
legs share their parameters: they were made from the same drawings.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..effects.catalogue import JOINTS as LAWS
from ..effects.choice import Choice, Effects, choose, without_losses
from ..effects.inputs import BaseMotion
from ..effects.joint_laws import RotorInertia
from ..effects.joints import JointEffect, OnJoints, placed
from ..effects.link_effect import LinkEffect
from ..effects.listing import listed_units
from ..effects.words import FROM_FILES
from ..errors import ModelError
from ..spatial import Array, Index
from ..structure.bodies import Payload
from ..structure.robot import HybridRobot
from .equal_legs import shared_by_legs
from .inertial import OF_BODY, moved, ten_numbers
from .standard import StandardParameters, Term

#: The word among `effects` that adds an offset to each motor's effort.
OFFSETS = "offsets"


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
    bodies, payloads, columns = dict[int, Index](), list[tuple[int, Index]](), _Gathered()
    loads, centres = list[Payload](), dict[int, Array]()
    for body in _heavy_bodies(robot, on):
        own = robot.bodies.bodies[body]
        ten = ten_numbers(own.mass, own.com, own.inertia) - sum(
            (placed_ten for at, placed_ten, _ in _payloads(robot) if at == body), np.zeros(10)
        )
        bodies[body] = columns.add([f"{number} of {own.name}" for number in OF_BODY], ten)
        centres[int(bodies[body][0])] = _centre(robot, own.name, links[own.name].com)
    for body, ten, load in _payloads(robot):
        if body in bodies:
            at = columns.add([f"{number} of payload on {load.link}" for number in OF_BODY], ten)
            payloads.append((body, at))
            loads.append(load)
            centres[int(at[0])] = _centre(robot, load.link, load.com)
    terms = tuple(_terms(robot, on, offsets, columns))
    every = np.concatenate([np.zeros(0), *columns.values])
    out = StandardParameters(
        tuple(columns.names), every, on, bodies, tuple(payloads), terms, tuple(loads), centres
    )
    return shared_by_legs(robot, out) if symmetric else out


class _Gathered:
    """Names and numbers of parameters, in the order in which they are added."""

    def __init__(self) -> None:
        self.names, self.values = list[str](), list[Array]()

    def add(self, new: Sequence[str], numbers: Any) -> Index:
        """Append parameters and return their places."""
        self.names.extend(new)
        self.values.append(np.asarray(numbers, dtype=float))
        return np.arange(len(self.names) - len(new), len(self.names))


def _terms(robot: HybridRobot, on: Effects, offsets: bool, columns: _Gathered) -> Iterator[Term]:
    """Yield the numbers of laws, and the offsets of motors if they are wanted; `columns` receives them."""
    for law in (law for law in (*on.rotors, *on.joints) if isinstance(law, OnJoints)):
        freedoms = [robot.v_slices[robot.joint_index[joint]] for joint in law.joints]
        widths = [at.stop - at.start for at in freedoms]
        each = np.repeat(np.arange(len(law.joints)), widths)
        for number, symbol in enumerate(law.effect.symbols):
            first = np.concatenate([[0], np.cumsum(widths)[:-1]])
            at = columns.add([f"{symbol} of {joint}" for joint in law.joints], law.p[number][first])
            joints = tuple(law.joints[i] for i in each)
            yield Term(symbol, law, number, joints, at[each], law.columns)
    if offsets:
        at = columns.add([f"offset of {motor}" for motor in robot.motors], np.zeros(len(robot.motors)))
        yield Term("offset", None, 0, tuple(robot.motors), at, robot.motor_v)


def _selected(robot: HybridRobot, effects: Choice) -> tuple[Effects, bool]:
    """Return the effects of a call, with laws from the robot's files on every motor, and whether offsets.

    Raises:
        ModelError: Effects are unknown, or no number of theirs is linear in the efforts.
    """
    if effects is None or isinstance(effects, Effects):
        return without_losses(choose(robot, effects).unbounded, "the linear model does not take"), False
    words = [effects] if isinstance(effects, str) else list(effects)
    offsets = OFFSETS in words
    words = [word for word in words if not (isinstance(word, str) and word == OFFSETS)]
    on = without_losses(choose(robot, words).unbounded, "the linear model does not take")
    units = listed_units(robot, words)
    acting = [unit for unit in units if isinstance(unit, (*LAWS, LinkEffect, BaseMotion))]
    if lost := [unit.name for unit in acting if not getattr(unit, "symbols", ())]:
        raise ModelError(
            f"the effect '{lost[0]}' has no number to identify: leave it out, and subtract its efforts from "
            "the measured ones", element=lost[0],
        )  # fmt: skip
    stated = [
        _on_motors(robot, unit) if unit.name in FROM_FILES else unit
        for unit in units
        if isinstance(unit, JointEffect)
    ]
    laws = [law for unit in stated if (law := placed(unit, robot))]
    rotors = tuple(law for law in laws if isinstance(law.effect, RotorInertia))
    joints = tuple(law for law in laws if not isinstance(law.effect, RotorInertia))
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
