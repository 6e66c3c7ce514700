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

if TYPE_CHECKING:
    import casadi as ca


class Samples(NamedTuple):
    """Samples of a motion and a design.

    Attributes:
        q, v: Positions and rates, shapes (T, nq), (T, nv).
        x: Accelerations, shape (T, nv), or efforts, shape (T, motors).
        slots: Numbers in slots, shape (T, slots).
        p: The parameters, shape (k,).
        single: Whether the input was one sample.
    """

    q: Array
    v: Array
    x: Array
    slots: Array
    p: Array
    single: bool

    @property
    def numbers(self) -> tuple[Array, Array, Array, Array]:
        """The arguments of the rows of loops; where efforts are given, accelerations do not matter."""
        a = self.x if self.x.shape == self.v.shape else np.zeros(self.v.shape)
        return self.q, self.v, a, self.slots

    def repeated(self, count: int) -> Samples:
        """Return each sample a number of times."""
        q, v, x, slots = (np.repeat(one, count, axis=0) for one in self[:4])
        return Samples(q, v, x, slots, self.p, self.single)


class Pulled(NamedTuple):
    """Results of a model, shape (T, n), and derivatives over slots, (T, slots) or (T, n, slots)."""

    value: Array
    over: Array


class ModelSweeps:
    """Both models of a robot with their sweeps back."""

    def __init__(self, programs: RobotPrograms, closed: ClosedAdjoint) -> None:
        self._programs, self._closed, self._robot = programs, closed, programs.robot
        self._models: dict[str, ca.Function] = {}

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

    def size(self, name: str) -> int:
        """Return the number of results of a model."""
        return len(self._robot.motors) if name == "idm" else self._robot.nv

    def each(self, at: Samples, factors: list[Factored], name: str) -> Pulled:
        """Return a model's results, and the derivatives of each of them over slots."""
        count = self.size(name)
        unknown = np.zeros(count, dtype=bool) if name == "idm" else self._closed.undetermined(factors)
        weights = np.tile(np.diag(1.0 - unknown), (len(at.q), 1))
        repeated = [one for one in factors for _ in range(count)]
        value, over = self.summed(at.repeated(count), repeated, weights, name)
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
    ) -> Pulled:
        """Return a model's results, and the derivatives of their weighted sum over slots.

        Args:
            at: The samples.
            factors: Their rows of loops.
            weights: Shape (T, n).
            name: "idm" or "ddm".
            motion: Derivatives of what is added to the sum over the motion, or None.

        Raises:
            SingularityError: A pivot of the model vanishes, or nothing determines the motion.
        """
        if name == "idm" and has_undriven(self._robot):
            return self._driven(at, factors, weights, motion)
        value, by = self._run(at, weights, name)
        none = np.zeros((len(at.q), self._robot.nv))
        bars = Bars(self._closed.freedoms(at.q, by["q"]), by["v"], by.get("a", none))
        if motion is not None:
            bars = Bars(*(x + y for x, y in zip(bars, motion, strict=True)))
        return Pulled(value, by["parameters"] + self._closed.back(factors, at.numbers, bars))

    def _run(self, at: Samples, weights: Array, name: str) -> tuple[Array, dict[str, Array]]:
        """Return a model's results, and the derivatives of their sum over each argument."""
        model, T = self.model(name), len(at.q)
        known = {"q": at.q, "v": at.v, "a": at.x, "tau": at.x, "parameters": at.slots, "weights": weights}
        sizes = {model.name_in(i): model.size1_in(i) for i in range(model.n_in())}
        given = [known.get(word, np.zeros((T, size))) for word, size in sizes.items()]
        ends = np.cumsum([weights.shape[1], 1, *sizes.values()])[:-1]
        value, guard, *over = np.split(called(model, *given), ends, axis=1)
        if not (guard <= GUARD_LIMIT).all():
            t = int(np.argmax(~(guard[:, 0] <= GUARD_LIMIT)))
            loaded = self._programs.effects.loaded is not None
            why = ", or friction that grows with load does not settle" if loaded else ""
            mend = ", or lower its coefficients" if loaded else ""
            raise SingularityError(
                f"a pivot of the compiled model nearly vanishes{why}{AT_SAMPLE} (guard {guard[t, 0]:.1e}, "
                f"limit {GUARD_LIMIT:g}): there is no gradient; move the motion away from this posture{mend}",
                what="the model",
                sample=t,
            )
        return value, dict(zip(sizes, over, strict=False))

    def _driven(self, at: Samples, factors: list[Factored], weights: Array, motion: Bars | None) -> Pulled:
        """Return `summed` of efforts at accelerations of the motors, from the direct model a(tau, p).

        d tau = -(d a_m / d tau)^-1 d a_m / dp       (m: motors)
        """
        T, N, u = len(at.q), len(self._robot.motors), self._robot.motor_v
        tau, _ = self._run(at, weights, "idm")
        each = np.zeros((T * N, self._robot.nv))
        each[np.arange(T * N), np.tile(u, T)] = 1.0
        _, by = self._run(at.repeated(N)._replace(x=np.repeat(tau, N, axis=0)), each, "ddm")
        caused = by["tau"].reshape(T, N, N).transpose(0, 2, 1)  # by one effort a row
        if (np.linalg.cond(caused) > 1.0 / SINGULAR_ROWS).any():
            raise SingularityError(
                "motors are redundant beside motions without a motor: efforts have no gradient; take 'ddm'",
                what="the motors",
            )
        spread = np.zeros((T, self._robot.nv))
        spread[:, u] = -np.linalg.solve(caused, weights[:, :, None])[:, :, 0]
        return Pulled(tau, self.summed(at._replace(x=tau), factors, spread, "ddm", motion).over)
