"""loops.py and closure_forms.py: each closure allows the motion of its name, wherever its frames are.

foreign.py: a loop in a form that is not read raises an error naming it; no loop is loaded as a tree.
"""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from hybridyn.description import Closure, read
from hybridyn.description.placement import placement_from, rotation_from_rpy
from tests.description.reading import Texts, holds, refused, save_all
from tests.robots import sketch
from tests.robots.robot_texts import FOUR_BAR, LOOP, TREE, line_of, read_text, robot, save

Array = NDArray[np.float64]

ROUNDING = 1e-14  # a few products of rotation matrices of entries below one, offsets of a few metres
FELT = 1e-3  # a locked motion of 0.1 must show at least this much in some row

PREDECESSOR = "<predecessor link='coupler'><origin xyz='0.3 -0.2 0.1' rpy='0.4 -0.6 1.2'/></predecessor>"
SUCCESSOR = "<successor link='rocker'><origin xyz='-0.5 0.2 0.7' rpy='-1.1 0.3 0.5'/></successor>"
ORIGIN_A = placement_from(rotation_from_rpy(0.4, -0.6, 1.2), np.array([0.3, -0.2, 0.1]))
ORIGIN_B = placement_from(rotation_from_rpy(-1.1, 0.3, 0.5), np.array([-0.5, 0.2, 0.7]))
AXIS = np.array([1.0, -2.0, 2.0]) / 3
AXIS_TAG = "<axis xyz='1 -2 2'/>"


def loop(kind: str, *inside: str, attributes: str = "") -> str:
    return f"<loop name='l' type='{kind}' {attributes}>{PREDECESSOR}{SUCCESSOR}{''.join(inside)}</loop>"


def rows(closure: Closure, relative: Array) -> Array:
    """Compute the rows as defined in `records.Closure`, with `relative` the position of origin B from A."""
    a_to_b = np.linalg.inv(closure.frame_a) @ ORIGIN_A @ relative @ np.linalg.inv(ORIGIN_B) @ closure.frame_b
    z = a_to_b[:3, 2]
    rotation = {
        "free": [],
        "perpendicular": [z[2]],
        "parallel": [z[0], z[1], 1 - z[2]],
        "fixed": list((a_to_b[:3, :3] - np.eye(3)).ravel()),
    }[closure.rotation]
    return np.array([*a_to_b[list(closure.translations), 3], *rotation])


def turn(axis: Array, angle: float) -> Array:
    return placement_from(sketch.turn(axis, angle), np.zeros(3))


def slide(direction: Array, distance: float) -> Array:
    return placement_from(np.eye(3), distance * direction)


SIDE = np.cross(AXIS, [1.0, 0.0, 0.0]) / np.linalg.norm(np.cross(AXIS, [1.0, 0.0, 0.0]))
MOTIONS = {
    "turn": turn(AXIS, 0.7),
    "turn about another axis": turn(SIDE, 0.7),
    "slide": slide(AXIS, 0.1),
    "slide aside": slide(SIDE, 0.1),
}
#: Number of rows, and what they allow.
ALLOWED: dict[str, tuple[int, set[str]]] = {
    "fixed": (6, set()),
    "revolute": (5, {"turn"}),
    "continuous": (5, {"turn"}),
    "prismatic": (5, {"slide"}),
    "cylindrical": (4, {"turn", "slide"}),
    "planar": (3, {"turn", "slide aside"}),
    "spherical": (3, {"turn", "turn about another axis"}),
    "point": (3, {"turn", "turn about another axis"}),
}


X, Y, Z = np.eye(3)
#: Rows that a closure states, and what they allow and lock.
STATED = [
    ("tx ty tz rx ry rz", [], [slide(X, 0.1), turn(Y, 0.5)]),
    ("ty tz", [slide(X, 0.1), turn(X, 0.5), turn(Z, 0.5)], [slide(Y, 0.1), slide(Z, 0.1)]),
    (
        "tx rx ry",
        [slide(Y, 0.1), slide(Z, 0.1), turn(Z, 0.5)],
        [slide(X, 0.1), turn(X, 0.5), turn(Y, 0.5)],
    ),
    (
        "tx ry rz",
        [slide(Y, 0.1), slide(Z, 0.1), turn(X, 0.5)],
        [slide(X, 0.1), turn(Z, 0.5), turn(Y, 0.5)],
    ),
    (
        "ty rx rz",
        [slide(X, 0.1), slide(Z, 0.1), turn(Y, 0.5)],
        [slide(Y, 0.1), turn(X, 0.5), turn(Z, 0.5)],
    ),
    ("tx tz ry rz", [slide(Y, 0.1), turn(X, 0.5)], [slide(X, 0.1), slide(Z, 0.1), turn(Z, 0.5)]),
    (
        "rx ry rz",
        [slide(X, 0.1), slide(Y, 0.1), slide(Z, 0.1)],
        [turn(X, 0.5), turn(Y, 0.5), turn(Z, 0.5)],
    ),
    ("rz ry", [slide(X, 0.1), slide(Z, 0.1), turn(X, 0.5)], [turn(Y, 0.5), turn(Z, 0.5)]),
]
#: A closure, its number of rows, and motions that it allows and locks.
LOCKS = [
    *(
        (
            loop(kind, AXIS_TAG), count, [MOTIONS[name] for name in allowed],
            [motion for name, motion in MOTIONS.items() if name not in allowed],
        )
        for kind, (count, allowed) in ALLOWED.items()
    ),
    *(
        (loop("rows", attributes=f"rows='{stated}'"), len(stated.split()), free, locked)
        for stated, free, locked in STATED
    ),
]  # fmt: skip


@pytest.mark.parametrize(("element", "count", "free", "locked"), LOCKS)
def test_a_loop_allows_the_motions_of_its_joint(
    element: str, count: int, free: list[Array], locked: list[Array], tmp_path: Path
) -> None:
    (closure,) = read_text(tmp_path, robot(element)).closures
    holds(closure, {"kind": element.split("'")[3], "link_a": "coupler", "link_b": "rocker"})
    rotation = {"free": 0, "perpendicular": 1, "parallel": 2, "fixed": 3}[closure.rotation]
    assert len(closure.translations) + rotation == count
    for motion in (np.eye(4), *free):
        assert np.abs(rows(closure, motion)).max(initial=0) < ROUNDING
    for motion in locked:
        assert np.abs(rows(closure, motion)).max(initial=0) > FELT


ISAAC = """<loop_joint name="l" type="spherical">
  <link1 link="coupler" rpy="0.4 -0.6 1.2" xyz="0.3 -0.2 0.1"/>
  <link2 link="rocker" rpy="-1.1 0.3 0.5" xyz="-0.5 0.2 0.7"/>
</loop_joint>"""
GEAR = (
    '<coupling name="gear" type="rolling"><predecessor link="coupler"/><successor link="rocker"/>'
    '<ratio value="6"/></coupling>'
)
ENDS = {"link_a": "coupler", "link_b": "rocker"}
FRAMES = {
    "frame_a": pytest.approx(ORIGIN_A, rel=1e-7, abs=0),
    "frame_b": pytest.approx(ORIGIN_B, rel=1e-7, abs=0),
}
#: An element, what is read, and the axis of a closure in the frames that its two ends state.
READ: dict[str, tuple[str, dict[str, object], tuple[Array, ...]]] = {
    "a universal joint keeps its two axes perpendicular": (
        loop("universal", AXIS_TAG, "<axis2 xyz='0 3 4'/>"),
        {"closures": [{"translations": (0, 1, 2), "rotation": "perpendicular"}]},
        (AXIS, np.array([0, 0.6, 0.8])),
    ),
    "the default axis is x": (loop("revolute"), {}, (X, X)),
    "a loop joint": (ISAAC, {"closures": [{"kind": "spherical", "rotation": "free", **ENDS, **FRAMES}]}, ()),
    "a loop joint with a tag twice": (ISAAC.replace("link2 ", "link1 "), {"closures": [ENDS]}, ()),
    "a loop joint of attributes": (
        '<loop_joint name="l" type="3D" link1="coupler" link2="rocker"/>',
        {"closures": [{"rotation": "free", "link_b": "rocker", "frame_b": np.eye(4)}]}, (),
    ),
    "a loop joint with an axis": (
        ISAAC.replace("spherical", "continuous").replace("<link1", AXIS_TAG + "<link1"), {}, (AXIS,),
    ),
    "a loop joint with damping": (
        ISAAC.replace("</loop", '<dynamics damping="1"/></loop'),
        {"notes": {"drops 'damping' of closure"}}, (),
    ),
    "a coupling counts both ways from the common ancestor": (
        GEAR,
        {"couplings": [{"terms": (("drive", 6.0), ("elbow", 6.0), ("swing", -1.0)), "offset": 0}]}, (),
    ),
    "a coupling of a link with one below": (
        GEAR.replace('successor link="rocker"', 'successor link="crank"'),
        {"couplings": [{"terms": (("elbow", 6.0),)}]}, (),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", READ)
def test_what_is_read(name: str, tmp_path: Path) -> None:
    element, expected, axes = READ[name]
    found = read_text(tmp_path, robot(element))
    holds(found, expected)
    for closure in found.closures:
        frames = (closure.frame_a, ORIGIN_A), (closure.frame_b, ORIGIN_B)
        for (frame, origin), axis in zip(frames, axes, strict=False):
            np.testing.assert_allclose(frame[:3, 2], origin[:3, :3] @ axis, atol=ROUNDING)
            np.testing.assert_allclose(frame[:3, 3], origin[:3, 3])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('type="revolute">\n    <pre', 'type="revolut">\n    <pre', "did you mean 'revolute'"),
        ('type="revolute">\n    <pre', ">\n    <pre", "attribute 'type' is missing"),
        ('<loop name="pin"', "<loop", "attribute 'name' is missing"),
        ('link="rocker"><', 'link="rockr"><', "did you mean 'rocker'"),
        ('link="rocker"><', 'link="coupler"><', "to itself"),
        ("successor", "succesor", "unknown in"),
        ('<origin xyz="1.5 0 0" rpy="0 0 0"/></pre', '<orgin xyz="1.5 0 0"/></pre', "did you mean 'origin'"),
        ('<origin xyz="1.5 0 0" rpy="0 0 0"/></pre', '<origin xzy="1.5 0 0"/></pre', "did you mean 'xyz'"),
        ('<axis xyz="0 0 1"/>\n  </loop>', '<axis xyz="0 0 0"/>\n  </loop>', "the axis is zero"),
        ('<axis xyz="0 0 1"/>\n  </loop>', '<axis xyz="0 nan 1"/>\n  </loop>', "not a finite number"),
        ('<axis xyz="0 0 1"/>\n  </loop>', '<axis2 xyz="0 0 1"/>\n  </loop>', "unknown in"),
        ('<axis xyz="0 0 1"/>\n  </loop>', '<axis xyz="0 0 1"/><axis xyz="0 0 1"/></loop>', "stated twice"),
        ('<loop name="pin"', '<loop rows="tx" name="pin"', "unknown attribute 'rows'"),
    ],
)
def test_nothing_in_a_loop_may_be_misspelt(tmp_path: Path, old: str, new: str, message: str) -> None:
    text = FOUR_BAR.replace(old, new)
    assert text != FOUR_BAR
    start = line_of(text, "<loop")
    assert refused(save(tmp_path, text), message).line in range(start, start + 5)


@pytest.mark.parametrize(
    ("elements", "message"),
    [
        *(
            ([loop("rows", attributes=f"rows='{stated}'")], message)
            for stated, message in (
                ("tx rx", "not holonomic"),
                ("rz", "not holonomic"),
                ("tx tq", "unknown row 'tq'"),
                ("tx tx", "stated twice"),
                ("", "is empty"),
            )
        ),
        ([loop("universal", AXIS_TAG)], "<axis2> is missing"),
        ([LOOP, LOOP], "closure 'pin' is stated twice"),
        *(
            ([GEAR.replace(old, new)], message)
            for old, new, message in (
                ('"6"', '"0"', "couples nothing"),
                ('"6"', '"six"', "not a finite number"),
                ("rolling", "roling", "known: 'rolling'"),
                ("<ratio value", "<ratio valu", "did you mean 'value'"),
                ('link="rocker"', 'link="coupler"', "no movable joint"),
                ("ratio", "rati", "unknown in"),
                ('"rocker"', '"roker"', "did you mean 'rocker'"),
            )
        ),
    ],
)
def test_what_closes_or_couples_nothing_is_refused(tmp_path: Path, elements: list[str], message: str) -> None:
    refused(save(tmp_path, robot(*elements)), message)


BODIES = '<predecessor link="coupler"/><successor link="rocker"/>'


@pytest.mark.parametrize(
    ("element", "message"),
    [
        (
            "<gazebo><plugin><x><joint name='E'>"
            "<child>rocker</child><parent>coupler</parent></joint></x></plugin></gazebo>",
            "an SDF joint inside <gazebo> (Gazebo)",
        ),
        ('<drake:distance_constraint name="a"/>', "a Drake distance"),
        (
            '<drake:linear_bushing_rpy><drake:bushing_frameA name="a"/>'
            '<drake:bushing_frameC name="crank"/></drake:linear_bushing_rpy>',
            "unknown frame 'a'",
        ),
        ('<constraint name="c" type="revolute"/>', "<parent> is missing"),
        (
            '<loop_constraint name="l"><parent link="a"/><child link="b"/></loop_constraint>',
            "an early form of URDF+",
        ),
        ('<joint_constraint name="l"><gear_ratio value="6"/></joint_constraint>', "an early form of URDF+"),
        (f'<lopp name="l" type="revolute">{BODIES}</lopp>', "did you mean <loop>"),
        (f'<Loop name="l" type="revolute">{BODIES}</Loop>', "did you mean <loop>"),
        ('<couplng name="c"/>', "did you mean <coupling>"),
        ('<jiont name="c"/>', "did you mean <joint>"),
        (f'<pin name="l" type="revolute">{BODIES}</pin>', "an unknown form"),
        ('<pin name="l" link1="a" link2="b"/>', "an unknown form"),
        ('<cut><parent link="a"/><child link="b"/></cut>', "an unknown form"),
        ("<loop_closures/>", "an unknown form"),
        ('<include filename="rest.urdf"/>', "URDF includes no file"),
        ('<equality><connect body1="a" body2="b"/></equality>', "an unknown form"),
        ('<predecessor link="a"/>', "an unknown form"),
        ('<mimic joint="drive"/>', "an unknown form"),
        ('<part><link name="x"/></part>', "they would be lost"),
        (f"<gazebo>{LOOP}</gazebo>", "inside <gazebo>"),
        (f'<link name="x">{LOOP}</link>', "is not read inside <link>"),
        (f'<link name="x"><visual>{LOOP}</visual></link>', "is not read inside <visual>"),
        ('<link name="x"><mimic joint="drive"/></link>', "is not read inside <link>"),
        ('<joint name="x" type="fixed"><link name="y"/></joint>', "is not read inside <joint>"),
        (
            f'<joint name="x" type="fixed"><robot name="r">{TREE}{LOOP}</robot></joint>',
            "is not read inside <robot>",
        ),
        (
            '<joint name="x" type="fixed"><axis><mimic joint="drive"/></axis></joint>',
            "is not read inside <axis>",
        ),
        ('<transmission><loop name="l"/></transmission>', "is not read inside <transmission>"),
    ],
)
def test_is_refused_by_name(tmp_path: Path, element: str, message: str) -> None:
    text = robot(element)
    start = line_of(text, element)
    assert refused(save(tmp_path, text), message).line in range(start, start + element.count("\n") + 1)


@pytest.mark.parametrize(
    "element",
    [
        '<sensor name="imu" type="imu"><parent link="crank"/><origin xyz="0 0 0"/></sensor>',
        '<ros2_control name="r" type="system"><joint name="drive">'
        '<command_interface name="effort"/></joint></ros2_control>',
        '<frame name="tip" link="rocker" xyz="1 0 0" rpy="0 0 0"/>',
        '<mujoco><compiler meshdir="x"/></mujoco>',
        '<gazebo><plugin filename="libx.so"><joint>drive</joint></plugin></gazebo>',
        "<!-- " + LOOP + " -->",
        '<custom_colour_table><entry value="3"/></custom_colour_table>',
    ],
)
def test_what_closes_nothing_passes(tmp_path: Path, element: str) -> None:
    found = read(save(tmp_path, robot(element)))
    assert any("<custom" in note for note in found.notes) == ("<custom" in element)
    assert found.closures == ()


def frames(*names: str) -> str:
    """Return massless frame links, the first ones on the coupler, the last one on the rocker."""
    return "".join(
        f'<link name="{name}"/><joint name="{name}_frame" type="fixed"><parent link="{parent}"/>'
        f'<child link="{name}"/></joint>'
        for name, parent in zip(names, ["coupler"] * (len(names) - 1) + ["rocker"], strict=True)
    )


CLOSING = frames("fermeture_a", "fermeture_b")
PLUGIN = (
    "<gazebo><plugin filename='libmimic.so'><joint>drive</joint><mimicJoint>{}</mimicJoint></plugin></gazebo>"
)
SECOND = '<joint name="pin" type="revolute"><parent link="coupler"/><child link="rocker"/></joint>'
SIDE_CARS = "loop_closures.yml", "loop_closures.yaml"


@pytest.mark.parametrize(
    ("texts", "messages"),
    [
        (robot(CLOSING), ["nothing says which frames close it"]),
        (robot(SECOND), ["'pin'", "already the child of joint 'swing'", "<loop name"]),
        *(({"four_bar.urdf": robot(), name: "closures: []"}, [name]) for name in SIDE_CARS),
    ],
)
def test_a_loop_that_would_be_lost_is_refused(texts: Texts, messages: list[str], tmp_path: Path) -> None:
    refused(save_all(tmp_path, texts), *messages)


@pytest.mark.parametrize(
    ("texts", "notes"),
    [
        (robot(PLUGIN.format("elbow").replace("drive", "driv")), {"drops the mimic of joint 'elbow'"}),
        (robot(PLUGIN.format("stranger")), ()),
        *(({"four_bar.urdf": FOUR_BAR, name: "closures: []"}, {name}) for name in SIDE_CARS),
    ],
)
def test_what_closes_no_more_loops_is_noted(texts: Texts, notes: object, tmp_path: Path) -> None:
    holds(read(save_all(tmp_path, texts)), {"notes": notes})
