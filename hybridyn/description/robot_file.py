"""Define the result of a format's reader; motors, home posture and checks complete it to a `Description`."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

from .records import Closure, Coupling, Format, Joint, JointKind, Link, StatedBase

MotorSource = Literal["side-car", "model file", "actuator", "transmission", "independent", "names"]


#: Number of freedoms of a joint, by its kind.
FREEDOMS: dict[JointKind, int] = {
    "fixed": 0,
    "revolute": 1,
    "continuous": 1,
    "prismatic": 1,
    "spherical": 3,
    "planar": 3,
    "floating": 6,
}
#: Coordinates of a joint at zero, by its kind, as in Pinocchio: unlimited angles are cosine and sine.
ZERO: dict[str, tuple[float, ...]] = {
    "revolute": (0.0,),
    "continuous": (1.0, 0.0),
    "prismatic": (0.0,),
    "spherical": (0.0, 0.0, 0.0, 1.0),
    "planar": (0.0, 0.0, 1.0, 0.0),
    "floating": (0.0,) * 6 + (1.0,),
}


class MotorStatement(NamedTuple):
    """A list of driven joints that some file states.

    Attributes:
        source: Kind of the source; `motors.py` ranks the kinds.
        where: The source in words, for `info` and messages ("URDF <transmission>").
        names: Names of joints as the author wrote them.
        file: Path of the file.
        line: Line in the file, or None.
        refusal: Why the list cannot be used, an error only if no other list ranks higher; "" if it can.
    """

    source: MotorSource
    where: str
    names: tuple[str, ...]
    file: str
    line: int | None = None
    refusal: str = ""


@dataclass(eq=False)
class RobotFile:
    """The content of a robot file, to which side-cars may still add.

    Attributes:
        name: Name of the robot.
        file: Path of the file, for messages.
        links: Links in file order.
        joints: Joints of the spanning tree in file order.
        closures: Loop closures.
        couplings: Couplings.
        motors: Every list of motors that the file states.
        notes: Remarks for the user.
        effects: Physical effects that the files state, as in `Description`.
        home: Home posture that the robot file states, as in `Description`; model.toml ranks higher.
        base: As in `Description`.
        base_home: As in `Description`.
        gravity: As in `Description`.
        format: As in `Description`.
        crossed: As in `Description`.
        left_out: As in `Description`.
        undriven: Names of joints that no rule takes for motors, because they let a body move freely.
    """

    name: str
    file: str
    links: list[Link] = field(default_factory=list)
    joints: list[Joint] = field(default_factory=list)
    closures: list[Closure] = field(default_factory=list)
    couplings: list[Coupling] = field(default_factory=list)
    motors: list[MotorStatement] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    effects: tuple[tuple[str, dict[str, Any]], ...] = ()
    home: dict[str, tuple[float, ...]] = field(default_factory=dict)
    base: StatedBase = "fixed"
    base_home: tuple[float, ...] | None = None
    gravity: tuple[float, float, float] | None = None
    format: Format = "URDF"
    crossed: dict[str, tuple[float, float]] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()
    undriven: set[str] = field(default_factory=set)
