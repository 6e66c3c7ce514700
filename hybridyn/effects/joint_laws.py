"""Laws of joint efforts that depend on rates: rotors, friction and dampers."""

from abc import abstractmethod
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from ..errors import ModelError
from ..joints.kinds import JointKind
from ..spatial import Array
from ..structure.robot import HybridRobot
from .joints import WIDTH, JointEffect, Numbers, Numerals, positive
from .words import FROM_FILES


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
    symbols = ("Ia",)
    by_joint = ("inertia",)
    several = (JointKind.SPHERICAL,)
    from_files = FROM_FILES[name]


class _Viscous(JointEffect):
    """tau = -c v."""

    by_joint = ("coefficient",)
    several = (JointKind.SPHERICAL, JointKind.PLANAR, JointKind.FLOATING)

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
    symbols = ("Fv",)
    from_files = FROM_FILES[name]


@dataclass(frozen=True)
class Damper(_Viscous):
    """tau = -c v, in addition to the viscous friction of the robot's files.

    `coefficient`: c by joint [N s/m or N m s/rad].
    """

    coefficient: Numbers = field(default_factory=dict)
    name: ClassVar[str] = "damper"
    symbols = ("d",)


class DryFriction(JointEffect):
    """tau = -level tanh(v / width): friction whose direction alone is smoothed where the rate changes sign.

    Attributes:
        width: Where the sign is smoothed [m/s or rad/s], the last of its parameters.
    """

    width: float
    for_all = ("width",)

    def numbers(self, robot: HybridRobot) -> dict[str, tuple[float, ...]]:
        """Return the law's parameters by joint, but for the width."""
        positive(self.name, "width", self.width)
        return super().numbers(robot)

    @abstractmethod
    def size(self, p: Numerals, v: Array, sign: Array) -> Array:
        """Compute the size of friction, shape (T, k), at rates v and directions `sign` of them, (T, k)."""

    def effort(self, p: Numerals, x: Array, v: Array) -> Array:
        """Compute the friction effort."""
        sign = np.tanh(v / p[-1])
        return -self.size(p, v, sign) * sign


@dataclass(frozen=True)
class CoulombFriction(DryFriction):
    """tau = -f tanh(v / width): smoothed dry friction; a joint creeps under a load below f, but for stiction.

    A ball joint has it about each of its three axes, as MuJoCo's frictionloss.

    `level`: f by joint [N or N m]; None uses the friction of the robot's files. `width` [m/s or rad/s].
    Source: the usual smoothing, e.g. Andersson, Soderberg & Bjorklund (2007), Tribology Int. 40.
    """

    level: Numbers | None = None
    width: float = WIDTH
    name: ClassVar[str] = "coulomb_friction"
    symbols = ("Fc",)
    by_joint = ("level",)
    several = (JointKind.SPHERICAL,)
    from_files = FROM_FILES[name]

    def size(self, p: Numerals, v: Array, sign: Array) -> Array:
        """Return f."""
        return p[0]


@dataclass(frozen=True)
class StribeckFriction(DryFriction):
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
    symbols = ("Fc", "Fs")
    by_joint = ("level", "static", "speed")

    def numbers(self, robot: HybridRobot) -> dict[str, tuple[float, ...]]:
        """Return f, s, v_s by joint."""
        out = super().numbers(robot)
        for joint, (level, static, speed) in out.items():
            positive(self.name, f"speed of '{joint}'", speed)
            if static < level:
                raise ModelError(
                    f"{self.name}: joint '{joint}': static {static:g} is less than level {level:g}",
                    element=joint,
                )
        return out

    def size(self, p: Numerals, v: Array, sign: Array) -> Array:
        """Compute f + (s - f) exp(-(v / v_s)^2)."""
        return p[0] + (p[1] - p[0]) * np.exp(-((v / p[2]) ** 2))


@dataclass(frozen=True)
class DirectedFriction(DryFriction):
    """tau = -f tanh(v / width), with another level f for each direction: dry friction of seals and pawls.

    The level is (forward + backward) / 2 + (forward - backward) / 2 tanh(v / width).

    `forward`, `backward`: f at positive and at negative rates by joint [N or N m]; `width` [m/s or rad/s]. It
    replaces Coulomb friction: do not name both for one joint. Source: `CoulombFriction`, by direction.
    """

    forward: Numbers = field(default_factory=dict)
    backward: Numbers = field(default_factory=dict)
    width: float = WIDTH
    name: ClassVar[str] = "directed_friction"
    by_joint = ("forward", "backward")

    def size(self, p: Numerals, v: Array, sign: Array) -> Array:
        """Compute the level of each direction."""
        return (p[0] + p[1] + (p[0] - p[1]) * sign) / 2
