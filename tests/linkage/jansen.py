"""Theo Jansen's walkers: any number of legs on one crank, each of six bars and three loops, as URDF."""

import numpy as np

#: Jansen's lengths [m].
A, B, C, D, E, F, G, J, K, L, M = (
    x / 100 for x in (38.0, 41.5, 39.3, 40.1, 55.8, 39.4, 36.7, 50.0, 61.9, 7.8, 15.0)
)
INERTIAL = (
    '<inertial><origin xyz="0.1 0 0"/><mass value="0.5"/>'
    '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>'
)


def meeting(p: np.ndarray, r: float, q: np.ndarray, s: float, side: int) -> np.ndarray:
    """The point at r from p and s from q, left (1) or right (-1) of the way from p to q."""
    d = np.linalg.norm(q - p)
    u = (q - p) / d
    x = (d * d + r * r - s * s) / (2 * d)
    return p + x * u + side * np.sqrt(r * r - x * x) * np.array([-u[1], u[0]])


def points(angle: float, mirrored: bool) -> list[np.ndarray]:
    """Crank pin, ground pivot, upper and lower knees, tip, ankle of a leg, shape (2,) each."""
    ground, pin = np.array([-A, -L]), M * np.array([np.cos(angle), np.sin(angle)])
    upper, lower = meeting(pin, J, ground, B, -1), meeting(pin, K, ground, C, 1)
    tip = meeting(ground, D, upper, E, 1)
    ankle = meeting(tip, F, lower, G, 1)
    flip = np.array([-1.0 if mirrored else 1.0, 1.0])
    return [flip * x for x in (pin, ground, upper, lower, tip, ankle)]


def walker(legs: int, *, stretch: float = 0.0, offset: float = 0.0, tilt: float = 0.0) -> str:
    """Write a walker.

    Args:
        legs: How many legs.
        stretch: Added to the last leg's upper bar, which then reaches nowhere [m].
        offset: How far the joints' zeros are from an assembled posture, at most [rad].
        tilt: How far axes are from parallel, at most [rad].
    """
    rng = np.random.default_rng(0)
    out = [
        '<robot name="walker"><link name="body"/>',
        f'<link name="crank">{INERTIAL}</link>',
        '<joint name="drive" type="continuous" independent="true"><parent link="body"/><child link="crank"/>'
        '<axis xyz="0 1 0"/></joint>',
    ]

    def link(name: str, parent: str, at: np.ndarray, y: float) -> None:
        rpy = rng.uniform(-1, 1, 3) * [tilt, offset, tilt]
        out.append(
            f'<link name="{name}">{INERTIAL}</link><joint name="{name}_pin" type="revolute" '
            f'independent="false"><parent link="{parent}"/><child link="{name}"/>'
            f'<origin xyz="{at[0]} {y} {at[1]}" rpy="{rpy[0]} {rpy[1]} {rpy[2]}"/><axis xyz="0 1 0"/>'
            '<limit lower="-3" upper="3" effort="0" velocity="10"/></joint>'
        )

    def loop(name: str, a: str, at_a: np.ndarray, b: str, at_b: np.ndarray) -> None:
        out.append(
            f'<loop name="{name}" type="revolute">'
            f'<predecessor link="{a}"><origin xyz="{at_a[0]} 0 {at_a[1]}"/></predecessor>'
            f'<successor link="{b}"><origin xyz="{at_b[0]} 0 {at_b[1]}"/></successor>'
            '<axis xyz="0 1 0"/></loop>'
        )

    pairs = (legs + 1) // 2
    for i in range(legs):
        turn = 2 * np.pi * (i // 2) / pairs
        pin, ground, upper, lower, tip, ankle = points(np.pi - turn if i % 2 else turn, bool(i % 2))
        j, k, bde, c, f, ghi = (f"l{i}_{part}" for part in ("j", "k", "bde", "c", "f", "ghi"))
        y = 0.1 * i
        link(j, "crank", pin, y)
        link(k, "crank", pin, y)
        link(bde, "body", ground, y)
        link(c, "body", ground, y)
        link(f, bde, tip - ground, 0.0)
        link(ghi, c, lower - ground, 0.0)
        longer = np.array([stretch if i == legs - 1 else 0.0, 0.0])
        loop(f"l{i}_upper", j, upper - pin + longer, bde, upper - ground)
        loop(f"l{i}_lower", k, lower - pin, c, lower - ground)
        loop(f"l{i}_ankle", f, ankle - tip, ghi, ankle - lower)
    return "\n".join([*out, "</robot>"])
