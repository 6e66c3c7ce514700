"""Laws of other packages: whether their classes and their numbers can be used."""

from __future__ import annotations

import inspect
import re
from collections.abc import Collection
from typing import Any

import numpy as np

from ..errors import ModelError
from ..extensions import refused, running
from ..spatial import Array
from ..structure.robot import HybridRobot
from .joint_laws import RotorInertia
from .joints import JointEffect, OnJoints
from .link_effect import LinkEffect, Moving

#: The package of hybridyn's own laws.
OWN = __name__.partition(".")[0]
#: Rates next to rest, between which a law does not jump, and ordinary ones [m/s or rad/s].
TRIED_RATES = (1e-12, -1e-12, 1.0, -1.0)
#: Part of its efforts at ordinary rates by which a law may change between rates next to rest: one that is
#: smooth over 1e-6 m/s changes by a millionth.
JUMP = 1e-3
#: Distance from home at which a law is checked to be linear in its numbers [m or rad], and the part of the
#: largest effort that sums may round off.
ASIDE, ROUNDING = 0.3, 1e-9


def is_other(law: type[Any]) -> bool:
    """Return whether a class of laws belongs to another package."""
    return issubclass(law, JointEffect | LinkEffect) and law.__module__.partition(".")[0] != OWN


def package_of(law: type[Any]) -> str:
    """Return the package of a class of laws."""
    return str(law.__module__).partition(".")[0]


def needs_nothing(law: type[Any]) -> bool:
    """Return whether a law can be made without numbers."""
    every = inspect.signature(law).parameters.values()
    return all(
        one.default is not one.empty or one.kind in (one.VAR_POSITIONAL, one.VAR_KEYWORD) for one in every
    )


def check_class(law: type[Any], own: Collection[str]) -> None:
    """Check the class of a law of another package.

    Args:
        law: The class.
        own: Names of the effects of hybridyn.

    Raises:
        ModelError: It has no name of its own, or no law.
    """
    name, package = getattr(law, "name", None), package_of(law)
    if not isinstance(name, str) or not re.fullmatch(r"[A-Za-z]\w*", name):
        raise ModelError(
            f"the effect {law.__name__} of the package '{package}' has no name: give the class a line such "
            'as  name: ClassVar[str] = "magnet"', element=law.__name__,
        )  # fmt: skip
    if name in own:
        raise refused("effects", name, package, "has the name of an effect of hybridyn's own; rename it")
    if issubclass(law, JointEffect):
        if law.effort is JointEffect.effort and not issubclass(law, RotorInertia):
            raise refused("effects", name, package, "has no law: write effort(p, x, v)")
        if law.numbers is JointEffect.numbers and not getattr(law, "by_joint", ()):
            raise refused("effects", name, package, "names no field with numbers: set by_joint")
        return
    if law.wrench_on is LinkEffect.wrench_on and (law.of_motion or law.wrenches is LinkEffect.wrenches):
        raise refused("effects", name, package, "has no law: write wrench_on(link, motions)")
    if law.links is LinkEffect.links:
        raise refused("effects", name, package, "acts on no link: write the property links")


def check_law(law: OnJoints, robot: HybridRobot) -> None:
    """Check a law of joints of another package at the home posture, at rest.

    Raises:
        ModelError: An error of its code, a wrong shape, a number that is not finite, or a jump at rest.
    """
    name, package = law.effect.name, package_of(type(law.effect))
    q, rest = robot.home[None], np.zeros((1, len(law.columns)))
    x = law.positions(q)
    with running("effects", name, package), np.errstate(all="ignore"):  # what is not finite is told below
        forwards, backwards, *fast = (law.effect.effort(law.p, x, rest + v) for v in TRIED_RATES)
        every = {
            "effort": forwards,
            "energy": law.effect.energy(law.p, x),
            "power": law.effect.power(law.p, x, rest),
        }
    for what, value in every.items():
        if np.shape(value) != rest.shape:
            raise refused(
                "effects", name, package,
                f"returns an {what} of shape {np.shape(value)} for positions of shape {rest.shape}",
            )  # fmt: skip
        if not np.isfinite(value).all():
            at = law.joints[0]
            raise refused("effects", name, package, f"has an {what} that is not finite at home ('{at}')")
    _check_linear(law, x)
    size = np.maximum(*np.abs(fast))
    if (np.abs(forwards - backwards) > JUMP * size).any():
        raise refused(
            "effects", name, package,
            f"jumps at rest, from {backwards.min():.3g} to {forwards.max():.3g}: no integrator follows it. "
            "Smooth it, as with tanh(v / width)",
        )  # fmt: skip


def check_link_law(law: LinkEffect) -> None:
    """Check what a law of links of another package returns, for links apart from one another.

    Raises:
        ModelError: An error of its code, or a wrong shape.
    """
    name, package, rest = law.name, package_of(type(law)), np.zeros((3, 1))
    axes = np.eye(3)[..., None]
    apart = {link: Moving(axes, rest + i + 1.0, rest + 0.1, rest + 0.1) for i, link in enumerate(law.links)}
    for link in law.links if law.of_motion else ():
        with running("effects", name, package), np.errstate(all="ignore"):
            parts = law.wrench_on(link, {other: apart[other] for other in law.watched(link)})
            shapes = [np.broadcast_arrays(*part, np.zeros(1))[:-1] for part in parts]
        if [len(shape) for shape in shapes] != [3, 3]:
            raise refused("effects", name, package, "returns no force and moment of three numbers each")


def _check_linear(law: OnJoints, x: Array) -> None:
    """Check that the effort is linear in the numbers that the law has symbols for.

    Raises:
        ModelError: It is not.
    """
    effect, count = law.effect, len(law.effect.symbols)
    if not count:
        return
    x, v = x + ASIDE, np.ones_like(x)
    units = [[np.full(len(x[0]), float(i == n)) for i in range(count)] for n in range(count)]
    parts = [law.p[n] * effect.effort([*units[n], *law.p[count:]], x, v) for n in range(count)]
    whole = effect.effort(law.p, x, v)
    if not (np.abs(sum(parts) - whole) <= ROUNDING * np.abs([*parts, whole]).max()).all():
        raise refused(
            "effects", effect.name, package_of(type(effect)),
            f"is not linear in {', '.join(effect.symbols)}: take from symbols what it is not linear in",
        )  # fmt: skip
