"""One robot's written-out inverse models for many sets of effects, each built where it is first asked for."""

from __future__ import annotations

import re

import numpy as np

from ..compiled.compiling import compile
from ..compiled.model import CompiledRobot
from ..dynamics.in_blocks import efforts_in_blocks
from ..effects.choice import Effects
from ..errors import CompileError, HybridynError
from ..spatial import Array


class EffectSets:
    """Inverse models of one robot, by effects.

    Attributes:
        refused: Why sets of effects are left to the general path, by the names of their effects.
    """

    def __init__(self, whole: CompiledRobot) -> None:
        """Start with one model.

        Args:
            whole: The model with every effect that is ever asked for.
        """
        self._whole = whole
        self._models: dict[tuple[str, ...], CompiledRobot] = {whole.effects.names: whole}
        self.refused: dict[tuple[str, ...], str] = {}

    def __len__(self) -> int:
        """Return how many models were built."""
        return len(self._models)

    @property
    def recomputed(self) -> int:
        """How many samples the general path had to compute, counted in every model."""
        return sum(model.recomputed for model in self._models.values())

    def idm(self, q: Array, v: Array, a: Array, on: Effects) -> Array:
        """Return motor efforts, as `hybridyn.idm` does.

        What holds a robot without inertia is what holds one with inertia that is at rest, so sets without
        inertia need no model of their own.

        Args:
            q: Positions, shape (T, nq).
            v: Rates, shape (T, nv), [m/s, rad/s].
            a: Accelerations, shape (T, nv), [m/s^2, rad/s^2].
            on: Some of the effects.

        Returns:
            Efforts, shape (T, motors), [N or N m].

        Raises:
            HybridynError: What `hybridyn.idm` raises, with the same words.
            CompileError: A model differs from the general path.
        """
        names = on.names
        if on.inertia is None and not on.joints:
            if on.gravity is None:
                return np.zeros((len(q), len(self._whole.robot.motors)))
            names = self._whole.effects.only({*on.names, "inertia"}).names
            v, a = np.zeros_like(v), np.zeros_like(a)
        model = self._model(names)
        if model is None:
            return efforts_in_blocks(self._whole.robot, q, v, a, self._whole.effects.only(names))
        out: Array = model.idm(q, v, a)
        return out

    def _model(self, names: tuple[str, ...]) -> CompiledRobot | None:
        """Return the model of some effects; None where it cannot be written out.

        A robot whose direct model is undefined without the legs' inertia, say, has none: there is nothing to
        check it against.
        """
        if names not in self._models and names not in self.refused:
            try:
                self._models[names] = compile(self._whole.robot, self._whole.effects.only(names))
            except CompileError:
                raise
            except HybridynError as error:
                self.refused[names] = re.sub(r" at sample \d+\b", "", str(error))  # a random one
        return self._models.get(names)
