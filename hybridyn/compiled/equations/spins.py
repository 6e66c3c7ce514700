"""Idle spins: a rod between two balls turns about its axis, which moves no output, motor or centre of mass.

A spin is a motion of one joint about a line that is fixed in the joint's body. The closures of the loops do
not feel it, so it is an independent motion, however the others are chosen. The motions of a module are its
spins, and motions orthogonal to them, as the general path takes them: those need the same forces whatever
accelerations the caller gives to the spins.
"""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...assembly.free_motions import IDLE, effects
from ...linkage.closures import TreeClosure
from ...spatial import Array
from ...structure.mechanism import Mechanism
from ...structure.wrists import axis_frame
from .chains import motion_subspace
from .expressions import Expression, dot, is_zero, numbers, snap, times
from .rigid import TURNING, Link, momentum, to_child

#: A closure does not feel a motion that opens it by less than this, without units: rounding.
UNFELT = 1e-13
#: Joints that may spin.
SPINNING = ("spherical", "floating", *TURNING)


@dataclass(frozen=True, eq=False)
class Spin:
    """An idle motion of one joint.

    Attributes:
        cols: Freedoms of the joint, in the tree after the cuts, a core or a leg.
        axis: Rates of these freedoms at a spin of one.
        share: Weights of these freedoms: the spin in a motion is their sum, 0 for motions orthogonal to it.
    """

    cols: tuple[int, ...]
    axis: Expression
    share: Expression

    @property
    def col(self) -> int:
        """The freedom that stands for the spin: the others can make up for it."""
        return self.cols[self.main]

    @property
    def main(self) -> int:
        """The number of this freedom in the joint."""
        return int(np.argmax(np.abs(np.array(self.axis * self.share, dtype=float))))

    def taken_out(self, X: Expression) -> None:
        """Make motions orthogonal to the spin in place, shape (n, motions)."""
        at = list(self.cols)
        share = dot(self.share, X[at])
        for i, x in zip(at, self.axis, strict=True):
            X[i] = [
                y if is_zero(x) or is_zero(z) else y - times(x, z) for y, z in zip(X[i], share, strict=True)
            ]

    def at(self, number: dict[int, int]) -> Spin:
        """Return the spin with its freedoms numbered anew."""
        return replace(self, cols=tuple(number[col] for col in self.cols))


def spins_of(m: Mechanism, driven: Container[int]) -> list[Spin]:
    """Find the idle spins of a module.

    Args:
        m: Its numbers.
        driven: Freedoms of the tree after the cuts that motors drive.
    """
    out: list[Spin] = []
    if not m.closures.rows or not m.mobility:
        return out
    K = m.reduction.scaled(m.generic_K)
    motion = m.tree.sweep(m.postures)
    moved = effects(m, motion)
    for i, (joint, at) in enumerate(zip(m.tree.joints, m.tree.v_slices, strict=True)):
        cols, unit = range(at.start, at.stop), m.reduction.col_scale[at]
        if joint.kind not in SPINNING or i in m.spec.platforms or any(col in driven for col in cols):
            continue
        _, s, Vt = np.linalg.svd(K[:, :, at].reshape(-1, len(cols)))
        axis = snap(Vt[-1] * np.sign(Vt[-1][np.argmax(np.abs(Vt[-1]))]))
        alone = len(cols) == 1 or s[-2] > IDLE
        if (
            s[-1] <= UNFELT * np.sqrt(len(K))
            and alone
            and np.abs(moved[:, :, at] @ (unit * axis)).max(initial=0.0) <= IDLE
        ):
            out.append(Spin(tuple(cols), unit * axis, axis / unit))
    return out


def first_moment(spin: Spin, links: Sequence[Link]) -> Expression:
    """Compute how far a spin of one moves the mass of its body and of slides on it, shape (3 bodies,)."""
    ends = np.cumsum([0, *(link.nv for link in links)]).tolist()
    first = ends.index(spin.cols[0])
    twists = {first + 1: dot(motion_subspace(links[first]), numbers(spin.axis))}
    for i, link in enumerate(links):
        if link.kind == "prismatic" and link.parent in twists:
            twists[i + 1] = to_child(numbers(link.R), numbers(link.p), twists[link.parent])
    return np.concatenate([momentum(numbers(links[i - 1].inertia), V)[:3] for i, V in twists.items()])


@dataclass(frozen=True, eq=False)
class Rod:
    """The side of a closure on a rod that turns about a point, in whose axes the closure's rows are sparse.

    Rows in other axes have no pivot that is large at every posture: the rod's turns move its end sideways.

    Attributes:
        on_a: Whether the rod is the closure's predecessor.
        axes: Axes of the rows in the rod's body, the third along the rod, shape (3, 3).
        turns: Freedoms of the joints about the point; they do not move the rod's end along the rod.
    """

    on_a: bool
    axes: Array
    turns: tuple[int, ...]


def rods_of(links: Sequence[Link], closures: Sequence[TreeClosure]) -> dict[int, Rod]:
    """Return the rods of closures by the closure's number; of one tree, in plain numbers."""
    out: dict[int, Rod] = {}
    for k, c in enumerate(closures):
        if not _is_ball(c):
            continue
        for on_a, body, point in ((True, c.body_a, c.p_a), (False, c.body_b, c.p_b)):
            found = _free_rod(links, closures, k, body, point) or _rod(links, body, point)
            if found:
                out[k] = Rod(on_a, *found)
                break
    return out


def _is_ball(closure: TreeClosure) -> bool:
    return closure.translations == (0, 1, 2) and closure.rotation == "free"


def _free_rod(
    links: Sequence[Link], closures: Sequence[TreeClosure], number: int, body: int, point: Array
) -> tuple[Array, tuple[int, ...]] | None:
    """Return `_rod` of a body on a floating joint that a ball and another one hold, and nothing else."""
    if not body or links[body - 1].kind != "floating" or any(link.parent == body for link in links):
        return None
    others = [c for k, c in enumerate(closures) if k != number and body in (c.body_a, c.body_b)]
    if len(others) != 1 or not _is_ball(others[0]):
        return None
    line = point - (others[0].p_a if others[0].body_a == body else others[0].p_b)
    length, first = float(np.linalg.norm(line)), sum(link.nv for link in links[: body - 1])
    if not length:
        return None
    beside = np.abs(np.cross(point, line)).max() > UNFELT * length
    turns = () if beside else tuple(range(first + 3, first + 6))
    return snap(axis_frame(snap(line / length))), turns


def _rod(links: Sequence[Link], body: int, point: Array) -> tuple[Array, tuple[int, ...]] | None:
    """Return the axes and the turning freedoms of the rod that ends at a point of a body, or None.

    A rod is a body on a ball or a universal joint, or slides along its line on one.
    """
    line, turn = [point], np.eye(3)
    while body and links[body - 1].kind == "prismatic":
        link = links[body - 1]
        turn = turn @ link.R.T
        line += [turn @ link.R @ link.axis, turn @ link.p]
        body = links[body - 1].parent
    joints = [body - 1] if body else []
    if joints and links[body - 1].kind in TURNING and np.abs(links[body - 1].p).max() <= UNFELT:
        joints.append(links[body - 1].parent - 1)
    kinds = [links[i].kind for i in joints if i >= 0]
    if kinds != ["spherical"] and not (len(kinds) == 2 and {*kinds} <= {*TURNING}):
        return None
    lengths = np.linalg.norm(line, axis=1)
    axis = line[int(np.argmax(lengths))] / (lengths.max() or 1.0)
    if not lengths.max() or np.abs(np.cross(line, axis)).max() > UNFELT * max(lengths.max(), 1.0):
        return None
    ends = np.cumsum([0, *(link.nv for link in links)])
    turns = [col for i in joints for col in range(ends[i], ends[i + 1])]
    return snap(axis_frame(snap(axis))), tuple(turns)
