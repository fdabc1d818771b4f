"""A source without a graph: a motor whose hidden Coulomb friction is found, added and taken back by rote."""

from __future__ import annotations

import asyncio
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from idloop.diagnosis import Candidate, Ladder, Step
from idloop.errors import InputError
from idloop.physics import load_model
from idloop.reporting.workbench.files import content
from idloop.reporting.workbench.state import FREE, SENT, Fit, Health, Missing, Note, Snapshot, State

FRICTION = Candidate(
    "coulomb_friction", "motor", "yes", "it reverses often", "A force of one size against the motion.", gain=812.0,
    p_value=0.0004, explains=0.93, parameters={"level": {"value": 1.21, "stderr": 0.02, "unit": "N·m"}},
)  # fmt: skip
DEAD_ZONE = Candidate(
    "dead_zone", "input", "yes", "", "Small commands do nothing.", gain=790.0, p_value=0.0004, explains=0.91,
    parameters={"width": {"value": 0.15, "stderr": 0.004, "unit": "V"}},
)  # fmt: skip
DRAG = Candidate("quadratic_drag", "motor", "yes", "", "Drag grows with the square of speed.", gain=1.2, p_value=0.8,
                 parameters={"coefficient": {"value": 1e-3, "stderr": 2e-3, "unit": "N·m·s²"}})  # fmt: skip
MISSING = Missing(
    "missing", "coulomb_friction@motor is missing", (FRICTION, DEAD_ZONE, DRAG), (FRICTION.name, DEAD_ZONE.name),
    untestable=("cogging@motor",),
)  # fmt: skip


DESIGNED = {
    "signal": {"name": "sine", "sample_time": 0.01, "duration": 4.0, "amplitude": 1.5},
    "adds_to": "command",
    "unit": "V",
    "text": "expected to tell both apart",
    "motion": [
        {"name": "motor.effort", "unit": "V", "low": -1.5, "high": 1.5, "limits": [-5.0, 5.0]},
        {"name": "motor.position", "unit": "rad", "low": -0.4, "high": 0.7, "limits": []},
    ],
}


def ticked(page):
    """Let a page look at what is new, as the server's loop does; the test's own thread may have a loop."""
    with ThreadPoolExecutor(1) as pool:
        pool.submit(asyncio.run, page.tick()).result()


def errors(nrmse):
    return {"nrmse": {"motor.position": nrmse, "motor.velocity": 2 * nrmse}, "fit": {
        "motor.position": 100 * (1 - nrmse), "motor.velocity": 100 * (1 - 2 * nrmse)}}  # fmt: skip


class FakeSource:
    """Implements `idloop.reporting.workbench.state.Source`."""

    def __init__(self, *, live=True, outputs=None):
        from idloop.reporting.workbench.signals import Signals

        self.model = load_model(outputs or "dc_motor")
        self.signals = Signals(self.model, capacity=20_000)
        start = Step(None, self.model, train=errors(0.2), validation=errors(0.21))
        self.state = State(
            Snapshot(live=live, title="dc_motor", model=self.model, moves=live, missing=MISSING,
                     ladder=Ladder((start,)),
                     fit=Fit({"motor.position": 79.0, "motor.velocity": 58.0}, {}, 4.0),
                     health=(Health("plant: loop", 0, "1000 samples/s"),), limits=(("command", "at most 5 V"),))
        )  # fmt: skip
        self.orders = []
        self.stops = 0
        self._time = 0
        self._running = threading.Event()
        self._thread = None

    def feed(self, count=200, peak=None):
        """Take in `count` samples at 1 kHz; one of them may be a peak."""
        k = self._time + np.arange(count)
        self._time += count
        stamps = 10**9 + k * 1_000_000
        columns = len(self.signals.names)
        clean = np.column_stack([np.sin(2e-3 * k + i) for i in range(columns)])
        noise = 0.02 * np.random.default_rng(self._time).standard_normal((count, columns))
        measured = clean + noise
        if peak is not None:
            measured[count // 2] = peak
        self.signals.extend("measured", stamps, measured)
        self.signals.extend("predicted", stamps, clean)
        self.signals.extend("residual", stamps, measured - clean)
        self.signals.extend("command", stamps, np.sign(np.sin(5e-3 * k))[:, None])

    def run(self):
        """Feed until closed, about as fast as time goes by."""
        self._running.set()

        def go():
            while self._running.is_set():
                self.feed(50)
                time.sleep(0.05)

        self._thread = threading.Thread(target=go, daemon=True)
        self._thread.start()

    def close(self):
        self._running.clear()
        if self._thread is not None:
            self._thread.join()

    def order(self, verb, effect=""):
        self.orders.append((verb, effect))
        ladder = self.state.snapshot.ladder
        if verb == "add":
            added = next(c for c in MISSING.candidates if c.name == effect)
            step = Step(added, self.model, (effect,), 0.0004, "diagnosis", errors(0.02), errors(0.03))
            self.state.change(
                ladder=Ladder((*ladder.steps, step)), missing=None, model=self.model.with_effects([effect])
            )
        elif verb == "undo":
            if len(ladder.steps) < 2:
                raise InputError("there is no step to take back")
            self.state.change(ladder=Ladder(ladder.steps[:-1]), missing=MISSING, model=self.model)
        elif verb == "automatic":
            what, to = effect.split()
            others = [one for one in self.state.snapshot.automatic if one != what]
            self.state.change(automatic=(*others, what) if to == "on" else tuple(others))
        elif verb == "design":
            self.state.change(suggested=DESIGNED)
        elif verb == "reset":
            self.state.change(stop=FREE)
        return f"{verb} {effect}".strip()

    def file(self, name):
        return content(name, self.state.snapshot, None)

    def stop(self):
        self.stops += 1
        self.state.change(stop=SENT, note=Note("stopped", 1))
        return "stopped"
