"""Habits of the ecosystem: a quiet library, a quick start, types, hooks, a CI that a fork can run."""

import ast
import os
import re
import shlex
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests import ROOT
from tests.support.snippets import blocks

PACKAGE = ROOT / "hybridyn"
HEAVY = ("numpy", "scipy", "pinocchio", "pydantic", "lxml", "polars", "matplotlib", "yourdfpy", "trimesh")


def nodes(pattern: str) -> Iterator[tuple[str, ast.AST]]:
    """Yield the nodes of the package's files in which a pattern occurs, with the file."""
    for path in PACKAGE.rglob("*.py"):
        text = path.read_text()
        if re.search(pattern, text):
            file = path.relative_to(PACKAGE).as_posix()
            yield from ((file, node) for node in ast.walk(ast.parse(text)))


def test_records_of_arrays_compare_by_identity() -> None:
    """Comparing arrays gives arrays, so that `==` of two such records would raise."""
    comparing = [
        f"{path}: {node.name}"
        for path, node in nodes(r"@dataclass\b(?!.*eq=False)")
        if isinstance(node, ast.ClassDef)
        and any(re.fullmatch(r"dataclass\b(?!.*eq=False).*", ast.unparse(one)) for one in node.decorator_list)
        and any(
            re.match(r"(Array|Index|Mask)\b|[^C]*\[.*\b(Array|Index|Mask)\b", ast.unparse(field.annotation))
            for field in node.body
            if isinstance(field, ast.AnnAssign)
        )
    ]
    assert comparing == []


#: What a test reads from the clock, and limits in seconds that a slow machine could reach.
JUDGED = re.compile(r"\b(?:perf_counter|process_time|monotonic|thread_time)(?:_ns)?\(\)|\btimeout=[\d.]+[,)]")


def test_no_test_is_judged_by_the_clock() -> None:
    """Clocks are those of `clocks.py`; limits are those of `waiting.py`, which only a hang reaches."""
    judged = [
        f"{path.relative_to(ROOT)}: {found[0]}"
        for path in sorted((ROOT / "tests").rglob("*.py"))
        if path.name != "waiting.py"
        for found in JUDGED.finditer(path.read_text(encoding="utf-8"))
    ]
    assert judged == []


def test_help_imports_nothing_heavy() -> None:
    asked = (["--version"], ["--help"], ["--robots"], ["info", "--help"])
    code = (
        "import sys; from hybridyn.cli import main\n"
        f"for words in {asked!r}:\n"
        "    main(words)\n"
        f"    print('heavy:', words, [name for name in {HEAVY!r} if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    told = [line for line in done.stdout.splitlines() if line.startswith("heavy:")]
    assert told == [f"heavy: {words} []" for words in asked]


#: Modules that few runs need: those with several processes, a bar, a misspelt name, an endless coupling.
RARE = ("subprocess", "shutil", "tempfile", "random", "difflib", "fractions", "decimal")
#: Files of the package that few runs need: they are imported where they are used.
SELDOM = (
    "description.residuals", "dynamics.reactions", "dynamics.link_motion", "manifold.branch",
    "studies.home", "tables.bags", "tables.tree_coordinates",
)  # fmt: skip


def test_a_start_imports_what_it_needs() -> None:
    """Loading a robot and its compiled models does without Pinocchio, which takes half of a start.

    Frameworks for learning are imported when their models are asked for.
    """
    code = (
        "import sys; own = {*sys.modules};"
        "import hybridyn.assembly.assemble, hybridyn.cli.idm, hybridyn.loading, hybridyn.tables.results;"
        f"assert not {{*{RARE!r}}} & ({{*sys.modules}} - own), {{*{RARE!r}}} & ({{*sys.modules}} - own);"
        f"print([name for name in {SELDOM!r} if f'hybridyn.{{name}}' in sys.modules]);"
        "robot = hybridyn.load('five_bar');"
        "import hybridyn.compiled.compiling, hybridyn.streams.postures;"
        "before = 'pinocchio' in sys.modules; hybridyn.idm(robot, robot.home, *[[0.0] * robot.nv] * 2);"
        "print(before, 'pinocchio' in sys.modules);"
        "hybridyn.torch, hybridyn.jax; print({'torch', 'jax'} & {*sys.modules})"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout == "[]\nFalse True\nset()\n"


#: How dependencies are imported whose names are others.
MODULES = {"pin": "pinocchio", "pyyaml": "yaml"}
#: The extras that the extra `test` brings.
TESTED = ("io", "plot", "compiled", "identify")
#: What only extras install.
OF_EXTRAS = (
    "polars", "yourdfpy", "trimesh", "viser", "PIL", "embreex", "imageio_ffmpeg", "matplotlib", "plotly",
    "casadi", "mujoco", "mpmath", "sphinx",
)  # fmt: skip


def project() -> dict[str, Any]:
    facts: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    return facts


def names_of(requirements: list[str]) -> set[str]:
    return {re.split(r"[^\w-]", text)[0] for text in requirements}


def imports(node: ast.AST) -> set[str]:
    """Return the packages that a node may import."""
    if isinstance(node, ast.Import):
        return {alias.name.partition(".")[0] for alias in node.names}
    if isinstance(node, ast.ImportFrom) and not node.level:
        return {str(node.module).partition(".")[0]}
    # a text may be the name of `import_module`
    return {node.value} if isinstance(node, ast.Constant) and isinstance(node.value, str) else set()


def test_every_dependency_is_imported() -> None:
    """What no file of the package names is not installed with it."""
    base = names_of(project()["dependencies"])
    for name in sorted(MODULES.get(name, name) for name in base):
        assert any(name in imports(node) for _, node in nodes(rf"\b{name}\b")), name
    assert not base & {"polars", "yourdfpy", "trimesh"}
    assert "yourdfpy" in names_of(project()["optional-dependencies"]["view"])


def test_a_file_of_tests_asks_for_an_extra_before_it_imports_it() -> None:
    """Without the extra its tests are skipped; the import would end the whole run."""
    extras = project()["optional-dependencies"]
    brought = [*project()["dependencies"], *extras["test"], *(one for name in TESTED for one in extras[name])]
    known = {*sys.stdlib_module_names, "hybridyn", "tests", "benchmarks", "docs"}
    known |= {MODULES.get(name, name) for name in names_of(brought)}
    early = set()
    for path in sorted((ROOT / "tests").rglob("test_*.py")):
        text = re.split("^(?:def test_|@)", path.read_text(encoding="utf-8"), maxsplit=1, flags=re.MULTILINE)[
            0
        ]
        lines = text.split("\n")
        for statement in ast.parse(text).body:  # the linter finds imports further below
            own = "\n".join(lines[statement.lineno - 1 : statement.end_lineno])
            if re.search(r"\b(needs|importorskip|skip)\(", own):
                break
            if isinstance(statement, ast.Import | ast.ImportFrom):
                early |= {(path.name, name) for name in imports(statement) - known}
    assert early == set()


def test_the_first_command_of_the_readme_needs_no_extra(tmp_path: Path) -> None:
    """It installs the package alone, and runs where nothing of the extras can be imported."""
    (block,) = [block for block in blocks(ROOT / "README.md", "sh") if "hybridyn idm" in block.text]
    assert "pip install -q . &&" in block.text
    words = shlex.split(block.text)
    words = words[words.index(".venv/bin/hybridyn") + 1 :]
    rows = [line for line in (ROOT / words[-1]).read_text().splitlines() if not line.startswith("#")]
    (tmp_path / "traj.csv").write_text("\n".join(rows[:3]) + "\n")
    code = (
        f"import sys; sys.modules.update(dict.fromkeys({OF_EXTRAS!r}));"
        "from hybridyn.cli import main; sys.exit(main(sys.argv[1:]))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, *words[:-1], str(tmp_path / "traj.csv")],
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert (done.returncode, len(done.stdout.splitlines())) == (0, 3), done.stderr


def test_hooks_call_the_tools_of_the_environment() -> None:
    hooks = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text())["repos"][0]["hooks"]
    assert {hook["entry"].split()[0] for hook in hooks} == {"ruff", "mypy", "codespell", "proselint"}
    assert all(hook["language"] == "system" for hook in hooks)


def test_the_workflow_of_a_fork_runs_what_has_to_pass() -> None:
    text = (ROOT / ".github" / "workflows" / "ci.yml").read_text()
    workflow = yaml.safe_load(text)
    runs = [step.get("run", "") for step in workflow["jobs"]["ci"]["steps"]]
    assert runs[-1] == ".ci/run"
    assert os.access(ROOT / ".ci" / "run", os.X_OK)
    assert "secrets." not in text
    for job in workflow["jobs"].values():
        for step in job["steps"]:
            for word in step.get("run", "").split():
                if word.startswith("tests/"):
                    assert (ROOT / word).is_file()


def test_a_tag_is_all_that_a_release_needs() -> None:
    """It builds, checks what it built in fresh environments, and publishes nothing else."""
    text = (ROOT / ".github" / "workflows" / "release.yml").read_text()
    workflow = yaml.safe_load(text)
    assert workflow[True]["push"] == {"tags": ["v*"]}  # YAML reads the key `on` as a truth value
    assert "secrets." not in text
    build, check, publish = (workflow["jobs"][name] for name in ("build", "check", "publish"))
    assert '.ci/release "$TAG"' in [step.get("run") for step in build["steps"]]
    assert (check["needs"], publish["needs"]) == ("build", ["build", "check"])
    assert publish["if"] == "github.ref_type == 'tag'"
    sources = [step["uses"].partition("@")[0] for step in publish["steps"]]
    assert sources == ["actions/download-artifact", "pypa/gh-action-pypi-publish"]


@pytest.mark.parametrize(
    ("tag", "said"), [("v9.9.9", "does not name the version"), ("", "is not empty: nothing but this release")]
)
def test_a_release_refuses_another_tag_and_a_folder_in_use(tag: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "older.whl").touch()
    done = subprocess.run([ROOT / ".ci" / "release", tag, tmp_path], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (1, "")
    assert said in done.stderr


@pytest.mark.slow
def test_a_release_is_built_and_checked(tmp_path: Path) -> None:
    """With pip, from the index."""
    version = project()["version"]
    done = subprocess.run(
        [ROOT / ".ci" / "release", f"v{version}", tmp_path / "made"], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    names = sorted(path.name for path in (tmp_path / "made").iterdir())
    assert names == [f"hybridyn-{version}-py3-none-any.whl", f"hybridyn-{version}.tar.gz"]
    assert done.stdout.count("four stacked 6-UPS platforms") == 2
