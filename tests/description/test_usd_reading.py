"""What USD states beside frames and masses: trees and cuts, limits, drives, couplings, home, base, layers."""

import zipfile
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.description import read
from hybridyn.description.bounds import recorded
from hybridyn.description.placement import (
    inverse,
    placement_from,
    poses_at,
    rotation_from_quaternion,
    rotation_from_rpy,
)
from hybridyn.description.usd.schema import AXES
from tests.description.reading import bound, holds, refused
from tests.description.usd_texts import BODY, DRIVE, FIVE_BAR, KINDS, at, body, joint, prim, usda
from tests.support import files
from tests.support.extras import needs

needs("usd")

HINGE = 'token physics:axis = "Y"'
EXCLUDED = "bool physics:excludeFromArticulation = true"


def save(folder: Path, content: str, name: str = "robot.usda") -> Path:
    return files.save(folder, content, name)


def about(expected: object, *, rel: float = 1e-14, least: float = 0.0) -> object:
    """Return numbers that the file states as decimals in degrees or centimetres."""
    return pytest.approx(expected, rel=rel, abs=least)


def arm(*content: str, schemas: tuple[str, ...] = (), kind: str = "Revolute", **units: float) -> str:
    """Return a pendulum whose joint has some content."""
    return usda(body("a"), joint(kind, "j", "", "a", *content, schemas=schemas), **units)


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


def limits(name: str, lower: float, upper: float) -> dict[str, object]:
    return {name: {"lower": about(lower, rel=1e-7), "upper": about(upper, rel=1e-7)}}


#: A generic joint that turns about y, within a limit.
HINGED = "(prepend apiSchemas = [{}]) {{\n{}".format(
    ", ".join(f'"PhysicsLimitAPI:{axis}"' for axis in AXES),
    "\n".join(
        f"float limit:{axis}:physics:low = {-90 if axis == 'rotY' else 1}\n"
        f"float limit:{axis}:physics:high = {'inf' if axis == 'rotY' else -1}"
        for axis in AXES
    ),
)

RESISTING = (
    "float physxJoint:armature = .2", "float physxJoint:maxJointVelocity = 90",
    "float physxJointAxis:angular:dynamicFrictionEffort = .3",
    "float physxJointAxis:angular:viscousFrictionCoefficient = .5",
)  # fmt: skip
LOWER = "float physics:lowerLimit = -90"
PAIR = body("a"), body("b", at="1, 0, 0"), joint("Revolute", "j", "", "a", HINGE)
OF_PHYSX = joint(
    "Prismatic", "k", "a", "b", at(0, "1, 0, 0"), "rel physxMimicJoint:rotX:referenceJoint = </robot/j>",
    "float physxMimicJoint:rotX:gearing = -2", "float physxMimicJoint:rotX:offset = 5",
    schemas=("PhysxMimicJointAPI:rotX",),
)  # fmt: skip
OF_NEWTON = joint(
    "Revolute", "k", "a", "b", HINGE, at(0, "1, 0, 0"), "rel newton:mimicJoint = </robot/j>",
    "float newton:mimicCoef0 = 90", "float newton:mimicCoef1 = 3", schemas=("NewtonMimicAPI",),
)  # fmt: skip
TURNED = usda(
    body("a", "double3 xformOp:translate = (0, 0, 0)\nfloat xformOp:rotateY = 30\n"
         'uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateY"]'),
    joint("Revolute", "j", "", "a", HINGE),
)  # fmt: skip
FREE = (
    body("b", at="1, 0, 0"),
    body("a", at="0, 0, 2"),
    joint("Revolute", "j", "a", "b", HINGE, at(0, "1, 0, -2")),
)
ROOT = FREE[0].replace('"PhysicsMassAPI"', '"PhysicsMassAPI", "PhysicsArticulationRootAPI"')
TWO_SIDES = [
    f'def Xform "{name}" {{\n'
    + prim("Xform", "arm", "float physics:mass = 1\nfloat3 physics:diagonalInertia = (1, 1, 1)", schemas=BODY)
    + "\n}\n"
    + joint("Fixed", f"j_{name}", "", f"{name}/arm")
    for name in ("left", "right")
]
CLASS = (
    'class Xform "arm" {\n'
    + body("a")
    + "\n"
    + joint("Revolute", "j", "", "a", HINGE).replace("/robot/a", "/arm/a")
    + "\n}\n"
)
INSTANCES = "".join(
    f'def Xform "{name}" (instanceable = true\nreferences = </arm>) {{\n'
    f'double3 xformOp:translate = ({x}, 0, 0)\nuniform token[] xformOpOrder = ["xformOp:translate"]\n}}\n'
    for name, x in (("left", 1), ("right", 2))
)
VARIANTS = (
    'def Xform "b" (variantSets = "size"\nvariants = {string size = "big"}) {\nvariantSet "size" = {\n'
    f'"big" {{\n{body("a", m=7)}\n}}\n"small" {{\n{body("a")}\n}}\n}}\n}}\n'
)
#: A text, and what is read.
READ = {
    "kinds of joints": (KINDS, {
        "joints": [
            {"name": name, "kind": kind, "parent": parent, "child": child}
            for name, kind, parent, child in (
                ("j1", "revolute", "world", "a_j1"), ("j1_fixed", "fixed", "a_j1", "a"),
                ("j2", "prismatic", "a", "b"), ("j3", "spherical", "b", "c_j3"),
                ("j3_fixed", "fixed", "c_j3", "c"), ("j4", "fixed", "c", "d"),
                ("j5_transX", "prismatic", "d", "e_j5_transX"),
                ("j5_rotZ", "revolute", "e_j5_transX", "e"), ("j6", "revolute", "e", "f"),
            )
        ],
        "closures": ["j7"], "gravity": (0, -9.81, 0),
    }),
    "limits": (KINDS, {
        "joints": limits("j1", -np.pi / 4, np.pi / 2) | limits("j5_transX", -0.03, 0.04)
        | {"j2": {"lower": about(-0.05), "upper": about(0.2)}},
    }),
    "links between joints": (KINDS, {
        "links": {name: {"between_joints": name in ("a_j1", "c_j3", "e_j5_transX")}
                  for name in ("a_j1", "c_j3", "e_j5_transX", *"abcdef", "world")},
    }),
    "a drive is a motor": (
        arm("float drive:angular:physics:maxForce = 30", "float drive:angular:physics:stiffness = 5",
            schemas=(DRIVE,), meters=0.1),
        {"motors": ("j",), "motors_from": "USD PhysicsDriveAPI", "joints": {"j": {"effort": about(0.3)}},
         "notes": {"stiffness"}},
    ),
    "friction of a hinge": (arm(*RESISTING, meters=0.1), {"joints": {"j": {
        "rotor_inertia": about(0.002), "velocity": about(np.pi / 2), "friction": about(0.003),
        "damping": about(0.005 * 180 / np.pi),
    }}}),
    "friction of a slide": (
        arm(*(line.replace("angular", "linear") for line in RESISTING), kind="Prismatic", meters=0.1),
        {"joints": {"j": {"rotor_inertia": about(0.2), "velocity": about(9.0), "friction": about(0.03),
                          "damping": about(0.5)}}},
    ),
    "friction of older files": (
        arm("float physxJoint:jointFriction = .4"), {"joints": {"j": {"friction": 0.4}}},
    ),
    "mimic of PhysX": (usda(*PAIR, OF_PHYSX, meters=0.01), {"couplings": [{
        "name": "k", "terms": (("k", 1.0), ("j", about(-2 * 0.01 * 180 / np.pi, rel=1e-7))),
        "offset": about(-0.05, rel=1e-7),
    }]}),
    "mimic of Newton": (usda(*PAIR, OF_NEWTON), {"couplings": [{
        "terms": (("k", 1.0), ("j", -3.0)), "offset": about(np.pi / 2, rel=1e-6),
    }]}),
    "mimic that is off": (
        usda(*PAIR, OF_NEWTON.replace("rel newton", "bool newton:mimicEnabled = false\nrel newton")),
        {"couplings": ()},
    ),
    "home where the body stands": (TURNED, {"home": {"j": about((np.pi / 6,), least=1e-7)}}),
    "home that is stated": (
        TURNED.replace(HINGE, f"{HINGE}\nfloat state:angular:physics:position = 60"),
        {"home": {"j": about((np.pi / 3,))}},
    ),
    "a body that nothing holds floats": (
        usda(*FREE), {"base": "floating", "root": "a", "base_home": (0, 0, 2, 0, 0, 0, 1)},
    ),
    "the root of the articulation": (usda(ROOT, *FREE[1:]), {"root": "b"}),
    "two floating bodies": (
        usda(*FREE, body("box")),
        {"base": "fixed", "root": "world", "joints": {"box_free": {"kind": "floating"}}},
    ),
    "limits of a cut joint": (
        loop("", "", f"{LOWER}\n{EXCLUDED}", ""),
        {"notes": {"limits of joints that close loops are not read: '/robot/j2'"}},
    ),
    "attributes whose schema is not applied": (
        arm("float drive:angular:physics:maxForce = 3", "float physics:foo = 2"),
        {"joints": {"j": {"effort": np.inf}}, "notes": {"'physics:foo', 'drive:angular:physics:maxForce'"}},
    ),
    "mass whose schema is not applied": (
        arm().replace('"PhysicsRigidBodyAPI", "PhysicsMassAPI"', '"PhysicsRigidBodyAPI"'),
        {"links": {"a": {"mass": 0}}, "notes": {"'physics:mass'"}},
    ),
    "an excluded joint that nothing replaces": (
        usda(*PAIR, joint("Revolute", "k", "a", "b", HINGE, at(0, "1, 0, 0"), EXCLUDED)),
        {"closures": (), "notes": {"/robot/k"}},
    ),
    "a generic joint whose position is limited is not cut": (
        loop("", "", "", "").replace("PhysicsRevoluteJoint", "PhysicsJoint", 3).replace(
            "PhysicsJoint", "PhysicsRevoluteJoint", 2
        ).replace('def PhysicsJoint "j2"  {', 'def PhysicsJoint "j2" ' + HINGED),
        {"closures": ["j1"], "joints": {"j2": {"lower": about(-np.pi / 2)}}},
    ),
    "names are unique and short": (usda(*TWO_SIDES), {"links": ["world", "left_arm", "right_arm"]}),
    "a kinematic body": (
        usda(body("base", "bool physics:kinematicEnabled = true", at="0, 0, 5"), body("a"),
             joint("Revolute", "j", "base", "a", HINGE)),
        {"root": "world", "notes": {"kinematic"},
         "joints": {"j": {"placement": placement_from(np.eye(3), np.array([0, 0, 5]))}}},
    ),
    "a disabled joint": (
        usda(*PAIR, joint("Revolute", "k", "", "a", "bool physics:jointEnabled = false"),
             joint("Fixed", "f", "a", "b")),
        {"notes": {"jointEnabled"}, "links": {"a": {"com": np.array([0.1, 0.01, 0.0])}}},
    ),
    "instances": (
        usda(INSTANCES).replace('def Xform "robot"', CLASS + 'def Xform "robot"'),
        {"joints": ["left_j", "right_j"], "links": ["world", "left_a", "right_a"]},
    ),
    "variants": (usda(VARIANTS, joint("Revolute", "j", "", "b/a")), {"links": {"a": {"mass": 7}}}),
    #: A joint that closes a loop and is needed carries a massless link, which is welded to its second body.
    **{
        f"a needed joint, {more}": (
            usda(
                body("a"), *(joint("Revolute", one, "", "a", HINGE, content, schemas=schemas) for one in "jk")
            ),
            {"joints": [{"name": "j", "child": "a"}, {"name": "k", "child": "a_at_k"}],
             "closures": [{"kind": "fixed", "link_a": "a_at_k", "link_b": "a"}], **motors},
        )
        for more, content, schemas, motors in (
            ("driven", "", (DRIVE,), {"motors": ("j", "k")}),
            ("armature", "float physxJoint:armature = .1", (), {}),
        )
    },
}  # fmt: skip


@pytest.mark.parametrize("name", READ)
def test_what_is_read(name: str, tmp_path: Path) -> None:
    text, expected = READ[name]
    holds(read(save(tmp_path, text)), expected)


@pytest.mark.parametrize("ends", ["ab", "ba"])
def test_a_ball_stands_where_its_body_does(ends: str, tmp_path: Path) -> None:
    turned = 'double3 xformOp:rotateXYZ = (20, 30, 40)\nuniform token[] xformOpOrder = ["xformOp:rotateXYZ"]'
    frames = at(0, "0, 0, 0", ".6, .8, 0, 0"), at(1, "0, 0, 0", ".8, 0, .6, 0")
    robot = hybridyn.load(save(tmp_path, usda(
        body("a"), body("b", turned), joint("Fixed", "f", "", "a"), joint("Spherical", "j", *ends, *frames),
    )))  # fmt: skip
    (ball,) = (one for one in robot.description.joints if one.kind == "spherical")
    pose = ball.placement[:3, :3] @ rotation_from_quaternion(*robot.description.home["j"])
    np.testing.assert_allclose(pose, rotation_from_rpy(*np.radians([20, 30, 40])), atol=1e-7)


def test_loops_are_cut_where_the_tree_needs_least(tmp_path: Path) -> None:
    for flags, cut in (
        (("", "", "", ""), "j2"),  # the farthest from the ground, the first of equals
        (("", "", "", EXCLUDED), "j3"),
        (("", LOWER, LOWER, ""), "j3"),
        ((EXCLUDED, EXCLUDED, "", ""), "j1"),
    ):
        robot = hybridyn.load(save(tmp_path, loop(*flags)))
        holds(robot.description, {"closures": [cut]})
        assert any("close loops" in note for note in robot.notes) == (EXCLUDED not in flags), flags
        assert hybridyn.closure_residual(robot, robot.home) < 1e-12


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
    refused(save(tmp_path, FIVE_BAR, "robot.txt"), "robot.txt: holds USD", "rename it to end in .usda")
    for name in ("binary.usdc", "package.usdz"):
        found = read(tmp_path / name)
        assert [j.name for j in found.joints] == [j.name for j in expected.joints], name
        for ours, theirs in zip(found.joints, expected.joints, strict=True):
            np.testing.assert_array_equal(ours.placement, theirs.placement)
    (tmp_path / "binary.usdc").rename(tmp_path / "binary.xml")
    refused(tmp_path / "binary.xml", "rename it to end in .usdc")
    (tmp_path / "package.usdz").rename(tmp_path / "package.zip")
    refused(tmp_path / "package.zip", "rename it to end in .usdz")
    with zipfile.ZipFile(tmp_path / "empty.usdz", "w") as archive:
        archive.writestr("a.txt", "x")
    refused(tmp_path / "empty.usdz")


def test_files_that_are_too_large_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    part = usda(body("a")).replace('"robot"', '"part"')
    save(tmp_path, part, "part.usda")
    file = save(tmp_path, usda('def "p" (references = @part.usda@) {}'))
    bound(monkeypatch, file=len(part) - 1)
    refused(file, "part.usda' is larger than")
    bound(monkeypatch, file=len(part))
    assert read(file).root == "a"
    bound(monkeypatch, prims=2)
    refused(file, "more than 2 prims")


def hinted(word: str, flag: str = "", *more: str) -> str:
    """Return a rod on a crank by a generic joint whose customData says what it is, as Kamino's files do."""
    rod = joint("", "g", "a", "b", at(0, "1, 0, 0", ".8, .6, 0, 0"), at(1, "0, 0, .3"), flag)
    hint = f'"g" (customData = {{ string dofs = "{word}" }})'
    return usda(*PAIR, rod.replace('"g"', hint, 1), *more)


def test_a_universal_joint_of_kamino_turns_about_x_then_y(tmp_path: Path) -> None:
    """The first axis is x of the joint's frame in the first body, the second y of that in the second one."""
    found = read(save(tmp_path, hinted("universal")))
    holds(found, {"joints": {"g_rotX": {"kind": "revolute"}, "g_rotY": {"kind": "revolute"}}})
    loaded = hybridyn.load(save(tmp_path, hinted("universal")))
    q = np.array([0.0, 0.3, -0.4])
    placed = poses_at(found, dict(zip(("j", "g_rotX", "g_rotY"), ((x,) for x in q), strict=True)))
    in_a = placement_from(rotation_from_quaternion(0.6, 0, 0, 0.8), np.array([1.0, 0, 0]))
    turn = rotation_from_rpy(0.3, 0, 0) @ rotation_from_rpy(0, -0.4, 0)
    in_b = placement_from(np.eye(3), np.array([0, 0, 0.3]))
    expected = placed["a"] @ in_a @ placement_from(turn, np.zeros(3)) @ inverse(in_b)
    np.testing.assert_allclose(placed["b"], expected, atol=1e-7)
    assert loaded.nv == 3


def test_a_universal_joint_of_kamino_closes_a_loop_with_four_rows(tmp_path: Path) -> None:
    second = joint("Revolute", "k", "a", "b", HINGE, at(0, "1, 0, 0"), at(1, "0, 0, .3"))
    (closure,) = read(save(tmp_path, hinted("universal", EXCLUDED, second))).closures
    assert (closure.kind, closure.translations, closure.rotation) == ("universal", (0, 1, 2), "perpendicular")
    in_a = rotation_from_quaternion(0.6, 0, 0, 0.8)
    np.testing.assert_allclose(closure.frame_a[:3, 2], in_a[:, 0], atol=1e-7)
    np.testing.assert_allclose(closure.frame_b[:3, 2], [0, 1, 0], atol=1e-7)


@pytest.mark.parametrize(("word", "kinds"), [
    ("cylindrical", ["prismatic", "revolute"]), ("cartesian", ["prismatic"] * 3),
])  # fmt: skip
def test_other_hints_of_kamino(word: str, kinds: list[str], tmp_path: Path) -> None:
    found = read(save(tmp_path, hinted(word)))
    made = [one.kind for one in found.joints if one.name.startswith("g_")]
    assert [kind for kind in made if kind != "fixed"] == kinds
