"""A robot whose USD has other frames is the same robot.

Each body gets another frame, so that axes miss the origins of links; each joint gets other frames on its
axis, and half of them are stated from the child to the parent; lengths are in centimetres, masses in half
kilograms.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hybridyn.conversion.renamed import allowed
from hybridyn.conversion.request import Losses
from hybridyn.conversion.usd import add_body, valid_name
from hybridyn.conversion.usd_joints import End, add_closure, start_joint
from hybridyn.conversion.usd_prim import UsdPrim
from hybridyn.description import Description, read
from hybridyn.description.placement import placement_from, poses_at, rotation_from_rpy, rotation_to_axis
from tests.conversion.judge import SINGLE, same_robot, states
from tests.robots.mechanisms import random_mechanism, random_states
from tests.robots.shipped import ROBOTS, shipped
from tests.support.extras import needs
from tests.support.files import save
from tests.support.samples import some

needs("usd")

OTHERS = ("loop_planar", "loop_fixed", "four_bar_two_motors")
CENTIMETRES, HALF_KILOGRAMS = 100.0, 2.0
TYPES = {"revolute": "rot", "continuous": "rot", "prismatic": "trans"}


def random_frame(draw: np.random.Generator) -> np.ndarray:
    return placement_from(rotation_from_rpy(*draw.uniform(-3, 3, 3)), draw.uniform(-1, 1, 3))


def longer(placement: np.ndarray) -> np.ndarray:
    """Return a placement in the file's unit of length."""
    return placement_from(placement[:3, :3], placement[:3, 3] * CENTIMETRES)


def scrambled(d: Description, seed: int) -> str:
    """Return a robot as USD in other frames and units."""
    draw = np.random.default_rng(seed)
    frames = {link.name: np.eye(4) if link.name == d.root else random_frame(draw) for link in d.links}
    back = {name: np.linalg.inv(frame) for name, frame in frames.items()}
    poses, top = poses_at(d, d.home), UsdPrim("", "", "")
    robot = top.child("Xform", d.name)
    bodies = {}
    for link in d.links:
        turn = frames[link.name][:3, :3]
        com = (back[link.name] @ [*link.com, 1])[:3] * CENTIMETRES
        inertia = turn.T @ link.inertia @ turn * CENTIMETRES**2 * HALF_KILOGRAMS
        moved = replace(link, mass=link.mass * HALF_KILOGRAMS, com=com, inertia=(inertia + inertia.T) / 2)
        bodies[link.name] = add_body(robot, moved, longer(poses[link.name] @ frames[link.name]))
    start_joint(robot, "root", (), (End(None, np.eye(4)), End(bodies[d.root], np.eye(4))))
    for joint in d.joints:
        turn = rotation_to_axis(joint.axis) if joint.kind != "fixed" else np.eye(3)
        axis = np.array([0.0, 0.0, 1.0])
        along = placement_from(turned(axis, draw.uniform(-3, 3)), axis * draw.normal())
        ends = [joint.placement @ placement_from(turn, np.zeros(3)), placement_from(turn, np.zeros(3))]
        names = [joint.parent, joint.child]
        if draw.random() < 0.5:
            flip = turned(np.roll(axis, 1), np.pi)
            ends = [end @ placement_from(flip, np.zeros(3)) for end in ends[::-1]]
            names = names[::-1]
        places = [longer(back[name] @ end @ along) for name, end in zip(names, ends, strict=True)]
        free = (TYPES[joint.kind] + "Z",) if joint.kind != "fixed" else ()
        first, second = (End(bodies[name], place) for name, place in zip(names, places, strict=True))
        prim = start_joint(robot, joint.name, free, (first, second))
        if joint.name in d.motors:
            prim.apply("PhysicsDriveAPI:linear" if joint.kind == "prismatic" else "PhysicsDriveAPI:angular")
    for closure in d.closures:
        end_a, end_b = (
            longer(back[closure.link_a] @ closure.frame_a),
            longer(back[closure.link_b] @ closure.frame_b),
        )
        moved_closure = replace(closure, frame_a=end_a, frame_b=end_b)
        ends = closure.link_a, closure.link_b
        add_closure(robot, moved_closure, (bodies[ends[0]], bodies[ends[1]]), Losses())
    units = 'metersPerUnit = 0.01\nkilogramsPerUnit = 0.5\nupAxis = "Z"'
    head = f'#usda 1.0\n(\ndefaultPrim = "{robot.name}"\n{units}\n)\n'
    return head + "\n".join(robot.lines()) + "\n"


def turned(axis: np.ndarray, angle: float) -> np.ndarray:
    """Return the rotation about a coordinate axis."""
    cross = np.cross(np.eye(3), axis).T
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def plain(d: Description) -> Description:
    """Return a robot with its motors in the order of its joints, without what `scrambled` leaves out."""
    d = allowed(d, Losses(), "USD", valid_name)
    driven, gone = {*d.motors}, {"damping": 0.0, "friction": 0.0, "rotor_inertia": 0.0, "gear_ratio": 1.0}
    joints = tuple(replace(joint, **gone) for joint in d.joints)
    return replace(d, joints=joints, motors=tuple(joint.name for joint in d.joints if joint.name in driven))


@pytest.mark.parametrize("name", some((*ROBOTS, *OTHERS), ("five_bar", "loop_planar")))
def test_a_robot_in_other_frames(name: str, tmp_path: Path) -> None:
    drawn = name in OTHERS
    description = plain(replace(random_mechanism(3, kind=name), couplings=()) if drawn else shipped(name))
    found = read(save(tmp_path, scrambled(description, 4), "robot.usda"))
    closed = random_states(description, "fixed", 3, 2) if drawn else states(description)
    same_robot(description, found, closed, links=False, tolerance=SINGLE)
