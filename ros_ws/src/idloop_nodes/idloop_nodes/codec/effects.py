"""What is missing, as diagnostic statuses and back, without loss: one status for the verdict, one for each effect."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field

from idloop.documents import read_json
from idloop.errors import InputError
from idloop.records.bags.cdr import CdrError
from idloop_nodes.codec.diagnostics import Level, Status
from idloop_nodes.codec.numbers import number_or_none, plus_minus, text_or_empty

LEVELS = {"adequate": Level.OK, "missing": Level.WARN}


@dataclass(frozen=True)
class Estimate:
    """Value of one parameter of an effect, with standard error (or None) and unit."""

    value: float
    stderr: float | None = None
    unit: str = ""

    @property
    def text(self) -> str:
        """For a person, with the 95 % interval: ``0.121 ± 0.002 V``."""
        return f"{self.value:.4g}{plus_minus(self.stderr)} {self.unit}".strip()


@dataclass(frozen=True)
class EffectSummary:
    """One effect that may be missing.

    Attributes
    ----------
    effect, at : str
        Effect and site.
    testable : str
        ``yes``, ``weak`` or ``no``: what the data can show of it.
    p_value : float or None
        Family-wise; None when it was not tested.
    explains : float
        Share of the unexplained error that it explains, 0 to 1.
    gain : float or None
        Log-likelihood gained; None when it was only screened.
    parameters : dict of str to Estimate
        By the parameter's name in the effect.
    replaces : str
        Effect of the model whose place it takes; empty when none.
    why, text : str
        Why it is testable or looks like this one; its physics in a sentence.
    fitted_model : str
        The model that was fitted with it, as the text of a model file; empty when it was only screened.
    """

    effect: str
    at: str
    testable: str = "yes"
    p_value: float | None = None
    explains: float = 0.0
    gain: float | None = None
    parameters: dict[str, Estimate] = field(default_factory=dict)
    replaces: str = ""
    why: str = ""
    text: str = ""
    fitted_model: str = ""

    @property
    def name(self) -> str:
        """``dead_zone@input``."""
        return f"{self.effect}@{self.at}"

    @property
    def line(self) -> str:
        """Evidence and parameters for a person."""
        parts = [] if self.p_value is None else [f"p {self.p_value:.2g}" if self.p_value >= 1e-3 else "p < 0.001"]
        parts.append(f"explains {100.0 * self.explains:.0f} %")
        parts += [f"{name} {one.text}" for name, one in self.parameters.items()]
        return ", ".join(parts)


@dataclass(frozen=True)
class UnknownSummary:
    """Structure that no effect of the catalogue explains: the remaining force over a variable, with its band."""

    variable: str
    unit: str
    force_unit: str
    at: tuple[float, ...]
    force: tuple[float, ...]
    band: tuple[float, ...]
    share: float
    text: str


@dataclass(frozen=True)
class MissingSummary:
    """What a diagnosis found.

    Attributes
    ----------
    model : str
        Name of the model.
    effects : tuple of str
        Effects that it has.
    verdict : str
        ``missing``, ``adequate``, ``unknown_structure`` or ``not_excited``.
    candidates : tuple of EffectSummary
        Best first.
    set : tuple of str
        Effects that the data cannot tell from the best one, that one included.
    untestable : tuple of str
        Effects of which the data can show nothing.
    findings, where : tuple of str
        What the data can show; where the model fails.
    unknown : UnknownSummary or None
    criterion : str
    level : float
        Family-wise error rate.
    windows : tuple of (int, int)
        First and last stamp of each stretch of data in nanoseconds.
    document : str
        All of it as `idloop diagnose` writes it (JSON, schema idloop/diagnose/1).
    error : str
        Why there is no diagnosis, one line; empty when there is one.
    pair : tuple of str
        Two effects that show only together; empty where one alone is missing, or none.
    """

    model: str
    effects: tuple[str, ...] = ()
    verdict: str = ""
    candidates: tuple[EffectSummary, ...] = ()
    set: tuple[str, ...] = ()
    untestable: tuple[str, ...] = ()
    findings: tuple[str, ...] = ()
    where: tuple[str, ...] = ()
    unknown: UnknownSummary | None = None
    criterion: str = ""
    level: float = 0.01
    windows: tuple[tuple[int, int], ...] = ()
    document: str = ""
    error: str = ""
    pair: tuple[str, ...] = ()

    @property
    def line(self) -> str:
        """The verdict for a person."""
        if self.error:
            return self.error
        if self.verdict == "missing" and self.candidates:
            best = self.candidates[0]
            ties = [name for name in self.set if name != best.name]
            tied = f"; this data cannot tell it from {', '.join(ties)}" if ties else ""
            if self.pair:
                return f"only together: {' and '.join(self.pair)} are missing ({best.line})"
            return f"{best.name} is missing ({best.line}){tied}"
        if self.verdict == "adequate":
            return "nothing significant is missing"
        if self.verdict == "unknown_structure":
            return self.unknown.text if self.unknown else "something is missing that is not in the catalogue"
        if self.verdict == "not_excited":
            return f"nothing significant is missing, but this data cannot show {', '.join(self.untestable)}"
        return self.verdict


def missing_to_statuses(node: str, summary: MissingSummary) -> list[Status]:
    """Return the statuses of ``estimator/missing_effects``."""
    values = {
        "verdict": summary.verdict,
        "model": summary.model,
        "effects": " ".join(summary.effects),
        "set": " ".join(summary.set),
        "pair": " ".join(summary.pair),
        "untestable": " ".join(summary.untestable),
        "criterion": summary.criterion,
        "level": repr(float(summary.level)),
        "windows": " ".join(f"{start}-{stop}" for start, stop in summary.windows),
        "findings": lines_to_text(summary.findings),
        "where": lines_to_text(summary.where),
        "document": summary.document,
        "error": summary.error,
    }
    if summary.unknown is not None:
        values |= _unknown_values(summary.unknown)
    level = Level.WARN if summary.error else LEVELS.get(summary.verdict, Level.WARN)
    head = Status(f"{node}: missing effects", summary.line, level, values, summary.model)
    return [head, *(effect_to_status(node, one, tied=one.name in summary.set) for one in summary.candidates)]


def missing_from_statuses(statuses: Sequence[Status]) -> MissingSummary:
    """Return the summary that `missing_to_statuses` wrote.

    Raises
    ------
    CdrError
        When a value is missing or no number.
    """
    if not statuses:
        raise CdrError("estimator/missing_effects holds no status")
    values = statuses[0].values
    try:
        return MissingSummary(
            model=values["model"],
            effects=tuple(values["effects"].split()),
            verdict=values["verdict"],
            candidates=tuple(effect_from_values(one.values) for one in statuses[1:]),
            set=tuple(values["set"].split()),
            pair=tuple(values.get("pair", "").split()),
            untestable=tuple(values["untestable"].split()),
            findings=lines_from_text(values["findings"]),
            where=lines_from_text(values["where"]),
            unknown=_unknown_from_values(values),
            criterion=values["criterion"],
            level=float(values["level"]),
            windows=tuple(_window(one) for one in values["windows"].split()),
            document=values["document"],
            error=values["error"],
        )
    except (KeyError, ValueError, TypeError, InputError) as error:
        raise CdrError(f"estimator/missing_effects cannot be read: {error}") from error


def effect_to_status(node: str, one: EffectSummary, *, tied: bool) -> Status:
    """Return the status of one effect."""
    level = Level.WARN if tied else Level.OK
    return Status(f"{node}: {one.name}", one.line, level, effect_to_values(one), one.name)


def effect_to_values(one: EffectSummary) -> dict[str, str]:
    """Return the key values of one effect."""
    values = {
        "effect": one.effect,
        "at": one.at,
        "testable": one.testable,
        "p_value": text_or_empty(one.p_value),
        "explains": repr(float(one.explains)),
        "gain": text_or_empty(one.gain),
        "replaces": one.replaces,
        "why": one.why,
        "text": one.text,
        "fitted_model": one.fitted_model,
    }
    for name, estimate in one.parameters.items():
        values[f"parameter/{name}"] = repr(float(estimate.value))
        values[f"stderr/{name}"] = text_or_empty(estimate.stderr)
        values[f"unit/{name}"] = estimate.unit
    return values


def effect_from_values(values: dict[str, str]) -> EffectSummary:
    """Return the effect that `effect_to_values` wrote; KeyError or ValueError when it did not."""
    names = [key.removeprefix("parameter/") for key in values if key.startswith("parameter/")]
    return EffectSummary(
        effect=values["effect"],
        at=values["at"],
        testable=values["testable"],
        p_value=number_or_none(values["p_value"]),
        explains=float(values["explains"]),
        gain=number_or_none(values["gain"]),
        parameters={
            name: Estimate(
                float(values[f"parameter/{name}"]),
                number_or_none(values[f"stderr/{name}"]),
                values[f"unit/{name}"],
            )
            for name in names
        },
        replaces=values["replaces"],
        why=values["why"],
        text=values["text"],
        fitted_model=values.get("fitted_model", ""),
    )


def lines_to_text(lines: Sequence[str]) -> str:
    """Return lines of text as one value."""
    return json.dumps(list(lines), ensure_ascii=False)


def lines_from_text(text: str) -> tuple[str, ...]:
    """Return the lines that `lines_to_text` wrote; ValueError or InputError when it did not."""
    lines = read_json(text, "lines")
    if not isinstance(lines, list) or not all(isinstance(one, str) for one in lines):
        raise ValueError(f"{text[:40]!r} is no list of lines")
    return tuple(lines)


def _window(text: str) -> tuple[int, int]:
    start, stop = text.split("-")
    return int(start), int(stop)


def _unknown_values(one: UnknownSummary) -> dict[str, str]:
    values = {name: getattr(one, name) for name in ("variable", "unit", "force_unit", "text")}
    values["share"] = repr(float(one.share))
    values |= {name: " ".join(repr(float(x)) for x in getattr(one, name)) for name in ("at", "force", "band")}
    return {f"unknown/{name}": value for name, value in values.items()}


def _unknown_from_values(values: dict[str, str]) -> UnknownSummary | None:
    if "unknown/variable" not in values:
        return None
    at, force, band = (tuple(float(x) for x in values[f"unknown/{name}"].split()) for name in ("at", "force", "band"))
    return UnknownSummary(
        variable=values["unknown/variable"],
        unit=values["unknown/unit"],
        force_unit=values["unknown/force_unit"],
        at=at,
        force=force,
        band=band,
        share=float(values["unknown/share"]),
        text=values["unknown/text"],
    )
