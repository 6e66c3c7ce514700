"""xml_node.py: dangerous XML raises an error, numbers are read strictly, and messages name the line."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from hybridyn.description import read
from hybridyn.description.urdf import xml_node
from hybridyn.errors import ModelError
from tests.description.reading import bound, holds, refused
from tests.robots.robot_texts import FOUR_BAR, line_of, read_text, save

BOMB = (
    '<!DOCTYPE robot [<!ENTITY a "aaaaaaaaaa">'
    + "".join(f'<!ENTITY {chr(98 + i)} "{("&" + chr(97 + i) + ";") * 10}">' for i in range(9))
    + ']><robot name="&j;"><link name="a"/></robot>'
)


#: Texts that are no robot.
NO_ROBOTS = [
    (BOMB, "not well-formed XML: Maximum entity amplification"),
    (BOMB.replace("&j;", "r"), "<!DOCTYPE is not allowed"),
    ('<!DOCTYPE robot SYSTEM "file:///etc/passwd"><robot/>', "<!DOCTYPE is not allowed"),
    ("<!doctype robot><robot/>", "not well-formed XML"),
    ("", "four_bar.urdf: not readable as XML: Document is empty, line 1, column 1"),
    ("#usda 1.0\n", "holds USD, which OpenUSD reads by its ending; rename it to end in .usda"),
    (b"PK\x03\x04 any archive", "four_bar.urdf: is a ZIP; if it holds USD, which OpenUSD reads"),
    (b"PXR-USDC\0\0", "rename it to end in .usdc"),
    ("  \n ", "not well-formed XML"),
    ("no xml at all", "not well-formed XML"),
    (FOUR_BAR[:-20], "not well-formed XML"),
    ('<?xml version="1.0" encoding="nonsense"?><robot>', "not well-formed XML"),
    ('<robot name="a"><link name="x & y"/></robot>', "not well-formed XML"),
    ("<robot>" * 2000 + "</robot>" * 2000, "not well-formed XML"),
    ("<mujocoinclude><worldbody/></mujocoinclude>", "this is a part of an MJCF file (MuJoCo)"),
    ('<sdf version="1.9"><model name="a"/></sdf>', "the model has no <link>"),
    ("<html/>", "not a robot file"),
    ('<robot name="a" name="b"><link name="l"/></robot>', "not well-formed XML"),
    ('<robot name="a"><!-- a -- b --><link name="l"></robot>', "not well-formed XML"),
    *(
        (f'<robot name="a" drake:b="c"><link name="l"/></robot>{more}', "something follows the root")
        for more in ("<robot/>", "<loop>", "text")
    ),
]
MASS, ORIGIN = '<mass value="{}"/>', '<origin xyz="{}"/><parent link="crank"/>'
WORDS = ["nan", "inf", "-inf", "1,5", "", " ", "1_0", "0x10", "1e400", "one", "\uff11", "1e", "--1"]
#: An element, its words, and words that are no numbers.
WRONG_NUMBERS = [
    *((MASS, "2", word) for word in WORDS),
    *((ORIGIN, "1 0 0", words) for words in ("0 0", "0 0 0 0", "", "0,0,1", "0 0 z")),
]


@pytest.mark.parametrize(("text", "message"), NO_ROBOTS)
def test_refuses_what_is_no_robot(tmp_path: Path, text: str | bytes, message: str) -> None:
    assert "<string>" not in str(refused(save(tmp_path, text), message))


@pytest.mark.parametrize(("element", "right", "wrong"), WRONG_NUMBERS)
def test_numbers_must_be_finite_and_as_many_as_needed(
    element: str, right: str, wrong: str, tmp_path: Path
) -> None:
    text = FOUR_BAR.replace(element.format(right), element.format(wrong))
    error = refused(save(tmp_path, text), "")
    place = line_of(text, element.format(wrong)), str(tmp_path / "four_bar.urdf")
    assert (error.line, error.file) == place


@pytest.mark.parametrize(
    ("change", "note"),
    [
        (lambda text: text.replace("<link", "<!-- limits -- see the manual --><link", 1), "2: '--' in"),
        (lambda text: "\ufeff" + text.replace("<link", "<!-- a -- b --><link", 1), "2: '--' in"),
        (lambda text: "<!-- by hand --><?xml version='1.0'?>" + text, "1: an XML declaration"),
        *(
            (
                lambda text, word=word: f"<?xml{word}?>{text}",
                f"1: the declaration <?xml{word}?> is not XML" if word else "1: an XML declaration",
            )
            for word in (
                "",
                ' version="2.0"',
                ' version="1"',
                ' encoding="UTF-8" version="1.0"',
                ' encoding="UTF-8"',
                ' version="1.0" encoding="unicode"',
                ' version="1.0" encoding="UTF-16"',
                ' version="1.0" standalone="true"',
            )
        ),
        (lambda text: text.replace("<link", "<drake:group name='g'/><link", 1), "2: a prefix without xmlns"),
        (lambda text: text.replace("<link", "<material name='<grey>'/><link", 1), "2: '<' in an attribute"),
    ],
)
def test_what_other_readers_accept_is_read_and_noted(
    tmp_path: Path, change: Callable[[str], str], note: str
) -> None:
    wanted = read(save(tmp_path, FOUR_BAR))
    found = read(save(tmp_path, change(FOUR_BAR), "other.urdf"))
    assert [one for one in found.notes if note in one]
    same = {"notes": wanted.notes, "source": wanted.source, "read_from": wanted.read_from}
    assert repr(replace(found, **same)) == repr(wanted)


def test_refuses_an_absurd_size(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bound(monkeypatch, file=1000)
    refused(save(tmp_path, FOUR_BAR), "larger than")
    bound(monkeypatch, XML=1000)
    with pytest.raises(ModelError, match="bytes of XML, limit "):
        xml_node.parse(FOUR_BAR.encode(), "four_bar.urdf")


def test_refuses_absurd_numbers_of_elements(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bound(monkeypatch, elements=10)
    refused(save(tmp_path, FOUR_BAR), "elements, limit 10")


def test_refuses_what_is_no_file(tmp_path: Path) -> None:
    for file, message in (
        (tmp_path / "absent.urdf", "No such file"), (tmp_path, "is a folder"),
        (Path("/dev/zero"), "not a regular file"), (Path("a\0b.urdf"), "null byte"),
    ):  # fmt: skip
        refused(file, message)


@pytest.mark.parametrize("word", ["2", "+2", "2.", "2e0", "0.02E+2", " 2 "])
def test_ordinary_numbers_pass(tmp_path: Path, word: str) -> None:
    text = FOUR_BAR.replace('<mass value="2"/>', f'<mass value="{word}"/>')
    assert read_text(tmp_path, text).links[1].mass == 2.0


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_comments_bom_and_line_ends_pass(tmp_path: Path, encoding: str) -> None:
    text = FOUR_BAR.replace("<link", "<!-- <loop/> --><link", 1).replace("\n", "\r\n")
    found = read_text(tmp_path, text.encode(encoding))
    holds(found, {"joints": ["drive", "elbow", "swing"], "closures": ["pin"]})


def test_a_name_is_not_proposed_for_itself(tmp_path: Path) -> None:
    error = refused(save(tmp_path, '<robot name="r"><link name=""/></robot>'), "")
    assert str(error).endswith("attribute 'name' is empty")
