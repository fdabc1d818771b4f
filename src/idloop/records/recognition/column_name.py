"""What the name of a column says: its words, its unit, and which of several joints it belongs to."""

from __future__ import annotations

import re
from collections.abc import Container, Iterable
from dataclasses import dataclass
from unicodedata import normalize

from idloop.records.tables.base_units import base_of, known_unit, read_unit
from idloop.records.tables.table import Table

_VOLTAGES, _CURRENTS, _TIMES, _SPEEDS = {"V"}, {"A"}, {"s"}, {"rad/s", "m/s", "counts/s"}
# Units, as the topics have them, of the quantities that words of a name state.
_UNITS_OF_WORDS: tuple[tuple[set[str], set[str]], ...] = (
    ({"voltage", "volt", "volts", "vin", "vbus", "uq", "vq", "ud", "vd", "spannung"}, _VOLTAGES),
    ({"current", "i", "iq", "id", "strom", "corriente", "courant", "corrente"}, _CURRENTS),
    ({"force", "kraft", "tension"}, {"N"}),
    ({"torque", "tau", "moment", "drehmoment", "couple"}, {"N·m"}),
    ({"u", "effort", "efforts", "stellgroesse", "stellgröße"}, {"V", "A", "N", "N·m"}),
    ({"pwm", "duty", "dutycycle", "throttle", "pulse", "pulsewidth"}, _TIMES),
    (
        {"theta", "phi", "alpha", "beta", "angle", "winkel", "angulo", "angolo", "enc", "encoder"},
        {"rad", "counts"},
    ),
    (
        {
            "omega", "w", "rpm", "erpm", "rps", "qd", "dq", "qdot", "thetadot", "dtheta", "angvel", "drehzahl", "n",
            "tacho", "tachometer", "velocity", "velocities", "vel", "speed", "geschwindigkeit", "velocidad", "vitesse",
            "velocita",
        },
        _SPEEDS,
    ),
    # What the sensor of a motion shows may be read as a voltage.
    ({"enc", "encoder", "tacho", "tachometer"}, _VOLTAGES),
    # A small v is a voltage or a velocity.
    ({"v"}, _VOLTAGES | _SPEEDS),
    (
        {
            "position", "positions", "pos", "x", "y", "z", "q", "lage", "weg", "posicion", "posizione", "displacement",
            "distance", "stroke", "stage", "slide", "carriage", "height", "cart",
        },
        {"rad", "m", "counts"},
    ),
)  # fmt: skip
# A small v behind these is in volts, and so is one behind the command of a motor; other ones are velocities.
_IN_VOLTS = {
    "voltage", "volt", "spannung", "supply", "bus", "vbus", "battery", "bat", "vbat", "u", "uq", "ud", "pwm",
}  # fmt: skip
_MOTORS = {"motor", "drive", "actuator", "servo", "armature"}
# Behind a name most often the way in, and a unit only where the name says that it is a length.
_WAY_IN = "in"
# A unit behind a name: in brackets, or as in "speed in rpm" and "n / rpm". A bracket without its other half is none.
BRACKETS = re.compile(r"\s*[\[(<{]\s*([^\[(<{\])>}]*?)\s*[\])>}]")
_BEHIND = re.compile(r"(?:\s+in\s+|\s+/\s+|\s*,\s+)(\S+)\s*$")
_WORD = re.compile(r"[A-ZÄÖÜ]+(?![a-zäöüß])|[A-ZÄÖÜ]?[a-zäöüß]+|\d+|µ[a-z]+|[%°]|[^\W\d_A-Za-zÄÖÜäöüßµ]+")
# A remark in a name, as in "Time (samples) TM=1000us": its unit is not that of the column.
_REMARK = re.compile(r"\b\w+\s*=\s*[-+]?\d\S*")
_INDEX = re.compile(r"\d+")
_ELEMENT = re.compile(r"(?<=[^\d./])[./](\d+)(?=[./]|$)")
# What was wanted, and what was measured of it.
WANTED = frozenset({
    "ref", "reference", "target", "goal", "setpoint", "desired", "des", "soll", "sollwert", "sp", "demand", "demanded",
    "command", "commands", "commanded", "cmd", "planned", "desire", "setp", "request", "requested", "set",
    "vorgabe", "führungsgröße", "consigne", "consigna", "referencia", "riferimento", "börvärde", "gewenst",
})  # fmt: skip
MEASURED = frozenset({
    "actual", "act", "meas", "measured", "measure", "measurement", "feedback", "fb", "ist", "istwert", "est",
    "estimate", "estimated", "present", "sensor", "filtered", "filt", "adc",
    "messwert", "mesure", "mesuree", "medida", "medido", "misurata", "misurato", "ärvärde", "gemeten",
})  # fmt: skip
# What is added to the output of a loop: a force that is commanded.
FEED_FORWARD = frozenset({"ff", "feedforward"})
# A number of the row or of the sample; it says neither when it was taken nor what was measured.
_COUNTERS = frozenset({
    "sample", "samples", "seq", "sequence", "index", "idx", "row", "rows", "line", "record", "no", "nr", "data",
    "number", "packet", "pkt", "frame", "cycles", "muestra", "muestras", "echantillon", "echantillons", "campione",
    "campioni", "amostra", "amostras", "abtastwert", "abtastwerte", "messpunkt", "messung", "zeile", "punkt",
    "probka", "vzorek",
})  # fmt: skip
# What a device says of itself; a structure around it does not change that.
FLAGS = frozenset({"state", "status", "flag", "flags", "mode", "fault"})
_VALUES = ("data", "value", "values")  # last part of a path that says only what stands there
_COMPONENTS = ("x", "y", "z", "w")
_NO_COUNTERS = frozenset({"data", "number", "no"})  # by themselves
# A German compound: its last noun is the quantity, set-point or measured are said before or behind it.
_COMPOUND = re.compile(
    r"(soll|ist)?(\w*?)(soll|ist)?"
    r"(geschwindigkeit|drehzahl|drehmoment|moment|kraft|strom|spannung|position|lage|winkel|weg|temperatur"
    r"|fehler|abweichung)"
    r"(?:s|en)?(sollwert|istwert|messwert|vorgabe|soll|ist)?"
)
# English words that are written as one.
_SIDES = "actual|act|measured|desired|target|reference|ref|setpoint|command|commanded|cmd|feedback|set"
_TOGETHER = re.compile(
    rf"({_SIDES}|motor|joint|axis|shaft|wheel|rotor|servo)?"
    r"(position|pos|angle|velocity|vel|speed|current|torque|voltage|effort|force|pwm)"
    rf"({_SIDES})?"
)
_FEEDBACK = re.compile(r"([fr])(pos|vel|acc)")  # as controllers of motion abbreviate


def is_in_volts(words: Iterable[str], wanted: Container[str]) -> bool:
    """Whether a small v behind words in small letters is the unit of a voltage; `wanted` are those of a set-point."""
    rest = set(words)
    return bool(rest & _IN_VOLTS) or (bool(rest & _MOTORS) and any(word in wanted for word in rest))


def is_unit_behind(suffix: str, words: Iterable[str]) -> bool:
    """Whether a unit behind words is one: a single letter, and ``in``, mean motor, measured and input as well."""
    if suffix != _WAY_IN and (len(suffix) > 1 or not suffix.isalpha()):
        return True
    rest = set(words)
    said = [units for some, units in _UNITS_OF_WORDS if some & rest]
    return any(base_of(suffix) in units for units in said) if said else suffix != _WAY_IN


def unit_within(word: str) -> tuple[str, str]:
    """Return name and symbol of a word such as ``yrad`` and ``wrads``; an empty unit where it has none that fits."""
    small = word.lower()
    if any(small in some for some, _ in _UNITS_OF_WORDS):
        return word, ""
    for some, units in _UNITS_OF_WORDS:
        for name in some:
            symbol = small.removeprefix(name) if small.startswith(name) else ""
            per_second = f"{symbol[:-1]}/s" if symbol.endswith("s") else ""
            for text in (per_second, symbol):
                unit, factor = read_unit(text)
                plain = unit.casefold() == text and factor == 1.0 and text != _WAY_IN
                if plain and len(symbol) > 1 and base_of(unit) in units:
                    return word[: len(name)], unit
    return word, ""


@dataclass(frozen=True)
class ColumnName:
    """A name taken apart."""

    words: tuple[str, ...]  # in small letters, without unit and index
    unit: str  # as a mapping file writes it, ``counts`` of an encoder; empty where the name has none
    index: str  # number of the joint or channel; empty without one
    # The single letter that the name is but for what was wanted or measured, whose case tells V from v: M_soll
    letter: str = ""
    factor: float = 1.0  # number of the unit that the column counts in: 0.01 of ``[0.01 A]``
    written: str = ""  # what is written as a unit and is none that is known


def with_brackets(name: str) -> str:
    """Return a path with the elements of arrays in brackets: ``/effort/data.0`` is ``/effort/data[0]``."""
    return _ELEMENT.sub(r"[\1]", name)


def parse_column_name(name: str, unit: str = "") -> ColumnName:
    """Take a name apart: ``Velocity [rpm]``, ``iq_setpoint``, ``motorSpeed_rad_s``, ``pos (1)``.

    `unit`: unit from a row below the header.
    """
    index = ""
    name = with_brackets(_REMARK.sub(" ", name))
    written = unit.strip("[](){}<> ")
    found, factor = read_unit(written)
    for match in BRACKETS.finditer(name):
        inside = match[1].strip()
        if _INDEX.fullmatch(inside):
            index = inside
        elif not found:
            own, times = read_unit(inside)
            found, factor = (own, times) if own else read_unit(inside.upper())
            written = written if not inside or _says_which(inside) else inside
    text = BRACKETS.sub(lambda match: f" {match[1]} " if _says_which(match[1]) else " ", _without_accents(name))
    behind = None if found else _BEHIND.search(text)
    if behind is not None and known_unit(behind[1]):
        found, text = known_unit(behind[1]), text[: behind.start()]
    # The last words of a topic's path or of a structure name the signal; what counts the rows does so in any of them.
    path = re.split(r"[/.]", text.strip("/. "))
    path = path[:-1] if len(path) > 1 and path[-1].strip().lower() in _VALUES else path
    # A state with an index is one of several, as of the joints.
    alone = _counts(path[-1]) or (path[-1].strip().lower() in FLAGS and not index)
    # Of a vector the last word is the component: wrench.force.x. Data to identify with are called id, and no current.
    around = [one for one in path[-3 if path[-1] in _COMPONENTS else -2 : -1] if one.strip().lower() != "id"]
    text = " ".join([*([] if alone else around), path[-1]])
    words = [word for word in _WORD.findall(text) if word]
    if text.rstrip().endswith("*"):
        words.append("setpoint")  # as i_q* in the literature on drives
    elif not found:
        found, factor, words = _unit_of_last_words(words)
        # The number of a joint may stand behind it: of a single letter it is a part.
        if not found and words[-1:] and words[-1].isdigit():
            own, times, rest = _unit_of_last_words(words[:-1])
            found, factor, words = (own, times, [*rest, words[-1]]) if len(own) > 1 else (found, factor, words)
    numbers = [word for word in words if word.isdigit()]
    plain = [word for word in words if not word.isdigit()]
    rest = [word for word in plain if word.lower() not in WANTED | MEASURED]
    letter = rest[0] if len(rest) == 1 and len(rest[0]) == 1 else ""
    parts = tuple(part for word in plain for part in _parts(word.lower()))
    if FEED_FORWARD & set(parts):
        parts = tuple("torque" if part == "t" else part for part in parts)  # t_ff of the MIT protocol
    return ColumnName(parts, found, index or (numbers[-1] if numbers else ""), letter, factor, "" if found else written)


def name_in(table: Table, name: str) -> ColumnName:
    """Take the name of a column of a table apart."""
    return parse_column_name(name, table.units.get(name, ""))


def is_counter(name: ColumnName) -> bool:
    """Whether a name says that a column counts the rows: ``Data No``, ``sample``, ``Time (samples)``."""
    return name.unit in ("", "counts") and (_counts(" ".join(name.words)) or _counts(name.written))


def _counts(text: str) -> bool:
    words = {word.lower() for word in _WORD.findall(_without_accents(text)) if not word.isdigit()}
    return words <= _COUNTERS and bool(words - _NO_COUNTERS or {"data", "no"} <= words or {"data", "number"} <= words)


def _says_which(inside: str) -> bool:
    """Whether brackets hold what was wanted or measured: Speed (actual) [rpm]."""
    return not (WANTED | MEASURED).isdisjoint(map(str.lower, _WORD.findall(inside)))


def _without_accents(text: str) -> str:
    """A text with plain letters for those with accents, but for umlauts: posición, vitesse mesurée."""
    return "".join(one if one in "äöüÄÖÜ" else normalize("NFD", one)[0] for one in normalize("NFC", text))


def _parts(word: str) -> list[str]:
    """Words of a compound in small letters; the word itself where it is none."""
    if match := _TOGETHER.fullmatch(word):
        return [part for part in match.groups() if part]
    if match := _FEEDBACK.fullmatch(word):
        return [{"f": "feedback", "r": "reference"}[match[1]], match[2]]
    match = _COMPOUND.fullmatch(word)
    # An s joins the words: versorgungs-spannung.
    return [part.removesuffix("s") for part in match.groups() if part] if match else [word]


def _unit_of_last_words(words: list[str]) -> tuple[str, float, list[str]]:
    """Unit in the last words of a name, as in ``speed_rad_s``, its number, and the words before it."""
    if words[-1:] == ["v"] and is_in_volts(map(str.lower, words[:-1]), WANTED):
        return "V", 1.0, words[:-1]
    for count in (3, 2, 1):
        if len(words) <= count - (count == 1 and len(words) == 1):
            continue
        last = words[-count:]
        for joint in ("/", "·", "per", ""):
            unit, factor = read_unit(joint.join(last) if count > 1 else last[0])
            # A single letter is a unit in its own case only, and only behind a name.
            written = len("".join(last)) > 1 or (len(words) > 1 and last[0] in (unit, "°"))
            written = written and last[0].lower() != "pulse"  # a command; an encoder counts pulses
            # Behind a name rated and nominal say which, and are no unit.
            if unit not in ("", "-") and written and is_unit_behind(unit, map(str.lower, words[:-count])):
                return unit, factor, words[:-count] or list(last)
    if words:
        name, unit = unit_within(words[-1])
        return unit, 1.0, [*words[:-1], name]
    return "", 1.0, words
