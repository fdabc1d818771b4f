"""Reader of the part of ROS 2's YAML launch format that our graphs use."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from idloop.documents import read_text, read_yaml
from idloop.errors import InputError
from idloop.graph.find import graph_path, package_share
from idloop.spelling import did_you_mean

_MOST_SUBSTITUTIONS = 100
_MOST_INCLUDES = 10
_SUBSTITUTION = re.compile(r"\$\(([^\s()]+)((?:\s+[^()]*)?)\)")
_NODE_KEYS = frozenset(
    {"pkg", "exec", "name", "namespace", "param", "remap", "args", "ros_args", "output", "on_exit", "if", "unless"}
)


@dataclass(frozen=True)
class Argument:
    """One argument of a launch file; `default` is None when it must be given."""

    name: str
    default: str | None
    description: str = ""


@dataclass(frozen=True)
class NodeEntry:
    """One node to start."""

    # What to run
    package: str
    executable: str
    # Node name and namespace; empty for the node's own
    name: str = ""
    namespace: str = ""
    parameters: dict[str, Any] = field(default_factory=dict)  # values by name
    parameter_files: tuple[Path, ...] = ()  # parameter files, read before `parameters`
    remappings: tuple[tuple[str, str], ...] = ()  # from, to
    arguments: tuple[str, ...] = ()  # further words of the command line
    ends_graph: bool = False  # the graph ends when this node ends (``on_exit: shutdown``)


@dataclass(frozen=True)
class Graph:
    """A launch file with its arguments filled in."""

    path: Path
    name: str
    arguments: tuple[Argument, ...]
    values: dict[str, str]
    nodes: tuple[NodeEntry, ...]


class _Reader:
    """Reader of one launch file with the values of its arguments."""

    def __init__(self, path: Path, given: Mapping[str, str]) -> None:
        self.path = path
        self.given = dict(given)
        self.arguments: list[Argument] = []
        self.values: dict[str, str] = {}
        self.nodes: list[NodeEntry] = []
        self.missing: list[Argument] = []
        self.depth = 0  # of files that include one another

    def fail(self, text: str) -> InputError:
        return InputError(f"{self.path}: {text}")

    def read(self) -> None:
        self.items()
        unknown = [name for name in self.given if name not in {one.name for one in self.arguments}]
        if unknown:
            known = [one.name for one in self.arguments]
            raise self.fail(
                f"no argument {unknown[0]!r}{did_you_mean(unknown[0], known)}; known: {', '.join(known) or 'none'}"
            )

    def items(self) -> None:
        document = read_yaml(read_text(self.path), str(self.path))
        if not isinstance(document, dict) or not isinstance(document.get("launch"), list):
            raise self.fail("no YAML launch file: it starts with a list under the key launch")
        readers: dict[str, Callable[[Any], None]] = {
            "arg": self.argument,
            "let": self.let,
            "node": self.node,
            "include": self.include,
        }
        for item in document["launch"]:
            if not isinstance(item, dict) or len(item) != 1:
                raise self.fail(f"{item!r} is no entry such as node: {{...}}")
            ((kind, content),) = item.items()
            if kind not in readers:
                raise self.fail(f"entry {kind!r} is not supported here ({', '.join(readers)}); use ros2 launch for it")
            if not isinstance(content, dict):
                raise self.fail(f"{kind}: {content!r} is no mapping")
            readers[kind](content)

    def include(self, content: dict[str, Any]) -> None:
        """Read the entries of another file; arguments that are declared already keep their default."""
        if set(content) != {"file"}:
            raise self.fail("include: only file is supported here, and must be given")
        if self.depth == _MOST_INCLUDES:
            raise self.fail("recursive include")
        outer, self.path = self.path, graph_path(self.substitute(content["file"]))
        self.depth += 1
        self.items()
        self.depth -= 1
        self.path = outer

    def argument(self, content: dict[str, Any]) -> None:
        name = self.required(content, "arg", "name")
        if name in self.values:
            return
        default = content.get("default")
        one = Argument(name, None if default is None else self.substitute(default), str(content.get("description", "")))
        self.arguments.append(one)
        if name in self.given:
            self.values[name] = self.given[name]
        elif one.default is not None:
            self.values[name] = one.default
        else:
            self.values[name] = ""
            self.missing.append(one)

    def let(self, content: dict[str, Any]) -> None:
        self.values[self.required(content, "let", "name")] = self.substitute(content.get("value", ""))

    def node(self, content: dict[str, Any]) -> None:
        unknown = sorted(str(key) for key in content if key not in _NODE_KEYS)
        if unknown:
            raise self.fail(f"node: key {unknown[0]!r} is not supported here{did_you_mean(unknown[0], _NODE_KEYS)}")
        if not self.wanted(content):
            return
        parameters: dict[str, Any] = {}
        files: list[Path] = []
        for entry in self.entries(content, "param"):
            if isinstance(entry, dict) and "from" in entry:
                files.append(Path(self.substitute(entry["from"])))
            else:
                name = self.required(entry, "param", "name")
                parameters[name] = self.parameter(name, entry)
        on_exit = content.get("on_exit")
        if on_exit not in (None, "shutdown"):
            raise self.fail(f"node: on_exit {on_exit!r} is not supported; only shutdown is")
        words = f"{self.substitute(content.get('args', ''))} {self.substitute(content.get('ros_args', ''))}"
        self.nodes.append(
            NodeEntry(
                package=self.required(content, "node", "pkg"),
                executable=self.required(content, "node", "exec"),
                name=self.substitute(content.get("name", "")),
                namespace=self.substitute(content.get("namespace", "")),
                parameters=parameters,
                parameter_files=tuple(files),
                remappings=tuple(
                    (self.required(one, "remap", "from"), self.required(one, "remap", "to"))
                    for one in self.entries(content, "remap")
                ),
                arguments=tuple(words.split()),
                ends_graph=on_exit == "shutdown",
            )
        )

    def wanted(self, content: dict[str, Any]) -> bool:
        truth = {"true": True, "1": True, "false": False, "0": False}
        for key, keep in (("if", True), ("unless", False)):
            if key in content:
                text = self.substitute(content[key]).strip().lower()
                if text not in truth:
                    raise self.fail(f"{key}: {text!r} is neither true nor false")
                if truth[text] != keep:
                    return False
        return True

    def entries(self, content: dict[str, Any], key: str) -> list[Any]:
        found = content.get(key, [])
        if not isinstance(found, list):
            raise self.fail(f"node: {key}: {found!r} is no list")
        return found

    def required(self, content: Any, kind: str, key: str) -> str:
        if not isinstance(content, dict) or key not in content:
            raise self.fail(f"{kind}: key {key} is missing")
        return self.substitute(content[key])

    def parameter(self, name: str, entry: dict[str, Any]) -> Any:
        kind = entry.get("type")
        if kind not in (None, "str"):
            raise self.fail(f"param {name}: type {kind!r} is not supported here; only str is")
        value = self.substitute(entry.get("value", "")) if kind == "str" else self.value(entry.get("value"))
        if isinstance(value, dict):
            raise self.fail(f"param {name}: a ROS parameter cannot be a mapping; for the text itself add type: str")
        return value

    def value(self, value: Any) -> Any:
        """Return a parameter's value; text is read as YAML, as launch_ros does."""
        if isinstance(value, list):
            return [self.value(item) for item in value]
        if not isinstance(value, str):
            return value
        text = self.substitute(value)
        try:
            read = read_yaml(text, "")
        except InputError:
            return text
        # ROS has no null parameters: such a text stays a text.
        return text if read is None else read

    def substitute(self, text: Any) -> str:
        """Replace $(var x), $(env X default), $(find-pkg-share p), $(dirname)."""
        if isinstance(text, bool):
            return str(text).lower()
        result = str(text)
        for _ in range(_MOST_SUBSTITUTIONS):
            if (match := _SUBSTITUTION.search(result)) is None:
                return result
            result = result[: match.start()] + self.look_up(match[1], match[2].split()) + result[match.end() :]
        raise self.fail(f"{str(text)[:40]!r} is a recursive substitution")

    def look_up(self, kind: str, words: list[str]) -> str:
        if kind == "dirname" and not words:
            return str(self.path.parent)
        if not words:
            raise self.fail(f"$({kind}) needs a name")
        if kind == "var":
            if words[0] not in self.values:
                raise self.fail(f"$(var {words[0]}) has no value{did_you_mean(words[0], self.values)}")
            return self.values[words[0]]
        if kind == "env":
            if words[0] in os.environ:
                return os.environ[words[0]]
            if len(words) > 1:
                return " ".join(words[1:]).strip("'\"")
            raise self.fail(f"$(env {words[0]}) is not set")
        if kind == "find-pkg-share":
            return str(package_share(words[0]))
        raise self.fail(f"substitution $({kind} ...) is not supported here (var, env, find-pkg-share, dirname)")


def load_graph(name: str, values: Mapping[str, str] | None = None, *, to_run: bool = True) -> Graph:
    """Read a launch file.

    `name`: name of one of our graphs, or path of a launch file. `values`: values of its arguments. `to_run`: whether
    arguments without a default must be given; otherwise they are empty. Raises InputError: no such graph, argument or
    substitution, or an entry that only `ros2 launch` supports.
    """
    path = graph_path(name)
    reader = _Reader(path, values or {})
    reader.read()
    if to_run and reader.missing:
        one = reader.missing[0]
        raise reader.fail(f"argument {one.name} must be given: {one.name}:=VALUE ({one.description})")
    return Graph(path, path.name.split(".")[0], tuple(reader.arguments), reader.values, tuple(reader.nodes))
