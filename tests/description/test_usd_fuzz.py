"""Broken binary files of USD, and files that end OpenUSD's process, hang it or need much memory."""

import contextlib
import os
import random
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from hybridyn.description import read
from hybridyn.description.usd import opening
from hybridyn.errors import ModelError
from tests.description import ending
from tests.description.fuzz_texts import USD, USD_PART
from tests.description.reading import bound, refused, save_all
from tests.description.usd_texts import FIVE_BAR
from tests.support.extras import needs
from tests.support.files import save
from tests.support.samples import slow
from tests.support.waiting import must_end

needs("usd")
from pxr import Sdf  # noqa: E402

CASES = 10  # per seed


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A robot, which is read before and after whatever happens."""
    file = save_all(tmp_path, {"r.usda": USD, "part.usda": USD_PART})
    assert read(file).motors == ("j8",)
    yield file
    monkeypatch.undo()
    assert read(file).motors == ("j8",)


@pytest.mark.parametrize("seed", [0, *(slow(seed) for seed in range(1, 20))])
def test_mutations_of_binary_files(file: Path, seed: int) -> None:
    draw, binary = random.Random(seed), file.with_suffix(".usdc")
    Sdf.Layer.FindOrOpen(str(file)).Export(str(binary))
    good = binary.read_bytes()
    for _ in range(CASES):
        raw = bytearray(good)
        for _ in range(draw.choice([1, 1, 3, 30])):
            raw[draw.randrange(len(raw))] = draw.randrange(256)
        binary.write_bytes(bytes(raw[: draw.choice([len(raw)] * 4 + [draw.randrange(len(raw))])]))
        with contextlib.suppress(ModelError), must_end(raw):
            read(binary)


def test_a_file_that_ends_the_process_is_refused(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(opening, "read_in_process", ending.abort)
    refused(file, "OpenUSD ended while it read the file")


def test_a_process_that_ended_while_it_waited_is_started_again(file: Path) -> None:
    _, process = opening._started(os.getpid())
    os.kill(process, signal.SIGKILL)


@pytest.mark.slow
def test_a_file_that_hangs_is_refused(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(opening, "read_in_process", ending.hang)
    with must_end("a hang"):
        refused(file, "OpenUSD ended while it read the file")
    signal.setitimer(signal.ITIMER_REAL, 0.5)
    before = signal.signal(signal.SIGALRM, signal.default_int_handler)
    with pytest.raises(KeyboardInterrupt):
        read(file)
    signal.signal(signal.SIGALRM, before)


@pytest.mark.slow
def test_a_file_that_needs_much_memory_is_refused(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opening._started.cache_clear()
    bound(monkeypatch, memory=2**28)
    refused(file, "OpenUSD")
    opening._started.cache_clear()


@pytest.mark.slow
def test_a_script_without_a_main_guard_reads_usd(tmp_path: Path) -> None:
    """Its process does not run the script once more."""
    save(tmp_path, FIVE_BAR, "r.usda")
    (tmp_path / "script.py").write_text("import hybridyn\nprint(hybridyn.load('r.usda').motors)\n")
    done = subprocess.run([sys.executable, "script.py"], cwd=tmp_path, capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("('motor_left', 'motor_right')\n", "")


@pytest.mark.slow
def test_references_that_double_at_each_level_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    arc = 'def "{}" (references = </l{}>) {{}}\n'
    levels = (f'def "l{i}" {{\n{arc.format("a", i + 1)}{arc.format("b", i + 1)}}}\n' for i in range(40))
    bound(monkeypatch, seconds=1)
    file = save(tmp_path, "#usda 1.0\n" + "".join(levels) + 'def Xform "l40" {}\n', "r.usda")
    refused(file, "needs more than 1 s")
