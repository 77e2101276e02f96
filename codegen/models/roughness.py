"""Rough surfaces in a film: functions of H = h / sigma, sigma the rms height of both together.

Flow factors of Patir and Cheng (1978, 1979) for isotropic Gaussian heights, the pressure of
asperities of Greenwood and Williamson (1966), and the mean gap where surfaces interpenetrate. Flow
factors take the effective thickness over sigma, which is positive however far that is.
"""

from __future__ import annotations

from typing import Any

import sympy as sp

R = sp.Rational
_JOINT = 5
"""H at which the published fits of the shear flow factors end."""


def effective(H: Any) -> Any:
    """Effective thickness over sigma: H from 1/2 on, positive and once differentiable below."""
    return sp.Piecewise((H, R(1, 2) <= H), (1 / (4 - 4 * H), True))


def mean_gap(H: Any) -> Any:
    """Mean gap h_T / sigma where heights that interpenetrate leave none."""
    return H * (1 - sp.erfc(H / sp.sqrt(2)) / 2) + sp.exp(-(H**2) / 2) / sp.sqrt(2 * sp.pi)


def asperities(H: Any) -> Any:
    """Greenwood's F_3/2(H), the mean of max(s - H, 0)^(3/2) over a normal variable s.

    With s = H + y^2 the integrand is even and smooth in y, y^4 exp(-(H + y^2)^2 / 2), for which the
    trapezoidal rule converges exponentially: steps of 1/6 up to 3.5 leave 1e-14 for H > -3.
    """
    step = R(1, 6)
    squares = [(k * step) ** 2 for k in range(1, 22)]
    total = sum(s**2 * sp.exp(-((H + s) ** 2) / 2) for s in squares)
    return 2 * step * total / sp.sqrt(2 * sp.pi)


def pressure_flow(H: Any) -> Any:
    """Factor phi_p of the pressure flow."""
    return 1 - R(9, 10) * sp.exp(-R(14, 25) * H)


def shear_flow(H: Any) -> Any:
    """Factor Phi_s of the flow that a rough surface carries along in its valleys."""
    inner = _shear_flow_fit(H)
    outer = _shear_flow_fit(sp.Integer(_JOINT)) * sp.exp(-(H - _JOINT) / 4)
    return sp.Piecewise((inner, H <= _JOINT), (outer, True))


def _shear_flow_fit(H: Any) -> Any:
    return R(1899, 1000) * H ** R(49, 50) * sp.exp(-R(23, 25) * H + H**2 / 20)


def shear_stress(H: Any) -> Any:
    """Factor phi_f of the mean of eta U / h, for heights up to 3 sigma; asperities from 0.01 on."""
    z = H / 3
    cubic = (1 - z**2) ** 3
    close_form = cubic * sp.log((z + 1) / (z - 1)) + z / 15 * (66 + z**2 * (30 * z**2 - 80))
    tail = z * (132 + z * (345 + z * (-160 + z * (-405 + z * (60 + 147 * z)))))
    mixed = cubic * sp.log(300 * (z + 1)) + R(1, 60) * (-55 + tail)
    factor = R(35, 32) * z
    return sp.Piecewise((_far(z), z >= 2), (factor * close_form, z > 1), (factor * mixed, True))


def _far(z: Any) -> Any:
    """phi_f by the moments of the heights, where its closed form has lost its digits."""
    moments = [sp.Integer(1)]
    for k in range(1, 20):
        moments.append(moments[-1] * R(2 * k - 1, 2 * k + 7))
    inverse, value = 1 / z**2, sp.Integer(0)
    for moment in reversed(moments):
        value = moment + inverse * value
    return value


def shear_difference(H: Any) -> Any:
    """Factor phi_fs: what the roughness of one surface adds to phi_f."""
    outer = _shear_difference_fit(sp.Integer(_JOINT)) * sp.exp(-R(409, 500) * (H - _JOINT))
    return sp.Piecewise((_shear_difference_fit(H), H <= _JOINT), (outer, True))


def _shear_difference_fit(H: Any) -> Any:
    return R(111, 10) * H ** R(231, 100) * sp.exp(-R(119, 50) * H + R(11, 100) * H**2)


def pressure_stress(H: Any) -> Any:
    """Factor phi_fp of the shear stress that the pressure gradient causes."""
    return 1 - R(7, 5) * sp.exp(-R(33, 50) * H)
