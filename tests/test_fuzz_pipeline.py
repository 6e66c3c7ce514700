"""No mutation of a robot's files, of its table or of a study ends in a traceback, a hang or a wrong posture.

Seeded mutations of shipped robots as URDF, of the files beside it, and of a short trajectory go the whole
way: read, load, assemble, inverse model. What comes through has finite efforts, loops that the oracle finds
closed, and motors where the table says; efforts of odd robots are judged in `test_fuzz_mechanisms`.

The fuzz of absurd numbers (`tests/scenes/test_fuzz_scenes.py`) mostly ends in the schema. The numbers of the
scenes and studies here stay valid, so that at least half of the cases must get through; the others are
refused in one line.
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
from hybridyn.studies.sweep.compiled_chunks import evaluate_chunk
from hybridyn.studies.sweep.designs import designs_of
from hybridyn.studies.sweep.evaluation import Chunk, DesignRow
from hybridyn.studies.sweep.reading import read_study
from hybridyn.tables.columns import read_layout
from hybridyn.tables.opening import open_table
from hybridyn.tables.trajectory import read_motions
from tests import ROOT
from tests.oracle import Oracle
from tests.robots.mutations import FLAT, TREE, change_number, swap_values
from tests.robots.posing import position
from tests.scenes import test_fuzz_scenes as parts
from tests.studies.test_sweep import pendulum_in
from tests.support.files import expanded
from tests.support.samples import fuzz, slow
from tests.support.waiting import outcome

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


FACTORS = (0.0, 1e-6, 0.1, 0.5, 0.9, 1.0, 1.1, 2.0, 10.0, -1.0)
#: Designs of a study that are evaluated.
DESIGNS = 2
PARAMETERS = (
    "length = { range = [0.5, 1.5], steps = 3 }\n",
    "mass = { range = [1.0, 4.0], steps = 2 }\n",
    "rod = { scale_inertia = 'rod', range = [0.5, 2.0], steps = 2 }\n",
)
METHODS = ("method = 'grid'\n", "method = 'sobol'\ncount = 4\n", "method = 'random'\ncount = 4\nseed = 3\n",
           "method = 'latin_hypercube'\ncount = 5\n")  # fmt: skip
TASKS = (
    "trajectory = 'swing.csv'\nmeasure = { top = 'peak_effort', rms = 'rms_effort' }\n",
    "trajectory = 'swing.csv'\neffects = ['default', 'viscous_friction']\n"
    "measure = ['rms_effort', 'peak_speed', 'stroke_margin']\n",
    "scene = 'fall.toml'\nmeasure = { t = 'time', top = 'final turn/velocity', e = 'max energy/kinetic' }\n",
)
FALL = """duration = 0.05
[robot]
file = "pendulum.urdf.xacro"
[initial]
joints = { turn = 0.2 }
[effects.damper]
coefficient = { turn = 0.3 }
[solver]
method = "rk4"
step = 0.01
"""


def scaled(text: str, draw: random.Random) -> str:
    """Multiply one to three of a text's numbers by a factor."""
    for _ in range(draw.choice([1, 1, 2, 3])):
        found = draw.choice(list(re.finditer(r"(?<![\w.\"])-?\d+\.\d+", text)))
        number = f"{float(found[0]) * draw.choice(FACTORS):.9f}"
        text = text[: found.start()] + number + text[found.end() :]
    return text


def scene(number: int) -> str:
    """Draw a scene, and scale some of its numbers."""
    draw = random.Random(f"valid scene {number}")
    kinds = (parts.CONTROLLERS, parts.EFFECTS, parts.SOLVERS, parts.OUTPUTS, parts.EVENTS)
    head = parts.HEAD.replace("BASE", "fixed") + draw.choice(["", parts.START])
    return scaled(head + "".join(map(draw.choice, kinds)), draw)


def first_rows(path: Path) -> tuple[DesignRow, ...]:
    """Evaluate the first designs of a study."""
    source = read_study(path)
    return evaluate_chunk(source, Chunk(0, designs_of(source)[:DESIGNS]), None).rows


def studies(folder: Path, first: int, count: int) -> int:
    """Evaluate the first designs of studies; return how many ran."""
    pendulum_in(folder)
    path, through = folder / "study.toml", 0
    for number in range(first, first + count):
        draw = random.Random(f"valid study {number}")
        (folder / "fall.toml").write_text(scaled(FALL, draw))
        chosen = {line.split()[0]: line for line in draw.sample(PARAMETERS, draw.choice([1, 2]))}
        text = "[robot]\nfile = 'pendulum.urdf.xacro'\n[designs]\n" + draw.choice(METHODS) + "[parameters]\n"
        text = scaled(text + "".join(chosen.values()), draw) + "[tasks.one]\n" + draw.choice(TASKS)
        path.write_text(text)
        rows, refused = outcome(f"study {number}\n{text}", lambda: first_rows(path))
        if refused:
            continue
        good = [row for row in rows if row.status == "ok"]
        assert all(np.isfinite(row.values).all() for row in rows), f"study {number}\n{text}"
        assert all(np.isfinite(row.measures).all() for row in good), f"study {number}\n{text}"
        through += bool(good)
    return through


@pytest.mark.parametrize(
    ("first", "count"), [(0, 10), slow(1000, 200), *(fuzz(1000 + 200 * block, 200) for block in range(1, 16))]
)
def test_valid_scenes(tmp_path: Path, first: int, count: int) -> None:
    assert parts.played(tmp_path, range(first, first + count), scene) >= count / 2


@pytest.mark.parametrize(
    ("first", "count"), [(0, 4), slow(1000, 40), *(fuzz(1000 + 40 * block, 40) for block in range(1, 16))]
)
def test_valid_studies(tmp_path: Path, first: int, count: int) -> None:
    assert studies(tmp_path, first, count) >= count / 2
