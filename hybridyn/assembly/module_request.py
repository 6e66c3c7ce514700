"""The request for one module: given joints of its tree after the cuts, and targets for its bodies."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ..errors import AT_SAMPLE, AssemblyError
from ..joints.kinds import JointKind
from ..linkage.motion import Motion
from ..linkage.targets import Target
from ..spatial import Array, quaternion_from_rotation
from ..structure.mechanism import Mechanism
from ..structure.module import Module
from ..structure.robot import HybridRobot
from .pose_targets import partial_targets, whole_target
from .poses import PoseRequest
from .requests import Requests

#: Angles of a limited joint beyond this [rad] are mistakes; beyond `BLUR`, any angle has lost its digits.
WOUND_UP, BLUR = 1e4, 1e8
#: Lengths beyond this many module lengths are out of reach of its loops.
FAR = 1e3


@dataclass(eq=False)
class ModuleRequest:
    """The request for one module, on its tree after the cuts.

    Attributes:
        mechanism: The module's numbers.
        known: Positions, shape (T, nq); only those of the joints in `given` are used.
        known_v: Their rates, shape (T, nv).
        known_a: Their accelerations, shape (T, nv).
        given: Indices of the joints whose positions are given.
        targets: Prescribed poses of other bodies, each with its link.
        angles: Given positions of continuous joints, including whole turns, shape (T,) each, [rad].
        strict: As in `Requests`.
        nearest: As in `Requests`.
        stay: As in `Requests`.
        weights: As in `Requests`.
    """

    mechanism: Mechanism
    known: Array
    known_v: Array
    known_a: Array
    given: list[int] = field(default_factory=list)
    targets: list[tuple[str, Target]] = field(default_factory=list)
    angles: dict[int, Array] = field(default_factory=dict)
    strict: bool = False
    nearest: tuple[str, ...] = ()
    stay: bool = False
    weights: Mapping[str, float] = field(default_factory=dict)

    def give_joint(self, joint: int, wanted: Array, name: str, *, endless: bool) -> None:
        """Set a joint's position, rate and acceleration, shape (3, T).

        Args:
            endless: Whether it is a gear that turns without limits.

        Raises:
            AssemblyError: A position is beyond any plausible range.
        """
        position, rate, acceleration = wanted
        m = self.mechanism
        kind = m.tree.joints[joint].kind
        far = FAR * m.length if m.closures.rows else np.inf
        turned = BLUR if endless or kind.endless else WOUND_UP
        limit = far if kind.slides else turned
        bad = np.flatnonzero(np.abs(position) > limit)  # catches mistakes in units
        if len(bad):
            unit = "m" if kind.slides else "rad"
            raise AssemblyError(
                f"joint '{name}' is out of reach{AT_SAMPLE}: {position[bad[0]]:.4g} {unit} (limit "
                f"{limit:.4g} {unit}); positions are in m and rad",
                sample=int(bad[0]),
            )
        at, to = m.tree.q_slices[joint], m.tree.v_slices[joint]
        if kind.endless:
            self.known[:, at.start], self.known[:, at.start + 1] = np.cos(position), np.sin(position)
            self.angles[joint] = position
        else:
            self.known[:, at.start] = position
        self.known_v[:, to.start], self.known_a[:, to.start] = rate, acceleration
        self.given.append(joint)

    def give_pose(self, link: str, place: tuple[int, Array, Array], motion: Motion) -> None:
        """Set a link's complete pose: a platform's as given coordinates, another body's as a target.

        Args:
            place: The link's body in the tree after the cuts, and its placement R, p in the body.
            motion: The link's motion in the module's base body.
        """
        body, R, p = place
        moved = motion.then(Motion.at_rest(len(motion.p), R.T, -R.T @ p))
        joint = self.mechanism.tree.joints[body - 1]
        if joint.kind is JointKind.FLOATING and joint.parent == 0:
            placement = Motion.at_rest(len(moved.p), joint.R, joint.p)
            self.give_floating(body - 1, moved.seen_from(placement))
            return
        self.targets.append((link, whole_target(body, moved, self.mechanism.length)))

    def give_floating(self, joint: int, inner: Motion) -> None:
        """Set the coordinates of a `floating` joint: its child's motion in its own frame on the parent."""
        at, to = self.mechanism.tree.q_slices[joint], self.mechanism.tree.v_slices[joint]
        self.known[:, at.start : at.start + 3] = inner.p
        self.known[:, at.start + 3 : at.stop] = quaternion_from_rotation(inner.R)
        self.known_v[:, to], self.known_a[:, to] = inner.twist(), inner.acceleration()
        self.given.append(joint)

    def give_followers(self) -> None:
        """Set the joints that linear couplings determine from joints that are set.

        Between two samples these move as the others do; followers along a curve are left to Newton's method.
        """
        tree = self.mechanism.tree
        waiting = [coupling for coupling in self.mechanism.spec.cut_couplings if not coupling.curve]
        while True:
            unknown = [{joint for joint, _ in c.terms}.difference(self.given) for c in waiting]
            ready = next((i for i, joints in enumerate(unknown) if len(joints) == 1), None)
            if ready is None:
                return
            coupling, (follower,) = waiting.pop(ready), unknown[ready]
            weight = sum(c for joint, c in coupling.terms if joint == follower)
            for level, slices, offset in (
                (self.known, tree.q_slices, coupling.offset),
                (self.known_v, tree.v_slices, 0.0),
                (self.known_a, tree.v_slices, 0.0),
            ):
                others = (c * level[:, slices[j].start] for j, c in coupling.terms if j != follower)
                level[:, slices[follower].start] = (offset - sum(others)) / weight
            self.given.append(follower)


def joined(requests: Iterable[ModuleRequest]) -> ModuleRequest:
    """Return one request for equal modules without targets: the samples of each, one after the other."""
    every = list(requests)
    known, known_v, known_a = (
        np.concatenate([getattr(r, name) for r in every]) for name in ("known", "known_v", "known_a")
    )
    angles = {joint: np.concatenate([r.angles[joint] for r in every]) for joint in every[0].angles}
    return replace(every[0], known=known, known_v=known_v, known_a=known_a, angles=angles)


def on_own_bases(requests: Requests, robot: HybridRobot, number: int | None = None) -> bool:
    """Check whether every pose in a module, or in any, is relative to its base: none needs another module."""
    place = robot.bodies.place
    owners = [(robot.body_owner[place[pose.link][0]][0], place[pose.other][0]) for pose in requests.poses]
    return all(
        other == place[robot.modules[owner].base][0] for owner, other in owners if number in (None, owner)
    )


def place_bodies(robot: HybridRobot, module: Module, motion: Motion, bodies: dict[int, Motion]) -> None:
    """Add the bodies of a module to those placed so far, in the root body, from the motion of its tree."""
    base = bodies[robot.bodies.place[module.base][0]]
    for i, joint in enumerate(module.joints):
        bodies[robot.body_of_joint[joint]] = base.then(motion.of_body(i + 1))


def module_request(
    requests: Requests,
    robot: HybridRobot,
    number: int,
    bodies: Mapping[int, Motion],
    *,
    followers: bool = True,
) -> ModuleRequest:
    """Build the request for one module.

    Args:
        requests: The requests for the whole robot.
        number: Index of the module.
        bodies: Motions of the bodies assembled so far, in the root body; those that carry the module or
            another pose's reference are needed only for a pose relative to another body than its base.
        followers: Whether joints that couplings determine from given ones are given, too.

    Raises:
        AssemblyError: A joint or a pose cannot be prescribed.
    """
    module = robot.modules[number]
    m = module.mechanism
    known = np.tile(m.home, (requests.samples, 1))
    still = np.zeros((2, requests.samples, m.tree.nv))
    request = ModuleRequest(
        m, known, still[0], still[1], strict=requests.strict, nearest=requests.nearest, stay=requests.stay,
        weights=requests.weights,
    )  # fmt: skip
    tree_joint = {source: i for i, source in enumerate(m.spec.tree_joint) if source is not None}
    for i, joint in enumerate(module.joints):
        if joint in requests.joints:
            if i not in tree_joint:
                raise AssemblyError(
                    f"joint '{joint}' belongs to a wrist that follows the platform of module "
                    f"'{module.name}'; give the platform's pose, or keep the joint: hybridyn.load(..., "
                    f"held=['{joint}'])",
                    module=module.name,
                )
            endless = joint in robot.description.endless_gears
            request.give_joint(tree_joint[i], requests.joints[joint], joint, endless=endless)
    for pose in requests.poses:
        if robot.body_owner[robot.bodies.place[pose.link][0]][0] != number:
            continue
        place, frame = place_in_tree(robot, pose.link), _frame_in_base(requests, robot, pose, bodies)
        if pose.motion is not None:
            request.give_pose(pose.link, place, frame.then(pose.motion))
        targets = partial_targets(pose, place[0], (frame.R[0], frame.p[0]), place[1:], m.length)
        request.targets += [(pose.link, target) for target in targets]
    if followers:
        request.give_followers()
    return request


def place_in_tree(robot: HybridRobot, link: str) -> tuple[int, Array, Array]:
    """Return the body of a module's tree after the cuts that has a link, and the link's placement R, p in it.

    Raises:
        AssemblyError: As in `body_in_tree`.
    """
    body, R, p = robot.bodies.place[link]
    number, R_end, p_end = body_in_tree(robot, robot.body_owner[body], link)
    return number, R_end @ R, p_end + R_end @ p


def body_in_tree(robot: HybridRobot, owner: tuple[int, int], link: str) -> tuple[int, Array, Array]:
    """Return the body of a module's tree after the cuts that has a body, and the body's placement R, p in it.

    Args:
        robot: The robot.
        owner: Number of the module, and of the body in its spanning tree.
        link: A link on the body, for messages.

    Raises:
        AssemblyError: The body is between the joints of a wrist that was cut.
    """
    module = robot.modules[owner[0]]
    found = module.mechanism.cut.place(owner[1])
    if found is None:
        raise AssemblyError(
            f"link '{link}' is between the joints of a wrist, which follows the platform of module "
            f"'{module.name}'; give the platform's pose instead",
            module=module.name,
        )
    return found


def _frame_in_base(
    requests: Requests, robot: HybridRobot, pose: PoseRequest, bodies: Mapping[int, Motion]
) -> Motion:
    """Compute the motion of the link in which a pose is measured, in the base body of the pose's module."""
    module = robot.modules[robot.body_owner[robot.bodies.place[pose.link][0]][0]]
    base, (other, R, p) = robot.bodies.place[module.base][0], robot.bodies.place[pose.other]
    placed = Motion.at_rest(requests.samples, R, p)
    if other == base:
        return placed
    if other not in bodies or pose.motion is None or pose.further:
        raise AssemblyError(
            f"pose of '{pose.link}' relative to '{pose.other}': give it relative to '{module.base}'",
            module=module.name,
        )
    return bodies[other].then(placed).seen_from(bodies[base])
