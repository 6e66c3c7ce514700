"""Postures of the shipped parallel robots in closed form, in fifty digits, from the numbers of their records.

Every robot's function gives joint positions by name. Angles that it takes are absolute (where a link points),
so that a posture can be put exactly at a singularity, or at any distance from it.
"""

import tempfile
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from hybridyn.description import Description, read
from tests import ROOT
from tests.hard.extended_judge import mp
from tests.oracle import Oracle
from tests.support.files import save

URDF = ROOT / "urdf"
Values = dict[str, Any]
Pair = tuple[Any, Any]


def changed_text(name: str, **given: str) -> str:
    """Give a shipped robot's file with other numbers in the call of its module, as `base_half_angle="10"`."""
    text = (URDF / f"{name}.urdf.xacro").read_text()
    text = text.replace('filename="modules/', f'filename="{URDF}/modules/')
    for key, value in given.items():
        first, mark, rest = text.partition(f' {key}="')
        assert mark, key
        text = first + mark + value + '"' + rest.partition('"')[2]
    return text


@lru_cache(maxsize=32)
def changed(name: str, **given: str) -> Description:
    """Read a shipped robot with other numbers in the call of its module."""
    with tempfile.TemporaryDirectory() as folder:
        path = save(Path(folder), changed_text(name, **given), f"{name}.urdf.xacro")
        return read(path)


def vector(description: Description, values: Mapping[str, Any]) -> np.ndarray:
    """Return q, shape (nq,), float64, from joint positions by name."""
    oracle = Oracle(description)
    q = np.zeros(oracle.nq)
    for name, (_, at, _) in oracle.coordinates.items():
        q[at] = float(values[name])
    return q


# ------------------------------------------------------------------ small geometry in fifty digits


def numbers(x: Any) -> Any:
    """Return an array of mpmath numbers."""
    source = np.asarray(x)
    out = np.empty(source.size, dtype=object)
    out[:] = [mp.mpf(y) if isinstance(y, mp.mpf) else mp.mpf(float(y)) for y in source.flat]
    return out.reshape(source.shape)


def placement(description: Description, joint: str) -> Pair:
    """Return rotation and origin of a joint in its parent link."""
    T = next(j for j in description.joints if j.name == joint).placement
    return numbers(T[:3, :3]), numbers(T[:3, 3])


def about(axis: int, angle: Any) -> Any:
    """Return the rotation about a coordinate axis."""
    R, i, j = numbers(np.eye(3)), (axis + 1) % 3, (axis + 2) % 3
    R[i, i] = R[j, j] = mp.cos(angle)
    R[j, i] = mp.sin(angle)
    R[i, j] = -R[j, i]
    return R


def length(x: Any) -> Any:
    """Return the norm of a vector."""
    return mp.sqrt(x @ x)


def pitch(R: Any) -> Any:
    """Return the angle of a rotation about y."""
    return mp.atan2(-R[2, 0], R[0, 0])


def meet(A: Any, a: Any, B: Any, b: Any, side: int) -> Any:
    """Return the point at distances a, b from points A, B of a plane, left (+1) or right (-1) of A to B."""
    d = B - A
    along = (d @ d + a * a - b * b) / (2 * (d @ d))
    square = a * a / (d @ d) - along * along
    if square < 0:
        assert square > -(mp.mpf(10) ** -12), "out of reach"  # the geometry is rounded to 1e-16
        square = mp.mpf(0)
    return A + along * d + side * mp.sqrt(square) * np.array([-d[1], d[0]])


def heading(A: Any, B: Any) -> Any:
    """Return the direction from A to B in a plane as an angle."""
    return mp.atan2(B[1] - A[1], B[0] - A[0])


def balls(description: Description, wrist: str) -> dict[str, Any]:
    """Return the ball centres in the platform by the rod that ends there."""
    R, p = placement(description, f"{wrist}_mount")
    carrier = next(j.parent for j in description.joints if j.name == f"{wrist}_y")
    return {carrier: -R.T @ p} | {c.link_b: numbers(c.frame_a[:3, 3]) for c in description.closures}


def carried(description: Description, wrist: str, rod: Any, platform: Any) -> Values:
    """Return the hinges of the ball that carries the platform, from the directions of rod and platform."""
    end = platform @ placement(description, f"{wrist}_mount")[0].T
    R = (rod @ placement(description, f"{wrist}_y")[0]).T @ end
    y, x, z = mp.atan2(R[0, 2], R[2, 2]), mp.asin(-R[1, 2]), mp.atan2(R[1, 0], R[1, 1])
    return {f"{wrist}_y": y, f"{wrist}_x": x, f"{wrist}_z": z}


# ------------------------------------------------------------------ the robots


def gough_stewart(
    description: Description, R: Any, p: Any, cross: Mapping[int, Pair] | None = None, module: str = "m1"
) -> Values:
    """Return the joints under a platform at (R, p); `cross`: that of a leg whose direction leaves it open."""
    values: Values = {}
    centres = balls(description, f"{module}_leg1_wrist")
    for i in range(1, 7):
        leg = f"{module}_leg{i}"
        Rh, ph = placement(description, f"{leg}_cross_y")
        d = Rh.T @ (p + R @ centres[f"{leg}_rod"] - ph)
        L = length(d)
        y, x = (cross or {}).get(i) or (mp.atan2(d[0], d[2]), mp.asin(-d[1] / L))
        stroke = L - placement(description, f"{leg}_slide")[1][2]
        values |= {f"{leg}_cross_y": y, f"{leg}_cross_x": x, f"{leg}_slide": stroke}
        if i == 1:
            values |= carried(description, f"{leg}_wrist", Rh @ about(1, y) @ about(0, x), R)
    return values


def rps3(description: Description, R: Any, p: Any, hinge: Mapping[int, Any] | None = None) -> Values:
    """Return the joints under a platform at (R, p); `hinge`: that of a leg of no length."""
    values: Values = {}
    centres = balls(description, "m1_leg1_wrist")
    for i in range(1, 4):
        leg = f"m1_leg{i}"
        Rh, ph = placement(description, f"{leg}_hinge")
        d = Rh.T @ (p + R @ centres[f"{leg}_rod"] - ph)
        turn = (hinge or {}).get(i)
        y = mp.atan2(d[0], d[2]) if turn is None else turn
        stroke = mp.sin(y) * d[0] + mp.cos(y) * d[2] - placement(description, f"{leg}_slide")[1][2]
        values |= {f"{leg}_hinge": y, f"{leg}_slide": stroke}
        if i == 1:
            values |= carried(description, f"{leg}_wrist", Rh @ about(1, y), R)
    return values


class Delta:
    """A Delta's arms: rods from elbows C_i to one point P, once the platform's radius is taken off.

    Attributes:
        tangents: Direction of each motor's axis.
        rod: Length of the rods.
    """

    def __init__(self, description: Description) -> None:
        self.description = description
        self.frames = [placement(description, f"m1_arm{i}_drive") for i in (1, 2, 3)]
        self.tangents = [R[:, 1] for R, _ in self.frames]
        self._balls = balls(description, "m1_arm1_rod_a_wrist")
        self._elbows = [placement(description, f"m1_arm{i}_rod_a_cross_y")[1] for i in (1, 2, 3)]
        closure = next(c for c in description.closures if c.link_b == "m1_arm2_rod_a")
        self.rod = numbers(closure.frame_b[0, 3])[()]

    def elbow(self, i: int, turn: Any) -> Any:
        """Return C of arm i (from 0) when its motor has turned so far."""
        R, p = self.frames[i]
        rods = [self._balls[f"m1_arm{i + 1}_rod_{x}"] for x in "ab"]
        return p + R @ about(1, turn) @ numbers([1, 0, 0]) * self._elbows[i][0] - (rods[0] + rods[1]) / 2

    def turn(self, i: int, P: Any, side: int) -> Any:
        """Return the turn of arm i's motor under P, its elbow on one side or the other."""
        R, p = self.frames[i]
        rods = [self._balls[f"m1_arm{i + 1}_rod_{x}"] for x in "ab"]
        w, a = R.T @ (P + (rods[0] + rods[1]) / 2 - p), self._elbows[i][0]
        reach = (w @ w + a * a - self.rod * self.rod) / (2 * a * mp.hypot(w[0], w[2]))
        return -mp.atan2(w[2], w[0]) + side * mp.acos(reach)

    def rods(self, P: Any, turns: Any) -> list[Any]:
        """Return the direction of each arm's rods."""
        return [(P - self.elbow(i, turn)) / self.rod for i, turn in enumerate(turns)]

    def values(self, P: Any, turns: Any, cross: Mapping[int, Any] | None = None) -> Values:
        """Return the joints; `cross`: the first angle of rods that lie along its axis."""
        values: Values = {}
        for i, (turn, (R, p)) in enumerate(zip(turns, self.frames, strict=True)):
            arm = R @ about(1, turn)
            values[f"m1_arm{i + 1}_drive"] = turn
            for x in "ab":
                rod = f"m1_arm{i + 1}_rod_{x}"
                Rc, pc = placement(self.description, f"{rod}_cross_y")
                d = (arm @ Rc).T @ (P + self._balls[rod] - p - arm @ pc)
                own = (cross or {}).get(i)
                y = mp.atan2(-d[2], d[0]) if own is None else own
                z = mp.atan2(d[1], mp.cos(y) * d[0] - mp.sin(y) * d[2])
                values |= {f"{rod}_cross_y": y, f"{rod}_cross_z": z}
                if rod == "m1_arm1_rod_a":
                    direction = arm @ Rc @ about(1, y) @ about(2, z)
                    values |= carried(self.description, f"{rod}_wrist", direction, numbers(np.eye(3)))
        return values


class FiveBar:
    """A planar five-bar in its plane (x, z): motors at A, upper and lower links of both sides.

    Attributes:
        motors: Where the motors stand.
        upper, lower: Lengths.
    """

    sides = ("m1_left", "m1_right")

    def __init__(self, description: Description) -> None:
        self.description = description
        self.motors = [placement(description, f"{side}_drive")[1][[0, 2]] for side in self.sides]
        self.upper = [placement(description, f"{side}_elbow")[1][0] for side in self.sides]
        self.lower = [numbers(f[0, 3])[()] for c in description.closures for f in (c.frame_a, c.frame_b)]

    def values(self, elbows: Any, tips: Any) -> Values:
        """Give the joints from each side's elbow and tip (one point twice, or where a side of it is open)."""
        values: Values = {}
        for side, A, E, T in zip(self.sides, self.motors, elbows, tips, strict=True):
            values |= self.angles(side, heading(A, E), heading(E, T))
        return values

    def angles(self, side: str, upper: Any, lower: Any) -> Values:
        """Return the joints of one side from the directions of its links in the plane."""
        drive, elbow = (pitch(placement(self.description, f"{side}_{x}")[0]) for x in ("drive", "elbow"))
        return {f"{side}_drive": wrap(-upper - drive), f"{side}_elbow": wrap(upper - lower - elbow)}


def wrap(angle: Any) -> Any:
    """Return an angle between -pi and pi."""
    return mp.atan2(mp.sin(angle), mp.cos(angle))


def towards(angle: Any) -> Any:
    """Return the unit vector of a direction in a plane."""
    return np.array([mp.cos(angle), mp.sin(angle)])
