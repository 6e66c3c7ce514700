"""Mechanisms that HyRoDyn names by type: closed from the tree, they move as its formulas say."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from tests.description.reading import refused, save_all

#: The closing of loops, to its tolerance.
CLOSED = 1e-9
INERTIAL = '<inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01"/></inertial>'
X, Y, Z = np.eye(3)


def chain(parent: str, *joints: tuple[str, str, Sequence[float]], at: pin.SE3 | None = None) -> str:
    """Return joints one behind the other with their links "NAME_link"; the first is placed on its parent."""
    out = ""
    for name, kind, axis in joints:
        place = at or pin.SE3.Identity()
        xyz, rpy = (
            " ".join(f"{x:.17g}" for x in v) for v in (place.translation, pin.rpy.matrixToRpy(place.rotation))
        )
        out += (
            f'<link name="{name}_link">{INERTIAL}</link><joint name="{name}" type="{kind}">'
            f'<origin xyz="{xyz}" rpy="{rpy}"/><parent link="{parent}"/><child link="{name}_link"/>'
            f'<axis xyz="{axis[0]} {axis[1]} {axis[2]}"/>'
            '<limit lower="-3" upper="3" effort="9" velocity="9"/></joint>'
        )
        parent, at = f"{name}_link", None
    return out


def leg(number: int, start: np.ndarray, end: np.ndarray, hinges: str) -> str:
    """Return a leg of hinges and a slide along z from one point of the base to another, at zero."""
    way = pin.Quaternion.FromTwoVectors(Z, end - start).matrix()
    names = [(f"B{number}{axis}", "revolute", {"x": X, "y": Y}[axis]) for axis in hinges]
    slide = (f"act{number}", "prismatic", Z)
    tip = pin.SE3(np.eye(3), np.array([0.0, 0.0, np.linalg.norm(end - start)]))
    return chain("base", *names, at=pin.SE3(way, start)) + chain(f"{names[-1][0]}_link", slide, at=tip)


def side_car(kind: str, independent: Sequence[str], passive: Sequence[str], legs: int) -> str:
    """Return the file of a mechanism."""
    active = [f"act{number}" for number in range(1, legs + 1)]
    words = {
        "contextual_name": "leg", "type": f'"{kind}"', "file_path": '"leg.urdf"',
        "jointnames_independent": f"[{', '.join(independent)}]",
        "jointnames_active": f"[{', '.join(active)}]",
        "jointnames_spanningtree": f"[{', '.join((*independent, *passive, *active))}]",
    }  # fmt: skip
    return "submechanisms:\n- " + "\n  ".join(f"{word}: {value}" for word, value in words.items()) + "\n"


def mechanism(kind: str) -> tuple[dict[str, str], list[str], Callable[[np.ndarray], np.ndarray]]:
    """Return files of a mechanism, its independent joints, and the ways of its slides from zero."""
    rng = np.random.default_rng(3)
    turns = {
        "hinge": ("revolute", Y),
        "roll": ("revolute", X),
        "pitch": ("revolute", Y),
        "yaw": ("revolute", Z),
    }
    slides = {"x": ("prismatic", X), "y": ("prismatic", Y), "z": ("prismatic", Z)}
    of = {
        "rrPr": ["hinge"], "2SPU+1U": ["roll", "pitch"], "2SPRR+1U": ["roll", "pitch"],
        "6UPS": ["x", "y", "z", "roll", "pitch", "yaw"],
    }[kind]  # fmt: skip
    count = {"rrPr": 1, "6UPS": 6}.get(kind, 2)
    angles = np.arange(count) * 2 * np.pi / max(count, 3) + 0.3 * (np.arange(count) % 2)
    ends = np.stack([0.1 * np.cos(angles), 0.1 * np.sin(angles), np.full(count, 0.05)], axis=1)
    starts = np.stack([0.2 * np.cos(angles + 0.2), 0.2 * np.sin(angles + 0.2), np.full(count, -0.3)], axis=1)
    starts += rng.uniform(-0.02, 0.02, starts.shape)
    if kind == "rrPr":
        ends[:, 1] = starts[:, 1] = 0.0
    text = chain("base", *((name, *(turns | slides)[name]) for name in of))
    arm, axis, passive = 0.03, np.array([np.cos(0.1), 0.0, np.sin(0.1)]), []
    tips = ends
    if kind == "2SPRR+1U":
        across = (starts - ends) - np.outer((starts - ends) @ axis, axis)
        tips = ends + arm * across / np.linalg.norm(across, axis=1, keepdims=True)
    for number, (start, end, tip) in enumerate(zip(starts, ends, tips, strict=True), start=1):
        if kind == "2SPRR+1U":
            text += chain(f"{of[-1]}_link", (f"E{number}", "revolute", axis), at=pin.SE3(np.eye(3), end))
        text += leg(number, start, tip, "y" if kind == "rrPr" else "xy")
        passive += [f"E{number}"] * (kind == "2SPRR+1U") + [
            f"B{number}{x}" for x in ("y" if kind == "rrPr" else "xy")
        ]

    def ways(y: np.ndarray) -> np.ndarray:
        """Return the ways of the slides: their lengths in HyRoDyn's formulas, less those at zero."""
        return lengths(y) - lengths(np.zeros(len(of)))

    def lengths(y: np.ndarray) -> np.ndarray:
        motion = pin.SE3.Identity()
        for name, x in zip(of, y, strict=True):
            about = (turns | slides)[name][1]
            motion = motion * (
                pin.SE3(pin.exp3(x * about), np.zeros(3)) if name in turns else pin.SE3(np.eye(3), x * about)
            )
        points = ends @ motion.rotation.T + motion.translation
        if kind != "2SPRR+1U":
            return np.linalg.norm(points - starts, axis=1)
        i, delta = motion.rotation @ axis, starts - points
        return np.hypot(delta @ i, np.linalg.norm(np.cross(i, delta), axis=1) - arm)

    robot = f'<robot name="leg"><link name="base"/>{text}</robot>'
    files = {"leg.urdf": robot, "submechanisms.yml": side_car(kind, of, passive, count)}
    return files, of, ways


KINDS = ("rrPr", "2SPU+1U", "2SPRR+1U", "6UPS")


@pytest.mark.parametrize("kind", KINDS)
def test_a_type_of_hyrodyn_moves_as_its_formulas_say(kind: str, tmp_path: Path) -> None:
    files, independent, ways = mechanism(kind)
    robot = hybridyn.load(save_all(tmp_path, files))
    assert sum(module.mobility for module in robot.modules) == len(independent)
    assert robot.motors == tuple(f"act{n}" for n in range(1, len(ways(np.zeros(len(independent)))) + 1))
    rng, guess = np.random.default_rng(0), robot.home
    for part in (0.3, 1.0):
        y = part * rng.uniform(-1, 1, len(independent)) * (0.02 if kind == "6UPS" else 0.3)
        motors = dict(zip(robot.motors, ways(y), strict=True))
        guess = hybridyn.assemble(robot, motors=motors, guess=guess)[0]
        found = [guess[robot.q_slices[robot.joints.index(name)]] for name in independent]
        np.testing.assert_allclose(np.concatenate(found), y, atol=CLOSED)


WRONG = [
    (
        "2SPU+1U",
        "jointnames_active: [act1, act2]",
        "jointnames_active: [act1]",
        "the slides of its legs as active",
    ),
    (
        "2SPU+1U",
        "jointnames_active: [act1, act2]",
        "jointnames_active: [act1, B1x]",
        "the slides of its legs",
    ),
    (
        "2SPU+1U",
        "jointnames_independent: [roll, pitch]",
        "jointnames_independent: []",
        "needs jointnames_indep",
    ),
    ("2SPU+1U", "jointnames_independent: [roll", "jointnames_independent: [rol", "no joint is called 'rol'"),
    ("2SPRR+1U", "E1, ", "", "has a hinge for each leg behind its independent joints, 2 of them"),
    ("rrPr", '"rrPr"', "3RUS2", "types that close themselves: 'rrPr', '2SPU+1U', '6UPS', '2SPRR+1U'"),
]


@pytest.mark.parametrize(("kind", "old", "new", "words"), WRONG)
def test_what_is_no_mechanism_of_its_type_is_refused(
    kind: str, old: str, new: str, words: str, tmp_path: Path
) -> None:
    files, _, _ = mechanism(kind)
    text = files["submechanisms.yml"]
    assert old in text
    error = refused(save_all(tmp_path, files | {"submechanisms.yml": text.replace(old, new)}), words)
    assert error.file == str(tmp_path / "submechanisms.yml")


def test_loop_constraints_count_before_the_type(tmp_path: Path) -> None:
    files, _, _ = mechanism("2SPU+1U")
    stated = "".join(
        f"  - cut_joint: act{n}\n    predecessor_body: act{n}_link\n    successor_body: pitch_link\n"
        "    constraint_axes:\n" + "".join(f"    - axis: {row}\n" for row in np.eye(6)[3:].tolist())
        for n in (1, 2)
    )
    one = hybridyn.load(save_all(tmp_path / "a", files))
    numeric = {"submechanisms.yml": files["submechanisms.yml"] + f"  loop_constraints:\n{stated}"}
    other = hybridyn.load(save_all(tmp_path / "b", files | numeric))
    q, v, a = hybridyn.assemble(one, motors={"act1": (0.01, 0.2, 0.3), "act2": (-0.02, 0.1, -0.4)})
    np.testing.assert_allclose(hybridyn.idm(one, q, v, a), hybridyn.idm(other, q, v, a), rtol=1e-12)
