"""Black-box estimators beside independent implementations, and their errors as records grow.

    .venv/bin/python benchmarks/estimators.py                              # consistency: error against samples
    .venv/bin/python benchmarks/estimators.py --long 1000000               # every method on one long record
    python3 -m venv peers && peers/bin/pip install statsmodels scikit-learn nfoursid sippy-unipi
    .venv/bin/python benchmarks/estimators.py --peers peers/bin/python     # the same data through other packages

The other packages run in an environment of their own, never in that of the project. GNU Octave's control package takes
part where ``octave-cli`` finds it (``apt-get install octave octave-control``). A package that is missing is named and
left out. The plant is known, so every error is against the truth.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from numpy.typing import NDArray

# Nothing of idloop above: the same file is run by the other packages' interpreter.
Array = NDArray[np.float64]

# Plant B / A, noise polynomials C and D, and a proportional loop around the plant.
B, A = np.array([0.0, 1.0, 0.5]), np.array([1.0, -1.5, 0.7])
C, D = np.array([1.0, 0.8, 0.3]), np.array([1.0, -0.9, 0.2])
LOOP_GAIN = 0.15
STEP = 0.01
NOISES = {"arx": ([1.0], A), "armax": (C, A), "oe": ([1.0], [1.0]), "bj": (C, D)}
# Of the deviation of the undisturbed output.
NOISE = 0.3
GRID = np.linspace(0.0, np.pi, 201)[1:]


def respond(numerator: Any, denominator: Any, grid: Array = GRID) -> NDArray[np.complex128]:
    """Frequency response of polynomials in q⁻¹ at angles [rad/sample]."""
    z = np.exp(-1j * grid)
    top, bottom = (np.polyval(np.asarray(one, dtype=float)[::-1], z) for one in (numerator, denominator))
    return np.asarray(top / bottom)


def respond_states(a: Any, b: Any, c: Any, d: Any, grid: Array = GRID) -> NDArray[np.complex128]:
    """Frequency response of a state-space model with one input and one output."""
    a, b, c, d = (np.atleast_2d(np.asarray(one, dtype=float)) for one in (a, b, c, d))
    eye = np.eye(len(a))
    b, c = b.reshape(len(a), 1), c.reshape(1, len(a))
    return np.array([(c @ np.linalg.solve(np.exp(1j * w) * eye - a, b) + d)[0, 0] for w in grid])


def plant_error(response: Any) -> float:
    """Error of a frequency response in percent of the plant's."""
    true = respond(B, A)
    return float(100.0 * np.linalg.norm(np.asarray(response) - true) / np.linalg.norm(true))


def simulate(kind: str, samples: int, seed: int, loop: str = "open") -> dict[str, Array]:
    """Run the plant under a random binary signal.

    Parameters
    ----------
    kind : str
        A key of `NOISES`.
    samples, seed : int
    loop : str
        "open", or "closed": the signal is then the reference of a proportional controller.

    Returns
    -------
    dict
        ``u``, ``y``, ``r``, each of shape (samples,).
    """
    from scipy.signal import lfilter

    random = np.random.default_rng(seed)
    size = float(np.sqrt(np.sum(lfilter(B, A, np.eye(1, 500)[0]) ** 2)))
    shape = lfilter(*NOISES[kind], np.eye(1, 2000)[0])
    e = random.standard_normal(samples) * NOISE * size / float(np.sqrt(np.sum(shape**2)))
    v = lfilter(*NOISES[kind], e)
    r = random.choice([-1.0, 1.0], samples)
    if loop == "open":
        return {"u": r, "y": lfilter(B, A, r) + v, "r": r}
    # Y (A + K B) = K B r + A v
    closed = A + LOOP_GAIN * B
    y = lfilter(LOOP_GAIN * B, closed, r / LOOP_GAIN) + lfilter(A, closed, v)
    return {"u": LOOP_GAIN * (r / LOOP_GAIN - y), "y": y, "r": r / LOOP_GAIN}


# -- consistency ------------------------------------------------------------------------------------

# Method, noise, settings, and whether theory says that it errs less and less in open and in closed loop.
CASES: tuple[tuple[str, str, dict[str, Any], bool, bool], ...] = (
    ("arx", "arx", {}, True, True),
    ("arx", "armax", {}, False, False),
    ("iv4", "armax", {"closed_loop": True}, True, True),
    ("armax", "armax", {}, True, True),
    ("oe", "bj", {}, True, False),
    ("bj", "bj", {}, True, True),
    ("n4sid", "armax", {}, True, False),
    ("moesp", "armax", {}, True, False),
    ("cva", "armax", {}, True, False),
    ("vodma", "armax", {"controller": {}}, True, True),
    ("vodma-direct", "armax", {}, True, False),
    ("pbsid", "armax", {}, True, True),
    ("pem", "armax", {}, True, True),
    ("rarx", "arx", {}, True, True),
    ("rarmax", "armax", {}, True, True),
    ("roe", "bj", {}, True, False),
    ("rbj", "bj", {}, True, True),
    ("rpem", "armax", {}, True, True),
    ("rplr", "armax", {}, True, True),
    ("ekf", "oe", {}, True, True),
    # It lets coefficients wander, so that as much of the noise stays in them however long the record is.
    ("kalman", "arx", {}, False, False),
    # Ljung 1979: it errs where its noises are not those of the data.
    ("ekf", "armax", {}, False, False),
)
LENGTHS = (1000, 4000, 16000)
# From the shortest to the longest record, 16 times, an error that falls as one over the root falls to a quarter.
FALLS = 2.5


def ours(name: str, data: dict[str, Array], settings: dict[str, Any], order: int = 2) -> NDArray[np.complex128]:
    """Response of the plant as a method of idloop finds it."""
    from idloop.estimation.black_box.identification import identify
    from idloop.estimation.black_box.method import Choices
    from idloop.estimation.black_box.sampled import SampledData

    chosen = dict(settings)
    closed = bool(np.any(data["r"] != data["u"]))
    if "controller" in chosen:
        gain = LOOP_GAIN if closed else 0.0
        chosen["controller"] = {"type": "p", "output": "motor.position", "kp": gain, "sample_time": STEP}
    if not closed:
        chosen.pop("closed_loop", None)
    # In open loop the signal is added to the command of a controller that answers nothing.
    signals = {"reference" if closed else "feedforward": data["r"]}
    sampled = SampledData(
        "data", data["u"][:, None], data["y"][:, None], STEP, output_names=("motor.position",), **signals
    )
    found = identify(sampled, name, Choices(order=order, **chosen))
    return np.asarray(found.model.response(GRID / (2.0 * np.pi * STEP))[:, 0, 0])


def root_mean_square(name: str, noise: str, samples: int, seeds: int, loop: str, settings: dict[str, Any]) -> float:
    """Error of a case over records of one length, all of them different from those of other lengths."""
    records = (simulate(noise, samples, 1000 * samples + seed, loop) for seed in range(seeds))
    return float(np.sqrt(np.mean([plant_error(ours(name, one, settings)) ** 2 for one in records])))


def consistency(seeds: int, methods: Collection[str] = (), lengths: tuple[int, ...] = LENGTHS) -> list[dict[str, Any]]:
    """Root mean square error of every case by loop and number of samples.

    Parameters
    ----------
    seeds : int
    methods : collection of str
        All when empty.
    lengths : tuple of int

    Returns
    -------
    list of dict
        ``method``, ``noise``, ``loop``, ``errors`` [%], ``fall`` (first over last) and whether that is as ``claimed``.
    """
    rows = []
    for name, noise, settings, in_open, in_closed in CASES:
        if methods and name not in methods:
            continue
        for loop, claimed in (("open", in_open), ("closed", in_closed)):
            errors = [root_mean_square(name, noise, n, seeds, loop, settings) for n in lengths]
            fall = errors[0] / errors[-1]
            rows.append({"method": name, "noise": noise, "loop": loop, "errors": errors, "fall": fall,
                         "consistent": claimed, "as_claimed": (fall > FALLS) == claimed})  # fmt: skip
            print(consistency_line(rows[-1]), flush=True)
    return rows


def consistency_line(row: dict[str, Any]) -> str:
    """One row as Markdown."""
    errors = " | ".join(f"{error:.2f}" for error in row["errors"])
    theory = "falls" if row["consistent"] else "stays"
    said = "" if row["as_claimed"] else " (NOT SEEN)"
    return f"| `{row['method']}` | {row['noise']} | {row['loop']} | {errors} | {row['fall']:.1f} | {theory}{said} |"


# -- one long record --------------------------------------------------------------------------------

NETWORKS, RESPONSES = ("narx-wavelet", "narx-neural"), ("etfe", "spa", "welch", "indirect")


def long_run(name: str, samples: int) -> dict[str, Any]:
    """One method on one long record of an open loop: error [%], seconds, megabytes; or the line with which it declines.

    The error is that of the response; the median over all lines where nothing is smooth; for networks the part
    of the free run on another record that is not explained.
    """
    import resource
    import time

    from idloop.errors import IdloopError
    from idloop.estimation.black_box.identification import identify
    from idloop.estimation.black_box.method import Choices
    from idloop.estimation.black_box.sampled import SampledData

    noise, settings = next(((case[1], case[2]) for case in CASES if case[0] == name and case[3]), ("armax", {}))
    data = duffing(samples, 1) if name in NETWORKS else simulate(noise, samples, 1)
    before, started = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.perf_counter()
    try:
        if name in NETWORKS:
            sampled = SampledData("data", data["u"][:, None], data["y"][:, None], STEP)
            network: Any = identify(sampled, name, Choices(order=2)).model
            spent = time.perf_counter() - started
            other = duffing(20_000, 2)
            unseen = SampledData("other", other["u"][:, None], other["y"][:, None], STEP)
            error = 100.0 - fit_of(other["y"][2:], np.asarray(network.simulate(unseen))[2:, 0])
        elif name in RESPONSES:
            signals = {"output_names": ("motor.position",), "reference": data["r"]}
            sampled = SampledData("data", data["u"][:, None], data["y"][:, None], STEP, **signals)
            found: Any = identify(sampled, name, Choices()).model
            spent = time.perf_counter() - started
            true = respond(B, A, 2.0 * np.pi * STEP * found.frequency)
            error = float(100.0 * np.median(np.abs(found.response[:, 0, 0] / true - 1.0)))
        else:
            response = ours(name, data, settings)
            spent = time.perf_counter() - started
            error = plant_error(response)
    except IdloopError as refused:
        return {"method": name, "said": str(refused), "seconds": time.perf_counter() - started}
    more = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024.0
    return {"method": name, "error": error, "seconds": spent, "megabytes": more}


def long_record(samples: int, methods: Collection[str] = ()) -> list[dict[str, Any]]:
    """Every method on a record of so many samples, each in a process of its own after a short record."""
    import multiprocessing

    rows = []
    every = [*RESPONSES, *dict.fromkeys(case[0] for case in CASES), *NETWORKS]
    print(f"| method | error of {samples} samples [%] | time [s] | memory [MB] |\n|---|---|---|---|")
    for name in methods or every:
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            pool.apply(long_run, (name, 2000))  # compiles what it needs
            rows.append(pool.apply(long_run, (name, samples)))
        one = rows[-1]
        said = one["said"] if "said" in one else f"{one['error']:.3f}"
        memory = f"{one['megabytes']:.0f}" if "megabytes" in one else ""
        print(f"| `{name}` | {said} | {one['seconds']:.1f} | {memory} |", flush=True)
    return rows


# -- the same data through other packages ------------------------------------------------------------

SAMPLES = 2000
# What each of ours is held against, by family.
FAMILIES = {"arx": "arx", "armax": "armax", "oe": "oe", "bj": "bj", "n4sid": "bj", "moesp": "bj", "cva": "bj"}


def lagged(u: Array, y: Array, na: int = 2, nb: int = 2) -> tuple[Array, Array]:
    """Regressors (past outputs, past inputs) and what follows them."""
    first = max(na, nb)
    columns = [y[first - k : len(y) - k] for k in range(1, na + 1)]
    columns += [u[first - k : len(u) - k] for k in range(1, nb + 1)]
    return np.column_stack(columns), y[first:]


def polynomials(past_outputs: Any, past_inputs: Any) -> NDArray[np.complex128]:
    """Response of coefficients of past outputs and inputs."""
    return respond([0.0, *past_inputs], [1.0, *(-np.asarray(past_outputs))])


def by_statsmodels(u: Array, y: Array, seed: int) -> dict[str, Any]:
    """statsmodels: least squares, and ARMAX as a regression on past outputs with moving-average errors."""
    import warnings

    import statsmodels.api as sm

    rows, following = lagged(u, y)
    found = {"arx": polynomials(*np.split(sm.OLS(following, rows).fit().params, [2]))}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model = sm.tsa.SARIMAX(following, exog=rows, order=(0, 0, 2)).fit(disp=False, maxiter=200)
    found["armax"] = polynomials(*np.split(np.asarray(model.params)[:4], [2]))
    return found


def by_scikit_learn(u: Array, y: Array, seed: int) -> dict[str, Any]:
    """scikit-learn: least squares."""
    from sklearn.linear_model import LinearRegression

    rows, following = lagged(u, y)
    return {"arx": polynomials(*np.split(LinearRegression(fit_intercept=False).fit(rows, following).coef_, [2]))}


def by_scipy(u: Array, y: Array, seed: int) -> dict[str, Any]:
    """SciPy's least_squares on the errors of output-error and Box-Jenkins models, written out here."""
    from scipy.optimize import least_squares
    from scipy.signal import lfilter

    def free_run(p: Array) -> Array:
        return y - lfilter([0.0, *p[:2]], [1.0, *p[2:4]], u)

    def whitened(p: Array) -> Array:
        return np.asarray(lfilter([1.0, *p[6:8]], [1.0, *p[4:6]], free_run(p)))

    def stable(p: Array, first: int, last: int) -> bool:
        return bool(np.all(np.abs(np.roots([1.0, *p[first:last]])) < 0.9999))

    def bounded(errors: Callable[[Array], Array], *places: tuple[int, int]) -> Callable[[Array], Array]:
        return lambda p: errors(p) if all(stable(p, *place) for place in places) else np.full(len(y), 1e3)

    rows, following = lagged(u, y)
    theta = np.linalg.lstsq(rows, following, rcond=None)[0]
    start = np.r_[theta[2:], -theta[:2]]
    oe = least_squares(bounded(free_run, (2, 4)), start, x_scale="jac").x
    bj = least_squares(bounded(whitened, (2, 4), (4, 6)), np.r_[oe, np.zeros(4)], x_scale="jac").x
    return {"oe": respond([0.0, *oe[:2]], [1.0, *oe[2:4]]), "bj": respond([0.0, *bj[:2]], [1.0, *bj[2:4]])}


def by_nfoursid(u: Array, y: Array, seed: int) -> dict[str, Any]:
    """nfoursid: N4SID."""
    import pandas as pd
    from nfoursid.nfoursid import NFourSID

    frame = pd.DataFrame({"u": u, "y": y})
    solver = NFourSID(frame, output_columns=["y"], input_columns=["u"], num_block_rows=15)
    solver.subspace_identification()
    model, _ = solver.system_identification(rank=2)
    return {"n4sid": respond_states(model.a, model.b, model.c, model.d)}


def by_sippy(u: Array, y: Array, seed: int) -> dict[str, Any]:
    """SIPPY: polynomial and subspace methods."""
    import contextlib
    import io

    from sippy_unipi import system_identification as identify

    found = {}
    settings: dict[str, dict[str, Any]] = {
        "arx": {"ARX_orders": [2, 2, 0]},
        "armax": {"ARMAX_orders": [2, 2, 2, 0], "ARMAX_mod": "OPT"},
        "oe": {"OE_orders": [2, 2, 0]},
        "bj": {"BJ_orders": [2, 2, 2, 2, 0]},
        "n4sid": {"SS_fixed_order": 2, "SS_f": 15, "SS_p": 15},
        "moesp": {"SS_fixed_order": 2, "SS_f": 15, "SS_p": 15},
        "cva": {"SS_fixed_order": 2, "SS_f": 15, "SS_p": 15},
    }
    for family, options in settings.items():
        with contextlib.redirect_stdout(io.StringIO()):
            model = identify(y, u, family.upper(), **options)
        if family in ("n4sid", "moesp", "cva"):
            found[family] = respond_states(model.A, model.B, model.C, model.D)
        else:
            from control import frequency_response

            found[family] = np.asarray(frequency_response(model.G, GRID).complex).ravel()
    return found


PEERS: dict[str, Callable[[Array, Array, int], dict[str, Any]]] = {
    "statsmodels": by_statsmodels,
    "scikit-learn": by_scikit_learn,
    "SciPy": by_scipy,
    "nfoursid": by_nfoursid,
    "SIPPY": by_sippy,
}

OCTAVE = """
pkg load control
data = load(argv(){{1}});
dat = iddata(data(:, 2), data(:, 1), 1);
models = {{'arx', arx(dat, 'na', 2, 'nb', 2); 'n4sid', n4sid(dat, 2, 's', 15); 'moesp', moesp(dat, 2)}};
w = linspace(0, pi, 201)(2:end);
for k = 1:rows(models)
  h = squeeze(freqresp(models{{k, 2}}, w)(1, 1, :));
  printf('%s', models{{k, 1}});
  printf(' %.17g', [real(h(:)); imag(h(:))]);
  printf('\\n');
end
""".replace("{{", "{").replace("}}", "}")


def by_octave(u: Array, y: Array, folder: Path) -> dict[str, Any]:
    """GNU Octave's control package."""
    script, table = folder / "peer.m", folder / "data.txt"
    script.write_text(OCTAVE)
    np.savetxt(table, np.column_stack([u, y]), fmt="%.17g")
    octave = shutil.which("octave-cli") or "octave-cli"
    done = subprocess.run([octave, "-q", str(script), str(table)], capture_output=True, text=True, check=True)
    found = {}
    for line in done.stdout.splitlines():
        family, *numbers = line.split()
        values = np.array(numbers, dtype=float)
        found[family] = values[: len(values) // 2] + 1j * values[len(values) // 2 :]
    return found


# Networks: one step ahead and free run on a record that no fit saw.


def duffing(samples: int, seed: int) -> dict[str, Array]:
    """A second-order system with a hardening spring, sampled."""
    random = np.random.default_rng(seed)
    u = np.repeat(random.uniform(-1.5, 1.5, samples // 5 + 1), 5)[:samples]
    y = np.zeros(samples)
    for t in range(2, samples):
        y[t] = 1.5 * y[t - 1] - 0.6 * y[t - 2] + 0.2 * u[t - 1] - 0.15 * y[t - 1] ** 3
    return {"u": u, "y": y + 0.005 * random.standard_normal(samples)}


def fit_of(measured: Array, modelled: Array) -> float:
    """FIT [%]."""
    return float(100.0 * (1.0 - np.linalg.norm(measured - modelled) / np.linalg.norm(measured - np.mean(measured))))


def network_scores(predict: Callable[[Array], Array], data: dict[str, Array]) -> dict[str, float]:
    """FIT one step ahead and in free run of a function of the regressors."""
    u, y = data["u"], data["y"]
    rows, following = lagged(u, y)
    free = y.copy()
    for t in range(2, len(y)):
        free[t] = np.clip(predict(np.array([[free[t - 1], free[t - 2], u[t - 1], u[t - 2]]]))[0], -1e3, 1e3)
    return {"ahead": fit_of(following, predict(rows)), "free": fit_of(y[2:], free[2:])}


def network_by_scikit_learn(train: dict[str, Array], test: dict[str, Array], seed: int) -> dict[str, Any]:
    """scikit-learn: a network of 10 units by L-BFGS, and kernel ridge regression, on the same regressors."""
    from sklearn.kernel_ridge import KernelRidge
    from sklearn.neural_network import MLPRegressor
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    rows, following = lagged(train["u"], train["y"])
    network = make_pipeline(
        StandardScaler(),
        MLPRegressor(
            hidden_layer_sizes=(10,), activation="tanh", solver="lbfgs", alpha=0.0, max_iter=3000, random_state=seed
        ),
    )
    kernel = make_pipeline(StandardScaler(), KernelRidge(kernel="rbf", gamma=0.05, alpha=1e-3))
    return {
        "scikit-learn, network": network_scores(network.fit(rows, following).predict, test),
        "scikit-learn, kernel ridge": network_scores(kernel.fit(rows, following).predict, test),
    }


def network_by_ours(train: dict[str, Array], test: dict[str, Array], seed: int) -> dict[str, Any]:
    """Networks of idloop with their own free run."""
    from idloop.estimation.black_box.identification import identify
    from idloop.estimation.black_box.method import Choices
    from idloop.estimation.black_box.sampled import SampledData

    data, other = (SampledData("data", one["u"][:, None], one["y"][:, None], STEP) for one in (train, test))
    found = {}
    for name in ("narx-neural", "narx-wavelet"):
        model: Any = identify(data, name, Choices(order=2, seed=seed)).model
        ahead, free = (np.asarray(run)[2:, 0] for run in (model.predict(other, 1), model.simulate(other)))
        found[f"idloop, {name}"] = {"ahead": fit_of(test["y"][2:], ahead), "free": fit_of(test["y"][2:], free)}
    return found


# -- running ----------------------------------------------------------------------------------------


def run_peer(folder: Path) -> dict[str, Any]:
    """All packages that this interpreter has, on the data in a folder."""
    found: dict[str, Any] = {"linear": {}, "networks": {}, "missing": []}
    for name, peer in PEERS.items():
        try:
            for path in sorted(folder.glob("*.npz")):
                if path.stem.startswith("duffing"):
                    continue
                noise, seed = path.stem.split("_")
                data = np.load(path)
                families = {family for family, kind in FAMILIES.items() if kind == noise}
                for family, response in peer(data["u"], data["y"], int(seed)).items():
                    if family in families:
                        found["linear"].setdefault(f"{family}/{name}", []).append(plant_error(response))
        except ImportError:
            found["missing"].append(name)
    try:
        train, test = (dict(np.load(folder / f"duffing_{part}.npz")) for part in ("train", "test"))
        found["networks"] = network_by_scikit_learn(train, test, 0)
    except ImportError:
        pass
    return found


def comparison(interpreter: str, seeds: int) -> dict[str, Any]:
    """Errors of ours and of others on the same records."""
    errors: dict[str, list[float]] = {}
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        records = {(noise, seed): simulate(noise, SAMPLES, seed) for noise in NOISES for seed in range(seeds)}
        for (noise, seed), data in records.items():
            np.savez(folder / f"{noise}_{seed}.npz", **data)
            for family, kind in FAMILIES.items():
                if kind == noise:
                    errors.setdefault(f"{family}/idloop", []).append(plant_error(ours(family, data, {})))
        train, test = duffing(1500, 1), duffing(1000, 2)
        np.savez(folder / "duffing_train.npz", **train)
        np.savez(folder / "duffing_test.npz", **test)
        command = [interpreter, str(Path(__file__).resolve()), "--inside", str(folder)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise SystemExit(f"{interpreter}: {done.stderr.strip().splitlines()[-1]}")
        peers = json.loads(done.stdout)
        errors |= peers["linear"]
        missing = peers["missing"]
        if shutil.which("octave-cli"):
            for (noise, _), data in records.items():
                families = {family for family, kind in FAMILIES.items() if kind == noise}
                if families & {"arx", "n4sid", "moesp"}:
                    for family, response in by_octave(data["u"], data["y"], folder).items():
                        if family in families:
                            errors.setdefault(f"{family}/Octave control", []).append(plant_error(response))
        else:
            missing.append("Octave control")
    networks = {**network_by_ours(train, test, 0), **peers["networks"]}
    return {"errors": errors, "networks": networks, "missing": missing}


def print_comparison(found: dict[str, Any]) -> None:
    """Two Markdown tables: medians of the plant's error, and FIT of the networks."""
    print("| method | error of the plant [%], median over records |\n|---|---|")
    for family in FAMILIES:
        cells = [
            f"{key.split('/')[1]} {np.median(values):.2f}"
            for key, values in found["errors"].items()
            if key.startswith(f"{family}/")
        ]
        print(f"| `{family}` | {', '.join(cells)} |")
    print("\n| network | FIT one step ahead [%] | FIT free run [%] |\n|---|---|---|")
    for name, scores in found["networks"].items():
        print(f"| {name} | {scores['ahead']:.2f} | {scores['free']:.2f} |")
    for name in found["missing"]:
        print(f"not installed: {name}")


def main() -> int:
    """Run what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--peers", metavar="PYTHON", help="interpreter that has the other packages")
    parser.add_argument("--long", type=int, metavar="N", help="every method on one record of N samples")
    methods = sorted({case[0] for case in CASES} | {*NETWORKS, *RESPONSES})
    parser.add_argument("--method", nargs="+", default=[], choices=methods, help="these only (default all)")
    parser.add_argument("--seeds", type=int, default=12, help="records of each kind (default 12)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all numbers")
    parser.add_argument("--inside", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.inside:
        print(json.dumps(run_peer(given.inside)))
        return 0
    if given.peers:
        found: Any = comparison(given.peers, given.seeds)
        print_comparison(found)
        failed = False
    elif given.long:
        found, failed = long_record(given.long, given.method), False
    else:
        print(f"| method | noise | loop | {' | '.join(f'{n} samples' for n in LENGTHS)} | fall | theory |")
        print("|---|---|---|" + "---|" * (len(LENGTHS) + 2))
        found = consistency(given.seeds, given.method)
        failed = not all(row["as_claimed"] for row in found)
    if given.json:
        given.json.write_text(json.dumps(found, indent=1) + "\n")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
