"""The numbers of one module in its own numbering, without names; modules with equal numbers are equal.

Body 0 is the base, and body i + 1 is the child of joint i. This holds in the whole tree (`structure.cut`), in
the tree after the cuts, whose joints come first in it, and in the spanning tree, which has its own numbers.
In the whole tree, `floating` joints connect the platforms to the base.
"""

import copyreg
import io
import pickle
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..joints.kinds import JointKind
from ..linkage.closures import Closures, TreeClosure
from ..linkage.couplings import TreeCoupling
from ..linkage.joints import TreeJoint
from ..linkage.motion import Motion
from ..linkage.reduction import LegBlock, Reduction
from ..linkage.tree import Tree
from ..spatial import Array, indices
from .bodies import Bodies, Body, first_extent
from .graph import ModuleGraph
from .wrists import Cutting, Wrist


@dataclass(frozen=True, eq=False)
class ModuleSpec:
    """The numbers of one module.

    Attributes:
        whole: Joints of the whole tree: those of the tree after the cuts, then those of each wrist.
        source: For each joint of `whole`, its number in `spanning`, or None for a platform.
        bodies: For each body of `whole`, its number in `spanning`.
        platforms: The `floating` joints of `tree` that move the platforms.
        closures: The author's closures, with bodies of `spanning`.
        couplings: The author's couplings, with joints of `spanning`.
        cut_closures: Closures after the cuts, with bodies of `tree`.
        wrists: The wrists that were cut.
        legs: Bodies of `tree` in each leg.
        outputs: Bodies of `tree` whose inertia belongs to the module and not to its legs: platforms, bases of
            other modules and, in a serial module, all bodies.
        leg_bodies: For each body of `tree` after the base, its inertia, or None for an output.
        home: Home position of the spanning tree, shape (nq,).
    """

    whole: tuple[TreeJoint, ...]
    source: tuple[int | None, ...]
    bodies: tuple[int, ...]
    platforms: tuple[int, ...]
    closures: tuple[TreeClosure, ...]
    couplings: tuple[TreeCoupling, ...]
    cut_closures: tuple[TreeClosure, ...]
    wrists: tuple[Wrist, ...]
    legs: tuple[tuple[int, ...], ...]
    outputs: tuple[int, ...]
    outputs_inertia: tuple[Body, ...]
    leg_bodies: tuple[Body | None, ...]
    home: Array

    @property
    def _kept(self) -> int:
        """Number of joints of the tree after the cuts."""
        return len(self.whole) - sum(len(wrist.joints) for wrist in self.wrists)

    @cached_property
    def tree(self) -> tuple[TreeJoint, ...]:
        """Joints of the tree after the cuts."""
        return self.whole[: self._kept]

    @cached_property
    def tree_joint(self) -> tuple[int | None, ...]:
        """For each joint of `tree`, its number in `spanning`, or None for a platform."""
        return self.source[: self._kept]

    @cached_property
    def tree_body(self) -> tuple[int, ...]:
        """For each body of `tree`, its number in `spanning`."""
        return self.bodies[: self._kept + 1]

    @cached_property
    def in_whole(self) -> tuple[int, ...]:
        """For each joint of `spanning`, its number in `whole`."""
        at = {joint: i for i, joint in enumerate(self.source) if joint is not None}
        return tuple(at[joint] for joint in range(len(at)))

    @cached_property
    def spanning(self) -> tuple[TreeJoint, ...]:
        """Joints of the spanning tree: those of `whole` without platforms, which wrists carry."""
        joints = (self.whole[i] for i in self.in_whole)
        return tuple(joint.on(self.bodies[joint.parent]) for joint in joints)

    @cached_property
    def cut_couplings(self) -> tuple[TreeCoupling, ...]:
        """The author's couplings, with joints of `tree`."""
        return tuple(c.of({i: self.in_whole[i] for i, _ in c.terms}) for c in self.couplings)

    @property
    def topology(self) -> tuple[object, ...]:
        """Everything but lengths, angles and masses: modules with equal topology may differ in these only."""
        joints = tuple(
            (j.kind, j.parent, tuple(np.asarray(j.axis).tolist()), j.pitch, source)
            for j, source in zip(self.whole, self.source, strict=True)
        )
        loops = tuple(
            tuple((c.body_a, c.body_b, c.translations, c.rotation) for c in closures)
            for closures in (self.closures, self.cut_closures)
        )
        wrists = tuple((w.joints, w.end, w.target, w.carries) for w in self.wrists)
        return joints, loops, wrists, tuple(c.form for c in self.couplings), self.platforms, self.outputs

    @cached_property  # pickled once: a mechanism may later cache values in the spec's joints
    def key(self) -> bytes:
        """Pickled content, equal for equal modules."""
        content = io.BytesIO()
        pickler = pickle.Pickler(content)
        pickler.dispatch_table = {**copyreg.dispatch_table, np.ndarray: _as_bytes}
        pickler.dump([getattr(self, field.name) for field in fields(self)])
        return content.getvalue()


def _as_bytes(x: Array) -> Any:
    """Return how an array is pickled to be compared: the same numbers have the same place, and so shape."""
    return x.__reduce__() if x.dtype.hasobject else (bytes, (x.tobytes(),))


def module_spec(bodies: Bodies, graph: ModuleGraph, home: Array, *, cut: bool = True) -> ModuleSpec:
    """Build the numbers of a module: its bodies and joints counted from zero, without names.

    Args:
        bodies: The robot's bodies.
        graph: The module.
        home: Home position of the module's spanning tree, shape (nq,).
        cut: Whether platforms and wrists are cut free. A cut replaces joints by closure rows. If rows are
            redundant and the file is rounded, the rows hold only in the least-squares sense, whereas joints
            hold exactly; modules of this kind are therefore not cut.
    """
    parts = _uncut(bodies, graph)
    closures, couplings = tuple(parts.closures), tuple(parts.couplings)
    if cut:
        parts.cut()
    parts.wrists.sort(key=lambda wrist: wrist.joints)
    whole, source, every_body = _whole_tree(parts)
    tree_body = every_body[: len(every_body) - sum(len(wrist.joints) for wrist in parts.wrists)]
    of_tree = {body: i for i, body in enumerate(tree_body)}
    serial = range(1, len(parts.bodies)) if not closures and not couplings else ()
    outputs = sorted({*parts.platforms, *parts.carried, *serial})
    return ModuleSpec(
        whole=tuple(whole),
        source=tuple(source),
        bodies=tuple(every_body),
        platforms=tuple(of_tree[body] - 1 for body in parts.platforms),
        closures=closures,
        couplings=couplings,
        cut_closures=tuple(_renumbered(c, of_tree) for c in parts.closures),
        wrists=tuple(parts.wrists),
        legs=tuple(tuple(of_tree[b] for b in leg) for leg in parts.legs()),
        outputs=tuple(of_tree[b] for b in outputs),
        outputs_inertia=tuple(parts.bodies[b] for b in outputs),
        leg_bodies=tuple(None if b in outputs else parts.bodies[b] for b in tree_body[1:]),
        home=home,
    )


def _uncut(bodies: Bodies, graph: ModuleGraph) -> Cutting:
    """Return a module before it is cut, counted from zero and without names."""
    joints = [bodies.joints[i] for i in graph.joints]
    number = {graph.base: 0} | {j.child: i + 1 for i, j in enumerate(joints)}
    joint_number = {joint: i for i, joint in enumerate(graph.joints)}
    couplings = tuple(c.of(joint_number) for c in graph.couplings)
    held = {i for joint, i in joint_number.items() if joint in graph.held}
    return Cutting(
        joints=tuple(j.in_tree("", number[j.parent]) for j in joints),
        records=[j.joint for j in joints],
        bodies=[bodies.bodies[b].nameless() for b in number],
        closures=[_renumbered(c, number) for c in graph.closures],
        couplings=couplings,
        carried=[number[b] for b in graph.carried],
        held=held | {i for c in couplings for i, _ in c.terms},
        reach=bodies.reach,
    )


def _renumbered(closure: TreeClosure, number: Mapping[int, int]) -> TreeClosure:
    """Return a closure between bodies of other numbers, without names."""
    return replace(closure, name="", kind="", body_a=number[closure.body_a], body_b=number[closure.body_b])


def _whole_tree(parts: Cutting) -> tuple[list[TreeJoint], list[int | None], list[int]]:
    """Build the whole tree: connect the platforms to the base, and append the wrists as branches.

    Returns:
        The joints of the tree, and the number in the spanning tree of each joint (None for a platform) and
        of each body.
    """
    gone = {j for w in parts.wrists for j in w.joints}
    whole: list[TreeJoint] = []
    source: list[int | None] = []
    bodies, number = [0], {0: 0}
    for i, joint in enumerate(parts.joints):
        if i + 1 in parts.platforms:
            whole.append(TreeJoint("", JointKind.FLOATING))
            source.append(None)
        elif i in gone:
            continue
        else:
            whole.append(joint.on(number[joint.parent]))
            source.append(i)
        number[i + 1] = len(whole)
        bodies.append(i + 1)
    for wrist in parts.wrists:
        parent = number[parts.joints[wrist.joints[0]].parent]
        for i in wrist.joints:
            whole.append(parts.joints[i].on(parent))
            source.append(i)
            bodies.append(i + 1)
            parent = len(whole)
    return whole, source, bodies


def module_length(spec: ModuleSpec, motion: Motion, robot_size: float) -> float:
    """Compute the extent of a module at home [m], rounded to a power of two so that scaling is exact.

    Args:
        spec: Numbers of the module.
        motion: Motion of its spanning tree at home.
        robot_size: Characteristic length of the robot [m], for modules that have no extent themselves: one
            joint, or joints that meet in a point.
    """
    points = [*motion.p[0]]
    points = points[1:] or points
    for c in spec.closures:
        points.append(motion.p[0, c.body_a] + motion.R[0, c.body_a] @ c.p_a)
        points.append(motion.p[0, c.body_b] + motion.R[0, c.body_b] @ c.p_b)
    extent = float(np.linalg.norm(np.ptp(np.array(points), axis=0)))
    return float(2.0 ** np.round(np.log2(first_extent(extent, robot_size))))


def freedom_units(tree: Tree, length: float) -> Array:
    """Return the unit of each freedom, shape (nv,): `length` if it is one, else one radian."""
    return np.where(tree.linear, length, 1.0)


def row_factors(tree: Tree, closures: Closures, length: float) -> Array:
    """Compute the factor that makes each closure row dimensionless, shape (rows,)."""
    out = np.where(closures.is_angle, 1.0, 1.0 / length)
    unit = freedom_units(tree, length)
    for i, coupling in enumerate(closures.couplings):
        at = closures.row_slices[len(closures.closures) + i]
        sizes = [size * unit[tree.v_slices[j].start] for j, size in coupling.sizes]
        out[at] = 1.0 / 2.0 ** np.round(np.log2(max(sizes)))
    return out


def leg_by_leg(spec: ModuleSpec, tree: Tree, closures: Closures, length: float) -> Reduction:
    """Build the elimination of a module's closures on the tree after the cuts, without fixed ranks."""
    shared = indices(tree.v_slices[i] for i in spec.platforms)
    scales = row_factors(tree, closures, length), freedom_units(tree, length)
    return Reduction(*scales, _blocks(spec, tree, closures), shared)


def _blocks(spec: ModuleSpec, tree: Tree, closures: Closures) -> list[LegBlock]:
    """Return the rows and columns of each leg; a row belongs to the leg that it constrains."""
    leg_of = {body: i for i, leg in enumerate(spec.legs) for body in leg}
    rows: list[list[int]] = [[] for _ in spec.legs]
    for c, at in zip(closures.closures, closures.row_slices, strict=False):
        leg = leg_of.get(c.body_a, leg_of.get(c.body_b))
        if leg is not None:
            rows[leg] += range(at.start, at.stop)
    for i, coupling in enumerate(closures.couplings):
        at = closures.row_slices[len(closures.closures) + i]
        rows[leg_of[coupling.terms[0][0] + 1]] += range(at.start, at.stop)
    cols = [indices(tree.v_slices[b - 1] for b in leg) for leg in spec.legs]
    return [LegBlock(np.array(r, dtype=int), c) for r, c in zip(rows, cols, strict=True)]
