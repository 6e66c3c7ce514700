"""The benchmarks' own arithmetic: the gate refuses, results survive their file, the report is theirs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.__main__ import COMMITTED
from benchmarks.cases import LX4_TRAJECTORY, stack_motion, write_long_trajectory
from benchmarks.gate import DDM_LIMIT, WrongModelError, refuse, relative
from benchmarks.report import exponent, report
from benchmarks.results import Result, read_machine, read_results, write_results
from benchmarks.slow import table

FIT = 1e-12  # a power law is fitted exactly
DIFFERENCES = 1e-3  # of the largest rate: second-order central differences at 5 ms of a motion of 1 Hz


@pytest.mark.parametrize("error", [2 * DDM_LIMIT, float("nan")])
def test_gate_refuses_a_wrong_model(error: float) -> None:
    with pytest.raises(WrongModelError, match=r"ddm of 4 modules: error .*, limit 1e-10"):
        refuse(error, DDM_LIMIT, "ddm of 4 modules")


def test_error_is_relative_to_the_largest_entry() -> None:
    assert relative(np.array([1.0, 100.0]), np.array([2.0, 100.0])) == 0.01


def test_exponent_of_a_power_law() -> None:
    sizes = [1, 2, 4, 8, 16]
    costs = [99.0, 99.0, *(3.0 * n**1.5 for n in sizes[2:])]  # small cases do not count
    assert abs(exponent(sizes, costs) - 1.5) < FIT


def test_results_survive_their_file(tmp_path: Path) -> None:
    results = [
        Result("stack", "modules", 4, "idm time", 123.456, "us per sample"),
        Result("main job on 2 cores", "rows", 1000, "wall time", 1.5, "s"),
    ]
    write_results(tmp_path / "results.csv", results)
    assert read_results(tmp_path / "results.csv") == results


def test_committed_report_is_that_of_the_committed_results() -> None:
    folder = COMMITTED / "results"
    expected = report(read_results(folder / "results.csv"), read_machine(folder / "machine.csv"))
    assert (COMMITTED / "report.md").read_text() == expected, "run python -m benchmarks --report"


def test_rates_of_the_motion_are_its_derivatives() -> None:
    for pose, twist, acceleration in stack_motion(2, 50).values():
        for value, rate in ((pose[:, :3], twist[:, :3]), (twist, acceleration)):
            found = (value[2:] - value[:-2]) / 0.01
            assert np.abs(found - rate[1:-1]).max() < DIFFERENCES * np.abs(rate).max()


def test_long_trajectory_repeats_the_shipped_one(tmp_path: Path) -> None:
    path = tmp_path / "long.csv"
    write_long_trajectory(path, 1500)
    long = np.loadtxt(path, delimiter=",", skiprows=1)
    short = np.loadtxt(LX4_TRAJECTORY, delimiter=",", skiprows=1)
    assert long.shape == (1500, short.shape[1])
    assert np.array_equal(long[1000:, 1:], short[:500, 1:])
    assert np.allclose(np.diff(long[:, 0]), 0.005)


def test_slow_tests_are_summed_up_by_function() -> None:
    record = """<testsuites><testsuite>
    <testcase classname="tests.test_b" name="test_x[1]" time="1.5"/>
    <testcase classname="tests.test_b" name="test_x[2]" time="2.0"><failure message="no"/></testcase>
    <testcase classname="tests.test_a" name="test_y" time="0.25"/></testsuite></testsuites>"""
    assert table(record) == [("test_a.py", "test_y", 1, 0, "0.2"), ("test_b.py", "test_x", 2, 1, "3.5")]
