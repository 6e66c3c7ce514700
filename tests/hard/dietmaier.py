"""Dietmaier's platform: the Gough-Stewart platform whose six leg lengths allow 40 real postures.

Source: P. Dietmaier, "The Stewart-Gough platform of general geometry can have 40 real postures", Advances in
Robot Kinematics, 1998. No platform of six legs has more (40 is the number of its complex postures), so 40
distinct real ones are all of them.

Beside the robot stands its mathematics in other terms, as judge: with the platform's origin p and unit
quaternion e, and g = p e / 2 (a product of quaternions), |p + R(e) a_i - b_i| = l_i, |e| = 1 and e . g = 0
are eight quadrics in (e, g) (the coordinates of Study).
"""

from functools import lru_cache

import mpmath
import numpy as np
import pinocchio as pin

import hybridyn
from hybridyn.description.records import Closure, Description, Joint, Link
from hybridyn.structure.building import build_robot
from tests.support.once import once

BASE = np.array([
    [0, 0, 0], [1.107915, 0, 0], [0.549094, 0.756063, 0],
    [0.735077, -0.223935, 0.525991], [0.514188, -0.526063, -0.368418], [0.590473, 0.094733, -0.205018],
])  # fmt: skip
PLATFORM = np.array([
    [0, 0, 0], [0.542805, 0, 0], [0.956919, -0.528915, 0],
    [0.665885, -0.353482, 1.402538], [0.478359, 1.158742, 0.107672], [-0.137087, -0.235121, 0.353913],
])  # fmt: skip
LENGTHS = np.array([1, 0.645275, 1.086284, 1.503439, 1.281933, 0.771071])
REAL = 40
#: One of the forty postures to two digits: the platform's position and quaternion (x, y, z, w).
POSE = np.array([0.9, -0.42, 0.1, -0.13, 0.53, 0.75, 0.38])


def at(point: np.ndarray) -> np.ndarray:
    """Return the placement of a frame shifted to a point."""
    out = np.eye(4)
    out[:3, 3] = point
    return out


def home_at_pose() -> dict[str, tuple[float, ...]]:
    """Return the positions of the joints at `POSE`, the legs on balls."""
    turn = pin.Quaternion(POSE[3:]).normalized()
    home = {"carrier": (*POSE[:3], *turn.coeffs())}
    for i, leg in enumerate(PLATFORM @ turn.matrix().T + POSE[:3] - BASE):
        home[f"foot{i}"] = tuple(pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), leg).coeffs())
        home[f"slide{i}"] = (float(np.linalg.norm(leg)),)
    return home


@lru_cache(maxsize=3)
def robot(foot: str = "S", at_pose: bool = False) -> hybridyn.HybridRobot:
    """Build the platform as a robot, its home far from every posture sought.

    Args:
        foot: "S" for legs on balls (6-SPS as published; the rods spin idly), "U" for legs on universal
            joints, where each leg reaches a point in two ways.
        at_pose: Whether its home is near one of them instead, from which it is found at once.
    """
    rod = np.diag([0.01, 0.01, 0.0]) if foot == "S" else np.diag([0.01, 0.01, 0.002])
    links = [Link("base", 0.0, np.zeros(3), np.zeros((3, 3))), Link("platform", 4.0, np.zeros(3), np.eye(3))]
    joints = [Joint("carrier", "floating", "base", "platform", np.eye(4), np.array([1.0, 0, 0]))]
    closures = []
    for i, (b, a) in enumerate(zip(BASE, PLATFORM, strict=True)):
        lower, upper = f"lower{i}", f"upper{i}"
        links += [Link(lower, 1.0, np.zeros(3), rod), Link(upper, 1.0, np.zeros(3), rod)]
        if foot == "S":
            joints.append(Joint(f"foot{i}", "spherical", "base", lower, at(b), np.array([1.0, 0, 0])))
        else:
            links.append(Link(f"cross{i}", 0.0, np.zeros(3), np.zeros((3, 3))))
            joints += [
                Joint(f"foot{i}", "continuous", "base", f"cross{i}", at(b), np.array([1.0, 0, 0])),
                Joint(f"turn{i}", "continuous", f"cross{i}", lower, np.eye(4), np.array([0.0, 1, 0])),
            ]
        joints.append(Joint(f"slide{i}", "prismatic", lower, upper, np.eye(4), np.array([0.0, 0, 1])))
        closures.append(
            Closure(f"ball{i}", "spherical", upper, np.eye(4), "platform", at(a), (0, 1, 2), "free")
        )
    lengths = {f"slide{i}": (float(length),) for i, length in enumerate(LENGTHS)}
    motors, home = tuple(lengths), home_at_pose() if at_pose else lengths
    description = Description(
        f"dietmaier_{foot}", tuple(links), tuple(joints), tuple(closures), (), motors, "published", home
    )
    return build_robot(description)


def forty() -> hybridyn.Assemblies:
    """Find the forty postures from 1,000 starts, once a session."""
    return once("dietmaier_forty", lambda: hybridyn.assemblies(robot(), motors=motors(), starts=1000))


def motors(lengths: np.ndarray = LENGTHS) -> dict[str, object]:
    """Return leg lengths, shape (6,) or (T, 6), as `assemble` takes them."""
    return {f"slide{i}": np.asarray(lengths)[..., i] for i in range(6)}


def poses(q: np.ndarray, foot: str = "S") -> np.ndarray:
    """Give the platform's p and e (x, y, z, w; its largest entry positive) from postures, shape (..., 7)."""
    r = robot(foot)
    x = q[..., r.q_slices[r.joint_index["carrier"]]].copy()
    e = x[..., 3:]
    largest = np.take_along_axis(e, np.abs(e).argmax(axis=-1)[..., None], axis=-1)
    x[..., 3:] = e * np.sign(largest)
    return x


# -------------------------------------------------------------------- the quadrics, and tracking that proves


def _left(b: np.ndarray) -> np.ndarray:
    """Return the matrix of e -> b e for a vector b, quaternions x, y, z, w."""
    x, y, z = b
    return np.array([[0, -z, y, x], [z, 0, -x, y], [-y, x, 0, z], [-x, -y, -z, 0]])


def _right(a: np.ndarray) -> np.ndarray:
    """Return the matrix of e -> e a for a vector a."""
    x, y, z = a
    return np.array([[0, z, -y, x], [-z, 0, x, y], [y, -x, 0, z], [-x, -y, -z, 0]])


def _quadrics() -> np.ndarray:
    """Return the symmetric matrices of the quadrics without l^2, shape (8, 8, 8)."""
    Q = np.zeros((8, 8, 8))
    for i, (a, b) in enumerate(zip(PLATFORM, BASE, strict=True)):
        Q[i, :4, :4] = (a @ a + b @ b) * np.eye(4) - 2 * _left(b).T @ _right(a)
        Q[i, 4:, 4:] = 4 * np.eye(4)
        Q[i, 4:, :4] = 4 * (_right(a) - _left(b))
    Q[6, 4:, :4] = Q[7, :4, :4] = np.eye(4)
    return (Q + np.swapaxes(Q, 1, 2)) / 2


QUADRICS = _quadrics()


def study(pose: np.ndarray) -> np.ndarray:
    """Return (e, g) from p and e, shape (7,): g = p e / 2."""
    return np.concatenate([pose[3:], _left(pose[:3]) @ pose[3:] / 2])


def pose_of(u: np.ndarray) -> np.ndarray:
    """Return p and e from (e, g): p = 2 g conj(e), e with its largest entry positive."""
    e, g = u[:4], u[4:]
    p = 2 * (e[3] * g[:3] - g[3] * e[:3] - np.cross(g[:3], e[:3]))
    return np.concatenate([p, e * np.sign(e[np.abs(e).argmax()])])


def values(u: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Return the left-hand sides of the eight equations, shape (8,), on any numbers."""
    out = np.array([u @ (Q @ u) for Q in QUADRICS])
    out[:6] = out[:6] - lengths**2 * (u[:4] @ u[:4])
    out[7] = out[7] - 1
    return out


def jacobian(u: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Return their derivatives, shape (8, 8), on any numbers."""
    out = np.array([2 * (Q @ u) for Q in QUADRICS])
    out[:6, :4] = out[:6, :4] - 2 * np.outer(lengths**2, u[:4])
    return out


def refined(pose: np.ndarray, digits: int = 50) -> tuple[mpmath.matrix, mpmath.mpf]:
    """Refine a posture by Newton on the quadrics in mpmath; give (e, g) and the largest left-hand side."""
    with mpmath.workdps(digits):
        exact = np.array([mpmath.mpf(float(x)) for x in study(pose)])
        lengths = np.array([mpmath.mpf(float(x)) for x in LENGTHS])
        for _ in range(7):
            J, F = (mpmath.matrix(f(exact, lengths)) for f in (jacobian, values))
            exact = exact - np.array(list(mpmath.lu_solve(J, F)))
        return exact, max(abs(x) for x in values(exact, lengths))


def proof(u: np.ndarray, digits: int = 50) -> tuple[mpmath.mpf, mpmath.mpf]:
    """Give Kantorovich's h = |J^-1| |F''| |J^-1 F| at (e, g), and the radius of the ball that holds one zero.

    The largest row sum is the norm; F'' is constant. With h <= 1/2 a zero lies within 2 |J^-1 F|, alone
    within 1 / (|J^-1| |F''|).
    """
    with mpmath.workdps(digits):
        lengths = np.array([mpmath.mpf(float(x)) for x in LENGTHS])
        inverse = mpmath.matrix(jacobian(u, lengths)) ** -1
        second = 2 * np.abs(QUADRICS).sum(axis=(1, 2)).max() + 8 * float(LENGTHS.max()) ** 2
        step = mpmath.norm(inverse * mpmath.matrix(values(u, lengths)), mpmath.inf)
        bound = mpmath.mnorm(inverse, mpmath.inf) * second
        return bound * step, 2 * step


class Tracked:
    """A posture carried along straight ways of the leg lengths, every step proved by Kantorovich's theorem.

    With J the derivative at u, eta a bound of |J^-1 F(u)| for all lengths on a step, and L a bound of
    |J^-1 (J(x) - J(y))| / |x - y| (the equations are quadrics: L is a number), u - J^-1 F is a contraction of
    the ball of radius 2 eta about u as long as (L + 4) eta < 1/2; 4 eta bounds what the change of the lengths
    adds to J. So for every length on the way one solution lies in the ball: the branch goes on there, and
    Newton from u finds it. Where steps shrink to nothing, a branch ends.
    """

    SURE = 0.4

    def __init__(self, pose: np.ndarray, lengths: np.ndarray = LENGTHS) -> None:
        self.lengths = np.array(lengths, dtype=float)
        self.u = self._newton(study(pose), self.lengths)

    def _newton(self, u: np.ndarray, lengths: np.ndarray) -> np.ndarray:
        for _ in range(6):
            u = u - np.linalg.solve(jacobian(u, lengths), values(u, lengths))
        return u

    @property
    def pose(self) -> np.ndarray:
        """The platform's p and e."""
        return pose_of(self.u)

    def normal(self) -> np.ndarray:
        """Return how leg lengths change, to first order, along the motion that is weakest here, unit (6,)."""
        U, _, _ = np.linalg.svd(jacobian(self.u, self.lengths))
        n = U[:6, -1] * self.lengths
        return n / np.linalg.norm(n)

    def move(self, lengths: np.ndarray, smallest: float = 1e-9) -> bool:
        """Follow the straight way to other lengths; say whether the branch leads there, and stop where not.

        Args:
            lengths: Where to, shape (6,).
            smallest: Part of the way below which a step says that the branch ends.
        """
        start, way, done, step = self.lengths, lengths - self.lengths, 0.0, 1.0
        while done < 1.0:
            inverse = np.linalg.inv(jacobian(self.u, self.lengths))
            second = np.einsum("jk,kmn->jmn", inverse, 2 * QUADRICS)
            second[:, :4, :4] -= 2 * np.einsum("jk,k,mn->jmn", inverse[:, :6], self.lengths**2, np.eye(4))
            L = np.linalg.norm(second.reshape(64, 8), 2)
            while True:
                step = min(step, 1.0 - done)
                there = start + (done + step) * way
                w = there - self.lengths
                eta = np.linalg.norm(inverse[:, :6] @ (2 * self.lengths * w))
                eta += np.linalg.norm(np.abs(inverse[:, :6]) @ w**2)
                if (L + 4) * eta <= self.SURE:
                    break
                step /= 2
                if step < smallest:
                    self.lengths = start + done * way
                    return False
            self.u = self._newton(self.u, there)
            self.lengths, done, step = there, done + step, 2 * step
        return True
