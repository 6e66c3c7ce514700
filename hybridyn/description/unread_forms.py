"""Recognise robot formats that hybridyn does not read, even in text that is not well-formed XML."""

from __future__ import annotations

import re

from .urdf.foreign import LEGACY_FORMS

#: Messages for files of other formats than URDF, by the name of the root element.
OTHER_FORMATS = {
    "mujocoinclude": "this is a part of an MJCF file (MuJoCo); name the file that includes it",
    "mujoco": "this is MJCF (MuJoCo)",
    "sdf": "this is SDF (Gazebo)",
}

COMMENT = re.compile(rb"<!--.*?(?:-->|\Z)", re.DOTALL)
ELEMENT = re.compile(rb"<([A-Za-z_][\w:.-]*)")


def unread_form(text: bytes) -> str:
    """Return the message for a text that is not well-formed XML, or "" if it is not recognised."""
    tags = dict.fromkeys(tag.decode("ascii", "replace") for tag in ELEMENT.findall(COMMENT.sub(b"", text)))
    root = next(iter(tags), "")
    if root in OTHER_FORMATS:
        return OTHER_FORMATS[root]
    found = [tag for tag in tags if tag in LEGACY_FORMS]
    if found:
        return f"and it holds <{found[0]}>, {LEGACY_FORMS[found[0]]}"
    return ""
