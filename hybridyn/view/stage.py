"""Display a picture in the page's scene: one frame per body, with the body's shapes in it.

The browser moves frames at once. Shapes are therefore fixed in the frames of their bodies, and follow these
at any playback speed; only rods that grow have a pose and a length of their own.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..colours import rgb
from ..spatial import Array, quaternion_from_rotation
from ..structure.robot import HybridRobot
from .picture import BodyPoint, Picture, PictureShape, Role
from .placing import Placement, along


class PageStage:
    """The scene of a page."""

    def __init__(self, server: Any, robot: HybridRobot, picture: Picture) -> None:
        self._scene, self._robot = server.scene, robot
        self._frames: dict[tuple[int, int], Any] = {}
        self._growing: list[tuple[Any, tuple[BodyPoint, BodyPoint]]] = []
        self._nodes: list[tuple[Any, PictureShape]] = []
        self._names = {body.joint + 1: body.name for body in robot.bodies.bodies}
        groups: dict[object, list[PictureShape]] = {}
        for shape in picture.shapes:
            alike = shape.module, shape.body, shape.role, shape.colour, shape.own_colour
            groups.setdefault(id(shape) if shape.ends else alike, []).append(shape)
        for shapes in groups.values():
            self._add(shapes)

    def _add(self, shapes: list[PictureShape]) -> None:
        """Add shapes of one module, body, role and colour as one mesh in the frame of their body."""
        first = shapes[0]
        counts = np.cumsum([0, *(len(shape.vertices) for shape in shapes)])
        node = self._scene.add_mesh_simple(
            f"{self._frame(first)}/{first.role} {len(self._nodes)}",
            vertices=np.concatenate([shape.vertices for shape in shapes]),
            faces=np.concatenate([shape.faces + n for shape, n in zip(shapes, counts, strict=False)]),
            color=rgb(first.colour),
            flat_shading=True,  # smooth shading would blur the edges
            side="double",
        )
        self._nodes.append((node, first))
        if first.ends is not None:
            self._growing.append((node, first.ends))

    def _frame(self, shape: PictureShape) -> str:
        """Return the path of a body's frame among the shapes of a module; add the frame if it is missing."""
        module, body = shape.module, shape.body
        part = "ground" if module < 0 else f"{module + 1} {_clean(self._robot.modules[module].name)}"
        path = f"/robot/{part}/{body} {_clean(self._names[body])}"
        if (module, body) not in self._frames:
            self._frames[module, body] = self._scene.add_frame(path, show_axes=False)
        return path

    def place(self, placement: Placement) -> None:
        """Move all frames and growing rods to their poses; only changes are sent to the browser."""
        for (_, body), frame in self._frames.items():
            _pose(frame, placement.p[body], placement.R[body])
        for node, ends in self._growing:
            start, end = ends
            axes, length = along(start.at, placement.seen_from(start.body).at(end))
            _pose(node, start.at, axes)
            node.scale = 1.0, 1.0, length

    def paint(self, own_colours: bool) -> None:
        """Give the shapes of the files their own colours, or those of their modules."""
        for node, shape in self._nodes:
            node.color = rgb(shape.own_colour if own_colours and shape.own_colour else shape.colour)

    def show(self, role: Role, visible: bool) -> None:
        """Show or hide all shapes of a role."""
        for node, shape in self._nodes:
            if shape.role == role:
                node.visible = visible


def _pose(node: Any, p: Array, R: Array) -> None:
    """Set position and orientation of a node."""
    _set(node, "position", p)
    _set(node, "wxyz", quaternion_from_rotation(R[None])[0, [3, 0, 1, 2]])


def _set(node: Any, name: str, value: Array) -> None:
    """Set an attribute of a node if its value changes."""
    new = np.asarray(value, dtype=np.float32)
    if not np.array_equal(np.asarray(getattr(node, name), dtype=np.float32), new):
        setattr(node, name, new)


def _clean(name: str) -> str:
    return name.replace("/", "_")
