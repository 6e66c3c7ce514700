"""The public names and the floors of the package."""

import ast
import pydoc
import re
import subprocess
import sys
import tomllib
from collections import Counter
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import hybridyn
from hybridyn import compiled
from hybridyn.errors import install_advice
from tests import ROOT

PACKAGE = ROOT / "hybridyn"
#: The floors from the ground. A room imports from its own folder and from the floors below.
FLOORS = (
    {"errors", "logs", "symbols", "colours", "threads"},
    {"spatial", "extensions"},
    {"joints"},
    {"description"},
    {"linkage", "tables"},
    {"structure"},
    {"assembly", "manifold", "effects"},
    {"dynamics", "loading"},
    {"compiled", "conversion"},
    {"simulation", "streams", "gradients", "optimal_control"},
    {"scenes", "view", "ros"},
    {"studies", "identification", "warp_batch"},
    {"figures", "learning"},
    {"cli"},
    {"__main__"},
)
LEVEL = {room: level for level, floor in enumerate(FLOORS) for room in floor}


#: An import, or the head of a class, as the formatter writes them.
STATEMENT = re.compile(r"^ *(from \S+ import (?:\([^)]*\)|.*)|import .*|class \w+(?=[:(]))", re.MULTILINE)


@cache
def statements(path: Path) -> list[ast.stmt]:
    """Return the imports and the classes of a file, inside functions too; these alone are parsed."""
    text, found = path.read_text(), []
    for part in STATEMENT.finditer(text):
        found += ast.parse(part[1] + ": pass" * part[1].startswith("class ")).body
        ast.increment_lineno(found[-1], text.count("\n", 0, part.start(1)))
    return found


def imports(file: str) -> list[tuple[str, str]]:
    """Room and place of what a file imports, inside functions and under TYPE_CHECKING too."""
    path, found = PACKAGE / file, []
    for node in statements(path):
        if isinstance(node, ast.ImportFrom) and node.level:
            above = path.relative_to(PACKAGE).parts[: -node.level]
            parts = [*above, *(node.module or "").split(".")]
            rooms = [parts[0]] if parts[0] else [alias.name for alias in node.names]
            found += [(room, f"{file}:{node.lineno}") for room in rooms]
        elif isinstance(node, ast.Import | ast.ImportFrom):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else [a.name for a in node.names]
            found += [(n.split(".")[1], f"{file}:{node.lineno}") for n in names if n.startswith("hybridyn.")]
    return found


@pytest.mark.parametrize("room", sorted(LEVEL))
def test_imports_run_downwards(room: str) -> None:
    files = [PACKAGE / f"{room}.py", *(PACKAGE / room).rglob("*.py")]
    upwards = [
        f"{place} imports {target}"
        for file in files
        if file.is_file()
        for target, place in imports(str(file.relative_to(PACKAGE)))
        if target != room and LEVEL.get(target, 0) >= LEVEL[room]
    ]
    assert upwards == []


def file_of(place: Path) -> Path | None:
    """Return the file of a module or package, from its path without ending; None where there is none."""
    return next((f for f in (place.with_suffix(".py"), place / "__init__.py") if f.is_file()), None)


def imported_files(path: Path) -> set[str]:
    """Return the files of the package that a file imports, inside functions and under TYPE_CHECKING too."""
    found = set()
    for node in statements(path):
        if isinstance(node, ast.ImportFrom) and node.level:
            base = path.parents[node.level - 1].joinpath(*(node.module or "").split("."))
            found |= {file_of(base / alias.name) or file_of(base) for alias in node.names}
    return {str(file.relative_to(PACKAGE)) for file in found if file}


#: Names of the door of compiled models. The number may fall.
DOOR = 38
#: An import of a file behind the door.
BELOW = r"(?:from|import) [.\w]*\bcompiled\.([.\w]+)"


def test_other_rooms_enter_compiled_models_by_the_door() -> None:
    assert len(compiled.__all__) == DOOR
    assert all(getattr(compiled, name) is not None for name in compiled.__all__)
    behind = set()
    for path in PACKAGE.rglob("*.py*"):
        place = path.relative_to(PACKAGE)
        if path.suffix not in (".py", ".pyi") or place.parts[0] == "compiled":
            continue
        behind |= {f"{place}: {file}" for file in re.findall(BELOW, path.read_text())}
        for node in statements(path):  # nor a file by its name alone
            if isinstance(node, ast.ImportFrom) and node.module == "compiled":
                behind |= {f"{place}: {x.name}" for x in node.names if x.name not in compiled.__all__}
    assert behind == set()


#: Files of compiled models that know what a spin of a rod is, all in one room. The number may fall.
SPINS = 6


def test_spins_of_rods_are_known_in_one_room_of_compiled_models() -> None:
    """The others know of motions, of which the idle ones come first."""
    files = [path for path in (PACKAGE / "compiled").rglob("*") if path.suffix in (".py", ".pyi", ".h")]
    naming = [path for path in files if re.search("spin|spun", path.read_text(), re.IGNORECASE)]
    assert {str(path.parent.relative_to(PACKAGE)) for path in naming} == {"compiled/equations/idle"}
    assert len(naming) == SPINS


def test_no_file_imports_itself_through_others() -> None:
    """`TopologicalSorter` raises a CycleError that names the files of a circle."""
    graph = TopologicalSorter[str]()
    for path in PACKAGE.rglob("*.py"):
        file = str(path.relative_to(PACKAGE))
        graph.add(file, *(imported_files(path) - {file}))
    graph.prepare()


def test_the_oracle_shares_no_code_with_what_it_checks() -> None:
    """It reads records of a robot's files, and is no part of the package."""
    files = [f for f in (ROOT / "tests" / "oracle").glob("*.py") if not f.name.startswith("test_")]
    assert {"models.py", "rows.py", "tree.py"} <= {file.name for file in files}
    for path in files:
        own = re.findall(r"^\s*(?:from|import)\s+(hybridyn\S*|tests\S*)", path.read_text(), re.MULTILINE)
        assert set(own) <= {"hybridyn.description.records"}, path.name


def test_every_room_has_a_floor() -> None:
    rooms = {
        path.stem for path in PACKAGE.iterdir() if path.suffix == ".py" or (path / "__init__.py").exists()
    }
    assert rooms - {"__init__"} == set(LEVEL)


def test_one_name_means_one_thing() -> None:
    """No class name stands twice; a file name may stand for a command, its study and its figure."""
    files = [path for path in PACKAGE.rglob("*.py") if path.name != "__init__.py"]
    classes = Counter(
        node.name for path in files for node in statements(path) if isinstance(node, ast.ClassDef)
    )
    assert [name for name, count in classes.items() if count > 1] == []
    assert [name for name, count in Counter(path.name for path in files).items() if count > 3] == []


def test_every_public_name_is_there_and_no_file() -> None:
    for name in hybridyn.__all__:
        assert getattr(hybridyn, name) is not None
        assert not (PACKAGE / f"{name}.py").exists()
        assert not (PACKAGE / name).exists()


def test_effects_are_reached_by_the_package() -> None:
    """`hybridyn.effects.Coulomb...` needs no import of its own, whatever was imported before."""
    code = "import hybridyn; print(hybridyn.effects.CoulombFriction.__name__)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "CoulombFriction\n"


def test_dir_and_help_show_the_public_names() -> None:
    assert set(hybridyn.__all__) - {"__version__"} <= set(dir(hybridyn))
    assert set(hybridyn.effects.__all__) == set(dir(hybridyn.effects))
    text = pydoc.render_doc(hybridyn, renderer=pydoc.plaintext)
    assert "hybridyn.assemble(robot, motors=" in text
    for name in ("idm", "mass_matrix", "joint_map", "simulate"):
        assert f"    {name}(robot: " in text, name


def test_a_robot_is_printed_in_two_lines() -> None:
    assert repr(hybridyn.load("lx4")) == (
        "HybridRobot 'lx4' on a fixed base: 4 modules, 84 joints, 24 freedoms, 24 motors\n"
        "q has 84 coordinates, v has 84, tau has 24: "
        "m1_leg1_slide, m1_leg2_slide, m1_leg3_slide, m1_leg4_slide, ..."
    )


def test_messages_name_extras_that_exist() -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    sources = "".join(path.read_text() for path in PACKAGE.rglob("*.py"))
    named = set(re.findall(r"""(?:install_advice\('|required\([\w."]+, ")(\w+)""", sources))
    assert {"io", "plot", "view", "compiled", "robots"} <= named <= extras.keys()
    assert sources.count("pip install 'hybridyn[") == 1  # the words stand in one function
    assert "pip install -e '.[plot]'" in install_advice("plot")


def test_each_mutant_breaks_one_place() -> None:
    """A fragment of `mutants.toml` stands once in its file; `tests.tools.mutants` breaks it there."""
    for file, mutants in tomllib.loads((ROOT / "tests/mutants.toml").read_text()).items():
        text = (ROOT / "hybridyn" / file).read_text()
        assert [name for name, (old, _) in mutants.items() if text.count(old) != 1] == [], file
