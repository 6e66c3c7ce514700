"""Build the picture of a robot from the shapes in its files, and from primitives for bodies without shapes.

A body without shapes is drawn as a rod between its joints, or as a plate if it has three joints or more.
Joints are cylinders about their axes, or balls if they have no axis. Motors are dark, closures yellow.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from ..colours import CLOSURE, GROUND, JOINT, MOTOR, lighter, module_colour
from ..description.records import Closure
from ..joints.kinds import JointKind
from ..spatial import Array, Index
from ..structure.robot import HybridRobot
from .picture import BodyPoint, Picture, PictureShape, Role
from .placing import Placement, extent, place_bodies, stretched
from .visuals import Visual

#: Radius of a rod relative to its module's length.
THIN = 0.018
DRUM, BALL, HUB = 1.9, 1.7, 1.35  # radii over the rod's: a motor's drum, a closure, a passive joint
#: Half of a plate's thickness relative to the rod's radius.
PLATE = 1.2
#: Points whose spread across is a smaller part of that along are a limb: rods that meet, and no plate.
NARROW = 0.3
#: Points closer than this, relative to the module's length, are merged.
SAME_PLACE = 1e-6
#: Part of a prismatic joint's rod at home that its motor covers.
BARREL = 0.55
#: Half of a drum's length relative to its radius.
LENGTH = 1.6
#: Sides of a rod, and subdivisions of a ball's twenty triangles.
SIDES, FINE = 24, 2
LEG, SLIDE = 0.18, 0.5  # how much paler than its module's platform a leg is, and the sliding part of it


def draw(robot: HybridRobot, visuals: Sequence[Visual] = (), notes: Sequence[str] = ()) -> Picture:
    """Build the picture of a robot.

    Args:
        visuals: Shapes from the robot's files.
        notes: Remarks that are shown with the picture.
    """
    pen = _Pen(robot, {robot.bodies.place[visual.link][0] for visual in visuals})
    for visual in visuals:
        pen.add_visual(visual)
    pen.add_bodies()
    pen.add_joints()
    for closure in robot.description.closures:
        pen.add_closure(closure)
    picture = Picture(tuple(pen.shapes), np.zeros((2, 3)), tuple(notes))
    return replace(picture, corners=extent(picture, pen.home))


class _Pen:
    """Collects the shapes of a robot."""

    def __init__(self, robot: HybridRobot, shaped: set[int]) -> None:
        self.robot, self.shaped = robot, shaped
        self.shapes: list[PictureShape] = []
        self.home: Placement = place_bodies(robot, robot.home)
        lengths = [m.mechanism.length for m in robot.modules if m.closures]
        self.length = float(np.median(lengths)) if lengths else robot.bodies.reach

    def module_of(self, body: int) -> int:
        """Return the number of the module that moves a body."""
        return self.robot.body_owner[body][0]

    def radius(self, module: int) -> float:
        """Return the radius of a module's rods."""
        if module >= 0 and self.robot.modules[module].closures:
            return THIN * float(self.robot.modules[module].mechanism.length)
        own = {body for body, (owner, _) in self.robot.body_owner.items() if owner == module}
        near = [j.p for j in self.robot.bodies.joints if module >= 0 and own & {j.parent, j.child}]
        reach = max((float(np.linalg.norm(p)) for p in near), default=0.0)
        return THIN * min(reach or self.length, self.length)

    def add_visual(self, visual: Visual) -> None:
        """Add a shape from the robot's files."""
        body, R, p = self.robot.bodies.place[visual.link]
        mesh = visual.vertices @ R.T + p, visual.faces
        self._add(visual.link, "link", self.module_of(body), body, mesh, self.colour(body), visual.colour)

    def colour(self, body: int) -> str:
        """Return the colour of a body: that of its module, paler for legs."""
        module = self.module_of(body)
        if module < 0:
            return GROUND
        m = self.robot.modules[module]
        if not m.closures or body in {self.robot.bodies.place[link][0] for link in m.outputs}:
            return module_colour(module)
        sliding = self.robot.bodies.joints[body - 1].joint.kind.slides
        return lighter(module_colour(module), SLIDE if sliding else LEG)

    def add_bodies(self) -> None:
        """Add rods or plates through the joints of the bodies that have no shapes."""
        points = self._points_of_bodies()
        for body in self.robot.bodies.bodies:
            number = body.joint + 1
            if number in self.shaped:
                continue
            own, module = points[number], self.module_of(number)
            if len(own) == 1 and not np.allclose(body.com, own[0], atol=SAME_PLACE * self.length):
                own = [own[0], body.com] if body.mass else own  # a hand, a pendulum
            if len(own) >= 3 and self._add_plate(body.name, module, number, np.array(own)):
                continue
            if len(own) < 2:
                continue
            colour = self.colour(number)
            centre = own[0] if len(own) == 2 else np.mean(own, axis=0)
            for end in own[1:] if len(own) == 2 else own:
                self._rod(
                    body.name, "link", module, BodyPoint(number, centre), BodyPoint(number, end), colour
                )

    def _points_of_bodies(self) -> list[list[Array]]:
        """Return for each body the distinct positions of its joints and closures in the body's frame, [m]."""
        bodies = self.robot.bodies
        points: list[list[Array]] = [[] for _ in bodies.bodies]
        for joint in bodies.joints:
            if joint.joint.kind is not JointKind.FLOATING:  # which holds a body nowhere
                points[joint.parent].append(joint.p)
                points[joint.child].append(np.zeros(3))
        for closure in self.robot.description.closures:
            for end in _ends(self.robot, closure):
                points[end.body].append(end.at)
        return [_distinct(own or [np.zeros(3)], SAME_PLACE * self.length) for own in points]

    def _add_plate(self, name: str, module: int, body: int, points: Array) -> bool:
        """Add the hull of three or more points; return False if they lie near a line."""
        found = hull(points, PLATE * self.radius(module))
        if found is None:
            return False
        self._add(name, "link", module, body, found, self.colour(body))
        return True

    def add_joints(self) -> None:
        """Add the joints: drums about axes, extending rods for prismatic joints, balls for the others."""
        motors = set(self.robot.motors)
        crowded = self._crowded()
        for joint in self.robot.bodies.joints:
            record, module = joint.joint, self.module_of(joint.child)
            shaped = {joint.parent, joint.child} <= self.shaped
            start, end = BodyPoint(joint.parent, joint.p), BodyPoint(joint.child, np.zeros(3))
            driven = record.name in motors
            if record.kind.slides:
                if not {joint.parent, joint.child} & self.shaped:
                    self._slide(record.name, module, start, end, driven)
            elif driven and record.kind.hinge:
                self._drum(record.name, module, end, record.axis, driven)
            elif joint.child in crowded:
                if crowded[joint.child] == joint.child and not shaped:
                    self._ball(record.name, "joint", module, end, HUB, JOINT)
            elif not {joint.parent, joint.child} & self.shaped:
                if record.kind.hinge:
                    self._drum(record.name, module, end, record.axis, driven)
                else:
                    self._ball(record.name, "joint", module, end, HUB, JOINT)

    def _crowded(self) -> dict[int, int]:
        """Find universal and ball joints made of passive hinges; map each of their bodies to the last one.

        The axes of such hinges meet in one point, where drums would overlap: one ball is drawn instead.
        """
        motors = set(self.robot.motors)
        last: dict[int, int] = {}
        bodies = self.robot.bodies.joints
        passive = {j.child for j in bodies if j.joint.kind.hinge and j.joint.name not in motors}
        for joint in reversed(bodies):
            if {joint.parent, joint.child} <= passive and np.abs(joint.p).max() <= SAME_PLACE * self.length:
                last[joint.parent] = last.setdefault(joint.child, joint.child)
        return last

    def _slide(self, name: str, module: int, start: BodyPoint, end: BodyPoint, driven: bool) -> None:
        """Add a prismatic joint: a rod from parent to child, with the motor around its first part."""
        self._rod(name, "link", module, start, end, self.colour(end.body), scale=0.75)
        if not driven:
            return
        home = self.home.seen_from(start.body)
        low, high = start.at, start.at + BARREL * (home.at(end) - start.at)
        if np.linalg.norm(high - low) <= SAME_PLACE * self.length:  # the slide is at zero
            axis = home.R[end.body] @ self.robot.bodies.joints[end.body - 1].joint.axis * self.radius(module)
            low, high = start.at - 6 * axis, start.at + 2 * axis
        self._rod(
            name, "motor", module, BodyPoint(start.body, low), BodyPoint(start.body, high), MOTOR, scale=1.5
        )

    def _drum(self, name: str, module: int, at: BodyPoint, axis: Array, driven: bool) -> None:
        scale = DRUM if driven else HUB
        half = axis * LENGTH * self.radius(module) * (1.0 if driven else 0.8)
        ends = BodyPoint(at.body, at.at - half), BodyPoint(at.body, at.at + half)
        role: Role = "motor" if driven else "joint"
        self._rod(name, role, module, *ends, MOTOR if driven else JOINT, scale=scale)

    def add_closure(self, closure: Closure) -> None:
        """Mark a closure at both of its frames, which coincide if it constrains translations."""
        a, b = _ends(self.robot, closure)
        module = self.module_of(b.body)
        if module < 0 or not set(self.robot.modules[module].closures) & {closure.name}:
            module = self.module_of(a.body)
        frame = closure.frame_a[:3, 2]
        if closure.rotation == "parallel":
            R = self.robot.bodies.place[closure.link_a][1]
            half = R @ frame * LENGTH * self.radius(module)
            ends = BodyPoint(a.body, a.at - half), BodyPoint(a.body, a.at + half)
            self._rod(closure.name, "closure", module, *ends, CLOSURE, scale=BALL)
        else:
            self._ball(closure.name, "closure", module, a, BALL, CLOSURE)
        self._ball(closure.name, "closure", module, b, 0.9 * BALL, CLOSURE)

    def _rod(
        self,
        name: str,
        role: Role,
        module: int,
        start: BodyPoint,
        end: BodyPoint,
        colour: str,
        scale: float = 1.0,
    ) -> None:
        rod, radius = _unit_rod(), scale * self.radius(module)
        corners = rod.vertices * [radius, radius, 1.0]
        grows = start.body != end.body
        if not grows:
            corners = stretched(corners, start.at, end.at)
        ends = (start, end) if grows else None
        self._add(name, role, module, start.body, (corners, rod.faces), colour, ends=ends)

    def _ball(self, name: str, role: Role, module: int, at: BodyPoint, scale: float, colour: str) -> None:
        ball = _unit_ball()
        corners = scale * self.radius(module) * ball.vertices + at.at
        self._add(name, role, module, at.body, (corners, ball.faces), colour)

    def _add(
        self, name: str, role: Role, module: int, body: int, mesh: tuple[Array, Index], colour: str,
        own_colour: str | None = None, ends: tuple[BodyPoint, BodyPoint] | None = None,
    ) -> None:  # fmt: skip
        self.shapes.append(PictureShape(name, role, module, body, *mesh, colour, own_colour, ends))


@cache
def _unit_rod() -> Any:
    import trimesh

    return trimesh.creation.cylinder(1.0, sections=SIDES, segment=[[0, 0, 0], [0, 0, 1]])


@cache
def _unit_ball() -> Any:
    import trimesh

    return trimesh.creation.icosphere(FINE)


def _ends(robot: HybridRobot, closure: Closure) -> tuple[BodyPoint, BodyPoint]:
    """Return the origins of a closure's frames A and B."""
    out = []
    for link, frame in ((closure.link_a, closure.frame_a), (closure.link_b, closure.frame_b)):
        body, R, p = robot.bodies.place[link]
        out.append(BodyPoint(body, p + R @ frame[:3, 3]))
    return out[0], out[1]


def _distinct(points: Iterable[Array], near: float) -> list[Array]:
    """Return points without duplicates, within a tolerance."""
    out: list[Array] = []
    for point in points:
        if all(np.abs(point - other).max() > near for other in out):
            out.append(point)
    return out


def hull(points: Array, half: float) -> tuple[Array, Index] | None:
    """Return the convex hull of points, thickened where they lie in one plane.

    Args:
        points: The points, shape (N, 3), [m].
        half: Half of the thickness of a flat one [m].

    Returns:
        Corners and triangles, counter-clockwise from outside; None where all points lie near one line.
    """
    import trimesh

    centre = points.mean(axis=0)
    _, spread, axes = np.linalg.svd(points - centre)
    if len(spread) < 2 or spread[1] < NARROW * spread[0]:
        return None
    if len(points) == 3 or spread[2] < half:
        points = np.concatenate([points - half * axes[2], points + half * axes[2]])
    found = trimesh.convex.convex_hull(points)
    return found.vertices, found.faces
