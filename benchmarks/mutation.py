"""Mutation testing of the last decisions before a motor: every change of their code must break a test.

Cosmic Ray makes the mutants: another operator or comparison, a number one more or less, `and` for `or`, a condition
negated. Two operators of our own are added: a call is replaced by its first argument (a clamp or an `abs` is deleted),
and a statement is left out. Each mutant runs the fast tests of its module, in a copy, until one fails. A survivor that
`mutation_survivors.yaml` does not explain is an exit code of 1; so is an explanation without a survivor.

    .venv/bin/python benchmarks/mutation.py
    .venv/bin/python benchmarks/mutation.py --only stream_watch --show
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import difflib
import io
import os
import shutil
import signal
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import parso
import yaml
from cosmic_ray.mutating import mutate_code
from cosmic_ray.operators.operator import Operator
from cosmic_ray.plugins import get_operator
from rich.console import Console
from rich.progress import track

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "ros_ws" / "src" / "idloop_nodes" / "idloop_nodes"
TESTS = ROOT / "tests" / "ros"
SURVIVORS = Path(__file__).with_name("mutation_survivors.yaml")
# Module, and the tests that are to kill its mutants.
GATE = ("test_safety_gate", "test_bridge_safety")
MODULES = {
    "safety_gate": (*GATE, "test_gate_settings"),
    "interlock": GATE,
    "command_limiter": ("test_command_limiter", "test_bridge_safety"),
    "managed_node": ("test_emergency_stop",),
    "stream_watch": ("test_stream_watch", "test_bridge_safety"),
    "guardian_link": ("test_silence_watch",),
    "trajectory_gate": ("test_path_timing",),
}
# What is changed of a module; else all of it.
PARTS = {
    "safety_gate": ("GateSettings", "gate_settings", "SafetyGate"),
    "managed_node": ("EmergencyStop",),
    "stream_watch": ("Arrival", "StreamWatch"),
    "guardian_link": ("SilenceWatch",),
    "trajectory_gate": ("PathTiming",),
}
# A mutant may wait for ever [s].
PATIENCE = 60
# Of Cosmic Ray's operators: one mutant for each mistake that somebody could make, not eleven for each plus sign.
OPERATORS = [
    f"core/{name}"
    for name in (
        "ReplaceBinaryOperator_Add_Sub", "ReplaceBinaryOperator_Sub_Add", "ReplaceBinaryOperator_Mul_Div",
        "ReplaceBinaryOperator_Div_Mul", "ReplaceBinaryOperator_FloorDiv_Mul", "ReplaceBinaryOperator_Pow_Mul",
        "ReplaceBinaryOperator_BitAnd_BitOr",
        "ReplaceComparisonOperator_Lt_LtE", "ReplaceComparisonOperator_Lt_Gt", "ReplaceComparisonOperator_LtE_Lt",
        "ReplaceComparisonOperator_LtE_Gt", "ReplaceComparisonOperator_Gt_GtE", "ReplaceComparisonOperator_Gt_Lt",
        "ReplaceComparisonOperator_GtE_Gt", "ReplaceComparisonOperator_GtE_Lt", "ReplaceComparisonOperator_Eq_NotEq",
        "ReplaceComparisonOperator_NotEq_Eq", "ReplaceComparisonOperator_Is_IsNot",
        "ReplaceComparisonOperator_IsNot_Is", "ReplaceUnaryOperator_Delete_USub", "ReplaceUnaryOperator_Delete_Not",
        "AddNot", "ReplaceTrueWithFalse", "ReplaceFalseWithTrue", "ReplaceAndWithOr", "ReplaceOrWithAnd",
        "NumberReplacer",
    )
]  # fmt: skip


class DeleteCall(Operator):
    """Replaces a call by its first argument."""

    def mutation_positions(self, node: Any) -> Iterator[Any]:
        """Where there is a call with an argument."""
        if self._argument(node) is not None:
            yield node.start_pos, node.end_pos

    def mutate(self, node: Any, index: int) -> Any:
        """Leave the argument alone."""
        return parso.parse(f"{node.get_first_leaf().prefix}({self._argument(node)})")

    @staticmethod
    def _argument(node: Any) -> str | None:
        if node.type != "atom_expr" or node.children[-1].type != "trailer" or node.children[-1].children[0] != "(":
            return None
        inside = node.children[-1].children[1]
        first = inside.children[0] if inside.type == "arglist" else inside
        plain = inside != ")" and first.type not in ("argument", "comp_for") and node.children[0].type != "keyword"
        return first.get_code().strip() if plain else None

    @classmethod
    def examples(cls) -> tuple[()]:
        """None."""
        return ()


class DeleteStatement(Operator):
    """Leaves an assignment or a call out."""

    def mutation_positions(self, node: Any) -> Iterator[Any]:
        """Where there is one."""
        if node.type == "simple_stmt" and node.children[0].type in ("expr_stmt", "atom_expr"):
            yield node.start_pos, node.end_pos

    def mutate(self, node: Any, index: int) -> Any:
        """Put `pass` in its place."""
        return parso.parse(f"{node.get_first_leaf().prefix}pass\n")

    @classmethod
    def examples(cls) -> tuple[()]:
        """None."""
        return ()


@dataclass(frozen=True)
class Mutant:
    """One change of a module."""

    module: str
    code: str
    change: str


def mutants(module: str) -> list[Mutant]:
    """Return all mutants of a module that differ from it and from one another, apart from imports and words."""
    source = _only(PACKAGE, module).read_text(encoding="utf-8")
    operators = [get_operator(name)() for name in OPERATORS] + [DeleteCall(), DeleteStatement()]
    found: dict[str, Mutant] = {}
    for operator in operators:
        for occurrence in range(10_000):
            code = mutate_code(source, operator, occurrence)
            if code is None:
                break
            change = _change(source, code)
            with contextlib.suppress(SyntaxError):
                if _part(module, code) != _part(module, source) and not _only_words(change):
                    found.setdefault(code, Mutant(module, code, change))
    return list(found.values())


def _part(module: str, code: str) -> list[str]:
    """Return what is changed of a module, in a form without positions."""
    names, body = PARTS.get(module), ast.parse(code).body
    return [ast.dump(node) for node in body if names is None or getattr(node, "name", "") in names]


def _only(folder: Path, module: str) -> Path:
    """Return the one file of a module somewhere in a folder."""
    (found,) = folder.rglob(f"{module}.py")
    return found


def _change(before: str, after: str) -> str:
    lines = difflib.unified_diff(before.splitlines(), after.splitlines(), lineterm="", n=0)
    return "\n".join(line for line in lines if line[:1] in "+-" and line[:3] not in ("+++", "---"))


def _only_words(change: str) -> bool:
    """Whether nothing but an import, an annotation or a message to a person has changed."""
    line = change[1:].strip()
    return line.startswith(("from ", "import ", "self.node.get_logger()"))


def survives(mutant: Mutant) -> bool:
    """Run the tests on a mutant, in a process of its own that may hang."""
    with tempfile.TemporaryDirectory(prefix="idloop_mutant_") as name:
        folder = Path(name)
        shutil.copytree(PACKAGE, folder / "idloop_nodes", ignore=shutil.ignore_patterns("__pycache__", "nodes"))
        _only(folder / "idloop_nodes", mutant.module).write_text(mutant.code, encoding="utf-8")
        tests = [_only(TESTS, test) for test in MODULES[mutant.module]]
        for test in tests:
            shutil.copy(test, folder)
        pid = os.fork()
        if pid == 0:
            _run(folder, [folder / test.name for test in tests])
        _, status = os.waitpid(pid, 0)
        return os.waitstatus_to_exitcode(status) == 0


def _run(folder: Path, tests: list[Path]) -> None:
    signal.alarm(PATIENCE)
    sys.dont_write_bytecode = True
    os.environ["PYTHONPATH"] = str(folder)
    sys.path.insert(0, str(folder))
    code = 1
    quiet = contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO())
    with quiet[0], quiet[1], contextlib.suppress(BaseException):
        from hypothesis import settings

        settings.register_profile("mutants", derandomize=True, deadline=None, max_examples=50, database=None)
        settings.load_profile("mutants")
        code = int(pytest().main(["-x", "-q", "-p", "no:cacheprovider", f"--rootdir={folder}", *map(str, tests)]))
    os._exit(code)


def pytest() -> Any:
    """Import pytest once, before the processes part."""
    import pytest

    return pytest


def main() -> int:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--only", nargs="+", choices=list(MODULES), default=list(MODULES), help="some modules; all when left out"
    )
    parser.add_argument("--show", action="store_true", help="print every survivor, explained or not")
    arguments = parser.parse_args()
    explained = yaml.safe_load(SURVIVORS.read_text(encoding="utf-8")) or {}
    screen, wrong = Console(stderr=True), 0
    import hypothesis.strategies  # noqa: F401  (once, before the processes part)
    import rclpy  # noqa: F401
    from std_srvs.srv import Trigger  # noqa: F401

    import idloop.errors  # noqa: F401

    pytest()
    print(f"{'module':18} {'mutants':>8} {'killed':>7} {'explained':>10} {'unexplained':>12}")
    with ProcessPoolExecutor(os.cpu_count(), mp_context=get_context("fork")) as pool:
        for module in arguments.only:
            all_of_it = mutants(module)
            alive = pool.map(survives, all_of_it)
            left = [
                one.change
                for one, lives in track(
                    zip(all_of_it, alive, strict=True), module, len(all_of_it), console=screen,
                    disable=not screen.is_terminal,
                )
                if lives
            ]  # fmt: skip
            reasons = {one["change"].strip(): one["why"] for one in explained.get(module, [])}
            known = [change for change in left if change in reasons]
            gone = [change for change in reasons if change not in left]
            unknown = len(left) - len(known)
            wrong += unknown + len(gone)
            print(
                f"{module:18} {len(all_of_it):8} {len(all_of_it) - len(left):7} {len(known):10} {unknown:12}",
                flush=True,
            )
            for change in left:
                if arguments.show or change not in reasons:
                    print(f"    survives: {reasons.get(change, 'why?')}\n      " + change.replace("\n", "\n      "))
            for change in gone:
                print("    explained and killed:\n      " + change.replace("\n", "\n      "))
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
