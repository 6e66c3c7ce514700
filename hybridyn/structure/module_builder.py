"""Build a robot's modules one after the other; equal modules share one mechanism."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..description.records import Description
from ..joints.kinds import JointKind
from ..linkage.joints import ROOT_JOINT, TreeJoint
from ..linkage.reduction import ROUNDED_ROWS
from ..spatial import Array, indices
from .bodies import Bodies
from .graph import ModuleGraph
from .mechanism import Mechanism, Tolerances
from .module import Module, check_mechanism
from .module_spec import ModuleSpec, module_spec

if TYPE_CHECKING:
    from collections.abc import Sequence


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
            whole=(joint,),
            source=(0,),
            bodies=(0, 1),
            platforms=(),
            closures=(),
            couplings=(),
            cut_closures=(),
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
