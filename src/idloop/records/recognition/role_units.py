"""Units of what the columns are taken for, and which of them are uncertain."""

from __future__ import annotations

import re
from dataclasses import replace
from math import pi

import numpy as np

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.records.recognition.column_name import WANTED, ColumnName, parse_column_name
from idloop.records.recognition.guess import LOAD, MOTION, SET_POINTS, Given, Guess, quoted
from idloop.records.recognition.roles import CURRENTS, TORQUES, role_by_name
from idloop.records.recognition.signal_units import (
    MotionUnits,
    motion_units,
    near_unit,
    slope_of,
    steps_per_turn,
    usual_resolution,
)
from idloop.records.recognition.table_column import Choice, TableColumn
from idloop.records.recognition.time_base import TimeBase
from idloop.records.recognition.unnamed_columns import longest_way
from idloop.records.tables.base_units import COUNTS, SECONDS, base_of, base_unit
from idloop.spelling import joined_names

_LINEAR_WORDS = {"x", "stage", "slide", "carriage", "stroke", "displacement", "distance", "weg", "z", "height", "cart"}
# What is called so turns, also under a force in newtons, as of a propeller.
_ROTARY_WORDS = {
    "omega", "n", "rpm", "erpm", "rps", "drehzahl", "angvel", "tacho", "tachometer", "theta", "phi", "alpha", "beta",
    "angle", "angles", "winkel", "angulo", "angolo", "thetadot", "dtheta",
}  # fmt: skip
_IN_HERTZ = re.compile(r"[\[(_ ]hz[\])]?$", re.IGNORECASE)
_ENCODERS = {"enc", "encoder", "count", "counts", "tick", "ticks", "inc"}
_FEWEST_COUNTS = 200  # of a turn
# Parts by which a ratio of velocity and slope is one, and by which it may differ from a factor that the file gives.
_SAME_SCALE, _WRITTEN_FACTOR = 0.1, 0.01
_PER_SAMPLE = 0.02  # part by which the time of a sample may differ from the factor of a difference
_MOST_LEVELS, _FEW_LEVELS = 8, 5  # of a command in whole amperes or newton metres, and of what follows it
_MANY_COUNTS = 1000  # whole numbers as large as this are no angle in rad
# Largest values of a command in counts, and those of them that a duty cycle may have as well.
_FULL_SCALES = {2.0**bits - 1.0: f"of {bits} bits" for bits in range(8, 17)}
_FULL_DUTIES = _FULL_SCALES | {1e2: "of per cent", 1e3: "of per mille", 1e4: "of a hundredth of a per cent"}
_DUTIES = {"pwm", "duty", "dutycycle", "throttle", "joystick"}
# Names of units by the word that a column of the command has.
_UNITS_OF_WORDS = (
    ({"voltage", "volt", "volts", "vin", "spannung"}, "V"),
    (CURRENTS, "A"),
    (TORQUES, "N·m"),
    ({"force", "kraft"}, "N"),
)
_UNITS_OF_LETTERS = {"V": "V", "U": "V", "I": "A", "F": "N", "T": "N·m", "M": "N·m"}
_OPPOSITE = "position and velocity have opposite signs; that of the velocity is turned"


def is_linear(unit: str) -> bool:
    """Whether a unit is one of a way or its rate."""
    return base_of(unit) in ("m", "m/s")


def set_units(log: Choice) -> None:
    """Set the units that no name says, and note which of them are uncertain.

    Raises InputError: the name of a position or a velocity says the unit of another quantity.
    """
    chosen = log.chosen
    for role in (*MOTION, LOAD):
        _check_quantity(chosen.get(role))
    command, wanted = chosen.get("command"), ""
    if command is not None and command.unit in SECONDS:
        chosen["command"] = command = _pulse_width(command)
    elif wanted := _wanted_as(log):
        chosen[wanted] = replace(chosen.pop("command"), role=wanted)
    elif command is not None and not command.unit:
        chosen["command"] = command = _full_scale(log, _force_unit(log, command))
    if "effort" in chosen and not chosen["effort"].unit:
        chosen["effort"] = _force_unit(log, chosen["effort"])
    motions = [chosen[role] for role in MOTION if role in chosen]
    words = {word for one in motions for word in parse_column_name(one.column).words}
    linear = (
        any(is_linear(one.unit) for one in motions)
        or (command is not None and base_of(command.unit) == "N" and not words & _ROTARY_WORDS)
        or bool(words & _LINEAR_WORDS)
    )
    _motion_units(log, linear=linear)
    _reference_units(chosen)
    _load_unit(chosen)
    if wanted and command is not None:
        set_point = chosen.pop(wanted, None)
        chosen["command"] = replace(set_point, role="command") if set_point else _force_unit(log, command)
    for role, one in chosen.items():
        if not one.unit:
            column = one.column or f"{one.options['value']:g}"
            chosen[role] = one.with_doubt(f"{_without_unit(one)}: --{role} '{column}=UNIT'")


def _motion_units(log: Choice, *, linear: bool) -> None:
    """Set the units of position and velocity."""
    chosen = log.chosen
    place, speed = log.chosen.get("position"), chosen.get("velocity")
    counted = None
    if place is not None and (place.unit == "counts" or (not place.unit and _is_count(log.columns[place.column]))):
        counted, chosen["position"] = place, _counts(place, log.columns[place.column])
    elif place is not None and not place.unit and not linear and _counts_many(log.columns[place.column].value):
        trial = replace(log, chosen=dict(chosen))
        if speed is not None:
            _relate(trial, linear=False)
        # Degrees, where a velocity proves them, are no counts.
        if trial.chosen["position"].unit != "deg":
            why = f"{place.column!r} holds large whole numbers, probably counts of an encoder; "
            counted, chosen["position"] = place, _counts(place, log.columns[place.column], why)
    if place is not None and speed is not None:
        _relate(log, linear=linear, counted=counted)
    elif place is not None and not chosen["position"].unit:
        chosen["position"] = _position_alone(place, log.columns[place.column], linear=linear)
    elif speed is not None and not speed.unit:
        usual = "m/s" if linear else "rad/s"
        chosen["velocity"] = _turns_per_second(speed) if _in_hertz(speed) else _taken_in(speed, usual)
    elif speed is not None and speed.unit == "counts":
        size = f"the size of a count is not known; one is taken as 1 rad: --velocity '{speed.column}=counts/N'"
        log.change("velocity", size, unit="rad/s")


def _check_quantity(one: Guess | None) -> None:
    """Refuse a motion that is by its name in the unit of another quantity, and say how its unit is given."""
    if one is None or one.unit in ("", *COUNTS):
        return
    try:
        base_unit(one.unit, base_field(one.role), f"the {one.role} {one.column!r}")
    except InputError as error:
        raise InputError(f"{error}; give the one that it is in: --{one.role} '{one.column}=UNIT'") from error


def set_wraps(log: Choice) -> None:
    """Find the ranges after which positions start again."""
    for role in log.chosen.keys() & {"position", "reference", LOAD}:
        guess, column = log.chosen[role], log.column(role)
        scale = guess.options.get("scale", 1.0)
        if column is None or "wrap" in guess.options:
            continue
        if whole := column.wrap(guess.unit if scale == 1.0 else "counts"):
            reason = f"{guess.reason}; starts again after {whole:g}"
            log.change(role, options=guess.options | {"wrap": whole * scale}, reason=reason)


def unit_by_words(name: ColumnName) -> str:
    """Unit of a force, torque, current or voltage by the words of its name."""
    unit = next((unit for some, unit in _UNITS_OF_WORDS if some.intersection(name.words)), "")
    return _UNITS_OF_LETTERS.get(name.letter, unit)


def _wanted_as(log: Choice) -> str:
    """Set-point that a command without a unit is by its name, and so has the unit of the motion; empty otherwise."""
    column = log.column("command")
    role = column.by_name.role if column is not None and not log.chosen["command"].unit else ""
    return role if role in SET_POINTS and role not in log.chosen else ""


def _taken_in(one: Guess, unit: str) -> Guess:
    """Take a signal in a unit that nothing says."""
    return replace(one, unit=unit).with_doubt(
        f"{_without_unit(one)} and taken as {unit}: --{one.role} '{one.column}=UNIT'"
    )


def _force_unit(log: Choice, one: Guess) -> Guess:
    """Set the unit of a command or a measured force by the words of its name."""
    parsed = parse_column_name(one.column)
    unit, column = unit_by_words(parsed), log.columns.get(one.column)
    most = _MOST_LEVELS if one.role == "command" else _FEW_LEVELS
    if unit in ("A", "N·m") and column is not None and column.whole_numbers > most:
        return replace(one, unit="-").with_doubt(
            f"{one.column!r} holds whole numbers, probably counts of the drive: --{one.role} '{one.column}=UNIT' if"
            " they are in a unit"
        )
    if unit:
        return _taken_in(one, unit)
    if one.role == "command" and _in_hertz(one):
        return _turns_per_second(one)
    # A duty cycle has no unit, and of an unknown one only ratios of the parameters matter.
    found = replace(one, unit="-")
    if not one.written and _DUTIES.intersection(parsed.words):
        return found
    what = f"the unit {one.written!r}" if one.written else "the unit"
    return found.with_doubt(f"{what} of the {one.role} is not known: --{one.role} '{one.column}=UNIT'")


def _full_scale(log: Choice, one: Guess) -> Guess:
    """Say how a command in counts of a PWM is taken as a share of its full scale, or as a voltage."""
    column, supply = log.columns.get(one.column), log.chosen.get("supply")
    if column is None or one.unit != "-" or one.options or not column.whole_numbers:
        return one
    largest = float(np.nanmax(np.abs(column.value)))
    duty = bool(_DUTIES & set(parse_column_name(one.column).words))
    scale = (_FULL_DUTIES if duty else _FULL_SCALES).get(largest, "")
    if not scale and not (duty and largest > 1.0):
        return one
    whole = f"{largest:g}" if scale else "N"
    what = f"probably the full scale {scale}" if scale else "of which the full scale N is not known (255 of 8 bits)"
    volts, unit = (quoted(supply.column), supply.unit) if supply is not None and supply.column else ("U", "V")
    return one.with_doubt(
        f"{one.column!r} holds whole numbers up to {largest:g}, {what}: as a share of it --{one.role}"
        f" '{quoted(one.column)} / {whole}=-', as the mean voltage{'' if volts != 'U' else ' of a supply of U volts'}"
        f" --{one.role} '{quoted(one.column)} * {volts} / {whole}={unit or 'V'}'"
    )


def _without_unit(guess: Guess) -> str:
    """Say that a unit is not written down, or that what is written is none that is known."""
    if guess.written:
        return f"the unit {guess.written!r} of the {guess.role} is not known"
    return f"the unit of the {guess.role} is not written down"


def _in_hertz(one: Guess) -> bool:
    """Whether a signal is in hertz by its name or by what stands as its unit."""
    return one.written.lower() == "hz" or bool(_IN_HERTZ.search(one.column))


def _turns_per_second(one: Guess) -> Guess:
    """Velocity, or command of one, in hertz: turns in a second, or what one turn has several of."""
    return replace(one, unit="rev/s", written="").with_doubt(
        f"the {one.role} is in hertz, taken as turns per second; if it counts pulses of an encoder, steps or periods of"
        f" the currents, of which a turn has N: --{one.role} '{quoted(one.column)} / N=rev/s'"
    )


def _pulse_width(command: Guess) -> Guess:
    """Command of a hobby servo or speed controller: a pulse of 1 to 2 ms, with zero in the middle."""
    scale = SECONDS[command.unit] / SECONDS["ms"]
    found = replace(command, unit="-", options=command.options | {"scale": 2.0 * scale, "offset": -3.0})
    return found.with_doubt(
        "the command is a pulse width; 1.5 ms is taken as zero, 2 ms as full: edit `scale` and `offset` in the mapping"
    )


def _is_count(column: TableColumn) -> bool:
    """Whether a position without a unit counts the steps of an encoder: whole numbers that start again, or its name."""
    known = column.value[np.isfinite(column.value)]
    if (known != np.round(known)).any():
        return False
    words = set(parse_column_name(column.name).words)
    return bool(words & _ENCODERS or (np.ptp(known) > _FEWEST_COUNTS and column.wrap("counts") > 0.0))


def _counts_many(value: Array) -> bool:
    """Whether a position holds whole numbers larger than an angle in rad."""
    known = value[np.isfinite(value)]
    return bool((known == np.round(known)).all() and np.abs(known).max() >= _MANY_COUNTS)


def _counts(place: Guess, column: TableColumn, why: str = "") -> Guess:
    """Set the size of an encoder's count: by its wrap, or as unknown; `why` it may be one, where nothing says so."""
    if whole := column.wrap("counts"):
        options = {**place.options, "scale": 2.0 * pi / whole, "wrap": 2.0 * pi}
        reason = f"{place.reason}; starts again after {whole:g} counts"
        return replace(place, unit="rad", options=options, reason=reason).with_doubt(
            f"{whole:g} counts are taken as one turn: --position '{place.column}=counts/N'"
        )
    return replace(place, unit="rad").with_doubt(
        f"{why}the size of a count is not known; one is taken as 1 rad: --position '{place.column}=counts/N' with the"
        " counts per turn N"
    )


def _position_alone(place: Guess, column: TableColumn, *, linear: bool) -> Guess:
    for unit in () if linear else ("rad", "deg"):
        if column.wrap(unit):
            return replace(place, unit=unit, reason=f"{place.reason}; starts again after a turn in {unit}")
        if steps := steps_per_turn(column.value, unit):
            return replace(place, unit=unit, reason=f"{place.reason}; a turn in {unit} has {steps} of its steps")
    return _taken_in(place, "m" if linear else "rad")


def _scaled_position(log: Choice) -> Array:
    """Position without its wraps, in the unit that is chosen for it."""
    place = log.chosen["position"]
    scale = place.options.get("scale", 1.0)
    return np.asarray(log.columns[place.column].unwrapped(place.unit if scale == 1.0 else "counts") * scale)


def _relate(log: Choice, *, linear: bool, counted: Guess | None = None) -> None:
    """Set units of position and velocity by the slope of one against the other.

    `counted` is a position in counts of a size that nothing else says, as it was before a size was assumed.
    """
    base, place, speed = log.base, log.chosen["position"], log.chosen["velocity"]
    column, rate = log.columns[place.column], log.columns[speed.column].value
    if column.value.size != base.seconds.size or rate.size != base.seconds.size:
        _unrelated(log, linear=linear)
        return
    scale = place.options.get("scale", 1.0)
    value = _scaled_position(log)
    run = longest_way(value, column.runs)

    def compared(one: Guess) -> MotionUnits:
        scaled = rate[run] * one.options.get("scale", 1.0)
        unit = "" if one.unit == "counts" else one.unit
        return motion_units(base.seconds[run], value[run], scaled, (place.unit, unit), base.units, linear=linear)

    # The counts of the position, in a second.
    in_counts = replace(speed, unit=f"{place.unit}/s", options=speed.options | {"scale": scale})
    known = speed.unit not in ("", "counts")
    if speed.unit == "counts" and scale != 1.0:
        log.chosen["velocity"] = speed = in_counts
    found = compared(speed)
    if not found.agree and not speed.unit and scale != 1.0 and (counting := compared(in_counts)).agree:
        speed, found = in_counts, counting
    if found.agree:
        _set_agreeing(log, place, speed, found, known=known)
        return
    if not speed.unit and scale != 1.0 and log.columns[speed.column].whole_numbers:
        speed = log.chosen["velocity"] = in_counts.with_doubt(
            f"{_without_unit(speed)}; its whole numbers are taken as counts of the position in a second:"
            f" --velocity '{speed.column}=UNIT'"
        )
    _unrelated(log, linear=linear)
    if known and not counted and _scaled_alike(log, found):
        return
    slope = slope_of(base.seconds, value, rate * speed.options.get("scale", 1.0), column.runs)
    if slope is None:
        return
    place_now = log.chosen["position"]
    base_place, factor = base_unit(place_now.unit, "position", place.column)
    if not known and _in_hertz(speed) and base_place == "rad":
        said = f"velocity: N is {2.0 * pi * abs(slope.value) / factor:.4g} by the slope of {place.column!r}"
        log.change("velocity", said)
    elif not known:
        said = _no_unit(slope.value, place_now)
        if period := _per_sample(slope.value, place_now, base):
            said = (
                f"it is what the position travels in a sample of {period:.4g} s, not in a second: --velocity"
                f" '{quoted(speed.column)} / {period:.4g}={place_now.unit}/s'"
            )
        log.change("velocity", said)
    elif counted:
        factor = base_unit(speed.unit, "velocity", speed.column)[1]
        # Over long windows the slope is exact, where it can be told there.
        exact = found.slope if np.isfinite(found.slope) else slope.value * factor
        _count_by_slope(log, counted, speed, exact * scale)


def _scaled_alike(log: Choice, found: MotionUnits) -> bool:
    """Scale the velocity or position by a factor of the file that makes one the slope of the other, if there is one."""
    place, speed = log.chosen["position"], log.chosen["velocity"]
    times = abs(found.slope)
    if any(log.given.get(role, Given()).unit for role in MOTION):
        return False
    if not np.isfinite(times) or abs(times - 1.0) < _SAME_SCALE or is_linear(place.unit) != is_linear(speed.unit):
        return False
    for name, factor in log.table.attributes.items():
        if isinstance(factor, bool) or not isinstance(factor, int | float) or not factor > 0.0:
            continue
        if abs(times * factor - 1.0) < _WRITTEN_FACTOR:
            one = speed
        elif abs(times / factor - 1.0) < _WRITTEN_FACTOR:
            one = place
        else:
            continue
        said = (
            f"the {one.role} is multiplied by {name} = {factor:.6g} of the file, so that the velocity is the slope of"
            f" the position; if that is wrong: --{one.role} '{one.column}={one.unit}'"
        )
        options = one.options | {"scale": one.options.get("scale", 1.0) * factor}
        log.change(one.role, said, options=options)
        return True
    return False


def _turned(speed: Guess, slope: float) -> Guess:
    """Turn the sign of a velocity that is opposite to that of the position."""
    if slope >= 0.0:
        return speed
    options = speed.options | {"scale": -speed.options.get("scale", 1.0)}
    return replace(speed, options=options).with_doubt(_OPPOSITE)


def _set_agreeing(log: Choice, place: Guess, speed: Guess, found: MotionUnits, *, known: bool) -> None:
    """Set the units in which a velocity is the slope of the position; `known` is that of the velocity."""
    times = f"it is the slope of the position in {found.position} and {found.velocity}"
    turned = replace(speed, unit=found.velocity, reason=f"{speed.reason}; {times}")
    log.chosen["velocity"] = _turned(turned, found.slope)
    if not place.unit:
        by_velocity = f"{found.position} by the velocity in {found.velocity}"
        log.chosen["position"] = replace(place, unit=found.position, reason=f"{place.reason}; {by_velocity}")
        if not known:
            written = [repr(one.written) for one in (place, speed) if one.written]
            said = f"not known as a unit: {joined_names(written)}" if written else "no unit is written down"
            doubt = (
                f"{said}; position in {found.position} and velocity in {found.velocity} agree, as others would:"
                f" --position '{place.column}=UNIT'"
            )
            log.change("position", doubt)
    base = log.base
    if found.time != base.units[0]:
        log.base = replace(
            base,
            time=base.time.model_copy(update={"unit": found.time}),
            seconds=base.seconds * (SECONDS[found.time] / SECONDS[base.units[0]]),
            units=(found.time,),
            reason=f"{base.reason}; but with {found.time} the velocity is the slope of the position",
            doubt="",
        )
    elif len(base.units) > 1:
        log.base = replace(base, units=(found.time,), doubt="", reason=f"{base.reason}, and so says the velocity")


def doubt_of_left_out(log: Choice) -> str:
    """Say what stays unknown where the user leaves out a velocity that is the slope of the position in no unit."""
    place, column, base = log.chosen.get("position"), log.column("position"), log.base
    if place is None or column is None or not log.left_out("velocity"):
        return ""
    value = _scaled_position(log)
    for one in log.columns.values():
        if one.by_name.role != "velocity" or not one.value.size == value.size == base.seconds.size:
            continue
        slope = slope_of(base.seconds, value, one.value, column.runs)
        if slope is not None and not _per_sample(slope.value, place, base) and (said := _no_unit(slope.value, place)):
            return f"{one.name!r} is left out; {said}"
    return ""


def _no_unit(slope: float, place: Guess) -> str:
    """What a velocity may be that is so many times the slope of a position; empty where a unit says it."""
    times = slope / base_unit(place.unit, "position", "")[1]
    if near_unit(times):
        return ""
    return (
        f"it is {times:.4g} times the slope of the position, which is no usual unit: its scale or that of the position"
        " is another, or the sample time is wrong by this factor, and with it every time constant"
    )


def _per_sample(slope: float, place: Guess, base: TimeBase) -> float:
    """Time in which a position travels what its velocity says, where that is a sample [s]; 0 elsewhere."""
    period = float(np.median(np.diff(base.seconds)))
    times = slope / base_unit(place.unit, "position", "")[1]
    return period if abs(times / period - 1.0) < _PER_SAMPLE else 0.0


def _count_by_slope(log: Choice, place: Guess, speed: Guess, slope: float) -> None:
    """Set the size of a count so that a velocity in a known unit, in rad/s or m/s `slope` per count, is their slope."""
    unit, factor = base_unit(speed.unit, "velocity", speed.column)
    size = abs(slope)
    if unit != "rad/s":
        size, unit = float(f"{size:.4g}"), unit.removesuffix("/s")
        way = f"--position '{quoted(place.column)} * {size:g}={unit}'"
        said = f"a count of {size:g} {unit}"
    else:
        counts = usual_resolution(2.0 * pi / size)
        # Who takes rpm for rad/s, or the reverse, knows the encoder by the other number.
        other = "rad/s" if speed.unit == "rpm" else "rpm"
        counts_in_other = usual_resolution(2.0 * pi / size * factor / base_unit(other, "velocity", "")[1])
        size, unit = 2.0 * pi / counts, "rad"
        said = f"{counts:g} counts per turn"
        way = (
            f"--position '{place.column}=counts/N'; with the velocity in {other} they are {counts_in_other:g}:"
            f" --velocity '{speed.column}={other}'"
        )
    reason = f"{place.reason}; with {said} the velocity is its slope"
    found = replace(place, unit=unit, options={**place.options, "scale": size}, reason=reason)
    log.chosen["position"] = found.with_doubt(f"{said}: found by the velocity in {speed.unit}; if it is another, {way}")
    log.chosen["velocity"] = _turned(speed, slope)


def _unrelated(log: Choice, *, linear: bool) -> None:
    """Take position and velocity in the usual units, where nothing says theirs."""
    if not log.chosen["velocity"].unit and _in_hertz(log.chosen["velocity"]):
        log.chosen["velocity"] = _turns_per_second(log.chosen["velocity"])
    for role, usual in (("position", "m" if linear else "rad"), ("velocity", "m/s" if linear else "rad/s")):
        if log.chosen[role].unit in ("", "counts"):
            log.chosen[role] = _taken_in(log.chosen[role], usual)


def _reference_units(chosen: dict[str, Guess]) -> None:
    """A set-point has the unit of what it is set for."""
    reference = chosen.get("reference")
    if reference and not {"position", "reference velocity"} & chosen.keys() and not _is_of_position(reference):
        chosen["reference velocity"] = replace(chosen.pop("reference"), role="reference velocity")
    for role, motion in (("reference", "position"), ("reference velocity", "velocity")):
        one, other = chosen.get(role), chosen.get(motion)
        if one is None or (one.unit and one.unit != "counts"):
            continue
        if other is None or _other_letters(one, other):
            del chosen[role]
            continue
        options = {key: other.options[key] for key in ("scale", "wrap") if key in other.options}
        reason = f"{one.reason}; unit of the {motion}"
        chosen[role] = replace(one, unit=other.unit, options=one.options | options, reason=reason)


def _load_unit(chosen: dict[str, Guess]) -> None:
    """The load has the unit of the position where it says none: how far it moves beside it is found from the data."""
    place, load = chosen.get("position"), chosen.get(LOAD)
    if place is None or load is None or (load.unit and load.unit != "counts"):
        return
    scale = {key: place.options[key] for key in ("scale",) if key in place.options}
    reason = f"{load.reason}; unit of the position"
    chosen[LOAD] = replace(load, unit=place.unit, options=scale | load.options, reason=reason)


def _is_of_position(reference: Guess) -> bool:
    """Whether a name says that a set-point is of the position, not only that it is one."""
    name = parse_column_name(reference.column)
    rest = tuple(word for word in name.words if word not in WANTED)
    return role_by_name(replace(name, words=rest, unit=reference.unit)).role == "position"


def _other_letters(reference: Guess, motion: Guess) -> bool:
    """Whether two letters name other quantities, as p_soll and n_ist do; r is the set-point of anything."""
    letters = {parse_column_name(one.column).letter.lower() for one in (reference, motion)} - {""}
    return len(letters - {"r"}) == 2


def base_field(role: str) -> str:
    """Field of JointState whose units a role may have."""
    fields = {"command": "effort", "reference": "position", LOAD: "position", "reference velocity": "velocity"}
    return fields.get(role, role if role in (*MOTION, "effort") else "condition")


def base_unit_of(guess: Guess) -> str:
    """Unit of the topics that a guess becomes."""
    return base_unit(guess.unit, base_field(guess.role), guess.role)[0]
