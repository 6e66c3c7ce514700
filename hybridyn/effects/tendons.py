"""Tendons over joints: springs, dampers and dry friction along sums of joint positions."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ..errors import ModelError
from ..spatial import Array, Index
from ..structure.robot import HybridRobot
from .joints import WIDTH, Numbers, joint_number, positive, refuse_cut
from .lengths import WORDS, check_numbers, stretch, tension


@dataclass(frozen=True)
class Tendons:
    """Springs, dampers and dry friction along tendons; the length of one is a sum of arm x joint position.

    The force along a tendon of length l is -k (l - upper) above `upper` and -k (l - lower) below `lower`,
    less c l_dot and f tanh(l_dot / width). It acts on each joint by its arm.

    `arms`: by joint, its arm in each tendon [1, m or m/rad]; `stiffness`: k, `damping`: c, `friction`: f,
    `lower` and `upper`: lengths between which the spring is slack, all by tendon, 0 by default; `width`
    [m/s or rad/s]. Every joint has one freedom and counts turns.
    Source: MuJoCo's fixed tendons, with smoothed friction.
    """

    arms: Mapping[str, Mapping[str, float]]
    stiffness: Numbers = field(default_factory=dict)
    damping: Numbers = field(default_factory=dict)
    friction: Numbers = field(default_factory=dict)
    lower: Numbers = field(default_factory=dict)
    upper: Numbers = field(default_factory=dict)
    width: float = WIDTH
    name: ClassVar[str] = "tendons"

    @property
    def tendons(self) -> list[str]:
        """Names of the tendons, in the order in which arms name them."""
        return list(dict.fromkeys(tendon for arms in self.arms.values() for tendon in arms))

    def numbers(self, robot: HybridRobot) -> dict[str, tuple[float, ...]]:
        """Return the joints; each has the numbers of no tendon of its own.

        Raises:
            ModelError: Numbers are invalid.
        """
        positive(self.name, "width", self.width)
        tables = {what: getattr(self, what) for what in WORDS}
        check_numbers(self.name, "tendon", self.tendons, "arm", tables, signed=("lower", "upper"))
        return dict.fromkeys(self.arms, ())

    def force(self, p: Any, length: Any, rate: Any) -> Any:
        """Compute the force along a tendon from its numbers, see `lengths.tension`, and the width."""
        return -tension(p[:5], p[5], length, rate)


class OnTendons(NamedTuple):
    """Tendons of one robot, as `joints.OnJoints`.

    Attributes:
        effect: The law.
        joints: Names of the joints.
        columns: Indices of their freedoms in v, shape (k,).
        at: Indices of their positions in q, shape (k,).
        arms: Arm of each joint in each tendon, shape (k, tendons).
        own: Numbers of each tendon: stiffness, damping, friction, lower, upper, width; shape (6, tendons).
    """

    effect: Tendons
    joints: tuple[str, ...]
    columns: Index
    at: Index
    arms: Array
    own: Array

    @property
    def fields(self) -> list[tuple[str, str]]:
        """Tendon and key of each number of `p`, empty for arms."""
        tendons = self.effect.tendons
        arms = [("", "")] * len(tendons)
        own = [(name, word) for word in (*WORDS, "width") for name in tendons]
        return [*arms, *own, *arms * len(self.columns)]

    @property
    def p(self) -> Sequence[Array]:
        """All numbers that the effort on a freedom depends on, each of shape (k,)."""
        every = np.concatenate([self.own.ravel(), self.arms.ravel()])
        return [*self.arms.T, *np.tile(every[:, None], len(self.columns))]

    def reads(self, i: int) -> tuple[Index, Index]:
        """Return the indices in q and in v of what the effort on freedom i depends on."""
        return self.at, self.columns

    def written(self, i: int, p: Sequence[Any], q: Sequence[Any], v: Sequence[Any]) -> Any:
        """Write the effort on freedom i from its numbers and from what it `reads`, as expressions."""
        count, total = self.own.shape[1], 0.0
        own, arms = p[count : 7 * count], p[7 * count :]
        for t in range(count):
            length, rate = (sum(arms[j * count + t] * x for j, x in enumerate(xs)) for xs in (q, v))
            total = total + p[t] * self.effect.force(own[t::count], length, rate)
        return total

    def effort(self, q: Array, v: Array) -> Array:
        """Compute the efforts, shape (T, k), from the robot's q and v."""
        out: Array = self.effect.force(self.own, *self._along(q, v)) @ self.arms.T
        return out

    def energy(self, q: Array) -> Array:
        """Compute the stored energy, shape (T,), [J]."""
        k, _, _, lower, upper, _ = self.own
        out: Array = (0.5 * k * stretch(lower, upper, q[:, self.at] @ self.arms) ** 2).sum(axis=1)
        return out

    def power(self, q: Array, v: Array) -> Array:
        """Compute the dissipated power, shape (T,), [W]."""
        length, rate = self._along(q, v)
        still = self.effect.force(self.own, length, 0.0 * rate)
        out: Array = ((still - self.effect.force(self.own, length, rate)) * rate).sum(axis=1)
        return out

    def _along(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Compute lengths and rates of the tendons, shape (T, tendons) each."""
        return q[:, self.at] @ self.arms, v[:, self.columns] @ self.arms


def on_tendons(effect: Tendons, robot: HybridRobot) -> OnTendons | None:
    """Find the joints of tendons in a robot; None if there is none.

    Raises:
        ModelError: A joint is unknown, does not have one freedom that counts turns, or was cut.
    """
    joints = tuple(effect.numbers(robot))
    for name in joints:
        kind = robot.kinds[joint_number(effect.name, robot, name)]
        if not kind.additive:
            raise ModelError(
                f"{effect.name}: joint '{name}' is {kind}; it must be revolute or prismatic",
                element=name,
            )
    refuse_cut(effect.name, robot, joints)
    if not joints:
        return None
    tendons = effect.tendons
    own = [[getattr(effect, word).get(tendon, 0.0) for tendon in tendons] for word in WORDS]
    own.append([effect.width] * len(tendons))
    arms = [[effect.arms[joint].get(tendon, 0.0) for tendon in tendons] for joint in joints]
    numbers = [robot.joint_index[joint] for joint in joints]
    columns, at = (np.array([where[n].start for n in numbers]) for where in (robot.v_slices, robot.q_slices))
    return OnTendons(effect, joints, columns, at, np.array(arms), np.array(own))
