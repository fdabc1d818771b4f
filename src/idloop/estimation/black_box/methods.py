"""Every black-box method by name: what it is for, what it needs, and one way to call it.

Nothing of a method is imported before it is used.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

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

    Result = LinearModel | NarxModel | FrequencyResponse | ImpulseResponse

_ORDERS = tuple(range(1, 9))  # tried for "auto" where a method has no choice of its own
_SHORTENED = 0.02  # share of a recursion's steps that may be shortened before that is noted
_HISTORY = 2000  # rows that are remembered of a recursive estimate


# ---------------------------------------------------------------- responses


def _etfe(data: list[SampledData], choices: Choices, *_: Any) -> Result:
    from idloop.estimation.nonparametric import etfe

    width = None if choices.window is None else 1.0 / (choices.window * data[0].sample_time)
    return etfe(data, width)


def _spa(data: list[SampledData], choices: Choices, *_: Any) -> Result:
    from idloop.estimation.nonparametric import spa

    return spa(data, choices.window)


def _welch(data: list[SampledData], choices: Choices, *_: Any) -> Result:
    from idloop.estimation.nonparametric import welch

    return welch(data, choices.window)


def _indirect(data: list[SampledData], choices: Choices, *_: Any) -> Result:
    from idloop.estimation.nonparametric import indirect

    return indirect(data, choices.window)


def _cra(data: list[SampledData], choices: Choices, *_: Any) -> Result:
    from idloop.estimation.nonparametric import cra

    return cra(data, choices.window or 20)


def _bla_robust(data: list[SampledData], choices: Choices, *_: Any) -> Result:
    from idloop.estimation.nonparametric import robust_best_linear_approximation

    return robust_best_linear_approximation(data, _period(data, choices), by_reference=choices.closed_loop)


def _bla_fast(data: list[SampledData], choices: Choices, *_: Any) -> Result:
    from idloop.estimation.nonparametric import fast_best_linear_approximation

    return fast_best_linear_approximation(data, _period(data, choices), by_reference=choices.closed_loop)


def _bla(data: list[SampledData], choices: Choices, *_: Any) -> Result:
    return _bla_robust(data, choices) if len(data) > 1 else _bla_fast(data, choices)


def _period(data: list[SampledData], choices: Choices) -> int:
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


def _degree(choices: Choices, name: str, order: int) -> int:
    return choices.structure.get(name, order)


def _weighed(data: list[SampledData], choices: Choices) -> dict[str, Any]:
    """At which frequencies errors are made small."""
    from idloop.estimation.black_box.prefilter import band_filter

    prefilter = None if choices.band is None else band_filter(*choices.band, data[0].sample_time)
    return {"prefilter": prefilter}


def _arx(data: list[SampledData], choices: Choices, order: int, delay: int) -> Result:
    from idloop.estimation.polynomial import arx

    na, nb = (_degree(choices, name, order) for name in ("na", "nb"))
    return arx(data, na, nb, delay, focus=choices.focus, **_weighed(data, choices))


def _iv4(data: list[SampledData], choices: Choices, order: int, delay: int) -> Result:
    from idloop.estimation.polynomial import iv4

    na, nb = (_degree(choices, name, order) for name in ("na", "nb"))
    instruments: Literal["reference", "command"] = "reference" if choices.closed_loop else "command"
    return iv4(data, na, nb, delay, instruments=instruments, **_weighed(data, choices))


def _armax(data: list[SampledData], choices: Choices, order: int, delay: int) -> Result:
    from idloop.estimation.polynomial import armax

    na, nb, nc = (_degree(choices, name, order) for name in ("na", "nb", "nc"))
    return armax(data, na, nb, nc, delay, focus=choices.focus, **_weighed(data, choices))


def _oe(data: list[SampledData], choices: Choices, order: int, delay: int) -> Result:
    from idloop.estimation.polynomial import output_error

    nb, nf = (_degree(choices, name, order) for name in ("nb", "nf"))
    return output_error(data, nb, nf, delay, **_weighed(data, choices))


def _bj(data: list[SampledData], choices: Choices, order: int, delay: int) -> Result:
    from idloop.estimation.polynomial import box_jenkins

    nb, nc, nd, nf = (_degree(choices, name, order) for name in ("nb", "nc", "nd", "nf"))
    return box_jenkins(data, nb, nc, nd, nf, delay, focus=choices.focus, **_weighed(data, choices))


# ---------------------------------------------------------------- state space


def _poles(choices: Choices) -> dict[str, Any]:
    """What is imposed on the poles of a subspace method."""
    known = {} if choices.integrates is None else {"integrates": choices.integrates}
    return {"stable": choices.stable, **known}


def _n4sid(data: list[SampledData], choices: Choices, order: int | Literal["auto"], _: int) -> LinearModel:
    from idloop.estimation.subspace import n4sid

    return n4sid(data, order, horizon=choices.horizon, focus=choices.focus, **_poles(choices))


def _moesp(data: list[SampledData], choices: Choices, order: int | Literal["auto"], _: int) -> Result:
    from idloop.estimation.subspace import moesp

    return moesp(data, order, horizon=choices.horizon, focus=choices.focus, **_poles(choices))


def _cva(data: list[SampledData], choices: Choices, order: int | Literal["auto"], _: int) -> Result:
    from idloop.estimation.subspace import cva

    return cva(data, order, horizon=choices.horizon, focus=choices.focus, **_poles(choices))


def _pbsid(data: list[SampledData], choices: Choices, order: int | Literal["auto"], _: int) -> LinearModel:
    from idloop.estimation.subspace import pbsid

    return pbsid(data, order, past=choices.horizon, **_poles(choices))


def _vodma(data: list[SampledData], choices: Choices, order: int | Literal["auto"], _: int) -> Result:
    from idloop.control.linear import linear_feedback
    from idloop.estimation.subspace import vodma
    from idloop.estimation.subspace.recorded_command import controller_notes

    if choices.controller is None:
        raise InputError("vodma needs the controller that ran; give a file with one: --controller FILE")
    feedback = linear_feedback(choices.controller, data[0].sample_time)
    notes = controller_notes(choices.controller, data)
    model = vodma(data, feedback, order, horizon=choices.horizon, **_poles(choices))
    return replace(model, notes=(*model.notes, *notes))


def _vodma_direct(data: list[SampledData], choices: Choices, order: int | Literal["auto"], _: int) -> Result:
    from idloop.estimation.subspace import vodma_direct

    return vodma_direct(data, order, horizon=choices.horizon, **_poles(choices))


def _pem(data: list[SampledData], choices: Choices, order: int | Literal["auto"], _: int) -> Result:
    from idloop.estimation.black_box.prefilter import prefiltered
    from idloop.estimation.linear import prediction_error

    if choices.band is not None and choices.focus == "prediction":
        raise InputError(
            "pem: a noise model that shares the plant's states takes up the filter of a band;"
            " add --focus simulation, or take bj"
        )
    weighed = _weighed(data, choices)
    # One-step errors suit any loop, and so does the start for them; free runs are for the open one, as their start is.
    if choices.focus == "simulation":
        start = _n4sid(prefiltered(data, weighed["prefilter"]), choices, order, 1)
        return prediction_error(data, start, focus="simulation", **weighed)
    start = _pbsid(data, choices, order, 1)
    try:
        # Where sensor noise is all there is, the way from a subspace method's Kalman gain to none is long and bent.
        quiet = prediction_error(data, start, focus="simulation")
    except IdloopError:
        return prediction_error(data, start)
    return prediction_error(data, min(quiet, start, key=lambda model: model.loss))


# ---------------------------------------------------------------- networks


def _narx_wavelet(data: list[SampledData], choices: Choices, order: int, delay: int) -> Result:
    from idloop.estimation.networks import TappedDelays, TrainingRules, narx_wavelet

    na, nb = (_degree(choices, name, order) for name in ("na", "nb"))
    delays = TappedDelays(na, nb, delay)
    # Only training fits a free run; the selection of units is one-step.
    trained: dict[str, Any] = {"form": "parallel", "refine": TrainingRules()} if choices.focus == "simulation" else {}
    return narx_wavelet(data, delays, units=choices.units or 25, seed=choices.seed, **trained)


def _narx_neural(data: list[SampledData], choices: Choices, order: int, delay: int) -> Result:
    from idloop.estimation.networks import TappedDelays, narx_neural

    na, nb = (_degree(choices, name, order) for name in ("na", "nb"))
    form: Literal["parallel", "series-parallel"] = "parallel" if choices.focus == "simulation" else "series-parallel"
    return narx_neural(data, TappedDelays(na, nb, delay), hidden=choices.units or 10, form=form, seed=choices.seed)


# ---------------------------------------------------------------- recursive


def _recursive(name: str) -> Callable[..., tuple[LinearModel, tuple[CoefficientHistory, ...]]]:
    """Run of a recursive method, whose polynomials have the order as degree where the settings say nothing else."""

    def run(
        data: list[SampledData], choices: Choices, order: int, delay: int
    ) -> tuple[LinearModel, tuple[CoefficientHistory, ...]]:
        from idloop.estimation.recursive import RECURSIVE_METHODS, recursive_estimator
        from idloop.estimation.recursive.estimator import structure

        degrees: dict[str, Any] = {
            polynomial: _degree(choices, polynomial, order * times)
            for polynomial, times in RECURSIVE_METHODS[name].degrees.items()
        }
        # A delay for each input also tells their number.
        orders = structure(**degrees, nk=(delay,) * data[0].input.shape[1])

        def make(output: str) -> RecursivePolynomial:
            return recursive_estimator(
                name, orders, sample_time=data[0].sample_time, input_names=data[0].input_names, output_name=output
            )

        return _tracked(data, orders, make)

    return run


def _tracked(
    data: list[SampledData], orders: Orders, make: Callable[[str], RecursivePolynomial]
) -> tuple[LinearModel, tuple[CoefficientHistory, ...]]:
    """Model of the last coefficients of every output, and their way there."""
    import numpy as np

    from idloop.estimation.polynomial.channels import check_inputs
    from idloop.estimation.polynomial.model import assemble
    from idloop.estimation.recursive import track

    check_inputs(data, orders)
    total = sum(len(one) for one in data)
    if total <= orders.size:
        raise InputError(
            f"{data[0].name}: {total} samples for {orders.size} coefficients; record longer or lower the orders"
        )
    every = max(total // _HISTORY, 1)
    estimators = [make(name) for name in data[0].output_names]
    histories = tuple(track(one, [each.outputs([i]) for each in data], every=every) for i, one in enumerate(estimators))
    notes = [
        f"{one.output_name}: {one.projections} of {total} steps were shortened to keep the predictor stable;"
        " rarx and rarmax follow plants that integrate"
        for one in estimators
        if one.projections > _SHORTENED * total
    ]
    notes += [
        f"{one.output_name}: C or F is hardly positive real, so pseudo-linear regression converges slowly and its"
        " standard errors leave out what is left of the start; take rpem"
        for one in estimators
        if one.slow
    ]
    model = assemble("recursive", data, [h.final for h in histories], [[h.innovations] for h in histories], notes=notes)
    # The loss is that of the last model on all data, as of the other methods; not that of its way there.
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
            ("window",), _spa,
        ),
        Method(
            "welch", "response", "Frequency response of long records, averaged over segments.", "open", "Welch 1967",
            ("window",), _welch,
        ),
        Method(
            "indirect", "response", "Frequency response under feedback, by way of the reference.",
            "closed, reference recorded", "Wellstead 1981",
            ("window",), _indirect,
        ),
        Method(
            "cra", "response", "Impulse response: delay, feedback, and how long the plant remembers.", "open",
            f"{_LJUNG}, 6.1", ("window",), _cra,
        ),
        Method(
            "bla", "response", "Noise and nonlinearity told apart; bla-robust for several bags, else bla-fast.",
            "any, with --closed-loop by the reference", "Pintelon and Schoukens 2012, 4.3",
            ("period", "closed_loop"), _bla,
        ),
        Method(
            "bla-robust", "response", "The same from several random-phase multisines.",
            "any, with --closed-loop by the reference", "Pintelon and Schoukens 2012, 4.3.1",
            ("period", "closed_loop"), _bla_robust,
        ),
        Method(
            "bla-fast", "response", "The same from one odd random-phase multisine.",
            "any, with --closed-loop by the reference", "Pintelon and Schoukens 2012, 4.3.2",
            ("period", "closed_loop"), _bla_fast,
        ),
        Method(
            "arx", "linear", "Least squares: quick, right in little noise.", "any, white equation error",
            f"{_LJUNG}, 7.3", ("order", "delay", "structure", "focus", "band"), _arx, ("na", "nb"), _ORDERS,
        ),
        Method(
            "iv4", "linear", "Instrumental variables: right whatever the noise, without a search.",
            "open, with --closed-loop by the reference", f"{_LJUNG}, 15.3; Gilson and Van den Hof 2005",
            ("order", "delay", "structure", "closed_loop", "band"), _iv4, ("na", "nb"), _ORDERS,
            "free run",
        ),
        Method(
            "armax", "linear", "Disturbances that enter where the command does.", "any, noise model right",
            f"{_LJUNG}, 4.2", ("order", "delay", "structure", "focus", "band"), _armax, ("na", "nb", "nc"), _ORDERS,
        ),
        Method(
            "oe", "linear", "The best free run: sensor noise, simulation, control design.",
            "open; closed in white noise only", f"{_LJUNG}, 4.2",
            ("order", "delay", "structure", "band"), _oe, ("nb", "nf"), _ORDERS, "free run",
        ),
        Method(
            "bj", "linear", "Plant and noise share nothing.", "any, noise model right", f"{_LJUNG}, 4.2",
            ("order", "delay", "structure", "focus", "band"), _bj, ("nb", "nc", "nd", "nf"), _ORDERS,
        ),
        Method(
            "n4sid", "linear", "State space without a search; the order shows in the singular values.", "open",
            "Van Overschee and De Moor 1996", (*_SUBSPACE, "focus"), _n4sid,
        ),
        Method(
            "moesp", "linear", "The same from the shift of the observability matrix.", "open", "Verhaegen 1994",
            (*_SUBSPACE, "focus"), _moesp,
        ),
        Method(
            "cva", "linear", "The same from canonical variates: outputs of any unit and noise.", "open",
            "Larimore 1990", (*_SUBSPACE, "focus"), _cva,
        ),
        Method(
            "vodma", "linear", "State space in a loop whose controller is known and linear.",
            "closed, controller known", "Van Overschee and De Moor 1997", (*_SUBSPACE, "controller"), _vodma,
        ),
        Method(
            "vodma-direct", "linear", "The same without the controller.", "open", "Linköping thesis 2009, 3.4",
            _SUBSPACE, _vodma_direct,
        ),
        Method(
            "pbsid", "linear", "State space under any feedback, nothing known of it.", "any", "Chiuso 2007",
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
                ("kalman", "The same for coefficients that wander.", "any, white equation error", f"{_LJUNG}, 11.2",
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
    """Return a method by name.

    Raises
    ------
    InputError
        No such method.
    """
    if name not in METHODS:
        raise InputError(f"no method {name!r}{did_you_mean_or_known(name, METHODS)}")
    return METHODS[name]
