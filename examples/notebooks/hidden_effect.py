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
# # A hidden effect
#
# A motor has a dead zone that its model does not contain. This notebook finds the effect from two records, adds it to
# the model, and writes a report.

# %%
import idloop

# %% [markdown]
# ## The machine and its model
#
# The dead zone is in the simulated machine only. The records have two amplitudes: with a command of one size, a dead
# zone looks like a smaller gain.

# %%
model = idloop.load_model("dc_motor")
machine = model.with_effect("dead_zone", "input", width=0.3)


def experiment(amplitude: float, seed: int) -> idloop.Record:
    """Twenty seconds at 100 Hz."""
    signal = idloop.excitation("prbs", amplitude=amplitude, duration=20.0, sample_time=0.01, seed=seed)
    return idloop.simulate(machine, signal, seed=seed, name=f"{amplitude} V")


train, unseen = [experiment(1.0, 1), experiment(1.5, 2)], experiment(0.7, 3)

# %% [markdown]
# ## Where the model fails
#
# The best linear model misses a part of the velocity. The figure shows its error over velocity, command, position,
# frequency and time since the last reversal.

# %%
linear = idloop.fit(model, train, validate=unseen)
idloop.compare(linear.model, unseen).plot()

# %% [markdown]
# ## What is missing
#
# `diagnose` weighs every effect of the catalogue by what models with and without it predict of samples that were not
# fitted. The answer lists the effects that the data support, those that tie, and those that this data cannot show.

# %%
diagnosis = idloop.diagnose(model, train)
diagnosis

# %%
print(diagnosis.verdict, diagnosis.missing)

# %% [markdown]
# ## Add it
#
# `refine` adds one effect at a time, fits again, and stops when nothing significant is left.

# %%
ladder = idloop.refine(model, train, validate=unseen)
ladder

# %%
ladder.plot()

# %%
width = ladder.model.values["dead_zone@input.width"]
print(f"dead zone {width:.3f} V, true 0.3 V")

# %% [markdown]
# ## Report
#
# One HTML file that needs no network. `ladder.save("run")` keeps model, ladder and report together for the
# command line.

# %%
print(ladder.report("report.html"))
