"""Row A4: the estimators of the toolbox's five layers on one data set of the simulated motor."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from papers import Progress
from papers.claim import Claim, above, below, equals, near
from papers.log_ticks import plain_ticks
from papers.motor import lehigh_motor
from papers.reproduction import Line, Reproduction, Table

if TYPE_CHECKING:
    import control
    from idloop.estimation.black_box.sampled import SampledData
    from idloop.estimation.linear import LinearModel
    from idloop.estimation.nonparametric import FrequencyResponse, ImpulseResponse

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

# Samples of each of the two records, amplitude [V] and band [Hz] of their excitation.
SAMPLES, AMPLITUDE, BAND = 2000, lehigh_motor.SQUARE_AMPLITUDE, 2.0
VELOCITY = 1
# A consistent estimate of these two numbers lies this close to the truth, and its free run this close to the truth's.
_TRUTH_ERROR, _FIT_LOSS = 5.0, 0.5
# A response without a model scatters: that much of the whole, with everything that smooths it switched on.
_SCATTER = 15.0
# Of the thesis, where the layers are.
_PLACE = "chapter 5"


@dataclass(frozen=True, eq=False)
class Method:
    """One estimator on the common data.

    Attributes
    ----------
    layer : int
        Of the toolbox (thesis, chapter 5).
    command : str
        Of the toolbox.
    ours : str
        Function.
    orders : str
        What was estimated.
    fit : float
        FIT of the free run on the validation record [%]; NaN for a response that cannot run.
    truth_error : float
        Distance of the frequency response from the true one over the band, over its size [%].
    claim : str
        What is claimed of it: "consistent", "biased", "scatters" or nothing.
    """

    layer: int
    command: str
    ours: str
    orders: str
    fit: float
    truth_error: float
    claim: str = ""


@dataclass(frozen=True, eq=False)
class Tool:
    """A command that is no estimator, with a number that shows that it is right.

    Attributes
    ----------
    layer : int
    command, ours : str
        The toolbox's and ours.
    checked : str
        What the number is.
    value : float
    claim : Claim
    """

    layer: int
    command: str
    ours: str
    checked: str
    value: float
    claim: Claim

    def line(self) -> Line:
        """The number and what is claimed of it."""
        return Line(f"{self.command}: {self.checked}", self.value, f"layer {self.layer}", "", _PLACE, self.claim)

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        line = self.line()
        return {**vars(self), "claim": line.claimed, "holds": line.holds}


@dataclass(frozen=True, eq=False)
class ToolboxLayers(Reproduction):
    """All layers on the same two records.

    Attributes
    ----------
    methods : tuple of Method
    tools : tuple of Tool
    best : float
        FIT of the true model on the validation record [%]: the most that the noise allows.
    frequency : ndarray, shape (f,)
        [Hz]
    true : ndarray of complex, shape (f,)
        From command to velocity.
    responses : dict of str to ndarray of complex
        Of each method at `frequency`.
    """

    methods: tuple[Method, ...]
    tools: tuple[Tool, ...]
    best: float
    frequency: Array
    true: Complex
    responses: dict[str, Complex]

    def rows(self) -> tuple[Line, ...]:
        """FIT and distance from the truth of every estimator, then the tools."""
        lines = [Line("most that the noise allows: FIT", self.best, None, "%", "")]
        for method in self.methods:
            listed = f"layer {method.layer}"
            if np.isfinite(method.fit):
                lines.append(Line(f"{method.command}: FIT", method.fit, listed, "%", _PLACE, self._fits(method)))
            lines.append(
                Line(f"{method.command}: distance from the truth", method.truth_error, listed, "%", _PLACE,
                     self._near(method))
            )  # fmt: skip
        return (*lines, *(tool.line() for tool in self.tools))

    def _fits(self, method: Method) -> Claim | None:
        return above(self.best - _FIT_LOSS) if method.claim == "consistent" else None

    def _near(self, method: Method) -> Claim | None:
        known = {"biased": above(_TRUTH_ERROR), "consistent": below(_TRUTH_ERROR), "scatters": below(_SCATTER)}
        return known.get(method.claim)

    def tables(self) -> tuple[Table, ...]:
        """One line for each estimator, with our function."""
        header = ("layer", "toolbox", "ours", "estimated", "FIT %", "from the truth %", "expected")
        rows = [
            (float(m.layer), m.command, m.ours, m.orders, m.fit, m.truth_error, m.claim or "-") for m in self.methods
        ]
        return (Table("Estimators on the same records", header, rows),)

    def notes(self) -> tuple[str, ...]:
        """What the data is, and what "biased" means."""
        return (
            (
                f"Command to tachometer of the motor of eq. 7.2, two pseudo-random records of {AMPLITUDE:g} V with"
                " the thesis's noise: one to estimate, one to validate. The free run begins at rest; FIT is limited"
                " by noise."
            ),
            (
                "The sensor's noise is white at the output. ARX of the true order takes it for white equation errors"
                " and is biased, as theory says; output error, Box-Jenkins, ARMAX, instruments and subspaces are"
                " not."
            ),
            "The plain empirical transfer function is as erratic as theory says; smoothed it is useful.",
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            **super().to_dict(),
            "methods": [vars(method) for method in self.methods],
            "tools": [tool.to_dict() for tool in self.tools],
            "best_fit": self.best,
        }

    def plot(self, axes: Any = None) -> Any:
        """Draw FIT and distance from the truth of every method, and all responses; returns the three axes."""
        import matplotlib.pyplot as plt

        from idloop import drawing

        names = [method.command for method in self.methods]
        place = np.arange(len(names))
        with drawing.styled():
            if axes is None:
                figure = plt.figure(figsize=(9.5, 7.0), layout="constrained")
                grid = figure.add_gridspec(2, 2, width_ratios=(1.0, 1.0))
                axes = np.array(
                    [figure.add_subplot(grid[:, 0]), figure.add_subplot(grid[0, 1]), figure.add_subplot(grid[1, 1])]
                )
            fits = [method.fit for method in self.methods]
            axes[0].barh(place, fits, color=drawing.BAND)
            axes[0].axvline(self.best, color=drawing.MODELS[1], label="true model")
            axes[0].set(yticks=place, yticklabels=names, xlabel=drawing.label("FIT of the free run", "%"))
            known = [fit for fit in fits if np.isfinite(fit)]
            axes[0].set_xlim(max(min(known) - 3.0, 0.0), self.best + 3.0)
            axes[0].invert_yaxis()
            axes[0].legend(loc="lower right")
            errors = [method.truth_error for method in self.methods]
            axes[1].bar(place, errors, color=drawing.BAND)
            axes[1].set(yscale="log", ylabel=drawing.label("distance from the truth", "%"), xticks=place)
            axes[1].set_xticklabels(names, rotation=90)
            named = 0
            for method in self.methods:
                # Those that lie on the true curve need no names.
                far = method.truth_error > 1.0
                look = drawing.model_look(named) if far else {"color": drawing.BAND}
                response = np.abs(self.responses[method.command])
                axes[2].loglog(self.frequency, response, **look, label=method.command if far else None)
                named += int(far)
            axes[2].plot([], [], color=drawing.BAND, label="all others")
            axes[2].loglog(self.frequency, np.abs(self.true), color=drawing.MEASURED, linewidth=1.6, label="true")
            axes[2].set_ylabel(drawing.label("magnitude", "rad/s/V"))
            axes[2].set_xlabel(drawing.label("frequency", "Hz"))
            axes[2].legend(ncols=2, fontsize=7)
            plain_ticks(axes[2].xaxis, axes[2].yaxis)
        return axes


@dataclass(frozen=True, eq=False)
class _Bench:
    """The two records, the truth, and the measures."""

    train: SampledData
    validation: SampledData
    plant: control.StateSpace
    frequency: Array

    @property
    def true(self) -> Complex:
        return self.true_at(self.frequency)

    def true_at(self, frequency: Array) -> Complex:
        z = np.exp(2j * np.pi * frequency * self.train.sample_time)
        return np.asarray(np.atleast_1d(self.plant(z)), dtype=complex)

    def fit(self, modelled: Array) -> float:
        from idloop.validation import fit_percent

        return float(fit_percent(self.validation.output[:, 0], modelled)[0])

    def distance(self, response: Complex, frequency: Array | None = None) -> float:
        true = self.true if frequency is None else self.true_at(frequency)
        return float(100.0 * np.linalg.norm(response - true) / np.linalg.norm(true))

    def model(self, model: LinearModel) -> tuple[float, float, Complex]:
        """FIT, distance and response of a model."""
        response = model.response(self.frequency)[:, 0, 0]
        return self.fit(model.simulate(self.validation, "zero")[:, 0]), self.distance(response), response

    def measured(self, measured: FrequencyResponse) -> tuple[float, float, Complex]:
        """The same of a frequency response without a model, which has no free run."""
        inside = (measured.frequency >= self.frequency[0]) & (measured.frequency <= self.frequency[-1])
        where, values = measured.frequency[inside], measured.response[inside, 0, 0]
        return float("nan"), self.distance(values, where), np.interp(self.frequency, where, values)

    def weights(self, weights: ImpulseResponse) -> tuple[float, float, Complex]:
        """The same of an impulse response."""
        causal = weights.lag >= 0
        g = weights.response[causal, 0]
        modelled = np.convolve(self.validation.input[:, 0], g)[: len(self.validation)]
        delays = weights.lag[causal] * self.train.sample_time
        response = np.exp(-2j * np.pi * np.outer(self.frequency, delays)) @ g
        return self.fit(modelled), self.distance(response), response


def reproduce(seed: int, progress: Progress, samples: int = SAMPLES) -> ToolboxLayers:
    """Run every layer of the toolbox on two records of the simulated motor.

    Parameters
    ----------
    seed : int
        Of excitation and noise.
    progress : callable
    samples : int
        Of each record, 500 or more.
    """
    bench = _bench(seed, samples)
    methods, responses = [], {}
    entries = _estimators(bench)
    for index, (layer, command, ours, orders, claim, run) in enumerate(entries):
        progress(0.9 * index / len(entries), command)
        fit, error, response = run()
        methods.append(Method(layer, command, ours, orders, fit, error, claim))
        responses[command] = response
    progress(0.9, "tools")
    free = _free_run(bench)
    return ToolboxLayers(
        tuple(methods), _tools(bench), bench.fit(free), bench.frequency, bench.true, responses,
    )  # fmt: skip


def _bench(seed: int, samples: int) -> _Bench:
    import control
    from idloop.diagnosis.design.experiment import Experiment
    from idloop.estimation.black_box.sampled import sampled
    from idloop.physics import Engine

    model = lehigh_motor.motor()
    linear = Engine(model).linearise(None)
    plant = control.c2d(
        control.ss(linear.A, linear.B[:, None], linear.C[VELOCITY : VELOCITY + 1], 0.0), lehigh_motor.SAMPLE_TIME
    )

    def record(number: int) -> SampledData:
        signal = {
            "name": "prbs",
            "sample_time": lehigh_motor.SAMPLE_TIME,
            "duration": (samples - 1) * lehigh_motor.SAMPLE_TIME,
            "amplitude": AMPLITUDE,
            "band_hz": BAND,
            "seed": number,
        }
        return sampled(Experiment(signal).run(model, noise=True, seed=number))[0].outputs([VELOCITY])

    frequency = np.linspace(0.02, BAND, 100)
    return _Bench(record(2 * seed), record(2 * seed + 1), plant, frequency)


def _free_run(bench: _Bench) -> Array:
    import control

    time = np.arange(len(bench.validation)) * bench.train.sample_time
    return np.asarray(control.forced_response(bench.plant, time, bench.validation.input[:, 0]).outputs, dtype=float)


Run = Callable[[], tuple[float, float, Complex]]


def _estimators(bench: _Bench) -> list[tuple[int, str, str, str, str, Run]]:
    """Layer, command, our function, orders, claim, and what runs it."""
    from idloop.estimation import linear, nonparametric, polynomial, subspace
    from idloop.estimation import recursive as recursion

    data = bench.train

    def model(make: Callable[[], LinearModel]) -> Run:
        return lambda: bench.model(make())

    def chosen() -> LinearModel:
        orders = polynomial.select_order(polynomial.arx_structures(data))
        return polynomial.arx(data, orders.na, orders.nb, orders.nk)

    def structure(a: float, b: float) -> tuple[Any, ...]:
        return [[-a]], [[b]], [[1.0]], [[0.0]]

    def recursive(make: Callable[..., recursion.RecursivePolynomial], *orders: int, **named: int) -> Run:
        estimator = make(*orders, **named, sample_time=data.sample_time)

        def run() -> LinearModel:
            return recursion.track(estimator, data).final.model()

        return model(run)

    consistent, biased, scatters = "consistent", "biased", "scatters"
    return [
        (1, "arx", "arx", "na 1, nb 1", biased, model(lambda: polynomial.arx(data, 1, 1))),
        (1, "cra", "cra", "lags 0 to 40", scatters, lambda: bench.weights(nonparametric.cra(data, lags=40))),
        (1, "spa", "spa", "window 60", scatters, lambda: bench.measured(nonparametric.spa(data, window=60))),
        (2, "arxstruc, selstruc", "arx_structures, select_order", "best of 64 by BIC", "", model(chosen)),
        (2, "armax", "armax", "1, 1, 1", consistent, model(lambda: polynomial.armax(data, 1, 1, 1))),
        (2, "oe", "output_error", "nb 1, nf 1", consistent, model(lambda: polynomial.output_error(data, 1, 1))),
        (2, "bj", "box_jenkins", "1, 1, 1, 1", consistent, model(lambda: polynomial.box_jenkins(data, 1, 1, 1, 1))),
        (2, "iv4", "iv4", "na 1, nb 1", consistent, model(lambda: polynomial.iv4(data, 1, 1))),
        (2, "n4sid", "n4sid", "order by itself", consistent, model(lambda: subspace.n4sid(data))),
        (2, "etfe", "etfe", "every line", "", lambda: bench.measured(nonparametric.etfe(data))),
        (2, "etfe, smoothed", "etfe", "over 0.2 Hz", scatters,
         lambda: bench.measured(nonparametric.etfe(data, smoothing=0.2))),
        (3, "pem", "prediction_error", "from n4sid", consistent,
         model(lambda: linear.prediction_error(data, subspace.n4sid(data, 1)))),
        (4, "rarx", "recursive_arx", "1, 1", biased, recursive(recursion.recursive_arx, 1, 1)),
        (4, "rarmax", "recursive_armax", "1, 1, 1", consistent, recursive(recursion.recursive_armax, 1, 1, 1)),
        (4, "roe", "recursive_output_error", "1, 1", consistent, recursive(recursion.recursive_output_error, 1, 1)),
        (4, "rbj", "recursive_box_jenkins", "1, 1, 1, 1", consistent,
         recursive(recursion.recursive_box_jenkins, 1, 1, 1, 1)),
        (4, "rpem", "recursive_prediction_error", "nb 1, nd 1, nf 1", consistent,
         recursive(recursion.recursive_prediction_error, nb=1, nd=1, nf=1)),
        (4, "rplr", "pseudo_linear_regression", "na 1, nb 1, nc 1", consistent,
         recursive(recursion.pseudo_linear_regression, na=1, nb=1, nc=1)),
        # Not of the toolbox, which estimates no state beside the coefficients.
        (4, "joint EKF (ours)", "ExtendedKalman", "na 1, nb 1", consistent,
         recursive(lambda order, delay, **named: recursion.recursive_estimator(
             "ekf", recursion.orders_of("ekf", order, delay), **named), 1, 1)),
        (5, "modstruc, ms2th, pem", "fit_structure", "a, b of the motor", consistent,
         model(lambda: linear.fit_structure(data, structure, {"a": 1.0, "b": 0.28}, continuous=True))),
    ]  # fmt: skip


def _tools(bench: _Bench) -> tuple[Tool, ...]:
    """Commands that examine and convert, each with a number."""
    import control
    from idloop.estimation import linear, polynomial, subspace
    from idloop.validation import residual_tests

    data, validation = bench.train, bench.validation
    model = polynomial.output_error(data, 1, 1)
    pole = float(model.poles[0].real)
    continuous = linear.d2c(model)
    back = linear.c2d(continuous, data.sample_time)
    transfer = control.ss2tf(model.system)
    polynomials = model.polynomials[0]
    errors = model.innovations(validation)
    test = residual_tests(errors, validation.input[:, 0], validation.output_names)[0]
    order = subspace.select_order(data).order
    (error,) = (c.stderr for c in model.coefficients if c.name.startswith("f1"))
    far = (float(polynomials.f[0][1]) + float(np.exp(-lehigh_motor.A * data.sample_time))) / error
    rate = float(np.log(pole)) / data.sample_time
    point, frequency = np.exp(1j), np.array([0.5 / np.pi / data.sample_time])
    there = float(np.real(continuous.poles()[0])) / rate - 1.0
    again = float(np.abs(back(point) - model.system(point)))
    other = float(np.abs(transfer(point) - model.response(frequency)[0, 0, 0]))
    # Of an output-error model the prediction is the free run.
    ahead = float(np.max(np.abs(model.predict(validation, 5) - model.simulate(validation))))
    truth = -rate / lehigh_motor.A - 1.0
    return (
        Tool(1, "present", "coefficients", "error of f1 over its standard deviation", far, near(0.0, 4.0)),
        Tool(1, "resid", "residual_tests", "p-value of whiteness", test.ljung_box_p, above(1e-4)),
        Tool(1, "th2zp", "poles", "pole over the motor's, less 1", truth, near(0.0, 0.05)),
        Tool(2, "n4sid", "select_order", "states that the data show", float(order), equals(1)),
        Tool(3, "predict", "predict", "five samples ahead against the free run", ahead, below(1e-9)),
        Tool(3, "thd2thc", "d2c", "pole over the logarithm of the sampled one, less 1", there, near(0.0, 1e-6)),
        Tool(3, "thc2thd", "c2d", "there and back, change of the response", again, below(1e-9)),
        Tool(3, "th2tf, th2ss", "system", "transfer function against state space", other, below(1e-9)),
    )
