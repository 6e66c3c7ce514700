"""Robots as USD files: that of the page, with the commands; what `convert` wrote, in usd-core."""

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hybridyn.description import Coupling, Description, Joint, Link, read
from hybridyn.description.placement import placement_from, rotation_from_rpy
from tests.conversion.judge import written
from tests.extras import needs
from tests.samples import some
from tests.shipped import ROBOTS, shipped

needs("usd")
from pxr import Usd, UsdGeom, UsdPhysics  # noqa: E402

#: usd-core computes in single precision.
SINGLE = 2e-6


@pytest.mark.parametrize("name", some(ROBOTS, ("delta",)))
def test_what_convert_writes_is_right_in_usd_core(name: str, tmp_path: Path) -> None:
    """Every joint is one for usd-core, and the bodies stand so that its frames of each joint coincide."""
    description = shipped(name)
    out = written(description, tmp_path / "robot.usda")
    assert out.losses == ()
    stage = Usd.Stage.Open(str(tmp_path / "robot.usda"))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        found = UsdPhysics.LoadUsdPhysicsFromRange(stage, ["/"])
    joints = [
        record
        for _, records in found.values()
        for record in records
        if isinstance(record, UsdPhysics.JointDesc)
    ]
    assert all(joint.isValid for joint in joints)
    assert len(joints) == 1 + len(description.joints) + len(description.closures)
    assert sum(joint.excludeFromArticulation for joint in joints) == len(description.closures)
    size = max(float(np.abs(joint.placement[:3, 3]).max()) for joint in description.joints)
    for joint in joints:
        if joint.body0.isEmpty or joint.type == UsdPhysics.ObjectType.PrismaticJoint:
            continue
        sides = (joint.body0, joint.localPose0Position), (joint.body1, joint.localPose1Position)
        first, second = (
            UsdGeom.Xformable(stage.GetPrimAtPath(body)).ComputeLocalToWorldTransform(0).Transform(place)
            for body, place in sides
        )
        np.testing.assert_allclose(np.array(first), np.array(second), atol=10 * SINGLE * size)


def test_it_comes_back_from_its_binary_form(tmp_path: Path) -> None:
    written(shipped("delta"), tmp_path / "robot.usda")
    Usd.Stage.Open(str(tmp_path / "robot.usda")).Export(str(tmp_path / "robot.usdc"))
    text, binary = read(tmp_path / "robot.usda"), read(tmp_path / "robot.usdc")
    for one, other in zip(text.joints, binary.joints, strict=True):
        np.testing.assert_array_equal(one.placement, other.placement)
    for one, other in zip(text.links, binary.links, strict=True):
        np.testing.assert_array_equal(one.inertia, other.inertia)


def test_a_floating_base_and_its_gravity_come_back(tmp_path: Path) -> None:
    description = replace(
        shipped("five_bar"), base="floating", base_home=(1, 2, 3, 0.6, 0, 0, 0.8), gravity=(0.1, -0.2, -1.62)
    )
    written(description, tmp_path / "robot.usda")
    found = read(tmp_path / "robot.usda")
    assert (found.base, found.root) == ("floating", description.root)
    np.testing.assert_allclose(found.base_home, description.base_home, atol=1e-15)
    np.testing.assert_allclose(found.gravity, description.gravity, atol=1e-15)


def test_what_records_can_say_comes_back(tmp_path: Path) -> None:
    """Kinds of joints and numbers that no shipped robot has."""
    kinds = ("continuous", "planar", "spherical", "floating", "prismatic", "revolute")
    turn = rotation_from_rpy(0.1, -0.2, 0.3)
    inertia = turn @ np.diag([1.0, 2.0, 2.5]) @ turn.T
    links = [
        Link("base", 0.0, np.zeros(3), np.zeros((3, 3))),
        Link("a link-1", 2.0, np.zeros(3), np.zeros((3, 3))),
    ]
    links += [Link(f"l{i}", 1 / 3, turn[0], inertia, None, i == 3) for i in range(1, 6)]
    joints = [
        Joint(f"{kind}/joint", kind, links[i].name, links[i + 1].name, placement_from(turn, turn[1]),
              np.array([0.0, 0.0, 1.0]) if kind == "planar" else -turn[2])
        for i, kind in enumerate(kinds)
    ]  # fmt: skip
    joints[4] = replace(joints[4], lower=-1 / 3, upper=0.1, velocity=1 / 7, effort=1 / 9, damping=1 / 11)
    joints[5] = replace(
        joints[5], friction=1 / 13, rotor_inertia=1 / 17, gear_ratio=-3.0, lower=-0.1, effort=1 / 3
    )
    half = float(np.sqrt(0.5))
    home = {
        "continuous/joint": (half, half), "planar/joint": (0.1, 0.2, 0.6, 0.8), "prismatic/joint": (1 / 3,),
        "spherical/joint": (0.48, 0.36, 0.0, 0.8), "floating/joint": (1 / 3, 0.2, 0.3, 0.0, 0.6, 0.0, 0.8),
        "revolute/joint": (-1 / 7,),
    }  # fmt: skip
    description = Description(
        "my robot", tuple(links), tuple(joints), motors=("revolute/joint", "prismatic/joint"), home=home,
        couplings=(Coupling("revolute/joint", (("revolute/joint", 2.0), ("prismatic/joint", 1 / 3)), 0.1),),
    )  # fmt: skip
    assert written(description, tmp_path / "robot.usd").losses == ()
    found = read(tmp_path / "robot.usd")
    assert (found.name, found.motors) == ("my robot", description.motors)
    for ours, theirs in zip(found.links, links, strict=True):
        assert (ours.name, ours.mass, ours.between_joints) == (
            theirs.name,
            theirs.mass,
            theirs.between_joints,
        )
        np.testing.assert_allclose(ours.inertia, theirs.inertia, atol=1e-15)
    for one, other in zip(found.joints, joints, strict=True):
        for field in ("name", "kind", "parent", "child", "gear_ratio"):
            assert getattr(one, field) == getattr(other, field)
        for field in (
            "placement",
            "axis",
            "lower",
            "upper",
            "velocity",
            "effort",
            "damping",
            "friction",
            "rotor_inertia",
        ):
            if field != "axis" or other.kind not in ("spherical", "floating"):
                np.testing.assert_allclose(getattr(one, field), getattr(other, field), rtol=1e-15, atol=1e-15)
        ours = found.home[one.name]
        ours = (np.cos(ours[0]), np.sin(ours[0])) if one.kind == "continuous" else ours
        np.testing.assert_allclose(ours, home[one.name], atol=1e-15)
    (coupling,) = found.couplings
    np.testing.assert_allclose([coupling.terms[1][1], coupling.offset], [1 / 6, 0.05], rtol=1e-15)
