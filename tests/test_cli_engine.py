"""The engine of the command line: chosen by a rule that is told, the same numbers by both."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridyn.cli.engine as engine
from hybridyn.cli import main
from hybridyn.shipped import shipped_robots
from tests.compiled_toys import own_cache

__all__ = ["own_cache"]

#: Both engines are exact to rounding; the table's numbers have 17 digits.
AGREE = 1e-10


def run(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """Run a command that succeeds; gives what it says."""
    assert main(list(words)) == 0
    return capsys.readouterr().err


def numbers(path: Path) -> Any:
    return np.loadtxt(path, delimiter=",", skiprows=1)


def same(one: Path, other: Path) -> bool:
    """Compare two tables, the first column of which is the time."""
    a, b = numbers(one)[:, 1:], numbers(other)[:, 1:]
    return bool(np.abs(a - b).max() <= AGREE * np.abs(a).max())


def test_both_engines_give_the_same_tables(own_cache: None, tmp_path: Path, capsys: Any) -> None:
    tables = {}
    for name in ("general", "compiled"):
        tables[name] = tmp_path / f"{name}.csv"
        said = run(capsys, "idm", "tanev", "--engine", name, "-o", str(tables[name]))
        assert f"engine: {name} (as asked)" in said
    assert same(tables["general"], tables["compiled"])


def test_several_processes_share_what_was_built(own_cache: None, tmp_path: Path, capsys: Any) -> None:
    one, two = tmp_path / "one.csv", tmp_path / "two.csv"
    run(capsys, "idm", "tanev", "--engine", "compiled", "-o", str(one))
    said = run(capsys, "idm", "tanev", "--engine", "compiled", "-j", "2", "-o", str(two))
    assert "in 2 processes" in said
    assert same(one, two)


def test_small_tables_are_not_worth_it(own_cache: None, tmp_path: Path, capsys: Any) -> None:
    said = run(capsys, "idm", "tanev", "-o", str(tmp_path / "efforts.csv"))
    assert "engine: general (" in said
    assert "compiled from 3,000,000 on)" in said


def test_large_tables_are(
    own_cache: None, tmp_path: Path, capsys: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(engine, "WORTH", 20_000)
    said = run(capsys, "idm", "tanev", "-o", str(tmp_path / "efforts.csv"))
    assert "engine: compiled (" in said
    reactions = str(tmp_path / "reactions.csv")
    said = run(capsys, "idm", "tanev", "-o", str(tmp_path / "efforts.csv"), "--reactions", reactions)
    assert "engine: general (compiled models cannot do: --reactions)" in said


def test_what_compiled_models_cannot_do_is_refused(tmp_path: Path, capsys: Any) -> None:
    output = str(tmp_path / "efforts.csv")
    assert main(["idm", "tanev", "--engine", "compiled", "--passive", "solved", "-o", output]) == 1
    assert "cannot do: --passive solved; use --engine general" in capsys.readouterr().err


def test_without_a_compiler_the_general_path_works(
    tmp_path: Path, capsys: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def none() -> Any:
        raise engine.HybridynError("no C compiler was found: install gcc")

    monkeypatch.setattr("hybridyn.compiled.model.find_compiler", none)
    output = str(tmp_path / "efforts.csv")
    assert main(["idm", "tanev", "--engine", "compiled", "-o", output]) == 1
    assert "install gcc" in capsys.readouterr().err
    monkeypatch.setattr(engine, "WORTH", 20_000)
    said = run(capsys, "idm", "tanev", "-o", output)
    assert "engine: general (not compiled: no C compiler was found" in said


def test_the_direct_model_too(own_cache: None, tmp_path: Path, capsys: Any) -> None:
    """A motion's own states and efforts give its accelerations back, by both engines."""
    efforts, states = tmp_path / "efforts.csv", tmp_path / "states.csv"
    run(capsys, "idm", "tanev", "-o", str(efforts))
    trajectory = shipped_robots()["tanev"].trajectory
    assert trajectory
    left = Path(trajectory).read_text().splitlines()
    right = [line.split(",", 1)[1] for line in efforts.read_text().splitlines()]
    states.write_text("\n".join(f"{a},{b}" for a, b in zip(left, right, strict=True)) + "\n")
    tables = {name: tmp_path / f"{name}.csv" for name in ("general", "compiled")}
    for name, table in tables.items():
        said = run(capsys, "ddm", "tanev", str(states), "--engine", name, "-o", str(table))
        assert f"engine: {name} (as asked)" in said
    assert same(tables["general"], tables["compiled"])


def test_simulations_too(own_cache: None, tmp_path: Path, capsys: Any) -> None:
    scene = tmp_path / "fall.toml"
    scene.write_text(
        f'duration = 0.2\n[robot]\nfile = "{shipped_robots()["five_bar"].file}"\n'
        "[initial]\njoints = { m1_left_drive = 0.5, m1_right_drive = 0.2 }\n"
        '[solver]\nmethod = "rk4"\nstep = 1e-2\n'
    )
    tables = {name: tmp_path / f"{name}.csv" for name in ("general", "compiled")}
    for name, table in tables.items():
        said = run(capsys, "simulate", str(scene), "--engine", name, "-o", str(table))
        assert f"engine: {name} (as asked)" in said
        head = [line for line in table.read_text().splitlines() if line.startswith("#")]
        assert f"# engine: {name} (as asked)" in head
    a, b = (np.genfromtxt(table, delimiter=",", comments="#", skip_header=5) for table in tables.values())
    assert np.nanmax(np.abs(a - b)) <= AGREE * np.nanmax(np.abs(a))
    said = run(capsys, "simulate", str(scene), "-o", str(tables["general"]))
    assert "engine: general (320 samples times freedoms; compiled from 200,000 on)" in said
