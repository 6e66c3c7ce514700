"""What the SDF reader makes of joints, frames, models and worlds, against values computed by hand."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn.description import read
from tests.description.reading import refused
from tests.files import save
from tests.sdf_texts import WORLD, joint, link, sdf

EXACT = 1e-14  # some products of matrices

AT = "0.1 -0.2 0.3 0.4 -0.5 0.6"  # of the joint, in its child
BODY = "0.5 0.6 -0.7 0.8 0.9 -1.0"  # of the child, in the world


def se3(text: str) -> pin.SE3:
    """Return a pose of SDF."""
    x, y, z, *angles = (float(word) for word in text.split())
    return pin.SE3(pin.rpy.rpyToMatrix(np.array(angles)), np.array([x, y, z]))


def written(folder: Path, *parts: str, version: str = "1.9") -> Path:
    return save(folder, sdf(*parts, version=version), "robot.sdf")


def places(file: Path, **positions: float) -> dict[str, pin.SE3]:
    """Return the pose of every link of a robot in the world at some joint positions."""
    robot = hybridyn.load(file)
    q = robot.home.copy()
    for name, x in positions.items():
        at = robot.q_slices[robot.joints.index(name)]
        q[at] = x if at.stop - at.start != 2 else (np.cos(x), np.sin(x))
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    links = (one.name for one in robot.description.links)
    return {name: data.oMf[robot.model.getFrameId(name, pin.BODY)] for name in links}


def turn(axis: tuple[float, ...], angle: float, slide: float = 0.0) -> pin.SE3:
    """Return a motion about and along an axis."""
    unit = np.array(axis) / np.linalg.norm(axis)
    return pin.SE3(pin.exp3(angle * unit), slide * unit)


MOTIONS = {
    "revolute": ("", {"j": 0.7}, turn((1, 2, 3), 0.7)),
    "continuous": ("", {"j": 2.7}, turn((1, 2, 3), 2.7)),
    "prismatic": ("", {"j": 0.7}, turn((1, 2, 3), 0, 0.7)),
    "fixed": ("", {}, pin.SE3.Identity()),
    "universal": (
        "<axis2><xyz>3 0 -1</xyz></axis2>", {"j_1": 0.7, "j_2": -0.4},
        turn((1, 2, 3), 0.7) * turn((3, 0, -1), -0.4),
    ),
    "revolute2": (
        "<axis2><xyz>1 1 0</xyz></axis2>", {"j_1": 0.7, "j_2": -0.4},
        turn((1, 2, 3), 0.7) * turn((1, 1, 0), -0.4),
    ),
}  # fmt: skip


@pytest.mark.parametrize("turned_round", [False, True])
@pytest.mark.parametrize("kind", MOTIONS)
def test_a_joint_moves_its_child_against_its_parent(kind: str, turned_round: bool, tmp_path: Path) -> None:
    """Where the tree runs against a joint, its parent moves the other way."""
    more, positions, motion = MOTIONS[kind]
    body = pin.SE3.Identity() if turned_round else se3(BODY)
    ends = ("arm", "base") if turned_round else ("base", "arm")
    pose = f"<pose>{AT}</pose>"
    file = written(
        tmp_path, link("base"), link("arm", f"<pose>{BODY}</pose>"), WORLD,
        joint("j", kind, *ends, pose, more, axis="" if kind == "fixed" else "1 2 3"),
    )  # fmt: skip
    at = body * se3(AT)
    moved = at * motion * at.inverse()
    expected = moved.inverse() * se3(BODY) if turned_round else moved * se3(BODY)
    np.testing.assert_allclose(places(file, **positions)["arm"], expected, atol=EXACT)


def test_a_ball_turns_about_its_centre(tmp_path: Path) -> None:
    pose = f"<pose>{AT}</pose>"
    file = written(
        tmp_path, link("base"), link("arm"), WORLD, joint("j", "ball", "base", "arm", pose, axis="")
    )
    robot = hybridyn.load(file)
    q = pin.Quaternion(pin.exp3(np.array([0.3, -0.5, 0.8])))
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q.coeffs())
    centre = pin.SE3(np.eye(3), se3(AT).translation)
    expected = centre * pin.SE3(q.matrix(), np.zeros(3)) * centre.inverse()
    np.testing.assert_allclose(data.oMf[robot.model.getFrameId("arm", pin.BODY)], expected, atol=EXACT)


MIMIC = "<axis><xyz>0 0 1</xyz><mimic joint='{}' axis='{}'><multiplier>3</multiplier><offset>.5</offset>"
MIMIC += "<reference>.2</reference></mimic></axis>"


@pytest.mark.parametrize(("which", "leader"), [("axis", "lead_1"), ("axis2", "lead_2")])
def test_an_axis_follows_another(which: str, leader: str, tmp_path: Path) -> None:
    second = "<axis2><xyz>1 0 0</xyz></axis2>"
    file = written(
        tmp_path, link("base"), link("a"), link("b"), WORLD, joint("lead", "universal", "base", "a", second),
        joint("follow", "revolute", "base", "b", MIMIC.format("lead", which), axis=""), version="1.11",
    )  # fmt: skip
    (coupling,) = read(file).couplings
    assert (coupling.name, coupling.terms) == ("follow", (("follow", 1.0), (leader, -3.0)))
    assert coupling.offset == pytest.approx(0.5 - 3 * 0.2, abs=EXACT)


def test_numbers_of_an_axis(tmp_path: Path) -> None:
    axis = (
        "<axis><xyz>0 0 1</xyz><limit><lower>-1</lower><upper>2</upper><effort>-1</effort>"
        "<velocity>3</velocity></limit><dynamics><damping>.1</damping><friction>.2</friction><spring_stiffness>5</spring_stiffness>"
        "<spring_reference>.3</spring_reference></dynamics></axis>"
    )
    drake = "<drake:rotor_inertia>.02</drake:rotor_inertia><drake:gear_ratio>50</drake:gear_ratio>"
    text = sdf(link("base"), link("a"), WORLD, joint("j", "revolute", "base", "a", axis, drake, axis=""))
    file = save(tmp_path, text.replace("<sdf", '<sdf xmlns:drake="http://drake.mit.edu"'), "robot.sdf")
    found = read(file)
    (one,) = [joint for joint in found.joints if joint.name == "j"]
    assert (one.lower, one.upper, one.effort, one.velocity) == (-1, 2, np.inf, 3)
    assert (one.damping, one.friction, one.rotor_inertia, one.gear_ratio) == (0.1, 0.2, 0.02, 50)
    assert found.effects == (("spring", {"stiffness": {"j": 5.0}, "rest": {"j": 0.3}}),)


def test_limits_of_1e16_are_none(tmp_path: Path) -> None:
    axis = "<axis><xyz>0 0 1</xyz><limit><lower>-1e16</lower><upper>1e16</upper></limit></axis>"
    found = read(
        written(
            tmp_path,
            link("base"),
            link("a"),
            WORLD,
            joint("j", "revolute", "base", "a", axis, axis=""),
            version="1.6",
        )
    )
    (one,) = [joint for joint in found.joints if joint.name == "j"]
    assert (one.lower, one.upper) == (-np.inf, np.inf)


@pytest.mark.parametrize(
    ("inertial", "mass", "moment"),
    [
        ("", 1.0, 1.0), ("<inertial><mass>3</mass></inertial>", 3.0, 1.0),
        ("<inertial><inertia><ixx>2</ixx><iyy>2</iyy><izz>2</izz></inertia></inertial>", 1.0, 2.0),
    ],
)  # fmt: skip
def test_a_link_has_the_inertia_that_sdformat_gives_it(
    inertial: str, mass: float, moment: float, tmp_path: Path
) -> None:
    found = read(written(tmp_path, f'<link name="base">{inertial}</link>', WORLD))
    (body,) = found.links
    assert body.mass == mass
    np.testing.assert_array_equal(body.inertia, moment * np.eye(3))
    assert any("SDFormat's default" in note and "'base'" in note for note in found.notes)


PART = sdf(
    link("arm", "<pose>1 0 0 0 0 0</pose>"),
    '<frame name="tip" attached_to="arm"><pose>0 0.5 0 0 0 0.3</pose></frame>',
    name="part",
)  # fmt: skip


def test_an_included_model_stands_by_its_pose(tmp_path: Path) -> None:
    (tmp_path / "part.sdf").write_text(PART)
    include = (
        '<include><uri>part.sdf</uri><name>left</name><pose relative_to="base">0 0 2 0 0 0.1</pose></include>'
    )
    weld = joint("weld", "fixed", "base", "left::tip", axis="")
    file = written(tmp_path, link("base", "<pose>0 3 0 0 0 0.5</pose>"), include, weld, WORLD)
    expected = se3("0 3 0 0 0 0.5") * se3("0 0 2 0 0 0.1") * se3("1 0 0 0 0 0")
    np.testing.assert_allclose(places(file)["left::arm"], expected, atol=EXACT)


def test_a_folder_stands_for_the_file_that_its_config_names(tmp_path: Path) -> None:
    part = tmp_path / "models" / "part"
    part.mkdir(parents=True)
    (part / "model.config").write_text(
        '<model><name>part</name><sdf version="1.4">old.sdf</sdf><sdf version="1.9">new.sdf</sdf></model>'
    )
    (part / "new.sdf").write_text(PART)
    (tmp_path / "models" / "robot").mkdir()
    include = "<include><uri>model://part</uri></include>"
    weld = joint("weld", "fixed", "base", "part::arm", axis="")
    found = read(written(tmp_path / "models" / "robot", link("base"), include, weld, WORLD))
    assert [one.name for one in found.links] == ["base", "part::arm"]


def test_frames_of_nested_models(tmp_path: Path) -> None:
    inner = '<model name="in"><pose>0 0 1 0.2 0 0</pose>' + link("a", "<pose>1 0 0 0 0 0</pose>")
    inner += joint("j", "revolute", "a", "b", "<pose>0 1 0 0 0 0</pose>")
    inner += link("b", '<pose relative_to="a">0 0 0 0 0 0.7</pose>') + "</model>"
    file = written(
        tmp_path, link("base"), inner, WORLD, link("c", '<pose relative_to="in::j">0 2 0 0 0 0</pose>'),
        '<frame name="f" attached_to="in::b"/>', joint("weld", "fixed", "f", "c", axis=""),
        joint("to", "fixed", "base", "in", axis=""),
    )  # fmt: skip
    found = places(file, **{"in::j": 0.0})
    model = se3("0 0 1 0.2 0 0")
    b = model * se3("1 0 0 0 0 0") * se3("0 0 0 0 0 0.7")
    np.testing.assert_allclose(found["in::b"], b, atol=EXACT)
    np.testing.assert_allclose(found["c"], b * se3("0 1 0 0 0 0") * se3("0 2 0 0 0 0"), atol=EXACT)


def test_a_world_places_its_robot_and_has_gravity(tmp_path: Path) -> None:
    text = sdf(
        "<pose>0 0 1 0 0 0.4</pose>", link("base"), link("a"), WORLD, joint("j", "revolute", "base", "a")
    )
    ground = '<model name="ground"><static>true</static><link name="l"/></model>'
    sun = "<include><uri>model://sun</uri></include>"
    text = text.replace("<model", f"<world name='w'><gravity>0 0 -1.62</gravity>{ground}{sun}<model", 1)
    file = save(tmp_path, text.replace("</sdf>", "</world></sdf>"), "moon.sdf")
    robot = hybridyn.load(file)
    np.testing.assert_array_equal(robot.gravity, [0, 0, -1.62])
    np.testing.assert_allclose(places(file)["base"], se3("0 0 1 0 0 0.4"), atol=EXACT)
    assert any("'ground', 'sun'" in note for note in robot.description.notes)
    file.write_text(file.read_text().replace("<gravity>0 0 -1.62</gravity>", ""))
    np.testing.assert_array_equal(hybridyn.load(file).gravity, [0, 0, -9.8])


def test_one_of_several_models_is_chosen_by_name(tmp_path: Path) -> None:
    """With its own world; an included model has the name that its world gives it, else that of its folder."""
    arm = sdf(link("base"), link("a"), WORLD, joint("j", "revolute", "base", "a"), name="arm")
    folder = tmp_path / "leg"
    folder.mkdir()
    (folder / "model.sdf").write_text(arm.replace('"arm"', '"other"').replace('"j"', '"k"'))
    (folder / "model.config").write_text("<model><sdf>model.sdf</sdf></model>")
    uri = "<include>{}<uri>model://leg</uri></include>"
    models = uri.format("") + uri.format("<name>two</name>")
    moon = f"<world name='moon'><gravity>0 0 -1.62</gravity>{models}</world>"
    file = save(tmp_path, arm.replace("</model>", "</model>" + moon), "robots.sdf")
    for name, joints, gravity in (("arm", ("j",), -9.81), ("leg", ("k",), -1.62), ("two", ("k",), -1.62)):
        robot = hybridyn.load(f"{file}#{name}")
        assert (robot.joints, robot.gravity[2], robot.description.source) == (joints, gravity, str(file))
    refused(f"{file}#legs", "no model is named 'legs' (did you mean 'leg'", "'arm', 'leg', 'two'")
    refused(f"{file}#", "cannot be read")
    urdf = save(tmp_path, '<robot name="r"><link name="l"/></robot>', "robot.urdf")
    refused(f"{urdf}#arm", "only an SDF file has several models; remove '#arm'")
    with pytest.raises(hybridyn.ModelError, match="own file"):
        hybridyn.convert(f"{file}#arm", file)
    urdf.rename(tmp_path / "robot#1.urdf")
    assert read(tmp_path / "robot#1.urdf").name == "r"


def test_a_model_that_nothing_holds_floats(tmp_path: Path) -> None:
    file = written(
        tmp_path, "<pose>0 0 1 0 0 0.4</pose>", link("base"), link("a"), joint("j", "revolute", "base", "a")
    )
    robot = hybridyn.load(file)
    assert (robot.base, robot.description.root) == ("floating", "base")
    np.testing.assert_allclose(robot.home[:7], [0, 0, 1, 0, 0, np.sin(0.2), np.cos(0.2)], atol=EXACT)
    assert hybridyn.load(file, base="fixed").base == "fixed"


def test_groups_of_links_float_beside_each_other(tmp_path: Path) -> None:
    found = read(written(tmp_path, link("base"), link("a", "<pose>1 2 3 0 0 0</pose>"), WORLD))
    (free,) = [joint for joint in found.joints if joint.kind == "floating"]
    assert (free.name, free.parent, free.child) == ("a_free", "world", "a")
    assert found.home["a_free"] == (1, 2, 3, 0, 0, 0, 1)


CORNERS = ("0 0 0 0 0 0", "0.3 0 1 0 0 0", "1.2 0 0.8 0 0 0")
LOOP = {"a": ("base", "l1"), "b": ("l1", "l2"), "c": ("l2", "l3"), "d": ("base", "l3")}
CUT = "<physics><simbody><must_be_loop_joint>true</must_be_loop_joint></simbody></physics>"
DAMPED = "<axis><xyz>0 1 0</xyz><dynamics><damping>.3</damping></dynamics></axis>"
LIMITED = "<axis><xyz>0 1 0</xyz><limit><lower>-1</lower></limit></axis>"


@pytest.mark.parametrize(
    ("about", "cut"),
    [
        ({}, "d"),  # the link hangs on another joint already
        ({"b": CUT}, "b"), ({"d": DAMPED}, "c"), ({"c": DAMPED, "d": LIMITED}, "b"),
        ({"a": LIMITED, "b": DAMPED, "d": LIMITED}, "c"), ({"b": "ball"}, "b"), ({"d": "fixed"}, "c"),
    ],
)  # fmt: skip
def test_the_joint_that_loses_least_closes_the_loop(about: dict[str, str], cut: str, tmp_path: Path) -> None:
    found = read(written(tmp_path, *loop(about)))
    (closure,) = found.closures
    assert closure.name == cut
    assert sorted(one.name for one in found.joints if one.name in LOOP) == sorted(set(LOOP) - {cut})


def loop(about: dict[str, str]) -> list[str]:
    """Return a closed chain of four links; what is said of a joint is its type or its axis."""
    parts = [link("base"), WORLD, *(link(f"l{n}", f"<pose>{at}</pose>") for n, at in enumerate(CORNERS, 1))]
    for name, ends in LOOP.items():
        more = about.get(name, "")
        kind = more if more in ("ball", "fixed") else "revolute"
        axis = "0 1 0" if kind == "revolute" and not more.startswith("<axis>") else ""
        pose = "<pose>0.1 0 -0.9 0 0 0</pose>" if name == "d" else ""
        parts.append(joint(name, kind, *ends, pose, more if kind == "revolute" else "", axis=axis))
    return parts


def test_a_loop_of_joints_with_forces_is_cut_behind_one(tmp_path: Path) -> None:
    found = read(written(tmp_path, *loop(dict.fromkeys(LOOP, DAMPED))))
    (closure,) = found.closures
    assert (closure.name, closure.kind, closure.link_b) == ("d_closure", "fixed", "l3")
    assert {one.name: one.damping for one in found.joints if one.name in LOOP} == dict.fromkeys(LOOP, 0.3)
    free = hybridyn.load(written(tmp_path, *loop({})))
    assert hybridyn.load(written(tmp_path, *loop(dict.fromkeys(LOOP, DAMPED)))).mobility == free.mobility


def test_what_is_left_out_is_said(tmp_path: Path) -> None:
    stop = "<axis><xyz>0 0 1</xyz><limit><stiffness>1e4</stiffness></limit></axis>"
    engine = "<physics><ode><erp>.1</erp></ode></physics>"
    parts = [
        link("base"), link("a"), WORLD, joint("j", "revolute", "base", "a", stop, engine, axis=""),
        '<plugin name="control" filename="c.so"/>', "<my:thing/>", joint("k", "fixed", "a", "b"),
        link("b", "<static>0</static><contact><collide_bitmask>1</collide_bitmask></contact>"), link("c"),
        joint("hip", "ball", "a", "c", "<axis><dynamics><damping>2</damping></dynamics></axis>", axis=""),
    ]  # fmt: skip
    file = save(tmp_path, sdf(*parts).replace("<sdf", '<sdf xmlns:my="urn:my"'), "robot.sdf")
    found = read(file)
    notes = "\n".join(found.notes)
    assert {one.damping for one in found.joints} == {0.0}
    for words in (
        "stiffness and dissipation",
        "physics engine",
        "'control'",
        "'my:thing'",
        "joints 'k', 'hip': an axis that the joint does not have, and its dynamics, are ignored",
        '<static> in <link name="b"> is ignored, as Gazebo does',
        '<contact> in <link name="b"> is ignored, as Gazebo does',
    ):
        assert words in notes


def test_an_empty_element_is_the_default(tmp_path: Path) -> None:
    axis = "<axis><xyz>0 0 1</xyz><limit><effort/></limit><dynamics><damping/></dynamics><initial_position/>"
    axis += "</axis>"
    cut = "<physics><simbody><must_be_loop_joint/></simbody></physics>"
    light = "<link name='a'><gravity/><kinematic/><pose/><inertial><mass/><inertia/><pose/></inertial></link>"
    file = written(
        tmp_path, link("base"), light, WORLD, joint("j", "revolute", "base", "a", axis, cut, axis="")
    )
    found = read(file)
    hinge = next(one for one in found.joints if one.name == "j")
    assert (hinge.damping, hinge.effort, found.home, found.links[1].mass) == (0.0, np.inf, {}, 1.0)
    assert any("'a': no mass" in note for note in found.notes)


def test_an_initial_position_is_home(tmp_path: Path) -> None:
    axis = "<axis><xyz>0 0 1</xyz><initial_position>.4</initial_position></axis>"
    file = written(
        tmp_path,
        link("base"),
        link("a"),
        WORLD,
        joint("j", "revolute", "base", "a", axis, axis=""),
        version="1.6",
    )
    assert read(file).home == {"j": (0.4,)}


def test_the_motion_does_not_depend_on_the_cut(tmp_path: Path) -> None:
    """Cut elsewhere, joints of the tree run backwards, or a link is welded: the motor feels the same."""
    felt = []
    for about in ({"b": CUT}, {"d": CUT}, dict.fromkeys(LOOP, DAMPED)):
        robot = hybridyn.load(written(tmp_path, *loop(about)), motors=["a"])
        weight = hybridyn.gravity(robot, robot.home)
        felt.append([hybridyn.mass_matrix(robot, robot.home)[0, 0], weight[0]])
    np.testing.assert_allclose(felt, np.broadcast_to(felt[0], (3, 2)), rtol=1e-11)
