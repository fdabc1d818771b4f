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
# # Several joints
#
# A motor drives a load through a flexible coupling. The model is a chain of two bodies. This notebook fits it from two
# encoders, and finds the backlash in the coupling.

# %%
from pathlib import Path

import numpy as np

import idloop

# %% [markdown]
# ## The model
#
# The command acts on the first body. Every body may have a sensor, and each coupling has a stiffness and a damping.

# %%
text = """\
schema: idloop/model/1
name: two_masses
input: {topic: joint_command, joint: motor, field: effort, unit: N·m}
outputs:
  - {topic: joint_states, joint: motor, field: position, unit: rad, noise: 0.0002}
  - {topic: joint_states, joint: load, field: position, unit: rad, noise: 0.0002}
bodies:
  - {name: motor, inertia: {value: 0.002, min: 0.0}, viscous_friction: {value: 0.02, min: 0.0}}
  - {name: load, inertia: {value: 0.01, min: 0.0}, viscous_friction: {value: 0.01, min: 0.0}}
couplings:
  - {from: motor, to: load, stiffness: {value: 5.0, min: 0.0}, damping: {value: 0.01, min: 0.0}}
"""
Path("two_masses.yaml").write_text(text, encoding="utf-8")
model = idloop.load_model("two_masses.yaml")
print(model.free)

# %% [markdown]
# ## Records
#
# The machine is stiffer than the model file says, and its coupling has 0.02 rad of backlash.

# %%
machine = model.with_values({"motor-load.stiffness": 8.0, "load.inertia": 0.015})
machine = machine.with_effect("backlash", "motor-load", gap=0.02)


def experiment(seed: int) -> idloop.Record:
    """Six seconds at 200 Hz."""
    signal = idloop.excitation("rgs", amplitude=0.3, duration=6.0, sample_time=0.005, seed=seed)
    return idloop.simulate(machine, signal, seed=seed, name=f"run {seed}")


train, unseen = experiment(1), experiment(2)

# %% [markdown]
# ## Fit the linear chain
#
# The backlash makes the fitted coupling softer than it is.

# %%
linear = idloop.fit(model, train, validate=unseen)
linear

# %% [markdown]
# ## Add the backlash
#
# `diagnose` finds it among the effects of the catalogue (see *a hidden effect*). Here it is added directly.

# %%
fitted = idloop.fit(linear.model.with_effect("backlash", "motor-load"), train, validate=unseen)
fitted

# %%
idloop.compare([linear.model, fitted.model], unseen).plot()

# %% [markdown]
# ## For control design
#
# `to_control` returns the linear part as a python-control system, with all its tools.

# %%
system = idloop.to_control(fitted.model)
print(system.state_labels, system.input_labels, system.output_labels)
print("resonances [Hz]:", np.unique(np.round(np.abs(np.imag(system.poles())) / (2.0 * np.pi), 2)))

# %% [markdown]
# ## For a simulator
#
# MuJoCo reads the exported file, backlash included. What a format cannot hold is listed.

# %%
exported = idloop.export(fitted.model, "mujoco", "two_masses.xml")
print(exported.text[:200])
