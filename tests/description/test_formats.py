"""The table of formats: what each reader reads past with a note, and what it refuses.

A row is a format, what is put into a robot of this format, the outcome, and the words for it. The page
`docs/formats.md` says the same.

Meshes are not opened for dynamics: neither a missing nor a huge one keeps a robot from loading.
"""

import os
import re
from collections.abc import Sequence
from pathlib import Path

import pytest

import hybridyn
from hybridyn.description import read
from hybridyn.description.notes import place_of
from tests import ROOT
from tests.conversion.judge import needs_reader
from tests.description.reading import refused
from tests.robots.mjcf_texts import BAR, mjcf
from tests.robots.robot_texts import robot
from tests.support.extras import needs
from tests.support.files import save

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


def mjcf_robot(section: str = "", part: str = "") -> str:
    return mjcf(section, world=HINGE.format(part))


def sdf_robot(part: str = "", kind: str = "revolute") -> str:
    return SDF.format(SDF_ARM.format(part, kind))


#: A robot of each format without anything special.
PLAIN = {"r.urdf": robot(TRANSMISSIONS), "r.xml": mjcf_robot(), "r.sdf": sdf_robot()}
#: File, text, outcome and words. An outcome is a note, a refusal or nothing.
TABLE = [
    ("r.urdf", robot(TRANSMISSIONS, "<!-- a -- b -->"), "note", "'--' in a comment"),
    ("r.urdf", robot(TRANSMISSIONS, "<material><my:thing/></material>"), "note", "a prefix without xmlns"),
    ("r.urdf", robot(TRANSMISSIONS, "<custom_tag/>"), "note", "unknown elements"),
    ("r.urdf", robot(TRANSMISSIONS, '<loop_constraint name="x"/>'), "refused", "an early form"),
    ("r.urdf", robot(TRANSMISSIONS, '<lnik name="x"/>'), "refused", "did you mean <link>"),
    ("r.urdf", "<!DOCTYPE a>" + robot(TRANSMISSIONS), "refused", "DOCTYPE"),
    ("r.xml", mjcf_robot("<option density='1'/>"), "note", "forces of a fluid"),
    ("r.xml", mjcf_robot("<actuator><motor site='s'/></actuator>"), "note", "no motors here"),
    ("r.xml", mjcf_robot("<sensor><jointpos joint='j'/></sensor>"), "nothing", ""),
    ("r.xml", mjcf_robot("", '<plugin plugin="mujoco.elasticity.cable"/>'), "refused", "a plugin"),
    ("r.sdf", sdf_robot("<unknown_thing/>"), "note", "unknown_thing"),
    ("r.sdf", sdf_robot(), "nothing", ""),
    ("r.sdf", sdf_robot("", "gearbox"), "refused", "gearbox"),
    ("r.sdf", sdf_robot("<inertail/>"), "refused", "inertail"),
]


def texts(notes: Sequence[str]) -> list[str]:
    """Return notes without their places, which each has."""
    places = [place_of(note) for note in notes]
    assert all(file and Path(file).name in PLAIN for file, _, _ in places)
    return [text for _, _, text in places]


@pytest.mark.parametrize(("name", "text", "outcome", "words"), TABLE)
def test_what_a_reader_does_with_it(name: str, text: str, outcome: str, words: str, tmp_path: Path) -> None:
    """A note is an error where reading is strict; without notes, strict reading is the same."""
    file = save(tmp_path, text, name)
    needs_reader(file)
    if outcome == "refused":
        refused(file, words)
        return
    plain = texts(read(save(tmp_path / "plain", PLAIN[name], name)).notes)
    notes = [note for note in texts(read(file).notes) if note not in plain]
    assert [words in note for note in notes] == [True] * (outcome == "note")
    if outcome == "note":
        with pytest.raises(hybridyn.ModelError, match="strict"):
            hybridyn.load(file, strict=True)


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


def test_the_page_says_of_each_format_what_is_read_noted_refused_and_lost() -> None:
    page = (ROOT / "docs" / "formats.md").read_text()
    tables = re.findall(r"(?:^\|.*\n)+", page, re.MULTILINE)
    read, *_, lost = (re.findall(r"^\| .*$", table, re.MULTILINE) for table in tables)
    assert [re.sub(r"\]\(.*", "", cell).strip(" [") for cell in read[0].split("|")[2:-1]] == [
        "URDF, xacro", "MJCF", "SDF", "USD"
    ]  # fmt: skip
    names = {row.split("|")[1].strip() for row in read}
    assert {"to install", "loops", "motors", "home", "base", "units", "noted", "refused"} <= names
    assert lost[0] == "| lost | MJCF | SDF | USD |"


#: Size of a mesh file that no test could read [bytes]; the file has no content on the disk.
HUGE = 2**42

OF_ARM = '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>'
MESHES = {
    "r.urdf": '<robot name="r"><link name="base"/><link name="arm"><inertial><mass value="2"/>' + OF_ARM
    + '</inertial><visual><geometry><mesh filename="part.stl"/></geometry></visual><collision><geometry>'
    '<mesh filename="package://none/other.dae"/></geometry></collision></link><joint name="j" '
    'type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/></joint></robot>',
    "r.sdf": '<sdf version="1.9"><model name="r"><link name="base"/><link name="arm"><inertial><mass>2</mass>'
    "</inertial><visual name='v'><geometry><mesh><uri>part.stl</uri></mesh></geometry></visual><collision "
    "name='c'><geometry><mesh><uri>model://none/other.dae</uri></mesh></geometry></collision></link>"
    '<joint name="hold" type="fixed"><parent>world</parent><child>base</child></joint><joint name="j" '
    'type="revolute"><parent>base</parent><child>arm</child><axis><xyz>0 1 0</xyz></axis></joint></model>'
    '</sdf>',
    "r.xml": '<mujoco><asset><mesh name="part" file="part.stl"/><mesh name="other" file="other.obj"/></asset>'
    '<worldbody><body name="arm"><joint name="j" axis="0 1 0"/><inertial pos="0 0 0" mass="2" '
    'diaginertia=".1 .1 .1"/><geom type="mesh" mesh="part"/><geom type="mesh" mesh="other"/></body>'
    "</worldbody></mujoco>",
}  # fmt: skip


@pytest.mark.parametrize("name", MESHES)
def test_meshes_are_not_opened(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if name == "r.xml":
        needs("mjcf")
    file, mesh = tmp_path / name, tmp_path / "part.stl"
    file.write_text(MESHES[name])
    mesh.touch()
    os.truncate(mesh, HUGE)
    description = read(file)
    assert [link.mass for link in description.links if link.name == "arm"] == [2]
    done = hybridyn.convert(file, tmp_path / "out.urdf")
    assert read(done.files[0]).joints[-1].name == "j"
    assert name == "r.urdf" or any(line.startswith("visual shapes") for line in done.losses)
