"""Row C5: all candidates on the same validation data in free run, with a grey-box model whose effects were found."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from papers import Progress
from papers.claim import above, below, near, stated
from papers.reproduction import Line, Reproduction, Table
from papers.stage import stage_paper
from papers.stage.stage_candidates import HEADER, Bench, Candidate, Scores, bench, black_box, draw, limit, scores
from papers.stage.stage_linear import transfer_function
from papers.stage.stage_neural import CLOSED, OPEN, neural_network
from papers.stage.stage_wavelet import wavelet_network

if TYPE_CHECKING:
    from idloop.diagnosis import Ladder
    from idloop.physics import Model
    from idloop.records import Record


LINEAR, WAVELET, GREY = "linear transfer function", "wavelet network", "grey-box with found effects"
# Other stretches of the excitation on which the paper's order is counted.
REPEATS = 6
# Seconds of the training record that the diagnosis reads.
READ = 30.0
# A free run fails where it misses more than this many times what the encoder's counts alone leave.
_FAILS = 2.0
# What the diagnosis calls dry friction and play of the stage, and how near their sizes must come to those built in.
FRICTION, PLAY = "coulomb_friction@stage.level", "backlash@screw-stage.gap"
_SIZE = 0.05


@dataclass(frozen=True)
class Stretch:
    """FIT of free runs [%] on a further stretch: linear model, wavelet network, neural network, the machine itself.

    Attributes
    ----------
    full, half : tuple of float
        At the training amplitude and at half of it.
    """

    full: tuple[float, ...]
    half: tuple[float, ...]

    @property
    def ordered(self) -> bool:
        """Whether the paper's order of methods holds."""
        linear, wavelet, neural, _ = self.full
        return linear < wavelet < neural

    @property
    def networks_fail(self) -> bool:
        """Whether both networks fail at half amplitude."""
        return all(fit < failing(self.half[-1]) for fit in self.half[1:3])


def failing(most: float) -> float:
    """FIT below which a free run misses more than twice what the encoder's counts alone leave, by theirs [%]."""
    return 100.0 - _FAILS * (100.0 - most)


@dataclass(frozen=True, eq=False)
class StageComparison(Reproduction):
    """The comparison.

    Attributes
    ----------
    data : Bench
    candidates : tuple of Candidate
        In the paper's order, then the grey-box model, then the network's open-loop form.
    ladder : Ladder
        From the plain linear model to the grey-box one.
    stretches : tuple of Stretch
    """

    data: Bench
    candidates: tuple[Candidate, ...]
    ladder: Ladder
    stretches: tuple[Stretch, ...]

    def found(self, name: str) -> Scores:
        """Measures of one candidate."""
        (candidate,) = [each for each in self.candidates if each.name == name]
        return scores(candidate, self.data)

    def rows(self) -> tuple[Line, ...]:
        """The paper's table 2, its order, and the grey-box model beside it."""
        paper = dict(zip((LINEAR, WAVELET, CLOSED),
                         (stage_paper.LINEAR, stage_paper.WAVELET, stage_paper.NEURAL), strict=True))  # fmt: skip
        measured = {name: self.found(name) for name in (*paper, GREY)}
        lines = []
        for name, published in paper.items():
            lines += [
                Line(f"{name}: FIT, free run", measured[name].free, published.fit, "%", "table 2",
                     near(published.fit, stage_paper.NEAR)),
                Line(f"{name}: MSE, free run", measured[name].free_mse, published.mse, "in²/s²", "table 2"),
            ]  # fmt: skip
        free = [measured[name].free for name in paper]
        count = len(self.stretches)
        held, failed = (sum(getattr(each, what) for each in self.stretches) for what in ("ordered", "networks_fail"))
        grey, most = measured[GREY], scores(limit(self.data), self.data)
        others = [self.found(each.name) for each in self.candidates if each.name != GREY]
        best = max(other.free for other in others), max(other.half for other in others)
        networks = max(measured[name].half for name in (WAVELET, CLOSED))
        effects = ", ".join(self.ladder.added)
        built = stage_paper.machine()
        kinds = sorted(name.split("@")[0] for name in self.ladder.added)
        hidden = sorted(name.split("@")[0] for name in built.effect_names)
        return (
            *lines,
            Line("order of methods in free run", " < ".join(sorted(paper, key=lambda name: measured[name].free)),
                 " < ".join(paper), "", "table 2", stated("the same order", free == sorted(free))),
            Line(f"the order holds on further stretches, of {count}", float(held), None, "", "",
                 above(count / 2) if count else None),
            Line("effects found", effects, "friction, backlash", "", "section 4",
                 stated("all hidden, no other", kinds == hidden)),
            *self._sizes(built),
            Line("grey-box: FIT, free run, of at most", f"{grey.free:.2f} of {most.free:.2f}", None, "%", "",
                 above(best[0]).of(grey.free)),
            Line("grey-box: FIT at half amplitude, of at most", f"{grey.half:.2f} of {most.half:.2f}", None, "%", "",
                 above(max(best[1], failing(most.half))).of(grey.half)),
            Line("networks: best FIT at half amplitude, fails", networks, None, "%", "", below(failing(most.half))),
            Line(f"networks fail at half amplitude on further stretches, of {count}", float(failed), None, "", "",
                 above(count / 2) if count else None),
        )  # fmt: skip

    def _sizes(self, built: Model) -> tuple[Line, ...]:
        """Dry friction and play that were found beside those that were built in, where they were found."""
        found = self.ladder.model.values
        lines = []
        for text, ours, true in (
            ("dry friction found, over the one built in", FRICTION, "coulomb_friction@stage.level"),
            ("play found, over the one built in", PLAY, "backlash@screw-nut.gap"),
        ):
            if ours in found:
                ratio = found[ours] / built.values[true]
                lines.append(Line(text, ratio, 1.0, "", "built in", near(1.0, _SIZE)))
        return tuple(lines)

    def tables(self) -> tuple[Table, ...]:
        """All candidates, the ladder of the grey-box model, and the further stretches."""
        everyone = (*self.candidates, limit(self.data))
        candidates = Table("On records that the fit has not seen", ("model", *HEADER),
                           [(each.name, *scores(each, self.data).cells) for each in everyone])  # fmt: skip
        steps = []
        for step in self.ladder.steps:
            judged = scores(grey_box(step.model, self.data), self.data)
            name = "plain linear model" if step.added is None else f"+ {step.added.name}"
            tied = ", ".join(other for other in step.set if step.added is None or other != step.added.name)
            steps.append((name, judged.free, judged.half, tied))
        header = ("step", "FIT free run [%]", "FIT at half amplitude [%]", "not told apart from")
        ladder = Table("The grey-box model, step by step", header, steps)
        names = (LINEAR, WAVELET, CLOSED, "the machine itself")
        columns = [*(f"{name} [%]" for name in names), *(f"{name}, half [%]" for name in names)]
        rows = [(*each.full, *each.half) for each in self.stretches]
        further = Table("FIT of the free run on further stretches", columns, rows)
        return (candidates, ladder, further) if rows else (candidates, ladder)

    def notes(self) -> tuple[str, ...]:
        """What each candidate was given, and how the experiment was chosen."""
        built = ", ".join(name for name in stage_paper.machine().effect_names if name != stage_paper.ENCODER)
        return (
            (
                f"All candidates learn from one record at {stage_paper.AMPLITUDE:g} V and are judged on the same"
                f" samples of others. The diagnosis of the grey-box model reads the first {READ:g} s of it as the"
                f" encoder gave it every {stage_paper.LOGGER_STEP * 1e3:g} ms; it starts from screw and stage, coupled"
                " stiffly, with viscous friction and no effect, and is told nothing of what was built in."
            ),
            (
                f"Built into the machine: {built}. The encoder sits on the screw and sees of the guides what comes back"
                " through the nut: after each reversal their friction is missing until the play is crossed. A start of"
                " one inertia has no place for the gap, and that passes for presliding friction there. The start has"
                f" the paper's chain of bodies instead, halved; its coupling ({stage_paper.NUT_STIFFNESS:g} N m/rad) is"
                " softer than the machine's, whose knocks are quicker than the logger's samples."
            ),
            (
                "The networks saw two levels of command and none between: elsewhere their free run is what their units"
                " happen to say, and it can run away to the limits that hold it. A free run is said to fail where it"
                f" misses more than {_FAILS:g} times what the encoder's counts alone leave."
            ),
            (
                "The neural network of table 2 is taken in closed-loop form; its open-loop form is listed too, and its"
                " free run may fall behind the wavelet network's. At the training amplitude the closed-loop form and"
                " the grey-box model both come near what the encoder's counts allow, and tenths lie between them. At"
                " half of it only one is left."
            ),
            *stage_paper.choices(),
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            **super().to_dict(),
            "scores": {each.name: vars(scores(each, self.data)) for each in (*self.candidates, limit(self.data))},
            "effects": list(self.ladder.added),
            "verdict": self.ladder.verdict,
            "model": self.ladder.model.to_yaml(),
            "stretches": [vars(each) for each in self.stretches],
        }

    def plot(self, axes: Any = None) -> Any:
        """Draw measured speed and free runs at both amplitudes; returns the two axes."""
        return draw(self.data, self.candidates[:4], axes)


def grey_box(model: Model, data: Bench, name: str = GREY) -> Candidate:
    """A model of the rig as a candidate: free runs from rest, without the counts of the encoder if it knows them."""
    smooth = model.without_effect(stage_paper.ENCODER) if stage_paper.ENCODER in model.effect_names else model
    runs = [stage_paper.free_run(smooth, record).output[:, 0] for record in data.records]
    return Candidate(name, None, (runs[0], runs[1], runs[2]))


def diagnosed(record: Record, progress: Progress) -> Ladder:
    """Find the effects from the plain linear model.

    Parameters
    ----------
    record : Record
        Of the encoder.
    progress : callable
    """
    from idloop.diagnosis import refine

    return refine(stage_paper.screw_and_stage(), [record.cut(0.0, READ)], progress=progress)


def reproduce(
    seed: int,
    progress: Progress,
    duration: float = stage_paper.DURATION,
    repeats: int = REPEATS,
    find: Callable[[Record, Progress], Ladder] = diagnosed,
) -> StageComparison:
    """Compare all candidates.

    Parameters
    ----------
    seed : int
        Of excitation, division and starts.
    progress : callable
    duration : float
        Of each record [s].
    repeats : int
        Further stretches on which the order of methods is counted.
    find : callable
        ``(record, progress) -> Ladder``: how the effects are found.
    """
    progress(0.0, "experiments")
    data = bench(seed, duration)
    ladder = find(data.records[0], lambda share, text: progress(0.02 + 0.7 * share, text))
    progress(0.75, "linear model and networks")
    linear, wavelet, closed = _paper_candidates(data, seed)
    opened = black_box(OPEN, neural_network(data.train, closed=False, seed=seed), data)
    stretches = []
    for index in range(repeats):
        progress(0.8 + 0.2 * index / repeats, f"order of methods, stretch {index + 1}")
        # Stretches that no seed of the row itself uses.
        number = 10_000 + repeats * seed + index
        other = bench(number, duration)
        judged = [scores(each, other) for each in (*_paper_candidates(other, number), limit(other))]
        stretches.append(Stretch(tuple(each.free for each in judged), tuple(each.half for each in judged)))
    candidates = (linear, wavelet, closed, grey_box(ladder.model, data), opened)
    return StageComparison(data, candidates, ladder, tuple(stretches))


def _paper_candidates(data: Bench, seed: int) -> tuple[Candidate, Candidate, Candidate]:
    """The three of table 2, in its order."""
    return (
        black_box(LINEAR, transfer_function(data.train), data),
        black_box(WAVELET, wavelet_network(data.train), data),
        black_box(CLOSED, neural_network(data.train, closed=True, seed=seed), data),
    )
