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
# # Own data from CSV
#
# A log needs three things: time stamps, the command, and at least one measurement. This notebook reads a CSV file
# into a record, writes a model for the axis, and fits it.

# %%
from pathlib import Path

import numpy as np

import idloop

# %% [markdown]
# ## A log
#
# This cell writes the log that the rest of the notebook reads: a linear axis with a current command in mA and an
# encoder in mm. Replace it by your own file.

# %%
stage = """\
schema: idloop/model/1
name: stage
input: {topic: joint_command, joint: stage, field: effort, unit: A}
outputs:
  - {topic: joint_states, joint: stage, field: position, unit: m}
bodies:
  - {name: stage, inertia: {value: 5.0, min: 0.0}, viscous_friction: {value: 50.0, min: 0.0}}
drive: {gain: 20.0}
"""
Path("stage.yaml").write_text(stage, encoding="utf-8")
model = idloop.load_model("stage.yaml")

true = {"stage.inertia": 8.0, "stage.viscous_friction": 90.0}
signal = idloop.excitation("rgs", amplitude=1.0, duration=20.0, sample_time=0.005, seed=1)
logged = idloop.simulate(model.with_values(true), signal, noise=False)
position = logged.output[:, 0] + 2e-6 * np.random.default_rng(1).normal(size=len(logged.time))
columns = np.column_stack([1e3 * logged.time, 1e3 * logged.input_at(logged.time), 1e3 * position])
np.savetxt("log.csv", columns, delimiter=",", header="t_ms,i_mA,x_mm", comments="", fmt="%.7g")
print("\n".join(Path("log.csv").read_text(encoding="utf-8").splitlines()[:4]))

# %% [markdown]
# ## Read the log
#
# Units are those of the model: s, A and m. `from_arrays` takes arrays; `from_frame` takes a pandas or polars data frame
# with the names of its columns. A measurement that is missing is NaN.

# %%
table = np.genfromtxt("log.csv", delimiter=",", names=True)
record = idloop.Record.from_arrays(
    1e-3 * table["t_ms"], 1e-3 * table["i_mA"], {"stage.position": 1e-3 * table["x_mm"]}, model, name="log"
)
print(record.output_names, f"{record.duration:.1f} s, every {1e3 * record.sample_time:.1f} ms")

# %% [markdown]
# ## Fit one half, judge on the other
#
# The drive gain is a bare number in the model file, so it is known. Without a known gain or a known mass, only
# their ratio could be estimated.

# %%
fitted = idloop.fit(model, record.cut(0.0, 10.0), validate=record.cut(10.0, 20.0))
fitted

# %%
for name, value in fitted.values.items():
    if name in fitted.intervals:
        low, high = fitted.intervals[name]
        print(f"{name}: {value:.3f}, 95 % interval {low:.3f} to {high:.3f}, true {true[name]:g}")

# %%
fitted.plot()
