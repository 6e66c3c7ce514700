"""Effects on joints: efforts tau(q, v), and the rotors' inertia.

Each unit is one law with its numbers by joint name; `placed` finds the joints in a robot once and gives an `OnJoints`,
which evaluates the law for whole batches. Efforts act along the joint's rate; units are those of the joint: N, m, m/s
for a prismatic joint, N m, rad, rad/s for the others.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar, Protocol

import numpy as np

from ..description.names import did_you_mean, listed
from ..errors import ModelError
from ..spatial import Array

if TYPE_CHECKING:
    from ..robot import HybridRobot

Numbers = Mapping[str, float]

#: Speed over which smoothed friction turns its sign [m/s or rad/s]; at three widths it is 99.5 % of its value.
WIDTH = 1e-2


class JointEffect(Protocol):
    """A law of joint efforts.

    Attributes:
        name: Name of the effect.
        any_freedoms: Whether joints with several freedoms may have it.
    """

    name: ClassVar[str]
    any_freedoms: ClassVar[bool]

    def numbers(self, robot: HybridRobot) -> dict[str, tuple[float, ...]]:
        """Give the law's numbers for each joint that has it."""
        ...

    def effort(self, p: Array, x: Array, v: Array) -> Array:
        """Give the effort, shape (T, k), for numbers p (numbers, k), positions x and rates v (T, k)."""
        ...

    def energy(self, p: Array, x: Array) -> Array:
        """Give the energy stored, shape (T, k), [J]."""
        ...

    def power(self, p: Array, x: Array, v: Array) -> Array:
        """Give the power lost, shape (T, k), [W], never negative."""
        ...


@dataclass(frozen=True)
class OnJoints:
    """A law placed on the joints of one robot.

    Attributes:
        effect: The law.
        joints: Names of its joints.
        columns: Their freedoms in v, shape (k,).
        at: Their first coordinate in q, shape (k,).
        turns: Whether q holds cosine and sine there, shape (k,).
        p: The law's numbers, shape (numbers, k).
    """

    effect: JointEffect
    joints: tuple[str, ...]
    columns: Array
    at: Array
    turns: Array
    p: Array

    def positions(self, q: Array) -> Array:
        """Give joint positions, shape (T, k), [m or rad]; of endless joints the angle in [-pi, pi]."""
        x = q[:, self.at]
        if self.turns.any():
            x[:, self.turns] = np.arctan2(q[:, self.at[self.turns] + 1], x[:, self.turns])
        return x

    def effort(self, q: Array, v: Array) -> Array:
        """Give the efforts, shape (T, k), for the robot's q and v."""
        return self.effect.effort(self.p, self.positions(q), v[:, self.columns])

    def energy(self, q: Array) -> Array:
        """Give the energy stored, shape (T,), [J]."""
        out: Array = self.effect.energy(self.p, self.positions(q)).sum(axis=1)
        return out

    def power(self, q: Array, v: Array) -> Array:
        """Give the power lost, shape (T,), [W]."""
        out: Array = self.effect.power(self.p, self.positions(q), v[:, self.columns]).sum(axis=1)
        return out


def placed(effect: JointEffect, robot: HybridRobot) -> OnJoints | None:
    """Find a law's joints in a robot; None where no joint has it.

    Raises:
        ModelError: A joint is unknown, has several freedoms where the law is for one, or sits in a wrist that was cut.
    """
    numbers = effect.numbers(robot)
    columns, at, turns, p = [], [], [], []
    for name, values in numbers.items():
        index = robot.joint_index.get(name)
        if index is None:
            known = [j for j in robot.joints if j in robot.body_of_joint]
            raise ModelError(f"{effect.name}: no such movable joint '{name}'{did_you_mean(name, known)}", element=name)
        freedoms = robot.v_slices[index]
        if freedoms.stop - freedoms.start > 1 and not effect.any_freedoms:
            raise ModelError(f"{effect.name}: joint '{name}' is {robot.kinds[index]}; it must have one freedom", element=name)
        for column in range(freedoms.start, freedoms.stop):
            columns.append(column)
            at.append(robot.q_slices[index].start)
            turns.append(robot.kinds[index] == "continuous")
            p.append(values)
    cut = [name for name in numbers if name in robot.cut_joints]
    if cut:
        raise ModelError(
            f"{effect.name}: {listed(cut)} sit in wrists without mass, which were cut: load the robot with "
            f"held={cut[:3]!r}, or take it from hybridyn.with_effects(robot, effects)", element=cut[0],
        )  # fmt: skip
    if not columns:
        return None
    return OnJoints(
        effect, tuple(numbers), np.array(columns), np.array(at), np.array(turns, dtype=bool), np.array(p, dtype=float).T
    )


def _stated(robot: HybridRobot, attribute: str) -> dict[str, tuple[float, ...]]:
    """Give what the robot's files state of its joints, where it is not zero."""
    joints = (j.joint for j in robot.bodies.joints)
    return {j.name: (float(getattr(j, attribute)),) for j in joints if getattr(j, attribute)}


def _given(effect: str, *tables: Numbers) -> dict[str, tuple[float, ...]]:
    """Join numbers by joint; all tables must name the same joints, no number may be negative.

    Raises:
        ModelError: One does not.
    """
    for table in tables[1:]:
        odd = sorted(set(table) ^ set(tables[0]))
        if odd:
            raise ModelError(f"{effect}: {listed(odd)} lack one of the law's numbers", element=odd[0])
    out = {name: tuple(float(table[name]) for table in tables) for name in tables[0]}
    for name, values in out.items():
        if not all(np.isfinite(x) and x >= 0 for x in values):
            raise ModelError(f"{effect}: joint '{name}' has {values}; numbers must be finite and not negative", element=name)
    return out


def _positive(effect: str, what: str, value: float) -> None:
    if not (np.isfinite(value) and value > 0):
        raise ModelError(f"{effect}: {what} must be positive, not {value:g}")


@dataclass(frozen=True)
class RotorInertia:
    """Inertia of the motors' rotors seen at the joints, J n^2 on the diagonal of A; no gyroscopic part.

    `inertia`: J n^2 by joint [kg or kg m^2]; None takes rotor inertia and gear ratio of the robot's files.
    Source: Featherstone (2008), section 9.6.
    """

    inertia: Numbers | None = None
    name: ClassVar[str] = "rotor_inertia"
    any_freedoms: ClassVar[bool] = False

    def numbers(self, robot: HybridRobot) -> dict[str, tuple[float, ...]]:
        """Give J n^2 by joint."""
        if self.inertia is not None:
            return _given(self.name, self.inertia)
        joints = (j.joint for j in robot.bodies.joints)
        return {j.name: (j.rotor_inertia * j.gear_ratio**2,) for j in joints if j.rotor_inertia}

    def diagonal(self, p: Array) -> Array:
        """Give what is added to the diagonal of A, shape (k,)."""
        return p[0]

    def kinetic(self, p: Array, v: Array) -> Array:
        """Give the rotors' kinetic energy, shape (T, k), [J]."""
        return 0.5 * p[0] * v**2

    def effort(self, p: Array, x: Array, v: Array) -> Array:
        """Give no effort: a rotor acts through accelerations."""
        return np.zeros_like(v)

    def energy(self, p: Array, x: Array) -> Array:
        """Give nothing: its energy is kinetic."""
        return np.zeros_like(x)

    def power(self, p: Array, x: Array, v: Array) -> Array:
        """Give nothing: it loses none."""
        return np.zeros_like(v)


class _Dissipative:
    """What friction laws share: no energy stored, all work of the effort lost."""

    def effort(self, p: Array, x: Array, v: Array) -> Array:
        """Give the effort, shape (T, k)."""
        raise NotImplementedError

    def energy(self, p: Array, x: Array) -> Array:
        """Give nothing: friction stores none."""
        return np.zeros_like(x)

    def power(self, p: Array, x: Array, v: Array) -> Array:
        """Give -tau v, shape (T, k), [W]."""
        return -self.effort(p, x, v) * v


@dataclass(frozen=True)
class ViscousFriction(_Dissipative):
    """tau = -c v.

    `coefficient`: c by joint [N s/m or N m s/rad]; None takes the damping of the robot's files.
    """

    coefficient: Numbers | None = None
    name: ClassVar[str] = "viscous_friction"
    any_freedoms: ClassVar[bool] = True

    def numbers(self, robot: HybridRobot) -> dict[str, tuple[float, ...]]:
        """Give c by joint."""
        return _stated(robot, "damping") if self.coefficient is None else _given(self.name, self.coefficient)

    def effort(self, p: Array, x: Array, v: Array) -> Array:
        """Give -c v."""
        return -p[0] * v


@dataclass(frozen=True)
class CoulombFriction(_Dissipative):
    """tau = -f tanh(v / width): dry friction, smoothed, so nothing sticks: under a load below f a joint creeps.

    `level`: f by joint [N or N m]; None takes the friction of the robot's files. `width` [m/s or rad/s].
    Source: the smoothing is the usual one, e.g. Andersson, Soderberg & Bjorklund (2007), Tribology Int. 40.
    """

    level: Numbers | None = None
    width: float = WIDTH
    name: ClassVar[str] = "coulomb_friction"
    any_freedoms: ClassVar[bool] = False

    def numbers(self, robot: HybridRobot) -> dict[str, tuple[float, ...]]:
        """Give f by joint."""
        _positive(self.name, "width", self.width)
        return _stated(robot, "friction") if self.level is None else _given(self.name, self.level)

    def effort(self, p: Array, x: Array, v: Array) -> Array:
        """Give -f tanh(v / width)."""
        return -p[0] * np.tanh(v / self.width)


@dataclass(frozen=True)
class StribeckFriction(_Dissipative):
    """tau = -(f + (s - f) exp(-(v / v_s)^2)) tanh(v / width): dry friction that is larger near rest.

    `level`: f at speed, `static`: s near rest (s >= f), both [N or N m], `speed`: v_s [m/s or rad/s], by joint; `width`
    [m/s or rad/s], well below v_s. It replaces Coulomb friction: do not name both for one joint.
    Source: Armstrong-Helouvry, Dupont & Canudas de Wit (1994), Automatica 30.
    """

    level: Numbers = field(default_factory=dict)
    static: Numbers = field(default_factory=dict)
    speed: Numbers = field(default_factory=dict)
    width: float = WIDTH
    name: ClassVar[str] = "stribeck_friction"
    any_freedoms: ClassVar[bool] = False

    def numbers(self, robot: HybridRobot) -> dict[str, tuple[float, ...]]:
        """Give f, s, v_s by joint."""
        _positive(self.name, "width", self.width)
        out = _given(self.name, self.level, self.static, self.speed)
        for joint, (level, static, speed) in out.items():
            _positive(self.name, f"speed of '{joint}'", speed)
            if static < level:
                raise ModelError(f"{self.name}: joint '{joint}': static {static:g} is less than level {level:g}", element=joint)
        return out

    def effort(self, p: Array, x: Array, v: Array) -> Array:
        """Give the friction."""
        return -(p[0] + (p[1] - p[0]) * np.exp(-((v / p[2]) ** 2))) * np.tanh(v / self.width)


@dataclass(frozen=True)
class Spring:
    """tau = -k (x - rest); of an endless joint the angle from `rest` in [-pi, pi].

    `stiffness`: k by joint [N/m or N m/rad]. `rest`: position without force by joint [m or rad], 0 where not named.
    """

    stiffness: Numbers = field(default_factory=dict)
    rest: Numbers = field(default_factory=dict)
    name: ClassVar[str] = "spring"
    any_freedoms: ClassVar[bool] = False

    def numbers(self, robot: HybridRobot) -> dict[str, tuple[float, ...]]:
        """Give k, rest and the period (infinite but for endless joints) by joint."""
        odd = sorted(set(self.rest) - set(self.stiffness))
        if odd:
            raise ModelError(f"{self.name}: 'rest' names '{odd[0]}', 'stiffness' does not", element=odd[0])
        endless = {name for name, kind in zip(robot.joints, robot.kinds, strict=True) if kind == "continuous"}
        given = _given(self.name, self.stiffness)
        return {n: (k, float(self.rest.get(n, 0.0)), float(n in endless)) for n, (k,) in given.items()}

    def effort(self, p: Array, x: Array, v: Array) -> Array:
        """Give -k (x - rest)."""
        return -p[0] * self._stretch(p, x)

    def energy(self, p: Array, x: Array) -> Array:
        """Give k (x - rest)^2 / 2."""
        return 0.5 * p[0] * self._stretch(p, x) ** 2

    def power(self, p: Array, x: Array, v: Array) -> Array:
        """Give nothing: a spring loses none."""
        return np.zeros_like(v)

    def _stretch(self, p: Array, x: Array) -> Array:
        stretch = x - p[1]
        return stretch - p[2] * 2 * np.pi * np.round(stretch / (2 * np.pi))


@dataclass(frozen=True)
class Damper(_Dissipative):
    """tau = -c v, beside the viscous friction that the files state.

    `coefficient`: c by joint [N s/m or N m s/rad].
    """

    coefficient: Numbers = field(default_factory=dict)
    name: ClassVar[str] = "damper"
    any_freedoms: ClassVar[bool] = True

    def numbers(self, robot: HybridRobot) -> dict[str, tuple[float, ...]]:
        """Give c by joint."""
        return _given(self.name, self.coefficient)

    def effort(self, p: Array, x: Array, v: Array) -> Array:
        """Give -c v."""
        return -p[0] * v


@dataclass(frozen=True)
class Stop:
    """Joint stops: beyond a limit by d, a push back of k d max(0, 1 + c d_dot), never a pull.

    The damping grows with the penetration, so that the force is continuous where the stop is touched and left (a plain
    spring-damper jumps there, and pulls on the way out): integrators keep their order. `stiffness`: k by joint [N/m or
    N m/rad]; `damping`: c [s/m or s/rad]; limits are the files', or `lower` and `upper` [m or rad] by joint.
    Source: Hunt & Crossley (1975), J. Appl. Mech. 42, with exponent one.
    """

    stiffness: Numbers = field(default_factory=dict)
    damping: float = 0.0
    lower: Numbers = field(default_factory=dict)
    upper: Numbers = field(default_factory=dict)
    name: ClassVar[str] = "stop"
    any_freedoms: ClassVar[bool] = False

    def numbers(self, robot: HybridRobot) -> dict[str, tuple[float, ...]]:
        """Give k, lower and upper limit by joint."""
        if not (np.isfinite(self.damping) and self.damping >= 0):
            raise ModelError(f"{self.name}: damping must be finite and not negative, not {self.damping:g}")
        record = {j.joint.name: j.joint for j in robot.bodies.joints}
        out = {}
        for joint, (stiffness,) in _given(self.name, self.stiffness).items():
            files = record.get(joint)
            lower = self.lower.get(joint, files.lower if files else -np.inf)
            upper = self.upper.get(joint, files.upper if files else np.inf)
            if files and not (lower < upper and (lower > -np.inf or upper < np.inf)):
                raise ModelError(f"{self.name}: joint '{joint}' has no limits ({lower:g} to {upper:g})", element=joint)
            out[joint] = (stiffness, lower, upper)
        return out

    def effort(self, p: Array, x: Array, v: Array) -> Array:
        """Give the push back."""
        low, high = np.maximum(p[1] - x, 0.0), np.maximum(x - p[2], 0.0)
        push_low = low * np.maximum(1.0 - self.damping * v, 0.0)
        push_high = high * np.maximum(1.0 + self.damping * v, 0.0)
        return p[0] * (push_low - push_high)

    def energy(self, p: Array, x: Array) -> Array:
        """Give k d^2 / 2."""
        return 0.5 * p[0] * (np.maximum(p[1] - x, 0.0) ** 2 + np.maximum(x - p[2], 0.0) ** 2)

    def power(self, p: Array, x: Array, v: Array) -> Array:
        """Give what the effort takes beyond the change of energy stored."""
        elastic = p[0] * (np.maximum(p[1] - x, 0.0) - np.maximum(x - p[2], 0.0))
        return (elastic - self.effort(p, x, v)) * v
