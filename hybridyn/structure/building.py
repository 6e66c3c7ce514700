"""Build a robot: turn the modules of the kinematic graph into modules with numbers and names."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..description.records import Description
from ..errors import HybridynError, ModelError
from ..joints.kinds import JointKind
from ..linkage.joints import ROOT_JOINT, TreeJoint
from ..linkage.reduction import ROUNDED_ROWS
from ..spatial import LARGEST, Array, indices, slices
from ..threads import one_thread
from .bodies import Bodies, carrying, home_of
from .graph import ModuleGraph, find_modules, joints_to_keep
from .mechanism import Mechanism, Tolerances
from .module import Module, check_mechanism
from .module_spec import ModuleSpec, module_spec
from .parameters.entries import Parameters
from .parameters.slots import check_signs, with_values
from .parameters.xacro import XacroArguments
from .robot import Base, HybridRobot

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from numpy.typing import ArrayLike

#: Acceleration of gravity if neither the caller nor the file defines one [m/s^2].
EARTH = (0.0, 0.0, -9.81)
#: A closure's frame this many times farther from its link than joints from each other has another unit.
FAR = 30.0


class ModuleBuilder:
    """Builder that adds modules in order, each after the module that carries it.

    Equal modules share one `Mechanism`.

    Attributes:
        modules: The modules added so far.
        output_of: For each body that can carry a module, the number of the module whose output it is, and the
            number of that output.
    """

    def __init__(
        self,
        bodies: Bodies,
        description: Description,
        joints: list[str],
        q_slices: tuple[slice, ...],
        v_slices: tuple[slice, ...],
        home: Array,
        tolerances: Tolerances,
        like: Sequence[Module] = (),
    ) -> None:
        """Prepare an empty robot.

        Args:
            bodies: The robot's bodies.
            description: Description of the robot.
            joints: Names of the movable joints; the free-flyer, if any, comes first.
            q_slices: Slice of q of each joint.
            v_slices: Slice of v of each joint.
            home: Home position, shape (nq,).
            tolerances: Tolerances of the robot.
            like: Modules of a robot that may differ in lengths and masses only.
        """
        self.like = {module.mechanism.spec.topology: module.mechanism for module in like}
        self.bodies, self.description = bodies, description
        self.number = {name: i for i, name in enumerate(joints)}
        self.q_slices, self.v_slices, self.home = q_slices, v_slices, home
        self.tolerances = tolerances
        self.modules: list[Module] = []
        self.shared: dict[bytes, Mechanism] = {}
        self.output_of: dict[int, tuple[int, int]] = {0: (-1, 0)}
        self.motor_number = {name: i for i, name in enumerate(description.motors)}

    def add_base(self) -> None:
        """Add the floating base as a module without legs, with one platform and a = identity."""
        root = replace(self.bodies.bodies[0], name="", joint=0, heaviest=0.0)
        joint = TreeJoint("", JointKind.FLOATING)
        spec = ModuleSpec(
            spanning=(joint,),
            tree=(joint,),
            tree_joint=(0,),
            tree_body=(0, 1),
            platforms=(),
            closures=(),
            couplings=(),
            cut_closures=(),
            cut_couplings=(),
            wrists=(),
            legs=((1,),),
            outputs=(1,),
            outputs_inertia=(root,),
            leg_bodies=(None,),
            home=self.home[:7],
        )
        name = self.bodies.bodies[0].name
        self._append(
            spec, name, base="world", outputs=(name,), joints=(ROOT_JOINT,), legs=(("", (ROOT_JOINT,)),)
        )
        self.output_of[0] = (0, 0)

    def add(self, graph: ModuleGraph) -> None:
        """Add a module of the kinematic graph."""
        links, joints = [body.name for body in self.bodies.bodies], self.bodies.joints
        names = [joints[j].joint.name for j in graph.joints]
        q_index = indices(self.q_slices[self.number[name]] for name in names)
        spec = module_spec(self.bodies, graph, self.home[q_index])
        report = self._mechanism(spec).reduction.report
        if spec.wrists and report.dropped > ROUNDED_ROWS:
            spec = module_spec(self.bodies, graph, self.home[q_index], cut=False)
        every = [graph.base] + [j + 1 for j in graph.joints]
        body = [every[i] for i in spec.tree_body]
        outputs = [body[o] for o in spec.outputs]
        link = [links[b] for b in outputs]
        name = link[0] if link else links[graph.joints[-1] + 1]
        own = [[body[b] for b in leg] for leg in spec.legs]
        legs = tuple(
            (_leg_name([links[b] for b in leg]), tuple(joints[b - 1].joint.name for b in leg)) for leg in own
        )
        closures = [c.name for c in graph.closures] + [c.name for c in graph.couplings]
        self._append(
            spec, name, links[graph.base], tuple(link), tuple(names), legs, tuple(closures),
            self.output_of[graph.base],
        )  # fmt: skip
        for i, o in enumerate(outputs):
            self.output_of[o] = (len(self.modules) - 1, i)

    def _mechanism(self, spec: ModuleSpec) -> Mechanism:
        """Return the mechanism of a module; equal modules get the same object."""
        key = spec.key
        if key not in self.shared:
            like = self.like.get(spec.topology) if self.like else None
            self.shared[key] = Mechanism(spec, self.tolerances, self.bodies.size, like)
        return self.shared[key]

    def _append(
        self,
        spec: ModuleSpec,
        name: str,
        base: str,
        outputs: tuple[str, ...],
        joints: tuple[str, ...],
        legs: tuple[tuple[str, tuple[str, ...]], ...],
        closures: tuple[str, ...] = (),
        stands_on: tuple[int, int] = (-1, 0),
    ) -> None:
        """Append a module; `stands_on` is the parent and its output, the others are those of `Module`."""
        mechanism = self._mechanism(spec)
        check_mechanism(mechanism, name, self.description.source, self.tolerances.closure)
        numbers = [self.number[j] for j in joints]
        tree_joint = {joints[s]: i for i, s in enumerate(spec.tree_joint) if s is not None}
        motors = tuple(j for j in joints if j in self.motor_number)
        columns = [mechanism.tree.v_slices[tree_joint[m]].start for m in motors]
        self.modules.append(
            Module(
                name=name,
                base=base,
                outputs=outputs,
                legs=legs,
                joints=joints,
                closures=closures,
                motors=motors,
                mechanism=mechanism,
                parent=stands_on[0],
                parent_output=stands_on[1],
                q_index=indices(self.q_slices[i] for i in numbers),
                v_index=indices(self.v_slices[i] for i in numbers),
                motor_index=np.array([self.motor_number[m] for m in motors], dtype=int),
                motor_columns=np.array(columns, dtype=int),
            )
        )


def _leg_name(links: list[str]) -> str:
    """Return the common prefix of the names of a leg's links, or the first name if it is too short."""
    first, *others = links
    ends = (n for n in range(len(first), 0, -1) if all(x.startswith(first[:n]) for x in others))
    common = first[: next(ends, 0)].rstrip("_-. ")
    return common if len(common) >= 3 and others else first


@one_thread()
def build_robot(
    description: Description,
    *,
    base: Base | None = None,
    gravity: tuple[float, float, float] | Array | None = None,
    rank_tolerance: float | None = None,
    closure_tolerance: float = 1e-4,
    held: Iterable[str] = (),
    like: HybridRobot | None = None,
) -> HybridRobot:
    """Build a robot from its description.

    Args:
        description: Description of the robot.
        base: "fixed", "moving" (prescribed motion) or "floating" (free); if None, that of the description.
        gravity: Acceleration of gravity in the world, shape (3,), [m/s^2]; if None, that of the
            description.
        rank_tolerance: Relative singular value below which closure rows count as dependent; if None, it is
            determined from the singular values.
        closure_tolerance: Largest residual that counts as closed, relative to the length of the module.
        held: Joints that must not be cut as part of a wrist, so that they can have joint effects.
        like: A robot that may differ in lengths and masses only. Ranks are then checked near its postures
            instead of decided anew.

    Raises:
        ModelError: The description does not define a robot, or the rank of a module's closures is in doubt.
        AssemblyError: No posture closes the loops of a module.
    """
    description = carrying(description)
    base = description.base if base is None else base
    if base not in ("fixed", "moving", "floating"):
        raise ModelError(f"base must be 'fixed', 'moving' or 'floating', not {base!r}")
    gravity = np.asarray(description.gravity or EARTH if gravity is None else gravity, dtype=float)
    if gravity.shape != (3,) or not (np.abs(gravity) <= LARGEST).all():
        raise ModelError(f"gravity must be three finite numbers of at most {LARGEST:.0e}, not {gravity}")
    kept = joints_to_keep(description, held)
    bodies, graphs = find_modules(description, kept)
    joints = [j.joint.name for j in bodies.joints]
    kinds = [j.joint.kind for j in bodies.joints]
    if base != "fixed":
        joints, kinds = [ROOT_JOINT, *joints], [JointKind.FLOATING, *kinds]
    q_slices = tuple(slices(kind.nq for kind in kinds))
    v_slices = tuple(slices(kind.nv for kind in kinds))
    home = home_of(description, bodies, kinds, base)
    tolerances = Tolerances(rank_tolerance, closure_tolerance)
    alike = like.modules if like is not None else ()
    build = ModuleBuilder(bodies, description, joints, q_slices, v_slices, home, tolerances, alike)
    if base == "floating":
        build.add_base()
    for graph in graphs:
        try:
            build.add(graph)
        except HybridynError as error:
            error.advice += _far_frame(description)
            raise
    return HybridRobot(
        description=description,
        base=base,
        gravity=gravity,
        modules=tuple(build.modules),
        joints=tuple(joints),
        kinds=tuple(kinds),
        q_slices=q_slices,
        v_slices=v_slices,
        motors=tuple(description.motors),
        bodies=bodies,
        closure_tolerance=closure_tolerance,
        home=home,
        rank_tolerance=rank_tolerance,
        held=kept,
        rebuild=_with_parameters,
    )


def _far_frame(description: Description) -> str:
    """Return the question about the unit of a closure's frame that is far beyond all joints, or ""."""
    size = max((float(np.linalg.norm(joint.placement[:3, 3])) for joint in description.joints), default=0.0)
    asked = (
        f". The frame of '{closure.name}' on '{link}' is {far:g} m from its link, and no joint is more than "
        f"{size:.3g} m from the one before it: millimetres?"
        for closure in description.closures
        for link, frame in ((closure.link_a, closure.frame_a), (closure.link_b, closure.frame_b))
        if (far := float(np.linalg.norm(frame[:3, 3]))) > FAR * size > 0
    )
    return next(asked, "")


def _with_parameters(robot: HybridRobot, values: Mapping[str, ArrayLike]) -> HybridRobot:
    """Build a robot with other parameters, see `HybridRobot.with_parameters`."""
    description, arguments = robot.description, [name for name in values if ":" not in name]
    if arguments:
        description = XacroArguments(description, arguments).expanded([values[name] for name in arguments])
    named = {name: value for name, value in values.items() if ":" in name}
    parameters = Parameters(description, list(named))
    slots = parameters.slot_values(parameters.vector(named)[None])[0]
    check_signs(parameters.slots, slots)
    return rebuilt(robot, with_values(description, parameters.slots, slots.tolist()), like=robot)


def rebuilt(
    robot: HybridRobot,
    description: Description | None = None,
    *,
    base: Base | None = None,
    held: Iterable[str] | None = None,
    like: HybridRobot | None = None,
) -> HybridRobot:
    """Build a robot with the choices of another one, but for those that are given.

    Args:
        description: Its description; that of the robot where left out.
        base: As for `build_robot`, likewise.
        held: As for `build_robot`, likewise.
        like: As for `build_robot`.

    Raises:
        ModelError: The description is no robot, or the rank of a module's closures is in doubt.
        AssemblyError: No posture closes the loops of a module.
    """
    return build_robot(
        robot.description if description is None else description, base=base or robot.base,
        gravity=robot.gravity, rank_tolerance=robot.rank_tolerance, closure_tolerance=robot.closure_tolerance,
        held=robot.held if held is None else held, like=like,
    )  # fmt: skip
