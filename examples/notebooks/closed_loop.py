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
# # The closed loop
#
# Under feedback the command depends on the measurement noise, and some identification methods become biased. This
# notebook identifies a motor in closed loop, then uses the model to cancel friction in the controller.

# %%
import numpy as np

import idloop

# %% [markdown]
# ## A record in closed loop
#
# With `controller=True` the signal is the reference of the controller that the model file describes. The record
# contains the command that the controller computed.

# %%
model = idloop.load_model("axis")
machine = model.with_effect("coulomb_friction", "axis", level=0.1)


def experiment(seed: int) -> idloop.Record:
    """Six seconds at 200 Hz."""
    reference = idloop.excitation("rgs", amplitude=1.0, duration=6.0, sample_time=0.005, seed=seed)
    return idloop.simulate(machine, reference, controller=model.controller | {"sample_time": 0.005}, seed=seed)


train, unseen = experiment(1), experiment(2)

# %% [markdown]
# ## A grey-box fit
#
# The prediction and force criteria are consistent under feedback; `fit` chooses the criterion and reports why.

# %%
fitted = idloop.fit(model.with_effect("coulomb_friction", "axis"), train, validate=unseen)
fitted

# %% [markdown]
# ## A black-box method for closed loops
#
# `pbsid` is a subspace method that is consistent under feedback. Its model is linear, so it averages the dry friction.

# %%
black_box = idloop.identify(train, "pbsid", order=2, sample_time=0.005)
print(black_box.summary())

# %% [markdown]
# ## Cancel the friction
#
# `compensate` follows a reference without and with compensation and returns the ratio of the tracking errors. Here
# the compensator uses the fitted model, and the machine is the true one.

# %%
gain = idloop.compensate(fitted.model, plant=machine)
gain

# %%
gain.plot()

# %%
print({name: float(np.round(ratio, 2)) for name, ratio in gain.ratio.items()})
gain.save("compensator.yaml")
