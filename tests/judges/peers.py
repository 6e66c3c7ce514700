"""Pinocchio models of descriptions, built here and nowhere else, so that tests have a judge of their own."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin

from hybridyn.description import read
from hybridyn.description.records import Description
from tests.support.extras import robots_of_others, skip


def example_urdf(name: str) -> Path:
    """Return a URDF file of `example-robot-data`."""
    listed = robots_of_others() or skip("robots") or []
    return next(path for path in listed if path.name == name)


def describe(urdf: Path) -> Description:
    """Read a plain URDF tree: nothing is coupled, every joint with one freedom is driven."""
    found = read(urdf)
    motors = tuple(j.name for j in found.joints if j.kind in ("revolute", "continuous", "prismatic"))
    return replace(found, motors=motors, couplings=(), home={})


class Peer:
    """The spanning tree of a description as a Pinocchio model, and its point and weld closures.

    Attributes:
        model, data: Pinocchio's.
        links: Link name to (joint index, placement of the link in that joint's frame).
    """

    def __init__(self, description: Description, base: str = "fixed") -> None:
        self.description = description
        self.model = pin.Model()
        at = 0
        if base != "fixed":
            at = self.model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root_joint")
        self.links = {description.root: (at, pin.SE3.Identity())}
        self._grow(description.root)
        for link in description.links:
            index, placement = self.links[link.name]
            self.model.appendBodyToJoint(index, pin.Inertia(link.mass, link.com, link.inertia), placement)
        self.data = self.model.createData()
        assert self.model.check(self.data)

    def _grow(self, parent: str) -> None:
        for joint in sorted((j for j in self.description.joints if j.parent == parent), key=lambda j: j.name):
            index, placement = self.links[parent]
            M = placement * pin.SE3(joint.placement)
            self.links[joint.child] = (index, M)
            if joint.kind != "fixed":
                turned = pin.SE3.Identity()
                if joint.kind in ("revolute", "continuous", "prismatic"):
                    turned.rotation = pin.Quaternion.FromTwoVectors(
                        np.array([0.0, 0.0, 1.0]), joint.axis
                    ).matrix()
                model = {
                    "revolute": pin.JointModelRZ,
                    "continuous": pin.JointModelRUBZ,
                    "prismatic": pin.JointModelPZ,
                    "spherical": pin.JointModelSpherical,
                    "planar": pin.JointModelPlanar,
                    "floating": pin.JointModelFreeFlyer,
                }[joint.kind]()
                at = self.model.addJoint(index, model, M * turned, joint.name)
                self.links[joint.child] = (at, turned.inverse())
            self._grow(joint.child)

    def efforts(self, tau: np.ndarray) -> np.ndarray:
        """Spread the motors' efforts over the tree, shape (nv,)."""
        Q = np.zeros(self.model.nv)
        for name, value in zip(self.description.motors, tau, strict=True):
            Q[self.model.joints[self.model.getJointId(name)].idx_v] += value
        return Q

    def forces(self, wrenches: dict[str, np.ndarray]) -> pin.StdVec_Force:
        """Return outer wrenches on links as Pinocchio's `f_ext`."""
        out = pin.StdVec_Force([pin.Force.Zero() for _ in range(self.model.njoints)])
        for name, wrench in wrenches.items():
            index, placement = self.links[name]
            out[index] += placement.act(pin.Force(wrench))
        return out

    def constraint_models(self) -> pin.StdVec_RigidConstraintModel:
        """Return Pinocchio's models of the closures, points and welds."""
        models = pin.StdVec_RigidConstraintModel()
        for closure in self.description.closures:
            kind = {"spherical": pin.ContactType.CONTACT_3D, "fixed": pin.ContactType.CONTACT_6D}[
                closure.kind
            ]
            ends = []
            for link, frame in ((closure.link_a, closure.frame_a), (closure.link_b, closure.frame_b)):
                index, placement = self.links[link]
                ends += [index, placement * pin.SE3(frame)]
            models.append(pin.RigidConstraintModel(kind, self.model, *ends, pin.ReferenceFrame.LOCAL))
        return models

    def constraint_dynamics(self, q: np.ndarray, v: np.ndarray, tau: np.ndarray, mu: float) -> np.ndarray:
        """Return accelerations by `pin.constraintDynamics`, for point and weld closures."""
        models = self.constraint_models()
        datas = pin.StdVec_RigidConstraintData()
        for model in models:
            datas.append(model.createData())
        data = self.model.createData()
        pin.initConstraintDynamics(self.model, data, models, datas)
        settings = pin.ProximalSettings(1e-15, mu, 50)
        return pin.constraintDynamics(
            self.model, data, q, v, self.efforts(tau), models, datas, settings
        ).copy()
