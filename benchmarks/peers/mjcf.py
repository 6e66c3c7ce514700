"""A robot as MJCF: hinges and slides, loops closed by equality constraints between sites.

MuJoCo refuses moving bodies without mass but lets a body have several joints, so the joints of a massless
link go to the next link with mass, written in its frame at joint position zero.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pinocchio as pin

from benchmarks.methods import NotMeasuredError
from benchmarks.peers.pinocchio_loops import closure_kind
from hybridyn import HybridRobot
from hybridyn.description.records import Description, Joint, Link
from hybridyn.spatial import Array

KINDS = {"revolute": "hinge", "continuous": "hinge", "prismatic": "slide"}
EQUALITY = {"spherical": "connect", "fixed": "weld"}
#: "world" is a name of MuJoCo's own.
PREFIX = "body_"


def mjcf(robot: HybridRobot) -> str:
    """Write a robot on a fixed base as MJCF.

    Raises:
        NotMeasuredError: It has a joint or closure that MJCF cannot state, or its base moves.
    """
    description = robot.description
    if robot.base != "fixed" or set(robot.kinds) - set(KINDS) or description.couplings:
        raise NotMeasuredError("only hinges and slides on a fixed base are written as MJCF")
    root = ET.Element("mujoco")
    ET.SubElement(root, "compiler", angle="radian", autolimits="false", inertiafromgeom="false")
    option = ET.SubElement(root, "option", gravity=_text(robot.gravity), tolerance="0", solver="Newton")
    ET.SubElement(option, "flag", warmstart="disable")
    base = ET.SubElement(ET.SubElement(root, "worldbody"), "body", name=f"{PREFIX}{description.root}")
    links = {link.name: link for link in description.links}
    _inertial(base, links[description.root])
    _grow(base, description, links, description.root, np.eye(4), [])
    _close(root, robot)
    return ET.tostring(root, encoding="unicode")


def _grow(
    element: ET.Element,
    description: Description,
    links: dict[str, Link],
    parent: str,
    M: Array,
    carried: list[tuple[Joint, Array]],
) -> None:
    """Add what hangs from a link; M and carried are placement and joints since the last body with mass."""
    for joint in (j for j in description.joints if j.parent == parent):
        at, joints = M @ joint.placement, [(j, frame @ joint.placement) for j, frame in carried]
        if joint.kind != "fixed":
            joints.append((joint, np.eye(4)))
        if joints and _is_only_a_joint(description, links[joint.child]):
            _grow(element, description, links, joint.child, at, joints)
            continue
        body = ET.SubElement(element, "body", {"name": f"{PREFIX}{joint.child}", **_pose(at)})
        for j, frame in joints:
            inverse = np.asarray(np.linalg.inv(frame), dtype=float)
            pos, axis = _text(inverse[:3, 3]), _text(inverse[:3, :3] @ j.axis)
            ET.SubElement(body, "joint", name=j.name, type=KINDS[j.kind], pos=pos, axis=axis)
        _inertial(body, links[joint.child])
        _grow(body, description, links, joint.child, np.eye(4), [])


def _is_only_a_joint(description: Description, link: Link) -> bool:
    """Tell whether a link has no mass, carries one joint, and closes nothing."""
    closed = {end for c in description.closures for end in (c.link_a, c.link_b)}
    children = sum(joint.parent == link.name for joint in description.joints)
    return link.mass == 0 and children == 1 and link.name not in closed


def _inertial(body: ET.Element, link: Link) -> None:
    if link.mass == 0:
        return
    xx, xy, xz, yy, yz, zz = link.inertia[np.triu_indices(3)]
    full = _text(np.array([xx, yy, zz, xy, xz, yz]))
    ET.SubElement(body, "inertial", pos=_text(link.com), mass=repr(float(link.mass)), fullinertia=full)


def _close(root: ET.Element, robot: HybridRobot) -> None:
    """Close the loops between sites, MuJoCo's frames that are no bodies."""
    equality, bodies = ET.SubElement(root, "equality"), {b.get("name"): b for b in root.iter("body")}
    for closure in robot.description.closures:
        kind = EQUALITY.get(closure_kind(robot, closure.name))
        if kind is None:
            raise NotMeasuredError(f"closure '{closure.name}' ({closure.kind}) is neither a point nor a weld")
        for end, link, frame in (
            ("a", closure.link_a, closure.frame_a),
            ("b", closure.link_b, closure.frame_b),
        ):
            site = {"name": f"{closure.name}_{end}", **_pose(frame)}
            ET.SubElement(bodies[f"{PREFIX}{link}"], "site", site)
        ET.SubElement(equality, kind, site1=f"{closure.name}_a", site2=f"{closure.name}_b")


def _pose(M: Array) -> dict[str, str]:
    quaternion = pin.Quaternion(M[:3, :3]).coeffs()
    return {"pos": _text(M[:3, 3]), "quat": _text(quaternion[[3, 0, 1, 2]])}


def _text(numbers: Array) -> str:
    return " ".join(repr(float(x)) for x in numbers)
