"""Laws of joint efforts: rotors, friction, dampers, springs and stops."""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from ..errors import ModelError
from ..spatial import LARGEST, Array
from ..structure.robot import HybridRobot
from .joints import WIDTH, JointEffect, Numbers, Numerals, positive


@dataclass(frozen=True)
class RotorInertia(JointEffect):
    """Inertia of the motors' rotors at the joints, J n^2 on the diagonal of A, without gyroscopic terms.

    It acts through accelerations, without an effort of its own; its energy is kinetic. A ball joint has it
    about each of its three axes, as MuJoCo's armature.

    `inertia`: J n^2 by joint [kg or kg m^2]; None uses rotor inertia and gear ratio of the robot's files.
    Source: Featherstone (2008), section 9.6.
    """

    inertia: Numbers | None = None
    name: ClassVar[str] = "rotor_inertia"
    by_joint = ("inertia",)
    several = ("spherical",)
    from_files = "armature"


class _Viscous(JointEffect):
    """tau = -c v."""

    by_joint = ("coefficient",)
    several = ("spherical", "planar", "floating")

    def effort(self, p: Numerals, x: Array, v: Array) -> Array:
        """Return -c v."""
        return -p[0] * v


@dataclass(frozen=True)
class ViscousFriction(_Viscous):
    """tau = -c v.

    `coefficient`: c by joint [N s/m or N m s/rad]; None uses the damping of the robot's files.
    """

    coefficient: Numbers | None = None
    name: ClassVar[str] = "viscous_friction"
    from_files = "damping"


@dataclass(frozen=True)
class Damper(_Viscous):
    """tau = -c v, in addition to the viscous friction of the robot's files.

    `coefficient`: c by joint [N s/m or N m s/rad].
    """

    coefficient: Numbers = field(default_factory=dict)
    name: ClassVar[str] = "damper"


@dataclass(frozen=True)
class CoulombFriction(JointEffect):
    """tau = -f tanh(v / width): smoothed dry friction without stiction; a joint creeps under a load below f.

    `level`: f by joint [N or N m]; None uses the friction of the robot's files. `width` [m/s or rad/s].
    Source: the usual smoothing, e.g. Andersson, Soderberg & Bjorklund (2007), Tribology Int. 40.
    """

    level: Numbers | None = None
    width: float = WIDTH
    name: ClassVar[str] = "coulomb_friction"
    by_joint = ("level",)
    from_files = "friction"

    def numbers(self, robot: HybridRobot) -> dict[str, tuple[float, ...]]:
        """Return f by joint."""
        positive(self.name, "width", self.width)
        return super().numbers(robot)

    def effort(self, p: Numerals, x: Array, v: Array) -> Array:
        """Compute -f tanh(v / width)."""
        return -p[0] * np.tanh(v / self.width)


@dataclass(frozen=True)
class StribeckFriction(JointEffect):
    """tau = -(f + (s - f) exp(-(v / v_s)^2)) tanh(v / width): dry friction that is larger near rest.

    `level`: f at speed, `static`: s near rest (s >= f), both [N or N m], `speed`: v_s [m/s or rad/s], by
    joint; `width` [m/s or rad/s], well below v_s. It replaces Coulomb friction: do not name both for one
    joint. Source: Armstrong-Helouvry, Dupont & Canudas de Wit (1994), Automatica 30.
    """

    level: Numbers = field(default_factory=dict)
    static: Numbers = field(default_factory=dict)
    speed: Numbers = field(default_factory=dict)
    width: float = WIDTH
    name: ClassVar[str] = "stribeck_friction"
    by_joint = ("level", "static", "speed")

    def numbers(self, robot: HybridRobot) -> dict[str, tuple[float, ...]]:
        """Return f, s, v_s by joint."""
        positive(self.name, "width", self.width)
        out = super().numbers(robot)
        for joint, (level, static, speed) in out.items():
            positive(self.name, f"speed of '{joint}'", speed)
            if static < level:
                raise ModelError(
                    f"{self.name}: joint '{joint}': static {static:g} is less than level {level:g}",
                    element=joint,
                )
        return out

    def effort(self, p: Numerals, x: Array, v: Array) -> Array:
        """Compute the friction effort."""
        return -(p[0] + (p[1] - p[0]) * np.exp(-((v / p[2]) ** 2))) * np.tanh(v / self.width)


@dataclass(frozen=True)
class Spring(JointEffect):
    """tau = -k (x - rest); for a continuous joint, x - rest is wrapped to [-pi, pi].

    `stiffness`: k by joint [N/m or N m/rad]. `rest`: position without force [m or rad], 0 by default.
    """

    stiffness: Numbers = field(default_factory=dict)
    rest: Numbers = field(default_factory=dict)
    name: ClassVar[str] = "spring"
    by_joint = ("stiffness",)

    def numbers(self, robot: HybridRobot) -> dict[str, tuple[float, ...]]:
        """Return k, rest and whether the joint is continuous (1 or 0) by joint."""
        odd = sorted(set(self.rest) - set(self.stiffness))
        if odd:
            raise ModelError(f"{self.name}: 'rest' names '{odd[0]}', 'stiffness' does not", element=odd[0])
        far = next((name for name, x in self.rest.items() if not abs(x) <= LARGEST), None)
        if far is not None:
            raise ModelError(
                f"{self.name}: joint '{far}' has the rest position {self.rest[far]:g}; it must be "
                f"finite, and at most {LARGEST:.0e}",
                element=far,
            )
        endless = {name for name, kind in zip(robot.joints, robot.kinds, strict=True) if kind == "continuous"}
        known = super().numbers(robot)
        return {n: (k, float(self.rest.get(n, 0.0)), float(n in endless)) for n, (k,) in known.items()}

    def effort(self, p: Numerals, x: Array, v: Array) -> Array:
        """Compute -k (x - rest)."""
        return -p[0] * self._stretch(p, x)

    def energy(self, p: Numerals, x: Array) -> Array:
        """Compute k (x - rest)^2 / 2."""
        return 0.5 * p[0] * self._stretch(p, x) ** 2

    def _stretch(self, p: Numerals, x: Array) -> Array:
        stretch = x - p[1]
        return stretch - p[2] * 2 * np.pi * np.round(stretch / (2 * np.pi))


@dataclass(frozen=True)
class Stop(JointEffect):
    """Joint stops: at a penetration d beyond a limit, the effort back is k d max(0, 1 + c d_dot) >= 0.

    The damping is proportional to the penetration. The force is therefore continuous at touch-down and
    lift-off, and integrators keep their order (the force of a plain spring-damper jumps, and pulls at
    lift-off). `stiffness`: k by joint [N/m or N m/rad]; `damping`: c [s/m or s/rad]; `lower` and `upper`:
    limits by joint [m or rad], those of the robot's files by default.
    Source: Hunt & Crossley (1975), J. Appl. Mech. 42, with exponent one.
    """

    stiffness: Numbers = field(default_factory=dict)
    damping: float = 0.0
    lower: Numbers = field(default_factory=dict)
    upper: Numbers = field(default_factory=dict)
    name: ClassVar[str] = "stop"
    by_joint = ("stiffness",)

    def numbers(self, robot: HybridRobot) -> dict[str, tuple[float, ...]]:
        """Return k, lower and upper limit by joint."""
        positive(self.name, "damping", self.damping, or_zero=True)
        record = {j.joint.name: j.joint for j in robot.bodies.joints}
        out: dict[str, tuple[float, ...]] = {}
        for joint, (stiffness,) in super().numbers(robot).items():
            files = record.get(joint)
            lower = self.lower.get(joint, files.lower if files else -np.inf)
            upper = self.upper.get(joint, files.upper if files else np.inf)
            if files and not (lower < upper and (lower > -np.inf or upper < np.inf)):
                raise ModelError(
                    f"{self.name}: joint '{joint}' has no limits ({lower:g} to {upper:g})", element=joint
                )
            out[joint] = (stiffness, lower, upper)
        return out

    def effort(self, p: Numerals, x: Array, v: Array) -> Array:
        """Compute the effort."""
        low, high = np.maximum(p[1] - x, 0.0), np.maximum(x - p[2], 0.0)
        push_low = low * np.maximum(1.0 - self.damping * v, 0.0)
        push_high = high * np.maximum(1.0 + self.damping * v, 0.0)
        out: Array = p[0] * (push_low - push_high)
        return out

    def energy(self, p: Numerals, x: Array) -> Array:
        """Compute k d^2 / 2."""
        out: Array = 0.5 * p[0] * (np.maximum(p[1] - x, 0.0) ** 2 + np.maximum(x - p[2], 0.0) ** 2)
        return out
