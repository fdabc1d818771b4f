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
# # An effect of one's own
#
# The catalogue of effects is open: an effect is one Python file in a folder `effects` beside the model file. This
# notebook adds an eddy-current brake, whose torque first rises and then falls with speed, and lets a diagnosis find it.

# %%
from pathlib import Path

import idloop

# %% [markdown]
# ## The effect
#
# A `force` equation returns the force on the body. It is compiled, so it uses numbers and `math` only. Every parameter
# has a unit and bounds. At its neutral value, here 0, the effect does nothing.

# %%
source = '''\
"""Eddy-current brake: drag that peaks at a critical speed."""

from typing import Any

from idloop.physics import Effect, EffectParameter, hook


@hook
def force(position: float, velocity: float, inertia: float, elapsed: float, state: Any, parameters: Any) -> float:
    """T = -2 peak / (v / v_c + v_c / v)."""
    ratio = velocity / parameters[1]
    return -2.0 * parameters[0] * ratio / (1.0 + ratio * ratio)


EFFECT = Effect(
    name="eddy_brake",
    site="body",
    text="An eddy-current brake opposes motion with a torque that peaks at a critical speed.",
    parameters=(
        EffectParameter("peak", "{force}", min=0.0, start=0.1),
        EffectParameter("critical_speed", "{position}/s", min=0.1, max=100.0, start=5.0),
    ),
    force=force,
)
'''
Path("effects").mkdir(exist_ok=True)
Path("effects/eddy_brake.py").write_text(source, encoding="utf-8")

# %% [markdown]
# ## The model
#
# An effect file is code, and reading the model runs it. Look at the file, then allow it: here with
# `allow_effects=True`, on the command line once with `idloop trust`.

# %%
idloop.load_model("axis").save("axis.yaml")
model = idloop.load_model("axis.yaml", allow_effects=True)
machine = model.with_effect("eddy_brake", "axis", peak=0.3, critical_speed=4.0)

# %% [markdown]
# ## Find it
#
# The diagnosis treats the effect like those of the catalogue.


# %%
def experiment(amplitude: float, seed: int) -> idloop.Record:
    """Ten seconds at 100 Hz."""
    signal = idloop.excitation("rgs", amplitude=amplitude, duration=10.0, sample_time=0.01, seed=seed)
    return idloop.simulate(machine, signal, seed=seed, name=f"run {seed}")


train, unseen = [experiment(1.0, 1), experiment(0.3, 2)], experiment(0.6, 3)
diagnosis = idloop.diagnose(model, train)
diagnosis

# %% [markdown]
# ## Fit it

# %%
fitted = idloop.fit(model.with_effect("eddy_brake", "axis"), train, validate=unseen)
fitted

# %%
fitted.plot()
