"""Row C1: the four-inertia lead-screw stage, its PRBS experiment and the spectrum of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from papers import Progress
from papers.claim import at_most, below, equals, stated, within
from papers.reproduction import Line, Reproduction
from papers.stage import stage_paper

if TYPE_CHECKING:
    from idloop.estimation.black_box.sampled import SampledData
    from idloop.physics import Model
    from idloop.records import Record

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

# The equations count as the preset's where their responses differ by less than this share up to half the sample rate.
_SAME = 0.01
# The speed's standard deviation counts as what table 2 implies within this share.
_SIZE = 0.25
# Whole numbers and clocks are the paper's but for rounding.
_COUNTED = 1e-5
_POINTS = 200


@dataclass(frozen=True, eq=False)
class StageMachine(Reproduction):
    """The simulated rig and one experiment on it.

    Attributes
    ----------
    model : Model
        With its effects.
    record : Record
        The encoder's own record.
    data : SampledData
        Speed of the stage at the paper's sampling interval.
    frequency : ndarray, shape (k,)
        [Hz]
    equations, preset : ndarray of complex, shape (k,)
        Response of the screw's speed to the command by eq. 1 to 4 and by the linear preset [rad/s/V].
    """

    model: Model
    record: Record
    data: SampledData
    frequency: Array
    equations: Complex
    preset: Complex

    @property
    def position(self) -> Array:
        """Of the stage by the encoder [in], shape (n,)."""
        return np.asarray(self.record.output[:, 0] * stage_paper.LEAD / stage_paper.INCH)

    def spectrum(self, values: Array) -> tuple[Array, Array]:
        """Spectral density by Welch, 7 windows that overlap by half: frequency [Hz], density [unit²/Hz]."""
        from scipy.signal import welch

        frequency, density = welch(values, 1.0 / stage_paper.SAMPLE_TIME, nperseg=len(values) // 4, detrend="constant")
        return np.asarray(frequency[1:]), np.asarray(density[1:])

    def rows(self) -> tuple[Line, ...]:
        """The machine, the experiment and its size."""
        far = float(np.max(np.abs(self.equations / self.preset - 1.0)))
        travel, level = float(np.ptp(self.position)), float(np.max(np.abs(self.data.input)))
        spread = float(np.std(self.data.output))
        implied = 0.5 * (stage_paper.WAVELET.spread + stage_paper.NEURAL.spread)
        values = self.model.values
        resolution = values[f"{stage_paper.ENCODER}.resolution"]
        frequency, density = self.spectrum(self.data.input[:, 0])
        half = float(frequency[np.argmax(np.cumsum(density) >= 0.5 * np.sum(density))])
        effects = sorted(name.split("@")[0] for name in self.model.effect_names)
        return (
            Line("inertias", float(len(self.model.bodies)), 4.0, "", "eq. 1 to 4", equals(4)),
            Line("response off that of eq. 1 to 4, up to 10 Hz", 100.0 * far, 0.0, "%", "eq. 1 to 4",
                 below(100.0 * _SAME)),
            Line("encoder: pulses a revolution", 2.0 * np.pi / resolution, float(stage_paper.PULSES), "", "section 3",
                 within(stage_paper.PULSES, _COUNTED)),
            Line("sampling interval", self.data.sample_time, stage_paper.SAMPLE_TIME, "s", "section 3",
                 within(stage_paper.SAMPLE_TIME, _COUNTED)),
            Line("nonlinear effects", ", ".join(effects), "backlash, friction", "", "sections 2, 4",
                 stated("both", {"backlash", "coulomb_friction"} <= set(effects))),
            Line("play between screw and nut", values["backlash@screw-nut.gap"] * stage_paper.LEAD * 1e3, None, "mm"),
            Line("dry friction at the screw", values["coulomb_friction@stage.level"], None, "N m"),
            Line("levels of the command", float(np.unique(self.data.input).size), 2.0, "", "figure 5", equals(2)),
            Line("largest command", level, f"within {stage_paper.RANGE_VOLTS:g}", "V", "section 3",
                 at_most(stage_paper.RANGE_VOLTS)),
            Line("half of the command's power lies below", half, "violent excitation", "Hz", "abstract"),
            Line("travel of the stage", travel, f"0 to {stage_paper.STROKE:g}", "in", "section 3",
                 below(stage_paper.STROKE)),
            Line("standard deviation of the speed", spread, implied, "in/s", "table 2", within(implied, _SIZE)),
        )  # fmt: skip

    def notes(self) -> tuple[str, ...]:
        """How the equations are read, and how the experiment was chosen."""
        return (
            (
                "Eq. 1 to 4 are read from the text and the units of table 1: the screw's axial mass rests on the"
                " stiffness of screw and bearing, and the nut's stiffness joins it to the stage. The preset is a"
                " chain in which that mass travels with the nut; in the excited band the two differ by the inertia"
                " of that mass only, which is counted in the stage's here."
            ),
            "The standard deviation beside the paper is the mean of what FIT and MSE of both networks imply.",
            *stage_paper.choices(),
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        frequency, density = self.spectrum(self.data.input[:, 0])
        return {
            **super().to_dict(),
            "model": self.model.to_yaml(),
            "time": self.data.time,
            "command": self.data.input[:, 0],
            "speed": self.data.output[:, 0],
            "spectrum": {"frequency": frequency, "command": density, "speed": self.spectrum(self.data.output[:, 0])[1]},
        }

    def plot(self, axes: Any = None) -> Any:
        """Draw command, speed, position (figures 5 to 7) and the spectra; returns the four axes."""
        import matplotlib.pyplot as plt

        from idloop import drawing

        with drawing.styled():
            if axes is None:
                _, axes = plt.subplots(4, 1, figsize=(8.0, 8.5), layout="constrained")
            for ax in axes[1:3]:
                ax.sharex(axes[0])
            time = self.data.time
            drawing.steps(axes[0], time, self.data.input[:, 0], color=drawing.COMMAND)
            drawing.line(axes[1], time, self.data.output[:, 0], color=drawing.MEASURED)
            drawing.line(axes[2], self.record.time, self.position, color=drawing.MEASURED)
            names = (("command", "V"), ("speed", "in/s"), ("position", "in"))
            for ax, (name, unit) in zip(axes[:3], names, strict=True):
                ax.set_ylabel(drawing.label(name, unit))
            axes[2].set_xlabel(drawing.label("time", "s"))
            for index, (name, values) in enumerate((("command", self.data.input), ("speed", self.data.output))):
                frequency, density = self.spectrum(values[:, 0])
                share = density / np.sum(density)
                axes[3].semilogy(frequency, share, label=name, **drawing.model_look(index))
            axes[3].set_xlabel(drawing.label("frequency", "Hz"))
            axes[3].set_ylabel(drawing.label("share of the power", None))
            axes[3].legend()
        return axes


def four_inertia_response(model: Model, frequency: Array) -> Complex:
    """Response of the screw's speed by eq. 1 to 4, linear, with the numbers of a chain referred to the screw's angle.

    Coordinates: angles of rotor and screw, axial play of the screw in its bearing x_s / l, place of the stage x_t / l.
    The nut sits at theta_s + x_s / l.

    Parameters
    ----------
    model : Model
        Preset ``lead_screw``.
    frequency : ndarray, shape (k,)
        [Hz]

    Returns
    -------
    ndarray of complex, shape (k,)
        [rad/s/V]
    """
    v = model.values
    mass = np.diag([v["rotor.inertia"], v["screw.inertia"], v["nut.inertia"], v["stage.inertia"] + v["nut.inertia"]])
    nut_and_stage = v["nut.viscous_friction"] + v["stage.viscous_friction"]
    ground = np.diag([v["rotor.viscous_friction"], v["screw.viscous_friction"], 0.0, nut_and_stage])

    def joined(quantity: str) -> Array:
        # What each spring or damper is stretched by: rotor to screw, screw in its bearing, nut to stage.
        stretch = np.array([[1.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 1.0, 1.0, -1.0]])
        size = [v[f"{place}.{quantity}"] for place in ("rotor-screw", "screw-nut", "nut-stage")]
        return np.asarray(stretch.T @ np.diag(size) @ stretch)

    push = np.array([v["drive.gain"], 0.0, 0.0, 0.0])
    s = 2j * np.pi * frequency
    speeds = [
        p * np.linalg.solve(p**2 * mass + p * (ground + joined("damping")) + joined("stiffness"), push) for p in s
    ]
    return np.asarray(speeds)[:, 1]


def chain_response(model: Model, frequency: Array) -> Complex:
    """The same of the preset as it is simulated.

    Parameters
    ----------
    model : Model
        Linear, the position of the screw its only output.
    frequency : ndarray, shape (k,)
        [Hz]

    Returns
    -------
    ndarray of complex, shape (k,)
        [rad/s/V]
    """
    from idloop.physics import Engine

    linear = Engine(model).linearise(None)
    s = 2j * np.pi * frequency
    unit = np.eye(len(linear.A))
    return np.asarray([p * (linear.C @ np.linalg.solve(p * unit - linear.A, linear.B))[0] for p in s])


def reproduce(seed: int, progress: Progress, duration: float = stage_paper.DURATION) -> StageMachine:
    """Compare the preset with the paper's equations and run its experiment.

    Parameters
    ----------
    seed : int
        Of the excitation.
    progress : callable
    duration : float
        [s]
    """
    progress(0.0, "equations")
    plain = stage_paper.plain()
    frequency = np.linspace(0.05, 0.5 / stage_paper.SAMPLE_TIME, _POINTS)
    equations, preset = four_inertia_response(plain, frequency), chain_response(plain, frequency)
    progress(0.3, "experiment")
    record = stage_paper.measure(stage_paper.AMPLITUDE, 3 * seed, duration)
    return StageMachine(stage_paper.machine(), record, stage_paper.speed(record), frequency, equations, preset)
