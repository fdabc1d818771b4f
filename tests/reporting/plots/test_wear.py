"""The figure of a watch: units on every axis, threshold, alarms, growth with intervals."""

from __future__ import annotations

import numpy as np

from idloop.monitoring import Monitor, choose_watches, learn
from idloop.physics import load_model
from idloop.reporting.plots.wear import plot_wear

LEVEL = "coulomb_friction@motor.level"


def test_it_shows_evidence_and_growth_with_units():
    from idloop.diagnosis.design.experiment import Experiment

    model = load_model("dc_motor").with_effects(["coulomb_friction@motor(level=0.8)"])

    def run(seconds, seed, level=0.8):
        given = {"name": "multilevel", "amplitude": 3.0, "sample_time": 0.01, "duration": seconds, "seed": seed}
        return Experiment(given).run(model.with_values({LEVEL: level}), noise=True, seed=seed)

    baseline = learn(model, [run(240.0, 1)], choose_watches(model, [f"{LEVEL}=60%"]), false_alarm_hours=1.0)
    monitor, records = Monitor(baseline), [run(60.0, 2), run(60.0, 3, 1.28)]
    traces = []
    for record in records:
        monitor.begin()
        traces.append(monitor.follow(record))
    top, below = plot_wear(baseline, records, traces).axes
    assert top.get_ylabel() == "evidence [-]"
    assert below.get_ylabel() == "growth [N·m]"
    assert below.get_xlabel() == "time of running [s]"
    assert "alarm above" in [text.get_text() for text in top.get_legend().get_texts()]
    drawn = top.lines[0].get_xdata()
    assert np.all(np.diff(drawn) > 0)
    assert len(drawn) == sum(len(trace.index) for trace in traces)
