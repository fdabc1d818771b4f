"""Subspace identification of the torsion system in closed loop, four outputs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from speed.contest import Contest
from speed.machines import STEP, TORSION_OUTPUTS, torsion_record
from speed.progress import say
from speed.result import Claim, Row, Section
from speed.slicot import NAME as SLICOT
from speed.slicot import n4sid_by_slicot

Array = NDArray[np.float64]

ORDER, HORIZON = 8, 28
LOUD = 20.0
UNASKED = "idloop, its poles as found"
BIASED = "in closed loop N4SID errs by a bias, which moves the pole that integrates"
FIT = "FIT, fresh data [%]"
LARGE = 10_000_000
PEERS = {"SIPPY": "n4sid_sippy", "nfoursid": "n4sid_nfoursid"}


def free_run_fit(answer: dict[str, Array], u: Array, y: Array) -> float:
    """Mean FIT [%] of the free run on a record, the first state estimated for all contestants alike."""
    from idloop.estimation.black_box.sampled import SampledData
    from idloop.estimation.linear.model import LinearModel

    p = y.shape[1]
    names = {"input_names": ("current",), "input_units": ("A",)}
    names |= {"output_names": TORSION_OUTPUTS[:p], "output_units": ("rad",) * p}
    matrices = {key: np.ascontiguousarray(answer[key], dtype=float) for key in "abcd"}
    none = np.zeros((len(matrices["a"]), p))
    model = LinearModel(
        "peer", **matrices, gain=none, covariance=np.eye(p), sample_time=STEP, **names, samples=0, free=0
    )
    with np.errstate(all="ignore"):
        error = y - model.simulate(SampledData("fresh", u, y, STEP, **names))
        return float(100.0 * np.mean(1.0 - np.linalg.norm(error, axis=0) / np.linalg.norm(y - y.mean(axis=0), axis=0)))


def run(contest: Contest) -> Section:
    """All contestants on both lengths, and ours on the longest record."""
    section = Section("n4sid", "N4SID: torsion system in closed loop, order 8, horizon 28, four outputs")
    sizes = (2000, 8000) if contest.quick else (8000, 80_000)
    settings = {"order": ORDER, "horizon": HORIZON, "memory_limit": 16.0}
    for loudness, samples in ((1.0, sizes[0]), (1.0, sizes[1]), (LOUD, sizes[1])):
        noise = loudness / 15.0
        work = f"{samples:,} samples" + (f", {loudness:g} times the noise" if loudness > 1.0 else "")
        data = dict(zip("uy", torsion_record(samples, 1, noise), strict=True))
        fresh = torsion_record(8000, 2, noise)
        found = [contest.enter(work, "idloop", "n4sid_idloop", data, settings, ours=True, runs=9)]
        for who, options, runs in ((UNASKED, {"integrates": False}, 9), ("idloop, QR", {"exact": True}, 3)):
            more = settings | {"options": options}
            found.append(contest.enter(work, who, "n4sid_idloop", data, more, ours=True, runs=runs))
        found.append(n4sid_by_slicot(contest, work, data, ORDER, HORIZON, 9))
        for who, module in PEERS.items():
            if loudness > 1.0:  # SLICOT is the one to compare with; these would take minutes more
                continue
            found.append(contest.enter(work, who, module, data, settings, runs=3))
        best = None
        for row, answer in found:
            if answer:
                found_fit = free_run_fit(answer, *fresh)
                best = found_fit if best is None else best
                row.agrees = bool(abs(found_fit - best) < 5.0)
                if np.isfinite(found_fit):
                    row.answer[FIT] = found_fit
                else:
                    row.note = "its free run overflows"
            section.rows.append(row)
    if not contest.quick:
        section.rows.append(longest(contest, LARGE if contest.long else LARGE // 10))
    section.claims = claims(section, sizes)
    section.shown = [f"{sizes[1]:,} samples"]
    section.remarks.append(
        "Time and memory of the identification alone, one thread each; FIT is that of the free run on a record that no"
        " fit saw. The QR way of idloop is its option `exact`."
    )
    return section


def longest(contest: Contest, samples: int) -> Row:
    """Ours on a record that fills memory by itself."""
    work = f"{samples:,} samples"
    say(f"making {work}")
    data = dict(zip("uy", torsion_record(samples, 1), strict=True))
    settings = {"order": ORDER, "horizon": HORIZON}
    row, answer = contest.enter(work, "idloop", "n4sid_idloop", data, settings, ours=True, runs=1)
    if answer:
        row.answer[FIT] = free_run_fit(answer, *torsion_record(8000, 2))
    return row


def claims(section: Section, sizes: tuple[int, int]) -> list[Claim]:
    """The targets of the section."""
    large = f"{sizes[1]:,} samples"
    loud = f"{large}, {LOUD:g} times the noise"
    own = [section.find(work, "idloop") for work in (f"{sizes[0]:,} samples", large)]
    found = [
        Claim(f"time of SLICOT over ours, {large}", 3.0, section.ratio(large, SLICOT)),
        Claim(f"time of SIPPY over ours, {large}", 50.0, section.ratio(large, "SIPPY")),
    ]
    grown = None
    if own[0] and own[1] and own[0].memory is not None and own[1].memory is not None:
        grown = own[1].memory - own[0].memory
    found.append(Claim("memory that ten times the samples add", 16.0, grown, "MB", at_least=False))
    for work in (large, loud):
        ours, theirs = section.find(work, "idloop"), section.find(work, SLICOT)
        apart = None
        if ours and theirs and FIT in ours.answer and FIT in theirs.answer:
            apart = ours.answer[FIT] - theirs.answer[FIT]
        found.append(Claim(f"FIT, ours less SLICOT's, {work}", 0.0, apart, "points", limit=BIASED))
    return found
