"""Which role a column plays, by the words and the unit of its name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from idloop.records.recognition.column_name import (
    FEED_FORWARD,
    FLAGS,
    MEASURED,
    WANTED,
    ColumnName,
    is_counter,
    parse_column_name,
)
from idloop.records.tables.base_units import SECONDS, TIME_WORDS, base_of

Signal = Literal[
    "time", "command", "position", "velocity", "effort", "reference", "reference velocity", "temperature", "supply"
]
# ... or the name says that it is none of them, or nothing.
Role = Signal | Literal["other", ""]

_FORCES = {
    "u", "voltage", "volt", "volts", "pwm", "duty", "dutycycle", "throttle", "effort", "efforts", "torque", "tau",
    "force", "current", "i", "iq", "uq", "vq", "vin", "spannung", "strom", "moment", "drehmoment", "kraft",
    "stellgroesse", "stellgröße", "input", "inp", "output", "out", "pid", "tension", "corriente", "courant", "corrente",
    "couple", "drive", "load", "esc", "power", "signal", "servo", "pulse", "pulsewidth", "dac", "trq", "cur", "curr",
    "amps", "joystick",
}  # fmt: skip
_POSITIONS = {
    "position", "positions", "pos", "angle", "theta", "q", "phi", "enc", "encoder", "count", "counts", "ticks", "tick",
    "inc", "winkel", "lage", "weg", "posicion", "posizione", "angulo", "angolo", "x", "y", "alpha",
    "beta", "rot", "rotation", "rotations", "deg", "degrees", "rad", "turns", "displacement", "distance", "stroke",
    "pose", "z", "yaw", "pitch", "roll",
}  # fmt: skip
_VELOCITIES = {
    "velocity", "velocities", "vel", "speed", "omega", "w", "qd", "dq", "rpm", "rps", "drehzahl", "geschwindigkeit",
    "qdot", "velocidad", "vitesse", "velocita", "thetadot", "dtheta", "angvel", "v", "n", "tacho", "tachometer",
}  # fmt: skip
_RATES = {"dot", "rate", "derivative"}
# Names that are no signal of an axis whatever else they say, without a unit, and by themselves.
_NEVER = {
    "error", "errors", "err", "deviation", "lag", "residual", "fehler", "abweichung", "regelabweichung",
    "schleppfehler", "schleppabstand", "pe", "droop", "diff", "difference", "differenz", "erreur", "errore",
    "enable", "enabled", "kp", "ki", "kd",
}  # fmt: skip
_WITHOUT_UNIT = {"acc", "accel", "acceleration", "accelerations", "qdd", "ddq"}
_OTHER = FLAGS | {
    "seq",
    "crc", "checksum", "moving", "frame", "procedure", "result", "sample", "samples", "done", "step", "bus",
}  # fmt: skip
_NUMBERS = {
    "index",
    "idx",
    "episode",
    "trial",
}  # of a row, or of a run, through which it is constant as a command may be
_TEMPERATURES = {"temp", "temperature", "temperatur"}
_SUPPLIES = {"vbus", "supply", "battery", "vbat", "vcc", "udc", "vdc", "versorgung", "akku"}
_VOLTAGES = {"voltage", "volt", "volts", "vin", "spannung"}
# Words of a voltage that is the supply where it hardly varies, and the command otherwise.
_FED = {"input", "vin"}
# Of a synchronous motor the current across its field (q) makes the torque, that along it (d) does not.
_ALONG_FIELD = {"id", "ud", "vd"}
_FIELD_AXES = {"i": "i", "current": "i", "u": "u", "voltage": "u", "v": "v"}
FIELD_WORDS = _FIELD_AXES.keys() | _ALONG_FIELD
# Names of a plant's signals, and of a controller's, by which the other one is meant.
IN_OR_OUT = (("input",), ("output",))

# Units, as the topics have them, of a place, a speed and a force.
_PLACES, _SPEEDS, _COMMANDS = {"rad", "m", "counts"}, {"rad/s", "m/s", "counts/s"}, {"V", "A", "N·m", "N"}
CURRENTS = {"current", "i", "iq", "strom", "corriente", "courant", "corrente", "cur", "curr", "amps"}
TORQUES = {"torque", "tau", "effort", "efforts", "moment", "drehmoment", "trq"}
_FORCE_NAMES = TORQUES | {"force", "kraft"}
# A sensor beside the drive, which feels what acts from outside as well.
_FORCE_SENSORS = ({"wrench"}, {"load", "cell"}, {"loadcell"}, {"dynamometer"})
# A part of a force, or the whole of it, by a model.
_COMPUTED = {
    "rigid", "model", "modelled", "modeled", "predicted", "prediction", "pred", "simulated", "sim", "theoretical",
    "friction", "gravity", "coriolis", "centrifugal",
}  # fmt: skip
# Words of a sensor at the motor, and of one at what it drives.
AT_MOTOR = {"motor", "rotor", "drive"}
AT_LOAD = {"load", "link", "arm", "output", "joint", "stage", "abtrieb"}
_COORDINATES = {"q", "x", "y", "z", "theta", "phi", "alpha", "beta"}
# The hand of an arm, whose place is that of no joint.
_HAND = {"ee", "eef", "tcp", "endeffector", "cartesian"}
# What shows a motion as a voltage.
_MOTION_SENSORS = {"enc", "encoder", "pot", "poti", "potentiometer", "tacho", "tachometer", "lvdt"}
_INPUTS = {"u", "input", "inp"}
# A channel for what is on or off, such as the flag INP (in position) of a drive: a command only where nothing else is.
_SWITCHES = {"digital"}
# Which of several columns is the command: what says so, then what acts first in the chain from command to force.
_ORDER = (
    {*_INPUTS, "cmd", "command", "commands", "stellgroesse", "stellgröße"},
    {*_VOLTAGES, "v", "uq", "vq", "pwm", "duty", "dutycycle", "throttle", "joystick", "esc", "dac"},
    _FORCE_NAMES,
    CURRENTS,
)


BY_UNIT = "by its unit"


@dataclass(frozen=True)
class RoleByName:
    """What a name says."""

    role: Role  # empty where the name says nothing
    rank: float = 0.0  # the larger, the surer; among columns of one role the largest is taken
    reason: str = ""


def role_by_name(name: ColumnName) -> RoleByName:
    """Return the role that words and unit of a name stand for."""
    words, unit = _axes_joined(set(name.words)), name.unit
    wanted, measured = words & WANTED, words & MEASURED
    if is_counter(name) and not words & TIME_WORDS:
        return RoleByName("other")
    if words & _TEMPERATURES or unit == "°C":
        return RoleByName("temperature", 1.0, "by its name")
    voltage = unit in ("V", "mV") or bool(words & _VOLTAGES)
    if words & _SUPPLIES or (voltage and "bus" in words):
        return RoleByName("supply", 1.0, "by its name")
    # A T in newton metres is a torque.
    if (words & TIME_WORDS and not _is_force(unit)) or (unit in SECONDS and not words & _FORCES):
        by_word = words & TIME_WORDS
        return RoleByName("time", 1.0 + (len(words) == 1) + bool(by_word), _because(by_word, unit))
    if is_sensor_in_volts(name):
        return RoleByName("other")
    kind = _kind(name, words, unit)
    along = words & _ALONG_FIELD or ("d" in words and unit in ("A", "mA", "V", "mV"))
    none = words & _NEVER or (along and not words & (_POSITIONS | _VELOCITIES))
    if none or (words & _WITHOUT_UNIT and not unit):
        return RoleByName("other")
    if words == {"observation", "state"} and not unit:
        return RoleByName("position", 1.0, _because(words, unit))
    if words & _NUMBERS and not kind:
        return RoleByName("other")
    if words & _OTHER and not kind:
        return RoleByName("")
    # In data sets for learning an action is the next set-point.
    if words in ({"r"}, {"action"}, {"actions"}) and not unit:
        return RoleByName("reference", 1.0, _because(words, unit))
    if kind == "force":
        # The current that a drive draws from its supply acts after that of the motor.
        drawn = "input" in words and bool(unit in ("A", "mA") or words & CURRENTS)
        acts = words - {"input"} - CURRENTS if drawn else words
        order = next((k for k, some in enumerate(_ORDER) if acts & some), len(_ORDER) - (not drawn))
        if words & _SWITCHES:
            return RoleByName("command", 0.5, _because(words & _FORCES, unit))
        if not wanted and (sensor := is_force_sensor(name)):
            return RoleByName("effort", 0.5, _because(sensor, unit))
        if measured and not wanted:
            return RoleByName("effort", 1.0 + (len(_ORDER) - order) / 10, _because(measured | words & _FORCES, unit))
        wanted = wanted | words & FEED_FORWARD
        rank = 2.0 + (len(_ORDER) - order) / 10 + 2.0 * bool(wanted)
        return RoleByName("command", rank, _because(wanted | words & _FORCES, unit))
    if kind == "position":
        role: Role = "reference" if wanted else "position"
        said = words & _POSITIONS
        # A letter may be any coordinate, or a state of a model.
        rank = 2.0 + bool(measured) + bool(unit) - 0.5 * bool(said and said <= _COORDINATES)
        return RoleByName(role, rank, _because(wanted | said, unit))
    if kind == "velocity":
        role = "reference velocity" if wanted else "velocity"
        return RoleByName(role, 2.0 + bool(measured) + bool(unit), _because(wanted | words & _VELOCITIES, unit))
    if words & {"cmd", "command", "commands", "commanded"}:
        return RoleByName("command", 3.0, _because(wanted, unit))
    if wanted:
        return RoleByName("reference", 1.0, _because(wanted, unit))
    return RoleByName("")


def is_named_as_signal(name: str) -> bool:
    """Whether the name of a column is that of a signal."""
    return role_by_name(parse_column_name(name)).role not in ("", "other")


def may_be_supply(name: ColumnName) -> bool:
    """Whether a voltage is the supply where it hardly varies, by its name: ``input_volts``."""
    words = set(name.words)
    return bool(words & _FED) and (name.unit in ("V", "mV") or bool(words & _VOLTAGES))


def may_be_measured(name: ColumnName) -> bool:
    """Whether a current is named and no command: ``motor_current``; that of a drive is measured as often as not."""
    words = set(name.words)
    current = name.unit in ("A", "mA") or bool(_axes_joined(words) & CURRENTS)
    return current and not words & (WANTED | _ORDER[0] | {"output", "out", "pid"})


def is_called_command(name: ColumnName) -> bool:
    """Whether a word says that a force was commanded: ``torque cmd``."""
    return bool(set(name.words) & WANTED) and role_by_name(name).role == "command"


def is_torque(name: ColumnName) -> bool:
    """Whether a torque or a force is named, and no word says that it was commanded."""
    words = set(name.words)
    return bool(words & _FORCE_NAMES) and not words & (WANTED | FEED_FORWARD | _ORDER[0] | {"output", "out", "pid"})


def says_no_command(name: ColumnName) -> bool:
    """Whether no word says that it was commanded, and what it names is measured as often as not: a current, a load."""
    return may_be_measured(name) or ("load" in name.words and not set(name.words) & (WANTED | _ORDER[0] | _ORDER[1]))


def is_force_sensor(name: ColumnName) -> set[str]:
    """Words that say that a sensor beside the drive felt a force: ``wrench``, ``load cell``; none where none do."""
    return next((some for some in _FORCE_SENSORS if some <= set(name.words)), set())


def is_sensor_in_volts(name: ColumnName) -> bool:
    """Whether a name says that a sensor shows a motion as a voltage, of a scale that is not known: ``encoder_V``."""
    return name.unit in ("V", "mV") and bool(set(name.words) & _MOTION_SENSORS) and not set(name.words) & WANTED


def is_of_hand(name: ColumnName) -> bool:
    """Whether a name says that a column is of the hand of an arm, and so of no joint: ``ee_pos``, ``tcp_pose``."""
    return bool(set(name.words) & _HAND)


def is_coordinate(name: ColumnName) -> bool:
    """Whether a name is one letter of a coordinate with a number, which may be that of a state: ``q3``, ``x[2]``."""
    return len(name.words) == 1 and set(name.words) <= _COORDINATES and bool(name.index) and not name.unit


def is_computed(name: ColumnName) -> bool:
    """Whether a name says that a model gave the values: ``tau_rigid``, ``predicted torque``."""
    words = set(name.words)
    return bool(words & _COMPUTED) and not words & (WANTED | MEASURED | FEED_FORWARD)


def is_feed_forward(name: ColumnName) -> bool:
    """Whether a name says that a force is added to the output of a loop."""
    return bool(set(name.words) & FEED_FORWARD) and role_by_name(name).role == "command"


def _axes_joined(words: set[str]) -> set[str]:
    """Words of a name with the axis of a current or voltage joined to it: i_q, q-axis current and Iq are iq."""
    said = next((letter for word, letter in _FIELD_AXES.items() if word in words), "")
    for axis in ("d", "q"):
        if said and axis in words:
            words = (words - {axis, "axis", *_FIELD_AXES}) | {said + axis}
    return words


def _kind(name: ColumnName, words: set[str], unit: str) -> str:
    """Quantity by unit, then by words; of V and v, N and n the case decides."""
    # Parts of a whole may be of anything that a word says.
    if _is_force(unit) and (unit != "%" or words & _FORCES or not words & (_VELOCITIES | _POSITIONS)):
        return "force"
    if base_of(unit) in _SPEEDS:
        return "velocity"
    if base_of(unit) in _PLACES:
        return "velocity" if words & (_VELOCITIES - {"w", "v", "n"}) else "position"
    if name.letter in ("V", "U", "I", "F", "T", "M"):
        return "force"
    if name.letter == "p":
        return "position"
    if words & _RATES and words & _POSITIONS:
        return "velocity"
    # Beside the name of a force or an input a coordinate says of what it is one.
    said = words - _COORDINATES if words & (_FORCE_NAMES | _INPUTS) else words
    for kind, known in (("velocity", _VELOCITIES), ("position", _POSITIONS), ("force", _FORCES)):
        if said & known:
            return kind
    return ""


def _is_force(unit: str) -> bool:
    return unit == "%" or base_of(unit) in _COMMANDS


def _because(words: set[str], unit: str) -> str:
    said = " ".join(sorted(words))
    by = f"by its name ({said})" if said else "by its name"
    return f"{by} and its unit" if unit and said else BY_UNIT if unit else by
