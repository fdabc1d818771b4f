"use strict";
// Draws the figures, one after the other so that the page answers meanwhile, in the reader's light or dark.
(() => {
  const root = document.documentElement;
  const items = document.getElementById("figures").textContent;
  const palettes = JSON.parse(document.getElementById("palettes").textContent);
  const places = [...document.querySelectorAll("figure.plot")];
  Bokeh.set_log_level("warn");
  let drawn = [];
  let turn = 0;

  function coloured(theme) {
    if (theme === "light") return JSON.parse(items);
    let text = items;
    palettes.light.forEach((colour, i) => { text = text.replaceAll(`"${colour}"`, `"${palettes[theme][i]}"`); });
    return JSON.parse(text);
  }

  function clear() {
    for (const one of drawn) for (const view of one.views) view.remove();
    for (const place of places) place.replaceChildren();
    drawn = [];
  }

  // A finger scrolls the page; a mouse zooms in the figure.
  function leaveTouchAlone(view) {
    if (!matchMedia("(pointer: coarse)").matches) return;
    for (const model of view.model.document.all_models ?? []) {
      if (model.type === "Toolbar") for (const tool of model.tools) if (tool.active === true) tool.active = false;
    }
  }

  async function draw(theme) {
    const mine = ++turn;
    root.dataset.theme = theme;
    delete root.dataset.ready;
    clear();
    const all = coloured(theme);
    for (const place of places) {
      const item = all[place.dataset.place];
      if (!item) continue;
      const manager = await Bokeh.embed.embed_item(item, place);
      if (mine !== turn) return;
      const views = [...(manager.roots ?? manager)];
      for (const view of views) leaveTouchAlone(view);
      drawn.push({ place, views });
      await new Promise((go) => setTimeout(go, 0));
    }
    root.dataset.ready = "yes";
  }

  // Paper gets pictures: a figure that is drawn for the screen has the screen's width.
  function picture() {
    for (const { place, views } of drawn) {
      place.querySelectorAll(":scope > img").forEach((img) => img.remove());
      // Each figure of a column by itself, so that the column may go on on the next page.
      for (const view of views.flatMap((one) => (one.child_views?.length ? one.child_views : [one]))) {
        const { canvas } = view.export("png", true);
        if (!canvas.width || !canvas.height) continue;
        const img = document.createElement("img");
        img.alt = place.getAttribute("aria-label");
        img.src = canvas.toDataURL("image/png");
        place.append(img);
      }
    }
  }

  // What only a click shows on a screen, paper shows at once.
  const folded = () => document.querySelectorAll("details.paper");
  addEventListener("beforeprint", () => { for (const one of folded()) one.open = true; picture(); });
  document.getElementById("theme").addEventListener("click", () => draw(root.dataset.theme === "dark" ? "light" : "dark"));
  draw(matchMedia("(prefers-color-scheme: dark)").matches && !matchMedia("print").matches ? "dark" : "light");
})();
