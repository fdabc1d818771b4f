"""The torsion system of Myklebust (Linköping 2009): what the thesis publishes, its excitations, its simulated twin."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import control
    from idloop.control.compensation import Compensation
    from idloop.estimation.black_box.sampled import SampledData
    from idloop.physics import Model
    from idloop.records import Record

Array = NDArray[np.float64]

# Table A.1: inertias [kg m^2], stiffness [N m/rad], torque constant [N m/A], counts of the encoders per turn.
MOTOR_INERTIA, LOAD_INERTIA, STIFFNESS, TORQUE_CONSTANT = 3.11e-5, 5.46e-4, 1.0, 0.0742
MOTOR_COUNTS, LOAD_COUNTS = 8192, 4096
MOTOR_SENSITIVITY, LOAD_SENSITIVITY = 7.67e-4, 15.34e-4
# Figure 2.3 and eq. 4.1: current over control signal [A], and its offset [A].
CURRENT_GAIN, CURRENT_OFFSET = 2.44, 0.0397
# Table 4.1 and section 4.3.2: gains in radians, and the limit of the control signal.
KP, KI, KD, LIMIT = 8.3867, 0.3255, 0.8, 2.95
# Chapter 4: sample times of measurement and identification [s], and what is dropped at both ends [s].
MEASURED_EVERY, IDENTIFIED_EVERY, DROPPED = 0.001, 0.01, 1.0
# Section 4.1: benchmark signals. Level of the PRBS and two deviations of the RGS [deg], band [Hz], length [s].
PRBS_LEVEL, RGS_TWO_DEVIATIONS, BAND, LENGTH = 36.0, 60.0, 10.0, 80.0
# Section 4.4.3: number of states and of block rows.
STATES, HORIZON = 9, 28
# The thesis names no filter of the derivative; without one the noise of an encoder alone fills the limit [s].
DERIVATIVE_FILTER = 0.005
# Sizes that the thesis does not tell: friction and imbalance of the motor [N m], ours.
FRICTION, IMBALANCE = 0.005, 0.006

# Table B.1 [%]: by experiment, in the order of `WAYS` and then the Quanser model; None where the thesis has a bar.
OPEN, CLOSED, NOISE, SATURATION = "open loop", "closed loop", "closed loop with noise", "closed loop with saturation"
TABLE_B_1: dict[str, tuple[float | None, ...]] = {
    OPEN: (None, None, 100.0, 100.0, 99.98, 99.98, 95.41, 99.46),
    CLOSED: (99.53, 99.60, 99.53, 99.58, 99.36, 99.37, 86.82, 92.96),
    NOISE: (87.30, 87.30, 93.10, 93.10, 93.24, 93.15, 89.14, 90.36),
    SATURATION: (78.82, 78.82, 42.50, 65.50, 47.93, 32.70, 55.18, 39.12),
}
# Noise of appendix B [deg]: all of it, and its deviation. Section "Simulation and Results": see `torsion_verification`.
NOISE_RANGE = 4.0
NOISE_DEVIATION = NOISE_RANGE / 3.4

VODMA_PEM, VODMA, DIRECT_PEM, DIRECT = "VODMA+PEM", "VODMA", "VODMA DI+PEM", "VODMA DI"
N4SID_PEM, N4SID, PEM = "N4SID+PEM", "N4SID", "PEM"
WAYS = (VODMA_PEM, VODMA, DIRECT_PEM, DIRECT, N4SID_PEM, N4SID, PEM)


@dataclass(frozen=True)
class Setting:
    """One row of table 5.1.

    Attributes
    ----------
    signal : str
        "prbs" or "rgs".
    amplitude, band : float
        Share of the benchmark's.
    compensated : bool
        Whether eq. 4.1 stands before the plant.
    controller : str
        "pid" or "pd".
    fits : tuple of float or None
        FIT by `WAYS` [%]; None where the thesis has a cross.
    """

    signal: str
    amplitude: float
    band: float
    compensated: bool
    controller: str
    fits: tuple[float | None, ...]

    @property
    def name(self) -> str:
        """As in ``"PRBS 90 %, band 80 %, PID"``."""
        bare = "" if self.compensated else ", uncompensated"
        size, band = 100.0 * self.amplitude, 100.0 * self.band
        return f"{self.signal.upper()} {size:.0f} %, band {band:.0f} %, {self.controller.upper()}{bare}"


TABLE_5_1 = (
    Setting("rgs", 1.0, 1.0, False, "pid", (71.54, 33.23, 62.03, None, 68.91, 56.85, 49.43)),
    Setting("rgs", 1.0, 1.0, True, "pid", (73.53, 73.40, 76.04, 74.66, 74.40, 73.79, 64.96)),
    Setting("rgs", 1.0, 0.8, True, "pid", (65.27, 60.07, 56.21, 56.21, 58.29, 56.59, 55.80)),
    Setting("rgs", 1.0, 0.67, True, "pid", (79.59, 76.36, 79.59, 79.01, 77.46, 77.30, 43.24)),
    Setting("prbs", 1.0, 1.0, True, "pid", (64.36, 64.36, 71.12, 71.12, 79.20, 70.85, 59.06)),
    Setting("prbs", 0.9, 0.8, True, "pid", (87.02, 85.69, 88.06, 88.06, 86.50, 85.95, 81.41)),
    Setting("prbs", 0.9, 0.67, True, "pid", (85.73, 84.79, 87.17, 85.94, 85.29, 83.06, 68.63)),
    Setting("prbs", 0.83, 0.8, True, "pid", (85.65, 85.11, 84.82, 82.45, 85.62, 79.20, 61.02)),
    Setting("prbs", 0.2, 0.8, True, "pid", (65.46, 35.50, 66.04, 26.85, 75.59, 57.64, 5.62)),
    Setting("prbs", 0.9, 0.8, True, "pd", (72.83, 72.83, None, None, 30.31, 48.02, 30.04)),
)
CHOSEN = TABLE_5_1[5]
# Table 5.2: average over all experiments by `WAYS`.
TABLE_5_2 = (77.10, 68.13, 75.76, 71.01, 75.91, 73.66, 51.05)


def quanser() -> Model:
    """Linear model of chapter 2 as the preset has it, input the motor current [A]."""
    from idloop.physics import load_model

    return replace(load_model("torsion"), controller=None)


def machine() -> Model:
    """The laboratory's machine, simulated: input the control signal, with what section 2.3 observes.

    Current gain and offset are the thesis's, friction and imbalance are there by its words and of our size, the
    encoders count.
    """
    return (
        quanser()
        .with_values({"drive.gain": TORQUE_CONSTANT * CURRENT_GAIN})
        .with_effects(
            [
                f"input_offset@input(offset={CURRENT_OFFSET / CURRENT_GAIN})",
                f"coulomb_friction@motor(level={FRICTION})",
                f"imbalance@motor(amplitude={IMBALANCE},phase=0.0)",
                f"sensor_quantisation@position[motor](resolution={2.0 * np.pi / MOTOR_COUNTS})",
                *(
                    f"sensor_quantisation@position[load{k}](resolution={2.0 * np.pi / LOAD_COUNTS})"
                    for k in (1, 2, 3)
                ),
            ]
        )
    )  # fmt: skip


def controller(kind: str = "pid", *, current: bool = True, limit: float | None = None) -> dict[str, Any]:
    """Section of the controller at the motor's angle (eq. 4.2).

    Parameters
    ----------
    kind : str
        "pid", or "pd" without the integral.
    current : bool
        Its law is a motor current, turned into the control signal by the gain of figure 2.3; else it is the plant's own
        input.
    limit : float, optional
        Of the control signal.
    """
    section: dict[str, Any] = {
        "type": kind,
        "output": "motor.position",
        "kp": KP,
        "kd": KD,
        "derivative_filter": DERIVATIVE_FILTER,
        "sample_time": MEASURED_EVERY,
    }
    if kind == "pid":
        section["ki"] = KI
    if current:
        section["linearisation"] = {"gain": CURRENT_GAIN}
    if limit is not None:
        section["limit"] = limit
    return section


def sampled_controller(kind: str, sample_time: float) -> control.TransferFunction:
    """From the motor's angle to what the controller subtracts, between samples that are joined smoothly (Tustin)."""
    import control

    s = control.tf([1.0, 0.0], [1.0])
    law = KP + KD * s / (1.0 + DERIVATIVE_FILTER * s)
    if kind == "pid":
        law += KI / s
    return control.c2d(law, sample_time, method="tustin")


def held_for(band: float) -> float:
    """Time for which a level of a band-limited signal is held [s].

    A band of B Hz means 1 / (2 B), as for MATLAB's idinput rounded down to whole samples: here of the identification,
    so that no level changes between two of them.
    """
    return float(np.floor(0.5 / band / IDENTIFIED_EVERY + 1e-9)) * IDENTIFIED_EVERY


def excitation(kind: str, amplitude: float, band: float, seed: int, length: float = LENGTH) -> Array:
    """A benchmark signal, scaled: levels held over the band's clock, at 1 kHz.

    Parameters
    ----------
    kind : str
        "prbs": plus or minus the amplitude; "rgs": normal values, the amplitude two deviations.
    amplitude : float
        In the unit wanted.
    band : float
        [Hz]
    seed : int
    length : float
        At 10 Hz [s]: the number of levels stays, a narrower band takes longer (section 4.1).

    Returns
    -------
    ndarray, shape (n,)
        With a second more at each end, which is dropped.
    """
    from idloop.signals.prbs import maximum_length_bits

    hold = held_for(band)
    duration = length * BAND / band + 2.0 * DROPPED
    count = int(np.ceil(duration / hold))
    random = np.random.default_rng(seed)
    if kind == "prbs":
        order = 11
        levels = amplitude * (2.0 * maximum_length_bits(order, count, int(random.integers(1, 2**order))) - 1.0)
    else:
        levels = 0.5 * amplitude * random.standard_normal(count)
    samples = round(hold / MEASURED_EVERY)
    return np.asarray(np.repeat(levels, samples)[: round(duration / MEASURED_EVERY)], dtype=float)


def reference(setting: Setting, seed: int, length: float = LENGTH) -> Array:
    """Reference of a row of table 5.1 [rad], as `excitation`."""
    level = PRBS_LEVEL if setting.signal == "prbs" else RGS_TWO_DEVIATIONS
    return excitation(setting.signal, np.radians(level * setting.amplitude), BAND * setting.band, seed, length)


def offset_compensation(model: Model) -> Compensation:
    """Eq. 4.1 without its gain: the offset alone is cancelled."""
    from idloop.control.compensation import Compensation

    return Compensation(model, ("input_offset",))


def in_loop(
    model: Model, section: Mapping[str, Any], wanted: Array, noise: Array | None = None, *, compensated: bool = False
) -> Record:
    """Simulate a closed loop from rest.

    Parameters
    ----------
    model : Model
    section : mapping
        Of the controller.
    wanted : ndarray, shape (n,)
        Reference every millisecond [rad].
    noise : ndarray, shape (n, 4), optional
        Added to the sensors' readings, which the controller sees [rad].
    compensated : bool
        Whether eq. 4.1 stands before the plant.

    Returns
    -------
    Record
        All samples.
    """
    from idloop.control import build_controller
    from idloop.diagnosis.design.experiment_loop import simulate_closed_loop
    from idloop.physics import Engine

    count = len(wanted)
    time: Array = np.arange(count, dtype=np.float64) * MEASURED_EVERY
    compensation = offset_compensation(model) if compensated else None
    engine, kernel = Engine(model), build_controller(dict(section), compensation=compensation).kernel
    rest = np.zeros(len(model.bodies))
    path = np.column_stack([wanted, np.zeros(count)])
    output, command = simulate_closed_loop(
        engine,
        None,
        kernel,
        np.array([model.output_names.index(name) for name in kernel.inputs], dtype=np.int64),
        time,
        np.ones(count, dtype=bool),
        path,
        np.zeros(count),
        engine.initial_state(rest, rest, None),
        np.zeros((count, len(model.outputs))) if noise is None else noise,
        np.zeros(count),
    )
    return recorded(model, time, command, output, path)


def open_loop(model: Model, command: Array) -> Record:
    """Simulate the plant alone from rest, a command every millisecond."""
    from idloop.physics import simulate

    time: Array = np.arange(len(command), dtype=np.float64) * MEASURED_EVERY
    return recorded(model, time, command, simulate(model, time, command, time).output, None)


def recorded(model: Model, time: Array, command: Array, output: Array, path: Array | None) -> Record:
    """Signals of an experiment as a record."""
    from idloop.records import Record

    return Record(
        name="torsion",
        input_time=time,
        input=command,
        time=time,
        output=output,
        input_name=model.input.name,
        input_unit=model.input.unit,
        output_names=model.output_names,
        output_units=tuple(o.unit for o in model.outputs),
        reference_time=None if path is None else time,
        reference=path,
    )


def thinned(record: Record, sample_time: float = IDENTIFIED_EVERY, filtered: bool = False) -> SampledData:
    """The record without its first and last second, down-sampled.

    Parameters
    ----------
    record : Record
        At 1 kHz.
    sample_time : float
        [s]
    filtered : bool
        Low-pass both sides alike before, without phase, below 80 % of the new half sample rate; else samples are
        taken as they are, the thesis's way.
    """
    from idloop.estimation.black_box.sampled import SampledData

    step = round(sample_time / MEASURED_EVERY)
    source = record.filtered(None, 0.4 / sample_time, inputs=True) if filtered and step > 1 else record
    first = round(DROPPED / MEASURED_EVERY)
    every = slice(first, len(record.time) - first, step)
    return SampledData(
        name=record.name,
        input=np.ascontiguousarray(source.input[every, None]),
        output=np.ascontiguousarray(source.output[every]),
        sample_time=sample_time,
        input_names=(record.input_name,),
        input_units=(record.input_unit,),
        output_names=record.output_names,
        output_units=record.output_units,
        start=DROPPED,
        reference=None if record.reference is None else record.reference[every, 0],
    )


def halves(data: SampledData) -> tuple[SampledData, SampledData]:
    """First half to identify, second to validate (section 4.1)."""
    half = len(data) // 2
    return data.part(0, half), data.part(half, 2 * half)


def average_fit(measured: Array, modelled: Array) -> float:
    """FIT of eq. 4.3, averaged over the outputs [%]; minus infinity where the model runs away."""
    from idloop.validation import fit_percent

    if not np.all(np.isfinite(modelled)) or float(np.max(np.abs(modelled))) > 1e100:
        return -np.inf
    return float(np.mean(fit_percent(measured, modelled)))
