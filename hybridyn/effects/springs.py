"""Laws of joint efforts that depend on positions: springs and stops; and polynomials, of rates too."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from ..errors import ModelError
from ..joints.kinds import JointKind
from ..spatial import LARGEST, Array
from ..structure.robot import HybridRobot
from .joints import JointEffect, Numbers, Numerals, positive

#: Largest deviation of the squared length of a quaternion at rest from one.
UNIT_QUATERNION = 1e-6
#: Square of the sine of half a turn below which the turn is a series: the quotient loses digits there, 1e-16
#: over the sine, in its second derivative. What the series leaves out is below 1e-16 in the latter.
SMALL_TURN, TERMS = 1e-3, 7


@dataclass(frozen=True)
class Spring(JointEffect):
    """tau = -k (x - rest); for a continuous joint, x - rest is wrapped to [-pi, pi].

    `stiffness`: k by joint [N/m or N m/rad]. `rest`: position without force [m or rad], 0 by default.
    """

    stiffness: Numbers = field(default_factory=dict)
    rest: Numbers = field(default_factory=dict)
    name: ClassVar[str] = "spring"
    symbols = ("k",)
    by_joint = ("stiffness",)

    def fields(self, count: int) -> list[tuple[str, tuple[int, ...]]]:
        """Return those of k and rest."""
        return [("stiffness", ()), ("rest", ()), ("", ())]

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
        endless = {name for name, kind in zip(robot.joints, robot.kinds, strict=True) if kind.endless}
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


class _Polynomial(JointEffect):
    """A law whose numbers are c1, c2, ... by joint, of either sign."""

    by_joint = ("coefficients",)
    coefficients: Mapping[str, Sequence[float]]

    def fields(self, count: int) -> list[tuple[str, tuple[int, ...]]]:
        """Return those of the coefficients."""
        return [("coefficients", (i,)) for i in range(count)]

    def numbers(self, robot: HybridRobot) -> dict[str, tuple[float, ...]]:
        """Return the coefficients by joint, all of one number: zeros follow."""
        most = max(map(len, self.coefficients.values()), default=0)
        for joint, values in self.coefficients.items():
            if not all(abs(x) <= LARGEST for x in values):
                raise ModelError(
                    f"{self.name}: joint '{joint}' has {list(values)}; numbers must be finite", element=joint
                )
        return {
            joint: (*map(float, values), *[0.0] * (most - len(values)))
            for joint, values in self.coefficients.items()
        }


@dataclass(frozen=True)
class PolynomialSpring(_Polynomial):
    """tau = -(c1 s + c2 s^2 + ...), with s = x - rest: a spring whose stiffness depends on the position.

    `coefficients`: c1, c2, ... by joint [N/m, N/m^2, ... or N m/rad, ...]. `rest`: position without force
    [m or rad], 0 by default. Source: MuJoCo's `stiffness` of several numbers.
    """

    coefficients: Mapping[str, Sequence[float]] = field(default_factory=dict)
    rest: Numbers = field(default_factory=dict)
    name: ClassVar[str] = "polynomial_spring"

    def fields(self, count: int) -> list[tuple[str, tuple[int, ...]]]:
        """Return those of rest and coefficients."""
        return [("rest", ()), *super().fields(count - 1)]

    def numbers(self, robot: HybridRobot) -> dict[str, tuple[float, ...]]:
        """Return rest and coefficients by joint."""
        odd = sorted({*self.rest} - {*self.coefficients})
        if odd:
            raise ModelError(f"{self.name}: 'rest' names '{odd[0]}', 'coefficients' does not", element=odd[0])
        return {n: (float(self.rest.get(n, 0.0)), *c) for n, c in super().numbers(robot).items()}

    def effort(self, p: Numerals, x: Array, v: Array) -> Array:
        """Compute the effort."""
        s = x - p[0]
        total = 0.0 * s
        for coefficient in reversed(p[1:]):
            total = (total + coefficient) * s
        return -total

    def energy(self, p: Numerals, x: Array) -> Array:
        """Compute c1 s^2 / 2 + c2 s^3 / 3 + ..."""
        s = x - p[0]
        return np.asarray(sum(c * s ** (n + 1) / (n + 1) for n, c in enumerate(p[1:], 1)))


@dataclass(frozen=True)
class PolynomialDamper(_Polynomial):
    """tau = -(c1 v + c2 v |v| + c3 v^3 + ...): damping that depends on the speed, beside viscous friction.

    `coefficients`: c1, c2, ... by joint [N s/m, N s^2/m^2, ... or N m s/rad, ...]. A ball joint has it about
    each of its three axes. Source: MuJoCo's `damping` of several numbers.
    """

    coefficients: Mapping[str, Sequence[float]] = field(default_factory=dict)
    name: ClassVar[str] = "polynomial_damper"
    several = (JointKind.SPHERICAL,)

    def effort(self, p: Numerals, x: Array, v: Array) -> Array:
        """Compute the effort."""
        total, speed = 0.0 * v, np.fabs(v)
        for coefficient in reversed(p):
            total = total * speed + coefficient
        return -total * v


@dataclass(frozen=True)
class BallSpring(JointEffect):
    """tau = -k r, with r the rotation vector from the rest orientation: a spring of a ball joint.

    The turn is taken the short way, up to half a turn. `stiffness`: k by joint [N m/rad]. `rest`: quaternion
    x, y, z, w by joint, the identity by default. Source: MuJoCo's `stiffness` of ball joints.
    """

    stiffness: Numbers = field(default_factory=dict)
    rest: Mapping[str, Sequence[float]] = field(default_factory=dict)
    name: ClassVar[str] = "ball_spring"
    symbols = ("k",)
    by_joint = ("stiffness",)
    several = (JointKind.SPHERICAL,)
    coordinates = 4

    def numbers(self, robot: HybridRobot) -> dict[str, tuple[float, ...]]:
        """Return k and the rest orientation by joint.

        Raises:
            ModelError: A joint is no ball, or a quaternion has not length one.
        """
        kinds = dict(zip(robot.joints, robot.kinds, strict=True))
        out = {}
        for joint, (k,) in super().numbers(robot).items():
            rest = np.asarray(self.rest.get(joint, (0.0, 0.0, 0.0, 1.0)), dtype=float)
            if kinds.get(joint, JointKind.SPHERICAL) is not JointKind.SPHERICAL:
                raise ModelError(
                    f"{self.name}: joint '{joint}' is {kinds[joint]}; it must be spherical", element=joint
                )
            if rest.shape != (4,) or not abs(rest @ rest - 1) <= UNIT_QUATERNION:
                raise ModelError(
                    f"{self.name}: the rest orientation of '{joint}' must be a quaternion x, y, z, w of "
                    "length one", element=joint,
                )  # fmt: skip
            out[joint] = (k, *rest.tolist())
        if odd := sorted({*self.rest} - {*self.stiffness}):
            raise ModelError(f"{self.name}: 'rest' names '{odd[0]}', 'stiffness' does not", element=odd[0])
        return out

    def by_freedom(self, values: tuple[float, ...], freedoms: int) -> list[tuple[float, ...]]:
        """Return the parameters of each freedom: k, and the rows of r and of the cosine of half the turn."""
        k, x, y, z, w = values
        rows = [(w, z, -y, -x), (-z, w, x, -y), (y, -x, w, -z)]
        return [(k, *rows[i], *rows[(i + 1) % 3], *rows[(i + 2) % 3], x, y, z, w) for i in range(3)]

    def position(self, p: Numerals, q: Sequence[Any]) -> Any:
        """Compute a component of r."""
        own, next_, last, cosine = (
            sum(a * x for a, x in zip(p[at : at + 4], q, strict=True)) for at in (1, 5, 9, 13)
        )
        square = own * own + next_ * next_ + last * last
        small = 1.0 * (square < SMALL_TURN)
        sine, c = np.sqrt(square + small), np.fabs(cosine) + (1.0 - small)  # none is zero where it has no use
        tangent, series = small * square / (c * c), 0.0
        for k in reversed(range(TERMS)):
            series = 1.0 / (2 * k + 1) - tangent * series
        half = small * series / c + (1.0 - small) * np.arctan2(sine, np.fabs(cosine)) / sine
        return 2.0 * own * half * (1.0 - 2.0 * (cosine < 0.0))

    def effort(self, p: Numerals, x: Array, v: Array) -> Array:
        """Compute -k r."""
        return -p[0] * x

    def energy(self, p: Numerals, x: Array) -> Array:
        """Compute k r^2 / 2."""
        return 0.5 * p[0] * x**2


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
    symbols = ("k_stop",)
    by_joint = ("stiffness",)
    for_all = ("damping",)

    def fields(self, count: int) -> list[tuple[str, tuple[int, ...]]]:
        """Return those of k and the limits."""
        return [("stiffness", ()), ("lower", ()), ("upper", ())]

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
        push_low = low * np.maximum(1.0 - p[3] * v, 0.0)
        push_high = high * np.maximum(1.0 + p[3] * v, 0.0)
        out: Array = p[0] * (push_low - push_high)
        return out

    def energy(self, p: Numerals, x: Array) -> Array:
        """Compute k d^2 / 2."""
        out: Array = 0.5 * p[0] * (np.maximum(p[1] - x, 0.0) ** 2 + np.maximum(x - p[2], 0.0) ** 2)
        return out
