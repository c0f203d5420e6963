"use strict";
// Without this script the page shows everything too: tabs, hiding and sliding are what it adds.

function element(name, attributes, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}

// Charts of one thing behind tabs.
for (const box of document.querySelectorAll(".tabs")) {
  const charts = [...box.children];
  if (charts.length < 2) continue;
  const buttons = charts.map((chart) =>
    element("button", { type: "button", role: "tab" }, chart.dataset.tab));
  const show = (chosen) => charts.forEach((chart, k) => {
    chart.style.display = k === chosen ? "" : "none";
    buttons[k].setAttribute("aria-selected", k === chosen);
  });
  buttons.forEach((button, k) => button.addEventListener("click", () => show(k)));
  box.prepend(element("div", { class: "tablist", role: "tablist" }, ...buttons));
  box.classList.add("tabbed");
  show(0);
}

// A chart: the nearest point is named, by pointer or arrow keys; its legend hides and shows groups.
for (const chart of document.querySelectorAll(".chart")) {
  const svg = chart.querySelector(".plot > svg");
  const tip = chart.querySelector(".tip");
  const points = [...svg.querySelectorAll(".point")].map((node) => {
    const title = node.querySelector("title");
    const words = title.textContent;
    title.remove(); // or the browser would show it as well
    return { node, words, x: Number(node.dataset.x), y: Number(node.dataset.y) };
  });
  let named = null;

  const visible = () => points.filter((p) => !p.node.parentNode.classList.contains("off"));
  const name = (point) => {
    if (named) named.node.classList.remove("named");
    named = point;
    tip.hidden = !point;
    if (!point) return;
    point.node.classList.add("named");
    tip.textContent = point.words;
    const scale = svg.clientWidth / svg.viewBox.baseVal.width;
    const left = point.x * scale, top = point.y * scale;
    const flip = left + 16 + tip.offsetWidth > svg.clientWidth;
    tip.style.left = `${Math.max(0, flip ? left - 12 - tip.offsetWidth : left + 12)}px`;
    tip.style.top = `${Math.max(0, Math.min(top - 12, svg.clientHeight - tip.offsetHeight))}px`;
  };
  svg.addEventListener("pointermove", (event) => {
    const box = svg.getBoundingClientRect();
    const scale = svg.viewBox.baseVal.width / box.width;
    const x = (event.clientX - box.left) * scale, y = (event.clientY - box.top) * scale;
    let nearest = null, least = 28;
    for (const point of visible()) {
      const away = Math.hypot(point.x - x, point.y - y);
      if (away < least) [nearest, least] = [point, away];
    }
    if (nearest !== named) name(nearest);
  });
  svg.addEventListener("pointerleave", () => name(null));
  svg.addEventListener("blur", () => name(null));
  svg.addEventListener("keydown", (event) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    event.preventDefault();
    const order = visible().sort((a, b) => a.x - b.x || a.y - b.y);
    const next = named ? order.indexOf(named) + step : step > 0 ? 0 : order.length - 1;
    name(order[Math.max(0, Math.min(next, order.length - 1))] ?? null);
  });
  for (const button of chart.querySelectorAll(".legend button")) {
    button.setAttribute("aria-pressed", "true");
    button.addEventListener("click", () => {
      const on = button.getAttribute("aria-pressed") !== "true";
      button.setAttribute("aria-pressed", on);
      for (const group of svg.querySelectorAll("[data-group]")) {
        if (group.dataset.group === button.dataset.group) group.classList.toggle("off", !on);
      }
      name(null);
    });
  }
}

// Two pictures over each other: the right one is cut where the border stands.
for (const box of document.querySelectorAll(".slider")) {
  const layers = [...box.querySelectorAll(".layers img")];
  const controls = box.querySelector(".controls"), stage = box.querySelector(".stage");
  const range = box.querySelector("input");
  const view = stage.querySelector(".window"), pair = stage.querySelector(".pair");
  const border = stage.querySelector(".border");
  const left = element("img", {}), right = element("img", {});
  const chosen = (side) => Number(controls.querySelector(`[data-side="${side}"]`).value);

  const place = () => {
    const part = range.value / range.max;
    border.style.left = `${100 * part}%`;
    const cut = view.scrollLeft + part * view.clientWidth;
    right.style.clipPath = `inset(0 0 0 ${cut}px)`;
  };
  const load = () => {
    for (const [image, side] of [[left, "left"], [right, "right"]]) {
      const layer = layers[chosen(side)];
      image.src = layer.src;
      image.alt = `${side}: ${layer.alt}`;
    }
  };
  const size = () => {
    const factor = chosen("size");
    const [wide, tall] = ["width", "height"].map((name) => Number(layers[0].getAttribute(name)));
    const fitted = Math.min(box.clientWidth, (0.8 * window.innerHeight * wide) / tall);
    const across = (view.scrollLeft + view.clientWidth / 2) / (pair.clientWidth || 1);
    const down = (view.scrollTop + view.clientHeight / 2) / (pair.clientHeight || 1);
    pair.style.width = `${factor ? factor * wide : fitted}px`;
    pair.classList.toggle("magnified", factor > 1);
    range.style.width = `${stage.clientWidth}px`;
    view.scrollLeft = across * pair.clientWidth - view.clientWidth / 2;
    view.scrollTop = down * pair.clientHeight - view.clientHeight / 2;
    place();
  };
  const drag = (event) => {
    if (!(event.buttons & 1)) return;
    const frame = view.getBoundingClientRect();
    const part = (event.clientX - frame.left) / view.clientWidth;
    if (part >= 0 && part <= 1) range.value = Math.round(part * range.max);
    place();
  };
  pair.append(left, right);
  left.draggable = right.draggable = false;
  for (const part of [controls, stage, range]) part.hidden = false;
  box.classList.add("sliding");
  range.addEventListener("input", place);
  view.addEventListener("scroll", place);
  view.addEventListener("pointerdown", drag);
  view.addEventListener("pointermove", drag);
  window.addEventListener("resize", size);
  controls.addEventListener("change", () => { load(); size(); });
  load();
  size();
}
