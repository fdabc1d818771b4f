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
}

async function take(files) {
  if (!files.length) return;
  await attempt(async () => {
    let first = "yes";
    // What was said of an earlier log is not true of this one.
    accepted = {};
    at("rate").value = "";
    at("signals").replaceChildren();
    at("signals-panel").hidden = at("begin-panel").hidden = true;
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
  at("picture").hidden = !found.picture;
  if (found.picture) at("picture").src = found.picture;
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
  showInspected(next.inspected);
  if (next.refused) throw new Error(next.refused);
}, "importing, inspecting and fitting"));
