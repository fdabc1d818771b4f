# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # From a log to the missing effect
#
# `start` reads a log of any form, finds out what its columns are, and fits a first model. `refine` adds the physical
# effects that the data ask for. No file is written by hand. Three machines show it, each with an effect that its log
# does not mention.

# %%
from pathlib import Path

import numpy as np

import idloop


def machine(position: str, command: str, body: str, gain: str, effect: str) -> idloop.Model:
    """A machine of one body with a hidden effect."""
    text = f"""\
schema: idloop/model/1
name: machine
input: {{topic: joint_command, joint: m, field: effort, unit: {command}}}
outputs:
  - {{topic: joint_states, joint: m, field: position, unit: {position}}}
  - {{topic: joint_states, joint: m, field: velocity, unit: {position}/s}}
bodies:
  - {{name: m, {body}}}
drive: {{gain: {gain}}}
"""
    Path("machine.yaml").write_text(text, encoding="utf-8")
    return idloop.load_model("machine.yaml").with_effects([effect])


noise = np.random.default_rng(7)

# %% [markdown]
# ## A geared motor, logged over a serial line
#
# A microcontroller prints time, duty cycle and speed, with text in between. Small duty cycles do not move the motor.

# %%
motor = machine("rad", '"-"', "inertia: 1.0, viscous_friction: 6.0", "0.9", "dead_zone@input(width=20.0)")
steps = idloop.excitation("multilevel", sample_time=0.02, duration=40.0, amplitude=100.0, seed=1)
run = idloop.simulate(motor, steps, noise=False)
speed = 60 / (2 * np.pi) * run.output[:, 1] + 0.1 * noise.normal(size=run.time.size)
lines = ["Booting", "time_ms,pwm,rpm"]
for stamp, duty, rpm in zip(run.time, run.input_at(run.time), speed, strict=True):
    lines.append(f"{1e3 * stamp:.0f},{duty:.0f},{rpm:.1f}")
lines.insert(700, "battery 11.9 V")
Path("serial.txt").write_text("\n".join(lines), encoding="utf-8")

motor_started = idloop.start("serial.txt", "motor")
motor_started

# %%
motor_ladder = idloop.refine(motor_started.fit.model, motor_started.records)
motor_ladder

# %% [markdown]
# ## A robot joint, exported from a drive
#
# A header of notes, semicolons, decimal commas, degrees and revolutions per minute. The joint has dry friction.

# %%
joint = machine("rad", "N·m", "inertia: 0.08, viscous_friction: 0.4", "1.0", "coulomb_friction@m(level=0.5)")
torque = idloop.excitation("multisine", sample_time=0.004, duration=20.0, amplitude=3.0, seed=2)
run = idloop.simulate(joint, torque, noise=False)
angle = np.degrees(run.output[:, 0]) + 0.01 * noise.normal(size=run.time.size)
speed = 60 / (2 * np.pi) * run.output[:, 1] + 0.05 * noise.normal(size=run.time.size)
table = np.column_stack([1e3 * run.time, run.input_at(run.time), angle, speed])
rows = [";".join(f"{cell:.4f}" for cell in row).replace(".", ",") for row in table]
header = "Time [ms];Torque demand [Nm];Position actual [deg];Velocity actual [rpm]"
Path("drive.csv").write_text("\n".join(["Drive export", "Serial number;4711", header, *rows]), encoding="utf-8")

joint_started = idloop.start("drive.csv", "joint")
joint_ladder = idloop.refine(joint_started.fit.model, joint_started.records)
joint_ladder

# %% [markdown]
# ## A linear stage, one signal per file
#
# Current and position are logged by two devices, with time stamps and rates of their own. The amplifier limits its
# current.

# %%
stage = machine("m", "A", "inertia: 4.0, viscous_friction: 30.0", "25.0", "saturation@input(limit=1.0)")
current = idloop.excitation("rgs", sample_time=0.01, duration=20.0, amplitude=1.5, seed=3)
run = idloop.simulate(stage, current, noise=False)
position = 1e3 * run.output[:, 0] + 0.002 * noise.normal(size=run.time.size)
for file, header, columns in (
    ("amplifier.csv", "t_s,current_A", [run.time, run.input_at(run.time)]),
    ("scale.csv", "time_us,x_mm", [1e6 * run.time, position]),
):
    np.savetxt(file, np.column_stack(columns), delimiter=",", header=header, comments="", fmt="%.7g")

stage_started = idloop.start(["amplifier.csv", "scale.csv"], "stage")
stage_ladder = idloop.refine(stage_started.fit.model, stage_started.records)
stage_ladder

# %% [markdown]
# The effects that were named, and those that were hidden:

# %%
hidden = {"motor": "dead_zone@input", "joint": "coulomb_friction@m", "stage": "saturation@input"}
for name, ladder in (("motor", motor_ladder), ("joint", joint_ladder), ("stage", stage_ladder)):
    print(f"{name}: hidden {hidden[name]}, named {ladder.added}")
