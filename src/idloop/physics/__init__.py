"""The axis model: bodies, couplings, drive, one file per physical effect, one compiled simulator."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from idloop.physics.conditions import Condition
    from idloop.physics.effect import Effect, EffectEquation, EffectParameter, catalogue
    from idloop.physics.effect_text import parse_effect
    from idloop.physics.engine import Engine
    from idloop.physics.hooks import hook
    from idloop.physics.machine import Machine
    from idloop.physics.model import Model
    from idloop.physics.model_file import load_model, preset_names
    from idloop.physics.parameter import Parameter
    from idloop.physics.plant import Plant
    from idloop.physics.simulation import Simulation, simulate

__all__ = [
    "Condition",
    "Effect",
    "EffectEquation",
    "EffectParameter",
    "Engine",
    "Machine",
    "Model",
    "Parameter",
    "Plant",
    "Simulation",
    "catalogue",
    "hook",
    "load_model",
    "parse_effect",
    "preset_names",
    "simulate",
]

_WHERE = {
    "Condition": "conditions",
    "Effect": "effect",
    "EffectEquation": "effect",
    "Engine": "engine",
    "Model": "model",
    "Parameter": "parameter",
    "EffectParameter": "effect",
    "Machine": "machine",
    "Plant": "plant",
    "Simulation": "simulation",
    "catalogue": "effect",
    "hook": "hooks",
    "load_model": "model_file",
    "parse_effect": "effect_text",
    "preset_names": "model_file",
    "simulate": "simulation",
}


def __getattr__(name: str) -> Any:
    """Import on first use, so that reading a model file does not start the compiler."""
    if name not in _WHERE:
        raise AttributeError(f"module 'idloop.physics' has no attribute '{name}'")
    import importlib

    value = getattr(importlib.import_module(f"idloop.physics.{_WHERE[name]}"), name)
    globals()[name] = value
    return value
