"""What MJCF states beside geometry: motors, passive forces, home, base, gravity, limits, names."""

from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.description import Description, read
from tests.comparing import close_to
from tests.description.reading import refused
from tests.extras import needs
from tests.files import save
from tests.mjcf_states import Pair
from tests.mjcf_texts import BAR, FLOATING, HEAD, LOOPS, ROBOTS, TENDONS, loops, mjcf
from tests.mujoco_matrices import mass_matrix

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


def arm(folder: Path, *sections: str, j: str = "", k: str = "", head: str = HEAD) -> Description:
    return read(text(folder, mjcf(*sections, world=ARM.format(j=j, k=k), head=head)))


def of(description: Description, name: str) -> hybridyn.description.Joint:
    return next(joint for joint in description.joints if joint.name == name)


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
    assert of(robot.description, "ball").rotor_inertia == 0.03


def test_dry_friction_and_limits(tmp_path: Path) -> None:
    found = arm(tmp_path, j='frictionloss=".6" range="-1 .5"', k='range="0 2" limited="false"')
    assert of(found, "j").friction == 0.6
    assert (of(found, "j").lower, of(found, "j").upper) == (-1, 0.5)
    assert (of(found, "k").lower, of(found, "k").upper) == (-np.inf, np.inf)


def test_motors_are_joints_in_the_order_of_the_actuators(tmp_path: Path) -> None:
    found = arm(
        tmp_path,
        '<tendon><fixed name="t"><joint joint="j" coef="2"/></fixed></tendon>',
        '<actuator><position joint="k" kp="10" forcerange="-3 2"/>'
        '<motor tendon="t" gear="5" ctrlrange="-1 4"/></actuator>',
    )
    assert found.motors == ("k", "j")
    assert found.motors_from == "MJCF <actuator>"
    assert (of(found, "k").effort, of(found, "j").effort) == (3, 40)
    assert any("servo" in note for note in found.notes)


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
    robot = hybridyn.load(file)
    assert robot.motors == ("open_left",)
    gear = 3 * (0.7 + 0.5 * 2)
    assert of(robot.description, "open_left").effort == pytest.approx(5 * gear)
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


def test_attached_models_frames_and_replicas_are_those_of_mujoco(tmp_path: Path) -> None:
    file = text(tmp_path, mjcf(HAND.format(bar=BAR.format(x=0.1, m=1))))
    save(tmp_path / "parts", ATTACHED, "finger.xml")
    save(tmp_path / "parts", TIP, "tip.obj")
    robot, pair = hybridyn.load(file), Pair(file)
    assert "one_bend" in robot.joints
    assert len(robot.joints) == 4
    draw = np.random.default_rng(2)
    q, v = pair.place(draw)
    close_to(pair.our_mass_matrix(q), pair.mass_matrix(), AGAINST_MUJOCO)
    close_to(pair.our_bias(q, v), pair.data.qfrc_bias, AGAINST_MUJOCO)
    (bend,) = (joint for joint in robot.description.joints if joint.name == "one_bend")
    assert (bend.damping, bend.rotor_inertia) == (0.3, 0.01)


def test_an_error_in_an_attached_model_names_its_file(tmp_path: Path) -> None:
    file = text(tmp_path, mjcf(HAND.format(bar=BAR.format(x=0.1, m=1))))
    save(tmp_path / "parts", TIP, "tip.obj")
    save(tmp_path / "parts", ATTACHED.replace('axis="0 1 0"', 'axis="0 0 0"'), "finger.xml")
    refused(file, "MuJoCo", "axis too small")
    part = save(
        tmp_path / "parts", ATTACHED.replace('axis="0 1 0"', 'type="ball" stiffness="1"'), "finger.xml"
    )
    error = refused(file, "one_bend", "a spring of a joint with several freedoms")
    assert (str(error.file), error.line) == (str(part), 5)


def test_a_limit_of_the_joint_counts_for_all_its_actuators(tmp_path: Path) -> None:
    both = (
        '<actuator><motor joint="j" ctrlrange="-1 1" gear="2"/><motor joint="j" ctrlrange="-3 3"/></actuator>'
    )
    assert of(arm(tmp_path, both), "j").effort == 5
    assert of(arm(tmp_path, both, j='actuatorfrcrange="-4 4"'), "j").effort == 4


def test_a_model_file_ranks_above(tmp_path: Path) -> None:
    (tmp_path / "robot.model.toml").write_text(
        'motors = ["k"]\n[home]\nj = 0.7\n[effects.spring]\nstiffness = { k = 3.0 }\n'
    )
    found = arm(tmp_path, '<actuator><motor joint="j"/></actuator>', j='stiffness="2"', k='ref=".4"')
    assert found.motors == ("k",)
    assert found.home == {"j": (0.7,), "k": (0.4,)}
    assert dict(found.effects) == {"spring": {"stiffness": {"k": 3.0}}}


def test_keyframes_are_home(tmp_path: Path) -> None:
    keys = '<keyframe><key name="far" qpos="1 2"/><key name="{}" qpos=".1 .2"/></keyframe>'
    assert arm(tmp_path, keys.format("home")).home == {"j": (0.1,), "k": (0.2,)}
    other = arm(tmp_path, keys.format("near"))
    assert other.home == {"j": (1.0,), "k": (2.0,)}
    assert any("'far'" in note and "'near'" in note for note in other.notes)


def test_gravity_is_that_of_the_file(tmp_path: Path) -> None:
    head = '<option gravity="1 2 3"/>'
    file = text(tmp_path, mjcf(world=ARM.format(j="", k=""), head=head))
    np.testing.assert_array_equal(hybridyn.load(file).gravity, [1, 2, 3])
    np.testing.assert_array_equal(hybridyn.load(file, gravity=(0, 0, -1)).gravity, [0, 0, -1])
    file = text(
        tmp_path, mjcf(world=ARM.format(j="", k=""), head='<option><flag gravity="disable"/></option>')
    )
    np.testing.assert_array_equal(hybridyn.load(file).gravity, [0, 0, 0])


def test_a_free_joint_is_a_floating_base(tmp_path: Path) -> None:
    robot = hybridyn.load(text(tmp_path, mjcf(world=FLOATING)))
    assert robot.base == "floating"
    assert robot.description.root == "trunk"
    np.testing.assert_allclose(robot.home[:3], [0, 0, 1])
    m = mujoco.MjModel.from_xml_path(str(tmp_path / "robot.xml"))
    np.testing.assert_allclose(robot.home[[6, 3, 4, 5]], m.qpos0[3:7], atol=1e-15)
    assert hybridyn.load(tmp_path / "robot.xml", base="fixed").base == "fixed"


def test_bodies_that_stand_still_beside_it_are_left_out(tmp_path: Path) -> None:
    found = read(text(tmp_path, mjcf(world=FLOATING + '<body name="table"><geom size="1"/></body>')))
    assert found.root == "trunk"
    assert any("'table'" in note for note in found.notes)


def test_what_ties_it_to_the_world_keeps_the_world(tmp_path: Path) -> None:
    equality = '<equality><connect name="x" body1="foot" anchor="0 0 -.1"/></equality>'
    robot = hybridyn.load(text(tmp_path, mjcf(equality, world=FLOATING)))
    assert (robot.base, robot.description.root) == ("fixed", "world")
    assert robot.kinds[0] == "floating"
    np.testing.assert_allclose(robot.home[:3], [0, 0, 1])


def test_what_has_no_name_gets_one(tmp_path: Path) -> None:
    world = (
        "<body><joint/>"
        + BAR.format(x=0, m=1)
        + '<body name="body1"><joint/><joint name="body1_joint2" axis="1 0 0"/>'
    )
    found = read(text(tmp_path, mjcf(world=world + BAR.format(x=0, m=1) + "</body></body>")))
    names = [joint.name for joint in found.joints if joint.kind != "fixed"]
    assert len({*names}) == len(names) == 3
    assert len({link.name for link in found.links}) == len(found.links)


def test_inactive_equalities_contacts_and_flags_are_remarks(tmp_path: Path) -> None:
    equality = '<equality><weld name="x" body1="a" body2="b" active="false"/></equality>'
    found = arm(
        tmp_path, equality, '<contact><pair geom1="g" geom2="h"/></contact>',
        head='<option><flag spring="disable"/></option>',
    )  # fmt: skip
    assert found.closures == ()
    for words in ("'x' has active=\"false\"", "contacts", "disables spring"):
        assert any(words in note for note in found.notes), words


def test_joints_without_actuators_are_no_sign_of_lost_loops(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    one = '<actuator><motor joint="j"/></actuator>'
    for sections in ((), (one,)):
        hybridyn.load(text(tmp_path, mjcf(*sections, world=ARM.format(j="", k=""))))
        assert not caplog.records


def test_frames_between_joints_are_no_parts_without_mass(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    file = text(tmp_path, ROBOTS["chain"])  # joints of one body at different places
    hybridyn.load(file)
    assert not caplog.records
    assert {finding.code for finding in hybridyn.check(file)} <= {"reader", "limits-missing"}


def test_a_file_without_joints_is_read(tmp_path: Path) -> None:
    found = read(
        text(tmp_path, mjcf(world='<body name="a"><geom size="1"/></body><body name="m" mocap="true"/>'))
    )
    assert [joint.kind for joint in found.joints] == ["fixed", "fixed"]
    assert any("mocap bodies are read as fixed: 'm'" in note for note in found.notes)


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
    assert [coupling.name for coupling in found.couplings] == ["a1", "e1", "a12"]
    d, draw = mujoco.MjData(m), np.random.default_rng(3)
    for _ in range(3):
        d.qpos[:] = draw.uniform(-1, 1, m.nq)
        mujoco.mj_forward(m, d)
        for coupling, row in zip(found.couplings, d.efc_pos[: d.ne], strict=True):
            ours = sum(c * d.joint(name).qpos[0] for name, c in coupling.terms) - coupling.offset
            assert abs(ours - row) < 1e-12


def test_frames_of_closures_are_named_by_their_line(tmp_path: Path) -> None:
    content = mjcf(TENDONS, '<equality><connect name="x" site1="sa" site2="sd"/></equality>', world=LOOPS)
    (closure,) = read(text(tmp_path, content)).closures
    assert (closure.kind, closure.link_a, closure.link_b) == ("connect", "a", "d")
    assert closure.line == content[: content.index("<connect")].count("\n") + 1
