"""What each format cannot say is listed, and nothing else; the home posture comes back from every format."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hybridyn.conversion.home import poses_at
from hybridyn.description import Description, Joint, Link
from hybridyn.description.placement import inverse, placement_from
from hybridyn.description.records import JointKind
from tests.conversion.judge import read_back
from tests.extras import needs

AT = placement_from(np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), np.array([0.1, 0.2, 0.3]))
INERTIA = np.diag([0.02, 0.03, 0.04])
#: Home positions by kind of the first joint; angles with whole sines, which lose no digit.
HOMES: dict[JointKind, tuple[float, ...]] = {
    "revolute": (0.3,), "prismatic": (0.3,), "spherical": (0.0, 0.6, 0.0, 0.8),
    "planar": (0.5, -0.4, 0.6, 0.8),
    "floating": (0.1, 0.2, 0.3, 0.0, 0.6, 0.0, 0.8),
}  # fmt: skip
#: What a format cannot say of a joint of a kind, or of any joint ("").
LOST = {
    (".sdf", "planar"): "planar joints are two slides and a hinge: 'first'",
    (".sdf", "floating"): (
        "floating joints have the name of their link and _free, and start at the world: 'first'"
    ),
    (".xml", ""): "dampers are read back as viscous friction, to which they are added: 'hinge'",
}
EXTRAS = {".xml": "mjcf", ".usda": "usd"}
#: A pose passes through angles, quaternions and degrees once.
SAME = 1e-14


@pytest.mark.parametrize("kind", HOMES)
@pytest.mark.parametrize("ending", [".sdf", ".xml", ".usda", ".urdf"])
def test_homes_come_back_and_losses_are_listed(kind: JointKind, ending: str, tmp_path: Path) -> None:
    if ending in EXTRAS:
        needs(EXTRAS[ending])
    links = tuple(Link(name, 1.5, np.array([0.1, 0, 0.2]), INERTIA) for name in ("base", "cart", "rod"))
    joints = (
        Joint("first", kind, "base", "cart", AT, np.array([0.0, 0.0, 1.0])),
        Joint("hinge", "revolute", "cart", "rod", AT, np.array([0.0, 1.0, 0.0])),
    )
    before = Description(
        "robot", links, joints, motors=("hinge",), home={"first": HOMES[kind], "hinge": (0.2,)},
        effects=(("damper", {"coefficient": {"hinge": 2.0}}),),
    )  # fmt: skip
    after, out = read_back(before, tmp_path / f"robot{ending}")
    assert set(out.losses) == {LOST[key] for key in ((ending, kind), (ending, "")) if key in LOST}
    ours, theirs = (poses_at(d, d.home) for d in (before, after))
    for name in ("cart", "rod"):
        there = inverse(theirs["base"]) @ theirs[name]
        np.testing.assert_allclose(there, ours[name], rtol=0, atol=SAME)
    friction = {joint.name: joint.damping for joint in after.joints}
    assert friction["hinge"] == (2.0 if ending == ".xml" else 0.0)
