"""Effects on joints that dissipate energy: friction laws and dampers."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from ..errors import ModelError
from ..spatial import Array
from .joints import WIDTH, JointEffect, Numbers, Numerals, given, positive, stated

if TYPE_CHECKING:
    from ..structure.robot import HybridRobot


class Dissipative(JointEffect):
    """Base of friction laws: all work of the effort is dissipated."""

    def power(self, p: Numerals, x: Array, v: Array) -> Array:
        """Compute -tau v, shape (T, k), [W]."""
        return -self.effort(p, x, v) * v


@dataclass(frozen=True)
class ViscousFriction(Dissipative):
    """tau = -c v.

    `coefficient`: c by joint [N s/m or N m s/rad]; None uses the damping of the robot's files.
    """

    coefficient: Numbers | None = None
    name: ClassVar[str] = "viscous_friction"
    any_freedoms: ClassVar[bool] = True

    def numbers(self, robot: HybridRobot) -> dict[str, tuple[float, ...]]:
        """Return c by joint."""
        return stated(robot, "damping") if self.coefficient is None else given(self.name, self.coefficient)

    def effort(self, p: Numerals, x: Array, v: Array) -> Array:
        """Return -c v."""
        return -p[0] * v


@dataclass(frozen=True)
class CoulombFriction(Dissipative):
    """tau = -f tanh(v / width): smoothed dry friction without stiction; a joint creeps under a load below f.

    `level`: f by joint [N or N m]; None uses the friction of the robot's files. `width` [m/s or rad/s].
    Source: the usual smoothing, e.g. Andersson, Soderberg & Bjorklund (2007), Tribology Int. 40.
    """

    level: Numbers | None = None
    width: float = WIDTH
    name: ClassVar[str] = "coulomb_friction"

    def numbers(self, robot: HybridRobot) -> dict[str, tuple[float, ...]]:
        """Return f by joint."""
        positive(self.name, "width", self.width)
        return stated(robot, "friction") if self.level is None else given(self.name, self.level)

    def effort(self, p: Numerals, x: Array, v: Array) -> Array:
        """Compute -f tanh(v / width)."""
        return -p[0] * np.tanh(v / self.width)


@dataclass(frozen=True)
class StribeckFriction(Dissipative):
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

    def numbers(self, robot: HybridRobot) -> dict[str, tuple[float, ...]]:
        """Return f, s, v_s by joint."""
        positive(self.name, "width", self.width)
        out = given(self.name, self.level, self.static, self.speed)
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
class Damper(Dissipative):
    """tau = -c v, in addition to the viscous friction of the robot's files.

    `coefficient`: c by joint [N s/m or N m s/rad].
    """

    coefficient: Numbers = field(default_factory=dict)
    name: ClassVar[str] = "damper"
    any_freedoms: ClassVar[bool] = True

    def numbers(self, robot: HybridRobot) -> dict[str, tuple[float, ...]]:
        """Return c by joint."""
        return given(self.name, self.coefficient)

    def effort(self, p: Numerals, x: Array, v: Array) -> Array:
        """Return -c v."""
        return -p[0] * v
