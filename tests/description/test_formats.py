"""The table of formats: what each reader reads past with a note, and what it refuses.

A row is a format, what is put into a robot of this format, the outcome, and the words for it. The page
`docs/formats.md` says the same.
"""

from pathlib import Path

import pytest

import hybridyn
from hybridyn.description import read
from tests import ROOT
from tests.description.reading import refused
from tests.extras import needs
from tests.files import save
from tests.mjcf_texts import BAR, mjcf
from tests.robot_texts import robot

TRANSMISSIONS = "".join(
    f'<transmission name="t_{name}"><joint name="{name}"/></transmission>'
    for name in ("drive", "elbow", "swing")
)
INERTIAL = "<inertial><mass>1</mass><inertia><ixx>1</ixx></inertia></inertial>"
SDF = (
    f'<sdf version="1.9"><model name="m"><link name="base">{INERTIAL}</link>'
    '<joint name="w" type="fixed"><parent>world</parent><child>base</child></joint>{}</model></sdf>'
)
SDF_ARM = (
    f'<link name="arm">{INERTIAL}{{}}</link><joint name="j" type="{{}}"><parent>base</parent>'
    "<child>arm</child><axis><xyz>0 1 0</xyz></axis></joint>"
)
HINGE = f'<body name="a"><joint name="j"/>{BAR.format(x=0.1, m=1)}<site name="s"/>{{}}</body>'
#: Format, what is special, outcome and words. An outcome is a note, a refusal or nothing.
TABLE = [
    ("urdf", "<!-- a -- b -->", "note", "'--' in a comment"),
    ("urdf", "<gazebo><my:thing/></gazebo>", "note", "a prefix without xmlns"),
    ("urdf", "<custom_tag/>", "note", "unknown elements"),
    ("urdf", '<loop_constraint name="x"/>', "refused", "an early form"),
    ("urdf", '<lnik name="x"/>', "refused", "did you mean <link>"),
    ("urdf", "<!DOCTYPE a>", "refused", "DOCTYPE"),
    ("mjcf", ("<option density='1'/>", ""), "note", "forces of a fluid"),
    ("mjcf", ("<actuator><motor site='s'/></actuator>", ""), "note", "no motors here"),
    ("mjcf", ("<sensor><jointpos joint='j'/></sensor>", ""), "nothing", ""),
    ("mjcf", ("", '<plugin plugin="mujoco.elasticity.cable"/>'), "refused", "a plugin"),
    ("sdf", ("<unknown_thing/>", "revolute"), "note", "unknown_thing"),
    ("sdf", ("", "revolute"), "nothing", ""),
    ("sdf", ("", "gearbox"), "refused", "gearbox"),
    ("sdf", ("<inertail/>", "revolute"), "refused", "inertail"),
]


def written(folder: Path, kind: str, special: object) -> Path:
    """Write a robot of a format with what is special in it."""
    if kind == "urdf":
        text = robot(TRANSMISSIONS, str(special))
        return save(folder, f"{special}{text}" if "DOCTYPE" in str(special) else text)
    assert isinstance(special, tuple)
    if kind == "mjcf":
        needs("mjcf")
        return save(folder, mjcf(special[0], world=HINGE.format(special[1])), "robot.xml")
    return save(folder, SDF.format(SDF_ARM.format(*special)), "robot.sdf")


@pytest.mark.parametrize(("kind", "special", "outcome", "words"), TABLE)
def test_what_a_reader_does_with_it(
    kind: str, special: object, outcome: str, words: str, tmp_path: Path
) -> None:
    """A note is an error where reading is strict; without notes, strict reading is the same."""
    file = written(tmp_path, kind, special)
    if outcome == "refused":
        refused(file, words)
        return
    plain = read(written(tmp_path / "plain", kind, PLAIN[kind])).notes
    notes = [note for note in read(file).notes if note not in plain]
    assert [words in note for note in notes] == [True] * (outcome == "note")
    if outcome == "note":
        with pytest.raises(hybridyn.ModelError, match="strict"):
            hybridyn.load(file, strict=True)


PLAIN = {"urdf": "", "mjcf": ("", ""), "sdf": ("", "revolute")}
SHAPES = {
    "missing": '<mesh filename="nowhere.stl"/>',
    "scale": '<mesh filename="nowhere.stl" scale="a b"/>',
    "package": '<mesh filename="package://nowhere/a.stl"/>',
    "unknown": '<torus r="1"/>',
    "empty": "",
    "numbers": '<box size="1 2"/>',
    "two": '<box size="1 1 1"/><sphere radius="1"/>',
}


@pytest.mark.parametrize("tag", ["visual", "collision"])
@pytest.mark.parametrize("shape", SHAPES)
def test_a_shape_that_cannot_be_read_changes_nothing(shape: str, tag: str, tmp_path: Path) -> None:
    bad = f'<{tag}><origin xyz="0 0"/><geometry>{SHAPES[shape]}</geometry><material name=""/></{tag}>'
    plain = robot(TRANSMISSIONS)
    text = plain.replace('<link name="crank">', f'<link name="crank">{bad}', 1)
    assert text != plain
    with_shape = hybridyn.load(save(tmp_path, text), strict=True)
    without = hybridyn.load(save(tmp_path / "plain", plain))
    q, rest = with_shape.home, [0.0] * with_shape.nv
    assert (hybridyn.idm(with_shape, q, rest, rest) == hybridyn.idm(without, q, rest, rest)).all()


def test_the_page_has_a_row_for_each_format() -> None:
    page = (ROOT / "docs" / "formats.md").read_text()
    for word in ("URDF, xacro", "[MJCF]", "[SDF]", "[USD]", "[Pinocchio]"):
        assert f"| {word}" in page
