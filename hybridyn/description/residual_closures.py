"""Functions of other packages as closures: a residual of joint positions and frames, r(x1, x2, ...) = 0.

CasADi derives a residual, which is written on symbols once; its text is kept, and determines the closure.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..errors import ModelError, required
from ..extensions import Extension, added, refused, running
from ..spatial import numpy_on_symbols
from .residual_frames import joints_of_frames, placement_of
from .residuals import Residual

if TYPE_CHECKING:
    from .records import Joint

#: Operations of CasADi without two derivatives.
NOT_SMOOTH = (
    "SIGN", "FLOOR", "CEIL", "FMOD", "REMAINDER", "LT", "LE", "EQ", "NE", "NOT", "AND", "OR", "IF_ELSE_ZERO",
    "FABS", "FMIN", "FMAX", "COPYSIGN",
)  # fmt: skip


class ResidualMaker(NamedTuple):
    """A closure that a package adds.

    Attributes:
        make: Computes the residual, from the joints' positions and the numbers of the file.
        name: Its name.
        package: Its package.
    """

    make: Callable[..., Any]
    name: str
    package: str

    def refused(self, why: str) -> ModelError:
        """Return the error for a residual that cannot be used."""
        return refused("closures", self.name, self.package, why)


def checked_closure(found: Extension) -> ResidualMaker:
    """Return the closure that a package adds.

    Raises:
        ModelError: It is no function.
    """
    if not callable(found.value):
        raise found.refused("closures", f"is {found.value!r}, no function of positions and numbers")
    return ResidualMaker(found.value, found.name, found.package)


def _one_number(maker: ResidualMaker, found: Any) -> Any:
    """Return a residual on symbols; refuse what is not one number."""
    import casadi as ca

    try:
        count = found.numel() if isinstance(found, ca.SX) else np.size(found)
        r = ca.SX(found) if count == 1 else None
    except (TypeError, ValueError, NotImplementedError):  # of CasADi and NumPy: no numbers
        why = f"returns {str(found)[:40]}: a residual is one number"
        raise maker.refused(why) from None
    if r is None:
        raise maker.refused(f"returns {count} numbers: a residual is one")
    if _has_nan(ca.Function("r", ca.symvar(r), [r])):
        why = "is not a number on symbols: take NumPy's functions, not math's"
        raise maker.refused(why)
    return r


def _has_nan(function: Any) -> bool:
    """Whether a constant is not a number, as what Python's math makes of a symbol."""
    import casadi as ca

    steps = (i for i in range(function.n_instructions()) if function.instruction_id(i) == ca.OP_CONST)
    return any(np.isnan(function.instruction_constant(i)) for i in steps)


def residual(
    closure: str, joints: Sequence[str], numbers: Mapping[str, Any], zeros: Mapping[str, float],
    frames: Sequence[str] = (), tree: Sequence[Joint] = (),
) -> Residual:  # fmt: skip
    """Write a closure of a package for some joints and frames.

    Args:
        closure: Its name.
        joints: The joints whose positions it takes, in order.
        numbers: What its file states for it.
        zeros: By joint, what is added to its position.
        frames: Links; it takes the placement of each but the first in the first one, after the positions.
        tree: All joints of the robot, for the frames.

    Raises:
        HybridynError: CasADi is not installed.
        ModelError: The closure's code fails on symbols, it is no smooth number, or lacks a joint; a joint
            between frames has several freedoms, or none moves.
    """
    maker: ResidualMaker = added("closures", closure)
    ca = required("casadi", "compiled", f"the closure '{closure}' of the package '{maker.package}'")
    stated = [(joint, ca.SX.sym(joint)) for joint in joints]
    carried = [(joint, ca.SX.sym(joint)) for joint in _moving(maker, frames, tree)]
    places = [placement_of(tree, frames[0], link, dict(carried)) for link in frames[1:]]
    r = _one_number(maker, _made(maker, [*(x for _, x in stated), *places], numbers))
    idle = [joint for joint, one in stated if ca.gradient(r, one).is_zero()]
    carried = [(joint, one) for joint, one in carried if not ca.gradient(r, one).is_zero()]
    unseen = maker.refused(f"does not depend on the frames {', '.join(frames)}")
    if idle:
        raise maker.refused(f"does not depend on joint '{idle[0]}'")
    if frames and not carried:
        raise unseen
    x = [one for _, one in (*stated, *carried)]
    column = ca.vertcat(*x)
    gradient = ca.densify(ca.gradient(r, column))
    hessian = ca.densify(ca.jacobian(gradient, column))
    entries = [hessian[i, j] for i in range(len(x)) for j in range(len(x))]
    _check_smooth(maker, ca.Function("r", x, [r]))
    written = ca.Function("residual", x, [r, *ca.vertsplit(gradient), *entries]).serialize()
    terms = tuple((joint, 1.0) for joint, _ in (*stated, *carried))
    added_to = (*(zeros.get(joint, 0.0) for joint in joints), *(0.0 for _ in carried))
    made = Residual(terms, closure, (*numbers.items(),), added_to, written, (*frames,), len(joints))
    if frames and not any(size for _, size in made.sizes):  # slopes cancel in numbers alone
        raise unseen
    return made


def _moving(maker: ResidualMaker, frames: Sequence[str], tree: Sequence[Joint]) -> list[str]:
    """Return the joints between frames that move.

    Raises:
        ModelError: One has several freedoms, or there is none.
    """
    moving = [joint for joint in joints_of_frames(tree, frames).values() if joint.kind != "fixed"]
    for joint in moving:
        if not joint.kind.single:
            why = (
                f"cannot have the frames {', '.join(frames)}: joint '{joint.name}' between them is "
                f"{joint.kind}, and joints between frames have one freedom; write it as hinges and slides"
            )
            raise maker.refused(why)
    if frames and not moving:
        why = f"has frames that no joint moves: {', '.join(frames)}"
        raise maker.refused(why)
    return [joint.name for joint in moving]


def _made(maker: ResidualMaker, x: Sequence[Any], numbers: Mapping[str, Any]) -> Any:
    """Return what a closure of a package makes of the symbols x of its joints.

    Raises:
        ModelError: Its code fails on symbols.
    """
    with running("closures", maker.name, maker.package), numpy_on_symbols():
        return maker.make(x, **numbers)


def _check_smooth(maker: ResidualMaker, function: Any) -> None:
    """Check that a residual has two derivatives.

    Raises:
        ModelError: It has a kink or a jump.
    """
    import casadi as ca

    used = {function.instruction_id(i) for i in range(function.n_instructions())}
    if bent := [name for name in NOT_SMOOTH if getattr(ca, f"OP_{name}", None) in used]:
        raise maker.refused(
            f"is not smooth ({bent[0].lower()}): loops are followed by two derivatives of the residual"
        )
