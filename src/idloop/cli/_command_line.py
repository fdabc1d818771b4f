"""The command line that is running, as one would type it again."""

from __future__ import annotations

import shlex
from collections.abc import Collection, Sequence
from typing import Any

import click
from click.core import ParameterSource


def command_line(context: click.Context, *, without: Collection[str] = (), with_: Sequence[str] = ()) -> str:
    """Write the verb with the arguments and options that were given, defaults left out.

    `context`: of the verb; `without`: names of parameters to leave out; `with_`: words that come first. Returns: for a
    shell.
    """
    words, options = ["idloop", context.info_name or "", *with_], []
    for parameter in context.command.params:
        name = parameter.name or ""
        if name in without or context.get_parameter_source(name) is not ParameterSource.COMMANDLINE:
            continue
        # What the verb does not see itself is kept under the option's name; a flag may be kept nowhere.
        value: Any = context.params.get(name, context.meta.get(f"idloop.{name}"))
        if isinstance(parameter, click.Argument):
            words += [str(word) for word in (value if isinstance(value, tuple) else (value,))]
        elif isinstance(parameter, click.Option) and (parameter.is_flag or parameter.count):
            options += [parameter.opts[0]] * int(value or 1)
        else:
            for one in value if parameter.multiple else (value,):
                options += [parameter.opts[0], *(str(word) for word in (one if isinstance(one, tuple) else (one,)))]
    return shlex.join([*words, *options])
