"""Dry friction in the direct model where joints stick: they have no rate, and friction is what holds them.

Friction phi of the joints is linear in the accelerations a = a_0 + G phi, and in the wrenches w = w_0 + B phi
on which it depends. A joint that slides in a direction s has phi = -s (level + gain N(w)), one that sticks
has a = 0 at most of the same size; s is a unit vector where phi is that of a ball. `load_friction` says when
N(w) is unique.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..description.names import listed
from ..effects.choice import Effects
from ..effects.dry_friction import OnSticking
from ..errors import ActuationError
from ..spatial import Array, Index
from ..structure.robot import HybridRobot
from .backward import reactions_of
from .direct import states_before
from .direct_recursion import accelerate, articulate
from .holding import Held, Hold
from .load_friction import STEPS, check_determined, check_jamming, solve_friction, wrenches_of
from .loads import Loads, all_loads

#: What an effort leaves of the accelerations that it cancels, in roundings of these.
CANCELLED = 64 * np.finfo(float).eps
#: Effort of a ball, over the largest, below which it has no direction.
POINTLESS = 1e-14
#: Acceleration of a joint at rest, over the largest without friction, from which it begins to move.
STARTS = 1e-10
#: Change of efforts, over the largest, at which what joints at rest hold has settled.
LEFT = 1e-11


class Free(NamedTuple):
    """One sample without dry friction, and how it answers to efforts of the joints that have some.

    Attributes:
        law: The joints and their friction.
        v: Rates of these joints, shape (k,).
        a: Accelerations of the robot, shape (nv,).
        G: The same per effort, shape (nv, k).
        w: Wrenches of the joints of `law.loaded`, shape (joints, 6).
        B: The same per effort, shape (joints, 6, k).
    """

    law: OnSticking
    v: Array
    a: Array
    G: Array
    w: Array
    B: Array

    def limits(self, sizes: Array) -> tuple[Array, Array]:
        """Compute friction at positive and at negative rates, shape (k,) each, from N(w), shape (joints,).

        That of a ball is the length of a vector, of all its freedoms.
        """
        forward, backward = (self.law.levels(self.v, np.full(len(self.v), s)) for s in (1.0, -1.0))
        if self.law.loaded is not None:
            more = self.law.of_loads(self.law.gains(self.v) * sizes)
            forward += more
            backward += more
        return forward, backward

    def hold(self, stuck: Index) -> Hold:
        """Return the joints at rest of some freedoms, by their places."""
        balls = [np.searchsorted(stuck, at) for at in self.law.vectors if at[0] in stuck]
        return Hold(self.G[self.law.columns[stuck]][:, stuck], balls)

    def sizes(self, efforts: Array) -> Array:
        """Compute N(w) under efforts of friction, shape (joints,)."""
        law = self.law.loaded
        return np.zeros(0) if law is None else law.sizes(self.w + self.B @ efforts)

    def accelerations(self, efforts: Array) -> Array:
        """Compute the accelerations, shape (nv,); what is rounding of terms that cancel is zero."""
        a: Array = self.a + self.G @ efforts
        terms = np.abs(self.a) + np.abs(self.G) @ np.abs(efforts)
        return np.where(np.abs(a) <= CANCELLED * terms, 0.0, a)


def free_of_friction(
    robot: HybridRobot, law: OnSticking, q: Array, v: Array, base: Array, tau: Array, loads: Loads
) -> Free:
    """Compute a sample without dry friction, and its answers.

    Args:
        q, v: The state, shapes (1, nq), (1, nv).
        base: Acceleration of a moving base, shape (6,).
        tau: Efforts behind the gears, shape (1, motors).
        loads: What acts besides dry friction.

    Raises:
        SingularityError: As `articulate`.
        ModelError: The motion does not determine a wrench on which friction depends.
    """
    a, k = np.zeros_like(v), len(law.columns)
    if robot.base == "moving":
        a[:, :6] = base
    states = states_before(robot, loads.on, q, v, a)
    accelerate(robot, articulate(robot, states, loads, tau, None, passing=True), v, a)
    inert = Effects(inertia=loads.on.inertia, leg_inertia=loads.on.leg_inertia, rotors=loads.on.rotors)
    many, still, quiet = np.repeat(q, k, axis=0), np.zeros((k, robot.nv)), np.zeros((k, len(robot.motors)))
    answers, at = still.copy(), states_before(robot, inert, many, still, still)
    unit = all_loads(robot, inert, many, still, None, None)
    unit.joints[np.arange(k), law.columns] = 1.0
    accelerate(robot, articulate(robot, at, unit, quiet, None, passing=True), still, answers)
    w, B = np.zeros((0, 6)), np.zeros((0, 6, k))
    if law.loaded is not None:
        start = reactions_of(robot, q, v, a, tau, loads)
        check_determined(law.loaded, start)
        w = wrenches_of(law.loaded, start)[0]
        B = np.moveaxis(wrenches_of(law.loaded, reactions_of(robot, many, still, answers, quiet, unit)), 0, 2)
    return Free(law, v[0, law.columns], a[0], answers.T, w, B)


class Friction(NamedTuple):
    """Friction of a sample.

    Attributes:
        efforts: Efforts of the joints, shape (k,).
        held: What those hold that stick, None where none does.
    """

    efforts: Array
    held: Held | None


def friction_of(free: Free, signs: Array, *, held: bool = False) -> Friction:
    """Compute friction from directions.

    Args:
        signs: 1 or -1 of joints that slide, 0 of those that stick, shape (k,); of balls unit vectors.
        held: Whether it is asked what sticking joints hold; else it is computed where friction needs it.

    Raises:
        ActuationError: Joints may jam, or what they hold does not settle.
    """
    signs = free.law.directions(free.v, signs)
    rests = free.law.at_rest(signs)
    stuck = np.flatnonzero(rests)
    columns, slides = free.law.columns[stuck], np.diag(np.where(rests, 0.0, 1.0))
    hold = free.hold(stuck) if len(stuck) else None
    onto, given = slides.copy(), np.zeros(len(signs))  # efforts of all are onto @ those of who slides + given
    if hold is not None:
        onto[stuck] -= hold.inverse @ free.G[columns] @ slides
        given[stuck] = -hold.inverse @ free.a[columns]
    for _ in range(STEPS):
        efforts = _sliding(free, signs, onto, given)
        if hold is None or not (held or free.law.loaded):
            return Friction(efforts, None)
        forward, backward = free.limits(free.sizes(efforts))
        part = hold.share(efforts[stuck], forward[stuck], backward[stuck])
        change = part.efforts - efforts[stuck]
        efforts[stuck] = part.efforts
        if not free.law.loaded or np.abs(change).max() <= LEFT * np.abs(part.efforts).max():
            return Friction(efforts, part)
        given[stuck] += change  # joints of a loop hold each other
    raise _unsettled(free)


def _sliding(free: Free, signs: Array, onto: Array, given: Array) -> Array:
    """Compute the friction of joints that slide, and what sticking ones hold against it, shape (k,)."""
    efforts: Array = onto @ (-signs * free.law.levels(free.v, signs)) + given
    law = free.law.loaded
    if law is None:
        return efforts
    per_size = np.zeros((len(signs), len(law.joints)))
    for joint, (at, gain) in enumerate(zip(free.law.of_load, free.law.gains(free.v), strict=True)):
        per_size[at, joint] = -signs[at] * gain
    per_size = onto @ per_size
    B = np.matmul(free.B, per_size)[None]
    check_jamming(law, B)
    out: Array = efforts + per_size @ solve_friction(law, (free.w + free.B @ efforts)[None], B)[0]
    return out


def directions_from_rest(free: Free, signs: Array) -> Array:
    """Find which of the joints at rest begin to move, and where to.

    Args:
        signs: Directions of the joints, 0 of those at rest, shape (k,).

    Returns:
        Directions in which 0 means that the joint sticks, shape (k,); of balls unit vectors.

    Raises:
        ActuationError: As `friction_of`.
    """
    now = friction_of(free, signs, held=True)
    signs = free.law.directions(free.v, signs)
    rest = np.flatnonzero(free.law.at_rest(signs))
    if now.held is None or now.held.ratio <= 1.0:
        return signs
    columns, out = free.law.columns[rest], signs.copy()
    hold, efforts = free.hold(rest), now.efforts
    for _ in range(STEPS):
        forward, backward = free.limits(free.sizes(efforts))
        last, efforts = efforts, -signs * np.where(signs > 0, forward, backward)
        without = free.a[columns] + free.G[columns] @ efforts
        efforts[rest] = hold.begin(without, forward[rest], backward[rest])
        if not free.law.loaded or np.abs(efforts - last).max() <= LEFT * np.abs(efforts).max():
            break
    else:
        raise _unsettled(free)
    a = without + free.G[columns][:, rest] @ efforts[rest]
    size, way = np.abs(a), np.sign(a)
    for at in hold.balls:  # friction opposes each motion, with digits that small accelerations lack
        push, size[at] = efforts[rest[at]], np.linalg.norm(a[at])
        pushed = np.linalg.norm(push)
        known = pushed > POINTLESS * np.abs(efforts).max() and forward[rest[at[0]]] > 0.0
        way[at] = -push / pushed if known else a[at] / np.where(size[at], size[at], 1.0)
    begins = size > STARTS * np.abs(without).max(initial=0.0)
    # Where friction is just exceeded, accelerations are rounding: the motion that needs most is released.
    out[rest] = np.where(begins, way, 0.0) if begins.any() else now.held.motion
    return out


def carried(free: Free, stuck: Index, x: Array) -> Array:
    """Compute the motion of all joints, shape (nv,), in which some move by x and nothing else moves them.

    Args:
        stuck: Numbers of these joints.
        x: Their rates or displacements.
    """
    out: Array = free.G[:, stuck] @ (free.hold(stuck).inverse @ x)
    return out


def stop_motion(free: Free, v: Array, stuck: Index) -> Array:
    """Compute rates without those of joints that stick, which lose kinetic energy, shape (nv,).

    Args:
        v: Rates, shape (nv,), of which those of these joints are small.
        stuck: Numbers of the joints.
    """
    columns = free.law.columns[stuck]
    out = v - carried(free, stuck, v[columns])
    out[columns] = 0.0
    return out


def _unsettled(free: Free) -> ActuationError:
    """Return the error that says that friction at rest was not found."""
    name = "" if free.law.loaded is None else f"{free.law.loaded.effect.name}: "
    return ActuationError(
        f"{name}what joints at rest hold does not settle in {STEPS} steps: their friction adds too much to "
        f"its own load. Lower coefficients of {listed(free.law.joints)}, or keep away from this posture"
    )
