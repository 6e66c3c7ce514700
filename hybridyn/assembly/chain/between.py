"""The modules between two links, and how their motions move one link in the other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...linkage.motion import Motion
from ...linkage.targets import COORDINATES
from ...spatial import Array
from ...structure.robot import HybridRobot
from ..module_request import module_request
from ..poses import PoseRequest
from ..redundancy import LEAST
from ..requests import Requests
from ..task import Task, left_open, module_task
from .bodies import ChainMotion
from .coupling import CoupledModules, is_own, own_requests, ways_between
from .problem import ChainProblem, Relative
from .solve import (
    chain_problem,
    chain_task,
    cut_positions,
    generic_motion,
    lowest_task,
)
from .task import ChainTask


def moving(robot: HybridRobot, link: str, other: str) -> tuple[int, ...]:
    """Return the numbers of the modules that move a link in another, those nearer to the root first."""
    ways = ways_between(robot, PoseRequest(link, other, None, {}))
    return tuple(sorted({k for way in ways for k, _ in way if robot.modules[k].mobility}))


def tools_of(robot: HybridRobot, number: int) -> list[str]:
    """Return the links at the ends of a module's links: they are fixed to these and carry no joint."""
    parents = {joint.parent for joint in robot.description.joints}
    return [
        joint.child
        for joint in robot.description.joints
        if joint.kind == "fixed"
        and joint.child not in parents
        and robot.body_owner[robot.bodies.place[joint.child][0]][0] == number
    ]


def end_link(robot: HybridRobot, number: int) -> str:
    """Return a module's platform: an output that is a platform or carries a module, else a tool."""
    module = robot.modules[number]
    carries = any(other.parent == number for other in robot.modules)
    if module.outputs and (carries or module.mechanism.spec.platforms):
        return module.outputs[0]
    tools = tools_of(robot, number)
    return tools[-1] if tools else module.outputs[0] if module.outputs else module.name


@dataclass(frozen=True, eq=False)
class Between:
    """Modules between two links. Instances are pickled for other processes.

    Attributes:
        robot: The robot.
        modules: Numbers of the modules that move the link in the other, those nearer to the root first.
        problem: Their rows, and a target of the link in the other; all their freedoms count alike.
        length: Unit of lengths: that of the longest of these modules [m].
    """

    robot: HybridRobot
    modules: tuple[int, ...]
    problem: ChainProblem
    length: float

    @classmethod
    def of_pose(cls, robot: HybridRobot, modules: tuple[int, ...], link: str, other: str) -> Between:
        """Take the link's whole pose as the target."""
        return cls._of(robot, modules, PoseRequest(link, other, Motion.at_rest(1), {}))

    @classmethod
    def of_coordinates(cls, robot: HybridRobot, modules: tuple[int, ...], link: str, other: str) -> Between:
        """Take all six coordinates of the link, each by itself, as the target."""
        return cls._of(
            robot, modules, PoseRequest(link, other, None, dict.fromkeys(COORDINATES, np.zeros((3, 1))))
        )

    @classmethod
    def _of(cls, robot: HybridRobot, modules: tuple[int, ...], pose: PoseRequest) -> Between:
        requests = Requests(1, False, {}, (pose,), None, None)
        chain = CoupledModules(modules, (pose,))
        own = own_requests(robot, requests._replace(poses=()), chain)
        states = robot.home[None], *np.zeros((2, 1, robot.nv))
        problem, _ = chain_problem(robot, chain, own, states)
        length = max(robot.modules[k].mechanism.length for k in modules)
        return cls(robot, modules, problem.unweighted, length)

    @property
    def relative(self) -> Relative:
        """The target."""
        return self.problem.relatives[0]

    def motion(self, q: Array) -> ChainMotion:
        """Compute the modules' motion at postures of the robot, shape (T, nq)."""
        return self.problem.tree.sweep(cut_positions(self.robot, self.modules, q))

    def generic(self) -> ChainMotion:
        """Compute the modules' motion at generic postures."""
        return generic_motion(self.problem, self.robot, self.modules, self.robot.home[None])

    def seen(self, motion: ChainMotion) -> Motion:
        """Compute the motion of the link in the other, as that of body 1 of a tree."""
        samples = np.zeros(len(motion.parts[0].p), dtype=int)
        return self.problem.frames(motion, samples).seen(self.relative.link, self.relative.other)

    def maps(self, motion: ChainMotion) -> tuple[Array, Array]:
        """Compute target rows and rates of the modules' motors over free motions, lengths over `length`.

        Returns:
            Shapes (T, 6, motions), (T, motors, motions).
        """
        split, rates = self.problem.split(self.problem.matrix(motion)), []
        for k, part, N in zip(self.modules, self.problem.parts, split.bases, strict=True):
            module = self.robot.modules[k]
            columns = module.motor_columns
            unit = part.col_scale[columns] / self.units(k)
            rates.append(N[:, columns] * unit[:, None])
        T, motors = len(split.reach), sum(x.shape[1] for x in rates)
        out, row, at = np.zeros((T, motors, split.reach.shape[2])), 0, 0
        for own in rates:
            out[:, row : row + own.shape[1], at : at + own.shape[2]] = own
            row, at = row + own.shape[1], at + own.shape[2]
        return split.reach, out

    def units(self, number: int) -> Array:
        """Return what counts as one of the motion of each motor of a module [m or rad]."""
        robot = self.robot
        kinds = [robot.kinds[robot.joint_index[name]] for name in robot.modules[number].motors]
        return np.array([self.length if kind.slides else 1.0 for kind in kinds])

    @property
    def q_index(self) -> Array:
        """Positions of the modules' joints in the robot's q, module by module."""
        return np.concatenate([np.asarray(self.robot.modules[k].q_index) for k in self.modules])


def pose_task(robot: HybridRobot, modules: tuple[int, ...], requests: Requests, q: Array) -> Task | ChainTask:
    """Build the task of one pose at postures of the robot; a rule takes the freedoms that it leaves.

    Args:
        robot: The robot.
        modules: The modules that move the pose's link.
        requests: The pose at T samples.
        q: Postures, shape (T, nq): other modules are there.

    Raises:
        AssemblyError: As in `assemble`.
    """
    (pose,), number = requests.poses, modules[0]
    if is_own(pose, ways_between(robot, pose)) and len(modules) == 1:
        request = module_request(requests, robot, number, {})
        if not left_open(robot, robot.modules[number], request):
            return module_task(robot, robot.modules[number], request)
    chain, rest = CoupledModules(modules, requests.poses), np.zeros((2, len(q), robot.nv))
    task = chain_task(robot, chain, own_requests(robot, requests, chain), (q, *rest))
    if task.redundant and requests.redundancy != LEAST:
        return lowest_task(robot, modules, requests, task, q[0])
    return task
