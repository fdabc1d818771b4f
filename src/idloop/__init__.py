"""idloop: identification in the loop for servo axes on ROS 2.

Read a record, fit a model, see where it fails, find the physical effect that is missing, and plan the next experiment::

    import idloop

    model = idloop.load_model("dc_motor")
    train, unseen = idloop.read_bags(["bags/run1", "bags/run2"], model)
    ladder = idloop.refine(model, train, validate=unseen)
    print(ladder.summary())
    ladder.plot().savefig("ladder.png")

Every result has ``summary()``, ``plot()`` and ``to_dict()``. Names are imported on first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from idloop.api.comparison import Comparison, compare
    from idloop.api.compensation import Compensation, compensate
    from idloop.api.data import read_bag, read_bags, simulate
    from idloop.api.diagnosis import Diagnosis, diagnose
    from idloop.api.export import export, to_control
    from idloop.api.fit import Fit, fit
    from idloop.api.fleet import Fleet, identify_fleet
    from idloop.api.identification import Identification, identify
    from idloop.api.ladder import Ladder, refine
    from idloop.api.monitor import Monitor
    from idloop.api.robot import RobotIdentification, identify_robot
    from idloop.api.robot_excitation import RobotExcitation, excite_robot
    from idloop.api.start import Start, start
    from idloop.api.suggestion import Suggestion, suggest
    from idloop.errors import IdloopError, InputError
    from idloop.exporters import Exported
    from idloop.physics.model import Model
    from idloop.physics.model_file import load_model, preset_names
    from idloop.records.record import Record
    from idloop.signals import Signal
    from idloop.signals.generate import build_signal as excitation

__version__ = "0.1.0"

__all__ = [
    "Comparison",
    "Compensation",
    "Diagnosis",
    "Exported",
    "Fit",
    "Fleet",
    "Identification",
    "IdloopError",
    "InputError",
    "Ladder",
    "Model",
    "Monitor",
    "Record",
    "RobotExcitation",
    "RobotIdentification",
    "Signal",
    "Start",
    "Suggestion",
    "compare",
    "compensate",
    "diagnose",
    "excitation",
    "excite_robot",
    "export",
    "fit",
    "identify",
    "identify_fleet",
    "identify_robot",
    "load_model",
    "preset_names",
    "read_bag",
    "read_bags",
    "refine",
    "simulate",
    "start",
    "suggest",
    "to_control",
]

# Name: the module that has it, and what it is called there where that differs.
_WHERE = {
    "Comparison": "api.comparison",
    "Compensation": "api.compensation",
    "Diagnosis": "api.diagnosis",
    "Exported": "exporters",
    "Fit": "api.fit",
    "Fleet": "api.fleet",
    "IdloopError": "errors",
    "Identification": "api.identification",
    "InputError": "errors",
    "Ladder": "api.ladder",
    "Model": "physics.model",
    "Monitor": "api.monitor",
    "Record": "records.record",
    "RobotExcitation": "api.robot_excitation",
    "RobotIdentification": "api.robot",
    "Signal": "signals",
    "Start": "api.start",
    "Suggestion": "api.suggestion",
    "compare": "api.comparison",
    "compensate": "api.compensation",
    "diagnose": "api.diagnosis",
    "excitation": "signals.generate:build_signal",
    "excite_robot": "api.robot_excitation",
    "export": "api.export",
    "fit": "api.fit",
    "identify": "api.identification",
    "identify_fleet": "api.fleet",
    "identify_robot": "api.robot",
    "load_model": "physics.model_file",
    "preset_names": "physics.model_file",
    "read_bag": "api.data",
    "read_bags": "api.data",
    "refine": "api.ladder",
    "simulate": "api.data",
    "start": "api.start",
    "suggest": "api.suggestion",
    "to_control": "api.export",
}


def __getattr__(name: str) -> Any:
    """Import on first use, so that `import idloop` takes milliseconds."""
    if name not in _WHERE:
        raise AttributeError(f"module 'idloop' has no attribute '{name}'")
    import importlib

    module, _, function = _WHERE[name].partition(":")
    value = getattr(importlib.import_module(f"idloop.{module}"), function or name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
