"""The commands that a page shows, run in the order of the page; what they print is what it shows."""

import re
import shlex
import subprocess
from itertools import zip_longest
from pathlib import Path

import pytest

from hybridyn.cli import main
from tests.support.command_line import Said
from tests.support.snippets import blocks

SHOWN = 1e-3  # numbers are printed with two to six digits
ROUNDING = 1e-9  # what is printed of a closed loop is rounding, other on every machine
#: Speeds, and where packages are installed.
MACHINE = re.compile(r"[\d,.]+(?= samples/s)|(?<=wall time )[\d.]+|\S+(?=/example-robot-data/)")


def same_word(word: str, expected: str) -> bool:
    try:
        a, b = float(word), float(expected)
    except ValueError:
        return word == expected
    return abs(a - b) <= max(SHOWN * abs(b), ROUNDING)


def same_line(line: str, expected: str) -> bool:
    """Compare word by word; where the page ends a line with `...` the rest is free."""
    found, wanted = (MACHINE.sub("#", text).split() for text in (line, expected))
    if wanted[-1:] == ["..."]:
        del found[len(wanted) - 1 :], wanted[-1]
    return len(found) == len(wanted) and all(map(same_word, found, wanted))


def shown(page: Path) -> str:
    """Return the commands that a page shows, with what they print."""
    return "".join(block.text for block in blocks(page, "console"))


def run_commands(text: str, capsys: pytest.CaptureFixture[str], *, whole: bool = False) -> Said:
    """Run commands, and compare what they print.

    Args:
        text: Each command after a `$`, and below it what it prints.
        capsys: Takes what is printed.
        whole: Whether commands without a line below them print nothing; else it is not compared.

    Returns:
        What the last one said.
    """
    said = Said(0, "", "")
    for part in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
        command, _, expected = part.partition("\n")
        program, *words = shlex.split(command, comments=True)
        if program != "hybridyn":
            subprocess.run(command, shell=True, check=True)
            continue
        said = Said(main(words), *capsys.readouterr())
        assert said.status == 0, command
        if expected or whole:
            for found, wanted in zip_longest((said.out + said.err).splitlines(), expected.splitlines()):
                assert found is not None, (command, wanted)
                assert wanted is not None, (command, found)
                assert same_line(found, wanted) or "ms per design" in wanted, (command, found, wanted)
    return said
