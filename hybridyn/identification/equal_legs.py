"""Legs with equal numbers, which share their parameters: they were made from the same drawings."""

import math
from dataclasses import replace

import numpy as np

from ..spatial import Array
from ..structure.module import Module
from ..structure.robot import HybridRobot
from .inertial import ten_numbers
from .standard import StandardParameters

#: Numbers of two legs are equal if they differ by less than this part.
EQUAL_LEGS = 1e-9
#: A leg: its joints and the numbers of its bodies, and what must be the same without any tolerance.
Leg = tuple[tuple[str, ...], Array, tuple[object, ...]]


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
