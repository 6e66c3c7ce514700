"""What the SDF reader makes of joints, frames, models and worlds, against values computed by hand."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn.description import read
from tests.description.engine_words import DETACHABLE
from tests.description.reading import Texts, holds, refused, save_all
from tests.description.sdf_texts import WORLD, joint, link, sdf
from tests.support.files import save

EXACT = 1e-14  # some products of matrices

AT = "0.1 -0.2 0.3 0.4 -0.5 0.6"  # of the joint, in its child
BODY = "0.5 0.6 -0.7 0.8 0.9 -1.0"  # of the child, in the world


def se3(*texts: str) -> pin.SE3:
    """Return the product of poses of SDF."""
    out = pin.SE3.Identity()
    for text in texts:
        x, y, z, *angles = (float(word) for word in text.split())
        out *= pin.SE3(pin.rpy.rpyToMatrix(np.array(angles)), np.array([x, y, z]))
    return out


def places(file: Path, **positions: object) -> dict[str, pin.SE3]:
    """Return the pose of every link of a robot in the world at some joint positions."""
    robot = hybridyn.load(file)
    q = robot.home.copy()
    for name, x in positions.items():
        at = robot.q_slices[robot.joints.index(name)]
        q[at] = (np.cos(x), np.sin(x)) if at.stop - at.start == 2 else x
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
        "<axis2><xyz>3 0 1</xyz></axis2>", {"j_1": 0.7, "j_2": -0.4},
        turn((1, 2, 3), 0.7) * turn((3, 0, 1), -0.4),
    ),
    # 0.4 m per turn
    "screw": (
        "<screw_thread_pitch>0.4</screw_thread_pitch>", {"j": 0.7},
        turn((1, 2, 3), 0.7, 0.7 * 0.4 / (2 * np.pi)),
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
    file = save(tmp_path, sdf(
        link("base"), link("arm", f"<pose>{BODY}</pose>"), WORLD,
        joint("j", kind, *ends, pose, more, axis="" if kind == "fixed" else "1 2 3"),
    ), "robot.sdf")  # fmt: skip
    at = body * se3(AT)
    moved = at * motion * at.inverse()
    expected = moved.inverse() * se3(BODY) if turned_round else moved * se3(BODY)
    np.testing.assert_allclose(places(file, **positions)["arm"], expected, atol=EXACT)


def test_a_ball_turns_about_its_centre(tmp_path: Path) -> None:
    pose = f"<pose>{AT}</pose>"
    text = sdf(link("base"), link("arm"), WORLD, joint("j", "ball", "base", "arm", pose, axis=""))
    turned = pin.exp3(np.array([0.3, -0.5, 0.8]))
    centre = pin.SE3(np.eye(3), se3(AT).translation)
    expected = centre * pin.SE3(turned, np.zeros(3)) * centre.inverse()
    found = places(save(tmp_path, text, "robot.sdf"), j=pin.Quaternion(turned).coeffs())
    np.testing.assert_allclose(found["arm"], expected, atol=EXACT)


MIMIC = "<axis><xyz>0 0 1</xyz><mimic joint='lead' axis='{}'><multiplier>3</multiplier><offset>.5</offset>"
MIMIC += "<reference>.2</reference></mimic></axis>"
CROSS = joint("lead", "universal", "base", "a", "<axis2><xyz>1 0 0</xyz></axis2>")
ABOUT_Z = "<axis><xyz>0 0 1</xyz>{}</axis>"
NUMBERS = ABOUT_Z.format(
    "<limit><lower>-1</lower><upper>2</upper><effort>-1</effort><velocity>3</velocity></limit>"
    "<dynamics><damping>.1</damping><friction>.2</friction><spring_stiffness>5</spring_stiffness>"
    "<spring_reference>.3</spring_reference></dynamics>"
)
DRAKE = "<drake:rotor_inertia>.02</drake:rotor_inertia><drake:gear_ratio>50</drake:gear_ratio>"
EMPTY = "<limit><effort/></limit><dynamics><damping/></dynamics><initial_position/>"
FEATHER = "<link name='a'><gravity/><kinematic/><pose/><inertial><mass/><inertia/><pose/></inertial></link>"
TWO = link("base"), link("a"), WORLD
HINGE = joint("j", "revolute", "base", "a")
PART = sdf(
    link("arm", "<pose>1 0 0 0 0 0</pose>"),
    '<frame name="tip" attached_to="arm"><pose>0 0.5 0 0 0 0.3</pose></frame>',
    name="part",
)  # fmt: skip
BALL_OF_DRAKE = (
    "<drake:ball_constraint><drake:ball_constraint_body_A>a</drake:ball_constraint_body_A>"
    "<drake:ball_constraint_p_AP>1 2 3</drake:ball_constraint_p_AP>"
    "<drake:ball_constraint_body_B>b</drake:ball_constraint_body_B>"
    "<drake:ball_constraint_p_BQ>4 5 6</drake:ball_constraint_p_BQ></drake:ball_constraint>"
)
INCLUDE = "<include><uri>{}</uri>{}</include>"
AT_BASE = '<name>left</name><pose relative_to="base">0 0 2 0 0 0.1</pose>'
ARM = f'<model name="arm"><pose relative_to="f">0 1 0 0 0 0</pose>{link("base")}</model>'
TWO_ARMS = ARM + ARM.replace('"arm"', '"two"').replace("0 1 0", "0 7 0")
IN_WORLD = (
    '<sdf version="1.11"><world name="w"><frame name="f"><pose>0 0 1 0 0 0.3</pose></frame>{}</world></sdf>'
)
HOLD = '<joint name="{}" type="fixed"><parent>{}</parent><child>{}</child></joint>'
HELD = IN_WORLD.format(ARM + HOLD.format("hold", "world", "arm::base"))
TIED = IN_WORLD.format(
    TWO_ARMS + HOLD.format("hold", "f", "arm::base") + HOLD.format("tie", "arm::base", "two::base")
)
APART = IN_WORLD.format(TWO_ARMS + HOLD.format("hold", "f", "two::base"))
INSIDE = "".join([
    '<model name="in"><pose>0 0 1 0.2 0 0</pose>', link("a", "<pose>1 0 0 0 0 0</pose>"),
    joint("j", "revolute", "a", "b", "<pose>0 1 0 0 0 0</pose>"),
    link("b", '<pose relative_to="a">0 0 0 0 0 0.7</pose>'), "</model>",
])  # fmt: skip
OTHERS = '<model name="ground"><static>true</static><link name="l"/></model><include><uri>model://sun</uri></include>'
MOON = (
    sdf("<pose>0 0 1 0 0 0.4</pose>", *TWO, HINGE)
    .replace("<model", f"<world name='w'><gravity>0 0 -1.62</gravity>{OTHERS}<model", 1)
    .replace("</sdf>", "</world></sdf>")
)
FLOATS = sdf("<pose>0 0 1 0 0 0.4</pose>", link("base"), link("a"), HINGE)
IN = ("0 0 1 0.2 0 0", "1 0 0 0 0 0", "0 0 0 0 0 0.7")
#: The text of a robot, or the texts of its files; where its links stand at home.
PLACED: dict[str, tuple[Texts, dict[str, pin.SE3]]] = {
    "an included model": (
        {
            "robot.sdf": sdf(
                link("base", "<pose>0 3 0 0 0 0.5</pose>"), WORLD,
                INCLUDE.format("part.sdf", '<name>left</name><pose relative_to="base">0 0 2 0 0 0.1</pose>'),
                joint("weld", "fixed", "base", "left::tip", axis=""),
            ),
            "part.sdf": PART,
        },
        {"left::arm": se3("0 3 0 0 0 0.5", "0 0 2 0 0 0.1", "1 0 0 0 0 0")},
    ),
    "nested models": (
        sdf(link("base"), INSIDE, WORLD, link("c", '<pose relative_to="in::j">0 2 0 0 0 0</pose>'),
            '<frame name="f" attached_to="in::b"/>', joint("weld", "fixed", "f", "c", axis=""),
            joint("to", "fixed", "base", "in", axis="")),
        {"in::b": se3(*IN), "c": se3(*IN, "0 1 0 0 0 0", "0 2 0 0 0 0")},
    ),
    # What stands at the pose is the tip: 0 0 2 is where the frame "tip" is, in the frame of the base.
    "an included model by its placement frame": (
        {
            "robot.sdf": sdf(
                link("base", "<pose>0 3 0 0 0 0.5</pose>"), WORLD,
                INCLUDE.format("part.sdf", AT_BASE + "<placement_frame>tip</placement_frame>"),
                joint("weld", "fixed", "base", "left::tip", axis=""),
            ),
            "part.sdf": PART,
        },
        {"left::arm": se3("0 3 0 0 0 0.5", "0 0 2 0 0 0.1") * se3("0 0.5 0 0 0 0.3").inverse()},
    ),
    "a merged model": (
        {
            "robot.sdf": sdf(
                link("base", "<pose>0 3 0 0 0 0.5</pose>"), WORLD,
                INCLUDE.replace("<include", '<include merge="true"').format("part.sdf", AT_BASE),
                joint("weld", "fixed", "base", "tip", axis=""),
            ),
            "part.sdf": PART,
        },
        {"arm": se3("0 3 0 0 0 0.5", "0 0 2 0 0 0.1", "1 0 0 0 0 0")},
    ),
    "a frame and a joint of the world": (HELD, {"base": se3("0 0 1 0 0 0.3", "0 1 0 0 0 0")}),
    "models that a joint of the world ties": (TIED, {
        "arm::base": se3("0 0 1 0 0 0.3", "0 1 0 0 0 0"), "two::base": se3("0 0 1 0 0 0.3", "0 7 0 0 0 0"),
    }),
    "the frame of a pose of SDFormat 1.6": (
        sdf(link("base", "<pose>0 3 0 0 0 0.5</pose>"), link("a", '<pose frame="base">1 0 0 0 0 0</pose>'),
            WORLD, HINGE, version="1.6"),
        {"a": se3("0 3 0 0 0 0.5", "1 0 0 0 0 0")},
    ),
    "a world": (MOON, {"base": se3("0 0 1 0 0 0.4")}),
    "a floating base": (FLOATS, {"base": se3("0 0 1 0 0 0.4")}),
}  # fmt: skip


@pytest.mark.parametrize("name", PLACED)
def test_links_stand_where_they_are_stated(name: str, tmp_path: Path) -> None:
    texts, expected = PLACED[name]
    found = places(save_all(tmp_path, texts, "robot.sdf"))
    for link_name, place in expected.items():
        np.testing.assert_allclose(found[link_name], place, atol=EXACT)


CORNERS = ("0 0 0 0 0 0", "0.3 0 1 0 0 0", "1.2 0 0.8 0 0 0")
LOOP = {"a": ("base", "l1"), "b": ("l1", "l2"), "c": ("l2", "l3"), "d": ("base", "l3")}
CUT = "<physics><simbody><must_be_loop_joint>true</must_be_loop_joint></simbody></physics>"
DAMPED = "<axis><xyz>0 1 0</xyz><dynamics><damping>.3</damping></dynamics></axis>"
LIMITED = "<axis><xyz>0 1 0</xyz><limit><lower>-1</lower></limit></axis>"
ALL_DAMPED = dict.fromkeys(LOOP, DAMPED)


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


#: The text of a robot, or the texts of its files, and what is read.
READ: dict[str, tuple[Texts, dict[str, object]]] = {
    **{
        f"an axis follows {axis}": (
            sdf(*TWO, link("b"), CROSS, joint("follow", "revolute", "base", "b", MIMIC.format(axis), axis=""),
                version="1.11"),
            {"couplings": [{"name": "follow", "terms": (("follow", 1.0), (leader, -3.0)),
                            "offset": pytest.approx(0.5 - 3 * 0.2, rel=0, abs=EXACT)}]},
        )
        for axis, leader in (("axis", "lead_1"), ("axis2", "lead_2"))
    },
    "numbers of an axis": (
        sdf(*TWO, joint("j", "revolute", "base", "a", NUMBERS, DRAKE, axis=""),
            more=' xmlns:drake="http://drake.mit.edu"'),
        {"joints": {"j": {
            "lower": -1, "upper": 2, "effort": np.inf, "velocity": 3, "damping": 0.1, "friction": 0.2,
            "rotor_inertia": 0.02, "gear_ratio": 50,
        }}, "effects": (("spring", {"stiffness": {"j": 5.0}, "rest": {"j": 0.3}}),)},
    ),
    **{
        f"a screw with {pitch}": (
            sdf(*TWO, joint("j", "screw", "base", "a", pitch)),
            {"joints": {"j": {"kind": "screw", "pitch": pytest.approx(way)}}},
        )
        for pitch, way in (
            ("<screw_thread_pitch>-.3</screw_thread_pitch>", -0.3 / (2 * np.pi)),
            ("<thread_pitch>3</thread_pitch>", -1 / 3), ("", 1 / (2 * np.pi)),
        )
    },
    "a revolute2 with axes of its own rotors": (
        sdf(*TWO, joint("j", "revolute2", "base", "a", *(
            f"<axis{n}><xyz>{xyz}</xyz><drake:rotor_inertia>{n or 1}</drake:rotor_inertia></axis{n}>"
            for n, xyz in (("", "0 0 1"), ("2", "0 1 0"))
        ), axis=""), more=' xmlns:drake="http://drake.mit.edu"'),
        {"joints": {"j_1": {"rotor_inertia": 1.0}, "j_2": {"rotor_inertia": 2.0}}},
    ),
    "an axis without a direction is z": (
        sdf(*TWO, joint("j", "revolute", "base", "a", "<axis/>", axis="")),
        {"joints": {"j": {"axis": (0, 0, 1)}}},
    ),
    "parts of screws in a hinge": (
        sdf(*TWO, joint("j", "revolute", "base", "a", "<thread_pitch>2</thread_pitch>")),
        {"couplings": (), "notes": {"joints 'j': parts of screws or gearboxes in a joint of another type"}},
    ),
    "a ball constraint of Drake": (
        sdf(*TWO, HINGE, link("b"), joint("k", "revolute", "base", "b"), BALL_OF_DRAKE,
            more=' xmlns:drake="http://drake.mit.edu"'),
        {"closures": [{"name": "ball_constraint1", "kind": "spherical", "link_a": "a", "link_b": "b",
                       "frame_b": pin.SE3(np.eye(3), np.array([4.0, 5.0, 6.0])).homogeneous}]},
    ),
    "a spring of Drake": (
        sdf(*TWO, HINGE, BALL_OF_DRAKE.replace("ball_constraint", "linear_spring_damper")
            .replace(">b<", ">base<").replace("</drake:linear_spring_damper>", "".join(
                f"<drake:linear_spring_damper_{word}>{x}</drake:linear_spring_damper_{word}>"
                for word, x in (("free_length", 1), ("stiffness", 2), ("damping", 3))
            ) + "</drake:linear_spring_damper>"), more=' xmlns:drake="http://drake.mit.edu"'),
        {"effects": (("line_springs", {
            "ends": {"linear_spring_damper1": ["a", "base"]},
            "points": {"linear_spring_damper1": [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]},
            "stiffness": {"linear_spring_damper1": 2.0}, "damping": {"linear_spring_damper1": 3.0},
            "lower": {"linear_spring_damper1": 1.0}, "upper": {"linear_spring_damper1": 1.0},
        }),)},
    ),
    "a link called world": (
        sdf("<pose>0 0 1 0 0 0</pose>", '<link name="world"/>', link("a"),
            joint("j", "revolute", "world", "a")),
        {"links": ["world2", "world", "a"], "base": "fixed", "notes": {"links 'world' without <inertial>"},
         "joints": {"world_hold": {"parent": "world2", "child": "world",
                                   "placement": pin.SE3(np.eye(3), np.array([0.0, 0, 1])).homogeneous}}},
    ),
    "a link called world with mass": (
        sdf(link("world"), link("a"), joint("j", "revolute", "world", "a")), {"base": "floating"},
    ),
    "links without weight": (
        sdf(link("base"), link("a", "<gravity>false</gravity>"), WORLD, HINGE),
        {"effects": (("gravity_compensation", {"fraction": {"a": 1.0}}),),
         "notes": {"gravity does not act on links 'a'"}},
    ),
    **{
        f"a gearbox {how}": (
            sdf(*TWO, link("b"), joint("j", "revolute", *ends),
                joint("k", "revolute", "base", "b", axis="0 0 -1"),
                joint("g", "gearbox", "a", "b", "<axis2><xyz>0 0 1</xyz></axis2>"
                      "<gearbox_ratio>5</gearbox_ratio><gearbox_reference_body>" + body
                      + "</gearbox_reference_body>")),
            {"couplings": [{"name": "g", "terms": (("k", -1.0), ("j", sense * 5.0))}]},
        )
        for how, ends, sense, body in (
            ("of two hinges", ("base", "a"), 1, "base"), ("against a hinge", ("a", "base"), -1, "base"),
            ("against the world", ("base", "a"), 1, "world"),
        )
    },
    "a gearbox against a link that moves": (
        sdf(*TWO, link("b"), link("c"), HINGE, joint("k", "revolute", "a", "b"),
            joint("l", "revolute", "a", "c"),
            joint("g", "gearbox", "base", "c", "<axis2><xyz>0 0 1</xyz></axis2><gearbox_ratio>-2"
                  "</gearbox_ratio><gearbox_reference_body>b</gearbox_reference_body>")),
        {"couplings": [{"terms": (("l", 1.0), ("j", 2.0), ("k", 1.0))}]},
    ),
    "limits of 1e16 are none": (
        sdf(*TWO, joint(
            "j", "revolute", "base", "a",
            ABOUT_Z.format("<limit><lower>-1e16</lower><upper>1e16</upper></limit>"), axis="",
        ), version="1.6"),
        {"joints": {"j": {"lower": -np.inf, "upper": np.inf}}},
    ),
    "an initial position is home": (
        sdf(*TWO, joint(
            "j", "revolute", "base", "a",
            ABOUT_Z.format("<initial_position>.4</initial_position>"), axis="",
        ), version="1.6"),
        {"home": {"j": (0.4,)}},
    ),
    "an empty element is the default": (
        sdf(link("base"), FEATHER, WORLD, joint(
            "j", "revolute", "base", "a", ABOUT_Z.format(EMPTY),
            CUT.replace(">true</must_be_loop_joint", "/"), axis="",
        )),
        {"joints": {"j": {"damping": 0.0, "effort": np.inf}}, "home": {}, "links": {"a": {"mass": 1.0}},
         "notes": {"'a': no mass"}},
    ),
    # The inertia that SDFormat gives a link.
    **{
        f"a link with {inertial}": (
            sdf(f'<link name="base">{inertial}</link>', WORLD),
            {"links": [{"mass": mass, "inertia": moment * np.eye(3)}],
             "notes": {"'base': no mass or inertia is stated, so SDFormat's default counts"}},
        )
        for inertial, mass, moment in (
            ("", 1.0, 1.0), ("<inertial><mass>3</mass></inertial>", 3.0, 1.0),
            ("<inertial><inertia><ixx>2</ixx><iyy>2</iyy><izz>2</izz></inertia></inertial>", 1.0, 2.0),
        )
    },
    "a folder stands for the file that its config names": (
        {
            "robot/robot.sdf": sdf(link("base"), INCLUDE.format("model://part", ""), WORLD,
                                   joint("weld", "fixed", "base", "part::arm", axis="")),
            "part/model.config": '<model><name>part</name><sdf version="1.4">old.sdf</sdf>'
            '<sdf version="1.9">new.sdf</sdf></model>',
            "part/new.sdf": PART,
        },
        {"links": ["base", "part::arm"]},
    ),
    "a world has gravity": (MOON, {"gravity": (0, 0, -1.62), "notes": {"'ground', 'sun'"}}),
    "usual gravity of a world": (
        MOON.replace("<gravity>0 0 -1.62</gravity>", ""), {"gravity": (0, 0, -9.8)},
    ),
    "a model that nothing holds floats": (FLOATS, {"base": "floating", "root": "base"}),
    "groups of links float beside each other": (
        sdf(link("base"), link("a", "<pose>1 2 3 0 0 0</pose>"), WORLD),
        {"joints": {"a_free": {"kind": "floating", "parent": "world", "child": "a"}},
         "home": {"a_free": (1, 2, 3, 0, 0, 0, 1)}},
    ),
    "a loop of joints with forces is cut behind one": (
        sdf(*loop(ALL_DAMPED)),
        {"closures": [{"name": "d_closure", "kind": "fixed", "link_b": "l3"}],
         "joints": {name: {"damping": 0.3} for name in LOOP}},
    ),
    "a long chain of frames": (
        sdf(*TWO, '<frame name="f0" attached_to="base"/>', joint("j", "fixed", "f1499", "a", axis=""), *(
            f'<frame name="f{n}" attached_to="f{n - 1}"><pose>1 0 0 0 0 0</pose></frame>'
            for n in range(1, 1500)
        )),
        {"joints": {"j": {"parent": "base"}}},
    ),
    "what is left out": (
        sdf(
            *TWO, '<plugin name="control" filename="c.so"/>', "<my:thing/>", joint("k", "fixed", "a", "b"),
            link("b", "<static>0</static><contact><collide_bitmask>1</collide_bitmask></contact>"), link("c"),
            joint("j", "revolute", "base", "a",
                  ABOUT_Z.format("<limit><stiffness>1e4</stiffness></limit>"),
                  "<physics><ode><erp>.1</erp></ode></physics>", axis=""),
            joint("hip", "ball", "a", "c", "<axis><dynamics><damping>2</damping></dynamics></axis>", axis=""),
            more=' xmlns:my="urn:my"',
        ),
        {"joints": {name: {"damping": 0.0} for name in ("j", "k", "hip")}, "notes": {
            "stiffness and dissipation", "'control'", "'my:thing'",
            "joints 'k', 'hip': an axis that the joint does not have, and its dynamics, are ignored",
            '<static> in <link name="b"> is ignored, as Gazebo does',
            '<contact> in <link name="b"> is ignored, as Gazebo does',
        }},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", READ)
def test_what_is_read(name: str, tmp_path: Path) -> None:
    texts, expected = READ[name]
    holds(read(save_all(tmp_path, texts, "robot.sdf")), expected)


@pytest.mark.parametrize(
    ("about", "cut"),
    [
        ({}, "d"),  # the link hangs on another joint already
        ({"b": CUT}, "b"), ({"d": DAMPED}, "c"), ({"c": DAMPED, "d": LIMITED}, "b"),
        ({"a": LIMITED, "b": DAMPED, "d": LIMITED}, "c"), ({"b": "ball"}, "b"), ({"d": "fixed"}, "c"),
    ],
)  # fmt: skip
def test_the_joint_that_loses_least_closes_the_loop(about: dict[str, str], cut: str, tmp_path: Path) -> None:
    found = read(save(tmp_path, sdf(*loop(about)), "robot.sdf"))
    assert {one.name for one in found.joints} & LOOP.keys() == LOOP.keys() - {cut}
    holds(found, {"closures": [cut]})


def test_the_motion_does_not_depend_on_the_cut(tmp_path: Path) -> None:
    """Cut elsewhere, joints of the tree run backwards, or a link is welded: the motor feels the same."""
    felt = []
    for about in ({"b": CUT}, {"d": CUT}, ALL_DAMPED):
        robot = hybridyn.load(save(tmp_path, sdf(*loop(about)), "robot.sdf"), motors=["a"])
        weight = hybridyn.gravity(robot, robot.home)[0]
        felt.append([hybridyn.mass_matrix(robot, robot.home)[0, 0], weight, robot.mobility])
    np.testing.assert_allclose(felt, np.broadcast_to(felt[0], (3, 3)), rtol=1e-11)


def test_a_detachable_joint_is_a_fixed_joint(tmp_path: Path) -> None:
    """The last hinge of the loop moves a link that is welded to the chain, by a plugin or by a joint."""
    *parts, last = loop({})
    parts.append(link("e", f"<pose>{CORNERS[2]}</pose>"))
    on_e = last.replace("<child>l3</child>", "<child>e</child>")
    fixed = joint("held", "fixed", "l3", "e", axis="")
    felt = []
    for ends in ((on_e, DETACHABLE.format("l3", "robot", "e")), (on_e, fixed), (last, fixed)):
        robot = hybridyn.load(save(tmp_path, sdf(*parts, *ends), "robot.sdf"), motors=["a"])
        weight = hybridyn.gravity(robot, robot.home)[0]
        felt.append([hybridyn.mass_matrix(robot, robot.home)[0, 0], weight, robot.mobility])
    np.testing.assert_allclose(felt, np.broadcast_to(felt[2], (3, 3)), rtol=1e-11)


def test_one_of_several_models_is_chosen_by_its_name(tmp_path: Path) -> None:
    """Joints of the world that hold another one do not count."""
    file = save(tmp_path, APART, "world.sdf")
    refused(file, "2 models that move: 'arm', 'two'", "'FILE#MODEL'")
    refused(f"{file}#twoo", "no model that moves is named 'twoo' (did you mean 'two'?)")
    for name, base in (("arm", "floating"), ("two", "fixed")):
        found = read(f"{file}#{name}")
        holds(found, {"name": name, "base": base, "source": str(file)})
        assert read(found.read_from.file).name == name
    urdf = save(tmp_path, '<robot name="r"><link name="l"/></robot>', "a.urdf")
    refused(f"{urdf}#l", "only an SDF file has several models; remove '#l'")


def test_a_link_without_weight_moves_with_its_mass(tmp_path: Path) -> None:
    """The weight of the arm is none of the motor's under the effects of the file; its inertia is."""
    parts = link("base"), WORLD, joint("j", "revolute", "base", "a", axis="0 1 0")
    heavy, light = (
        hybridyn.load(save(tmp_path, sdf(*parts, link("a", said)), f"{name}.sdf"))
        for name, said in (("heavy", ""), ("light", "<gravity>0</gravity>"))
    )
    q, no = np.array([0.3]), np.zeros(1)
    felt = [
        hybridyn.idm(one, q, no, np.array([x]), effects="model")[0] for one in (heavy, light) for x in (0, 1)
    ]
    assert abs(felt[0]) > 0.1
    assert felt[2] == pytest.approx(0.0, abs=EXACT)
    assert felt[3] == pytest.approx(felt[1] - felt[0], rel=1e-12)


def test_a_screw_may_close_a_loop(tmp_path: Path) -> None:
    """A nut on a guide: the screw of 0.2 m per turn lifts it, the guide keeps it from turning."""
    parts = link("base"), link("nut"), WORLD, joint("guide", "prismatic", "base", "nut"), link("spindle")
    spindle = joint("drive", "revolute", "base", "spindle")
    screw = joint("thread", "screw", "spindle", "nut", "<screw_thread_pitch>0.2</screw_thread_pitch>")
    robot = hybridyn.load(save(tmp_path, sdf(*parts, spindle, screw), "robot.sdf"), motors=["drive"])
    assert robot.mobility == 1
    q, v, _ = hybridyn.assemble(robot, motors={"drive": (1.5, 2.0, 0.0)}, guess=robot.home)
    at, rate = (x[s[robot.joints.index("thread")]][0] for x, s in ((q, robot.q_slices), (v, robot.v_slices)))
    p = -0.2 / (2 * np.pi)
    np.testing.assert_allclose([at, rate], [-1.5, -2.0], rtol=1e-9)
    M = hybridyn.mass_matrix(robot, q)
    np.testing.assert_allclose(M, [[_about_z() + 0.1**2 + 0.01**2 + p**2]], rtol=1e-9)


def _about_z() -> float:
    """Return the moment of a link of the tests about its z through its centre of mass [kg m^2]."""
    R = pin.rpy.rpyToMatrix(0.1, 0.2, 0.3)
    inertia = np.array([[0.02, 0.002, -0.003], [0.002, 0.05, 0.004], [-0.003, 0.004, 0.06]])
    return float((R @ inertia @ R.T)[2, 2])
