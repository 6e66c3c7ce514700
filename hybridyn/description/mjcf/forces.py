"""Forces of a compiled MJCF model, as effects: springs and dampers of joints, tendons, compensated weights.

Dry friction, linear damping and armature of joints are numbers of these (`mjcf`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ...joints.kinds import JointKind
from ..names import noted, unique
from ..records import Coupling, Joint, RobotFile, StatedSpring, massless, spring_effect
from .compiling import Compiled

#: MuJoCo's numbers of the forces along a tendon.
OF_TENDONS = ("stiffness", "damping", "frictionloss")
#: Orientation without turn, x, y, z, w.
LEVEL = (0.0, 0.0, 0.0, 1.0)


class JointPart(NamedTuple):
    """A joint of the robot that stands for one of MuJoCo's, or for a part of it.

    Attributes:
        number: Number of MuJoCo's joint.
        name: Name of the joint in the robot.
        kind: Its kind.
        at, dof: Its first coordinate in `qpos` and in `qvel`.
    """

    number: int
    name: str
    kind: JointKind
    at: int
    dof: int


def fixed_terms(compiled: Compiled, tendon: int) -> dict[str, float] | None:
    """Return the coefficient of each joint in a fixed tendon's length, or None for a spatial tendon."""
    model = compiled.model
    terms: dict[str, float] = {}
    for wrap in _wraps(compiled, tendon):
        if model.wrap_type[wrap] != compiled.code("mjWRAP_JOINT"):
            return None
        joint = compiled.joints[model.wrap_objid[wrap]]
        terms[joint] = terms.get(joint, 0.0) + float(model.wrap_prm[wrap])
    return terms


def _wraps(compiled: Compiled, tendon: int) -> range:
    first = int(compiled.model.tendon_adr[tendon])
    return range(first, first + int(compiled.model.tendon_num[tendon]))


def pulling(compiled: Compiled) -> list[int]:
    """Return the numbers of the tendons with a spring, damping or friction."""
    model = compiled.model
    return np.flatnonzero(sum(np.abs(getattr(model, f"tendon_{word}")) for word in OF_TENDONS)).tolist()


def bodies_of(compiled: Compiled, tendon: int) -> list[int]:
    """Return the numbers of the bodies with the sites of a tendon."""
    model, site = compiled.model, compiled.code("mjWRAP_SITE")
    wraps = _wraps(compiled, tendon)
    return [int(model.site_bodyid[model.wrap_objid[w]]) for w in wraps if model.wrap_type[w] == site]


def add_forces(robot: RobotFile, compiled: Compiled, parts: Sequence[JointPart]) -> None:
    """Add the forces of joints, tendons and weights to the robot's effects.

    Raises:
        ModelError: A tendon wraps around geoms, or is spatial and has armature; or joints carry a compensated
            weight partly by their actuators.
    """
    _add_inertia(robot, compiled)
    springs, effects = _springs(compiled, parts)
    robot.effects += (spring_effect(springs),) if springs else ()
    effects["polynomial_damper"] = {"coefficients": _dampers(compiled, parts)}
    effects["tendons"], effects["line_springs"] = _tendons(compiled)
    effects["gravity_compensation"] = {"fraction": _compensated(robot, compiled)}
    for name, numbers in effects.items():
        stated = {key: values for key, values in numbers.items() if values}
        robot.effects += ((name, stated),) if stated else ()


def _springs(
    compiled: Compiled, parts: Sequence[JointPart]
) -> tuple[list[StatedSpring], dict[str, dict[str, Any]]]:
    """Return the linear springs of joints with one freedom, and all others as effects."""
    model, springs = compiled.model, list[StatedSpring]()
    bent: dict[str, dict[str, Any]] = {"coefficients": {}, "rest": {}}
    balls: dict[str, dict[str, Any]] = {"stiffness": {}, "rest": {}}
    higher = compiled.rows("jnt_stiffnesspoly")
    for part in sorted(parts, key=lambda part: part.number):
        k = float(model.jnt_stiffness[part.number])
        more = higher[part.number].tolist() if len(higher) else []
        if not (k or any(more)):
            continue
        rest = model.qpos_spring[part.at :]
        if part.kind is JointKind.SPHERICAL:
            x, y, z, w = turn = (*map(float, rest[1:4]), float(rest[0]))
            balls["stiffness"][part.name] = k
            balls["rest"] |= {} if turn == LEVEL else {part.name: [x, y, z, w]}
        elif any(more):
            bent["coefficients"][part.name] = [k, *more]
            bent["rest"] |= {part.name: float(rest[0])} if rest[0] else {}
        else:
            springs.append(StatedSpring(part.name, k, float(rest[0])))
    return springs, {"polynomial_spring": bent, "ball_spring": balls}


def _dampers(compiled: Compiled, parts: Sequence[JointPart]) -> dict[str, list[float]]:
    """Return the coefficients of damping above the linear one, by joint."""
    higher = compiled.rows("dof_dampingpoly")
    return {
        part.name: [0.0, *higher[part.dof].tolist()]
        for part in parts
        if len(higher) and higher[part.dof].any()
    }


def _tendons(compiled: Compiled) -> tuple[dict[str, dict[str, Any]], dict[str, dict[str, Any]]]:
    """Return the forces along fixed tendons, and along those through sites, as numbers of effects."""
    words = ("stiffness", "damping", "friction", "lower", "upper")
    fixed: dict[str, dict[str, Any]] = {word: {} for word in ("arms", *words)}
    lines: dict[str, dict[str, Any]] = {word: {} for word in ("ends", "points", "shares", *words)}
    model = compiled.model
    for number in pulling(compiled):
        name, terms = compiled.name("tendon", number) or f"tendon{number}", fixed_terms(compiled, number)
        if terms is None:
            sites, shares = _path(compiled, number)
            lines["shares"] |= {name: shares} if any(share != 1 for share in shares) else {}
            lines["ends"][name] = [compiled.bodies[model.site_bodyid[site]] for site in sites]
            lines["points"][name] = [model.site_pos[site].tolist() for site in sites]
        for joint, arm in (terms or {}).items():
            fixed["arms"].setdefault(joint, {})[name] = arm
        own = [float(getattr(model, f"tendon_{word}")[number]) for word in OF_TENDONS]
        stated = zip(words, (*own, *map(float, model.tendon_lengthspring[number])), strict=True)
        for word, x in stated:
            if x and not (word in ("lower", "upper") and not own[0]):
                (lines if terms is None else fixed)[word][name] = x
    return fixed, lines


def _path(compiled: Compiled, number: int) -> tuple[list[int], list[float]]:
    """Return the sites of a spatial tendon, and the share of its length of each stretch between them.

    Behind a pulley begins another branch, whose length is divided.

    Raises:
        ModelError: It passes geoms.
    """
    model, sites, shares, share = compiled.model, list[int](), list[float](), 1.0
    joined = False
    for wrap in _wraps(compiled, number):
        kind = int(model.wrap_type[wrap])
        if kind == compiled.code("mjWRAP_PULLEY"):
            share, joined = 1.0 / float(model.wrap_prm[wrap]), False
        elif kind == compiled.code("mjWRAP_SITE"):
            shares += [share if joined else 0.0] if sites else []
            sites.append(int(model.wrap_objid[wrap]))
            joined = True
        else:
            raise compiled.error(
                "tendon", number,
                "it wraps around geoms; hybridyn reads forces along straight lines through sites: remove the "
                "geoms, or its stiffness, damping and frictionloss",
            )  # fmt: skip
    return sites, shares


def _add_inertia(robot: RobotFile, compiled: Compiled) -> None:
    """Add the inertia along fixed tendons: to the joint of one over a single joint, else as a joint.

    Such a joint has the name of the tendon, whose length it follows, and moves the inertia alone.

    Raises:
        ModelError: A tendon with inertia is spatial.
    """
    stated, taken = np.ravel(compiled.rows("tendon_armature")), {joint.name for joint in robot.joints}
    for number in np.flatnonzero(stated).tolist():
        name, terms = compiled.name("tendon", number) or f"tendon{number}", fixed_terms(compiled, number)
        if terms is None:
            message = "armature along a spatial tendon is not read; remove it, or put it on joints"
            raise compiled.error("tendon", number, message)
        at = {joint.name: n for n, joint in enumerate(robot.joints) if joint.name in terms}
        if len(terms) == 1:
            ((joint, arm),) = terms.items()
            own = robot.joints[at[joint]]
            more = own.rotor_inertia + float(stated[number]) * arm**2
            robot.joints[at[joint]] = replace(own, rotor_inertia=more)
            continue
        name = unique(name, taken)
        link, line = unique(name, {link.name for link in robot.links}), compiled.line("tendon", number)
        carrier = robot.joints[min(at.values())].parent
        robot.links.append(massless(link, line, between=True))
        robot.joints.append(Joint(
            name, JointKind.PRISMATIC, carrier, link, np.eye(4), np.array([0.0, 0.0, 1.0]),
            rotor_inertia=float(stated[number]), line=line,
        ))  # fmt: skip
        robot.undriven.add(name)
        tied = tuple((joint, -arm) for joint, arm in terms.items() if arm)
        robot.couplings.append(Coupling(name, ((name, 1.0), *tied), 0.0, line))
        robot.home[name] = (sum(arm * robot.home[joint][0] for joint, arm in terms.items()),)
        robot.notes.append(
            f"the armature of tendon '{name}' is that of a joint of this name, which follows its length"
        )


def _compensated(robot: RobotFile, compiled: Compiled) -> dict[str, float]:
    """Return the part of its weight that each body is relieved of; actuators' own part is noted.

    Raises:
        ModelError: Of the joints that carry such a body, only some compensate by their actuators.
    """
    model, out, by_motors, idle = compiled.model, dict[str, float](), list[str](), list[str]()
    names = {link.name for link in robot.links}
    for body in np.flatnonzero(model.body_gravcomp).tolist():
        actuated = {bool(model.jnt_actgravcomp[joint]) for joint in _carrying(compiled, body)}
        if compiled.bodies[body] not in names or not actuated or not model.body_mass[body]:
            idle.append(compiled.bodies[body])
            continue
        if actuated == {True}:
            by_motors.append(compiled.bodies[body])
            continue
        if len(actuated) > 1:
            raise compiled.error(
                "body", body,
                "its gravcomp acts through the actuators of some joints and beside those of others "
                "(actuatorgravcomp); state the same for all joints that carry it",
            )  # fmt: skip
        out[compiled.bodies[body]] = float(model.body_gravcomp[body])
    alone = np.flatnonzero(model.jnt_actgravcomp).tolist() if not model.body_gravcomp.any() else []
    robot.notes += noted({
        "actuatorgravcomp of joints {} acts on nothing: no body has gravcomp":
            [compiled.joints[joint] for joint in alone],
        "gravcomp of bodies {} acts on nothing: no joint carries them, or they have no mass": idle,
        "gravcomp of bodies {} is a part of the efforts of their motors (actuatorgravcomp), which are inputs "
        "of the models": by_motors
    })  # fmt: skip
    return out


def _carrying(compiled: Compiled, body: int) -> list[int]:
    """Return the numbers of the joints that carry a body."""
    model, out = compiled.model, list[int]()
    while body:
        first = int(model.body_jntadr[body])
        out += range(first, first + int(model.body_jntnum[body]))
        body = int(model.body_parentid[body])
    return out


def split(compiled: Compiled, joint: int) -> bool:
    """Say whether a free joint has numbers that count along axes, so that slides and a ball stand for it."""
    model, dof = compiled.model, int(compiled.model.jnt_dofadr[joint])
    numbers = (model.dof_armature[dof], model.dof_frictionloss[dof], model.jnt_stiffness[joint])
    return any(numbers) or bool(compiled.rows("dof_dampingpoly")[dof : dof + 1].any())
