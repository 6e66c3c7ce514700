"""What effects cost: the study of `hybridyn cost`, over our robots along their own motions."""

from __future__ import annotations

from benchmarks.cases import ROOT, case_of
from benchmarks.results import Row
from hybridyn.effects.choice import choose
from hybridyn.streams.one_pass import read_postures
from hybridyn.studies.cost.models import Trajectory, study_models

#: Robots whose files state more effects than those that are on by default.
ROBOTS = ("five_bar", "gough_stewart", "lx4")


def measure(case: str, rows: int | None = None) -> list[Row]:
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
