"""Grey-box fits of a DC motor."""

from __future__ import annotations

from speed.contest import Contest
from speed.motor import PERIOD, START, TRUTH, experiment
from speed.result import Claim, Section

YARDSTICK = "numba Runge-Kutta, least_squares"
SCIPY = "solve_ivp (LSODA), least_squares"
LIMIT = "a fifth each: the way to the start, runs, slopes, the search around them, the covariance of coloured residuals"
FIVE, TWO = "Stribeck friction, five parameters", "viscous friction, two parameters"


def run(contest: Contest) -> Section:
    """Five parameters by those that can stick and slip, two by those that cannot."""
    seconds = 5.0 if contest.quick else 30.0
    section = Section("greybox", f"Grey-box fit: DC motor, {seconds:g} s at 1 kHz")
    most = {"most": 3} if contest.quick else {}
    plan = (
        (FIVE, tuple(TRUTH), (
            ("idloop", "greybox_idloop", True, 7, {}),
            (YARDSTICK, "greybox_numba", False, 7, {}),
            (SCIPY, "greybox_scipy", False, 1, most),
        )),
        (TWO, ("gain", "viscous"), (
            ("idloop", "greybox_idloop", True, 7, {}),
            ("MuJoCo sysid", "greybox_mujoco", False, 3, {}),
            ("jax-sysid", "greybox_jax_sysid", False, 3, {}),
        )),
    )  # fmt: skip
    for work, names, entries in plan:
        data = experiment(seconds, names)
        for who, module, ours, runs, more in entries:
            settings = {"names": names, "start": START, "period": PERIOD} | more
            row, answer = contest.enter(work, who, module, data, settings, ours=ours, runs=runs)
            if answer:
                errors = [abs(float(answer[name]) / TRUTH[name] - 1.0) for name in names]
                row.answer["largest error of a parameter [%]"] = 100.0 * max(errors)
                row.agrees = max(errors) < 0.01
                if "evaluations" in answer:
                    row.answer["simulations"] = float(answer["evaluations"])
                if float(answer.get("stopped", 0.0)):
                    row.note = f"stopped after {int(answer['evaluations'])} simulations, unfinished"
            section.rows.append(row)
    ours = section.find(FIVE, "idloop")
    section.claims = [
        Claim(
            "time of the compiled yardstick over ours", 3.0, section.ratio(FIVE, YARDSTICK),
            limit=LIMIT,
        ),
        Claim("time of solve_ivp over ours", 300.0, section.ratio(FIVE, SCIPY), limit=LIMIT),
        Claim("time of MuJoCo sysid over ours", 5.0, section.ratio(TWO, "MuJoCo sysid")),
        Claim("time of jax-sysid over ours", 5.0, section.ratio(TWO, "jax-sysid"), limit=LIMIT),
        Claim(
            "largest error of a parameter, ours", 0.1,
            ours.answer.get("largest error of a parameter [%]") if ours else None, "%", at_least=False,
        ),
    ]  # fmt: skip
    section.remarks.append(
        "Noise of 0.001 rad and 0.005 rad/s; all start at the same values, off by 25 to 50 %, and fit the free run."
        " SciPy's friction is a smooth step 1e-3 rad/s wide, and its run is done once. jax-sysid and MuJoCo have no"
        " Stribeck friction that sticks: they fit the motor without it."
    )
    return section
