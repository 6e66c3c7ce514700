"""What MJCF states beside geometry: motors, passive forces, home, base, gravity, limits, names."""

from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.description import read
from tests.description.mjcf_states import Pair
from tests.description.reading import Texts, holds, refused, save_all
from tests.judges.mujoco_matrices import mass_matrix
from tests.robots.mjcf_texts import BAR, FLOATING, HEAD, LOOPS, ROBOTS, TENDONS, TWO_FLOAT, loops, mjcf
from tests.robots.robot_texts import line_of
from tests.support.comparing import close_to
from tests.support.extras import needs
from tests.support.files import save
from tests.support.samples import slow

mujoco = needs("mjcf")

#: Efforts against `mj_inverse`, relative: as for the numbers of `test_mjcf_numbers`.
AGAINST_MUJOCO = 1e-10

ARM = (
    '<body name="a" pos="0 0 1"><joint name="j" axis="0 1 0" {j}/>'
    + BAR.format(x=0.1, m=1)
    + '<body name="b" pos=".3 0 0">'
    '<joint name="k" type="slide" axis="1 0 1" {k}/>' + BAR.format(x=0.2, m=2) + "</body></body>"
)  # fmt: skip


def text(folder: Path, content: str) -> Path:
    return save(folder, content, "robot.xml")


def arm(*sections: str, j: str = "", k: str = "", head: str = HEAD) -> str:
    """Return an arm of a hinge and a slide with some attributes."""
    return mjcf(*sections, world=ARM.format(j=j, k=k), head=head)


MOTORS = """<tendon><fixed name="t"><joint joint="j" coef="2"/></fixed></tendon>
<actuator><position joint="k" kp="10" forcerange="-3 2"/>
<motor tendon="t" gear="5" ctrlrange="-1 4"/></actuator>"""
MOTOR = '<actuator><motor joint="j"/></actuator>'
TWO_MOTORS = (
    '<actuator><motor joint="j" ctrlrange="-1 1" gear="2"/><motor joint="j" ctrlrange="-3 3"/></actuator>'
)
KEYS = '<keyframe><key name="far" qpos="1 2"/><key name="{}" qpos=".1 .2"/></keyframe>'
FOOT = '<equality><connect name="x" body1="foot" anchor="0 0 -.1"/></equality>'
TIED = mjcf(TENDONS, '<equality><connect name="x" site1="sa" site2="sd"/></equality>', world=LOOPS)
UNIT = BAR.format(x=0, m=1)
#: The text of a robot, or the texts of its files, and what is read.
READ: dict[str, tuple[Texts, dict[str, object]]] = {
    "dry friction and limits": (
        arm(j='frictionloss=".6" range="-1 .5"', k='range="0 2" limited="false"'),
        {"joints": {"j": {"friction": 0.6, "lower": -1, "upper": 0.5},
                    "k": {"lower": -np.inf, "upper": np.inf}}},
    ),
    "motors in the order of the actuators": (arm(MOTORS), {
        "motors": ("k", "j"), "motors_from": "MJCF <actuator>", "notes": {"servo"},
        "joints": {"k": {"effort": 3}, "j": {"effort": 40}},
    }),
    "efforts of two actuators": (arm(TWO_MOTORS), {"joints": {"j": {"effort": 5}}}),
    "the limit of a joint counts for all its actuators": (
        arm(TWO_MOTORS, j='actuatorfrcrange="-4 4"'), {"joints": {"j": {"effort": 4}}},
    ),
    "a model file ranks above": (
        {
            "robot.xml": arm(MOTOR, j='stiffness="2"', k='ref=".4"'),
            "robot.model.toml": 'motors = ["k"]\n[home]\nj = 0.7\n'
            "[effects.spring]\nstiffness = { k = 3.0 }\n",
        },
        {"motors": ("k",), "home": {"j": (0.7,), "k": (0.4,)},
         "effects": (("spring", {"stiffness": {"k": 3.0}}),)},
    ),
    "the keyframe of home": (arm(KEYS.format("home")), {"home": {"j": (0.1,), "k": (0.2,)}}),
    "the first keyframe": (
        arm(KEYS.format("near")), {"home": {"j": (1.0,), "k": (2.0,)}, "notes": {"'far'", "'near'"}},
    ),
    "gravity": (arm(head='<option gravity="1 2 3"/>'), {"gravity": (1, 2, 3)}),
    "no gravity": (arm(head='<option><flag gravity="disable"/></option>'), {"gravity": (0, 0, 0)}),
    "bodies that stand still beside a floating base are left out": (
        mjcf(world=FLOATING + '<body name="table"><geom size="1"/></body>'),
        {"root": "trunk", "notes": {"'table'"}},
    ),
    "inactive equalities, contacts and flags": (
        arm('<equality><weld name="x" body1="a" body2="b" active="false"/></equality>',
            '<contact><pair geom1="g" geom2="h"/></contact>',
            head='<option><flag spring="disable"/></option>'),
        {"closures": (), "notes": {"'x' has active=\"false\"", "contacts", "disables 'spring'"}},
    ),
    "a file without joints": (
        mjcf(world='<body name="a"><geom size="1"/></body><body name="m" mocap="true"/>'),
        {"joints": [{"kind": "fixed"}, {"kind": "fixed"}],
         "notes": {"mocap bodies are read as fixed: 'm'"}},
    ),
    "what has no name gets one": (
        mjcf(world=f"<body><joint/>{UNIT}<body name='body1'><joint/>"
             f"<joint name='body1_joint2' axis='1 0 0'/>{UNIT}</body></body>"),
        {"joints": ["body12_joint", "body1_joint", "body1_joint2"],
         "links": ["world", "body12", "body1_body1_joint", "body1"]},
    ),
    "frames of a closure are named by its line": (TIED, {"closures": [
        {"kind": "connect", "link_a": "a", "link_b": "d", "line": line_of(TIED, "<connect")}
    ]}),
}  # fmt: skip


@pytest.mark.parametrize("name", READ)
def test_what_is_read(name: str, tmp_path: Path) -> None:
    texts, expected = READ[name]
    holds(read(save_all(tmp_path, texts, "robot.xml")), expected)


@pytest.mark.parametrize(
    ("equality", "expected"),
    [
        ("", {"base": "floating", "root": "trunk"}),
        (FOOT, {"base": "fixed", "root": "world", "joints": {"free": {"kind": "floating"}}}),
    ],
)
def test_a_free_joint_is_a_floating_base_where_nothing_ties_it_to_the_world(
    equality: str, expected: dict[str, object], tmp_path: Path
) -> None:
    file = text(tmp_path, mjcf(equality, world=FLOATING))
    robot, m = hybridyn.load(file), mujoco.MjModel.from_xml_path(str(file))
    holds(robot.description, expected)
    np.testing.assert_allclose(robot.home[[0, 1, 2, 6, 3, 4, 5]], m.qpos0[:7], atol=1e-15)


def test_the_caller_ranks_above_the_file(tmp_path: Path) -> None:
    file = text(tmp_path, mjcf(world=FLOATING, head='<option gravity="1 2 3"/>'))
    robot = hybridyn.load(file, base="fixed", gravity=(0, 0, -1))
    assert (robot.base, *robot.gravity) == ("fixed", 0, 0, -1)


@pytest.mark.parametrize(
    ("content", "code"), [(arm(), "reader"), (arm(MOTOR), "motors-missing"), (ROBOTS["chain"], "reader")]
)
def test_nothing_seems_lost(
    content: str, code: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Joints without actuators are no signs of lost loops, frames between joints no parts without mass."""
    file = text(tmp_path, content)
    hybridyn.load(file)
    assert not caplog.records
    assert {finding.code for finding in hybridyn.check(file)} <= {"reader", "limits-missing", code}


def test_passive_forces_are_those_of_mujoco(tmp_path: Path) -> None:
    passive = 'damping=".3" armature=".2" stiffness="7" springref=".4" ref=".1"'
    actuators = (
        '<actuator><motor joint="j" gear="3" armature=".05" damping=".02"/><motor joint="k"/></actuator>'
    )
    if mujoco.mj_version() < 400:  # armature and damping of actuators came later
        actuators = '<actuator><motor joint="j" gear="3"/><motor joint="k"/></actuator>'
    file = text(tmp_path, mjcf(actuators, world=ARM.format(j=passive, k=passive)))
    robot = hybridyn.load(file)
    m = mujoco.MjModel.from_xml_path(str(file))
    d = mujoco.MjData(m)
    d.qpos[:], d.qvel[:], d.qacc[:] = [0.3, -0.2], [1.1, 0.7], [-0.4, 2.0]
    q, v, a = d.qpos.copy(), d.qvel.copy(), d.qacc.copy()
    mujoco.mj_inverse(m, d)
    close_to(hybridyn.idm(robot, q, v, a, effects="model"), d.qfrc_inverse, AGAINST_MUJOCO)


def test_actuators_with_several_controls_shift_no_limits(tmp_path: Path) -> None:
    """In MuJoCo 4 a pid has two controls, and an actuator that turns a ball three outputs."""
    if mujoco.mj_version() < 400:
        pytest.skip("MuJoCo 4 has them")
    ball = f'<body name="c"><joint name="l" type="ball"/>{BAR.format(x=0.1, m=1)}</body>'
    first = '<orientation name="o" joint="l" kp="3"/><pid joint="j" kp="3"/>'
    motor = '<motor joint="k" gear="2" ctrlrange="-7 7" armature=".1"/>'
    world = ARM.format(j="", k="") + ball
    file = text(tmp_path, mjcf(f"<actuator>{first}{motor}</actuator>", world=world))
    holds(read(file), {"joints": {"j": {"effort": np.inf}, "k": {"effort": 14, "rotor_inertia": 0.4}}})


HEAD_ON_A_BALL = """
<default><joint armature=".03" damping=".2"/></default>
<worldbody><body name="neck"><joint name="pan" axis="0 0 1"/>
  <inertial pos="0 0 .1" mass=".4" diaginertia="1e-3 2e-3 3e-3"/>
  <body name="head" pos="0 .02 .2"><joint name="ball" type="ball"/>
    <inertial pos=".03 0 .05" mass=".7" diaginertia="4e-3 5e-3 6e-3"/></body></body></worldbody>
<actuator><motor joint="pan"/></actuator>"""


@pytest.mark.parametrize("engine", ["general", "compiled"])
def test_armature_of_a_ball_is_about_each_axis(engine: str, tmp_path: Path) -> None:
    """MuJoCo adds it to three entries of the diagonal: the head's acceleration is MuJoCo's."""
    file = text(tmp_path, mjcf(HEAD_ON_A_BALL))
    robot = hybridyn.load(file)
    m = mujoco.MjModel.from_xml_path(str(file))
    d, draw = mujoco.MjData(m), np.random.default_rng(5)
    quaternion = draw.normal(size=4)
    d.qpos[:] = [0.4, *quaternion / np.linalg.norm(quaternion)]
    d.qvel[:] = draw.normal(size=4)
    d.qfrc_applied[0] = 0.6
    mujoco.mj_forward(m, d)
    q = d.qpos[[0, 2, 3, 4, 1]]
    if engine == "general":
        found = hybridyn.ddm(robot, q, d.qvel, np.array([0.6]), effects="model")
    else:
        found = hybridyn.compile(robot, effects="model").ddm(q, d.qvel, np.array([0.6]))
    close_to(found, d.qacc, AGAINST_MUJOCO)
    holds(robot.description, {"joints": {"ball": {"rotor_inertia": 0.03}}})


FREE = ' type="free" armature=".3" damping=".2" name="free'
WALKER = mjcf(
    '<actuator><motor joint="hip"/><motor joint="knee"/></actuator>',
    world=TWO_FLOAT.replace('<freejoint name="free', f"<joint{FREE}"),
)
ALONE = mjcf(world=FLOATING.replace('<freejoint name="free', f"<joint{FREE}"))
DAMPED = ALONE.replace('armature=".3"', "")
BOX = mjcf(world=f'<body name="box" pos="1 0 0"><joint{FREE}"/>{BAR.format(x=0.1, m=1)}</body>')


@pytest.mark.parametrize(
    ("content", "noted", "engine"),
    [
        (WALKER, "slides", "general"), (ALONE, "slides", "general"), (DAMPED, "not float", "general"),
        slow(BOX, "slides", "compiled"), slow(WALKER, "slides", "compiled"),
    ],
)  # fmt: skip
def test_armature_and_damping_of_free_joints_are_those_of_mujoco(
    content: str, noted: str, engine: str, tmp_path: Path
) -> None:
    """MuJoCo's armature resists accelerations along the world's axes: slides and a ball have it."""
    file = text(tmp_path, content)
    robot, m = hybridyn.load(file), mujoco.MjModel.from_xml_path(str(file))
    holds(robot.description, {"base": "fixed", "notes": {noted}})
    assert not [motor for motor in robot.motors if motor.startswith("free")]
    d, draw = mujoco.MjData(m), np.random.default_rng(6)
    d.qpos[:], d.qvel[:] = draw.normal(size=m.nq), draw.normal(size=m.nv)
    mujoco.mj_normalizeQuat(m, d.qpos)
    for motor in robot.motors:
        d.qfrc_applied[m.joint(motor).dofadr] = 0.6
    mujoco.mj_forward(m, d)
    q, v, expected = np.zeros(robot.nq), np.zeros(robot.nv), np.zeros(robot.nv)
    for name, kind, at_q, at_v in zip(robot.joints, robot.kinds, robot.q_slices, robot.v_slices, strict=True):
        stem, _, part = name.partition("_")
        joint, shift = m.joint(stem), ("x", "y", "z", "turn", "").index(part) % 4
        x = d.qpos[joint.qposadr[0] + shift :][: at_q.stop - at_q.start]
        order = {"spherical": [1, 2, 3, 0], "floating": [0, 1, 2, 4, 5, 6, 3]}.get(kind, [0])
        q[at_q] = x[order]
        rates = slice(joint.dofadr[0] + shift, joint.dofadr[0] + shift + at_v.stop - at_v.start)
        v[at_v], expected[at_v] = d.qvel[rates], d.qacc[rates]
        if kind == "floating":  # its linear rates are along the axes of the body
            turn = d.body(m.jnt_bodyid[joint.id]).xmat.reshape(3, 3).T
            v[at_v][:3], linear = turn @ v[at_v][:3], turn @ expected[at_v][:3]
            expected[at_v][:3] = linear - np.cross(v[at_v][3:], v[at_v][:3])
    tau = np.full(len(robot.motors), 0.6)
    if engine == "general":
        found = hybridyn.ddm(robot, q, v, tau, effects="model")
    else:
        found = hybridyn.compile(robot, effects="model").ddm(q, v, tau)
    close_to(found, expected, AGAINST_MUJOCO)


GRIPPER = """
<worldbody><body name="palm">
  <body name="left" pos=".1 0 0"><joint name="open_left" axis="0 0 1"/>{bar}</body>
  <body name="right" pos="-.1 0 0"><joint name="open_right" axis="0 0 -1"/>{bar}</body></body></worldbody>
<tendon><fixed name="split">
  <joint joint="open_right" coef=".5"/><joint joint="open_left" coef=".7"/></fixed></tendon>
<equality><joint joint1="open_right" joint2="open_left" polycoef=".1 2 0 0 0"/></equality>
<actuator><motor name="squeeze" tendon="split" gear="3" forcerange="-5 5"/></actuator>"""


def test_a_tendon_over_coupled_joints_is_one_motor(tmp_path: Path) -> None:
    """Its power is that of the tendon: the coefficients add up, each times the rate of its joint."""
    file = text(tmp_path, mjcf(GRIPPER.format(bar=BAR.format(x=0.1, m=1))))
    robot, gear = hybridyn.load(file), 3 * (0.7 + 0.5 * 2)
    effort = pytest.approx(5 * gear)
    holds(robot.description, {"motors": ("open_left",), "joints": {"open_left": {"effort": effort}}})
    m = mujoco.MjModel.from_xml_path(str(file))
    d = mujoco.MjData(m)
    q = np.array([0.3, 0.7])  # of the left and of the right finger, which is at .1 + 2 x
    d.qpos[:], d.ctrl[0] = q, 0.4
    mujoco.mj_forward(m, d)
    along = np.array([1.0, 2.0])  # rates of the coupled motion
    a = along @ (d.qfrc_actuator - d.qfrc_bias) / (along @ mass_matrix(m, d) @ along)
    close_to(hybridyn.ddm(robot, q, np.zeros(2), np.array([0.4 * gear])), a * along, AGAINST_MUJOCO)


ATTACHED = """<mujoco model="finger"><compiler angle="radian"/>
<default><default class="soft"><joint damping=".3" armature=".01"/></default></default>
<asset><mesh name="tip" file="tip.obj"/></asset>
<worldbody>
<body name="tip"><joint name="bend" class="soft" axis="0 1 0"/>
<geom type="mesh" mesh="tip" mass=".2"/></body></worldbody></mujoco>"""
TIP = "v 0 0 0\nv .1 0 0\nv 0 .1 0\nv 0 0 .1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
HAND = """<asset><model name="finger" file="parts/finger.xml"/></asset>
<worldbody><body name="hand"><joint name="wrist" axis="0 0 1"/>{bar}
<frame pos="0 .1 0" euler="0 0 .5"><attach model="finger" body="tip" prefix="one_"/></frame>
<replicate count="2" euler="0 0 1">
  <body name="knuckle" pos=".2 0 0"><joint name="fold"/>{bar}</body></replicate>
</body></worldbody>"""
FILES = {
    "robot.xml": mjcf(HAND.format(bar=BAR.format(x=0.1, m=1))),
    "parts/finger.xml": ATTACHED,
    "parts/tip.obj": TIP,
}  # fmt: skip


def test_attached_models_frames_and_replicas_are_those_of_mujoco(tmp_path: Path) -> None:
    file = save_all(tmp_path, FILES)
    robot, pair = hybridyn.load(file), Pair(file)
    assert len(robot.joints) == 4
    holds(robot.description, {"joints": {"one_bend": {"damping": 0.3, "rotor_inertia": 0.01}}})
    q, v = pair.place(np.random.default_rng(2))
    close_to(pair.our_mass_matrix(q), pair.mass_matrix(), AGAINST_MUJOCO)
    close_to(pair.our_bias(q, v), pair.data.qfrc_bias, AGAINST_MUJOCO)


@pytest.mark.parametrize(
    ("said", "messages", "place"),
    [
        ('axis="0 0 0"', ("MuJoCo", "axis too small"), ""),
        (
            'type="ball" armature="-1"',
            ("one_bend", "damping, armature or frictionloss is negative"),
            "finger.xml:5",
        ),
    ],
)
def test_an_error_in_an_attached_model_names_its_file(
    said: str, messages: tuple[str, ...], place: str, tmp_path: Path
) -> None:
    other = {"parts/finger.xml": ATTACHED.replace('axis="0 1 0"', said)}
    error = refused(save_all(tmp_path, FILES | other), *messages)
    assert f"{error.file}:{error.line}".endswith(place)


def test_couplings_hold_where_mujoco_says(tmp_path: Path) -> None:
    """A posture that satisfies MuJoCo's equality satisfies ours, references included."""
    file = text(
        tmp_path,
        loops(
            '<joint joint1="a1" joint2="c1" polycoef=".1 -2 0 0 0"/>'
            '<joint joint1="e1" polycoef=".3 0 0 0 0"/>'
            '<tendon tendon1="t1" tendon2="t2" polycoef=".1 3 0 0 0"/>'
        ),
    )
    found, m = read(file), mujoco.MjModel.from_xml_path(str(file))
    holds(found, {"couplings": ["a1", "e1", "a12"]})
    d, draw = mujoco.MjData(m), np.random.default_rng(3)
    for _ in range(3):
        d.qpos[:] = draw.uniform(-1, 1, m.nq)
        mujoco.mj_forward(m, d)
        for coupling, row in zip(found.couplings, d.efc_pos[: d.ne], strict=True):
            ours = sum(c * d.joint(name).qpos[0] for name, c in coupling.terms) - coupling.offset
            assert abs(ours - row) < 1e-12


#: A model with something to note in each element, one of which stands in a line of its own.
NOTED = """<mujoco>
<option density="1.2">
<flag frictionloss="disable"/>
</option>
<worldbody>
<geom name="floor" type="plane" size="1 1 1"/>
<body name="b"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
<joint name="j" type="ball" limited="true" range="0 1"/>
<geom size="0.1"/>
<body name="c" pos="0 0 1"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
<joint name="k"/>
</body></body>
<body name="hand" mocap="true"/>
</worldbody>
<tendon>
<fixed name="t" limited="true" range="0 1"><joint joint="k" coef="1"/></fixed>
</tendon>
<equality>
<joint name="e" joint1="k" active="false"/>
</equality>
<actuator>
<position name="servo" joint="k"/>
<motor name="several" joint="j" gear="1 0 0"/>
</actuator>
<keyframe>
<key name="far" qpos="1 0 0 0 0"/>
<key name="near" qpos="1 0 0 0 0"/>
</keyframe>
</mujoco>"""


def test_each_note_stands_at_the_element_that_it_speaks_of(tmp_path: Path) -> None:
    """Also notes on the whole file: contacts at a geom that could touch, a fluid at its option."""
    file = text(tmp_path, NOTED)
    at = {
        "of a fluid": "<option", "<flag> disables": "<flag", "contacts between geoms": "<geom",
        "limits of balls": "<joint", "mocap bodies": "<body name=\"hand\"", "limits of tendons": "<fixed",
        "has active": "<joint name=\"e\"", "have a servo": "<position", "no motors here": "<motor",
        "home is the first": "<key name",
    }  # fmt: skip
    notes = read(file).notes
    assert len(notes) == len(at)
    for words, element in at.items():
        (note,) = (note for note in notes if words in note)
        assert note.startswith(f"{file}:{line_of(NOTED, element)}: ")


def test_notes_stand_in_the_included_file(tmp_path: Path) -> None:
    world = '<body name="b"><joint/>' + BAR.format(x=0, m=1) + "</body>"
    part = '<mujocoinclude>\n<option viscosity="0.1"/>\n</mujocoinclude>'
    content = mjcf(world=world, head='<include file="part.xml"/>')
    save_all(tmp_path, {"robot.xml": content, "part.xml": part})
    (note,) = read(tmp_path / "robot.xml").notes
    assert note.startswith(f"{tmp_path / 'part.xml'}:2: drops the forces of a fluid")
