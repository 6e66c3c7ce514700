"""HybridRobot: a tree of modules on a fixed, moving or floating base.

Positions q, rates v and accelerations a live on the spanning tree, every movable URDF joint, in the order and
the coordinates of `pin.buildModelFromXML`; a moving or floating base puts a free-flyer first.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np

from .bodies import Bodies
from .description.names import did_you_mean
from .description.records import Description
from .errors import ModelError
from .joints import NQ, NV, TreeJoint
from .kinematics import Tree
from .module import Mechanism, Module, check_mechanism
from .modulespec import ModuleSpec, module_spec
from .reduction import ROUNDED
from .spatial import Array, spatial_inertia
from .topology import ModuleGraph, find_modules, leave_whole

if TYPE_CHECKING:
    from collections.abc import Iterable

    import pinocchio as pin

    from .effects.inputs import Payload

Base = Literal["fixed", "moving", "floating"]

#: Name of the free-flyer under the root link, Pinocchio's.
ROOT_JOINT = "root_joint"


@dataclass(frozen=True)
class HybridRobot:
    """A robot made of modules.

    Attributes:
        description: What the files say.
        base: "fixed", "moving" (prescribed) or "floating" (free).
        gravity: Acceleration of gravity in the world, shape (3,), [m/s^2].
        modules: Modules, bases before what they carry; a floating base is the first.
        joints: Names of the movable joints in the order of q and v ("root_joint" first on a moving base).
        kinds: Kind of each joint.
        q_slices: Slice of q of each joint.
        v_slices: Slice of v of each joint.
        motors: Names of the motors, the order of tau.
        links: For each link its body's number and its placement (R, p) in the body.
        bodies: Bodies; the child of URDF joint i (without the root joint) is body i + 1.
        closure_tolerance: Largest closure residual at home and in `assemble` over the module's length.
        home: Home position, shape (nq,).
        rank_tolerance: What `build_robot` was given.
        held: Joints that are never cut away in a wrist.
        payloads: Payloads that were added to the links (`hybridyn.with_effects`).
    """

    description: Description
    base: Base
    gravity: Array
    modules: tuple[Module, ...]
    joints: tuple[str, ...]
    kinds: tuple[str, ...]
    q_slices: tuple[slice, ...]
    v_slices: tuple[slice, ...]
    motors: tuple[str, ...]
    bodies: Bodies
    closure_tolerance: float
    home: Array
    rank_tolerance: float | None = None
    held: frozenset[str] = frozenset()
    payloads: tuple[Payload, ...] = ()

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
        """Number of independent velocities, a free base's six among them, a prescribed base's not."""
        return sum(module.mobility for module in self.modules)

    @property
    def notes(self) -> tuple[str, ...]:
        """What the reader remarked."""
        return self.description.notes

    @cached_property
    def joint_index(self) -> dict[str, int]:
        """For each joint its number in `joints`."""
        return {name: i for i, name in enumerate(self.joints)}

    @cached_property
    def cut_joints(self) -> frozenset[str]:
        """Massless passive joints that were cut away in wrists."""
        wrists = ((module, wrist) for module in self.modules for wrist in module.mechanism.spec.wrists)
        return frozenset(module.joints[i] for module, wrist in wrists for i in wrist.joints)

    @cached_property
    def body_of_joint(self) -> dict[str, int]:
        """For each joint the body that it moves."""
        return {j.joint.name: j.child for j in self.bodies.joints} | {ROOT_JOINT: 0}

    @cached_property
    def body_owner(self) -> dict[int, tuple[int, int]]:
        """Module that moves each body and the body's number in its spanning tree; root: (-1, 0)."""
        out = {0: (-1, 0)}
        for k, module in enumerate(self.modules):
            for i, joint in enumerate(module.joints):
                out[self.body_of_joint[joint]] = (k, i + 1)
        return out

    @cached_property
    def root_inertia(self) -> Array:
        """6-D inertia of the root body, shape (6, 6), body frame."""
        root = self.bodies.bodies[0]
        return spatial_inertia(root.mass, root.com, root.inertia)

    @cached_property
    def model(self) -> pin.Model:
        """Pinocchio's model of the spanning tree, built on first use.

        Raises:
            ModelError: The robot has more than 10,000 joints, which Pinocchio cannot hold.
        """
        from .pinocchio_model import build_model

        return build_model(self)


def build_robot(
    description: Description,
    *,
    base: Base = "fixed",
    gravity: tuple[float, float, float] | Array = (0.0, 0.0, -9.81),
    rank_tolerance: float | None = None,
    closure_tolerance: float = 1e-4,
    held: Iterable[str] = (),
    payloads: tuple[Payload, ...] = (),
) -> HybridRobot:
    """Build a robot from its description.

    Args:
        description: What the files say.
        base: "fixed", "moving" (prescribed motion) or "floating" (free).
        gravity: Acceleration of gravity in the world, shape (3,), [m/s^2].
        rank_tolerance: Relative singular value under which closure rows are dependent; found where left out.
        closure_tolerance: Largest residual that counts as closed, relative to a module's length.
        held: Joints that are never cut away in a wrist, so that they can have joint effects.
        payloads: Payloads that the description has on its links already.

    Raises:
        ModelError: The description makes no robot, or the rank of a module's closures is in doubt.
        AssemblyError: A module's loops close nowhere.
    """
    if base not in ("fixed", "moving", "floating"):
        raise ModelError(f"base must be 'fixed', 'moving' or 'floating', not {base!r}")
    kept = _held(description, held)
    bodies, graphs = find_modules(description, kept)
    joints = [j.joint.name for j in bodies.joints]
    kinds = [str(j.joint.kind) for j in bodies.joints]
    if base != "fixed":
        joints, kinds = [ROOT_JOINT, *joints], ["floating", *kinds]
    q_ends, v_ends = (np.cumsum([0] + [n[k] for k in kinds]) for n in (NQ, NV))
    q_slices = tuple(slice(int(a), int(b)) for a, b in zip(q_ends, q_ends[1:], strict=False))
    v_slices = tuple(slice(int(a), int(b)) for a, b in zip(v_ends, v_ends[1:], strict=False))
    home = _home(description, bodies, kinds, base)
    build = _Builder(bodies, description, joints, q_slices, v_slices, home, rank_tolerance, closure_tolerance)
    if base == "floating":
        build.add_base()
    for graph in graphs:
        build.add(graph)
    return HybridRobot(
        description,
        base,
        np.asarray(gravity, dtype=float),
        tuple(build.modules),
        tuple(joints),
        tuple(kinds),
        q_slices,
        v_slices,
        tuple(description.motors),
        bodies,
        closure_tolerance,
        home,
        rank_tolerance,
        kept,
        payloads,
    )


def _held(description: Description, held: Iterable[str]) -> frozenset[str]:
    """Give the joints that must not be cut: those named, and those with an effect of the robot's own.

    Raises:
        ModelError: A name is no movable joint.
    """
    movable = [joint.name for joint in description.joints if joint.kind != "fixed"]
    for name in held:
        if name not in movable:
            raise ModelError(
                f"held: no such movable joint '{name}'{did_you_mean(name, movable)}", element=name
            )
    tables = [
        numbers
        for _, values in description.effects
        for numbers in values.values()
        if isinstance(numbers, dict)
    ]
    return frozenset(held) | {name for numbers in tables for name in numbers if name in movable}


def _home(description: Description, bodies: Bodies, kinds: list[str], base: str) -> Array:
    """Give the home position of the whole robot, shape (nq,)."""
    parts = [np.array([0.0, 0, 0, 0, 0, 0, 1])] if base != "fixed" else []
    for joint, kind in zip(bodies.joints, kinds[len(parts) :], strict=True):
        value = np.asarray(description.home.get(joint.joint.name, (0.0,)), dtype=float)
        one = Tree([TreeJoint("", joint.joint.kind, 0, joint.R, joint.p, joint.joint.axis)])
        if len(value) == NQ[kind] and kind != "continuous":
            parts.append(value)
        elif kind == "continuous":
            angle = value[0] if len(value) == 1 else np.arctan2(value[1], value[0])
            parts.append(np.array([np.cos(angle), np.sin(angle)]))
        else:
            parts.append(one.neutral())
    return np.concatenate(parts) if parts else np.zeros(0)


class _Builder:
    """Modules one after the other, equal ones sharing their mechanism."""

    def __init__(
        self,
        bodies: Bodies,
        description: Description,
        joints: list[str],
        q_slices: tuple[slice, ...],
        v_slices: tuple[slice, ...],
        home: Array,
        rank_tolerance: float | None,
        closure_tolerance: float,
    ) -> None:
        self.bodies, self.description = bodies, description
        self.number = {name: i for i, name in enumerate(joints)}
        self.q_slices, self.v_slices, self.home = q_slices, v_slices, home
        self.tolerances = (rank_tolerance, closure_tolerance)
        self.modules: list[Module] = []
        self.shared: dict[bytes, Mechanism] = {}
        self.output_of: dict[int, tuple[int, int]] = {0: (-1, 0)}
        self.motor_number = {name: i for i, name in enumerate(description.motors)}

    def add_base(self) -> None:
        """Add the free base: no legs, one platform, a = identity."""
        root = replace(self.bodies.bodies[0], name="", joint=0, heaviest=0.0)
        joint = TreeJoint("", "floating", 0, np.eye(3), np.zeros(3), np.array([0.0, 0.0, 1.0]))
        spec = ModuleSpec(
            (joint,),
            (joint,),
            (0,),
            (0, 1),
            (),
            (),
            (),
            (),
            (),
            (),
            ((1,),),
            (1,),
            (root,),
            (None,),
            self.home[:7],
        )
        name = self.bodies.bodies[0].name
        self._append(spec, name, "world", (name,), [ROOT_JOINT], [("", [ROOT_JOINT])], [], -1, 0)
        self.output_of[0] = (0, 0)

    def add(self, graph: ModuleGraph) -> None:
        """Add a module of the kinematic graph."""
        names = [self.bodies.joints[j].joint.name for j in graph.joints]
        q_index = np.concatenate([np.arange(self.home.size)[self.q_slices[self.number[n]]] for n in names])
        spec = module_spec(self.bodies, graph, self.home[q_index])
        report = self._mechanism(spec).reduction.report
        if graph.wrists and report.dropped > ROUNDED:
            leave_whole(self.bodies, graph)
            spec = module_spec(self.bodies, graph, self.home[q_index])
        body = dict(enumerate([graph.base] + [j + 1 for j in graph.joints]))
        outputs = [body[spec.tree_body[o]] for o in spec.outputs]
        link = [self.bodies.bodies[b].name for b in outputs]
        name = link[0] if link else self.bodies.bodies[graph.joints[-1] + 1].name
        legs = []
        for leg in graph.legs:
            own = [self.bodies.joints[b - 1].joint.name for b in leg]
            legs.append((_leg_name([self.bodies.bodies[b].name for b in leg]), own))
        closures = [c.name for c in graph.closures] + [c.name for c in graph.couplings]
        parent, output = self.output_of[graph.base]
        self._append(
            spec,
            name,
            self.bodies.bodies[graph.base].name,
            tuple(link),
            names,
            legs,
            closures,
            parent,
            output,
        )
        for i, o in enumerate(outputs):
            self.output_of[o] = (len(self.modules) - 1, i)

    def _mechanism(self, spec: ModuleSpec) -> Mechanism:
        """Give the mechanism of a module, the one of an equal module where there is one."""
        key = spec.key
        if key not in self.shared:
            self.shared[key] = Mechanism(spec, *self.tolerances)
        return self.shared[key]

    def _append(
        self,
        spec: ModuleSpec,
        name: str,
        base: str,
        outputs: tuple[str, ...],
        joints: list[str],
        legs: list[tuple[str, list[str]]],
        closures: list[str],
        parent: int,
        output: int,
    ) -> None:
        mechanism = self._mechanism(spec)
        check_mechanism(mechanism, name, self.description.source, self.tolerances[1])
        every_q, every_v = np.arange(self.q_slices[-1].stop), np.arange(self.v_slices[-1].stop)
        numbers = [self.number[j] for j in joints]
        tree_joint = {joints[s]: i for i, s in enumerate(spec.tree_joint) if s is not None}
        motors = [j for j in joints if j in self.motor_number]
        self.modules.append(
            Module(
                name,
                base,
                outputs,
                tuple((n, tuple(j)) for n, j in legs),
                tuple(joints),
                tuple(closures),
                tuple(motors),
                mechanism,
                parent,
                output,
                np.concatenate([every_q[self.q_slices[i]] for i in numbers]),
                np.concatenate([every_v[self.v_slices[i]] for i in numbers]),
                np.array([self.motor_number[m] for m in motors], dtype=int),
                np.array([mechanism.tree.v_slices[tree_joint[m]].start for m in motors], dtype=int),
            )
        )


def _leg_name(links: list[str]) -> str:
    """Name a leg by what its links' names have in common, else by its first link."""
    first = links[0]
    common = next(
        (first[:n] for n in range(len(first), 0, -1) if all(x.startswith(first[:n]) for x in links)), ""
    )
    common = common.rstrip("_-. ")
    return common if len(common) >= 3 and len(links) > 1 else first
