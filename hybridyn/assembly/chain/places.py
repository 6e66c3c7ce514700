"""Frames of a robot as places on the parts of a chain, and how other modules move them."""

from __future__ import annotations

from dataclasses import replace

from ...linkage.motion import Motion
from ...spatial import Array
from ...structure.robot import HybridRobot
from ..module_request import body_in_tree
from .bodies import CarriedFrame
from .coupling import CoupledModules, way_to_root


class ChainPlaces:
    """Frames of the robot as places on the parts of a chain; other modules between them move as is known.

    The base of the chain is the root link; where a pose is measured in the world, it is the world.
    """

    def __init__(self, robot: HybridRobot, chain: CoupledModules, q: Array, v: Array, a: Array) -> None:
        self.robot, self.parts = robot, {k: i for i, k in enumerate(chain.modules)}
        self.q, self.v, self.a = q, v, a
        self.root = tuple(pose.frame for pose in chain.poses if pose.frame is not None)[:1]
        self._motions: dict[int, Motion] = {}

    def place(self, link: str) -> CarriedFrame:
        """Return the place of a link."""
        body, R, p = self.robot.bodies.place[link]
        ways: tuple[Motion, ...] = (Motion.at_rest(len(self.q), R, p),)
        for k, local in way_to_root(self.robot, body):
            if k in self.parts:
                number, *end = body_in_tree(self.robot, (k, local), link)
                return CarriedFrame(self.parts[k], number, (Motion.at_rest(len(self.q), *end), *ways))
            ways = (self._motion(k).of_body(local), *ways)
        return CarriedFrame(-1, 0, (*self.root, *ways))

    def base(self, number: int) -> CarriedFrame:
        """Return the place of a module's base body."""
        _, R, p = self.robot.bodies.place[self.robot.modules[number].base]
        place = self.place(self.robot.modules[number].base)
        back = Motion.at_rest(len(self.q), R.T, -R.T @ p)
        return replace(place, ways=(*place.ways, back))

    def _motion(self, number: int) -> Motion:
        """Return the motion of a module's bodies in its base, at all samples."""
        if number not in self._motions:
            module = self.robot.modules[number]
            at, to = module.q_index, module.v_index
            tree = module.mechanism.spanning
            self._motions[number] = tree.sweep(self.q[:, at], self.v[:, to], self.a[:, to])
        return self._motions[number]


def motion_of(robot: HybridRobot, link: str, states: tuple[Array, Array, Array]) -> Motion:
    """Compute the motion of a link in the root body at states q, v, a, shapes (T, nq), (T, nv), (T, nv)."""
    return ChainPlaces(robot, CoupledModules((), ()), *states).place(link).inner
