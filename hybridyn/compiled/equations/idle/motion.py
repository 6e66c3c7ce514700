"""Find the idle motions of a module.

Idle motions are spins: a rod between two balls turns about its axis, which moves no output, motor or centre
of mass. A spin is a motion of one joint about a line that is fixed in the joint's body. The closures of the
loops do not feel it, so it is an independent motion, however the others are chosen. The motions of a module
are its spins, and motions orthogonal to them, as the general path takes them. Where a rod's foot rests on the
base, those need the same forces whatever accelerations the caller gives to the spins; an arm that moves turns
the rod about its line, too, and feels them.
"""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ....assembly.free_motions import IDLE, effects
from ....linkage.loop_problem import LoopProblem
from ....linkage.tree import Tree
from ....spatial import Array, Index, motion_to_body
from ....structure.mechanism import Mechanism
from ....structure.module import Module
from ....symbols import Expression, dot, is_zero, times
from ..expressions import TURNED_ROUNDING, numbers, snap
from ..rigid import BallAxes, Links, freedoms, momentum
from ..rods import UNFELT


@dataclass(frozen=True, eq=False)
class IdleMotion:
    """An idle motion of one joint, a spin.

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

    @property
    def key(self) -> tuple[object, ...]:
        """What is equal for motions that the same kernels know."""
        return self.cols, tuple(self.axis.tolist())

    def taken_out(self, X: Expression) -> None:
        """Make motions orthogonal to the spin in place, shape (n, motions)."""
        at = list(self.cols)
        share = dot(self.share, X[at])
        for i, x in zip(at, self.axis, strict=True):
            X[i] = [
                y if is_zero(x) or is_zero(z) else y - times(x, z) for y, z in zip(X[i], share, strict=True)
            ]

    def at(self, number: dict[int, int] | Index) -> IdleMotion:
        """Return the spin with its freedoms numbered anew."""
        return replace(self, cols=tuple(int(number[col]) for col in self.cols))

    def in_own_axes(self, links: Links) -> IdleMotion:
        """Return the spin from that in axes of the file: about the third axis of a ball that has own axes."""
        ball = self._ball(links)
        if not ball:
            return self
        axis, share = np.abs([ball.rates @ self.axis, ball.rates @ self.share])  # the line may point back
        return replace(self, axis=snap(axis, TURNED_ROUNDING), share=snap(share, TURNED_ROUNDING))

    def in_file(self, links: Links) -> IdleMotion:
        """Return the spin in axes of the file from that of `in_own_axes`."""
        ball = self._ball(links)
        if not ball:
            return self
        return replace(self, axis=ball.rates.T @ self.axis, share=ball.rates.T @ self.share)

    def _ball(self, links: Links) -> BallAxes | None:
        """Return the axes of its joint, one of some links, if these are not those of the file."""
        return next(links[i].ball for i, at in freedoms(links).items() if at.start == self.cols[0])

    def moves(self, tree: Tree, bodies: Sequence[int]) -> bool:
        """Return whether its joint moves one of some bodies of the tree after the cuts."""
        return bool(tree.support[list(bodies)][:, list(self.cols)].any())


def idle_motions(m: Mechanism, driven: Container[int]) -> list[IdleMotion]:
    """Find the idle motions of a module.

    Args:
        m: Its numbers.
        driven: Freedoms of the tree after the cuts that motors drive.
    """
    out: list[IdleMotion] = []
    if not m.closures.rows or not m.mobility:
        return out
    K = m.reduction.scaled(m.generic_K)
    motion = m.tree.sweep(m.postures)
    moved = effects(m, motion)
    for i, (joint, at) in enumerate(zip(m.tree.joints, m.tree.v_slices, strict=True)):
        cols, unit = range(at.start, at.stop), m.reduction.col_scale[at]
        if (
            not (joint.kind.ball or joint.kind.hinge)
            or i in m.spec.platforms
            or any(col in driven for col in cols)
        ):
            continue
        _, s, Vt = np.linalg.svd(K[:, :, at].reshape(-1, len(cols)))
        axis = snap(Vt[-1] * np.sign(Vt[-1][np.argmax(np.abs(Vt[-1]))]))
        alone = len(cols) == 1 or s[-2] > IDLE
        if (
            s[-1] <= UNFELT * np.sqrt(len(K))
            and alone
            and np.abs(moved[:, :, at] @ (unit * axis)).max(initial=0.0) <= IDLE
        ):
            out.append(IdleMotion(tuple(cols), unit * axis, axis / unit))
    return out


def lines_of_balls(
    m: Mechanism, idle: Sequence[IdleMotion], marks: Sequence[str], fixed: Container[int]
) -> dict[int, Array]:
    """Return the axes of the spins on balls by joint, body's axes: all of them, if one is no coordinate axis.

    Args:
        m: Numbers of the module.
        idle: Its idle motions.
        marks: What acts on each freedom of its tree; where something does, it acts in the axes of the file.
        fixed: Bodies whose axes must not change.
    """
    joint = {at.start: i for i, at in enumerate(m.tree.v_slices)}
    lines = {
        joint[spin.cols[0]]: spin.axis / np.linalg.norm(spin.axis)
        for spin in idle
        if len(spin.cols) == 3 and not any(marks[col] for col in spin.cols)
    }
    lines = {i: line for i, line in lines.items() if i + 1 not in fixed}
    for i, body in enumerate(m.spec.leg_bodies):
        if i in lines and body and lines[i] @ body.com < 0.0:
            lines[i] = -lines[i]  # those of equal legs point the same way
    return lines if any(np.abs(snap(line)).max() < 1.0 for line in lines.values()) else {}


def idle_among(idle: Sequence[IdleMotion], tree_v: Index) -> tuple[IdleMotion, ...]:
    """Return the idle motions of some freedoms, numbered among these."""
    number = {int(col): k for k, col in enumerate(tree_v)}
    return tuple(spin.at(number) for spin in idle if number.keys() >= {*spin.cols})


def left_open(module: Module, problem: LoopProblem) -> tuple[IdleMotion, ...]:
    """Return the idle motions of a module that neither loops nor targets determine."""
    m, unit = module.mechanism, problem.col_scale
    K = problem.matrix(m.tree.sweep(m.postures))
    return tuple(
        spin
        for spin in idle_motions(m, module.motor_columns)
        if problem.free[list(spin.cols)].all()
        and np.abs(K[:, :, spin.cols] @ (spin.axis / unit[list(spin.cols)])).max() <= UNFELT
    )


def take_out_idle(module: Module, rates: Array) -> None:
    """Make rates or accelerations of a module's tree after the cuts orthogonal to its idle motions, in place.

    Args:
        rates: Shape (T, nv).
    """
    for spin in idle_motions(module.mechanism, module.motor_columns):
        spin.taken_out(rates.T)


def twists_of(spin: IdleMotion, links: Links) -> dict[int, Expression]:
    """Return the twists of its body, and of slides on it, at a spin of one; by body, own frames."""
    first = next(i for i, at in freedoms(links).items() if at.start == spin.cols[0])
    twists = {first + 1: dot(numbers(links[first].S), numbers(spin.axis))}
    for i, link in links.items():
        if link.kind.slides and link.parent in twists:
            twists[i + 1] = motion_to_body(numbers(link.R), numbers(link.p), twists[link.parent])
    return twists


def momenta(spin: IdleMotion, links: Links) -> dict[int, Expression]:
    """Compute the momentum of each body that a spin of one moves, own frames, shape (6,)."""
    return {i: momentum(numbers(links[i - 1].inertia), V) for i, V in twists_of(spin, links).items()}


def first_moment(spin: IdleMotion, links: Links) -> Expression:
    """Compute how far a spin of one moves the mass of its body and of slides on it, shape (3 bodies,)."""
    return np.concatenate([P[:3] for P in momenta(spin, links).values()])
