"""Every row of the table of MJCF forms on the page, as files: read, noted or refused as the row says."""

from pathlib import Path
from typing import Any

import pytest

from hybridyn.description import read
from tests.description.reading import holds, refused, rows_of_page
from tests.robots.mjcf_texts import BAR, HEAD, mjcf
from tests.support.extras import needs
from tests.support.files import save

mujoco = needs("mjcf")
FOUR = mujoco.mj_version() >= 400

FIXED = '<tendon><fixed name="t" {}><joint joint="j" coef="1"/><joint joint="k" coef="2"/></fixed></tendon>'
LINE = '<tendon><spatial name="t" {}><site site="s"/>{}<site site="e"/></spatial></tendon>'
PULLEY = '<site site="g"/><pulley divisor="2"/><site site="g"/>'
RANGE = 'limited="true" range="-1 1"'


def arm(joint: str = "", body: str = "", *, kind: str = "hinge", more: str = "", head: str = HEAD) -> str:
    """Return two hinges in a row, with attributes of the first one and its body, and further elements."""
    world = (
        f'<site name="g" pos="0 0 2"/><body name="a" {body}><joint name="j" type="{kind}" {joint}/>'
        f'{BAR.format(x=0.1, m=1)}<site name="s"/><geom name="ball" size=".1"/>'
        f'<body name="b" pos=".3 0 0"><joint name="k" axis="0 1 0"/>{BAR.format(x=0.1, m=1)}'
        '<geom name="other" size=".1"/><site name="e" pos=".1 0 0"/></body></body>'
    )
    return mjcf(more, world=world, head=head)


def equal(equality: str) -> str:
    """Return the robot with an equality."""
    return arm(more=f"<equality>{equality}</equality>")


def acted(actuator: str, kind: str = "hinge", more: str = "") -> str:
    """Return the robot with an actuator, and a motor of the second hinge."""
    return arm(kind=kind, more=f'{more}<actuator>{actuator}<motor name="n" joint="k"/></actuator>')


def option(stated: str, flag: str = "") -> str:
    """Return the robot with settings."""
    return arm(head=f'<option {stated}><flag contact="disable" {flag}/></option>')


def effect(*names: str) -> dict[str, Any]:
    """Return what a robot with an effect has."""
    return {"effects": [*names]}


MOTOR, SITE = '<motor name="m" joint="j"/>', '<motor name="m" site="s" {}/>'
#: By the row's first cell, files: what a read robot has, or words of the note or of the error.
ROWS: dict[str, list[tuple[str, Any]]] = {
    "`hinge`, `slide`, `ball`, `free`, several in a body": [
        (arm(kind=kind), {"joints": {"j": {"kind": name}}})
        for kind, name in (("hinge", "revolute"), ("slide", "prismatic"), ("ball", "spherical"))
    ],
    "`ref`, `springref`": [
        (arm('ref=".3" stiffness="2" springref=".1"'), {"springs": {"j": {"stiffness": 2, "rest": 0.1}}})
    ],
    "`range`, `actuatorfrcrange`": [
        (
            arm(f'{RANGE} actuatorfrclimited="true" actuatorfrcrange="-3 3"'),
            {"joints": {"j": {"lower": -1, "upper": 1, "effort": 3}}},
        )
    ],
    "`range` of balls": [(arm('limited="true" range="0 1"', kind="ball"), "limits of balls 'j'")],
    "`<inertial>`, masses of geoms, `settotalmass` and others of `<compiler>`": [
        (arm(head='<compiler settotalmass="5"/>'), {"links": {"a": {"mass": 2.5}}}),
    ],
    "`<connect>`, `<weld>` of bodies or sites": [
        (equal('<connect body1="a" body2="b" anchor="0 0 0"/>'), {"closures": [{"rotation": "free"}]}),
        (equal('<weld site1="s" site2="e"/>'), {"closures": [{"rotation": "fixed"}]}),
    ],
    '`<weld torquescale="0">`': [
        (equal('<weld site1="s" site2="e" torquescale="0"/>'), {"closures": [{"rotation": "free"}]}),
    ],
    'equalities with `active="false"`': [
        (equal('<weld name="w" site1="s" site2="e" active="false"/>'), "'w' has active=\"false\""),
    ],
    "`solref`, `solimp` softer than MuJoCo's own": [
        (equal('<weld name="w" site1="s" site2="e" solref=".1 1"/>'), "compliance of equalities 'w'"),
    ],
    '`<flag equality="disable">` with equalities': [
        (
            arm(
                more='<equality><weld site1="s" site2="e"/></equality>',
                head='<option><flag equality="disable"/></option>',
            ),
            'remove equality="disable"',
        )
    ],
    "equalities of spatial tendons, `flex` and others": [
        (arm(more=LINE.format("", "") + '<equality><tendon tendon1="t"/></equality>'), "'t' is spatial"),
    ],
    "mocap bodies": [
        (
            arm(more='<worldbody><body name="m" mocap="true" pos="1 0 0"/></worldbody>'),
            "mocap bodies are read as fixed: 'm'",
        ),
    ],
    "mocap bodies that an equality holds": [
        (
            arm(
                more='<worldbody><body name="m" mocap="true"/></worldbody>'
                '<equality><weld body1="m" body2="b"/></equality>'
            ),
            "a program moves a mocap body",
        )
    ],
    "actuators on hinges and slides, or on `<fixed>` tendons of coupled joints": [
        (acted(MOTOR), {"motors": ("j", "k")}),
        (
            acted(
                '<motor tendon="t"/>',
                more=FIXED.format("") + '<equality><joint joint1="j" joint2="k"/></equality>',
            ),
            {"motors": ("k",)},
        ),
    ],
    "actuators on sites and cranks that act on one joint alike": [
        (acted(SITE.format('gear="0 0 0 0 0 1"')), {"motors": ("j", "k")}),
    ],
    "servos, muscles and dynamics of actuators": [
        (acted('<position name="m" joint="j" kp="3"/>'), "actuators 'm' have a servo"),
        (acted('<muscle name="m" joint="j" lengthrange="1 2"/>'), "actuators 'm' have a servo"),
    ],
    "actuators on balls, bodies, spatial tendons, other sites": [
        (acted(MOTOR.replace("/>", ' gear="1 0 0"/>'), "ball"), "'m' drives joint 'j'"),
        (acted('<adhesion name="m" body="a" ctrlrange="0 1"/>'), "no motors here: 'm'"),
        (acted('<motor name="m" tendon="t"/>', more=LINE.format("", "")), "'m' pulls a spatial tendon"),
        (acted(SITE.format('gear="1 0 0 0 0 0"')), "no motors here: 'm'"),
    ],
    "`<key>`": [
        (
            arm(more='<keyframe><key name="home" qpos=".2 .3"/></keyframe>'),
            {"home": {"j": (0.2,), "k": (0.3,)}},
        )
    ],
    "geoms that touch, `<contact>`": [
        (
            arm(head="<option/>", more='<contact><pair geom1="ball" geom2="other"/></contact>'),
            "touches nothing",
        )
    ],
    "`<option>`: `density`, `viscosity`": [
        (option('density="1000"'), "drops the forces of a fluid"), (option('viscosity="1"'), "fluid"),
    ],
    '`<option gravity>`, `<flag gravity="disable">`': [
        (option('gravity="1 2 3"'), {"gravity": (1, 2, 3)}),
        (option("", 'gravity="disable"'), {"gravity": (0, 0, 0)}),
    ],
    "other `<flag>`s that switch forces off": [
        (option("", 'damper="disable"' if FOUR else 'passive="disable"'), "<flag> disables"),
    ],
    "limits of tendons": [
        (arm(more=FIXED.format(RANGE)), "drops the limits of tendons 't'"),
    ],
    "`<joint damping>` and `<joint stiffness>` of hinges and slides, one number or several": [
        (arm('damping="3"'), {"joints": {"j": {"damping": 3}}}), (arm('stiffness="3"'), effect("spring")),
        *([(arm('stiffness="3 2"'), effect("polynomial_spring"))] if FOUR else []),
    ],
    "`<joint damping frictionloss armature>` of balls": [
        (
            arm('damping="3" frictionloss="2" armature="1"', kind="ball"),
            {"joints": {"j": {"damping": 3, "friction": 2, "rotor_inertia": 1}}},
        )
    ],
    "`<joint stiffness>` of balls": [(arm('stiffness="3"', kind="ball"), effect("ball_spring"))],
    "the same of free joints": [
        (
            arm('frictionloss="3"', kind="free"),
            {"joints": {"j_x": {"friction": 3}, "j_turn": {"friction": 3}}},
        )
    ],
    "`springyield`": [(arm('springyield="3"'), "springyield")] if FOUR else [],
    "`<replicate>`, `<attach>`, `<frame>`": [
        (
            arm(
                more='<worldbody><replicate count="2" offset="1 0 0"><body name="r"><joint name="x"/>'
                '<geom size=".1"/></body></replicate></worldbody>'
            ),
            {"joints": {"x0": {"kind": "revolute"}, "x1": {"kind": "revolute"}}},
        )
    ],
    "`<composite>`": [],  # tests/description/test_mjcf_files.py
    "`<flex>`, `<flexcomp>`": [
        (
            arm(
                more='<worldbody><body name="c"><flexcomp name="f" type="grid" count="3 3 1"/></body>'
                '</worldbody>'
            ),
            "a deformable body",
        )
    ],
    "`<plugin>` with forces": [
        (arm(more='<worldbody><body name="c"><plugin plugin="x"/></body></worldbody>'), "a plugin"),
    ],
    "meshes": [],  # tests/description/test_mjcf_files.py
    "`<body gravcomp>`": [(arm(body='gravcomp=".5"'), effect("gravity_compensation"))],
    "`<fixed>` tendons with `stiffness`, `damping`, `frictionloss`, `springlength`": [
        (arm(more=FIXED.format(f'{word}="2"')), effect("tendons"))
        for word in ("stiffness", "damping", "frictionloss")
    ],
    "`<spatial>` tendons through sites, over pulleys too, with the same": [
        (arm(more=LINE.format('stiffness="2"', path)), effect("line_springs")) for path in ("", PULLEY)
    ],
    "`<fixed>` tendons with `armature`": [
        (arm(more=FIXED.format('armature="2"')), {"joints": {"t": {"rotor_inertia": 2}}}),
    ] if FOUR else [],
    "`<spatial>` tendons with forces around geoms, or with `armature`": [
        (arm(more=LINE.format('stiffness="2"', '<geom geom="ball"/>')), "wraps around geoms"),
        *([(arm(more=LINE.format('armature="2"', "")), "armature along a spatial")] if FOUR else []),
    ],
    "`<tendon>` with several numbers of `stiffness` or `damping`": [
        (arm(more=FIXED.format('stiffness="2 3"')), "depends on a tendon's length"),
    ] if FOUR else [],
    "`<equality><joint polycoef>`, `<equality><tendon polycoef>`, of any order": [
        (equal('<joint joint1="j" joint2="k" polycoef=".1 2 3 4 5"/>'), {"couplings": [{"offset": 0.1}]}),
    ],
    "sensors, cameras, lights, materials, visuals": [
        (
            arm(
                more='<sensor><jointpos joint="j"/></sensor>',
                head='<option><flag contact="disable"/></option>',
            ),
            {"notes": ()},
        )
    ],
}  # fmt: skip


def test_each_row_of_the_page_has_its_files() -> None:
    rows = rows_of_page("MJCF form by form")
    assert [*rows] == [*ROWS]
    assert {*rows.values()} == {"read", "noted", "dropped", "refused"}


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("form", [form for form, cases in ROWS.items() if cases])
def test_a_form_is_as_its_row_says(form: str, tmp_path: Path) -> None:
    what = rows_of_page("MJCF form by form")[form]
    for text, expected in ROWS[form]:
        file = save(tmp_path, text, "robot.xml")
        if what == "refused":
            refused(file, expected)
            continue
        robot = read(file)
        if what == "read":
            if "effects" in expected:
                assert [name for name, _ in robot.effects] == expected["effects"]
            else:
                holds(robot, expected)
        else:
            (note,) = [note for note in robot.notes if expected in note]
            assert ("drops" in note) == (what == "dropped")
