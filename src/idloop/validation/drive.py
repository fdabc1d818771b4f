"""Drive side: the force that the model requires for the measured motion, compared with the applied force.

In a stiff closed loop the position error hides model errors; the force error shows them. It is relative to the
commanded force, the drive's gain times the command or the output of its loop, so that no effect at the command makes
its own error look smaller or larger: for every model the ratio is that of two commands, of which the denominator is
measured.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.estimation.dataset import prepare
from idloop.estimation.force_balance.force_error import record_balance, thin
from idloop.estimation.force_balance.motion import bridged
from idloop.estimation.statistics.student import scale_of
from idloop.physics import Model
from idloop.records import Record

# Filter transients at a gap in the measurements last this many periods of the band.
_MARGIN = 2.0
# With more relative error from sensor noise alone, the error says nothing about the model.
MOST_NOISE = 0.2


@dataclass(frozen=True)
class ForceError:
    """Applied and required drive force of one record in the compared band."""

    relative: float  # ``‖required − applied‖ / ‖commanded‖``
    typical: float  # the same by the scale of Student's t distribution: a few instants, such as steps, count little
    # shape (m,): instants [s] and low-passed forces in the model's force unit; `commanded` is the gain times the
    # command, `applied` that with the effects at the command
    time: Array
    applied: Array
    required: Array
    commanded: Array
    command: Array  # shape (m,): mean command over one sample around each instant
    # Cut-off of the differentiating filter and of the comparison [Hz]
    cutoff: float
    band: float
    noise_share: float  # share of sensor noise in the power of the differentiated acceleration
    noise: float  # relative error from sensor noise alone
    rest_speed: float  # speed below which the driven body counts as standing, in its own unit

    @property
    def trusted(self) -> bool:
        """Whether the error is that of the model rather than that of the sensors."""
        return self.noise < MOST_NOISE


def force_error(model: Model, record: Record, cutoff: float | None = None) -> ForceError:
    """Relative force error by inverse dynamics along the measured motion.

    Motion by zero-phase band-limited differentiation, both forces with the same low-pass
    (Janot, Gautier and Brunot, EMPS benchmark, 2019). Unlike there, dry friction of a standing body
    balances the other forces up to its static level: only the excess is an error. A body is
    standing where its velocity is within three standard deviations of the velocity's noise.

    `model`: with the parameter values to use; nothing is fitted. `record`: with measured position or velocity of every
    body. `cutoff`: cut-off of the differentiating filter [Hz]; from the record's excited band when left out. Give the
    same one to compare records. Raises InputError: the motion of a body is not measured at a steady rate, or no force
    was applied.
    """
    from idloop.physics import Engine

    engine, data = Engine(model), prepare(model, [record])[0]
    with np.errstate(invalid="ignore", divide="ignore"):  # a sensor that never changes has no spectrum
        balance = record_balance(engine, data, cutoff)
    if balance is None:
        raise InputError(
            f"record {record.name!r}: the force error needs position or velocity of every body at a steady rate"
        )
    m = balance.motion
    rest = float(m.rest_speed[0])  # the drive's force is that on the first body
    applied, required = balance.forces(engine, rest)
    # The mean of the held command around each instant is what was commanded there.
    command = balance.command.mean
    loop = model.loop_gains(model.values)
    output = loop.set_point * command + loop.position * m.position[:, 0] + loop.velocity * m.velocity[:, 0]
    commanded = model.values["drive.gain"] * output
    # The filter does not change a straight line, so the filtered sample numbers give the kept instants.
    forces = thin(np.column_stack([applied, required, commanded, np.arange(len(m.time))]), m)
    kept = np.rint(forces[:, 3]).astype(np.int64)
    seen = ~bridged(m.time[kept], model, data, _MARGIN / m.comparison_band)
    if np.sum(seen) < 2:
        raise InputError(f"record {record.name!r}: the motion is measured with too many gaps for the force error")
    forces, kept = forces[seen], kept[seen]
    size = float(np.linalg.norm(forces[:, 2]))
    if size <= 0.0:
        idle = not np.any(data.input)
        raise InputError(
            f"record {record.name!r}: "
            + ("the command is zero" if idle else "the drive of this model makes no force of the command")
        )
    relative = float(np.linalg.norm(forces[:, 1] - forces[:, 0])) / size
    # White motion has the spectrum of noise; but noise cannot be more than the error that it is a part of.
    noise = min(_of_noise(model, m.noise) * float(np.sqrt(len(forces))) / size, relative)
    return ForceError(
        relative=relative,
        typical=scale_of(forces[:, 1] - forces[:, 0]) * float(np.sqrt(len(forces))) / size,
        time=m.time[kept],
        applied=forces[:, 0],
        required=forces[:, 1],
        commanded=forces[:, 2],
        command=command[kept],
        cutoff=m.cutoff,
        band=m.comparison_band,
        noise_share=float(np.max(m.noise_share)),
        noise=noise,
        rest_speed=rest,
    )


def _of_noise(model: Model, noise: Array) -> float:
    """Standard deviation of the required force from sensor noise (bodies, 3): driven body and first coupling."""
    values, driven = model.values, model.bodies[0]
    parts = [values[f"{driven}.inertia"] * noise[0, 2], values[f"{driven}.viscous_friction"] * noise[0, 1]]
    for name in model.couplings[:1]:
        parts += [values[f"{name}.stiffness"] * n for n in noise[:2, 0]]
        parts += [values[f"{name}.damping"] * n for n in noise[:2, 1]]
    return float(np.linalg.norm(parts))
