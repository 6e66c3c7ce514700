"""What requests ask of each module alone, in its own tree."""

from __future__ import annotations

from numpy.typing import ArrayLike

from ....assembly.module_request import ModuleRequest, module_request, on_own_bases, place_in_tree
from ....assembly.poses import PoseRequest
from ....assembly.requests import Requests, gather_requests
from ....linkage.motion import Motion
from ....spatial import cross
from ....structure.module import Module
from ....structure.robot import HybridRobot
from ....structure.samples import as_batch, same_samples


def requests_of_motors(
    robot: HybridRobot, position: ArrayLike, rates: tuple[ArrayLike | None, ArrayLike | None]
) -> Requests:
    """Return the requests that prescribe all motors.

    Args:
        position: Positions in the order of `robot.motors`, shape (motors,) or (T, motors), [m or rad].
        rates: Their rates and accelerations, of the same shape; zero where left out.

    Raises:
        TrajectoryError: An array has a wrong shape, or is not finite.
    """
    count = len(robot.motors)
    first, single = as_batch(position, count, "position")
    given = {"rate": rates[0], "acceleration": rates[1]}
    found = {name: as_batch(x, count, name)[0] for name, x in given.items() if x is not None}
    same_samples(position=first, **found)
    each = [x[0] if single else x for x in (first, *(found.get(name, 0.0 * first) for name in given))]
    motors = {name: tuple(x[..., i] for x in each) for i, name in enumerate(robot.motors)}
    return gather_requests(robot, motors, {})


def modules_of(robot: HybridRobot) -> list[tuple[int, Module]]:
    """Return the modules that requests close, with their numbers: all but a free base."""
    first = 1 if robot.base == "floating" else 0
    return list(enumerate(robot.modules))[first:]


def module_requests(robot: HybridRobot, requests: Requests) -> list[ModuleRequest] | None:
    """Build the request for each module; None if one depends on the posture of another module.

    That also holds for the motion of a frame in which a pose is measured. A pose relative to the base of its
    own module needs no motion of the base.

    Raises:
        HybridynError: As in `assembly.module_request`.
    """
    if any(pose.frame is not None or pose.further for pose in requests.poses):
        return None
    still, out = Motion.at_rest(requests.samples), list[ModuleRequest]()
    placed, known = {0: still}, {0}  # the motions that are not known do not matter
    far = not on_own_bases(requests, robot)
    for k, module in modules_of(robot):
        base = robot.bodies.place[module.base][0]
        poses = [p for p in requests.poses if robot.body_owner[robot.bodies.place[p.link][0]][0] == k]
        for pose in poses:
            other = robot.bodies.place[pose.other][0]
            if other != base and other in placed and not {other, base} <= known:
                return None
        own = [pose for pose in poses if _is_own(robot, pose, base)]
        others = tuple(pose for pose in poses if pose not in own)
        # Kernels take the motors' numbers alone, and find what follows by gears among the unknowns.
        request = module_request(requests._replace(poses=others), robot, k, placed, followers=False)
        for pose in own:
            request.give_floating(place_in_tree(robot, pose.link)[0] - 1, _of_platform(robot, pose))
        out.append(request)
        placed |= dict.fromkeys((robot.body_of_joint[joint] for joint in module.joints), still)
        for pose in poses if far else ():
            other = robot.bodies.place[pose.other][0]
            if pose.motion is not None and other in known:
                body = robot.bodies.place[pose.link][0]
                placed[body] = _of_body(robot, pose, placed[other])
                known.add(body)
    return out


def _is_own(robot: HybridRobot, pose: PoseRequest, base: int) -> bool:
    """Return whether a pose is the whole pose of a platform in the base of its own module."""
    body, other = (robot.bodies.place[link][0] for link in (pose.link, pose.other))
    if pose.motion is None or other != base:
        return False
    m = robot.modules[robot.body_owner[body][0]].mechanism
    return place_in_tree(robot, pose.link)[0] - 1 in m.spec.platforms


def _of_platform(robot: HybridRobot, pose: PoseRequest) -> Motion:
    """Compute the motion of a platform's body in its base from that of a link of it in a link of the base."""
    _, R_link, p_link = place_in_tree(robot, pose.link)
    _, R_other, p_other = robot.bodies.place[pose.other]
    m = pose.motion
    assert m is not None
    arm = m.R @ (-R_link.T @ p_link)  # from the link's origin to the body's, axes of the other link
    swing = cross(m.w, arm)
    p_dot = m.p_dot + swing
    p_ddot = m.p_ddot + cross(m.w_dot, arm) + cross(m.w, swing)
    back = R_other.T
    return Motion(
        R_other @ (m.R @ R_link.T), (m.p + arm) @ back + p_other, m.w @ back, p_dot @ back,
        m.w_dot @ back, p_ddot @ back,
    )  # fmt: skip


def _of_body(robot: HybridRobot, pose: PoseRequest, other: Motion) -> Motion:
    """Compute the motion of the body whose whole pose is given in another body, of known motion."""
    _, R, p = robot.bodies.place[pose.link]
    assert pose.motion is not None
    in_other = Motion.at_rest(len(pose.motion.p), *robot.bodies.place[pose.other][1:])
    link = other.then(in_other).then(pose.motion)
    return link.then(Motion.at_rest(len(pose.motion.p), R.T, -R.T @ p))


def structure_of(requests: Requests) -> tuple[object, ...]:
    """Return what requests have in common that the same program closes."""
    poses = tuple(
        (
            p.link, p.other, p.motion is None, p.turn is None, tuple(p.coordinates),
            p.direction and p.direction[0], p.distance is None,
        )
        for p in requests.poses
    )  # fmt: skip
    rule = requests.redundancy, *requests.weights.items()
    return tuple(requests.joints), poses, requests.base is None, rule
