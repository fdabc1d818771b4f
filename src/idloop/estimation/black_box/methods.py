"""Every black-box method by name: what it is for, what it needs, and one way to call it.

Nothing of a method is imported before it is used.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from idloop.errors import IdloopError, InputError
from idloop.estimation.black_box.method import Choices, Method
from idloop.spelling import did_you_mean_or_known

if TYPE_CHECKING:
    from idloop.estimation.black_box.sampled import SampledData
    from idloop.estimation.linear import LinearModel
    from idloop.estimation.networks import NarxModel
    from idloop.estimation.nonparametric import FrequencyResponse, ImpulseResponse
    from idloop.estimation.polynomial import Orders
    from idloop.estimation.recursive import CoefficientHistory, RecursivePolynomial

    Result: TypeAlias = LinearModel | NarxModel | FrequencyResponse | ImpulseResponse

Run = Callable[..., Any]

_ORDERS = tuple(range(1, 9))  # tried for "auto" where a method does not choose its order itself
_SHORTENED = 0.02  # share of the steps of a recursion that may be shortened before a note says so
_HISTORY = 2000  # rows that are kept of a recursive estimate


def _call(function: str, *arguments: Any, **options: Any) -> Any:
    """Call a function of `idloop.estimation`, such as "nonparametric.spa"; its package is imported only now."""
    package, name = function.rsplit(".", 1)
    return getattr(import_module(f"idloop.estimation.{package}"), name)(*arguments, **options)


# ---------------------------------------------------------------- responses


def _windowed(function: str, default: int | None = None) -> Run:
    """Run of a response whose only setting is a window or a largest lag [samples]."""

    def run(data: list[SampledData], choices: Choices, *_: Any) -> Result:
        found: Result = _call(function, data, default if choices.window is None else choices.window)
        return found

    return run


def _etfe(data: list[SampledData], choices: Choices, *_: Any) -> Result:
    from idloop.estimation.nonparametric import etfe

    return etfe(data, None if choices.window is None else 1.0 / (choices.window * data[0].sample_time))


def _best_linear_approximation(kind: Literal["robust", "fast"] | None) -> Run:
    """Run of one kind; without a kind the robust one for several records, else the fast one."""

    def run(data: list[SampledData], choices: Choices, *_: Any) -> Result:
        chosen = kind or ("robust" if len(data) > 1 else "fast")
        function = f"nonparametric.{chosen}_best_linear_approximation"
        found: Result = _call(function, data, _period(data, choices), by_reference=choices.closed_loop)
        return found

    return run


def _period(data: list[SampledData], choices: Choices) -> int:
    """Period of the excitation [samples]."""
    if choices.period is None:
        raise InputError("a best linear approximation needs the excitation's period; give --period SECONDS")
    samples = choices.period / data[0].sample_time
    if abs(samples - round(samples)) > 1e-3 * max(samples, 1.0) / 4:
        raise InputError(
            f"period {choices.period:g} s is {samples:g} samples of {data[0].sample_time:g} s; choose a sample time"
            " that divides it"
        )
    return round(samples)


# ---------------------------------------------------------------- polynomials


def _degrees(choices: Choices, names: tuple[str, ...], order: int) -> dict[str, int]:
    """Degree of each polynomial: the order where the structure does not set it."""
    return {name: choices.structure.get(name, order) for name in names}


def _prefilter(data: list[SampledData], choices: Choices) -> dict[str, Any]:
    """Frequency weighting of the fit."""
    from idloop.estimation.black_box.prefilter import band_filter

    return {"prefilter": None if choices.band is None else band_filter(*choices.band, data[0].sample_time)}


def _polynomial(function: str, *names: str, with_focus: bool = True) -> Run:
    """Run of a polynomial method with these degrees."""

    def run(data: list[SampledData], choices: Choices, order: int, delay: int) -> LinearModel:
        options = {**_degrees(choices, names, order), **_prefilter(data, choices)}
        if with_focus:
            options["focus"] = choices.focus
        found: LinearModel = _call(f"polynomial.{function}", data, nk=delay, **options)
        return found

    return run


def _iv4(data: list[SampledData], choices: Choices, order: int, delay: int) -> LinearModel:
    from idloop.estimation.polynomial import iv4

    instruments: Literal["reference", "command"] = "reference" if choices.closed_loop else "command"
    na, nb = _degrees(choices, ("na", "nb"), order).values()
    return iv4(data, na, nb, delay, instruments=instruments, **_prefilter(data, choices))


# ---------------------------------------------------------------- state space


def _poles(choices: Choices) -> dict[str, Any]:
    """What is imposed on the poles of a subspace method."""
    known = {} if choices.integrates is None else {"integrates": choices.integrates}
    return {"stable": choices.stable, **known}


def _subspace(function: str, horizon: str = "horizon", *, with_focus: bool = False) -> Run:
    """Run of a subspace method; `horizon` is the name of its argument for it."""

    def run(data: list[SampledData], choices: Choices, order: int | Literal["auto"], *_: Any) -> LinearModel:
        options = {horizon: choices.horizon, **_poles(choices)}
        if with_focus:
            options["focus"] = choices.focus
        found: LinearModel = _call(f"subspace.{function}", data, order, **options)
        return found

    return run


_n4sid, _pbsid = _subspace("n4sid", with_focus=True), _subspace("pbsid", "past")


def _vodma(data: list[SampledData], choices: Choices, order: int | Literal["auto"], *_: Any) -> LinearModel:
    from idloop.control.linear import linear_feedback
    from idloop.estimation.subspace import vodma
    from idloop.estimation.subspace.known_controller import controller_notes

    if choices.controller is None:
        raise InputError("vodma needs the controller that ran; give a file with one: --controller FILE")
    feedback = linear_feedback(choices.controller, data[0].sample_time)
    notes = controller_notes(choices.controller, data)
    model = vodma(data, feedback, order, horizon=choices.horizon, **_poles(choices))
    return replace(model, notes=(*model.notes, *notes))


def _pem(data: list[SampledData], choices: Choices, order: int | Literal["auto"], *_: Any) -> LinearModel:
    from idloop.estimation.black_box.prefilter import prefiltered
    from idloop.estimation.linear import prediction_error

    if choices.band is not None and choices.focus == "prediction":
        raise InputError(
            "pem: a noise model that shares the plant's states takes up the filter of a band;"
            " add --focus simulation, or take bj"
        )
    weighting = _prefilter(data, choices)
    # One-step errors suit any loop, and so does the start for them; free runs are for the open one, as their start is.
    if choices.focus == "simulation":
        start = _n4sid(prefiltered(data, weighting["prefilter"]), choices, order)
        return prediction_error(data, start, focus="simulation", **weighting)
    start = _pbsid(data, choices, order)
    try:
        # Where all noise is the sensor's, the gain is zero, which a search from a subspace estimate hardly finds.
        without_gain = prediction_error(data, start, focus="simulation")
    except IdloopError:
        return prediction_error(data, start)
    return prediction_error(data, min(without_gain, start, key=lambda model: model.loss))


# ---------------------------------------------------------------- networks


def _narx_wavelet(data: list[SampledData], choices: Choices, order: int, delay: int) -> NarxModel:
    from idloop.estimation.networks import TappedDelays, TrainingRules, narx_wavelet

    delays = TappedDelays(**_degrees(choices, ("na", "nb"), order), nk=delay)
    # Only training fits a free run; the selection of units is one-step.
    trained: dict[str, Any] = {"form": "parallel", "refine": TrainingRules()} if choices.focus == "simulation" else {}
    return narx_wavelet(data, delays, units=choices.units or 25, seed=choices.seed, **trained)


def _narx_neural(data: list[SampledData], choices: Choices, order: int, delay: int) -> NarxModel:
    from idloop.estimation.networks import TappedDelays, narx_neural

    delays = TappedDelays(**_degrees(choices, ("na", "nb"), order), nk=delay)
    form: Literal["parallel", "series-parallel"] = "parallel" if choices.focus == "simulation" else "series-parallel"
    return narx_neural(data, delays, hidden=choices.units or 10, form=form, seed=choices.seed)


# ---------------------------------------------------------------- recursive


def _recursive(name: str) -> Run:
    """Run of a recursive method, whose polynomials have the order as degree where the settings do not set it."""

    def run(
        data: list[SampledData], choices: Choices, order: int, delay: int
    ) -> tuple[LinearModel, tuple[CoefficientHistory, ...]]:
        from idloop.estimation.polynomial import Orders
        from idloop.estimation.recursive import RECURSIVE_METHODS, recursive_estimator

        degrees: dict[str, Any] = {
            polynomial: choices.structure.get(polynomial, order * times)
            for polynomial, times in RECURSIVE_METHODS[name].degrees.items()
        }
        orders = Orders.of(data[0].input.shape[1], **degrees, nk=delay)
        labels = {"sample_time": data[0].sample_time, "input_names": data[0].input_names}
        estimators = [
            recursive_estimator(name, orders, **labels, output_name=output) for output in data[0].output_names
        ]
        return _tracked(data, orders, estimators)

    return run


def _tracked(
    data: list[SampledData], orders: Orders, estimators: list[RecursivePolynomial]
) -> tuple[LinearModel, tuple[CoefficientHistory, ...]]:
    """Model of the final coefficients of every output, and their histories."""
    import numpy as np

    from idloop.estimation.polynomial.model import assemble
    from idloop.estimation.polynomial.regression import check_inputs
    from idloop.estimation.recursive import track

    check_inputs(data, orders)
    total = sum(len(one) for one in data)
    if total <= orders.size:
        raise InputError(
            f"{data[0].name}: {total} samples for {orders.size} coefficients; record longer or lower the orders"
        )
    every = max(total // _HISTORY, 1)
    histories = tuple(track(one, [each.outputs([i]) for each in data], every=every) for i, one in enumerate(estimators))
    notes = [
        f"{one.output_name}: {one.projections} of {total} steps were shortened to keep the predictor stable;"
        " rarx and rarmax follow plants that integrate"
        for one in estimators
        if one.projections > _SHORTENED * total
    ]
    notes += [
        f"{one.output_name}: C or F is hardly positive real, so pseudo-linear regression converges slowly and its"
        " standard errors leave out the error of the start; take rpem"
        for one in estimators
        if one.slow
    ]
    model = assemble("recursive", data, [h.final for h in histories], [[h.innovations] for h in histories], notes=notes)
    # The loss is that of the final model on all data, as of the other methods; not that of the recursion.
    with np.errstate(all="ignore"):
        errors = np.concatenate([model.innovations(one) for one in data])
        covariance = errors.T @ errors / len(errors)
    return replace(model, covariance=covariance, samples=len(errors)), histories


# ---------------------------------------------------------------- the table

_LJUNG = "Ljung 1999"
_SUBSPACE = ("order", "horizon", "stable", "integrates")

METHODS: dict[str, Method] = {
    method.name: method
    for method in (
        Method(
            "etfe", "response", "Raw frequency response, every line of the record.", "open", f"{_LJUNG}, 6.3",
            ("window",), _etfe,
        ),
        Method(
            "spa", "response", "Smooth frequency response with coherence and bands.", "open", f"{_LJUNG}, 6.4",
            ("window",), _windowed("nonparametric.spa"),
        ),
        Method(
            "welch", "response", "Frequency response of long records, averaged over segments.", "open", "Welch 1967",
            ("window",), _windowed("nonparametric.welch"),
        ),
        Method(
            "indirect", "response", "Frequency response under feedback, by way of the reference.",
            "closed, reference recorded", "Wellstead 1981",
            ("window",), _windowed("nonparametric.indirect"),
        ),
        Method(
            "cra", "response", "Impulse response: delay, feedback, and length of the memory.", "open",
            f"{_LJUNG}, 6.1", ("window",), _windowed("nonparametric.cra", 20),
        ),
        Method(
            "bla", "response", "Noise and nonlinearity separated; bla-robust for several bags, else bla-fast.",
            "any, with --closed-loop by the reference", "Pintelon and Schoukens 2012, 4.3",
            ("period", "closed_loop"), _best_linear_approximation(None),
        ),
        Method(
            "bla-robust", "response", "The same from several random-phase multisines.",
            "any, with --closed-loop by the reference", "Pintelon and Schoukens 2012, 4.3.1",
            ("period", "closed_loop"), _best_linear_approximation("robust"),
        ),
        Method(
            "bla-fast", "response", "The same from one odd random-phase multisine.",
            "any, with --closed-loop by the reference", "Pintelon and Schoukens 2012, 4.3.2",
            ("period", "closed_loop"), _best_linear_approximation("fast"),
        ),
        Method(
            "arx", "linear", "Least squares: fast, accurate in little noise.", "any, white equation error",
            f"{_LJUNG}, 7.3", ("order", "delay", "structure", "focus", "band"), _polynomial("arx", "na", "nb"),
            ("na", "nb"), _ORDERS,
        ),
        Method(
            "iv4", "linear", "Instrumental variables: consistent in noise of any colour, without a search.",
            "open, with --closed-loop by the reference", f"{_LJUNG}, 15.3; Gilson and Van den Hof 2005",
            ("order", "delay", "structure", "closed_loop", "band"), _iv4, ("na", "nb"), _ORDERS,
            "free run",
        ),
        Method(
            "armax", "linear", "Disturbances that enter where the command does.", "any, noise model right",
            f"{_LJUNG}, 4.2", ("order", "delay", "structure", "focus", "band"),
            _polynomial("armax", "na", "nb", "nc"), ("na", "nb", "nc"), _ORDERS,
        ),
        Method(
            "oe", "linear", "The best free run: sensor noise, simulation, control design.",
            "open; closed in white noise only", f"{_LJUNG}, 4.2",
            ("order", "delay", "structure", "band"),
            _polynomial("output_error", "nb", "nf", with_focus=False), ("nb", "nf"), _ORDERS, "free run",
        ),
        Method(
            "bj", "linear", "Plant and noise model have no polynomial in common.", "any, noise model right",
            f"{_LJUNG}, 4.2", ("order", "delay", "structure", "focus", "band"),
            _polynomial("box_jenkins", "nb", "nc", "nd", "nf"), ("nb", "nc", "nd", "nf"), _ORDERS,
        ),
        Method(
            "n4sid", "linear", "State space without a search; the order shows in the singular values.", "open",
            "Van Overschee and De Moor 1996", (*_SUBSPACE, "focus"), _n4sid,
        ),
        Method(
            "moesp", "linear", "The same from the shift of the observability matrix.", "open", "Verhaegen 1994",
            (*_SUBSPACE, "focus"), _subspace("moesp", with_focus=True),
        ),
        Method(
            "cva", "linear", "The same from canonical variates: outputs of any unit and noise.", "open",
            "Larimore 1990", (*_SUBSPACE, "focus"), _subspace("cva", with_focus=True),
        ),
        Method(
            "vodma", "linear", "State space in a loop whose controller is known and linear.",
            "closed, controller known", "Van Overschee and De Moor 1997", (*_SUBSPACE, "controller"), _vodma,
        ),
        Method(
            "vodma-direct", "linear", "The same without the controller.", "open", "Linköping thesis 2009, 3.4",
            _SUBSPACE, _subspace("vodma_direct"),
        ),
        Method(
            "pbsid", "linear", "State space under any feedback, the controller unknown.", "any", "Chiuso 2007",
            _SUBSPACE, _pbsid,
        ),
        Method(
            "pem", "linear", "All matrices refined until the one-step errors are least.", "any, noise model right",
            f"{_LJUNG}, 7.4; McKelvey et al. 2004", (*_SUBSPACE, "focus", "band"), _pem,
        ),
        Method(
            "narx-wavelet", "network", "Nonlinear: linear part and wavelets, selected, no training.", "any",
            "Zhang and Benveniste 1992", ("order", "delay", "structure", "units", "focus", "seed"), _narx_wavelet,
            ("na", "nb"), (2,),
        ),
        Method(
            "narx-neural", "network", "Nonlinear: tapped delays and a trained network.", "any",
            "Hagan and Menhaj 1994", ("order", "delay", "structure", "units", "focus", "seed"), _narx_neural,
            ("na", "nb"), (2,),
        ),
        *(
            Method(
                name, "recursive", summary, loop, source,
                ("order", "delay", "structure"), _recursive(name), polynomials, _ORDERS,
            )
            for name, summary, loop, source, polynomials in (
                ("rarx", "Least squares, sample by sample.", "any, white equation error", f"{_LJUNG}, 11.2",
                 ("na", "nb")),
                ("kalman", "The same for time-varying coefficients.", "any, white equation error", f"{_LJUNG}, 11.2",
                 ("na", "nb")),
                ("ekf", "State and coefficients in one extended Kalman filter: biased where its noises are wrong.",
                 "any, noise levels right", "Ljung 1979", ("na", "nb")),
                ("rarmax", "ARMAX, sample by sample.", "any, noise model right", f"{_LJUNG}, 11.4", ("na", "nb", "nc")),
                ("roe", "Output error, sample by sample.", "open", f"{_LJUNG}, 11.4", ("nb", "nf")),
                ("rbj", "Box-Jenkins, sample by sample.", "any, noise model right", f"{_LJUNG}, 11.4",
                 ("nb", "nc", "nd", "nf")),
                ("rpem", "Any structure, sample by sample; ARMAX unless --structure says otherwise.",
                 "any, noise model right", f"{_LJUNG}, 11.4", ("na", "nb", "nc", "nd", "nf")),
                ("rplr", "The same by pseudo-linear regression: simpler, less exact.", "any, noise model right",
                 f"{_LJUNG}, 11.5", ("na", "nb", "nc", "nd", "nf")),
            )
        ),
    )
}  # fmt: skip


def find_method(name: str) -> Method:
    """Return a method by name."""
    if name not in METHODS:
        raise InputError(f"no method {name!r}{did_you_mean_or_known(name, METHODS)}")
    return METHODS[name]
