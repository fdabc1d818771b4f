"""Units of foreign files, and the units of the topics."""

from __future__ import annotations

from math import pi

from idloop.errors import InputError
from idloop.physics.units import ALIASES
from idloop.records.tables.unit_words import multiple, unit_by_words
from idloop.spelling import did_you_mean_or_known

_MINUTE = 60.0
_INCH, _POUND = 0.0254, 4.4482216152605  # exact by definition [m], [N]
_MILLI, _MICRO, _KILO = 1e-3, 1e-6, 1e3

# Unit of a file: the topics' unit and the factor to it.
_BASE: dict[str, tuple[str, float]] = {
    "rad": ("rad", 1.0),
    "mrad": ("rad", _MILLI),
    "deg": ("rad", pi / 180.0),
    "arcmin": ("rad", pi / 180.0 / 60.0),
    "arcsec": ("rad", pi / 180.0 / 3600.0),
    "rev": ("rad", 2.0 * pi),
    "m": ("m", 1.0),
    "cm": ("m", 1e-2),
    "mm": ("m", _MILLI),
    "um": ("m", _MICRO),
    "rad/s": ("rad/s", 1.0),
    "mrad/s": ("rad/s", _MILLI),
    "deg/s": ("rad/s", pi / 180.0),
    "rev/s": ("rad/s", 2.0 * pi),
    "rpm": ("rad/s", 2.0 * pi / _MINUTE),
    "m/s": ("m/s", 1.0),
    "cm/s": ("m/s", 1e-2),
    "mm/s": ("m/s", _MILLI),
    "um/s": ("m/s", _MICRO),
    "m/min": ("m/s", 1.0 / _MINUTE),
    "mm/min": ("m/s", _MILLI / _MINUTE),
    "V": ("V", 1.0),
    "mV": ("V", _MILLI),
    "V/s": ("V/s", 1.0),
    "A": ("A", 1.0),
    "mA": ("A", _MILLI),
    "N·m": ("N·m", 1.0),
    "mN·m": ("N·m", _MILLI),
    "kN·m": ("N·m", _KILO),
    "N": ("N", 1.0),
    "mN": ("N", _MILLI),
    "kN": ("N", _KILO),
    "in": ("m", _INCH),
    "in/s": ("m/s", _INCH),
    "lbf": ("N", _POUND),
    "kip": ("N", 1e3 * _POUND),
    "lbf·in": ("N·m", _POUND * _INCH),
    "lbf·ft": ("N·m", _POUND * 12.0 * _INCH),
    "ozf·in": ("N·m", _POUND * _INCH / 16.0),
    "°C": ("°C", 1.0),
    "-": ("-", 1.0),
    "%": ("-", 1e-2),
}
_ALIASES = ALIASES | {
    "°": "deg", "degree": "deg", "degrees": "deg", "°/s": "deg/s", "turn": "rev", "turns": "rev", "turn/s": "rev/s",
    "rev/min": "rpm", "1/min": "rpm", "µm": "um", "µm/s": "um/s", "mNm": "mN·m", "mN.m": "mN·m", "kNm": "kN·m",
    "degC": "°C", "℃": "°C",
}  # fmt: skip
# Further abbreviations that logs use, in small letters.
_SPELLINGS = {
    "radps": "rad/s", "degps": "deg/s", "dps": "deg/s", "rps": "rev/s", "mps": "m/s", "rpm": "rpm", "r.p.m.": "rpm",
    "umin": "rpm", "upm": "rpm", "min-1": "rpm", "min⁻¹": "rpm", "min^-1": "rpm", "mv": "mV", "millivolt": "mV",
    "millivolts": "mV", "ma": "mA", "milliamp": "mA", "milliamps": "mA", "newton meter": "N·m", "mnm": "mN·m",
    "lbs": "lbf", "lb": "lbf", "in-lb": "lbf·in", "lb-in": "lbf·in", "ft-lb": "lbf·ft", "oz-in": "ozf·in",
    "ozin": "ozf·in",
}  # fmt: skip
# Units of time [s].
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


COUNTS = ("counts", "counts/s")  # steps of an encoder, of a size that the user has to say


def known_unit(text: str) -> str:
    """Return the unit that a log writes in some spelling, as a mapping file writes it; empty where it is none.

    `text`: ``RPM``, ``rad/sec``, ``giri/min``. Steps of an encoder are ``counts`` and ``counts/s``; times are ``s``,
    ``ms``, ``us``, ``ns``.
    """
    text = " ".join(text.split())
    if text in _BASE or text in SECONDS:
        return text
    if not text:
        return ""
    return _ALIASES.get(text, "") or _SPELLINGS.get(text.lower(), "") or unit_by_words(text)


def read_unit(text: str) -> tuple[str, float]:
    """Return a unit and the number of it that a log counts in; an empty unit where it is none.

    `text`: as `known_unit` takes it, or a multiple: ``0.01 A``, ``1/1000 rated``, ``mdeg``.
    """
    if unit := known_unit(text):
        return unit, 1.0
    factor, rest = multiple(text)
    unit = known_unit(rest) if factor != 1.0 else ""
    return (unit, factor) if unit and unit not in SECONDS else ("", 1.0)


# What each field of JointState may be in. A sensor that is read in volts stays in volts.
_FIELDS = {
    "position": ("rad", "m", "V", "-"),
    "velocity": ("rad/s", "m/s", "V/s", "V", "-"),
    "condition": ("°C", "V", "A", "N·m", "N", "-"),
    "effort": ("V", "A", "N·m", "N", "rad", "m", "rad/s", "m/s", "-"),
}


def is_unit_of(unit: str, field: str) -> bool:
    """Whether a unit of a file may be that of a field, as `base_unit` takes both."""
    return base_of(unit) in _FIELDS[field]


def base_of(unit: str) -> str:
    """Return the unit of the topics that a unit of a file becomes; of one that becomes none, the unit itself."""
    return _BASE.get(_ALIASES.get(unit, unit), (unit, 1.0))[0]


def base_unit(unit: str, field: str, where: str) -> tuple[str, float]:
    """Unit in which a topic carries a signal, and what its values are multiplied by.

    `unit`: unit of the file; empty where not given, and then the result is empty.
    `field`: one of "position", "velocity", "effort", "condition". Field of sensor_msgs/JointState; a command is an
    effort, a condition was measured beside the axis.
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
