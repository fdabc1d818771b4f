"""The lead-screw stage of Shamseldin (WSEAS 2022): what the paper publishes of it, and its simulated twin."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from idloop.estimation.black_box.sampled import SampledData
    from idloop.physics import Model
    from idloop.records import Record

Array = NDArray[np.float64]

# Section 3: sampling interval [s], pulses of the encoder a revolution, stroke [in], volts of the data acquisition.
SAMPLE_TIME, PULSES, STROKE, RANGE_VOLTS = 0.050, 100, 9.0, 5.0
INCH = 0.0254
# Sections 3 and 4: units of the wavelet network, neurons of the hidden layer.
WAVELET_UNITS, HIDDEN = 25, 10

# What follows is ours, for the paper prints symbols and figures without values.
# Travel of the stage by a radian of the screw [m] (preset lead_screw: lead 5.08 mm).
LEAD = 8.085e-4
# Excitation: amplitude [V], samples for which each bit is held, register length, duration [s].
AMPLITUDE, CLOCK, REGISTER, DURATION = 0.55, 2, 15, 60.0
# Dry friction of the guides over the torque of that amplitude, gap between screw and nut [rad], share that is left
# of the preset's viscous friction.
DRY_SHARE, GAP, VISCOUS_SHARE = 0.4, 0.3, 0.1
# Step at which the data logger records the encoder [s]: what the grey-box model is fitted to.
LOGGER_STEP = 0.005
BODIES = ("rotor", "screw", "nut", "stage")
# Coupling of screw and stage in the grey-box start [N m/rad, N m s/rad]: it swings at 43 Hz, far above the excitation.
# The preset's own (3.3, 82 Hz) would make the knock of a gap quicker than the logger's step can show.
NUT_STIFFNESS, NUT_DAMPING = 1.0, 1e-3
COUNT = 2.0 * np.pi / PULSES
ENCODER = "sensor_quantisation@position[screw]"
# FIT this close to the paper's counts as the same [%].
NEAR = 6.0


@dataclass(frozen=True)
class Published:
    """A model of the paper's table 2.

    Attributes
    ----------
    fit : float
        "Estimation to fit data" [%].
    mse : float
        Mean square error; its unit is not given.
    """

    fit: float
    mse: float

    @property
    def spread(self) -> float:
        """Standard deviation that the measured speed must have had if both figures are of the same samples."""
        return float(np.sqrt(self.mse) / (1.0 - self.fit / 100.0))


LINEAR, WAVELET, NEURAL = Published(79.624, 0.0499), Published(91.5, 0.00096), Published(93.3, 0.00071)


def plain() -> Model:
    """The preset with the rig's only sensor, the encoder on the screw: the linear model without any effect."""
    from idloop.physics import load_model

    preset = load_model("lead_screw")
    encoder = tuple(output for output in preset.outputs if output.field == "position")
    return replace(preset, outputs=encoder)


def screw_and_stage() -> Model:
    """The plain linear start of the grey-box model: screw and stage behind one stiff coupling, no effect.

    As heavy and as viscous as the preset's chain, whose first twist swings at 82 Hz while the excitation ends at 10 Hz:
    the encoder cannot tell how the load is shared, nor the stiffness, so those two are taken as known.
    """
    from idloop.physics.model_file import from_text

    chain = plain()
    values = chain.values
    driven, carried = (sum(values[f"{body}.inertia"] for body in half) for half in (BODIES[:2], BODIES[2:]))
    viscous = sum(values[f"{body}.viscous_friction"] for body in BODIES)
    encoder = chain.outputs[0]
    text = (
        "schema: idloop/model/1\nname: screw_and_stage\n"
        f"input: {{topic: {chain.input.topic}, joint: {chain.input.joint}, field: effort, unit: {chain.input.unit}}}\n"
        "outputs:\n"
        f"  - {{topic: {encoder.topic}, joint: screw, field: position, unit: rad, noise: {COUNT / 12**0.5}}}\n"
        "bodies:\n"
        f"  - {{name: screw, inertia: {{value: {driven}, min: 0.0}},"
        f" viscous_friction: {{value: {viscous}, min: 0.0}}}}\n"
        f"  - {{name: stage, inertia: {carried}}}\n"
        f"couplings:\n  - {{from: screw, to: stage, stiffness: {NUT_STIFFNESS}, damping: {NUT_DAMPING}}}\n"
        f"drive: {{gain: {chain.values['drive.gain']}}}\n"
    )
    return from_text(text, None)


def friction() -> float:
    """Dry friction of the guides, referred to the screw [N m]."""
    return DRY_SHARE * AMPLITUDE * plain().values["drive.gain"]


def machine() -> Model:
    """The simulated rig: backlash between screw and nut, dry friction, the encoder's counts."""
    model = plain()
    viscous = {f"{body}.viscous_friction": VISCOUS_SHARE * model.values[f"{body}.viscous_friction"] for body in BODIES}
    return model.with_values(viscous).with_effects(
        [
            f"coulomb_friction@stage(level={friction()})",
            f"backlash@screw-nut(gap={GAP})",
            f"{ENCODER}(resolution={COUNT})",
        ]
    )


def measure(amplitude: float, seed: int, duration: float = DURATION) -> Record:
    """Run an experiment on the rig: a stretch of a long PRBS from rest, the encoder at the logger's step.

    Parameters
    ----------
    amplitude : float
        [V]
    seed : int
        Place in the sequence; nothing else is random.
    duration : float
        [s]
    """
    from idloop.diagnosis.design.experiment import Experiment

    signal = {
        "name": "prbs",
        "sample_time": SAMPLE_TIME,
        "duration": duration - SAMPLE_TIME,
        "amplitude": amplitude,
        "order": REGISTER,
        "clock_divider": CLOCK,
        "seed": seed,
    }
    return Experiment(signal, sample_time=LOGGER_STEP).run(machine(), name=f"PRBS {amplitude:g} V, stretch {seed}")


def speed(record: Record, position: Array | None = None) -> SampledData:
    """Speed of the stage as the paper has it: pulses of each sampling interval times the lead.

    Parameters
    ----------
    record : Record
        As `measure` gives it.
    position : ndarray, shape (n,), optional
        Of the screw at the record's stamps [rad]; what the encoder read by default.

    Returns
    -------
    SampledData
        Sample k is the mean speed [in/s] up to its instant, and the command from there on [V].
    """
    from idloop.estimation.black_box.sampled import SampledData

    angle = record.output[:, 0] if position is None else position
    every = round(SAMPLE_TIME / LOGGER_STEP)
    value = np.diff(angle[::every]) * LEAD / INCH / SAMPLE_TIME
    time = record.time[every::every]
    # A millisecond later: stamps of the two clocks that are one instant may differ by their rounding.
    command = np.asarray(record.input_at(time + 1e-3), dtype=float)
    return SampledData(
        record.name, command[:, None], value[:, None], SAMPLE_TIME, (record.input_name,), (record.input_unit,),
        ("stage.velocity",), ("in/s",), start=float(time[0]),
    )  # fmt: skip


def free_run(model: Model, record: Record) -> SampledData:
    """What a model of the rig, started at rest, says of the speed of an experiment."""
    from idloop.physics import Engine

    return speed(record, Engine(model).simulate(None, record.input_time, record.input, record.time)[:, 0])


def choices() -> tuple[str, ...]:
    """What the paper does not tell, and what was taken instead."""
    return (
        (
            "The paper prints neither values nor scales. Plant: preset lead_screw with a tenth of its viscous friction;"
            f" dry friction of the guides {friction():.3g} N m at the screw, {DRY_SHARE:.0%} of the torque of the"
            f" excitation; {GAP * LEAD * 1e3:.2f} mm ({GAP * LEAD / INCH:.3f} in) of play between screw and nut."
        ),
        (
            f"Excitation: {AMPLITUDE:g} V, bits of {CLOCK * SAMPLE_TIME:g} s, different stretches of one sequence of"
            f" 2^{REGISTER} - 1 bits. At this amplitude the speed has the standard deviation that both networks' FIT"
            f" and MSE of table 2 imply if it is in in/s, {WAVELET.spread:.2f} and {NEURAL.spread:.2f}, and the stage"
            f" stays within its stroke."
        ),
        (
            f"The speed is the number of pulses in {SAMPLE_TIME * 1e3:g} ms, so it comes in steps of"
            f" {COUNT * LEAD / INCH / SAMPLE_TIME:.3f} in/s, which alone limits the FIT of any model; no other noise."
        ),
    )
