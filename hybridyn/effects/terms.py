"""Effects that are terms of the recursions: gravity, inertia, the legs' inertia, velocity terms.

Each effect contains the code of its term, which a recursion calls only if the effect is selected.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..spatial import Array, crf, rotate_back, rotation_from_quaternion
from ..structure.module import ModuleState
from ..structure.robot import HybridRobot


@dataclass(frozen=True)
class WithoutParameters:
    """Base class of these effects: all of one class are equal."""

    name: ClassVar[str]


class Gravity(WithoutParameters):
    """Weight of every body, as an acceleration -g of the first base: V_dot_0 - g.

    Unit: m/s^2, `robot.gravity`. Source: Ibrahim & Khalil (2010), below Eq. (29).
    """

    name: ClassVar[str] = "gravity"

    def carried(self, robot: HybridRobot, q: Array) -> Array:
        """Return g in the axes of the base of the first modules, shape (T, 3)."""
        g = np.tile(robot.gravity, (len(q), 1))
        return rotate_back(rotation_from_quaternion(q[:, 3:7]), g) if robot.base == "moving" else g


class Inertia(WithoutParameters):
    """Inertial forces of every body; without them the inverse model is static.

    Without this effect, rates and accelerations are zero in the recursion; joint laws and contacts still use
    the actual rates. The direct model requires inertia.
    """

    name: ClassVar[str] = "inertia"

    def motion(self, v: Array, a: Array) -> tuple[Array, Array]:
        """Return the rates and accelerations used by the forward recursion."""
        return v, a


class LegInertia(WithoutParameters):
    """The legs' part of gravity and inertia: H, F_b by RNEA, [[S1, D^T], [D, A]] by CRBA.

    It is on with gravity or inertia, unless legs are to be massless (`MasslessLegs`). Legs are all bodies
    except platforms, links of serial joints, and links that carry another module.

    Source: Ibrahim & Khalil (2010), appendices A to C.
    """

    name: ClassVar[str] = "leg_inertia"

    def forces(self, s: ModuleState, V: Array, v: Array, bias: bool) -> tuple[Array, Array]:
        """Compute F_b, shape (T, 6), and H, shape (T, n), Eqs. (54)-(62), for given twists V and rates v.

        If `bias`, compute p and h, Eqs. (71)-(73): the same without accelerations.
        """
        V_dot, a = (np.zeros_like(s.V_dot), np.zeros_like(s.a)) if bias else (s.V_dot, s.a)
        return s.mechanism.legs.rnea(V, V_dot, s.q, v, a)

    def matrix(self, s: ModuleState) -> Array:
        """Compute M_leg, shape (T, 6 + n, 6 + n), Eqs. (63)-(75)."""
        return s.mechanism.legs.crba(s.q)


class MasslessLegs(WithoutParameters):
    """Legs without mass: the platform-only model, without the legs' part of gravity and inertia."""

    name: ClassVar[str] = "massless_legs"


class VelocityTerms(WithoutParameters):
    """Centrifugal, Coriolis and gyroscopic forces of legs and platforms.

    Without this effect, twists and rates are zero in the inertial forces of legs and platforms, and only
    there: H = D V_dot + A q_ddot and F_p = I V_dot. The drift of the closures and crm(V_o) v_o remain, since
    the loops would open otherwise. Energy is then not conserved. Source: Eq. (30), second term, and h, p of
    Eqs. (71)-(73).
    """

    name: ClassVar[str] = "velocity"

    def twists(self, s: ModuleState) -> tuple[Array, Array]:
        """Return the base's twist and the rates used for the legs' forces."""
        return s.V, s.v

    def of_body(self, V: Array, inertia: Array) -> Array:
        """Compute crf(V) (I V), shape (..., 6), Eq. (30), from V and the inertia, shape (..., 6, 6)."""
        return crf(V, np.matmul(V[..., None, :], inertia)[..., 0, :])
