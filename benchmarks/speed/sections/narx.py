"""Training a NARX network: Levenberg-Marquardt against L-BFGS, to the same error."""

from __future__ import annotations

from speed.contest import Contest
from speed.duffing import records
from speed.result import Claim, Row, Section

# Contestant, module, whether ours, iterations to start from and at most.
CONTESTANTS = (("idloop", "narx_idloop", True, 5, 320), ("scikit-learn, L-BFGS", "narx_sklearn", False, 50, 6400))
LIMIT = "half of an epoch is QR, a third the slopes"
SLACK = 1.02  # of the worse of the two: an error that both reach


def run(contest: Contest) -> Section:
    """Each learns to the end; then the fewest iterations, doubled from few, that reach what both can."""
    samples = 1500 if contest.quick else 10_000
    section = Section("narx", f"NARX network of ten units, {samples:,} samples, to the same error")
    data, work = records(samples), "an oscillator with a hardening spring"
    ends: list[float] = []
    for who, module, ours, _, most in CONTESTANTS:
        _, answer = contest.enter(f"{work}, to the end", who, module, data, _settings(most), ours=ours, runs=1)
        if answer:
            ends.append(float(answer["train"]))
    goal = SLACK * max(ends, default=0.0)
    for who, module, ours, first, most in CONTESTANTS:
        row, iterations = Row(work, who), first
        while iterations <= most:
            row, answer = contest.enter(work, who, module, data, _settings(iterations), ours=ours, runs=3)
            if not answer or float(answer["train"]) <= goal:
                break
            iterations *= 2
        if answer:
            row.answer = {"error, trained": float(answer["train"]), "error, fresh data": float(answer["fresh"])}
            row.answer["iterations"] = float(iterations)
            row.agrees = float(answer["train"]) <= goal
        section.rows.append(row)
    section.claims = [Claim("time of scikit-learn over ours", 1.0, section.ratio(work, CONTESTANTS[1][0]), limit=LIMIT)]
    section.remarks.append(
        "Ten tanh units, two past outputs and commands, one step ahead, all samples train. Errors are root mean"
        " squares; the noise is 0.005. PyTorch is left out: its wheel is larger than all the others together."
    )
    return section


def _settings(iterations: int) -> dict[str, int]:
    return {"iterations": iterations, "seed": 0}
