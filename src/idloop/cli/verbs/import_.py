"""`idloop import`: a log of any known form or a foreign bag becomes a bag of our topics."""

from __future__ import annotations

from pathlib import Path

import click

from idloop.cli import _outputs
from idloop.errors import InputError
from idloop.output_files import probe_folder


def list_sets(*, as_json: bool) -> None:
    """Print the ready data sets and their parts."""
    from idloop.records.tables.mapping import load_mapping, ready_mappings

    sets = [load_mapping(name) for name in ready_mappings()]
    fields = ("name", "description", "cite")
    document = [{key: getattr(one, key) for key in fields} | {"parts": list(one.parts)} for one in sets]
    rows = [(one.name, one.description, ", ".join(one.parts) or "-") for one in sets]
    _outputs.print_rows(["set", "what it is", "parts"], rows, document, as_json=as_json)


def split_arguments(words: tuple[str, ...], mapping: str | None) -> tuple[str, Path, Path]:
    """Return mapping, source and bag from the words of the command line.

    Raises InputError: too few or too many words, or both SET and --map.
    """
    from idloop.records.tables.mapping import ready_mappings

    known = ", ".join(ready_mappings())
    if len(words) == 3 and mapping is None:
        return words[0], Path(words[1]), Path(words[2])
    if len(words) == 2 and mapping is not None:
        return mapping, Path(words[0]), Path(words[1])
    if len(words) == 3:
        raise InputError(f"give either a SET ({words[0]}) or --map {mapping}, not both")
    if len(words) == 2:
        raise InputError(f"which columns are what? name a SET before the file ({known}), or a mapping file with --map")
    raise InputError(f"give [SET] SRC BAG: a ready set ({known}) or --map FILE, the file to read, the bag to write")


@click.command("import")
@click.argument("words", nargs=-1, metavar="[SET] SRC BAG")
@click.option("--map", "mapping", metavar="FILE", help="Mapping file of your own (schema idloop/mapping/1).")
@click.option("--part", metavar="NAME", help="Which record of a file that holds several.")
@click.option("--list", "show_list", is_flag=True, help="List the ready sets and their parts.")
@_outputs.json_option
def command(words: tuple[str, ...], *, mapping: str | None, part: str | None, show_list: bool, as_json: bool) -> None:
    """Turn SRC (a log of any known form, or a foreign bag) into the bag BAG of our topics.

    SET names a ready mapping (see --list); for a file of your own write a mapping file and give it with --map.
    It says which column is what:

    \b
      schema: idloop/mapping/1
      name: my_axis
      joint: motor
      time: {column: t}             # or {period: 0.001}, {rate: 1000}
      command: {column: u, unit: V}
      position: {column: angle, scale: 0.0015339808, unit: rad}
      velocity: {column: speed, decode: int16, unit: rad/s}

    Units are converted to those of the topics: deg, rev, rpm, mm, mm/s, mV, mA, mN·m and their like become rad,
    rad/s, m, m/s, V, A, N·m. A bag is never overwritten.
    """  # noqa: D301 - \b keeps click from joining the lines
    if show_list:
        list_sets(as_json=as_json)
        return
    name, source, bag = split_arguments(words, mapping)
    probe_folder(bag, "BAG", new=True, parents=True)
    from idloop.records.tables.importing import import_bag

    result = import_bag(source, bag, name, part=part)
    if as_json:
        _outputs.print_json(result.to_dict())
        return
    for note in result.notes:
        _outputs.log(f"note: {note}")
    for finding in result.findings:
        _outputs.log(f"{finding.level}: {finding.text}")
    written = ", ".join(f"{channel} [{unit or 'unit not given'}]" for channel, unit in result.channels.items())
    click.echo(
        f"{result.bag}: {result.samples} samples, {result.duration:.6g} s, every {result.period * 1e3:.6g} ms;"
        f" {written}"
    )
