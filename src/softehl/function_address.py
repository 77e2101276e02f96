"""Addresses of C functions of ctypes, cffi and Numba, as numbers that kernels get."""

from __future__ import annotations

import ctypes
from typing import Any

import cffi

from softehl.errors import SoftehlError

LOWEST_ADDRESS = 4096
"""No function lies below."""
_ffi = cffi.FFI()
_FUNCTION: Any = ctypes.CFUNCTYPE(None).__mro__[1]
"""Type of the functions of ctypes."""


class FunctionAddressError(SoftehlError, ValueError):
    """Error: something is no C function; the message says what is."""


class FunctionAddress(float):
    """Address of a C function as a parameter of a kernel; `owner` keeps the function alive."""

    owner: object

    def __reduce__(self) -> tuple[Any, ...]:
        """For `pickle`: an address means nothing in another process."""
        raise TypeError("the address of a C function cannot be pickled: name its source instead")

    def __deepcopy__(self, memo: object) -> FunctionAddress:
        """Itself."""
        return self


def address_of(name: str, function: Any) -> FunctionAddress:
    """Return the address of a C function, or of an integer.  Raises `FunctionAddressError`."""
    if isinstance(function, FunctionAddress):
        return function
    number = getattr(function, "address", function)
    if isinstance(function, _FUNCTION):
        number = ctypes.cast(function, ctypes.c_void_p).value
    elif isinstance(function, _ffi.CData):
        number = int(_ffi.cast("uintptr_t", function))
    if not isinstance(number, int) or isinstance(number, bool) or number < LOWEST_ADDRESS:
        raise FunctionAddressError(
            f"{name} = {function!r}: give the address of a C function, of ctypes, cffi or Numba, "
            "or as an integer"
        )
    address = FunctionAddress(number)
    address.owner = function
    return address
