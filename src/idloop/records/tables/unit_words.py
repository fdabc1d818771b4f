"""Words of units in the languages in which logs are written, and multiples of a unit."""

from __future__ import annotations

import re
from unicodedata import normalize

_SECONDS = (
    "s sec secs second seconds sek sekunde sekunden seconde secondes secondo secondi seg segundo segundos sekunda"
    " sekundy sekund sn с сек секунда секунды секунд 秒"
)
# Without accents, in small letters. Of a unit in `_OF_RATES` the word means it before a time only: U/min, g/min, r/s.
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
}
_TIMES = {
    "s": _SECONDS,
    "min": "min min. mn minute minutes minuten minuto minutos minuti minuut minuta minuty minut dk dak мин минута 分",
}
_OF_RATES = {"u": "rev", "g": "rev", "d": "rev", "r": "rev", "1": "rev"}
_ONLY_PER_MINUTE = {"g", "d", "1"}
_UNITS = {word: unit for unit, words in _WORDS.items() for word in words.split()}
_SPANS = {word: unit for unit, words in _TIMES.items() for word in words.split()}
_RATES = {"rev/min": "rpm"} | {
    f"{unit}/s": f"{unit}/s" for unit in ("rad", "deg", "rev", "m", "cm", "mm", "um", "in", "counts")
} | {"m/min": "m/min", "mm/min": "mm/min"}  # fmt: skip
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
_STANDARD_GRAVITY = 9.80665  # [m/s²]
# Forces and torques without the signs between their parts: N·cm, kgf.cm, g cm
_PRODUCTS = {
    "ncm": (1e-2, "N·m"), "nmm": (1e-3, "N·m"), "kgfm": (_STANDARD_GRAVITY, "N·m"),
    "kgfcm": (1e-2 * _STANDARD_GRAVITY, "N·m"), "kgcm": (1e-2 * _STANDARD_GRAVITY, "N·m"),
    "gcm": (1e-5 * _STANDARD_GRAVITY, "N·m"), "gfcm": (1e-5 * _STANDARD_GRAVITY, "N·m"),
    "kgf": (_STANDARD_GRAVITY, "N"), "gf": (1e-3 * _STANDARD_GRAVITY, "N"),
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


def unit_by_words(text: str) -> str:
    """Return the unit that words of some language mean; empty where they mean none.

    `text`: ``degrees``, ``giri/min``, ``DegPerSec``, ``mm·s⁻¹``, ``% of rated torque``.
    """
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


def multiple(text: str) -> tuple[float, str]:
    """Return the number and the unit of a multiple of a unit; 1 and the text itself where it is none.

    `text`: ``0.01 A``, ``1/1000 rated``, ``0.1%``, ``‰``, ``mdeg``, ``mdps``.
    """
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
