"""MuJoCo's own model of the written file: mass matrix, bias, closed dynamics, forces, open closures."""

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from hybridyn import HybridRobot, ddm, idm
from hybridyn.conversion.convert import write
from hybridyn.conversion.request import ConversionRequest, Losses
from hybridyn.description import Closure, Description, Joint, Link, read
from hybridyn.description.placement import placement_from
from hybridyn.description.shipped import find_robot
from hybridyn.errors import AssemblyError, ModelError
from hybridyn.structure.building import build_robot
from hybridyn.structure.robot import joint_position
from tests.conversion import judge
from tests.conversion.features import FEATURES, closed, link, renamed
from tests.conversion.judge import (
    SINGLE,
    bodily,
    open_postures,
    read_back,
    same_robot,
    same_structure,
)  # fmt: skip
from tests.judges.mujoco_matrices import mass_matrix
from tests.robots.mechanisms import KINDS, random_mechanism
from tests.robots.mjcf_texts import ROBOTS as ROBOTS_OF_MJCF
from tests.robots.shipped import ROBOTS, shipped
from tests.support.comparing import close_to, refused
from tests.support.extras import needs
from tests.support.files import save
from tests.support.samples import slow, some

mujoco = needs("mjcf")

#: MuJoCo and Pinocchio on the same numbers, each rotation through a quaternion.
SAME = 1e-10


class Model:
    """MuJoCo's model of a description, with coordinates by joint."""

    def __init__(self, description: Description, tightness: float = 1e-4) -> None:
        target = Path("robot.xml")
        self.out = write(ConversionRequest(description, target, tightness=tightness), Losses())
        self.robot = build_robot(description)
        self.model = mujoco.MjModel.from_xml_string(self.out.text)
        self.model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        self.data = mujoco.MjData(self.model)
        self.columns = [
            self.model.jnt_dofadr[self.model.joint(name).id] + i
            for name, at in zip(self.robot.joints, self.robot.v_slices, strict=True)
            for i in range(at.stop - at.start)
        ]

    def place(self, q: np.ndarray, v: np.ndarray) -> None:
        """Set the joints of the robot; followers are where the keyframe has them."""
        mujoco.mj_resetDataKeyframe(self.model, self.data, 0)
        for name, kind, at in zip(self.robot.joints, self.robot.kinds, self.robot.q_slices, strict=True):
            start, x = self.model.jnt_qposadr[self.model.joint(name).id], q[at]
            if kind == "continuous":
                x = np.array([np.arctan2(x[1], x[0])])
            elif kind == "spherical":
                x = x[[3, 0, 1, 2]]
            self.data.qpos[start : start + len(x)] = x
        self.data.qvel[self.columns] = v
        mujoco.mj_forward(self.model, self.data)


@pytest.mark.parametrize("name", some(ROBOTS, ("gough_stewart",)))
def test_the_open_tree_is_that_of_pinocchio(name: str) -> None:
    tree = replace(shipped(name), closures=(), couplings=())
    written, robot = Model(tree), build_robot(tree)
    for q in open_postures(robot, 2):
        v = np.random.default_rng(3).normal(size=robot.nv)
        written.place(q, v)
        M = pin.crba(robot.model, robot.model.createData(), q)
        M = np.triu(M) + np.triu(M, 1).T
        for joint in tree.joints:
            if joint.rotor_inertia:
                at = robot.v_slices[robot.joints.index(joint.name)].start
                M[at, at] += joint.rotor_inertia * joint.gear_ratio**2
        close_to(mass_matrix(written.model, written.data)[np.ix_(written.columns, written.columns)], M, SAME)
        bias = pin.rnea(robot.model, robot.model.createData(), q, v, np.zeros(robot.nv))
        close_to(written.data.qfrc_bias[written.columns], bias, SAME)


def accelerations(written: Model, tau: np.ndarray) -> np.ndarray:
    """Return the accelerations at rest that MuJoCo's matrices give with rigid equalities."""
    m, d = written.model, written.data
    rows = d.efc_J.reshape(-1, m.nv)[d.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY]
    force = -d.qfrc_bias
    for motor, effort in zip(written.robot.motors, tau, strict=True):
        force[m.jnt_dofadr[m.joint(motor).id]] += effort
    _, s, Vt = np.linalg.svd(rows)
    free = Vt[int((s > 1e-8 * s[0]).sum()) :].T
    M = mass_matrix(written.model, written.data)
    return (free @ np.linalg.solve(free.T @ M @ free, free.T @ force))[written.columns]


LOOPS = ("loop_revolute", "loop_prismatic", "loop_rows_y_perpendicular")


@pytest.mark.parametrize("kind", some([k for k in KINDS if k.startswith(("loop", "four_bar"))], LOOPS))
def test_closed_robots_accelerate_as_ours(kind: str) -> None:
    description = bodily(random_mechanism(3, kind=kind))
    written = Model(without_rotors(description))
    robot = written.robot
    rest = np.zeros(robot.nv)
    written.place(robot.home, rest)
    tau = np.random.default_rng(1).normal(size=len(robot.motors))
    close_to(accelerations(written, tau), ddm(robot, robot.home, rest, tau), 1e-9)


def without_rotors(description: Description) -> Description:
    """Return a robot without rotors, friction and springs: `ddm` computes them only where asked."""
    joints = tuple(
        replace(joint, rotor_inertia=0.0, damping=0.0, friction=0.0, lower=-np.inf, upper=np.inf)
        for joint in description.joints
    )
    return replace(description, joints=joints, effects=())


def opening(written: Model, robot: HybridRobot, seconds: float) -> float:
    """Return the largest distance by which closures open in a run from home without motors [m]."""
    m, d = written.model, written.data
    written.place(robot.home, np.zeros(robot.nv))
    largest = 0.0
    for _ in range(int(seconds / m.opt.timestep)):
        mujoco.mj_step(m, d)
        for number in range(m.neq):
            if m.eq_type[number] in (int(mujoco.mjtEq.mjEQ_CONNECT), int(mujoco.mjtEq.mjEQ_WELD)):
                first, second = (d.site_xpos[x[number]] for x in (m.eq_obj1id, m.eq_obj2id))
                largest = max(largest, float(np.linalg.norm(first - second)))
    return largest


@pytest.mark.parametrize(
    ("name", "tightness"),
    [
        ("five_bar", 1e-4), slow("five_bar", 1e-6), slow("delta", 1e-4), slow("gough_stewart", 1e-4),
        slow("gough_stewart", 1e-6),
        # closures with a follower
        slow("loop_prismatic", 1e-4), slow("loop_universal", 1e-4), slow("loop_rows_y_perpendicular", 1e-4),
        slow("loop_planar", 1e-4),
    ],
)  # fmt: skip
def test_closures_stay_as_tight_as_asked(name: str, tightness: float) -> None:
    description = bodily(random_mechanism(3, kind=name)) if name in KINDS else shipped(name)
    written = Model(without_rotors(description), tightness)
    assert 0 < opening(written, written.robot, 0.3) <= tightness


@pytest.mark.parametrize(
    "name",
    [
        "andrews", slow("bricard"),
        "serial_all", slow("planar_rpr"), slow("gough_floating"), slow("star_five"),
    ],
)  # fmt: skip
def test_the_robot_moves_as_ours_where_bodies_and_joints_are_added(name: str, tmp_path: Path) -> None:
    """Massless ends of closures add no mass; for joints that MuJoCo does not have are others, and listed."""
    drawn = name in KINDS
    description = bodily(random_mechanism(3, kind=name)) if drawn else read(find_robot(name))
    other, out = read_back(description, tmp_path / "robot.xml")
    judge.same_mass(description, other, judge.SAME)
    said = " ".join(out.losses)
    assert all(joint.name in said for joint in description.joints if joint.kind in ("planar", "floating"))
    assert drawn or {line.split()[0] for line in out.losses} <= {"speed", "names", "closures"}
    assert any("springs and dampers" in note for note in out.notes) == (name == "andrews")  # that has one


@pytest.mark.parametrize("kind", ["andrews", "gear_three", slow("flyball_governor"), slow("gear_rack")])
def test_loops_are_closed_where_mujoco_weighs_equalities(kind: str) -> None:
    """At `qpos0` equalities hold by MuJoCo's own account, and struts have their length, at zero none."""
    description = random_mechanism(3, kind=kind) if kind in KINDS else read(find_robot(kind))
    written = Model(bodily(description))
    m, d = written.model, written.data
    mujoco.mj_resetData(m, d)
    mujoco.mj_forward(m, d)
    held = d.efc_type == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
    assert held.any()
    np.testing.assert_allclose(d.efc_pos[held], 0.0, atol=SAME)
    assert (
        m.dof_invweight0 * np.diag(mass_matrix(written.model, written.data))
    ).max() < 1e6  # 1 for each joint by itself
    home = np.array(d.qpos)
    mujoco.mj_resetDataKeyframe(m, d, 0)
    np.testing.assert_array_equal(home, d.qpos)


@pytest.mark.parametrize("name", some(ROBOTS_OF_MJCF, ("balls", "a foot on the ground")))
@pytest.mark.parametrize("ending", [".xml", slow(".urdf"), slow(".usda")])
def test_mjcf_comes_back(name: str, ending: str, tmp_path: Path) -> None:
    file = save(tmp_path, ROBOTS_OF_MJCF[name], "robot.xml")
    description = read(file)
    other, _ = read_back(description, tmp_path / f"other{ending}")
    if ending == ".urdf":  # it says neither; a loss line names them
        other = replace(other, base=description.base, base_home=description.base_home)
    try:
        robot = build_robot(description)
    except AssemblyError:  # no posture closes the loops
        with pytest.raises(AssemblyError):
            build_robot(other)
        return
    tolerance = SINGLE if ending == ".usda" else judge.SAME
    if ending == ".usda" and any(joint.kind in ("planar", "floating") for joint in description.joints):
        assert build_robot(other).mobility == robot.mobility  # USD has other joints for them
        return
    same_structure(robot, build_robot(other), tolerance=tolerance)
    if not description.closures and not description.couplings:
        draw = np.random.default_rng(2)
        drawn = open_postures(robot, 2), *draw.normal(size=(2, 2, robot.nv))
        pair = (replace(one, gravity=(0.0, 0.0, -9.81)) for one in (description, other))
        same_robot(*pair, drawn, tolerance=tolerance)


def chain(names: list[str], closures: tuple[Closure, ...] = ()) -> Description:
    """Return links one behind the other."""
    links = tuple(Link(name, 1.0, np.zeros(3), np.eye(3)) for name in names)
    step = placement_from(np.eye(3), np.array([1.0, 0.0, 0.0]))
    joints = tuple(
        Joint(f"to {b}", "revolute", a, b, step, np.array([0.0, 0.0, 1.0]))
        for a, b in itertools.pairwise(names)
    )
    return Description("chain", links, joints, closures)


def test_what_mujoco_would_not_read_is_refused() -> None:
    deep = chain([str(number) for number in range(300)])
    refused(lambda: Model(deep), ModelError, "more than 240 bodies")


@pytest.mark.parametrize("moments", [(-1e-6, 0.1, 0.1), (-0.2, 0.1, 0.05), (0.0, 0.0, 1.0)])
def test_a_body_that_does_not_move_may_have_any_inertia(moments: tuple[float, float, float]) -> None:
    """The writer never came back from a negative moment, which a dozen published robots have."""
    d = link("base", inertia=np.diag(moments))
    written = Model(d)
    assert any(line.startswith("inertias that no body can have") for line in written.out.losses)
    assert (written.model.body_inertia >= 0).all()


def test_names_of_bodies_that_are_added_are_new() -> None:
    taken = renamed(closed("prismatic"), "arm", "loop_follower")
    model = Model(taken).model
    assert {"loop_follower", "loop_follower2"} <= {model.body(n).name for n in range(model.nbody)}


LOOP = closed("revolute")
TWICE = replace(LOOP, closures=(*LOOP.closures, replace(LOOP.closures[0], name="loop:axis")))


ITS_WORLD = renamed(renamed(LOOP, "arm", "world"), "cart", "world_")
FREE = replace(renamed(LOOP, "two", "base:free"), base="floating")


@pytest.mark.parametrize(
    ("d", "names"),
    [
        (ITS_WORLD, {"world_", "world_2"}),
        (TWICE, {"loop:axis", "loop:axis2", "loop:axis:axis"}),
        (FREE, {"base:free", "base:free2"}),
    ],
)
def test_names_that_mujoco_would_find_twice_get_a_number(
    d: Description, names: set[str], tmp_path: Path
) -> None:
    other, out = read_back(d, tmp_path / "robot.xml")
    model = mujoco.MjModel.from_xml_string(out.text)
    assert names <= {name.decode() for name in model.names.split(b"\0")}
    assert len(other.closures) == 2 * len(d.closures)  # each is two connects


# -------------------- springs, dampers and friction


#: Robots with a force in joints that MuJoCo has by the same names.
NAMES = [
    name
    for name, (_, robot) in FEATURES.items()
    if name.startswith(("spring", "damper", "viscous"))
    and not {joint.kind for joint in robot.joints} & {"planar", "floating"}
]


@pytest.mark.parametrize("name", NAMES)
def test_springs_and_dampers_act_as_stated(name: str) -> None:
    """MuJoCo's passive forces are -(damping v) - stiffness (x - rest), by the numbers of the description."""
    _, d = FEATURES[name]
    written, draw = Model(d), np.random.default_rng(4)
    robot, (q,) = written.robot, open_postures(written.robot, 1)
    v = draw.normal(size=robot.nv)
    dampers = dict(d.effects).get("damper", {}).get("coefficient", {})
    damping = {joint.name: joint.damping + dampers.get(joint.name, 0.0) for joint in d.joints}
    springs, expected = {spring.name: spring for spring in d.springs}, np.zeros(robot.nv)
    for one, to in zip(robot.joints, robot.v_slices, strict=True):
        expected[to] = -damping[one] * v[to]
        if spring := springs.get(one):
            expected[to] -= spring.stiffness * (float(joint_position(robot, q, one)) - spring.rest)
    written.place(q, v)
    assert np.abs(expected).max() > 0
    close_to(written.data.qfrc_passive[written.columns], expected, SAME)


@pytest.mark.parametrize("name", ["tendons", "line springs", "gravity compensation"])
def test_tendons_lines_and_weights_act_as_ours(name: str) -> None:
    """Those without dry friction, which MuJoCo has as a constraint."""
    _, d = FEATURES[name]
    ((effect, numbers),) = d.effects
    numbers = {key: value for key, value in numbers.items() if key != "friction"}
    joints = tuple(joint.name for joint in d.joints)
    written = Model(replace(d, motors=joints, effects=((effect, numbers),)))
    robot = written.robot
    (q,), v = open_postures(robot, 1), np.random.default_rng(4).normal(size=robot.nv)
    ours = -idm(robot, q, v, np.zeros(robot.nv), effects=[effect])
    written.place(q, v)
    assert np.abs(ours).max() > 0
    columns = [written.columns[robot.joints.index(motor)] for motor in robot.motors]
    close_to(written.data.qfrc_passive[columns], ours, SAME)
