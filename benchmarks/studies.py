"""What hybridyn's own studies say and cost.

Effects are those of `hybridyn cost`, over our robots along their own motions. Sweeps are those of the
five-bar by the general path, each in a program of its own, by processor time with all child processes, in
which a busy machine shows little.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from benchmarks.cases import ROOT, case_of
from benchmarks.results import Row
from benchmarks.timing import spent
from hybridyn.effects.choice import choose
from hybridyn.streams.one_pass import read_postures
from hybridyn.studies.cost.measured import Trajectory
from hybridyn.studies.cost.variants import study_models

#: Robots whose files state more effects than those that are on by default.
ROBOTS = ("five_bar", "gough_stewart", "lx4")

#: Postures of a design; a table with fewer rows takes longer, because steps between its rows are divided.
POSTURES = (81, 4001)
STUDY = """[robot]
file = "five_bar"
[designs]
method = "sobol"
count = {designs}
seed = 1
[parameters]
upper_length = {{ range = [0.22, 0.30] }}
lower_length = {{ range = [0.38, 0.45] }}
[tasks.pick]
trajectory = "pick.csv"
measure = ["peak_effort"]
"""


def effects(case: str, rows: int | None = None) -> list[Row]:
    """Return each effect's change of the efforts, and its share of the operations.

    Args:
        case: A shipped robot.
        rows: Rows of its trajectory that are taken, None for all.
    """
    robot = case_of(case).load()
    _, (motion, q, v, a) = read_postures(robot, str(ROOT / "models" / case / "traj.csv"))
    trajectory = Trajectory(q[:rows], v[:rows], a[:rows], None if motion.time is None else motion.time[:rows])
    worth = study_models(robot, trajectory, choose(robot, "model")).worth
    return [Row(case, "idm", one.effect, error=one.error, value=one.share) for one in worth]


def sweeps(few: int, many: int) -> list[Row]:
    """Sweep few and many designs with few and many postures in one process, then many in two."""
    runs = [(1, designs, postures) for designs in (few, many) for postures in POSTURES]
    return [run(*one) for one in (*runs, (2, many, POSTURES[0]))]


def run(workers: int, designs: int, postures: int) -> Row:
    """Run a sweep in a program of its own.

    Raises:
        RuntimeError: It failed.
    """
    with tempfile.TemporaryDirectory() as place:
        Path(place, "study.toml").write_text(STUDY.format(designs=designs))
        t = np.linspace(0.0, 0.8, postures)
        tau = 1 - np.abs(t / 0.4 - 1)
        s = tau**3 * (10 - 15 * tau + 6 * tau**2)
        rows = np.column_stack([t, -0.15 + 0.3 * s, -0.48 + 0.96 * (s * (1 - s)) ** 2])
        header = "time,m1_tool/pose/x,m1_tool/pose/z"
        np.savetxt(Path(place, "pick.csv"), rows, "%.6f", ",", header=header, comments="")
        words = f"sweep --engine general study.toml -o out --jobs {workers}"
        processor, wall, _ = spent(["-m", "hybridyn", *words.split()], cwd=place)
    row = Row("five_bar", "sweep", "loky", at=designs, batch=postures, threads=workers)
    return row._replace(seconds=processor, value=wall, unit="s by the clock")
