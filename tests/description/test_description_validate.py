"""validate.py: every format gives one tree with known names; an unphysical inertia is noted."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.description.reading import refused
from tests.robot_texts import FOUR_BAR, INERTIAL, TREE, read_text, save


def joint(name: str, parent: str, child: str, kind: str = "fixed") -> str:
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/></joint>'


def links(*names: str) -> str:
    return "".join(f'<link name="{name}"/>' for name in names)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("", "the robot has no link"),
        (links("a", "a"), "link 'a' is stated twice (first in line 1)"),
        (links("a", "b", "c") + joint("j", "a", "b") + joint("j", "a", "c"), "joint 'j' is stated twice"),
        (links("a", "base") + joint("j", "bas", "a"), "unknown parent link 'bas' (did you mean 'base'?)"),
        (links("a", "b") + joint("j", "a", "x"), "unknown child link 'x'"),
        (links("a", "b") + joint("j", "a", "a"), "joins link 'a' to itself"),
        (
            links("a", "b", "c") + joint("j", "a", "c") + joint("k", "b", "c"),
            "already the child of joint 'j'",
        ),
        (
            links("a", "b") + joint("j", "a", "b") + joint("k", "b", "a"),
            "form a cycle and no link is the root",
        ),
        (
            links("r", "a", "b") + joint("j", "a", "b") + joint("k", "b", "a"),
            "links 'a', 'b' form a cycle of joints apart from the root 'r'",
        ),
        (links("a", "b"), "2 links have no parent joint: 'a', 'b'"),
        (links(*(f"l{i}" for i in range(20))), "'l7' and 12 more"),
    ],
)
def test_is_refused(tmp_path: Path, body: str, message: str) -> None:
    refused(save(tmp_path, f'<robot name="r">{body}</robot>'), message)


def test_a_long_chain_is_read_without_recursion(tmp_path: Path) -> None:
    count = 6000
    body = links(*(f"l{i}" for i in range(count)))
    body += "".join(joint(f"j{i}", f"l{i}", f"l{i + 1}", "continuous") for i in range(count - 1))
    assert len(read_text(tmp_path, f'<robot name="r">{body}</robot>').joints) == count - 1


@pytest.mark.parametrize(
    ("moments", "physical"),
    [
        ("ixx='1' iyy='1' izz='1'", True),
        ("ixx='1' iyy='1' izz='2.001'", True),
        ("ixx='0' iyy='0' izz='1'", False),
        ("ixx='1' iyy='1' izz='2.1'", False),
        ("ixx='1' iyy='1' izz='-1'", False),
        ("ixx='1' iyy='1' izz='1' ixy='1.5'", False),
        ("ixx='0' iyy='0' izz='0'", True),
    ],
)
def test_unphysical_inertia_is_noted(tmp_path: Path, moments: str, physical: bool) -> None:
    inertial = f"<inertial><mass value='1'/><inertia {moments}/></inertial>"
    description = read_text(tmp_path, f'<robot name="r"><link name="a">{inertial}</link></robot>')
    assert any("unphysical inertia" in note for note in description.notes) != physical


def test_a_mass_without_inertia_is_a_point(tmp_path: Path) -> None:
    text = FOUR_BAR.replace(INERTIAL, '<inertial><mass value="2"/></inertial>', 1)
    description = read_text(tmp_path, text)
    assert description.links[1].mass == 2
    assert not description.links[1].inertia.any()
    assert any("point mass" in note for note in description.notes)


def test_couplings_need_joints_with_one_freedom(tmp_path: Path) -> None:
    free = '<link name="x"/><joint name="f" type="floating"><parent link="rocker"/><child link="x"/></joint>'
    mimic = TREE.replace('<origin xyz="1 0 0"/>', '<origin xyz="1 0 0"/><mimic joint="f"/>')
    refused(save(tmp_path, f'<robot name="r">{mimic}{free}</robot>'), "joint 'f' is floating")
