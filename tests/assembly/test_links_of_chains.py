"""Every link can be placed: at wrists' ends, on slides without extent, on modules of other poses."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn import AssemblyError, HybridRobot
from hybridyn.structure.building import build_robot
from tests.robots.mechanisms import random_mechanism, random_states
from tests.robots.posing import far_apart, of_joints, of_link
from tests.robots.shipped import shipped, states_near_home
from tests.support.comparing import close_to, refused

REACHED = 1e-10  # relative, of positions, rates and accelerations
KINDS = ("gough", "star_universal")


def links_at_wrists(robot: HybridRobot) -> tuple[list[str], list[str]]:
    """Return the links at the ends of cut wrists, and those between the joints of these."""
    ends, between = [], []
    m = robot.modules[0].mechanism
    at = {wrist.end for wrist in m.spec.wrists if not wrist.carries}
    for link, (body, _, _) in robot.bodies.place.items():
        number, local = robot.body_owner[body]
        if body and number == 0 and local in at:
            ends.append(link)
        elif body and number == 0 and local not in m.cut.bodies:
            between.append(link)
    return ends, between


@pytest.mark.parametrize("kind", KINDS)
def test_poses_of_links_at_the_ends_of_wrists_are_theirs(kind: str) -> None:
    description = random_mechanism(3, kind=kind)
    robot = build_robot(description)
    q, v, a = random_states(description, "fixed", 3, 1)
    motors, root = of_joints(robot, q, v, a), description.root
    ends, between = links_at_wrists(robot)
    assert ends
    assert between
    for link in ends[:2]:
        given = {link: of_link(robot, q, v, a, link, root)}
        found = hybridyn.assemble(robot, motors=motors, platforms=given, guess=q[0])
        assert far_apart(robot, found[0], q) < REACHED, link
        for one, wanted in zip(found[1:], (v, a), strict=True):
            close_to(one, wanted, REACHED)
    given = {between[0]: of_link(robot, q, v, a, between[0], root)}
    refused(partial(hybridyn.assemble, robot, platforms=given), AssemblyError, "joints of a wrist, which")


@pytest.mark.parametrize("offset", [0.0, 3e-17, 1e-3])
def test_slides_without_extent_are_measured_by_the_robot(offset: float, tmp_path: Path) -> None:
    """A joint's distance from its base is a choice of frames, and may be rounding."""
    parts, below = ['<link name="base"/>'], "base"
    for axis, at in (("1 0 0", offset), ("0 1 0", offset), ("0 0 1", 0.5)):
        name = f"l{len(parts)}"
        parts.append(
            f'<link name="{name}"/><joint name="j{len(parts)}" type="prismatic"><parent link="{below}"/>'
            f'<child link="{name}"/><origin xyz="{at!r} 0 0"/><axis xyz="{axis}"/>'
            '<limit lower="-9" upper="9" effort="9" velocity="9"/></joint>'
        )
        below = name
    path = tmp_path / "gantry.urdf"
    path.write_text(f'<robot name="gantry">{"".join(parts)}</robot>')
    robot, goal = hybridyn.load(path), np.array([3.0, -2.0, 1.0])
    q = hybridyn.assemble(robot, platforms={"l3": (dict(zip("xyz", goal, strict=True)),)})[0]
    close_to(q, goal - [0.5 + 2 * offset, 0.0, 0.0], REACHED)


def test_poses_through_modules_of_other_poses_wait_for_these() -> None:
    """The third platform of an lx4 is given twice; the fourth stands on it."""
    robot = build_robot(shipped("lx4"))
    states = states_near_home(robot.description, "fixed", 3, 1)
    root, links = robot.description.root, [m.outputs[0] for m in robot.modules]
    motors = of_joints(robot, *states, [name for m in robot.modules[:2] for name in m.motors])
    third, fourth = (of_link(robot, *states, link, root) for link in links[2:4])
    part = of_link(robot, *states, links[2], links[0])
    along = tuple({"x": level[:, 0]} for level in part)
    platforms = {links[2]: third, f"{links[2]}@{links[0]}": along, links[3]: fourth}
    found = hybridyn.assemble(robot, motors=motors, platforms=platforms)
    assert far_apart(robot, found[0], states[0]) < REACHED
    for one, wanted in zip(found[1:], states[1:], strict=True):
        close_to(one, wanted, 1e-8)
