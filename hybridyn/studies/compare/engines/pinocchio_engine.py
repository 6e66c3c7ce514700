"""Pinocchio: the robot as its reader of URDF sees it, and with constraint models for its closures.

Its algorithms are two solvers for closed loops, `aba` and `rnea` of trees, and `rnea` projected.

The projection is the honest baseline of inverse dynamics. With K the closure rows, split into motors m and
passive joints p, K v = 0 and Q the tree's efforts,

    tau = Q_m - K_m^T K_p^-T Q_p,

one solve of K_p: of all the robot at once (dense), or module after module, since a module's rows touch its
own joints only. Where K_p is not square, the minimum-norm solution of the same rows. A cheaper baseline of
equal accuracy is not known to us. `pin.rnea` of a robot with loops, which does not close them, is listed too:
its time is a floor for whoever starts there, its efforts are another robot's.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np
import pinocchio as pin

from ....description.placement import placement_from
from ....description.records import Closure
from ....spatial import Array, Index
from ....structure.robot import HybridRobot
from ..methods import Method, Model, Setting, Solver, grid
from ..peer_engine import NotComparableError, OwnFile, PeerEngine, at_points, refuse_other_joints
from ..states import DEPENDENT

#: Distance of the two points that stand for a hinge from its centre, relative to the robot's size.
HINGE = 0.1
#: Proximal settings: accuracy, mu and iterations. Rows may be redundant, so mu is not zero.
SETTINGS = (1e-14, 1e-10, 100)
#: Of the proximal iterations: they end at their count, or when nothing changes any more.
ACCURACY = 1e-15
#: What is swept of the two solvers for closed loops, both proximal: the sparse Cholesky factors of the KKT
#: matrix, and the loop-constrained articulated body algorithm, of linear cost.
SWEPT = {
    "constraintDynamics": grid(mu=(1e-14, 1e-12, 1e-10, 1e-8, 1e-6, 1e-4, 1e-2), iterations=(1, 2, 3, 5, 10)),
    "lcaba": grid(mu=(1e-8, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1), iterations=(1, 2, 3, 4, 5, 6, 8, 10, 15)),
}
#: Most velocities: Pinocchio's Data holds several nv^3 tensors, 3 GB there.
MOST = 400

Parts = list[tuple[Index, Index, Index]]  # rows, motors and passive freedoms of each module


class PinocchioEngine:
    """A Pinocchio model with rigid constraints.

    Attributes:
        model, data: Pinocchio's.
        contacts, datas: The constraints.
        owners: Names of the closures that they state, where it is known.
    """

    def __init__(
        self, robot: HybridRobot, model: pin.Model, contacts: pin.StdVec_RigidConstraintModel, way: str,
        notes: tuple[str, ...] = (), owners: Sequence[str] = (),
    ) -> None:  # fmt: skip
        self.robot, self.model, self.way, self.notes, self.owners = robot, model, way, notes, owners
        model.gravity.linear = np.array(robot.gravity)
        model.armature[:] = 0.0
        self.data, self.contacts = model.createData(), contacts
        self.datas = pin.StdVec_RigidConstraintData([contact.createData() for contact in contacts])
        pin.initConstraintDynamics(model, self.data, contacts, self.datas)
        self.settings = pin.ProximalSettings(*SETTINGS)
        numbers = [model.getJointId(name) for name in robot.joints]
        if robot.base != "fixed":
            numbers[0] = 1
        # Endless gears are angles here, and cosine and sine in models that Pinocchio reads.
        turns = [i for i, n in enumerate(numbers) if model.nqs[n] == 2 and robot.kinds[i].additive]
        sizes = [1 if i in turns else model.nqs[n] for i, n in enumerate(numbers)]
        starts = [model.idx_qs[n] for n in numbers]
        self.q_at = np.concatenate([self._range(*own) for own in zip(starts, sizes, strict=True)])
        self.turned = np.array([robot.q_slices[i].start for i in turns], dtype=int)
        self.v_at = np.concatenate([self._range(model.idx_vs[n], model.nvs[n]) for n in numbers])
        if len(self.q_at) != robot.nq or len(self.v_at) != robot.nv:
            raise NotComparableError("Pinocchio's joints have other coordinates")

    @staticmethod
    def _range(start: int, size: int) -> Index:
        return np.arange(int(start), int(start) + int(size))

    def _theirs(self, q: Array, *rates: Array) -> list[Array]:
        positions = np.zeros(self.model.nq)
        positions[self.q_at] = q
        cosines = self.q_at[self.turned]
        positions[cosines], positions[cosines + 1] = np.cos(q[self.turned]), np.sin(q[self.turned])
        out = [positions]
        for x in rates:
            own = np.zeros(self.model.nv)
            own[self.v_at] = x
            out.append(own)
        return out

    def efforts(self, tau: Array) -> Array:
        """Spread the motors' efforts over the joints, shape (nv,)."""
        out = np.zeros(self.robot.nv)
        out[self.robot.motor_v] = tau
        return out

    def forward(self, q: Array, v: Array, force: Array) -> Array:
        """Compute accelerations by `constraintDynamics` (`aba` where there is no constraint)."""
        state = (self.model, self.data, *self._theirs(q, v, force))
        if len(self.contacts):
            found = pin.constraintDynamics(*state, self.contacts, self.datas, self.settings)
        else:
            found = pin.aba(*state)
        out: Array = np.asarray(found)[self.v_at]
        return out

    def inverse(self, q: Array, v: Array, a: Array) -> Array:
        """Compute forces by `rnea`."""
        out: Array = np.array(pin.rnea(self.model, self.data, *self._theirs(q, v, a)))[self.v_at]
        return out

    def rows(self, q: Array) -> Array:
        """Return the constraints' Jacobian, shape (rows, nv), at Pinocchio's own positions."""
        pin.computeJointJacobians(self.model, self.data, q)
        for contact, data in zip(self.contacts, self.datas, strict=True):
            contact.calc(self.model, self.data, data)
        K: Array = pin.getConstraintsJacobian(self.model, self.data, self.contacts, self.datas)
        return K

    def freedoms(self, q: Array) -> int:
        """Count freedoms by the rank of the constraints' Jacobian."""
        rank = np.linalg.matrix_rank(self.rows(*self._theirs(q)), rtol=DEPENDENT) if len(self.contacts) else 0
        return int(self.model.nv - rank)


def ways(robot: HybridRobot, own: OwnFile) -> Iterator[tuple[str, Callable[[], PeerEngine]]]:
    """Yield the ways into Pinocchio: by its reader of URDF, and by constraint models."""
    if own.format == "URDF":
        yield "its URDF reader", partial(_read, robot, own)
    yield "rigid constraints", partial(with_constraints, robot)


def _read(robot: HybridRobot, own: OwnFile) -> PeerEngine:
    """Read the robot's own file with Pinocchio's reader."""
    root = [] if robot.base == "fixed" else [pin.JointModelFreeFlyer()]
    try:
        model = pin.buildModelFromXML(own.text, *root)
    except (RuntimeError, ValueError) as error:
        raise NotComparableError(
            f"Pinocchio's reader refuses it: {' '.join(str(error).split())[:200]}"
        ) from None
    theirs = [str(name) for name in model.names][1:]
    names = theirs if robot.base == "fixed" else [robot.joints[0], *theirs[1:]]
    refuse_other_joints(robot, names, "Pinocchio's reader")
    return PinocchioEngine(robot, model, pin.StdVec_RigidConstraintModel(), "its URDF reader")


def with_constraints(robot: HybridRobot) -> PinocchioEngine:
    """Add a rigid constraint for each closure that Pinocchio has; a note names what it has none for."""
    model = robot.unchanged_model.copy()
    contacts, left_out, owners = pin.StdVec_RigidConstraintModel(), list[str](), list[str]()
    for closure in robot.description.closures:
        found = list(_contacts(robot, model, closure))
        left_out += [] if found else [closure.name]
        owners += len(found) * [closure.name]
        for contact in found:
            contacts.append(contact)
    left_out += [coupling.name for coupling in robot.description.couplings]
    note = (f"Pinocchio has no constraint for {', '.join(left_out)}",) if left_out else ()
    return PinocchioEngine(robot, model, contacts, "rigid constraints", note, owners)


def _contacts(robot: HybridRobot, model: pin.Model, closure: Closure) -> Iterator[pin.RigidConstraintModel]:
    """Yield the constraints of a closure: a point, a weld, or two points on the axis of a hinge.

    Of the six rows of two points, five are independent. There are none for other closures.
    """
    if closure.translations != (0, 1, 2) or closure.rotation == "perpendicular":
        return
    ends = []
    for link, frame in ((closure.link_a, closure.frame_a), (closure.link_b, closure.frame_b)):
        body, R, p = robot.bodies.place[link]
        root = 0 if robot.base == "fixed" else 1
        joint = model.getJointId(robot.bodies.joints[body - 1].joint.name) if body else root
        ends.append((joint, pin.SE3(np.asarray(R), np.asarray(p)), frame))
    fixed, reach = closure.rotation == "fixed", HINGE * robot.bodies.size
    contact = pin.ContactType.CONTACT_6D if fixed else pin.ContactType.CONTACT_3D
    for shift in (-reach, reach) if closure.rotation == "parallel" else (0.0,):
        way = placement_from(np.eye(3), np.array([0.0, 0.0, shift]))
        frames = [x for joint, at, frame in ends for x in (joint, at * pin.SE3(frame @ way))]
        yield pin.RigidConstraintModel(contact, model, *frames)


def closed(robot: HybridRobot) -> PinocchioEngine:
    """Return a robot with all its closures. Make one for each algorithm: they keep state in it.

    Raises:
        NotComparableError: It has closures or couplings that Pinocchio cannot state.
    """
    own = with_constraints(at_points(robot))
    if own.notes:
        raise NotComparableError(own.notes[0])
    return own


def loop_solver(own: PinocchioEngine, name: str) -> Callable[..., Array]:
    """Prepare one of the solvers for loops; `lcaba` without the minimal ordering would end the process."""
    if name == "lcaba":
        pin.computeJointMinimalOrdering(own.model, own.data, own.contacts)
    solve: Callable[..., Array] = getattr(pin, name)
    return solve


def direct(name: str, robot: HybridRobot) -> Callable[[Setting], Solver]:
    """Prepare a robot for one of them."""
    own = closed(robot)
    call, closures = loop_solver(own, name), (own.contacts, own.datas)

    def at(setting: Setting) -> Solver:
        settings = pin.ProximalSettings(ACCURACY, setting["mu"], int(setting["iterations"]))

        def solve(q: Array, v: Array, tau: Array) -> Array:
            return call(own.model, own.data, q, v, own.efforts(tau), *closures, settings)

        return solve

    return at


def project(K: Array, Q: Array, motors: Index, passive: Index) -> Array:
    """Return the motors' efforts (..., motors) that do the work of Q (..., nv)."""
    K_p = np.swapaxes(K[..., passive], -1, -2)
    if K_p.shape[-1] == K_p.shape[-2]:
        forces = np.linalg.solve(K_p, Q[..., passive, None])
    else:
        forces = np.linalg.pinv(K_p, rcond=1e-10) @ Q[..., passive, None]
    out: Array = Q[..., motors] - (np.swapaxes(K[..., motors], -1, -2) @ forces)[..., 0]
    return out


def projected(robot: HybridRobot) -> PinocchioEngine:
    """Return a robot whose motors determine every motion, for the projection.

    Raises:
        NotComparableError: It has no closures, or passive motions that the motors do not determine.
    """
    if not robot.description.closures:
        raise NotComparableError("no loops: pin.rnea alone does it")
    if robot.mobility != len(robot.motors):
        raise NotComparableError(
            f"{robot.mobility} freedoms, {len(robot.motors)} motors: no projection onto them"
        )
    return closed(robot)


def dense(robot: HybridRobot) -> Callable[[Setting], Solver]:
    """Project with one solve for the whole robot."""
    own, motors = projected(robot), robot.motor_v
    passive = np.setdiff1d(np.arange(robot.nv), motors)

    def solve(q: Array, v: Array, a: Array) -> Array:
        K = own.rows(q)
        return project(K, pin.rnea(own.model, own.data, q, v, a), motors, passive)

    return lambda setting: solve


def per_module(robot: HybridRobot) -> Callable[[Setting], Solver]:
    """Project module after module; equal modules in one stacked solve."""
    own = projected(robot)
    alike: dict[tuple[int, int, int], Parts] = {}
    for rows, motors, passive in _parts(robot, own):
        alike.setdefault((len(rows), len(motors), len(passive)), []).append((rows, motors, passive))
    groups = [tuple(np.array(x) for x in zip(*same, strict=True)) for same in alike.values()]

    def solve(q: Array, v: Array, a: Array) -> Array:
        K = own.rows(q)
        Q = pin.rnea(own.model, own.data, q, v, a)
        whole = Q.copy()
        for rows, motors, passive in groups:
            freedoms = np.concatenate([motors, passive], axis=1)
            own_K = K[rows[:, :, None], freedoms[:, None, :]]
            m = motors.shape[1]
            split = np.arange(freedoms.shape[1])
            whole[motors] = project(own_K, Q[freedoms], split[:m], split[m:])
        out: Array = whole[robot.motor_v]
        return out

    return lambda setting: solve


def _parts(robot: HybridRobot, own: PinocchioEngine) -> Parts:
    """Return each module's rows of K, motors and passive freedoms; one without loops has no rows."""
    rows: dict[str, list[int]] = {}
    at = 0
    for name, contact in zip(own.owners, own.contacts, strict=True):
        size = 3 if contact.type == pin.ContactType.CONTACT_3D else 6
        rows.setdefault(name, []).extend(range(at, at + size))
        at += size
    out = []
    for module in robot.modules:
        mine = [row for name in module.closures for row in rows[name]]
        motors = np.array([i for i in robot.motor_v if i in module.v_index], dtype=int)
        if mine:
            out.append((np.array(mine, dtype=int), motors, np.setdiff1d(module.v_index, motors)))
    return out


def tree_alone(model: Model, closed: bool, robot: HybridRobot) -> Callable[[Setting], Solver]:
    """Prepare `pin.aba` or `pin.rnea`; of a robot with loops, the tree cut open.

    Raises:
        NotComparableError: It has no loops where some are wanted, or the other way round; or couplings.
    """
    if robot.description.couplings:
        raise NotComparableError("couplings of joints are no closures for Pinocchio")
    if bool(robot.description.closures) != closed:
        raise NotComparableError("no loops: listed as pin.rnea" if closed else "it has loops")
    own, motors = robot.unchanged_model.copy(), robot.motor_v
    data, efforts = own.createData(), np.zeros(robot.nv)

    def direct(q: Array, v: Array, tau: Array) -> Array:
        efforts[motors] = tau
        a: Array = pin.aba(own, data, q, v, efforts)
        return a.copy()

    def inverse(q: Array, v: Array, a: Array) -> Array:
        out: Array = pin.rnea(own, data, q, v, a)[motors]
        return out

    return lambda setting: direct if model == "ddm" else inverse


METHODS = (
    *(Method(f"pin.{name}", "ddm", partial(direct, name), swept, most=MOST) for name, swept in SWEPT.items()),
    Method("pin.rnea + projection, dense", "idm", dense, most=MOST),
    Method("pin.rnea + projection, per module", "idm", per_module, most=MOST),
    Method("pin.rnea, loops open", "idm", partial(tree_alone, "idm", True), most=MOST),
    Method("pin.aba", "ddm", partial(tree_alone, "ddm", False), most=MOST),
    Method("pin.rnea", "idm", partial(tree_alone, "idm", False), most=MOST),
)
