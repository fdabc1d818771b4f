"""Every number that the figures of the page hold is that of the JSON of refine, compare and diagnose."""

from __future__ import annotations

import base64
import gzip
import json
import re
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from idloop.reporting.page.contents import Contents
from idloop.reporting.page.page import render_page

Node = Any
KINDS = ("validation", "train")  # unseen data are drawn first


def parts(node: Node) -> Iterator[dict[str, Any]]:
    """Every object of a figure."""
    if isinstance(node, dict):
        yield node
        for value in node.values():
            yield from parts(value)
    elif isinstance(node, list):
        for value in node:
            yield from parts(value)


def values(node: Node) -> Any:
    """A column of a figure's data."""
    if isinstance(node, dict) and node.get("type") == "ndarray":
        raw = node["array"]["data"]
        content = gzip.decompress(base64.b64decode(raw)) if isinstance(raw, str) else raw
        return np.frombuffer(content, dtype=node["dtype"]).astype(float)
    return node


def columns(node: Node) -> list[dict[str, Any]]:
    """Data of all glyphs, in the order in which they were drawn; each once."""
    return [
        {name: values(column) for name, column in one["attributes"]["data"]["entries"]}
        for one in parts(node)
        if one.get("name") == "ColumnDataSource" and one["attributes"].get("data", {}).get("entries")
    ]


@pytest.fixture(scope="module")
def figures(contents: Contents) -> dict[str, Any]:
    """The figures as they lie in the page."""
    page = render_page(contents)
    text = re.search(r'<script type="application/json" id="figures">(.*?)</script>', page, re.DOTALL)
    assert text is not None
    return dict(json.loads(text[1]))


@pytest.fixture(scope="module")
def refined(contents: Contents) -> dict[str, Any]:
    """What ``ladder.json`` says."""
    return dict(json.loads(json.dumps(contents.ladder.to_dict())))


@pytest.fixture(scope="module")
def compared(contents: Contents) -> list[list[dict[str, Any]]]:
    """What ``idloop compare --json`` says of each record: of the first and of the last model."""
    return [[json.loads(json.dumps(c.to_dict())) for _, c in judged.rows] for judged in contents.judged]


def held(found: list[dict[str, Any]], name: str, expected: Any) -> bool:
    """Whether a figure holds a column with these numbers."""
    return any(
        len(one[name]) == len(expected) and np.allclose(np.asarray(one[name], dtype=float), expected, rtol=1e-6)
        for one in found
        if name in one and not isinstance(one[name][0], str)
    )


def test_the_ladder(figures: Node, refined: Node) -> None:
    drawn = columns(figures["ladder"])
    for kind in KINDS:
        assert held(drawn, "x", [100.0 * step[kind]["force"] for step in refined["ladder"]])
        for name in ("motor.position", "motor.velocity"):
            assert held(drawn, "x", [step[kind]["nrmse"][name] for step in refined["ladder"]])


def test_the_noise_floor(figures: Node, contents: Contents) -> None:
    drawn = {x for one in columns(figures["ladder"]) if "high" in one for x in one["x"]}
    assert drawn == set(contents.floor.values())


def test_what_was_weighed(figures: Node, refined: Node) -> None:
    (drawn,) = (one for one in columns(figures["candidates"]) if "share" in one)
    said = {f"{step['added']['effect']}@{step['added']['at']}": step["added"] for step in refined["ladder"][1:]}
    said |= {f"{one['effect']}@{one['at']}": one for one in refined["candidates"]}
    for words, share in zip(drawn["name"], drawn["share"], strict=True):
        name = words.lower().replace(" @ ", "@").replace(" ", "_")
        # What ties and was not refitted explains as much as what it ties with.
        if said.get(name, {}).get("explains"):
            assert share == pytest.approx(100.0 * said[name]["explains"])
        else:
            shares = [100.0 * (one["explains"] or 0.0) for one in said.values()]
            assert any(share == pytest.approx(one) for one in (0.0, *shares))


def test_what_no_effect_explains(figures: Node, refined: Node) -> None:
    (drawn,) = columns(figures["unknown"])
    unknown = refined["unknown"]
    np.testing.assert_allclose(drawn["x"], unknown["at"])
    np.testing.assert_allclose(0.5 * (drawn["high"] - drawn["low"]), unknown["band"])
    assert held([drawn], "y", unknown["force"])


def test_free_runs(figures: Node, compared: Node) -> None:
    for index, documents in enumerate(compared):
        drawn = columns(figures[f"overlay-{index}"])
        step = 1 + 2 * len(documents)
        for output, name in enumerate(("motor.position", "motor.velocity")):
            part = drawn[output * step : (output + 1) * step]
            above, below = part[: 1 + len(documents)], part[1 + len(documents) :]
            measured = above[0]["y"]
            for modelled, left, document in zip(above[1:], below, documents, strict=True):
                said = document["free_run"]
                np.testing.assert_allclose(left["y"], measured - modelled["y"], atol=1e-5)
                assert np.sqrt(np.mean(left["y"] ** 2)) == pytest.approx(said["rmse"][name], rel=1e-4)
                nrmse = np.sqrt(np.mean(left["y"] ** 2)) / np.std(measured)
                assert nrmse == pytest.approx(said["nrmse"][name], rel=0.02)


def test_words_of_a_legend(figures: Node, compared: Node) -> None:
    for index, documents in enumerate(compared):
        written = re.findall(r"FIT (−?[\d.]+) %", json.dumps(figures[f"overlay-{index}"], ensure_ascii=False))
        numbers = np.array([float(text.replace("−", "-")) for text in written])
        fits = [fit for document in documents for fit in document["free_run"]["fit"].values()]
        assert len(numbers) == len(fits)
        for fit in fits:
            assert np.min(np.abs(numbers - fit)) <= 0.05


def test_drive_force(figures: Node, compared: Node) -> None:
    for index, documents in enumerate(compared):
        applied, *rest = columns(figures[f"force-{index}"])
        size = np.sqrt(np.mean(applied["y"] ** 2))
        missed = rest[len(documents) :]
        for needed, left, document in zip(rest, missed, documents, strict=False):
            relative = document["force"]["relative_error"]
            np.testing.assert_allclose(left["y"], applied["y"] - needed["y"], atol=1e-4)
            assert np.sqrt(np.mean(left["y"] ** 2)) / size == pytest.approx(relative, rel=1e-4)


def test_where_the_model_fails(figures: Node, compared: Node) -> None:
    places = [name.split("-", 2)[1:] for name in figures if name.startswith("where-")]
    assert {variable for _, variable in places} > {"time", "velocity", "frequency", "command"}
    for error, variable in places:
        drawn = columns(figures[f"where-{error}-{variable}"])
        for document in compared[0]:
            told = document["where"][error]
            if variable == "time":
                sizes = [float(np.sqrt(np.mean(one["y"] ** 2))) for one in drawn]
                assert sum(size == pytest.approx(told["rms"], rel=1e-4) for size in sizes) == 1
                continue
            bins = told["share"][variable]["bins"]
            rms = np.array([np.nan if one["rms"] is None else one["rms"] for one in bins])
            share = np.array([100.0 * one["error"] for one in bins])
            # Written for the words under the mouse: to a tenth.
            assert any(
                np.allclose(one["rms"], rms, rtol=1e-6, equal_nan=True) and np.all(np.abs(one["error"] - share) < 0.051)
                for one in drawn
                if "rms" in one and len(one["rms"]) == len(rms)
            ), (error, variable)


def test_residual_tests(figures: Node, contents: Contents, compared: Node) -> None:
    told = {one["output"]: one for one in compared[0][-1]["residual"]}
    for test in contents.judged[0].rows[-1][1].residual_tests():
        own, cross = columns(figures[f"residual-{test.name}"])
        assert test.ljung_box_p == told[test.name]["ljung_box_p"]
        np.testing.assert_allclose(own["y"], test.autocorrelation, rtol=1e-6)
        np.testing.assert_allclose(cross["y"], test.cross_correlation, rtol=1e-6)
        # Outside the bands lies what the test says.
        outside = np.mean(np.abs(own["y"]) > own["high"])
        assert (outside > 0.1) <= (not told[test.name]["white"])
