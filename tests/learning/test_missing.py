"""Learning frameworks are asked for by name, and not before."""

import sys
from collections.abc import Callable

import pytest

import hybridyn
from tests.support.comparing import refused


@pytest.mark.parametrize("function", [hybridyn.torch, hybridyn.jax])
def test_a_framework_that_is_not_installed_is_named(
    function: Callable[..., object], monkeypatch: pytest.MonkeyPatch
) -> None:
    name = function.__name__
    monkeypatch.setitem(sys.modules, name, None)
    words = rf"hybridyn.{name} needs {name}: install it with `pip install -e '.\[{name}\]'`"
    refused(lambda: function(hybridyn.load("five_bar")), hybridyn.HybridynError, words)
