"""What runs where the repository lives: files that parse, scripts that are there, and what the scripts do."""

import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import yaml

from tests import ROOT

GITHUB = ROOT / ".github"


def test_files_parse_and_call_scripts_that_run() -> None:
    files = [*GITHUB.rglob("*.yml"), ROOT / "environment.yml"]
    texts = {file.name: file.read_text() for file in files}
    assert all(isinstance(yaml.safe_load(text), dict) for text in texts.values())
    called = {name for text in texts.values() for name in re.findall(r"(?<![\w.])\.ci/\w+", text)}
    assert called == {".ci/run", ".ci/release", ".ci/oldest", ".ci/pages"}
    assert all((ROOT / name).stat().st_mode & 0o100 for name in called)


def test_the_oldest_releases_are_those_of_pyproject() -> None:
    command = [sys.executable, str(ROOT / ".ci" / "oldest"), "test"]
    found = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    wanted = [*project["dependencies"], *(one for name in ("test", "io", "plot") for one in extras[name])]
    for requirement in wanted:
        if least := re.match(r"([\w-]+)>=([\w.]+)", requirement):
            assert f"{least[1]}=={least[2]}" in found
    assert len(found) == len({line.split("==")[0] for line in found}) > 15


@pytest.mark.skipif(shutil.which("git") is None, reason="needs git")
def test_pages_are_kept_by_version_and_the_root_leads_to_the_last_release(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def git(*words: str) -> str:
        return subprocess.run(["git", *words], check=True, capture_output=True, text=True).stdout

    git("init", "-q", "--bare", str(tmp_path / "origin"))
    git("clone", "-q", str(tmp_path / "origin"), str(tmp_path / "clone"))
    monkeypatch.chdir(tmp_path / "clone")
    git("-c", "user.name=a", "-c", "user.email=a@b", "commit", "-q", "--allow-empty", "-m", "first")
    (tmp_path / "built").mkdir()
    for version in ("main", "v0.9.0", "v0.10.0", "main"):
        (tmp_path / "built" / "index.html").write_text(version)
        script = [str(ROOT / ".ci" / "pages"), version, str(tmp_path / "built")]
        subprocess.run(script, check=True, capture_output=True)
    git("fetch", "-q")
    for version in ("main", "v0.9.0", "v0.10.0"):
        assert git("show", f"origin/gh-pages:{version}/index.html") == version
    assert "url=v0.10.0/" in git("show", "origin/gh-pages:index.html")
    wrong = subprocess.run([str(ROOT / ".ci" / "pages"), "../x", "."], capture_output=True, text=True)
    assert (wrong.returncode, wrong.stderr) == (1, "'../x' is neither main nor a release\n")
