"""Every black-box method by name: what it is for, what it needs, and one way to call it.

Nothing of a method is imported before it is used.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal

from idloop.errors import IdloopError, InputError
from idloop.estimation.black_box.method import Choices, Kind, Method
from idloop.spelling import did_you_mean_or_known

if TYPE_CHECKING:
    from idloop.estimation.black_box.sampled import SampledData
    from idloop.estimation.linear import LinearModel
    from idloop.estimation.networks import NarxModel, TappedDelays
    from idloop.estimation.polynomial import Orders
    from idloop.estimation.recursive import CoefficientHistory, RecursivePolynomial

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
    return lambda data, choices, *_: _call(function, data, default if choices.window is None else choices.window)


def _etfe(data: list[SampledData], choices: Choices, *_: Any) -> Any:
    width = None if choices.window is None else 1.0 / (choices.window * data[0].sample_time)
    return _call("nonparametric.etfe", data, width)


def _best_linear_approximation(kind: Literal["robust", "fast"] | None) -> Run:
    """Run of one kind; without a kind the robust one for several records, else the fast one."""

    def run(data: list[SampledData], choices: Choices, *_: Any) -> Any:
        chosen = kind or ("robust" if len(data) > 1 else "fast")
        function = f"nonparametric.{chosen}_best_linear_approximation"
        return _call(function, data, _period(data, choices), by_reference=choices.closed_loop)

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

    def run(data: list[SampledData], choices: Choices, order: int, delay: int) -> Any:
        focus = {"focus": choices.focus} if with_focus else {}
        degrees, weighting = _degrees(choices, names, order), _prefilter(data, choices)
        return _call(f"polynomial.{function}", data, nk=delay, **degrees, **weighting, **focus)

    return run


def _iv4(data: list[SampledData], choices: Choices, order: int, delay: int) -> Any:
    instruments = "reference" if choices.closed_loop else "command"
    options = {**_degrees(choices, ("na", "nb"), order), **_prefilter(data, choices)}
    return _call("polynomial.iv4", data, nk=delay, instruments=instruments, **options)


# ---------------------------------------------------------------- state space


def _poles(choices: Choices) -> dict[str, Any]:
    """What is imposed on the poles of a subspace method."""
    known = {} if choices.integrates is None else {"integrates": choices.integrates}
    return {"stable": choices.stable, **known}


def _subspace(function: str, horizon: str = "horizon", *, with_focus: bool = False) -> Run:
    """Run of a subspace method; `horizon` is the name of its argument for it."""

    def run(data: list[SampledData], choices: Choices, order: int | Literal["auto"], *_: Any) -> Any:
        focus = {"focus": choices.focus} if with_focus else {}
        return _call(f"subspace.{function}", data, order, **{horizon: choices.horizon}, **_poles(choices), **focus)

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


def _delays(choices: Choices, order: int, delay: int) -> TappedDelays:
    from idloop.estimation.networks import TappedDelays

    return TappedDelays(**_degrees(choices, ("na", "nb"), order), nk=delay)


def _narx_wavelet(data: list[SampledData], choices: Choices, order: int, delay: int) -> NarxModel:
    from idloop.estimation.networks import TrainingRules, narx_wavelet

    # Only training fits a free run; the selection of units is one-step.
    trained: dict[str, Any] = {"form": "parallel", "refine": TrainingRules()} if choices.focus == "simulation" else {}
    return narx_wavelet(data, _delays(choices, order, delay), units=choices.units or 25, seed=choices.seed, **trained)


def _narx_neural(data: list[SampledData], choices: Choices, order: int, delay: int) -> Any:
    form = "parallel" if choices.focus == "simulation" else "series-parallel"
    options = {"hidden": choices.units or 10, "form": form, "seed": choices.seed}
    return _call("networks.narx_neural", data, _delays(choices, order, delay), **options)


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
_STRUCTURE = ("order", "delay", "structure")
_BY_REFERENCE = "any, with --closed-loop by the reference"
_NOISE_MODEL = "any, noise model right"
_ABC, _BCDF = ("na", "nb", "nc"), ("nb", "nc", "nd", "nf")


def _family(kind: Kind, needs: tuple[str, ...], *rows: tuple[Any, ...], **shared: Any) -> tuple[Method, ...]:
    """Methods that read the same choices, from rows of name, summary, loop, source, run and polynomials."""
    return tuple(
        Method(name, kind, summary, loop, source, needs, run, *polynomials, **shared)
        for name, summary, loop, source, run, *polynomials in rows
    )


METHODS: dict[str, Method] = {
    method.name: method
    for method in (
        *_family(
            "response", ("window",),
            ("etfe", "Raw frequency response, every line of the record.", "open", f"{_LJUNG}, 6.3", _etfe),
            ("spa", "Smooth frequency response with coherence and bands.", "open", f"{_LJUNG}, 6.4",
             _windowed("nonparametric.spa")),
            ("welch", "Frequency response of long records, averaged over segments.", "open", "Welch 1967",
             _windowed("nonparametric.welch")),
            ("indirect", "Frequency response under feedback, by way of the reference.", "closed, reference recorded",
             "Wellstead 1981", _windowed("nonparametric.indirect")),
            ("cra", "Impulse response: delay, feedback, and length of the memory.", "open", f"{_LJUNG}, 6.1",
             _windowed("nonparametric.cra", 20)),
        ),
        *_family(
            "response", ("period", "closed_loop"),
            ("bla", "Noise and nonlinearity separated; bla-robust for several bags, else bla-fast.", _BY_REFERENCE,
             "Pintelon and Schoukens 2012, 4.3", _best_linear_approximation(None)),
            ("bla-robust", "The same from several random-phase multisines.", _BY_REFERENCE,
             "Pintelon and Schoukens 2012, 4.3.1", _best_linear_approximation("robust")),
            ("bla-fast", "The same from one odd random-phase multisine.", _BY_REFERENCE,
             "Pintelon and Schoukens 2012, 4.3.2", _best_linear_approximation("fast")),
        ),
        *_family(
            "linear", (*_STRUCTURE, "focus", "band"),
            ("arx", "Least squares: fast, accurate in little noise.", "any, white equation error", f"{_LJUNG}, 7.3",
             _polynomial("arx", "na", "nb"), ("na", "nb")),
            automatic=_ORDERS,
        ),
        *_family(
            "linear", (*_STRUCTURE, "closed_loop", "band"),
            ("iv4", "Instrumental variables: consistent in noise of any colour, without a search.",
             "open, with --closed-loop by the reference", f"{_LJUNG}, 15.3; Gilson and Van den Hof 2005", _iv4,
             ("na", "nb")),
            automatic=_ORDERS, selects="free run",
        ),
        *_family(
            "linear", (*_STRUCTURE, "focus", "band"),
            ("armax", "Disturbances that enter where the command does.", _NOISE_MODEL, f"{_LJUNG}, 4.2",
             _polynomial("armax", *_ABC), _ABC),
            automatic=_ORDERS,
        ),
        *_family(
            "linear", (*_STRUCTURE, "band"),
            ("oe", "The best free run: sensor noise, simulation, control design.", "open; closed in white noise only",
             f"{_LJUNG}, 4.2", _polynomial("output_error", "nb", "nf", with_focus=False), ("nb", "nf")),
            automatic=_ORDERS, selects="free run",
        ),
        *_family(
            "linear", (*_STRUCTURE, "focus", "band"),
            ("bj", "Plant and noise model have no polynomial in common.", _NOISE_MODEL, f"{_LJUNG}, 4.2",
             _polynomial("box_jenkins", *_BCDF), _BCDF),
            automatic=_ORDERS,
        ),
        *_family(
            "linear", (*_SUBSPACE, "focus"),
            ("n4sid", "State space without a search; the order shows in the singular values.", "open",
             "Van Overschee and De Moor 1996", _n4sid),
            ("moesp", "The same from the shift of the observability matrix.", "open", "Verhaegen 1994",
             _subspace("moesp", with_focus=True)),
            ("cva", "The same from canonical variates: outputs of any unit and noise.", "open", "Larimore 1990",
             _subspace("cva", with_focus=True)),
        ),
        *_family(
            "linear", (*_SUBSPACE, "controller"),
            ("vodma", "State space in a loop whose controller is known and linear.", "closed, controller known",
             "Van Overschee and De Moor 1997", _vodma),
        ),
        *_family(
            "linear", _SUBSPACE,
            ("vodma-direct", "The same without the controller.", "open", "Linköping thesis 2009, 3.4",
             _subspace("vodma_direct")),
            ("pbsid", "State space under any feedback, the controller unknown.", "any", "Chiuso 2007", _pbsid),
        ),
        *_family(
            "linear", (*_SUBSPACE, "focus", "band"),
            ("pem", "All matrices refined until the one-step errors are least.", _NOISE_MODEL,
             f"{_LJUNG}, 7.4; McKelvey et al. 2004", _pem),
        ),
        *_family(
            "network", (*_STRUCTURE, "units", "focus", "seed"),
            ("narx-wavelet", "Nonlinear: linear part and wavelets, selected, no training.", "any",
             "Zhang and Benveniste 1992", _narx_wavelet, ("na", "nb")),
            ("narx-neural", "Nonlinear: tapped delays and a trained network.", "any", "Hagan and Menhaj 1994",
             _narx_neural, ("na", "nb")),
            automatic=(2,),
        ),
        *_family(
            "recursive", _STRUCTURE,
            ("rarx", "Least squares, sample by sample.", "any, white equation error", f"{_LJUNG}, 11.2",
             _recursive("rarx"), ("na", "nb")),
            ("kalman", "The same for time-varying coefficients.", "any, white equation error", f"{_LJUNG}, 11.2",
             _recursive("kalman"), ("na", "nb")),
            ("ekf", "State and coefficients in one extended Kalman filter: biased where its noises are wrong.",
             "any, noise levels right", "Ljung 1979", _recursive("ekf"), ("na", "nb")),
            ("rarmax", "ARMAX, sample by sample.", _NOISE_MODEL, f"{_LJUNG}, 11.4", _recursive("rarmax"), _ABC),
            ("roe", "Output error, sample by sample.", "open", f"{_LJUNG}, 11.4", _recursive("roe"), ("nb", "nf")),
            ("rbj", "Box-Jenkins, sample by sample.", _NOISE_MODEL, f"{_LJUNG}, 11.4", _recursive("rbj"), _BCDF),
            ("rpem", "Any structure, sample by sample; ARMAX unless --structure says otherwise.", _NOISE_MODEL,
             f"{_LJUNG}, 11.4", _recursive("rpem"), ("na", *_BCDF)),
            ("rplr", "The same by pseudo-linear regression: simpler, less exact.", _NOISE_MODEL, f"{_LJUNG}, 11.5",
             _recursive("rplr"), ("na", *_BCDF)),
            automatic=_ORDERS,
        ),
    )
}  # fmt: skip


def find_method(name: str) -> Method:
    """Return a method by name."""
    if name not in METHODS:
        raise InputError(f"no method {name!r}{did_you_mean_or_known(name, METHODS)}")
    return METHODS[name]
