"""Planar four-bars whose four bars can lie in one line: their change points, where two branches cross."""

import tempfile
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from hybridyn.description import Description, read
from tests.hard.closed_forms import Values, heading, meet, numbers, towards, wrap
from tests.hard.extended_judge import mp
from tests.support.files import save

BAR = """<link name="{name}"><inertial><origin xyz="{half} 0.01 0.02"/><mass value="{mass}"/>
  <inertia ixx="0.001" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
HINGE = """<joint name="{name}" type="revolute" independent="{driven}"><parent link="{parent}"/>
  <child link="{child}"/><origin xyz="{at} 0 0" rpy="0 {turn} 0"/><axis xyz="0 -1 0"/>
  <limit lower="-9" upper="9" effort="99" velocity="9"/></joint>"""
PIN = """<loop name="pin" type="revolute">
  <predecessor link="coupler"><origin xyz="{coupler} 0 0"/></predecessor>
  <successor link="rocker"><origin xyz="{rocker} 0 0"/></successor><axis xyz="0 1 0"/></loop>"""
HOME = 1.2  # the crank's direction at home, far from any line


class FourBar:
    """A planar four-bar in the plane (x, z), where gravity acts.

    Args:
        crank, coupler, rocker, ground: Lengths [m].
        sides: On which side of the line from crank to the rocker's hinge the pin lies, for positive and for
            negative directions of the crank.
    """

    def __init__(self, crank: float, coupler: float, rocker: float, ground: float, sides: tuple[int, int]):
        self.lengths = tuple(mp.mpf(x) for x in (crank, coupler, rocker, ground))
        self.sides = sides
        self.home = [float(x) for x in self.directions(mp.mpf(HOME))]
        one, two, three = self.home
        names = zip(("crank", "coupler", "rocker"), (crank, coupler, rocker), (2.0, 3.0, 1.5), strict=True)
        self.text = "".join(
            [
                '<robot name="four_bar"><link name="ground"/>',
                *(BAR.format(name=name, half=x / 2, mass=m) for name, x, m in names),
                HINGE.format(name="a", driven="true", parent="ground", child="crank", at=0, turn=repr(-one)),
                HINGE.format(
                    name="b", driven="false", parent="crank", child="coupler", at=crank, turn=repr(one - two)
                ),
                HINGE.format(
                    name="c", driven="false", parent="ground", child="rocker", at=ground, turn=repr(-three)
                ),
                PIN.format(coupler=coupler, rocker=rocker),
                "</robot>",
            ]
        )

    def directions(self, angle: Any) -> tuple[Any, Any, Any]:
        """Return the directions of crank, coupler and rocker."""
        crank, coupler, rocker, ground = self.lengths
        B, D = crank * towards(angle), numbers([0.0, 0.0]) + np.array([ground, mp.mpf(0)])
        side = self.sides[0] if mp.sin(angle) >= 0 else self.sides[1]
        C = meet(B, coupler, D, rocker, side)
        return angle, heading(B, C), heading(D, C)

    def values(self, angle: Any) -> Values:
        """Return the joints at a direction of the crank."""
        now = [x - mp.mpf(y) for x, y in zip(self.directions(angle), self.home, strict=True)]
        # The elbow's placement is a rounded difference of two directions.
        between = mp.mpf(self.home[1] - self.home[0]) - (mp.mpf(self.home[1]) - mp.mpf(self.home[0]))
        return {"a": wrap(now[0]), "b": wrap(now[1] - now[0] - between), "c": wrap(now[2])}


@lru_cache(maxsize=8)
def described(*lengths: float, sides: tuple[int, int]) -> tuple[FourBar, Description]:
    """Return a four-bar and its record."""
    bars = FourBar(*lengths, sides=sides)
    with tempfile.TemporaryDirectory() as folder:
        path = save(Path(folder), bars.text, "four_bar.urdf")
        return bars, read(path)


def folded_parallelogram(d: Any) -> tuple[Description, Values]:
    """Constraint: bars of 1 and 2 m, d radians from lying folded in one line; it stays a parallelogram."""
    bars, description = described(1.0, 2.0, 1.0, 2.0, sides=(1, -1))
    return description, bars.values(mp.mpf(d))


def flat_four_bar(d: Any) -> tuple[Description, Values]:
    """Constraint: bars of 1, 2, 1.5 and 2.5 m, the crank d radians from pointing away along the ground.

    The shortest and the longest are together as long as the others: a change point (Grashof's border).
    """
    bars, description = described(1.0, 2.0, 1.5, 2.5, sides=(1, -1))
    return description, bars.values(mp.pi - mp.mpf(d))
