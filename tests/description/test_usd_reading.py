"""What USD states beside frames and masses: trees and cuts, limits, drives, couplings, home, base, layers."""

import zipfile
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.description import Description, read
from hybridyn.description.files_read import recorded
from hybridyn.description.placement import rotation_from_quaternion, rotation_from_rpy
from hybridyn.description.usd import opening
from tests import files
from tests.description.reading import refused
from tests.extras import needs
from tests.usd_texts import BODY, DRIVE, FIVE_BAR, KINDS, at, body, joint, prim, usda

needs("usd")

#: Numbers of decimals that are stated in degrees or centimetres.
UNITS = 1e-14

HINGE = 'token physics:axis = "Y"'
EXCLUDED = "bool physics:excludeFromArticulation = true"


def save(folder: Path, content: str, name: str = "robot.usda") -> Path:
    return files.save(folder, content, name)


def arm(
    folder: Path, *content: str, schemas: tuple[str, ...] = (), kind: str = "Revolute", **units: float
) -> Description:
    """Read a pendulum whose joint has some content."""
    file = save(folder, usda(body("a"), joint(kind, "j", "", "a", *content, schemas=schemas), **units))
    return read(file)


def of(description: Description, name: str) -> hybridyn.description.Joint:
    return next(j for j in description.joints if j.name == name)


def test_kinds_of_joints(tmp_path: Path) -> None:
    found = read(save(tmp_path, KINDS))
    kinds = {j.name: (j.kind, j.parent, j.child) for j in found.joints}
    assert kinds == {
        "j1": ("revolute", "world", "a_j1"), "j1_fixed": ("fixed", "a_j1", "a"),
        "j2": ("prismatic", "a", "b"),
        "j3": ("spherical", "b", "c_j3"), "j3_fixed": ("fixed", "c_j3", "c"), "j4": ("fixed", "c", "d"),
        "j5_transX": ("prismatic", "d", "e_j5_transX"), "j5_rotZ": ("revolute", "e_j5_transX", "e"),
        "j6": ("revolute", "e", "f"),
    }  # fmt: skip
    assert [c.name for c in found.closures] == ["j7"]
    np.testing.assert_allclose([of(found, "j1").lower, of(found, "j1").upper], [-np.pi / 4, np.pi / 2])
    np.testing.assert_allclose([of(found, "j2").lower, of(found, "j2").upper], [-0.05, 0.2], rtol=UNITS)
    np.testing.assert_allclose([of(found, "j5_transX").lower, of(found, "j5_transX").upper], [-0.03, 0.04])
    assert found.gravity == (0, -9.81, 0)
    assert [link.name for link in found.links if link.between_joints] == ["a_j1", "c_j3", "e_j5_transX"]


def test_a_drive_is_a_motor(tmp_path: Path) -> None:
    found = arm(
        tmp_path, "float drive:angular:physics:maxForce = 30", "float drive:angular:physics:stiffness = 5",
        schemas=(DRIVE,), meters=0.1,
    )  # fmt: skip
    assert found.motors == ("j",)
    assert found.motors_from == "USD PhysicsDriveAPI"
    assert of(found, "j").effort == pytest.approx(0.3, rel=UNITS)
    assert any("stiffness" in note for note in found.notes)


def test_armature_friction_and_speed(tmp_path: Path) -> None:
    content = (
        "float physxJoint:armature = .2", "float physxJoint:maxJointVelocity = 90",
        "float physxJointAxis:angular:dynamicFrictionEffort = .3",
        "float physxJointAxis:angular:viscousFrictionCoefficient = .5",
    )  # fmt: skip
    found = of(arm(tmp_path, *content, meters=0.1), "j")
    got = [found.rotor_inertia, found.velocity, found.friction, found.damping]
    np.testing.assert_allclose(got, [0.002, np.pi / 2, 0.003, 0.005 * 180 / np.pi], rtol=UNITS)
    sliding = of(
        arm(tmp_path, *(line.replace("angular", "linear") for line in content), kind="Prismatic", meters=0.1),
        "j",
    )
    got = [sliding.rotor_inertia, sliding.velocity, sliding.friction, sliding.damping]
    np.testing.assert_allclose(got, [0.2, 9, 0.03, 0.5], rtol=UNITS)
    assert of(arm(tmp_path, "float physxJoint:jointFriction = .4"), "j").friction == 0.4


PAIR = body("a"), body("b", at="1, 0, 0"), joint("Revolute", "j", "", "a", HINGE)


def test_mimic_joints_of_physx(tmp_path: Path) -> None:
    follower = joint(
        "Prismatic", "k", "a", "b", at(0, "1, 0, 0"), "rel physxMimicJoint:rotX:referenceJoint = </robot/j>",
        "float physxMimicJoint:rotX:gearing = -2", "float physxMimicJoint:rotX:offset = 5",
        schemas=("PhysxMimicJointAPI:rotX",),
    )  # fmt: skip
    (coupling,) = read(save(tmp_path, usda(*PAIR, follower, meters=0.01))).couplings
    assert coupling.name == "k"
    assert coupling.terms[0] == ("k", 1)
    np.testing.assert_allclose([coupling.terms[1][1], coupling.offset], [-2 * 0.01 * 180 / np.pi, -0.05])


def test_mimic_joints_of_newton(tmp_path: Path) -> None:
    follower = joint(
        "Revolute", "k", "a", "b", HINGE, at(0, "1, 0, 0"), "rel newton:mimicJoint = </robot/j>",
        "float newton:mimicCoef0 = 90", "float newton:mimicCoef1 = 3", schemas=("NewtonMimicAPI",),
    )  # fmt: skip
    (coupling,) = read(save(tmp_path, usda(*PAIR, follower))).couplings
    assert coupling.terms == (("k", 1.0), ("j", -3.0))
    assert coupling.offset == pytest.approx(np.pi / 2)
    off = follower.replace("rel newton", "bool newton:mimicEnabled = false\nrel newton")
    assert read(save(tmp_path, usda(*PAIR, off))).couplings == ()


def test_home_is_the_state_of_joints_or_where_bodies_stand(tmp_path: Path) -> None:
    turned = (
        "double3 xformOp:translate = (0, 0, 0)\nfloat xformOp:rotateY = 30\n"
        'uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateY"]'
    )
    pendulum = usda(body("a", turned), joint("Revolute", "j", "", "a", HINGE))
    (home,) = read(save(tmp_path, pendulum)).home["j"]
    assert home == pytest.approx(np.pi / 6, abs=1e-7)
    stated = pendulum.replace(HINGE, f"{HINGE}\nfloat state:angular:physics:position = 60")
    assert read(save(tmp_path, stated)).home["j"][0] == pytest.approx(np.pi / 3, rel=UNITS)


@pytest.mark.parametrize("reverse", [False, True])
def test_a_ball_stands_where_its_body_does(reverse: bool, tmp_path: Path) -> None:
    turned = 'double3 xformOp:rotateXYZ = (20, 30, 40)\nuniform token[] xformOpOrder = ["xformOp:rotateXYZ"]'
    ends = ("b", "a") if reverse else ("a", "b")
    frames = at(0, "0, 0, 0", ".6, .8, 0, 0"), at(1, "0, 0, 0", ".8, 0, .6, 0")
    found = read(save(tmp_path, usda(
        body("a"), body("b", turned), joint("Fixed", "f", "", "a"), joint("Spherical", "j", *ends, *frames),
    )))  # fmt: skip
    robot = hybridyn.load(tmp_path / "robot.usda")
    ball = of(found, "j")
    x, y, z, w = found.home["j"]
    pose = ball.placement[:3, :3] @ rotation_from_quaternion(x, y, z, w)
    np.testing.assert_allclose(pose, rotation_from_rpy(*np.radians([20, 30, 40])), atol=1e-7)
    assert robot.kinds == ("spherical",)


def test_a_body_that_nothing_holds_floats(tmp_path: Path) -> None:
    pair = (
        body("b", at="1, 0, 0"),
        body("a", at="0, 0, 2"),
        joint("Revolute", "j", "a", "b", HINGE, at(0, "1, 0, -2")),
    )
    robot = hybridyn.load(save(tmp_path, usda(*pair)))
    assert (robot.base, robot.description.root) == ("floating", "a")
    assert robot.description.base_home == (0, 0, 2, 0, 0, 0, 1)
    root = pair[0].replace('"PhysicsMassAPI"', '"PhysicsMassAPI", "PhysicsArticulationRootAPI"')
    assert read(save(tmp_path, usda(root, *pair[1:]))).root == "b"
    two = read(save(tmp_path, usda(*pair, body("box"))))
    assert (two.base, two.root, of(two, "box_free").kind) == ("fixed", "world", "floating")


def loop(*flags: str) -> str:
    """Return a four-bar on the ground of hinges, with content for each joint."""
    ends = [
        ("", "a", "0,0,0", "0,0,0"),
        ("a", "b", "0,0,1", "0,0,0"),
        ("b", "c", "1,0,0", "0,0,1"),
        ("c", "", "0,0,0", "1,0,0"),
    ]
    joints = [
        joint("Revolute", f"j{i}", first, second, HINGE, at(0, p), at(1, r), flag)
        for i, ((first, second, p, r), flag) in enumerate(zip(ends, flags, strict=True))
    ]
    return usda(body("a"), body("b", at="0, 0, 1"), body("c", at="1, 0, 0"), *joints)


def test_loops_are_cut_where_the_tree_needs_least(tmp_path: Path) -> None:
    limit = "float physics:lowerLimit = -90"
    for flags, cut in (
        (("", "", "", ""), "j2"),  # the farthest from the ground, the first of equals
        (("", "", "", EXCLUDED), "j3"),
        (("", limit, limit, ""), "j3"),
        ((EXCLUDED, EXCLUDED, "", ""), "j1"),
    ):
        found = read(save(tmp_path, loop(*flags)))
        assert [c.name for c in found.closures] == [cut], flags
        assert any("close loops" in note for note in found.notes) == (EXCLUDED not in flags), flags
        robot = hybridyn.load(tmp_path / "robot.usda")
        assert hybridyn.closure_residual(robot, robot.home) < 1e-12


def test_limits_of_cut_joints_are_noted(tmp_path: Path) -> None:
    found = read(save(tmp_path, loop("", "", "float physics:lowerLimit = -90\n" + EXCLUDED, "")))
    assert any("limits of joints that close loops are not read: '/robot/j2'" in n for n in found.notes)


def test_attributes_of_schemas_that_are_not_applied_are_noted(tmp_path: Path) -> None:
    found = arm(tmp_path, "float drive:angular:physics:maxForce = 3", "float physics:foo = 2")
    assert of(found, "j").effort == np.inf
    assert any("'physics:foo', 'drive:angular:physics:maxForce'" in note for note in found.notes)
    light = body("a").replace('"PhysicsRigidBodyAPI", "PhysicsMassAPI"', '"PhysicsRigidBodyAPI"')
    found = read(save(tmp_path, usda(light, joint("Revolute", "j", "", "a"))))
    assert found.links[1].mass == 0
    assert any("'physics:mass'" in note for note in found.notes)


def test_an_excluded_joint_carries_what_hangs_on_nothing_else(tmp_path: Path) -> None:
    hanging = joint("Revolute", "k", "a", "b", HINGE, at(0, "1, 0, 0"), EXCLUDED)
    found = read(save(tmp_path, usda(*PAIR, hanging)))
    assert found.closures == ()
    assert any("/robot/k" in note for note in found.notes)


def test_names_are_unique_and_short(tmp_path: Path) -> None:
    def side(name: str) -> str:
        arm = prim(
            "Xform", "arm", "float physics:mass = 1\nfloat3 physics:diagonalInertia = (1, 1, 1)", schemas=BODY
        )
        return f'def Xform "{name}" {{\n{arm}\n}}'

    ends = (joint("Fixed", f"j_{name}", "", f"{name}/arm") for name in ("left", "right"))
    found = read(save(tmp_path, usda(side("left"), side("right"), *ends)))
    assert [link.name for link in found.links] == ["world", "left_arm", "right_arm"]


def test_disabled_and_kinematic_bodies_stand_still(tmp_path: Path) -> None:
    still = body("base", "bool physics:kinematicEnabled = true", at="0, 0, 5")
    found = read(save(tmp_path, usda(still, body("a"), joint("Revolute", "j", "base", "a", HINGE))))
    assert found.root == "world"
    np.testing.assert_array_equal(of(found, "j").placement[:3, 3], [0, 0, 5])
    assert any("kinematic" in note for note in found.notes)
    off = joint("Revolute", "k", "", "a", "bool physics:jointEnabled = false")
    assert any(
        "jointEnabled" in note
        for note in read(save(tmp_path, usda(*PAIR, off, joint("Fixed", "f", "a", "b")))).notes
    )


def test_single_precision_numbers_are_the_decimals_of_the_author(tmp_path: Path) -> None:
    link = read(save(tmp_path, usda(*PAIR, joint("Fixed", "f", "a", "b")))).links[1]
    assert link.com[0] == 0.1


@pytest.mark.parametrize("more", [{"schemas": (DRIVE,)}, {"content": "float physxJoint:armature = .1"}])
def test_a_joint_that_closes_a_loop_and_is_needed_stays_a_joint(more: dict, tmp_path: Path) -> None:
    """It carries a massless link, which is welded to its second body; its motor moves the loop."""
    content, schemas = more.get("content", ""), more.get("schemas", ())
    pins = (joint("Revolute", name, "", "a", HINGE, content, schemas=schemas) for name in ("j", "k"))
    found = read(save(tmp_path, usda(body("a"), *pins)))
    assert [(j.name, j.child) for j in found.joints] == [("j", "a"), ("k", "a_at_k")]
    (weld,) = found.closures
    assert (weld.kind, weld.link_a, weld.link_b) == ("fixed", "a_at_k", "a")
    assert not schemas or found.motors == ("j", "k")


def test_layers_of_its_folder_are_read_and_no_others(tmp_path: Path) -> None:
    folder = tmp_path / "robot"
    (folder / "parts").mkdir(parents=True)
    part = usda(body("a")).replace('"robot"', '"part"')
    save(folder / "parts", part, "part.usda")
    text = usda('def "p" (references = @./parts/part.usda@) {\n}', joint("Revolute", "j", "", "p/a"))
    assert [link.name for link in read(save(folder, text)).links] == ["world", "a"]
    seen = []
    for mass in (1, 3):
        save(folder / "parts", usda(body("a", m=mass)).replace('"robot"', '"part"'), "part.usda")
        with recorded() as files:
            read(folder / "robot.usda")
        seen.append(files)
    assert seen[0] != seen[1]  # a changed layer is another robot
    save(tmp_path, part, "part.usda")
    outside = text.replace("./parts", "..")
    refused(save(folder, outside), "outside the robot's folder")
    assert read(save(folder, outside), package_dirs=[tmp_path]).links[1].name == "a"
    (folder / "parts" / "link.usda").symlink_to(tmp_path / "part.usda")
    refused(save(folder, text.replace("part.usda", "link.usda")), "outside")
    for asset in ("/etc/passwd", "https://example.com/a.usd", "missing.usda", "`$X`", "parts"):
        for arc in ("references", "payload", "subLayers"):
            wrong = text.replace("references = @./parts/part.usda@", f"{arc} = @{asset}@")
            if arc == "subLayers":
                wrong = text.replace('upAxis = "Z"', f'upAxis = "Z"\n  subLayers = [@{asset}@]')
            refused(save(folder, wrong), "layer")


def test_other_suffixes_and_packages(tmp_path: Path) -> None:
    from pxr import Sdf, UsdUtils

    expected = read(save(tmp_path, FIVE_BAR))
    Sdf.Layer.FindOrOpen(str(tmp_path / "robot.usda")).Export(str(tmp_path / "binary.usdc"))
    UsdUtils.CreateNewUsdzPackage(str(tmp_path / "binary.usdc"), str(tmp_path / "package.usdz"))
    save(tmp_path, FIVE_BAR, "robot.txt")
    for name in ("binary.usdc", "package.usdz", "robot.txt"):
        found = read(tmp_path / name)
        assert [j.name for j in found.joints] == [j.name for j in expected.joints], name
        for ours, theirs in zip(found.joints, expected.joints, strict=True):
            np.testing.assert_array_equal(ours.placement, theirs.placement)
    (tmp_path / "binary.usdc").rename(tmp_path / "binary.xml")
    refused(tmp_path / "binary.xml", "rename it to end in .usdc")
    (tmp_path / "package.usdz").rename(tmp_path / "package.zip")
    refused(tmp_path / "package.zip", "a zip archive", " rename it to end in .usdz if it is one")
    with zipfile.ZipFile(tmp_path / "empty.usdz", "w") as archive:
        archive.writestr("a.txt", "x")
    refused(tmp_path / "empty.usdz")


def test_instances_and_variants_are_those_of_usd(tmp_path: Path) -> None:
    hinge = joint("Revolute", "j", "", "a", HINGE).replace("/robot/a", "/arm/a")
    arm = 'def Xform "arm" {\n' + body("a") + "\n" + hinge + "\n}\n"
    instances = "".join(
        f'def Xform "{name}" (instanceable = true\nreferences = </arm>) {{\n'
        f'double3 xformOp:translate = ({x}, 0, 0)\nuniform token[] xformOpOrder = ["xformOp:translate"]\n}}\n'
        for name, x in (("left", 1), ("right", 2))
    )
    text = usda(instances).replace('def Xform "robot"', arm.replace("def", "class", 1) + 'def Xform "robot"')
    found = read(save(tmp_path, text))
    assert [j.name for j in found.joints] == ["left_j", "right_j"]
    assert [link.name for link in found.links] == ["world", "left_a", "right_a"]
    heavy = "float physics:mass = 7"
    sizes = f'"big" {{\n{body("a").replace("float physics:mass = 1", heavy)}\n}}\n"small" {{\n{body("a")}\n}}'
    variants = (
        'def Xform "b" (variantSets = "size"\nvariants = {string size = "big"}) {\n'
        f'variantSet "size" = {{\n{sizes}\n}}\n}}\n'
    )
    found = read(save(tmp_path, usda(variants, joint("Revolute", "j", "", "b/a"))))
    assert found.links[1].mass == 7


def test_files_that_are_too_large_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    part = usda(body("a")).replace('"robot"', '"part"')
    save(tmp_path, part, "part.usda")
    file = save(tmp_path, usda('def "p" (references = @part.usda@) {}'))
    monkeypatch.setattr(opening, "LARGEST_FILE", len(part) - 1)
    refused(file, "its layers together are larger")
    monkeypatch.setattr(opening, "LARGEST_FILE", len(part))
    assert read(file).root == "a"
    monkeypatch.setattr(opening, "MOST_PRIMS", 2)
    refused(file, "more than 2 prims")
