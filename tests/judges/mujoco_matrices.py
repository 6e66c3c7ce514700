"""Matrices of MuJoCo's models, by every version of MuJoCo."""

from typing import Any

import numpy as np


def mass_matrix(model: Any, data: Any) -> np.ndarray:
    """Return the mass matrix of a MuJoCo model, shape (nv, nv).

    Args:
        model: MuJoCo's model.
        data: Its data, after `mj_forward`.
    """
    import mujoco

    M = np.zeros((model.nv, model.nv))
    try:
        mujoco.mj_fullM(model, data, M)
    except TypeError:  # before MuJoCo 4
        mujoco.mj_fullM(model, M, data.qM)
    return M
