"""What each format cannot say is listed, and nothing else: a table of features and formats.

Each robot of `features` is written and read back. Where a cell says "kept", it comes back equal and nothing
is listed; where it names losses, it does not come back equal, and each loss is one line with the element's
name. Not compared are words for messages (the kind of a closure), scales of couplings, 0 and infinity as
limits of speed and effort (both mean none), and fixed joints and massless links that are added: a robot of
MuJoCo hangs on the body of the world.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.conversion.home import home_of, poses_at
from hybridyn.description import Closure, Description, Joint
from hybridyn.description.placement import inverse, turned
from tests.conversion.features import FEATURES
from tests.conversion.judge import read_back
from tests.extras import needs

#: What a line on a loss starts with, by the word for it in the table.
LINES = {
    "continuous": "continuous joints, which MuJoCo does not have: read back as hinges",
    "planar": "planar joints are two slides and a hinge",
    "free": "floating joints have the name of their link and _free, and start at the world",
    "weld": "names of fixed joints, which MuJoCo does not have",
    "equal": "position limits without room between them, which MuJoCo refuses",
    "crossed": "position limits of which the lower is above the upper",
    "speed": "speed limits, which MuJoCo does not have",
    "limit": "limits of joints with several freedoms",
    "gear": "gear ratios: the rotor's inertia is written as that at the joint",
    "forces": "damping, friction and rotors of joints with several freedoms",
    "friction": "dry friction and rotors of joints with several freedoms",
    "turns": "springs of continuous joints: MuJoCo counts whole turns",
    "damper": "dampers are read back as viscous friction, to which they are added",
    "level": "levels of coulomb_friction are read back as dry friction, too",
    "slides": "closures are slides and a loop joint behind them, with massless links",
    "rows": "closures left out, since they have no row",
    "axes": "axes in which hybridyn reports the wrenches of closures",
    "mimic": "names of couplings, which are read back with those of joints",
    "base": "the base floats, which URDF cannot say",
    "pose": "pose of the floating base in the home posture",
    "gravity": "gravity of ",
    "mass": "moving links without mass, which MuJoCo refuses: written with",
    "body": "names of massless links that only carry a joint: they have no body",
    "thin": "links without inertia about an axis, which MuJoCo refuses: written with a small one",
    "light": "links with inertia but without mass: written with",
    "large": "inertias that no body can have: the largest principal moment is reduced",
    "load": "which part of a link is an added body",
    "name": "names that SDF does not allow, or that two things have, are changed",
    "closure": "names of closures that a joint has, too, are changed",
    "world": "names that MuJoCo keeps for itself: written with an underscore",
    "still": "mass and inertia of the world's link, which do not move",
}
#: What is lost of each feature in URDF, MJCF, SDF and USD.
TABLE = """
                                URDF        MJCF              SDF           USD
nothing                         kept        kept              kept          kept
revolute joint                  kept        kept              kept          kept
continuous joint                kept        continuous        kept          kept
prismatic joint                 kept        kept              kept          kept
spherical joint                 kept        kept              kept          kept
planar joint                    kept        kept              planar        kept
floating joint                  kept        kept              free          kept
home of a revolute joint        kept        kept              kept          kept
home of a continuous joint      kept        continuous        kept          kept
home of a prismatic joint       kept        kept              kept          kept
home of a spherical joint       kept        kept              kept          kept
home of a planar joint          kept        kept              planar        kept
home of a floating joint        kept        kept              free          kept
fixed joint                     kept        weld              kept          kept
lower limit                     kept        kept              kept          kept
upper limit                     kept        kept              kept          kept
limits of a slide               kept        kept              kept          kept
equal limits                    kept        equal             kept          kept
crossed limits                  crossed     crossed           crossed       crossed
speed limit                     kept        speed             kept          kept
speed limit of zero, none       kept        kept              kept          kept
effort limit                    kept        kept              kept          kept
effort limit of a motor         kept        kept              kept          kept
effort limit of zero, none      kept        kept              kept          kept
viscous friction                kept        kept              kept          kept
dry friction                    kept        kept              kept          kept
rotor                           kept        kept              kept          kept
geared rotor                    kept        gear              kept          kept
gear without rotor              kept        gear              kept          kept
viscous friction, spherical     kept        kept              forces        kept
viscous friction, planar        kept        kept              planar+forces kept
viscous friction, floating      kept        kept              free+forces   kept
dry friction, spherical         kept        friction          forces        kept
dry friction, planar            kept        friction          planar+forces kept
dry friction, floating          kept        friction          free+forces   kept
rotor, spherical                kept        friction          forces        kept
rotor, planar                   kept        friction          planar+forces kept
rotor, floating                 kept        friction          free+forces   kept
gear, spherical                 kept        gear              forces        kept
gear, planar                    kept        gear              planar+forces kept
gear, floating                  kept        gear              free+forces   kept
position limit, spherical       limit       limit             limit         limit
position limit, planar          limit       limit             planar+limit  limit
position limit, floating        limit       limit             free+limit    limit
speed limit, spherical          limit       speed             limit         limit
speed limit, planar             kept        speed             planar+limit  limit
speed limit, floating           kept        speed             free+limit    limit
effort limit, spherical         limit       limit             limit         limit
effort limit, planar            kept        limit             planar+limit  limit
effort limit, floating          kept        limit             free+limit    limit
spring                          kept        kept              kept          kept
spring with a rest              kept        kept              kept          kept
spring away from home           kept        kept              kept          kept
spring of a slide               kept        kept              kept          kept
spring, continuous              kept        continuous+turns  kept          kept
damper                          kept        damper            kept          kept
damper over friction            kept        damper            kept          kept
coulomb level                   kept        level             kept          kept
coulomb width                   kept        kept              kept          kept
coulomb over friction           kept        level             kept          kept
stribeck friction               kept        kept              kept          kept
stop                            kept        kept              kept          kept
ground contact                  kept        kept              kept          kept
closure fixed                   kept        kept              kept          kept
closure revolute                kept        kept              kept          kept
closure prismatic               kept        kept              kept          kept
closure cylindrical             kept        kept              slides        kept
closure universal               kept        kept              kept          kept
closure planar                  kept        kept              slides        kept
closure spherical               kept        kept              kept          kept
closure rows_x                  kept        kept              slides        kept
closure rows_yz                 kept        kept              slides        kept
closure rows_y_perpendicular    kept        kept              slides        kept
closure rows_xz_parallel        kept        kept              slides        kept
closure rows_x_fixed            kept        kept              slides        kept
closure rows_parallel           kept        kept              slides        kept
closure rows_fixed              kept        kept              slides        kept
closure without a row           rows        rows              rows          rows
closure from the base           kept        kept              kept          kept
closure to the base             kept        kept              kept          kept
closure at a massless end       kept        kept              kept          kept
author's axes, fixed            kept        kept              kept          kept
author's axes, spherical        kept        kept              kept          kept
author's axes, revolute         kept        kept              kept          kept
author's axes, prismatic        kept        kept              kept          kept
author's axes, universal        kept        axes              kept          kept
author's axes, rows_xz_parallel kept        kept              slides        kept
oblique axes, revolute          kept        axes              kept          kept
oblique axes, rows_x_fixed      axes        axes              slides        kept
mimic                           kept        kept              kept          kept
mimic with an offset            kept        kept              kept          kept
coupling with a name            mimic       kept              mimic         kept
coupling of three               kept        kept              kept          kept
coupling of one                 kept        kept              kept          kept
coupling with a zero            kept        kept              kept          kept
endless gear                    kept        kept              kept          kept
floating base                   base        kept              kept          kept
home of a floating base         base+pose   kept              kept          kept
usual gravity                   kept        kept              kept          kept
other gravity                   gravity     kept              kept          kept
no gravity                      gravity     kept              kept          kept
no motor                        kept        kept              kept          kept
motors in another order         kept        kept              kept          kept
link without mass               kept        mass              kept          kept
link without mass that carries  kept        body              kept          kept
base without mass               kept        kept              kept          kept
point mass                      kept        thin              kept          kept
inertia without mass            kept        light             kept          kept
inertia that no body has        kept        large             kept          kept
added body                      load        load              load          load
name with a colon               kept        kept              name          kept
name with other letters         kept        kept              kept          kept
link named as a joint           kept        kept              name          kept
closure named as a joint        kept        kept              name          closure
link named world                kept        world             name          kept
base named world                kept        still             still         kept
robot without a name            kept        kept              kept          kept
"""
ENDINGS = {".urdf": "", ".xml": "mjcf", ".sdf": "", ".usda": "usd"}
CELLS = {
    (line[:32].strip(), ending): cell.split("+")
    for line in TABLE.splitlines()[2:]
    for ending, cell in zip(ENDINGS, line[32:].split(), strict=True)
}
#: A pose passes through angles, quaternions and degrees once.
SAME = 1e-12
GRAVITY, AT_ORIGIN = (0.0, 0.0, -9.81), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
OF_JOINTS = (
    "kind", "parent", "child", "lower", "upper", "speed_limit", "effort_limit", "damping", "friction",
    "rotor_inertia", "gear_ratio", "placement",
)  # fmt: skip


def facts(d: Description, of: Description) -> dict[str, Any]:
    """Return what a robot is, by words; massless links and fixed joints only if another one has them, too."""
    out: dict[str, Any] = {
        "base": (d.base, d.base_home or AT_ORIGIN if d.base == "floating" else ()),
        "gravity": d.gravity or GRAVITY, "motors": d.motors, "name": d.name or "robot",
        "crossed": d.crossed, "added bodies": [load.name for load in d.loads],
        "springs": {spring.name: (spring.stiffness, spring.rest) for spring in d.springs},
        "effects": {name: numbers for name, numbers in d.effects if name != "spring"},
        "couplings": dict(_couplings(d)), "closures": {c.name: _of_closure(c) for c in d.closures},
    }  # fmt: skip
    names = {one.name for one in (*of.links, *of.joints)}
    for link in d.links:
        if link.name in names or link.mass or link.inertia.any():
            out[f"link {link.name}"] = (link.mass, link.com, link.inertia)
    for joint in d.joints:
        if joint.name in names or joint.kind != "fixed":
            out[f"joint {joint.name}"] = _of_joint(d, joint)
    for word, posture in (("zero", {}), ("home", d.home)):
        poses = poses_at(d, posture)
        root = inverse(poses.get(of.root, np.eye(4)))
        out[f"poses at {word}"] = {name: root @ pose for name, pose in poses.items() if name in names}
    return out


def _of_joint(d: Description, joint: Joint) -> list[Any]:
    axis = joint.axis if joint.kind in ("revolute", "continuous", "prismatic") else ()
    home = () if joint.kind == "fixed" else home_of(d, joint)
    return [axis, home, *(getattr(joint, word) for word in OF_JOINTS)]


def _couplings(d: Description) -> Iterator[tuple[str, dict[str, float]]]:
    for coupling in d.couplings:
        terms = {name: factor for name, factor in coupling.terms if factor}
        scale = next(iter(dict(sorted(terms.items())).values()))
        yield coupling.name, {name: x / scale for name, x in (*terms.items(), ("", coupling.offset))}


def _of_closure(c: Closure) -> list[Any]:
    """Return the rows of a closure in its author's axes, which may turn about a free axis."""
    locked = c.turn[:, c.translations] @ c.turn[:, c.translations].T
    axis = c.turn[:, 2] if c.rotation in ("parallel", "perpendicular") else ()
    other = turned(c.frame_b, c.turn.T) if c.rotation != "perpendicular" else c.frame_b[:, 2:]
    return [c.link_a, c.link_b, c.rotation, locked, axis, turned(c.frame_a, c.turn.T), other]


def same(a: Any, b: Any) -> bool:
    """Say whether two facts are equal, numbers to rounding."""
    if isinstance(a, dict):
        return isinstance(b, dict) and a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    if isinstance(a, list | tuple):
        return isinstance(b, list | tuple) and len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, str) or isinstance(b, str):
        return bool(a == b)
    x, y = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    return x.shape == y.shape and np.allclose(x, y, rtol=SAME, atol=SAME)


def changed(before: Description, after: Description) -> list[str]:
    """Return the words of what did not come back equal."""
    ours, theirs = facts(before, before), facts(after, before)
    words = sorted(ours.keys() | theirs.keys())
    return [word for word in words if not same(ours.get(word, ""), theirs.get(word, ""))]


def test_the_table_has_every_feature() -> None:
    assert {name for name, _ in CELLS} == FEATURES.keys()
    assert {word for cell in CELLS.values() for word in cell} == LINES.keys() | {"kept"}


def cases() -> Iterator[Any]:
    """Yield the cells; those in which USD keeps a feature are slow, since a process of its own reads it."""
    for (name, ending), cell in CELLS.items():
        kept = ending == ".usda" and cell == ["kept"]
        yield pytest.param(name, ending, marks=[pytest.mark.slow] if kept else [])


@pytest.mark.parametrize(("name", "ending"), [*cases()])
def test_what_does_not_come_back_is_listed(name: str, ending: str, tmp_path: Path) -> None:
    if ENDINGS[ending]:
        needs(ENDINGS[ending])
    element, before = FEATURES[name]
    after, out = read_back(before, tmp_path / f"robot{ending}")
    listed = dict(zip(CELLS[name, ending], out.losses, strict=False))
    if CELLS[name, ending] == ["kept"]:
        assert (changed(before, after), out.losses) == ([], ())
        return
    assert changed(before, after)
    assert len(out.losses) == len(CELLS[name, ending])
    for word, line in listed.items():
        assert line.startswith(LINES[word])
        assert element in line.removeprefix(LINES[word])


def test_a_base_that_moves_as_prescribed_is_listed(tmp_path: Path) -> None:
    robot = hybridyn.load("five_bar", base="moving")
    line = "the base moves as prescribed: written as one at rest"
    assert line in hybridyn.convert(robot, tmp_path / "robot.urdf").losses
    assert line not in hybridyn.convert(robot, tmp_path / "robot.urdf", base="floating").losses
