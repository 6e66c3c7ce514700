"""`hybridyn info --plot`: the cards of a robot, where they stand, and the files that they become."""

import itertools
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

import hybridyn
from hybridyn.figures.structure import layout
from hybridyn.figures.structure_cards import Card, Leg, Sign, cards, dot_of_cards
from tests import ROOT
from tests.command_line import call
from tests.shipped import ROBOTS


def robot(name: str, **arguments: str) -> hybridyn.HybridRobot:
    return hybridyn.load(ROOT / f"urdf/{name}.urdf.xacro", xacro_args=arguments)


@pytest.mark.parametrize("name", ROBOTS)
def test_every_module_stands_on_one_card_above_what_it_stands_on(name: str) -> None:
    loaded = robot(name)
    drawn = cards(loaded)
    assert sorted(k for card in drawn for k in card.modules) == [*range(len(loaded.modules))]
    for number, card in enumerate(drawn[1:], start=1):
        assert card.parent is not None
        assert card.parent < number
        below = loaded.modules[card.modules[0]].parent
        assert below == (drawn[card.parent].modules or (-1,))[-1]
    legs = [(leg.number, sign) for card in drawn for leg in card.legs for sign in leg.joints]
    if not any(card.folded for card in drawn):
        assert sum(number for number, sign in legs if sign.driven) == len(loaded.motors)


def test_the_lx4_is_told_module_by_module() -> None:
    ground, first, *rest = cards(robot("lx4"))
    assert ground.lines == ("base, fixed", "lx4: 4 modules, 24 freedoms, 24 motors")
    assert first.title == "m1_platform"
    assert first.lines[0] == "module 1: 6 freedoms, 6 motors"
    assert first.legs == (Leg(6, (Sign("R", False), Sign("R", False), Sign("P", True))),)
    assert [card.modules for card in rest] == [(1,), (2, 3)]
    assert first.colour != rest[0].colour == rest[1].colour


def test_joints_in_series_share_a_card() -> None:
    arm = cards(robot("stewart_ur5"))[-1]
    assert arm.title == "shoulder_link ... wrist_3_link"
    assert arm.lines == ("6 joints in series, 6 motors",)
    assert arm.legs == (Leg(1, (Sign("R", True),) * 6),)


@pytest.mark.slow
def test_equal_modules_are_one_pile() -> None:
    drawn = cards(robot("lx4", modules="9"))
    assert len(drawn) < 8
    pile = drawn[-1]
    assert pile.folded
    assert pile.lines[0] == "modules 3 to 9: 7 like m2_platform"
    assert pile.lines[1].endswith("42 motors in all")


def tree(count: int) -> list[Card]:
    """Return a tree of many unlike modules, some of which branch."""
    out = [Card("ground", ("base",), (), "#888888", (), None)]
    for k in range(count):
        leg = Leg(3, (Sign("R", False),) * (1 + k % 12))
        out.append(Card(f"m{k}", ("module",), (leg,), "#3366aa", (k,), k if k % 9 else max(0, k - 4)))
    return out


@pytest.mark.parametrize("count", [1, 5, 64, 300])
def test_cards_are_on_the_page_and_none_covers_another(count: int) -> None:
    drawn = tree(count)
    places, width, height = layout(drawn)
    for place in places:
        assert 0 < place.x < place.x + place.width < width
        assert 0 < place.y < place.y + place.height < height
    for a, b in itertools.combinations(places, 2):
        apart = a.x + a.width <= b.x or b.x + b.width <= a.x
        assert apart or a.y + a.height <= b.y or b.y + b.height <= a.y
    if count == 64:
        assert 0.5 < width / height < 2  # a page, not a ribbon


def test_the_svg_names_every_module(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "tanev.svg"
    answer = call(capsys, "info", "tanev", "--plot", target)
    assert "nothing looks wrong" in answer.out  # the text comes as well
    words = {element.text for element in ElementTree.parse(target).iter() if element.text}
    assert {"m1_base", "m1_platform", "m2_platform", "dark: motor, R revolute, P prismatic"} <= words


@pytest.mark.parametrize(("ending", "head"), [("png", b"\x89PNG"), ("pdf", b"%PDF"), ("dot", b"digraph")])
def test_other_endings(tmp_path: Path, capsys: pytest.CaptureFixture[str], ending: str, head: bytes) -> None:
    target = tmp_path / f"five_bar.{ending}"
    call(capsys, "info", "five_bar", "--plot", target)
    assert target.read_bytes().startswith(head)
    assert [*tmp_path.iterdir()] == [target]


def test_dot_is_quoted() -> None:
    card = Card('a "name"\\', (), (), "#000000", (), None)
    assert '"a \\"name\\"\\\\"' in dot_of_cards([card])
    text = dot_of_cards(cards(robot("tanev")))
    assert len(re.findall(r"->", text)) == 2
    assert "3 x R P*" in text
