"""The C99 header, compiled, against the equations in Python."""

from __future__ import annotations

import ctypes
import itertools
import math
import shutil
import subprocess

import numpy as np
import pytest

import idloop
from idloop.errors import InputError
from idloop.exporters.c_equation import c_function
from idloop.physics import Engine, load_model
from idloop.physics.effect import catalogue
from idloop.physics.hooks import hook

COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="no C compiler")
PLACES = ("command", "force", "friction", "coupling", "reading", "undo")


def compiled(text, folder):
    source, library = folder / "header.c", folder / "header.so"
    source.write_text(text, encoding="utf-8")
    strict = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O2", "-shared", "-fPIC"]
    subprocess.run([COMPILER, *strict, str(source), "-o", str(library), "-lm"], check=True, timeout=60)
    return ctypes.CDLL(str(library))


def function(library, name, numbers):
    found = getattr(library, name)
    found.restype, found.argtypes = ctypes.c_double, [ctypes.c_double] * numbers
    return found


def model(*effects):
    return load_model("axis").with_values({"drive.gain": 1.0}).with_effects(effects)


def header(machine, folder):
    """Functions of the force and of the command."""
    wrapped = idloop.export(machine, "c").text + (
        "\ndouble f(double q, double v, double a, double w) { return axis_force(q, v, a, w); }\n"
        "double c(double q, double v, double a, double w, double r) { return axis_command(q, v, a, w, r); }\n"
    )
    library = compiled(wrapped, folder)
    return function(library, "f", 4), function(library, "c", 5)


@needs_compiler
def test_every_equation_without_memory_is_what_it_is_in_python(tmp_path):
    hooks = [
        (f"{effect.name}_{effect.site}_{place}".replace("-", "_"), effect, getattr(effect, place))
        for several in catalogue().values()
        for effect in several
        for place in PLACES
        if effect.settle is None and getattr(effect, place) is not None
    ]
    assert len(hooks) > 20
    inputs = "double a, double b, double c, const double *p"
    text = "#include <math.h>\n" + "".join(
        c_function(name, one).replace("static inline", "static")
        + f"double x_{name}({inputs}) {{ double s[4] = {{0.1, 0.2, 0.3, 0.4}}; return {name}(a, b, c, 0.0, s, p); }}\n"
        for name, _, one in hooks
    )
    library, random = compiled(text, tmp_path), np.random.default_rng(1)
    for name, effect, one in hooks:
        found = function(library, f"x_{name}", 3)
        found.argtypes = [*found.argtypes, ctypes.POINTER(ctypes.c_double)]
        for _ in range(50):
            numbers = random.uniform(0.1, 0.9, max(len(effect.parameters), 1))
            a, b, c = random.normal(size=3)
            expected = one(a, b, c, 0.0, [0.1, 0.2, 0.3, 0.4], numbers)
            given_ = (ctypes.c_double * len(numbers))(*numbers)
            assert found(a, b, c, given_) == pytest.approx(expected, rel=1e-12, abs=1e-12), name


@needs_compiler
def test_the_force_is_what_the_balance_of_the_model_requires(tmp_path):
    machine = model(
        "stribeck_friction@axis(coulomb=0.1, static=0.15, velocity=0.2)", "cogging@axis(amplitude=0.02, harmonic=7)",
        "gravity@axis(moment=0.3)", "quadratic_drag@axis(coefficient=0.01)", "load_torque@axis(torque=0.05)",
    )  # fmt: skip
    force, _ = header(machine, tmp_path)
    q, v, a = (one.ravel() for one in np.meshgrid([-1.0, 0.2, 2.0], [-3.0, -0.1, 0.1, 4.0], [-20.0, 0.0, 30.0]))
    time = np.arange(len(q), dtype=float)
    motion = [one[:, None] for one in (q, v, a)]
    needed = Engine(machine).balance(None, *motion, time, np.zeros(len(q)), time).required
    np.testing.assert_allclose([force(*one, 0.0) for one in zip(q, v, a, strict=True)], needed, rtol=1e-12, atol=1e-12)


@needs_compiler
def test_the_command_goes_back_through_what_acts_on_it(tmp_path):
    machine = model(
        "dead_zone@input(width=0.1)", "input_offset@input(offset=0.03)", "gain_asymmetry@input(ratio=0.2)",
        "load_dependent_friction@axis(ratio=0.25)",
    )  # fmt: skip
    force, command = header(machine, tmp_path)
    for q, v, a in itertools.product([0.0, 1.0], [-2.0, 3.0], [-40.0, 50.0]):
        wanted = force(q, v, a, 0.0)
        smooth = 0.01 * a + 0.05 * v
        assert wanted == pytest.approx(smooth + math.copysign(0.25 * abs(wanted), v), rel=1e-4)
        value = command(q, v, a, 0.0, 0.0)
        for active in machine.acting:
            if active.effect.command is not None:
                own = [machine.values[f"{active.name}.{spec.name}"] if f"{active.name}.{spec.name}" in machine.values
                       else machine.values[f"{active.name}.width"] for spec in active.effect.parameters]  # fmt: skip
                value = active.effect.command(value, v, q, 0.0, [], own)
        assert value == pytest.approx(wanted, rel=1e-9)


def test_what_has_memory_is_left_out_and_said():
    found = idloop.export(
        model("input_delay@input(delay=0.002)", "presliding_friction@axis(level=0.1, stiffness=50.0)"), "c"
    )
    assert any(line.startswith("input_delay@input") for line in found.left_out)
    assert any(line.startswith("presliding_friction@axis") for line in found.left_out)


@pytest.mark.parametrize(
    ("machine", "words"),
    [
        (lambda: load_model("torsion"), "has 4"),
        (lambda: model().with_values({"drive.gain": 0.0}), "drive gain is 0"),
    ],
)
def test_what_it_cannot_hold_is_one_line(machine, words):
    with pytest.raises(InputError, match=words):
        idloop.export(machine(), "c")


def test_an_equation_that_cannot_be_translated_is_said():
    @hook
    def looping(a, b, c, elapsed, state, parameters):
        while a > 1.0:
            a -= 1.0
        return a

    with pytest.raises(InputError, match="no translation to C: while"):
        c_function("looping", looping)
