"""A description as a MuJoCo model, for tests: trees of hinges and slides, closed at points.

MuJoCo refuses moving bodies without mass but lets a body have several joints, so the joints of a massless
link that carries one joint go to the child of that joint, written in the child's frame at zero position.
"""

import xml.etree.ElementTree as ET

import numpy as np
import pinocchio as pin

from hybridyn.description import Description
from hybridyn.description.records import Joint, Link
from tests.extras import needs
from tests.mujoco_matrices import mass_matrix
from tests.oracle import Oracle

mujoco = needs("bench")

KINDS = {"revolute": "hinge", "continuous": "hinge", "prismatic": "slide"}
BODY = "body_"  # "world" is a name of MuJoCo's own


class MuJoCo:
    """The MuJoCo model of a robot on a fixed base.

    Attributes:
        root: The model as MJCF.
        model, data: MuJoCo's.
        description: The robot.
    """

    def __init__(self, description: Description) -> None:
        self.description = description
        self._links = {link.name: link for link in description.links}
        root = ET.Element("mujoco")
        ET.SubElement(root, "compiler", angle="radian", autolimits="false", inertiafromgeom="false")
        option = ET.SubElement(root, "option", gravity="0 0 -9.81", jacobian="dense", solver="Newton")
        option.attrib.update(tolerance="0", iterations="200", cone="elliptic")
        base = ET.SubElement(ET.SubElement(root, "worldbody"), "body", name=f"{BODY}{description.root}")
        self._inertial(base, self._links[description.root])
        self._grow(base, description.root, np.eye(4), [])
        self._close(root)
        self.root = root
        self.model = mujoco.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"))
        self.data = mujoco.MjData(self.model)

    def _grow(
        self, element: ET.Element, link: str, M: np.ndarray, carried: list[tuple[Joint, np.ndarray]]
    ) -> None:
        """Add what hangs from a link; (M, carried) are placement and joints since the last body with mass."""
        for joint in (j for j in self.description.joints if j.parent == link):
            at, joints = M @ joint.placement, [(j, frame @ joint.placement) for j, frame in carried]
            if joint.kind != "fixed":
                joints.append((joint, np.eye(4)))
            if joints and self._is_only_a_joint(joint.child):
                self._grow(element, joint.child, at, joints)
                continue
            body = ET.SubElement(element, "body", name=f"{BODY}{joint.child}", **_pose(at))
            for j, frame in joints:
                inverse = np.linalg.inv(frame)  # the joint's frame in the body's
                pos, axis = _text(inverse[:3, 3]), _text(inverse[:3, :3] @ j.axis)
                ET.SubElement(body, "joint", name=j.name, type=KINDS[j.kind], pos=pos, axis=axis)
            self._inertial(body, self._links[joint.child])
            self._grow(body, joint.child, np.eye(4), [])

    def _is_only_a_joint(self, link: str) -> bool:
        """Tell whether a link has no mass, carries one joint, and closes nothing."""
        closed = {end for c in self.description.closures for end in (c.link_a, c.link_b)}
        children = sum(joint.parent == link for joint in self.description.joints)
        return self._links[link].mass == 0 and children == 1 and link not in closed

    def _inertial(self, body: ET.Element, link: Link) -> None:
        if link.mass == 0:
            return
        xx, xy, xz, yy, yz, zz = link.inertia[np.triu_indices(3)]
        full = _text(np.array([xx, yy, zz, xy, xz, yz]))
        ET.SubElement(body, "inertial", pos=_text(link.com), mass=repr(float(link.mass)), fullinertia=full)

    def _close(self, root: ET.Element) -> None:
        """Close loops between sites, MuJoCo's frames that are no bodies."""
        equality, bodies = ET.SubElement(root, "equality"), {b.get("name"): b for b in root.iter("body")}
        for closure in self.description.closures:
            assert (closure.translations, closure.rotation) == ((0, 1, 2), "free"), "a point closure"
            for end, link, frame in (
                ("a", closure.link_a, closure.frame_a),
                ("b", closure.link_b, closure.frame_b),
            ):
                ET.SubElement(bodies[f"{BODY}{link}"], "site", name=f"{closure.name}_{end}", **_pose(frame))
            ET.SubElement(equality, "connect", site1=f"{closure.name}_a", site2=f"{closure.name}_b")

    def place(self, q: np.ndarray, v: np.ndarray) -> None:
        """Set a state, given in the order of the spanning tree, and compute everything up to velocities."""
        for name, (kind, at_q, at_v) in Oracle(self.description).coordinates.items():
            joint = self.model.joint(name)
            angle = np.arctan2(q[at_q][1], q[at_q][0]) if kind == "continuous" else q[at_q][0]
            self.data.qpos[joint.qposadr[0]], self.data.qvel[joint.dofadr[0]] = angle, v[at_v][0]
        mujoco.mj_fwdPosition(self.model, self.data)
        mujoco.mj_fwdVelocity(self.model, self.data)

    def efforts(self, tau: np.ndarray) -> np.ndarray:
        """Spread the motors' efforts over MuJoCo's velocities."""
        out = np.zeros(self.model.nv)
        out[[self.model.joint(motor).dofadr[0] for motor in self.description.motors]] = tau
        return out

    def in_our_order(self, a: np.ndarray) -> np.ndarray:
        """Return accelerations in the order of the spanning tree."""
        return np.array(
            [a[self.model.joint(name).dofadr[0]] for name in Oracle(self.description).coordinates]
        )

    def rigid(self, q: np.ndarray, v: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """Return accelerations from MuJoCo's inertia, bias and constraint rows, its softness left out.

        [M, J^T; J, 0] [a; -f] = [tau - bias; -J_dot v], J_dot from `mj_jacDot`: MuJoCo itself neglects it.
        """
        self.place(q, v)
        m, d, nv = self.model, self.data, self.model.nv
        M = mass_matrix(m, d)
        J, drift = d.efc_J.reshape(-1, nv)[: d.ne], np.zeros(d.ne)
        assert d.ne == 3 * m.neq
        rates = np.zeros((2, 3, nv))
        for i in range(m.neq):
            for sign, site in ((1, m.eq_obj1id[i]), (-1, m.eq_obj2id[i])):
                mujoco.mj_jacDot(m, d, rates[0], rates[1], d.site_xpos[site], m.site_bodyid[site])
                drift[3 * i : 3 * i + 3] += sign * rates[0] @ d.qvel
        K = np.block([[M, J.T], [J, np.zeros((d.ne, d.ne))]])
        known = np.concatenate([self.efforts(tau) - d.qfrc_bias, -drift])
        return self.in_our_order(np.linalg.lstsq(K, known, rcond=1e-13)[0][:nv])

    def soft(self, q: np.ndarray, tau: np.ndarray, impedance: float) -> np.ndarray:
        """Give MuJoCo's own accelerations at rest, its closures as stiff as `impedance` (at most 0.9999)."""
        self.model.eq_solimp[:, :2] = impedance
        self.place(q, np.zeros(self.model.nv))
        self.data.qfrc_applied[:] = self.efforts(tau)
        mujoco.mj_forward(self.model, self.data)
        return self.in_our_order(self.data.qacc)


def _pose(M: np.ndarray) -> dict[str, str]:
    quaternion = pin.Quaternion(M[:3, :3]).coeffs()
    return {"pos": _text(M[:3, 3]), "quat": _text(quaternion[[3, 0, 1, 2]])}


def _text(numbers: np.ndarray) -> str:
    return " ".join(repr(float(x)) for x in numbers)
