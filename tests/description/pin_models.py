"""Random Pinocchio models with closed loops, closed where they are drawn."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pinocchio as pin

from hybridyn.joints.kinds import JointKind
from hybridyn.linkage.joints import TreeJoint
from hybridyn.structure.pinocchio_model import pinocchio_joint

Rng = np.random.Generator
ANCHORS = {"point": pin.PointAnchorConstraintModel, "frame": pin.FrameAnchorConstraintModel}
CONTACTS = {"3D": pin.ContactType.CONTACT_3D, "6D": pin.ContactType.CONTACT_6D}


def seeded(*seeds: int) -> Rng:
    """Return a source of numbers, and seed Pinocchio's own."""
    pin.seed(seeds[0])
    return np.random.default_rng(seeds)


def unit(rng: Rng, size: int = 3) -> np.ndarray:
    """Draw a unit vector."""
    x = rng.normal(size=size)
    return x / np.linalg.norm(x)


def pose(rng: Rng) -> pin.SE3:
    """Draw a placement."""
    return pin.SE3(pin.Quaternion(*unit(rng, 4)).matrix(), rng.uniform(-0.5, 0.5, 3))


def _continuous(rng: Rng) -> pin.JointModel:
    return pinocchio_joint(TreeJoint("", JointKind.CONTINUOUS, 0, np.eye(3), np.zeros(3), unit(rng)))


def _composite(rng: Rng) -> pin.JointModel:
    out = pin.JointModelComposite(3)
    for joint in (
        pin.JointModelRX(),
        pin.JointModelPrismaticUnaligned(unit(rng)),
        pin.JointModelRevoluteUnaligned(unit(rng)),
    ):
        out.addJoint(joint, pose(rng))
    return out


def _universal(rng: Rng) -> pin.JointModel:
    return pin.JointModelUniversal(*np.linalg.qr(rng.normal(size=(3, 3)))[0][:2])


#: Every kind of joint that is read.
JOINTS: dict[str, Callable[[Rng], Any]] = {
    "RX": lambda _: pin.JointModelRX(),
    "RY": lambda _: pin.JointModelRY(),
    "RUBZ": lambda _: pin.JointModelRUBZ(),
    "PZ": lambda _: pin.JointModelPZ(),
    "R": lambda rng: pin.JointModelRevoluteUnaligned(unit(rng)),
    "P": lambda rng: pin.JointModelPrismaticUnaligned(unit(rng)),
    "RUB": _continuous,
    "U": _universal,
    "S": lambda _: pin.JointModelSpherical(),
    "ZYX": lambda _: pin.JointModelSphericalZYX(),
    "T": lambda _: pin.JointModelTranslation(),
    "E": lambda _: pin.JointModelPlanar(),
    "C": _composite,
}


@dataclass
class Drawn:
    """A model, its constraints, and a posture that closes them."""

    model: pin.Model
    q: np.ndarray
    constraints: list[Any] = field(default_factory=list)

    @property
    def contacts(self) -> Any:
        """The constraints as Pinocchio's dynamics takes them."""
        out = pin.StdVec_RigidConstraintModel()
        for constraint in self.constraints:
            rigid = isinstance(constraint, pin.RigidConstraintModel)
            out.append(constraint if rigid else pin.convertToRigidConstraintModel(self.model, constraint))
        return out

    def rows(self) -> np.ndarray:
        """Return Pinocchio's Jacobian of the constraints."""
        data, contacts = self.model.createData(), self.contacts
        datas = pin.StdVec_RigidConstraintData([contact.createData() for contact in contacts])
        pin.computeJointJacobians(self.model, data, self.q)
        for contact, its in zip(contacts, datas, strict=True):
            contact.calc(self.model, data, its)
        return np.asarray(pin.getConstraintsJacobian(self.model, data, contacts, datas))

    def velocity(self, rng: Rng) -> np.ndarray:
        """Draw rates that the constraints allow."""
        rows = self.rows()
        v = rng.normal(size=self.model.nv)
        return v - np.linalg.lstsq(rows, rows @ v, rcond=1e-10)[0]

    def acceleration(self, v: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """Return Pinocchio's accelerations under efforts of all joints, shape (nv,)."""
        data, contacts = self.model.createData(), self.contacts
        datas = pin.StdVec_RigidConstraintData([contact.createData() for contact in contacts])
        pin.initConstraintDynamics(self.model, data, contacts, datas)
        settings = pin.ProximalSettings(1e-15, 1e-10, 100)
        return np.array(pin.constraintDynamics(self.model, data, self.q, v, tau, contacts, datas, settings))


def drawn(
    rng: Rng,
    joints: Sequence[str],
    closures: Sequence[str] = (),
    *,
    floating: bool = False,
    branch: int = 0,
    armature: float = 0.0,
) -> Drawn:
    """Draw a model of two chains, whose tips the closures tie.

    Args:
        rng: Source of numbers.
        joints: Names of `JOINTS`, those of the first chain first.
        closures: "3D", "6D", "point", "frame"; each ties the tips of the two chains, or, on a single chain,
            the tip and the world.
        floating: Whether a free-flyer carries the chains.
        branch: Number of joints of the second chain.
        armature: Size of the armature of joints with one freedom.
    """
    model = pin.Model()
    model.name = "drawn"
    root = 0
    if floating:
        root = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "free")
        model.appendBodyToJoint(root, pin.Inertia.Random(), pin.SE3.Identity())
    tips, tip = [], root
    for number, kind in enumerate(joints):
        if number == len(joints) - branch:
            tips.append(tip)
            tip = root
        tip = model.addJoint(tip, JOINTS[kind](rng), pose(rng), f"j{len(joints) - number}_{kind}")
        if model.nvs[tip] == 1:
            model.armature[model.idx_vs[tip]] = armature * rng.uniform(0.5, 2.0)
        mass = rng.uniform(0.5, 2.0)
        inertia = pin.Inertia.FromEllipsoid(mass, *rng.uniform(0.1, 0.4, 3))
        model.appendBodyToJoint(tip, inertia, pose(rng))
        model.addBodyFrame(f"body{number}", tip, pose(rng) if number % 2 else pin.SE3.Identity(), 0)
    tips.append(tip)
    if len(tips) == 1:
        tips.insert(0, 0)
    q = pin.randomConfiguration(model, -np.ones(model.nq), np.ones(model.nq))
    out = Drawn(model, q)
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    for number, kind in enumerate(closures):
        first = pose(rng)
        second = data.oMi[tips[1]].actInv(data.oMi[tips[0]]) * first
        ends = (tips[0], first, tips[1], second)
        if kind in CONTACTS:
            reference = pin.LOCAL if number % 2 else pin.LOCAL_WORLD_ALIGNED
            constraint = pin.RigidConstraintModel(CONTACTS[kind], model, *ends, reference)
        else:
            constraint = ANCHORS[kind](model, *ends)
        constraint.name = f"loop{number}"
        out.constraints.append(constraint)
    return out
