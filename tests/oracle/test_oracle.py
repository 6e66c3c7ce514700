"""The oracle, judged by what is not hybridyn, and what its models promise, tell and refuse."""

from dataclasses import replace

import mpmath
import numpy as np
import pinocchio as pin
import pytest

from hybridyn.description.records import Closure, Description, Joint, Link
from tests.comparing import ROUNDING, SOLVED, close_to, refused
from tests.mechanisms import KINDS, drawn, random_mechanism, random_states, random_wrenches
from tests.oracle import Base, Extended, Float64, Oracle
from tests.peers import Peer, describe, example_urdf
from tests.samples import in_turn, slow

PROXIMAL = 1e-9  # what constraintDynamics reaches at its best mu
BASES: tuple[Base, ...] = ("fixed", "moving", "floating")


# -------------------------------------------------------------------- trees, against Pinocchio

SHUFFLED = """
<robot name="shuffled">
  <joint name="j10" type="revolute"><parent link="hub"/><child link="c"/>
    <origin xyz="0 .2 0" rpy=".1 .2 .3"/><axis xyz="0 1 1"/>
    <limit effort="1" velocity="1" lower="-9" upper="9"/></joint>
  <joint name="a_fixed" type="fixed"><parent link="hub"/><child link="flange"/>
    <origin xyz=".1 0 .1" rpy="1 0 0"/></joint>
  <joint name="z" type="prismatic"><parent link="c"/><child link="e"/>
    <origin xyz="0 0 .3"/><axis xyz="1 2 0"/>
    <limit effort="1" velocity="1" lower="-9" upper="9"/></joint>
  <joint name="j2" type="continuous"><parent link="hub"/><child link="d"/>
    <origin xyz=".3 0 0"/><axis xyz="1 0 2"/></joint>
  <joint name="B" type="continuous"><parent link="flange"/><child link="f"/>
    <origin rpy="0 1 0"/><axis xyz="0 0 1"/></joint>
  <joint name="first" type="revolute"><parent link="base"/><child link="hub"/>
    <origin xyz="0 0 .5"/><axis xyz="0 1 0"/>
    <limit effort="1" velocity="1" lower="-9" upper="9"/></joint>
  <joint name="a" type="planar"><parent link="d"/><child link="g"/>
    <origin xyz="0 0 .1"/><axis xyz="0 0 1"/></joint>
  <joint name="Z" type="floating"><parent link="d"/><child link="h"/><origin xyz="0 0 .1"/></joint>
  {links}
</robot>
""".replace(
    "{links}",
    "\n".join(
        f"""<link name="{name}"><inertial><origin xyz=".0{i} .1 -.0{i}" rpy=".{i} 0 1"/><mass value="1.{i}"/>
        <inertia ixx=".02" iyy=".03" izz=".04" ixy=".001" ixz=".002" iyz=".003"/></inertial></link>"""
        for i, name in enumerate(["g", "hub", "base", "c", "f", "d", "e", "flange", "h"])
    ),
)
TREES = {
    "shuffled": lambda: SHUFFLED,
    "ur5": lambda: example_urdf("ur5_robot.urdf"),
    "panda": lambda: example_urdf("panda.urdf"),
    "talos": lambda: example_urdf("talos_reduced.urdf"),
    "pr2": lambda: example_urdf("pr2.urdf"),
    "allegro": lambda: example_urdf("allegro_left_hand.urdf"),
}


def built(urdf: str, base: Base) -> pin.Model:
    return (
        pin.buildModelFromXML(urdf)
        if base == "fixed"
        else pin.buildModelFromXML(urdf, pin.JointModelFreeFlyer())
    )


@pytest.mark.parametrize("base", ["fixed", "floating"])
@pytest.mark.parametrize("name", TREES)
def test_the_spanning_tree_is_ordered_as_pinocchio_orders_it(name: str, base: Base) -> None:
    urdf = TREES[name]()
    model, oracle = built(urdf, base), Oracle(describe(urdf), base)
    assert (oracle.nq, oracle.nv, oracle.joint_names) == (model.nq, model.nv, list(model.names)[1:])
    for index, (_, at_q, at_v) in enumerate(oracle.coordinates.values(), start=1):
        assert (at_q.start, at_v.start) == (model.joints[index].idx_q, model.joints[index].idx_v)


@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize("name", TREES)
def test_trees_move_as_in_rnea_and_aba(name: str, base: Base) -> None:
    urdf = TREES[name]()
    description, model = describe(urdf), built(urdf, base)
    oracle, data, rng = Oracle(description, base), model.createData(), np.random.default_rng(3)
    q = pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv))
    v, a = rng.normal(size=model.nv), rng.normal(size=model.nv)
    link = description.links[-1].name
    wrench = rng.normal(size=6)
    frame = model.frames[model.getFrameId(link, pin.FrameType.BODY)]
    f_ext = pin.StdVec_Force([pin.Force.Zero() for _ in range(model.njoints)])
    f_ext[frame.parentJoint] = frame.placement.act(pin.Force(wrench))
    tau, missing = oracle.idm_and_missing(q, v, a, {link: wrench})
    Q = missing.copy()
    Q[oracle.motors] += tau
    skip = 6 if base == "moving" else 0  # what moves a prescribed base is no effort of the model
    close_to(Q[skip:], pin.rnea(model, data, q, v, a, f_ext)[skip:], ROUNDING)


@pytest.mark.parametrize("base", ["fixed", "floating"])
@pytest.mark.parametrize("kind", ["serial", "serial_all"])
def test_drawn_trees_move_as_in_aba(kind: str, base: Base) -> None:
    description, q, v, _ = drawn(kind, base)
    oracle, peer, rng = Oracle(description, base), Peer(description, base), np.random.default_rng(1)
    tau = rng.normal(size=len(oracle.motors))
    wrenches = {link.name: rng.normal(size=6) for link in description.links[:3]}
    expected = pin.aba(peer.model, peer.data, q, v, peer.efforts(tau), peer.forces(wrenches))
    close_to(oracle.ddm(q, v, tau, wrenches=wrenches), expected, SOLVED)


@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize("kind", ["serial", "serial_all", "gough_points", "on_leg"])
def test_what_carries_the_robot_is_the_base_wrench(kind: str, base: Base) -> None:
    """Closures pass nothing to the base: the spanning tree's own `rnea` gives the wrench on a free root."""
    description = random_mechanism(0, kind=kind)
    wrenches = random_wrenches(description, 0)
    q, v, a = (x[0] for x in random_states(description, base, 0, 1, wrenches=wrenches))
    peer = Peer(description, "floating")
    at_rest = [np.array([0.0, 0, 0, 0, 0, 0, 1]), np.zeros(6), np.zeros(6)]
    free = [np.concatenate([r, x]) if base == "fixed" else x for r, x in zip(at_rest, (q, v, a), strict=True)]
    expected = pin.rnea(peer.model, peer.data, *free, peer.forces(wrenches))[:6]
    support = Oracle(description, base).support(q, v, a, wrenches)
    assert np.abs(support - expected).max() <= ROUNDING * 9.81 * sum(link.mass for link in description.links)


def test_a_moving_base_accelerates_as_prescribed() -> None:
    description, q, v, a = drawn("serial", "moving")
    oracle, peer = Oracle(description, "moving"), Peer(description, "moving")
    expected = pin.rnea(peer.model, peer.data, q, v, a)
    tau = oracle.idm(q, v, a)
    close_to(peer.efforts(tau)[6:], expected[6:], ROUNDING)
    close_to(oracle.ddm(q, v, tau, base_acceleration=a[:6]), a, SOLVED)


# -------------------------------------------------------------------- closures, against Pinocchio


@pytest.mark.parametrize("base", ["fixed", "floating"])
@pytest.mark.parametrize("kind", ["loop_spherical", "loop_fixed", "four_bar_point", "rssr", "gough_points"])
def test_points_and_welds_move_as_in_constraint_dynamics(kind: str, base: Base) -> None:
    description, q, v, _ = drawn(kind, base)
    oracle, peer = Oracle(description, base), Peer(description, base)
    tau = 10 * np.random.default_rng(5).normal(size=len(oracle.motors))
    ours = oracle.ddm(q, v, tau)
    theirs = [peer.constraint_dynamics(q, v, tau, mu) for mu in (1e-12, 1e-10, 1e-8, 1e-6)]
    errors = [np.abs(a - ours).max() / np.abs(ours).max() for a in theirs]
    assert min(errors) <= PROXIMAL, errors


# -------------------------------------------------------------------- a closed form


CRANK, ROD, GROUND = (0.4, 0.5), (0.6, 0.7), 0.5
MASS, CENTRE = (1.0, 1.3, 0.7, 0.9), (0.2, 0.3, 0.25, 0.3)  # cranks, rods
GRAVITY = 9.81


def five_bar_closed_form(theta: np.ndarray, theta_dot: np.ndarray, theta_ddot: np.ndarray) -> np.ndarray:
    """Return the efforts on the cranks of a vertical five-bar, from its kinetic energy.

    Cranks of length l_i turn by theta_i at A_1 = (0, 0) and A_2 = (b, 0), y upwards; rods of length r_i join
    their tips P_i to one pin C. With d = P_2 - P_1 and D = |d|, the law of cosines puts the foot of C on d at
    s = (D^2 + r_1^2 - r_2^2) / (2 D) from P_1, its height at h = sqrt(r_1^2 - s^2), so that
    C = P_1 + (s d + h d_perp) / D, with the unit rods e_i = (C - P_i) / r_i. Since |C - P_i| is constant,
    e_i . (C_dot - P_i_dot) = 0: two equations for C_dot. The rods turn by
    phi_i_dot = e_i_perp . (C_dot - P_i_dot) / r_i. Links are slender, I_i = m_i L_i^2 / 12 about their mass
    centres, which lie at c_i along the link. So T = sum (m_i |v_i|^2 + I_i omega_i^2) / 2 is
    theta_dot^T M(theta) theta_dot / 2, and U = g sum m_i y_i, and

        tau = M theta_ddot + sum_k dM/dtheta_k theta_dot_k theta_dot
              - d(theta_dot^T M theta_dot / 2)/dtheta + dU/dtheta.

    M and U are analytic in theta; their derivatives are taken by complex steps, exact to rounding.
    """
    (l1, l2), (r1, r2), b, lengths = CRANK, ROD, GROUND, CRANK + ROD

    def inertia_and_potential(x: np.ndarray) -> tuple[np.ndarray, complex]:
        crank = np.array([[np.cos(t), np.sin(t)] for t in x])
        perp = np.array([[-np.sin(t), np.cos(t)] for t in x])
        P = np.array([l1 * crank[0], np.array([b, 0]) + l2 * crank[1]])
        P_dot = np.zeros((2, 2, 2), complex)  # point, component, theta
        P_dot[0, :, 0], P_dot[1, :, 1] = l1 * perp[0], l2 * perp[1]
        d = P[1] - P[0]
        D = np.sqrt(d @ d)
        s = (D * D + r1 * r1 - r2 * r2) / (2 * D)
        C = P[0] + (s * d + np.sqrt(r1 * r1 - s * s) * np.array([-d[1], d[0]])) / D
        e = np.array([(C - P[0]) / r1, (C - P[1]) / r2])
        C_dot = np.linalg.solve(e, np.array([e[i] @ P_dot[i] for i in range(2)]))
        M, U = np.zeros((2, 2), complex), 0j
        origin = np.array([[0, 0], [b, 0]])
        for i in range(2):
            across = np.array([-e[i][1], e[i][0]])
            phi_dot = across @ (C_dot - P_dot[i]) / (r1, r2)[i]
            turn = np.eye(2)[i]
            m, c = MASS[i], CENTRE[i]
            v = c * np.outer(perp[i], turn)
            M += m * v.T @ v + m * lengths[i] ** 2 / 12 * np.outer(turn, turn)
            U += m * GRAVITY * (origin[i] + c * crank[i])[1]
            m, c = MASS[2 + i], CENTRE[2 + i]
            v = P_dot[i] + c * np.outer(across, phi_dot)
            M += m * v.T @ v + m * lengths[2 + i] ** 2 / 12 * np.outer(phi_dot, phi_dot)
            U += m * GRAVITY * (P[i] + c * e[i])[1]
        return M, U

    step = 1e-40
    M = inertia_and_potential(theta.astype(complex))[0].real
    slopes = [inertia_and_potential(theta + 1j * step * np.eye(2)[k]) for k in range(2)]
    M_slope = [slope[0].imag / step for slope in slopes]
    U_slope = np.array([slope[1].imag / step for slope in slopes])
    M_dot = M_slope[0] * theta_dot[0] + M_slope[1] * theta_dot[1]
    half = np.array([theta_dot @ x @ theta_dot / 2 for x in M_slope])
    return M @ theta_ddot + M_dot @ theta_dot - half + U_slope


def five_bar() -> Description:
    """Describe the five-bar of the closed form: it moves in x-z, so that its axes point along -y."""
    (l1, l2), b, lengths = CRANK, GROUND, CRANK + ROD
    names = ("crank1", "crank2", "rod1", "rod2")
    links = [Link("base", 0.0, np.zeros(3), np.zeros((3, 3)))]
    for name, m, c, length in zip(names, MASS, CENTRE, lengths, strict=True):
        links.append(Link(name, m, np.array([c, 0, 0]), m * length**2 / 12 * np.diag([0.0, 1.0, 1.0])))
    joints = []
    for parent, child, x in (
        ("base", "crank1", 0),
        ("base", "crank2", b),
        ("crank1", "rod1", l1),
        ("crank2", "rod2", l2),
    ):
        at = np.eye(4)
        at[0, 3] = x
        joints.append(Joint(f"j_{child}", "revolute", parent, child, at, np.array([0.0, -1.0, 0.0])))
    ends = []
    for length in lengths[2:]:
        frame = np.eye(4)
        frame[:3, :3], frame[0, 3] = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]), length
        ends.append(frame)
    closure = Closure("pin", "revolute", "rod1", ends[0], "rod2", ends[1], (0, 1, 2), "parallel")
    return Description("five_bar", tuple(links), tuple(joints), (closure,), motors=("j_crank1", "j_crank2"))


def test_a_five_bar_agrees_with_its_kinetic_energy() -> None:
    oracle, rng = Oracle(five_bar()), np.random.default_rng(0)
    for _ in range(5):
        guess = {"j_crank1": 1.9, "j_crank2": 1.2, "j_rod1": -1.2, "j_rod2": 1.0}
        q = np.array([guess[name] for name in oracle.joint_names]) + 0.1 * rng.normal(size=4)
        q = oracle.close(q)
        v = oracle.project_velocity(q, rng.normal(size=4))
        a = oracle.consistent_acceleration(q, v, rng.normal(size=4))
        at = oracle.motors
        tau = oracle.idm(q, v, a)
        close_to(tau, five_bar_closed_form(q[at], v[at], a[at]), SOLVED)
        close_to(oracle.ddm(q, v, tau), a, SOLVED)


# -------------------- what the models promise


@pytest.mark.parametrize(("kind", "base"), in_turn([k for k in KINDS if not KINDS[k].massless], BASES))
def test_inverse_and_direct_model_undo_each_other(kind: str, base: Base) -> None:
    description = random_mechanism(1, kind=kind)
    wrenches = random_wrenches(description, 1)
    q, v, a = (x[0] for x in random_states(description, base, 1, 1, wrenches=wrenches))
    oracle = Oracle(description, base)
    tau, missing = oracle.idm_and_missing(q, v, a, wrenches)
    close_to(oracle.ddm(q, v, tau, a[:6] if base == "moving" else None, wrenches), a, SOLVED)
    needed = np.abs(oracle.idm(q, v, a, wrenches={description.root: 100 * np.ones(6)})).max()
    assert np.abs(missing).max() <= SOLVED * max(np.abs(tau).max(), needed)


def test_redundant_motors_share_by_weights() -> None:
    description, q, v, a = drawn("five_bar_four_motors")
    oracle, w = Oracle(description), np.array([1.0, 4.0, 0.25, 9.0])
    tau = oracle.idm(q, v, a, weights=w)
    B = oracle.motor_map(oracle.posture(q))
    needed = B @ oracle.idm(q, v, a)
    close_to(B @ tau, needed, SOLVED)
    close_to(tau, (B.T / w[:, None]) @ np.linalg.solve(B @ (B.T / w[:, None]), needed), SOLVED)


def test_what_no_motor_can_produce_is_told() -> None:
    description, q, v, a = drawn("five_bar_one_motor")
    oracle = Oracle(description)
    pushed = a + oracle.motions(q) @ np.array([1.0, -2.0])
    tau, missing = oracle.idm_and_missing(q, v, pushed)
    full = Oracle(replace(description, motors=tuple(oracle.joint_names)))
    needed = full.idm(q, v, pushed)
    Z = oracle.motions(q)
    produced = np.zeros(oracle.nv)
    produced[oracle.motors] = tau
    close_to(Z.T @ (produced + missing), Z.T[:, full.motors] @ needed, SOLVED)
    assert np.abs(missing).max() > 1e-3 * np.abs(tau).max()


def test_solved_passive_motion_needs_no_effort() -> None:
    description, q, v, a = drawn("five_bar_one_motor")
    oracle, rng = Oracle(description), np.random.default_rng(0)
    wrenches = {description.links[0].name: rng.normal(size=6)}
    asked = a + rng.normal(size=oracle.nv)
    solved = oracle.solve_passive(q, v, asked, wrenches)
    close_to(solved[oracle.motors], asked[oracle.motors], SOLVED)
    tau, missing = oracle.idm_and_missing(q, v, asked, wrenches, passive="solved")
    assert np.abs(missing).max() <= SOLVED * np.abs(tau).max()
    close_to(oracle.ddm(q, v, tau, wrenches=wrenches), solved, SOLVED)


def test_a_forced_motion_without_mass_is_refused_an_unforced_one_rests() -> None:
    base, rod = np.zeros((3, 3)), np.diag([0.0, 1.0, 1.0])
    links = (Link("base", 0.0, np.zeros(3), base), Link("rod", 1.0, np.array([0.3, 0, 0]), rod))
    joints = (Joint("spin", "revolute", "base", "rod", np.eye(4), np.array([1.0, 0, 0])),)
    oracle = Oracle(Description("spin", links, joints, motors=("spin",)))
    assert oracle.ddm([0.1], [0.2], [0.0]) == pytest.approx(0.0)
    refused(lambda: oracle.ddm([0.1], [0.2], [1.0]), ValueError, "without mass is forced")


def test_a_wrench_on_no_link_is_refused() -> None:
    description, q, v, a = drawn("serial")
    refused(lambda: Oracle(description).idm(q, v, a, wrenches={"nobody": np.zeros(6)}), KeyError, "")


@pytest.mark.parametrize(
    ("kind", "base"),
    [
        ("five_bar", "fixed"),
        ("gear_three", "floating"),
        ("planar_rpr", "moving"),
        ("rssr", "floating"),
        slow("sps_thin", "fixed"),
    ],
)
def test_fifty_digits_agree_with_sixteen(kind: str, base: Base) -> None:
    description, q, v, a = drawn(kind, base)
    with mpmath.workdps(50):
        short, long = Oracle(description, base), Oracle(description, base, arithmetic=Extended(mpmath.mp))
        exact = long.close(q)
        v_exact = long.project_velocity(exact, v)
        a_exact = long.consistent_acceleration(exact, v_exact, a)
        tau = long.idm(exact, v_exact, a_exact)
        close_to(short.idm(q, v, a), np.array(tau, float), SOLVED)
        base_acceleration = a_exact[:6] if base == "moving" else None
        again = long.ddm(exact, v_exact, tau, base_acceleration)
        free = np.array(long.massless(exact), float)  # along these an acceleration has no answer
        left = np.array(again - a_exact, float)
        left -= free @ np.linalg.lstsq(free, left, rcond=None)[0]
        assert np.abs(left).max() <= SOLVED * np.abs(a).max()


@pytest.mark.parametrize("shape", [(7, 4), (4, 7), (5, 5)])
@pytest.mark.parametrize("rank", [0, 2, 4])
def test_both_factorisations_are_what_they_say(shape: tuple[int, int], rank: int) -> None:
    rng = np.random.default_rng(rank)
    A = rng.normal(size=(shape[0], rank)) @ rng.normal(size=(rank, shape[1]))
    b = rng.normal(size=shape[0])
    with mpmath.workdps(30):
        for arithmetic in (Float64(), Extended(mpmath.mp)):
            factor = arithmetic.factor(arithmetic.array(A), 1e-9)
            U, inverse, V, Z = (np.array(x, float) for x in factor)
            assert (U.shape[1], Z.shape[1]) == (rank, shape[1] - rank)
            close_to(U.T @ A @ V @ inverse, np.eye(rank), SOLVED)
            close_to(
                np.array(factor.least_norm(arithmetic.array(b)), float), np.linalg.pinv(A, 1e-9) @ b, SOLVED
            )
            assert np.abs(A @ Z).max(initial=0.0) <= SOLVED
            close_to(Z.T @ Z, np.eye(Z.shape[1]), SOLVED)
