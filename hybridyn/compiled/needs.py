"""What writing a model out needs beyond hybridyn's own requirements."""

from __future__ import annotations

import importlib.util

from ..errors import CompileError

WITHOUT_CASADI = (
    "writing a model out needs CasADi, of the extra 'compiled': install it with `pip install "
    "'hybridyn[compiled]'`, or alone with `pip install casadi`; the general path works without it"
)


def needs_casadi() -> None:
    """Say what to install where CasADi is not.

    Raises:
        CompileError: It is not installed.
    """
    if importlib.util.find_spec("casadi") is None:
        raise CompileError(WITHOUT_CASADI)
