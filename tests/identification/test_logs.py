"""Logs as they come: from rosbags, from PlotJuggler, in milliseconds."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.errors import TrajectoryError
from hybridyn.identification.logs import read_log
from tests.identification.logs import PERIOD, Table, case
from tests.support.extras import needs
from tests.support.samples import slow

BAND = 2.0
#: Base parameters from splines, of the largest: motions of 1.25 Hz, 200 samples a second.
SPLINES = 1e-6


def off(found: hybridyn.Identification) -> float:
    """Return the largest error of base parameters, of the largest."""
    base = case("five_bar").base
    return float(np.abs(found.values - base).max() / np.abs(base).max())


def at(time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and efforts of the robot's motors at other times, exactly."""
    one = case("five_bar")
    rate = 2 * np.pi / PERIOD * np.arange(6)
    bases = [np.hstack([np.cos(np.outer(t, rate)), np.sin(np.outer(t, rate[1:]))]) for t in (one.time, time)]
    x, x_dot, x_ddot = (np.linalg.lstsq(bases[0], level)[0] for level in one.motion)
    motion = bases[1] @ x, bases[1] @ x_dot, bases[1] @ x_ddot
    q, v, a = hybridyn.assemble(one.robot, motors=motion, guess=one.robot.home)
    return motion[0], hybridyn.idm(one.true, q, v, a, effects="model")


def jittered(seed: int, count: int = 800) -> np.ndarray:
    """Return times of a rosbag: late by up to half a step, one in twenty lost."""
    rng = np.random.default_rng(seed)
    time = (np.arange(count) + 0.5 * rng.random(count)) * PERIOD / count
    return time[(rng.random(count) > 0.05) | (np.arange(count) % (count - 1) == 0)]


def columns(time: np.ndarray, form: str = "{}") -> Table:
    """Return a log at some times."""
    x, tau = at(time)
    out = {}
    for i, motor in enumerate(case("five_bar").robot.motors):
        out |= {form.format(f"{motor}/position"): x[:, i], form.format(f"{motor}/effort"): tau[:, i]}
    return out


def identified(log: Any, **words: Any) -> hybridyn.Identification:
    """Identify the robot from a log."""
    return hybridyn.identify(case("five_bar").robot, log, symmetric=True, **words)


@pytest.mark.parametrize("words", [{"period": PERIOD, "band": BAND}, {"band": 20.0}])
def test_uneven_times_are_resampled_and_the_report_says_so(words: dict[str, Any]) -> None:
    time = jittered(1)
    found = identified({"time": time} | columns(time), **words)
    assert off(found) <= (SPLINES if "period" in words else 1e-3)
    assert "times are uneven" in found.report()
    assert "times are uneven" in repr(found)
    assert len(repr(found)) < 2000
    assert "resampled by quintic splines to" in found.report()


def test_even_times_are_taken_as_they_are() -> None:
    log = read_log(case("five_bar").robot, case("five_bar").log())
    assert not log.remarks
    np.testing.assert_array_equal(log.position, case("five_bar").motion[0])


def plot_juggler(file: Path, topics: list[tuple[np.ndarray, Table]], start: float) -> None:
    """Write series as PlotJuggler exports them: the union of times, empty cells, %.6f and %.9f."""
    names = sorted(name for _, table in topics for name in table)
    rows: dict[str, dict[str, float]] = {}
    for time, table in topics:
        for i, t in enumerate(time):
            rows.setdefault(f"{start + t:.6f}", {}).update({name: own[i] for name, own in table.items()})
    lines = [",".join(["__time", *names])]
    for t in sorted(rows, key=float):
        lines.append(",".join([t, *(f"{rows[t][name]:.9f}" if name in rows[t] else "" for name in names)]))
    file.write_text("\n".join(lines) + "\n")


@pytest.mark.parametrize("start", [0.0, 1.7e9])
@pytest.mark.parametrize("topics", [1, 2])
def test_tables_of_plotjuggler_are_read(tmp_path: Path, start: float, topics: int) -> None:
    """Of joint states, and with efforts of a topic with a clock of its own, among columns of others."""
    times = jittered(2), jittered(3, 1000)
    parts = [columns(times[i], "/joint_states/{}") for i in range(topics)]
    series = [
        {name: own for name, own in part.items() if topics == 1 or name.endswith(end)}
        for part, end in zip(parts, ("position", "effort"), strict=False)
    ]
    other = {"/odom/twist/linear/x": np.arange(0, PERIOD, 0.03), "/imu/x": np.arange(0, PERIOD, 0.03)}
    file = tmp_path / "log.csv"
    plot_juggler(
        file, [*zip(times, series, strict=False), (np.arange(0, PERIOD, 0.03) + 1.7e-4, other)], start
    )
    found = identified(file, period=PERIOD, band=BAND)
    assert off(found) <= 1e-4  # times have six decimals
    assert any("resampled" in remark for remark in found.remarks)


def test_columns_that_nobody_asked_for_may_hold_anything(tmp_path: Path) -> None:
    """Texts with commas between quotes, names twice or none, infinite numbers."""
    log, file = case("five_bar").log(), tmp_path / "log.csv"
    rows = zip(*log.values(), strict=True)
    lines = [",".join(f"{x!r}" for x in map(float, row)) + ',"moving, fast",,inf' for row in rows]
    file.write_text("\n".join([",".join([*log, "phase", "", "phase"]), *lines]))
    found, wanted = (read_log(case("five_bar").robot, table) for table in (file, log))
    for one, other in (
        (found.time, wanted.time),
        (found.position, wanted.position),
        (found.effort, wanted.effort),
    ):
        np.testing.assert_array_equal(one, other)
    assert found.remarks == wanted.remarks


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_empty_cells_are_numbers_that_were_not_taken(tmp_path: Path, kind: str) -> None:
    """Of each column others, in a file as in a mapping."""
    one, rng = case("five_bar"), np.random.default_rng(4)
    lost = {
        name: np.where((rng.random(800) < 0.1) & (name != "time"), np.nan, own)
        for name, own in one.log().items()
    }
    file = tmp_path / f"log.{kind}"
    if kind == "parquet":
        polars = needs("io")
        polars.DataFrame(lost).fill_nan(None).write_parquet(file)
    else:
        rows = [
            ",".join("" if np.isnan(x) else repr(float(x)) for x in row)
            for row in zip(*lost.values(), strict=True)
        ]
        file.write_text("\n".join([",".join(lost), *rows]))
    found = [identified(log, period=PERIOD, band=BAND) for log in (file, lost)]
    np.testing.assert_array_equal(found[0].values, found[1].values)
    assert off(found[0]) <= SPLINES


@pytest.mark.parametrize(("factor", "unit"), [(1e3, "milli"), slow(1e6, "micro"), slow(1e9, "nano")])
@pytest.mark.parametrize("name", ["five_bar", slow("rps3"), slow("delta")])
@pytest.mark.parametrize("words", [{}, {"band": BAND}, {"period": PERIOD}, {"period": PERIOD, "band": BAND}])
def test_the_unit_of_times_is_asked_first(
    name: str, words: dict[str, float], factor: float, unit: str
) -> None:
    """Before band and period, which are in seconds, make the log something else."""
    log = case(name).log()
    log["time"] = factor * log["time"]
    with pytest.raises(TrajectoryError, match=rf"column 'time': .* {unit}seconds\? Times are in s"):
        hybridyn.identify(case(name).robot, log, symmetric=True, **words)


def test_a_slow_motion_does_not_tell_the_unit_but_the_samples_do() -> None:
    """Weight alone is the same in any time: what a band cannot be says that samples lie far apart."""
    one = case("five_bar")
    still = one.motion[0], 0 * one.motion[1], 0 * one.motion[2]
    tau = hybridyn.idm(one.robot, *hybridyn.assemble(one.robot, motors=still), effects="default")
    log = one.log(tau=tau) | {"time": 1e5 * one.time}
    for words, says in (({"band": BAND}, "band of 2 Hz"), ({"period": PERIOD}, "holds no harmonic")):
        with pytest.raises(TrajectoryError, match=rf"{says}.*milliseconds\? Times are in s"):
            hybridyn.identify(one.robot, log, symmetric=True, effects=None, **words)


def test_what_is_missing_is_named_with_what_is_there() -> None:
    log = case("five_bar").log()
    log["times"] = log.pop("time")
    with pytest.raises(TrajectoryError, match=r"column 'time': is missing \(did you mean 'times'"):
        identified(log)
