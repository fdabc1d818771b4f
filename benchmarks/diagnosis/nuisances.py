"""What every real drive has beside its dominant effects: small, and mostly in no catalogue."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# The rectified mains [Hz].
SUPPLY_HZ = 100.0


@dataclass(frozen=True)
class Nuisances:
    """The small things of one drive, in the model's units; 0 where there is none.

    Attributes
    ----------
    friction : float
        Dry friction of every body beside the hidden one, of the LuGre kind as all of it.
    break_away : float
        Static friction as a multiple of the kinetic one.
    stribeck_speed : float
        Speed of the fall from the one to the other.
    reach : float
        Displacement before sliding.
    counts : tuple of float
        Resolution of the encoder of each body; 0 where there is none.
    velocity_filter : float
        Low pass behind the differenced velocity [s].
    current_loop : float
        Its bandwidth [Hz].
    delay : float
        From the sample to the current loop [s].
    limit : float
        Of the command, in its unit.
    supply_ripple : float
        Share of the gain, at `SUPPLY_HZ`.
    tick_jitter, late_ticks : float
        Deviation of the controller's ticks as a share of the sample time, and share of ticks that come half a sample
        late.
    stamp_jitter : float
        Deviation of the stamps from the ticks, as a share of the sample time.
    torque_ripple : tuple of (amplitude, harmonic, phase)
        Forces over the position.
    ripple_with_current : float
        Share of the gain, with the first of these harmonics.
    unexplained : float
        Amplitude of a friction that changes with the place and with the temperature.
    wave, phase : float
        Of its change over the position [rad/position, rad].
    warming, warm_up : float
        Share that goes with the temperature, and its time constant [s].
    unexplained_speed : float
        Speed at which it has its sign in full.
    """

    friction: float
    break_away: float
    stribeck_speed: float
    reach: float
    counts: tuple[float, ...]
    velocity_filter: float
    current_loop: float
    delay: float
    limit: float
    supply_ripple: float
    tick_jitter: float
    late_ticks: float
    stamp_jitter: float
    torque_ripple: tuple[tuple[float, float, float], ...]
    ripple_with_current: float
    unexplained: float
    wave: float
    phase: float
    warming: float
    warm_up: float
    unexplained_speed: float

    def left_out(self) -> Nuisances:
        """None of them, but that dry friction still builds up over its reach."""
        return replace(
            self,
            friction=0.0,
            break_away=1.0,
            current_loop=float("inf"),
            delay=0.0,
            limit=float("inf"),
            supply_ripple=0.0,
            torque_ripple=(),
            ripple_with_current=0.0,
            unexplained=0.0,
        )

    def names(self, bodies: tuple[str, ...], sites: tuple[str, ...]) -> frozenset[str]:
        """Effects of the catalogue that these things are: to name one of them is not false.

        Parameters
        ----------
        bodies : tuple of str
        sites : tuple of str
            Of the outputs, such as ``position[motor]``.
        """
        dry = ("coulomb_friction", "stribeck_friction", "presliding_friction") if self.friction > 0.0 else ()
        found = {f"{effect}@{body}" for effect in dry for body in bodies}
        found |= {f"sensor_quantisation@{site}" for site in sites}
        for site in sites:
            if site.startswith("velocity"):
                # a difference shows the mean velocity of the sample: half a sample late
                found |= {f"velocity_filter@{site}", f"sensor_delay@{site}"}
        found |= {f"{effect}@input" for effect in ("input_delay", "actuator_lag", "saturation")}
        if self.torque_ripple:
            # as many waves as there are, beside one that is hidden
            numbers = ("", *(f"#{number}" for number in range(2, len(self.torque_ripple) + 2)))
            found |= {f"{wave}{number}@{bodies[0]}" for wave in ("cogging", "periodic_force") for number in numbers}
        return frozenset(found)


def ticks(nuisances: Nuisances, rate: float, count: int, seed: int) -> Array:
    """When the controller's samples are really taken (count + 1,) [s]; they never pass each other."""
    random = np.random.default_rng(seed)
    early = np.clip(nuisances.tick_jitter * random.standard_normal(count + 1), -0.15, 0.15)
    late = 0.5 * (random.uniform(size=count + 1) < nuisances.late_ticks)
    shift = early + late
    shift[0] = 0.0
    return np.asarray((np.arange(count + 1) + shift) / rate)


def stamps(nuisances: Nuisances, taken: Array, rate: float, seed: int) -> Array:
    """Stamps of the samples: a callback later than the ticks, by an amount that changes [s]."""
    late = np.abs(np.random.default_rng(seed).standard_normal(len(taken))) * nuisances.stamp_jitter / rate
    found = taken + np.minimum(late, 0.15 / rate)
    return np.asarray(found - found[0])
