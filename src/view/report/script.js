// Charts: zoom, cursors, values and CSV. Without this script a page shows all charts unchanged. Every value is read from the lines:
// whole units from the upper left corner of the plot, with the ends of both axes beside them.
(() => {
  "use strict";
  const SVG = document.querySelector("svg").namespaceURI;
  const charts = [];
  let cursors = []; // test times, at most two
  const make = (name, attributes, text) => {
    const one = document.createElementNS(SVG, name);
    for (const [key, value] of Object.entries(attributes)) one.setAttribute(key, value);
    if (text !== undefined) one.textContent = text;
    return one;
  };
  const rounded = (v, digits) => (Number.isFinite(v) ? String(Number(v.toPrecision(digits))).replace("-", "−") : "–");

  /** An axis: ends, place of a value in 0..1 and back, words, unit and divisor. */
  function axis(text) {
    const [lo, hi, log, words, unit, factor] = JSON.parse(text);
    const to = log ? Math.log10 : (v) => v;
    const back = log ? (v) => 10 ** v : (v) => v;
    const [a, b] = [to(lo), to(hi)];
    return {
      lo, hi, log, words, unit, factor,
      place: (v) => (to(v) - a) / (b - a),
      value: (share) => back(a + share * (b - a)),
      show: (v, digits = 5) => rounded(v / factor, digits) + (unit ? ` ${unit}` : ""),
    };
  }

  /** The points of a path, NaN where the line is broken; of bars the left edge and the height. */
  function points(path, chart) {
    const { x, y, width, height } = chart;
    const all = [];
    let [px, py] = [0, 0];
    for (const [, run, dot] of path.getAttribute("d").matchAll(/m([^mh]*)(h0)?/g)) {
      if (all.length > 0 && !dot) all.push([NaN, NaN]);
      const numbers = run.match(/-?\d+/g).map(Number);
      for (let i = 0; i < numbers.length; i += 2) {
        [px, py] = [px + numbers[i], py + numbers[i + 1]];
        all.push([x.value(px / width), y.value(1 - py / height)]);
      }
    }
    return path.dataset.bars === undefined ? all : all.filter((p, i) => i % 5 === 1);
  }

  /** Round numbers between the ends of an axis. */
  function ticks(lo, hi, about) {
    const raw = (hi - lo) / about;
    const decade = 10 ** Math.floor(Math.log10(raw));
    const step = decade * ([1, 2, 5].find((d) => d * decade >= raw) ?? 10);
    const found = [];
    for (let k = Math.ceil(lo / step); k * step <= hi; k += 1) found.push(k * step);
    return found;
  }

  function label(chart) {
    const { figure, lines, x, y, range } = chart;
    const [left, top, w, h] = ["x", "y", "width", "height"].map((name) => Number(lines.getAttribute(name)));
    for (const [name, of, [lo, hi], about] of [["across", x, range[0], w / 90], ["up", y, range[1], h / 45]]) {
      const group = figure.querySelector(`.ticks.${name}`);
      if (of.log) continue;
      group.replaceChildren();
      for (const at of ticks(lo / of.factor, hi / of.factor, Math.max(2, about))) {
        const share = (at * of.factor - lo) / (hi - lo);
        const words = rounded(at, 10);
        if (name === "across") {
          const px = left + share * w;
          group.append(make("line", { class: "l-grid", x1: px, x2: px, y1: top, y2: top + h + 5 }));
          group.append(make("text", { class: "f-soft", x: px, y: top + h + 14, dy: ".35em", "font-size": 12, "text-anchor": "middle" }, words));
        } else {
          const py = top + (1 - share) * h;
          group.append(make("line", { class: "l-grid", x1: left, x2: left + w, y1: py, y2: py }));
          group.append(make("text", { class: "f-soft", x: left - 7, y: py, dy: ".35em", "font-size": 12, "text-anchor": "end" }, words));
        }
      }
    }
  }

  /** Fits a wide history into a narrow page: a shorter time axis, and the legend below the title. */
  function fit(chart) {
    const { figure, svg, lines } = chart;
    const [, , wide, high] = svg.getAttribute("viewBox").split(" ").map(Number);
    const room = figure.clientWidth / 0.8;
    if (!chart.isHistory || figure.clientWidth === 0 || room > 0.7 * wide) return;
    const [left, w] = ["x", "width"].map((name) => Number(lines.getAttribute(name)) + (name === "x" ? 0 : room - wide));
    svg.setAttribute("viewBox", `0 0 ${room} ${high}`);
    svg.style.setProperty("--drawn", room);
    lines.setAttribute("width", w);
    figure.querySelector(".foot line").setAttribute("x2", left + w);
    figure.querySelector(".foot text").setAttribute("x", left + w / 2);
    const legend = figure.querySelector(".legend");
    const first = legend?.firstElementChild;
    if (first && Number(first.getAttribute("y1")) < 20) legend.setAttribute("transform", `translate(${2 - 0.92 * Number(first.getAttribute("x1"))} 14) scale(.92 1)`);
    figure.querySelector(".names")?.remove();
    chart.drawn = undefined;
    label(chart);
  }

  const isWhole = (chart) => chart.range[0][0] === chart.x.lo && chart.range[0][1] === chart.x.hi && chart.range[1][0] === chart.y.lo && chart.range[1][1] === chart.y.hi;

  /** Shows a range of a chart; of a history the values in it decide its height. */
  function show(chart, [lo, hi], up) {
    const { x, y, width, height, lines } = chart;
    [lo, hi] = [Math.max(lo, x.lo), Math.min(hi, x.hi)];
    if (!(hi - lo > (x.hi - x.lo) * 1e-5)) return;
    let ends = up ?? [y.lo, y.hi];
    if (chart.isHistory && !y.log && !(lo === x.lo && hi === x.hi)) {
      const seen = chart.series.flatMap((one) => one.points.filter(([px]) => px >= lo && px <= hi).map(([, py]) => py));
      const [a, b] = seen.reduce(([a, b], v) => [Math.min(a, v), Math.max(b, v)], [Infinity, -Infinity]);
      const air = 0.06 * (b - a) || (y.hi - y.lo) * 0.01;
      if (b >= a) ends = [a - air, b + air];
    }
    chart.range = [[lo, hi], ends];
    const [x0, x1, y0, y1] = [x.place(lo) * width, x.place(hi) * width, (1 - y.place(ends[1])) * height, (1 - y.place(ends[0])) * height];
    lines.setAttribute("viewBox", `${x0} ${y0} ${x1 - x0} ${y1 - y0}`);
    if (isWhole(chart) && chart.drawn) chart.figure.querySelectorAll(".ticks").forEach((one, i) => one.replaceChildren(...chart.drawn[i]));
    else label(chart);
    chart.figure.classList.toggle("zoomed", !isWhole(chart));
    place(chart);
  }

  /** Zooms a chart, and all histories with one of them. */
  function zoom(chart, range, up) {
    for (const one of chart.isHistory ? charts.filter((c) => c.isHistory) : [chart]) show(one, range ?? [one.x.lo, one.x.hi], range ? up : undefined);
  }

  /** Value of a series at a place: straight between its points. */
  function at(series, t) {
    const all = series.points;
    for (let i = 1; i < all.length; i += 1) {
      const [[a, p], [b, q]] = [all[i - 1], all[i]];
      if (t >= a && t <= b) return b === a ? q : p + ((q - p) * (t - a)) / (b - a);
    }
    return NaN;
  }

  /** Cursor lines of a chart, and the values at them. */
  function place(chart, pointer) {
    const { x, y, width, height, lines, read } = chart;
    lines.querySelectorAll(".cursor").forEach((one) => one.remove());
    if (!chart.isHistory && !chart.isCurve) {
      read.textContent = pointer === undefined ? "" : `${x.words} ${x.show(pointer[0], 4)}, ${y.words} ${y.show(pointer[1], 4)}`;
      return;
    }
    const set = chart.isHistory ? cursors : [];
    const times = set.length > 0 ? set : pointer === undefined ? [] : [pointer[0]];
    for (const t of times.filter((t) => t >= x.lo && t <= x.hi)) {
      lines.append(make("path", { class: "cursor", d: `M${x.place(t) * width} ${-height}V${2 * height}` }));
    }
    const where = times.map((t) => x.show(t, 8)).join(" → ");
    const values = chart.series.map((one) => {
      const found = times.map((t) => at(one, t));
      const apart = found.length === 2 ? ` (Δ ${y.show(found[1] - found[0])})` : "";
      return `${one.name} ${found.map((v) => y.show(v)).join(" → ")}${apart}`;
    });
    const apart = times.length === 2 ? ` (Δ ${x.show(times[1] - times[0])})` : "";
    read.textContent = times.length === 0 ? "" : `${x.words} ${where}${apart}: ${values.join("; ")}`;
  }
  const placeAll = (chart, pointer) => (chart.isHistory ? charts.filter((c) => c.isHistory) : [chart]).forEach((one) => place(one, pointer));

  function save(chart) {
    const unit = (of, words) => `"${words}${of.unit ? ` (${of.unit})` : ""}"`;
    const rows = chart.series.flatMap((one) =>
      one.points.map(([px, py]) => [`"${one.name}"`, ...[px / chart.x.factor, py / chart.y.factor].map((v) => (Number.isFinite(v) ? Number(v.toPrecision(8)) : ""))].join(",")));
    const text = [["series", unit(chart.x, chart.x.words), unit(chart.y, chart.y.words)].join(","), ...rows].join("\n");
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([`${text}\n`], { type: "text/csv" }));
    link.download = `${chart.figure.querySelector("svg").getAttribute("aria-label").replace(/[^\p{L}\p{N}]+/gu, "-")}.csv`;
    link.click();
    URL.revokeObjectURL(link.href);
  }

  /** Zooms about the middle, or moves, by shares of the range. */
  function step(chart, wider, moved) {
    const by = ([lo, hi], moved) => [lo + (moved + (1 - wider) / 2) * (hi - lo), hi + (moved - (1 - wider) / 2) * (hi - lo)];
    const range = by(chart.range[0], moved);
    if (wider > 1 && range[1] - range[0] >= chart.x.hi - chart.x.lo) return zoom(chart);
    if (moved !== 0 && (range[0] < chart.x.lo || range[1] > chart.x.hi)) return undefined;
    return zoom(chart, range, by(chart.range[1], 0));
  }
  const KEYS = { ArrowLeft: [1, -0.2], ArrowRight: [1, 0.2], "+": [0.5, 0], "=": [0.5, 0], "-": [2, 0] };

  function listen(chart) {
    const { figure, svg, lines } = chart;
    let from;
    const where = (event) => {
      const [left, top, w, h] = ["x", "y", "width", "height"].map((name) => Number(lines.getAttribute(name)));
      const outer = svg.getBoundingClientRect();
      const scale = outer.width / svg.viewBox.baseVal.width;
      const share = [(event.clientX - outer.left - left * scale) / (w * scale), 1 - (event.clientY - outer.top - top * scale) / (h * scale)];
      const [vx, vy] = lines.getAttribute("viewBox").split(" ").reduce((v, n, i) => { v[i % 2].push(Number(n)); return v; }, [[], []]);
      const [sx, sy] = share.map((s) => Math.min(1, Math.max(0, s)));
      return [chart.x.value((vx[0] + sx * vx[1]) / chart.width), chart.y.value(1 - (vy[0] + (1 - sy) * vy[1]) / chart.height)];
    };
    svg.addEventListener("pointerdown", (event) => { if (event.button === 0) from = where(event); });
    svg.addEventListener("pointermove", (event) => {
      const to = where(event);
      lines.querySelectorAll(".drag").forEach((one) => one.remove());
      placeAll(chart, to);
      if (from === undefined || event.buttons === 0) return;
      const [a, b] = [from, to].map(([px]) => chart.x.place(px) * chart.width);
      const [c, d] = chart.isHistory ? [-chart.height, 2 * chart.height] : [from, to].map(([, py]) => (1 - chart.y.place(py)) * chart.height);
      lines.append(make("rect", { class: "drag", x: Math.min(a, b), width: Math.abs(b - a), y: Math.min(c, d), height: Math.abs(d - c) }));
    });
    svg.addEventListener("pointerup", (event) => {
      lines.querySelectorAll(".drag").forEach((one) => one.remove());
      if (from === undefined) return;
      const to = where(event);
      const sorted = (i) => [from[i], to[i]].sort((a, b) => a - b);
      const span = Math.abs(chart.x.place(to[0]) - chart.x.place(from[0]));
      if (span > 0.01 * (chart.x.place(chart.range[0][1]) - chart.x.place(chart.range[0][0]))) zoom(chart, sorted(0), sorted(1));
      else if (chart.isHistory && event.detail < 2) {
        cursors = cursors.length === 1 ? [cursors[0], to[0]].sort((a, b) => a - b) : [to[0]];
        placeAll(chart);
      }
      from = undefined;
    });
    svg.addEventListener("pointerleave", () => { from = undefined; placeAll(chart); });
    svg.addEventListener("dblclick", () => { cursors = []; zoom(chart); });
    figure.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.altKey || event.metaKey) return;
      if (event.key in KEYS) step(chart, ...KEYS[event.key]);
      else if (event.key === "0") zoom(chart);
      else if (event.key === "Escape") { cursors = []; placeAll(chart); }
      else return;
      event.preventDefault();
    });
  }

  for (const lines of document.querySelectorAll("figure svg.lines")) {
    const [svg, figure] = [lines.parentElement, lines.closest("figure")];
    const [, , width, height] = lines.getAttribute("viewBox").split(" ").map(Number);
    const [x, y] = [axis(lines.dataset.x), axis(lines.dataset.y)];
    const chart = { figure, svg, lines, x, y, width, height, range: [[x.lo, x.hi], [y.lo, y.hi]], isHistory: figure.classList.contains("history") };
    chart.series = [...lines.querySelectorAll("path[data-name]")].map((path) => ({ name: path.dataset.name, points: points(path, chart) }));
    const rises = ({ points: all }) => all.length > 1 && all.every(([px], i) => i === 0 || !(px < all[i - 1][0]));
    chart.isCurve = chart.series.every(rises);
    chart.drawn = [...figure.querySelectorAll(".ticks")].map((one) => [...one.childNodes]);
    svg.tabIndex = 0;
    const tools = document.createElement("div");
    tools.className = "tools";
    for (const [words, name, act] of [
      ["+", "Zoom in", () => step(chart, 0.5, 0)],
      ["−", "Zoom out", () => step(chart, 2, 0)],
      ["Whole", "Show everything", () => { cursors = []; zoom(chart); }],
      ["CSV", "Save the values of this chart", () => save(chart)],
    ]) {
      const button = document.createElement("button");
      [button.type, button.textContent, button.title] = ["button", words, name];
      button.setAttribute("aria-label", name);
      button.addEventListener("click", act);
      tools.append(button);
    }
    chart.read = document.createElement("p");
    chart.read.className = "read";
    chart.read.setAttribute("aria-live", "polite");
    svg.after(chart.read, tools);
    charts.push(chart);
    listen(chart);
    fit(chart);
    figure.closest("details")?.addEventListener("toggle", () => fit(chart));
  }
  addEventListener("beforeprint", () => { cursors = []; charts.forEach((chart) => zoom(chart)); });
  document.documentElement.classList.add("scripted");
})();
