"""Laws of forces on symbols: they are NumPy code that runs on expressions, or are refused."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import casadi as ca
import numpy as np

from ...effects.joints import OnJoints
from ...effects.link_effect import LinkEffect, Moving
from ...effects.others import is_other, package_of
from ...effects.tendons import OnTendons
from ...errors import HybridynError, ModelError
from ...extensions import refused
from ...linkage.motion import Motion
from ...spatial import cross, numpy_on_symbols
from ...structure.robot import HybridRobot
from ...symbols import Expression, dot
from ..equations.expressions import numbers, pack, symbols
from .general import WIDTH, motion_of

#: Symbols of the motions of bodies, and a wrench.
Written = tuple[list[ca.SX], ca.SX]
#: Frames of links in their bodies, as `Bodies.place`.
Watched = Mapping[str, tuple[int, Expression, Expression]]


@contextmanager
def on_symbols(effect: Any) -> Iterator[None]:
    """Run a law's NumPy code on symbols.

    Raises:
        ModelError: It does not run on them.
    """
    try:
        with numpy_on_symbols():
            yield
    except HybridynError:
        raise
    except Exception as error:  # whatever code on symbols raises
        if not is_other(type(effect)):
            raise ModelError(
                f"the effect '{effect.name}' cannot be compiled: use the general path for it",
                element=effect.name,
            ) from error
        raise refused(
            "effects", effect.name, package_of(type(effect)),
            f"does not run on symbols ({type(error).__name__}: {error}): write it with functions of NumPy "
            "that take one number each, without 'if' on them, or use the general path",
        ) from error  # fmt: skip


def written_effort(law: OnJoints | OnTendons, i: int, p: ca.SX, x: ca.SX, v: ca.SX) -> Any:
    """Return the effort of a law on its freedom i as an expression."""
    with on_symbols(law.effect):
        return law.written(i, *(tuple(s[n] for n in range(s.numel())) for s in (p, x, v)))


def bodies_of(watched: Watched) -> tuple[list[ca.SX], dict[str, Motion]]:
    """Return columns of symbols, and the motions of the links' bodies that they stand for."""
    pairs = [symbols(f"motion {i}", WIDTH) for i in range(len(watched))]
    motions = {link: motion_of(motion) for link, (_, motion) in zip(watched, pairs, strict=True)}
    return [column for column, _ in pairs], motions


def moving(body: Motion, R: Expression, p: Expression) -> Moving:
    """Return the motion of a frame of a body in the world; R (3, 3) and p (3,) are its placement there."""
    axes, arm = (dot(body.R, numbers(x)) for x in (R, p))
    return Moving(axes, body.p + arm, body.p_dot + cross(body.w, arm), body.w)


def written_wrench(link: str, law: LinkEffect, watched: Watched) -> Written:
    """Return the wrench of a law on a link, in its body's frame, from the motion of bodies."""
    columns, bodies = bodies_of(watched)
    motions = {name: moving(bodies[name], R, p) for name, (_, R, p) in watched.items()}
    with on_symbols(law):
        force, moment = (np.array([*part], dtype=object) for part in law.wrench_on(link, motions))
        if {force.shape, moment.shape} != {(3,)}:
            raise ValueError(f"force and moment have the shapes {force.shape} and {moment.shape}, not (3,)")
        own, turning = (dot(bodies[link].R.T, x) for x in (force, moment))
        about = turning + cross(numbers(watched[link][2]), own)
        return columns, pack(np.concatenate([own, about]))


def text_of(
    robot: HybridRobot, laws: Sequence[OnJoints | OnTendons], wrenches: Sequence[LinkEffect]
) -> list[bytes]:
    """Return what determines laws in a robot's models: their expressions, and the numbers in these.

    Raises:
        ModelError: A law does not run on symbols.
    """
    out = []
    for law in laws:
        for i, column in enumerate(law.columns):
            p, (x, v) = ca.SX.sym("p", len(law.p)), (ca.SX.sym("x", len(at)) for at in law.reads(i))
            effort = ca.SX(written_effort(law, i, p, x, v))
            numbers_of = [float(row[i]) for row in law.p]
            out.append(repr((int(column), [at.tolist() for at in law.reads(i)], numbers_of)).encode())
            out.append(ca.Function("law", [p, x, v], [effort]).serialize().encode())
    for acting in wrenches:
        for link in acting.links:
            watched = {name: robot.bodies.place[name] for name in acting.watched(link)}
            columns, wrench = written_wrench(link, acting, watched)
            out.append(ca.Function("law", columns, [wrench]).serialize().encode())
            out.append(repr((link, [*watched])).encode())
    return out
