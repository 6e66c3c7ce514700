"""What Drake adds to URDF: its joints, its constraints, against Drake where it is installed, else by hand."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn.description import read
from tests.description.drake_plant import Plant
from tests.description.reading import holds, refused
from tests.description.test_urdf_dialects import MOTOR, TIP, compare, loop
from tests.robots.robot_texts import INERTIAL, robot
from tests.support.files import save

#: One solution of linear equations.
SOLVED = 1e-11

ORIGIN = '<origin xyz="0.1 -0.2 0.3" rpy="0.4 -0.5 0.6"/>'


def tree(kind: str, *parts: str, declared: bool = True) -> str:
    """Return a robot with one joint of Drake, and a hinge behind it; the namespace may be undeclared."""
    ends = '<parent link="base"/><child link="arm"/>'
    namespace = ' xmlns:drake="http://drake.mit.edu"' if declared else ""
    return (
        f'<robot name="r"{namespace}><link name="base"/><link name="arm">{INERTIAL}</link>'
        f'<link name="hand">{INERTIAL}</link>'
        '<joint name="anchor" type="fixed"><parent link="world"/><child link="base"/></joint>'
        f'<drake:joint name="j" type="{kind}">{ORIGIN}{ends}{"".join(parts)}</drake:joint>'
        '<joint name="k" type="revolute"><origin xyz="0.5 0 0" rpy="0.3 0 0"/><parent link="arm"/>'
        '<child link="hand"/><axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>'
        "</robot>"
    )


DAMPED = '<dynamics damping="0.7"/>'
SCREW = '<axis xyz="1 2 3"/><drake:screw_thread_pitch value="0.4"/>'
#: The joint, its parts, and the joints that it becomes.
JOINTS = {
    "ball": ("ball", (DAMPED,), {"j": "spherical"}),
    "universal": ("universal", (DAMPED,), {"j_1": "revolute", "j_2": "revolute"}),
    "screw": ("screw", (SCREW, DAMPED), {"j": "screw"}),
    "planar": ("planar", ('<axis xyz="0 0 1"/>',), {"j": "planar"}),
    "damped planar": (
        "planar", ('<axis xyz="1 2 3"/><dynamics damping="0.7 0.2 0.9"/>',),
        {"j_x": "prismatic", "j_y": "prismatic", "j_turn": "revolute", "j_frame": "fixed"},
    ),
    "a planar joint about -z": ("planar", ('<axis xyz="0 0 -1"/>',), {"j": "planar", "j_frame": "fixed"}),
}  # fmt: skip


@pytest.mark.parametrize("declared", [True, False])
@pytest.mark.parametrize("name", JOINTS)
def test_joints_of_drake_are_chains(name: str, declared: bool, tmp_path: Path) -> None:
    kind, parts, made = JOINTS[name]
    found = read(save(tmp_path, tree(kind, *parts, declared=declared)))
    holds(found, {"joints": {one: {"kind": word} for one, word in made.items()}})
    assert {joint.name for joint in found.joints} == {"anchor", "k", *made}
    single = [one for one, word in made.items() if word in ("revolute", "prismatic", "screw")]
    assert found.motors == (*single, "k")


def test_a_screw_is_driven_as_its_pitch_says(tmp_path: Path) -> None:
    """A nut of mass m and inertia J about its axis feels as J + m p^2, with p = pitch / 2 pi."""
    text = tree("screw", '<axis xyz="0 0 1"/><drake:screw_thread_pitch value="-0.4"/>')
    text = text.replace('<link name="hand">' + INERTIAL, '<link name="hand">').replace(
        'type="revolute"', 'type="fixed"'
    )
    found = hybridyn.load(save(tmp_path, text))
    assert found.joints == ("j",)
    q = np.array([0.7])
    p, inertia = -0.4 / (2 * np.pi), 0.25 + 2 * 0.5**2
    assert hybridyn.mass_matrix(found, q)[0, 0] == pytest.approx(inertia + 2 * p**2, rel=SOLVED)
    up = pin.rpy.rpyToMatrix(np.array([0.4, -0.5, 0.6])).T @ [0, 0, 1]
    com = 0.5 * np.array([-np.sin(0.7), np.cos(0.7), 0.0])  # the way of the centre of mass per turn
    weight = 2 * 9.81 * (p * up[2] + com @ up)
    assert hybridyn.gravity(found, q)[0] == pytest.approx(weight, rel=SOLVED)


def free(name: str, draw: np.random.Generator) -> tuple[np.ndarray, ...]:
    """Return positions and rates of a joint of Drake, our positions, and the map from our rates."""
    x, v, sure = draw.uniform(-1, 1, 3), draw.uniform(-1, 1, 3), np.eye(3)
    if name == "ball":
        R = pin.rpy.rpyToMatrix(x)
        return x, v, pin.Quaternion(R).coeffs(), R
    if (name.endswith("planar") and "damped" not in name) or "about" in name:
        turn = pin.rpy.rpyToMatrix(0.0, 0.0, x[2])
        return x, v, np.array([*x[:2], np.cos(x[2]), np.sin(x[2])]), turn
    n = {"universal": 2, "screw": 1}.get(name, 3)
    return x[:n], v[:n], x[:n], sure[:n, :n]


@pytest.mark.parametrize("name", JOINTS)
def test_trees_move_as_in_drake(name: str, tmp_path: Path) -> None:
    """With the friction of the file, under gravity and efforts."""
    kind, parts, _ = JOINTS[name]
    file, draw = save(tmp_path, tree(kind, *parts)), np.random.default_rng(4)
    drake = Plant(file, "r")
    x, w, ours, back = free(name, draw)
    x2, w2, n = 0.3, 0.8, len(w)
    driven = n if np.array_equal(back, np.eye(n)) else 0
    efforts = np.append(draw.uniform(-1, 1, n) if driven else np.zeros(n), 0.6)
    theirs = drake.accelerations([*x, x2], [*w, w2], efforts)
    robot_ = hybridyn.load(file)
    v, q = np.array([*(back.T @ w), w2]), np.array([*ours, x2])
    drake.compare_poses(robot_, q)
    a = hybridyn.ddm(robot_, q, v, efforts[n - driven :], effects="model")
    if not driven:
        spin = v[:3] if name == "ball" else np.array([0, 0, v[2]])
        a = np.array([*(back @ (a[:3] + (0 if name == "ball" else np.cross(spin, v[:3])))), a[3]])
    np.testing.assert_allclose(a, theirs, rtol=1e-10, atol=1e-10 * np.abs(theirs).max())


CONSTRAINT = (
    '<drake:ball_constraint><drake:ball_constraint_body_A name="coupler"/>'
    '<drake:ball_constraint_body_B name="rocker"/><drake:ball_constraint_p_AP value="1.5 0 0"/>'
    '<drake:ball_constraint_p_BQ value="1 0 0"/></drake:ball_constraint>'
)
#: Constraints of Drake between the ends of the four-bar, and ours.
SAME = {
    "ball_constraint1": (CONSTRAINT, loop("spherical", "")),
    "weld_constraint1": (
        '<drake:weld_constraint><drake:weld_constraint_body_A name="tip"/><drake:weld_constraint_body_B '
        'name="pin"/><drake:weld_constraint_X_BQ xyz="0 0 0"/></drake:weld_constraint>',
        '<loop name="w" type="fixed"><predecessor link="tip"/><successor link="pin"/></loop>',
    ),
}  # fmt: skip
PIN = (
    '<link name="pin"/><joint name="hinge" type="revolute"><parent link="rocker"/><child link="pin"/>'
    '<origin xyz="1 0 0"/><axis xyz="0 0 1"/></joint>'
)


@pytest.mark.parametrize("name", SAME)
def test_constraints_are_closures(name: str, tmp_path: Path) -> None:
    theirs, ours = SAME[name]
    more = (MOTOR, TIP, PIN) if "weld" in name else (MOTOR,)
    files = [save(tmp_path / side, robot(*more, said)) for side, said in (("a", theirs), ("b", ours))]
    assert [closure.name for closure in read(files[0]).closures] == [name]
    if "weld" not in name:
        compare(*files)
        return
    one, other = (hybridyn.load(file) for file in files)
    q, v, a = hybridyn.assemble(other, motors={"drive": (0.2, 0.7, 1.3)}, guess=other.home)
    np.testing.assert_allclose(hybridyn.idm(one, q, v, a), hybridyn.idm(other, q, v, a), rtol=SOLVED)


def test_points_of_a_ball_constraint_coincide_in_drake(tmp_path: Path) -> None:
    file = save(tmp_path, robot(CONSTRAINT))
    drake, ours = Plant(file, "four_bar"), hybridyn.load(file)
    q, *_ = hybridyn.assemble(ours, motors={"drive": 0.2}, guess=ours.home)
    for name, at in zip(ours.joints, ours.q_slices, strict=True):
        x = q[at]
        drake.joints[name].set_angle(drake.context, np.arctan2(*x[::-1]) if len(x) == 2 else float(x[0]))
    ends = [
        drake.plant.EvalBodyPoseInWorld(drake.context, drake.bodies[link]).multiply(np.array(point))
        for link, point in (("coupler", [1.5, 0, 0]), ("rocker", [1.0, 0, 0]))
    ]
    # The loop closes to the tolerance of `assemble`.
    np.testing.assert_allclose(*ends, atol=1e-9)


TENDON = (
    '<drake:tendon_constraint><drake:tendon_constraint_joint name="drive" a="2"/>'
    '<drake:tendon_constraint_joint name="swing" a="-3"/><drake:tendon_constraint_offset value="0.5"/>'
    '<drake:tendon_constraint_lower_limit value="0.7"/><drake:tendon_constraint_upper_limit value="0.7"/>'
    "</drake:tendon_constraint>"
)


def test_a_rigid_tendon_is_a_coupling(tmp_path: Path) -> None:
    found = read(save(tmp_path, robot(TENDON)))
    (one,) = found.couplings
    assert (one.name, one.terms) == ("tendon_constraint1", (("drive", 2.0), ("swing", -3.0)))
    assert one.offset == pytest.approx(0.2, rel=1e-15)


SPRING = (
    '<drake:linear_spring_damper><drake:linear_spring_damper_body_A name="base"/>'
    '<drake:linear_spring_damper_p_AP value="0 2 0"/><drake:linear_spring_damper_body_B name="arm"/>'
    '<drake:linear_spring_damper_p_BQ value="1 0 0"/><drake:linear_spring_damper_free_length value="1.5"/>'
    '<drake:linear_spring_damper_stiffness value="30"/><drake:linear_spring_damper_damping value="4"/>'
    "</drake:linear_spring_damper>"
)
HINGED = (
    f'<robot name="r"><link name="base"/><link name="arm">{INERTIAL}</link>'
    '<joint name="anchor" type="fixed"><parent link="world"/><child link="base"/></joint>'
    '<joint name="j" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/></joint>'
    f"{SPRING}</robot>"
)


def test_a_spring_between_two_points_pulls_along_its_line(tmp_path: Path) -> None:
    """At the angle x its length is |(cos x, sin x - 2)|; tension is k (l - l0) + c l_dot."""
    found = hybridyn.load(save(tmp_path, HINGED))
    x, w = 0.7, -0.4
    q, v, no = np.array([np.cos(x), np.sin(x)]), np.array([w]), np.zeros(1)
    length = np.hypot(np.cos(x), np.sin(x) - 2)
    rate = -2 * np.cos(x) / length  # of the length with the angle
    expected = (30 * (length - 1.5) + 4 * rate * w) * rate
    added = hybridyn.idm(found, q, v, no, effects="model") - hybridyn.idm(found, q, v, no)
    assert added[0] == pytest.approx(expected, rel=SOLVED)


def test_a_spring_between_two_points_pulls_as_in_drake(tmp_path: Path) -> None:
    file = save(tmp_path, HINGED)
    theirs = Plant(file, "r").accelerations([0.7], [-0.4], [0.6])
    q = np.array([np.cos(0.7), np.sin(0.7)])
    ours = hybridyn.ddm(hybridyn.load(file), q, np.array([-0.4]), np.array([0.6]), effects="model")
    np.testing.assert_allclose(ours, theirs, rtol=1e-10)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (HINGED.replace('"30"', '"-30"'), "-30 is negative"),
        (tree("revolute"), "Drake has no such type 'revolute' in <drake:joint>; known: 'ball', 'planar'"),
        (tree("univresal"), "(did you mean 'universal'?)"),
        (tree("curvilinear"), "a joint along a curve is not read"),
        (tree("screw"), "<drake:screw_thread_pitch> is missing"),
        (tree("ball", '<drake:rotor_inertia value="1"/>'), "does not say about which axis of a ball joint"),
        (tree("planar", '<dynamics damping="1 -2 3"/>'), "negative damping"),
        (robot(CONSTRAINT.replace("_p_AP", "_p_PA")), "did you mean 'drake:ball_constraint_p_AP'?"),
        (robot("<drake:ball_constraint/>"), "<drake:ball_constraint_body_A> is missing"),
        (robot(CONSTRAINT.replace('"rocker"', '"roker"')), "did you mean 'rocker'"),
        (robot(TENDON.replace('upper_limit value="0.7"', 'upper_limit value="1"')), "may vary is not read"),
    ],
)  # fmt: skip
def test_what_drake_does_not_have_is_refused(text: str, message: str, tmp_path: Path) -> None:
    refused(save(tmp_path, text), message)


def test_what_drake_ignores_is_noted(tmp_path: Path) -> None:
    found = read(save(tmp_path, tree("universal", '<axis xyz="0 0 1"/><limit lower="0" upper="1"/>')))
    holds(found, {"notes": {"the axis of universal joint 'j' is ignored: it turns about x, then y"}})


def test_a_joint_of_urdf_may_have_the_dampings_of_drake(tmp_path: Path) -> None:
    text = tree("planar", '<axis xyz="0 0 1"/><dynamics damping="0.7 0.2 0.9"/>')
    found = read(save(tmp_path, text.replace("drake:joint", "joint")))
    holds(found, {"joints": {"j_x": {"damping": 0.7}, "j_y": {"damping": 0.2}, "j_turn": {"damping": 0.9}}})
