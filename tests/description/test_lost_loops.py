"""`load`, `info` and `check` report robots whose file lacks their loops or masses."""

import logging
from pathlib import Path

import pytest

import hybridyn
from hybridyn.cli import main
from hybridyn.description import read
from hybridyn.description.lost_loops import lost_loops
from hybridyn.description.shipped import shipped_robots
from hybridyn.description.weightless import weightless
from hybridyn.errors import ModelError
from hybridyn.loading import load, of_files
from hybridyn.studies.check.remarks import findings
from tests.robot_texts import INERTIAL, LOOP, robot, save


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
    "named pair": (robot(frame("l1_cl1_1", "coupler"), frame("l1_cl1_2", "rocker"), ALL), "'l1_cl1_1' and"),
    "lone closing frame": (robot(frame("closing_knee", "coupler"), ALL), "'closing_knee'"),
    "one place": (
        # In the zero posture the coupler's end is at 2.5 m along the crank, turned by 0.4 rad.
        robot(
            frame("pin_1", "coupler", "1.5 0 0"),
            frame("pin_2", "rocker", f"{2.5 * 0.9210609940028851 - 1.5} {2.5 * 0.3894183423086505} 0"),
            ALL,
        ),
        "coincide in the zero posture",
    ),
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
    (said,) = [record.getMessage() for record in caplog.records]
    assert part in said
    code, words = ("missing-inertial", "link 'coupler'") if "mass" in case else ("lost-loops", part)
    assert "mass" in case or "loop" in said
    assert any(words in remark for remark in findings(loaded))
    (found,) = [finding for finding in hybridyn.check(path) if finding.code == code]
    assert words in f"{found.element} {found.message}"


@pytest.mark.parametrize("name", ["robot_submechanisms.yml", "submechanisms/knee.submechanism.yaml"])
def test_a_file_of_loops_beside_is_told(name: str, tmp_path: Path) -> None:
    path = save(tmp_path / "urdf", robot(ALL))
    assert of_files(load(path).description) == []
    save(tmp_path / "urdf", "submechanisms: []", name)
    (said,) = of_files(load(path).description)
    assert Path(name).name in said
    save(tmp_path / "urdf", robot(LOOP, ALL))
    assert lost_loops(load(path, motors=["drive"]).description) == []


QUIET = {
    "a tree": robot(ALL),
    "motors named": robot(effort("free", 0), driven("drive", "elbow", "swing", "free")),
    "cameras": robot(frame("camera_1", "coupler", "0 0.1 0"), frame("camera_2", "rocker"), ALL),
    "four feet": robot(*(frame(f"cl_{i}", "rocker" if i % 2 else "coupler") for i in range(1, 5)), ALL),
    "one body": robot(frame("loop_1", "rocker"), frame("loop_2", "rocker", "1 0 0"), ALL),
    "at a joint": robot(frame("pin_1", "crank", "1 0 0"), frame("pin_2", "coupler"), ALL),
}


@pytest.mark.parametrize("case", QUIET)
def test_a_robot_without_lost_loops_is_not(case: str, tmp_path: Path) -> None:
    assert of_files(load(save(tmp_path, QUIET[case])).description) == []


@pytest.mark.parametrize("name", shipped_robots())
def test_shipped_robots_lost_nothing(name: str) -> None:
    assert of_files(read(shipped_robots()[name].file)) == []


def test_mass_welded_to_a_link_is_its_own(tmp_path: Path) -> None:
    welded = frame("weight", "coupler").replace('name="weight"/>', f'name="weight">{INERTIAL}</link>', 1)
    assert weightless(load(save(tmp_path, light(welded))).description) == []


def test_a_robot_without_any_mass_is_an_error(tmp_path: Path) -> None:
    path = save(tmp_path, robot(ALL).replace(INERTIAL, ""))
    (said,) = of_files(load(path).description)
    assert "no link has mass" in said
    assert [f.severity for f in hybridyn.check(path) if f.code == "massless-robot"] == ["error"]


SDF_LINK = '<link name="{}"><inertial><mass>1</mass></inertial></link>'
SDF_JOINT = (
    '<joint name="{0}_joint" type="revolute"><parent>{1}</parent><child>{0}</child>'
    "<axis><xyz>0 1 0</xyz><limit><lower>-1</lower><upper>1</upper><effort>{2}</effort></limit></axis>"
    "</joint>"
)


def sdf_tree(*joints: tuple[str, str, float]) -> str:
    """Return an SDF tree of links under joints with effort limits, from (child, parent, effort)."""
    world = '<joint name="w" type="fixed"><parent>world</parent><child>base</child></joint>'
    parts = "".join(SDF_LINK.format(joint[0]) + SDF_JOINT.format(*joint) for joint in joints)
    return f'<sdf version="1.9"><model name="m">{SDF_LINK.format("base")}{world}{parts}</model></sdf>'


def test_a_passive_chain_is_a_sign_in_every_format(tmp_path: Path) -> None:
    """The mend is written in the words of the format."""
    legs = [("thigh", "base", 50.0), ("shin", "thigh", 50.0), ("rod", "base", 0.0), ("end", "rod", 0.0)]
    (said,) = of_files(load(save(tmp_path, sdf_tree(*legs), "m.sdf")).description)
    assert "2 of its 4 joints state effort 0" in said
    assert "as joints: a link may be the child of several" in said


def test_a_name_is_no_sign_in_a_format_that_states_its_loops(tmp_path: Path) -> None:
    """In URDF the name of a closing frame without a closure is an error; SDF states loops as joints."""
    name = "closed_loop_controller_box"
    loaded = load(save(tmp_path, sdf_tree((name, "base", 50.0)), "m.sdf"))
    assert loaded.motors == (f"{name}_joint",)
    assert of_files(loaded.description) == []


@pytest.mark.parametrize("words", [[], ["--strict"]])
def test_strict_makes_notes_errors(
    tmp_path: Path, words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    """What was read past, and signs of lost loops; each is named."""
    unknown = "<custom_tag/>"
    path = save(tmp_path, robot(unknown, frame("closing_knee", "coupler"), ALL))
    assert load(path).motors
    status = main(["info", str(path), *words])
    if not words:
        assert status == 0
        return
    said = capsys.readouterr().err
    assert status == 1
    with pytest.raises(ModelError) as error:
        load(path, strict=True)
    for part in ("2 notes", "<custom_tag>", "'closing_knee'", path.name):
        assert part in str(error.value)
        assert part in said
    assert load(save(tmp_path, robot(LOOP, driven("drive"))), strict=True).mobility == 1


def test_convert_and_check_are_strict(tmp_path: Path) -> None:
    path, out = save(tmp_path, robot("<custom_tag/>", ALL)), str(tmp_path / "out.xml")
    assert main(["convert", str(path), "-o", out, "--strict"]) == 1
    assert not Path(out).exists()
    assert [main(["check", str(path), *words]) for words in ([], ["--strict"])] == [0, 1]
