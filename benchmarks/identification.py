"""Identification beside figaroh, on serial arms of example-robot-data: base parameters, and times of both.

    python -m benchmarks.identification          prints a table; needs figaroh and example-robot-data

Both have the same samples; processor times are interleaved. Our base parameters are expressed by the columns
that figaroh chose.
"""

from collections.abc import Callable
from importlib.metadata import files
from pathlib import Path
from time import process_time
from types import SimpleNamespace

import numpy as np

import hybridyn
from benchmarks.timing import interleaved
from hybridyn.identification.base_parameters import random_motions

#: Files of serial arms, and samples.
ARMS = ("ur5_robot.urdf", "kinova.urdf", "talos_left_arm.urdf", "xarm7.urdf", "z1.urdf")
SAMPLES, ROUNDS = 1000, 9


def arm(name: str) -> hybridyn.HybridRobot:
    """Load an arm."""
    file = next(file for file in files("example-robot-data") or () if file.name == name)
    return hybridyn.load(Path(str(file.locate())))


def compared(robot: hybridyn.HybridRobot) -> tuple[tuple[int, int], float, list[Callable[[], object]]]:
    """Compute the base parameters of an arm by both.

    Returns:
        Our rank and figaroh's, the largest difference of values, of the largest value, and the calls that
        compute regressors and base parameters, ours first.
    """
    from figaroh.tools.qrdecomposition import get_baseParams
    from figaroh.tools.regressor import RegressorBuilder, RegressorConfig, eliminate_non_dynaffect

    states, model = random_motions(robot, SAMPLES), robot.model
    builder = RegressorBuilder(SimpleNamespace(model=model, data=model.createData()), RegressorConfig())
    every = np.concatenate([body.toDynamicParameters() for body in list(model.inertias)[1:]])
    values = {str(i): value for i, value in enumerate(every)}

    def rows() -> np.ndarray:
        """Compute figaroh's regressor."""
        return np.asarray(builder.build_basic_regressor(*states, {"act_idxv": range(model.nv)}))

    def base() -> list[int]:
        """Compute figaroh's base parameters; return their columns."""
        reduced, kept = eliminate_non_dynaffect(rows(), values)
        return [int(kept[i]) for i in get_baseParams(reduced, kept, values)[2]]

    own, theirs, Y = hybridyn.base_parameters(robot), base(), rows()
    wanted = np.linalg.lstsq(Y[:, theirs], Y @ every)[0]
    off = np.linalg.lstsq(own.combination[:, theirs], own.values)[0] - wanted
    return (
        (own.rank, len(theirs)), float(np.abs(off).max() / np.abs(wanted).max()),
        [lambda: hybridyn.regressor(robot, *states), rows, lambda: hybridyn.base_parameters(robot), base],
    )  # fmt: skip


def main() -> None:
    """Print the table."""
    print("| arm | rank | figaroh's | values differ by | rows [ms] | figaroh's | base [ms] | figaroh's |")
    print(f"|{'---|' * 8}")
    for name in ARMS:
        ranks, off, calls = compared(arm(name))
        times = (f"{1e3 * least:.3g}" for least, _ in interleaved(calls, ROUNDS, clock=process_time))
        print("", name, *ranks, f"{off:.1e}", *times, "", sep=" | ")


if __name__ == "__main__":
    main()
