"""Sweeps with gradients: rows, shards, processes and questions."""

import math
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.studies.sweep.best import find_best
from hybridyn.studies.sweep.gradients import StudyGradients
from hybridyn.studies.sweep.reading import read_study
from hybridyn.studies.sweep.shards import read_shards
from tests.studies.test_study_gradients import STUDY as LOOP
from tests.studies.test_study_gradients import TWO, with_tip
from tests.studies.test_study_gradients import study as written_loop
from tests.studies.test_sweep import ANGLE, GRID, effort, folder, written
from tests.support.command_line import call
from tests.support.comparing import close_to, refused
from tests.support.extras import needs

__all__ = ["folder"]
needs("compiled")
needs("sweep")
#: Polynomials through the numbers of the xacro file.
AGREE = 1e-10
BOTH = '["peak_effort", "rms_effort"]'
ONE = "length = { values = [0.5, 1.5] }\nrod = { scale_inertia = 'rod', values = [2.0] }"


def test_columns_are_the_derivatives_of_the_equation(folder: Path) -> None:
    state = hybridyn.sweep(written("method = 'grid'", GRID, BOTH), "out", jobs=1, gradient=True)
    assert (state.now, state.compiled, state.why_general) == (6, 0, "gradients are those of single designs")
    found = read_shards("out")
    assert found.columns[4:] == [
        "peak_effort", "rms_effort", "peak_effort.d_length", "peak_effort.d_rod", "rms_effort.d_length",
        "rms_effort.d_rod", "closing", "closing.d_length", "closing.d_rod", "conditioning",
        "conditioning.d_length", "conditioning.d_rod", "message",
    ]  # fmt: skip
    for row in found.iter_rows(named=True):
        length, rod = row["length"], row["rod"]
        tau = effort(length, rod)
        k, by_length = int(np.abs(tau).argmax()), 4 * rod * length * -ANGLE - 2 * rod * 9.81 * np.cos(ANGLE)
        assert row["peak_effort.d_rod"] == pytest.approx(row["peak_effort"] / rod, rel=AGREE)
        assert row["peak_effort.d_length"] == pytest.approx(np.sign(tau[k]) * by_length[k], rel=AGREE)
        assert row["rms_effort.d_rod"] == pytest.approx(row["rms_effort"] / rod, rel=AGREE)
        assert row["closing"] == row["conditioning"] == math.inf  # no loops
    best = find_best("out", "-peak_effort.d_length", "rms_effort.d_rod > 0")
    assert best.columns == ("design", "length", "rod", "peak_effort", "rms_effort", "-peak_effort.d_length")


@pytest.mark.slow
def test_rows_are_the_same_bit_for_bit_in_several_processes(tmp_path: Path) -> None:
    written_loop(tmp_path, 'measure = ["rms_effort", "peak_speed"]', LOOP.replace("count = 4", "count = 12"))
    for jobs in (1, 2):
        hybridyn.sweep(tmp_path / "study.toml", tmp_path / f"by{jobs}", jobs=jobs, gradient=True)
    one, two = (read_shards(tmp_path / f"by{jobs}") for jobs in (1, 2))
    assert one.equals(two)
    assert one["closing.d_gap"].is_not_null().sum() == (one["status"] == "ok").sum() > 6
    of = StudyGradients(read_study(tmp_path / "study.toml"))
    for row in one.filter(one["status"] == "ok").iter_rows(named=True):
        found = of(np.array([row[name] for name in of.source.study.parameters]))
        close_to(found.gradient[0], [row[f"rms_effort.d_{x}"] for x in of.source.study.parameters], 1e-12)
        close_to(found.closing, row["closing"], 1e-12)
        close_to(found.conditioning, row["conditioning"], 1e-12)


def test_a_run_continues_with_the_same_models(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hybridyn.studies.sweep.sweep.CHUNK_SECONDS", 1e-9)  # a design is a shard
    study = written("method = 'grid'", GRID.replace("0.5, 1.5", "-1e308, 0.5"))
    hybridyn.sweep(study, "whole", jobs=1, gradient=True)
    whole = read_shards("whole")
    assert whole["peak_effort.d_rod"].is_null().to_list() == [True] * 3 + [False] * 3  # no such pendulum
    next(iter(sorted(Path("whole").glob("*.parquet"))[2:])).unlink()
    refused(lambda: hybridyn.sweep(study, "whole", jobs=1, resume=True), hybridyn.HybridynError, "gradient")
    assert hybridyn.sweep(study, "whole", jobs=1, resume=True, gradient=True).now == 1
    monkeypatch.setattr(StudyGradients, "row", None)  # nothing is left to evaluate
    assert hybridyn.sweep(study, "whole", jobs=1, resume=True, gradient=True).now == 0
    assert read_shards("whole").equals(whole)


def test_a_parameter_without_slots_is_named_beside_designs_out_of_reach(tmp_path: Path) -> None:
    with_tip(tmp_path, "tip$(arg upper_mass)", "0.1")
    written_loop(tmp_path, 'measure = ["energy"]', TWO.format("0.05, 0.25"))
    run = partial(hybridyn.sweep, tmp_path / "study.toml", tmp_path / "out", jobs=1, gradient=True)
    refused(run, hybridyn.HybridynError, "no design can be evaluated .*the links are others")


@pytest.mark.parametrize(
    ("measure", "says"),
    [
        ('{ closing = "peak_effort" }', "'closing' is a column of gradients"),
        ('{ x = "own.py:cost" }', "no design can be evaluated .*'own.py:cost' has no gradient"),
    ],
)
def test_what_has_no_gradient_is_refused_in_one_line(measure: str, says: str, folder: Path) -> None:
    study = written("method = 'grid'", ONE, measure)
    Path("own.py").write_text("def cost(robot, motion): return 1.0")
    run = partial(hybridyn.sweep, study, "out", jobs=1, gradient=True, allow_python=True)
    refused(run, hybridyn.HybridynError, says)


def test_without_casadi_it_is_one_line(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    study = written("method = 'grid'", ONE)
    real = hybridyn.compiled.failures.importlib.util.find_spec  # type: ignore[attr-defined]
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None if name == "casadi" else real(name))
    refused(
        lambda: hybridyn.sweep(study, "out", jobs=1, gradient=True), hybridyn.HybridynError, "needs CasADi"
    )
    assert not Path("out").exists()


def test_the_command_writes_and_asks_gradients(folder: Path, capsys: Any) -> None:
    written("method = 'grid'", ONE)
    words = ("sweep", "study.toml", "-o", "out", "--jobs", "1", "--gradient")
    done = call(capsys, *words, "--best", "-peak_effort.d_rod")
    assert "gradients are those of single designs" in done.err
    assert "-peak_effort.d_rod" in done.out
    assert "belongs to a STUDY" in call(capsys, "sweep", "--best", "x", "--gradient", status=2).err
    words = ("sweep", "study.toml", "--gradient", "--engine", "compiled")
    assert "--gradient goes without" in call(capsys, *words, status=2).err
