"use strict";

const key = document.body.dataset.key;
const at = (id) => document.getElementById(id);

async function post(path, body) {
  const answer = await fetch(path, { method: "POST", headers: { "X-Idloop-Key": key }, body });
  const found = await answer.json().catch(() => ({ error: `the page answered ${answer.status}` }));
  if (found.error) throw new Error(found.error);
  return found;
}

async function attempt(work, text) {
  at("message").textContent = text;
  showInspected([]);
  for (const button of document.querySelectorAll("button")) button.disabled = true;
  try {
    await work();
    at("message").textContent = "";
  } catch (error) {
    at("message").textContent = error.message;
  }
  for (const button of document.querySelectorAll("button")) button.disabled = false;
  saySeen();
}

async function take(files) {
  if (!files.length) return;
  await attempt(async () => {
    let first = "yes";
    // What was said of an earlier log is not true of this one.
    accepted = {};
    at("rate").value = "";
    at("signals").replaceChildren();
    at("signals-panel").hidden = at("begin-panel").hidden = at("onward").hidden = true;
    for (const file of files) {
      const kept = await post(`file?name=${encodeURIComponent(file.name)}&first=${first}`, file);
      at("names").textContent = kept.files.join(", ");
      first = "";
    }
    await recognise({});
  }, "reading");
}

async function recognise(given) {
  const found = await post("recognise", JSON.stringify(given));
  if (!found.missing) accepted = given;
  // After a refusal what was changed stays in the table, to be corrected there.
  if (!found.missing || !document.querySelector("#signals tbody tr")) show(found);
  if (found.missing) throw new Error(found.missing);
  at("begin-panel").hidden = false;
}

// What the user has said of the log as it is shown.
let accepted = {};

function edited() {
  const said = { ...accepted };
  const rate = at("rate").value.trim();
  if (rate) said.rate = rate;
  else delete said.rate;
  for (const row of document.querySelectorAll("#signals tbody tr")) {
    const column = row.querySelector("select").value;
    const unit = row.querySelector("input").value.trim();
    if (row.dataset.column === column && row.dataset.unit === unit) continue;
    said[row.dataset.role] = column === "" ? "none" : unit ? `${column}=${unit}` : column;
  }
  return said;
}

function list(id, texts) {
  at(id).replaceChildren(...texts.map((text) => {
    const item = document.createElement("li");
    item.textContent = text;
    return item;
  }));
}

function showInspected(texts) {
  list("inspected", texts);
  at("inspected-panel").hidden = !texts.length;
}

// Every file with its name and its use; the choice needs no new reading.
function showPictures(pictures) {
  at("pictures").replaceChildren(...pictures.map((one) => {
    const figure = document.createElement("figure");
    const caption = document.createElement("figcaption");
    caption.append(Object.assign(document.createElement("b"), { textContent: one.name }));
    if (one.choice) {
      const use = document.createElement("select");
      use.setAttribute("aria-label", `use of ${one.name}`);
      use.dataset.file = one.name;
      use.append(new Option("to fit", "fit"), new Option("kept unseen, to judge the fit", "unseen"));
      use.value = one.unseen ? "unseen" : "fit";
      use.addEventListener("change", choose);
      caption.append(use);
    }
    const picture = Object.assign(document.createElement("img"), { src: one.picture, alt: `The signals of ${one.name} as they were read, over time` });
    figure.append(caption, picture);
    return figure;
  }));
  saySeen();
}

const uses = () => [...document.querySelectorAll("#pictures select")];

function choose() {
  const unseen = uses().filter((one) => one.value === "unseen").map((one) => one.dataset.file);
  if (unseen.length) accepted.unseen = unseen.join("\n");
  else delete accepted.unseen;
  saySeen();
}

function saySeen() {
  const unseen = uses().filter((one) => one.value === "unseen").length;
  at("unseen-words").textContent = !uses().length ? "" : unseen ? "" : "Every file is fitted. One that is kept unseen above shows what a fit is worth.";
  at("begin").disabled = uses().length > 0 && unseen === uses().length;
}

function show(found) {
  const table = at("signals");
  table.replaceChildren();
  const head = table.createTHead().insertRow();
  for (const text of ["signal", "column", "unit", "why"]) {
    const cell = document.createElement("th");
    cell.scope = "col";
    cell.textContent = text;
    head.append(cell);
  }
  const body = table.createTBody();
  for (const signal of found.signals) {
    const row = body.insertRow();
    Object.assign(row.dataset, { role: signal.role, column: signal.column, unit: signal.unit });
    row.insertCell().textContent = signal.role;
    const choice = document.createElement("select");
    choice.setAttribute("aria-label", `column of the ${signal.role}`);
    const turned = signal.role === "command" && found.turned ? [found.turned] : [];
    for (const name of new Set(["", ...found.columns, ...turned, signal.column])) choice.append(new Option(name || "none", name, false, name === signal.column));
    row.insertCell().append(choice);
    const unit = document.createElement("input");
    unit.value = signal.unit;
    unit.setAttribute("aria-label", `unit of the ${signal.role}`);
    row.insertCell().append(unit);
    row.insertCell().textContent = signal.reason;
  }
  list("notes", found.notes);
  list("doubts", found.doubts);
  showPictures(found.pictures);
  at("folder").textContent = found.folder;
  at("signals-panel").hidden = false;
}

at("files").addEventListener("change", (event) => take([...event.target.files]));
at("drop").addEventListener("dragover", (event) => { event.preventDefault(); at("drop").classList.add("over"); });
at("drop").addEventListener("dragleave", () => at("drop").classList.remove("over"));
at("drop").addEventListener("drop", (event) => {
  event.preventDefault();
  at("drop").classList.remove("over");
  take([...event.dataTransfer.files]);
});
// What is fitted is what is shown: a change is shown first.
for (const id of ["signals", "rate"]) at(id).addEventListener("input", () => { at("begin-panel").hidden = true; });
at("again").addEventListener("click", () => attempt(() => recognise(edited()), "reading"));
at("begin").addEventListener("click", () => attempt(async () => {
  const next = await post("begin", JSON.stringify(accepted));
  // With a fit the workbench shows it.
  if (next.address) location.assign(next.address);
  showBegun(next);
  if (next.refused) throw new Error(next.refused);
}, "importing, inspecting and fitting"));

function showBegun(next) {
  showInspected(next.inspected);
  at("onward").hidden = !next.address;
  if (next.address) at("workbench").href = next.address;
}

// What was done before the page was loaded again is still there.
(async () => {
  const kept = await fetch("state").then((answer) => answer.json()).catch(() => ({ files: [] }));
  if (!kept.files.length || !kept.found) return;
  at("names").textContent = kept.files.join(", ");
  accepted = kept.given;
  if (accepted.rate) at("rate").value = accepted.rate;
  show(kept.found);
  at("begin-panel").hidden = false;
  if (kept.begun) {
    showBegun(kept.begun);
    at("message").textContent = kept.begun.refused;
  }
})();
