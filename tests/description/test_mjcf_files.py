"""Where the files of an MJCF robot are found, and bodies that MuJoCo multiplies: as MuJoCo does it."""

import itertools
from pathlib import Path

import pytest

from hybridyn.description import read
from hybridyn.errors import ModelError
from tests.description.reading import refused
from tests.support.extras import needs

mujoco = needs("mjcf")

TETRAHEDRON = "v 0 0 0\nv {} 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
WORLD = '<worldbody><body name="a"><joint/><geom type="mesh" mesh="part"/></body></worldbody>'
ASSET = '<asset><mesh name="part" file="part.obj"/></asset>'
#: Where the mesh may be. Each file has another volume.
PLACES = ("part.obj", "d/part.obj", "s/part.obj", "s/d/part.obj")


def write(folder: Path, place: str, word: str, include: str, meshes: tuple[str, ...]) -> Path:
    """Write a robot whose included file names a mesh, with a folder of meshes in one of both files."""
    compiler = f'<compiler {word}="d"/>' if word else ""
    main, part = (compiler, "") if place == "main" else ("", compiler)
    files = {
        "robot.xml": f'<mujoco>{main}<include file="{include}"/>{WORLD}</mujoco>',
        include: f"<mujocoinclude>{part}{ASSET}</mujocoinclude>",
        **{mesh: TETRAHEDRON.format(1 + PLACES.index(mesh)) for mesh in meshes},
    }
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder / "robot.xml"


@pytest.mark.parametrize("include", ["p.xml", "s/p.xml"])
@pytest.mark.parametrize(
    ("place", "word"), [("main", ""), *itertools.product(("main", "part"), ("meshdir", "assetdir"))]
)
def test_meshes_are_found_where_mujoco_finds_them(
    place: str, word: str, include: str, tmp_path: Path
) -> None:
    """With one file and with two, of which one counts."""
    for number, meshes in enumerate([*((mesh,) for mesh in PLACES), *itertools.combinations(PLACES, 2)]):
        file = write(tmp_path / str(number), place, word, include, meshes)
        try:
            theirs = float(mujoco.MjModel.from_xml_path(str(file)).body_mass[1])
        except ValueError:
            with pytest.raises(ModelError, match="cannot be read"):
                read(file)
        else:
            (mass,) = (link.mass for link in read(file).links if link.name == "a")
            assert abs(mass - theirs) < 1e-12 * theirs, meshes


def test_an_include_outside_says_how_to_allow_it(tmp_path: Path) -> None:
    (tmp_path / "robot").mkdir()
    (tmp_path / "parts").mkdir()
    file = tmp_path / "robot" / "robot.xml"
    file.write_text(f'<mujoco><include file="../parts/p.xml"/>{WORLD}</mujoco>')
    (tmp_path / "parts" / "p.xml").write_text(f"<mujocoinclude>{ASSET}</mujocoinclude>")
    (tmp_path / "parts" / "part.obj").write_text(TETRAHEDRON.format(1))
    refused(file, "is outside the robot's folders; name the folder that holds it with package_dirs")
    assert read(file, package_dirs=[tmp_path / "parts"]).links[-1].mass > 0


CABLE = """<mujoco><worldbody><body name="a" pos="0 0 1"><joint name="j" axis="0 1 0"/><geom size=".1"/>
<composite prefix="c_" type="cable" curve="s" count="{} 1 1" size="1" initial="none" offset=".1 0 0">
<joint kind="main" damping=".1"/><geom type="capsule" size=".01" density="1000"/></composite></body>
</worldbody></mujoco>"""


def test_composites_are_bodies_where_mujoco_has_them(tmp_path: Path) -> None:
    file = tmp_path / "robot.xml"
    file.write_text(CABLE.format(6))
    if mujoco.mj_version() >= 400:
        refused(
            file, "unrecognized element <composite>, which MuJoCo 4 does not have any more; take MuJoCo 3"
        )
        return
    names = [link.name for link in read(file).links]
    assert names == ["world", "a", "c_B_first", "c_B_1", "c_B_2", "c_B_3", "c_B_last"]


def test_composites_count_their_bodies(tmp_path: Path) -> None:
    file = tmp_path / "robot.xml"
    file.write_text(CABLE.format("1e6"))
    refused(file, "MuJoCo")
    file.write_text(CABLE.format("1000000"))
    refused(file, "more than 50,000 elements")


def test_replicas_are_bodies(tmp_path: Path) -> None:
    file = tmp_path / "robot.xml"
    file.write_text(
        '<mujoco><worldbody><body name="a"><joint name="j"/><geom size=".1"/><replicate count="3" '
        'offset=".2 0 0" sep="-"><body name="f" pos=".3 0 0"><joint name="k"/><geom size=".05"/></body>'
        "</replicate></body>"
        "</worldbody></mujoco>"
    )
    assert [joint.name for joint in read(file).joints] == ["j", "k-0", "k-1", "k-2"]
