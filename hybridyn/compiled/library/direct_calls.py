"""Call C functions of NumPy arrays through the interface of CPython, without the overhead of ctypes."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

import numpy as np

#: Status of a single call whose arguments are not contiguous arrays of the library's type.
REFUSED = 1

#: CPython's flag for a C function that receives its arguments in one array.
METH_FASTCALL = 0x0080

#: Status of a single call: done, refused, or done but the guard is above its limit.
ANSWERS = (0, REFUSED, 2)


class Method(ctypes.Structure):
    """CPython's `PyMethodDef`: a C function that Python calls directly, without ctypes."""

    _fields_ = (
        ("name", ctypes.c_char_p),
        ("address", ctypes.c_void_p),
        ("flags", ctypes.c_int),
        ("doc", ctypes.c_char_p),
    )

    def function(self, given: Any = None) -> Callable[..., int]:
        """Return the function, which receives `given` as its first argument in C.

        This structure must stay alive as long as the function.
        """
        new = ctypes.pythonapi.PyCFunction_NewEx
        new.restype = ctypes.py_object
        new.argtypes = [ctypes.POINTER(Method), ctypes.py_object, ctypes.c_void_p]
        made: Callable[..., int] = new(ctypes.byref(self), given, None)
        return made


def knows_arrays(held: ctypes.PyDLL, dtype: np.dtype[Any]) -> bool:
    """Set up the reading of NumPy arrays in C, and return whether C sees their layout correctly."""
    held.hybridyn_setup.argtypes = [ctypes.c_void_p] * 4
    held.hybridyn_setup.restype = None
    answers = (ctypes.c_void_p * len(ANSWERS))(*map(id, ANSWERS))
    increment = ctypes.cast(ctypes.pythonapi.Py_IncRef, ctypes.c_void_p)
    held.hybridyn_setup(id(np.ndarray), id(dtype), answers, increment)
    held.hybridyn_layout.argtypes = [ctypes.py_object, ctypes.c_void_p, ctypes.c_longlong, ctypes.c_longlong]
    held.hybridyn_layout.restype = ctypes.c_int
    for shape in ((3, 5), (7, 2)):
        array = np.zeros(shape, dtype)
        if type(array) is not np.ndarray or array.dtype is not dtype:
            return False
        if not held.hybridyn_layout(array, array.ctypes.data, shape[0], dtype.itemsize):
            return False
    return True
