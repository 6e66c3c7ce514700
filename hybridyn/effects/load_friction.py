"""Friction that grows with the load that a joint carries; `dynamics.load_friction` solves for it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce
from operator import add
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ..errors import ModelError
from ..joints.kinds import JointKind
from ..spatial import Array, Index
from ..structure.parameters.effect_numbers import LOAD_FRICTION
from ..structure.robot import HybridRobot
from .joints import WIDTH, Numbers, given, joint_number, positive, refuse_cut


@dataclass(frozen=True)
class LoadFriction:
    """Dry friction in proportion to the wrench that a joint transmits, smoothed like Coulomb friction.

    A hinge or a screw has the effort -(radial |F_radial| + axial |F_axial| + tilt |M_tilt|) tanh(v / width),
    a slide -(normal |F_normal| + tilt |M|) tanh(v / width), and a ball joint radial |F| tanh(|w| / width)
    against its angular velocity w. F and M are those of `Reactions.joints`: radial, normal and tilt are at
    right angles to the joint's axis. Near rest it is larger where `static` and `speed` say so: by the factor
    1 + (static - 1) exp(-(v / speed)^2), as in the models of servos by Duclusaud & Passault (2024).

    `radial`, `axial`: friction coefficient times radius of the bearing, by joint [m]; `tilt`: by joint,
    without unit for hinges and balls, [1/m] for slides; `normal`: friction coefficient of a slide, by joint;
    `static`: friction near rest over that at speed, 1 or more, by joint; `speed`: its Stribeck velocity, by
    joint, and `width` [m/s or rad/s]. Source: the laws of plain bearings, e.g. Harris & Kotzalas (2006),
    chapter 10.
    """

    radial: Numbers = field(default_factory=dict)
    axial: Numbers = field(default_factory=dict)
    tilt: Numbers = field(default_factory=dict)
    normal: Numbers = field(default_factory=dict)
    static: Numbers = field(default_factory=dict)
    speed: Numbers = field(default_factory=dict)
    width: float = WIDTH
    name: ClassVar[str] = "load_friction"

    @property
    def joints(self) -> frozenset[str]:
        """Names of the joints with a coefficient."""
        return frozenset({*self.radial, *self.axial, *self.tilt, *self.normal})


class OnLoads(NamedTuple):
    """The law applied to joints of one robot.

    Attributes:
        effect: The law.
        joints: Names of its joints.
        freedoms: For each joint, its freedoms in v.
        of_joint: For each term of the law, the number of its joint among `joints`.
        factor: Coefficient of each term.
        part: What a term takes from the wrench of its joint, shape (terms, 3, 6).
        words: Name of each term's coefficient.
        rise, speed: By how much friction is larger at rest, and the Stribeck velocity, shape (joints,).
    """

    effect: LoadFriction
    joints: tuple[str, ...]
    freedoms: tuple[slice, ...]
    of_joint: Index
    factor: Array
    part: Array
    words: tuple[str, ...]
    rise: Array
    speed: Array

    def directions(self, v: Array) -> Array:
        """Compute each joint's effort per unit of friction, shape (T, nv, joints), from rates (T, nv)."""
        out = np.zeros((*v.shape, len(self.joints)))
        for i, at in enumerate(self.freedoms):
            out[:, at, i] = np.stack(
                against(v[:, at].T, self.effect.width, self.rise[i], self.speed[i]), axis=1
            )
        return out

    def sizes(self, wrenches: Array) -> Array:
        """Compute the friction of each joint, shape (..., joints), from wrenches, shape (..., joints, 6)."""
        return self._by_joint(self.factor * length(np.moveaxis(self._parts(wrenches), -1, 0)))

    def slopes(self, wrenches: Array) -> Array:
        """Compute the derivative of the friction of each joint by its wrench, shape (..., joints, 6)."""
        along = np.stack(direction(np.moveaxis(self._parts(wrenches), -1, 0)), axis=-1)
        each = self.factor[:, None] * np.einsum("...ki,kij->...kj", along, self.part)
        return np.moveaxis(self._by_joint(np.moveaxis(each, -1, 0)), 0, -1)

    def between(self, joints: Index, wrenches: Array) -> Array:
        """Compute by how much the friction of joints changes at most, shape (T, joints, k).

        Args:
            joints: Numbers of some joints.
            wrenches: Columns of changes of their wrenches, shape (T, joints, 6, k).
        """
        terms, at = self._among(joints)
        parts = np.einsum("kij,tkjs->tkis", self.part[terms], wrenches[:, at])
        sizes = self.factor[terms][:, None] * np.linalg.norm(parts, axis=2)
        out = np.zeros((len(wrenches), len(joints), sizes.shape[2]))
        for term, joint in enumerate(at):
            out[:, joint] += sizes[:, term]
        return out

    def lipschitz(self, joints: Index, wrenches: Array, weight: Array) -> Array:
        """Compute rows whose length bounds the change of friction of joints, each over its weight.

        Args:
            joints: Numbers of some joints.
            wrenches: Columns of changes of their wrenches, shape (T, joints, 6, k).
            weight: Shape (T, joints).

        Returns:
            Shape (T, 3 terms, k). A joint of m terms has |sum of f |P w|| <= sqrt(m sum of f^2 |P w|^2).
        """
        terms, at = self._among(joints)
        factor = self.factor[terms] * np.sqrt(np.bincount(at, minlength=len(joints)))[at]
        parts = np.einsum("kij,tkjs->tkis", factor[:, None, None] * self.part[terms], wrenches[:, at])
        shape = len(wrenches), 3 * len(terms), wrenches.shape[3]
        out: Array = (parts / weight[:, at, None, None]).reshape(shape)
        return out

    def _among(self, joints: Index) -> tuple[Index, Index]:
        """Return the terms of some joints, and for each the number of its joint among these."""
        terms = np.flatnonzero(np.isin(self.of_joint, joints))
        return terms, np.searchsorted(joints, self.of_joint[terms])

    def _parts(self, wrenches: Array) -> Array:
        """Compute the part of the wrench that each term takes, shape (..., terms, 3)."""
        out: Array = np.einsum("kij,...kj->...ki", self.part, wrenches[..., self.of_joint, :])
        return out

    def _by_joint(self, terms: Array) -> Array:
        """Sum terms, shape (..., terms), by joint, shape (..., joints)."""
        out = np.zeros((*terms.shape[:-1], len(self.joints)))
        for k, joint in enumerate(self.of_joint):
            out[..., joint] += terms[..., k]
        return out


#: Added to the square of a length that divides, so that a vector of zeros has no direction, also in single
#: precision; far below the squares of rates [rad/s] and of loads [N, N m] that matter.
NO_LENGTH = 1e-30


def larger(rise: Any, rate: Any, speed: Any) -> Any:
    """Compute friction at a rate over that far from rest.

    This and the next three run on numbers and symbols.
    """
    return 1.0 + rise * np.exp(-((rate / speed) ** 2))


def against(v: Array | Sequence[Any], width: Any, rise: Any, speed: Any) -> list[Any]:
    """Return the efforts over a joint's freedoms per unit of its friction, from its rates v.

    Args:
        width, rise, speed: As of `OnLoads`.
    """
    rate = v[0] if len(v) == 1 else np.sqrt(_square(v) + NO_LENGTH)
    slope = -np.tanh(rate / width) * larger(rise, rate, speed)
    return [slope] if len(v) == 1 else [x * (slope / rate) for x in v]


def length(part: Array | Sequence[Any]) -> Any:
    """Return the length of a part of a wrench, to which the friction of its term is in proportion."""
    return np.abs(part[0]) if len(part) == 1 else np.sqrt(_square(part))


def direction(part: Array | Sequence[Any]) -> list[Any]:
    """Return the derivative of `length` by the part, which vanishes where the part does."""
    if len(part) == 1:
        return [np.sign(part[0])]
    size = np.sqrt(_square(part) + NO_LENGTH)
    return [x / size for x in part]


def _square(x: Array | Sequence[Any]) -> Any:
    """Return the sum of the squares of some numbers."""
    return reduce(add, [y * y for y in x])


def coefficients(effect: LoadFriction) -> dict[str, Numbers]:
    """Return the tables of a law's friction coefficients, by their names."""
    return {word: getattr(effect, word) for word in LOAD_FRICTION}


def on_loads(effect: LoadFriction, robot: HybridRobot) -> OnLoads | None:
    """Find the law's joints in a robot; None if it has none.

    Raises:
        ModelError: A joint is unknown or of a kind without this coefficient, or a number is negative.
    """
    positive(effect.name, "width", effect.width)
    tables = coefficients(effect)
    terms: list[tuple[str, str, float, Array]] = []
    for word, table in tables.items():
        for name, (factor,) in given(f"{effect.name}: {word}", table).items():
            number = joint_number(effect.name, robot, name)
            part = load_parts(robot, name).get(word)
            if part is None:
                raise ModelError(
                    f"{effect.name}: joint '{name}' is {robot.kinds[number]}; it has no '{word}'",
                    element=name,
                )
            if factor:
                terms.append((name, word, factor, part))
    near_rest = _near_rest(effect)
    if not terms:
        return None
    joints = tuple(dict.fromkeys(name for name, *_ in terms))
    refuse_cut(effect.name, robot, joints)
    names, words, factors, parts = zip(*terms, strict=True)
    freedoms = tuple(robot.v_slices[robot.joint_index[name]] for name in joints)
    of_joint = np.array([joints.index(name) for name in names])
    rise, speed = np.array([near_rest.get(name, (0.0, 1.0)) for name in joints]).T
    return OnLoads(effect, joints, freedoms, of_joint, np.array(factors), np.array(parts), words, rise, speed)


def _near_rest(effect: LoadFriction) -> dict[str, tuple[float, float]]:
    """Return by how much friction is larger at rest, and the Stribeck velocity, by joint.

    Raises:
        ModelError: A joint has one of the numbers alone or no friction, or a number is out of its range.
    """
    stated = given(f"{effect.name}: static, speed", effect.static, effect.speed)
    for name, (static, speed) in stated.items():
        if name not in effect.joints:
            raise ModelError(f"{effect.name}: '{name}' has a static part and no friction", element=name)
        positive(effect.name, f"speed of '{name}'", speed)
        if static < 1:
            raise ModelError(
                f"{effect.name}: joint '{name}': static {static:g} is below 1, the friction at speed",
                element=name,
            )
    return {name: (static - 1, speed) for name, (static, speed) in stated.items()}


def load_parts(robot: HybridRobot, name: str) -> Mapping[str, Array]:
    """Return the parts of a joint's wrench that load its bearing, (3, 6), by the coefficient's name."""
    kind, (force, moment) = robot.kinds[robot.joint_index[name]], np.split(np.eye(6), 2)
    if kind is JointKind.SPHERICAL:
        return {"radial": force}
    if not kind.single:
        return {}
    axis = robot.records[name].axis
    along = np.outer(axis, axis)
    across = np.eye(3) - along
    if kind.slides:
        return {"normal": across @ force, "tilt": moment}
    return {"radial": across @ force, "axial": along @ force, "tilt": across @ moment}
