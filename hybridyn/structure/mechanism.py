"""One module in its general form: legs, platforms, closures, and the motions that keep its loops closed.

A `Mechanism` is what equal modules share: trees, closures, ranks, Pinocchio's leg model. It knows no names.

The unknowns x of a module are [legs' joints; platforms' twists]. In x the module's row of the paper reads

    x_dot = [q_dot; v] = [Psi; a] u                     (2), (8), (15)
    H = D V_dot_base + A q_ddot + h                     (34)

and an output on a leg link moves with a_o = J_o Psi.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from ..linkage.closures import Closures
from ..linkage.elimination import least_squares
from ..linkage.gimbal_lock import GIMBAL_LOCK, warn_of_gimbal_lock
from ..linkage.joints import TreeJoint
from ..linkage.newton import generic_postures
from ..linkage.reduction import RANK_TOLERANCE, Basis
from ..linkage.tree import Motion, Tree
from ..spatial import Array, Index, Mask, cross, quaternion_from_rotation, select, spatial_inertia
from .leg_model import LegModel
from .long_legs import LongLegs
from .module_spec import ModuleSpec
from .rank_evidence import rank_by_home, rank_decision
from .scaling import freedom_units, leg_by_leg, module_length, row_factors

#: Where its axes span less than this, a carrying wrist does not tell its platform's motion: rates grow there.
NEAR_LOCK = 1e-2
#: A freedom that moves no more than this where a module moves by one (rad, module lengths) does not move at
#: all: ten thousand roundings.
STILL = 1e-11
#: Legs of more freedoms have a model of their own: Pinocchio's data grow with the cube, 20 MB here.
PINOCCHIO_HOLDS = 128


class Mechanism:
    """The numbers of a module, shared by all modules that are equal.

    Attributes:
        spanning: Tree of every joint of the module, wrists included, as in the user's q, v, a.
        tree: Tree after the cuts: legs' joints and platforms (as `floating` joints from the base).
        closures: Closures on `tree`.
        spanning_closures: The author's closures, on `spanning`.
        length: The module's length [m], a power of two.
        reduction: Elimination of `closures`, ranks fixed.
        legs: The model of the legs: Pinocchio's, or for hundreds of freedoms our own.
        inertias: 6-D inertias of the outputs, shape (outputs, 6, 6), body frames.
        postures: Assembled generic postures of `tree`, shape (samples, nq).
        rank_tolerance: Relative singular value from which on rows count as independent.
    """

    def __init__(
        self, spec: ModuleSpec, rank_tolerance: float | None, closure_tolerance: float, robot_size: float
    ) -> None:
        """Find ranks and lengths of a module.

        Args:
            spec: Its numbers.
            rank_tolerance: What `build_robot` was given.
            closure_tolerance: What `build_robot` was given.
            robot_size: A length of the robot, for modules without an extent of their own [m].
        """
        self.spec = spec
        self.rank_is_given = rank_tolerance is not None
        self.spanning, self.tree = Tree(list(spec.spanning)), Tree(list(spec.tree))
        self.spanning_closures = Closures(self.spanning, list(spec.closures), list(spec.couplings))
        self.closures = Closures(self.tree, list(spec.cut_closures), list(spec.cut_couplings))
        self.length = module_length(spec, self.spanning, robot_size)
        self.inertias = np.array([spatial_inertia(b.mass, b.com, b.inertia) for b in spec.outputs_inertia])
        self.inertias = self.inertias.reshape(-1, 6, 6)
        model = LegModel if self.tree.nv <= PINOCCHIO_HOLDS else LongLegs
        self.legs = model(self.tree, list(spec.leg_bodies))
        self._map_coordinates()
        self.reduction = leg_by_leg(spec, self.tree, self.closures, self.length)
        home = self.cut(spec.home[None], None, None, self.spanning.sweep(spec.home[None]))[0]
        self.home = home[0]
        scales = (self.reduction.row_scale, self.reduction.col_scale)
        self.postures, self.best_residual = home, 0.0
        home_open = np.abs(self.closures.residual(home, self.tree.sweep(home)) * self.reduction.row_scale)
        #: Whether the loops are closed at home; robots may be written with their loops open.
        self.home_closes = bool((home_open <= closure_tolerance).all())
        self.rank_tolerance = rank_tolerance or RANK_TOLERANCE
        if self.closures.rows:
            self.postures, self.best_residual = generic_postures(
                self.closures, self.home, *scales, closure_tolerance
            )
        self.spanning_col_scale = freedom_units(self.spanning, self.length)
        self.spanning_row_scale = row_factors(self.spanning, self.spanning_closures, self.length)
        self.rounding = 0.0
        self.generic_K = self.closures.matrix(self.tree.sweep(self.postures))
        #: How rows were counted where numbers had to decide it; empty where nothing was in doubt.
        self.rank_decision = ""
        if len(self.postures):
            self.reduction.fix_ranks(self.generic_K, self.rank_tolerance)
            if rank_tolerance is None:
                self._decide_by_home(float(home_open.max(initial=0.0)))
            at_best = self.closures.residual(self.postures, self.tree.sweep(self.postures))
            worst = np.abs(at_best * self.reduction.row_scale).max(initial=0.0)
            #: How far rounding in the file keeps over-constrained loops from closing, relative to the length.
            self.rounding = 4.0 * max(float(worst), self.reduction.report.dropped)

    def _decide_by_home(self, open_by: float) -> None:
        """Count rows in doubt where home, open by that much, closes too well for them to be rounding."""
        evidence = rank_by_home(self.closures, self.reduction, self.home, open_by)
        if evidence:
            self.postures, self.rank_tolerance = evidence.postures, evidence.tolerance
            self.generic_K = self.closures.matrix(self.tree.sweep(self.postures))
            self.reduction.fix_ranks(self.generic_K, self.rank_tolerance)
            self.reduction.report = replace(self.reduction.report, doubted=None)
        self.rank_decision = rank_decision(self.reduction.report, evidence, open_by)

    @property
    def mobility(self) -> int:
        """The paper's N_k."""
        return self.reduction.mobility

    @cached_property
    def locked(self) -> Mask:
        """Freedoms of `tree` that the closures let not move, at no generic posture, shape (nv,).

        A motor there does no work: what it does is not told by the motion, and numbers that would tell it
        are rounding divided by rounding.
        """
        if not len(self.postures):
            return np.zeros(self.tree.nv, dtype=bool)
        Psi = self.basis(self.generic_K).Psi / self.reduction.col_scale[:, None]
        out: Mask = np.abs(Psi).max(axis=(0, 2), initial=0.0) <= STILL + self.rounding
        return out

    def _map_coordinates(self) -> None:
        """Index arrays between the spanning tree and the tree after the cuts."""
        self._q_from: list[int] = []
        self._q_to: list[int] = []
        self._v_from: list[int] = []
        self._v_to: list[int] = []
        for i, source in enumerate(self.spec.tree_joint):
            if source is None:
                continue
            self._q_from += range(*self.spanning.q_slices[source].indices(self.spanning.nq))
            self._q_to += range(*self.tree.q_slices[i].indices(self.tree.nq))
            self._v_from += range(*self.spanning.v_slices[source].indices(self.spanning.nv))
            self._v_to += range(*self.tree.v_slices[i].indices(self.tree.nv))
        self.bodies = np.array(self.spec.tree_body)

    def cut(self, q: Array, v: Array | None, a: Array | None, motion: Motion) -> tuple[Array, Array, Array]:
        """Return positions, rates, accelerations of `tree` from those of the spanning tree and its motion."""
        T = len(q)
        out_q = np.zeros((T, self.tree.nq))
        out_v, out_a = np.zeros((2, T, self.tree.nv))
        out_q[:, self._q_to] = q[:, self._q_from]
        if v is not None:
            out_v[:, self._v_to] = v[:, self._v_from]
        if a is not None:
            out_a[:, self._v_to] = a[:, self._v_from]
        for joint in self.spec.platforms:
            body = self.bodies[joint + 1]
            at, to = self.tree.q_slices[joint], self.tree.v_slices[joint]
            out_q[:, at.start : at.start + 3] = motion.p[:, body]
            out_q[:, at.start + 3 : at.stop] = quaternion_from_rotation(motion.R[:, body])
            if v is not None:
                out_v[:, to] = motion.twist(body)
            if a is not None:
                out_a[:, to] = motion.acceleration(body)
        return out_q, out_v, out_a

    def locked_carriers(self, spanning: Motion) -> Index:
        """Return the samples at which a wrist that carries a platform is near gimbal lock."""
        near = np.zeros(len(spanning.p), dtype=bool)
        for number, wrist in enumerate(self.spec.wrists):
            if wrist.carries and len(wrist.joints) == 3:
                near |= np.abs(np.linalg.det(self.wrist_rates(spanning, number)[:, 3:])) <= NEAR_LOCK
        return np.flatnonzero(near)

    def platforms_from_legs(
        self, x: Array, x_dot: Array, x_ddot: Array | None, motion: Motion, samples: Index
    ) -> None:
        """Take the platforms' rates from the closures instead of from the wrists that carry them, in place.

        Args:
            x: Positions of `tree`, shape (T, nq).
            x_dot: Rates, shape (T, nv).
            x_ddot: Accelerations, shape (T, nv), or None.
            motion: Motion of `tree` as the spanning tree tells it.
            samples: The samples concerned.
        """
        r, slices = self.reduction, [self.tree.v_slices[i] for i in self.spec.platforms]
        cols = np.concatenate([np.arange(s.start, s.stop) for s in slices])
        K = r.scaled(self.closures.matrix(motion.take(samples)))

        def missing(rates: Array, drift: Array) -> Array:
            miss = np.einsum("tij,tj->ti", K, rates / r.col_scale) + drift * r.row_scale
            out: Array = least_squares(K[:, :, cols], -miss, relative=GIMBAL_LOCK) * r.col_scale[cols]
            return out

        x_dot[np.ix_(samples, cols)] += missing(x_dot[samples], np.zeros(K.shape[:2]))
        right = self.tree.sweep(x[samples], x_dot[samples])
        if x_ddot is not None:
            drift = self.closures.rates(right, x_dot[samples])[1]
            x_ddot[np.ix_(samples, cols)] += missing(x_ddot[samples], drift)
            right = self.tree.sweep(x[samples], x_dot[samples], x_ddot[samples])
        for name in ("w", "p_dot", "w_dot", "p_ddot"):
            getattr(motion, name)[samples] = getattr(right, name)

    def to_spanning(self, x: Array, out: Array) -> None:
        """Copy the legs' rates (or accelerations) of `tree` into those of the spanning tree, in place."""
        out[:, self._v_from] = x[:, self._v_to]

    def to_cut(self, spanning: Array, out: Array) -> None:
        """Copy the legs' rates (or accelerations) of the spanning tree into those of `tree`, in place."""
        out[:, self._v_to] = spanning[:, self._v_from]

    def positions_to_spanning(self, x: Array, out: Array) -> None:
        """Copy the legs' positions of `tree` into those of the spanning tree, in place."""
        out[:, self._q_from] = x[:, self._q_to]

    def tree_body(self, body: int) -> int:
        """Return the number in `tree` of a body of the spanning tree (a welded wrist's end is its target)."""
        for wrist in self.spec.wrists:
            if wrist.end == body:
                body = wrist.target
        return int(np.flatnonzero(self.bodies == body)[0])

    def wrist_joints(self, wrist: int) -> tuple[TreeJoint, ...]:
        """Return a wrist's joints as a chain of their own, hanging from the wrist's parent body."""
        joints = self.spec.wrists[wrist].joints
        return tuple(replace(self.spanning.joints[j], parent=i) for i, j in enumerate(joints))

    def wrist_positions(self, wrist: int) -> Index:
        """Return the position coordinates of a wrist in the spanning tree."""
        every = np.arange(self.spanning.nq)
        return np.concatenate([every[self.spanning.q_slices[i]] for i in self.spec.wrists[wrist].joints])

    def cut_motion(self, motion: Motion) -> Motion:
        """Return the same motion for the bodies of `tree` (they are bodies of the spanning tree)."""
        take = self.bodies
        return Motion(*(select(x, take) for x in motion.arrays))

    def basis(self, K: Array, gamma: Array | None = None) -> Basis:
        """Return Psi and drift on `tree` from its closure rows (drift 0 where gamma is left out)."""
        return self.reduction.basis(K, np.zeros(K.shape[:2]) if gamma is None else gamma)

    def jacobian(self, motion: Motion, body: int) -> Array:
        """Return a body's twist in its own frame over x_dot, shape (T, 6, n); J Psi is the paper's a."""
        return to_body_axes(motion.R[:, body], self.tree.jacobian(motion, body))

    def wrist_link_jacobian(self, spanning: Motion, motion: Motion, body: int) -> Array:
        """Return the twist in its own frame of a link inside a wrist that was cut, over x_dot, (T, 6, n).

        Args:
            spanning: Motion of the spanning tree.
            motion: Motion of `tree`.
            body: The link's body in the spanning tree.
        """
        number = next(i for i, w in enumerate(self.spec.wrists) if body - 1 in w.joints)
        wrist, cols = self.spec.wrists[number], self.wrist_columns(number)
        parent = int(np.flatnonzero(self.bodies == self.spanning.joints[wrist.joints[0]].parent)[0])
        target = int(np.flatnonzero(self.bodies == wrist.target)[0])
        end, here = spanning.p[:, wrist.end], spanning.p[:, body]
        miss = self.tree.jacobian(motion, target, end) - self.tree.jacobian(motion, parent, end)
        miss[:, :3] /= self.length
        rates = np.matmul(np.linalg.pinv(self.wrist_rates(spanning, number), rcond=1e-12), miss)
        own = self.spanning.jacobian(spanning, body, here)[:, :, cols] * self.spanning_col_scale[cols]
        J = self.tree.jacobian(motion, parent, here) + np.matmul(own, rates)
        return to_body_axes(spanning.R[:, body], J)

    def wrist_rates(self, motion: Motion, wrist: int) -> Array:
        """Return the twist of a wrist's end, relative to its parent, over the wrist's scaled joint rates.

        Args:
            motion: Motion of the spanning tree.
            wrist: Number of the wrist.

        Returns:
            Shape (T, 6, joints of the wrist), at the end body's origin, base axes, linear over the length.
        """
        end, cols = self.spec.wrists[wrist].end, self.wrist_columns(wrist)
        linear, angular = (c[:, cols] for c in self.spanning.columns(motion))
        shift = cross(angular, motion.p[:, end, None] - motion.p[:, self.spanning.dof_body[cols]])
        S = np.swapaxes(np.concatenate([(linear + shift) / self.length, angular], axis=-1), 1, 2)
        out: Array = S * self.spanning_col_scale[cols]
        return out

    def recover_rates(self, q: Array, v: Array, target: Motion) -> None:
        """Fill in the wrists' rates that make their ends follow their targets (least norm), in place.

        Args:
            q: Positions of the spanning tree, shape (T, nq).
            v: Rates of the spanning tree, shape (T, nv); those of the wrists are overwritten.
            target: Motion of `tree`, with rates.
        """
        self._recover(q, v, None, target)

    def recover_accelerations(self, q: Array, v: Array, a: Array, target: Motion) -> None:
        """Fill in the wrists' accelerations, in place; arguments as in `recover_rates`."""
        self._recover(q, v, a, target)

    def _recover(self, q: Array, v: Array, a: Array | None, target: Motion) -> None:
        """Fill in the wrists' rates, or, where `a` is given, their accelerations, in place."""
        unknown = v if a is None else a
        motion: Motion | None = None
        for number, wrist in enumerate(self.spec.wrists):
            cols = self.wrist_columns(number)
            unknown[:, cols] = 0.0
            if motion is None:
                motion = self.spanning.sweep(q, v, a)
            body = int(np.flatnonzero(self.bodies == wrist.target)[0])
            r = motion.p[:, wrist.end] - target.p[:, body]
            w = target.w[:, body]
            if a is None:
                linear = target.p_dot[:, body] + cross(w, r) - motion.p_dot[:, wrist.end]
                angular = w - motion.w[:, wrist.end]
            else:
                w_dot = target.w_dot[:, body]
                linear = (
                    target.p_ddot[:, body]
                    + cross(w_dot, r)
                    + cross(w, cross(w, r))
                    - motion.p_ddot[:, wrist.end]
                )
                angular = w_dot - motion.w_dot[:, wrist.end]
            miss = np.concatenate([linear / self.length, angular], axis=-1)
            S = self.wrist_rates(motion, number)
            unknown[:, cols] = least_squares(S, miss, relative=GIMBAL_LOCK) * self.spanning_col_scale[cols]
            warn_of_gimbal_lock(S)
            if wrist.carries:  # what hangs from a platform moves with it: sweep again before the next wrist
                motion = None

    def wrist_columns(self, wrist: int) -> Index:
        """Return the freedoms of a wrist in the spanning tree."""
        every = np.arange(self.spanning.nv)
        return np.concatenate([every[self.spanning.v_slices[i]] for i in self.spec.wrists[wrist].joints])


def to_body_axes(R: Array, J: Array) -> Array:
    """Turn Jacobians (T, 6, n) from base axes to axes R (T, 3, 3)."""
    Rt = np.swapaxes(R, 1, 2)
    return np.concatenate([np.matmul(Rt, J[:, :3]), np.matmul(Rt, J[:, 3:])], axis=1)
