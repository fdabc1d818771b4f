"""Free runs of axis models against SciPy, MuJoCo and plain C."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from speed.contest import Contest
from speed.plants import PLANTS, Plant, steps_of_command
from speed.result import Claim, Section

Array = NDArray[np.float64]

PERIOD = 1e-3
FINE = 64  # steps a sample of the run that the others are judged by
SOLVERS = ("RK45", "LSODA")  # what solve_ivp takes by itself, and its fastest here
LIMITS = {"LSODA": "it takes one step for each command, so that even plain C is hardly twice as far ahead of it"}
# MuJoCo's friction is a soft constraint of first order in the step: fine steps until it is as exact as it gets.
MUJOCO = {"viscous": (("RK4", 1),), "Coulomb": (("implicitfast", 1), ("implicitfast", 16))}


def run(contest: Contest) -> Section:
    """All contestants on all plants."""
    seconds = 5.0 if contest.quick else 30.0
    section = Section("simulation", f"Simulation: free run of {seconds:g} s at 1 kHz")
    for plant in PLANTS:
        one_plant(section, contest, plant, int(seconds / PERIOD))
    section.claims = claims(section)
    section.shown = [plant.name for plant in PLANTS if any(plant.dry)]
    section.remarks.append(
        f"Errors are the largest of the positions against plain C with {FINE} steps a sample. SciPy's friction is a"
        " smooth step 1e-3 rad/s wide; MuJoCo runs by its own rollout, without Python in"
        " the loop; its friction is a soft constraint, whose error does not fall with the step."
    )
    return section


def one_plant(section: Section, contest: Contest, plant: Plant, samples: int) -> None:
    """One plant by all."""
    data = plant.numbers() | {"command": steps_of_command(samples)}
    usual = {"period": PERIOD, "pieces": 1, "plant": plant.name}
    _, truth = contest.enter(
        plant.name, f"C, {FINE} steps", "simulation_c", data, usual | {"pieces": FINE}, ours=True, runs=1
    )
    entries = [("idloop", "simulation_idloop", usual, True, 21), ("C, gcc -O3", "simulation_c", usual, True, 21)]
    kind = "Coulomb" if any(plant.dry) else "viscous"
    for integrator, pieces in MUJOCO[kind]:
        settings = usual | {"integrator": integrator, "pieces": pieces}
        entries.append((f"MuJoCo, {integrator}, {1e3 * PERIOD / pieces:g} ms", "simulation_mujoco", settings, False, 5))
    entries += [(f"solve_ivp, {name}", "simulation_scipy", usual | {"method": name}, False, 1) for name in SOLVERS]
    for who, module, settings, ours, runs in entries:
        row, answer = contest.enter(plant.name, who, module, data, settings, ours=ours, runs=runs)
        if answer and truth:
            error = float(np.max(np.abs(answer["position"] - truth["position"])))
            row.answer["largest error [rad]"] = error
            row.agrees = error < 0.02 * float(np.ptp(truth["position"]))
        section.rows.append(row)


def claims(section: Section) -> list[Claim]:
    """The targets of the section."""
    found = []
    for plant in PLANTS:
        for name in SOLVERS:
            ratio = section.ratio(plant.name, f"solve_ivp, {name}")
            found.append(Claim(f"{plant.name}: solve_ivp, {name}, over ours", 300.0, ratio, limit=LIMITS.get(name, "")))
        others = [row.who for row in section.rows if row.work == plant.name and row.who.startswith("MuJoCo")]
        if others:
            # The finest of its steps is the one whose accuracy is nearest to ours.
            found.append(Claim(f"{plant.name}: {others[-1]} over ours", 5.0, section.ratio(plant.name, others[-1])))
        ratio = section.ratio(plant.name, "C, gcc -O3")
        cost = None if not ratio else 1.0 / ratio
        found.append(Claim(f"{plant.name}: ours over plain C", 3.0, cost, at_least=False))
    return found
