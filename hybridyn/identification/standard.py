"""The records of standard parameters: their names, numbers, and what each belongs to."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ..description.names import did_you_mean
from ..effects.choice import Effects
from ..effects.joints import OnJoints
from ..errors import ModelError
from ..spatial import Array, Index
from ..structure.bodies import Payload


@dataclass(frozen=True, eq=False)
class Term:
    """A number of a law, for each of the law's joints.

    Attributes:
        symbol: Symbol of the number.
        law: The law on its joints, or None for offsets of motors.
        number: Which of the law's numbers it is.
        joints: Joint of each freedom.
        columns: Parameter of each freedom, shape (k,).
        freedoms: Index of each freedom in v, shape (k,).
    """

    symbol: str
    law: OnJoints | None
    number: int
    joints: tuple[str, ...]
    columns: Index
    freedoms: Index

    def efforts(self, q: Array, v: Array, a: Array) -> Array:
        """Compute the effort along each freedom per unit of its number, shape (T, k)."""
        if self.law is None:
            return np.ones((len(q), len(self.freedoms)))
        if self.symbol == "Ia":
            return a[:, self.freedoms]
        linear = len(self.law.effect.symbols)
        p = [
            np.full(len(self.freedoms), float(i == self.number)) if i < linear else numbers
            for i, numbers in enumerate(self.law.p)
        ]
        return -self.law.effect.effort(p, self.law.positions(q), v[:, self.freedoms])


@dataclass(frozen=True, eq=False)
class StandardParameters:
    """The standard parameters of a robot under some effects.

    Attributes:
        names: Name of each, such as "m of rod1"; of several equal legs, that of the first.
        values: The robot's own numbers, shape (p,), SI units.
        effects: The effects, as the models compute them.
        bodies: The ten parameters of each body, by the body's number, shape (10,).
        payloads: The ten parameters of each payload of `robot.payloads`, and its body.
        terms: The numbers of laws and the offsets.
        loads: The payloads themselves, in the order of `payloads`.
        centres: By the first of ten parameters, the centre of mass in the file of what these belong to: the
            payload, or the link that a body is called by; in the body's frame, shape (3,), [m].
    """

    names: tuple[str, ...]
    values: Array
    effects: Effects
    bodies: dict[int, Index]
    payloads: tuple[tuple[int, Index], ...] = ()
    terms: tuple[Term, ...] = ()
    loads: tuple[Payload, ...] = ()
    centres: dict[int, Array] = field(default_factory=dict)

    @property
    def tens(self) -> list[Index]:
        """The ten parameters of each body and of each payload, shape (10,); those that are shared once."""
        every = (*self.bodies.values(), *(at for _, at in self.payloads))
        return list({tuple(at): at for at in every}.values())

    def vector(self, values: Mapping[str, float] | Array) -> Array:
        """Return all parameters, shape (p,), from some by name or from all.

        Raises:
            ModelError: A name is unknown, or the number of values is wrong.
        """
        if not isinstance(values, Mapping):
            out = np.asarray(values, dtype=float)
            if out.shape != self.values.shape or not np.isfinite(out).all():
                raise ModelError(f"values must be {len(self.values)} finite numbers, one per parameter")
            return out
        out = self.values.copy()
        for name, value in values.items():
            if name not in self.names:
                raise ModelError(f"there is no parameter '{name}'{did_you_mean(name, self.names)}")
            out[self.names.index(name)] = value
        return out
