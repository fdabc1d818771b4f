"""Which effects the suite hides, where, and the excitations that can show them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """An effect at a site of a machine, with the excitations of either loop that can show it."""

    effect: str
    at: str
    machine: str
    open: tuple[str, ...]
    closed: tuple[str, ...]


# Excitations by what they are good for: (open loop, closed loop).
STATIC = (("multilevel", "multisine", "slow_sines"), ("moves", "reference_sines", "reference_steps"))
FAST = (("multilevel", "chirp", "multisine"), ("reference_steps", "reference_sines"))
DRY = (("multilevel", "slow_sines", "coast"), ("slow_moves", "moves", "speeds"))
TURNS = (("plateaus", "multilevel"), ("speeds", "moves"))
SPEED = (("plateaus", "multilevel", "coast"), ("moves", "speeds"))
SMALL = (("multisine", "multilevel"), ("reference_steps", "slow_moves"))
TWIST = (("multilevel", "multisine", "chirp"), ("moves", "reference_sines"))

# Left out: what depends on a condition measured beside the axis (a temperature, the supply). No experiment of the suite
# records one, so that no diagnosis of it weighs such an effect; tests/diagnosis/test_measured_conditions.py has
# machines of their own that do.
_SITES: tuple[tuple[str, tuple[tuple[str, ...], tuple[str, ...]], tuple[tuple[str, str], ...]], ...] = (
    (
        "input_offset",
        STATIC,
        (("axis", "input"), ("dc_motor", "input"), ("torsion", "input")),
    ),
    (
        "gain_asymmetry",
        STATIC,
        (("axis", "input"), ("dc_motor", "input"), ("lead_screw", "input")),
    ),
    (
        "dead_zone",
        STATIC,
        (
            ("axis", "input"),
            ("dc_motor", "input"),
            ("dc_position", "input"),
            ("torsion", "input"),
            ("lead_screw", "input"),
        ),
    ),
    (
        "saturation",
        STATIC,
        (("axis", "input"), ("dc_motor", "input"), ("torsion", "input"), ("lead_screw", "input")),
    ),
    ("speed_limit_voltage", SPEED, (("axis", "input"), ("dc_motor", "input"))),
    (
        "input_delay",
        FAST,
        (("axis", "input"), ("dc_motor", "input"), ("torsion", "input")),
    ),
    (
        "actuator_lag",
        FAST,
        (("axis", "input"), ("dc_motor", "input"), ("axis_position", "input")),
    ),
    ("viscous_friction", SPEED, (("axis", "axis"), ("torsion", "load2"))),
    (
        "coulomb_friction",
        DRY,
        (
            ("axis", "axis"),
            ("dc_motor", "motor"),
            ("axis_position", "axis"),
            ("torsion", "motor"),
            ("torsion", "load1"),
            ("lead_screw", "rotor"),
        ),
    ),
    ("stribeck_friction", DRY, (("axis", "axis"), ("dc_motor", "motor"))),
    (
        "asymmetric_friction",
        DRY,
        (("axis", "axis"), ("dc_motor", "motor"), ("torsion", "motor")),
    ),
    ("presliding_friction", SMALL, (("axis", "axis"), ("axis_position", "axis"))),
    ("quadratic_drag", SPEED, (("axis", "axis"), ("dc_motor", "motor"))),
    ("asymmetric_viscous_friction", SPEED, (("axis", "axis"), ("dc_motor", "motor"))),
    ("gravity", TURNS, (("axis", "axis"), ("dc_motor", "motor"))),
    (
        "imbalance",
        TURNS,
        (("axis", "axis"), ("dc_motor", "motor"), ("torsion", "motor"), ("torsion", "load2")),
    ),
    (
        "cogging",
        TURNS,
        (("axis", "axis"), ("dc_motor", "motor"), ("torsion", "motor")),
    ),
    (
        "cable_spring",
        STATIC,
        (("axis", "axis"), ("dc_motor", "motor"), ("torsion", "load3")),
    ),
    ("load_torque", STATIC, (("axis", "axis"), ("torsion", "load2"))),
    (
        "load_dependent_friction",
        DRY,
        (("axis", "axis"), ("torsion", "load1"), ("lead_screw", "rotor")),
    ),
    (
        "compliance",
        FAST,
        (("axis", "axis"), ("dc_motor", "motor"), ("axis_position", "axis")),
    ),
    (
        "backlash",
        TWIST,
        (("torsion", "motor-load1"), ("torsion", "load1-load2"), ("lead_screw", "nut-stage")),
    ),
    (
        "backlash",
        DRY,
        (("axis", "position[axis]"), ("dc_motor", "position[motor]"), ("lead_screw", "position[screw]")),
    ),
    ("hardening_stiffness", TWIST, (("torsion", "motor-load1"), ("torsion", "load2-load3"))),
    ("slip", TWIST, (("torsion", "motor-load1"), ("torsion", "load1-load2"))),
    (
        "sensor_quantisation",
        DRY,
        (
            ("axis", "position[axis]"),
            ("axis", "velocity[axis]"),
            ("dc_motor", "position[motor]"),
            ("torsion", "position[load1]"),
        ),
    ),
    (
        "sensor_delay",
        FAST,
        (
            ("axis", "position[axis]"),
            ("axis", "velocity[axis]"),
            ("dc_motor", "velocity[motor]"),
            ("torsion", "position[load3]"),
        ),
    ),
    (
        "sensor_offset",
        STATIC,
        (("axis", "velocity[axis]"), ("dc_motor", "velocity[motor]"), ("torsion", "position[load2]")),
    ),
    ("sensor_ripple", TURNS, (("axis", "velocity[axis]"), ("dc_motor", "velocity[motor]"))),
    ("velocity_filter", FAST, (("axis", "velocity[axis]"), ("dc_motor", "velocity[motor]"))),
)

SINGLES: tuple[Row, ...] = tuple(
    Row(effect, at, machine, *loops) for effect, loops, sites in _SITES for machine, at in sites
)

# Effects that one machine hides together: machine, (effect, site) of each, excitations.
DOUBLES: tuple[tuple[str, tuple[tuple[str, str], ...], tuple[tuple[str, ...], tuple[str, ...]]], ...] = (
    ("dc_motor", (("dead_zone", "input"), ("backlash", "position[motor]")), STATIC),
    ("dc_motor", (("dead_zone", "input"), ("coulomb_friction", "motor")), DRY),
    ("dc_motor", (("input_offset", "input"), ("saturation", "input")), STATIC),
    ("dc_motor", (("coulomb_friction", "motor"), ("quadratic_drag", "motor")), SPEED),
    ("dc_motor", (("imbalance", "motor"), ("coulomb_friction", "motor")), TURNS),
    ("dc_motor", (("actuator_lag", "input"), ("dead_zone", "input")), STATIC),
    ("axis", (("coulomb_friction", "axis"), ("input_offset", "input")), DRY),
    ("axis", (("coulomb_friction", "axis"), ("cogging", "axis")), TURNS),
    ("axis", (("saturation", "input"), ("coulomb_friction", "axis")), STATIC),
    ("axis", (("stribeck_friction", "axis"), ("input_delay", "input")), DRY),
    ("axis", (("quadratic_drag", "axis"), ("imbalance", "axis")), TURNS),
    ("axis", (("actuator_lag", "input"), ("coulomb_friction", "axis")), DRY),
    ("axis", (("cable_spring", "axis"), ("dead_zone", "input")), STATIC),
    ("axis", (("sensor_delay", "velocity[axis]"), ("coulomb_friction", "axis")), DRY),
    ("axis", (("compliance", "axis"), ("coulomb_friction", "axis")), FAST),
    ("axis", (("compliance", "axis"), ("backlash", "axis-axis_far")), FAST),
    ("axis_position", (("compliance", "axis"), ("backlash", "axis-axis_far")), FAST),
    ("dc_motor", (("compliance", "motor"), ("backlash", "motor-motor_far")), FAST),
    ("axis_position", (("coulomb_friction", "axis"), ("load_torque", "axis")), DRY),
    ("axis_position", (("dead_zone", "input"), ("imbalance", "axis")), TURNS),
    ("torsion", (("input_offset", "input"), ("coulomb_friction", "motor")), DRY),
    ("torsion", (("imbalance", "motor"), ("coulomb_friction", "motor")), TURNS),
    ("torsion", (("slip", "motor-load1"), ("saturation", "input")), TWIST),
    ("torsion", (("backlash", "load1-load2"), ("coulomb_friction", "load3")), TWIST),
    ("torsion", (("hardening_stiffness", "motor-load1"), ("input_offset", "input")), TWIST),
    ("lead_screw", (("backlash", "nut-stage"), ("coulomb_friction", "rotor")), DRY),
    ("lead_screw", (("dead_zone", "input"), ("saturation", "input")), STATIC),
)

TRIPLES: tuple[tuple[str, tuple[tuple[str, str], ...], tuple[tuple[str, ...], tuple[str, ...]]], ...] = (
    ("dc_motor", (("dead_zone", "input"), ("backlash", "position[motor]"), ("input_offset", "input")), STATIC),
    ("dc_motor", (("coulomb_friction", "motor"), ("imbalance", "motor"), ("saturation", "input")), TURNS),
    ("dc_motor", (("dead_zone", "input"), ("quadratic_drag", "motor"), ("input_delay", "input")), STATIC),
    ("axis", (("coulomb_friction", "axis"), ("input_offset", "input"), ("imbalance", "axis")), TURNS),
    ("axis", (("coulomb_friction", "axis"), ("cogging", "axis"), ("actuator_lag", "input")), TURNS),
    ("axis", (("dead_zone", "input"), ("saturation", "input"), ("cable_spring", "axis")), STATIC),
    ("axis", (("stribeck_friction", "axis"), ("gain_asymmetry", "input"), ("quadratic_drag", "axis")), DRY),
    ("axis_position", (("coulomb_friction", "axis"), ("input_offset", "input"), ("saturation", "input")), STATIC),
    ("torsion", (("input_offset", "input"), ("coulomb_friction", "motor"), ("imbalance", "motor")), TURNS),
    ("torsion", (("slip", "motor-load1"), ("saturation", "input"), ("input_offset", "input")), TWIST),
    ("lead_screw", (("coulomb_friction", "rotor"), ("dead_zone", "input"), ("backlash", "nut-stage")), DRY),
)
