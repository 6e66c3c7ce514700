"""Quantities of links and output joints of compiled models, with the names and errors of the general path."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from ....dynamics.guards import IMMOVABLE
from ....dynamics.link_motion import LinkMotion, motions_of, named_links
from ....dynamics.quantities.independent import Coordinates
from ....dynamics.quantities.joint_map import JointMap, related, side_motions
from ....dynamics.quantities.links import delassus, inverse_of, link_jacobian, operational_inertia
from ....dynamics.state_checks import checked_state
from ....errors import SingularityError
from ....spatial import Array
from ....structure.samples import one_of
from ...library.calls import Numbers
from ..general import body_motion, named
from .calls import Joints, Quantities
from .engine import CompiledEngine

#: Reciprocal condition number of a compiled Delassus matrix below which the general path inverts it. In seven
#: digits, rounding hides directions in which links cannot move.
IMMOVABLE_AS_COMPUTED = {"float64": IMMOVABLE, "float32": 1e-4}


class LinkQuantities(Quantities):
    """The quantities of a `CompiledRobot` that belong to some of its links or joints, as in `Quantities`."""

    def kinematics(
        self, q: Array, v: Array, a: Array | None = None, links: Sequence[str] | None = None
    ) -> dict[str, LinkMotion]:
        """Compute poses, twists and accelerations of links, like `hybridyn.kinematics`."""
        given = named(self.robot, {"q": q, "v": v} | ({} if a is None else {"a": a}))
        rows = self._run("kinematics", given | {"a": given.get("a", np.zeros(np.shape(given["v"])))})
        places = self.robot.bodies.place
        wanted = list(named_links(self.robot, links))
        bodies = {body: body_motion(np.atleast_2d(rows), body) for body in {places[x][0] for x in wanted}}
        return motions_of(self.robot, bodies, wanted, rows.ndim == 1)

    def link_jacobian(
        self, q: ArrayLike, link: str, *, joints: Joints = None, axes: str = "world"
    ) -> Numbers:
        """Compute the Jacobian of a link, shape (6, N) or (T, 6, N), like `hybridyn.link_jacobian`."""
        moves = self._following(joints)
        named_links(self.robot, [link])
        one_of("axes", axes, "world", "link")
        q, _, single = checked_state(self.robot, q, None)
        general = partial(link_jacobian, self.robot, link=link, joints=joints, axes=axes)
        formula = partial(CompiledEngine.link_jacobians, links=[link], axes=axes)
        return self._finished("link_jacobian", moves, formula, general, 6, single, q=q)

    def delassus(self, q: ArrayLike, links: str | Sequence[str], *, axes: str = "world") -> Numbers:
        """Compute J M^-1 J^T of links, shape (6 k, 6 k) or (T, 6 k, 6 k), like `hybridyn.delassus`."""
        names = [links] if isinstance(links, str) else list(links)
        named_links(self.robot, names)
        one_of("axes", axes, "world", "link")
        q, _, single = checked_state(self.robot, q, None)
        moves = self._driven_by(None, only=True)
        general = partial(delassus, self.robot, links=names, axes=axes, effects=self.effects)
        formula = partial(CompiledEngine.delassus, links=names, axes=axes)
        return self._finished("delassus", moves, formula, general, 6 * len(names), single, q=q)

    def operational_inertia(
        self, q: ArrayLike, links: str | Sequence[str], *, axes: str = "world"
    ) -> Numbers:
        """Compute (J M^-1 J^T)^-1 of links, shape as `delassus`, like `hybridyn.operational_inertia`."""
        D = self.delassus(q, links, axes=axes).astype(float)
        limit = IMMOVABLE_AS_COMPUTED[str(self.dtype)]
        try:
            out = inverse_of(self.robot, np.reshape(D, (-1, *D.shape[-2:])), links, limit)
        except SingularityError:  # the general path decides, with its message
            self.hand_over("operational_inertia", len(D) if D.ndim == 3 else 1)
            out = operational_inertia(self.robot, q, links, axes=axes, effects=self.effects)
        return out.reshape(D.shape).astype(self.dtype, copy=False)

    def joint_map(self, q: ArrayLike | Mapping[str, ArrayLike], joints: Sequence[str]) -> JointMap:
        """Compute the map between output joints and motors, like `hybridyn.joint_map`."""
        q = self._posture_at(q) if isinstance(q, Mapping) else q
        return related(self.robot, q, joints, self._side_motions)

    def _side_motions(self, q: Array, v: Array | None, side: Coordinates) -> tuple[Array, Array]:
        """Compute motions over one side of a map, and with rates its accelerations at rest of that side."""
        moves = self._over(side)

        def general(q: Array, v: Array | None = v) -> Array:
            """Compute it by the general path."""
            E, drift = side_motions(self.robot, q, v, side)
            return E if v is None else drift

        if v is None:
            E = self._finished("joint_map", moves, CompiledEngine.map, general, 6, False, q=q)
            return E, np.zeros((len(q), self.robot.nv))
        drift = self._finished("joint_map", moves, CompiledEngine.drift, general, 1, False, q=q, v=v)
        return np.zeros((len(q), self.robot.nv, side.size)), drift
