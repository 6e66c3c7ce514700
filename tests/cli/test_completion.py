"""Shell completion: the scripts, and what they offer."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from hybridyn.cli import COMMANDS, main
from hybridyn.cli.lists import VARIABLE, WHERE
from hybridyn.description.shipped import main_names
from tests import ROOT
from tests.support.command_line import call
from tests.support.comparing import refused
from tests.support.files import save


def asked(line: str) -> dict[str, str]:
    """Return the variables by which bash asks what there is for the last word of a line."""
    return {VARIABLE: "bash_complete", "COMP_WORDS": line, "COMP_CWORD": str(line.count(" "))}


@pytest.mark.parametrize("shell", WHERE)
def test_a_script_per_shell(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    said = call(capsys, "--completion", shell)
    assert f"{VARIABLE}={shell}_complete" in said.out
    program = shutil.which(shell)
    if program:  # the shell itself finds nothing wrong with it
        subprocess.run([program, "-n"], input=said.out, text=True, check=True)


def test_other_shells_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    call(capsys, "--completion", "tcsh", status=2, says="'bash', 'zsh', 'fish'")


def test_commands_options_and_robots_are_offered(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def offered(line: str) -> list[str]:
        for name, value in asked(line).items():
            monkeypatch.setenv(name, value)
        refused(lambda: main([]), SystemExit, "0")
        items = capsys.readouterr().out.splitlines()
        return [item.partition(",")[2] for item in items if item.startswith("plain,")]

    assert offered("hybridyn ") == list(COMMANDS)
    assert "--fail-on" in offered("hybridyn info --fa")
    assert offered("hybridyn info --fail-on w") == ["warning"]
    assert offered("hybridyn idm sca") == ["scara_delta"]
    assert set(main_names()) <= set(offered("hybridyn info "))


@pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")
def test_bash_completes_by_the_script(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Source the script in bash and call the function that it registers, as a press of the tab key does."""
    script = save(tmp_path, call(capsys, "--completion", "bash").out, "completion.bash")
    program = save(
        tmp_path, f'#!/bin/sh\nPYTHONPATH={ROOT} exec {sys.executable} -m hybridyn "$@"\n', "hybridyn"
    )
    program.chmod(0o755)
    ask = (
        f"compopt() {{ :; }}; source {script}; COMP_WORDS=(hybridyn idm goug); COMP_CWORD=2;"
        " _hybridyn_completion hybridyn;"
        ' printf "%s\\n" "${COMPREPLY[@]}"'
    )
    environment = os.environ | {"PATH": f"{tmp_path}{os.pathsep}{os.environ['PATH']}"}
    done = subprocess.run(["bash", "-c", ask], env=environment, capture_output=True, text=True)
    assert "gough_stewart" in done.stdout.split()


@pytest.mark.parametrize(
    ("words", "line", "says"),
    [
        ([], "hybridyn idm ", "plain,five_bar"),
        (["--help"], "", "  idm "),
        (["idm", "--help"], "", "  --loads"),
    ],
    ids=["completion", "help", "help of a command"],
)
def test_help_and_completion_import_nothing_heavy(words: list[str], line: str, says: str) -> None:
    """They take a tenth of a second, which Pinocchio alone would double."""
    code = (
        "import sys; from hybridyn.cli import main; import atexit;"
        "atexit.register(lambda: print([m for m in ('numpy', 'pinocchio', 'scipy') if m in sys.modules]));"
        "sys.exit(main())"
    )
    environment = os.environ | (asked(line) if line else {}) | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", code, *words]
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    *said, heavy = done.stdout.splitlines()
    assert any(one.startswith(says) for one in said)
    assert heavy == "[]"
