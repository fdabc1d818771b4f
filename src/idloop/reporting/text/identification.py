"""Identified models in words: methods, scores, poles, notes, the loop, sweeps."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from idloop.p_values import p_text
from idloop.reporting.residual_findings import residual_line
from idloop.reporting.text.blocks import Block, Table, number
from idloop.spelling import listed
from idloop.validation.identification_outcome import Outcome, best_values, mean
from idloop.validation.words import fit_text

if TYPE_CHECKING:
    from idloop.estimation.feedback import Loop

_AT_ZERO = 1e-12
_SURE = 0.3  # of a response's size, its standard error where the response is known
_LOUD = 1e-3  # share of the command's power that is noise: less biases no more than other errors do
_SEEN = 0.05  # probability of so much by chance below which nonlinearity is seen
_CRITERIA = ("loss", "FPE", "AIC", "BIC")
_EDGE = 1e-3  # a pole this close to the unit circle is as good as on it


def methods_blocks() -> Iterator[Block]:
    """Yield every method with what it is for."""
    from idloop.estimation.black_box.methods import METHODS

    yield Table.of(
        ["method", "what for", "loop", "source"],
        [(name, method.summary, method.loop, method.source) for name, method in METHODS.items()],
    )


def outcomes_blocks(outcomes: Sequence[Outcome], steps: int) -> Iterator[Block]:
    """Yield one line for each method and output; what belongs to the method is said once."""
    rows = []
    for one in outcomes:
        if one.score is None:
            continue
        delay = None if one.found is None else one.found.delay
        head, tail = [one.label, _text(one.states), _text(delay)], [*_criteria(one), _stability(one)]
        for name, free_run, ahead in zip(one.score.output_names, one.score.free_run, one.score.ahead, strict=True):
            rows.append([*head, name, fit_text(float(free_run)), fit_text(float(ahead)), *tail])
            head, tail = [""] * len(head), [""] * len(tail)
    if rows:
        header = ("method", "states", "delay", "output", "FIT % free run", f"FIT % {steps} ahead")
        yield Table.of([*header, *_CRITERIA, "stable"], rows)


def responses_blocks(outcomes: Sequence[Outcome]) -> Iterator[Block]:
    """Yield what each frequency or impulse response covers."""
    rows = []
    for one in outcomes:
        if one.found is None or one.found.predicts:
            continue
        model: Any = one.found.model
        impulse = hasattr(model, "lag")
        for column, name in enumerate(model.output_names):
            unit, smoothed, heard = ("s" if impulse else "Hz"), "-", None
            if impulse:
                size, at = abs(model.response[:, column]), model.time
                sure = slice(None)
            else:
                kept = model.resolved
                size, at = abs(model.response[kept, column, 0]), model.frequency[kept]
                heard = None if model.coherence is None else sorted(model.coherence[kept, column])[len(at) // 2]
                smoothed = "-" if model.resolution is None else f"{number(model.resolution)} Hz"
                # Where next to nothing was sent in, what is largest is an error.
                sure = model.stderr[kept, column, 0] < _SURE * size
            known, where = size[sure], at[sure]
            peak = (number(float(known.max())), f"{number(where[known.argmax()])} {unit}") if len(known) else ("-", "-")
            span = f"{at[0]:.4g} to {at[-1]:.4g} {unit}"
            rows.append((one.label, name, str(len(at)), span, smoothed, *peak, number(heard)))
    if rows:
        yield Table.of(["method", "output", "points", "range", "resolution", "largest", "at", "median coherence"], rows)


def followed_blocks(outcomes: Sequence[Outcome]) -> Iterator[Block]:
    """Yield what coefficients that change predict: on their way through the data of the fit, and the last ones."""
    import numpy as np

    rows = []
    for one in outcomes:
        if one.found is None:
            continue
        model: Any = one.found.model
        for column, history in enumerate(one.found.history):
            size = float(np.std(history.measured))
            held = math.sqrt(float(model.covariance[column, column]))
            last = 100.0 * (1.0 - held / size) if size > 0.0 else math.nan
            first = column == 0
            rows.append((one.label if first else "", history.output_name, fit_text(history.fit), fit_text(last)))
    if rows:
        yield ""
        yield Table.of(
            ["method", "output", "FIT % 1 ahead, coefficients of each instant", "FIT % 1 ahead, the last ones held"],
            rows,
        )
        yield (
            "of the data of the fit; the free run and all else above have the last coefficients, held for the whole"
            " record; --plot draws how they went"
        )


def distortion_blocks(outcomes: Sequence[Outcome]) -> Iterator[Block]:
    """Yield how much of each best linear approximation is noise, and how much the nonlinearity scatters."""
    rows, verdicts = [], []
    for one in outcomes:
        model: Any = None if one.found is None else one.found.model
        told = getattr(model, "distortion", None)
        if told is None:
            continue
        for name, parts in zip(told.output_names, told.shares(model.response[:, :, 0]), strict=True):
            sizes = (parts[kind] for kind in ("noise", "stochastic", "odd", "even"))
            rows.append((one.label, name, *(number(100.0 * size, 3) for size in sizes)))
            verdicts.append(f"{one.label}, {name}: {nonlinearity_text(parts)}")
    if rows:
        yield ""
        yield Table.of(["method", "output", "noise %", "nonlinear %", "odd lines %", "even lines %"], rows)
        yield (
            "of the linear response, noise and scatter by the nonlinearity in one experiment each; of the output, what"
            " odd and even nonlinearity make at lines left empty"
        )
        yield from verdicts


def nonlinearity_text(parts: Mapping[str, float]) -> str:
    """Whether each kind of nonlinearity stands out of the noise, from `Distortion.shares`."""
    texts = []
    for kind, name in (("stochastic", "nonlinear"), ("odd", "odd lines"), ("even", "even lines")):
        level, p_value = parts[kind], parts[f"p_{kind}"]
        if not math.isfinite(p_value):
            continue
        chance = p_text(p_value)
        if p_value >= _SEEN:
            texts.append(f"{name}: not seen ({chance})")
        else:
            # A few quiet lines may show what the average over all of them does not.
            texts.append(f"{name}: {f'{100.0 * level:.3g} %' if level > 0.0 else 'seen at some lines'} ({chance})")
    return "; ".join(texts)


def details_blocks(one: Outcome) -> Iterator[Block]:
    """Yield poles and, where they have a meaning of their own, coefficients of a single linear model."""
    model = None if one.found is None else one.found.linear
    if model is None:
        return
    yield ""
    poles = sorted(model.poles, key=lambda p: (-abs(p), -p.imag))
    # A delay is a row of poles at zero.
    moving = [pole for pole in poles if abs(pole) > _AT_ZERO]
    length = model.samples * model.sample_time
    rows = [pole_row(pole, model.sample_time, length) for pole in moving]
    if len(moving) < len(poles):
        rows.append((f"0 ({len(poles) - len(moving)} times)", "0", "-", "-", "-"))
    yield Table.of(["pole", "|z|", "natural frequency Hz", "damping", "time constant s"], rows)
    if model.coefficients:
        yield ""
        yield Table.of(
            ["coefficient", "value", "standard error"],
            [(c.name, number(c.value, 6), number(c.stderr, 3)) for c in model.coefficients],
        )


def pole_row(pole: complex, sample_time: float, length: float = math.inf) -> tuple[str, ...]:
    """Pole, its size, and frequency [Hz], damping and time constant [s] of the continuous pole of same samples.

    `sample_time`, `length`: of the record [s]: a pole whose time constant is longer is an integrator's as far as that
    shows.
    """
    import cmath

    text = f"{pole.real:.6g}" + (f"{pole.imag:+.6g}j" if pole.imag else "")
    s = cmath.log(pole) / sample_time
    natural = abs(s)
    slow = 1.0 / abs(s.real) if s.real else math.inf
    size, constant = f"{abs(pole):.6f}", number(slow)
    if pole.imag == 0.0 and pole.real > 0.0 and slow > length:
        return (text, size, "-", "integrator", constant)
    if s.real > 0.0:
        # What grows has no damping; the time in which it grows e times tells more.
        constant = f"grows, {constant}"
        if pole.imag == 0.0 and pole.real > 0.0:
            return (text, size, "-", "-", constant)
    damping = -s.real / natural if natural > 0 else math.nan
    return (text, size, number(natural / (2 * math.pi)), number(damping), constant)


def notes_blocks(outcomes: Sequence[Outcome]) -> Iterator[Block]:
    """Yield what was chosen, what a user should know of it, and what the one-step errors still hold."""
    for one in outcomes:
        if one.error:
            yield f"{one.label}: failed: {one.error}"
        if one.found is None:
            continue
        tried = len(one.found.trials)
        if tried:
            delay = "" if one.found.delay is None else f", delay {one.found.delay}"
            of_run = " of the free run" if one.found.method.selects == "free run" else ""
            further = ""
            if one.found.at_limit and isinstance(one.found.order, int):
                further = f"; none higher was tried: --order 1:{2 * one.found.order} looks further"
            yield f"{one.label}: order {one.found.order}{delay}: the least BIC{of_run} of {tried} tried{further}"
        for note in (*one.found.model.notes, one.hint):
            if note:
                yield f"{one.label}: {note}"
        for test in one.score.tests if one.score is not None else ():
            yield residual_line(one.label, test)


def loop_text(loop: Loop, biased: Sequence[str]) -> str:
    """One line on methods for the open loop that are given data of a closed one; empty where there are none."""
    from idloop.estimation.feedback import closed_loop_methods

    if not (loop.closed and biased):
        return ""
    loud = loop.fed_back > _LOUD
    signs = ["the reference moves"] if loop.reference else []
    if loop.depends and loud:
        signs.append(f"noise of the outputs is {number(100 * loop.fed_back, 3)} % of the command's power")
    bias = "biased by it" if loop.depends and loud else "biased, if little: hardly any noise comes back"
    white = "; oe is right only where its residual is white" if "oe" in biased else ""
    return (
        f"the loop was closed ({', '.join(signs)}): {listed(biased)} {'is' if len(biased) == 1 else 'are'} for an open"
        f" loop and {bias}{white}; right here: {', '.join(closed_loop_methods(loop))}"
    )


def sweep_blocks(
    name: str, unit: str | None, rows: Sequence[tuple[float, Outcome]], steps: int, smallest: Mapping[str, float]
) -> Iterator[Block]:
    """Yield one line for each value and method, then the best value of each method, and a lower order as good."""
    of_records, failed = any(one.record for _, one in rows), any(one.error for _, one in rows)
    table = []
    for value, one in rows:
        swept = (one.record, number(value, 4)) if of_records else (number(value, 6),)
        fits = (fit_text(mean(one, kind)) for kind in ("free_run", "ahead"))
        error = [one.error] if failed else []
        table.append((*swept, one.label, _text(one.states), *fits, *_criteria(one), _stability(one), *error))
    swept = ("record", f"{name} [{unit}]") if of_records else (name,)
    header = (*swept, "method", "states", "mean FIT % free run", f"mean FIT % {steps} ahead", *_CRITERIA, "stable")
    yield Table.of([*header, "failed"] if failed else header, table)
    yield ""
    for label, value in best_values(rows).items():
        runs = {at: mean(one, "free_run") for at, one in reversed(rows) if one.label == label}
        at_best = f"{value:.4g} {unit}" if of_records else f"{value:g}"
        yield f"{label}: best free run at {name} {at_best}: mean FIT {fit_text(runs[value], 4, ' %')}"
        least = smallest.get(label, value)
        if least != value:
            close = fit_text(runs[least], 4, " %")
            yield f"{label}: {name} {least:g} is as good as that within what these data tell: mean FIT {close}"


def _criteria(one: Outcome) -> list[str]:
    """Loss, FPE, AIC and BIC; of AIC and BIC differences count, which four digits of so large numbers do not show."""
    known = one.information
    if known is None:
        return ["-"] * 4
    sums = [f"{value:.1f}" if math.isfinite(value) else number(value) for value in (known.aic, known.bic)]
    return [number(known.loss), number(known.fpe), *sums]


def _text(value: int | None) -> str:
    return "-" if value is None else str(value)


def _stability(one: Outcome) -> str:
    if one.largest_pole is None:
        return "-"
    # An integrator's pole is found a little inside or outside the circle.
    return "edge" if abs(one.largest_pole - 1.0) < _EDGE else "yes" if one.stable else "NO"
