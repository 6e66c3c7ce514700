"""Packages are found by the name in their package.xml, as ROS does, whatever their folders are called."""

from pathlib import Path

import pytest

from hybridyn.description import read
from hybridyn.description.shape_files import MeshFiles
from hybridyn.errors import ModelError
from tests.description.reading import save_all
from tests.description.sdf_texts import link, sdf
from tests.support.comparing import refused

HEAD = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="r">'


def package(folder: str, name: str | None, content: str = "right") -> dict[str, str]:
    """Return the files of a package; its parts say whether they are those that are wanted."""
    stated = f"<package format='3'><!-- <name>commented</name> --><name> {name} </name></package>"
    return {
        f"{folder}/package.xml": "<package/>" if name is None else stated,
        f"{folder}/part.xacro": f'{HEAD}<link name="{content}"/></robot>',
        f"{folder}/part.sdf": sdf(link(content)),
        f"{folder}/meshes/{content}.stl": "",
    }


#: The files beside the robot, the folder of the robot in them, and folders that the user names.
FOUND = {
    "a clone of another name": (package("ws/arm-main", "arm"), "ws/other/urdf", []),
    "the robot's own package": (package("ws/arm-main", "arm"), "ws/arm-main/urdf", []),
    "among the user's folders": (package("ws/arm-main", "arm"), "robot", ["ws"]),
    "the user's folder": (package("ws/arm-main", "arm"), "robot", ["ws/arm-main"]),
    "beside a folder of its name": (
        package("ws/arm", "leg", "wrong") | package("ws/z", "arm"), "ws/other/urdf", [],
    ),
    "behind a folder of its name": (
        package("a/arm", "leg", "wrong") | package("b/z", "arm"), "robot", ["a", "b"],
    ),
    "no name is stated": (package("ws/arm", None), "robot", ["ws"]),
    "another name is stated, and no package states this one": (package("ws/arm", "leg"), "robot", ["ws"]),
}  # fmt: skip


@pytest.mark.parametrize("case", FOUND)
def test_a_package_is_found_by_its_name(case: str, tmp_path: Path) -> None:
    texts, folder, named = FOUND[case]
    save_all(tmp_path, texts)
    dirs = [tmp_path / place for place in named]
    robots = {
        "r.xacro": f'{HEAD}<xacro:include filename="$(find arm)/part.xacro"/></robot>',
        "r.sdf": '<sdf version="1.9"><world name="w"><include><uri>package://arm/part.sdf</uri></include></world></sdf>',
    }
    for name, text in robots.items():
        file = save_all(tmp_path / folder, {name: text})
        assert [one.name for one in read(file, package_dirs=dirs).links] == ["right"], name
    for strict in (False, True):
        find = MeshFiles(tmp_path / folder, dirs, named=strict)
        assert find("package://arm/meshes/right.stl").is_file()


def test_a_statement_that_cannot_be_read_states_nothing(tmp_path: Path) -> None:
    texts = package("ws/arm-main", "arm") | {"ws/arm-main/package.xml": "<package><name>arm</name>"}
    save_all(tmp_path, texts)
    file = save_all(
        tmp_path / "robot", {"r.xacro": f'{HEAD}<xacro:include filename="$(find arm)/part.xacro"/></robot>'}
    )
    refused(lambda: read(file, package_dirs=[tmp_path / "ws"]), ModelError, "package 'arm' is not found")
