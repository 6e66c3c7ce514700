"""Data that the checks use: the file as XML, as records and, if it can be built, as a robot."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from os import PathLike

import numpy as np

from ...description.placement import poses_at_zero
from ...description.records import Description, Joint, Link
from ...description.urdf.xml_node import Node
from ...spatial import Array
from ...structure.robot import HybridRobot
from .finding import Finding
from .places import Places
from .shapes import Shape


@dataclass(frozen=True)
class Subject:
    """A robot's files in every form that the checks need.

    Attributes:
        root: Root element, xacro expanded.
        description: Records read from the files.
        package_dirs: Folders in which `package://` searches.
        shapes: Shapes of the links, by link.
        robot: The robot, or None if it cannot be built.
    """

    root: Node
    description: Description
    package_dirs: Sequence[str | PathLike[str]] = ()
    shapes: Mapping[str, list[Shape]] = field(default_factory=dict)
    robot: HybridRobot | None = None

    @cached_property
    def places(self) -> Places:
        """Files and lines of the elements."""
        return Places(self.root)

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
    def carried(self) -> Counter[str]:
        """Number of moving joints on each body, whose name is that of its first link."""
        return Counter(self.body(one.parent) for one in self.description.joints if one.kind != "fixed")

    def body(self, link: str) -> str:
        """Return the first link of the body that a link belongs to."""
        while link in self.joint_above and self.joint_above[link].kind == "fixed":
            link = self.joint_above[link].parent
        return link

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
        place = self.places.of("link", name, line or self.links[name].line)
        return Finding(code, f"link '{name}'", message, why, mend, *place)

    def of_joint(self, code: str, name: str, message: str, why: str, mend: str) -> Finding:
        """Return a finding about a joint."""
        place = self.places.of("joint", name, self.joints[name].line)
        return Finding(code, f"joint '{name}'", message, why, mend, *place)

    def of_module(
        self, code: str, name: str, message: str, why: str, mend: str, at: tuple[str, ...]
    ) -> Finding:
        """Return a finding about a module, at the line of the first element of `at` that has one."""
        closures = {c.name: c.line for c in self.description.closures}
        closures |= {c.name: c.line for c in self.description.couplings}
        for element in at:
            if element in self.joints:
                place = self.places.of("joint", element, self.joints[element].line)
            else:
                tags = ("loop", "constraint", "loop_joint", "coupling")
                tries = (self.places.of(tag, element, closures.get(element)) for tag in tags)
                place = next((found for found in tries if found[1]), (self.places.file, None))
            if place[1]:
                return Finding(code, f"module '{name}'", message, why, mend, *place)
        return Finding(code, f"module '{name}'", message, why, mend, self.places.file)
