"""Every public function and class shows a call, which runs and prints what its docstring says."""

import doctest
import inspect
from functools import lru_cache
from typing import Any

import pytest

import hybridyn
from hybridyn.loading import load
from tests.support.extras import needs
from tests.support.samples import slow

#: Extras of examples that take long, most of them for a compiler.
LONG = {"compile": "compiled", "CompiledRobot": "compiled", "sweep": "sweep", "warp": "gpu"}
LONG |= {"torch": "torch", "jax": "jax"}
NAMES = sorted({*hybridyn.__all__} - {"__version__"})


#: The robot with which most examples begin, loaded once.
five_bar = lru_cache(load)


def load_once(path: str, **words: Any) -> hybridyn.HybridRobot:
    return load(path, **words) if words else five_bar(path)


@pytest.mark.parametrize("name", [slow(name) if name in LONG else name for name in NAMES])
def test_the_example_of_a_public_name_prints_what_it_says(
    name: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    request: pytest.FixtureRequest,
) -> None:
    if name not in LONG:
        request.getfixturevalue("interpreted")
    elif needs(LONG[name]).__name__ == "warp":
        monkeypatch.setattr("warp.config.log_level", needs("gpu").LOG_WARNING)
    if name != "load":
        monkeypatch.setattr(hybridyn, "load", load_once)
    public = getattr(hybridyn, name)
    found = doctest.DocTestParser().get_doctest(inspect.getdoc(public) or "", {}, name, None, None)
    found.globs["hybridyn"] = hybridyn
    assert any(f"hybridyn.{name}(" in one.source or inspect.isclass(public) for one in found.examples)
    doctest.DocTestRunner().run(found)
    assert capsys.readouterr().out == ""
