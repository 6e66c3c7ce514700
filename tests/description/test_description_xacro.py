"""xacro.py: macros, arguments and packages work; harmful files raise an error."""

from pathlib import Path

import pytest

from hybridyn.description import read
from tests.description.reading import Texts, holds, refused, save_all
from tests.robots.robot_texts import FOUR_BAR, LOOP, TREE, save

HEAD = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'


def xacro(*parts: str) -> str:
    return "\n".join((HEAD, *parts, "</robot>"))


BAR = '<xacro:macro name="bar" params="name"><link name="${name}_bar"/></xacro:macro>'
PREFIXED = {
    "r.xacro": xacro(
        '<xacro:arg name="prefix" default="left"/><xacro:include filename="parts/bar.xacro"/>'
        '<xacro:bar name="$(arg prefix)"/>'
    ),
    "parts/bar.xacro": xacro(BAR),
}
PACKAGE = {
    "ws/arm_description/arm.xacro": xacro('<link name="a"/>'),
    "ws/arm_description/package.xml": "<package/>",
}
FIND = xacro('<xacro:include filename="$(find arm_description)/arm.xacro"/>')
LIGHT = '<link name="{}"><inertial><mass value="1"/></inertial></link>'
POINT = "states a mass but no inertia: taken as a point mass"
FAR = {
    "r.xacro": xacro(
        LIGHT.format("near") + '<xacro:include filename="parts.xacro"/>',
        '<joint name="j" type="fixed"><parent link="near"/><child link="far"/></joint>',
    ),
    "parts.xacro": xacro("", LIGHT.format("far")),
}
#: The texts of a robot's files, its arguments, folders of packages, and what is read.
READ: dict[str, tuple[Texts, dict[str, str], list[str], dict[str, object]]] = {
    "macros and includes": (PREFIXED, {}, [], {"links": ["left_bar"]}),
    "arguments": (PREFIXED, {"prefix": "right"}, [], {"links": ["right_bar"]}),
    "a URDF that holds xacro": (
        {"r.urdf": xacro('<xacro:property name="n" value="a"/><link name="${n}"/>')}, {}, [],
        {"links": ["a"]},
    ),
    "arithmetic of arguments, numbers and names": (
        {
            "r.xacro": xacro(
                '<xacro:arg name="count" default="2"/><xacro:arg name="big" default="false"/>'
                '<xacro:arg name="side" default="left"/>'
                "<link name=\"a$(eval count * 2 + 1)_$(eval side + '_' if not big else 'x')$(eval pi > 3)\"/>"
            )
        },
        {"count": "3"}, [], {"links": ["a7_left_True"]},
    ),
    "an element whose name is evaluated": (
        {"r.xacro": xacro('<xacro:element xacro:name="${\'link\'}" name="a"/>')},
        {}, [], {"links": ["a"]},
    ),
    **{
        f"a package in {place} of {dirs}": ({f"{place}/r.xacro": text} | PACKAGE, {}, dirs, {"links": ["a"]})
        for place, text, dirs in (
            (".", FIND, ["ws"]), (".", FIND, ["ws/arm_description"]), ("ws/other/urdf", FIND, []),
            ("ws/other", FIND.replace("$(find arm_description)", "package://arm_description"), []),
        )
    },
    "notes of xacro name file and line": (
        {
            "r.xacro": xacro('<link name="a"/>\n<xacro:include filename="parts.xacro"/>'),
            "parts.xacro": xacro('\n\n<xacro:property name="pi" value="3"/>'),
        },
        {}, [], {"notes": {"parts.xacro:4: xacro: redefining global symbol: pi"}},
    ),
    "notes name the file of a macro": (
        FAR, {}, [], {"notes": {f"/r.xacro:2: link 'near' {POINT}", f"/parts.xacro:3: link 'far' {POINT}"}},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", READ)
def test_what_is_read(name: str, tmp_path: Path) -> None:
    texts, arguments, folders, expected = READ[name]
    dirs = [tmp_path / folder for folder in folders]
    holds(read(save_all(tmp_path, texts), xacro_args=arguments or None, package_dirs=dirs), expected)


MACRO = '<xacro:macro name="m" params="a"><link name="${a + nothing}"/></xacro:macro><xacro:m a="1"/>'
INCLUDE = '<xacro:include filename="{}.xacro"/>'


def weighing(mass: str) -> dict[str, str]:
    """Return a robot that includes a bar with a mass, and has a joint with a limit that is no number."""
    bar = [
        "<xacro:macro name='bar' params='name length'>", "<link name='${name}'>",
        "<!-- light --><inertial>", f"<mass value='{mass}'/>",
        "<inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial></link></xacro:macro>",
    ]  # fmt: skip
    robot = [
        "<xacro:include filename='parts.xacro'/>", "<link name='base'/>", "<xacro:bar name='a' length='1'/>",
        "<joint name='j' type='revolute'><parent link='base'/><child link='a'/><axis xyz='0 0 1'/>",
        "<limit effort='abc' velocity='1' lower='-1' upper='1'/></joint>",
    ]  # fmt: skip
    return {"r.xacro": xacro(*robot), "parts.xacro": xacro(*bar)}


#: What stands in a robot's file, or the texts of its files, and what is told.
REFUSED: list[tuple[Texts, list[str]]] = [
    *(
        (f'<link name="{said}"/>', ["r.xacro", message])
        for said, message in (
            ("${(lambda: 1)()}", "Lambda Functions not implemented"),
            ("${().__class__}", "attribute '__class__' is not allowed"),
            ("${_private}", "'_private' is not defined"),
            ("${'a'.format(1)}", "attribute 'format' is not allowed"),
            ("$(eval 1 + side)", "'side' is not defined"),
            ("$(eval open)", "open"),
            ("$(env HOME)", "HOME"),
            ("${undefined + 1}", "undefined"),
            ("${1 +}", "invalid syntax"),
            ("${1 / 0}", "division by zero"),
            ("${xacro.load_yaml('/dev/zero')}", "outside the robot's folders"),
            ("${xacro.load_yaml('absent.yaml')}", "No such file"),
            ("${'a' * 10**11}", "not evaluate something that long"),
            ("${'a'.replace('', 'b' * 9000).replace('', 'c' * 9000)}", "too large"),
            ("${'9'.join(['0' * 10**6] * 10**5)}", "that long"),
            ("$(find nowhere)", "package 'nowhere' is not found"),
            ("$(arg nothing)", "nothing"),
        )
    ),
    (INCLUDE.format("broken"), ["broken.xacro:1: xacro: mismatched tag"]),
    (INCLUDE.format("absent"), ["No such file or directory"]),
    (MACRO, ["in macro m"]),
    ("<xacro:nothing/>", ["unknown macro name"]),
    ('<xacro:macro name="m"><xacro:m/></xacro:macro><xacro:m/>', ["without end"]),
    (INCLUDE.format("entity"), ["entity.xacro:2: xacro: <!DOCTYPE is not allowed"]),
    (
        '<xacro:property name="p" value="$(eval 1+x)"/><link name="${p}"/>',
        ["r.xacro:2: xacro: 'x' is not defined for expression '1+x' when evaluating expression 'p'"],
    ),
    # What is expanded is checked like any URDF.
    (
        f"{TREE}{LOOP}".replace("<loop", "<lopp").replace("/loop", "/lopp"),
        ["r.xacro:", "did you mean <loop>"],
    ),
    # File and line are those where the element was written.
    (weighing("${lenght * 2}"), ["parts.xacro:5", "'lenght' is not defined"]),
    (weighing("${length * -2}"), ["parts.xacro:4", "link 'a' has a negative mass"]),
    (weighing("${length}"), ["r.xacro:6", "effort 'abc' is not a finite number"]),
    (
        {"elsewhere/r.xacro": FIND} | PACKAGE,
        ["package 'arm_description' is not found", "package_dirs"],
    ),
]  # fmt: skip


@pytest.mark.parametrize(("said", "messages"), REFUSED)
def test_it_is_refused(tmp_path: Path, said: Texts, messages: list[str]) -> None:
    save(tmp_path, f"{HEAD}<link></robot>", "broken.xacro")
    save(tmp_path, '<?xml version="1.0"?>\n<!DOCTYPE r [<!ENTITY a "b">]><robot/>', "entity.xacro")
    texts = {"r.xacro": xacro(said)} if isinstance(said, str) else said
    refused(save_all(tmp_path, texts), *messages)


@pytest.mark.parametrize(
    ("texts", "arguments", "message"),
    [
        (PREFIXED, {"prefx": "right"}, "there is no argument 'prefx'; the file's arguments: 'prefix'"),
        (FOUR_BAR, {"n": "3"}, "is not a xacro file"),
    ],
)
def test_wrong_arguments_are_refused(
    texts: Texts, arguments: dict[str, str], message: str, tmp_path: Path
) -> None:
    refused(save_all(tmp_path, texts), message, xacro_args=arguments)


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
