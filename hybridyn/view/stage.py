"""Display a picture in the page's scene: one frame per body, with the body's solids, rods and balls in it.

The browser moves frames at once, but updates positions inside a batch of shapes later. Shapes are therefore
fixed in the frames of their bodies, so that they follow the bodies at any playback speed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..colours import rgb
from ..spatial import Array, quaternion_from_rotation
from ..structure.robot import HybridRobot
from .picture import Ball, Picture, Rod, Role
from .placing import Placement
from .triangles import ball_transforms, rod_transforms, unit_ball, unit_cylinder

#: Sides of a rod, and rings of latitude of a ball.
SIDES, RINGS = 24, 12
ROLES: tuple[Role, ...] = ("link", "motor", "joint", "closure")


class Stage:
    """The scene of a page.

    Attributes:
        nodes: Scene nodes of rods and balls by their role.
        names: Label of each module, and the body that it follows.
    """

    def __init__(self, server: Any, robot: HybridRobot, picture: Picture) -> None:
        self.robot, self.picture = robot, picture
        self.nodes: dict[Role, list[Any]] = {role: [] for role in ROLES}
        self.names: list[tuple[Any, int]] = []
        self._server = server
        self._frames: dict[tuple[int, int], tuple[str, Any]] = {}
        self._growing: list[tuple[Any, int, list[Rod]]] = []
        self._solids: list[Any] = []
        self._body_names = {body.joint + 1: body.name for body in robot.bodies.bodies}
        for shapes in _batches(picture):
            self._add_batch(shapes)
        for number, solid in enumerate(picture.solids):
            node = server.scene.add_mesh_simple(
                f"{self._frame(solid.module, solid.body)}/{_clean(solid.name)} {number}",
                vertices=solid.vertices,
                faces=solid.faces,
                color=rgb(solid.colour),
                flat_shading=True,  # smooth shading would blur the edges
                side="double",
            )
            self._solids.append(node)
        for number, part in enumerate(robot.modules):
            if part.outputs:
                label = server.scene.add_label(f"/names/{number}", part.name, visible=False)
                self.names.append((label, robot.bodies.place[part.outputs[0]][0]))

    def _frame(self, module: int, body: int) -> str:
        """Return the path of a body's frame among the shapes of a module; add the frame if it is missing."""
        if (module, body) not in self._frames:
            part = "ground" if module < 0 else f"{module + 1} {_clean(self.robot.modules[module].name)}"
            path = f"/robot/{part}/{body} {_clean(self._body_names[body])}"
            self._frames[module, body] = path, self._server.scene.add_frame(path, show_axes=False)
        return self._frames[module, body][0]

    def _add_batch(self, shapes: Sequence[Rod] | Sequence[Ball]) -> None:
        """Add rods or balls of one module, role and body as instances of one shape."""
        first, body = shapes[0], _body(shapes[0])
        rods = [shape for shape in shapes if isinstance(shape, Rod)]
        vertices, faces = unit_cylinder(SIDES) if rods else unit_ball(RINGS)
        grows = bool(rods) and _grows(rods[0])
        axes, origins, scales = _transforms(shapes, _at_rest(len(self._body_names)))
        kind = ("growing rods" if grows else "rods") if rods else "balls"
        node = self._server.scene.add_batched_meshes_simple(
            f"{self._frame(first.module, body)}/{first.role} {kind}",
            vertices=vertices,
            faces=faces,
            batched_wxyzs=wxyz(axes),
            batched_positions=origins,
            batched_scales=scales,
            batched_colors=_linear([shape.colour for shape in shapes]),
            lod="off",
        )
        self.nodes[first.role].append(node)
        if grows:
            self._growing.append((node, body, rods))

    def place(self, placement: Placement) -> None:
        """Move all frames and growing rods to their poses; only changes are sent to the browser."""
        quaternions = wxyz(placement.R)
        for (_, body), (_, frame) in self._frames.items():
            _set(frame, "wxyz", quaternions[body])
            _set(frame, "position", placement.p[body])
        for node, body, rods in self._growing:
            axes, origins, scales = _transforms(rods, _seen_from(placement, body))
            _set(node, "batched_wxyzs", wxyz(axes))
            _set(node, "batched_positions", origins)
            _set(node, "batched_scales", scales)
        for label, body in self.names:
            _set(label, "position", placement.p[body])

    def paint(self, own_colours: bool) -> None:
        """Give the solids the colours of their files, or those of their modules."""
        for node, solid in zip(self._solids, self.picture.solids, strict=True):
            node.color = rgb(solid.own_colour if own_colours else solid.colour)

    def show(self, role: Role, visible: bool) -> None:
        """Show or hide all shapes of a role."""
        for node in self.nodes[role]:
            node.visible = visible

    def show_names(self, visible: bool) -> None:
        """Show or hide the modules' names."""
        for label, _ in self.names:
            label.visible = visible


def _batches(picture: Picture) -> list[list[Rod] | list[Ball]]:
    """Group rods and balls by module, role and body; growing rods have separate groups."""
    rods: dict[tuple[object, ...], list[Rod]] = {}
    balls: dict[tuple[object, ...], list[Ball]] = {}
    for rod in picture.rods:
        rods.setdefault((rod.module, rod.role, _body(rod), _grows(rod)), []).append(rod)
    for ball in picture.balls:
        balls.setdefault((ball.module, ball.role, _body(ball)), []).append(ball)
    return [*rods.values(), *balls.values()]


def _body(shape: Rod | Ball) -> int:
    """Return the body in whose frame a shape is drawn."""
    return shape.start.body if isinstance(shape, Rod) else shape.at.body


def _grows(rod: Rod) -> bool:
    """Return whether a rod's ends belong to different bodies."""
    return rod.start.body != rod.end.body


def _transforms(shapes: Sequence[Rod] | Sequence[Ball], placement: Placement) -> tuple[Array, Array, Array]:
    """Compute axes, shape (N, 3, 3), origins and scales, shape (N, 3), of instances of the unit shape."""
    rods = [shape for shape in shapes if isinstance(shape, Rod)]
    if rods:
        return rod_transforms(rods, placement)
    centres, radii = ball_transforms([shape for shape in shapes if isinstance(shape, Ball)], placement)
    return np.tile(np.eye(3), (len(shapes), 1, 1)), centres, np.repeat(radii[:, None], 3, axis=1)


def _at_rest(count: int) -> Placement:
    """Return a placement with every body's frame at the world frame."""
    return Placement(np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3)))


def _seen_from(placement: Placement, body: int) -> Placement:
    """Compute the poses of all bodies in the frame of one of them."""
    R = placement.R[body]
    return Placement(R.T @ placement.R, (placement.p - placement.p[body]) @ R)


def _linear(colours: Sequence[str]) -> NDArray[np.uint8]:
    """Convert sRGB colours to linear ones, shape (N, 3), which batches need; single shapes take sRGB."""
    x = np.array([rgb(colour) for colour in colours]) / 255
    light = np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)
    return np.round(255 * light).astype(np.uint8)


def wxyz(R: Array) -> Array:
    """Convert rotation matrices, shape (N, 3, 3), to quaternions with the scalar first, shape (N, 4)."""
    return quaternion_from_rotation(R)[:, [3, 0, 1, 2]]


def _set(node: Any, name: str, value: Array) -> None:
    """Set an attribute of a node if its value changes."""
    new = np.asarray(value, dtype=np.float32)
    if not np.array_equal(np.asarray(getattr(node, name), dtype=np.float32), new):
        setattr(node, name, new)


def _clean(name: str) -> str:
    return name.replace("/", "_")
