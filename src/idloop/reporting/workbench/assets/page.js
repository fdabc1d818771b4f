// The page around the figures: asks the server what it knows, says it in words, passes orders on.
// Figures come over Bokeh's own connection; this part works without it, the STOP button above all.
"use strict";
(() => {
  const PERIOD = 400; // milliseconds between two questions
  const ALONE = 20; // seconds over which a model of a live graph is left alone
  const PATIENCE = 4; // questions without an answer before the page says so
  const STOP_PATIENCE = 1000; // milliseconds that the stop's own server may take
  const FIRST = 2000; // milliseconds that the figures wait for the first picture of the strips
  const LONGEST = 4000; // milliseconds that an answer may take
  const COMPUTING = "being computed";
  const LEVELS = ["ok", "warning", "error", "silent"];
  const MANY = 3; // effects that tie from which on each gets less room, so that all are seen at once
  const UNEVEN = 250; // pixels by which columns must become more alike before a panel changes its side
  const SETTLED = 250; // milliseconds for which panels keep their height before they are balanced
  const LONG = 90; // letters from which on a verdict is read as text
  const FAILED = 2; // level of a check from which on the head says so
  // Texts for the states of the stop, and what the reader does about it.
  const BY_HAND = "The motor may still be driven: switch the drive off by hand.";
  const STOPS = {
    sent: ["Stop sent, not confirmed", BY_HAND],
    stopped: ["Motor stopped", "The last node before the motor has confirmed it, and it sends the neutral command until it is released."],
    releasing: ["Release sent, not confirmed", "The motor may move at any time."],
    unknown: ["Stop not confirmed", `The workbench does not answer. ${BY_HAND}`],
  };
  const $ = (id) => document.getElementById(id);
  const automatic = document.querySelectorAll("#automatic input");
  const base = new URL(".", location.href);
  const { key, run } = document.body.dataset;
  let state = null; // newest answer of the server
  let have = "";
  let failures = 0;
  let figuresLost = false; // Bokeh's connection is gone, and it does not come back by itself
  let awaited = false; // the reader has asked for an experiment that is not there yet
  let chosen = false; // the reader has chosen an error or a variable
  let telling = ""; // what the error and the variable that are open were chosen for
  let look = null; // the source over which both sides tell what is shown
  let shown = {};

  // -- small helpers ------------------------------------------------------------------------

  function make(tag, attributes = {}, ...children) {
    const one = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) {
      if (name === "onclick") one.addEventListener("click", value);
      else if (value === true) one.setAttribute(name, "");
      else if (value !== false && value != null) one.setAttribute(name, value);
    }
    one.append(...children.filter((child) => child != null));
    return one;
  }

  // Rebuilding what has not changed would take the focus away from the reader.
  const drawn = new Map();
  function render(id, content, build) {
    const text = JSON.stringify(content);
    if (drawn.get(id) === text) return;
    drawn.set(id, text);
    const focused = document.activeElement?.dataset?.focus;
    const open = [...$(id).querySelectorAll("details[open]")].map((one) => one.dataset.list);
    $(id).replaceChildren(...build());
    for (const one of $(id).querySelectorAll("details")) one.open = open.includes(one.dataset.list);
    if (focused) $(id).querySelector(`[data-focus="${CSS.escape(focused)}"]`)?.focus();
  }

  const say = (id, text) => { if ($(id).textContent !== text) $(id).textContent = text; };
  // -- orders -------------------------------------------------------------------------------

  let fading = 0;
  function note(text, bad) {
    clearTimeout(fading);
    if (!bad) fading = setTimeout(() => { $("note").hidden = true; }, 6000);
    $("note").hidden = false;
    $("note").classList.toggle("bad", Boolean(bad));
    $("note").firstElementChild.textContent = text;
  }

  async function post(path, body) {
    try {
      const response = await fetch(new URL(path, base), {
        method: "POST",
        headers: { "Content-Type": "application/json", "X-Idloop-Key": key },
        body: JSON.stringify(body ?? {}),
      });
      const answer = await response.json();
      if (!response.ok) {
        note(answer.refused ?? "The workbench refused the order.", true);
        taken(); // a choice that was refused is none
      }
    } catch {
      note("The order did not reach the workbench: it does not answer.", true);
    }
    ask();
  }
  // The model is left alone on the newest data, not on those of the last fit.
  function showModel(shown) {
    const alone = state?.live && shown === "free_run";
    choose(alone && view.follow ? { shown, span: Math.max(view.span, ALONE) } : { shown });
    if (alone) order("assess");
  }
  const order = (verb, what = "") => post("order", { verb, what });
  // The stop has a server of its own, which no other request holds up; where only the page's port is passed on (a tunnel),
  // the page's server takes it.
  async function stop() {
    const own = `http://${location.hostname}:${document.body.dataset.stopPort}/stop/${key}`;
    try {
      const response = await fetch(own, { method: "POST", credentials: "omit", signal: AbortSignal.timeout(STOP_PATIENCE) });
      if (!response.ok) throw new Error(String(response.status));
      ask();
    } catch {
      post("stop");
    }
  }

  // -- what is shown: the strips here, the figures by the server ------------------------------

  const view = { follow: false, span: ALONE, shown: "free_run", stretch: null };
  const TITLES = { one_step: "Measured and predicted one step ahead", free_run: "Measured and free run" };
  const strips = window.strips = new Strips($("strips"), base, (stretch) => choose({ follow: false, stretch }));
  strips.paintIn(document.body);
  let arranged = "";

  function choose(values) {
    for (const name of Object.keys(view)) if (name in values) view[name] = values[name];
    const rest = Object.fromEntries(Object.entries(values).filter(([name]) => !(name in view)));
    if (look !== null && Object.keys(rest).length) look.data = { json: [JSON.stringify({ ...JSON.parse(look.data.json[0]), ...rest })] };
    taken();
  }

  function taken() {
    if (look !== null) shown = JSON.parse(look.data.json[0]);
    if (shown.theme && document.body.className !== shown.theme) paint(shown.theme);
    say("theme", shown.theme === "dark" ? "Light" : "Dark");
    if (!state) return;
    $("follow").hidden = !state.live;
    const several = state.recordings;
    $("recording-label").hidden = several.length < 2;
    render("recording", several, () => several.map((name, index) => make("option", { value: String(index) }, name)));
    $("recording").value = String(state.shown);
    $("follow").setAttribute("aria-pressed", String(view.follow));
    say("follow", view.follow ? "Pause" : "Follow");
    $("follow").classList.toggle("primary", !view.follow);
    $("span").value = String(view.span);
    $("shown").value = view.shown;
    say("strips-title", TITLES[view.shown]);
    say("paper-recording", state.recordings[state.shown] ? `: ${state.recordings[state.shown]}` : "");
    const comparing = !state.live && !state.assessment && state.activity;
    say("given", comparing ? `The free run of the model is ${COMPUTING}.`
      : state.assessment && !state.assessment.current ? `Free run of the model before this step; the new one is ${COMPUTING}.`
      : view.shown === "free_run" ? "The model gets the command alone and begins at the measured state." : "");
    $("corrected").hidden = !state.live || view.shown !== "one_step";
    strips.show({ follow: view.follow ? view.span : null, stretch: view.stretch, shown: view.shown });
    showWhere(state);
    showLinear(state);
  }

  // A live graph is followed; of a recording everything is shown. The model is left alone in both: the view in which it is worst.
  function arrange(s) {
    const { outputs, input, followed, live } = s;
    const text = JSON.stringify([outputs, input, followed, live]);
    if (text === arranged) return;
    arranged = text;
    Object.assign(view, { follow: live, shown: "free_run", stretch: null });
    strips.arrange(outputs, input, followed);
  }

  // Bokeh's code takes as long to read as everything else together: strips and words come first.
  async function loadFigures() {
    const end = performance.now() + FIRST;
    while (!strips.pictures && performance.now() < end) await new Promise((resolve) => setTimeout(resolve, 10));
    for (const one of $("figures-code").content.querySelectorAll("script")) {
      if (/bokeh-(gl|tables|mathjax|widgets)/.test(one.src)) continue; // no figure needs them
      const script = make("script", Object.fromEntries([...one.attributes].map(({ name, value }) => [name, value])), one.textContent);
      const loaded = one.src && new Promise((resolve) => { script.onload = script.onerror = resolve; });
      document.body.append(script);
      await loaded;
    }
    connect();
  }

  function connect() {
    const found = window.Bokeh?.documents?.[0]?.get_model_by_name("look");
    if (!found) return setTimeout(connect, 50);
    look = found;
    Bokeh.documents[0].on_event("connection_lost", () => { figuresLost = true; });
    const stored = localStorage.getItem("idloop_theme");
    const wanted = stored ?? (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
    // Before anything is drawn: a figure that changes its colours is drawn a second time.
    setTheme(wanted, stored !== null);
    choose({ seen: document.visibilityState === "visible", near: [...near] });
    performance.mark("idloop-figures");
    document.body.dataset.ready = "true";
  }

  // Of a live graph a figure is drawn from when it has come near to sight; it stays from then on.
  const near = new Set();
  const sight = new IntersectionObserver((found) => {
    const come = found.filter((one) => one.isIntersecting);
    if (!come.length) return;
    for (const { target } of come) { near.add(target.dataset.figures); sight.unobserve(target); }
    choose({ near: [...near] });
  }, { rootMargin: "200px" });
  for (const one of document.querySelectorAll("main [data-figures]")) sight.observe(one);

  function setTheme(theme, keep) {
    if (keep) localStorage.setItem("idloop_theme", theme);
    document.cookie = `idloop_theme=${theme}; SameSite=Strict; path=${base.pathname}`;
    choose({ theme });
  }

  // -- the parts of the page ----------------------------------------------------------------

  // One number with what it is of; of a model that is gone there is none.
  function tile(one, pending) {
    return make("div", { class: `fit ${one.view === "force" ? "error" : ""}`, "data-output": one.view === "force" ? "force" : one.quantity, title: one.about },
      make("div", { class: "value" }, pending ? "…" : one.text),
      make("div", { class: "bar" }, make("i", { style: `width:${pending ? 0 : 100 * one.share}%` })),
      make("div", { class: "what" }, `${one.name}, ${pending ? COMPUTING : one.data}`),
      one.beside && !pending ? make("div", { class: "what", title: one.view === "force" ? one.about : "FIT of the prediction, in which the measurements correct the model until so many samples before." }, one.beside) : null);
  }

  function showHead(s) {
    say("band-words", s.band);
    say("title", `workbench · ${s.title}`);
    render("model", s.effects, () => s.effects.length
      ? [make("span", { class: "plain", style: "background:none;padding:0" }, "with"), ...s.effects.map((e) => make("span", {}, e))]
      : ["no effects added"]);
    render("fits", s.head, () => s.head.why ? [make("span", { class: "hint" }, s.head.why)] : [...s.head.scores.map((one) => tile(one, s.head.pending)), s.head.judged ? make("p", { class: "hint judged" }, s.head.judged) : null].filter(Boolean));
    $("fits").setAttribute("aria-busy", String(s.head.pending));
    $("stop").hidden = !s.moves;
    showStop(s.stop);
    const worst = s.health.filter((one) => one.level >= FAILED);
    $("state").className = `state ${worst.length || s.stop ? "bad" : s.live ? "running" : ""}`;
    $("state").title = worst.map((one) => `${one.name}: ${one.message}`).join("\n");
    say("state", s.stop ? STOPS[s.stop][0].toLowerCase() : worst.length === 1 ? `${worst[0].name.split(":")[0]}: ${LEVELS[worst[0].level]}`
      : worst.length ? `${worst.length} checks failed, see health` : s.live ? "live" : "recording");
    for (const one of document.querySelectorAll(".live-only")) one.hidden = !s.live;
    $("whole").hidden = s.live;
    const text = s.note ? JSON.stringify(s.note) : "";
    if (text && text !== drawn.get("note") ) { drawn.set("note", text); note(s.note.text, s.note.level > 0); awaited &&= s.note.level === 0; }
  }

  // "" while there is nothing to say; "unknown" when the workbench itself is silent.
  function showStop(stop) {
    $("stopped").hidden = !stop;
    if (!stop) return;
    $("stopped").dataset.stop = stop;
    say("stop-state", `${STOPS[stop][0]}.`);
    say("stop-text", STOPS[stop][1]);
    $("reset").hidden = stop === "releasing" || stop === "unknown";
  }

  // A live free run is looked at every few seconds: what is open stays open as long as it says as much as the rest.
  function worth(s, found) {
    const about = JSON.stringify(s.live ? s.effects : [s.version, s.shown]);
    const loud = ({ error, variable }) => found.maps.find((map) => map.name === error)?.loud.includes(variable);
    if (about === telling && found.maps.some((map) => map.name === shown.error) && (loud(shown) || !loud(found.telling))) return false;
    telling = about;
    return true;
  }

  function showWhere(s) {
    const found = s.assessment;
    $("error-label").hidden = !found?.maps.length;
    if (!found || !found.maps.length) {
      const comparing = Boolean(!s.live && s.activity);
      say("where-hint", s.live ? "The model is compared with the first seconds of data as soon as they are there." : comparing ? `The errors of the model are ${COMPUTING}.` : "");
      $("where-panel").setAttribute("aria-busy", String(comparing));
      for (const one of document.querySelectorAll("#variables button")) one.disabled = true;
      render("stretches", null, () => []);
      return;
    }
    if (!chosen && found.telling && look && (shown.error !== found.telling.error || shown.variable !== found.telling.variable) && worth(s, found)) {
      return choose(found.telling);
    }
    const map = found.maps.find((m) => m.name === shown.error) ?? found.maps[0];
    render("error", found.maps.map((m) => [m.name, m.rms, m.relative]), () =>
      found.maps.map((m) => make("option", { value: m.name }, `${m.name} (rms ${m.rms}${m.relative ? ", " + m.relative : ""})`)));
    $("error").value = map.name;
    // The figure may show a prediction where the free run has drifted away.
    const of = found.current ? "" : " of the model before this step";
    $("where-panel").setAttribute("aria-busy", String(!found.current));
    say("where-hint", `${found.current ? "" : `The present model is ${COMPUTING}. `}${map.kind[0].toUpperCase()}${map.kind.slice(1)}${of} on ${found.record}.`);
    for (const one of document.querySelectorAll("#variables button")) {
      const name = one.dataset.variable;
      const checked = name === (shown.variable || "velocity");
      one.disabled = !map.variables.includes(name);
      one.title = map.left_out[name] ?? "";
      one.setAttribute("aria-checked", String(checked));
      one.tabIndex = checked ? 0 : -1;
      one.classList.toggle("loud", map.loud.includes(name));
    }
    say("where-title", `Where the model fails: ${map.name}, ${map.kind}`);
    say("where-words", [map.why, map.along[shown.variable || "velocity"]].filter(Boolean).join(" "));
    render("stretches", [map.name, map.stretches], () => map.stretches.length ? [
      make("h3", {}, "Worst stretches: a click zooms to them"),
      ...map.stretches.map((one, index) => make("button", { type: "button", "data-focus": `stretch${index}`, onclick: () => zoom(one) },
        make("b", {}, String(index + 1)),
        make("span", {}, `${one.start.toFixed(2)} to ${one.stop.toFixed(2)} s: ${one.error} of the error in ${one.time} of the time `, make("small", {}, one.text)))),
    ] : [make("p", { class: "hint" }, "No stretch of time stands out.")]);
  }

  // Of the output whose error is looked at, or of that which says most, as the figures are.
  function showLinear(s) {
    const found = s.assessment;
    const of = (name) => found?.outputs.find((output) => output.name === name);
    const one = of(shown.error) ?? of(found?.output);
    $("frequency-panel").hidden = !found?.poles.length;
    $("residual-panel").hidden = !one?.tests;
    if (!found) return;
    for (const id of ["frequency-panel", "residual-panel"]) $(id).setAttribute("aria-busy", String(!found.current));
    const before = found.current ? "" : "Of the model before this step. ";
    say("residual-before", before.trim());
    say("frequency-hint", found.poles.length ? `${before}From the command to ${one.name}: the measurement and the free run of the model on ${found.record}, by the same estimator (Welch), which spreads what is weak beside what is strong alike in both. ${one.readable}` : "");
    say("poles", found.poles.length ? `Poles of the linear part: ${found.poles.join("; ")}.` : "");
    say("residual-words", one?.tests ? `The one-step error of ${one.name} on ${found.record} ${one.tests}.` : "");
  }

  // Two panels stand where the columns come out most alike; they stay where that gains little.
  function balance() {
    const panels = [$("frequency-panel"), $("residual-panel")];
    if (panels.some((one) => one.contains(document.activeElement))) return;
    const columns = [".wide", ".narrow"].map((name) => document.querySelector(name));
    const tall = columns.map((column) => [...column.children].reduce((sum, one) => (panels.includes(one) ? sum : sum + one.offsetHeight), 0));
    const uneven = (sides) => Math.abs(panels.reduce((by, one, i) => by + (sides[i] ? -1 : 1) * one.offsetHeight, tall[0] - tall[1]));
    const now = panels.map((one) => columns.indexOf(one.parentElement));
    const best = [[0, 0], [0, 1], [1, 0], [1, 1]].reduce((a, b) => (uneven(b) < uneven(a) ? b : a), now);
    if (uneven(now) - uneven(best) > UNEVEN) panels.forEach((one, i) => columns[best[i]].append(one));
  }

  // Whatever changes their height: words, a figure that is drawn, a list that is opened.
  let balancing = 0;
  const heights = new ResizeObserver(() => { clearTimeout(balancing); balancing = setTimeout(balance, SETTLED); });
  for (const one of document.querySelectorAll("main section")) heights.observe(one);

  function zoom(one) {
    const room = Math.max(one.stop - one.start, 0.05);
    choose({ follow: false, shown: "free_run", stretch: [one.start - room, one.stop + room] });
    $("strips-panel").scrollIntoView({ block: "start", behavior: "smooth" });
  }

  const VERDICTS = {
    adequate: "Nothing significant is missing.",
    unknown_structure: "Something is missing that is not in the catalogue.",
    not_excited: "Nothing significant is missing, but this data cannot show everything.",
  };

  function showMissing(s) {
    const m = s.missing;
    const verdict = $("verdict");
    verdict.className = "verdict";
    const beside = m ? m.candidates.filter((c) => !c.significant && c.fitted && c.below_level) : [];
    $("candidates").setAttribute("aria-busy", String(s.pending));
    if (!m || s.pending) say("verdict", s.activity || s.pending ? "" : (s.ladder?.steps.length ?? 0) > 1 ? "Added. Is anything still missing?" : "No diagnosis of this model yet.");
    else if (m.error) say("verdict", m.error);
    else if (m.verdict === "missing") {
      verdict.classList.add("found");
      say("verdict", m.pair.length ? `Missing, and only together: ${m.pair.join(" and ")}.`
        : m.tied.length > 1 ? `One of these ${m.tied.length} effects is missing; this data cannot tell which.` : `Missing: ${m.tied[0]}.`);
    } else {
      verdict.classList.add(m.verdict === "unknown_structure" || m.conclusion ? "open" : "good");
      const shape = m.verdict === "unknown_structure" ? m.unknown : "";
      const plain = beside.length ? VERDICTS[m.verdict]?.replace("Nothing significant", "Nothing worth adding") : VERDICTS[m.verdict];
      say("verdict", [m.conclusion || plain, shape].filter(Boolean).join(" ") || m.line);
    }
    verdict.classList.toggle("long", verdict.textContent.length > LONG);
    const over = m && m.verdict !== "missing" && beside.length ? `Significant by itself and not added: ${beside.map((c) => `${c.words}, because ${c.passed_over}`).join("; ")}.` : "";
    say("beside", m && s.pending ? "Found beside the model before this step." : [m?.elsewhere, over].filter(Boolean).join(" "));
    const busy = Boolean(s.activity);
    // While a recording is looked at, the search may wait for that; where a model is made, there is nothing to search yet.
    $("diagnose").disabled = busy && (s.live || Boolean(m) || Boolean(s.computing) || Boolean(s.activity.then) || s.activity.text.startsWith("looking"));
    $("diagnose").classList.toggle("primary", !m || m.verdict !== "missing");
    say("diagnose", m ? "Look again" : "Find what is missing");
    render("candidates", [m, busy], () => (m ? candidates(m, busy) : []));
    const cannot = m?.untestable ?? [];
    $("cannot").hidden = !cannot.length;
    const list = JSON.stringify([cannot, m?.basis]);
    if (drawn.get("cannot") !== list) {
      drawn.set("cannot", list);
      $("cannot").firstElementChild.textContent = `${m?.basis} ${cannot.length} effect${cannot.length > 1 ? "s" : ""}`;
      $("cannot").lastElementChild.replaceChildren(...cannot.map((c) => make("li", {}, make("b", {}, c.name), c.why ? `: ${c.why}` : "")));
    }
  }

  function candidates(m, busy) {
    const significant = m.candidates.filter((c) => c.significant);
    const others = m.candidates.filter((c) => !c.significant && c.fitted).slice(0, 8);
    const rest = m.candidates.filter((c) => !c.significant && !c.fitted && c.testable !== "no");
    const parts = [];
    const cards = significant.map((c) => card(c, busy, m, significant.length));
    if (cards.length > 1) {
      parts.push(make("div", { class: `tie${m.pair.length ? "" : " open"}${cards.length >= MANY ? " many" : ""}` }, make("p", {}, m.pair.length
        ? "Neither is significant alone; both together are" : ["A tie: they fit this data equally well", ...same(significant)].join(" · ")), ...cards,
        ...m.twins.map((one) => make("p", { class: "twins" }, `${one.text} By hand: ${one.checks.join(" ")}`))));
    } else parts.push(...cards);
    if (cards.length || others.length) parts.push(make("p", { class: "hint" }, `Shares are parts ${m.explains}.`));
    const also = others.filter((c) => c.below_level).length;
    if (others.length) parts.push(make("details", { "data-list": "fitted" }, make("summary", {}, also ? `${others.length} fitted and not chosen, ${notChosen(also, others.length)}` : `${others.length} fitted, not significant`), ...others.map((c) => card(c, busy, m))));
    if (rest.length) parts.push(make("details", { "data-list": "screened" }, make("summary", {}, `${rest.length} screened, no sign of them`),
      make("ul", {}, ...rest.map((c) => make("li", {}, make("b", {}, c.words), ` ${c.text} `, add(c, busy, m))))));
    return parts;
  }

  function notChosen(also, all) {
    const by = also > 1 ? "by themselves" : "by itself";
    return `${also < all ? `${also} of them` : all > 1 ? "all of them" : ""} significant ${by}`.trim();
  }

  // What is the same of all effects of a tie stands once, above them.
  const common = (all, part) => (all.every((c) => part(c) === part(all[0])) ? part(all[0]) : "");
  const same = (all) => [common(all, (c) => c.p), common(all, (c) => `each explains ${c.share}`)].filter(Boolean);

  function add(c, busy, m, tied = 1) {
    const pair = m.pair.length > 0 && c.best;
    return make("button", { type: "button", class: c.best ? "primary" : null, disabled: busy, "data-focus": `add ${c.name}`, "data-effect": c.name,
      onclick: () => order("add", c.name) }, pair ? "Add both" : c.best && tied < 2 ? "Add it" : "Add this one");
  }

  function card(c, busy, m, tied = 1) {
    const picture = c.picture ? drawing(c.picture) : null;
    const shared = tied > 1 && !m.pair.length ? same(m.candidates.filter((one) => one.significant)).join() : "";
    const own = [c.p, `explains ${c.share}`].filter((text) => !shared.includes(text));
    return make("div", { class: `card ${c.significant ? "significant" : "weak"} ${picture || c.fitted ? "" : "plain"}`, "data-candidate": c.name },
      picture ?? (c.fitted ? make("p", { class: "none" }, c.no_picture) : null),
      make("div", {}, make("h3", {}, c.words),
        make("div", { class: "numbers" }, ...[...own, ...c.parameters].filter(Boolean).flatMap((text, i) => [i ? " · " : "", make("span", {}, text)])),
        make("div", { class: "share" }, make("i", { style: `width:${Math.max(0, Math.min(100, 100 * c.explains))}%` }))),
      add(c, busy, m, tied),
      make("p", {}, c.text, c.replaces ? ` It takes the place of ${c.replaces}.` : "",
        c.passed_over ? ` Significant, but not chosen: ${c.passed_over}.` : ""));
  }

  function node(tag, attributes, text) {
    const one = document.createElementNS("http://www.w3.org/2000/svg", tag);
    for (const [name, value] of Object.entries(attributes)) one.setAttribute(name, value);
    if (text) one.textContent = text;
    return one;
  }

  function drawing(picture) {
    const svg = node("svg", { viewBox: "0 0 150 92", role: "img", "aria-label": `${picture.y} over ${picture.x}` });
    const xs = [...picture.curve, ...picture.data].map((p) => p[0]);
    const ys = [0, ...[...picture.curve, ...picture.data].map((p) => p[1])];
    const [x0, x1, y0, y1] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
    const px = (x) => (4 + (142 * (x - x0)) / (x1 - x0 || 1)).toFixed(1);
    const py = (y) => (73 - (55 * (y - y0)) / (y1 - y0 || 1)).toFixed(1);
    svg.append(node("title", {}, `${picture.y} over ${picture.x}: dots are what the data leave, the line is the fitted effect`));
    svg.append(node("line", { x1: 4, x2: 146, y1: py(0), y2: py(0) }));
    if (x0 < 0 && x1 > 0) svg.append(node("line", { x1: px(0), x2: px(0), y1: 18, y2: 73 }));
    for (const [x, y] of picture.data) svg.append(node("circle", { cx: px(x), cy: py(y), r: 1.7 }));
    svg.append(node("path", { d: picture.curve.map(([x, y], i) => `${i ? "L" : "M"}${px(x)} ${py(y)}`).join("") }));
    svg.append(node("text", { x: 2, y: 11 }, picture.y));
    svg.append(node("text", { x: 146, y: 87, "text-anchor": "end" }, picture.x));
    return svg;
  }

  function showActivity(s) {
    $("activity").hidden = !s.activity;
    if (!s.activity) return;
    $("activity").firstElementChild.textContent = s.activity.then ? `${s.activity.text}; then ${s.activity.then}` : s.activity.text;
    const bar = $("activity").lastElementChild;
    if (s.activity.share == null) bar.removeAttribute("value");
    else bar.value = s.activity.share;
  }

  function showLadder(s) {
    const steps = s.ladder?.steps ?? [];
    $("undo").disabled = steps.length < 2 || Boolean(s.activity);
    say("ladder-hint", steps.length ? s.ladder.data : `Each effect that is added becomes a step${s.live || s.recordings.some((one) => one.endsWith("(unseen)")) ? "; the error on unseen data says what it was worth" : ""}.`);
    render("beware", s.ladder?.beware ?? [], () => (s.ladder?.beware ?? []).map((text) => make("p", {}, text)));
    const scores = (all) => make("span", { class: "errors" }, ...all.map((score) => make("span", { "data-output": score.quantity, title: score.about }, make("small", {}, `${score.name} `), score.text)));
    const before = s.ladder?.given ? [make("li", { class: "given" }, make("span", {}, "as it was opened", make("small", {}, "before the fit")), scores(s.ladder.given))] : [];
    const next = s.computing ? [make("li", { class: "computing" }, make("span", {}, s.computing), make("span", { class: "errors" }, COMPUTING))] : [];
    render("steps", [steps, s.ladder?.given, s.computing], () => [...before, ...steps.map((one) => make("li", { "data-step": one.number },
      make("span", {}, one.words, one.by ? make("small", {}, one.by) : null, one.ties.length ? make("small", {}, `this data cannot distinguish it from ${one.ties.join(", ")}`) : null,
        one.parameters.length ? make("small", {}, one.parameters.join(" · ")) : null),
      scores(one.scores))), ...next]);
  }

  // The model itself: what its numbers are of.
  function showModelPanel(s) {
    render("equations", s.equations, () => s.equations.map((one) => {
      const math = make("div", { class: "math", tabindex: "0" });
      math.innerHTML = one.math;
      return make("div", { class: `equation ${one.new ? "new" : ""}` }, math, make("small", {}, [one.about, one.effect, one.new ? "new" : ""].filter(Boolean).join(", ")));
    }));
    const value = (one) => (s.pending && one.kind !== "known" ? COMPUTING : [one.value, one.unit].filter(Boolean).join("\u00a0"));
    const row = (one) => make("tr", { "data-parameter": one.key }, make("th", { scope: "row" }, one.name), make("td", { "data-label": "value (95 %)" }, value(one)),
      make("td", { "data-label": "bounds" }, one.bounds), make("td", { "data-label": "kind" }, s.pending && one.kind !== "known" ? "" : one.kind));
    render("parameters", [s.parameters, s.pending], () => s.parameters.map(row));
    say("version", s.version);
    say("reason", s.pending ? `: the next one is ${COMPUTING}` : s.reason ? `: ${s.reason}` : "");
    $("model-panel").setAttribute("aria-busy", String(s.pending));
    render("commands", s.commands, () => s.commands.map((text) => make("code", {}, text)));
    $("commands-block").hidden = !s.commands.length;
    say("commands-hint", s.downloaded ? "The same on the command line, beside the downloaded model.yaml:" : "The same on the command line:");
    render("inspected", s.inspected, () => s.inspected.map((text) => make("li", {}, text)));
    $("inspected-panel").hidden = !s.inspected.length;
    for (const one of document.querySelectorAll("[data-file]")) one.hidden = !s.files.includes(one.dataset.file);
  }

  // Key of a line of the evidence: colour, dashes and mark, as `idloop.reporting.figures` has them.
  const DASHES = ["", "10 4", "3 3", "10 3 3 3"];
  const MARKS = ["M-4 0a4 4 0 1 0 8 0a4 4 0 1 0 -8 0", "M-4 -4h8v8h-8z", "M0 -4L4 4H-4z", "M0 -5L4 0L0 5L-4 0z", "M0 4L4 -4H-4z", "M-4 0L-2 -4H2L4 0L2 4H-2z"];
  function lineKey(index) {
    const svg = node("svg", { viewBox: "-16 -6 32 12", class: "key", "aria-hidden": "true" });
    if (index == null) return svg;
    svg.style.color = `var(--series${index % 5})`;
    svg.innerHTML = `<path d="M-16 0H16" stroke="currentColor" stroke-width="2" stroke-dasharray="${DASHES[index % 4]}"/><path d="${MARKS[index % 6]}" fill="currentColor"/>`;
    return svg;
  }

  function showEvidence(s) {
    const e = s.evidence;
    $("evidence-panel").hidden = !e;
    if (!e) return;
    $("evidence-panel").setAttribute("aria-busy", String(!e.current));
    say("evidence-before", e.current ? "" : `Weighed beside the model before this step; new samples for the present one are ${COMPUTING}.`);
    say("evidence-line", [e.ended ? `The experiment was ended: ${e.ended}.` : "", `${e.line}.`].filter(Boolean).join(" "));
    say("evidence-hint", e.hint);
    $("evidence-numbers").hidden = !e.effects.length;
    render("evidence-effects", e.effects, () => e.effects.map((one) => make("tr", { "data-evidence": one.name },
      make("th", { scope: "row" }, lineKey(one.line), one.words), make("td", {}, one.log_e), make("td", {}, one.decided))));
    $("trust").hidden = !e.estimates.length;
    render("trust-rows", e.estimates, () => e.estimates.flatMap((one) => [
      make("tr", {}, make("th", { scope: "row" }, one.name), make("td", {}, one.text), make("td", {}, make("b", {}, one.trusted ? "yes" : "not yet"))),
      ...(one.why ? [make("tr", { class: "why" }, make("td", { colspan: "3" }, one.why))] : []),
    ]));
  }

  function showExperiment(s) {
    const m = s.missing;
    const tied = m && m.separable;
    // One that was looked for and not found is not offered again.
    const futile = s.suggested && !s.suggested.signal;
    const open = !futile && (tied || m?.verdict === "not_excited");
    $("onward").hidden = !open;
    const aim = tied ? "that tells them apart" : "that shows more";
    say("experiment", s.live ? `Run the experiment ${aim} …` : `Work out the experiment ${aim}`);
    $("experiment").disabled = Boolean(s.activity || s.stop);
    say("onward-words", s.activity && s.automatic?.includes("experiment") ? "The graph runs it automatically, see the box below." : s.live ? "It moves the motor: you see the limits and the predicted motion first." : "It says what to send in, and what each effect would show.");
    $("experiment-panel").hidden = !s.suggested;
    if (s.suggested && awaited && !s.activity) {
      awaited = false;
      $("experiment-panel").scrollIntoView({ block: "start", behavior: s.live ? "instant" : "smooth" });
      if (s.live && s.suggested.motion.length) confirmed("experiment");
    }
    say("experiment-signal", s.suggested?.signal ?? "");
    say("experiment-text", s.suggested?.text ?? "");
    say("experiment-title", futile ? "No experiment decides it" : "The next experiment");
    $("experiment-hint").hidden = s.live || Boolean(futile);
    const motion = s.suggested?.motion ?? [];
    const ranges = () => motion.map((one) => make("tr", { class: one.outside ? "outside" : null }, make("th", { scope: "row" }, one.name), make("td", {}, one.range),
      make("td", {}, one.limit, one.inside ? make("small", {}, "kept") : one.outside ? make("small", {}, "not kept") : null)));
    for (const id of ["motion", "predicted"]) render(id, motion, ranges);
    $("motion-table").hidden = !motion.length;
    render("outcomes", s.suggested?.outcomes ?? [], () => (s.suggested?.outcomes ?? []).map((text) => make("li", {}, text)));
    render("limits", s.limits, () => s.limits.map((one) => make("tr", {}, make("th", { scope: "row" }, one.name), make("td", {}, one.value))));
  }

  function showAutomatic(s) {
    $("automatic").hidden = s.automatic == null;
    for (const one of automatic) one.checked = s.automatic?.includes(one.dataset.automatic) ?? false;
  }

  // Whatever moves the motor is asked once, with the limits beside it.
  const QUESTIONS = {
    experiment: ["The motor will move", "The excitation will run the experiment that separates the effects in question, within these limits:", "Run the experiment"],
    automatic: ["The motor will move by itself", "Wherever effects tie, the excitation will run an experiment without asking again, within these limits:", "Let it run experiments"],
  };
  let asked = []; // the order that waits for its answer
  function confirmed(verb, what = "") {
    asked = [verb, what];
    $("predicted-table").hidden = verb !== "experiment" || !state.suggested?.motion.length;
    [$("confirm-title").textContent, $("confirm-text").textContent, $("confirm-yes").textContent] = QUESTIONS[verb];
    $("confirm").showModal();
  }

  function showHealth(s) {
    $("health-panel").hidden = !s.health.length;
    render("health", s.health, () => s.health.map((one) => make("tr", {},
      make("td", {}, one.name),
      make("td", { title: Object.entries(one.values).map(([k, v]) => `${k}: ${v}`).join("\n") },
        make("span", { class: `level level${one.level}` }, `${LEVELS[one.level]} `), one.message,
        one.trouble.length ? make("small", {}, one.trouble.join(", ")) : null))));
  }

  function show(s) {
    showHead(s);
    arrange(s);
    taken();
    showActivity(s);
    showMissing(s);
    showEvidence(s);
    showLadder(s);
    showModelPanel(s);
    showExperiment(s);
    showAutomatic(s);
    showHealth(s);
    $("reference-legend").hidden = !strips.values("reference").length;
    document.body.dataset.version = String(s.change);
    document.body.dataset.model = s.version;
    document.body.dataset.looks = String(s.looks);
  }

  // -- the server ---------------------------------------------------------------------------

  let asking = false;
  // The first answer comes with the page.
  function take(answer) {
    if (state === null) performance.mark("idloop-words");
    have = `${answer.run}:${answer.change}`;
    state = answer;
    show(state);
  }

  async function ask() {
    if (asking) return;
    asking = true;
    try {
      const response = await fetch(new URL(`state?have=${encodeURIComponent(have)}`, base), { cache: "no-store", signal: AbortSignal.timeout(LONGEST) });
      if (!response.ok) throw new Error(String(response.status));
      const answer = await response.json();
      if (answer.run !== run) return location.reload(); // another run of the server
      if (figuresLost) return location.reload();
      if (failures >= PATIENCE) {
        $("lost").hidden = true;
        strips.wire.renew();
        if (state) showHead(state);
      }
      failures = 0;
      if ("title" in answer) take(answer);
    } catch {
      failures += 1;
      if (failures >= PATIENCE) {
        $("lost").hidden = false;
        if (state?.stop) showStop("unknown");
        $("state").className = "state bad";
        say("state", "connection lost");
      }
    } finally {
      asking = false;
    }
  }

  // On paper nothing unfolds: what the data cannot show is said there. It is light, and gets pictures of the figures, which
  // have the width and the colours of the screen.
  let folded = false, before = "light";
  function paint(theme) {
    document.body.className = theme;
    strips.paintIn(document.body);
  }
  addEventListener("beforeprint", () => {
    folded = !$("cannot").open;
    $("cannot").open = true;
    before = document.body.className;
    for (const view of window.Bokeh?.index ?? []) {
      for (const figure of view.child_views ?? []) {
        const { canvas } = figure.export("png", true);
        if (canvas.width && canvas.height) document.querySelector(`[data-figures="${view.model.name}"]`)?.append(make("img", { src: canvas.toDataURL("image/png"), class: before, alt: "" }));
      }
    }
    paint("light");
    strips.paper();
  });
  addEventListener("afterprint", () => {
    if (folded) $("cannot").open = false;
    for (const one of document.querySelectorAll("[data-figures] > img")) one.remove();
    paint(before);
  });
  // A page in the background draws nothing, and the server sends it nothing.
  document.addEventListener("visibilitychange", () => choose({ seen: document.visibilityState === "visible" }));
  addEventListener("keydown", (event) => {
    if (event.key !== "Escape" || !state?.moves || event.repeat) return;
    $("confirm").close();
    event.preventDefault();
    stop();
  }, { capture: true });
  $("stop").addEventListener("click", stop);
  $("reset").addEventListener("click", () => order("reset"));
  $("diagnose").addEventListener("click", () => order("diagnose"));
  $("undo").addEventListener("click", () => order("undo"));
  $("assess").addEventListener("click", () => order("assess"));
  $("experiment").addEventListener("click", () => {
    if (state.live && state.suggested?.motion.length) return confirmed("experiment");
    awaited = true;
    order(state.live ? "design" : "experiment");
  });
  $("confirm-no").addEventListener("click", () => $("confirm").close());
  $("confirm-yes").addEventListener("click", () => { $("confirm").close(); order(...asked); });
  for (const one of automatic) {
    one.addEventListener("change", () => {
      const [what, on] = [one.dataset.automatic, one.checked];
      one.checked = !on; // it shows what the graph does, not what was asked of it
      if (what === "experiment" && on) confirmed("automatic", "experiment on");
      else order("automatic", `${what} ${on ? "on" : "off"}`);
    });
  }
  $("note").lastElementChild.addEventListener("click", () => { $("note").hidden = true; });
  $("theme").addEventListener("click", () => setTheme(shown.theme === "dark" ? "light" : "dark", true));
  $("follow").addEventListener("click", () => choose({ follow: !view.follow, stretch: [strips.start, strips.stop] }));
  $("recording").addEventListener("change", () => order("show", $("recording").value));
  $("whole").addEventListener("click", () => choose({ follow: false, stretch: null }));
  $("zoom-out").addEventListener("click", () => strips.zoom(2));
  $("save").addEventListener("click", () => strips.save("workbench.png",
    [`${state.title}: ${TITLES[view.shown].toLowerCase()}`, state.recordings[state.shown], state.version && `model ${state.version}`].filter(Boolean).join(", "),
    [...document.querySelectorAll(".legend li:not([hidden])")].map((one) => [one.firstElementChild.className.split(" ").at(-1), one.textContent])));
  $("span").addEventListener("change", () => choose({ span: Number($("span").value), follow: true }));
  $("shown").addEventListener("change", () => showModel($("shown").value));
  $("alone").addEventListener("click", () => { showModel("free_run"); $("shown").focus(); });
  $("error").addEventListener("change", () => { chosen = true; choose({ error: $("error").value }); });
  const tabs = [...document.querySelectorAll("#variables button")];
  for (const one of tabs) {
    one.addEventListener("click", () => { chosen = true; choose({ variable: one.dataset.variable }); });
    one.addEventListener("keydown", (event) => {
      const by = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
      const open = tabs.filter((tab) => !tab.disabled);
      if (!by || !open.includes(one)) return;
      event.preventDefault();
      const next = open[(open.indexOf(one) + by + open.length) % open.length];
      next.focus();
      next.click();
    });
  }
  take(JSON.parse($("first-state").textContent));
  setInterval(ask, PERIOD);
  loadFigures();
})();
