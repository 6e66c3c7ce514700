"""Scenes and studies whose numbers are changed by a factor: most of them run, and their results are finite.

The fuzz of absurd numbers (`tests/scenes/test_fuzz_scenes.py`) mostly ends in the schema. Here the numbers
stay valid, so that at least half of the cases must get through; the others are refused in one line.
"""

import random
import re
from pathlib import Path

import numpy as np
import pytest

from hybridyn.studies.sweep.designs import Designs
from hybridyn.studies.sweep.evaluation import Chunk, Row, evaluate
from hybridyn.studies.sweep.reading import read_study
from tests.samples import fuzz, slow
from tests.scenes import test_fuzz_scenes as parts
from tests.studies.test_sweep import pendulum_in
from tests.waiting import outcome

FACTORS = (0.0, 1e-6, 0.1, 0.5, 0.9, 1.0, 1.1, 2.0, 10.0, -1.0)
#: Designs of a study that are evaluated.
DESIGNS = 2
PARAMETERS = (
    "length = { range = [0.5, 1.5], steps = 3 }\n",
    "mass = { range = [1.0, 4.0], steps = 2 }\n",
    "rod = { scale_inertia = 'rod', range = [0.5, 2.0], steps = 2 }\n",
)
METHODS = ("method = 'grid'\n", "method = 'sobol'\ncount = 4\n", "method = 'random'\ncount = 4\nseed = 3\n",
           "method = 'latin_hypercube'\ncount = 5\n", "method = 'morris'\ncount = 2\n",
           "method = 'saltelli'\ncount = 2\n")  # fmt: skip
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


def first_rows(path: Path) -> tuple[Row, ...]:
    """Evaluate the first designs of a study."""
    source = read_study(path)
    designs = Designs(source)
    return evaluate(source, Chunk(0, designs.values(0, min(designs.count, DESIGNS)))).rows


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
    ("first", "count"), [(0, 20), slow(1000, 200), *(fuzz(1000 + 200 * block, 200) for block in range(1, 16))]
)
def test_valid_scenes(tmp_path: Path, first: int, count: int) -> None:
    assert parts.played(tmp_path, range(first, first + count), scene) >= count / 2


@pytest.mark.parametrize(
    ("first", "count"), [(0, 4), slow(1000, 40), *(fuzz(1000 + 40 * block, 40) for block in range(1, 16))]
)
def test_valid_studies(tmp_path: Path, first: int, count: int) -> None:
    assert studies(tmp_path, first, count) >= count / 2
