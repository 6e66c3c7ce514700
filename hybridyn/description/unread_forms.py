"""Formats and forms that are known and not read, recognised in text that is no XML, too."""

from __future__ import annotations

import re

from .urdf.foreign import LEGACY_FORMS

#: Formats that are known and not read yet, by the name of the root element.
UNREAD_FORMATS = {"mujoco": "MJCF (MuJoCo)", "sdf": "SDF (Gazebo)", "mujocoinclude": "MJCF (MuJoCo)"}

COMMENT = re.compile(rb"<!--.*?(?:-->|\Z)", re.DOTALL)
ELEMENT = re.compile(rb"<([A-Za-z_][\w:.-]*)")


def not_read(root: str) -> str:
    """Say that a format is not read, or give an empty text where it is none that is known.

    Args:
        root: Name of the root element.
    """
    if root not in UNREAD_FORMATS:
        return ""
    name = UNREAD_FORMATS[root]
    return f"this is {name}, which is not read yet; convert the robot to URDF with <loop> closures"


def form_of(text: bytes) -> str:
    """Say what a text is that is no well-formed XML, or give an empty text where that is not known.

    Args:
        text: The text of a file.
    """
    tags = dict.fromkeys(tag.decode("ascii", "replace") for tag in ELEMENT.findall(COMMENT.sub(b"", text)))
    root = next(iter(tags), "")
    if told := not_read(root):
        return told
    found = [tag for tag in tags if tag in LEGACY_FORMS]
    if found:
        return f"and it holds <{found[0]}>, {LEGACY_FORMS[found[0]]}"
    if any(tag.startswith("drake:") for tag in tags) and b"xmlns:drake" not in text:
        return 'Drake\'s elements need xmlns:drake="http://drake.mit.edu" in <robot>'
    return ""
