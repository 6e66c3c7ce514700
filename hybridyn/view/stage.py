"""A picture in the page's scene: batches of rods and balls per module, one node per solid."""

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
        self._batches: list[tuple[Any, Sequence[Rod] | Sequence[Ball]]] = []
        self._solids: list[Any] = []
        for module in picture.modules:
            path = self._path(module)
            for role in ROLES:
                rods = [rod for rod in picture.rods if (rod.module, rod.role) == (module, role)]
                balls = [ball for ball in picture.balls if (ball.module, ball.role) == (module, role)]
                for kind, shapes in (("rods", rods), ("balls", balls)):
                    if shapes:
                        self._add_batch(server, f"{path}/{role} {kind}", role, shapes)
        for number, solid in enumerate(picture.solids):
            node = server.scene.add_mesh_simple(
                f"{self._path(solid.module)}/{_clean(solid.name)} {number}",
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

    def _path(self, module: int) -> str:
        name = "ground" if module < 0 else f"{module + 1} {_clean(self.robot.modules[module].name)}"
        return f"/robot/{name}"

    def _add_batch(self, server: Any, name: str, role: Role, shapes: Sequence[Rod] | Sequence[Ball]) -> None:
        """Add rods or balls as copies of one shape."""
        vertices, faces = unit_cylinder(SIDES) if isinstance(shapes[0], Rod) else unit_ball(RINGS)
        count = len(shapes)
        node = server.scene.add_batched_meshes_simple(
            name,
            vertices=vertices,
            faces=faces,
            batched_wxyzs=np.tile([1.0, 0, 0, 0], (count, 1)),
            batched_positions=np.zeros((count, 3)),
            batched_scales=np.ones((count, 3)),
            batched_colors=_linear([shape.colour for shape in shapes]),
            lod="off",
        )
        self.nodes[role].append(node)
        self._batches.append((node, shapes))

    def place(self, placement: Placement) -> None:
        """Put everything where a posture has it; what has not moved is not sent."""
        for node, shapes in self._batches:
            if isinstance(shapes[0], Rod):
                axes, origins, scales = rod_transforms(shapes, placement)  # type: ignore[arg-type]
                _set(node, "batched_wxyzs", wxyz(axes))
            else:
                origins, radii = ball_transforms(shapes, placement)  # type: ignore[arg-type]
                scales = np.repeat(radii[:, None], 3, axis=1)
            _set(node, "batched_positions", origins)
            _set(node, "batched_scales", scales)
        quaternions = wxyz(placement.R)
        for node, solid in zip(self._solids, self.picture.solids, strict=True):
            _set(node, "wxyz", quaternions[solid.body])
            _set(node, "position", placement.p[solid.body])
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
