"""Linkages with redundant closure rows, as URDF texts, with their motion in closed form.

Every linkage has one freedom, hangs askew in the world (a closure in 3-D sees no plane of its own), and has
links whose centres of mass and inertias lie askew as well, so that internal wrenches have all six components.
"""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

import hybridyn
from tests.hard.one_freedom import Law
from tests.support.files import save

GRAVITY = (1.5, -4.0, -8.5)
ASKEW = "0.4 -0.3 0.7"


class Linkage(NamedTuple):
    """A linkage.

    Attributes:
        text: Its URDF, motor `drive`.
        law: Joint positions and their derivatives over s.
        spare: Redundant rows among those of its closures.
        s: A posture to look at.
        closures: Names of its closures.
    """

    text: str
    law: Law
    spare: int
    s: float
    closures: tuple[str, ...]


def link(name: str, mass: float, x: float, y: float = 0.03, z: float = 0.05) -> str:
    """Write a link whose centre of mass is at (x, y, z)."""
    return (
        f'<link name="{name}"><inertial><origin xyz="{float(x)!r} {y!r} {z!r}"/><mass value="{mass!r}"/>'
        f'<inertia ixx="{0.02 * mass!r}" iyy="{0.035 * mass!r}" izz="{0.03 * mass!r}" ixy="{0.004 * mass!r}" '
        f'ixz="{-0.003 * mass!r}" iyz="{0.005 * mass!r}"/></inertial></link>'
    )


def hinge(
    name: str,
    parent: str,
    child: str,
    xyz: tuple[float, float, float] = (0, 0, 0),
    rpy: str = "0 0 0",
    axis: str = "0 0 1",
) -> str:
    """Write a revolute joint; the one named `drive` is the motor."""
    place = " ".join(repr(float(x)) for x in xyz)
    return (
        f'<joint name="{name}" type="revolute" independent="{str(name == "drive").lower()}">'
        f'<parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{place}" rpy="{rpy}"/><axis xyz="{axis}"/>'
        '<limit lower="-10" upper="10" effort="100" velocity="100"/></joint>'
    )


def pin(
    name: str,
    a: str,
    at_a: tuple[float, float, float],
    b: str,
    at_b: tuple[float, float, float],
    rpy_a: str = "0 0 0",
    rpy_b: str = "0 0 0",
    kind: str = "revolute",
    axis: str = "0 0 1",
) -> str:
    """Write a closure of two frames, a revolute one about `axis` or, as "rows", what it says."""
    turn = "" if kind.startswith("rows") else f'<axis xyz="{axis}"/>'
    one, two = (" ".join(repr(float(x)) for x in xyz) for xyz in (at_a, at_b))
    return (
        f'<loop name="{name}" type="{kind}">'
        f'<predecessor link="{a}"><origin xyz="{one}" rpy="{rpy_a}"/></predecessor>'
        f'<successor link="{b}"><origin xyz="{two}" rpy="{rpy_b}"/></successor>{turn}</loop>'
    )


def framed(name: str, *parts: str) -> str:
    """Write a robot that stands askew in the world: its frame `ground` is fixed to the root link."""
    return (
        f'<robot name="{name}"><link name="world"/><link name="ground"/>'
        f'<joint name="stand" type="fixed"><parent link="world"/><child link="ground"/>'
        f'<origin xyz="0.1 0.2 0.3" rpy="{ASKEW}"/></joint>{"".join(parts)}</robot>'
    )


def loaded(folder: Path, linkage: Linkage) -> hybridyn.HybridRobot:
    """Load a linkage, its home close to the posture to look at."""
    path = save(folder, linkage.text, "linkage.urdf")
    home = (f"{name} = {float(x)!r}\n" for name, (x, _) in linkage.law(linkage.s - 0.2).items())
    (folder / "linkage.model.toml").write_text("[home]\n" + "".join(home))
    return hybridyn.load(path, gravity=GRAVITY)


CRANK, COUPLER, ROCKER, GROUND = 0.3, 0.7, 0.6, 0.8


def four_bar_law(s: complex) -> dict[str, tuple[complex, complex]]:
    """Return the planar four-bar's angles over the crank's, by the half-angle formula and the sine rule."""
    a, b, c, g = CRANK, COUPLER, ROCKER, GROUND
    X, Y = g - a * np.cos(s), -a * np.sin(s)
    Z = (b * b - X * X - Y * Y - c * c) / (2 * c)
    gamma = 2 * np.arctan((Y + np.sqrt(X * X + Y * Y - Z * Z)) / (X + Z))
    beta = 2 * np.arctan((Y + c * np.sin(gamma)) / (b + X + c * np.cos(gamma)))
    beta_rate = a * np.sin(s - gamma) / (b * np.sin(gamma - beta))
    gamma_rate = a * np.sin(s - beta) / (c * np.sin(gamma - beta))
    return {"drive": (s, 1.0), "elbow": (beta - s, beta_rate - 1), "swing": (gamma, gamma_rate)}


def four_bar(kind: str = "revolute") -> Linkage:
    """Crank 0.3, coupler 0.7, rocker 0.6, ground 0.8 m; of the closure's five rows a plane needs two."""
    text = framed(
        "four_bar",
        link("crank", 0.5, 0.15),
        link("coupler", 1.2, 0.35),
        link("rocker", 0.9, 0.3),
        hinge("drive", "ground", "crank"),
        hinge("elbow", "crank", "coupler", (CRANK, 0, 0)),
        hinge("swing", "ground", "rocker", (GROUND, 0, 0)),
        pin("pin", "coupler", (COUPLER, 0, 0), "rocker", (ROCKER, 0, 0), kind=kind),
    )
    return Linkage(text, four_bar_law, 3 if "revolute" in kind else 0, 1.1, ("pin",))


def parallelogram() -> Linkage:
    """Three uprights of 0.5 m, 0.4 m apart, under one bar: with one upright fewer it would move as well."""

    def law(s: complex) -> dict[str, tuple[complex, complex]]:
        return {"drive": (s, 1.0), "top": (-s, -1.0), "middle": (s, 1.0), "last": (s, 1.0)}

    text = framed(
        "parallelogram",
        *(
            link(name, 0.6, 0.2, y)
            for name, y in (("first_bar", 0.02), ("middle_bar", -0.03), ("last_bar", 0.0))
        ),
        link("bar", 1.1, 0.35),
        hinge("drive", "ground", "first_bar"),
        hinge("top", "first_bar", "bar", (0.5, 0, 0)),
        hinge("middle", "ground", "middle_bar", (0.4, 0, 0)),
        hinge("last", "ground", "last_bar", (0.8, 0, 0)),
        pin("middle_pin", "bar", (0.4, 0, 0), "middle_bar", (0.5, 0, 0)),
        pin("last_pin", "bar", (0.8, 0, 0), "last_bar", (0.5, 0, 0)),
    )
    return Linkage(text, law, 7, 0.9, ("middle_pin", "last_pin"))


def bennett() -> Linkage:
    """Bennett's linkage: twists and lengths with sin(alpha) / a = sin(beta) / b, opposite links equal.

    With T_i = Rz(theta_i) Tx(a_i) Rx(alpha_i), i = 1..4, T_1 T_2 T_3 T_4 = 1 for theta_3 = -theta_1,
    theta_4 = -theta_2 and
    tan(theta_1 / 2) tan(theta_2 / 2) = sin((beta + alpha) / 2) / sin((beta - alpha) / 2).
    """
    alpha, beta, a = 0.6, 1.3, 0.4
    b = a * np.sin(beta) / np.sin(alpha)
    k = np.sin((beta + alpha) / 2) / np.sin((beta - alpha) / 2)

    def law(s: complex) -> dict[str, tuple[complex, complex]]:
        t = np.tan(s / 2)
        second, rate = 2 * np.arctan(k / t), -k * (1 + t * t) / (t * t + k * k)
        return {"drive": (s, 1.0), "two": (second, rate), "three": (-s, -1.0)}

    text = framed(
        "bennett",
        link("link1", 0.7, a / 2),
        link("link2", 1.0, b / 2),
        link("link3", 0.8, a / 2),
        hinge("drive", "ground", "link1"),
        hinge("two", "link1", "link2", (a, 0, 0), f"{float(alpha)!r} 0 0"),
        hinge("three", "link2", "link3", (b, 0, 0), f"{float(beta)!r} 0 0"),
        # The fourth hinge turns about z of the third link's end; on the ground it stands at
        # (Tx(b) Rx(beta))^-1.
        pin(
            "four", "link3", (a, 0, 0), "ground", (-b, 0, 0), f"{float(alpha)!r} 0 0", f"{float(-beta)!r} 0 0"
        ),
    )
    return Linkage(text, law, 3, 1.2, ("four",))


def sarrus() -> Linkage:
    """Two legs of three parallel hinges, at right angles: the platform moves straight up and down."""

    def law(s: complex) -> dict[str, tuple[complex, complex]]:
        lean, fold = (-s, -1.0), (-2 * s, -2.0)
        return {"drive": (-s, -1.0), "knee_x": fold, "hip_x": lean, "foot_y": (-s, -1.0), "knee_y": fold}

    # A leg's links point along x, outwards at s = 0, and fold: lower to s above the level, upper back.
    text = framed(
        "sarrus",
        *(
            link(f"{part}_{leg}", mass, 0.2)
            for leg in "xy"
            for part, mass in (("lower", 0.6), ("upper", 0.5))
        ),
        link("platform", 2.0, 0.1, 0.05),
        hinge("drive", "ground", "lower_x", (0.3, 0, 0), axis="0 1 0"),
        hinge("knee_x", "lower_x", "upper_x", (0.4, 0, 0), f"0 0 {np.pi!r}", axis="0 1 0"),
        hinge("hip_x", "upper_x", "platform", (0.4, 0, 0), f"0 0 {np.pi!r}", axis="0 1 0"),
        hinge("foot_y", "ground", "lower_y", (0, 0.3, 0), f"0 0 {np.pi / 2!r}", axis="0 1 0"),
        hinge("knee_y", "lower_y", "upper_y", (0.4, 0, 0), f"0 0 {np.pi!r}", axis="0 1 0"),
        pin(
            "hip_y",
            "upper_y",
            (0.4, 0, 0),
            "platform",
            (-0.3, 0.3, 0),
            f"0 0 {np.pi!r}",
            f"0 0 {np.pi / 2!r}",
            axis="0 1 0",
        ),
    )
    return Linkage(text, law, 1, 0.8, ("hip_y",))


def bricard_law(s: complex) -> dict[str, tuple[complex, complex]]:
    """Return the angles of the Bricard linkage of unit rods and right angles.

    Its angles from the stretched posture, theta and phi in turn, obey cos(theta / 2) cos(phi / 2) = 1/2 on
    the component that holds the cube. With theta / 2 + phi / 2 = P and theta / 2 - phi / 2 = M that is
    cos P + cos M = 1, or sin^2(P / 2) + sin^2(M / 2) = 1/2: P = 2 asin(sin(s) / sqrt 2) and
    M = 2 asin(cos(s) / sqrt 2) are analytic all the way round. The cube (all angles 90 degrees, where
    the URDF has its zeros) is s = pi / 2.
    """
    half = np.sqrt(0.5)
    P, M = 2 * np.arcsin(half * np.sin(s)), 2 * np.arcsin(half * np.cos(s))
    P_rate = 2 * half * np.cos(s) / np.sqrt(1 - np.sin(s) ** 2 / 2)
    M_rate = -2 * half * np.sin(s) / np.sqrt(1 - np.cos(s) ** 2 / 2)
    theta, theta_rate = P + M - np.pi / 2, P_rate + M_rate
    phi, phi_rate = P - M - np.pi / 2, P_rate - M_rate
    return {
        "hinge0": (-theta, -theta_rate),
        "hinge1": (-phi, -phi_rate),
        "hinge2": (-theta, -theta_rate),
        "hinge3": (-phi, -phi_rate),
        "hinge4": (-theta, -theta_rate),
    }


LINKAGES: dict[str, Callable[[], Linkage]] = {
    "four_bar": four_bar,
    "parallelogram": parallelogram,
    "bennett": bennett,
    "sarrus": sarrus,
}


def crossed_bars(long: float = 1.0, short: float = 0.4) -> Linkage:
    """An antiparallelogram: crank and rocker of one length, coupler and ground of another, crossing over.

    Of the two postures to a crank angle s, tan(gamma / 2) = k tan(s / 2), k = (a + b) / (a - b), is the one
    that is no parallelogram: from |b + a exp(i gamma) - a exp(i s)| = b. At s = 0 all bars lie in one line,
    where both meet, and the closures lose rank; gamma runs through smoothly.
    """
    a, b = short, long
    k = (a + b) / (a - b)

    def law(s: complex) -> dict[str, tuple[complex, complex]]:
        t = np.tan(s / 2)
        gamma, gamma_rate = 2 * np.arctan(k * t), k * (1 + t * t) / (1 + k * k * t * t)
        sine = a * (np.sin(gamma) - np.sin(s)) / b
        cosine = 1 + a * (np.cos(gamma) - np.cos(s)) / b
        beta = 2 * np.arctan(sine / (1 + cosine))
        beta_rate = a * (np.cos(gamma) * gamma_rate - np.cos(s)) / (b * cosine)
        return {"drive": (s, 1.0), "elbow": (beta - s, beta_rate - 1), "swing": (gamma, gamma_rate)}

    text = framed(
        "crossed_bars",
        link("crank", 0.5, 0.2),
        link("coupler", 1.2, 0.45),
        link("rocker", 0.9, 0.15),
        hinge("drive", "ground", "crank"),
        hinge("elbow", "crank", "coupler", (a, 0, 0)),
        hinge("swing", "ground", "rocker", (b, 0, 0)),
        pin("pin", "coupler", (b, 0, 0), "rocker", (a, 0, 0)),
    )
    return Linkage(text, law, 3, 0.8, ("pin",))
