"""What acts on the robot beside motors and weight, brought to where the recursions take it.

These are wrenches on links, efforts of joint laws, and rotors.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ..description.names import did_you_mean
from ..effects.choice import STANDARD, Effects
from ..errors import TrajectoryError
from ..spatial import Array, rotate, wrench_to_base
from ..structure.module_spec import ModuleSpec
from ..structure.robot import HybridRobot
from .link_motion import observed_motions

if TYPE_CHECKING:
    from ..structure.state import ModuleState


@dataclass
class ModuleLoad:
    """Wrenches on one module's bodies, each in the body's frame at its origin.

    Attributes:
        outputs: Output number and wrench (T, 6).
        legs: Body of the tree after the cuts and wrench (T, 6).
        wrist_links: Body of the spanning tree and wrench (T, 6), for massless links inside cut wrists.
        wrist_ends: Wrist number and wrench (T, 6), for ends of cut wrists that a closure holds; it is entered
            on the wrist's target as well.
        base: Wrenches that a wrist hands straight to the base body, (T, 6).
    """

    outputs: list[tuple[int, Array]] = field(default_factory=list)
    legs: list[tuple[int, Array]] = field(default_factory=list)
    wrist_links: list[tuple[int, Array]] = field(default_factory=list)
    wrist_ends: list[tuple[int, Array]] = field(default_factory=list)
    base: list[Array] = field(default_factory=list)

    def on_output(self, state: ModuleState, output: int) -> Array:
        """Return the wrench on an output, shape (T, 6), its own frame: minus the paper's F_e."""
        out = np.zeros_like(state.V)
        for number, wrench in self.outputs:
            if number == output:
                out += wrench
        return out

    def through_wrist(self, state: ModuleState, number: int) -> Array:
        """Compute the wrench of a cut wrist's links on its target, (T, 6), base axes, at the wrist's end."""
        m = state.mechanism
        wrist, spanning = m.spec.wrists[number], state.spanning
        out = np.zeros_like(state.V)
        R = spanning.R[:, wrist.end]
        for end, wrench in self.wrist_ends:
            if end == number:
                out += np.concatenate([rotate(R, wrench[:, :3]), rotate(R, wrench[:, 3:])], axis=1)
        for body, wrench in self.wrist_links:
            if body - 1 in wrist.joints:
                R, cols = spanning.R[:, body], m.wrists.columns(number)
                own = m.spanning.jacobian(spanning, body)[:, :, cols] * m.spanning_col_scale[cols]
                world = np.concatenate([rotate(R, wrench[:, :3]), rotate(R, wrench[:, 3:])], axis=1)
                along = np.einsum("tij,ti->tj", own, world)
                handed = np.einsum(
                    "tij,ti->tj", np.linalg.pinv(m.wrists.jacobian(spanning, number), rcond=1e-12), along
                )
                out += handed / np.array([m.length] * 3 + [1.0] * 3)
        return out

    def on_legs(self, state: ModuleState) -> tuple[Array, Array]:
        """Compute the wrench of loads on leg links on the base, (T, 6), and their force along x, (T, n)."""
        m = state.mechanism
        base, along = np.zeros_like(state.V), np.zeros((len(state.V), m.tree.nv))
        for wrench in self.base:
            base += wrench
        for body, wrench in self.legs:
            base += wrench_to_base(state.motion.R[:, body], state.motion.p[:, body], wrench)
            along += np.einsum("tij,ti->tj", m.jacobian(state.motion, body), wrench)
        for body, wrench in self.wrist_links:
            base += wrench_to_base(state.spanning.R[:, body], state.spanning.p[:, body], wrench)
            J = m.wrists.link_jacobian(state.spanning, state.motion, body)
            along += np.einsum("tij,ti->tj", J, wrench)
        return base, along


@dataclass
class Loads:
    """All that acts on the robot beside motors and weight.

    Attributes:
        modules: One entry per module: external wrenches.
        root: Wrench on the root body, shape (T, 6), its frame.
        on: The effects that are computed.
        joints: Efforts of joint laws on the spanning tree, shape (T, nv), or None.
        rotors: What rotors add to the diagonal of the inertia, shape (nv,), or None.
    """

    modules: list[ModuleLoad]
    root: Array
    on: Effects = STANDARD
    joints: Array | None = None
    rotors: Array | None = None

    def on_legs(self, k: int, state: ModuleState) -> tuple[Array, Array]:
        """Compute the wrench of loads on module k on its base, (T, 6), and their force along x, (T, n)."""
        base, along = self.modules[k].on_legs(state)
        if self.joints is not None:
            passive = np.zeros_like(along)
            state.mechanism.cut.to_tree(self.joints[:, state.module.v_index], passive)
            along = along + passive
        return base, along

    def rotor_diagonal(self, state: ModuleState) -> Array | None:
        """Return what rotors add to the diagonal of a module's inertia along x, shape (n,), or None."""
        if self.rotors is None:
            return None
        out = np.zeros((1, state.mechanism.tree.nv))
        state.mechanism.cut.to_tree(self.rotors[None, state.module.v_index], out)
        diagonal: Array = out[0]
        return diagonal


def all_loads(
    robot: HybridRobot,
    on: Effects,
    q: Array,
    v: Array,
    time: Array | None,
    wrenches: Mapping[str, Array] | None,
) -> Loads:
    """Gather wrenches given by the caller, and what the effects add.

    Args:
        robot: The robot.
        on: The effects that are computed.
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv).
        time: Times, shape (T,), or None.
        wrenches: As `gather_loads` takes them.

    Raises:
        TrajectoryError: As `gather_loads`; or an effect needs time.
    """
    loads = gather_loads(robot, wrenches, len(q))
    loads.on, loads.joints, loads.rotors = on, on.joint_efforts(robot, q, v), on.rotor_diagonal(robot)
    if on.links:
        for given in on.wrenches(observed_motions(robot, on, q, v), time, len(q)):
            _enter(robot, loads, given, len(q))
    return loads


def gather_loads(robot: HybridRobot, wrenches: Mapping[str, Array] | None, samples: int) -> Loads:
    """Sort wrenches on links by module and body.

    Args:
        robot: The robot.
        wrenches: For each link a wrench on it, shape (6,) or (samples, 6), in its frame at its origin.
        samples: Number of samples.

    Raises:
        TrajectoryError: An unknown link, a wrong shape, or a number that is not finite.
    """
    loads = Loads([ModuleLoad() for _ in robot.modules], np.zeros((samples, 6)))
    _enter(robot, loads, wrenches or {}, samples)
    return loads


def _enter(robot: HybridRobot, loads: Loads, wrenches: Mapping[str, Array], samples: int) -> None:
    """Add wrenches on links to the loads."""
    for link, given in wrenches.items():
        wrench = _wrench(robot, link, given, samples)
        body, R, p = robot.bodies.place[link]
        wrench = wrench_to_base(R, p, wrench)
        if body == 0 and robot.base != "floating":
            loads.root += wrench
            continue
        module, number = robot.body_owner[body]
        _place(robot.modules[module].mechanism.spec, loads.modules[module], number, wrench)


def _wrench(robot: HybridRobot, link: str, given: Array, samples: int) -> Array:
    """Check a wrench on a link and return it for every sample, shape (samples, 6).

    Raises:
        TrajectoryError: An unknown link, a wrong shape, or a number that is not finite.
    """
    if link not in robot.bodies.place:
        raise TrajectoryError(f"wrench on unknown link '{link}'{did_you_mean(link, robot.bodies.place)}")
    wrench = np.asarray(given, dtype=float)
    if wrench.shape not in ((6,), (samples, 6)):
        raise TrajectoryError(f"wrench on '{link}' has shape {wrench.shape}; wanted (6,) or ({samples}, 6)")
    if not np.isfinite(wrench).all():
        raise TrajectoryError(f"wrench on '{link}' is not finite")
    return np.broadcast_to(wrench, (samples, 6))


def _place(spec: ModuleSpec, load: ModuleLoad, body: int, wrench: Array) -> None:
    """Enter a wrench on a body of a module's spanning tree."""
    for number, wrist in enumerate(spec.wrists):
        if wrist.end == body and not wrist.carries:
            load.wrist_ends.append((number, wrench))
            wrench = wrench_to_base(wrist.R, wrist.p, wrench)
            body = wrist.target
            break
    if body == 0:
        load.base.append(wrench)
    elif body not in spec.tree_body:
        load.wrist_links.append((body, wrench))
    elif (own := spec.tree_body.index(body)) in spec.outputs:
        load.outputs.append((spec.outputs.index(own), wrench))
    else:
        load.legs.append((own, wrench))
