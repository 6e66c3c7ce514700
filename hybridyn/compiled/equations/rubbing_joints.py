"""Joints of a module with friction that grows with load, and the terms of its law."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from ...effects.load_friction import OnLoads, against
from ...errors import ModelError
from ...spatial import Array, numpy_on_symbols
from ...structure.module import Module
from ...structure.parameters.slots import Slot
from ...symbols import Expression
from .coefficients import friction_slots
from .expressions import filled, snap
from .parts import Parts

#: Entries of constant directions nearer to 0, 1 or -1 than this differ from them by rounding.
ROUNDED_PART = 1e-14


class Argument(NamedTuple):
    """A number that is an argument of the models.

    Attributes:
        place: Its place in the input "parameters".
        less: What is taken from it.
    """

    place: int
    less: float = 0.0


class LoadTerm(NamedTuple):
    """What one term of the law takes from the wrench of its joint, in the joint's child frame.

    Attributes:
        factor: Its coefficient: a number, an expression, or the place of an argument.
        part: Orthogonal directions of wrenches, shape (k, 6), k up to 3; their length counts.
    """

    factor: Any
    part: tuple[tuple[float, ...], ...]


class Rubbing(NamedTuple):
    """A joint of a module with friction that grows with its load.

    Attributes:
        joint: Its number in the whole tree.
        cols: Its freedoms in the tree after the cuts.
        terms: Those of the law.
        rise, speed, width: By how much friction is larger at rest, its Stribeck velocity, and `width`: each
            like a term's factor.
    """

    joint: int
    cols: tuple[int, ...]
    terms: tuple[LoadTerm, ...]
    rise: Any
    speed: Any
    width: Any

    def effort(self, v: Expression) -> Expression:
        """Compute the efforts over its freedoms per unit of friction at their rates v."""
        with numpy_on_symbols():
            return filled(against(v, self.width, self.rise, self.speed), len(v))


def rubbing_marks(law: OnLoads, module: Module) -> dict[int, str]:
    """Return what equal legs have in common, by the number of each joint that rubs in the whole tree."""
    out, in_whole = dict[int, str](), module.mechanism.spec.in_whole
    for n, name in enumerate(law.joints):
        if name in module.joints:
            words = [word for word, joint in zip(law.words, law.of_joint, strict=True) if joint == n]
            out[in_whole[module.joints.index(name)]] = f"rubs {words} {law.rise[n] > 0} "
    return out


def rubbing_joints(
    law: OnLoads | None, module: Module, parts: Parts, slots: Sequence[Slot]
) -> tuple[Rubbing, ...]:
    """Return the joints of a module on which friction that grows with load acts: of its core, of its legs.

    Args:
        slots: Numbers of the description that are arguments.

    Raises:
        ModelError: Friction acts along an idle motion, or inside a wrist that carries a platform.
    """
    out = list[Rubbing]()
    spec, tree = module.mechanism.spec, module.mechanism.tree
    idle = {col for motion in parts.all_idle for col in motion.cols}
    for n, name in enumerate(() if law is None else law.joints):
        if law is None or name not in module.joints:
            continue
        joint = spec.in_whole[module.joints.index(name)]
        cols = tuple(range(*tree.v_slices[joint].indices(tree.nv))) if joint < len(spec.tree) else ()
        if not cols or idle.intersection(cols):
            where = "an idle motion turns it" if cols else "it is in a wrist that carries a platform"
            raise ModelError(
                f"the effect '{law.effect.name}' cannot be compiled on joint '{name}': {where}. Use the "
                "general path for it", element=name,
            )  # fmt: skip
        *own, static, speed, width = friction_slots(law, name)
        part = [_in_aligned(law.part[k], parts.turns[joint + 1]) for k in np.flatnonzero(law.of_joint == n)]
        factor = law.factor[law.of_joint == n].tolist()
        terms = tuple(
            LoadTerm(_given(slots, slot, x), one) for slot, x, one in zip(own, factor, part, strict=True)
        )
        out.append(Rubbing(
            joint, cols, terms, _given(slots, static, float(law.rise[n]), 1.0),
            _given(slots, speed, float(law.speed[n])), _given(slots, width, float(law.effect.width)),
        ))  # fmt: skip
    legs = [joint for group in parts.groups for leg in group for joint in leg.links]
    order = [*parts.links, *legs]
    return tuple(sorted(out, key=lambda one: order.index(one.joint)))


def _given(slots: Sequence[Slot], slot: Slot, number: float, less: float = 0.0) -> Any:
    """Return a number of the law, as an argument if its slot is one."""
    return Argument(slots.index(slot), less) if slot in slots else number


def argued(rubbing: Sequence[Rubbing]) -> bool:
    """Return whether a number is an argument."""
    numbers = (x for one in rubbing for x in (*one[3:], *(term.factor for term in one.terms)))
    return any(isinstance(x, Argument) for x in numbers)


def with_arguments(rubbing: Sequence[Rubbing], column: ca.SX | None) -> tuple[Rubbing, ...]:
    """Return joints with the arguments among their numbers as expressions.

    Args:
        column: Symbols of all arguments, or None without any.
    """

    def filled_in(x: Any) -> Any:
        """Return a number, as an expression where it is an argument."""
        return column[x.place] - x.less if column is not None and isinstance(x, Argument) else x

    return tuple(
        Rubbing(
            one.joint, one.cols, tuple(LoadTerm(filled_in(term.factor), term.part) for term in one.terms),
            *map(filled_in, one[3:]),
        )
        for one in rubbing
    )  # fmt: skip


def of_core(rubbing: Sequence[Rubbing], parts: Parts) -> list[Rubbing]:
    """Return the joints of the core that rub, which come before those of the legs."""
    return [one for one in rubbing if one.joint in parts.links]


def of_legs(rubbing: Sequence[Rubbing], parts: Parts) -> list[list[tuple[Rubbing, ...]]]:
    """Return the joints of each leg that rub, by group."""
    return [
        [tuple(one for one in rubbing if one.joint in leg.links) for leg in group] for group in parts.groups
    ]


def _in_aligned(part: Array, T: Array) -> tuple[tuple[float, ...], ...]:
    """Return what a term takes from a wrench in the axes T of the body, without rows of zeros."""
    out = snap(T.T @ part @ np.kron(np.eye(2), T), ROUNDED_PART)  # so that equal legs have equal ones
    return tuple(tuple(row.tolist()) for row in out if row.any())


def terms_of(rubbing: Sequence[Rubbing]) -> list[tuple[int, Any, int]]:
    """Return the number of its joint, the factor and the number of rows of each term."""
    return [(i, term.factor, len(term.part)) for i, one in enumerate(rubbing) for term in one.terms]


def rows_of_terms(rubbing: Sequence[Rubbing], rows: Expression) -> list[Expression]:
    """Split what all terms take, shape (rows, ...), by term."""
    ends = np.cumsum([size for _, _, size in terms_of(rubbing)])
    return np.split(rows, ends[:-1])
