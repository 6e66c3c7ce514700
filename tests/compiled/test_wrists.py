"""Wrists that were cut, on joints and links of every kind."""

from dataclasses import replace

import numpy as np

import hybridyn
from hybridyn.compiled.code.scalars import GUARD_LIMIT
from hybridyn.compiled.equations.states import random_states
from hybridyn.compiled.programs import whole_robot
from hybridyn.compiled.programs.robot_programs import RobotPrograms
from hybridyn.description import Description
from hybridyn.effects import choose
from hybridyn.joints.kinds import JointKind
from hybridyn.structure.building import build_robot
from tests.robots.posing import of_link
from tests.robots.shipped import shipped
from tests.robots.sketch import placement, rotation_of
from tests.support.comparing import SOLVED, close_to
from tests.support.written_out import Interpreted


def compare(description: Description, model: str) -> None:
    """Compare a model at moving states; no sample may be handed over."""
    robot = build_robot(description)
    q, v, a, tau = random_states(robot, 2, seed=1)
    given = tau if model == "ddm" else a
    (found,), guard = Interpreted(robot, (model,)).batch(model, q, v, given)
    assert (guard <= GUARD_LIMIT).all()
    close_to(found, getattr(hybridyn, model)(robot, q, v, given), SOLVED)


def test_a_screw_carries_a_platform() -> None:
    d = shipped("rps3")
    joints = (replace(j, kind=JointKind.SCREW, pitch=0.05) if j.kind == "prismatic" else j for j in d.joints)
    compare(replace(d, joints=tuple(joints)), "idm")


def test_legs_on_screws_of_different_pitch_differ_in_their_equations() -> None:
    """Where loops were just closed, no guard compares their ends."""
    d, pitches = shipped("gough_stewart"), iter((0.3, 0.5, -0.4, 0.2, 0.6, -0.3))
    joints = [
        replace(j, kind=JointKind.SCREW, pitch=next(pitches)) if j.kind == "prismatic" else j
        for j in d.joints
    ]
    robot = build_robot(replace(d, joints=tuple(joints)))
    q, v, a, _ = random_states(robot, 2, seed=1)
    model = RobotPrograms(robot, choose(robot, None)).model("idm", compared=False)
    (found,), guard = whole_robot.Interpreted([model]).batch("idm", q, v, a)
    assert (guard <= GUARD_LIMIT).all()
    close_to(found, hybridyn.idm(robot, q, v, a), SOLVED)


def test_a_wrist_hangs_from_the_platform() -> None:
    """The other end of the leg that it closes is a link of this leg."""
    d = shipped("gough_stewart")
    ball = next(c for c in d.closures if c.rotation == "free")
    robot = build_robot(d)
    still = np.zeros((1, robot.nv))
    pose = of_link(robot, robot.home[None], still, still, ball.link_a, ball.link_b)[0][0]
    seen = placement(rotation_of(pose[3:]), pose[:3])
    bare, like = next(x for x in d.links if not x.mass), next(j for j in d.joints if "wrist" in j.name)
    links, joints, parent, at = list(d.links), list(d.joints), ball.link_a, ball.frame_a
    for name, axis in zip("xyz", np.eye(3), strict=True):
        links.append(replace(bare, name=f"part_{name}"))
        turn = {"parent": parent, "child": f"part_{name}", "placement": at, "axis": axis}
        joints.append(replace(like, name=f"turn_{name}", **turn))
        parent, at = f"part_{name}", np.eye(4)
    weld = replace(
        ball, kind="fixed", link_a=parent, frame_a=at, frame_b=seen @ ball.frame_a,
        rotation="fixed",
    )  # fmt: skip
    closures = tuple(weld if c is ball else c for c in d.closures)
    compare(replace(d, links=tuple(links), joints=tuple(joints), closures=closures), "ddm")
