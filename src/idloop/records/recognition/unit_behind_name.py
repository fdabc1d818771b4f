"""Whether the last letters of a name are a unit: ``x_m`` is in metres, ``theta_m`` is an angle of the motor."""

from __future__ import annotations

from collections.abc import Container, Iterable

from idloop.records.tables.base_units import base_of, read_unit

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


def is_in_volts(words: Iterable[str], wanted: Container[str]) -> bool:
    """Whether a small v behind words in small letters is the unit of a voltage; `wanted` are those of a set-point."""
    rest = set(words)
    return bool(rest & _IN_VOLTS) or (bool(rest & _MOTORS) and any(word in wanted for word in rest))


def is_unit_behind(suffix: str, words: Iterable[str]) -> bool:
    """Whether a unit behind a name is one: a single letter, and ``in``, mean motor, measured, phase and input as well.

    `suffix`: as known units are written: ``m``, ``A``, ``rad/s``.
    `words`: the rest of the name, in small letters.
    """
    if suffix != _WAY_IN and (len(suffix) > 1 or not suffix.isalpha()):
        return True
    rest = set(words)
    said = [units for some, units in _UNITS_OF_WORDS if some & rest]
    return any(base_of(suffix) in units for units in said) if said else suffix != _WAY_IN


def unit_within(word: str) -> tuple[str, str]:
    """Return the name and the unit that a word has one behind the other: ``yrad``, ``wrads`` in rad/s.

    Returns: an empty unit where the word has none: the symbol of one, of two letters at least, that fits the name.
    """
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
