"""The polynomials of one output: A(q) y = sum_i B_i(q) / F_i(q) u_i + C(q) / D(q) e."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop.arrays import Array, Complex
from idloop.errors import InputError
from idloop.estimation.black_box.labels import control_names
from idloop.estimation.linear import Coefficient, LinearModel
from idloop.estimation.linear.sensitivity import Matrices

if TYPE_CHECKING:
    import control


@dataclass(frozen=True)
class Orders:
    """Degrees and delays; InputError for negative ones, or not one of nb, nf and nk per input."""

    na: int  # degree of A
    nb: tuple[int, ...]  # number of coefficients of B of each input
    nc: int  # degree of C
    nd: int  # degree of D
    nf: tuple[int, ...]  # degree of F of each input
    nk: tuple[int, ...]  # delay of each input [samples]

    def __post_init__(self) -> None:
        if not len(self.nb) == len(self.nf) == len(self.nk):
            raise InputError(f"orders nb {self.nb}, nf {self.nf}, nk {self.nk}: give one of each per input")
        numbers = {"na": (self.na,), "nb": self.nb, "nc": (self.nc,), "nd": (self.nd,), "nf": self.nf, "nk": self.nk}
        for name, values in numbers.items():
            if any(value < 0 for value in values):
                raise InputError(f"order {name} = {', '.join(map(str, values))}; orders and delays must be 0 or more")
        if self.size == 0:
            raise InputError("all orders are 0: nothing to estimate; give na, nb or nc at least 1")

    @classmethod
    def of(
        cls, inputs: int | None = None, *, na: int = 0, nb: int | Sequence[int] = 0, nc: int = 0, nd: int = 0,
        nf: int | Sequence[int] = 0, nk: int | Sequence[int] = 1,
    ) -> Orders:  # fmt: skip
        """Orders from numbers or sequences; without `inputs` the longest sequence sets the number of inputs."""
        if inputs is None:
            inputs = max([len(value) for value in (nb, nf, nk) if not isinstance(value, int)], default=1)
        return cls(na, per_input(nb, inputs, "nb"), nc, nd, per_input(nf, inputs, "nf"), per_input(nk, inputs, "nk"))

    @property
    def inputs(self) -> int:
        """Number of inputs."""
        return len(self.nb)

    @property
    def size(self) -> int:
        """Number of coefficients."""
        return self.na + sum(self.nb) + self.nc + self.nd + sum(self.nf)

    @cached_property
    def _places(self) -> list[slice]:
        edges = np.cumsum([0, self.na, *self.nb, self.nc, self.nd, *self.nf]).tolist()
        return [slice(first, stop) for first, stop in pairwise(edges)]

    @property
    def a(self) -> slice:
        """Place of the coefficients of A."""
        return self._places[0]

    def b(self, index: int) -> slice:
        """Place of the coefficients of B of one input."""
        return self._places[1 + index]

    @property
    def c(self) -> slice:
        """Place of the coefficients of C."""
        return self._places[1 + self.inputs]

    @property
    def d(self) -> slice:
        """Place of the coefficients of D."""
        return self._places[2 + self.inputs]

    def f(self, index: int) -> slice:
        """Place of the coefficients of F of one input."""
        return self._places[3 + self.inputs + index]

    def names(self, inputs: Sequence[str]) -> tuple[str, ...]:
        """Names of the coefficients; the number is the lag: b3[u] multiplies u(t - 3)."""
        names = [f"a{k}" for k in range(1, self.na + 1)]
        for nb, nk, name in zip(self.nb, self.nk, inputs, strict=True):
            names += [f"b{k}[{name}]" for k in range(nk, nk + nb)]
        names += [f"c{k}" for k in range(1, self.nc + 1)] + [f"d{k}" for k in range(1, self.nd + 1)]
        for nf, name in zip(self.nf, inputs, strict=True):
            names += [f"f{k}[{name}]" for k in range(1, nf + 1)]
        return tuple(names)


def per_input(value: int | Sequence[int], inputs: int, name: str) -> tuple[int, ...]:
    """Spread one number over all inputs, or check that there is one for each."""
    values = (int(value),) * inputs if isinstance(value, int) else tuple(int(v) for v in value)
    if len(values) != inputs:
        raise InputError(f"{name} has {len(values)} entries for {inputs} inputs; give one number or one per input")
    return values


def radius(polynomial: Array) -> float:
    """Largest magnitude of the roots of 1 + p1 q^-1 + ... (0 for a constant, infinite if not finite)."""
    if len(polynomial) < 2:
        return 0.0
    if not np.all(np.isfinite(polynomial)):
        return float("inf")
    return float(np.max(np.abs(np.roots(polynomial)), initial=0.0))


def reflect(polynomial: Array, limit: float = 1.0) -> Array:
    """Mirror the roots outside the unit circle at it, and pull what is still beyond `limit` in to that.

    Mirroring keeps the magnitude of the frequency response up to a factor.
    """
    if radius(polynomial) <= limit:
        return polynomial
    roots = np.roots(polynomial)
    size = np.abs(roots)
    roots = np.where(size > max(limit, 1.0), roots / np.maximum(size, 1.0) ** 2, roots)
    size = np.abs(roots)
    roots = np.where(size > limit, roots * limit / np.maximum(size, limit), roots)
    result = np.zeros(len(polynomial))
    found = np.real(np.poly(roots))
    result[: len(found)] = found
    return result


def observer_form(denominator: Array, numerators: Sequence[Array]) -> tuple[Array, Array, Array, Array]:
    """State space of y = sum_i N_i(q) / P(q) v_i (Ljung, System Identification, 2nd ed., eq. 4.87 to 4.90).

    `denominator`: P, coefficients of 1, q^-1, ...; the first is 1; `numerators`: N_i, coefficients of 1, q^-1, .
    Returns `a, b, c, d` (n, n), (n, m), (1, n), (1, m).
    """
    order = max([len(denominator), *(len(n) for n in numerators)]) - 1
    low = np.zeros(order + 1)
    low[: len(denominator)] = denominator
    high = np.zeros((order + 1, len(numerators)))
    for index, numerator in enumerate(numerators):
        high[: len(numerator), index] = numerator
    a = np.eye(order, k=1)
    if order:
        a[:, 0] -= low[1:]
    b = high[1:] - np.outer(low[1:], high[0])
    return a, b, np.eye(1, order), high[:1].copy()


def general_form(a: Array, b: Sequence[Array], c: Array, d: Array, f: Sequence[Array]) -> Matrices:
    """State space of A y = sum_i B_i / F_i u_i + C / D e for one output.

    `a`, `c`, `d`: polynomials, first coefficient 1; `b`, `f`: of each input; B with its delay as leading zeros.
    """
    # A path with its own denominator is a subsystem in series with 1/A; the others drive 1/A directly.
    paths = [(num, den, column) for column, (num, den) in enumerate(zip(b, f, strict=True))] + [(c, d, len(b))]
    through = [np.ones(1) if len(den) > 1 else num for num, den, _ in paths]
    core = observer_form(a, through)
    parts = [(observer_form(den, [num]), column) for num, den, column in paths if len(den) > 1]
    order = core[0].shape[0] + sum(part[0].shape[0] for part, _ in parts)
    size, width = core[0].shape[0], len(paths)
    aa, bb, cc, dd = np.zeros((order, order)), np.zeros((order, width)), np.zeros((1, order)), np.zeros((1, width))
    aa[:size, :size], bb[:size], cc[:, :size], dd[:] = core
    first = size
    for (pa, pb, pc, pd), column in parts:
        rows = slice(first, first + pa.shape[0])
        aa[rows, rows], bb[rows, column] = pa, pb[:, 0]
        aa[:size, rows] = core[1][:, [column]] @ pc
        cc[:, rows] = core[3][0, column] * pc
        bb[:size, column] = core[1][:, column] * pd[0, 0]
        dd[0, column] = core[3][0, column] * pd[0, 0]
        first = rows.stop
    return Matrices(aa, bb[:, :-1], cc, dd[:, :-1], bb[:, -1:])


def stack(parts: Sequence[Matrices]) -> Matrices:
    """One model of several outputs from one model of each, side by side."""
    from scipy.linalg import block_diag

    return Matrices(
        block_diag(*(part.a for part in parts)),
        np.vstack([part.b for part in parts]),
        block_diag(*(part.c for part in parts)),
        np.vstack([part.d for part in parts]),
        block_diag(*(part.gain for part in parts)),
    )


@dataclass(frozen=True, eq=False)
class Polynomials:
    """General family of black-box models (Ljung, System Identification, 2nd ed., eq. 4.33).

    All polynomials are in the delay operator: index k multiplies q^-k. Raises InputError where the first coefficient of
    A, C, D or an F is not 1, or for other counts than one per input.
    """

    a: Array
    b: tuple[Array, ...]  # of each input from its delay on: ``b[i][k]`` multiplies u_i(t - delay_i - k)
    c: Array
    d: Array
    f: tuple[Array, ...]  # of each input
    delay: tuple[int, ...]  # of each input [samples]
    sample_time: float  # period [s]
    input_names: tuple[str, ...] = ("input",)
    output_name: str = "output"
    variance: float = float("nan")  # of the innovations e [output unit squared]
    covariance: Array | None = None  # shape (k, k): of the coefficients in the order of `names`

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
    def realization(self) -> Matrices:
        """Innovation-form state space."""
        numerators = [self.numerator(i) for i in range(len(self.b))]
        return general_form(self.a, numerators, self.c, self.d, self.f)

    def model(self) -> LinearModel:
        """Linear model in innovation form, to simulate, predict and draw with, as of a recursive estimate."""
        count = len(self.b)
        return LinearModel(
            "polynomials", *self.realization.parts, np.array([[self.variance]]), self.sample_time, self.input_names,
            ("-",) * count, (self.output_name,), ("-",), samples=0, free=self.orders.size,
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
        names = ("sample_time", "delay", "a", "b", "c", "d", "f", "variance")
        return {
            "output": self.output_name,
            "inputs": self.input_names,
            **{name: getattr(self, name) for name in names},
            "coefficients": {c.name: {"value": c.value, "stderr": c.stderr} for c in self.coefficients},
        }


def _in_z(numerator: Array, denominator: Array) -> tuple[Array, Array]:
    """Coefficients of falling powers of z of a ratio in q^-1."""
    size = max(len(numerator), len(denominator))
    high = np.concatenate([numerator, np.zeros(size - len(numerator))])
    low = np.concatenate([denominator, np.zeros(size - len(denominator))])
    high = np.trim_zeros(high, "f")
    return high if len(high) else np.zeros(1), low


def response_error(polynomials: Polynomials, index: int, frequency: Array) -> tuple[Complex, Array, Array]:
    """Response G = B / (A F) from one input, with the standard errors of its size and angle.

    To first order in the coefficients: dG is linear in them, d|G| / |G| the real part of dG / G and the angle its
    imaginary part (Ljung, System Identification, 2nd ed., section 9.4).

    `index`: input; `frequency` (f,): [Hz]. Returns `response` (f,): [output unit / input unit]. `size_error` (f,):
    standard error of the magnitude [output unit / input unit]; NaN where no covariance is known. `angle_error` (f,):
    standard error of the phase [rad].
    """
    orders = polynomials.orders
    delayed = np.exp(-2j * np.pi * np.asarray(frequency, dtype=float) * polynomials.sample_time)

    def powers(first: int, count: int) -> Complex:
        return np.asarray(delayed[:, None] ** np.arange(first, first + count))

    def value(coefficients: Array) -> Complex:
        return np.asarray(powers(0, len(coefficients)) @ coefficients)

    a, f = value(polynomials.a), value(polynomials.f[index])
    response = value(polynomials.numerator(index)) / (a * f)
    if polynomials.covariance is None:
        return response, np.full(response.shape, np.nan), np.full(response.shape, np.nan)
    slope = np.zeros((len(delayed), orders.size), dtype=complex)
    slope[:, orders.a] = -response[:, None] * powers(1, orders.na) / a[:, None]
    slope[:, orders.b(index)] = powers(orders.nk[index], orders.nb[index]) / (a * f)[:, None]
    slope[:, orders.f(index)] = -response[:, None] * powers(1, orders.nf[index]) / f[:, None]
    size = np.abs(response)
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = slope / response[:, None]
    radial, turning = (
        np.sqrt(np.maximum(np.einsum("fi,ij,fj->f", part, polynomials.covariance, part), 0.0))
        for part in (relative.real, relative.imag)
    )
    return response, size * radial, turning
