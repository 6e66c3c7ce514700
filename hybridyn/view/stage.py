"""A picture in the page's scene: a frame per body, and in it the body's solids, rods and balls.

The browser moves frames at once, but takes longer for new positions inside a batch of shapes. So a shape does
not move in the frame of its body: it cannot leave it, however fast a motion is played.
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

SIDES, RINGS = 24, 12
ROLES: tuple[Role, ...] = ("link", "motor", "joint", "closure")


class Stage:
    """The scene of a page.

    Attributes:
        nodes: Nodes by what they stand for, to be shown and hidden.
        names: The modules' names in the scene.
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
                flat_shading=True,  # machines have edges, which smooth shading smears
                side="double",
            )
            self._solids.append(node)
        for number, part in enumerate(robot.modules):
            if part.outputs:
                label = server.scene.add_label(f"/names/{number}", part.name, visible=False)
                self.names.append((label, robot.bodies.place[part.outputs[0]][0]))

    def _frame(self, module: int, body: int) -> str:
        """Return the path of a body's frame among the shapes of a module; add it if it is not there."""
        if (module, body) not in self._frames:
            part = "ground" if module < 0 else f"{module + 1} {_clean(self.robot.modules[module].name)}"
            path = f"/robot/{part}/{body} {_clean(self._body_names[body])}"
            self._frames[module, body] = path, self._server.scene.add_frame(path, show_axes=False)
        return self._frames[module, body][0]

    def _add_batch(self, shapes: Sequence[Rod] | Sequence[Ball]) -> None:
        """Add rods or balls of one module, role and body as copies of one shape."""
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
        """Put everything where a posture has it; what has not moved is not sent."""
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
        """Return shapes the colours of their files, or of their modules."""
        for node, solid in zip(self._solids, self.picture.solids, strict=True):
            node.color = rgb(solid.own_colour if own_colours else solid.colour)

    def show(self, role: Role, visible: bool) -> None:
        """Show or hide everything that stands for something."""
        for node in self.nodes[role]:
            node.visible = visible

    def show_names(self, visible: bool) -> None:
        """Show or hide the modules' names."""
        for label, _ in self.names:
            label.visible = visible


def _batches(picture: Picture) -> list[list[Rod] | list[Ball]]:
    """Return rods and balls in groups with the same module, role and body, growing rods apart."""
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
    """Return axes, shape (N, 3, 3), origins and scales, shape (N, 3), of copies of the unit shape."""
    rods = [shape for shape in shapes if isinstance(shape, Rod)]
    if rods:
        return rod_transforms(rods, placement)
    centres, radii = ball_transforms([shape for shape in shapes if isinstance(shape, Ball)], placement)
    return np.tile(np.eye(3), (len(shapes), 1, 1)), centres, np.repeat(radii[:, None], 3, axis=1)


def _at_rest(count: int) -> Placement:
    """Return the placement in which every body's frame is the world's."""
    return Placement(np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3)))


def _seen_from(placement: Placement, body: int) -> Placement:
    """Return the poses of all bodies in the frame of one of them."""
    R = placement.R[body]
    return Placement(R.T @ placement.R, (placement.p - placement.p[body]) @ R)


def _linear(colours: Sequence[str]) -> NDArray[np.uint8]:
    """Return colours, shape (N, 3), as batches want them: in linear light, where single shapes want sRGB."""
    x = np.array([rgb(colour) for colour in colours]) / 255
    light = np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)
    return np.round(255 * light).astype(np.uint8)


def wxyz(R: Array) -> Array:
    """Return quaternions with the scalar first, shape (N, 4), of axes, shape (N, 3, 3)."""
    return quaternion_from_rotation(R)[:, [3, 0, 1, 2]]


def _set(node: Any, name: str, value: Array) -> None:
    new = np.asarray(value, dtype=np.float32)
    if not np.array_equal(np.asarray(getattr(node, name), dtype=np.float32), new):
        setattr(node, name, new)


def _clean(name: str) -> str:
    return name.replace("/", "_")
