"""loops.py and closure_forms.py: each closure allows the motion of its name, wherever its frames are."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from hybridyn.description import Closure
from hybridyn.description.placement import placement_from, rotation_from_rpy
from tests import sketch
from tests.description.reading import refused
from tests.robot_texts import FOUR_BAR, LOOP, line_of, read_text, robot, save

Array = NDArray[np.float64]

ROUNDING = 1e-14  # a few products of rotation matrices of entries below one, offsets of a few metres
FELT = 1e-3  # a locked motion of 0.1 must show at least this much in some row

PREDECESSOR = "<predecessor link='coupler'><origin xyz='0.3 -0.2 0.1' rpy='0.4 -0.6 1.2'/></predecessor>"
SUCCESSOR = "<successor link='rocker'><origin xyz='-0.5 0.2 0.7' rpy='-1.1 0.3 0.5'/></successor>"
ORIGIN_A = placement_from(rotation_from_rpy(0.4, -0.6, 1.2), np.array([0.3, -0.2, 0.1]))
ORIGIN_B = placement_from(rotation_from_rpy(-1.1, 0.3, 0.5), np.array([-0.5, 0.2, 0.7]))
AXIS = np.array([1.0, -2.0, 2.0]) / 3
AXIS_TAG = "<axis xyz='1 -2 2'/>"


def loop(kind: str, *inside: str, attributes: str = "") -> str:
    return f"<loop name='l' type='{kind}' {attributes}>{PREDECESSOR}{SUCCESSOR}{''.join(inside)}</loop>"


def read_closure(folder: Path, element: str) -> Closure:
    (closure,) = read_text(folder, robot(element)).closures
    return closure


def rows(closure: Closure, relative: Array) -> Array:
    """Compute the rows as defined in `records.Closure`, with `relative` the position of origin B from A."""
    a_to_b = np.linalg.inv(closure.frame_a) @ ORIGIN_A @ relative @ np.linalg.inv(ORIGIN_B) @ closure.frame_b
    z = a_to_b[:3, 2]
    rotation = {
        "free": [],
        "perpendicular": [z[2]],
        "parallel": [z[0], z[1], 1 - z[2]],
        "fixed": list((a_to_b[:3, :3] - np.eye(3)).ravel()),
    }[closure.rotation]
    return np.array([*a_to_b[list(closure.translations), 3], *rotation])


def turn(axis: Array, angle: float) -> Array:
    return placement_from(sketch.turn(axis, angle), np.zeros(3))


def slide(direction: Array, distance: float) -> Array:
    return placement_from(np.eye(3), distance * direction)


SIDE = np.cross(AXIS, [1.0, 0.0, 0.0]) / np.linalg.norm(np.cross(AXIS, [1.0, 0.0, 0.0]))
MOTIONS = {
    "turn": turn(AXIS, 0.7),
    "turn about another axis": turn(SIDE, 0.7),
    "slide": slide(AXIS, 0.1),
    "slide aside": slide(SIDE, 0.1),
}
#: Number of rows, and what they allow.
ALLOWED: dict[str, tuple[int, set[str]]] = {
    "fixed": (6, set()),
    "revolute": (5, {"turn"}),
    "continuous": (5, {"turn"}),
    "prismatic": (5, {"slide"}),
    "cylindrical": (4, {"turn", "slide"}),
    "planar": (3, {"turn", "slide aside"}),
    "spherical": (3, {"turn", "turn about another axis"}),
    "point": (3, {"turn", "turn about another axis"}),
}


@pytest.mark.parametrize("kind", ALLOWED)
def test_a_loop_allows_the_motions_of_its_joint(tmp_path: Path, kind: str) -> None:
    closure, (count, allowed) = read_closure(tmp_path, loop(kind, AXIS_TAG)), ALLOWED[kind]
    assert (closure.kind, closure.link_a, closure.link_b) == (kind, "coupler", "rocker")
    rotation = {"free": 0, "perpendicular": 1, "parallel": 2, "fixed": 3}[closure.rotation]
    assert len(closure.translations) + rotation == count
    assert np.abs(rows(closure, np.eye(4))).max() < ROUNDING
    for name, motion in MOTIONS.items():
        error = np.abs(rows(closure, motion)).max()
        assert (error < ROUNDING) if name in allowed else (error > FELT), name


def test_universal_keeps_its_two_axes_perpendicular(tmp_path: Path) -> None:
    closure = read_closure(tmp_path, loop("universal", AXIS_TAG, "<axis2 xyz='0 3 4'/>"))
    assert closure.translations == (0, 1, 2)
    assert closure.rotation == "perpendicular"
    np.testing.assert_allclose(closure.frame_a[:3, 2], ORIGIN_A[:3, :3] @ AXIS, atol=ROUNDING)
    np.testing.assert_allclose(closure.frame_b[:3, 2], ORIGIN_B[:3, :3] @ [0, 0.6, 0.8], atol=ROUNDING)


def test_the_default_axis_is_x(tmp_path: Path) -> None:
    closure = read_closure(tmp_path, loop("revolute"))
    np.testing.assert_allclose(closure.frame_a[:3, 2], ORIGIN_A[:3, 0], atol=ROUNDING)
    np.testing.assert_allclose(closure.frame_b[:3, 2], ORIGIN_B[:3, 0], atol=ROUNDING)


X, Y, Z = np.eye(3)


@pytest.mark.parametrize(
    ("stated", "free", "locked"),
    [
        ("tx ty tz rx ry rz", [], [slide(X, 0.1), turn(Y, 0.5)]),
        ("ty tz", [slide(X, 0.1), turn(X, 0.5), turn(Z, 0.5)], [slide(Y, 0.1), slide(Z, 0.1)]),
        (
            "tx rx ry",
            [slide(Y, 0.1), slide(Z, 0.1), turn(Z, 0.5)],
            [slide(X, 0.1), turn(X, 0.5), turn(Y, 0.5)],
        ),
        (
            "tx ry rz",
            [slide(Y, 0.1), slide(Z, 0.1), turn(X, 0.5)],
            [slide(X, 0.1), turn(Z, 0.5), turn(Y, 0.5)],
        ),
        (
            "ty rx rz",
            [slide(X, 0.1), slide(Z, 0.1), turn(Y, 0.5)],
            [slide(Y, 0.1), turn(X, 0.5), turn(Z, 0.5)],
        ),
        ("tx tz ry rz", [slide(Y, 0.1), turn(X, 0.5)], [slide(X, 0.1), slide(Z, 0.1), turn(Z, 0.5)]),
        (
            "rx ry rz",
            [slide(X, 0.1), slide(Y, 0.1), slide(Z, 0.1)],
            [turn(X, 0.5), turn(Y, 0.5), turn(Z, 0.5)],
        ),
        ("rz ry", [slide(X, 0.1), slide(Z, 0.1), turn(X, 0.5)], [turn(Y, 0.5), turn(Z, 0.5)]),
    ],
)
def test_rows_lock_what_they_name(
    tmp_path: Path, stated: str, free: list[Array], locked: list[Array]
) -> None:
    closure = read_closure(tmp_path, loop("rows", attributes=f"rows='{stated}'"))
    assert np.abs(rows(closure, np.eye(4))).max(initial=0) < ROUNDING
    for motion in free:
        assert np.abs(rows(closure, motion)).max(initial=0) < ROUNDING
    for motion in locked:
        assert np.abs(rows(closure, motion)).max(initial=0) > FELT


def test_constraint_has_an_axis_on_each_side(tmp_path: Path) -> None:
    element = """<constraint name="c" type="revolute">
      <parent link="coupler"/><parent_origin xyz="0.3 -0.2 0.1" rpy="0.4 -0.6 1.2"/><parent_axis xyz="0 0 2"/>
      <child link="rocker"/><child_origin xyz="-0.5 0.2 0.7" rpy="-1.1 0.3 0.5"/>
      <child_axis xyz="0 -1 0"/></constraint>"""
    closure = read_closure(tmp_path, element)
    assert (closure.translations, closure.rotation) == ((0, 1, 2), "parallel")
    np.testing.assert_allclose(closure.frame_a[:3, 2], ORIGIN_A[:3, 2], atol=ROUNDING)
    np.testing.assert_allclose(closure.frame_b[:3, 2], -ORIGIN_B[:3, 1], atol=ROUNDING)
    np.testing.assert_allclose(closure.frame_b[:3, 3], ORIGIN_B[:3, 3])
    fixed = read_closure(tmp_path, element.replace("revolute", "fixed"))
    np.testing.assert_allclose(fixed.frame_a, ORIGIN_A)
    message = "'prismatic' is not read in <constraint>"
    refused(save(tmp_path, robot(element.replace("revolute", "prismatic"))), message)


ISAAC = """<loop_joint name="l" type="spherical">
  <link1 link="coupler" rpy="0.4 -0.6 1.2" xyz="0.3 -0.2 0.1"/>
  <link2 link="rocker" rpy="-1.1 0.3 0.5" xyz="-0.5 0.2 0.7"/>
</loop_joint>"""


def test_loop_joint_in_the_shapes_seen(tmp_path: Path) -> None:
    closure = read_closure(tmp_path, ISAAC)
    assert (closure.kind, closure.rotation, closure.link_a, closure.link_b) == (
        "spherical",
        "free",
        "coupler",
        "rocker",
    )
    np.testing.assert_allclose(closure.frame_a, ORIGIN_A)
    np.testing.assert_allclose(closure.frame_b, ORIGIN_B)
    twice = read_closure(tmp_path, ISAAC.replace("link2 ", "link1 "))
    assert (twice.link_a, twice.link_b) == ("coupler", "rocker")
    bare = read_closure(tmp_path, '<loop_joint name="l" type="3D" link1="coupler" link2="rocker"/>')
    assert (bare.rotation, bare.link_b) == ("free", "rocker")
    np.testing.assert_array_equal(bare.frame_b, np.eye(4))
    hinge = ISAAC.replace("spherical", "continuous").replace("<link1", AXIS_TAG + "<link1")
    np.testing.assert_allclose(
        read_closure(tmp_path, hinge).frame_a[:3, 2], ORIGIN_A[:3, :3] @ AXIS, atol=ROUNDING
    )
    damped = read_text(tmp_path, robot(ISAAC.replace("</loop", '<dynamics damping="1"/></loop')))
    assert any("damping of the cut joint" in note for note in damped.notes)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('type="revolute">\n    <pre', 'type="revolut">\n    <pre', "did you mean 'revolute'"),
        ('type="revolute">\n    <pre', ">\n    <pre", "attribute 'type' is missing"),
        ('<loop name="pin"', "<loop", "attribute 'name' is missing"),
        ('link="rocker"><', 'link="rockr"><', "did you mean 'rocker'"),
        ('link="rocker"><', 'link="coupler"><', "to itself"),
        ("successor", "succesor", "unknown in"),
        ('<origin xyz="1.5 0 0" rpy="0 0 0"/></pre', '<orgin xyz="1.5 0 0"/></pre', "did you mean 'origin'"),
        ('<origin xyz="1.5 0 0" rpy="0 0 0"/></pre', '<origin xzy="1.5 0 0"/></pre', "did you mean 'xyz'"),
        ('<axis xyz="0 0 1"/>\n  </loop>', '<axis xyz="0 0 0"/>\n  </loop>', "the axis is zero"),
        ('<axis xyz="0 0 1"/>\n  </loop>', '<axis xyz="0 nan 1"/>\n  </loop>', "not a finite number"),
        ('<axis xyz="0 0 1"/>\n  </loop>', '<axis2 xyz="0 0 1"/>\n  </loop>', "unknown in"),
        ('<axis xyz="0 0 1"/>\n  </loop>', '<axis xyz="0 0 1"/><axis xyz="0 0 1"/></loop>', "stated twice"),
        ('<loop name="pin"', '<loop rows="tx" name="pin"', "unknown attribute 'rows'"),
    ],
)
def test_nothing_in_a_loop_may_be_misspelt(tmp_path: Path, old: str, new: str, message: str) -> None:
    text = FOUR_BAR.replace(old, new)
    assert text != FOUR_BAR
    start = line_of(text, "<loop")
    assert refused(save(tmp_path, text), message).line in range(start, start + 5)


GEAR = (
    '<coupling name="gear" type="rolling"><predecessor link="coupler"/><successor link="rocker"/>'
    '<ratio value="6"/></coupling>'
)


def test_coupling_counts_both_ways_from_the_common_ancestor(tmp_path: Path) -> None:
    (coupling,) = read_text(tmp_path, robot(GEAR)).couplings
    assert coupling.terms == (("drive", 6.0), ("elbow", 6.0), ("swing", -1.0))
    assert coupling.offset == 0
    inner = GEAR.replace('successor link="rocker"', 'successor link="crank"')
    assert read_text(tmp_path, robot(inner)).couplings[0].terms == (("elbow", 6.0),)


@pytest.mark.parametrize(
    ("elements", "message"),
    [
        *(
            ([loop("rows", attributes=f"rows='{stated}'")], message)
            for stated, message in (
                ("tx rx", "not holonomic"),
                ("rz", "not holonomic"),
                ("tx tq", "unknown row 'tq'"),
                ("tx tx", "stated twice"),
                ("", "is empty"),
            )
        ),
        ([loop("universal", AXIS_TAG)], "<axis2> is missing"),
        ([LOOP, LOOP], "closure 'pin' is stated twice"),
        *(
            ([GEAR.replace(old, new)], message)
            for old, new, message in (
                ('"6"', '"0"', "couples nothing"),
                ('"6"', '"six"', "not a finite number"),
                ("rolling", "roling", "known: 'rolling'"),
                ("<ratio value", "<ratio valu", "did you mean 'value'"),
                ('link="rocker"', 'link="coupler"', "no movable joint"),
                ("ratio", "rati", "unknown in"),
                ('"rocker"', '"roker"', "did you mean 'rocker'"),
            )
        ),
    ],
)
def test_what_closes_or_couples_nothing_is_refused(tmp_path: Path, elements: list[str], message: str) -> None:
    refused(save(tmp_path, robot(*elements)), message)
