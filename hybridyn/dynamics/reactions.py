"""Compute the wrenches between modules and in the closures."""

from dataclasses import dataclass, field

import numpy as np

from ..effects.choice import Effects
from ..linkage.closures import TreeClosure
from ..spatial import Array, Mask, rotate_back, wrench_to_base
from ..structure.module import ModuleState
from .guards import LOST_PIVOT
from .inverse_recursion import ModuleForces
from .joint_wrenches import (
    closure_frames,
    joint_wrenches,
    needed_by_bodies,
    needed_of_closures,
    unit_wrenches,
)
from .loads import ModuleLoad

#: A component of a closure wrench is undetermined if a unit self-stress has more than this part along it.
UNDETERMINED = 1e-6


def undetermined(shared: Array) -> Mask:
    """Return whether the motion leaves open what each self-stress would add to, shape (..., k)."""
    out: Mask = ~(np.abs(shared).max(axis=-1, initial=0.0) <= UNDETERMINED)
    return out


@dataclass(eq=False)
class Reactions:
    """Internal wrenches, [force; moment] in [N, N m]; leading axis T dropped for a single sample.

    Attributes:
        base: Wrench that the ground exerts ON the root body, shape (T, 6), root frame, at its origin. For a
            floating base it is zero, up to rounding, if the motion satisfies the equations of motion.
        modules: For each module name, the wrench that the base body exerts ON the module (the paper's F_k
            plus that of the legs), shape (T, 6), in the base body's frame, at its origin.
        closures: For each closure name, the wrench that the closure exerts ON its successor link, shape
            (T, 6). The wrench on the predecessor is the opposite. The axes are those of the predecessor's
            closure frame as placed by the author, for any axis of the closure. The point is the origin of
            the successor's closure frame. For a coupling: the multiplier of its equation as written, shape
            (T, 1).
        unique: For each closure name, False if the motion does not determine the wrench, because rows are
            redundant or lose rank at a sample. The returned wrenches are then the smallest ones in the
            module's closures that produce the motion, in the norm of the moments and of the forces times the
            module's length.
        determined: For each closure name, True for each component of the wrench that the motion determines,
            shape (T, 6), or (T, 1) for a coupling. In a planar loop these are the forces in its plane.
        joints: For each joint name, the wrench that the joint exerts ON its child, shape (T, 6), in the
            child's frame, at the joint. Along the joint's freedom it is the effort of the motor and of the
            joint's laws. A wrench that redundant rows share is that of the smallest closure wrenches.
        joints_shared: For each joint name, what each self-stress of the closures would add to the wrench,
            shape (T, 6, k), with forces times the module's length.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> q, v, a = hybridyn.assemble(robot, motors=([0.1, 0.2], [1.0, 0.0], [0.0, 0.0]))
        >>> tau, inner = hybridyn.idm(robot, q, v, a, reactions=True)
        >>> inner.base[[0, 2]].round(3)
        array([ 0.109, 90.546])
        >>> inner.closures["m1_tip"][[0, 2]].round(3)
        array([-0.131, -3.114])
    """

    base: Array
    modules: dict[str, Array] = field(default_factory=dict)
    closures: dict[str, Array] = field(default_factory=dict)
    unique: dict[str, bool] = field(default_factory=dict)
    determined: dict[str, Mask] = field(default_factory=dict)
    joints: dict[str, Array] = field(default_factory=dict)
    joints_shared: dict[str, Array] = field(default_factory=dict)

    @property
    def joints_determined(self) -> dict[str, Mask]:
        """For each joint name, True for each component of its wrench that the motion determines, (T, 6)."""
        return {name: ~undetermined(shared) for name, shared in self.joints_shared.items()}

    def sample(self, t: int) -> "Reactions":
        """Return the reactions at one sample."""
        return Reactions(
            self.base[t],
            {name: w[t] for name, w in self.modules.items()},
            {name: w[t] for name, w in self.closures.items()},
            {name: bool(d[t].all()) for name, d in self.determined.items()},
            {name: d[t] for name, d in self.determined.items()},
            {name: w[t] for name, w in self.joints.items()},
            {name: w[t] for name, w in self.joints_shared.items()},
        )


def module_reactions(
    result: Reactions, state: ModuleState, load: ModuleLoad, on: Effects, needed: ModuleForces, tau: Array
) -> None:
    """Compute the reactions of one module and add them to `result`.

    Args:
        result: Reactions of the robot, changed in place.
        state: State of the module.
        load: Wrenches on its bodies.
        on: The effects that are computed.
        needed: Forces that its motion needs.
        tau: Efforts of the module's motors, shape (T, motors).
    """
    module = state.module
    result.modules[module.name] = needed.F
    left = needed.H.copy()
    left[:, module.motor_columns] -= tau
    multipliers, idle = multipliers_of(state, left[..., None])
    _of_joints(result, state, needed_by_bodies(state, load, on, needed.W), multipliers, idle)
    _of_closures(result, state, load, multipliers[..., 0], idle)


def _of_joints(result: Reactions, state: ModuleState, needed: Array, multipliers: Array, idle: Array) -> None:
    """Compute the wrench of each joint from what the bodies beyond it need, and add it to `result`."""
    m, names = state.mechanism, state.module.joints
    columns = needed_of_closures(state, np.concatenate([multipliers, idle], axis=2))
    columns[..., 0] += needed
    wrenches = joint_wrenches(state, columns)  # under the multipliers, then under each self-stress
    free = wrenches[..., 1:] * m.length_of_wrench[:, None]
    for i, source in enumerate(m.spec.source):
        if source is not None:  # else a platform, which its wrist carries
            result.joints[names[source]] = wrenches[:, i, :, 0]
            result.joints_shared[names[source]] = free[:, i]


def _of_closures(
    result: Reactions, state: ModuleState, load: ModuleLoad, multipliers: Array, idle: Array
) -> None:
    """Compute the wrench of each closure and the multiplier of each coupling, and add them to `result`."""
    module, m = state.module, state.mechanism
    authors = len(m.spec.closures)
    for i, (name, at) in enumerate(module.named_rows()):
        lam, free = multipliers[:, at], idle[:, at]
        if i < authors:
            author = m.author_closures.closures[i]
            wrenches = _closure_wrenches(state, m.closures.closures[i], author)
            lam = np.einsum("tij,tj->ti", wrenches, lam) + _from_cut_wrists(state, load, i)
            free = np.matmul(wrenches, free)
            free *= m.length_of_wrench[:, None]
        elif i < len(m.closures.closures):
            continue  # a wrist that carries a platform is a joint of the file, not a closure
        else:
            free = free / m.reduction.row_scale[at][:, None]
        result.closures[name] = lam
        result.determined[name] = ~undetermined(free)
        result.unique[name] = bool(result.determined[name].all())


def multipliers_of(state: ModuleState, needed: Array) -> tuple[Array, Array]:
    """Compute the multipliers of a module's closure rows, and a basis of its self-stresses.

    A self-stress is a set of multipliers without effect on the motion.

    Args:
        state: State of the module.
        needed: Columns of the generalised force along x that closures must produce, shape (T, n, c).

    Returns:
        The multipliers, shape (T, rows, c), with the least norm in the author's rows; and an orthonormal
        basis of the self-stresses, scaled like them and padded with zeros, shape (T, rows, k).
    """
    m, reduction = state.mechanism, state.mechanism.reduction
    rows, rank = len(reduction.row_scale), reduction.rank
    if not rows:
        return np.zeros((len(needed), 0, needed.shape[2])), np.zeros((len(needed), 0, 0))
    U, s, Vt = np.linalg.svd(reduction.scaled(state.K), full_matrices=rank < rows)
    keep = (np.arange(s.shape[1]) < rank) & (s > LOST_PIVOT * s[:, :1])
    y = np.matmul(Vt[:, : s.shape[1]], needed * reduction.col_scale[:, None])
    y = np.where(keep[..., None], y / np.where(keep, s, 1.0)[..., None], 0.0)
    lam = np.matmul(U[:, :, : s.shape[1]], y)
    kept = keep.sum(axis=1)
    first = int(kept.min(initial=rank))
    idle = U[:, :, first:] * np.where(np.arange(first, U.shape[2]) >= kept[:, None], 1.0, 0.0)[:, None]
    carried = m.closures.row_slices[len(m.spec.closures) : len(m.closures.closures)]  # wrists of platforms
    if carried and idle.size:
        authors = np.r_[: carried[0].start, carried[-1].stop : rows]
        change = np.linalg.pinv(idle[:, authors], rcond=UNDETERMINED) @ lam[:, authors]
        lam -= np.matmul(idle, change)
    return lam * reduction.row_scale[:, None], idle * reduction.row_scale[:, None]


def _closure_wrenches(state: ModuleState, cut: TreeClosure, author: TreeClosure) -> Array:
    """Compute the wrench on the successor link per unit of each multiplier of a closure's rows.

    Args:
        state: State of the module.
        cut: The closure on the tree after the cuts.
        author: The author's closure on the whole tree.

    Returns:
        Shape (T, 6, rows of the closure), in the frame of `_wrench_frame`.
    """
    A_out, p_out = _wrench_frame(state, author)
    wrenches = unit_wrenches(state.motion, cut, p_out)
    # The closure that replaces a wrist may have predecessor and successor exchanged.
    sign = 1.0 if cut.body_b == author.body_b or cut.body_a == author.body_a else -1.0
    parts = (wrenches[:, :3], wrenches[:, 3:])
    return sign * np.concatenate([np.matmul(np.swapaxes(A_out, 1, 2), x) for x in parts], axis=1)


def _from_cut_wrists(state: ModuleState, load: ModuleLoad, closure: int) -> Array:
    """Compute the part of a closure's wrench that is due to loads on the links of a cut wrist.

    Args:
        closure: Number of the author's closure.

    Returns:
        Wrench on the successor link, shape (T, 6), in the frame of `_wrench_frame`.
    """
    m, out = state.mechanism, np.zeros_like(state.V)
    author = m.author_closures.closures[closure]
    for number, (wrist, weld) in enumerate(zip(m.spec.wrists, m.cut.welds, strict=True)):
        if wrist.closure != closure:
            continue
        A, p = _wrench_frame(state, author)
        motion = state.whole.of_body(weld.body_a)
        handed = wrench_to_base(motion.R, motion.p - p, load.through_wrist(state, number))
        sign = 1.0 if weld.body_b == author.body_b else -1.0
        out += sign * np.concatenate([rotate_back(A, x) for x in (handed[:, :3], handed[:, 3:])], axis=-1)
    return out


def _wrench_frame(state: ModuleState, author: TreeClosure) -> tuple[Array, Array]:
    """Return the axes and the origin, in the base frame, in which a closure's wrench is expressed.

    The axes are those of the predecessor's closure frame as placed by the author. (Frame A differs from it,
    because z of frame A is the axis of the closure.) The origin is that of the successor's closure frame.
    """
    A, _, _, p = closure_frames(state.whole, author)
    return A @ author.turn.T, p
