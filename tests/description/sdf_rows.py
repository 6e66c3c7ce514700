"""Files for each row of the table of forms of SDF on the page, and what they give."""

from collections.abc import Mapping
from typing import Any

import pytest

from tests.description.sdf_texts import joint, link, sdf
from tests.description.test_sdf_reading import (
    ABOUT_Z,
    ARM,
    CROSS,
    DRAKE,
    HELD,
    HINGE,
    IN_WORLD,
    INCLUDE,
    INSIDE,
    MIMIC,
    PART,
    PLACED,
    TIED,
    TWO,
)
from tests.description.test_sdf_reading import READ as SDF
from tests.description.test_sdf_refusals import ABOUT_X, AUTO, REFERENCE
from tests.description.test_sdf_shapes import BOX
from tests.description.test_sdf_shapes import robot as shaped

#: The text of a robot, or the texts of its files.
Files = str | Mapping[str, str]
#: What a file gives: parts of a robot that is read, with its notes, or words with which it is refused.
Case = tuple[Files, dict[str, Any] | str]
#: By the row's first cell, files.
Rows = dict[str, list[Case]]


def closes(kind: str) -> dict[str, Any]:
    """Return what a robot with one closure has."""
    return {"closures": [{"kind": kind}]}


def kinds(**of: str) -> dict[str, Any]:
    """Return kinds of joints."""
    return {"joints": {name: {"kind": kind} for name, kind in of.items()}}


OF_SDF = ' xmlns:drake="http://drake.mit.edu"'
FRAME, MOVES = '<frame name="f" attached_to="{}"/>', joint("j", "revolute", "base", "a")
OLD = "<pose frame='base'>1 0 0 0 0 0</pose>"
IN_1_6 = sdf(link("base"), link("a", OLD), TWO[2], MOVES, version="1.6")
TO_WORLD = joint("hold", "fixed", "base", "world", axis="")
UPSIDE = sdf(link("base"), link("a"), TO_WORLD, MOVES)
OF_ROTOR = ABOUT_Z.format(DRAKE)
AUTO_BOX = shaped("", [("", BOX)])
GEARED = "a gearbox of two hinges"
SPUN = ABOUT_Z.format("<dynamics><damping>1</damping></dynamics>")
#: Each row of SDF, and what is read of some files.
SDF_ROWS: Rows = {
    "`<frame>` and `<joint>` in `<world>`, also on static models": [
        (HELD, {"base": "fixed"}),
        (HELD.replace("</world>", '<model name="s"><static>1</static><link name="l"/></model></world>'), {
            "base": "fixed", "notes": {"'s'"},
        }),
    ],
    "a frame or pose of a model's elements relative to `world`": [
        (sdf(*TWO, MOVES, FRAME.format("world")), "do not know the frame of the world"),
        (sdf(*TWO, link("c", '<pose relative_to="world"/>')), "do not know the frame of the world"),
    ],
    "a joint whose child is `world`": [(UPSIDE, {"base": "fixed", "root": "base"})],
    "models in one `<world>` that its joints tie": [
        (TIED, {"links": ["world", "arm::base", "two::base"]}),
    ],
    "several models": [(IN_WORLD.format(ARM + ARM.replace('"arm"', '"two"')), "FILE#MODEL")],
    "nested models, names with `::`": [
        (PLACED["nested models"][0], {"links": {"in::a": {}, "in::b": {}}}),
        (
            sdf(link("base"), INSIDE, TWO[2], joint("to", "fixed", "base", "in::b", axis="")),
            {"base": "fixed"},
        ),
    ],
    '`<include merge="true">`': [
        (PLACED["a merged model"][0], {"links": {"arm": {}}}),
        (
            {"r.sdf": IN_WORLD.format(INCLUDE.replace("de>", 'de merge="1">', 1).format("part.sdf", "")),
             "part.sdf": PART},
            "links do not stand in a <world>",
        ),
    ],
    "`placement_frame` of models and includes; `canonical_link`": [
        (PLACED["an included model by its placement frame"][0], {"links": {"left::arm": {}}}),
        (sdf(*TWO, MOVES).replace('name="robot"', 'name="robot" canonical_link="a"'), {"base": "fixed"}),
    ],
    "`screw` with `<screw_thread_pitch>` [m per turn] or `<thread_pitch>` [rad/m, left-handed]; 1 m per turn "
    "without both": [case for name, case in SDF.items() if name.startswith("a screw with")],
    "`universal`, `revolute2`": [
        (sdf(*TWO, CROSS), kinds(lead_1="revolute", lead_2="revolute")),
        SDF["a revolute2 with axes of its own rotors"],
    ],
    "`gearbox` with `<gearbox_ratio>`, `<gearbox_reference_body>`": [
        SDF[GEARED],
        (SDF[GEARED][0].replace(ABOUT_Z.format(""), SPUN), {"notes": {"drops"}}),
        (sdf(*TWO, link("b"), joint("g", "gearbox", "a", "b", ABOUT_X + REFERENCE)), "'a_free' is between"),
    ],
    "parts of screws and gearboxes in other joints": [SDF["parts of screws in a hinge"]],
    "`piston`": [(sdf(*TWO, joint("j", "piston", "base", "a")), "type 'piston' is not read")],
    '`<inertial auto="true">` with collisions that are boxes, spheres, cylinders, capsules, ellipsoids, '
    "cones": [(AUTO_BOX, {"links": {"a": {"mass": pytest.approx(48.0)}}})],
    "the same with meshes, planes and other shapes": [
        (sdf(*TWO, AUTO.format("", shape)), "computes no inertia of")
        for shape in ("<mesh><uri>a.stl</uri></mesh>", "<plane/>")
    ],
    "a link named `world`": [SDF["a link called world"], SDF["a link called world with mass"]],
    "`<drake:rotor_inertia>`, `<drake:gear_ratio>` in a joint or in an `<axis>`": [
        (sdf(*TWO, joint("j", "revolute", "base", "a", *said, axis=""), more=OF_SDF),
         {"joints": {"j": {"rotor_inertia": 0.02, "gear_ratio": 50}}})
        for said in ((ABOUT_Z.format(""), DRAKE), (OF_ROTOR,))
    ],
    "`<gravity>false</gravity>` of a link": [SDF["links without weight"]],
    "an `<axis>` without `<xyz>`": [SDF["an axis without a direction is z"]],
    '`<pose frame="...">` of SDFormat 1.5 and 1.6': [
        (IN_1_6, {"links": ["base", "a"]}),
        (IN_1_6.replace('"1.6"', '"1.7"'), "frame ended with SDFormat 1.6"),
    ],
    "poses with fewer numbers; `<lower>` outside `<limit>`": [
        (sdf(*TWO, HINGE, link("c", "<pose>1 2 3</pose>")), "has 3 numbers instead of 6"),
        (
            sdf(*TWO, joint("j", "revolute", "base", "a", ABOUT_Z.format("<lower>1</lower>"), axis="")),
            "<lower>",
        ),
    ],
    "versions 1.3 to 1.12": [
        (sdf(*TWO, HINGE, version=f"1.{minor}"), {"joints": {"j": {}}}) for minor in range(3, 13)
    ],
    "`<mimic>` of an axis": [
        (sdf(*TWO, link("b"), CROSS, joint("f", "revolute", "base", "b", MIMIC.format("axis"), axis=""),
             version="1.11"), {"couplings": ["f"]}),
    ],
}  # fmt: skip
