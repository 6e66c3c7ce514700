"""Expansions against xacro itself: the same elements, attributes and texts, comments left out."""

import contextlib
import importlib
import io
import random
from pathlib import Path
from typing import Any

import pytest
import xacro
from lxml import etree

from hybridyn.description.urdf import xacro as xacro_files
from hybridyn.errors import ModelError
from tests import ROOT
from tests.description.reading import save_all
from tests.support.extras import robots_of_others, skip
from tests.support.samples import slow

HEAD = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'


def tree(text: bytes) -> list[Any]:
    """Return what an XML text says."""

    def said(node: Any) -> list[Any]:
        attributes = {name: value for name, value in node.attrib.items() if name != "hybridyn-place"}
        texts = [node.text, *(child.tail for child in node)]
        words = " ".join(" ".join(one or "" for one in texts).split())
        return [node.tag, attributes, words, [said(child) for child in node]]

    return said(etree.fromstring(text, etree.XMLParser(remove_comments=True)))


def of_xacro(file: Path, given: dict[str, str]) -> list[Any] | None:
    """Return what xacro makes of a file; None where it fails."""
    with contextlib.redirect_stderr(io.StringIO()):
        try:
            document = xacro.process_file(str(file), mappings=dict(given))
        except Exception:
            return None
    return tree(document.toprettyxml(indent="", encoding="utf-8"))


def ours(file: Path, given: dict[str, str]) -> list[Any]:
    """Return what the reader makes of it."""
    return tree(xacro_files.expand(str(file), given, ())[0])


BESIDE = {
    "part.xacro": HEAD + '<xacro:macro name="part" params="size:=1"><part size="${size}"/></xacro:macro>'
    '<xacro:property name="inner" value="5"/><beside xmlns:my="urn:my"/></robot>',
    "other.xacro": HEAD.replace(">", ' xmlns:my="urn:my">') + "<my:other/></robot>",
    "some.yaml": "x: 3\nlist: [1, {a: b}]\ndeep: {er: {est: 4}}\nangle: !degrees 90\nback: &k [1]\n"
    "again: *k\n",
}
MACRO = '<xacro:macro name="m" params="{}">{}</xacro:macro>'
#: Arguments, and properties of their names.
KNOWN = "".join(
    f'<xacro:arg name="{name}" default="0"/><xacro:property name="{name}" value="$(arg {name})"/>'
    for name in "ak"
)
#: What stands in a robot, with arguments `a` and `k`.
TEXTS = {
    "values": """<l a="${1 + 2}" b="$${x}" c="$$(x)" d="${'a' + str(2)}" e="5$" f="a $5 b"/>""",
    "literals": """<xacro:property name="t" value="true"/><xacro:property name="u" value="1_0"/>
        <xacro:property name="q" value="'7'"/><xacro:property name="e" value="'${q}'"/>
        <l t="${t and 3}" u="${u + 'x'}" q="${q}" e="${e}" n="${[1, 2.5, None, t]}"/>""",
    "lazy properties": """<xacro:property name="b" value="${c + 1}"/><xacro:property name="c" value="2"/>
        <l b="${b}"/><xacro:property name="c" value="3"/><l b="${b}" c="${c}"/>
        <xacro:property name="d" value="${c + 1}" lazy_eval="false"/><xacro:property name="c" value="4"/>
        <l d="${d}"/>""",
    "removed properties": """<xacro:property name="b" value="1"/><xacro:property name="b" remove="true"/>
        <xacro:property name="b" default="9"/><l b="${b}"/>
        <xacro:property name="b" default="8"/><l b="${b}"/>""",
    "scopes": """<xacro:property name="g" value="1"/>
        <xacro:macro name="in"><xacro:property name="g" value="2" scope="parent"/>
        <xacro:property name="h" value="3" scope="global"/><l g="${g}"/></xacro:macro>
        <xacro:macro name="out"><xacro:in/><l g="${g}" h="${h}"/></xacro:macro><xacro:out/>
        <l g="${g}" h="${h}"/>""",
    "names that are evaluated": """<xacro:property name="${'n' + 'm'}" value="1"/><l nm="${nm}"/>
        <xacro:element xacro:name="${'ta' + 'g'}" a="1"><x/></xacro:element>""",
    "attributes": """<l><xacro:attribute name="${'w'}" value="a${1 + 1}"/><x/></l>
        <l><xacro:if value="1"><xacro:attribute name="lost" value="1"/></xacro:if></l>
        <xacro:macro name="n"><xacro:attribute name="lost" value="1"/><y/></xacro:macro><l><xacro:n/></l>""",
    "parameters": MACRO.format("x y:=2 z:='a b' w:=${y} v:=^ u:=^|9 t=3",
        '<m x="${x}" y="${y}" z="${z}" w="${w}" v="${v}" u="${u}" t="${t}"/>')
        + '<xacro:property name="v" value="7"/><xacro:property name="y" value="5"/>'
        '<xacro:m x="1"/><xacro:m x="${y}" y="1" u="" z="\'q\'"/>',
    "blocks": MACRO.format("*one **many n:=3", """<o n="${n}"><xacro:insert_block name="one"/>
        <xacro:insert_block name="many"/><xacro:insert_block name="one"/></o>""")
        + '<xacro:property name="n" value="1"/><xacro:m><i a="${n}" b="$${n}"/>'
        '<g c="${n}"><x/>t<y/></g></xacro:m>',
    "blocks of properties": """<xacro:property name="p"><x a="${k}"/>text<y/></xacro:property>
        <l><xacro:insert_block name="p"/></l>""",
    "calls by name": MACRO.format("x", '<m x="${x}"/>') + '<xacro:call macro="${\'m\'}" x="2"/>',
    "macros in macros": """<xacro:macro name="o"><xacro:macro name="i"><i/></xacro:macro><xacro:i/>
        </xacro:macro><xacro:o/><xacro:macro name="i"><j/></xacro:macro><xacro:i/><xacro:o/>""",
    "macros that call themselves": """<xacro:macro name="m" params="n"><l n="${n}"/>
        <xacro:if value="${n > 0}"><xacro:m n="${n - 1}"/></xacro:if></xacro:macro><xacro:m n="30"/>""",
    "conditions": """<xacro:if value="${k == 'big'}"><a/></xacro:if>
        <xacro:unless value="0">text<b/></xacro:unless>
        <xacro:if value="true"><xacro:if value="0"><c/></xacro:if><d/></xacro:if>
        <xacro:if value="${[]}"><e/></xacro:if>""",
    "arguments": """<xacro:arg name="a" default="8"/><xacro:arg name="own" default="${a}$(arg k)"/>
        <l a="$(arg a)" o="$(arg own)" e="$(eval a * 2 if k == 'big' else pi)" x="${xacro.arg('a')}"
        n="$(arg ${'k'})" opt="$(optenv NOT_SET a b)"/>""",
    "includes": """<xacro:include filename="part.xacro"/><xacro:part size="${inner}"/><l i="${inner}"/>
        <xacro:include filename="absent.xacro" optional="true"/><xacro:include filename="oth*.xacro"/>""",
    "name spaces": """<xacro:property name="inner" value="1"/>
        <xacro:include filename="part.xacro" ns="${'n' + 's'}"/>
        <xacro:ns.part size="${ns.inner}"/><l i="${inner}"/>""",
    "YAML": """<xacro:property name="y" value="${xacro.load_yaml('some.yaml')}"/>
        <l x="${y.x}" d="${y.deep.er.est}" l="${y['list'][1].a}" g="${y.angle}" k="${y.again + y.back}"/>
        <l w="${load_yaml('some.yaml')['x']}" t="${xacro.tokenize('a, b;c')}" z="${sorted([2, 1])}"/>
        <l d="${xacro.dotify(dict(a=dict(b=1))).a.b}" p="${xacro.abs_filename('x')}"/>""",
    "texts": "<l>${1}${2} and $(arg k)</l><l> ${k} <x/> after ${1} </l><l><![CDATA[a & b]]></l>"
    "<l>&lt;&amp;</l>",
    "comments": "<!-- ${nothing} --><l><!-- a --><!-- xacro:eval-comments --><!-- ${k} --></l>",
}  # fmt: skip


@pytest.mark.parametrize("name", TEXTS)
def test_texts_are_those_of_xacro(name: str, tmp_path: Path) -> None:
    given = {"a": "2", "k": "big"}
    file = save_all(tmp_path, {"r.xacro": f"{HEAD}{KNOWN}{TEXTS[name]}</robot>"} | BESIDE)
    assert ours(file, given) == of_xacro(file, given)


REFUSED = [
    '<l a="${nothing}"/>', '<l a="$(arg nothing)"/>', '<l a="$(nothing)"/>', '<l a="${1"/>', '<l a="$$a"/>',
    "<xacro:nothing/>", '<xacro:insert_block name="b"/>', '<xacro:if value="${3"/>', "<xacro:if/>",
    '<xacro:if value="some"/>', '<xacro:property name="for" value="1"/>',
    '<xacro:property name="1a" value="1"/>', '<xacro:property name="p" value="1" default="2"/>',
    '<xacro:macro name="call"/>', '<xacro:macro name="a.b"/>',
    '<xacro:property name="p" value="${p}"/><l a="${p}"/>', "<xacro:arg name='x'/>", '<xacro:call macro=""/>',
    '<xacro:property name="p" value="1" scope="parent"/>', '<xacro:include filename="absent.xacro"/>',
    '<xacro:element xacro:name=""/>', '<l><xacro:attribute name="" value="1"/></l>', "${xacro.fatal('no')}",
    *(
        MACRO.format("x *b", "<m/>") + call
        for call in (
            "<xacro:m/>", '<xacro:m x="1"/>', '<xacro:m x="1" y="2"><i/></xacro:m>',
            "<xacro:m><i/></xacro:m>", '<xacro:m x="1"><i/><j/></xacro:m>',
        )
    ),
    MACRO.format("x:=^", "<m/>") + "<xacro:m/>", MACRO.format("", "<m/>") + "<xacro:nothing.m/>",
    MACRO.format("", "<m/>") + "<xacro:m.m/>",
]  # fmt: skip


@pytest.mark.parametrize("text", REFUSED)
def test_what_xacro_refuses_is_refused(text: str, tmp_path: Path) -> None:
    file = save_all(tmp_path, {"r.xacro": f"{HEAD}{text}</robot>"})
    assert of_xacro(file, {}) is None
    with pytest.raises(ModelError, match=r"r\.xacro:1: xacro: "):
        ours(file, {})


PARAMETERS = ["", "a", "a:=3", "b:=^|4 *n", "**n", "a:=${b}"]


def drawn(draw: random.Random, depth: int = 0) -> str:
    """Draw what stands in a robot; much of it is wrong."""
    name = draw.choice("abc")
    value = draw.choice([
        "1", "2.5", "true", "'q'", "${a}", "${b + 1}", "${c * 2}", "$(arg k)", "x${a}y", "${[a, b]}", "$${a}",
        "${k}", "", "${a if a else b}",
    ])  # fmt: skip
    inner = "".join(drawn(draw, depth + 1) for _ in range(draw.randint(0, 3) if depth < 3 else 0))
    block = draw.choice(["", '<xacro:insert_block name="n"/>'])
    scope = draw.choice(["", "", ' scope="parent"', ' scope="global"', ' lazy_eval="false"'])
    kinds = [
        f'<l v="{value}">{inner}</l>', value, f'<xacro:property name="{name}" value="{value}"{scope}/>',
        f'<xacro:property name="{name}" default="{value}"/>',
        f'<xacro:property name="{name}">{inner}</xacro:property>',
        f'<xacro:if value="{draw.choice(["1", "0", "${a}", value])}">{inner}</xacro:if>',
        f'<xacro:unless value="${{{name} == 1}}">{inner}</xacro:unless>',
        f'<xacro:macro name="m{name}" params="{draw.choice(PARAMETERS)}">{inner}{block}</xacro:macro>',
        f'<xacro:m{name} {draw.choice(["", "a=" + chr(34) + value + chr(34)])}>{inner}</xacro:m{name}>',
        f'<xacro:insert_block name="{name}"/>', f'<xacro:arg name="{name}" default="{value}"/>',
        f'<xacro:attribute name="{name}" value="a{value}"/>',
        f"""<xacro:element xacro:name="${{'l{name}'}}">{inner}</xacro:element>""",
        f'<xacro:property name="{name}" remove="{draw.choice(["true", "false"])}"/>',
    ]  # fmt: skip
    return draw.choice(kinds[:3] + kinds)


def agrees(name: str, folder: Path) -> bool:
    """Draw a file; check that it is expanded as by xacro, where that reads it, and return whether it does.

    Where xacro refuses a file, the reader may read it: it does not evaluate the parameters of macros.
    """
    draw = random.Random(name)
    start = KNOWN + "".join(f'<xacro:property name="{name}" value="{n}"/>' for n, name in enumerate("abc"))
    text = HEAD + start + "".join(drawn(draw) for _ in range(draw.randint(1, 6))) + "</robot>"
    file = save_all(folder, {"r.xacro": text})
    theirs = of_xacro(file, {"k": "big"})
    try:
        made = ours(file, {"k": "big"})
    except ModelError:
        assert theirs is None, text
        return False
    assert theirs in (None, made), text
    return theirs is not None


@pytest.mark.parametrize(("seed", "count"), [(0, 50), *(slow(seed, 300) for seed in range(30))])
def test_what_is_drawn_is_expanded_as_by_xacro(seed: int, count: int, tmp_path: Path) -> None:
    assert sum(agrees(f"{seed} {number}", tmp_path) for number in range(count)) > count / 10


SOME = ["five_bar", "delta"]
MORE = ["gough_stewart", "lx4", "rps3", "tanev", "scara_delta", "snake", *[
    f"benchmarks/{name}" for name in ("andrews", "bricard", "flyball_governor", "heavy_top", "n_four_bar")
]]  # fmt: skip


@pytest.mark.parametrize("name", [*SOME, "stewart_ur5", *map(slow, MORE)])
def test_shipped_robots_expand_as_by_xacro(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if name == "stewart_ur5" and not robots_of_others():
        skip("robots")
    examples = (Path(share, "example-robot-data") for share in xacro_files.share_dirs())
    found = next((str(folder) for folder in examples if folder.is_dir()), "")
    substitutions = importlib.import_module("xacro.substitution_args")
    monkeypatch.setattr(substitutions, "_eval_find", lambda _: found)
    file = ROOT / "urdf" / f"{name}.urdf.xacro"
    assert ours(file, {}) == of_xacro(file, {})
