"""Numbers of a USD robot against usd-core's own evaluation of the stage, and against hand-written URDF."""

import math
import warnings
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.description.placement import rotation_from_quaternion
from hybridyn.description.usd.bodies import Bodies
from hybridyn.description.usd.joints import AXES, read_joints
from hybridyn.description.usd.masses import Mass, masses
from hybridyn.description.usd.opening import open_usd
from tests.comparing import close_to
from tests.extras import needs
from tests.files import save
from tests.shipped import states_near_home
from tests.usd_texts import FIVE_BAR, FIVE_BAR_URDF, KINDS

needs("usd")
from pxr import Gf, Usd, UsdGeom, UsdPhysics  # noqa: E402

#: usd-core computes in single precision.
SINGLE = 2e-6

#: Two readers of the same decimals: rotations pass through a quaternion in one, through angles in the other.
TWO_READERS = 1e-11


def text(folder: Path, content: str, name: str = "robot.usda") -> Path:
    return save(folder, content, name)


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


def of_quaternion(q: Gf.Quatf) -> np.ndarray:
    return rotation_from_quaternion(*q.GetImaginary(), q.GetReal())


def test_frames_of_joints_are_those_of_usd_core(tmp_path: Path) -> None:
    file = text(tmp_path, KINDS)
    theirs = parsed(file)
    joints = read_joints(Bodies(open_usd(str(file))), [])
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
            assert joint.free[0][-1] == record.axis.name or len(joint.free) == 3
        if record.type == UsdPhysics.ObjectType.D6Joint:
            locked = [
                a
                for a, limit in ((p.first.name, p.second) for p in record.jointLimits)
                if limit.lower > limit.upper
            ]
            assert [a for a in AXES if a not in joint.free] == [a[0].lower() + a[1:] for a in locked]


def test_places_of_bodies_are_those_of_usd_core(tmp_path: Path) -> None:
    file = text(tmp_path, KINDS)
    bodies = Bodies(open_usd(str(file)))
    stage = Usd.Stage.Open(str(file))
    for path, prim in bodies.moving.items():
        theirs = Gf.Transform(UsdGeom.Xformable(stage.GetPrimAtPath(path)).ComputeLocalToWorldTransform(0))
        pose = bodies.pose(prim)
        np.testing.assert_allclose(pose.frame[:3, 3], np.array(theirs.GetTranslation()) * 0.01, atol=1e-15)
        q = theirs.GetRotation().GetQuat()
        np.testing.assert_allclose(pose.frame[:3, :3], of_quaternion(q), atol=1e-15)
        np.testing.assert_allclose(pose.scale, np.array(theirs.GetScale()), atol=1e-15)


def random_bodies(seed: int) -> str:
    """Return bodies with colliders of random shapes, which state masses and densities in every way."""
    draw = np.random.default_rng(seed)

    def stated(names: list[str]) -> str:
        lines = {
            "mass": f"float physics:mass = {draw.uniform(1, 5):.3f}",
            "density": f"float physics:density = {draw.uniform(0.001, 0.01):.5f}",
            "com": "point3f physics:centerOfMass = (3, 2, 1)",
            "inertia": "float3 physics:diagonalInertia = (200, 500, 600)\n"
            "quatf physics:principalAxes = (.8, 0, .6, 0)",
        }
        return "\n".join(lines[name] for name in names)

    def shape(number: int) -> str:
        kind = draw.choice(["Cube", "Sphere", "Cylinder", "Capsule", "Cone"])
        a, b = draw.uniform(2, 6, 2)
        size = {"Cube": f"double size = {a}", "Sphere": f"double radius = {a}"}.get(
            kind,
            f'double radius = {a}\ndouble height = {b}\nuniform token axis = "{draw.choice(list("XYZ"))}"',
        )
        scale = (1, 2, 3) if kind == "Cube" else (1.5,) * 3
        x, y, z, r = draw.uniform(-9, 9, 4)
        of_own = stated(list(draw.permutation(["mass", "density"])[: draw.integers(0, 2)]))
        return (
            f'def {kind} "s{number}" (prepend apiSchemas = ["PhysicsCollisionAPI", "PhysicsMassAPI"]) {{\n'
            f"{size}\n{of_own}\ndouble3 xformOp:translate = ({x}, {y}, {z})\n"
            f"float xformOp:rotateY = {10 * r}\nfloat3 xformOp:scale = {scale}\n"
            'uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateY", "xformOp:scale"]\n}'
        )

    prims = []
    for i in range(8):
        names = [name for name in ("mass", "density", "com", "inertia") if draw.random() < 0.4]
        prims.append(
            f'def Xform "b{i}" (prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"]) {{\n'
            + stated(names) + "\n" + "\n".join(shape(j) for j in range(draw.integers(1, 4))) + "\n}"
        )  # fmt: skip
    return '#usda 1.0\n(\n metersPerUnit = 0.01\n kilogramsPerUnit = 0.5\n upAxis = "Z"\n)\n' + "\n".join(
        prims
    )


def information(prim: Usd.Prim, body: Usd.Prim) -> UsdPhysics.RigidBodyAPI.MassInformation:
    """Return volume and inertia of a shape by sums over many points: nothing of the reader's formulas."""
    world = Gf.Transform(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(0))
    scale = np.array(world.GetScale())
    points = np.stack(np.meshgrid(*[np.linspace(-1, 1, 41)[:-1] + 1 / 40] * 3), axis=-1).reshape(-1, 3)
    get = prim.GetAttribute
    if prim.GetTypeName() == "Cube":
        half, keep = np.full(3, get("size").Get() / 2), np.ones(len(points), bool)
    elif prim.GetTypeName() == "Sphere":
        half, keep = np.full(3, get("radius").Get()), (points**2).sum(1) <= 1
    else:
        axis = "XYZ".index(get("axis").Get())
        r, h = get("radius").Get(), get("height").Get() / 2
        caps = prim.GetTypeName() == "Capsule"
        half = np.full(3, r)
        half[axis] = h + (r if caps else 0)
        across = np.delete(points * half, axis, axis=1)
        along = points[:, axis] * half[axis]
        radius = np.full(len(points), r)
        if caps:
            radius = np.sqrt(np.maximum(r**2 - np.maximum(np.abs(along) - h, 0) ** 2, 0))
        if prim.GetTypeName() == "Cone":
            radius = r * (1 - (along / h + 1) / 2)
        keep = (across**2).sum(1) <= radius**2
    inside = points[keep] * half * scale
    cell = np.prod(half * scale) * 8 / len(points)
    out = UsdPhysics.RigidBodyAPI.MassInformation()
    out.volume = float(cell * len(inside))
    centre = inside.mean(0)
    arms = inside - centre
    inertia = cell * ((arms**2).sum() * np.eye(3) - arms.T @ arms)
    local = Gf.Transform(
        UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(0)
        * UsdGeom.Xformable(body).ComputeLocalToWorldTransform(0).GetInverse()
    )
    out.inertia = Gf.Matrix3f(*(float(x) for x in inertia.ravel()))
    out.centerOfMass = Gf.Vec3f(*(float(x) for x in centre))
    out.localPos = Gf.Vec3f(local.GetTranslation())
    out.localRot = Gf.Quatf(local.GetRotation().GetQuat())
    return out


def test_mass_properties_are_those_of_usd_core(tmp_path: Path) -> None:
    file = text(tmp_path, random_bodies(1))
    ours = masses(Bodies(open_usd(str(file))))
    stage = Usd.Stage.Open(str(file))
    for path, found in ours.items():
        prim = stage.GetPrimAtPath(path)
        mass, moments, com, axes = UsdPhysics.RigidBodyAPI(prim).ComputeMassProperties(
            lambda shape, prim=prim: information(shape, prim)
        )
        turn = of_quaternion(axes)
        theirs = Mass(mass * 0.5, np.array(com) * 0.01, turn @ np.diag(moments) @ turn.T * 0.5e-4)
        grid = 0.02  # of the sums over points
        assert math.isclose(found.mass, theirs.mass, rel_tol=grid)
        np.testing.assert_allclose(found.com, theirs.com, atol=grid * 0.1)
        np.testing.assert_allclose(found.inertia, theirs.inertia, atol=grid * np.abs(theirs.inertia).max())


def test_the_same_robot_in_urdf_has_the_same_models(tmp_path: Path) -> None:
    usd = hybridyn.load(text(tmp_path, FIVE_BAR))
    urdf = hybridyn.load(text(tmp_path, FIVE_BAR_URDF, "robot.urdf"), motors=usd.motors)
    assert usd.motors == ("motor_left", "motor_right")
    assert usd.joints == urdf.joints
    draw = np.random.default_rng(0)
    q, v, a = states_near_home(urdf.description, "fixed", 1, 3)
    tau = draw.normal(size=(3, 2))
    close_to(hybridyn.idm(usd, q, v, a), hybridyn.idm(urdf, q, v, a), TWO_READERS)
    close_to(hybridyn.ddm(usd, q, v, tau), hybridyn.ddm(urdf, q, v, tau), TWO_READERS)
    q += draw.normal(size=q.shape)
    close_to(hybridyn.closure_residual(usd, q), hybridyn.closure_residual(urdf, q), TWO_READERS)


@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
def test_gravity_is_against_the_up_axis(axis: str, tmp_path: Path) -> None:
    content = FIVE_BAR.replace('upAxis = "Z"', f'upAxis = "{axis}"') if axis != "X" else FIVE_BAR + (
        'def PhysicsScene "scene" {\nvector3f physics:gravityDirection = (-2, 0, 0)\n'
        "float physics:gravityMagnitude = 9.81\n}\n"
    )  # fmt: skip
    robot = hybridyn.load(text(tmp_path, content))
    np.testing.assert_allclose(robot.gravity, -9.81 * np.eye(3)["XYZ".index(axis)], rtol=1e-15)
