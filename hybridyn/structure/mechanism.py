"""Numbers that equal modules share: lengths, ranks, generic postures and the model of the legs.

A `Mechanism` has no names. The unknowns x of a module are [joints of its legs; twists of its platforms]. In
these unknowns the equations of the paper for the module are

    x_dot = [q_dot; v] = [Psi; a] u                     (2), (8), (9), (15)
    H = D V_dot_base + A q_ddot + h                     (34)

For an output that is a leg link, a_o = J_o Psi.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..linkage.closures import Closures
from ..linkage.elimination import least_squares
from ..linkage.generic_postures import kept_generic_postures
from ..linkage.loop_problem import LoopProblem
from ..linkage.motion import Motion
from ..linkage.newton import close
from ..linkage.reduction import RANK_TOLERANCE, Basis
from ..spatial import Array, Index, Mask, indices, spatial_inertia, to_body_axes
from .cut import Cut
from .leg_model import LegModel, LongLegs
from .module_spec import ModuleSpec, freedom_units, leg_by_leg, module_length, row_factors
from .rank_evidence import dropped_rows, rank_by_home, singular_home
from .wrist_rows import GIMBAL_LOCK, WristRows

#: A freedom is locked if it moves no more than this when its module moves by one (rad, module lengths). The
#: limit is about 5e4 times the machine epsilon.
STILL = 1e-11
#: Number of postures of another mechanism near which the ranks of this one are checked, and the part of them
#: near which it must close.
CHECKED, LEAST_FOLLOW = 8, 0.5
#: Largest number of freedoms for `LegModel`; larger modules use `LongLegs`. Pinocchio's `Data` grows with the
#: cube of the number: 20 MB here.
MOST_PINOCCHIO_FREEDOMS = 128


class Tolerances(NamedTuple):
    """Tolerances for building a robot (see `build_robot`).

    Attributes:
        rank: Relative singular value below which closure rows count as dependent, or None to determine it.
        closure: Largest residual that counts as closed, relative to the length of a module.
    """

    rank: float | None
    closure: float


class SweptModule(NamedTuple):
    """Motion of a module at the samples of a batch.

    Attributes:
        whole: Motion of its whole tree.
        motion: Motion of its tree after the cuts, whose bodies come first in the whole tree.
        q, v, a: Positions, rates and accelerations of this tree, shapes (T, nq), (T, nv), (T, nv).
    """

    whole: Motion
    motion: Motion
    q: Array
    v: Array
    a: Array


class Mechanism:
    """The numbers of a module; equal modules share one object.

    Attributes:
        spec: The joints, closures and inertias from which it was built.
        cut: The whole tree, the spanning tree and the tree after the cuts, and the maps between them.
        spanning: Tree of all joints of the module (`cut.spanning`).
        tree: Tree after the cuts (`cut.tree`).
        closures: Closures on `tree`.
        spanning_closures: The author's closures, on `spanning`.
        length: Length of the module [m], a power of two.
        length_of_wrench: What makes each component of a wrench a moment, shape (6,): forces times length.
        unit: Unit of each freedom of the whole tree, shape (its nv,).
        legs: Model of the legs: `LegModel`, or `LongLegs` for hundreds of freedoms.
        inertias: 6-D inertias of the outputs, shape (outputs, 6, 6), body frames.
        reduction: Elimination of `closures`, with fixed ranks.
        wrists: Rows of the wrists that were cut.
        home: Home position of `tree`, shape (nq,).
        home_closes: Whether the loops are closed at home; a file may describe a robot with open loops.
        postures: Generic postures of `tree` with closed loops, shape (samples, nq).
        best_residual: Smallest residual found in the search for these postures, relative to the length.
        rank_tolerance: Relative singular value above which rows count as independent.
        rank_decision: Text that describes how doubtful rows were counted; empty if no row was in doubt.
        generic_K: Closure rows at `postures`, shape (samples, rows, n).
        rounding: Residual that rounding in the file may leave in over-constrained loops, relative to the
            length.
    """

    def __init__(
        self, spec: ModuleSpec, tolerances: Tolerances, robot_size: float, like: Mechanism | None = None
    ) -> None:
        """Compute the length, the ranks and generic postures of a module.

        Args:
            spec: Numbers of the module.
            tolerances: Tolerances of the robot.
            robot_size: Characteristic length of the robot [m], for modules that have no extent themselves.
            like: A mechanism of the same topology, near whose postures those of this one are looked for, and
                whose ranks are expected; without them, everything is decided anew.
        """
        self.spec = spec
        self.rank_is_given = tolerances.rank is not None
        self.cut = Cut(spec)
        self.spanning, self.tree = self.cut.spanning, self.cut.tree
        self.spanning_closures = Closures(self.spanning, list(spec.closures), list(spec.couplings))
        self.closures = Closures(self.tree, list(spec.cut_closures), list(spec.cut_couplings))
        spanning = self.spanning.sweep(spec.home[None])
        self.length = module_length(spec, spanning, robot_size)
        self.home = self.cut.coordinates(spec.home[None], None, None, spanning)[0][0, : self.tree.nq]
        at_home = self.tree.sweep(self.home[None]) if spec.wrists else spanning
        self.length_of_wrench = np.array([self.length] * 3 + [1.0] * 3)
        inertias = [spatial_inertia(b.mass, b.com, b.inertia) for b in spec.outputs_inertia]
        self.inertias = np.array(inertias).reshape(-1, 6, 6)
        model = LegModel if self.tree.nv <= MOST_PINOCCHIO_FREEDOMS else LongLegs
        self.legs = model(self.tree, list(spec.leg_bodies))
        self.unit = freedom_units(self.cut.whole, self.length)
        self.spanning_col_scale = self.unit[self.cut.v_of]
        self.spanning_row_scale = row_factors(self.spanning, self.spanning_closures, self.length)
        self.wrists = WristRows(self.cut, self.length, self.unit)
        if like is None or not self._follows(like, tolerances, at_home):
            self._fix_ranks(tolerances.rank, self._find_postures(tolerances.closure, at_home), at_home)

    def _follows(self, like: Mechanism, tolerances: Tolerances, at_home: Motion) -> bool:
        """Close the loops near the postures of another mechanism; return whether the ranks are the same."""
        if like.rank_decision or not like.reduction.report.clear or not len(like.postures):
            return False
        near = like.postures[:CHECKED]
        open_by = self._find_postures(tolerances.closure, at_home, near)
        if len(self.postures) < len(near) * LEAST_FOLLOW:
            return False
        self._fix_ranks(like.rank_tolerance, open_by, at_home)
        report = self.reduction.report
        return report.clear and report.doubted is None and report.rank == like.reduction.rank

    def _find_postures(self, tolerance: float, at_home: Motion, near: Array | None = None) -> float:
        """Find generic postures that close the loops, and return the largest residual at home.

        Args:
            tolerance: Largest residual of a closed posture, relative to the length.
            at_home: Motion of `tree` at home.
            near: Postures near which they are looked for, shape (samples, nq), or None.
        """
        self.reduction = leg_by_leg(self.spec, self.tree, self.closures, self.length)
        home, row_scale, col_scale = self.home[None], self.reduction.row_scale, self.reduction.col_scale
        residual = self.closures.residual(home, at_home) * row_scale
        open_by = float(np.abs(residual).max(initial=0.0))
        self.home_closes = open_by <= tolerance
        self.postures, self.best_residual = home, 0.0
        if self.closures.rows and near is not None:
            every = np.ones(self.tree.nv, dtype=bool)
            found = close(LoopProblem(self.closures, row_scale, col_scale, every), near)
            self.postures = found.q[found.residual <= tolerance]
            self.best_residual = float(found.residual.min())
        elif self.closures.rows:
            self.postures, self.best_residual = kept_generic_postures(
                self.closures, self.home, row_scale, col_scale, tolerance
            )
        return open_by

    def _fix_ranks(self, tolerance: float | None, open_by: float, at_home: Motion) -> None:
        """Decide the ranks of the closures at the generic postures.

        Args:
            tolerance: Relative singular value below which rows count as dependent, or None to determine it.
            open_by: Largest residual at home, relative to the length.
            at_home: Motion of `tree` at home, the only posture where there are no closures.
        """
        self.rank_tolerance, self.rank_decision = tolerance or RANK_TOLERANCE, ""
        motion = self.tree.sweep(self.postures) if self.closures.rows else at_home
        self.rounding, self.generic_K = 0.0, self.closures.matrix(motion)
        if not len(self.postures):
            return
        self.reduction.fix_ranks(self.generic_K, self.rank_tolerance)
        if tolerance is None:
            motion = self._decide_by_home(open_by, at_home) or motion
        residual = self.closures.residual(self.postures, motion)
        worst = float(np.abs(residual * self.reduction.row_scale).max(initial=0.0))
        self.rounding = 4.0 * max(worst, self.reduction.report.dropped)

    def _decide_by_home(self, open_by: float, at_home: Motion) -> Motion | None:
        """Count doubtful rows as independent if home closes too well for these rows to be rounding.

        Then the postures are others. Return the motion of `tree` there.

        Args:
            open_by: Largest residual at home, relative to the length.
            at_home: Motion of `tree` at home.
        """
        evidence, motion = rank_by_home(self.closures, self.reduction, self.home, open_by), None
        if evidence:
            self.postures, self.rank_tolerance = evidence.postures, evidence.tolerance
            motion = self.tree.sweep(self.postures)
            self.generic_K = self.closures.matrix(motion)
            self.reduction.fix_ranks(self.generic_K, self.rank_tolerance)
            self.reduction.report = self.reduction.report._replace(doubted=None)
        said = [evidence.words if evidence else dropped_rows(self.reduction.report, open_by)]
        said.append(singular_home(self.closures, self.reduction, at_home, open_by))
        self.rank_decision = "; ".join(filter(None, said))
        return motion

    @property
    def mobility(self) -> int:
        """Mobility of the module, the paper's N_k."""
        return self.reduction.mobility

    @property
    def spanning_rank(self) -> int:
        """Number of rows of `spanning_closures` that are independent."""
        return self.spanning.nv - self.mobility

    @property
    def self_stresses(self) -> int:
        """Number of rows of `spanning_closures` that others imply: sets of multipliers that move nothing."""
        return self.spanning_closures.rows - self.spanning_rank

    @cached_property
    def author_closures(self) -> Closures:
        """The author's closures and couplings, on the whole tree."""
        of = self.cut.whole_body
        closures = [replace(c, body_a=of(c.body_a), body_b=of(c.body_b)) for c in self.spec.closures]
        return Closures(self.cut.whole, closures, list(self.spec.cut_couplings))

    @cached_property
    def turned_inertia(self) -> Array:
        """Trace of the inertia of each freedom's body about its joint, zero of slides, shape (nv,), [kg m^2].

        The inertia about one axis is a difference of terms of this size.
        """
        bodies = [
            body and np.trace(body.inertia) + 2 * body.mass * body.com @ body.com
            for body in self.spec.leg_bodies
        ]
        traces = np.array([trace or 0.0 for trace in bodies])[self.tree.dof_body - 1]
        return np.where(self.tree.S_angular.any(axis=1), traces, 0.0)

    @cached_property
    def generic_Psi(self) -> Array:
        """All motions at the generic postures, shape (samples, n, N)."""
        return self.basis(self.generic_K).Psi

    @cached_property
    def locked(self) -> Mask:
        """Freedoms of `tree` that the closures hold still at every generic posture, shape (nv,).

        A motor on a locked freedom does no work. The motion does not determine its effort, and a computed
        effort would be rounding divided by rounding.
        """
        if not len(self.postures):
            return np.zeros(self.tree.nv, dtype=bool)
        Psi = self.generic_Psi / self.reduction.col_scale[:, None]
        out: Mask = np.abs(Psi).max(axis=(0, 2), initial=0.0) <= STILL + self.rounding
        return out

    def sweep(self, q: Array, v: Array, a: Array | None) -> SweptModule:
        """Compute the motion of the module's bodies, and its coordinates after the cuts.

        Args:
            q: Positions of the spanning tree, shape (T, nq).
            v: Rates, shape (T, nv).
            a: Accelerations, shape (T, nv), or None if they are not needed.
        """
        spanning = self.spanning.sweep(q, v, a)
        z, *rates = self.cut.coordinates(q, v, a, spanning)
        whole = self.cut.motion(spanning, z)
        motion = self.cut.of_tree(whole)
        x, (x_dot, x_ddot) = z[:, : self.tree.nq], (each[:, : self.tree.nv] for each in rates)
        locked = self.wrists.near_gimbal_lock(whole)
        if len(locked):
            self.platforms_from_legs(x, x_dot, None if a is None else x_ddot, motion, locked)
        return SweptModule(whole, motion, x, x_dot, x_ddot)

    def platforms_from_legs(
        self, x: Array, x_dot: Array, x_ddot: Array | None, motion: Motion, samples: Index
    ) -> None:
        """Compute the rates of platforms from the closures, in place.

        Near gimbal lock this replaces the rates that are computed from the wrists that carry the platforms.

        Args:
            x: Positions of `tree`, shape (T, nq).
            x_dot: Rates, shape (T, nv).
            x_ddot: Accelerations, shape (T, nv), or None.
            motion: Motion of `tree` as computed from the spanning tree.
            samples: The samples to correct (`WristRows.near_gimbal_lock`).
        """
        r, cols = self.reduction, indices(self.tree.v_slices[i] for i in self.spec.platforms)
        K = r.scaled(self.closures.matrix(motion.take(samples)))

        def missing(rates: Array, drift: Array) -> Array:
            """Compute the platforms' rates that close what other rates and a drift leave open."""
            miss = np.einsum("tij,tj->ti", K, rates / r.col_scale) + drift * r.row_scale
            return least_squares(K[:, :, cols], -miss, relative=GIMBAL_LOCK) * r.col_scale[cols]

        x_dot[np.ix_(samples, cols)] += missing(x_dot[samples], np.zeros(K.shape[:2]))
        right = self.tree.sweep(x[samples], x_dot[samples])
        if x_ddot is not None:
            drift = self.closures.rates(right, x_dot[samples])[1]
            x_ddot[np.ix_(samples, cols)] += missing(x_ddot[samples], drift)
            right = self.tree.sweep(x[samples], x_dot[samples], x_ddot[samples])
        for name in ("w", "p_dot", "w_dot", "p_ddot"):
            getattr(motion, name)[samples] = getattr(right, name)

    def spanning_rates(self, q: Array, x: Array, x_dot: Array, x_ddot: Array) -> tuple[Array, Array]:
        """Compute rates and accelerations of the spanning tree, whose wrists follow the bodies they connect.

        Args:
            q: Positions of the spanning tree, shape (T, nq).
            x, x_dot, x_ddot: Positions, rates and accelerations of `tree` at the same posture, shapes
                (T, its nq), (T, its nv), (T, its nv).

        Returns:
            Shapes (T, nv), (T, nv).
        """
        if self.spec.wrists:
            z = np.empty((len(q), self.cut.whole.nq))
            z[:, self.cut.q_of], z[:, : self.tree.nq] = q, x
            at = self.cut.whole.sweep(z)
            x_dot = self.wrists.rates(at, x_dot[:, :, None])[:, :, 0]
            x_ddot = self.wrists.accelerations(x_dot, x_ddot, at)
        return self.cut.to_spanning(x_dot), self.cut.to_spanning(x_ddot)

    def residual(self, q: Array, motion: Motion) -> Array:
        """Compute the residuals of the author's closures, without units.

        Args:
            q: Positions of `spanning`, shape (T, nq).
            motion: Motion of `spanning`.

        Returns:
            Shape (T, rows): distances divided by the length of the module, or angles [rad].
        """
        return self.spanning_closures.residual(q, motion) * self.spanning_row_scale

    def basis(self, K: Array, gamma: Array | None = None) -> Basis:
        """Compute the basis of the motions that keep the loops closed.

        Args:
            K: Closure rows, shape (T, rows, n).
            gamma: Drift term of the rows, shape (T, rows); zero if None.
        """
        return self.reduction.basis(K, np.zeros(K.shape[:2]) if gamma is None else gamma)

    def jacobian(self, motion: Motion, body: int) -> Array:
        """Compute the Jacobian J of a body: its twist, in its own frame, is J x_dot; J Psi is the paper's a.

        Args:
            motion: Motion of `tree`.
            body: Number of the body in `tree`.

        Returns:
            Shape (T, 6, n).
        """
        return to_body_axes(motion.R[:, body], self.tree.jacobian(motion, body))
