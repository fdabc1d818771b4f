"""Inspection of bags, as a whole and for the joint of a model."""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from idloop.api.single_thread import single_threaded
from idloop.called_as import program

if TYPE_CHECKING:
    from idloop.physics import Model
    from idloop.records import Finding, Inspection


@dataclass(frozen=True)
class BagGrade:
    """How far a bag can be used for one joint."""

    bag: Path
    # As those of an inspection, by the faults alone: a constant command may serve beside other records
    grade: str
    reason: str
    faults: tuple[Finding, ...]

    @property
    def useless(self) -> bool:
        """Whether nothing can be identified from it."""
        from idloop.records.inspection.grade import EVERYTHING, NOT_USABLE

        return self.grade == f"{NOT_USABLE} {EVERYTHING}"

    def line(self, said: Container[str] = ()) -> str:
        """What there is to say before a fit; empty without a fault that is new or spoils something.

        `said`: texts of findings that the user has seen.
        """
        new = [one for one in self.faults if one.spoils or one.text not in said]
        return f"{self.bag}: {self.grade}: {self.reason} ({program()} inspect {self.bag})" if new else ""

    def to_dict(self) -> dict[str, Any]:
        """Return plain values."""
        faults = [one.to_dict() for one in self.faults]
        return {"bag": str(self.bag), "grade": self.grade, "grade_reason": self.reason, "faults": faults}


@single_threaded
def inspect_bag(bag: Path, *, command: str | None = None, distro: str | None = None) -> Inspection:
    """Inspect a bag as `idloop.records.inspect_bag` does, with one thread for linear algebra."""
    from idloop import records

    return records.inspect_bag(bag, command=command, distro=distro)


def without_modelled_faults(model: Model, inspection: Inspection) -> Inspection:
    """Return an inspection without the faults that a model describes.

    These are a set-point, where it has the drive's loop, and a command that was measured, where its input is.
    """
    from idloop.records.inspection.faults.loops import SET_POINT
    from idloop.records.inspection.measured_input import KIND as MEASURED

    kinds = [*([SET_POINT] if model.loop is not None else []), *([MEASURED] if model.input.kind == "measured" else [])]
    return inspection.with_notes(*kinds) if kinds else inspection


def bag_grades(bags: Sequence[Path], model: Model) -> list[BagGrade]:
    """Inspect the joint of a model in each of several bags.

    `model`: names the command and the joint.
    Raises InputError: a bag cannot be read, or does not hold the command.
    """
    from idloop.records.bags.topics import REQUESTED_COMMAND
    from idloop.records.inspection.together import judged_together

    own = model.input.topic
    # Of a requested command, the one that the drive applied counts.
    command = None if own.rpartition("/")[2] == REQUESTED_COMMAND else own
    inspections = [without_modelled_faults(model, inspect_bag(bag, command=command)) for bag in bags]
    return [_grade(bag, model, one) for bag, one in zip(bags, judged_together(inspections), strict=True)]


def _grade(bag: Path, model: Model, inspection: Inspection) -> BagGrade:
    from idloop.records.inspection.grade import USABLE, grade

    joints = {output.joint for output in model.outputs} | {model.input.joint}
    others = tuple(f"{name}." for name in inspection.joints if name not in joints)
    faults = tuple(one for one in inspection.faults if not one.where.startswith(others))
    return BagGrade(bag, *grade(USABLE, faults), faults)
