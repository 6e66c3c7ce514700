"""Check that CasADi, which code generation needs, is installed."""

from __future__ import annotations

import importlib.util

from ..errors import CompileError, install_advice

WITHOUT_CASADI = (
    f"compiling a model needs CasADi: {install_advice('compiled')}, "
    "or CasADi alone with `pip install casadi`; the general path works without it"
)


def needs_casadi() -> None:
    """Check that CasADi is installed.

    Raises:
        CompileError: CasADi is not installed; the message says how to install it.
    """
    if importlib.util.find_spec("casadi") is None:
        raise CompileError(WITHOUT_CASADI)
