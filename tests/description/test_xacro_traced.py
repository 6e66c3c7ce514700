"""Traced expansions have the bytes of whole ones, whatever the arguments; they are used where they can be."""

import re
from pathlib import Path

import numpy as np
import pytest

from hybridyn.description.urdf import xacro
from hybridyn.description.urdf.expansion import Expansion
from hybridyn.description.urdf.robot_folders import RobotFolders
from hybridyn.errors import ModelError
from tests import ROOT
from tests.description.reading import save_all

HEAD = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'
PART = HEAD + '<xacro:macro name="part" params="name size:=1"><{}_part name="${{name}}" size="${{size {}}}"/>'
#: Files that the robots below include.
BESIDE = {
    "big.xacro": PART.format("big", "* 2") + "</xacro:macro></robot>",
    "small.xacro": PART.format("small", "+ 1")
    + '</xacro:macro><xacro:property name="inner" value="5"/></robot>',
    "conf.yaml": "x: 3\nlist: [1, 2]\ndeep: {er: 4}\n",
}
#: Robots with an argument `a`, mostly a number, and an argument `k`, mostly a name.
ROBOTS = {
    "values": """
        <xacro:property name="lazy" value="${a + 1}"/><xacro:property name="later" value="${lazy * two}"/>
        <xacro:property name="two" value="2"/><l v="${later}" w="${a}_$(arg k)" x="$${a}"/>
        <xacro:property name="two" value="3"/><l v="${later}" w="${two}" e="${a * 2}"/>
        <t>${a} and $(arg k)</t><t> $(arg k) </t><t>$(arg k)</t><l v="${'%s-%s' % (a, '$(arg k)')}"/>
        <l y="${str(a) + '1'}"/>
        <l v="${'big' if a > 1 else lazy}" l="${[x * a for x in [1, 2]]}" r="${round(sin(a), 3)} ${-a}"/>""",
    "scopes": """
        <xacro:macro name="m" params="p:=${a} q:='$(arg k)' r:=^|9"><mm p="${p}" q="${q}" r="${r}"/>
        <xacro:property name="back" value="${p}" scope="parent"/></xacro:macro>
        <xacro:m/><b v="${back}"/><xacro:m p="4" r="$(arg k)"/><b v="${back}"/>
        <xacro:property name="eager" value="${a + 1}" lazy_eval="false"/><b v="${eager}"/>
        <xacro:property name="stated" default="$(arg k)"/><b v="${stated}"/>""",
    "blocks": """
        <xacro:macro name="m" params="*one **all n:=7"><o n="${n}"><xacro:insert_block name="one"/>
        <xacro:insert_block name="all"/></o></xacro:macro>
        <xacro:m n="${a}"><i v="$(arg k)"/><g><x v="${a * 2}"/><y/></g></xacro:m>""",
    "conditions": """
        <xacro:if value="${a > 1 and a &lt; 3}"><in v="${a}"/></xacro:if>
        <xacro:unless value="${k == 'big'}"><other v="$(arg k)"/></xacro:unless>
        <xacro:macro name="loop" params="i"><i v="${a * i}"/>
        <xacro:if value="${i &lt; a}"><xacro:loop i="${i + 1}"/></xacro:if></xacro:macro>
        <xacro:loop i="1"/>""",
    "includes": '<xacro:include filename="$(arg k).xacro"/><xacro:part name="$(arg k)" size="${a}"/>',
    "choice of a macro": """
        <xacro:macro name="big"><big v="${a}"/></xacro:macro>
        <xacro:macro name="small"><small/></xacro:macro><xacro:call macro="$(arg k)"/>""",
    "lists that change": """
        <xacro:property name="items" value="${[1, 2, a]}"/>
        <i v="${items.pop(0)}" w="${items}"/><i v="${items.pop(0) if a > 1 else 0}"/>""",
    "tables": """<xacro:property name="conf" value="${xacro.load_yaml('conf.yaml')}"/><h v="${conf.x}"/>
        <c v="${conf.x * a}" w="${conf['list'][1]}" x="${conf.deep.er + a}"/>""",
    "a name space": """<xacro:include filename="small.xacro" ns="ns"/><n v="${ns.inner}" w="${a}"/>
        <xacro:ns.part name="z" size="${a}"/><xacro:property name="inner" value="${a}"/>""",
    "names": """<xacro:element xacro:name="tag_$(arg k)" v="1"/>
        <g><xacro:attribute name="w" value="$(arg k)"/></g>
        <!-- xacro:eval-comments --><!-- ${a} --><z v="${xacro.arg('k')}"/>""",
    "warnings": '<xacro:if value="${a == 2}">${xacro.warning("two", a)}</xacro:if><l v="${a}"/>',
}  # fmt: skip
NUMBERS, NAMES = ["2", "0.5", "-2", "7.25", "3", "1e-3"], ["big", "small"]
ODD = [
    "",
    " ",
    "x<y",
    "'q'",
    'd"q',
    "$(arg a)",
    "${1}",
    "1_0",
    "[1, 2]",
    "true",
    "é",
    "a$b",
    "a b",
    "\ue0000\ue001",
]
#: Those that a traced expansion serves, with ordinary arguments.
SERVED = {"values", "scopes", "blocks", "conditions", "includes", "tables", "warnings"}


def whole(file: Path, given: dict[str, str]) -> str:
    """Expand a file as a whole."""
    share, shipped = xacro.share_dirs(), [str(ROOT / "urdf")]
    folders = RobotFolders(str(file), [], share, shipped)
    made = Expansion(str(file), folders, given, traced=False)
    return made.text + repr(made.notes)


def by_expand(file: Path, given: dict[str, str]) -> str:
    text, notes = xacro.expand(str(file), given, ())
    return text.decode() + repr(notes)


def same(file: Path, given: dict[str, str]) -> None:
    """Compare both ways to expand a file, or both errors."""
    found = []
    for way in (whole, by_expand):
        try:
            found.append(way(file, given))
        except ModelError as error:
            found.append(str(error))
    assert found[1] == found[0]


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[object]:
    """List the whole expansions that `expand` makes."""
    calls: list[object] = []
    expanded = xacro._expanded

    def counted(*given: object) -> object:
        calls.append(given)
        return expanded(*given)  # type: ignore[arg-type]

    monkeypatch.setattr(xacro, "_traced", [])
    monkeypatch.setattr(xacro, "_expanded", counted)
    return calls


@pytest.mark.parametrize("name", ROBOTS)
def test_any_arguments(name: str, tmp_path: Path, made: list[object]) -> None:
    arguments = '<xacro:arg name="a" default="2"/><xacro:arg name="k" default="big"/>'
    properties = '<xacro:property name="a" value="$(arg a)"/><xacro:property name="k" value="$(arg k)"/>'
    file = save_all(tmp_path, {"r.xacro": f"{HEAD}{arguments}{properties}{ROBOTS[name]}</robot>"} | BESIDE)
    rng = np.random.default_rng(3)
    for odd in (0.0, 0.3):
        for _ in range(15):
            drawn = {"a": str(rng.choice(NUMBERS)), "k": str(rng.choice(NAMES))}
            same(
                file, {key: str(rng.choice(ODD)) if rng.random() < odd else one for key, one in drawn.items()}
            )
        assert odd or (len(made) <= 12) == (name in SERVED)


MORE = [pytest.param(name, marks=pytest.mark.slow) for name in ("delta", "lx4", "snake")]


@pytest.mark.parametrize("name", ["five_bar", "gough_stewart", *MORE])
def test_shipped_robots(name: str, made: list[object]) -> None:
    file = ROOT / "urdf" / f"{name}.urdf.xacro"
    stated = dict(re.findall(r'<xacro:arg name="(\w+)" default="([^"]*)"', file.read_text()))
    rng = np.random.default_rng(1)
    for _ in range(4):
        factors = 1 + 0.05 * rng.uniform(-1, 1, len(stated))
        counts = {"modules", "n"} & stated.keys()
        given = {
            key: str(rng.integers(1, 3)) if key in counts else repr(float(value) * float(factor))
            for (key, value), factor in zip(stated.items(), factors, strict=True)
        }
        same(file, given)
    assert len(made) <= (2 if counts else 1)
