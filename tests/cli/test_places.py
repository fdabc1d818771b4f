"""Where results go: a place that cannot be written is told before the work, by every verb in the same words."""

from __future__ import annotations

import os
import sys

import click
import pytest

from idloop import output_files
from idloop.cli import main

FIGURES = {
    "inspect": ("inspect", "BAG", "--plot"),
    "fit": ("fit", "dc_motor", "BAG", "--plot"),
    "compare": ("compare", "dc_motor", "BAG", "--plot"),
    "compare where": ("compare", "dc_motor", "BAG", "--plot-where"),
    "identify": ("identify", "BAG", "--method", "oe", "--plot"),
    "suggest": ("suggest", "dc_motor", "BAG", "--plot"),
    "compensate": ("compensate", "dc_motor", "--plot"),
    "monitor": ("monitor", "dc_motor", "BAG", "--plot"),
    "papers": ("papers", "B2", "--plot"),
}
FILES = {
    "fit": ("fit", "dc_motor", "BAG", "--output"),
    "suggest": ("suggest", "dc_motor", "BAG", "--output"),
    "compensate": ("compensate", "dc_motor", "--output"),
    "export": ("export", "dc_motor", "--format", "urdf", "--output"),
    "identify": ("identify", "BAG", "--method", "oe", "--save"),
}
PAGES = {
    "report": (("report", "BAG", "--output"), ".html"),
    "report on paper": (("report", "BAG", "--pdf"), ".pdf"),
    "picture of a report": (("report", "BAG", "--picture"), ".png"),
}
FOLDERS = {
    "refine": ("refine", "dc_motor", "BAG", "--output"),
    "workbench": ("workbench", "dc_motor", "BAG", "--output"),
    "report": ("report", "BAG", "--svg"),
}
# These make the folders above as well, and refuse one that is there.
RECORDINGS = {
    "import": ("import", "emps", "nothing.mat"),
    "recover": ("recover", "BAG"),
    "replay": ("replay", "BAG", "--output"),
    "demo": ("demo", "--directory"),
    "compensate": ("compensate", "dc_motor", "--graph", "--bags"),
}
EVERY = [(line, ".png") for line in FIGURES.values()]
EVERY += [(line, ".json") for line in FILES.values()]
EVERY += list(PAGES.values())
NAMES = [*(f"figure: {name}" for name in FIGURES), *(f"file: {name}" for name in FILES), *PAGES]

every_file = pytest.mark.parametrize(("line", "suffix"), EVERY, ids=NAMES)
not_root = pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="root may write anywhere")
with_proc = pytest.mark.skipif(sys.platform != "linux", reason="no /proc")


@pytest.fixture
def tried(tmp_path, capsys):
    """Run a verb on a BAG that nobody could read, and return exit code and the line that it says."""
    bag = tmp_path / "no_recording"
    bag.mkdir()

    def run(line: tuple[str, ...], place: object, *more: str) -> tuple[int, str]:
        words = [str(bag) if word == "BAG" else word for word in line]
        code = main.run([*words, str(place), *more])
        said = capsys.readouterr()
        assert said.out == ""
        assert said.err.count("\n") == 1, said.err
        assert said.err.startswith(f"idloop {line[0]}: ")
        return code, said.err

    return run


@every_file
def test_a_folder_that_is_not_there(tried, line, suffix, tmp_path):
    code, said = tried(line, tmp_path / "no" / f"such{suffix}")
    assert code == 2
    assert f"{line[-1]} {tmp_path}/no/such{suffix}: there is no folder {tmp_path}/no, make it first" in said


@every_file
def test_a_folder_where_a_file_should_be(tried, line, suffix, tmp_path):
    folder = tmp_path / f"folder{suffix}"
    folder.mkdir()
    code, said = tried(line, folder)
    assert code == 2
    assert "this is a folder, name a file" in said


@every_file
def test_a_file_in_the_place_of_the_folder(tried, line, suffix, tmp_path):
    (tmp_path / "file").touch()
    code, said = tried(line, tmp_path / "file" / f"in{suffix}")
    assert code == 2
    assert "is a file and not a folder" in said


@with_proc
@every_file
def test_a_place_where_nobody_may_write(tried, line, suffix):
    code, said = tried(line, f"/proc/idloop{suffix}")
    assert code == 2
    assert "cannot be written (" in said


@every_file
def test_a_name_that_is_too_long(tried, line, suffix, tmp_path):
    code, said = tried(line, tmp_path / f"{'long' * 100}{suffix}")
    assert code == 2
    assert "File name too long" in said


@not_root
@every_file
def test_a_folder_without_the_right_to_write(tried, line, suffix, tmp_path):
    folder = tmp_path / "read_only"
    folder.mkdir(mode=0o500)
    code, said = tried(line, folder / f"in{suffix}")
    assert code == 2
    assert "Permission denied" in said


@pytest.mark.parametrize("line", FIGURES.values(), ids=FIGURES)
@pytest.mark.parametrize("name", ("figure.xyz", "figure", "figure.jpg"))
def test_a_figure_in_a_format_that_there_is_not(tried, line, name, tmp_path):
    code, said = tried(line, tmp_path / name)
    assert code == 2
    assert f"{line[-1]} {tmp_path}/{name}: the suffix must be one of .png, .svg, .pdf" in said


@pytest.mark.parametrize(("line", "suffix"), PAGES.values(), ids=PAGES)
def test_a_report_does_not_take_the_place_of_a_recording(tried, line, suffix, tmp_path):
    recording = tmp_path / "run.mcap"
    recording.write_bytes(b"measured")
    code, said = tried(line, recording)
    assert code == 2
    assert "the suffix must be" in said
    assert recording.read_bytes() == b"measured"


@pytest.mark.parametrize("line", FILES.values(), ids=FILES)
def test_what_is_there_is_overwritten_only_when_asked(tried, line, tmp_path):
    there = tmp_path / "there.json"
    there.write_text("mine", encoding="utf-8")
    code, said = tried(line, there)
    assert code == 2
    assert "the file is there already, name another or add --force" in said
    assert there.read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize("line", [FILES["fit"], FILES["suggest"], FILES["identify"]])
def test_the_probe_leaves_nothing_behind_and_changes_nothing(tried, line, tmp_path):
    there = tmp_path / "there.json"
    there.write_text("mine", encoding="utf-8")
    before = there.stat().st_mtime_ns
    _, said = tried(line, there, "--force")
    assert "there already" not in said  # it went on to the bag that cannot be read
    assert (there.read_text(encoding="utf-8"), there.stat().st_mtime_ns) == ("mine", before)
    _, said = tried(line, tmp_path / "new.json")
    assert "new.json" not in said
    assert not (tmp_path / "new.json").exists()


@pytest.mark.parametrize("line", FOLDERS.values(), ids=FOLDERS)
def test_a_folder_that_cannot_be_made(tried, line, tmp_path):
    (tmp_path / "file").touch()
    cases = {
        tmp_path / "no" / "such": "there is no folder",
        tmp_path / "file": "this is a file, name a folder",
        tmp_path / "file" / "in": "is a file and not a folder",
        tmp_path / ("long" * 100): "File name too long",
    }
    for place, reason in cases.items():
        code, said = tried(line, place)
        assert code == 2
        assert f"{line[-1]} {place}: " in said
        assert reason in said


@pytest.mark.parametrize("line", RECORDINGS.values(), ids=RECORDINGS)
def test_a_new_recording_that_cannot_be_made(tried, line, tmp_path):
    (tmp_path / "file").touch()
    (tmp_path / "there").mkdir()
    cases = {
        tmp_path / "there": "exists already and is not overwritten",
        tmp_path / "file": "exists already and is not overwritten",
        tmp_path / "file" / "in" / "it": "cannot be written (Not a directory)",
    }
    for place, reason in cases.items():
        code, said = tried(line, place)
        assert code == 2
        assert reason in said
    assert list((tmp_path / "there").iterdir()) == []


def test_folders_above_a_recording_are_made_and_taken_away_again(tmp_path):
    place = tmp_path / "above" / "bag"
    assert output_files.probe_folder(place, "BAG", new=True, parents=True) == place
    assert not (tmp_path / "above").exists()
    (tmp_path / "above").mkdir()
    output_files.probe_folder(place, "BAG", new=True, parents=True)
    assert list((tmp_path / "above").iterdir()) == []


def test_a_link_that_leads_nowhere_is_where_the_file_will_be(tmp_path):
    link = tmp_path / "link.json"
    link.symlink_to(tmp_path / "later.json")
    assert output_files.probe_file(link, "--output") == link
    assert link.is_symlink()
    assert not (tmp_path / "later.json").exists()


def test_two_results_do_not_share_a_file(tried, tmp_path):
    line = ("compare", "dc_motor", "BAG", "--plot", str(tmp_path / "one.png"), "--plot-where")
    code, said = tried(line, tmp_path / "." / "one.png")
    assert code == 2
    assert f"--plot-where {tmp_path}/one.png: --plot goes there too" in said


def test_a_resumed_ladder_that_cannot_be_written_is_told_before_it_is_climbed(tried, tmp_path):
    (tmp_path / "run" / "model.yaml").mkdir(parents=True)
    code, said = tried(("refine", "--resume"), tmp_path / "run")
    assert code == 2
    assert "model.yaml: this is a folder" in said


def test_every_place_that_a_verb_writes_to_is_probed():
    """An option with a path of its own either names what is read, or has a type that probes."""
    read = {("refine", "resume"), ("suggest", "ladder"), ("report", "run"), ("inspect", "bags"), ("trust", "place")}
    read |= {("start", "files"), ("robot", "urdf")}
    read |= {("export", "output")}  # a file or a folder, as the formats say: probed by the verb
    for name in main.VERBS:
        command = main.group.get_command(click.Context(main.group), name)
        assert command is not None
        for parameter in command.params:
            if isinstance(parameter.type, click.Path):
                assert (name, parameter.name) in read, f"idloop {name} {parameter.opts[0]}"
