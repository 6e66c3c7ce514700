"""Both models with a sweep back from their results to the numbers in slots, through closed loops."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..assembly.task import SINGULAR_ROWS
from ..compiled import GUARD_LIMIT, RobotPrograms
from ..errors import AT_SAMPLE, SingularityError
from ..spatial import Array
from .adjoint import Bars, ClosedAdjoint, called
from .blocks import Factored
from .kept import has_undriven
from .samples import Samples

if TYPE_CHECKING:
    import casadi as ca


#: Steps of Newton's method to efforts: one where accelerations are linear in them, and one that shows it.
STEPS = 30
#: Largest difference from accelerations, of the largest of their parts: rounding of ill-conditioned models.
EFFORTS_FOUND = 1e-10


class Pulled(NamedTuple):
    """Results of a model, shape (T, n), and derivatives over slots, (T, slots) or (T, n, slots)."""

    value: Array
    over: Array


class ModelSweeps:
    """Both models of a robot with their sweeps back."""

    def __init__(self, programs: RobotPrograms, closed: ClosedAdjoint) -> None:
        self._programs, self._closed, self._robot = programs, closed, programs.robot
        self._models: dict[str, ca.Function] = {}
        self._links: dict[str, ca.Function] = {}

    def model(self, name: str) -> ca.Function:
        """Return a model: from its arguments and weights to results, guard and derivatives of the sum."""
        import casadi as ca

        if name not in self._models:
            model = self._programs.function(name)
            given = [ca.SX.sym(model.name_in(i), model.size1_in(i)) for i in range(model.n_in())]
            results, guard = model.call(given)
            weights = ca.SX.sym("weights", results.numel())
            over = ca.gradient(ca.dot(weights, results), ca.vertcat(*given))
            self._models[name] = ca.Function(
                name, [*given, weights], [ca.vertcat(results, guard, over)],
                [*model.name_in(), "weights"], ["found"],
            )  # fmt: skip
        return self._models[name]

    def of_link(self, at: Samples, link: str, weights: Array) -> tuple[Bars, Array]:
        """Return the derivatives of a weighted sum of a link's motion, as `MeasureBars.links` has it.

        Returns:
            Those over the motion, and over slots at a motion that stays, shape (T, slots).
        """
        import casadi as ca

        if link not in self._links:
            motion = self._programs.link_motion(link)
            given = [ca.SX.sym("given", motion.size1_in(i)) for i in range(motion.n_in())]
            column = ca.SX.sym("weights", motion.size1_out(0))
            over = ca.gradient(ca.dot(column, motion.call(given)[0]), ca.vertcat(*given))
            self._links[link] = ca.Function("link", [*given, column], [over])
        found = called(self._links[link], at.q, at.v, at.x, at.slots, weights)
        nq, nv = self._robot.nq, self._robot.nv
        q_bar, v_bar, a_bar, slots = np.split(found, [nq, nq + nv, nq + 2 * nv], axis=1)
        return Bars(self._closed.freedoms(at.q, q_bar), v_bar, a_bar), slots

    def size(self, name: str) -> int:
        """Return the number of results of a model."""
        return len(self._robot.motors) if name == "idm" else self._robot.nv

    def each(self, at: Samples, factors: list[Factored], name: str) -> Pulled:
        """Return a model's results, and the derivatives of each of them over slots."""
        count = self.size(name)
        if not count:  # of a robot without motors
            return Pulled(np.zeros((len(at.q), 0)), np.zeros((len(at.q), 0, at.slots.shape[1])))
        unknown = np.zeros(count, dtype=bool) if name == "idm" else self._closed.undetermined(factors)
        weights = np.tile(np.diag(1.0 - unknown), (len(at.q), 1))
        repeated = [one for one in factors for _ in range(count)]
        caused = self.caused(at, name)
        caused = None if caused is None else np.repeat(caused, count, axis=0)
        value, over = self.summed(at.repeated(count), repeated, weights, name, caused=caused)
        over = over.reshape(len(at.q), count, -1)
        over[:, unknown] = np.nan
        return Pulled(value[::count], over)

    def summed(
        self,
        at: Samples,
        factors: list[Factored],
        weights: Array,
        name: str,
        motion: Bars | None = None,
        caused: Array | None = None,
    ) -> Pulled:
        """Return a model's results, and the derivatives of their weighted sum over slots.

        Args:
            at: The samples.
            factors: Their rows of loops.
            weights: Shape (T, n).
            name: "idm" or "ddm".
            motion: Derivatives of what is added to the sum over the motion, or None.
            caused: As `caused` returns it, for callers with several sums; None to compute it.

        Raises:
            SingularityError: A pivot of the model vanishes, or nothing determines the motion.
        """
        caused = self.caused(at, name) if caused is None else caused
        if caused is not None:
            return self._driven(at, factors, weights, motion, caused)
        value, by = self._run(at, weights, name)
        none = np.zeros((len(at.q), self._robot.nv))
        bars = Bars(self._closed.freedoms(at.q, by["q"]), by["v"], by.get("a", none))
        if motion is not None:
            bars = Bars(*(x + y for x, y in zip(bars, motion, strict=True)))
        return Pulled(value, by["parameters"] + self._closed.back(factors, at.numbers, bars))

    def mass_matrix(self, at: Samples, factors: list[Factored]) -> Pulled:
        """Return the mass matrix over the motors, (T, N, N), and its derivatives over slots, from rest."""
        T, N, u = len(at.q), len(self._robot.motors), self._robot.motor_v
        many, repeated = at.repeated(N), [one for one in factors for _ in range(N)]
        moved = np.zeros((T * N, self._robot.nv))
        moved[np.arange(T * N), np.tile(u, T)] = 1.0
        moved = self._closed.followed(repeated, many.q, many.slots, moved)
        pulled, still = self.each(many._replace(x=moved), repeated, "idm"), self.each(at, factors, "idm")
        M = (pulled.value.reshape(T, N, N) - still.value[:, None]).transpose(0, 2, 1)
        return Pulled(M, (pulled.over.reshape(T, N, N, -1) - still.over[:, None]).transpose(0, 2, 1, 3))

    def _run(self, at: Samples, weights: Array, name: str) -> tuple[Array, dict[str, Array]]:
        """Return a model's results, and the derivatives of their sum over each argument."""
        model, T = self.model(name), len(at.q)
        known = {
            "q": at.q, "v": at.v, "a": at.x, "tau": at.x, "parameters": at.slots, "weights": weights,
            "wrenches": at.wrenches, "base_acceleration": at.base,
        }  # fmt: skip
        sizes = {model.name_in(i): model.size1_in(i) for i in range(model.n_in())}
        given = [known.get(word, np.zeros((T, size))) for word, size in sizes.items()]
        ends = np.cumsum([weights.shape[1], 1, *sizes.values()])[:-1]
        value, guard, *over = np.split(called(model, *given), ends, axis=1)
        if not (guard <= GUARD_LIMIT).all():
            raise self._untrusted(name, guard[:, 0])
        return value, dict(zip(sizes, over, strict=False))

    def _untrusted(self, name: str, guard: Array) -> SingularityError:
        """Return the error of the first sample that a model does not trust."""
        t, others = int(np.argmax(~(guard <= GUARD_LIMIT))), []
        if self._programs.effects.loaded is not None:
            others.append(("friction that grows with load does not settle", "lower its coefficients"))
        if name == "idm" and has_undriven(self._robot):
            others.append(("a motion without a motor needs an effort", 'pass passive="solved"'))
        why, mend = ("".join(f", or {words[k]}" for words in others) for k in range(2))
        return SingularityError(
            f"a pivot of the compiled model nearly vanishes{why}{AT_SAMPLE} (guard {guard[t]:.1e}, "
            f"limit {GUARD_LIMIT:g}): there is no gradient; move the motion away from this posture{mend}",
            what="the model",
            sample=t,
        )

    def solved(self, at: Samples) -> Samples:
        """Return samples with the accelerations that those of the motors cause.

        Their efforts are found by Newton's method, in one step where accelerations are linear in them.

        Raises:
            SingularityError: They are not found.
        """
        u, tau = self._robot.motor_v, np.zeros((len(at.q), len(self._robot.motors)))
        for _ in range(STEPS):
            a, caused = self._caused(at, tau)
            lacking = at.x[:, u] - a[:, u]
            parts = np.einsum("tij,tj->ti", np.abs(caused), np.abs(tau)), np.abs(at.x[:, u])
            size = sum(part.max(axis=1, initial=0.0) for part in parts)
            off = np.abs(lacking).max(axis=1, initial=0.0)
            if (off <= EFFORTS_FOUND * size).all():
                return at._replace(x=a)
            tau = tau + [np.linalg.lstsq(one, x)[0] for one, x in zip(caused, lacking, strict=True)]
        t = int(np.argmax(off - EFFORTS_FOUND * size))
        raise SingularityError(
            f"no efforts cause the accelerations of the motors{AT_SAMPLE} (off by {off[t]:.1e}, limit "
            f"{EFFORTS_FOUND * size[t]:.1e}): motors lose a direction; move the motion away",
            what="the motors",
            sample=t,
        )

    def caused(self, at: Samples, name: str) -> Array | None:
        """Return accelerations of motors over efforts, (T, motors, motors), whatever is summed.

        None where no model asks for them.

        Raises:
            SingularityError: A pivot of a model vanishes.
        """
        if name != "idm" or not has_undriven(self._robot):
            return None
        tau, _ = self._run(at, np.zeros((len(at.q), len(self._robot.motors))), name)
        return self._caused(at, tau)[1]

    def _caused(self, at: Samples, tau: Array) -> tuple[Array, Array]:
        """Return accelerations of efforts, (T, nv), and those of motors over efforts, (T, motors, motors)."""
        T, N, u = len(at.q), len(self._robot.motors), self._robot.motor_v
        many = max(N, 1)
        each = np.zeros((T * many, self._robot.nv))
        each[np.arange(T * N), np.tile(u, T)] = 1.0
        a, by = self._run(at.repeated(many)._replace(x=np.repeat(tau, many, axis=0)), each, "ddm")
        return a[::many], by["tau"].reshape(T, N, N)

    def _driven(
        self, at: Samples, factors: list[Factored], weights: Array, motion: Bars | None, caused: Array
    ) -> Pulled:
        """Return `summed` of efforts at accelerations of the motors, from the direct model a(tau, p).

        d tau = -(d a_m / d tau)^-1 d a_m / dp       (m: motors)

        Accelerations of the other motions follow, and so does what is added of them.
        """
        T, u = len(at.q), self._robot.motor_v
        tau, _ = self._run(at, weights, "idm")
        if caused.size and (np.linalg.cond(caused) > 1.0 / SINGULAR_ROWS).any():
            raise SingularityError(
                "motors are redundant beside motions without a motor: efforts have no gradient; take 'ddm'",
                what="the motors",
            )
        spread = np.zeros((T, self._robot.nv))
        if motion is not None:
            spread, motion = motion.a.copy(), motion._replace(a=np.zeros(motion.a.shape))
            weights = weights + self._run(at._replace(x=tau), spread, "ddm")[1]["tau"]
        spread[:, u] -= np.linalg.solve(caused.transpose(0, 2, 1), weights[:, :, None])[:, :, 0]
        return Pulled(tau, self.summed(at._replace(x=tau), factors, spread, "ddm", motion).over)
