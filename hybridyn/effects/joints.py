"""Effects on joints: efforts tau(q, v), and the rotors' inertia.

Each effect (in `joint_laws`) is one law with its parameters by joint name. `placed` finds the joints in a
robot once and returns an `OnJoints`, which evaluates the law for a batch. Efforts act along the joint's rate.
Units are those of the joint: N, m, m/s for a prismatic joint, N m, rad, rad/s for the others.
"""

from abc import ABC
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ..description.names import did_you_mean, listed
from ..errors import ModelError
from ..joints.kinds import JointKind
from ..spatial import LARGEST, Array, Index, Mask
from ..structure.robot import HybridRobot

Numbers = Mapping[str, float]
Numerals = Sequence[Array]

#: Speed scale of the sign change of smoothed friction [m/s or rad/s]; it reaches 99.5 % at three widths.
WIDTH = 1e-2


class JointEffect(ABC):
    """A law of joint efforts; by default, it has none and stores no energy.

    Attributes:
        name: Name of the effect.
        by_joint: Its fields that hold a number by joint.
        for_all: Its fields that hold one number for all joints, which follow in the law's parameters.
        symbols: What identification calls its first numbers, in which the effort is linear; it finds none
            of a law without.
        from_files: Attribute of the files' joints that replaces the first field where this is None.
        several: Kinds of joints with several freedoms to which it applies, to each freedom alike.
        acts_on: What its numbers in files are by: "joint".
        coordinates: Number of a joint's coordinates that a position is computed from; 0 where that depends on
            its kind: an angle, or its cosine and sine.
    """

    name: ClassVar[str]
    by_joint: ClassVar[tuple[str, ...]]
    for_all: ClassVar[tuple[str, ...]] = ()
    symbols: ClassVar[tuple[str, ...]] = ()
    from_files: ClassVar[str] = ""
    several: ClassVar[tuple[JointKind, ...]] = ()
    coordinates: ClassVar[int] = 0
    acts_on: ClassVar[str] = "joint"

    def numbers(self, robot: HybridRobot) -> dict[str, tuple[float, ...]]:
        """Return the law's parameters by joint, but for those that all share.

        Raises:
            ModelError: They are invalid.
        """
        tables = [getattr(self, field) for field in self.by_joint]
        if tables[0] is not None:
            return given(self.name, *tables)
        stated = {j.joint.name: float(getattr(j.joint, self.from_files)) for j in robot.bodies.joints}
        return {name: (number,) for name, number in stated.items() if number}

    def fields(self, count: int) -> list[tuple[str, tuple[int, ...]]]:
        """Return the field, and the place in it, of each of `count` parameters by joint; "" for none."""
        return [(field, ()) for field in (*self.by_joint, *[""] * (count - len(self.by_joint)))]

    def by_freedom(self, values: tuple[float, ...], freedoms: int) -> list[tuple[float, ...]]:
        """Return the parameters of each freedom of a joint; by default all have the joint's."""
        return [values] * freedoms

    def position(self, p: Numerals, q: Sequence[Any]) -> Any:
        """Compute a position from coordinates: arrays or expressions, one, or a cosine and a sine."""
        return q[0] if len(q) == 1 else np.arctan2(q[1], q[0])

    def effort(self, p: Numerals, x: Array, v: Array) -> Array:
        """Compute the effort, shape (T, k), from parameters p, positions x and rates v (T, k)."""
        return np.zeros_like(v)

    def energy(self, p: Numerals, x: Array) -> Array:
        """Compute the stored energy, shape (T, k), [J]."""
        return np.zeros_like(x)

    def power(self, p: Numerals, x: Array, v: Array) -> Array:
        """Compute the dissipated power, shape (T, k), [W], never negative.

        It is that of the part of the effort that is zero at rest.
        """
        return (self.effort(p, x, np.zeros_like(v)) - self.effort(p, x, v)) * v


class OnJoints(NamedTuple):
    """A law applied to joints of one robot.

    Attributes:
        effect: The law.
        joints: Names of its joints.
        columns: Indices of their freedoms in v, shape (k,).
        at: Indices of their first coordinates in q, shape (k,).
        turns: Whether q holds cosine and sine there, shape (k,).
        p: The law's parameters, each of shape (k,).
    """

    effect: JointEffect
    joints: tuple[str, ...]
    columns: Index
    at: Index
    turns: Mask
    p: Numerals

    def positions(self, q: Array) -> Array:
        """Return joint positions, shape (T, k), [m or rad]; angles of continuous joints in [-pi, pi]."""
        if several := self.effect.coordinates:
            out: Array = self.effect.position(self.p, [q[:, self.at + i] for i in range(several)])
            return out
        x = q[:, self.at]
        if self.turns.any():
            x[:, self.turns] = np.arctan2(q[:, self.at[self.turns] + 1], x[:, self.turns])
        return x

    def reads(self, i: int) -> tuple[Index, Index]:
        """Return the indices in q and in v of what the effort on freedom i depends on."""
        count = self.effect.coordinates or 1 + bool(self.turns[i])
        return self.at[i] + np.arange(count), self.columns[i : i + 1]

    def written(self, i: int, p: Sequence[Any], q: Sequence[Any], v: Sequence[Any]) -> Any:
        """Write the effort on freedom i from its parameters and from what it `reads`, as expressions."""
        return self.effect.effort(p, self.effect.position(p, q), v[0])

    def effort(self, q: Array, v: Array) -> Array:
        """Compute the efforts, shape (T, k), from the robot's q and v."""
        return self.effect.effort(self.p, self.positions(q), v[:, self.columns])

    def energy(self, q: Array) -> Array:
        """Compute the stored energy, shape (T,), [J]."""
        out: Array = self.effect.energy(self.p, self.positions(q)).sum(axis=1)
        return out

    def power(self, q: Array, v: Array) -> Array:
        """Compute the dissipated power, shape (T,), [W]."""
        out: Array = self.effect.power(self.p, self.positions(q), v[:, self.columns]).sum(axis=1)
        return out


def placed(effect: JointEffect, robot: HybridRobot) -> OnJoints | None:
    """Find a law's joints in a robot; None if the law has no joints.

    Raises:
        ModelError: A joint is unknown, has several freedoms although the law is for one, or belongs to a
            cut wrist.
    """
    numbers = effect.numbers(robot)
    rows: list[tuple[float, ...]] = []  # column, place in q, whether it turns, parameters
    for name, values in numbers.items():
        index = joint_number(effect.name, robot, name)
        freedoms = robot.v_slices[index]
        if freedoms.stop - freedoms.start > 1 and (kind := robot.kinds[index]) not in effect.several:
            or_several = "".join(f" or be {known}" for known in effect.several)
            raise ModelError(
                f"{effect.name}: joint '{name}' is {kind}; it must have one freedom{or_several}", element=name
            )
        place = robot.q_slices[index].start, robot.kinds[index].endless
        each = effect.by_freedom(values, freedoms.stop - freedoms.start)
        shared = [float(getattr(effect, field)) for field in effect.for_all]
        rows += [(at, *place, *own, *shared) for at, own in enumerate(each, freedoms.start)]
    refuse_cut(effect.name, robot, numbers)
    if not rows:
        return None
    columns, at, turns, *p = np.array(rows, dtype=float).T
    return OnJoints(effect, tuple(numbers), columns.astype(int), at.astype(int), turns.astype(bool), p)


def joint_number(effect: str, robot: HybridRobot, name: str) -> int:
    """Return the number of a joint that an effect names.

    Raises:
        ModelError: The robot has no such movable joint.
    """
    if name not in robot.joint_index:
        known = [j for j in robot.joints if j in robot.body_of_joint]
        raise ModelError(f"{effect}: no such movable joint '{name}'{did_you_mean(name, known)}", element=name)
    return robot.joint_index[name]


def refuse_cut(effect: str, robot: HybridRobot, names: Iterable[str]) -> None:
    """Refuse joints of cut wrists.

    Raises:
        ModelError: Some of the joints that an effect names are of those.
    """
    if cut := [name for name in names if name in robot.cut_joints]:
        raise ModelError(
            f"{effect}: {listed(cut)} sit in wrists without mass, which were cut: load the robot with "
            f"held={cut[:3]!r}, or take it from hybridyn.with_effects(robot, effects)", element=cut[0],
        )  # fmt: skip


def given(effect: str, *tables: Numbers) -> dict[str, tuple[float, ...]]:
    """Combine tables of parameters by joint.

    Raises:
        ModelError: The tables do not name the same joints, or a number is negative or beyond `LARGEST`.
    """
    for table in tables[1:]:
        odd = sorted(set(table) ^ set(tables[0]))
        if odd:
            raise ModelError(f"{effect}: {listed(odd)} lack one of the law's numbers", element=odd[0])
    out = {name: tuple(float(table[name]) for table in tables) for name in tables[0]}
    for name, values in out.items():
        if not all(0 <= x <= LARGEST for x in values):
            raise ModelError(
                f"{effect}: joint '{name}' has {', '.join(f'{x:g}' for x in values)}; numbers must be "
                f"at most {LARGEST:g} and not negative", element=name,
            )  # fmt: skip
    return out


def positive(effect: str, what: str, value: float, *, or_zero: bool = False) -> None:
    """Check that a number is finite and positive, or zero if that is allowed.

    Raises:
        ModelError: It is not.
    """
    if not (np.isfinite(value) and (value > 0 or (or_zero and value == 0))):
        kind = "finite and not negative" if or_zero else "positive"
        raise ModelError(f"{effect}: {what} must be {kind}, not {value:g}")
