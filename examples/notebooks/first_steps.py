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
# # First steps
#
# A model describes an axis by its physics. This notebook simulates an axis, estimates its parameters from the
# record, and judges the model on a second record that was not fitted.

# %%
import idloop

# %% [markdown]
# ## Choose a model
#
# `axis` is a preset: one rotary body with an inertia and viscous friction, commanded in torque. `model.free` lists
# the parameters that a fit estimates; all others are known numbers.

# %%
model = idloop.load_model("axis")
print(model.to_yaml())
print("free:", model.free)

# %% [markdown]
# ## Make two records
#
# The simulated machine has twice the inertia that the model assumes, and dry friction. The excitation is a
# pseudo-random binary sequence. With a real machine, read two bags instead: `idloop.read_bags([...], model)`.

# %%
machine = model.with_values({"axis.inertia": 0.02, "axis.viscous_friction": 0.08})
machine = machine.with_effect("coulomb_friction", "axis", level=0.05)


def experiment(seed: int) -> idloop.Record:
    """Ten seconds at 200 Hz."""
    signal = idloop.excitation("prbs", amplitude=0.6, duration=10.0, sample_time=0.005, seed=seed)
    return idloop.simulate(machine, signal, seed=seed, name=f"run {seed}")


train, unseen = experiment(1), experiment(2)

# %% [markdown]
# ## Fit
#
# The fit estimates the free parameters with 95 % confidence intervals. FIT is 100 % for a perfect model, and 0 % for a
# model that is no better than the mean of the measurement.

# %%
start = model.with_effect("coulomb_friction", "axis")
fitted = idloop.fit(start, train, validate=unseen)
fitted

# %%
low, high = fitted.intervals["axis.inertia"]
print(f"inertia {fitted.values['axis.inertia']:.5f} kg·m², 95 % interval {low:.5f} to {high:.5f}; true 0.02")

# %% [markdown]
# ## Compare
#
# `compare` simulates each model with the recorded command and puts it beside the measurement.

# %%
comparison = idloop.compare([model, fitted.model], unseen)
comparison.plot()

# %%
print(comparison.fit)

# %% [markdown]
# ## Keep the model
#
# The file holds values, bounds and standard errors. Every verb of the command line and every ROS 2 node reads it.

# %%
fitted.model.save("fitted.yaml")
print(idloop.load_model("fitted.yaml").values)
