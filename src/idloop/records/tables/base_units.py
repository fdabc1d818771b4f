"""Units of foreign files, in the languages and spellings of logs, the units of the topics, and names of stamps."""

from __future__ import annotations

import re
from math import pi
from typing import Any
from unicodedata import normalize

from idloop.errors import InputError
from idloop.physics.units import ALIASES
from idloop.spelling import did_you_mean_or_known

_INCH, _POUND, _GRAVITY = 0.0254, 4.4482216152605, 9.80665  # exact by definition [m], [N], [m/s²]
_DEGREE, _TURN, _MINUTE = pi / 180.0, 2.0 * pi, 60.0

_ANGLES = {"rad": 1.0, "mrad": 1e-3, "deg": _DEGREE, "arcmin": _DEGREE / 60.0, "arcsec": _DEGREE / 3600.0, "rev": _TURN}
_LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": _INCH}
# Units of files by the unit of the topics, with the factor to it.
_QUANTITIES = {
    "rad": _ANGLES,
    "m": _LENGTHS,
    "rad/s": {f"{unit}/s": factor for unit, factor in _ANGLES.items()} | {"rpm": _TURN / _MINUTE},
    "m/s": {f"{unit}/s": factor for unit, factor in _LENGTHS.items()}
    | {"m/min": 1.0 / _MINUTE, "mm/min": 1e-3 / _MINUTE},
    "V": {"V": 1.0, "mV": 1e-3},
    "V/s": {"V/s": 1.0},
    "A": {"A": 1.0, "mA": 1e-3},
    "N·m": {
        "N·m": 1.0,
        "mN·m": 1e-3,
        "kN·m": 1e3,
        "lbf·in": _POUND * _INCH,
        "lbf·ft": _POUND * 12.0 * _INCH,
        "ozf·in": _POUND * _INCH / 16.0,
    },
    "N": {"N": 1.0, "mN": 1e-3, "kN": 1e3, "lbf": _POUND, "kip": 1e3 * _POUND},
    "°C": {"°C": 1.0},
    "-": {"-": 1.0, "%": 1e-2},
}
_BASE = {unit: (base, factor) for base, units in _QUANTITIES.items() for unit, factor in units.items()}
_ALIASES = ALIASES | {
    "°": "deg", "degree": "deg", "degrees": "deg", "°/s": "deg/s", "turn": "rev", "turns": "rev", "turn/s": "rev/s",
    "rev/min": "rpm", "1/min": "rpm", "µm": "um", "µm/s": "um/s", "mNm": "mN·m", "mN.m": "mN·m", "kNm": "kN·m",
    "degC": "°C", "℃": "°C",
}  # fmt: skip
# Units of time [s].
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
COUNTS = ("counts", "counts/s")  # steps of an encoder, of a size that the user has to say
_SECONDS = (
    "s sec secs second seconds sek sekunde sekunden seconde secondes secondo secondi seg segundo segundos sekunda"
    " sekundy sekund sn с сек секунда секунды секунд 秒"
)
# Words of units without accents, in small letters. Those of `_OF_RATES` mean it before a time only: U/min, r/s.
_WORDS: dict[str, str] = {
    "rad": "rad radian radians radiant radianti radianes radianos radiani radianten radianer radiany radiaali rads"
    " рад радиан радианы радиан弧度 弧度 ラジアン",
    "deg": "deg degs degree degrees dg ° º grad grade grado grados gradi graus grau degre degres graden graad grader"
    " stopien stopnie stopni stopnia stupen stupne stupnu stupnov derece aste astetta astetta fok град градус градусы"
    " градусов 度",
    "rev": "rev revs revolution revolutions rot rots rotation rotations turn turns tour tours tr trs giro giri vuelta"
    " vueltas volta voltas rpt umdrehung umdrehungen umdr umdr. omwenteling omwentelingen omw omdrejning omdrejninger"
    " omdr varv obrot obroty obrotow obr otacka otacky otacek ot ot. kierros kierrosta devir об оборот обороты"
    " оборотов 转 圈 回転",
    "m": "m meter meters metre metres metro metros metri metr metry metrow metra mtr м метр метры метров 米",
    "cm": "cm centimeter centimeters centimetre centimetres centimetro centimetros centimetri zentimeter см",
    "mm": "mm millimeter millimeters millimetre millimetres milimetro milimetros millimetro millimetri milimetr"
    " milimetry мм миллиметр миллиметры 毫米",
    "um": "um µm μm micron microns micrometer micrometers micrometre micrometres mikrometer micra мкм 微米",
    "in": "in inch inches pulgada pulgadas pouce pouces zoll pollici",
    "counts": "counts count cnt cts steps ticks tick pulse pulses puls impuls impulse impulses impulsy impulsos impulsi"
    " impulsions inc incs increment increments inkrement inkremente incrementos incrementi lsb qc имп импульсы 脉冲",
    "V": "v volt volts volte voltio voltios в вольт вольты 伏 伏特",
    "A": "a arms apk amp amps ampere amperes amper ampery amperio amperios а ампер амперы 安 安培",
    "N": "newton newtons newtonow newtonit ньютон н",
    "N·m": "nm n·m n-m n*m n.m newtonmeter newtonmetre нм н·м",
    "°C": "celsius degc",
    "s": _SECONDS,
    "ms": "ms msec millis millisec millisecond milliseconds millisekunde millisekunden milliseconde millisecondes"
    " milisegundo milisegundos millisecondi milisekundy мс 毫秒",
    "us": "us usec µs μs micros microsec microsecond microseconds mikrosekunde mikrosekunden microsegundos мкс 微秒",
    "ns": "ns nsec nanos nanosec nanosecond nanoseconds nanosekunden нс 纳秒",
    "%": "% percent pct prozent procent pourcent porcentaje percentuale prosent процент",
    "-": "rated nominal p.u. pu fullscale fs",
    "rad/s": "radps",
    "deg/s": "degps dps",
    "rev/s": "rps",
    "m/s": "mps",
    "rpm": "rpm r.p.m. umin upm min-1 min⁻¹ min^-1",
    "mV": "mv millivolt millivolts",
    "mA": "ma milliamp milliamps",
    "mN·m": "mnm",
    "lbf": "lbs lb",
    "lbf·in": "in-lb lb-in",
    "lbf·ft": "ft-lb",
    "ozf·in": "oz-in ozin",
}
_TIMES = {
    "s": _SECONDS,
    "min": "min min. mn minute minutes minuten minuto minutos minuti minuut minuta minuty minut dk dak мин минута 分",
}
_OF_RATES = {"u": "rev", "g": "rev", "d": "rev", "r": "rev", "1": "rev"}
_ONLY_PER_MINUTE = {"g", "d", "1"}
_UNITS = {word: unit for unit, words in _WORDS.items() for word in words.split()} | {"newton meter": "N·m"}
_SPANS = {word: unit for unit, words in _TIMES.items() for word in words.split()}
_RATES = {f"{unit}/s": f"{unit}/s" for unit in ("rad", "deg", "rev", "m", "cm", "mm", "um", "in", "counts")}
_RATES |= {"rev/min": "rpm", "m/min": "m/min", "mm/min": "mm/min"}
_RATE = re.compile(r"(.+?)\s*(?:/|(?<![a-z])(?:per|pro|par|por|al)(?![a-z])|per(?=[a-z]))\s*(.+)")
_INVERSE = re.compile(r"\s*[·*.]?\s*(s|sec|min)\s*\^?\s*(?:-1|⁻¹|\(-1\))$")
_FRACTION = re.compile(
    r"(?P<part>.*?)\s*(?:(?:of|von|de|di)\s+)?(?:the\s+)?"
    r"(?:rated|nominal|nenn\w*|nom\.?|full[ -]?scale|per[ -]unit)(?:\s+(?:torque|current|speed|force|moment|value))?"
)
_MULTIPLE = re.compile(
    r"(?P<number>1\s*/\s*\d+|10\s*\^\s*-?\d+|\d+(?:[.,]\d+)?(?:e[-+]?\d+)?)\s*[x×*·]?\s*(?P<unit>[^\d\s].*)",
    re.IGNORECASE,
)
_PREFIXES = {"m": 1e-3, "c": 1e-2, "µ": 1e-6, "μ": 1e-6, "u": 1e-6, "k": 1e3}
# Forces and torques without the signs between their parts: N·cm, kgf.cm, g cm
_PRODUCTS = {
    "ncm": (1e-2, "N·m"), "nmm": (1e-3, "N·m"), "kgfm": (_GRAVITY, "N·m"),
    "kgfcm": (1e-2 * _GRAVITY, "N·m"), "kgcm": (1e-2 * _GRAVITY, "N·m"),
    "gcm": (1e-5 * _GRAVITY, "N·m"), "gfcm": (1e-5 * _GRAVITY, "N·m"),
    "kgf": (_GRAVITY, "N"), "gf": (1e-3 * _GRAVITY, "N"),
}  # fmt: skip
_BETWEEN = re.compile(r"(?<=\w)[·.*\- ](?=\w)")
# The key under which a unit stands.
_KEYS = {
    "unit", "units", "unite", "unites", "unidad", "unidades", "unidade", "einheit", "einheiten", "unita", "eenheid",
    "enhet", "jednostka", "jednotka", "birim", "uom", "единица", "单位",
}  # fmt: skip
# What a prefix stands before: symbols, not words.
_PREFIXED = {
    "rad", "deg", "°", "V", "A", "N", "Nm", "N·m", "N.m", "N*m", "rad/s", "deg/s", "°/s", "dps", "rev", "rev/s", "rpm",
}  # fmt: skip
# What each field of JointState may be in. A sensor that is read in volts stays in volts.
_FIELDS = {
    "position": ("rad", "m", "V", "-"),
    "velocity": ("rad/s", "m/s", "V/s", "V", "-"),
    "condition": ("°C", "V", "A", "N·m", "N", "-"),
    "effort": ("V", "A", "N·m", "N", "rad", "m", "rad/s", "m/s", "-"),
}
TIME_WORDS = frozenset({
    "t", "time", "times", "timestamp", "timestamps", "stamp", "stamps", "timevec", "tout", "zeit", "clock", "elapsed",
    "elapsedtime", "sec", "seconds", "millis", "micros", "millisec", "microsec", "timeseconds", "datetime",
    "tiempo", "tempo", "tijd",
})  # fmt: skip
# What may stand before a time: which clock, or since when.
_WHICH = re.compile(
    r"(?:elapsed|relative|absolute|receive|received|log|recorded|sample|local|utc|unix|system)[\s_]+(?=time)"
)
_BEHIND = re.compile(r"^(.*?)[\s_.\-]*[\[(<]?([a-zµμ]+)[\])>]?$")


def known_unit(text: str) -> str:
    """Return the unit that a log writes as ``RPM``, ``rad/sec`` or ``giri/min``, as a mapping file writes it, or empty.

    Steps of an encoder are ``counts`` and ``counts/s``; times are ``s``, ``ms``, ``us``, ``ns``.
    """
    text = " ".join(text.split())
    if not text or text in _BASE or text in SECONDS:
        return text
    return _ALIASES.get(text, "") or _unit_by_words(text)


def read_unit(text: str) -> tuple[str, float]:
    """Return a unit and the number of it that a log counts in, also of ``0.01 A`` and ``mdeg``; empty for no unit."""
    if unit := known_unit(text):
        return unit, 1.0
    factor, rest = _multiple(text)
    unit = known_unit(rest) if factor != 1.0 else ""
    return (unit, factor) if unit and unit not in SECONDS else ("", 1.0)


def is_unit_of(unit: str, field: str) -> bool:
    """Whether a unit of a file may be that of a field, as `base_unit` takes both."""
    return base_of(unit) in _FIELDS[field]


def base_of(unit: str) -> str:
    """Return the unit of the topics that a unit of a file becomes; of one that becomes none, the unit itself."""
    return _BASE.get(_ALIASES.get(unit, unit), (unit, 1.0))[0]


def base_unit(unit: str, field: str, where: str) -> tuple[str, float]:
    """Unit in which a topic carries a signal, and what its values are multiplied by; empty where no unit is given.

    `field`: "position", "velocity", "effort" (a command as well) or "condition".
    `where`: place for the message.
    Raises InputError: unknown unit, or a unit of another quantity.
    """
    if not unit:
        return "", 1.0
    short = _ALIASES.get(unit, unit)
    fitting = [name for name, (base, _) in _BASE.items() if base in _FIELDS[field]]
    if short not in _BASE:
        raise InputError(
            f"{where}: unknown unit {unit!r}{did_you_mean_or_known(unit, fitting)}; for another unit give `scale:`"
        )
    if short not in fitting:
        raise InputError(f"{where}: {unit} is not a unit of a {field}; known are {', '.join(fitting)}")
    return _BASE[short]


def _unit_by_words(text: str) -> str:
    """The unit that ``degrees``, ``giri/min``, ``DegPerSec`` or ``% of rated torque`` mean; empty for other words."""
    plain = _without_accents(" ".join(text.split()).lower())
    # A Latin letter is a unit in its own case only.
    if plain in _UNITS and (len(plain) > 1 or not plain.isascii()):
        return _UNITS[plain]
    if (part := _FRACTION.fullmatch(plain)) is not None:
        return {"": "-", "%": "%", "percent": "%"}.get(part["part"], "")
    rate = _RATE.fullmatch(_INVERSE.sub(r"/\1", plain))
    if rate is None or rate[2] not in _SPANS:
        return ""
    span, what = _SPANS[rate[2]], rate[1].rstrip(". ")
    unit = _UNITS.get(what, "")
    if not unit and (span == "min" or what not in _ONLY_PER_MINUTE):
        unit = _OF_RATES.get(what, "")
    return _RATES.get(f"{unit}/{span}", "")


def is_unit_key(name: str) -> bool:
    """Whether a key, in some language, is that of a unit."""
    return _without_accents(name.strip().rstrip(":").lower()) in _KEYS


def _multiple(text: str) -> tuple[float, str]:
    """The number and the unit of ``0.01 A``, ``1/1000 rated`` or ``mdeg``; 1 and the text where it is no multiple."""
    text = " ".join(text.replace("‰", "0.1 %").split())
    if match := _MULTIPLE.fullmatch(text):
        number = match["number"].replace(",", ".").replace(" ", "")
        if "/" in number:
            over = float(number.partition("/")[2])
            return (1.0 / over, match["unit"]) if over else (1.0, text)
        base, hat, exponent = number.partition("^")
        return float(base) ** float(exponent) if hat else float(number), match["unit"]
    if text[:1] in _PREFIXES and text[1:] in _PREFIXED:
        return _PREFIXES[text[:1]], text[1:]
    return _PRODUCTS.get(_BETWEEN.sub("", text).lower(), (1.0, text))


def _without_accents(text: str) -> str:
    """A text with plain letters for those with accents; of other alphabets as it is."""
    found = normalize("NFD", text.replace("ł", "l").replace("ø", "o"))
    return normalize("NFC", "".join(one for one in found if not "\u0300" <= one <= "\u036f" or one == "\u0306"))


def clock_unit(name: str) -> str | None:
    """Return the unit of stamps such as ``t`` or ``time [ms]``, empty without one; None for other columns."""
    text = _WHICH.sub("", name.strip().strip("_").lower(), count=1)
    if text in TIME_WORDS:
        # A name such as `millis` is a unit itself.
        return "s" if text == "timeseconds" else known_clock_unit(text)
    match = _BEHIND.match(text)
    if match and match[1].strip() in TIME_WORDS and text[len(match[1])] in " _.-[(<":
        return known_clock_unit(match[2]) or None
    return None


def known_clock_unit(text: str) -> Any:
    """Return a unit of stamps as a mapping file writes it; empty for another unit."""
    unit = known_unit(text.strip().strip("[]()<>").lower())
    return unit if unit in SECONDS else ""
