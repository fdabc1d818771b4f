"""The polynomials of one output: A(q) y = sum_i B_i(q) / F_i(q) u_i + C(q) / D(q) e."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from idloop.errors import InputError
from idloop.estimation.black_box.control_names import control_names
from idloop.estimation.linear import Coefficient, LinearModel
from idloop.estimation.polynomial.orders import Orders
from idloop.estimation.polynomial.realization import Realization, general_form

if TYPE_CHECKING:
    import control

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Polynomials:
    """General family of black-box models (Ljung, System Identification, 2nd ed., eq. 4.33).

    All polynomials are in the delay operator: index k multiplies q^-k.

    Attributes
    ----------
    a, c, d : ndarray
        First coefficient 1.
    b : tuple of ndarray, one per input
        Coefficients from the delay on: ``b[i][k]`` multiplies u_i(t - delay_i - k).
    f : tuple of ndarray, one per input
        First coefficient 1.
    delay : tuple of int, one per input
        [samples]
    sample_time : float
        Period [s].
    variance : float
        Of the innovations e [output unit squared].
    covariance : ndarray, shape (k, k), or None
        Of the coefficients in the order of `names`.

    Raises
    ------
    InputError
        A first coefficient that is not 1, or other counts than one per input.
    """

    a: Array
    b: tuple[Array, ...]
    c: Array
    d: Array
    f: tuple[Array, ...]
    delay: tuple[int, ...]
    sample_time: float
    input_names: tuple[str, ...] = ("input",)
    output_name: str = "output"
    variance: float = float("nan")
    covariance: Array | None = None

    def __post_init__(self) -> None:
        if len(self.input_names) != len(self.b):
            raise InputError(f"{len(self.b)} polynomials B for {len(self.input_names)} inputs; give one per input")
        for name, polynomial in (("A", self.a), ("C", self.c), ("D", self.d), *(("F", f) for f in self.f)):
            if len(polynomial) == 0 or polynomial[0] != 1.0:
                raise InputError(f"polynomial {name} = {np.array2string(polynomial)}: its first coefficient must be 1")
        self.orders  # noqa: B018  (checks the counts)

    @classmethod
    def from_vector(
        cls, orders: Orders, vector: Array, *, sample_time: float, input_names: tuple[str, ...], output_name: str,
        variance: float = float("nan"), covariance: Array | None = None,
    ) -> Polynomials:  # fmt: skip
        """Build from the coefficients in the order of `names`."""
        monic = [np.concatenate([[1.0], vector[place]]) for place in (orders.a, orders.c, orders.d)]
        return cls(
            monic[0],
            tuple(np.array(vector[orders.b(i)]) for i in range(orders.inputs)),
            monic[1],
            monic[2],
            tuple(np.concatenate([[1.0], vector[orders.f(i)]]) for i in range(orders.inputs)),
            orders.nk, sample_time, input_names, output_name, variance, covariance,
        )  # fmt: skip

    @property
    def orders(self) -> Orders:
        """Degrees and delays."""
        return Orders(
            len(self.a) - 1, tuple(len(b) for b in self.b), len(self.c) - 1, len(self.d) - 1,
            tuple(len(f) - 1 for f in self.f), self.delay,
        )  # fmt: skip

    @property
    def vector(self) -> Array:
        """Coefficients in the order of `names`, shape (k,)."""
        return np.concatenate([self.a[1:], *self.b, self.c[1:], self.d[1:], *(f[1:] for f in self.f)])

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the coefficients, as "a1", "b1[u]", "c1", "d1", "f1[u]"; the number is the lag."""
        return self.orders.names(self.input_names)

    @property
    def stderr(self) -> Array:
        """Standard errors, shape (k,); NaN where none is known."""
        if self.covariance is None:
            return np.full(self.orders.size, np.nan)
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def coefficients(self) -> tuple[Coefficient, ...]:
        """The coefficients with names and standard errors."""
        numbers = zip(self.names, self.vector, self.stderr, strict=True)
        return tuple(Coefficient(name, float(value), float(error)) for name, value, error in numbers)

    def numerator(self, index: int) -> Array:
        """B of one input with its delay as leading zeros."""
        return np.concatenate([np.zeros(self.delay[index]), self.b[index]])

    @property
    def realization(self) -> Realization:
        """Innovation-form state space."""
        numerators = [self.numerator(i) for i in range(len(self.b))]
        return general_form(self.a, numerators, self.c, self.d, self.f)

    def model(
        self, *, method: str = "polynomials", input_units: tuple[str, ...] | None = None, output_unit: str = "-",
        samples: int = 0,
    ) -> LinearModel:  # fmt: skip
        """Linear model in innovation form, to simulate, predict and draw with, as of a recursive estimate.

        Parameters
        ----------
        method : str
            Name of the estimator.
        input_units : tuple of str, one per input, optional
        output_unit : str
        samples : int
            That the estimate rests on.
        """
        form = self.realization
        return LinearModel(
            method=method, a=form.a, b=form.b, c=form.c, d=form.d, gain=form.gain,
            covariance=np.array([[self.variance]]), sample_time=self.sample_time,
            input_names=self.input_names,
            input_units=("-",) * len(self.b) if input_units is None else input_units,
            output_names=(self.output_name,), output_units=(output_unit,),
            samples=samples, free=self.orders.size,
            coefficients=self.coefficients, coefficient_covariance=self.covariance,
        )  # fmt: skip

    @property
    def system(self) -> control.TransferFunction:
        """G = B / (A F) from each input, as a python-control transfer function in z."""
        import control

        pairs = [_in_z(self.numerator(i), np.convolve(self.a, f)) for i, f in enumerate(self.f)]
        return control.tf(
            [[numerator for numerator, _ in pairs]], [[denominator for _, denominator in pairs]], self.sample_time,
            inputs=control_names(self.input_names), outputs=control_names([self.output_name]),
        )  # fmt: skip

    @property
    def noise_system(self) -> control.TransferFunction:
        """H = C / (A D) from the innovations, as a python-control transfer function in z."""
        import control

        numerator, denominator = _in_z(self.c, np.convolve(self.a, self.d))
        (name,) = control_names([self.output_name])
        return control.tf(numerator, denominator, self.sample_time, inputs=[f"e[{name}]"], outputs=[name])

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        return {
            "output": self.output_name,
            "inputs": list(self.input_names),
            "sample_time": self.sample_time,
            "delay": list(self.delay),
            "a": self.a,
            "b": list(self.b),
            "c": self.c,
            "d": self.d,
            "f": list(self.f),
            "variance": self.variance,
            "coefficients": {c.name: {"value": c.value, "stderr": c.stderr} for c in self.coefficients},
        }

    def plot(self, axes: Any = None) -> Any:
        """Draw poles and zeros of G and H in the z plane; returns the matplotlib axes."""
        import matplotlib.pyplot as plt

        from idloop import drawing

        with drawing.styled():
            if axes is None:
                _, axes = plt.subplots(figsize=(4.5, 4.5), layout="constrained")
            turn = np.exp(2j * np.pi * np.linspace(0.0, 1.0, 200))
            axes.plot(turn.real, turn.imag, color=drawing.BAND, linewidth=0.6)
            systems = [
                (f"{name} → {self.output_name}", self.b[i], np.convolve(self.a, self.f[i]))
                for i, name in enumerate(self.input_names)
            ]
            for index, (text, zeros, poles) in enumerate([*systems, ("noise", self.c, np.convolve(self.a, self.d))]):
                color = drawing.MODELS[index % len(drawing.MODELS)]
                for roots, marker in ((np.roots(poles), "x"), (np.roots(np.trim_zeros(zeros, "f")), "o")):
                    label = text if marker == "x" else None
                    axes.plot(roots.real, roots.imag, marker, color=color, fillstyle="none", label=label)
            axes.set_aspect("equal")
            axes.set(xlabel=drawing.label("real part of z", None), ylabel=drawing.label("imaginary part of z", None))
            axes.set_title(f"{self.output_name}: poles × and zeros ○")
            axes.legend()
        return axes


def _in_z(numerator: Array, denominator: Array) -> tuple[Array, Array]:
    """Coefficients of falling powers of z of a ratio in q^-1."""
    size = max(len(numerator), len(denominator))
    high = np.concatenate([numerator, np.zeros(size - len(numerator))])
    low = np.concatenate([denominator, np.zeros(size - len(denominator))])
    high = np.trim_zeros(high, "f")
    return high if len(high) else np.zeros(1), low
