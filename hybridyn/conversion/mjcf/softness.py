"""Choose MuJoCo's time step and how its equalities act, so that closures stay as tight as the user asks.

MuJoCo pulls a closure shut like a critically damped spring with time constant T. Where the links of a closure
would part with acceleration c without it, it opens by about c T^2. Equalities are as hard as MuJoCo allows,
so that the load on a closure adds little to this. The time step is T / 2, the longest that MuJoCo takes.
"""

from __future__ import annotations

import math
from typing import NamedTuple
from xml.etree import ElementTree as ET

from ...description.records import Description
from ..numerals import numeral, numerals

#: Acceleration at which closures stay as tight as asked, relative to gravity: a robot that falls freely.
FREE_FALL = 10.0
#: Gravity where the robot has none [m/s^2].
EARTH = 9.81
#: Impedance of equalities, the largest that MuJoCo takes.
HARDEST = 0.9999
#: Longest time step [s]; slower motions than those of the closures need to be followed, too.
LONGEST_STEP = 1e-3
#: Part of a unit by which a step of two digits may miss it.
TWO_DIGITS = 1e-9


class Softness(NamedTuple):
    """MuJoCo's numbers: time step [s], time constant of equalities [s]."""

    step: float
    constant: float


def softness(d: Description, tightness: float) -> Softness:
    """Return time step and time constant. `tightness`: distance by which closures may open [m]."""
    step = min(math.sqrt(tightness / acceleration(d)) / 2, LONGEST_STEP)
    unit = 10.0 ** (math.floor(math.log10(step)) - 1)
    step = float(f"{math.floor(step / unit * (1 + TWO_DIGITS)) * unit:.1e}")  # two digits, rounded down
    return Softness(step, 2 * step)


def acceleration(d: Description) -> float:
    """Return the acceleration at which closures stay as tight as asked [m/s^2]."""
    return FREE_FALL * (math.hypot(*d.gravity) if d.gravity and any(d.gravity) else EARTH)


def add_softness(root: ET.Element, option: ET.Element, chosen: Softness) -> None:
    """Add time step and default equality.

    Args:
        root: The root element, which receives `<default>`.
        option: The element `<option>`.
    """
    option.set("timestep", numeral(chosen.step))
    default = ET.SubElement(root, "default")
    solimp = numerals((HARDEST, HARDEST, 0.001, 0.5, 2))
    ET.SubElement(default, "equality", solref=numerals((chosen.constant, 1)), solimp=solimp)
