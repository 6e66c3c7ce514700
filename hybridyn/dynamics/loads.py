"""Collect what acts on the robot besides motors and weight, in the form that the recursions need.

These are wrenches on links, efforts of joint laws, and rotors.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..description.names import did_you_mean
from ..effects.choice import Effects
from ..errors import TrajectoryError
from ..linkage.motion import Motion
from ..spatial import Array, wrench_to_base
from ..structure.module import ModuleState
from ..structure.robot import HybridRobot
from ..structure.samples import as_batch


@dataclass(eq=False)
class ModuleLoad:
    """Wrenches on one module's bodies.

    Attributes:
        bodies: Number of the body in the spanning tree, and wrench (T, 6) in its frame at its origin.
        wrist_ends: Wrist number and wrench (T, 6), for ends of cut wrists that a closure fixes to a target.
            The same wrench is also among those on the target.
    """

    bodies: list[tuple[int, Array]] = field(default_factory=list)
    wrist_ends: list[tuple[int, Array]] = field(default_factory=list)

    def on_outputs(self, state: ModuleState) -> Array:
        """Compute the wrenches of the loads on the outputs, (T, outputs, 6), own frames: minus the F_e."""
        spec, out = state.mechanism.spec, np.zeros_like(state.outputs)
        for body, wrench in self.bodies:
            out[:, [spec.tree_body[output] == body for output in spec.outputs]] += wrench[:, None]
        return out

    def on_legs(self, state: ModuleState) -> tuple[Array, Array]:
        """Compute what the loads on leg links and on the base exert on the base and along x.

        Returns:
            Wrench on the base, shape (T, 6), base frame; generalised force along x, shape (T, n).
        """
        m, s = state.mechanism, state.whole
        base, along = np.zeros_like(state.V), np.zeros((len(state.V), m.tree.nv))
        tree = m.spec.tree_body
        for body, wrench in self.bodies:
            if body in tree and tree.index(body) in m.spec.outputs:
                continue
            at = m.cut.whole_body(body)
            base += wrench_to_base(s.R[:, at], s.p[:, at], wrench)
            # a body outside the tree is a massless link inside a cut wrist
            J = m.jacobian(state.motion, at) if body in tree else m.wrists.link_jacobian(s, at)
            along += np.einsum("tij,ti->tj", J, wrench)
        return base, along

    def through_wrist(self, state: ModuleState, number: int) -> Array:
        """Compute the wrench of a cut wrist's links, its end among them, on the wrist's target.

        Returns:
            Shape (T, 6), in the axes of the wrist's end, at its origin.
        """
        out = self.inside_wrist(state, number)
        for end, wrench in self.wrist_ends:
            if end == number:
                out += wrench
        return out

    def inside_wrist(self, state: ModuleState, number: int) -> Array:
        """Compute the wrench on a cut wrist's target of the links between the wrist's joints.

        Returns:
            Shape (T, 6), in the axes of the wrist's end, at its origin.
        """
        m, s = state.mechanism, state.whole
        out = np.zeros_like(state.V)
        for body, wrench in self.bodies:
            if body - 1 in m.spec.wrists[number].joints and body not in m.spec.tree_body:
                own = m.wrists.of_link(s, number, m.cut.whole_body(body))
                along = np.einsum("tij,ti->tj", own, wrench)
                inverse = np.linalg.pinv(m.wrists.jacobian(s, number), rcond=1e-12)
                out += np.einsum("tij,ti->tj", inverse, along) / np.array([m.length] * 3 + [1.0] * 3)
        return out


class LegTerms(NamedTuple):
    """Inertia and forces of a module's legs, including rotors and the loads on the legs.

    Attributes:
        M: Inertia for [V_dot_base; x_ddot], shape (T, 6 + n, 6 + n), with blocks A and D, Eqs. (63)-(75).
        p: Wrench of the base on the legs at zero accelerations, minus the wrench of the loads on the base,
            shape (T, 6), Eqs. (71)-(73).
        h: Generalised force along x at zero accelerations, shape (T, n).
        f: Generalised force of the loads along x, shape (T, n).
    """

    M: Array
    p: Array
    h: Array
    f: Array


@dataclass(eq=False)
class Loads:
    """All that acts on the robot besides motors and weight.

    Attributes:
        modules: External wrenches on each module.
        root: Wrench on the root body, shape (T, 6), root frame.
        on: The effects that are computed.
        joints: Efforts of joint laws on the spanning tree, shape (T, nv).
        rotors: Inertia that rotors add to the diagonal of the mass matrix, shape (nv,).
    """

    modules: list[ModuleLoad]
    root: Array
    on: Effects
    joints: Array
    rotors: Array

    def on_legs(self, k: int, state: ModuleState) -> tuple[Array, Array]:
        """Compute what the loads on module k exert on its base and along x, as `ModuleLoad.on_legs`."""
        base, along = self.modules[k].on_legs(state)
        return base, along + state.mechanism.cut.to_tree(self.joints[:, state.module.v_index])

    def rotor_diagonal(self, state: ModuleState) -> Array:
        """Return the inertia that rotors add to the diagonal along x, shape (1, n)."""
        return state.mechanism.cut.to_tree(self.rotors[None, state.module.v_index])

    def leg_matrix(self, state: ModuleState) -> Array:
        """Compute M_leg with rotors, shape (T, 6 + n, 6 + n)."""
        M = self.on.leg_matrix(state)
        M[:, 6:, 6:] += np.diag(self.rotor_diagonal(state)[0])
        return M

    def leg_terms(self, k: int, state: ModuleState) -> LegTerms:
        """Compute the inertia and forces of the legs of module k."""
        M = self.leg_matrix(state)  # Eqs. (34), (37): A, D and S1
        p, h = self.on.leg_forces(state, bias=True)
        f_base, f = self.on_legs(k, state)
        return LegTerms(M, p - f_base, h, f)


def all_loads(
    robot: HybridRobot,
    on: Effects,
    q: Array,
    v: Array,
    time: Array | None,
    wrenches: Mapping[str, Array] | None,
) -> Loads:
    """Collect the wrenches given by the caller and the loads of the effects.

    Args:
        on: The effects that are computed.
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv).
        time: Times, shape (T,), or None.
        wrenches: Wrench on each link, by link name, shape (6,) or (T, 6), in its frame at its origin.

    Raises:
        TrajectoryError: A link is unknown, a shape is wrong, or a number is not finite; or an effect needs
            time and there is none.
    """
    modules = [ModuleLoad() for _ in robot.modules]
    loads = Loads(modules, np.zeros((len(q), 6)), on, on.joint_efforts(robot, q, v), on.rotor_diagonal(robot))
    motions: dict[str, Motion] = {}
    if on.observed_links:
        from .link_motion import link_motions  # the default effects depend on none

        motions = link_motions(robot, q, v, on.observed_links)
    for given in (wrenches or {}, *on.wrenches(motions, time, len(q))):
        _enter(robot, loads, given, len(q))
    return loads


def _enter(robot: HybridRobot, loads: Loads, wrenches: Mapping[str, Array], samples: int) -> None:
    """Add wrenches on links to the loads of the modules that the links belong to."""
    for link, given in wrenches.items():
        if link not in robot.bodies.place:
            raise TrajectoryError(f"wrench on unknown link '{link}'{did_you_mean(link, robot.bodies.place)}")
        body, R, p = robot.bodies.place[link]
        wrench = wrench_to_base(R, p, in_every_sample(given, f"wrench on '{link}'", samples))
        if body == 0 and robot.base != "floating":
            loads.root += wrench
            continue
        module, number = robot.body_owner[body]
        load = loads.modules[module]
        for i, wrist in enumerate(robot.modules[module].mechanism.spec.wrists):
            if wrist.end == number and not wrist.carries:
                load.wrist_ends.append((i, wrench))
                number, wrench = wrist.target, wrench_to_base(wrist.R, wrist.p, wrench)
                break
        load.bodies.append((number, wrench))


def in_every_sample(given: ArrayLike, name: str, samples: int) -> Array:
    """Return six numbers for every sample, shape (samples, 6), given once or for each sample.

    Raises:
        TrajectoryError: The shape is wrong, or a number is not finite.
    """
    out, one = as_batch(given, 6, name)
    if not one and len(out) != samples:
        raise TrajectoryError(f"{name} has shape {out.shape}; wanted (6,) or ({samples}, 6)")
    return np.broadcast_to(out, (samples, 6))
