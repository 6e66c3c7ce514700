"""HybridRobot: a tree of modules on a fixed, moving or floating base.

Positions q, rates v and accelerations a are those of the spanning tree, which has every movable URDF joint.
Order and coordinates are those of `pin.buildModelFromXML`, but for endless joints in gears
(`description.records.Joint`). A moving or floating base adds a free-flyer as the
first joint.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np

from ..description.names import counted
from ..description.records import Description, Joint
from ..joints.kinds import JointKind
from ..linkage.joints import ROOT_JOINT
from ..spatial import Array, Index
from .bodies import Bodies, Payload, payloads_of
from .module import Module

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import pinocchio as pin
    from numpy.typing import ArrayLike


Base = Literal["fixed", "moving", "floating"]
#: Motors that the printed robot names.
SHOWN_MOTORS = 4
#: Attributes that `dir` lists.
SHOWN = (
    "base", "description", "effort_units", "gravity", "home", "joint_index", "joints", "kinds", "mobility",
    "model", "modules", "motor_q", "motor_v", "motors", "name", "notes", "nq", "nv", "payloads", "q_slices",
    "v_slices", "with_parameters",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class HybridRobot:
    """A robot made of modules.

    Attributes:
        description: Description of the robot, as read from its files.
        base: "fixed", "moving" (prescribed) or "floating" (free).
        gravity: Acceleration of gravity in the world, shape (3,), [m/s^2].
        modules: Modules, each after the module that carries it; a floating base is the first.
        joints: Names of the movable joints in the order of q and v ("root_joint" first on a moving base).
        kinds: Kind of each joint.
        q_slices: Slice of q of each joint.
        v_slices: Slice of v of each joint.
        motors: Names of the motors, in the order of tau.
        bodies: Bodies; body i + 1 is the child of URDF joint i (not counting the root joint).
        closure_tolerance: Largest closure residual at home and in `assemble` over the module's length.
        home: Home position, shape (nq,).
        rank_tolerance: Argument of `build_robot`.
        held: Joints that must not be cut as part of a wrist.
        rebuild: Builds the robot with other parameters (`with_parameters`).

    Example:
        >>> print(hybridyn.load("five_bar"))
        HybridRobot 'five_bar' on a fixed base: 1 module, 4 joints, 2 freedoms, 2 motors
        q has 4 coordinates, v has 4, tau has 2: m1_left_drive, m1_right_drive
    """

    description: Description
    base: Base
    gravity: Array
    modules: tuple[Module, ...]
    joints: tuple[str, ...]
    kinds: tuple[JointKind, ...]
    q_slices: tuple[slice, ...]
    v_slices: tuple[slice, ...]
    motors: tuple[str, ...]
    bodies: Bodies
    closure_tolerance: float
    home: Array
    rank_tolerance: float | None = None
    held: frozenset[str] = frozenset()
    rebuild: Callable[[HybridRobot, Mapping[str, ArrayLike]], HybridRobot] | None = None

    def __repr__(self) -> str:
        """Describe the robot in two lines: its structure, and its coordinates."""
        shown = ", ".join(self.motors[:SHOWN_MOTORS]) + (", ..." if len(self.motors) > SHOWN_MOTORS else "")
        return (
            f"HybridRobot '{self.name}' on a {self.base} base: {counted(len(self.modules), 'module')}, "
            f"{counted(len(self.joints), 'joint')}, {counted(self.mobility, 'freedom')}, "
            f"{counted(len(self.motors), 'motor')}\n"
            f"q has {self.nq} coordinates, v has {self.nv}, tau has {len(self.motors)}"
            + (f": {shown}" if shown else "")
        )

    def __dir__(self) -> list[str]:
        """List what a user may touch; hybridyn's own functions use more."""
        return [*SHOWN]

    @property
    def name(self) -> str:
        """Name of the robot."""
        return self.description.name

    @property
    def nq(self) -> int:
        """Number of position coordinates."""
        return self.q_slices[-1].stop if self.q_slices else 0

    @property
    def nv(self) -> int:
        """Number of velocities."""
        return self.v_slices[-1].stop if self.v_slices else 0

    @property
    def mobility(self) -> int:
        """Number of independent velocities, including six of a floating base, but none of a moving base."""
        return sum(module.mobility for module in self.modules)

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks of the reader of the files."""
        return self.description.notes

    @cached_property
    def payloads(self) -> tuple[Payload, ...]:
        """Payloads that were added to the links (`hybridyn.with_effects`)."""
        return payloads_of(self.description)

    @cached_property
    def joint_index(self) -> dict[str, int]:
        """Number of each joint in `joints`, by name."""
        return {name: i for i, name in enumerate(self.joints)}

    @cached_property
    def records(self) -> dict[str, Joint]:
        """Record of each joint in the robot's files, by name."""
        return {joint.name: joint for joint in self.description.joints}

    @cached_property
    def closure_kinds(self) -> dict[str, str]:
        """Kind of each closure in the robot's files, by name; that of a coupling is "coupling"."""
        coupled = {c.name: "coupling" for c in self.description.couplings}
        return {c.name: c.kind for c in self.description.closures} | coupled

    @cached_property
    def children(self) -> dict[int, list[int]]:
        """Numbers of the modules that stand on each module that carries any; key -1 for the base."""
        out: dict[int, list[int]] = {}
        for number, module in enumerate(self.modules):
            out.setdefault(module.parent, []).append(number)
        return out

    @cached_property
    def effort_units(self) -> list[str]:
        """Unit of each motor's effort."""
        return ["N" if self.records[name].kind.slides else "N m" for name in self.motors]

    @cached_property
    def motor_q(self) -> Index:
        """Index in q of each motor, shape (motors,); that of a joint that turns without end is its cosine."""
        return np.array([self.q_slices[self.joint_index[name]].start for name in self.motors], dtype=int)

    @cached_property
    def motor_v(self) -> Index:
        """Index in v of each motor, shape (motors,)."""
        return np.array([self.v_slices[self.joint_index[name]].start for name in self.motors], dtype=int)

    @cached_property
    def cut_joints(self) -> frozenset[str]:
        """Massless passive joints that were cut as part of a wrist."""
        wrists = ((module, wrist) for module in self.modules for wrist in module.mechanism.spec.wrists)
        return frozenset(module.joints[i] for module, wrist in wrists for i in wrist.joints)

    @cached_property
    def body_of_joint(self) -> dict[str, int]:
        """Number of the body that each joint moves, by joint name."""
        return {j.joint.name: j.child for j in self.bodies.joints} | {ROOT_JOINT: 0}

    @cached_property
    def body_owner(self) -> dict[int, tuple[int, int]]:
        """For each body, the module that moves it and the body's number in the module's spanning tree.

        The entry of the root body is (-1, 0) unless a module moves it.
        """
        out = {0: (-1, 0)}
        for k, module in enumerate(self.modules):
            for i, joint in enumerate(module.joints):
                out[self.body_of_joint[joint]] = (k, i + 1)
        return out

    def module_of(self, joint: str) -> int:
        """Return the number of the module that moves a joint; -1 for a prescribed base."""
        return self.body_owner[self.body_of_joint[joint]][0]

    @cached_property
    def unit(self) -> Array:
        """Unit of each freedom, shape (nv,): the length of its module if it is linear, else one radian."""
        out = np.ones(self.nv)
        if self.base == "moving":
            out[:3] = 2.0 ** np.round(np.log2(self.bodies.size))
        for module in self.modules:
            out[module.v_index] = module.mechanism.spanning_col_scale
        return out

    @cached_property
    def unit_coordinates(self) -> tuple[Index, ...]:
        """Indices in q of cosine and sine pairs, shape (k, 2), and of quaternions, shape (l, 4).

        Each pair and each quaternion has length one.
        """
        ends = [(at.stop, len(kind.turn.zero)) for kind, at in zip(self.kinds, self.q_slices, strict=True)]
        return tuple(
            np.array([end for end, size in ends if size == width], dtype=int)[:, None] + np.arange(-width, 0)
            for width in (2, 4)
        )

    @cached_property
    def model(self) -> pin.Model:
        """Pinocchio model of the spanning tree, your own copy: edits of it change no result of hybridyn.

        For other masses, lengths or laws build another robot: `with_parameters`, `hybridyn.with_effects`.

        Raises:
            ModelError: The robot has more than 10,000 joints, which Pinocchio cannot hold.
        """
        return self.unchanged_model.copy()

    @cached_property
    def unchanged_model(self) -> pin.Model:
        """The same model for hybridyn's own functions; it is never returned to callers."""
        from .pinocchio_model import build_model

        return build_model(self.bodies, self.joints, self.base, self.gravity, self.name)

    def with_parameters(self, values: Mapping[str, ArrayLike]) -> HybridRobot:
        """Build the robot with other parameters; if its topology is the same, ranks are only checked.

        Args:
            values: Parameters by name: numbers of the description such as "mass:LINK" or "position:JOINT" (as
                in `hybridyn.compile`), or arguments of the robot's xacro file.

        Raises:
            ModelError: A parameter is unknown, a value has a wrong size, a number is out of the range that
                files may state, or there is no such robot.
            AssemblyError: No posture closes the loops of a module.
        """
        assert self.rebuild is not None
        return self.rebuild(self, values)


def joint_position(robot: HybridRobot, q: Array, joint: str) -> Array:
    """Return the position of a joint with one freedom; for a continuous joint the angle in [-pi, pi].

    Args:
        q: Positions of the spanning tree, shape (..., nq).
        joint: Name of the joint.

    Returns:
        Shape (...), [m or rad].
    """
    x = q[..., robot.q_slices[robot.joint_index[joint]]]
    return x[..., 0] if x.shape[-1] == 1 else np.arctan2(x[..., 1], x[..., 0])


def positions(robot: HybridRobot, q: Array) -> dict[str, tuple[float, ...]]:
    """Return the position of each joint of a posture as `model.toml` states it; a free base is left out.

    Args:
        q: Positions on the spanning tree, shape (nq,).

    Returns:
        By joint one number (an angle for a continuous joint), or Pinocchio's coordinates.
    """
    out: dict[str, tuple[float, ...]] = {}
    for name, kind, at in zip(robot.joints, robot.kinds, robot.q_slices, strict=True):
        if kind.endless:
            out[name] = (float(joint_position(robot, q, name)),)
        elif robot.base == "fixed" or name != robot.joints[0]:
            out[name] = tuple(float(value) for value in q[at])
    return out
