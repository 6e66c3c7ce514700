"""What writing a model out needs beyond hybridyn's own requirements."""

from __future__ import annotations

import importlib.util

from ..errors import CompileError, install_advice

WITHOUT_CASADI = (
    f"writing a model out needs CasADi: {install_advice('compiled')}, "
    "or CasADi alone with `pip install casadi`; the general path works without it"
)


def needs_casadi() -> None:
    """Say what to install where CasADi is not.

    Raises:
        CompileError: It is not installed.
    """
    if importlib.util.find_spec("casadi") is None:
        raise CompileError(WITHOUT_CASADI)
