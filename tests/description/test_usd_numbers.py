"""Numbers of a USD robot against usd-core's own evaluation of the stage, and against hand-written URDF."""

import warnings
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.description.placement import rotation_from_quaternion
from hybridyn.description.urdf.robot_folders import RobotFolders
from hybridyn.description.usd.schema import AXES
from tests.conversion.judge import same_robot
from tests.description.usd_texts import FIVE_BAR, FIVE_BAR_URDF, KINDS
from tests.robots.shipped import states_near_home
from tests.support.extras import needs
from tests.support.files import save

needs("usd")
from pxr import Gf, Usd, UsdGeom, UsdPhysics  # noqa: E402

from hybridyn.description.usd.joints import read_joints  # noqa: E402
from hybridyn.description.usd.stage import UsdStage  # noqa: E402
from hybridyn.description.usd.usd import open_stage  # noqa: E402

#: usd-core computes in single precision.
SINGLE = 2e-6

#: Two readers of the same decimals: rotations pass through a quaternion in one, through angles in the other.
TWO_READERS = 1e-11


def parsed(file: Path) -> dict[str, object]:
    """Return usd-core's descriptions of the joints and bodies of a stage by path."""
    stage = Usd.Stage.Open(str(file))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # its successor is not in the older versions
        found = UsdPhysics.LoadUsdPhysicsFromRange(stage, ["/"])
    return {
        str(path): record
        for _, (paths, records) in found.items()
        for path, record in zip(paths, records, strict=True)
    }


def stage_of(file: Path) -> UsdStage:
    folders = RobotFolders(str(file), [], [])
    return UsdStage(open_stage(str(file), folders), str(file))


def of_quaternion(q: Gf.Quatf) -> np.ndarray:
    return rotation_from_quaternion(*q.GetImaginary(), q.GetReal())


def test_frames_of_joints_are_those_of_usd_core(tmp_path: Path) -> None:
    file = save(tmp_path, KINDS, "robot.usda")
    theirs = parsed(file)
    joints = read_joints(stage_of(file), (), [])
    assert len(joints) == 7
    for joint in joints:
        record = theirs[joint.prim.path]
        for side, (end, frame) in enumerate(zip(joint.ends, joint.frames, strict=True)):
            assert str(getattr(record, f"body{side}")) == end
            place = np.array(getattr(record, f"localPose{side}Position")) * 0.01
            np.testing.assert_allclose(frame[:3, 3], place, atol=SINGLE)
            turn = of_quaternion(getattr(record, f"localPose{side}Orientation"))
            np.testing.assert_allclose(frame[:3, :3], turn, atol=SINGLE)
        if hasattr(record, "axis"):
            assert next(iter(joint.limits))[-1] == record.axis.name or len(joint.limits) == 3
        if record.type == UsdPhysics.ObjectType.D6Joint:
            locked = [
                a
                for a, limit in ((p.first.name, p.second) for p in record.jointLimits)
                if limit.lower > limit.upper
            ]
            assert [a for a in AXES if a not in joint.limits] == [a[0].lower() + a[1:] for a in locked]


def test_places_of_bodies_are_those_of_usd_core(tmp_path: Path) -> None:
    file = save(tmp_path, KINDS, "robot.usda")
    stage = Usd.Stage.Open(str(file))
    for path, prim in stage_of(file).moving.items():
        theirs = Gf.Transform(UsdGeom.Xformable(stage.GetPrimAtPath(path)).ComputeLocalToWorldTransform(0))
        np.testing.assert_allclose(prim.pose[:3, 3], np.array(theirs.GetTranslation()) * 0.01, atol=1e-15)
        q = theirs.GetRotation().GetQuat()
        np.testing.assert_allclose(prim.pose[:3, :3], of_quaternion(q), atol=1e-15)
        scale = prim.point(np.ones(3)) / 0.01
        np.testing.assert_allclose(scale, np.array(theirs.GetScale()), atol=1e-15)


def test_the_same_robot_in_urdf_has_the_same_models(tmp_path: Path) -> None:
    usd = hybridyn.load(save(tmp_path, FIVE_BAR, "robot.usda"))
    urdf = hybridyn.load(save(tmp_path, FIVE_BAR_URDF, "robot.urdf"), motors=usd.motors)
    assert usd.motors == ("motor_left", "motor_right")
    assert usd.joints == urdf.joints
    batch = states_near_home(urdf.description, "fixed", 1, 3)
    same_robot(urdf.description, usd.description, batch, tolerance=TWO_READERS)


@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
def test_gravity_is_against_the_up_axis(axis: str, tmp_path: Path) -> None:
    content = FIVE_BAR.replace('upAxis = "Z"', f'upAxis = "{axis}"') if axis != "X" else FIVE_BAR + (
        'def PhysicsScene "scene" {\nvector3f physics:gravityDirection = (-2, 0, 0)\n'
        "float physics:gravityMagnitude = 9.81\n}\n"
    )  # fmt: skip
    robot = hybridyn.load(save(tmp_path, content, "robot.usda"))
    np.testing.assert_allclose(robot.gravity, -9.81 * np.eye(3)["XYZ".index(axis)], rtol=1e-15)
