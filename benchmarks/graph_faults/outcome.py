"""What one fault did."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass
class Outcome:
    """What one fault did.

    Attributes
    ----------
    zero : float or None
        Seconds from the last command that was none to the first zero, where the fault asks for one.
    tail : float or None
        Age of the last measurement that was saved [s], where a recording was cut off.
    back : float or None
        Seconds until everything ran again.
    wrong : list of str
        Findings.
    late : list of str
        Findings about time, which a busy machine may cause as well.
    """

    zero: float | None = None
    tail: float | None = None
    back: float | None = None
    wrong: list[str] = field(default_factory=list)
    late: list[str] = field(default_factory=list)

    def told_zero(self, after: float, within: float = 0.05) -> None:
        """Take in when the robot was told zero [s], and until when it had to be."""
        self.zero = after
        if after > within:
            self.late.append(f"zero after {1e3 * after:.0f} ms")
