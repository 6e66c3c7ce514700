"""The kinds of joints. A joint shifts its child along zero to three axes, and turns it; all else follows.

| kind | shift | turn | coordinates q | freedoms v |
|---|---|---|---|---|
| revolute | | angle | angle | wz |
| continuous | | circle | cosine, sine | wz |
| prismatic | along its axis | | way | vz |
| screw | pitch x angle | angle | angle | wz |
| spherical | | ball | quaternion x, y, z, w | wx, wy, wz |
| planar | x, y | circle | x, y, cosine, sine | vx, vy, wz |
| floating | x, y, z | ball | x, y, z, quaternion | vx, vy, vz, wx, wy, wz |

Coordinates and freedoms are Pinocchio's: q places the child in the joint's frame, v is its twist in its own
axes. "z" is the joint's axis where it has one.
"""

from __future__ import annotations

from enum import Enum, StrEnum
from functools import cached_property
from typing import Literal

#: What a closure holds of the rotation, as in `description.records.Closure`.
RotationKind = Literal["free", "perpendicular", "parallel", "fixed"]
#: Names of coordinates in tables.
LENGTHS, QUATERNION, SPIN, YAW = ("x", "y", "z"), ("qx", "qy", "qz", "qw"), ("wx", "wy", "wz"), "yaw"


class Turn(Enum):
    """How a joint turns its child: the coordinates at zero, and the number of freedoms."""

    NONE = (), 0
    ANGLE = (0.0,), 1
    CIRCLE = (1.0, 0.0), 1
    BALL = (0.0, 0.0, 0.0, 1.0), 3

    def __init__(self, zero: tuple[float, ...], nv: int) -> None:
        self.zero, self.nv = zero, nv


class JointKind(StrEnum):
    """A kind of joint; it equals its own name."""

    FIXED = "fixed"
    REVOLUTE = "revolute"
    CONTINUOUS = "continuous"
    PRISMATIC = "prismatic"
    SCREW = "screw"
    SPHERICAL = "spherical"
    PLANAR = "planar"
    FLOATING = "floating"

    @cached_property
    def shift(self) -> int:
        """Number of leading coordinates [m] that shift the child before it turns.

        One shifts it along its axis, two in x and y, three in x, y and z.
        """
        return _FORMS[self][0]

    @cached_property
    def turn(self) -> Turn:
        """How the other coordinates turn the child."""
        return _FORMS[self][1]

    @cached_property
    def letter(self) -> str:
        """Its letter in chains of joints: R R P."""
        return _FORMS[self][2]

    @cached_property
    def zero(self) -> tuple[float, ...]:
        """Coordinates at zero, as in Pinocchio: unlimited angles are cosine and sine."""
        return (0.0,) * self.shift + self.turn.zero

    @cached_property
    def nq(self) -> int:
        """Number of coordinates."""
        return len(self.zero)

    @cached_property
    def nv(self) -> int:
        """Number of freedoms."""
        return self.shift + self.turn.nv

    @cached_property
    def single(self) -> bool:
        """Whether it has one freedom, and so an axis."""
        return self.nv == 1

    @cached_property
    def additive(self) -> bool:
        """Whether its position is one number to which a displacement is added."""
        return self.nq == self.nv == 1

    @cached_property
    def slides(self) -> bool:
        """Whether its one freedom is a length."""
        return self.single and self.shift == 1

    @cached_property
    def hinge(self) -> bool:
        """Whether it turns about its axis and does nothing else."""
        return self.single and self is not JointKind.SCREW and not self.shift

    @cached_property
    def endless(self) -> bool:
        """Whether its one position is an angle that does not count turns."""
        return self.single and self.turn is Turn.CIRCLE

    @cached_property
    def ball(self) -> bool:
        """Whether its last four coordinates are a quaternion."""
        return self.turn is Turn.BALL

    @property
    def closure(self) -> tuple[tuple[int, ...], RotationKind] | None:
        """Axes without translation, and rotation, of a closure with its freedoms; None for a screw."""
        held = {1: (0, 1), 2: (2,), 3: ()}.get(self.shift, (0, 1, 2))
        turning: dict[Turn, RotationKind] = {Turn.NONE: "fixed", Turn.BALL: "free"}
        return None if self is JointKind.SCREW else (held, turning.get(self.turn, "parallel"))

    @property
    def columns(self) -> list[int]:
        """Entries of the twist that are the rates, where the axis is z; a screw's turn."""
        shifts = (2,) if self.shift == 1 else range(self.shift)
        turns = {Turn.NONE: (), Turn.BALL: (3, 4, 5)}.get(self.turn, (5,))
        return [*shifts, *turns]

    @property
    def parts(self) -> dict[str, JointKind]:
        """Joints with its freedoms, one behind the other, by the ending of their names."""
        if self is JointKind.SPHERICAL:
            return dict.fromkeys(("_x", "_y", "_z"), JointKind.REVOLUTE)
        out = dict.fromkeys(("_x", "_y", "_z")[: self.shift], JointKind.PRISMATIC)
        if self.turn is not Turn.NONE:
            out["_turn"] = JointKind.SPHERICAL if self.ball else JointKind.REVOLUTE
        return out

    @property
    def places(self) -> tuple[str, ...]:
        """Names of the parts of its position in tables; one nameless number for one freedom."""
        turns = {Turn.NONE: (), Turn.BALL: QUATERNION}.get(self.turn, (YAW,))
        return ("",) if self.single else (*LENGTHS[: self.shift], *turns)

    @property
    def rates(self) -> tuple[str, ...]:
        """Names of the parts of its velocity in tables, as `places`."""
        return ("",) if self.single else tuple((*LENGTHS, *SPIN)[at] for at in self.columns)

    @property
    def unit(self) -> str:
        """Unit of its one position."""
        return "m" if self.slides else "rad"

    @property
    def effort_unit(self) -> str:
        """Unit of its one effort."""
        return "N" if self.slides else "N m"


_FORMS: dict[JointKind, tuple[int, Turn, str]] = {
    JointKind.FIXED: (0, Turn.NONE, ""),
    JointKind.REVOLUTE: (0, Turn.ANGLE, "R"),
    JointKind.CONTINUOUS: (0, Turn.CIRCLE, "R"),
    JointKind.PRISMATIC: (1, Turn.NONE, "P"),
    JointKind.SCREW: (0, Turn.ANGLE, "H"),
    JointKind.SPHERICAL: (0, Turn.BALL, "S"),
    JointKind.PLANAR: (2, Turn.CIRCLE, "E"),
    JointKind.FLOATING: (3, Turn.BALL, "F"),
}
