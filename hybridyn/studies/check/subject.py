"""Data that the checks use: the file as XML, as records and, if it can be built, as a robot."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ...description.loop_signs import WeldedBodies
from ...description.placement import poses_at_zero
from ...description.records import Closure, Coupling, Description, Joint, Link
from ...description.urdf.xml_node import Expanded, XmlNode
from ...spatial import Array
from ...structure.robot import HybridRobot
from .finding import Finding
from .shapes import LinkShape

#: Elements that state joints, closures and couplings.
NAMED = ("joint", "loop", "constraint", "loop_joint", "coupling")


@dataclass
class Subject:
    """A robot's files in every form that the checks need.

    Attributes:
        root: Root element, xacro expanded.
        description: Records read from the files.
        shapes: Shapes of the links, by link.
        robot: The robot, or None if it cannot be built.
    """

    root: XmlNode
    description: Description
    shapes: Mapping[str, list[LinkShape]] = field(default_factory=dict)
    robot: HybridRobot | None = None

    def place(self, tag: str, name: str, line: int | None) -> tuple[str, int | None]:
        """Return file and line of an element.

        Args:
            tag: Tag of the element: "link", "joint", "loop", ...
            line: Its line in the text that was read; ignored if xacro wrote that text.
        """
        if not isinstance(self.root.file, Expanded):
            return self.root.file, line
        return self._written.get((tag, name), (self.root.file, None))

    @cached_property
    def _written(self) -> dict[tuple[str, str], tuple[str, int | None]]:
        """Places of all named elements, the first of each name."""
        named = [(node.tag, str(node.attrib.get("name")), node) for node in self.root.descendants()]
        return {(tag, name): node.place for tag, name, node in reversed(named)}

    @cached_property
    def links(self) -> dict[str, Link]:
        """Links by name."""
        return {link.name: link for link in self.description.links}

    @cached_property
    def joints(self) -> dict[str, Joint]:
        """Joints by name."""
        return {joint.name: joint for joint in self.description.joints}

    @cached_property
    def joint_above(self) -> dict[str, Joint]:
        """Parent joint of each link except the root."""
        return {joint.child: joint for joint in self.description.joints}

    @cached_property
    def body(self) -> dict[str, str]:
        """First link of the body that each link belongs to."""
        return WeldedBodies(self.description).of

    @cached_property
    def carried(self) -> Counter[str]:
        """Number of moving joints on each body, whose name is that of its first link."""
        return Counter(self.body[one.parent] for one in self.description.joints if one.kind != "fixed")

    @cached_property
    def extent(self) -> float:
        """Size of the robot [m]: diagonal of the box around frames and closures with all joints at zero."""
        place = {self.description.root: np.eye(4)} | poses_at_zero(self.description.joints)
        points = [frame[:3, 3] for frame in place.values()]
        for closure in self.description.closures:
            points.append((place[closure.link_a] @ closure.frame_a)[:3, 3])
            points.append((place[closure.link_b] @ closure.frame_b)[:3, 3])
        return float(np.linalg.norm(np.ptp(np.array(points), axis=0)))

    def box(self, link: str) -> tuple[Array, Array] | None:
        """Return lower and upper corner of the box around a link's shapes [m], link frame, or None."""
        corners = [shape.corners for shape in self.shapes.get(link, ()) if shape.corners is not None]
        if not corners:
            return None
        points = np.concatenate(corners)
        return points.min(axis=0), points.max(axis=0)

    def of_link(
        self, code: str, name: str, message: str, why: str, mend: str, line: int | None = None
    ) -> Finding:
        """Return a finding about a link, at the link's line or at the given line inside it."""
        place = self.place("link", name, line or self.links[name].line)
        return Finding(code, f"link '{name}'", message, why, mend, *place)

    def of_joint(self, code: str, name: str, message: str, why: str, mend: str) -> Finding:
        """Return a finding about a joint."""
        place = self.place("joint", name, self.joints[name].line)
        return Finding(code, f"joint '{name}'", message, why, mend, *place)

    def first_place(self, names: Iterable[str]) -> tuple[str, int | None]:
        """Return the place of the first of some joints, closures and couplings that has a line."""
        d = self.description
        named: list[Closure | Coupling | Joint] = [*d.closures, *d.couplings, *d.joints]
        lines = {one.name: one.line for one in named}
        places = (self.place(tag, name, lines.get(name)) for name in names for tag in NAMED)
        return next((place for place in places if place[1]), (self.root.file, None))

    def of_module(
        self, code: str, name: str, message: str, why: str, mend: str, at: tuple[str, ...]
    ) -> Finding:
        """Return a finding about a module, at the line of the first element of `at` that has one."""
        return Finding(code, f"module '{name}'", message, why, mend, *self.first_place(at))
