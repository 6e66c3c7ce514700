"""Loops as other tools write them in URDF: each gives the robot that the same loop as `<loop>` gives."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.description import read
from tests.description.reading import Texts, holds, refused, save_all
from tests.robots.robot_texts import INERTIAL, robot, save
from tests.support.samples import slow

#: Largest relative difference of two robots that say the same in other words.
EQUAL = 1e-11
MOTOR = '<transmission name="t"><joint name="drive"/></transmission>'


def loop(kind: str, axis: str = '<axis xyz="0 0 1"/>') -> str:
    """Return the loop of the four-bar as `<loop>`."""
    return (
        f'<loop name="pin" type="{kind}"><predecessor link="coupler"><origin xyz="1.5 0 0"/></predecessor>'
        f'<successor link="rocker"><origin xyz="1 0 0"/></successor>{axis}</loop>'
    )


def frame(name: str, link: str, xyz: str, rpy: str = "0 0 0") -> str:
    """Return a frame as onshape-to-robot writes it: a link of 1e-9 kg on a fixed joint."""
    return (
        f'<link name="{name}"><inertial><mass value="1e-9"/><inertia ixx="0" iyy="0" izz="0"/></inertial>'
        "</link>"
        f'<joint name="{name}_frame" type="fixed"><parent link="{link}"/><child link="{name}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/></joint>'
    )


def mates(*points: str, rpy: str = "0 0 0") -> str:
    """Return the closing frames of the four-bar's tip; each point is an ending and its height."""
    parts = []
    for point in points:
        ending, height = point.split("@") if "@" in point else (point, "0")
        link, x = ("coupler", 1.5) if ending.startswith("1") else ("rocker", 1)
        parts.append(frame(f"closing_tip_{ending}", link, f"{x} 0 {height}", rpy))
    return "".join(parts)


def compare(theirs: Path, ours: Path) -> None:
    """Compare the dynamics and residuals of two robots at states that both close."""
    a, b = hybridyn.load(theirs), hybridyn.load(ours)
    assert a.mobility == b.mobility
    assert a.motors == b.motors
    q, v, acc = hybridyn.assemble(b, motors={"drive": (0.2, 0.7, 1.3)}, guess=b.home)
    assert np.allclose(hybridyn.closure_residual(a, q), hybridyn.closure_residual(b, q), atol=1e-12)
    tau = hybridyn.idm(b, q, v, acc)
    assert np.abs(hybridyn.idm(a, q, v, acc) - tau).max() < EQUAL * np.abs(tau).max()
    theirs_, ours_ = (hybridyn.ddm(r, q, v, np.array([1.5])) for r in (a, b))
    assert np.abs(theirs_ - ours_).max() < EQUAL * np.abs(ours_).max()
    off = q + np.array([0.1, 0, 0, 0, 0])
    assert min(hybridyn.closure_residual(a, off), hybridyn.closure_residual(b, off)) > 0.01


GAZEBO = """<gazebo><joint name="pin" type="{0}"><parent>coupler</parent><child>rocker</child>
  <pose>1 0 0 {1}</pose>{2}</joint></gazebo>"""
AXIS = "<axis><xyz>0 0 1</xyz></axis>"
IN_MODEL = '<axis><xyz expressed_in="{}">0 0 1</xyz></axis>'


def closed(*parts: str) -> str:
    """Return the four-bar bent so that its loop is closed where all joints are at zero."""
    elbow, swing = angles()
    text = robot(*parts)
    text = text.replace('<origin xyz="1 0 0"/><parent', f'<origin xyz="1 0 0" rpy="0 0 {elbow!r}"/><parent')
    return text.replace(
        '<origin xyz="1.5 0 0"/><parent', f'<origin xyz="1.5 0 0" rpy="0 0 {swing!r}"/><parent'
    )


def angles() -> tuple[float, float]:
    """Return the angles of elbow and swing that close the four-bar whose crank stands at 0.4 rad."""
    tip = np.array([np.cos(0.4), np.sin(0.4)])
    to = np.array([1.5, 0.0]) - tip
    d = float(np.linalg.norm(to))
    at_crank = np.arccos((1.5**2 + d**2 - 1) / (2 * 1.5 * d))
    coupler = float(np.arctan2(to[1], to[0]) + at_crank)
    end = tip + 1.5 * np.array([np.cos(coupler), np.sin(coupler)]) - [1.5, 0.0]
    return coupler - 0.4, float(np.arctan2(end[1], end[0]))


SUBMECHANISM = """submechanisms:
- contextual_name: arm
  type: NUMERICAL
  jointnames_active: [drive]
  jointnames_independent: [drive]
  jointnames_spanningtree: [drive, elbow, swing]
  loop_constraints:
  - cut_joint: elbow
    predecessor_body: tip
    successor_body: rocker
    constraint_axes:
"""
ROWS = {
    "tx": "[0., 0., 0., 1., 0., 0.]", "ty": "[0, 0, 0, 0, 1, 0]", "tz": "[0, 0, 0, 0, 0, 1]",
    "rx": "[1, 0, 0, 0, 0, 0]", "ry": "[0, -2, 0, 0, 0, 0]", "rz": "[0, 0, 1, 0, 0, 0]",
}  # fmt: skip
TIP = frame("tip", "coupler", "1.5 0 0")
ALONG = "    - axis: [0, 0, 0, 1, 0, 0]\n"


def submechanisms(cut: str, predecessor: str, successor: str, rows: str) -> str:
    """Return a file of hyrodyn, which locks some rows."""
    text = SUBMECHANISM.replace("cut_joint: elbow", f"cut_joint: {cut}")
    text = text.replace("body: tip", f"body: {predecessor}").replace("body: rocker", f"body: {successor}")
    return text + "".join(f"    - {{name: {row}, axis: {ROWS[row]}}}\n" for row in rows.split())


def rows_loop(rows: str) -> str:
    """Return a loop of rows from the tip to the pin of the four-bar that is closed."""
    elbow, swing = angles()
    return (
        f'<loop name="pin" type="rows" rows="{rows}"><predecessor link="tip"/>'
        f'<successor link="rocker"><origin xyz="1 0 0" rpy="0 0 {0.4 + elbow - swing!r}"/></successor></loop>'
    )


HINGED = mates("1", "2", "1_z@0.1", "2_z@0.1")
PIN = frame("pin", "rocker", "1 0 0")
TWO_FRAMES = closed(
    MOTOR, TIP, PIN,
    '<loop name="pin" type="rows" rows="tx ty"><predecessor link="tip"/><successor link="pin"/></loop>',
)  # fmt: skip
#: A robot in the words of another tool, and in ours.
SAME: dict[str, tuple[Texts, str]] = {
    # The witness points stand 0.1 m from the frames along the axis.
    "closing frames of a hinge": (
        robot(MOTOR, HINGED), robot(MOTOR, HINGED.replace("closing", "frame"), loop("revolute")),
    ),
    "closing frames of a ball": (
        robot(MOTOR, mates("1", "2")),
        robot(MOTOR, frame("x1", "coupler", "1 0 0"), frame("x2", "rocker", "1 0 0"), loop("spherical", "")),
    ),
    # SDF closes its loop where all joints are at zero, so the four-bar is bent to be closed there.
    **{
        f"a {kind} of Gazebo{turn}": (
            closed(MOTOR, GAZEBO.format(kind, turn, axis)), closed(MOTOR, ours),
        )
        for kind, turn, axis, ours in (
            ("revolute", "0 0 0", AXIS, loop("revolute")), ("ball", "0 0 0", "", loop("spherical", "")),
            ("continuous", "0.4 0.1 0", IN_MODEL.format("__model__"), loop("revolute")),
            ("revolute", "0.4 0 0", IN_MODEL.format("rocker"), loop("revolute")),
        )
    },
    # The constraint's frame is the predecessor's body, and stands at zero where the successor meets it.
    **{
        f"rows {rows} of hyrodyn": (
            {"r.urdf": closed(TIP), "submechanisms.yml": submechanisms("elbow", "tip", "rocker", rows)},
            closed(MOTOR, TIP, rows_loop(rows)),
        )
        for rows in ("tx ty", "tx ty tz rx ry")
    },
    # A body whose frame is not at the pin is the other one, predecessor or successor.
    **{
        f"a cut joint {cut}": (
            {"r.urdf": closed(TIP, PIN), "submechanisms.yml": submechanisms(cut, *bodies, "tx ty")},
            TWO_FRAMES,
        )
        for cut, bodies in (("pin_frame", ("coupler", "pin")), ("tip_frame", ("tip", "rocker")))
    },
}  # fmt: skip
SLOW = "a ball of Gazebo", "a continuous of Gazebo", "a revolute of Gazebo0.4", "rows tx ty tz"


@pytest.mark.parametrize("name", [slow(name) if name.startswith(SLOW) else name for name in SAME])
def test_the_same_loop_in_other_words(name: str, tmp_path: Path) -> None:
    theirs, ours = SAME[name]
    compare(save_all(tmp_path / "a", theirs), save(tmp_path / "b", ours))


def fastened(said: str) -> dict[str, str]:
    """Return the files of a robot with closing frames, of which model.toml says more."""
    return {"four_bar.urdf": robot(MOTOR, mates("1", "2")), "four_bar.model.toml": f"[closures]\n{said}\n"}


USED = loop("revolute").replace('"coupler"', '"closing_tip_1"').replace('"rocker"', '"closing_tip_2"')
ROTOR = (
    '<transmission name="t"><type>transmission_interface/SimpleTransmission</type><joint name="drive"/>'
    '<actuator name="m"><drake:rotor_inertia value="2e-4"/><drake:gear_ratio value="30"/></actuator>'
    "</transmission>"
)
FOLLOWER = (
    '<link name="wheel">' + INERTIAL + '</link><joint name="roll" type="continuous"><parent link="ground"/>'
    '<child link="wheel"/><axis xyz="0 1 0"/><{} joint="drive" multiplier="-3" offset="0.5"/></joint>'
)
SERIAL = (
    "submechanisms:\n- type: 3R\n  jointnames_active: [drive, elbow, swing]\n"
    "- type: 6DOF\n  jointnames_active: []\n  jointnames_spanningtree: [free_flyer]\n"
)
#: The text of a robot, or the texts of its files, and what is read.
READ: dict[str, tuple[Texts, dict[str, object]]] = {
    "closing frames without an axis": (robot(MOTOR, mates("1", "2")), {"notes": {"are read as balls"}}),
    # Only model.toml can say that frames are fastened.
    "closing frames that are fastened": (
        fastened('closing_tip = "fixed"'), {"closures": [{"rotation": "fixed", "translations": (0, 1, 2)}]},
    ),
    # Each mate counts, whatever else closes loops; frames that a loop uses do not count twice.
    "closing frames that a loop uses": (robot(mates("1", "2"), USED), {"closures": ["pin"]}),
    "closing frames beside another closure": (
        robot(mates("1", "2"), loop("revolute")), {"closures": ["pin", "closing_tip"]},
    ),
    **{
        f"{word} and rotor": (robot(ROTOR, FOLLOWER.format(word), loop("revolute")), {
            "couplings": [{"terms": (("roll", 1.0), ("drive", 3.0)), "offset": 0.5}],
            "joints": {"drive": {"rotor_inertia": 2e-4, "gear_ratio": 30.0}},
        })
        for word in ("drake:mimic", "mimic")
    },
    "serial submechanisms name the motors": (
        {"r.urdf": robot(TIP), "submechanisms.yml": SERIAL},
        {"motors": ("drive", "elbow", "swing"), "motors_from": "jointnames_active of submechanisms.yml"},
    ),
    "submechanisms beside a loop": (
        {"r.urdf": robot(MOTOR, loop("revolute")), "submechanisms.yml": SERIAL}, {"notes": {"was not read"}},
    ),
    "a weld of Gazebo": (
        robot(MOTOR, GAZEBO.format("fixed", "0 0 0", "")), {"closures": [{"rotation": "fixed"}]},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", READ)
def test_what_is_read(name: str, tmp_path: Path) -> None:
    texts, expected = READ[name]
    holds(read(save_all(tmp_path, texts)), expected)


def test_closing_frames_whose_axis_is_not_z(tmp_path: Path) -> None:
    turned = mates("1", "2", "1_z@0.1", "2_z@0.1", rpy="0.5 0.2 0")
    theirs = hybridyn.load(save(tmp_path, robot(MOTOR, turned)))
    (closure,) = theirs.description.closures
    bodies = [theirs.bodies.place[link][1] for link in (closure.link_a, closure.link_b)]
    for R, frame_ in zip(bodies, (closure.frame_a, closure.frame_b), strict=True):
        assert np.allclose(R @ frame_[:3, 2], [0, 0, 1])
    assert theirs.mobility == 1


def test_sdf_joint_whose_zero_is_its_closed_posture(tmp_path: Path) -> None:
    """Like Gazebo, the joint takes the zero posture as closed, wherever the tips are."""
    loaded = hybridyn.load(save(tmp_path, robot(MOTOR, GAZEBO.format("revolute", "0 0 0", AXIS))))
    assert float(hybridyn.closure_residual(loaded, loaded.home)) < 1e-14


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda text: text.replace("NUMERICAL", "3RUS2").split("  loop")[0],
            "submechanism 'arm' of type '3RUS2' has no loop_constraints",
        ),
        (lambda text: text.split("  loop")[0], "or <loop> or <mimic> in the URDF"),
        (
            lambda text: text.replace("predecessor_body: tip", "predecessor_body: tap") + ALONG,
            "no link is called 'tap'",
        ),
        (lambda text: text.replace("    predecessor_body: tip\n", ""), "'predecessor_body' is missing"),
        (lambda text: text.replace("[drive, elbow", "[drive, elbwo") + ALONG, "no joint is called 'elbwo'"),
        (
            lambda text: re.sub("predecessor_body: .*", "predecessor_body: [a]", text),
            "should be a valid string",
        ),
        (lambda text: text + "    - axis: [1, 0, 0, 0, 0, 0]\n", "a single rotation row"),
        (lambda text: text + "    - axis: [0, 0, 0, 1, 1, 0]\n", "one number that is not zero"),
        (lambda text: text + "    - axis: [0, 0, 0, 0, 0, 0]\n", "one number that is not zero"),
        (lambda text: text + "    - axis: [0, 0, 1]\n", "at least 6 items"),
        (
            lambda text: text + "    - axis: [0, 0, .nan, 0, 0, 0]\n",
            "axis.2': should be a finite number",
        ),
        (lambda text: text, "constraint_axes': should be a valid list"),
        *(
            (lambda text, new=new: text.replace(*new), "'NUMERICAL' has no loop_constraints")
            for new in (("loop_constraints", "lop_constraints"), ("tree: [drive, elbow, swing]\n  loop", ""))
        ),
        (lambda _: "submechanisms: []", "submechanisms': List should have at least 1 item"),
        (lambda _: "submechanisms: 3", "submechanisms': should be a valid list"),
        (lambda _: "submechanisms:\n- 3", "submechanisms.0': should hold keys with values, not a number"),
        (lambda _: "[1, 2]", "should hold keys with values, not a list"),
        (lambda _: "", "should hold keys with values, not nothing"),
        (
            lambda text: text.replace("[drive]\n  jointnames_i", "drive\n  jointnames_i") + ALONG,
            "jointnames_active': should be a valid list",
        ),
    ],
)
def test_wrong_submechanisms(tmp_path: Path, change: Callable[[str], str], message: str) -> None:
    files = {"four_bar.urdf": closed(TIP), "submechanisms.yml": change(SUBMECHANISM)}
    refused(save_all(tmp_path, files), "submechanisms.yml", message)


@pytest.mark.parametrize(
    ("said", "message"),
    [
        ('closing_tpi = "fixed"', "no such closure (did you mean 'closing_tip'"),
        ('closing_tip = "welded"', "closing_tip"),
    ],
)
def test_wrong_words_about_closing_frames(tmp_path: Path, said: str, message: str) -> None:
    refused(save_all(tmp_path, fastened(said)), message)


@pytest.mark.parametrize(
    ("element", "message"),
    [
        (mates("1", "2", "1_z@0.1"), "states the axis of closing_tip on one side only"),
        (mates("1", "2", "1_z@0.1", "2_z@0.2"), "cannot both coincide"),
        (mates("1", "2", "1_z", "2_z@0.1"), "coincide, so they state no axis"),
        (
            mates("1", "2", "2_z@0.1") + frame("closing_tip_1_z", "rocker", "1 0 0.1"),
            "stand on two bodies",
        ),
        *(
            (
                "".join(
                    f'<joint name="closing_tip_{end}" type="fixed"><parent link="coupler"/>'
                    f'<child link="none{end}"/></joint>'
                    for end in ends
                ),
                "unknown child link 'none1'",
            )
            for ends in (("1", "2"), ("1", "2", "3"))
        ),
        ('<link name="x"><drake:ball_constraint/></link>', "is not read inside <link>"),
        (GAZEBO.format("piston", "0 0 0", AXIS), "type 'piston' closes no loop"),
        (GAZEBO.format("revolute", "0 0 0", ""), "<axis> is missing"),
        (GAZEBO.format("revolute", "0 0 0", "<axis><xyz>0 0 0</xyz></axis>"), "the axis is zero"),
        (
            GAZEBO.format("universal", "0 0 0", AXIS + "<axis2><xyz>1 0 1</xyz></axis2>"),
            "the axes of a universal joint are perpendicular",
        ),
        (GAZEBO.format("revolute", "0 0", AXIS), "text has 5 numbers instead of 6"),
        (GAZEBO.format("revolute", "0 0 0", AXIS).replace(">rocker<", ">rokcer<"), "unknown link 'rokcer'"),
        (
            GAZEBO.format("revolute", "0 0 0", '<axis><xyz expressed_in="tool">0 0 1</xyz></axis>'),
            "unknown frame 'tool'",
        ),
        (
            GAZEBO.format(
                "revolute",
                "0 0 0",
                "<axis><xyz>0 0 1</xyz><use_parent_model_frame>no</use_parent_model_frame></axis>",
            ),
            "text 'no' instead of true or false",
        ),
        (
            GAZEBO.format("revolute", "0 0 0", AXIS).replace("<gazebo>", '<gazebo reference="rocker">'),
            "an SDF joint inside <gazebo>",
        ),
        (
            '<joint name="x" type="fixed"><parent link="ground"/><child link="y"/><mimic joint="drive"/>'
            '<drake:mimic joint="drive"/></joint>',
            "stated twice in <joint",
        ),
    ],
)
def test_is_refused_by_name(tmp_path: Path, element: str, message: str) -> None:
    assert refused(save(tmp_path, robot(element)), message).line is not None
