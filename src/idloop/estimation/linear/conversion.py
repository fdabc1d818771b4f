"""Continuous to discrete time and back: commands held, joined by straight lines, or by Tustin's rule."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.estimation.linear.model import LinearModel

if TYPE_CHECKING:
    import control

Hold = Literal["zoh", "foh", "tustin"]

_HOLDS = ("zoh", "foh", "tustin")
_ROUNDING = 1e-7  # of the largest pole: nearer to zero, or to the negative axis, a pole lies on it


def c2d(system: control.StateSpace | control.TransferFunction, sample_time: float, hold: Hold = "zoh") -> Any:
    """Sample a continuous-time system.

    Parameters
    ----------
    system : python-control StateSpace or TransferFunction
        Continuous.
    sample_time : float
        Period [s].
    hold : "zoh", "foh" or "tustin"
        Command held between samples, joined by straight lines, or the trapezoidal rule.

    Returns
    -------
    python-control system of the same kind
        Discrete, with the same names of inputs and outputs.

    Raises
    ------
    InputError
        A system that is discrete already, a period that is not positive, or another hold.
    """
    from scipy.signal import cont2discrete

    given, a, b, c, d = _matrices(system)
    if not given.isctime():
        raise InputError(f"system has sample time {given.dt}; c2d takes a continuous one, d2d changes the sample time")
    _check(sample_time, hold)
    method = "bilinear" if hold == "tustin" else hold
    ad, bd, cd, dd, _ = cont2discrete((a, b, c, d), sample_time, method=method)
    return _like(system, ad, bd, cd, dd, sample_time)


def d2c(system: LinearModel | control.StateSpace | control.TransferFunction, hold: Hold = "zoh") -> Any:
    """Continuous-time system that gives the same samples.

    Integrators are left exact: the logarithm is taken of the matrix that holds A and B together (Åström and
    Wittenmark, Computer-Controlled Systems, 3rd ed., section 2.3).

    Parameters
    ----------
    system : LinearModel or discrete python-control system
        Of a model, the part from the commands to the outputs.
    hold : "zoh", "foh" or "tustin"
        As for `c2d`.

    Returns
    -------
    python-control TransferFunction for such a system, StateSpace otherwise
        Continuous.

    Raises
    ------
    InputError
        A system that is not discrete, or poles that no continuous-time system has: zero or negative ones with zoh
        and foh, and -1 with tustin.
    """
    source = system.system if isinstance(system, LinearModel) else system
    given, a, b, c, d = _matrices(source)
    if not given.isdtime(strict=True) or given.dt is True:
        raise InputError(f"system has sample time {given.dt}; d2c takes a discrete one with a period in seconds")
    _check(float(given.dt), hold)
    back = {"zoh": _from_held, "foh": _from_lines, "tustin": _from_tustin}[hold]
    return _like(source, *back(a, b, c, d, float(given.dt)), 0)


def d2d(
    system: LinearModel | control.StateSpace | control.TransferFunction, sample_time: float, hold: Hold = "zoh"
) -> Any:
    """Discrete-time system at another sample time, by way of continuous time.

    Parameters, results and errors as for `d2c` and `c2d`.
    """
    return c2d(d2c(system, hold), sample_time, hold)


def _from_held(a: Array, b: Array, c: Array, d: Array, period: float) -> tuple[Array, Array, Array, Array]:
    n, m = b.shape
    joint = np.eye(n + m)
    joint[:n] = np.hstack([a, b])
    rates = _logarithm(joint, a, "zoh") / period
    return rates[:n, :n], rates[:n, n:], c, d


def _from_lines(a: Array, b: Array, c: Array, d: Array, period: float) -> tuple[Array, Array, Array, Array]:
    """Undo the state that the sampled system with a first-order hold has: x + (what the next command adds) u."""
    from scipy.linalg import expm

    n = len(a)
    rates = _logarithm(a, a, "foh") / period
    # The exponential of (A, I, 0; 0, 0, I; 0, 0, 0) holds the responses to a step and to a ramp.
    joint = np.zeros((3 * n, 3 * n))
    joint[:n, :n] = rates * period
    joint[:n, n : 2 * n] = joint[n : 2 * n, 2 * n :] = np.eye(n)
    exponential = expm(joint)[:n]
    step, ramp = exponential[:, n : 2 * n], exponential[:, 2 * n :]
    # B_d = (step - ramp + A_d ramp) B T and D_d = D + C ramp B T, after Franklin, Powell and Workman, section 6.2.
    into = np.linalg.solve(step - ramp + a @ ramp, b)
    return rates, into / period, c, d - c @ ramp @ into


def _from_tustin(a: Array, b: Array, c: Array, d: Array, period: float) -> tuple[Array, Array, Array, Array]:
    eye = np.eye(len(a))
    poles = np.linalg.eigvals(a)
    if np.any(np.abs(poles + 1.0) <= _ROUNDING):
        raise InputError("a pole at -1 has no continuous-time counterpart by Tustin's rule; use another hold")
    inverse = np.linalg.inv(eye + a)
    rates = 2.0 / period * inverse @ (a - eye)
    # With w = (I + A)^-1 the transfer function is C (zI - A)^-1 B at z = (1 + s T / 2) / (1 - s T / 2).
    return rates, 2.0 / period * inverse @ b, 2.0 * c @ inverse, d - c @ inverse @ b


def _logarithm(joint: Array, a: Array, hold: str) -> Array:
    from scipy.linalg import logm

    poles = np.linalg.eigvals(a)
    size = float(np.max(np.abs(poles), initial=1.0))
    zero = np.abs(poles) <= _ROUNDING * size
    negative = (poles.real < 0.0) & (np.abs(poles.imag) <= _ROUNDING * size)
    if np.any(zero):
        raise InputError(
            f'{int(zero.sum())} poles at zero (delays) have no continuous-time counterpart with hold "{hold}";'
            ' take the delay out of the model, or use hold "tustin"'
        )
    if np.any(negative):
        raise InputError(
            f"pole {poles[negative][0].real:.4g} on the negative real axis has no continuous-time counterpart with hold"
            f' "{hold}"; identify with a lower order or a shorter sample time, or use hold "tustin"'
        )
    result = logm(joint)
    return np.asarray(result.real, dtype=float)


def _matrices(system: Any) -> tuple[Any, Array, Array, Array, Array]:
    import control

    if not isinstance(system, control.StateSpace | control.TransferFunction):
        raise InputError(f"{type(system).__name__} cannot be converted; give a LinearModel or a python-control system")
    states = control.ss(system)
    return states, *(np.asarray(part, dtype=float) for part in (states.A, states.B, states.C, states.D))


def _like(system: Any, a: Array, b: Array, c: Array, d: Array, period: float) -> Any:
    """Of the kind and with the names of the given system."""
    import control

    names = {"inputs": system.input_labels, "outputs": system.output_labels}
    states = control.ss(a, b, c, d, period, **names)
    return control.ss2tf(states, **names) if isinstance(system, control.TransferFunction) else states


def _check(sample_time: float, hold: str) -> None:
    if not sample_time > 0.0:
        raise InputError(f"sample time {sample_time:g} s; it must be positive")
    if hold not in _HOLDS:
        raise InputError(f'hold "{hold}" is not known; use one of {", ".join(_HOLDS)}')
