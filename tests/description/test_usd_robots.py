"""Robots as USD files: that of the page, with the commands; what `convert` wrote, in usd-core."""

import warnings
from pathlib import Path

import numpy as np
import pytest

from hybridyn.description import read
from tests.conversion.judge import written
from tests.robots.shipped import ROBOTS, shipped
from tests.support.extras import needs
from tests.support.samples import some

needs("usd")
from pxr import Usd, UsdGeom, UsdPhysics  # noqa: E402

#: usd-core computes in single precision.
SINGLE = 2e-6


@pytest.mark.parametrize("name", some(ROBOTS, ("delta",)))
def test_what_convert_writes_is_right_in_usd_core(name: str, tmp_path: Path) -> None:
    """Every joint is one for usd-core, and the bodies stand so that its frames of each joint coincide."""
    description = shipped(name)
    out = written(description, tmp_path / "robot.usda")
    assert all(
        line.startswith(("continuous joints", "effort limits of joints without", "names that USD"))
        for line in out.losses
    )
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
