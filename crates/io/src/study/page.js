"use strict";
const study = JSON.parse(document.getElementById("data").textContent);
const element = (id) => document.getElementById(id);
const across = {
  seconds: ["seconds", (r) => r.seconds.median],
  elements: ["elements", (r) => r.elements],
  evaluations: ["exact evaluations", (r) => r.exact_evaluations],
  memory: ["bytes", (r) => r.memory_bytes],
};
const up = {
  rms: ["rms error / peak", (r) => r.error.rms],
  max: ["largest error / peak", (r) => r.error.max],
  penumbra_rms: ["rms error in penumbras / peak", (r) => r.error.penumbra_rms],
  penumbra_max: ["largest error in penumbras / peak", (r) => r.error.penumbra_max],
};
const meshers = [...new Set(study.series.map((s) => s.mesher))];
const degrees = [...new Set(study.series.map((s) => s.degree))].sort();
const colorOf = (mesher) => colors[study.series.findIndex((s) => s.mesher === mesher)];
const hidden = new Set();

function chip(key, label, color) {
  const box = document.createElement("input");
  box.type = "checkbox";
  box.checked = true;
  box.addEventListener("change", () => {
    if (box.checked) hidden.delete(key);
    else hidden.add(key);
    draw();
  });
  const all = document.createElement("label");
  all.className = "chip";
  all.append(box);
  if (color) {
    const line = document.createElement("i");
    line.style.background = color;
    all.append(line);
  }
  all.append(label);
  element("series").append(all);
}
for (const m of meshers) chip("m:" + m, m, colorOf(m));
for (const d of degrees) chip("d:" + d, "degree " + d);

const SVG = "http://www.w3.org/2000/svg";
function add(parent, name, attributes, text) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text !== undefined) made.textContent = text;
  parent.append(made);
  return made;
}
const tick = (k) => (k >= 0 && k < 4 ? String(10 ** k) : "1e" + k);

const tip = document.createElement("div");
tip.id = "tip";
tip.hidden = true;
document.body.append(tip);

function draw() {
  const [xName, xOf] = across[element("across").value];
  const [yName, yOf] = up[element("up").value];
  const [w, h, left, right, top, bottom] = [1000, 600, 80, 980, 20, 540];
  const shown = study.series.filter((s) => !hidden.has("m:" + s.mesher) && !hidden.has("d:" + s.degree));
  const runs = shown.flatMap((s) => s.runs).filter((r) => xOf(r) > 0 && yOf(r) > 0);
  const svg = document.createElementNS(SVG, "svg");
  svg.setAttribute("viewBox", `0 0 ${w} ${h}`);
  svg.setAttribute("role", "img");
  svg.setAttribute("aria-label", yName + " against " + xName);
  element("plot").replaceChildren(svg);
  if (runs.length === 0) {
    add(svg, "text", { x: left, y: 300 }, "nothing to show");
    return;
  }
  const range = (of) => {
    const logs = runs.map((r) => Math.log10(of(r)));
    const [low, high] = [Math.floor(Math.min(...logs)), Math.ceil(Math.max(...logs))];
    return [low, Math.max(high, low + 1)];
  };
  const [x0, x1] = range(xOf);
  const [y0, y1] = range(yOf);
  const px = (v) => left + ((right - left) * (Math.log10(v) - x0)) / (x1 - x0);
  const py = (v) => bottom - ((bottom - top) * (Math.log10(v) - y0)) / (y1 - y0);
  const place = (k, a, b) => a + (b - a) * k;
  for (let k = x0; k <= x1; k++) {
    const x = place((k - x0) / (x1 - x0), left, right);
    add(svg, "line", { x1: x, x2: x, y1: top, y2: bottom, stroke: "#ddd" });
    add(svg, "text", { x, y: bottom + 20, "text-anchor": "middle", "font-size": 13 }, tick(k));
  }
  for (let k = y0; k <= y1; k++) {
    const y = place((k - y0) / (y1 - y0), bottom, top);
    add(svg, "line", { x1: left, x2: right, y1: y, y2: y, stroke: "#ddd" });
    add(svg, "text", { x: left - 8, y: y + 4, "text-anchor": "end", "font-size": 13 }, tick(k));
  }
  add(svg, "text", { x: (left + right) / 2, y: h - 15, "text-anchor": "middle", "font-size": 15 }, xName);
  add(svg, "text", { x: -(top + bottom) / 2, y: 18, transform: "rotate(-90)", "text-anchor": "middle", "font-size": 15 }, yName);
  // The Pareto front of what is shown, in these axes.
  const isOnFront = (r) => !runs.some((o) => xOf(o) <= xOf(r) && yOf(o) <= yOf(r) && (xOf(o) < xOf(r) || yOf(o) < yOf(r)));
  const front = runs.filter(isOnFront).sort((a, b) => xOf(a) - xOf(b));
  add(svg, "polyline", {
    points: front.map((r) => px(xOf(r)) + "," + py(yOf(r))).join(" "),
    fill: "none", stroke: "#f0d060", "stroke-width": 9, "stroke-linejoin": "round", opacity: 0.6,
  });
  for (const s of shown) {
    const color = colorOf(s.mesher);
    const good = s.runs.filter((r) => xOf(r) > 0 && yOf(r) > 0);
    add(svg, "polyline", {
      points: good.map((r) => px(xOf(r)) + "," + py(yOf(r))).join(" "),
      fill: "none", stroke: color, "stroke-width": s.mesher.startsWith("discontinuity") ? 3 : 1.6,
      "stroke-dasharray": ["", "7 4", "", "2 3", "9 3 2 3"][s.degree] || "",
    });
    for (const r of good) {
      const dot = add(svg, "circle", { cx: px(xOf(r)), cy: py(yOf(r)), r: 2.5 + s.degree, fill: color, stroke: front.includes(r) ? "#000" : "none" });
      dot.addEventListener("mousemove", (event) => {
        tip.hidden = false;
        tip.style.left = Math.min(event.clientX + 12, innerWidth - 360) + "px";
        tip.style.top = event.clientY + 12 + "px";
        tip.textContent = `${s.mesher}, degree ${s.degree}, ${r.setting}: ${r.elements} elements, ${r.exact_evaluations} evaluations, ${r.seconds.median.toPrecision(3)} s (${r.seconds.min.toPrecision(3)} to ${r.seconds.max.toPrecision(3)}), rms ${r.error.rms.toExponential(2)}, largest ${r.error.max.toExponential(2)}`;
      });
      dot.addEventListener("mouseleave", () => { tip.hidden = true; });
    }
  }
}
element("controls").hidden = false;
for (const id of ["across", "up"]) element(id).addEventListener("change", draw);
draw();
document.addEventListener("DOMContentLoaded", () => {
  const edges = element("edges");
  if (edges) edges.addEventListener("change", () => document.body.classList.toggle("hide", !edges.checked));
});
