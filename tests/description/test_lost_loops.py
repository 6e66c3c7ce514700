"""`load` and `info` report robots whose file lacks their loops or masses."""

import logging
import re
from pathlib import Path

import pytest

import hybridyn
from hybridyn.description import read
from hybridyn.description.loop_signs import lost_loops, weightless
from hybridyn.description.shipped import shipped_robots
from hybridyn.errors import ModelError
from hybridyn.loading import load, of_files
from tests.judges.remarks import findings
from tests.robots.robot_texts import INERTIAL, LOOP, robot, save
from tests.support.command_line import call
from tests.support.comparing import refused


def frame(name: str, link: str, xyz: str = "0 0 0") -> str:
    """Return a massless frame welded to a link."""
    return (
        f'<link name="{name}"/><joint name="{name}_weld" type="fixed"><origin xyz="{xyz}"/>'
        f'<parent link="{link}"/><child link="{name}"/></joint>'
    )


def effort(joint: str, value: float) -> str:
    """Return another joint that turns a heavy link, with an effort limit."""
    return (
        f'<link name="{joint}_body">{INERTIAL}</link><joint name="{joint}" type="revolute">'
        f'<parent link="ground"/><child link="{joint}_body"/><axis xyz="0 0 1"/>'
        f'<limit lower="-1" upper="1" velocity="1" effort="{value}"/></joint>'
    )


def driven(*names: str) -> str:
    return "".join(
        f'<transmission name="t_{n}"><joint name="{n}"/><actuator name="a_{n}"/></transmission>'
        for n in names
    )


def light(*parts: str) -> str:
    """Return a four-bar whose coupler states no mass."""
    whole = f'<link name="coupler">{INERTIAL}'
    return robot(LOOP, *parts, driven("drive")).replace(whole, '<link name="coupler">')


ALL = driven("drive", "elbow", "swing")
LOST = {
    "frames of a loop": (robot(frame("loop_joint_1", "coupler"), ALL), "'loop_joint_1' are named for"),
    "frames beside a loop": (
        robot(LOOP, frame("closedloop1_A", "coupler"), driven("drive")),
        "'closedloop1_A' are named for",
    ),
    **{
        f"a pair of {one}": (
            robot(frame(one, "coupler"), frame(other, "rocker"), ALL),
            f"'{one}', '{other}' are named for",
        )
        for one, other in (("cut_1", "cut_2"), ("left_weld_a", "left_weld_b"), ("constraint0", "constraint1"))
    },
    "lone closing frame": (robot(frame("closing_knee", "coupler"), ALL), "'closing_knee'"),
    "efforts of zero": (robot(effort("free", 0)), "'free'"),
    "no effort at all": (
        robot().replace('effort="10"', 'effort="0"'),
        "none of its 3 joints states an effort",
    ),
    "left passive": (robot(driven("drive")), "leaves these passive: 'elbow', 'swing'"),
    # the coupler of a four-bar; a frame that is welded to a link may have no mass
    "lost mass": (light(frame("tag", "rocker")), "link 'coupler' moves and has no mass"),
}


@pytest.mark.parametrize("case", LOST)
def test_a_robot_that_lost_loops_or_mass_is_told(
    case: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    text, part = LOST[case]
    path = save(tmp_path, text)
    with caplog.at_level(logging.WARNING, logger="hybridyn"):
        loaded = load(path)
    told = [record.getMessage() for record in caplog.records]
    (said,) = [text for text in told if "open at home" not in text]
    assert part in said
    code, words = ("missing-inertial", "link 'coupler'") if "mass" in case else ("lost-loops", part)
    assert "mass" in case or "loop" in said
    assert any(words in remark for remark in findings(loaded))
    (found,) = [finding for finding in hybridyn.check(path) if finding.code == code]
    assert words in f"{found.element} {found.message}"


def belt(predecessor: str, successor: str) -> str:
    """Return a coupling: `drive` with `swing`, or both `drive` and `elbow` with `swing`."""
    return (
        f'<coupling name="belt_{predecessor}"><predecessor link="{predecessor}"/>'
        f'<successor link="{successor}"/><ratio value="-2"/></coupling>'
    )


def mimic(follower: str, leader: str) -> tuple[str, str]:
    joint = f'<joint name="{follower}" type="continuous">'
    return joint, joint + f'<mimic joint="{leader}" multiplier="-2"/>'


#: Couplings in every form, the text that is replaced, the driven joints, and the joints that move freely.
COUPLED = {
    "a mimic": ((), mimic("swing", "drive"), "", ["drive"], ["elbow"]),
    "a belt": ((belt("crank", "rocker"),), ("", ""), "", ["drive"], ["elbow"]),
    "a belt whose other end is driven": ((belt("crank", "rocker"),), ("", ""), "", ["swing"], ["elbow"]),
    "a belt of which no end is driven": (
        (belt("crank", "rocker"),), ("", ""), "", ["elbow"], ["drive", "swing"],
    ),
    "a differential": ((belt("coupler", "rocker"),), ("", ""), "", ["drive"], ["elbow", "swing"]),
    "a differential with two motors": ((belt("coupler", "rocker"),), ("", ""), "", ["drive", "swing"], []),
    "a differential and a belt": (
        (belt("crank", "rocker"), belt("coupler", "rocker")), ("", ""), "", ["drive"], [],
    ),
    "a coupling of the model file": (
        (), ("", ""), "[couplings.belt]\nterms = {swing = 1, drive = -2}\n", ["drive"], ["elbow"],
    ),
    "no coupling": ((), ("", ""), "", ["drive"], ["elbow", "swing"]),
}  # fmt: skip


@pytest.mark.parametrize("case", COUPLED)
def test_a_coupling_is_one_in_every_form(case: str, tmp_path: Path) -> None:
    parts, replaced, model, motors, free = COUPLED[case]
    path = save(tmp_path, robot(*parts, driven(*motors)).replace(*replaced))
    save(tmp_path, model, f"{path.stem}.model.toml")
    said = " ".join(of_files(read(path)))
    assert all(f"'{name}'" in said for name in free), said
    assert not any(f"'{name}'" in said for name in ("drive", "elbow", "swing") if name not in free), said
    chains = [one for one in hybridyn.check(path) if "ends a chain" in one.message]
    assert chains == []


@pytest.mark.parametrize("name", ["robot_submechanisms.yml", "submechanisms/knee.submechanism.yaml"])
def test_a_file_of_loops_beside_is_told(name: str, tmp_path: Path) -> None:
    path = save(tmp_path / "urdf", robot(ALL))
    assert of_files(load(path).description) == []
    save(tmp_path / "urdf", "submechanisms: []", name)
    (said,) = of_files(load(path).description)
    assert Path(name).name in said
    save(tmp_path / "urdf", robot(LOOP, ALL))
    assert lost_loops(load(path, motors=["drive"]).description) == []


SDF_LINK = '<link name="{}"><inertial><mass>1</mass></inertial></link>'
SDF_JOINT = (
    '<joint name="{0}_joint" type="revolute"><parent>{1}</parent><child>{0}</child>'
    "<axis><xyz>0 1 0</xyz><limit><lower>-1</lower><upper>1</upper><effort>{2}</effort></limit></axis>"
    "</joint>"
)


def sdf_tree(*joints: tuple[str, str, float], coupled: str = "") -> str:
    """Return an SDF tree of links under joints with effort limits, from (child, parent, effort).

    Args:
        joints: The joints.
        coupled: The child of a joint that all others mimic; none states an effort then.
    """
    world = '<joint name="w" type="fixed"><parent>world</parent><child>base</child></joint>'
    parts = "".join(SDF_LINK.format(joint[0]) + SDF_JOINT.format(*joint) for joint in joints)
    if coupled:
        mimic = f'</xyz><mimic joint="{coupled}_joint"><multiplier>-1</multiplier></mimic>'
        parts = re.sub("<limit>.*?</limit>", "", parts.replace("</xyz>", mimic)).replace(mimic, "</xyz>", 1)
    return f'<sdf version="1.9"><model name="m">{SDF_LINK.format("base")}{world}{parts}</model></sdf>'


QUIET = {
    "a tree": robot(ALL),
    "motors named": robot(effort("free", 0), driven("drive", "elbow", "swing", "free")),
    "one frame for welding": robot(frame("weld_1", "coupler"), frame("weldment_2", "rocker"), ALL),
    "cameras": robot(frame("camera_1", "coupler", "0 0.1 0"), frame("camera_2", "rocker"), ALL),
    "a box that encloses": robot(frame("enclosing_box", "rocker"), ALL),
    "at a joint": robot(frame("pin_1", "crank", "1 0 0"), frame("pin_2", "coupler"), ALL),
    "a frame with mass": light(
        frame("weight", "coupler").replace('name="weight"/>', f'name="weight">{INERTIAL}</link>', 1)
    ),
    # In URDF the name of a closing frame without a closure is an error; SDF states loops as joints.
    "chains that a coupling moves together": sdf_tree(
        ("left", "base", 0.0), ("right", "base", 0.0), ("bar", "left", 0.0), coupled="left"
    ),
    "a name in SDF": sdf_tree(("closed_loop_controller_box", "base", 50.0)),
}


@pytest.mark.parametrize("case", QUIET)
def test_a_robot_without_lost_loops_is_not(case: str, tmp_path: Path) -> None:
    text = QUIET[case]
    loaded = load(save(tmp_path, text, "m.sdf" if text.startswith("<sdf") else "m.urdf"))
    assert (of_files(loaded.description), weightless(loaded.description)) == ([], [])


@pytest.mark.parametrize("name", shipped_robots())
def test_shipped_robots_lost_nothing(name: str) -> None:
    assert of_files(read(shipped_robots()[name].file)) == []


def test_a_robot_without_any_mass_is_an_error(tmp_path: Path) -> None:
    path = save(tmp_path, robot(ALL).replace(INERTIAL, ""))
    (said,) = of_files(load(path).description)
    assert "no link has mass" in said
    assert [f.severity for f in hybridyn.check(path) if f.code == "massless-robot"] == ["error"]


def test_a_passive_chain_is_a_sign_in_every_format(tmp_path: Path) -> None:
    """The mend is written in the words of the format."""
    legs = [("thigh", "base", 50.0), ("shin", "thigh", 50.0), ("rod", "base", 0.0), ("end", "rod", 0.0)]
    (said,) = of_files(load(save(tmp_path, sdf_tree(*legs), "m.sdf")).description)
    assert "2 of its 4 joints state effort 0" in said
    assert "as joints: a link may be the child of several" in said


def test_strict_makes_notes_errors(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What was read past, and signs of lost loops; each is named."""
    path = save(tmp_path, robot("<custom_tag/>", frame("closing_knee", "coupler"), ALL))
    assert load(path).motors
    call(capsys, "info", path)
    words = "2 notes", "<custom_tag>", "'closing_knee'", path.name
    call(capsys, "info", path, "--strict", status=1, says=words)
    refused(lambda: load(path, strict=True), ModelError, ".*".join(words[:3]))
    assert load(save(tmp_path, robot(LOOP, driven("drive"))), strict=True).mobility == 1


def test_convert_and_info_are_strict(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = save(tmp_path, robot("<custom_tag/>", ALL)), tmp_path / "out.xml"
    call(capsys, "convert", path, "-o", out, "--strict", status=1)
    assert not out.exists()
    call(capsys, "info", path)
    call(capsys, "info", path, "--strict", status=1)
