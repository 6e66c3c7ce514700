"""Define the plain data of robots: links, joints, closures, couplings, motors, home posture.

A format's reader returns a `RobotFile`; motors, home posture and checks complete it to a `Description`.

This module computes no dynamics and depends on no file format. Units are SI. A *placement* is a (4, 4)
homogeneous matrix, "frame B in A": it holds the coordinates of B's axes and origin in A.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..joints.kinds import JointKind, RotationKind

if TYPE_CHECKING:  # few robots have closures of other packages
    from .residuals import Residual

Array = NDArray[np.float64]

StatedBase = Literal["fixed", "floating"]
Format = Literal["URDF", "MJCF", "Pinocchio", "USD", "SDF", "added"]


@dataclass(frozen=True, eq=False)
class Link:
    """A rigid body as its file states it.

    Attributes:
        name: Name of the link.
        mass: Mass [kg], 0 if the file states no inertial.
        com: Centre of mass, shape (3,), [m], link frame.
        inertia: Inertia about the centre of mass, shape (3, 3), [kg m^2], link axes.
        line: Line in the file, or None.
        between_joints: Whether the reader made it as a frame between the joints of one body.
    """

    name: str
    mass: float
    com: Array
    inertia: Array
    line: int | None = None
    between_joints: bool = False


def massless(name: str, line: int | None = None, *, between: bool = False) -> Link:
    """Return a link without mass; `between`: whether the reader made it as a frame between joints."""
    return Link(name, 0.0, np.zeros(3), np.zeros((3, 3)), line, between)


@dataclass(frozen=True, eq=False)
class Load:
    """A body that was added to a link, and the link's own numbers.

    Attributes:
        name: Name of the link.
        mass, com, inertia: Those of the added body, as in `Link`.
        own_mass, own_com, own_inertia: Those of the link without it.
    """

    name: str
    mass: float
    com: Array
    inertia: Array
    own_mass: float
    own_com: Array
    own_inertia: Array


@dataclass(frozen=True)
class StatedSpring:
    """A spring that the files state for a joint.

    Attributes:
        name: Name of the joint.
        stiffness: Stiffness [N/m or N m/rad].
        rest: Position without force [m or rad].
    """

    name: str
    stiffness: float
    rest: float


def spring_effect(springs: Iterable[StatedSpring]) -> tuple[str, dict[str, Any]]:
    """Return springs as an effect: its name, and its numbers by parameter."""
    stated = [*springs]
    rest = {spring.name: spring.rest for spring in stated}
    return "spring", {"stiffness": {spring.name: spring.stiffness for spring in stated}, "rest": rest}


@dataclass(frozen=True, eq=False)
class Joint:
    """A joint of the spanning tree.

    Attributes:
        name: Name of the joint.
        kind: One of `JointKind`; coordinates are Pinocchio's (`continuous`: cos, sin; `spherical`: quaternion
            x, y, z, w; `planar`: x, y, cos, sin; `floating`: x, y, z, quaternion). A continuous joint in a
            coupling is a revolute one without limits, whose position counts whole turns.
        parent: Name of the parent link.
        child: Name of the child link.
        placement: Child frame in the parent frame at joint position zero, shape (4, 4).
        axis: Unit axis in the child frame, shape (3,) (revolute, continuous, prismatic; z, the normal, for a
            planar joint).
        lower: Lower position limit [m or rad], -inf if absent.
        upper: Upper position limit [m or rad], +inf if absent.
        velocity: Speed limit as the file states it [m/s or rad/s], +inf if absent; see `speed_limit`.
        effort: Effort limit as the file states it [N or N m], +inf if absent; see `effort_limit`.
        damping: Viscous friction [N s/m or N m s/rad], from URDF `<dynamics>` or model.toml.
        friction: Coulomb friction [N or N m].
        rotor_inertia: Inertia of the rotor about its own axis [kg m^2].
        gear_ratio: Rotor turns per joint turn.
        line: Line in the file, or None.
        pitch: Way of a screw along its axis [m/rad].
    """

    name: str
    kind: JointKind
    parent: str
    child: str
    placement: Array
    axis: Array
    lower: float = -np.inf
    upper: float = np.inf
    velocity: float = np.inf
    effort: float = np.inf
    damping: float = 0.0
    friction: float = 0.0
    rotor_inertia: float = 0.0
    gear_ratio: float = 1.0
    line: int | None = None
    pitch: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "kind", JointKind(self.kind))

    @property
    def armature(self) -> float:
        """Inertia of the rotor at the joint, J n^2 [kg or kg m^2]."""
        return self.rotor_inertia * self.gear_ratio**2

    @property
    def speed_limit(self) -> float:
        """Speed limit [m/s or rad/s], +inf if there is none. URDF demands a number, and 0 states none."""
        return self.velocity or np.inf

    @property
    def effort_limit(self) -> float:
        """Effort limit [N or N m], +inf if there is none. URDF demands a number, and 0 states none."""
        return self.effort or np.inf


@dataclass(frozen=True, eq=False)
class Closure:
    """A loop closure between two links, in one canonical form.

    With frame A fixed to `link_a` and frame B fixed to `link_b`, r the position of B's origin relative to A's
    origin in A's axes, and z_A, z_B their third axes:

        r[i] = 0 for every i in `translations`
        rotation "free"           no further rows
        rotation "perpendicular"  z_A . z_B = 0              (1 row: universal; z_A and z_B are its two axes)
        rotation "parallel"       z_A = z_B                  (2 rows: rotation about z stays free)
        rotation "fixed"          A and B have the same axes (3 rows)

    So: fixed (0,1,2)+fixed; revolute (0,1,2)+parallel; prismatic along z (0,1)+fixed; cylindrical
    (0,1)+parallel; universal (0,1,2)+perpendicular; planar with normal z (2,)+parallel; spherical
    (0,1,2)+free.

    Attributes:
        name: Name of the closure.
        kind: The author's word for its kind, for messages ("revolute", "rows", "6d", ...).
        link_a: Predecessor link.
        frame_a: Frame A in `link_a`, shape (4, 4).
        link_b: Successor link.
        frame_b: Frame B in `link_b`, shape (4, 4).
        translations: Axes of A along which B's origin may not move, a subset of (0, 1, 2).
        rotation: One of `RotationKind`.
        line: Line in the file, or None.
        turn: Axes of frame A in the frame that the author placed on `link_a`, shape (3, 3). Wrenches of the
            closure are reported in the author's axes.
    """

    name: str
    kind: str
    link_a: str
    frame_a: Array
    link_b: str
    frame_b: Array
    translations: tuple[int, ...]
    rotation: RotationKind
    line: int | None = None
    turn: Array = field(default_factory=lambda: np.eye(3))


@dataclass(frozen=True)
class Curve:
    """What bends a coupling: c2 s^2 + c3 s^3 + ..., with s = sum of factor x position - reference.

    Attributes:
        terms: Pairs (joint, factor): the joint's name, or its number in a tree.
        coefficients: c2, c3, ...
        reference: What is taken from the sum [m or rad].
    """

    terms: tuple[tuple[Any, float], ...]
    coefficients: tuple[float, ...]
    reference: float = 0.0

    def of(self, names: Mapping[Any, Any]) -> Curve:
        """Return the curve of joints of other names or numbers."""
        return replace(self, terms=tuple((names[joint], factor) for joint, factor in self.terms))

    def argument(self, positions: Mapping[Any, Any]) -> Any:
        """Compute s from positions by joint: numbers, arrays or expressions."""
        return sum(factor * positions[joint] for joint, factor in self.terms) - self.reference

    def moved(self, shift: Mapping[Any, float]) -> Curve:
        """Return the curve of positions that count from other zeros, as `Coupling.moved`."""
        back = sum(factor * shift.get(joint, 0.0) for joint, factor in self.terms)
        return replace(self, reference=self.reference - back)

    @property
    def sizes(self) -> list[tuple[Any, float]]:
        """How strongly each joint counts."""
        return [(joint, abs(factor) * max(map(abs, self.coefficients))) for joint, factor in self.terms]

    def value(self, positions: Mapping[Any, Any]) -> Any:
        """Compute the curve from positions by joint: numbers, arrays or expressions."""
        return self.at(self.argument(positions))[0]

    def slopes(self, positions: Mapping[Any, Any]) -> dict[Any, Any]:
        """Compute the derivative by each joint's position."""
        slope, out = self.at(self.argument(positions))[1], dict[Any, Any]()
        for joint, factor in self.terms:
            out[joint] = out.get(joint, 0.0) + slope * factor
        return out

    def bend(self, positions: Mapping[Any, Any], rates: Mapping[Any, Any]) -> Any:
        """Compute the second derivative over time of joints with constant rates."""
        s_dot = sum(factor * rates[joint] for joint, factor in self.terms)
        return self.at(self.argument(positions))[2] * s_dot**2

    def at(self, s: Any) -> tuple[Any, Any, Any]:
        """Compute the curve and its first two derivatives at s: a number, an array or an expression."""
        value, slope, bend = 0.0 * s, 0.0 * s, 0.0 * s
        for coefficient in (*self.coefficients[::-1], 0.0, 0.0):  # Horner's rule; c1 and c0 are 0
            bend = bend * s + 2.0 * slope
            slope = slope * s + value
            value = value * s + coefficient
        return value, slope, bend


@dataclass(frozen=True)
class Coupling:
    """A relation between joint positions: sum of coefficient x position + curve = offset.

    Attributes:
        name: Name of the coupling (a mimic joint's own name).
        terms: Pairs (joint name, coefficient); every joint has one freedom. Joints of the curve alone have
            the coefficient 0 here.
        offset: Right-hand side [m or rad].
        line: Line in the file, or None.
        curve: What bends the relation; None if it is linear.
    """

    name: str
    terms: tuple[tuple[str, float], ...]
    offset: float = 0.0
    line: int | None = None
    curve: Curve | Residual | None = None

    def __post_init__(self) -> None:
        known = {joint for joint, _ in self.terms}
        more = tuple(
            (joint, 0.0) for joint, _ in (self.curve.terms if self.curve else ()) if joint not in known
        )
        object.__setattr__(self, "terms", self.terms + more)

    @property
    def frames(self) -> tuple[str, ...]:
        """Links whose frames its residual sees."""
        return () if self.curve is None or isinstance(self.curve, Curve) else self.curve.frames

    def of(self, names: Mapping[str, str]) -> Coupling:
        """Return the coupling of joints of other names."""
        terms = tuple((names[joint], factor) for joint, factor in self.terms)
        return replace(self, terms=terms, curve=self.curve and self.curve.of(names))

    def moved(self, shift: Mapping[str, float]) -> Coupling:
        """Return the coupling of positions that count from other zeros.

        Args:
            shift: Old position of the new zero, by joint; 0 for those left out.
        """
        by = sum(factor * shift.get(joint, 0.0) for joint, factor in self.terms)
        return replace(self, offset=self.offset - by, curve=self.curve and self.curve.moved(shift))

    def open_by(self, positions: Mapping[str, float]) -> float:
        """Return by how much positions miss the relation."""
        total = sum(factor * positions[joint] for joint, factor in self.terms) - self.offset
        return total + (float(self.curve.value(positions)) if self.curve else 0.0)

    def rates(self, positions: Mapping[str, float]) -> dict[str, float]:
        """Return the derivative of the relation by each joint's position."""
        out: dict[str, float] = {}
        for joint, factor in self.terms:
            out[joint] = out.get(joint, 0.0) + factor
        if self.curve:
            for joint, slope in self.curve.slopes(positions).items():
                out[joint] += float(slope)
        return out


class ReadFrom(NamedTuple):
    """The file that a description was read from, and what the reader was told.

    Attributes:
        file: Path of the file, with the name of its model after "#" where it was chosen.
        motors: Names of the driven joints, or None.
        xacro_args: Arguments of a xacro file by name.
        package_dirs: Folders that hold packages.
    """

    file: str
    motors: tuple[str, ...] | None
    xacro_args: dict[str, object]
    package_dirs: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Description:
    """The description of one robot, from all of its files.

    Attributes:
        name: Name of the robot.
        links: Every link, in file order.
        joints: Every joint of the spanning tree, fixed ones too, in file order.
        closures: Every loop closure.
        couplings: Every coupling.
        motors: Names of the driven joints, in order.
        motors_from: The source or rule of `motors`, one phrase for `info`.
        home: Joint positions of the home posture by joint name: one number (angle or metres), or the joint's
            Pinocchio coordinates; joints not named are at zero.
        notes: Remarks of the reader for the user. A closure is never ignored with a note.
        source: Path of the robot file, or None.
        effects: Physical effects that belong to the robot, pairs (name, numbers of the effect by parameter).
        base: Whether the file states that the root link floats (a free joint of MJCF); URDF never does.
        base_home: Pose of a floating root link in the home posture, shape (7,): x, y, z [m], quaternion x, y,
            z, w; None is identity.
        gravity: Acceleration of gravity that the file states [m/s^2], or None.
        read_from: What it was read from; None for a model in memory.
        format: Format of the robot file, "added" by another package; "Pinocchio" for a model in memory, whose
            order of joints is kept.
        loads: Bodies that were added to links, whose numbers include them.
        crossed: Lower and upper position limit [m or rad] of each joint whose file states the lower above the
            upper; the joint itself has no limits.
        left_out: Actuators of the file that no motor expresses.
    """

    name: str
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    closures: tuple[Closure, ...] = ()
    couplings: tuple[Coupling, ...] = ()
    motors: tuple[str, ...] = ()
    motors_from: str = ""
    home: dict[str, tuple[float, ...]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    source: str | None = None
    effects: tuple[tuple[str, dict[str, Any]], ...] = ()
    base: StatedBase = "fixed"
    base_home: tuple[float, ...] | None = None
    gravity: tuple[float, float, float] | None = None
    format: Format = "URDF"
    read_from: ReadFrom | None = field(default=None, compare=False)
    loads: tuple[Load, ...] = ()
    crossed: dict[str, tuple[float, float]] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        # Cosine and sine do not count whole turns, which a coupling needs.
        geared = {name for coupling in self.couplings for name, _ in coupling.terms}
        joints = tuple(
            replace(joint, kind=JointKind.REVOLUTE, lower=-np.inf, upper=np.inf)
            if joint.kind.endless and joint.name in geared
            else joint
            for joint in self.joints
        )
        angles = {
            name: (math.atan2(x[1], x[0]),) for name, x in self.home.items() if name in geared and len(x) == 2
        }
        object.__setattr__(self, "joints", joints)
        object.__setattr__(self, "home", self.home | angles)

    @property
    def springs(self) -> tuple[StatedSpring, ...]:
        """The springs in `effects`, joint by joint."""
        return tuple(
            StatedSpring(joint, stiffness, values.get("rest", {}).get(joint, 0.0))
            for name, values in self.effects
            if name == "spring"
            for joint, stiffness in values["stiffness"].items()
        )

    def with_springs(self, springs: Iterable[StatedSpring]) -> Description:
        """Return the description with other springs, in one table in place of all others."""
        return self.with_effect(*spring_effect(springs))

    def with_effect(self, name: str, values: dict[str, Any]) -> Description:
        """Return the description with other numbers of an effect, in its place, or last."""
        names = [own for own, _ in self.effects]
        at = names.index(name) if name in names else len(names)
        left = (effect for effect in self.effects[at:] if effect[0] != name)
        return replace(self, effects=(*self.effects[:at], (name, values), *left))

    @property
    def root(self) -> str:
        """Name of the root link: it is not the child of any joint."""
        children = {joint.child for joint in self.joints}
        return next(link.name for link in self.links if link.name not in children)

    @cached_property
    def endless_gears(self) -> frozenset[str]:
        """Names of the joints in couplings that turn without limits: their positions count whole turns."""
        held = {name for coupling in self.couplings for name, _ in coupling.terms}
        return frozenset(
            joint.name
            for joint in self.joints
            if joint.name in held and joint.kind == "revolute" and joint.lower == -np.inf == -joint.upper
        )

    def siblings(self, joints: Sequence[Joint]) -> list[Joint]:
        """Order the joints of one parent link as q and v have them: by name, as `pin.buildModelFromXML` does.

        Joints of a Pinocchio model keep its order.
        """
        return list(joints) if self.format == "Pinocchio" else sorted(joints, key=lambda joint: joint.name)


MotorSource = Literal[
    "side-car", "model file", "actuator", "transmission", "independent", "interface", "names"
]  # fmt: skip


class MotorStatement(NamedTuple):
    """A list of driven joints that some file states.

    Attributes:
        source: Kind of the source; `motors.py` ranks the kinds.
        where: The source in words, for `info` and messages ("URDF <transmission>").
        names: Names of joints as the author wrote them.
        file: Path of the file.
        line: Line in the file, or None.
    """

    source: MotorSource
    where: str
    names: tuple[str, ...]
    file: str
    line: int | None = None


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
        closing: Names of joints of the tree that close loops in the file; no rule takes them for motors.
        springs: Springs of joints, which the reader makes one of `effects`.
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
    closing: set[str] = field(default_factory=set)
    springs: list[StatedSpring] = field(default_factory=list)
