"""Poses, axes and inertias of SDF files against rod, which reads SDF by code of its own."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn.description import read
from hybridyn.structure.robot import HybridRobot
from tests.conversion.judge import written
from tests.description.sdf_texts import random_pair, sdf
from tests.robots.shipped import ROBOTS, shipped
from tests.support.extras import needs
from tests.support.files import save
from tests.support.samples import slow, some

rod = needs("sdf")
transforms = pytest.importorskip("rod.kinematics.tree_transforms")

#: Two programs that multiply the same few matrices.
AGAINST_ROD = 1e-12

CASES = [(1, "1.7"), *(slow(seed, version) for version in ("1.7", "1.8") for seed in range(2, 12))]


@pytest.mark.parametrize(("seed", "version"), CASES)
def test_frames_are_those_of_rod(seed: int, version: str, tmp_path: Path) -> None:
    pin.seed(seed)
    texts = random_pair(seed, version)
    file = save(tmp_path, sdf(*texts.sdf[:-1], version=version), "robot.sdf")  # rod reads trees
    compare(hybridyn.load(file), file)


@pytest.mark.parametrize("name", some([name for name in ROBOTS if name != "snake"], ()))
def test_rod_reads_what_is_written(name: str, tmp_path: Path) -> None:
    """The tree of a robot as `convert` writes it stands at home for rod, too."""
    description = shipped(name)
    file = tmp_path / "robot.sdf"
    written(description, file)
    robot = hybridyn.load(file)
    assert sum(joint.name.startswith("anchor") for joint in model_of(file).joints()) == (
        robot.base == "fixed"
    )
    cut = {closure.name for closure in robot.description.closures}
    compare(robot, file, cut)


def model_of(file: Path) -> object:
    """Return rod's model of a file."""
    parsed = rod.Sdf.load(sdf=file, is_urdf=False)
    return parsed.models()[0]


def compare(robot: HybridRobot, file: Path, cut: set[str] = frozenset()) -> None:
    """Compare links, in the posture of the file, and axes in the world."""
    model = model_of(file)
    model.joint = [joint for joint in model.joints() if joint.name not in cut]
    tree = transforms.TreeTransforms.build(model)
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, robot.home)
    place = {
        link.name: data.oMf[robot.model.getFrameId(link.name, pin.BODY)] for link in robot.description.links
    }
    by_name = {link.name: link for link in robot.description.links}
    for link in model.links():
        np.testing.assert_allclose(place[link.name], tree.transform(link.name), atol=AGAINST_ROD)
        found, at = by_name[link.name], link.inertial.pose.transform() if link.inertial.pose else np.eye(4)
        assert found.mass == link.inertial.mass
        np.testing.assert_allclose(found.com, at[:3, 3], atol=AGAINST_ROD)
        turned = at[:3, :3] @ link.inertial.inertia.matrix() @ at[:3, :3].T
        np.testing.assert_allclose(found.inertia, turned, atol=AGAINST_ROD)
    joints = {joint.name: joint for joint in read(file).joints}
    for joint in model.joints():
        if joint.axis is None or joint.name not in joints:
            continue
        frame = joint.axis.xyz.expressed_in or joint.name
        axis = np.array(joint.axis.xyz.xyz)
        there = tree.transform(frame)[:3, :3] @ axis / np.linalg.norm(axis)
        ours = place[joints[joint.name].child].rotation @ joints[joint.name].axis
        np.testing.assert_allclose(ours, there, atol=AGAINST_ROD)
