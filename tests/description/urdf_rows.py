"""Files for each row of the tables of forms of Drake and URDF on the page, and what they give."""

from typing import Any

import numpy as np

from tests.description import test_gazebo_joints as blocks
from tests.description import test_urdf_dialects as dialects
from tests.description.sdf_rows import OF_SDF, Rows, closes, kinds
from tests.description.sdf_texts import sdf
from tests.description.test_bushings import IN_SDF, WITH_BUSHING
from tests.description.test_hyrodyn_types import mechanism
from tests.description.test_sdf_reading import (
    HINGE,
    TWO,
)
from tests.description.test_sdf_reading import READ as SDF
from tests.description.test_transmissions import ARM as JOINT
from tests.description.test_transmissions import OF_DRAKE, REDUCTION, ROTOR, SIMPLE
from tests.description.test_urdf_dialects import MOTOR, closed, frame, mates
from tests.description.test_urdf_drake import CONSTRAINT, HINGED, SAME, SCREW, TENDON, tree
from tests.description.test_urdf_forms import (
    AXLE,
    BESIDE,
    COMMANDED,
    DOJO,
    FOLLOWS,
    FUSION,
    HINGES,
    LIMIT,
    NAMED,
    PINS,
    SOLVED,
    SPHERICAL,
    WRIST,
    pair,
)
from tests.description.test_urdf_forms import CONSTRAINT as OF_URDFDOM
from tests.robots.robot_texts import INERTIAL, robot


def effect(name: str, *notes: str) -> dict[str, Any]:
    """Return what a robot with one effect has."""
    return {"effects": [name], "notes": {*notes}} if notes else {"effects": [name]}


TIPS = frame("tip", "coupler", "1 0 0"), frame("pin", "rocker", "1 0 0")
WELD = SAME["weld_constraint1"][0]
LOOSE = TENDON.replace('upper_limit value="0.7"', 'upper_limit value="0.9"')
FOLLOWER = dialects.READ["drake:mimic and rotor"]
OF_DRAKE_ROWS: Rows = {
    "`<drake:ball_constraint>`": [
        (robot(CONSTRAINT), closes("spherical")), SDF["a ball constraint of Drake"],
    ],
    "`<drake:weld_constraint>` with `_body_A`, `_body_B`, `_X_AP`, `_X_BQ` (`xyz`, `rpy`)": [
        (robot(*TIPS, WELD), closes("fixed")),
        (robot(*TIPS, WELD.replace("drake:", ":")), closes("fixed") | {"notes": {"begins with ':'"}}),
    ],
    "`<drake:tendon_constraint>` with equal limits, without stiffness and damping": [
        (robot(TENDON), {"couplings": ["tendon_constraint1"]}),
    ],
    "other `<drake:tendon_constraint>`": [(robot(LOOSE), "may vary")],
    "`<drake:joint>` of type `ball`": [
        (tree("ball", AXLE), kinds(j="spherical") | {"notes": {"the axis of ball joint 'j' is ignored"}}),
    ],
    "`<drake:joint>` of type `universal`": [
        (
            tree("universal", AXLE),
            kinds(j_1="revolute", j_2="revolute") | {"notes": {"turns about x, then y"}},
        ),
    ],
    "`<drake:joint>` of type `planar`": [
        (tree("planar", AXLE), kinds(j="planar")),
        (
            tree("planar", AXLE, '<dynamics damping="1 2 3"/>'),
            kinds(j_x="prismatic", j_y="prismatic", j_turn="revolute"),
        ),
    ],
    "`<drake:joint>` of type `screw` with `<drake:screw_thread_pitch>` [m per turn]": [
        (tree("screw", SCREW), {"joints": {"j": {"kind": "screw", "pitch": 0.4 / (2 * np.pi)}}}),
    ],
    "`<drake:joint>` of type `curvilinear`": [(tree("curvilinear"), "along a curve is not read")],
    "`<drake:mimic>`": [FOLLOWER],
    "`<drake:rotor_inertia>`, `<drake:gear_ratio>`": [
        FOLLOWER,
        (JOINT.format(OF_DRAKE, ""), {"joints": {"j": {"rotor_inertia": 2e-4, "gear_ratio": 160}}}),
    ],
    "`<drake:distance_constraint>`": [
        (robot("<drake:distance_constraint/>"), "two balls"),
        (sdf(*TWO, HINGE, "<drake:distance_constraint/>", more=OF_SDF), "not read in SDF"),
    ],
    "`<drake:linear_spring_damper>`": [(HINGED, effect("line_springs")), SDF["a spring of Drake"]],
    "`<drake:linear_bushing_rpy>`": [
        (WITH_BUSHING, effect("bushings", "closes no loop")), (IN_SDF, effect("bushings", "closes no loop")),
    ],
    "`world` as the parent of a joint, also without such a link": [
        (JOINT.format("", ""), {"base": "fixed", "root": "world"}),
        (JOINT.format("", '<link name="world"/>'), {"base": "fixed", "root": "world"}),
    ],
}  # fmt: skip

FRAMES_OF = {"r.urdf": closed(dialects.TIP)}
OF_3RUS2 = dialects.SUBMECHANISM.replace("NUMERICAL", "3RUS2").split("  loop")[0]
TWO_ROOTS = robot(f'<link name="table">{INERTIAL}</link>')
SIDE = {"r.urdf": closed()}
SPINS = WRIST.format(INERTIAL, "{}", 1e-5, 3e-5)
NUMBERLESS = "<mechanicalReduction>reduction</mechanicalReduction>"
SPINNING = SPINS.format("FourBarLinkage")
BLOCK = dialects.GAZEBO
URDF_ROWS: Rows = {
    "`<constraint>` of each type of `<loop>` but `rows`": [
        (robot(OF_URDFDOM.format("revolute", "0 0 1", "0 0 1")), closes("revolute")),
        (robot(OF_URDFDOM.format("prismatic", "0 1 0", "0 1 0")), closes("prismatic")),
        (robot(OF_URDFDOM.format("rows", "0 1 0", "0 1 0")), "known"),
    ],
    "`<loop_joint>` with `<link1>`, `<link2>`": [
        (robot(MOTOR, DOJO.replace('<dynamics damping="1.0"/>', "")), closes("continuous")),
        (closed(MOTOR, DOJO), {"joints": {"pin": {"damping": 1.0}}}),
        (robot(DOJO.replace('<dynamics damping="1.0"/>', LIMIT)), {"notes": {"the limits of closure 'pin'"}}),
    ],
    "`<loop_joint>` with `<parent_origin>`, `<child_origin>`": [
        (robot(FUSION.format("revolute", AXLE)), closes("revolute")),
    ],
    "`<joint>` in `<gazebo>` of type `fixed`, `revolute`, `continuous`, `prismatic`, `ball`, `universal`": [
        (closed(MOTOR, BLOCK.format(kind, "0 0 0", axis)), {"closures": [{"rotation": rotation}]})
        for kind, axis, rotation in (
            ("fixed", "", "fixed"), ("revolute", dialects.AXIS, "parallel"),
            ("continuous", dialects.AXIS, "parallel"),
            ("prismatic", dialects.AXIS, "fixed"), ("ball", "", "free"),
            ("universal", f"{dialects.AXIS}<axis2><xyz>1 0 0</xyz></axis2>", "perpendicular"),
        )
    ],
    "the same of type `screw`": [
        (blocks.robot(*blocks.PRESS, blocks.SCREW.format("")), kinds(thread="screw") | closes("fixed")),
    ],
    "the same of type `gearbox`": [
        (
            blocks.robot(*blocks.WHEELS, blocks.gazebo(
                "g", "gearbox", "one", "two", blocks.BOX.format("base")
                + "<axis><xyz>0 0 1</xyz><dynamics><damping>1</damping></dynamics></axis>", axis="",
            )),
            {"couplings": ["g"], "notes": {"drops"}},
        ),
    ],
    "the same with the `world` as `<parent>` or `<child>`": [
        (blocks.robot(*blocks.WHEELS, blocks.gazebo("hold", "fixed", "world", "base", axis="")), {
            "base": "fixed",
        }),
        (blocks.robot(*blocks.WHEELS, blocks.gazebo("hold", "revolute", "one", "world")), {
            "notes": {"holds a link in the world"},
        }),
    ],
    "frames `closing_x_1`, `closing_x_2`; the same with `_z`": [
        (robot(MOTOR, mates("1", "2")), {"closures": [{"rotation": "free"}], "notes": {"are read as balls"}}),
        (robot(MOTOR, dialects.HINGED), {"closures": [{"rotation": "parallel"}]}),
    ],
    "frames `loop_x_1` and `loop_x_2`, `x_cut_1` and `x_cut_2`, also `_a`, `_b`": [
        (robot(MOTOR, pair(*ends)), {"closures": [{"rotation": "free"}]})
        for ends in (
            ("loop_x_1", "loop_x_2"), ("x_cut_1", "x_cut_2"), ("loop_x_a", "loop_x_b"),
            ("x_cut_a", "x_cut_b"),
        )
    ],
    '`<joint type="spherical">`': [
        (SPHERICAL.format(' friction="0.5"'), {
            "joints": {"neck": {"kind": "spherical", "damping": 0.25}},
            "notes": {"drops the dry friction of joint 'neck'"},
        }),
    ],
    "`<command_interface>` of joints in `<ros2_control>`": [
        (robot(COMMANDED.format("", "")), {"motors": ("drive", "swing")}),
        (robot(COMMANDED.format("", ""), MOTOR), {"motors": ("drive",)}),
    ],
    '`mimic="true"`, `mimic="false"` of joints in `<ros2_control>`': [
        (robot(COMMANDED.format(' mimic="true"', "")), {"notes": {"but follows no joint"}}),
        (robot(COMMANDED.format(' mimic="false"', "")).replace(*FOLLOWS), {"notes": {"by its <mimic> here"}}),
    ],
    "`loop_closures.yaml` with `closures`, `independent`": [
        (SIDE | {"loop_closures.yaml": HINGES + SOLVED}, closes("revolute") | {"motors": ("drive",)}),
    ],
    "`loop_closures.yaml` with `pin_loops`, `ball_loops`, `ball_upgrades`, `actuated_joints`": [
        (SIDE | {"loop_closures.yaml": PINS}, closes("revolute") | {"motors": ("drive",)}),
        ({"r.urdf": BESIDE["a ball"][0], "loop_closures.yaml": BESIDE["a ball"][1]}, BESIDE["a ball"][2]),
    ],
    "`submechanisms.yml` of type `NUMERICAL`": [
        (FRAMES_OF | {"submechanisms.yml": dialects.submechanisms("elbow", "tip", "rocker", "tx ty")}, {
            "closures": [{"translations": (0, 1)}],
        }),
    ],
    "of types `rrPr`, `2SPU+1U`, `2SPRR+1U`, `6UPS`": [
        (mechanism(kind)[0], {"closures": [*[{"kind": joins}] * legs]})
        for kind, joins, legs in (
            ("rrPr", "rows", 1), ("2SPU+1U", "spherical", 2), ("2SPRR+1U", "universal", 2),
            ("6UPS", "spherical", 6),
        )
    ],
    "of other types with passive joints that nothing moves": [
        (FRAMES_OF | {"submechanisms.yml": OF_3RUS2}, "3RUS2"),
    ],
    "`$(eval ...)` in xacro": [
        (
            {"r.urdf.xacro": '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'
             '<xacro:arg name="n" default="2"/><link name="a$(eval n * 2 if pi > 3 and true else 0)"/>'
             "</robot>"},
            {"links": ["a4"]},
        ),
    ],
    "rotors of the actuators of a DifferentialTransmission or FourBarLinkageTransmission": [
        (SPINNING, kinds(m1="revolute", m2="revolute")),
        (SPINNING.replace("FourBarLinkage", "Differential"), kinds(m1="revolute")),
    ],
    "a `mechanicalReduction` that is no number": [
        (JOINT.format("", SIMPLE.format(1, "", NUMBERLESS)), {"notes": {"is no number; no rotor needs it"}}),
        (JOINT.format("", SIMPLE.format(1, "", NUMBERLESS + ROTOR)), "text 'reduction' is not"),
    ],
    "rotors of several transmissions of one joint": [
        (JOINT.format("", SIMPLE.format(1, "", ROTOR + REDUCTION) + SIMPLE.format(2, "", ROTOR)), {
            "notes": {"their inertias at the joint add"},
        }),
    ],
    "rotors of other transmissions with several joints": [
        (SPINNING.replace("FourBarLinkage", "Other"), {"notes": {"drops"}}),
    ],
    "several roots": [(TWO_ROOTS, "'ground' (3 links on it), 'table' (nothing on it)")],
    "XML that urdfdom reads and the standard forbids: undeclared or empty prefixes, odd declarations, `--` "
    "in comments, `<` in attributes": [
        (start + robot().replace("<link", f"{more}<link", 1), {"notes": {words}})
        for start, more, words in (
            ("", "<my:group/>", "a prefix without xmlns"), ('<?xml version="2"?>', "", "is not XML"),
            ("", "<!-- a -- b -->", "'--' in"),
            ("", "<:group/>", "a name that begins with ':'"),
            ("", "<material name='<grey>'/>", "'<' in an attribute"),
        )
    ],
    "two frames `closedloop1_A`, `closedloop1_B` (`fermeture1`) without a side-car": [
        (NAMED, {"closures": [{"rotation": "fixed"}]}),
    ],
}  # fmt: skip
