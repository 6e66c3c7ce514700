"""The documentation builds, complete and without a warning; the examples run, check their claims, draw."""

import importlib
import inspect
import os
import re
import subprocess
import sys
from html import unescape
from pathlib import Path
from pkgutil import resolve_name

import click
import pytest

import hybridyn
from hybridyn.cli import COMMANDS, commands
from tests import ROOT
from tests.support.extras import needs
from tests.support.samples import some

DOCS = ROOT / "docs"


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the pages as the README says, warnings being errors."""
    needs("docs")
    out = tmp_path_factory.mktemp("docs")
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "sphinx",
            "-W",
            "--keep-going",
            "-q",
            "-E",
            "-d",
            str(out / "trees"),
            "docs",
            str(out),
        ],
        cwd=ROOT,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return out


def text_of(page: Path) -> str:
    return unescape(re.sub(r"<[^>]+>", "", page.read_text()))


@pytest.mark.slow
def test_every_command_and_option_has_its_place(built: Path) -> None:
    page = text_of(built / "commands.html")
    for name in COMMANDS:
        command = commands.get_command(click.Context(commands), name)
        assert f"Usage: hybridyn {name} " in page, name
        assert command is not None
        for parameter in command.params:
            if isinstance(parameter, click.Option) and not parameter.hidden:
                assert parameter.opts[-1] in page, (name, parameter.opts)


@pytest.mark.slow
def test_every_public_name_has_its_place(built: Path) -> None:
    page = (built / "python.html").read_text()
    for name in set(hybridyn.__all__) - {"__version__"}:
        assert f'id="hybridyn.{name}"' in page, name
    for method in ("idm", "assemble", "mass_matrix"):  # its own, and inherited ones
        assert f'id="hybridyn.CompiledRobot.{method}"' in page, method


def test_every_page_is_in_the_table_of_contents() -> None:
    named = set(re.findall(r"^[\w/-]+$", (DOCS / "index.md").read_text(), re.MULTILINE))
    found = [*DOCS.glob("*.md"), *DOCS.glob("*.rst"), *DOCS.glob("notebooks/*.ipynb")]
    pages = {page.relative_to(DOCS).with_suffix("").as_posix() for page in found} - {"index"}
    assert pages <= named
    assert named - pages == {"examples/index"}


def equations() -> list[tuple[str, str, str]]:
    """Return equations, function and file of each row of the theory page's table."""
    text = (DOCS / "theory.md").read_text()
    return re.findall(
        r"^\| (\([^|]+) \| [^|]+ \| `hybridyn\.([\w.]+)` \| `([\w/.]+)` \|$", text, re.MULTILINE
    )


@pytest.mark.parametrize(("numbers", "name", "file"), equations())
def test_equations_are_where_the_theory_says(numbers: str, name: str, file: str) -> None:
    function = resolve_name(f"hybridyn.{name}")
    assert callable(function)
    assert Path(inspect.getsourcefile(inspect.unwrap(function)) or "") == ROOT / file


def test_every_equation_of_the_paper_has_its_row() -> None:
    found: set[int] = set()
    for numbers, _, _ in equations():
        for first, last in re.findall(r"\((\d+)\)(?:-\((\d+)\))?", numbers):
            found |= set(range(int(first), int(last or first) + 1))
    assert {2, 6, *range(8, 12), 13, *range(15, 18), *range(24, 27), *range(28, 34), *range(38, 49)} <= found
    assert {51, 53, *range(54, 76)} <= found


def tagged() -> dict[int, str]:
    """Return files and lines that name each equation of the paper in a comment, as the page writes them."""
    found: dict[int, dict[str, list[str]]] = {}
    for path in sorted((ROOT / "hybridyn" / "dynamics").glob("*.py")):
        for number, line in enumerate(path.read_text().split("\n"), 1):
            for equation in re.findall(r"\((\d+)\)", line.partition("# Eq")[2]):
                lines = found.setdefault(int(equation), {}).setdefault(str(path.relative_to(ROOT)), [])
                lines.append(str(number))
    return {n: "; ".join(f"`{f}` {', '.join(at)}" for f, at in places.items()) for n, places in found.items()}


def test_equations_of_the_models_stand_in_the_lines_that_the_theory_names() -> None:
    text = (DOCS / "theory.md").read_text()
    stated = dict(re.findall(r"^\| \((\d+)\) \| [^|]+ \| (`hybridyn/dynamics/[^|]+) \|$", text, re.MULTILINE))
    assert {int(n): where for n, where in stated.items()} == {n: tagged()[n] for n in range(30, 54)}


FOLDER = ROOT / "docs" / "examples"
SCRIPTS = sorted(path.stem for path in FOLDER.glob("*.py") if path.stem != "pictures")
LARGEST = 150_000  # bytes of a committed picture


def run(name: str, words: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    if "hybridyn.sweep(" in (FOLDER / f"{name}.py").read_text():
        needs("sweep")
    monkeypatch.syspath_prepend(FOLDER)
    importlib.import_module(name).main(words)


def is_a_picture(path: Path) -> bool:
    from PIL import Image

    with Image.open(path) as picture:
        return picture.width > 600 and len(picture.convert("RGB").getcolors(2**24) or []) > 20


@pytest.mark.parametrize("name", some(SCRIPTS, ()))
def test_example_runs(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run(name, ["--short", "--to", str(tmp_path)], monkeypatch)
    assert is_a_picture(tmp_path / f"{name}.png")


@pytest.mark.slow
@pytest.mark.parametrize("name", SCRIPTS)
def test_whole_example_runs(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run(name, ["--to", str(tmp_path)], monkeypatch)
    assert is_a_picture(tmp_path / f"{name}.png")


@pytest.mark.parametrize("name", SCRIPTS)
def test_committed_picture_is_small_and_shown(name: str) -> None:
    assert is_a_picture(FOLDER / f"{name}.png")
    assert (FOLDER / f"{name}.png").stat().st_size < LARGEST
    page = (FOLDER / "index.md").read_text()
    assert f"({name}.py)" in page
    assert f"({name}.png)" in page
