"""Small valid files of every format: free bodies, a pile of them, an object alone, few joints or none.

A file states up to three bodies. Each stands in the world or on another one, by a joint of some kind, or
freely. The robot that is read has the freedoms of these joints, and every check of it ends.
"""

import itertools
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

import hybridyn
from hybridyn.errors import HybridynError
from hybridyn.loading import of_files
from hybridyn.studies.workspace.workspace import workspace
from tests.description.sdf_texts import joint as sdf_joint
from tests.description.sdf_texts import link as sdf_link
from tests.description.sdf_texts import sdf
from tests.description.usd_texts import body as usd_body
from tests.description.usd_texts import joint as usd_joint
from tests.description.usd_texts import usda
from tests.support.comparing import refused
from tests.support.extras import needs
from tests.support.files import save


class Body(NamedTuple):
    """A body, the one that it stands on ("" for the world), and the joint between: `FREEDOMS`."""

    name: str
    on: str
    joint: str


FREEDOMS = {"free": 6, "hinge": 1, "slide": 1, "ball": 3, "fixed": 0}
INERTIAL = (
    '<inertial><mass value="1"/><inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial>'
)


def urdf(bodies: list[Body]) -> str:
    """Return a URDF, which has no ball joint: a planar one has as many freedoms."""
    kinds = {
        "free": "floating",
        "hinge": "revolute",
        "slide": "prismatic",
        "fixed": "fixed",
        "ball": "planar",
    }
    limit = '<limit lower="-1" upper="1" effort="0" velocity="1"/>'
    parts = (
        f'<link name="{one.name}">{INERTIAL}</link><joint name="{one.name}_joint" type="{kinds[one.joint]}">'
        f'<parent link="{one.on or "world"}"/><child link="{one.name}"/><axis xyz="0 0 1"/>{limit}</joint>'
        for one in bodies
    )
    return f'<robot name="r"><link name="world"/>{"".join(parts)}</robot>'


def mjcf(bodies: list[Body]) -> str:
    """Return an MJCF."""
    joints = {"free": "<freejoint/>", "hinge": "<joint/>", "slide": '<joint type="slide"/>'}
    joints |= {"ball": '<joint type="ball"/>', "fixed": ""}

    def inside(on: str) -> str:
        return "".join(
            f'<body name="{one.name}">{joints[one.joint]}<geom size=".1"/>{inside(one.name)}</body>'
            for one in bodies
            if one.on == on
        )

    return f"<mujoco><worldbody>{inside('')}</worldbody></mujoco>"


def sdf_text(bodies: list[Body]) -> str:
    """Return an SDF: bodies without a joint are free."""
    kinds = {"hinge": "revolute", "slide": "prismatic", "ball": "ball", "fixed": "fixed"}
    joints = [
        sdf_joint(f"{one.name}_joint", kinds[one.joint], one.on or "world", one.name)
        for one in bodies
        if one.joint != "free"
    ]
    return sdf(*(sdf_link(one.name) for one in bodies), *joints)


def usd(bodies: list[Body]) -> str:
    """Return a USD: bodies without a joint are free."""
    kinds = {"hinge": "Revolute", "slide": "Prismatic", "ball": "Spherical", "fixed": "Fixed"}
    joints = [
        usd_joint(kinds[one.joint], f"{one.name}_joint", one.on, one.name)
        for one in bodies
        if one.joint != "free"
    ]
    return usda(*(usd_body(one.name) for one in bodies), *joints)


FORMATS: dict[str, Callable[[list[Body]], str]] = {
    "urdf": urdf, "xml": mjcf, "sdf": sdf_text, "usda": usd,
}  # fmt: skip


#: The extra that reads a format.
EXTRAS = {"xml": "mjcf", "usda": "usd"}


def layouts() -> list[list[Body]]:
    """Return every file of one or two bodies, piles of three, and a free body beside a chain."""
    out = [[Body("a", "", kind)] for kind in FREEDOMS]
    for first, second in itertools.product(FREEDOMS, repeat=2):
        out.append([Body("a", "", first), Body("b", "", second)])
        out += [[Body("a", "", first), Body("b", "a", second)]] * (second != "free")
    out += [[Body(name, "", kind) for name in "abc"] for kind in FREEDOMS]
    chain = [Body("a", "", "hinge"), Body("b", "a", "hinge")]
    return [*out, [*chain, Body("c", "", "free")], [*chain, Body("c", "a", "hinge")]]


def check_installed(ending: str) -> None:
    """Skip a test of a format whose reader is not installed."""
    if ending in EXTRAS:
        needs(EXTRAS[ending])


@pytest.mark.parametrize("ending", FORMATS)
def test_a_robot_of_few_bodies_is_read_and_checked(ending: str, tmp_path: Path) -> None:
    check_installed(ending)
    for bodies in layouts():
        path = save(tmp_path, FORMATS[ending](bodies), f"small.{ending}")
        robot = hybridyn.load(path)
        assert robot.mobility == sum(FREEDOMS[one.joint] for one in bodies), bodies
        driven = [one for one in bodies if one.joint in ("hinge", "slide")]
        assert len(robot.motors) <= len(driven), bodies
        signs = [remark for remark in of_files(robot.description) if "effort" in remark]
        assert driven or not signs, (bodies, signs)
        found = hybridyn.check(path, robot, meshes=False)
        assert not [finding for finding in found if finding.severity == "error"], (bodies, found)


@pytest.mark.parametrize("kind", ["revolute", "continuous", "prismatic", "planar", "floating", "fixed"])
def test_a_weld_of_one_joint_that_cannot_close_is_refused(kind: str, tmp_path: Path) -> None:
    weld = (
        '<loop name="weld" type="fixed"><predecessor link="world"><origin xyz="0.3 0 0" rpy="1 2 0.5"/>'
        '</predecessor><successor link="a"/></loop></robot>'
    )
    text = urdf([Body("a", "", "hinge")]).replace("revolute", kind).replace("</robot>", weld)
    if kind == "floating":
        assert hybridyn.load(save(tmp_path, text)).mobility == 0
    else:
        refused(lambda: hybridyn.load(save(tmp_path, text)), HybridynError, "closes its loops|weld")


@pytest.mark.parametrize("ending", FORMATS)
def test_a_file_without_bodies_is_a_base_or_refused(ending: str, tmp_path: Path) -> None:
    check_installed(ending)
    path = save(tmp_path, FORMATS[ending]([]), f"empty.{ending}")
    if ending == "urdf":
        robot = hybridyn.load(path)
        assert robot.mobility == 0
        refused(lambda: workspace(robot), hybridyn.TrajectoryError, "no joint of 'r' moves")
        return
    (found,) = hybridyn.check(path)
    assert (found.code, "has at least one" in found.message) == ("unreadable", True)
