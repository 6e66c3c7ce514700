"""Cut platforms and massless wrists free from the legs of a module, in the module's own numbering.

A *platform* is a body with at least three legs: if it and the base are removed, three or more legs remain. A
platform is cut free from the leg that carries it in the spanning tree.

A *wrist* is a chain of massless passive joints that constrains two bodies exactly as one closure does: a
single joint, two revolute joints whose axes intersect at a right angle (universal), or three whose axes
intersect in one point (spherical). If wrists at the ends of legs are cut, a leg keeps only the joints that
move mass. The positions of the cut joints follow from the bodies that the wrist connects.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ..description.groups import Groups
from ..description.records import Joint
from ..joints.kinds import JointKind, RotationKind
from ..linkage.closures import TreeClosure
from ..linkage.couplings import TreeCoupling
from ..linkage.joints import TreeJoint
from ..spatial import Array, cross
from .bodies import Body

#: Axes of a wrist must intersect to this part of the robot's reach, and the cosine between the axes of a
#: universal joint must be below this. Otherwise a cut would change the mechanism.
EXACT = 1e-13
#: Fewest legs of a platform.
PLATFORM_LEGS = 3

#: A closure that replaces a chain of joints: its translations and rotation, and its point in the children of
#: the first joint and of the last.
Form = tuple[tuple[tuple[int, ...], RotationKind], Array, Array]


class Wrist(NamedTuple):
    """A chain of joints that is replaced by one closure.

    Attributes:
        joints: Joints of the chain, outwards.
        end: Body at the end of the chain.
        target: Body to which `end` is fixed: `end` itself if the chain carries a platform, another body if a
            weld closes the loop.
        R: Axes of `end` in `target`, shape (3, 3).
        p: Origin of `end` in `target`, shape (3,), [m].
        carries: Whether the end is a platform.
        closure: Number of the closure that replaces the chain, among the closures after the cuts.
    """

    joints: tuple[int, ...]
    end: int
    target: int
    R: Array
    p: Array
    carries: bool
    closure: int


@dataclass(eq=False)
class Cutting:
    """A module while it is cut; body 0 is its base, and body i + 1 the child of joint i.

    Attributes:
        joints: Joints of its spanning tree.
        records: Records of these joints in the description.
        bodies: Its bodies, the base first.
        closures: Its closures; those that are cut are replaced.
        couplings: Its couplings.
        carried: Bodies that carry another module.
        held: Joints that must not be cut.
        reach: Longest offset from one joint of the robot to the next [m].
        wrists: The wrists that are cut.
        platforms: The bodies that are cut free.
    """

    joints: Sequence[TreeJoint]
    records: Sequence[Joint]
    bodies: Sequence[Body]
    closures: list[TreeClosure]
    couplings: Sequence[TreeCoupling]
    carried: Sequence[int]
    held: set[int]
    reach: float
    wrists: list[Wrist] = field(default_factory=list)
    platforms: list[int] = field(default_factory=list)

    def cut(self) -> None:
        """Cut the terminal wrists, choose the platforms, and cut these free."""
        if self.closures:
            self._cut_terminal_wrists()
        for body in range(1, len(self.bodies)) if self.closures else ():
            if self._is_platform(body) and (found := self._chain(self.closures, body)):
                wrist = Wrist(found[0], body, body, np.eye(3), np.zeros(3), True, len(self.closures))
                self.platforms.append(body)
                self.wrists.append(wrist)
                self.closures.append(self._equivalent(wrist, *found[1]))

    def legs(self) -> list[list[int]]:
        """Group the bodies that stay connected when the base and the platforms are removed."""
        return self._components({0, *self.platforms})

    def _cut_terminal_wrists(self) -> None:
        """Replace a weld to a massless body at the end of a wrist by one closure equivalent to the wrist."""
        for at, closure in enumerate(list(self.closures)):
            if closure.rotation != "fixed" or closure.translations != (0, 1, 2):
                continue
            for end, other in ((closure.body_b, closure.body_a), (closure.body_a, closure.body_b)):
                rest = [c for c in self.closures if c is not closure]
                found = self._chain(rest, end) if self._is_free_end(rest, end) else None
                if found and other not in [j + 1 for j in found[0]]:
                    wrist = Wrist(found[0], end, other, *_weld(closure, end), False, at)
                    self.wrists.append(wrist)
                    self.closures[at] = self._equivalent(wrist, *found[1])
                    break

    def _is_free_end(self, closures: list[TreeClosure], body: int) -> bool:
        """Return True if a massless body is connected to others by its own joint and one closure only."""
        return (
            body != 0
            and self.bodies[body].massless
            and body not in self.carried
            and not any(body in (c.body_a, c.body_b) for c in closures)
            and not any(joint.parent == body for joint in self.joints)
        )

    def _chain(self, closures: list[TreeClosure], end: int) -> tuple[tuple[int, ...], Form] | None:
        """Find the longest chain of joints above a body that one closure can replace.

        Args:
            closures: The closures that the chain must not touch between its ends.
            end: Body at the end of the chain.

        Returns:
            The joints and the form of the closure, or None if there is no such chain.
        """
        chain: list[int] = []
        body, best = end, None
        while len(chain) < 3 and body:
            joint, record = self.joints[body - 1], self.records[body - 1]
            acts = record.damping or record.friction or record.rotor_inertia
            if body - 1 in self.held or acts or joint.kind is JointKind.FLOATING:
                break
            chain.insert(0, body - 1)
            if form := self._form([self.joints[i] for i in chain]):
                best = tuple(chain), form
            body = joint.parent
            neighbours = sum(other.parent == body for other in self.joints)
            closed = any(body in (c.body_a, c.body_b) for c in closures)
            if not self.bodies[body].massless or neighbours > 1 or closed or body in self.carried:
                break
        return best

    def _form(self, chain: list[TreeJoint]) -> Form | None:
        """Return the form of the closure that is equivalent to a chain of joints, or None."""
        if len(chain) == 1:
            form = chain[0].kind.closure
            return form and (form, np.zeros(3), np.zeros(3))
        if not all(joint.kind.hinge for joint in chain):
            return None
        before, after = (self._crossing(*two) for two in (chain[:2], chain[-2:]))
        if before is None or after is None:
            return None
        second, last = chain[1], chain[-1]
        point = last.R.T @ (after - last.p)
        if len(chain) == 2:
            right = abs(chain[0].axis @ second.R @ second.axis) < EXACT
            return (((0, 1, 2), "perpendicular"), before, point) if right else None
        # Both intersections must be the same point of the second axis, expressed in the second joint's child.
        apart = second.R.T @ (before - second.p) - after
        return (((0, 1, 2), "free"), before, point) if apart @ apart <= (EXACT * self.reach) ** 2 else None

    def _crossing(self, first: TreeJoint, second: TreeJoint) -> Array | None:
        """Compute the point where two adjacent revolute axes intersect, in the body between them, or None."""
        a, b, p = first.axis, second.R @ second.axis, second.p
        normal = cross(a, b)
        if normal @ normal < 1e-6:
            return None  # nearly parallel axes do not form a wrist
        if abs(normal @ p) > EXACT * self.reach * np.linalg.norm(normal.astype(float)):
            return None
        along = cross(p, b) @ normal / (normal @ normal)
        return along * a

    def _equivalent(
        self, wrist: Wrist, form: tuple[tuple[int, ...], RotationKind], c_first: Array, c_last: Array
    ) -> TreeClosure:
        """Build the closure of a form between a wrist's parent and its target."""
        first, last = self.joints[wrist.joints[0]], self.joints[wrist.joints[-1]]
        turn_a, turn_b = axis_frame(first.axis), axis_frame(last.axis)
        if form[1] == "free" or form[0] == (2,):  # no axis, or that of the frame
            turn_a = turn_b = np.eye(3)
        return TreeClosure(
            "", "",
            first.parent, first.R @ turn_a, first.p + first.R @ c_first,
            wrist.target, wrist.R @ turn_b, wrist.p + wrist.R @ c_last,
            *form,
        )  # fmt: skip

    def _edges(self) -> list[tuple[int, int]]:
        """List the edges of the module's graph after the cuts, as pairs of bodies."""
        gone = {i for w in self.wrists for i in w.joints}
        edges = [(joint.parent, i + 1) for i, joint in enumerate(self.joints) if i not in gone]
        edges += [(c.body_a, c.body_b) for c in self.closures]
        for coupling in self.couplings:
            first = coupling.terms[0][0] + 1
            edges += [(first, i + 1) for i, _ in coupling.terms[1:]]
        return edges

    def _components(self, without: Iterable[int]) -> list[list[int]]:
        """Group the bodies into the connected components that remain without some of them."""
        gone = {i + 1 for w in self.wrists for i in w.joints}
        left = set(range(len(self.bodies))) - gone - set(without)
        groups: Groups[int] = Groups()
        for edge in self._edges():
            if left.issuperset(edge):
                groups.join_all(edge)
        return groups.classes(sorted(left))

    def _is_platform(self, body: int) -> bool:
        """Return whether at least `PLATFORM_LEGS` legs touch a body.

        Legs are the adjacent components that remain without the body and the base, and the direct joints
        between the two. There are at most as many as edges at the body, which decide for most bodies.
        """
        at_body = [edge for edge in self._edges() if body in edge]
        if len(at_body) < PLATFORM_LEGS:
            return False
        near = {b if a == body else a for a, b in at_body}
        components = self._components({0, body, *self.platforms})
        direct = sum(1 for edge in at_body if {*edge} == {body, 0})
        return sum(1 for c in components if near & set(c)) + direct >= PLATFORM_LEGS


def _weld(closure: TreeClosure, end: int) -> tuple[Array, Array]:
    """Return the placement of body `end` in the body to which a closure welds it."""
    Ra, pa, Rb, pb = closure.R_a, closure.p_a, closure.R_b, closure.p_b
    if end == closure.body_a:
        Ra, pa, Rb, pb = Rb, pb, Ra, pa
    R = Ra @ Rb.T
    return R, pa - R @ pb


def axis_frame(axis: Array) -> Array:
    """Return orthonormal axes, shape (3, 3), whose third axis is `axis`."""
    other = np.zeros(3)
    other[np.argmin(np.abs(axis))] = 1.0
    x = cross(other, axis)
    x /= np.linalg.norm(x)
    return np.stack([x, cross(axis, x), axis], axis=1)
