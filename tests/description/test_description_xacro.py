"""xacro.py: macros, arguments and packages work; harmful files raise an error."""

from pathlib import Path

import pytest

from hybridyn.description import read
from tests.description.reading import refused
from tests.robot_texts import FOUR_BAR, LOOP, TREE, save

HEAD = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'


def file(folder: Path, body: str, name: str = "robot.urdf.xacro") -> Path:
    """Write a xacro file."""
    return save(folder, f"{HEAD}{body}</robot>", name)


def xacro(folder: Path, body: str, name: str = "robot.urdf.xacro", **options: object) -> list[str]:
    """Read a xacro file and return the names of its links."""
    return [link.name for link in read(file(folder, body, name), **options).links]  # type: ignore[arg-type]


def test_macros_arguments_and_includes(tmp_path: Path) -> None:
    save(
        tmp_path / "parts",
        f'{HEAD}<xacro:macro name="bar" params="name"><link name="${{name}}_bar"/></xacro:macro></robot>',
        "bar.xacro",
    )
    body = (
        '<xacro:arg name="prefix" default="left"/><xacro:include filename="parts/bar.xacro"/>'
        '<xacro:bar name="$(arg prefix)"/>'
    )
    assert xacro(tmp_path, body) == ["left_bar"]
    assert xacro(tmp_path, body, xacro_args={"prefix": "right"}) == ["right_bar"]
    told = "there is no argument 'prefx'; the file's arguments: 'prefix'"
    refused(file(tmp_path, body), told, xacro_args={"prefx": "right"})


def test_arguments_need_a_xacro_file(tmp_path: Path) -> None:
    refused(save(tmp_path, FOUR_BAR), "is not a xacro file", xacro_args={"n": "3"})


def test_a_urdf_that_holds_xacro_is_expanded(tmp_path: Path) -> None:
    assert xacro(tmp_path, '<xacro:property name="n" value="a"/><link name="${n}"/>', "robot.urdf") == ["a"]


def test_packages_are_found(tmp_path: Path) -> None:
    save(tmp_path / "ws" / "arm_description", f'{HEAD}<link name="a"/></robot>', "arm.xacro")
    save(tmp_path / "ws" / "arm_description", "<package/>", "package.xml")
    body = '<xacro:include filename="$(find arm_description)/arm.xacro"/>'
    assert xacro(tmp_path, body, package_dirs=[tmp_path / "ws"]) == ["a"]
    assert xacro(tmp_path, body, package_dirs=[tmp_path / "ws" / "arm_description"]) == ["a"]
    assert xacro(tmp_path / "ws" / "other" / "urdf", body) == ["a"]
    assert xacro(
        tmp_path / "ws" / "other", body.replace("$(find arm_description)", "package://arm_description")
    ) == ["a"]
    refused(file(tmp_path / "elsewhere", body), "package 'arm_description' is not found", "package_dirs")


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("${(lambda: 1)()}", "Lambda Functions not implemented"),
        ("${().__class__}", "attribute '__class__' is not allowed"),
        ("${_private}", "'_private' is not defined"),
        ("${'a'.format(1)}", "attribute 'format' is not allowed"),
        ("$(eval __import__)", "'__import__' is not defined"),
        ("$(env HOME)", "HOME"),
        ("${undefined + 1}", "undefined"),
        ("${1 +}", "invalid syntax"),
        ("${1 / 0}", "division by zero"),
        ("${xacro.load_yaml('/dev/zero')}", "outside the robot's folders"),
        ("${xacro.load_yaml('absent.yaml')}", "No such file"),
        ("${'a' * 10**11}", "a text or list is too large"),
        ("${'a'.replace('', 'b' * 10**6).replace('', 'c' * 10**6)}", "too large"),
        ("${'9'.join(['0' * 10**6] * 10**5)}", "a text or list is too large"),
        ("$(find nowhere)", "package 'nowhere' is not found"),
        ("$(arg nothing)", "nothing"),
    ],
)
def test_expressions_do_no_harm(tmp_path: Path, body: str, message: str) -> None:
    path = file(tmp_path, f'<link name="{body}"/>')
    assert refused(path, message).file == str(path)


MACRO = '<xacro:macro name="m" params="a"><link name="${a + nothing}"/></xacro:macro><xacro:m a="1"/>'
INCLUDE = '<xacro:include filename="{}.xacro"/>'


@pytest.mark.parametrize(
    ("body", "message"),
    [
        (INCLUDE.format("broken"), "broken.xacro:1: xacro: mismatched tag"),
        (INCLUDE.format("absent"), "No such file or directory"),
        (MACRO, "in macro m"),
        ("<xacro:nothing/>", "unknown macro name"),
        ('<xacro:macro name="m"><xacro:m/></xacro:macro><xacro:m/>', "without end"),
        (INCLUDE.format("entity"), "DOCTYPE"),
    ],
)
def test_errors_name_the_included_file_and_the_macro(tmp_path: Path, body: str, message: str) -> None:
    save(tmp_path, f"{HEAD}<link></robot>", "broken.xacro")
    save(tmp_path, '<!DOCTYPE r [<!ENTITY a "b">]><robot/>', "entity.xacro")
    refused(file(tmp_path, body), message)


def test_what_is_expanded_is_checked_like_any_urdf(tmp_path: Path) -> None:
    path = save(
        tmp_path, f"{HEAD}{TREE}{LOOP}</robot>".replace("<loop", "<lopp").replace("/loop", "/lopp"), "r.xacro"
    )
    refused(path, "r.xacro:", "did you mean <loop>")


@pytest.mark.parametrize(
    ("mass", "place", "message"),
    [
        ("${lenght * 2}", "parts.xacro:5", "'lenght' is not defined"),
        ("${length * -2}", "parts.xacro:4", "link 'a' has a negative mass"),
        ("${length}", "r.xacro:6", "effort 'abc' is not a finite number"),
    ],
)
def test_errors_name_file_and_line_where_the_element_was_written(
    tmp_path: Path, mass: str, place: str, message: str
) -> None:
    bar = [
        f"{HEAD}<xacro:macro name='bar' params='name length'>", "<link name='${name}'>", "<!-- light -->",
        "<inertial>", f"<mass value='{mass}'/>",
        "<inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial></link></xacro:macro></robot>",
    ]  # fmt: skip
    save(tmp_path, "\n".join(bar), "parts.xacro")
    robot = [
        HEAD, "<xacro:include filename='parts.xacro'/>", "<link name='base'/>",
        "<xacro:bar name='a' length='1'/>",
        "<joint name='j' type='revolute'><parent link='base'/><child link='a'/><axis xyz='0 0 1'/>",
        "<limit effort='abc' velocity='1' lower='-1' upper='1'/></joint></robot>",
    ]  # fmt: skip
    refused(save(tmp_path, "\n".join(robot), "r.xacro"), place, message)


SECOND = '<joint name="again" type="fixed"><parent link="base"/><child link="a"/></joint>'


@pytest.mark.parametrize("included", [False, True])
def test_errors_of_the_whole_robot_name_a_line_only_where_it_is_one_of_the_file(
    tmp_path: Path, included: bool
) -> None:
    """A joint that makes a second parent is found when all are read: its line is that of its own file."""
    save(tmp_path, f"{HEAD}\n\n\n{SECOND}</robot>", "parts.xacro")
    first = SECOND.replace("again", "first")
    last = '<xacro:include filename="parts.xacro"/>' if included else SECOND
    lines = [HEAD, '<link name="base"/><link', 'name="a"/>', first, last, "</robot>"]
    error = refused(
        save(tmp_path, "\n".join(lines), "r.xacro"), "link 'a' is already the child of joint 'first'"
    )
    assert (Path(error.file or "").name, error.line) == ("r.xacro", None if included else 5)


def test_notes_name_the_file_of_a_macro(tmp_path: Path) -> None:
    light = '<link name="{}"><inertial><mass value="1"/></inertial></link>'
    save(tmp_path, f"{HEAD}\n\n{light.format('far')}</robot>", "parts.xacro")
    near = f'{HEAD}\n{light.format("near")}<xacro:include filename="parts.xacro"/>'
    joint = '<joint name="j" type="fixed"><parent link="near"/><child link="far"/></joint></robot>'
    notes = read(save(tmp_path, f"{near}\n{joint}", "r.xacro")).notes
    said = "states a mass but no inertia: taken as a point mass"
    assert notes == (f"link 'near' (line 2) {said}", f"link 'far' ({tmp_path}/parts.xacro:3) {said}")


def test_an_optional_glob_that_matches_nothing_is_noted(tmp_path: Path) -> None:
    path = save(
        tmp_path, f'{HEAD}<link name="a"/><xacro:include filename="none_*.xacro"/></robot>', "r.xacro"
    )
    assert any("matched no files" in note for note in read(path).notes)
