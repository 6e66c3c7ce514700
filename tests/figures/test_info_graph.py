"""`hybridyn info --plot`: the cards of a robot, where they stand, and the files that they become."""

import itertools
from pathlib import Path
from xml.etree import ElementTree

import pytest

import hybridyn
from hybridyn.figures.module_tree import Card, cards
from hybridyn.figures.structure import layout
from hybridyn.studies.check.loops import home_residuals
from tests import ROOT
from tests.robots.shipped import ROBOTS
from tests.support.command_line import call


def robot(name: str, **arguments: str) -> hybridyn.HybridRobot:
    return hybridyn.load(ROOT / f"urdf/{name}.urdf.xacro", xacro_args=arguments)


def cards_of(name: str, **arguments: str) -> tuple[hybridyn.HybridRobot, list[Card]]:
    loaded = robot(name, **arguments)
    return loaded, cards(loaded, home_residuals(loaded), ())


@pytest.mark.parametrize("name", ROBOTS)
def test_every_module_stands_on_one_card_above_what_it_stands_on(name: str) -> None:
    loaded, drawn = cards_of(name)
    assert sorted(k for card in drawn for k in card.modules) == [*range(len(loaded.modules))]
    for number, card in enumerate(drawn[1:], start=1):
        assert card.parent is not None
        assert card.parent < number
        below = loaded.modules[card.modules[0]].parent
        assert below == (drawn[card.parent].modules or (-1,))[-1]
    if not any(len(card.modules) > 1 for card in drawn):
        joints = [joint for card in drawn for leg in card.legs for _, joint in leg]
        assert sum(joint.endswith("*") for joint in joints) == len(loaded.motors)


def test_the_lx4_is_told_module_by_module() -> None:
    _, (ground, first, *rest) = cards_of("lx4")
    assert ground.what == "lx4: 4 modules, 24 freedoms, 24 motors"
    assert (first.title, first.what) == ("m1_platform", "module 1, 6 freedoms, 6 motors")
    assert {tuple(letter for letter, _ in leg) for leg in first.legs} == {("R", "R", "P")}
    assert len(first.legs) == 6
    assert first.legs[0][2] == ("P", "m1_leg1_slide*")
    assert [[*card.modules] for card in rest] == [[1], [2, 3]]


@pytest.mark.slow
def test_equal_modules_are_one_pile() -> None:
    drawn = cards_of("lx4", modules="9")[1]
    assert len(drawn) < 8
    pile = drawn[-1]
    assert pile.title == "m3_platform ... m9_platform"
    assert pile.what == "modules 3-9, one on the other, like module 2 (m2_platform); 42 motors in all"


def tree(count: int) -> list[Card]:
    """Return a tree of many unlike modules, some of which branch."""
    out = [Card((), None, "ground", "base")]
    for k in range(count):
        leg = (("R", "joint"),) * (1 + k % 12)
        out.append(Card([k], k if k % 9 else max(0, k - 4), f"m{k}", "module", (), [leg] * 3))
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


@pytest.mark.parametrize(("ending", "head"), [("png", b"\x89PNG"), ("pdf", b"%PDF")])
def test_other_endings(tmp_path: Path, capsys: pytest.CaptureFixture[str], ending: str, head: bytes) -> None:
    target = tmp_path / f"five_bar.{ending}"
    call(capsys, "info", "five_bar", "--plot", target)
    assert target.read_bytes().startswith(head)
    assert [*tmp_path.iterdir()] == [target]
