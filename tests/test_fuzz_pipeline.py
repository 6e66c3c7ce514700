"""No mutation of a robot's files or of its table ends in a traceback, a hang or a wrong posture.

Seeded mutations of shipped robots as URDF, of the files beside it, and of a short trajectory go the whole
way: read, load, assemble, inverse model. What comes through has finite efforts, loops that the oracle finds
closed, and motors where the table says; efforts of odd robots are judged in `test_fuzz_mechanisms`.
"""

import random
import re
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.streams.postures import postures
from hybridyn.tables.columns import read_layout
from hybridyn.tables.opening import open_table
from hybridyn.tables.trajectory import read_motions
from tests import ROOT
from tests.files import expanded
from tests.mutations import FLAT, TREE, change_number, swap_values
from tests.oracle import Oracle
from tests.posing import position
from tests.samples import fuzz, slow
from tests.waiting import outcome

CLOSED = 1e-6  # what the dynamic models ask of a state, relative to the robot's size
FOLLOWED = 1e-7  # m or rad: a table that closures contradict within their tolerance is bent
ROWS = 8

Texts = dict[str, str]


@lru_cache
def originals(name: str) -> Texts:
    """Return a shipped robot's files by their ending, and the start of its trajectory from its motors."""
    path = ROOT / f"urdf/{name}.urdf.xacro"
    robot = hybridyn.load(path)
    time = 0.05 * np.arange(ROWS)
    header, columns = ["time"], [time]
    for number, motor in enumerate(robot.motors):
        header += [f"{motor}/{rate}" for rate in ("position", "velocity", "acceleration")]
        phase = 2.0 * time + number
        rates = np.array([np.sin(phase) - np.sin(number), 2.0 * np.cos(phase), -4.0 * np.sin(phase)])
        columns += list(0.02 * rates)
    rows = [",".join(header), *(",".join(f"{x:.6f}" for x in row) for row in np.array(columns).T)]
    return {
        ".urdf": expanded(path),
        ".model.toml": (ROOT / f"models/{name}/model.toml").read_text(),
        ".csv": "\n".join(rows) + "\n",
    }


@lru_cache
def with_side_car() -> Texts:
    """Return the five-bar with its loop in a side-car: a point, which is all that a plane needs."""
    texts = dict(originals("five_bar"))
    loop = re.search(r"<loop\b.*?</loop>", texts[".urdf"], re.DOTALL)
    frames = ""
    for number, side in enumerate(("predecessor", "successor")):
        part = re.search(rf'<{side} link="([^"]+)"(?:/>|>(.*?)</{side}>)', loop[0], re.DOTALL)
        frames += f'<link name="end{number}"/><joint name="end{number}_joint" type="fixed">'
        frames += f'<parent link="{part[1]}"/><child link="end{number}"/>{part[2] or ""}</joint>'
    texts[".urdf"] = texts[".urdf"].replace(loop[0], frames)
    texts[".yaml"] = "closed_loop: [[end0, end1]]\ntype: ['3d']\nname_mot: [m1_left_drive, m1_right_drive]\n"
    return texts


def scale_number(text: str, draw: random.Random) -> bytes:
    """Change one number so that it stays one: a little, its sign, its size."""
    found = list(re.finditer(r"(?<![\w.])-?\d+\.\d+(e-?\d+)?(?![\w.])", text)) or [re.match("", text)]
    part = draw.choice(found)
    by = draw.choice([1.0 + 1e-7, 1.001, 1.1, 0.5, 2.0, -1.0, 0.0, 1e-3, 1e3])
    number = repr(float(part[0] or 0) * by)
    return (text[: part.start()] + number + text[part.end() :]).encode()


def exchange_cells(text: str, draw: random.Random) -> bytes:
    """Exchange two columns' names, or two rows."""
    lines = text.splitlines()
    if draw.random() < 0.5:
        names = lines[0].split(",")
        i, j = draw.sample(range(len(names)), 2)
        names[i], names[j] = names[j], names[i]
        lines[0] = ",".join(names)
    else:
        i, j = draw.sample(range(1, len(lines)), 2)
        lines[i], lines[j] = lines[j], lines[i]
    return ("\n".join(lines) + "\n").encode()


MUTATORS = {
    ".urdf": [*TREE, *[scale_number] * 8],
    ".model.toml": [*FLAT, scale_number],
    ".yaml": [*FLAT],
    ".csv": [
        *(change for change in FLAT if change is not swap_values),
        change_number,
        *[scale_number] * 4,
        exchange_cells,
    ],
}


def went_through(folder: Path, texts: Texts | dict[str, bytes], case: str) -> bool:
    """Send files the whole way; say whether efforts came out, which are then judged."""
    for old in folder.iterdir():
        old.unlink()
    for ending, text in texts.items():
        (folder / f"r{ending}").write_bytes(text if isinstance(text, bytes) else text.encode())
    result, _ = outcome(case, lambda: efforts(folder))
    if result is None:
        return False
    assert np.isfinite(result[-1]).all(), case
    with np.errstate(all="ignore"):
        judge(*result[:2], case)
    return True


def efforts(folder: Path) -> tuple[hybridyn.HybridRobot, Any, np.ndarray]:
    """Return the robot of a folder, the states of its table, and the efforts that they take."""
    robot = hybridyn.load(folder / "r.urdf")
    with open_table(folder / "r.csv") as table:
        layout = read_layout(table.columns, robot.description, motors=robot.motors, file=table.file)
        block = postures(robot, next(read_motions(table, layout)), layout, None)
    return robot, block, hybridyn.idm(robot, block.q, block.v, block.a)


def judge(robot: hybridyn.HybridRobot, block, case: str) -> None:
    """Check loops and motors of the first and the last row."""
    oracle = Oracle(robot.description)
    for t in (0, -1):
        q = block.q[t]
        assert np.abs(oracle.residual(q)).max(initial=0.0) <= CLOSED * max(
            robot.modules[0].mechanism.length, 1.0
        ), case
        for joint, (wanted, *_) in block.motion.joints.items():
            off = position(robot, joint, q) - wanted[t]
            off -= (
                2 * np.pi * np.round(off / (2 * np.pi))
                if robot.kinds[robot.joints.index(joint)] == "continuous"
                else 0
            )
            assert abs(off) <= FOLLOWED, case


CASES = [
    ("five_bar", ".urdf", 40),
    ("five_bar", ".model.toml", 10),
    ("five_bar", ".csv", 25),
    ("side_car", ".yaml", 15),
    ("rps3", ".urdf", 20),
    ("rps3", ".csv", 15),
    ("gough_stewart", ".urdf", 15),
    ("gough_stewart", ".csv", 10),
]


def files(name: str) -> Texts:
    return with_side_car() if name == "side_car" else originals(name)


@pytest.mark.parametrize("name", ["five_bar", "side_car", slow("rps3"), slow("gough_stewart")])
def test_the_files_are_good_as_they_stand(tmp_path: Path, name: str) -> None:
    assert went_through(tmp_path, files(name), "as it stands")


FEW = [
    ("five_bar", ".urdf", 12), ("five_bar", ".model.toml", 8), ("five_bar", ".csv", 8),
    ("side_car", ".yaml", 8), ("rps3", ".csv", 5),
]  # fmt: skip


@pytest.mark.parametrize(
    ("name", "ending", "count", "seed"),
    [
        *((*case, 0) for case in FEW),
        *(slow(*case, seed) for case in CASES for seed in (0, 1)),
        *(fuzz(*case, seed) for case in CASES for seed in range(2, 5)),
    ],
)
def test_mutations(tmp_path: Path, name: str, ending: str, count: int, seed: int) -> None:
    """Of so many mutations of one of a robot's files, some come through."""
    draw = random.Random(f"{name}{ending}{seed}")
    texts = files(name)
    through = 0
    for number in range(count):
        mutate = draw.choice(MUTATORS[ending])
        mutated = {**texts, ending: mutate(texts[ending], draw)}
        case = f"{name}{ending}, seed {seed}, case {number}: {mutate.__name__}"
        through += went_through(tmp_path, mutated, case)
    assert seed or 0 < through < count, "mutations must hit, and must not hit always"
