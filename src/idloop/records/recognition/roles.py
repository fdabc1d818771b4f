"""Which role a column plays, by the words and the unit of its name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from idloop.records.recognition.column_name import ColumnName
from idloop.records.tables.base_units import TIME_UNITS

Role = Literal[
    "time", "command", "position", "velocity", "effort", "reference", "reference velocity", "temperature", "supply", ""
]

_TIME = {
    "time",
    "timestamp",
    "stamp",
    "t",
    "zeit",
    "clock",
    "elapsed",
    "millis",
    "micros",
    "seconds",
    "sec",
    "datetime",
}
_WANTED = {
    "ref", "reference", "target", "goal", "setpoint", "desired", "des", "soll", "sollwert", "sp", "demand", "demanded",
    "command", "commands", "commanded", "cmd", "planned", "desire", "setp", "request", "requested",
}  # fmt: skip
_MEASURED = {
    "actual", "act", "meas", "measured", "measurement", "feedback", "fb", "ist", "istwert", "est", "estimate",
    "estimated", "present", "sensor", "filtered", "filt",
}  # fmt: skip
_FORCES = {
    "u", "voltage", "volt", "volts", "pwm", "duty", "dutycycle", "throttle", "effort", "efforts", "torque", "tau",
    "force",
    "current", "i", "iq", "spannung", "strom", "moment", "drehmoment", "kraft", "stellgroesse", "stellgröße", "input",
    "output", "out", "pid", "tension", "corriente", "courant", "corrente", "couple",
    "drive", "load", "motorpwm", "esc", "power", "signal", "servo", "pulse", "pulsewidth",
}  # fmt: skip
_POSITIONS = {
    "position", "positions", "pos", "angle", "theta", "q", "phi", "enc", "encoder", "count", "counts", "ticks", "tick",
    "inc", "winkel", "lage", "weg", "posicion", "posizione", "angulo", "angolo", "x", "y", "alpha",
    "beta", "rot", "rotation", "rotations", "deg", "degrees", "rad", "turns", "displacement", "distance", "stroke",
    "pose", "z",
}  # fmt: skip
_VELOCITIES = {
    "velocity", "velocities", "vel", "speed", "omega", "w", "qd", "dq", "rpm", "rps", "drehzahl", "geschwindigkeit",
    "qdot", "velocidad", "vitesse", "velocita", "thetadot", "dtheta", "angvel", "v", "n", "tacho", "tachometer",
}  # fmt: skip
_RATES = {"dot", "rate", "derivative"}
# Names that are no signal of an axis whatever else they say, and those that are none by themselves.
_NEVER = {"acc", "accel", "acceleration", "accelerations", "qdd", "ddq", "error", "errors", "err"}
_OTHER = {
    "id", "state", "status", "flag", "mode", "seq",
    "crc", "checksum", "moving", "fault", "frame", "procedure", "result", "index", "sample", "samples", "done", "step",
    "bus",
}  # fmt: skip
_TEMPERATURES = {"temp", "temperature", "temperatur"}
_SUPPLIES = {"vbus", "supply", "battery", "vbat", "vcc", "udc", "vdc"}

_ANGLES = {"rad", "mrad", "deg", "arcmin", "arcsec", "rev", "m", "cm", "mm", "um", "in", "counts"}
_SPEEDS = {
    "rad/s", "mrad/s", "deg/s", "rev/s", "rpm", "m/s", "cm/s", "mm/s", "um/s", "m/min", "mm/min", "in/s"
}  # fmt: skip
_COMMANDS = {
    "V",
    "mV",
    "A",
    "mA",
    "N·m",
    "mN·m",
    "kN·m",
    "N",
    "mN",
    "kN",
    "%",
    "kip",
    "lbf",
    "lbf·in",
    "lbf·ft",
    "ozf·in",
}
# Which of several columns is the command: what says so, then what acts first in the chain from command to force.
_ORDER = (
    {"u", "input", "cmd", "command", "commands", "stellgroesse", "stellgröße"},
    {"voltage", "volt", "volts", "spannung", "v", "pwm", "duty", "dutycycle", "throttle", "motorpwm", "esc"},
    {"torque", "tau", "force", "effort", "efforts", "moment", "drehmoment", "kraft"},
    {"current", "i", "iq", "strom"},
)


BY_UNIT = "by its unit"


@dataclass(frozen=True)
class RoleByName:
    """What a name says.

    Attributes
    ----------
    role : Role
        Empty where the name says nothing.
    rank : float
        The larger, the surer; among columns of one role the largest is taken.
    reason : str
    """

    role: Role
    rank: float
    reason: str


def role_by_name(name: ColumnName) -> RoleByName:
    """Return the role that words and unit of a name stand for."""
    words, unit = set(name.words), name.unit
    wanted, measured = words & _WANTED, words & _MEASURED
    if words & _TEMPERATURES or unit == "°C":
        return RoleByName("temperature", 1.0, "by its name")
    if words & _SUPPLIES or {"bus", "voltage"} <= words or {"input", "volts"} <= words:
        return RoleByName("supply", 1.0, "by its name")
    if words & _TIME or (unit in TIME_UNITS and not words & _FORCES):
        return RoleByName("time", 1.0 + (len(words) == 1) + bool(words & _TIME), _because(words & _TIME, unit))
    kind = _kind(name, words, unit)
    if (words & _NEVER and not unit) or (words & _OTHER and not kind):
        return RoleByName("", 0.0, "")
    if kind == "force":
        order = next((k for k, some in enumerate(_ORDER) if words & some), len(_ORDER) - 1)
        if measured and not wanted:
            return RoleByName("effort", 1.0 + (len(_ORDER) - order) / 10, _because(measured, unit))
        rank = 2.0 + (len(_ORDER) - order) / 10 + 2.0 * bool(wanted)
        return RoleByName("command", rank, _because(wanted | words & _FORCES, unit))
    if kind == "position":
        role: Role = "reference" if wanted else "position"
        return RoleByName(role, 2.0 + bool(measured) + bool(unit), _because(wanted | words & _POSITIONS, unit))
    if kind == "velocity":
        role = "reference velocity" if wanted else "velocity"
        return RoleByName(role, 2.0 + bool(measured) + bool(unit), _because(wanted | words & _VELOCITIES, unit))
    if words & {"cmd", "command", "commands", "commanded"}:
        return RoleByName("command", 3.0, _because(wanted, unit))
    if wanted:
        return RoleByName("reference", 1.0, _because(wanted, unit))
    return RoleByName("", 0.0, "")


def _kind(name: ColumnName, words: set[str], unit: str) -> str:
    """Quantity by unit, then by words; of V and v, N and n the case decides."""
    if unit in _COMMANDS:
        return "force"
    if unit in _SPEEDS:
        return "velocity"
    if unit in _ANGLES:
        return "velocity" if words & (_VELOCITIES - {"w", "v", "n"}) else "position"
    if name.letter in ("V", "U", "I", "F", "T"):
        return "force"
    if words & _RATES and words & _POSITIONS:
        return "velocity"
    for kind, known in (("velocity", _VELOCITIES), ("position", _POSITIONS), ("force", _FORCES)):
        if words & known:
            return kind
    return ""


def _because(words: set[str], unit: str) -> str:
    said = " ".join(sorted(words))
    by = f"by its name ({said})" if said else "by its name"
    return f"{by} and its unit" if unit and said else BY_UNIT if unit else by
