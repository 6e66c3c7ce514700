"""The public names, whatever was imported before."""

from __future__ import annotations

import subprocess
import sys

import pytest

import hybridyn


@pytest.mark.parametrize(
    "first",
    [
        "import hybridyn",
        "from hybridyn import ddm",
        "import hybridyn.ddm",
        "from hybridyn.ddm import articulate",
    ],
)
def test_verbs_are_functions_whichever_file_came_first(first: str) -> None:
    check = "import hybridyn; assert callable(hybridyn.ddm); assert callable(hybridyn.idm)"
    after = "from hybridyn import idm, ddm; assert callable(idm); assert callable(ddm)"
    subprocess.run([sys.executable, "-c", f"{first}; {check}; {after}"], check=True)


def test_every_public_name_is_there() -> None:
    for name in hybridyn.__all__:
        assert getattr(hybridyn, name) is not None
