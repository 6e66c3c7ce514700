"""Wrenches inside the robot against balances written elsewhere: Pinocchio's tree, and the oracle's bodies."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn.description.records import Closure
from hybridyn.spatial import Array
from hybridyn.structure.building import build_robot
from tests.oracle import Base, Oracle
from tests.robots.mechanisms import KINDS, random_mechanism, random_states, random_wrenches
from tests.support.comparing import SOLVED, close_to
from tests.support.files import save
from tests.support.samples import in_turn, some

BASES: tuple[Base, ...] = ("fixed", "moving", "floating")
SEED = 12
BALANCED = 1e-10  # of the largest effort: multipliers of redundant rows are found by singular values
LOOPED = [k for k in KINDS if KINDS[k].loops]

Case = tuple[hybridyn.HybridRobot, Array, Array, Array, dict[str, Array], Array, hybridyn.Reactions]


def solved(kind: str, base: Base, count: int = 2) -> Case:
    description = random_mechanism(SEED, kind=kind)
    wrenches = random_wrenches(description, SEED)
    robot = build_robot(description, base=base)
    q, v, a = random_states(description, base, SEED, count, wrenches=wrenches)
    tau, reactions = hybridyn.idm(
        robot, q, v, a, wrenches=wrenches, weights=np.ones(len(robot.motors)), reactions=True
    )
    return robot, q, v, a, wrenches, tau, reactions


def outer_forces(case: Case, t: int) -> tuple[pin.Model, pin.Data, pin.StdVec_Force]:
    """Return what wrenches on links and closures exert on the joints' children of the spanning tree."""
    robot, q, _, _, wrenches, _, reactions = case
    model, data = robot.model, robot.model.createData()
    pin.forwardKinematics(model, data, q[t])
    pin.updateFramePlacements(model, data)
    force = pin.StdVec_Force([pin.Force.Zero() for _ in range(model.njoints)])

    def push(link: str, world: pin.Force) -> None:
        joint = model.frames[model.getFrameId(link, pin.BODY)].parentJoint
        force[joint] += data.oMi[joint].actInv(world)

    for link, wrench in wrenches.items():
        push(link, data.oMf[model.getFrameId(link, pin.BODY)].act(pin.Force(wrench)))
    for closure in robot.description.closures:
        A = data.oMf[model.getFrameId(closure.link_a, pin.BODY)] * pin.SE3(closure.frame_a)
        B = data.oMf[model.getFrameId(closure.link_b, pin.BODY)] * pin.SE3(closure.frame_b)
        on_b = pin.SE3(A.rotation, B.translation).act(pin.Force(reactions.closures[closure.name][t]))
        push(closure.link_b, on_b)
        push(closure.link_a, -on_b)
    return model, data, force


def left_over(case: Case, t: int) -> tuple[Array, float]:
    """Return what the tree still needs once motors, closures and outer wrenches have acted, shape (nv,)."""
    robot, q, v, a, _, tau, reactions = case
    model, data, force = outer_forces(case, t)
    needed = pin.rnea(model, data, q[t], v[t], a[t], force)
    size = np.abs(pin.rnea(model, data, q[t], v[t], a[t])).max()
    column = {name: at.start for name, at in zip(robot.joints, robot.v_slices, strict=True)}
    for motor, effort in zip(robot.motors, tau[t], strict=True):
        needed[column[motor]] -= effort
    for coupling in robot.description.couplings:
        (multiplier,) = reactions.closures[coupling.name][t]
        for joint, coefficient in coupling.terms:
            needed[column[joint]] -= coefficient * multiplier
    largest = max([size, *(np.abs(w[t]).max() for w in reactions.closures.values())])
    return needed, float(largest)


def joints_differ(case: Case, t: int) -> float:
    """Return by how much the wrenches of joints differ from those of Pinocchio's tree, of the largest."""
    _, q, v, a, _, _, reactions = case
    model, data, force = outer_forces(case, t)
    pin.rnea(model, data, q[t], v[t], a[t], force)
    expected = {name: data.f[model.getJointId(name)].vector for name in reactions.joints}
    size = max(np.abs(f).max() for f in expected.values())
    return max(float(np.abs(reactions.joints[name][t] - f).max()) for name, f in expected.items()) / size


@pytest.mark.parametrize(("kind", "base"), in_turn([*LOOPED, "serial", "serial_all"], BASES))
def test_joints_transmit_what_the_tree_beyond_them_needs(kind: str, base: Base) -> None:
    case = solved(kind, base)
    assert {*case[-1].joints} == {name for module in case[0].modules for name in module.joints}
    assert max(joints_differ(case, t) for t in range(2)) < BALANCED


@pytest.mark.parametrize(("kind", "base"), in_turn(LOOPED, BASES))
def test_motors_closures_and_wrenches_are_all_that_the_tree_needs(kind: str, base: Base) -> None:
    """Every joint of the spanning tree is free of other efforts; only the base may carry the robot."""
    case = solved(kind, base)
    robot, reactions = case[0], case[-1]
    for t in range(2):
        needed, size = left_over(case, t)
        if base == "moving":
            root = robot.description.root
            close_to(
                needed[:6], reactions.base[t], BALANCED * size / max(np.abs(reactions.base[t]).max(), 1e-9)
            )
            assert robot.bodies.place[root][0] == 0
            needed = needed[6:]
        assert np.abs(needed).max() < BALANCED * size


def test_wrenches_on_links_of_cut_wrists_reach_the_closures() -> None:
    """One link at a time, inside the chains and at their ends."""
    description = random_mechanism(1, kind="gough_gimbals")
    robot = build_robot(description)
    q, v, a = random_states(description, "fixed", 1, 1)
    (module,) = robot.modules
    inside = {module.joints[j] for w in module.mechanism.spec.wrists for j in w.joints}
    bodies = {robot.body_of_joint[j] for j in inside}
    links = [name for name, (body, *_) in robot.bodies.place.items() if body in bodies]
    assert len(links) >= 12
    for link in links:
        wrenches = {link: np.array([3.0, -1.0, 2.0, 0.5, 1.5, -0.7])}
        tau, reactions = hybridyn.idm(robot, q, v, a, wrenches=wrenches, reactions=True)
        case = robot, q, v, a, wrenches, tau, reactions
        needed, size = left_over(case, 0)
        assert np.abs(needed).max() < BALANCED * size
        assert joints_differ(case, 0) < BALANCED


@pytest.mark.parametrize(("kind", "base"), in_turn([*LOOPED, "serial", "serial_all"], BASES))
def test_the_base_carries_what_all_bodies_together_need(kind: str, base: Base) -> None:
    """Their change of momentum, less gravity and outer wrenches; nothing where the base floats."""
    robot, q, v, a, wrenches, _, reactions = solved(kind, base)
    oracle = Oracle(robot.description, base)
    for t in range(2):
        expected = oracle.support(q[t], v[t], a[t], wrenches)
        size = max(np.abs(w[t]).max() for w in reactions.modules.values())
        assert np.abs(reactions.base[t] - expected).max() < SOLVED * max(size, np.abs(expected).max())
        if base == "floating":
            assert np.abs(reactions.base[t]).max() < SOLVED * size


def carried_by(robot: hybridyn.HybridRobot, number: int) -> set[int]:
    """Return the bodies of a module and of all that stand on it."""
    modules = {number}
    for k, module in enumerate(robot.modules):
        if module.parent in modules:
            modules.add(k)
    return {robot.body_of_joint[j] for k in modules for j in robot.modules[k].joints}


@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize(
    "kind", ["stack", "on_leg", "branched", "scara_delta", "gough_gimbals", "chain_of_bars", "serial"]
)
def test_a_base_body_gives_its_module_what_everything_on_it_needs(kind: str, base: Base) -> None:
    """Newton and Euler for all bodies beyond, about the base body's origin."""
    robot, q, v, a, wrenches, _, reactions = solved(kind, base)
    oracle = Oracle(robot.description, base)
    for t in range(2):
        posture = oracle.posture(q[t])
        V, g, _ = oracle.tree.drifts(posture, v[t])
        needed = oracle.bodies.needed(posture, V, (posture.G @ a[t]).reshape(-1, 6) + g, wrenches)
        ours = {posture.links[x].body: body for x, (body, *_) in robot.bodies.place.items()}
        for k, module in enumerate(robot.modules):
            if module.base == "world":
                continue
            beyond = carried_by(robot, k)
            data = robot.model.createData()
            pin.framesForwardKinematics(robot.model, data, q[t])
            body = robot.bodies.place[module.base][0]
            joint = robot.bodies.joints[body - 1].joint.name if body else robot.joints[0]
            M = data.oMi[robot.model.getJointId(joint)] if body or base != "fixed" else pin.SE3.Identity()
            total = pin.Force.Zero()
            for i, (wrench, origin) in enumerate(zip(needed, posture.origins, strict=True)):
                if ours.get(i) in beyond:
                    total += pin.SE3(np.eye(3), np.asarray(origin, float)).act(
                        pin.Force(np.asarray(wrench, float))
                    )
            close_to(reactions.modules[module.name][t], M.actInv(total).vector, BALANCED)


def unmoved(robot: hybridyn.HybridRobot, data: pin.Data, closure: Closure) -> list[Array]:
    """Return the axes about which a closure exerts no moment, in its frame on the predecessor."""
    A, B = (
        data.oMf[robot.model.getFrameId(link, pin.BODY)].rotation @ frame[:3, :3]
        for link, frame in ((closure.link_a, closure.frame_a), (closure.link_b, closure.frame_b))
    )
    z = (A.T @ B)[:, 2]
    axes = {"free": [*np.eye(3)], "parallel": [z], "perpendicular": [z, np.array([0.0, 0.0, 1.0])]}
    return axes.get(closure.rotation, [])


@pytest.mark.parametrize("kind", some(LOOPED))
def test_closures_do_not_act_where_they_leave_freedom(kind: str) -> None:
    """No force along a free slide and no moment about a free axis, in the closure's own frames."""
    robot, q, _, _, _, _, reactions = solved(kind, "fixed")
    data = robot.model.createData()
    for closure in robot.description.closures:
        for t in range(2):
            pin.framesForwardKinematics(robot.model, data, q[t])
            wrench = reactions.closures[closure.name][t]
            size = max(np.abs(wrench).max(), 1e-9)
            free = [i for i in range(3) if i not in closure.translations]
            assert np.abs(wrench[free]).max(initial=0.0) < SOLVED * size
            for axis in unmoved(robot, data, closure):
                assert abs(axis @ wrench[3:]) < SOLVED * size


@pytest.mark.parametrize(
    ("kind", "unique"),
    [("four_bar", False), ("four_bar_point", False), ("planar_rpr", False), ("delta_bars", False),
     ("gough", True), ("rps3", False), ("loop_revolute", True), ("gear_two", True), ("gear_inside", False)],
)  # fmt: skip
def test_redundant_closures_are_flagged(kind: str, unique: bool) -> None:
    """Where rows outnumber rank, not every wrench is determined, and the caller is told which.

    A coupling beside a redundant closure has a row of its own, and its multiplier stays unique.
    """
    robot, *_, reactions = solved(kind, "fixed")
    for module in robot.modules:
        report = module.mechanism.reduction.report
        told = [reactions.unique[name] for name in module.closures]
        assert all(told) == (report.rank == report.rows)
        assert told == [bool(reactions.determined[name].all()) for name in module.closures]
    couplings = {coupling.name for coupling in robot.description.couplings}
    names = [name for module in robot.modules for name in module.closures]
    flags = [reactions.unique[name] for name in names if unique or name not in couplings]
    if kind == "rps3":
        return  # depends on how its legs' wrists were drawn
    assert all(flags) if unique else not any(flags)


@pytest.mark.parametrize("kind", ["four_bar", "planar_rpr", "delta_bars", "rps3", "gough", "loop_revolute"])
def test_self_stresses_reach_the_joints_that_are_not_determined(kind: str) -> None:
    """Closure wrenches without effect on the motion, found in Pinocchio's tree, against what is told."""
    robot, q, v, a, _, tau, reactions = solved(kind, "fixed", 1)
    closures = [c.name for c in robot.description.closures]
    assert not robot.description.couplings

    def tree(wrenches: Array) -> tuple[Array, dict[str, Array]]:
        """Return the efforts and the joints' wrenches of the tree at rest under closure wrenches alone."""
        given = dict(zip(closures, wrenches.reshape(-1, 1, 6), strict=True))
        case = robot, q, v, a, {}, tau, replace(reactions, closures=given)
        model, data, force = outer_forces(case, 0)
        model.gravity.linear = np.zeros(3)
        rest = np.zeros(robot.nv)
        efforts = pin.rnea(model, data, q[0], rest, rest, force)
        return efforts, {name: data.f[model.getJointId(name)].vector.copy() for name in reactions.joints}

    units = np.eye(6 * len(closures))
    idle = np.zeros((0, len(units)))
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q[0])
    for i, closure in enumerate(robot.description.closures):
        rows = [units[6 * i + k] for k in range(3) if k not in closure.translations]
        rows += [np.concatenate([[0.0] * (6 * i + 3), x, [0.0] * (len(units) - 6 * i - 6)])
                 for x in unmoved(robot, data, closure)]  # fmt: skip
        idle = np.concatenate([idle, np.reshape(rows, (-1, len(units)))])
    length = np.tile([robot.modules[0].mechanism.length] * 3 + [1.0] * 3, len(closures))
    every = np.array([tree(unit)[0] for unit in units]).T / length
    _, s, Vt = np.linalg.svd(np.concatenate([every, idle / length]))
    stresses = Vt[(np.append(s, np.zeros(len(Vt) - len(s))) < 1e-9 * s[0])] / length
    moved = [tree(stress)[1] for stress in stresses]
    for name, told in reactions.joints_determined.items():
        most = np.max([np.abs(wrenches[name]) for wrenches in moved] or [np.zeros(6)], axis=0)
        assert told[0].tolist() == (most < 1e-7).tolist(), name


def test_every_module_and_closure_has_its_reaction() -> None:
    description = random_mechanism(0, kind="chain_of_bars")
    robot = build_robot(description)
    q, v, a = random_states(description, "fixed", 0, 3)
    _, batch = hybridyn.idm(robot, q, v, a, reactions=True)
    assert set(batch.modules) == {m.name for m in robot.modules}
    assert set(batch.closures) == {c.name for c in description.closures} == set(batch.unique)
    assert batch.base.shape == (3, 6)
    assert all(w.shape == (3, 6) for w in (*batch.modules.values(), *batch.closures.values()))


def test_asking_for_reactions_does_not_change_the_efforts() -> None:
    robot, q, v, a, wrenches, tau, _ = solved("stack", "fixed")
    close_to(hybridyn.idm(robot, q, v, a, wrenches=wrenches), tau, 1e-15)


PORTAL = """<robot name="portal"><link name="ground"/>
  <link name="crank"><inertial><mass value="1e-9"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>
  </inertial></link>
  <link name="beam"><inertial><origin xyz="0.5 0 0"/><mass value="1"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
  <link name="rocker"/>
  <joint name="drive" type="revolute"><parent link="ground"/><child link="crank"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="10" velocity="9"/></joint>
  <joint name="elbow" type="continuous"><origin xyz="0 0 1"/><parent link="crank"/><child link="beam"/>
    <axis xyz="0 1 0"/></joint>
  <joint name="swing" type="continuous"><origin xyz="1 0 0"/><parent link="ground"/><child link="rocker"/>
    <axis xyz="0 1 0"/></joint>
  {}
  <transmission name="t"><type>transmission_interface/SimpleTransmission</type><joint name="drive"/>
  <actuator name="m"/></transmission>
</robot>"""
LOOP = (
    '<loop name="pin" {}><predecessor link="beam"><origin xyz="1 0 0" rpy="{rpy}"/></predecessor>'
    '<successor link="rocker"><origin xyz="0 0 1" rpy="{rpy}"/></successor>{}</loop>'
)

FORMS = {
    "in the plane": LOOP.format('type="rows" rows="tx tz"', "", rpy="0 0 0"),
    "ball": LOOP.format('type="spherical"', "", rpy="0 0 0"),
    "five rows": LOOP.format('type="rows" rows="tx ty tz rx rz"', "", rpy="0 0 0"),
    "sleeve": LOOP.format('type="cylindrical"', '<axis xyz="0 1 0"/>', rpy="0 0 0"),
    "hinge": LOOP.format('type="revolute"', '<axis xyz="0 1 0"/>', rpy="0 0 0"),
    "hinge the other way": LOOP.format('type="revolute"', '<axis xyz="0 -1 0"/>', rpy="0 0 0"),
    "frame whose x points up": LOOP.format('type="revolute"', '<axis xyz="0 1 0"/>', rpy=f"0 {-np.pi / 2} 0"),
    "two hinges": LOOP.format('type="universal"', '<axis xyz="0 1 0"/><axis2 xyz="1 0 0"/>', rpy="0 0 0"),
    "loop joint": (
        '<loop_joint name="pin" type="revolute"><link1 link="beam" xyz="1 0 0"/>'
        '<link2 link="rocker" xyz="0 0 1"/><axis xyz="0 1 0"/></loop_joint>'
    ),
}


@pytest.mark.parametrize("form", FORMS)
def test_a_hinge_has_one_reaction_however_it_is_written(form: str, tmp_path: Path) -> None:
    """Half the beam's weight rests on the rocker, in the axes of the `<origin>` that the author wrote."""
    robot = hybridyn.load(save(tmp_path, PORTAL.format(FORMS[form]), "portal.urdf"))
    rest = np.zeros(robot.nv)
    _, reactions = hybridyn.idm(robot, robot.home, rest, rest, reactions=True)
    down = [-4.905, 0.0, 0.0] if form == "frame whose x points up" else [0.0, 0.0, -4.905]
    close_to(reactions.closures["pin"][:3], np.array(down), 1e-8)
    assert reactions.determined["pin"][[0, 2]].all()
