"""The page itself: sections, words escaped, numbers of the ladder, nothing loaded; then in a real browser."""

from __future__ import annotations

import base64
import gzip
import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from idloop.diagnosis.evidence.detection_limit import DetectionLimit
from idloop.errors import IdloopError, InputError
from idloop.reporting.figures.theme import LIGHT
from idloop.reporting.page.chromium import VARIABLE, find_chromium, print_pdf, take_picture
from idloop.reporting.page.contents import gather
from idloop.reporting.page.page import changes, headline, render_page
from idloop.reporting.scores import error_lines

SECTIONS = ("answer", "ladder", "measured", "where", "left", "open", "model", "data", "provenance")
PHONE, DESKTOP = {"width": 360, "height": 740}, {"width": 1280, "height": 900}


class Outline(HTMLParser):
    """Sections, places of figures and whatever a browser would load."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.sections, self.places, self.loaded = [], [], []
        self.feed(html)

    def handle_starttag(self, tag, attrs):
        found = dict(attrs)
        if tag == "section":
            self.sections.append(found["id"])
        if tag == "figure":
            self.places.append(found["data-place"])
        self.loaded += [v for k, v in attrs if k in {"src", "srcset"} or (tag == "link" and k == "href")]


@pytest.fixture(scope="module")
def html(contents) -> str:
    return render_page(contents)


@pytest.fixture(scope="module")
def items(html) -> dict:
    return json.loads(re.search(r'<script type="application/json" id="figures">(.*?)</script>', html, re.DOTALL)[1])


def test_all_sections_and_figures_are_there_and_nothing_is_loaded(html, items):
    outline = Outline(html)
    assert tuple(outline.sections) == SECTIONS
    assert set(outline.places) == set(items)
    assert outline.loaded == []
    assert "default-src 'none'" in html
    assert len(html.encode()) < 3_000_000


def test_a_fit_is_explained_where_it_is_first_listed(html):
    ladder = html.partition('<section id="ladder">')[2].partition("</section>")[0]
    assert "100&nbsp;% is perfect, 0&nbsp;% no better than a constant" in ladder


@pytest.mark.slow
def test_what_was_passed_over_is_listed_once_with_its_reason(contents):
    ladder = replace(contents.ladder, passed_over={"saturation@input": "beside imbalance@motor nothing is left of it"})
    page = render_page(replace(contents, ladder=ladder))
    said = page.partition('<section id="open">')[2].partition("</section>")[0]
    assert "Significant on the fitted data, but not added" in said
    assert said.count("saturation @ input") == 1
    assert "<strong>saturation @ input</strong>: beside imbalance @ motor nothing" in said


def test_the_answer_comes_first(html, contents):
    tied = "Coulomb friction or dead zone"
    said = f"Missing from the model: {tied} and something that no effect of the catalogue explains."
    assert headline(contents.ladder) == said
    assert headline(replace(contents.ladder, verdict="adequate")) == f"Missing from the model: {tied}."
    answer = html[html.index('id="answer"') : html.index('id="ladder"')]
    for text in (said, "3.000 ± 0.039", "N·m", "p &lt; 0.001"):
        assert text in answer
    assert "cannot distinguish it from dead zone @ input" in answer
    assert "What is left has a shape" in answer
    # What the headline says is not said again.
    assert answer.count("no effect of the catalogue explains") == 1


@pytest.mark.slow
def test_values_are_those_of_the_last_model_beside_what_they_were_at_the_step(contents):
    start, step = contents.ladder.steps
    level = {"level": {"value": 2.5, "stderr": 0.1, "unit": "N·m"}}
    then = replace(step, added=replace(step.added, parameters=level))
    page = render_page(replace(contents, ladder=replace(contents.ladder, steps=(start, then))))
    answer = page[page.index('id="answer"') : page.index('id="ladder"')]
    assert "3.000 ± 0.039" in answer
    assert "When it was added: level 2.50 ± 0.20 N·m." in answer


@pytest.mark.slow
def test_a_fit_that_falls_is_not_coloured_like_a_gain(contents):
    start, step = contents.ladder.steps
    fits = {"motor.position": 99.0, "motor.velocity": 50.0}
    before = {**start.validation, "fit": fits, "force": 0.2}
    after = {**step.validation, "fit": {"motor.position": 98.0, "motor.velocity": 50.0}, "force": 0.1}
    ladder = replace(contents.ladder, steps=(replace(start, validation=before), replace(step, validation=after)))
    assert [row["trend"] for row in changes(ladder)] == ["better", "worse", "same"]
    page = render_page(replace(contents, ladder=ladder))
    page = page.replace("\u00a0", " ").replace("&nbsp;", " ")
    assert '<strong class="number worse">98 %</strong> <small>worse</small>' in page
    assert '<strong class="number better">10 %</strong></span>' in page


@pytest.mark.slow
def test_what_was_found_is_not_among_what_the_data_cannot_show(contents):
    names = ("saturation@input", "dead_zone@input", "coulomb_friction@motor")
    page = render_page(replace(contents, ladder=replace(contents.ladder, verdict="not_excited", untestable=names)))
    hidden = page[page.index("<h3>This data cannot show</h3>") : page.index('id="model"')]
    assert re.findall(r"<strong>(.*?)</strong>", hidden) == ["saturation @ input"]
    assert "this data cannot show saturation @ input." in page


@pytest.mark.slow
def test_what_explains_everything_explains_a_hundred_percent(contents):
    start, step = contents.ladder.steps
    whole = replace(step, added=replace(step.added, explains=0.9996))
    page = render_page(replace(contents, ladder=replace(contents.ladder, steps=(start, whole))))
    assert "100\u00a0% of the power of the errors" in page
    none = replace(step, added=replace(step.added, explains=0.0))
    page = render_page(replace(contents, ladder=replace(contents.ladder, steps=(start, none))))
    assert "of the power of the errors" not in page


@pytest.mark.slow
def test_a_large_size_has_its_power_of_ten(contents):
    limits = {"compliance@motor": DetectionLimit("stiffness", "N·m/rad", 5600.0, 5600.0, at_most=True)}
    page = render_page(replace(contents, ladder=replace(contents.ladder, untestable=(), limits=limits)))
    assert "stiffness ≤ 5.6 · 10³ N·m/rad" in page.replace("\u00a0", " ")


@pytest.mark.slow
def test_a_verdict_is_contradicted_by_errors_that_are_not_white(contents, story):
    coloured = np.cumsum(np.random.default_rng(0).normal(size=(len(story["train"].time), 2)), axis=0) * (1e-4, 5e-4)
    train = replace(story["train"], output=story["train"].output + coloured)
    ladder = replace(contents.ladder, verdict="adequate", unknown=None)
    page = render_page(gather(ladder, [train], [story["unseen"]]))
    answer = page[page.index('id="answer"') : page.index('id="ladder"')]
    assert "But the one-step error" in answer
    # The figures below are those of another record.
    assert "on the fitted data" in answer
    left = page[page.index('id="left"') : page.index('id="open"')]
    assert "One-step residual of motor.position on the unseen data: unseen" in left


@pytest.mark.slow
def test_a_share_says_of_what_it_is_one_and_a_list_of_which_model(contents):
    page = render_page(contents)
    # Which errors an effect was judged by, its step does not say: the last look may have been by others.
    assert "80\u00a0% of the power of the errors that the model without it leaves" in page
    assert "Criterion of the last look: one-step prediction errors." in page
    assert "<h3>This data cannot show</h3>" in page
    stopped = render_page(replace(contents, ladder=replace(contents.ladder, verdict="missing")))
    assert "<h3>As long as what is still missing is not in the model, this data cannot show</h3>" in stopped


@pytest.mark.slow
def test_effects_that_are_one_equation_get_their_check_by_hand(contents):
    start, step = contents.ladder.steps
    model = start.model.with_effects(["input_offset@input(offset=0.1)"])
    added = replace(step.added, effect="input_offset", at="input", model=model, parameters={})
    names = ("input_offset@input", "load_torque@motor", "dead_zone@input")
    last = replace(step, added=added, model=model, set=names)
    page = render_page(replace(contents, ladder=replace(contents.ladder, steps=(start, last))))
    assert "cannot distinguish it from dead zone @ input." in page
    assert (
        "No experiment can distinguish it from load torque @ motor: both give the same equation of motion. "
        "Check by hand:" in page
    )


@pytest.mark.slow
def test_words_of_a_model_are_escaped(html, contents):
    assert "Dry friction &lt;opposes&gt; motion." in html
    name = '</script><img src="x">'
    model = replace(contents.ladder.model, description=name)
    steps = tuple(replace(step, model=model) for step in contents.ladder.steps)
    page = render_page(replace(contents, ladder=replace(contents.ladder, steps=steps)))
    assert name not in page
    assert Outline(page).loaded == []


def test_the_table_says_what_the_document_says(html, contents):
    table = html[html.index('id="ladder"') : html.index('id="measured"')]
    for step in contents.ladder.to_dict()["ladder"]:
        for kind in ("train", "validation"):
            assert f">{100.0 * step[kind]['force']:.3g}<" in table
            for value in step[kind]["fit"].values():
                assert f">{value:.4g}<".replace("-", "−") in table


def arrays(node):
    """Arrays of numbers anywhere in a figure."""
    if isinstance(node, dict):
        if node.get("type") == "ndarray" and node["dtype"] in {"float64", "float32"}:
            yield np.frombuffer(gzip.decompress(base64.b64decode(node["array"]["data"])), dtype=node["dtype"])
        for value in node.values():
            yield from arrays(value)
    elif isinstance(node, list):
        for value in node:
            yield from arrays(value)


def test_the_figure_of_the_ladder_holds_the_numbers_of_the_document(items, contents):
    held = list(arrays(items["ladder"]))
    for line in error_lines(contents.ladder):
        assert any(np.array_equal(one, line.error) for one in held), line.label


@pytest.mark.slow
def test_a_ladder_without_a_step_says_so(contents):
    start = contents.ladder.steps[:1]
    for verdict, words in (("adequate", "Nothing is missing"), ("not_excited", "cannot show everything")):
        nothing = {"unknown": None, "candidates": (), "untestable": (), "findings": ()}
        alone = replace(contents.ladder, steps=start, verdict=verdict, **nothing)
        assert words in headline(alone)
        bare = replace(
            contents, ladder=alone, characteristics={},
            judged=tuple(replace(one, rows=one.rows[:1]) for one in contents.judged),
        )  # fmt: skip
        page = render_page(bare)
        assert "This data would have shown every effect that was looked for" in page
        assert tuple(Outline(page).sections) == SECTIONS


# ---------------------------------------------------------------- in a browser


@pytest.fixture(scope="module")
def file(html, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "report.html"
    path.write_text(html, encoding="utf-8")
    return path


@pytest.fixture
def opened(browser, file):
    """Open the page from disk in a window; complaints and requests are kept and must stay empty."""
    contexts, bad = [], []

    def opening(shown=file, **window):
        context = browser.new_context(offline=True, **window)
        contexts.append(context)
        page = context.new_page()
        page.on("console", lambda said: bad.append(said.text) if said.type in {"error", "warning"} else None)
        page.on("pageerror", lambda error: bad.append(str(error)))
        page.on(
            "request", lambda asked: bad.append(asked.url) if not asked.url.startswith(("file:", "data:")) else None
        )
        page.goto(shown.as_uri())
        page.wait_for_selector("html[data-ready]", timeout=200_000)
        return page

    yield opening
    for context in contexts:
        context.close()
    assert bad == []


def drawn(page) -> int:
    """Figures in which a canvas has been drawn on."""
    return page.evaluate("""[...document.querySelectorAll("figure.plot")].filter((place) => {
        const find = (node) => [...node.querySelectorAll("*")].some(
            (one) => (one.tagName === "CANVAS" && one.width > 0) || (one.shadowRoot && find(one.shadowRoot)));
        return find(place);
    }).length""")


@pytest.mark.slow
def test_every_figure_is_drawn_from_disk_without_a_network(opened, items, contents):
    page = opened(viewport=DESKTOP)
    assert drawn(page) == len(items)
    assert page.locator("#answer h1").inner_text() == headline(contents.ladder)
    assert page.locator("math").count() > 3
    # The first column of pixels of a figure is one of its middle where it is a fraction of a pixel wide.
    clipped = "[...document.querySelectorAll('figure.plot > :not(img)')].map((one) => getComputedStyle(one).clipPath)"
    assert set(page.evaluate(clipped)) == {"inset(0px 0px 0px 1px)"}


@pytest.mark.slow
def test_a_phone_shows_it_without_sideways_scrolling(opened, items):
    page = opened(viewport=PHONE, has_touch=True, is_mobile=True, color_scheme="dark")
    assert drawn(page) == len(items)
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    # The ladder's table is whole: its columns stand below one another, each with its name.
    assert page.evaluate(
        "(({ scrollWidth, clientWidth }) => scrollWidth <= clientWidth)(document.querySelector('.stacked'))"
    )
    label = page.evaluate("getComputedStyle(document.querySelector('.stacked td:last-child'), '::before').content")
    assert "FIT" in label
    assert page.evaluate("document.documentElement.dataset.theme") == "dark"
    # A finger on a figure scrolls the page: no tool that drags is on.
    assert page.evaluate(
        """Bokeh.documents.every((one) => [...one.all_models].every(
            (model) => model.type !== "Toolbar" || model.tools.every((tool) => !(tool.active === true))))"""
    )


@pytest.mark.slow
def test_light_and_dark_are_switched_and_paper_gets_pictures(opened, items):
    page = opened(viewport=DESKTOP)
    page.click("#theme")
    page.wait_for_selector('html[data-ready][data-theme="dark"]', timeout=200_000)
    assert drawn(page) == len(items)
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    page.emulate_media(media="print")
    page.wait_for_function("[...document.querySelectorAll('figure.plot img')].every((img) => img.naturalWidth > 0)")
    # A picture for every figure, and there are several at some places.
    pictured = page.evaluate(
        "[...document.querySelectorAll('figure.plot')].map((place) => place.querySelectorAll('img').length)"
    )
    assert min(pictured) == 1
    assert max(pictured) > 3
    assert page.locator("figure.plot img:visible").count() == sum(pictured)
    assert page.locator("header").is_hidden()
    # No box is empty because what it holds is folded up, and no figure is cut off.
    assert (
        page.evaluate(
            "[...document.querySelectorAll('.card')].filter((card) => card.checkVisibility() && !card.innerText.trim()"
            " && !card.querySelector('img')).length"
        )
        == 0
    )
    assert page.evaluate(
        "[...document.querySelectorAll('figure.plot img')].every((img) => img.getBoundingClientRect().right"
        " <= img.closest('.card').getBoundingClientRect().right)"
    )
    # Words on paper are dark, whatever the screen was.
    dark_ink = "rgb({}, {}, {})".format(*(int(LIGHT.text[i : i + 2], 16) for i in (1, 3, 5)))
    assert page.evaluate("getComputedStyle(document.body).color") == dark_ink


@pytest.mark.slow
def test_paper_shows_what_a_click_unfolds_where_nothing_else_says_it(opened, contents, tmp_path):
    limits = {"backlash@position[motor]": DetectionLimit("gap", "rad", 0.01, 0.02)}
    shown = tmp_path / "limits.html"
    shown.write_text(render_page(replace(contents, ladder=replace(contents.ladder, limits=limits))), encoding="utf-8")
    page = opened(shown, viewport=DESKTOP)
    folded = page.locator("details.paper")
    assert folded.count() == 1
    assert not folded.locator("table").is_visible()
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    page.emulate_media(media="print")
    assert folded.locator("table").is_visible()
    assert "backlash" in folded.inner_text()
    assert page.locator("details:not(.paper):visible").count() == 0


@pytest.mark.slow
def test_a_pdf_is_printed(file, tmp_path):
    try:
        find_chromium()
    except InputError as error:
        pytest.skip(str(error))
    printed = print_pdf(file, tmp_path / "report.pdf")
    content = printed.read_bytes()
    assert content.startswith(b"%PDF")
    # Pages with the figures as pictures, not empty boxes.
    assert len(content) > 200_000


@pytest.mark.slow
def test_a_picture_is_taken(file, tmp_path):
    try:
        find_chromium()
    except InputError as error:
        pytest.skip(str(error))
    taken = take_picture(file, tmp_path / "report.png", 800, 600)
    content = taken.read_bytes()
    assert content.startswith(b"\x89PNG")
    assert (int.from_bytes(content[16:20], "big"), int.from_bytes(content[20:24], "big")) == (800, 600)


def test_without_a_browser_one_line_says_what_to_do(monkeypatch, file, tmp_path):
    monkeypatch.setenv(VARIABLE, "no-such-browser")
    with pytest.raises(InputError, match=f"install chromium, name it in {VARIABLE}"):
        print_pdf(file, tmp_path / "report.pdf")
    monkeypatch.setenv(VARIABLE, "false")
    with pytest.raises(IdloopError, match="could not print"):
        print_pdf(file, tmp_path / "report.pdf")
