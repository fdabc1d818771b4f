"""The command line that is running: what it keeps for functions deeper down, and how one would type it again."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Collection, Sequence
from functools import partial
from typing import Any, TypeVar

import click
from click.core import ParameterSource

Function = TypeVar("Function", bound=Callable[..., Any])


def keep(context: click.Context, parameter: click.Parameter, value: Any) -> None:
    """Keep the value of an option that no verb sees itself, as its callback."""
    context.meta[f"idloop.{parameter.name}"] = value


# An option that no verb sees itself, for `kept`.
kept_option = partial(click.option, expose_value=False, callback=keep)


def together(*options: Callable[[Function], Function]) -> Callable[[Function], Function]:
    """Add several options, in this order."""

    def add(function: Function) -> Function:
        for option in reversed(options):
            function = option(function)
        return function

    return add


def kept(name: str) -> Any:
    """Value of an option that `keep` has; None where it was not given, and outside of the command line."""
    context = click.get_current_context(silent=True)
    return None if context is None else context.meta.get(f"idloop.{name}")


def command_line(context: click.Context, *, without: Collection[str] = (), with_: Sequence[str] = ()) -> str:
    """Write the verb for a shell with what was given, defaults left out.

    `without`: names of parameters to leave out. `with_`: words that come first.
    """
    words, options = ["idloop", context.info_name or "", *with_], []
    for parameter in context.command.params:
        name = parameter.name or ""
        if name in without or context.get_parameter_source(name) is not ParameterSource.COMMANDLINE:
            continue
        # A flag that the verb does not see may be kept nowhere.
        value: Any = context.params.get(name, context.meta.get(f"idloop.{name}"))
        if isinstance(parameter, click.Argument):
            words += [str(word) for word in (value if isinstance(value, tuple) else (value,))]
        elif isinstance(parameter, click.Option) and (parameter.is_flag or parameter.count):
            options += [parameter.opts[0]] * int(value or 1)
        else:
            for one in value if parameter.multiple else (value,):
                options += [parameter.opts[0], *(str(word) for word in (one if isinstance(one, tuple) else (one,)))]
    return shlex.join([*words, *options])
