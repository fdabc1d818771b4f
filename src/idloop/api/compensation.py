"""What it gains to cancel the effects of a fitted model in the controller."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from idloop.api import tracking_runs as runs
from idloop.api.result import Progress, Result, ignore_progress
from idloop.control import build_controller
from idloop.control.compensation import Compensation as NewSettings
from idloop.errors import InputError
from idloop.exporters.compensator import export_compensation
from idloop.output_files import write_text
from idloop.reporting.plots.tracking import plot_tracking
from idloop.reporting.text.blocks import Block
from idloop.reporting.text.tracking import command_sizes, ratio, tracking_blocks

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from idloop.control import Controller
    from idloop.control.compensation import Compensation as Settings
    from idloop.physics import Model


@dataclass(frozen=True)
class Compensation(Result):
    """A closed loop without and with compensation.

    Attributes
    ----------
    settings : idloop.control.compensation.Compensation
        The model whose effects are cancelled, and within which limits.
    controller : Controller
        The compensating controller, with its plan of what is cancelled and how.
    loops : Loops
        The runs without, with, and without the effects.
    reference : Reference
    settle : float
        Seconds at the start that the errors leave out.
    """

    settings: Settings
    controller: Controller
    loops: runs.Loops = field(repr=False)
    reference: runs.Reference = field(repr=False)
    settle: float = 1.0

    @property
    def model(self) -> Model:
        """The compensating model."""
        return self.settings.model

    @property
    def followed(self) -> str:
        """Output that the controller makes follow the reference."""
        return str(self.controller.parameters.get("output") or self.controller.inputs[0])

    @property
    def ratio(self) -> dict[str, float]:
        """Tracking error (rms) with compensation over that without, by output."""
        without, compensated = self.loops.without, self.loops.compensated
        return {
            name: ratio(compensated.error_of(name, self.settle).rms, without.error_of(name, self.settle).rms)
            for name in without.followed
        }

    def blocks(self) -> Iterator[Block]:
        """Yield what is cancelled and how, the tracking errors, and the size of the command."""
        loops = (self.loops.without, self.loops.compensated, self.loops.aim)
        plan, unit = self.controller.plan, self.model.input.unit
        return tracking_blocks(loops, plan, self.reference.words, self.followed, self.settle, self.model.name, unit)

    def plot(self) -> Figure:
        """Draw motion, error and command without and with compensation."""
        names = self.model.input.name, self.model.input.unit
        return plot_tracking(self.loops.without, self.loops.compensated, self.followed, *names, self.settle)

    def to_dict(self) -> dict[str, Any]:
        """Return the document of schema ``idloop/compensate/1``."""
        without, compensated, aim = self.loops.without, self.loops.compensated, self.loops.aim
        units = dict(zip(without.names, without.units, strict=True))
        errors = {
            name: {
                "unit": units[name],
                "without": without.error_of(name, self.settle),
                "with": compensated.error_of(name, self.settle),
                "ratio": part,
                "aim": None if aim is None else aim.error_of(name, self.settle),
            }
            for name, part in self.ratio.items()
        }
        assert self.controller.plan is not None  # noqa: S101 - it was built with a compensation
        return {
            "schema": "idloop/compensate/1",
            "model": self.model.name,
            "controller": self.model.controller,
            "followed": self.followed,
            "cancelled": {one.active.name: one.how for one in self.controller.plan.cancelled},
            "left": self.controller.plan.left,
            "settings": self.controller.settings,
            "reference": {"signal": self.reference.signal, "text": self.reference.words},
            "settle": self.settle,
            "errors": errors,
            "command": {
                "without": command_sizes(without.command),
                "with": command_sizes(compensated.command),
                "limit": self.controller.limit,
            },
        }

    def save(self, path: str | Path) -> Path:
        """Write the compensator that the controller node takes as its parameter `compensation`."""
        write_text(Path(path), export_compensation(self.settings).text)
        return Path(path)


def compensate(
    model: Model,
    *,
    effects: Sequence[str] = (),
    plant: Model | Path | None = None,
    plant_effects: Sequence[str] = (),
    reference: str | None = None,
    controller: str | Mapping[str, Any] | None = None,
    limit: float | None = None,
    velocity_width: float | None = None,
    command_width: float | None = None,
    crossing_time: float | None = None,
    settle: float = 1.0,
    seed: int = 0,
    noise: bool = True,
    run: Callable[..., runs.Loops] | None = None,
    progress: Progress = ignore_progress,
) -> Compensation:
    """Follow a reference without and with compensation by a model.

    Parameters
    ----------
    model : Model
        The machine as a fit has found it; its section `controller` closes the loop.
    effects : sequence of str
        Cancel these only (``name`` or ``name@site``); all that can be when empty.
    plant : Model or Path, optional
        The machine: another model, or an MJCF file for MuJoCo; as `model` says when left out.
    plant_effects : sequence of str
        Added to the machine, as ``dead_zone@input(width=0.1)``.
    reference : str, optional
        A signal as YAML, or the path of a bag whose reference is followed again; moves to and fro when left out.
    controller : str or mapping, optional
        Section of a controller, as mapping, text or file, in place of the model's.
    limit : float, optional
        Most that is added to the command [input unit]; half of the controller's limit when left out.
    velocity_width, command_width, crossing_time : float, optional
        Where dry friction, a jump of the command and a gap are cancelled in part.
    settle : float
        Seconds at the start that the errors leave out.
    seed : int
        Of the measurement noise.
    noise : bool
        Whether sensors have noise.
    run : callable, optional
        Runs the loops: takes what `idloop.api.tracking_runs.simulate_loops` takes but the progress. Simulated when left
        out.
    progress : callable, optional
        Called with the share done in [0, 1] and a short text.

    Raises
    ------
    InputError
        No controller, one without feedback, or a reference that cannot be followed.

    Examples
    --------
    >>> import idloop
    >>> axis = idloop.load_model("axis").with_effect("coulomb_friction", "axis", level=0.3)
    >>> idloop.compensate(axis).ratio["axis.position"] < 0.5
    True
    """
    if controller is None or isinstance(controller, str):
        section: Mapping[str, Any] = runs.controller_section(model, controller)
    else:
        section = {"sample_time": 0.001, **controller}
    model = replace(model, controller=dict(section))
    settings = NewSettings(model, tuple(effects), limit, velocity_width, command_width, crossing_time)
    built = build_controller(section, compensation=settings)
    if not built.inputs:
        raise InputError("the controller has no feedback and follows nothing: give another one with --controller")
    machine = runs.machine_of(plant, plant_effects, model)
    path = runs.make_reference(reference, model, section)
    if settle >= (len(path.path) - 1) * built.sample_time:
        raise InputError(f"--settle {settle:g} s leaves nothing of the reference: shorten it")
    run = run or partial(runs.simulate_loops, progress=progress)
    return Compensation(settings, built, run(machine, settings, section, path, seed=seed, noise=noise), path, settle)
