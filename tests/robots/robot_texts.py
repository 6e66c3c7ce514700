"""Small robots as texts, for the tests of the readers."""

from pathlib import Path

from hybridyn.description import Description, read
from tests.support.files import save

__all__ = [
    "DOOR", "FOUR_BAR", "INERTIAL", "LOOP", "SECOND_HINGE", "TREE", "door", "line_of", "read_text", "robot",
    "save",
]  # fmt: skip

INERTIAL = (
    '<inertial><origin xyz="0.5 0 0" rpy="0 0 0"/><mass value="2"/>'
    '<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.25"/></inertial>'
)

LOOP = """
  <loop name="pin" type="revolute">
    <predecessor link="coupler"><origin xyz="1.5 0 0" rpy="0 0 0"/></predecessor>
    <successor link="rocker"><origin xyz="1 0 0"/></successor>
    <axis xyz="0 0 1"/>
  </loop>"""

TREE = f"""
  <link name="ground"/>
  <link name="crank">{INERTIAL}</link>
  <link name="coupler">{INERTIAL}</link>
  <link name="rocker">{INERTIAL}</link>
  <joint name="drive" type="revolute">
    <origin xyz="0 0 0" rpy="0 0 0.4"/>
    <parent link="ground"/><child link="crank"/>
    <axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" velocity="5" effort="10"/>
    <dynamics damping="0.1" friction="0.2"/>
  </joint>
  <joint name="elbow" type="continuous">
    <origin xyz="1 0 0"/><parent link="crank"/><child link="coupler"/><axis xyz="0 0 1"/>
  </joint>
  <joint name="swing" type="continuous">
    <origin xyz="1.5 0 0"/><parent link="ground"/><child link="rocker"/><axis xyz="0 0 1"/>
  </joint>"""
"""A planar four-bar, open: base 1.5, crank 1, coupler 1.5, rocker 1; `LOOP` closes it."""

#: A door about the horizontal y, so that it swings, with one hinge; `SECOND_HINGE` closes a loop over it.
DOOR = f"""
  <link name="wall"/>
  <link name="leaf">{INERTIAL}</link>
  <joint name="hinge" type="revolute">
    <parent link="wall"/><child link="leaf"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" velocity="20" effort="50"/>
  </joint>
  <transmission name="drive"><joint name="hinge"/><actuator name="motor"/></transmission>"""
SECOND_HINGE = """
  <loop name="second" type="revolute">
    <predecessor link="wall"><origin xyz="0 1.5 0"/></predecessor>
    <successor link="leaf"><origin xyz="0 1.5 0"/></successor>
    <axis xyz="0 1 0"/>
  </loop>"""

#: Its loop is open at home, which is at zero.
FOUR_BAR = f'<robot name="four_bar">{TREE}{LOOP}\n</robot>\n'
#: The same links, at a home that closes the loop.
CLOSED_FOUR_BAR = FOUR_BAR.replace(
    '<origin xyz="1 0 0"/><parent', '<origin xyz="1 0 0" rpy="0 0 -0.4"/><parent'
).replace('<origin xyz="1.5 0 0"/><parent', '<origin xyz="1.5 0 0" rpy="0 0 0.4"/><parent')


def robot(*parts: str) -> str:
    """Return the open four-bar with other elements below `<robot>`."""
    return f'<robot name="four_bar" xmlns:drake="http://drake">{TREE}\n' + "\n".join(parts) + "\n</robot>\n"


def door(hinges: int) -> str:
    """Return the door with one hinge or with two."""
    return f'<robot name="door">{DOOR}{SECOND_HINGE if hinges == 2 else ""}\n</robot>\n'


def read_text(folder: Path, text: str | bytes, **options: object) -> Description:
    """Read a text as a URDF."""
    return read(save(folder, text), **options)  # type: ignore[arg-type]


def line_of(text: str, part: str) -> int:
    """Return the line (from 1) where a part first stands in a text."""
    return text[: text.index(part)].count("\n") + 1
