"""What users install: wheel and sdist hold the robots, and the README runs from an installed wheel."""

import json
import os
import re
import shlex
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

from tests import ROOT
from tests.support.snippets import blocks

BUILD = "import hatchling.build as build, sys; print(getattr(build, sys.argv[1])(sys.argv[2]))"
DATA = ("urdf", "models")
CLEAN = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "PYTHONHOME")}


def files_of(*names: str) -> set[str]:
    """Return the files of some folders of this repository, or files themselves."""
    out = set()
    for name in names:
        path = ROOT / name
        found = path.rglob("*") if path.is_dir() else [path]
        out |= {str(file.relative_to(ROOT)) for file in found if file.is_file()}
    return {name for name in out if "__pycache__" not in name}


def build(kind: str, folder: Path) -> Path:
    """Build a wheel or an sdist with the backend that pyproject.toml names."""
    command = [sys.executable, "-c", BUILD, f"build_{kind}", str(folder)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    return folder / done.stdout.strip()


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build("wheel", tmp_path_factory.mktemp("wheel"))


def environment(folder: Path) -> Path:
    """Return an empty virtual environment's folder of programs."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(folder)], check=True)
    return folder / "bin"


@pytest.fixture(scope="module")
def programs(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Install the wheel into an environment of its own; what it depends on is taken from this one."""
    bin_folder = environment(tmp_path_factory.mktemp("environment"))
    (packages,) = bin_folder.parent.glob("lib/python*/site-packages")
    borrowed = [path for path in sys.path if "site-packages" in path]
    (packages / "borrowed.pth").write_text("\n".join(borrowed) + "\n")
    pip = [sys.executable, "-m", "pip", "--python", str(bin_folder / "python"), "install", "-q"]
    subprocess.run([*pip, "--no-deps", "--no-index", str(wheel)], check=True, env=CLEAN)
    return bin_folder


def run(programs: Path, folder: Path, command: str) -> subprocess.CompletedProcess[str]:
    """Run a shell command where `hybridyn` is the installed one."""
    path = f"{programs}{os.pathsep}{CLEAN['PATH']}"
    return subprocess.run(
        ["bash", "-euo", "pipefail", "-c", command],
        cwd=folder,
        env=CLEAN | {"PATH": path, "COLUMNS": "90"},
        capture_output=True,
        text=True,
    )


def test_the_wheel_holds_robots_types_and_licence(wheel: Path) -> None:
    names = set(zipfile.ZipFile(wheel).namelist())
    assert {f"hybridyn/_data/{name}" for name in files_of(*DATA)} <= names
    assert "hybridyn/py.typed" in names
    assert any(name.endswith("licenses/LICENSE") for name in names)
    assert {name for name in files_of("hybridyn") if name.endswith(".py")} <= names
    assert not [name for name in names if name.startswith(("tests/", "benchmarks/")) or ".pyc" in name]


@pytest.mark.slow
def test_the_sdist_holds_what_a_clone_has(tmp_path: Path) -> None:
    with tarfile.open(build("sdist", tmp_path)) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    wanted = files_of(
        *DATA, "hybridyn", "tests", "docs", "README.md", "LICENSE", "CHANGELOG.md", "CITATION.cff"
    )
    assert wanted <= names


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "told"),
    [
        ("hybridyn --robots", "four stacked 6-UPS platforms"),
        ("hybridyn info tanev", "nothing looks wrong"),
        ("hybridyn idm lx4 -o efforts.csv && head -n 1 efforts.csv", "m4_leg6_slide/effort"),
        ("hybridyn simulate five_bar --until 0.02 -q -o s.csv; tail -n 1 s.csv", "0.02,"),
        ("hybridyn info delta", "nothing looks wrong"),
        ("hybridyn idm five_bar --loads --jobs 2", "m1_right_drive"),
        ("python -m hybridyn --version", "hybridyn"),
        ("python -c 'import hybridyn; print(hybridyn.load(\"lx4\").nq, hybridyn.__file__)'", "site-packages"),
    ],
)
def test_an_installed_wheel_works_in_any_folder(
    command: str, told: str, programs: Path, tmp_path: Path
) -> None:
    done = run(programs, tmp_path, command)
    assert done.returncode == 0, done.stderr
    assert told in done.stdout
    assert str(ROOT / "hybridyn") not in done.stdout + done.stderr


def by_name(command: str, data: Path) -> str:
    """Write `urdf/X.urdf.xacro` as X and `models/X/f` as X/f for hybridyn, as a path for other programs."""
    if shlex.split(command)[0] == "hybridyn":
        command = re.sub(r"\burdf/(\w+)\.urdf\.xacro", r"\1", command)
        return re.sub(r"\bmodels/(\w+/[\w.]+)", r"\1", command)
    return re.sub(r"\b(urdf|models)/", rf"{data}/\1/", command)


def run_readme(programs: Path, folder: Path) -> None:
    """Run every command and the Python of the README where there is no clone."""
    listed = json.loads(run(programs, folder, "hybridyn --robots=json").stdout)
    data = Path(listed[0]["file"]).parents[1]
    assert programs.parent in data.parents
    consoles = "".join(block.text for block in blocks(ROOT / "README.md", "console"))
    for command in re.findall(r"^\$ (.*)$", consoles, re.MULTILINE):
        done = run(programs, folder, by_name(command, data))
        assert done.returncode == 0, (command, done.stderr)
    text = "\n".join(
        block.text for block in blocks(ROOT / "README.md", "python")
    )  # blocks go on from each other
    (folder / "readme.py").write_text(re.sub(r"\burdf/(\w+)\.urdf\.xacro", r"\1", text))
    done = run(programs, folder, "python readme.py")
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_the_readme_runs_from_an_installed_wheel(programs: Path, tmp_path: Path) -> None:
    run_readme(programs, tmp_path)


@pytest.mark.slow
def test_the_readme_runs_after_a_real_installation(
    wheel: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Installed with pip and all that it depends on, from the index, into an empty environment."""
    bin_folder = environment(tmp_path_factory.mktemp("empty"))
    pip = [sys.executable, "-m", "pip", "--python", str(bin_folder / "python"), "install", "-q"]
    subprocess.run([*pip, f"{wheel}[plot,compiled]"], check=True, env=CLEAN)
    run_readme(bin_folder, tmp_path_factory.mktemp("anywhere"))
