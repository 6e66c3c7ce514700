"""The handle by which a tool is dragged on the page, and the choice of the tool."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..spatial import Array, quaternion_from_rotation, rotation_from_quaternion
from .posing import Moved, Poser

#: Size of the handle, as a part of the robot's.
GRIP = 0.12


class Grip:
    """The handle of a tool, one of the links that can be dragged."""

    def __init__(self, server: Any, poser: Poser, size: float, ask: Callable[[str, Any], None]) -> None:
        """Add the handle.

        Args:
            server: The page's server.
            poser: Moves the robot.
            size: Size of the robot [m].
            ask: Called with "drag" and a pose when a user drags the handle, and with "grip" when the handle
                has to return to the tool.
        """
        self._poser, self._ask = poser, ask
        self._tool = server.gui.add_dropdown("dragged link", poser.links, initial_value=poser.links[-1])
        self._tool.on_update(lambda event: ask("grip", True))
        self.handle: Any = server.scene.add_transform_controls(
            "/grip", GRIP * size, disable_sliders=True, depth_test=False
        )
        self.handle.on_update(self.dragged)

    def dragged(self, event: Any) -> None:
        """Ask for the pose to which a user has dragged the handle; at the end, for the handle at the tool."""
        if event.phase == "end":
            self._ask("grip", True)
        elif event.phase == "update":
            self._ask("drag", (np.array(self.handle.position), np.array(self.handle.wxyz)))

    def place(self, q: Array) -> None:
        """Put the handle where the tool is in a posture, shape (nq,)."""
        p, R = self._poser.pose(q, self._tool.value)
        self.handle.position = p
        self.handle.wxyz = quaternion_from_rotation(R[None])[0, [3, 0, 1, 2]]

    def drag(self, q: Array, pose: tuple[Array, Array]) -> Moved:
        """Move the tool from a posture, shape (nq,), towards a position [m] and a quaternion w, x, y, z."""
        p, wxyz = pose
        return self._poser.drag(q, self._tool.value, p, rotation_from_quaternion(wxyz[None, [1, 2, 3, 0]])[0])
