"""Effects on joints that store energy: rotors, springs and stops."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from ..errors import ModelError
from ..spatial import LARGEST, Array
from .joints import JointEffect, Numbers, Numerals, given

if TYPE_CHECKING:
    from ..structure.robot import HybridRobot


@dataclass(frozen=True)
class RotorInertia(JointEffect):
    """Inertia of the motors' rotors at the joints, J n^2 on the diagonal of A, without gyroscopic terms.

    It acts through accelerations, without an effort of its own; its energy is kinetic.

    `inertia`: J n^2 by joint [kg or kg m^2]; None uses rotor inertia and gear ratio of the robot's files.
    Source: Featherstone (2008), section 9.6.
    """

    inertia: Numbers | None = None
    name: ClassVar[str] = "rotor_inertia"

    def numbers(self, robot: HybridRobot) -> dict[str, tuple[float, ...]]:
        """Return J n^2 by joint."""
        if self.inertia is not None:
            return given(self.name, self.inertia)
        joints = (j.joint for j in robot.bodies.joints)
        return {j.name: (j.rotor_inertia * j.gear_ratio**2,) for j in joints if j.rotor_inertia}


@dataclass(frozen=True)
class Spring(JointEffect):
    """tau = -k (x - rest); for a continuous joint, x - rest is wrapped to [-pi, pi].

    `stiffness`: k by joint [N/m or N m/rad]. `rest`: position without force [m or rad], 0 by default.
    """

    stiffness: Numbers = field(default_factory=dict)
    rest: Numbers = field(default_factory=dict)
    name: ClassVar[str] = "spring"

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
        known = given(self.name, self.stiffness)
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

    def numbers(self, robot: HybridRobot) -> dict[str, tuple[float, ...]]:
        """Return k, lower and upper limit by joint."""
        if not (np.isfinite(self.damping) and self.damping >= 0):
            raise ModelError(f"{self.name}: damping must be finite and not negative, not {self.damping:g}")
        record = {j.joint.name: j.joint for j in robot.bodies.joints}
        out: dict[str, tuple[float, ...]] = {}
        for joint, (stiffness,) in given(self.name, self.stiffness).items():
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

    def power(self, p: Numerals, x: Array, v: Array) -> Array:
        """Compute the power dissipated: the power absorbed minus the rate of the stored energy."""
        elastic = p[0] * (np.maximum(p[1] - x, 0.0) - np.maximum(x - p[2], 0.0))
        out: Array = (elastic - self.effort(p, x, v)) * v
        return out
