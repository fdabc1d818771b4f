"""One simulated motor, logged in many forms: what each says of itself, what its user must say, and what is true.

The motor is J w' = u - B w - C sign(w), with J = 0.02, B = 0.1, C = 0.15 for u in N·m (or V, A, ... where `gain` is 1).
Its command has several levels or several sines, in both directions; its encoder is read with noise. Each function of
`FORMS` writes one log into a folder, as a device or program of that kind writes it.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from math import pi
from pathlib import Path

import numpy as np
from tests.records.formats.writers import Ref, mat_hdf5, mat_objects, torch_archive, torch_legacy, wpilog

INERTIA, VISCOUS, COULOMB = 0.02, 0.1, 0.15
RATE, DURATION = 100.0, 20.0
_FINE = 20  # steps of the simulation in one sample
_POSITION_NOISE, _VELOCITY_NOISE = 2e-4, 0.02  # [rad, rad/s]


@dataclass(frozen=True)
class Truth:
    """What a column is: value = file * scale + offset, in `unit`."""

    column: str
    unit: str
    scale: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class Log:
    """One log.

    Attributes
    ----------
    files : tuple of Path
    kind : str
        Form that the reader must recognise.
    flags : tuple of str
        What the user must say to `idloop start`, because nothing in the files does.
    truth : dict of str to Truth
        What each signal is, by its role; with the time.
    gain : float
        Newton metres of a unit of the command: inertia, friction of a fit are those of the motor divided by it.
    length : float
        Metres of a radian, of an axis that is logged as linear.
    records : int
        Records in it.
    """

    files: tuple[Path, ...]
    kind: str
    flags: tuple[str, ...]
    truth: dict[str, Truth]
    gain: float = 1.0
    length: float = 1.0
    records: int = 1

    @property
    def parameters(self) -> dict[str, float]:
        """What a fit must find, in the units of the command and the position in SI."""
        per = 1.0 / (self.gain * self.length)
        return {"inertia": INERTIA * per, "viscous_friction": VISCOUS * per, "coulomb": COULOMB / self.gain}


@dataclass(frozen=True)
class Run:
    """Samples of one experiment: time [s], command [N·m], position [rad], velocity [rad/s]."""

    t: np.ndarray
    u: np.ndarray
    q: np.ndarray
    w: np.ndarray
    noise: np.random.Generator = field(repr=False, default_factory=lambda: np.random.default_rng(0))


def simulate(command: np.ndarray, seed: int = 0, dt: float = 1.0 / RATE) -> Run:
    """Move the motor from rest; the command is held between samples, the measurement is that of its beginning."""
    step, q, w = dt / _FINE, 0.0, 0.0
    position, velocity = np.empty(command.size), np.empty(command.size)
    for k, u in enumerate(command):
        position[k], velocity[k] = q, w
        for _ in range(_FINE):
            if w == 0.0 and abs(u) <= COULOMB:
                continue
            sign = np.sign(w) if w else np.sign(u)
            new = w + step * (u - VISCOUS * w - COULOMB * sign) / INERTIA
            # Friction stops the motor, it does not turn it round.
            new = 0.0 if new * sign < 0.0 and abs(u) <= COULOMB else new
            q, w = q + 0.5 * step * (w + new), new
    noise = np.random.default_rng(seed)
    return Run(
        dt * np.arange(command.size),
        command,
        position + noise.normal(0.0, _POSITION_NOISE, command.size),
        velocity + noise.normal(0.0, _VELOCITY_NOISE, command.size),
        noise,
    )


@cache
def levels(seed: int = 0, *, one_way: bool = False) -> Run:
    """Levels of 0.2 to 0.8 s, as much to one side as to the other."""
    chance = np.random.default_rng(seed)
    command = np.zeros(round(RATE * DURATION))
    k, side = 50, 1.0
    while k < command.size - 60:
        length = int(chance.integers(20, 80))
        command[k : k + length] = side * chance.choice([0.3, 0.5, 0.8, 1.1, 1.4])
        k, side = k + length, 1.0 if one_way else -side
    return simulate(np.round(command, 3), seed)


@cache
def multisine(seed: int = 1) -> Run:
    """Sum of sines of 0.1 to 5 Hz."""
    chance = np.random.default_rng(seed)
    t = np.arange(round(RATE * DURATION)) / RATE
    frequencies = np.array([2, 5, 9, 14, 22, 34, 51, 77, 101]) / DURATION
    waves = np.sin(2 * pi * frequencies[:, None] * t + chance.uniform(0, 2 * pi, frequencies.size)[:, None])
    return simulate(np.round(0.45 * waves.sum(axis=0), 4), seed)


@cache
def sysid() -> dict[str, Run]:
    """Return the four tests of SysId: slow ramps and steps, forwards and backwards, each from rest."""
    ramp, jump = 0.25 * np.arange(500) / RATE, np.full(200, 1.0)
    still = np.zeros(20)
    commands = {
        "quasistatic-forward": ramp,
        "quasistatic-reverse": -ramp,
        "dynamic-forward": jump,
        "dynamic-reverse": -jump,
    }
    return {name: simulate(np.concatenate([still, one]), k) for k, (name, one) in enumerate(commands.items())}


Form = Callable[[Path], Log]
FORMS: dict[str, Form] = {}


def form(function: Form) -> Form:
    """Add a form to the corpus."""
    FORMS[function.__name__.strip("_")] = function
    return function


def write_corpus(folder: Path) -> dict[str, Log]:
    """Write all logs, each into a folder of its name."""
    found = {}
    for name, function in FORMS.items():
        (folder / name).mkdir(parents=True, exist_ok=True)
        found[name] = function(folder / name)
    return found


# Helpers


DEG, RPM, TURN = 180.0 / pi, 30.0 / pi, 0.5 / pi


def _cells(column, digits):
    if np.asarray(column).dtype.kind in "iu":
        return [str(one) for one in column]
    return [one if isinstance(one, str) else f"{one:.{digits}f}" for one in column]


def _text(columns, *, sep=",", digits=6, comma=False, end="", header=True, above="", units=None):
    names = list(columns)
    lines = [sep.join(names) + end] if header else []
    lines += [sep.join(units) + end] if units else []
    cells = [_cells(column, digits) for column in columns.values()]
    rows = [sep.join(row) + end for row in zip(*cells, strict=True)]
    return above + "\n".join(lines + ([row.replace(".", ",") for row in rows] if comma else rows)) + "\n"


def _write(path, text, encoding="utf-8"):
    path.write_bytes(text.encode(encoding))
    return (path,)


def _motor(t="t", u="u", q="q", w="w", unit="N·m", time="s", angle="rad", speed="rad/s"):
    found = {
        "time": Truth(t, time),
        "command": Truth(u, unit),
        "position": Truth(q, angle),
        "velocity": Truth(w, speed),
    }
    return {role: one for role, one in found.items() if one.column}


def _si(run, *, t="t", u="u", q="q", w="w"):
    return {t: run.t, u: run.u, q: run.q, w: run.w}


_UNITS = ("--command", "u=N·m", "--position", "q=rad", "--velocity", "w=rad/s")
_BARE = ("--time", "0=s", "--command", "1=N·m", "--position", "2=rad", "--velocity", "3=rad/s")


# Tables of text


@form
def comma_without_units(folder):
    return Log(_write(folder / "log.csv", _text(_si(levels()))), "csv", _UNITS, _motor())


@form
def units_in_brackets(folder):
    names = ("time [s]", "voltage [V]", "angle [rad]", "speed [rad/s]")
    return Log(
        _write(
            folder / "run.csv", _text(dict(zip(names, (levels().t, levels().u, levels().q, levels().w), strict=True)))
        ),
        "csv",
        (),
        _motor(*names, unit="V"),
    )


@form
def german_decimal_commas(folder):
    run, names = multisine(), ("Zeit [s]", "Drehmoment [Nm]", "Winkel [°]", "Drehzahl [1/min]")
    columns = dict(zip(names, (run.t, run.u, run.q * DEG, run.w * RPM), strict=True))
    return Log(
        _write(folder / "Messung.csv", _text(columns, sep=";", digits=4, comma=True), "cp1252"),
        "csv",
        (),
        _motor(*names, unit="N·m", angle="deg", speed="rpm"),
    )


@form
def french_semicolons(folder):
    run, names = levels(2), ("temps (s)", "tension (V)", "position (rad)", "vitesse (rad/s)")
    columns = dict(zip(names, (run.t, run.u, run.q, run.w), strict=True))
    return Log(_write(folder / "essai.csv", _text(columns, sep=";")), "csv", (), _motor(*names, unit="V"))


@form
def tabs_with_a_row_of_units(folder):
    run, names = levels(3), ("Time", "Torque", "Position", "Velocity")
    columns = dict(zip(names, (run.t, run.u, run.q * DEG, run.w * DEG), strict=True))
    return Log(
        _write(folder / "drive.tsv", _text(columns, sep="\t", units=("s", "N·m", "deg", "deg/s"))),
        "csv",
        (),
        _motor(*names, angle="deg", speed="deg/s"),
    )


@form
def fixed_width(folder):
    run = multisine(2)
    rows = "".join(
        f"{t:12.4f}{u:12.5f}{q:14.6f}{w:14.6f}\n" for t, u, q, w in zip(run.t, run.u, run.q, run.w, strict=True)
    )
    header = f"{'time(s)':>12}{'torque(Nm)':>12}{'angle(rad)':>14}{'speed(rad/s)':>14}\n"
    return Log(
        _write(folder / "log.dat", header + rows),
        "csv",
        (),
        _motor("time(s)", "torque(Nm)", "angle(rad)", "speed(rad/s)"),
    )


@form
def excel_sep_line(folder):
    run, names = levels(4), ("Time (s)", "Voltage (V)", "Angle (deg)")
    columns = dict(zip(names, (run.t, run.u, run.q * DEG), strict=True))
    text = "sep=;\n" + _text(columns, sep=";", digits=3, comma=True)
    return Log(
        _write(folder / "export.csv", text.replace("\n", "\r\n")),
        "csv",
        (),
        _motor(*names, w="", unit="V", angle="deg"),
    )


@form
def numpy_savetxt_with_names(folder):
    run = levels(5)
    np.savetxt(folder / "log.txt", np.column_stack([run.t, run.u, run.q, run.w]), header="t u q w")
    return Log((folder / "log.txt",), "csv", _UNITS, _motor())


@form
def numpy_savetxt_bare(folder):
    run = multisine(3)
    np.savetxt(folder / "log.txt", np.column_stack([run.t, run.u, run.q, run.w]))
    return Log((folder / "log.txt",), "csv", _BARE, _motor("0", "1", "2", "3"))


@form
def matlab_writematrix(folder):
    run = levels(6)
    text = _text({"0": run.t, "1": run.u, "2": run.q}, digits=5, header=False)
    return Log(
        _write(folder / "data.csv", text),
        "csv",
        ("--time", "0=s", "--command", "1=V", "--position", "2=rad"),
        _motor("0", "1", "2", "", unit="V"),
    )


@form
def arduino_micros_pwm_counts(folder):
    run, counts, full = levels(7), 2400, 2.0
    columns = {
        "micros": np.round(4_211_340 + run.t * 1e6 + run.noise.normal(0, 40, run.t.size)).astype(int),
        "pwm": np.round(run.u / full * 255).astype(int),
        "counts": np.round(run.q * TURN * counts).astype(int),
    }
    truth = {
        "time": Truth("micros", "us"),
        "command": Truth("pwm", "-"),
        "position": Truth("counts", "rev", 1 / counts),
    }
    return Log(
        _write(folder / "serial.log", _text(columns)),
        "csv",
        ("--position", f"counts=counts/{counts}"),
        truth,
        gain=full / 255,
    )


@form
def arduino_with_text_between(folder):
    run, counts = levels(8), 4096
    lines = ["Booting...", "IMU ok, encoder ok", "t_ms,u_V,enc"]
    for k, (t, u, q) in enumerate(zip(run.t, run.u, run.q, strict=True)):
        lines.append(f"{round(t * 1000)},{u:.3f},{round(q * TURN * counts)}")
        if k in (400, 1210):
            lines.append("W: loop overrun")
        if k == 800:
            lines.append("free heap 18432")
    lines.append("done.")
    truth = {"time": Truth("t_ms", "ms"), "command": Truth("u_V", "V"), "position": Truth("enc", "rev", 1 / counts)}
    return Log(
        _write(folder / "putty.log", "\r\n".join(lines) + "\r\n"), "csv", ("--position", f"enc=counts/{counts}"), truth
    )


@form
def absolute_encoder_wraps(folder):
    run = multisine(4)
    raw = np.round(run.q * TURN * 4096 + 1000).astype(int) % 4096
    columns = {"time_ms": np.round(run.t * 1000).astype(int), "voltage_V": run.u, "angle_raw": raw}
    truth = {
        "time": Truth("time_ms", "ms"),
        "command": Truth("voltage_V", "V"),
        "position": Truth("angle_raw", "rev", 1 / 4096),
    }
    return Log(
        _write(folder / "as5600.csv", _text(columns, digits=3)), "csv", ("--position", "angle_raw=counts/4096"), truth
    )


@form
def degrees_wrap_at_180(folder):
    run = levels(9)
    angle = (run.q * DEG + 180.0) % 360.0 - 180.0
    names = ("time", "torque_Nm", "angle_deg", "speed_deg_s")
    columns = dict(zip(names, (run.t, run.u, angle, run.w * DEG), strict=True))
    return Log(
        _write(folder / "imu.csv", _text(columns, digits=3)), "csv", (), _motor(*names, angle="deg", speed="deg/s")
    )


@form
def milliamperes_degrees_rpm(folder):
    run, constant = levels(10), 0.5
    columns = {
        "t_ms": np.round(run.t * 1000).astype(int),
        "current_mA": run.u / constant * 1000,
        "angle_deg": run.q * DEG,
        "speed_rpm": run.w * RPM,
    }
    return Log(
        _write(folder / "bench.csv", _text(columns, digits=2)),
        "csv",
        (),
        _motor("t_ms", "current_mA", "angle_deg", "speed_rpm", "mA", "ms", "deg", "rpm"),
        gain=constant,
    )


@form
def epos_export(folder):
    run, counts, constant = multisine(5), 2000, 0.5
    above = (
        "EPOS Studio,3.7 Revision 1,,,\nExport,Data Recorder,,,\nNode,EPOS4 50/5 [Node 1],,,\n"
        "Note,run 4 after new grease,,,\nSampling period [ms],10,,,\nTrigger,single,,,\n\n"
    )
    columns = {
        "Time [ms]": np.round(run.t * 1000).astype(int),
        "Current demand value [mA]": np.round(run.u / constant * 1000).astype(int),
        "Position actual value [inc]": np.round(run.q * TURN * counts).astype(int),
        "Velocity actual value averaged [rpm]": np.round(run.w * RPM).astype(int),
    }
    names = list(columns)
    truth = {
        "time": Truth(names[0], "ms"),
        "command": Truth(names[1], "mA"),
        "position": Truth(names[2], "rev", 1 / counts),
        "velocity": Truth(names[3], "rpm"),
    }
    return Log(
        _write(folder / "recorder.csv", _text(columns, end=",", above=above)),
        "csv",
        ("--position", f"{names[2]}=counts/{counts}"),
        truth,
        gain=constant,
    )


@form
def rcbenchmark(folder):
    run = levels(11, one_way=True)
    full = 1.6
    zeros = np.full(run.t.size, "")
    columns = {
        "Time (s)": run.t,
        "ESC signal (µs)": 1000.0 + 1000.0 * run.u / full,
        "Servo 1 (µs)": zeros,
        "Torque (N·m)": zeros,
        "Thrust (N)": zeros,
        "Voltage (V)": 16.0 + 0.02 * run.noise.normal(size=run.t.size),
        "Current (A)": zeros,
        "Motor Optical Speed (RPM)": np.maximum(0, np.round(run.w * RPM)).astype(int),
        "App message": zeros,
    }
    truth = {
        "time": Truth("Time (s)", "s"),
        "command": Truth("ESC signal (µs)", "-", 0.001, -1.0),
        "velocity": Truth("Motor Optical Speed (RPM)", "rpm"),
        "supply": Truth("Voltage (V)", "V"),
    }
    return Log(
        _write(folder / "StepsTest.csv", "\ufeff" + _text(columns, digits=4)),
        "csv",
        ("--command", "`ESC signal (µs)` * 0.001 - 1=-"),
        truth,
        gain=full,
    )


@form
def one_signal_per_file(folder):
    run = levels(12)
    first = _write(folder / "voltage.csv", _text({"time [s]": run.t, "voltage [V]": run.u}))
    second = _write(
        folder / "encoder.csv",
        _text({"time [s]": run.t[::2] + 0.0013, "position [rad]": np.interp(run.t[::2] + 0.0013, run.t, run.q)}),
    )
    truth = {
        "time": Truth("voltage.time [s]", "s"),
        "command": Truth("voltage.voltage [V]", "V"),
        "position": Truth("encoder.position [rad]", "rad"),
    }
    return Log(first + second, "csv", (), truth)


@form
def two_runs_in_two_files(folder):
    files = ()
    names = ("time [s]", "torque [Nm]", "angle [rad]")
    for k, run in enumerate((levels(13), multisine(6)), 1):
        files += _write(folder / f"run{k}.csv", _text(dict(zip(names, (run.t, run.u, run.q), strict=True))))
    return Log(files, "csv", (), _motor(*names, w=""), records=2)


@form
def labview_lvm(folder):
    run = multisine(7)
    above = (
        "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\nDecimal_Separator\t,\n"
        "Multi_Headings\tNo\nX_Columns\tOne\nTime_Pref\tRelative\nOperator\tlab\nDate\t2023/05/11\n"
        "Time\t14:02:11,3310000\n***End_of_Header***\t\n\t\nChannels\t3\t\t\t\nSamples\t2000\t2000\t2000\t\n"
        "X_Dimension\tTime\tTime\tTime\t\nX0\t0,0E+0\t0,0E+0\t0,0E+0\t\nDelta_X\t0,010000\t0,010000\t0,010000\t\n"
        "***End_of_Header***\t\t\t\t\n"
    )
    names = ("X_Value", "Spannung [V]", "Winkel [rad]", "Drehzahl [rad/s]")
    columns = dict(zip(names, (run.t, run.u, run.q, run.w), strict=True)) | {"Comment": np.full(run.t.size, "")}
    return Log(
        _write(folder / "test_01.lvm", _text(columns, sep="\t", comma=True, above=above)),
        "lvm",
        (),
        _motor(*names, unit="V"),
    )


@form
def oscilloscope(folder):
    run, volts = levels(14), 10.0
    swing = float(np.abs(run.q).max())
    above = (
        "Model,MSO24\nFirmware Version,1.40.4\nWaveform Type,ANALOG\nPoint Format,Y\nHorizontal Units,s\n"
        "Horizontal Scale,2\nSample Interval,0.01\nRecord Length,2000\nProbe Attenuation,1,1\nVertical Units,V,V\n"
        "Label,drive,pot\n"
    )
    columns = {"TIME": run.t - 10.0, "CH1": run.u, "CH2": np.round(run.q / swing * volts, 3)}
    truth = {"time": Truth("TIME", "s"), "command": Truth("CH1", "V"), "position": Truth("CH2", "rad", swing / volts)}
    return Log(
        _write(folder / "tek0003.csv", _text(columns, digits=4, above=above)),
        "csv",
        ("--command", "CH1=V", "--position", f"CH2 * {swing / volts:.6g}=rad"),
        truth,
    )


def _two_channels(folder, name, head, row, truth, flags=()):
    """Write command and potentiometer as an oscilloscope does, by the line of a row."""
    run, volts = levels(14), 10.0
    swing = float(np.abs(run.q).max())
    rows = zip(range(run.t.size), run.t - 10.0, run.u, np.round(run.q / swing * volts, 3), strict=True)
    time, command, sensor = truth
    quoted = sensor if sensor.isidentifier() else f"`{sensor}`"
    found = {"command": Truth(command, "V"), "position": Truth(sensor, "rad", swing / volts)}
    return Log(
        _write(folder / name, head + "".join(row.format(*one) for one in rows)),
        "csv",
        ("--command", f"{command}=V", "--position", f"{quoted} * {swing / volts:.6g}=rad", *flags),
        found | ({"time": Truth(time, "s")} if time else {}),
    )


@form
def oscilloscope_commas_behind(folder):
    head = "Model,TBS1052C,,\nSample Interval,0.01,,\nRecord Length,2000,,\nVertical Units,V,V,\n,,,\nTIME,CH1,CH2,\n"
    return _two_channels(folder, "tek.csv", head, "{1:.4f},{2:.4f},{3:.3f},\n", ("TIME", "CH1", "CH2"))


@form
def oscilloscope_numbered_channels(folder):
    head = "x-axis,1,2\nsecond,Volt,Volt\n"
    return _two_channels(folder, "scope_1.csv", head, "{1:.4e},{2:.4e},{3:.4e}\n", ("x-axis", "1", "2"))


@form
def oscilloscope_start_and_increment(folder):
    head = "X,CH1,CH2,Start,Increment,\nSequence,Volt,Volt,-1.000000e+01,1.000000e-02\n"
    return _two_channels(folder, "NewFile1.csv", head, "{0},{2:.4e},{3:.4e},,\n", ("", "CH1", "CH2"))


@form
def serial_plotter(folder):
    run = multisine(4)
    lines = [
        f"t_ms:{1000 * t:.0f},u_V:{u:.3f},angle_deg:{q * DEG:.3f}\n"
        for t, u, q in zip(run.t, run.u, run.q, strict=True)
    ]
    truth = _motor("t_ms", "u_V", "angle_deg", "", "V", "ms", "deg")
    return Log(_write(folder / "plotter.txt", "Ready\n" + "".join(lines)), "labels", (), truth)


@form
def teleplot(folder):
    run = levels(21)
    lines = []
    for t, u, q, w in zip(run.t, run.u, run.q, run.w, strict=True):
        stamp = 1627551892437 + 1000 * t
        lines += [
            f">torque:{stamp:.0f}:{u:.3f}§Nm",
            f">angle:{stamp:.0f}:{q:.5f}§rad|g",
            f">speed:{stamp:.0f}:{w:.4f}§rad/s",
        ]
    text = ">state:ready|t\n" + "\n".join(lines) + "\n"
    return Log(
        _write(folder / "teleplot.txt", text), "labels", (), _motor("time", "torque", "angle", "speed", time="ms")
    )


@form
def console_log(folder):
    run = multisine(22)
    lines = [
        f"[09:59:{40 + t:06.3f}] INFO motor: pos={q:.5f} vel={w:.4f} tau={u:.3f}\n"
        if t < 20.0
        else f"[10:00:{t - 20.0:06.3f}] INFO motor: pos={q:.5f} vel={w:.4f} tau={u:.3f}\n"
        for t, u, q, w in zip(run.t, run.u, run.q, run.w, strict=True)
    ]
    lines[500:500] = ["[09:59:45.000] WARN can: bus load 61 %\n"]
    flags = ("--command", "=Nm")
    return Log(_write(folder / "node.log", "".join(lines)), "labels", flags, _motor("time", "tau", "pos", "vel"))


@form
def siemens_trace_two_columns_of_time(folder):
    run = levels(35)
    lines = [
        "Startdrive Trace;;;;",
        "Datum;Uhrzeit;Momentensollwert;Lageistwert;Drehzahlistwert",
        "TT.MM.JJJJ;hh:mm:ss,ms;Nm;°;1/min",
    ]
    rows = (
        f"29.11.2026;10:00:{10 + t:06.3f};{u:.3f};{q * DEG:.3f};{w * RPM:.2f}".replace(".", ",").replace(",11,", ".11.")
        for t, u, q, w in zip(run.t, run.u, run.q, run.w, strict=True)
    )
    path = _write(folder / "trace.csv", "\n".join([*lines, *rows]) + "\n", "cp1252")
    truth = _motor("Uhrzeit", "Momentensollwert", "Lageistwert", "Drehzahlistwert", angle="deg", speed="rpm")
    return Log(path, "csv", (), truth)


@form
def pandas_dates_as_index(folder):
    run = levels(40)
    rows = (
        f"2025-03-30 12:00:{10 + t:09.6f}+02:00,{u:.3f},{q * DEG:.4f}"
        for t, u, q in zip(run.t, run.u, run.q, strict=True)
    )
    text = ",torque_Nm,angle_deg\n" + "\n".join(rows) + "\n"
    return Log(_write(folder / "frame.csv", text), "csv", (), _motor("0", "torque_Nm", "angle_deg", "", angle="deg"))


@form
def matlab_timetable_with_durations(folder):
    run = levels(41)
    rows = (f"{t:.5g} sec,{u:.6g},{q:.8g},{w:.6g}" for t, u, q, w in zip(run.t, run.u, run.q, run.w, strict=True))
    path = _write(folder / "tt.csv", "Time,torque,angle,speed\n" + "\n".join(rows) + "\n")
    return Log(path, "csv", (), _motor("Time", "torque", "angle", "speed"))


@form
def spreadsheet_with_german_thousands(folder):
    run = levels(42)
    cells = (f"{1e3 * t:,.0f}\t{1e3 * u:,.1f}\t{q * DEG:,.3f}" for t, u, q in zip(run.t, run.u, run.q, strict=True))
    rows = [row.translate(str.maketrans(",.", ".,")) for row in cells]
    path = _write(folder / "paste.txt", "\n".join(["Zeit (ms)\tMoment (mNm)\tWinkel (Grad)", *rows]) + "\n")
    truth = _motor("Zeit (ms)", "Moment (mNm)", "Winkel (Grad)", "", "mN·m", "ms", "deg")
    return Log(path, "csv", (), truth)


@form
def columns_of_one_name_with_units(folder):
    run = levels(48)
    rows = (
        f"{t:.3f},{u:.4f} Nm,{q:.5f} rad,{w:.4f} rad/s" for t, u, q, w in zip(run.t, run.u, run.q, run.w, strict=True)
    )
    path = _write(folder / "values.csv", "t,value,value,value\n" + "\n".join(rows) + "\n")
    return Log(path, "csv", (), _motor("t", "value.1", "value.2", "value.3"))


@form
def rows_of_signals(folder):
    run = levels(45)
    signals = {"t [s]": run.t, "u [Nm]": run.u, "q [rad]": run.q}
    text = "".join(f"{name},{','.join(f'{one:.6g}' for one in values)}\n" for name, values in signals.items())
    return Log(_write(folder / "rows.csv", text), "csv", (), _motor("t [s]", "u [Nm]", "q [rad]", ""))


@form
def elmo_recorder(folder):
    run = levels(51)
    counts = 4096 / (2.0 * pi)
    rows = (
        f"{k},{u:.3f},{q * counts:.0f},{w * counts:.0f}"
        for k, (u, q, w) in enumerate(zip(run.u, run.q, run.w, strict=True))
    )
    head = "Elmo Recorder\nResolution[s],0.01\n\nIndex,Current Command [A],Position [cnt],Velocity [cnt/sec]\n"
    path = _write(folder / "elmo.csv", head + "\n".join(rows) + "\n")
    names = "Current Command [A]", "Position [cnt]", "Velocity [cnt/sec]"
    truth = {
        "command": Truth(names[0], "A"),
        "position": Truth(names[1], "rad", 1.0 / counts),
        "velocity": Truth(names[2], "rad/s", 1.0 / counts),
    }
    return Log(path, "csv", ("--position", f"{names[1]}=counts/4096"), truth)


@form
def ros2_topic_echo(folder):
    run = levels(52)
    message = (
        "header:\n  stamp:\n    sec: {0}\n    nanosec: {1}\n  frame_id: ''\nname:\n- motor\nposition:\n- {2:.6f}\n"
        "velocity:\n- {3:.5f}\neffort:\n- {4:.4f}\n---\n"
    )
    rows = zip(run.t, run.q, run.w, run.u, strict=True)
    text = "".join(message.format(1_700_000_000 + int(t), round(t % 1 * 1e9), q, w, u) for t, q, w, u in rows)
    truth = _motor("stamp", "effort[0]", "position[0]", "velocity[0]")
    return Log(_write(folder / "echo.txt", text), "echo", (), truth)


@form
def dictionaries_as_python_prints_them(folder):
    run = levels(53)
    rows = zip(run.t.tolist(), run.u.tolist(), run.q.tolist(), strict=True)
    lines = [str({"t": round(t, 3), "torque_Nm": round(u, 4), "pos_rad": round(q, 6)}) for t, u, q in rows]
    path = _write(folder / "out.txt", "\n".join(["connected", *lines]) + "\n")
    return Log(path, "labels", (), _motor("t", "torque_Nm", "pos_rad", ""))


@form
def topics_and_paths_row_by_row(folder):
    run = levels(54)
    rows = (
        f"{t:.4f},/joint_states,position[0],{q:.6f}\n{t + 0.0002:.4f},/cmd,torque,{u:.4f}\n"
        for t, q, u in zip(run.t, run.q, run.u, strict=True)
    )
    path = _write(folder / "plot.csv", "elapsed time,topic,message path,value\n" + "".join(rows))
    names = "/cmd.torque", "/joint_states.position[0]"
    flags = ("--command", f"{names[0]}=Nm", "--position", f"{names[1]}=rad")
    return Log(path, "csv", flags, _motor(f"{names[1]}.elapsed time", *names, ""))


@form
def ros2_topic_echo_csv(folder):
    run = levels(39)
    rows = zip(run.t, run.q, run.w, run.u, strict=True)
    lines = (
        f"{1_700_000_000 + int(t)},{round(t % 1 * 1e9)},base,motor,{q:.6f},{w:.5f},{u:.4f}\n" for t, q, w, u in rows
    )
    path = _write(folder / "joint_states.csv", "".join(lines))
    return Log(path, "csv", ("--command", "6=Nm"), _motor("stamp", "6", "4", "5"))


@form
def date_and_clock(folder):
    run = multisine(9)
    days = np.where(run.t < 4.0, "12.11.2025", "13.11.2025")
    clocks = [f"23:59:{56 + t:06.3f}" if t < 4.0 else f"00:00:{t - 4.0:06.3f}" for t in run.t]
    columns = {"Date": list(days), "Time": clocks, "torque [N·m]": run.u, "position [rad]": run.q}
    return Log(
        _write(folder / "logger.csv", _text(columns)),
        "csv",
        (),
        _motor("Time", "torque [N·m]", "position [rad]", ""),
    )


@form
def plotjuggler_sparse(folder):
    run = levels(15)
    stamps = 1_700_000_000.0 + run.t
    half = np.arange(0, run.t.size, 2)
    rows = [(t, f"{u:.4f}", "", "") for t, u in zip(stamps + 0.0004, run.u, strict=True)]
    rows += [
        (stamps[k] + 0.0021, "", f"{np.interp(run.t[k] + 0.0021, run.t, run.q):.6f}", f"{run.w[k]:.5f}") for k in half
    ]
    text = "__time,/joint_command/motor/effort,/joint_states/motor/position,/joint_states/motor/velocity\n"
    text += "".join(f"{t:.6f},{u},{q},{w}\n" for t, u, q, w in sorted(rows))
    names = text.split("\n", 1)[0].split(",")
    flags = ("--command", f"{names[1]}=N·m", "--position", f"{names[2]}=rad", "--velocity", f"{names[3]}=rad/s")
    return Log(_write(folder / "plotjuggler.csv", text), "csv", flags, _motor(*names))


@form
def rostopic_echo(folder):
    run = levels(16)
    names = (
        "%time",
        "field.header.seq",
        "field.header.stamp",
        "field.header.frame_id",
        "field.name0",
        "field.position0",
        "field.velocity0",
        "field.effort0",
    )
    stamp = 1_600_000_000_000_000_000 + np.round(run.t * 1e9).astype(np.int64)
    texts = np.full(run.t.size, ""), np.full(run.t.size, "motor")
    columns = dict(zip(names, (stamp + 90_000, np.arange(run.t.size), stamp, *texts, run.q, run.w, run.u), strict=True))
    flags = (
        "--time",
        "field.header.stamp=ns",
        "--command",
        "field.effort0=N·m",
        "--position",
        "field.position0=rad",
        "--velocity",
        "field.velocity0=rad/s",
    )
    return Log(
        _write(folder / "joint_states.csv", _text(columns)),
        "csv",
        flags,
        _motor(names[2], names[7], names[5], names[6], time="ns"),
    )


@form
def pandas_index(folder):
    run = multisine(8)
    columns = {"": np.arange(run.t.size)} | _si(run, t="time", u="torque_Nm", q="position_rad", w="velocity_rad_s")
    return Log(
        _write(folder / "frame.csv", _text(columns)),
        "csv",
        (),
        _motor("time", "torque_Nm", "position_rad", "velocity_rad_s"),
    )


@form
def iso_dates(folder):
    run = levels(17)
    begin = np.datetime64("2024-05-01T10:00:00.000000")
    stamps = [str(begin + np.timedelta64(round(t * 1e6), "us")) for t in run.t]
    columns = {"timestamp": stamps, "voltage (V)": run.u, "position (rad)": run.q}
    return Log(
        _write(folder / "telemetry.csv", _text(columns)),
        "csv",
        (),
        _motor("timestamp", "voltage (V)", "position (rad)", "", "V", "iso8601"),
    )


@form
def unix_seconds(folder):
    run = multisine(9)
    columns = {
        "timestamp": 1_714_557_600.0 + run.t,
        "torque [N·m]": run.u,
        "position [rad]": run.q,
        "velocity [rad/s]": run.w,
    }
    return Log(_write(folder / "telemetry.csv", _text(columns)), "csv", (), _motor(*columns))


@form
def quoted_windows(folder):
    run, names = levels(18), ("Time [s]", "Current [A]", "Position [rad]", "Velocity [rad/s]")
    cells = zip(run.t, run.u, run.q, run.w, strict=True)
    text = (
        ",".join(f'"{name}"' for name in names)
        + "\r\n"
        + "".join(",".join(f'"{value:.5f}"' for value in row) + "\r\n" for row in cells)
    )
    return Log(_write(folder / "export.csv", "\ufeff" + text), "csv", (), _motor(*names, unit="A"))


@form
def pipes(folder):
    run, names = levels(19), ("t [s]", "u [V]", "angle [deg]", "speed [deg/s]")
    columns = dict(zip(names, (run.t, run.u, run.q * DEG, run.w * DEG), strict=True))
    return Log(
        _write(folder / "table.txt", _text(columns, sep="|")),
        "csv",
        (),
        _motor(*names, unit="V", angle="deg", speed="deg/s"),
    )


@form
def notes_behind_hashes(folder):
    run = multisine(10)
    above = "# motor: 42BLS, unloaded\n# rate: 100 Hz\n# torque constant: 0.07 N·m/A\n"
    names = ("time_s", "torque_Nm", "theta_rad", "omega_rad_s")
    return Log(
        _write(folder / "run.csv", _text(dict(zip(names, (run.t, run.u, run.q, run.w), strict=True)), above=above)),
        "csv",
        (),
        _motor(*names),
    )


@form
def without_a_time(folder):
    run = levels(20)
    columns = {"target": run.u, "angle": run.q, "velocity": run.w}
    flags = ("--rate", "100", "--command", "target=V", "--position", "angle=rad", "--velocity", "velocity=rad/s")
    truth = _motor("", "target", "angle", "velocity", unit="V")
    return Log(_write(folder / "monitor.txt", _text(columns, sep="\t", digits=4)), "csv", flags, truth)


@form
def linear_axis_millimetres(folder):
    run, length = levels(21), 0.01
    columns = {
        "t [ms]": run.t * 1000,
        "force [N]": run.u,
        "x [mm]": run.q * length * 1000,
        "v [mm/s]": run.w * length * 1000,
    }
    return Log(
        _write(folder / "stage.csv", _text(columns, digits=4)),
        "csv",
        (),
        _motor(*columns, "N", "ms", "mm", "mm/s"),
        length=length,
    )


@form
def controlled_in_position(folder):
    run = simulate_loop(22)
    reference, loop = run
    columns = {
        "time [s]": loop.t,
        "setpoint [rad]": reference,
        "position [rad]": loop.q,
        "velocity [rad/s]": loop.w,
        "output [V]": loop.u,
    }
    truth = _motor("time [s]", "output [V]", "position [rad]", "velocity [rad/s]", unit="V")
    return Log(
        _write(folder / "loop.csv", _text(columns)), "csv", (), truth | {"reference": Truth("setpoint [rad]", "rad")}
    )


@cache
def simulate_loop(seed: int) -> tuple[np.ndarray, Run]:
    """Set-points that jump, followed by a proportional controller with velocity feedback; returns them and the run."""
    chance = np.random.default_rng(seed)
    reference = np.repeat(chance.uniform(-3.0, 3.0, 25), 80)
    command = np.zeros(reference.size)
    q = w = 0.0
    step = 1.0 / RATE / _FINE
    for k, target in enumerate(reference):
        command[k] = u = float(np.round(np.clip(2.0 * (target - q) - 0.1 * w, -1.5, 1.5), 4))
        for _ in range(_FINE):
            if w == 0.0 and abs(u) <= COULOMB:
                continue
            sign = np.sign(w) if w else np.sign(u)
            new = w + step * (u - VISCOUS * w - COULOMB * sign) / INERTIA
            new = 0.0 if new * sign < 0.0 and abs(u) <= COULOMB else new
            q, w = q + 0.5 * step * (w + new), new
    return reference, simulate(command, seed)


# Drives


@form
def odrive(folder):
    run, constant = levels(23), 0.5
    columns = {
        "t": run.t,
        "pos_estimate": run.q * TURN,
        "vel_estimate": run.w * TURN,
        "Iq_setpoint": run.u / constant,
        "Iq_measured": run.u / constant + run.noise.normal(0, 0.02, run.t.size),
    }
    truth = {
        "time": Truth("t", "s"),
        "command": Truth("Iq_setpoint", "A"),
        "position": Truth("pos_estimate", "rev"),
        "velocity": Truth("vel_estimate", "rev/s"),
        "effort": Truth("Iq_measured", "A"),
    }
    return Log(_write(folder / "odrive.csv", _text(columns)), "csv", (), truth, gain=constant)


@form
def moteus(folder):
    run = multisine(11)
    columns = {
        "time": run.t,
        "mode": np.full(run.t.size, 10),
        "position": run.q * TURN,
        "velocity": run.w * TURN,
        "torque": run.u + run.noise.normal(0, 0.01, run.t.size),
        "q_current": run.u / 0.5,
        "command_feedforward_torque": run.u,
        "voltage": np.full(run.t.size, 24.1),
    }
    truth = {
        "time": Truth("time", "s"),
        "command": Truth("command_feedforward_torque", "N·m"),
        "position": Truth("position", "rev"),
        "velocity": Truth("velocity", "rev/s"),
        "effort": Truth("torque", "N·m"),
        "supply": Truth("voltage", "V"),
    }
    return Log(_write(folder / "moteus.csv", _text(columns)), "csv", (), truth)


@form
def vesc(folder):
    run, pairs, full = levels(24), 7, 2.0
    n = run.t.size
    columns = {
        "ms_today": np.round(36_000_000 + run.t * 1000).astype(int),
        "input_voltage": np.full(n, 24.0),
        "temp_mos_max": np.full(n, 31.2),
        "temp_motor": np.full(n, 28.0),
        "current_motor": run.u,
        "current_in": np.abs(run.u) * 0.2,
        "d_axis_current": np.zeros(n),
        "q_axis_current": run.u,
        "erpm": np.round(run.w * RPM * pairs, 1),
        "duty_cycle": run.u / full,
        "tachometer": np.round(run.q * TURN * 6 * pairs).astype(int),
    }
    truth = {
        "time": Truth("ms_today", "ms"),
        "command": Truth("duty_cycle", "-"),
        "velocity": Truth("erpm", "rpm", 1 / pairs),
        "position": Truth("tachometer", "rev", 1 / (6 * pairs)),
        "supply": Truth("input_voltage", "V"),
        "temperature": Truth("temp_motor", "°C"),
    }
    flags = ("--velocity", f"erpm / {pairs}=rpm", "--position", f"tachometer=counts/{6 * pairs}")
    return Log(_write(folder / "vesc.csv", _text(columns, sep=";", digits=4)), "csv", flags, truth, gain=full)


@form
def dynamixel_registers(folder):
    run, full = levels(25), 2.0
    n = run.t.size
    columns = {
        "time": run.t,
        "Goal PWM": np.round(run.u / full * 885).astype(int) % 65536,
        "Present Position": np.round(run.q * TURN * 4096).astype(np.int64) % (1 << 32),
        "Present Velocity": np.round(run.w * RPM / 0.229).astype(np.int64) % (1 << 32),
        "Present Current": np.round(run.u / 0.5 * 1000 / 2.69).astype(int) % 65536,
        "Present Input Voltage": np.full(n, 121),
        "Present Temperature": np.full(n, 33),
    }
    truth = {
        "time": Truth("time", "s"),
        "command": Truth("Goal PWM", "%", 100 / 885),
        "position": Truth("Present Position", "rev", 1 / 4096),
        "velocity": Truth("Present Velocity", "rpm", 0.229),
        "effort": Truth("Present Current", "mA", 2.69),
        "supply": Truth("Present Input Voltage", "V", 0.1),
        "temperature": Truth("Present Temperature", "°C"),
    }
    return Log(_write(folder / "xm430.csv", _text(columns)), "csv", (), truth, gain=full)


@form
def pid_library(folder):
    """The controller's words: its input is what was measured."""
    reference, loop = simulate_loop(64)
    columns = {
        "millis": np.round(loop.t * 1000).astype(int),
        "Setpoint": reference,
        "Input": loop.q,
        "Output": np.round(loop.u * 100, 2),
    }
    truth = _motor("millis", "Output", "Input", "", unit="-", time="ms") | {"reference": Truth("Setpoint", "rad")}
    return Log(_write(folder / "pid.csv", _text(columns)), "csv", (), truth, gain=0.01)


@form
def simplefoc_monitor(folder):
    """Target, voltage, velocity and angle, without names and without a time."""
    reference, loop = simulate_loop(63)
    columns = {"target": reference, "voltage": loop.u, "velocity": loop.w, "angle": loop.q}
    text = "Monitor enabled!\n" + _text(columns, sep="\t", digits=4, header=False)
    return Log(_write(folder / "foc.txt", text), "csv", ("--rate", "100"), _motor("", "1", "3", "2", unit="-"))


@form
def franka_log_of_seven_joints(folder):
    run = levels(77)
    still, noise = np.zeros(run.t.size), run.noise
    joints = {"q": run.q, "dq": run.w, "tau_J": run.u + noise.normal(0, 0.01, run.t.size), "tau_J_d": run.u}
    columns = {"time": run.t}
    for name, moving in joints.items():
        columns |= {f"{name}[{k}]": moving if k == 3 else still + 0.1 * k for k in range(7)}
    truth = _motor("time", "tau_J_d[3]", "q[3]", "dq[3]")
    return Log(_write(folder / "franka.csv", _text(columns)), "csv", (), truth)


@form
def epos_torque_in_per_mille(folder):
    run = levels(65)
    names = ("Time [ms]", "Torque demand value [‰]", "Position actual value [deg]", "Velocity actual value [rpm]")
    columns = dict(zip(names, (1000 * run.t, 100 * run.u, run.q * DEG, run.w * RPM), strict=True))
    truth = _motor(*names, unit="%", time="ms", angle="deg", speed="rpm")
    truth["command"] = Truth(names[1], "%", 0.1)
    return Log(_write(folder / "epos4.csv", _text(columns, sep=";")), "csv", (), truth, gain=10.0)


@form
def servo_telemetry_with_sign_bits(folder):
    run, full = multisine(13), 4.0
    counts = 4096 / (2 * pi)
    columns = {
        "timestamp": run.t,
        "pos (1)": np.round(run.q * counts + 2048).astype(int),
        "speed (1)": _sign_bit(run.w * counts, 15),
        "load (1)": _sign_bit(run.u / full * 1000, 10),
        "current (1)": np.round(np.abs(run.u) * 30).astype(int),
    }
    flags = ("--position", "pos (1)=counts/4096", "--command", "load (1)=-")
    truth = {
        "time": Truth("timestamp", "s"),
        "command": Truth("load (1)", "-"),
        "position": Truth("pos (1)", "rad", 1 / counts),
        "velocity": Truth("speed (1)", "rad/s", 1 / counts),
    }
    return Log(_write(folder / "telemetry.csv", _text(columns)), "csv", flags, truth, gain=full / 1000)


def _sign_bit(values, bit):
    whole = np.round(values).astype(int)
    return np.where(whole < 0, -whole + (1 << bit), whole)


@form
def feetech_registers(folder):
    run, full = multisine(12), 4.0
    n = run.t.size
    columns = {
        "timestamp": 1_720_000_000.0 + run.t,
        "Present_Position": np.round(run.q * TURN * 4096 + 2048).astype(int) % 4096,
        "Present_Velocity": _sign_bit(run.w * TURN * 4096, 15),
        "Present_Load": _sign_bit(run.u / full * 1000, 10),
        "Present_Voltage": np.full(n, 74),
        "Present_Temperature": np.full(n, 30),
        "Present_Current": np.round(np.abs(run.u) * 1000 / 6.5).astype(int),
    }
    truth = {
        "time": Truth("timestamp", "s"),
        "command": Truth("Present_Load", "%", 0.1),
        "position": Truth("Present_Position", "rev", 1 / 4096),
        "velocity": Truth("Present_Velocity", "rev/s", 1 / 4096),
        "supply": Truth("Present_Voltage", "V", 0.1),
        "temperature": Truth("Present_Temperature", "°C"),
    }
    return Log(_write(folder / "sts3215.csv", _text(columns)), "csv", (), truth, gain=full)


@form
def codesys_trace(folder):
    run, ms = levels(26), np.round(levels(26).t * 1000).astype(int)
    signals = {"PLC_PRG.rTorque_Nm": run.u, "PLC_PRG.rPosition_rad": run.q, "PLC_PRG.rVelocity_rad_s": run.w}
    text = "[key]; [value]\nVersion; 0x03050000\nName; Application.Trace\nIecTaskName; MainTask\nBufferEntries; 2000\n"
    for k, (name, values) in enumerate(signals.items()):
        text += f"{k}.Variable; {name}\n{k}.Class; 14\n{k}.Size; 4\n{k}.GraphColor; 4282811060\n{k}.Data; \n"
        text += "".join(f"; {t}; {value:.6g}\n" for t, value in zip(ms + 2, values, strict=True))
    return Log(
        _write(folder / "axis.trace.csv", text), "codesys", (), _motor("PLC_PRG.rTorque_Nm.time", *signals, time="ms")
    )


@form
def blocks_of_text(folder):
    run = levels(27)
    text = ""
    for name, values, place in (("voltage [V]", run.u, slice(None)), ("position [rad]", run.q, slice(0, None, 2))):
        text += f"{name}\ntime_s\tvalue\n"
        text += "".join(f"{t:.4f}\t{value:.6f}\n" for t, value in zip(run.t[place], values[place], strict=True)) + "\n"
    return Log(
        _write(folder / "curves.txt", text),
        "blocks",
        (),
        _motor("voltage [V].time", "voltage [V]", "position [rad]", "", unit="V"),
    )


# Other forms


@form
def json_list(folder):
    run = levels(28)
    rows = [
        dict(zip(("time", "torque_Nm", "position_rad"), map(float, row), strict=True))
        for row in zip(run.t, run.u, run.q, strict=True)
    ]
    return Log(
        _write(folder / "log.json", json.dumps(rows)), "json", (), _motor("time", "torque_Nm", "position_rad", "")
    )


@form
def json_columns(folder):
    run = multisine(13)
    content = {"rate": RATE, "t": run.t.tolist(), "voltage_V": run.u.tolist(), "angle_deg": (run.q * DEG).tolist()}
    return Log(
        _write(folder / "log.json", json.dumps(content)),
        "json",
        (),
        _motor("t", "voltage_V", "angle_deg", "", "V", angle="deg"),
    )


@form
def json_lines(folder):
    run = levels(29)
    lines = [
        json.dumps(
            {
                "ts_ms": round(t * 1000),
                "motor": {"torque_Nm": round(u, 4), "pos_rad": round(q, 6), "vel_rad_s": round(w, 5)},
            }
        )
        for t, u, q, w in zip(run.t, run.u, run.q, run.w, strict=True)
    ]
    return Log(
        _write(folder / "telemetry.jsonl", "\n".join(lines) + "\n"),
        "jsonl",
        (),
        _motor("ts_ms", "motor.torque_Nm", "motor.pos_rad", "motor.vel_rad_s", time="ms"),
    )


_SYSID = {
    "quasistatic-forward": "slow-forward",
    "quasistatic-reverse": "slow-backward",
    "dynamic-forward": "fast-forward",
    "dynamic-reverse": "fast-backward",
}


@form
def sysid_json(folder):
    content = {"sysid": True, "test": "Simple", "units": "Rotations", "unitsPerRotation": 1.0}
    begin = 41.2
    for name, run in sysid().items():
        content[_SYSID[name]] = [
            [begin + t, u, q * TURN, w * TURN] for t, u, q, w in zip(run.t, run.u, run.q, run.w, strict=True)
        ]
        begin += run.t[-1] + 4.0
    text = json.dumps(dict(sorted(content.items())))
    return Log(
        _write(folder / "sysid_data20230211-101501.json", text),
        "sysid",
        (),
        _motor("time", "voltage", "position", "velocity", "V", angle="rev", speed="rev/s"),
        records=4,
    )


@form
def wpilib_data_log(folder):
    entries = [
        ("NT:/FMSInfo/MatchNumber", "int64", '{"source":"NT"}'),
        ("voltage-wheel-shooter", "double", "Volt"),
        ("position-wheel-shooter", "double", "Rotation"),
        ("velocity-wheel-shooter", "double", "Rotation per Second"),
        ("sysid-test-state-shooter", "string", ""),
    ]
    records, begin = [(0, 1000, 0)], 12.5
    for name, run in sysid().items():
        for t, u, q, w in zip(run.t, run.u, run.q, run.w, strict=True):
            stamp = round((begin + t) * 1e6)
            records += [(1, stamp, u), (2, stamp + 20, q * TURN), (3, stamp + 35, w * TURN), (4, stamp + 50, name)]
        begin += run.t[-1]
        records.append((4, round((begin + 0.02) * 1e6), "none"))
        begin += 3.0
    (folder / "FRC_20240211_101501.wpilog").write_bytes(wpilog(entries, records))
    names = [entry[0] for entry in entries[1:4]]
    return Log(
        (folder / "FRC_20240211_101501.wpilog",),
        "wpilog",
        (),
        _motor(f"{names[0]}.time", *names, "V", angle="rev", speed="rev/s"),
        records=4,
    )


@form
def mat_arrays(folder):
    from scipy.io import savemat

    run = levels(30)
    savemat(folder / "log.mat", {"t": run.t[:, None], "u_V": run.u[:, None], "theta_rad": run.q[:, None]})
    return Log((folder / "log.mat",), "mat", (), _motor("t", "u_V", "theta_rad", "", "V"))


@form
def mat_structure_with_time(folder):
    from scipy.io import savemat

    run = multisine(14)
    signals = [
        {"values": values[:, None], "dimensions": 1.0, "label": label, "title": "", "plotStyle": 0.0}
        for label, values in (("voltage", run.u), ("position", run.q), ("velocity", run.w))
    ]
    savemat(
        folder / "scope.mat", {"ScopeData": {"time": run.t[:, None], "signals": signals, "blockName": "motor/Scope"}}
    )
    names = [f"ScopeData.{name}" for name in ("time", "voltage", "position", "velocity")]
    flags = ("--command", f"{names[1]}=V", "--position", f"{names[2]}=rad", "--velocity", f"{names[3]}=rad/s")
    return Log((folder / "scope.mat",), "mat", flags, _motor(*names, "V"))


@form
def mat_data_set(folder):
    from scipy.io import savemat

    run = levels(31)
    two = slice(0, None, 2)
    elements = [
        {"Name": name, "Values": {"Time": t[:, None], "Data": x[:, None], "DataInfo": {"Units": unit}}}
        for name, t, x, unit in (("torque", run.t, run.u, "N*m"), ("position", run.t[two], run.q[two], "rad"))
    ]
    savemat(folder / "logsout.mat", {"logsout": np.array(elements, dtype=object)})
    return Log(
        (folder / "logsout.mat",),
        "mat",
        (),
        _motor("logsout.torque.Time", "logsout.torque.Data", "logsout.position.Data", ""),
    )


@form
def mat_timetable(folder):
    run = multisine(20)
    columns = [values[:, None] for values in (run.u, run.q, run.w)]
    inner = {
        "data": columns,
        "varNames": ["torque", "position", "velocity"],
        "varUnits": ["N*m", "rad", "rad/s"],
        "rowTimes": {"origin": Ref(2), "stepSize": np.zeros((0, 0)), "sampleRate": np.array([[RATE]])},
        "numRows": np.array([[float(run.t.size)]]),
    }
    objects = [("timetable", {"any": inner}, True), ("duration", {"millis": np.zeros((1, 1))}, False)]
    mat_objects(folder / "log.mat", {"TT": 1}, objects)
    return Log((folder / "log.mat",), "mat", (), _motor("TT.Time", "TT.torque", "TT.position", "TT.velocity"))


@form
def mat_version_7_3(folder):
    run = multisine(15)
    mat_hdf5(folder / "log.mat", {"log": {"t": run.t, "torque_Nm": run.u, "theta_deg": run.q * DEG}, "operator": "lab"})
    return Log((folder / "log.mat",), "mat", (), _motor("log.t", "log.torque_Nm", "log.theta_deg", "", angle="deg"))


@form
def npz(folder):
    run = levels(32)
    np.savez_compressed(folder / "run.npz", time=run.t, voltage_V=run.u, position_rad=run.q, velocity_rad_s=run.w)
    return Log((folder / "run.npz",), "npz", (), _motor("time", "voltage_V", "position_rad", "velocity_rad_s", "V"))


@form
def npy(folder):
    run = levels(33)
    np.save(folder / "run.npy", np.column_stack([run.t, run.u, run.q, run.w]))
    return Log((folder / "run.npy",), "npy", _BARE, _motor("0", "1", "2", "3"))


@form
def npy_fields(folder):
    run = multisine(16)
    rows = np.zeros(run.t.size, dtype=[("time_us", "i8"), ("current_A", "f4"), ("angle_deg", "f4")])
    rows["time_us"], rows["current_A"], rows["angle_deg"] = np.round(run.t * 1e6), run.u, run.q * DEG
    np.save(folder / "run.npy", rows)
    return Log((folder / "run.npy",), "npy", (), _motor("time_us", "current_A", "angle_deg", "", "A", "us", "deg"))


@form
def hdf5_groups(folder):
    import h5py

    run = levels(34)
    with h5py.File(folder / "run.h5", "w") as file:
        for name, values, unit in (
            ("time", run.t * 1000, "ms"),
            ("voltage", run.u, "V"),
            ("position", run.q * DEG, "deg"),
            ("velocity", run.w * RPM, "rpm"),
        ):
            file.create_dataset(f"axis1/{name}", data=values, compression="gzip")
            file[f"axis1/{name}"].attrs["units"] = unit
    names = [f"axis1/{name}" for name in ("time", "voltage", "position", "velocity")]
    return Log((folder / "run.h5",), "hdf5", (), _motor(*names, "V", "ms", "deg", "rpm"))


@form
def hdf5_two_rates(folder):
    import h5py

    run = multisine(17)
    with h5py.File(folder / "daq.hdf5", "w") as file:
        for group, name, k, values, unit in (
            ("drive", "torque", 1, run.u, "N·m"),
            ("encoder", "angle", 2, run.q, "rad"),
        ):
            file[f"{group}/time"] = run.t[::k]
            file[f"{group}/{name}"] = values[::k]
            file[f"{group}/time"].attrs["units"], file[f"{group}/{name}"].attrs["units"] = "s", unit
    return Log((folder / "daq.hdf5",), "hdf5", (), _motor("drive/time", "drive/torque", "encoder/angle", ""))


@form
def hdf5_table_of_pandas(folder):
    import pickle

    import h5py

    run = levels(35)
    rows = np.zeros(run.t.size, dtype=[("index", "f8"), ("values_block_0", "f8", (3,))])
    rows["index"], rows["values_block_0"] = run.t, np.column_stack([run.u, run.q, run.w])
    with h5py.File(folder / "frame.h5", "w") as file:
        file["df/table"] = rows
        names = ["torque_Nm", "position_rad", "velocity_rad_s"]
        file["df/table"].attrs["values_block_0_kind"] = np.bytes_(pickle.dumps(names, protocol=0))
    return Log(
        (folder / "frame.h5",),
        "hdf5",
        ("--time", "df/table/index=s"),
        _motor("df/table/index", *(f"df/table/{name}" for name in names)),
    )


@form
def parquet(folder):
    import pyarrow as pa
    from pyarrow import parquet as writer

    run = levels(36)
    writer.write_table(
        pa.table(_si(run, t="time_s", u="torque_Nm", q="position_rad", w="velocity_rad_s")), folder / "run.parquet"
    )
    return Log(
        (folder / "run.parquet",), "parquet", (), _motor("time_s", "torque_Nm", "position_rad", "velocity_rad_s")
    )


@form
def parquet_with_dates(folder):
    import pyarrow as pa
    from pyarrow import parquet as writer

    run = multisine(18)
    stamps = pa.array(1_714_557_600_000_000 + np.round(run.t * 1e6).astype(np.int64), pa.timestamp("us", tz="UTC"))
    fields = [("time", stamps, "s"), ("voltage", run.u, "V"), ("angle", run.q * DEG, "deg")]
    arrays = [pa.array(values) for _, values, _ in fields]
    schema = pa.schema(
        [pa.field(name, one.type, metadata={"unit": unit}) for (name, _, unit), one in zip(fields, arrays, strict=True)]
    )
    writer.write_table(pa.table(arrays, schema=schema), folder / "telemetry.parquet")
    return Log((folder / "telemetry.parquet",), "parquet", (), _motor("time", "voltage", "angle", "", "V", angle="deg"))


@form
def feather(folder):
    import pyarrow as pa
    from pyarrow import feather as writer

    run = levels(37)
    writer.write_feather(
        pa.table(_si(run, t="t", u="voltage_V", q="angle_rad", w="speed_rad_s")), folder / "run.feather"
    )
    return Log((folder / "run.feather",), "feather", (), _motor("t", "voltage_V", "angle_rad", "speed_rad_s", "V"))


@form
def torch_dictionary(folder):
    run = levels(38)
    content = {"time": run.t, "torque_Nm": run.u.astype(np.float32), "position_rad": run.q, "dt": 1.0 / RATE}
    (folder / "rollout.pt").write_bytes(torch_archive(content))
    return Log((folder / "rollout.pt",), "torch", (), _motor("time", "torque_Nm", "position_rad", ""))


@form
def torch_before_1_6(folder):
    run = multisine(19)
    (folder / "rollout.pth").write_bytes(torch_legacy({"t": run.t, "voltage_V": run.u, "angle_deg": run.q * DEG}))
    return Log((folder / "rollout.pth",), "torch", (), _motor("t", "voltage_V", "angle_deg", "", "V", angle="deg"))
