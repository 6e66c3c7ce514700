"""Refuse what MuJoCo would not read: names that occur twice, and bodies nested too deep."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from xml.etree import ElementTree as ET

from ...description.names import listed
from ...description.poses import outwards
from ...description.records import Description
from ...errors import ModelError

#: Most bodies one inside the other; XML readers stop at 256 elements.
DEEPEST = 240

#: Elements that share their names.
GROUPS = (("body",), ("joint", "freejoint"), ("site",), ("connect", "weld", "joint", "tendon"), ("fixed",))


def check_depth(d: Description) -> None:
    """Refuse robots that are too deep to be written as nested bodies.

    Raises:
        ModelError: More than `DEEPEST` joints follow one another.
    """
    depth = {d.root: 1}
    for joint in outwards(d.joints, [d.root]):
        depth[joint.child] = depth[joint.parent] + 1
        if depth[joint.child] > DEEPEST:
            raise ModelError(
                f"more than {DEEPEST} joints one behind the other, up to link '{joint.child}'; bodies of "
                "MJCF stand inside one another, and XML readers go no deeper",
                element=joint.child,
            )


def check_names(root: ET.Element) -> None:
    """Refuse names that would be mixed up.

    Raises:
        ModelError: A name occurs twice.
    """
    worldbody, equality = root.find("worldbody"), root.find("equality")
    for tags in GROUPS:
        place = equality if "weld" in tags else root if tags == ("fixed",) else worldbody
        found = [] if place is None else [str(x.get("name")) for x in place.iter() if x.tag in tags]
        _refuse([name for name, count in Counter(found).items() if count > 1], f"<{tags[0]}>")


def _refuse(names: Iterable[str], what: str) -> None:
    if names := list(names):
        raise ModelError(
            f"in MJCF, {what} would have these names twice: {listed(names)}; rename them in the robot's file",
            element=names[0],
        )
