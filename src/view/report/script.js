// Makes the histories of a page zoomable, all together. Without this script the pictures stand as they are.
(() => {
  "use strict";
  const root = document.documentElement;
  const plots = [];
  const cursor = uPlot.sync("time");
  const colour = (name) => getComputedStyle(root).getPropertyValue(name).trim();
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
  const gaps = (values) => Array.from(values, (v) => (Number.isFinite(v) ? v : null));
  const rounded = (v, digits) =>
    v === null || v === undefined ? "–" : String(Number(v.toPrecision(digits))).replace("-", "−");
  const digits = (v) => rounded(v, 5);
  // A moment is told apart from the next tick's, also late in a long test.
  const moment = (t) => rounded(t, 10);
  let range = null;
  let moving = false;

  function times(time) {
    if (time.values) return Array.from(new Float64Array(bytes(time.values)));
    const all = [];
    let place = 0;
    let [apart, weight] = [0, 1];
    for (const byte of new Uint8Array(bytes(time.apart))) {
      apart += (byte & 127) * weight;
      weight *= 128;
      if (byte & 128) continue;
      place += apart;
      [apart, weight] = [0, 1];
      all.push(time.start + place * time.step);
    }
    return all;
  }

  /** One column of times and one of values for each series: straight between its own points. */
  function columns(series) {
    const own = series.map((s) => [times(s.time), gaps(new Float32Array(bytes(s.y)))]);
    if (own.length === 1) return own[0];
    const all = Array.from(new Set(own.flatMap(([x]) => x))).sort((a, b) => a - b);
    const along = ([x, y]) => {
      let next = 0;
      return all.map((t) => {
        while (next < x.length && x[next] < t) next += 1;
        if (next === x.length) return null;
        if (x[next] === t) return y[next];
        if (next === 0) return null;
        const [a, b] = [y[next - 1], y[next]];
        if (a === null || b === null) return null;
        return a + ((b - a) * (t - x[next - 1])) / (x[next] - x[next - 1]);
      });
    };
    return [all, ...own.map(along)];
  }

  function spread(u, min, max) {
    if (moving) return;
    moving = true;
    const all = plots.every((p) => p.uplot !== u || (min <= p.ends[0] && max >= p.ends[1]));
    range = all ? null : [min, max];
    for (const p of plots) {
      if (p.uplot === u) continue;
      const [lo, hi] = range || p.ends;
      p.uplot.setScale("x", { min: lo, max: hi });
    }
    whole.hidden = range === null;
    moving = false;
  }

  const whole = document.createElement("button");
  whole.className = "whole";
  whole.textContent = "Show the whole test";
  whole.hidden = true;
  whole.addEventListener("click", () => {
    const first = plots[0];
    first.uplot.setScale("x", { min: first.ends[0], max: first.ends[1] });
  });

  function marks(u, times) {
    const { ctx, bbox } = u;
    ctx.save();
    ctx.strokeStyle = colour("--alarm");
    ctx.lineWidth = 1.5 * devicePixelRatio;
    ctx.beginPath();
    for (const t of times) {
      const x = u.valToPos(t, "x", true);
      if (x < bbox.left || x > bbox.left + bbox.width) continue;
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + 9 * devicePixelRatio);
    }
    ctx.stroke();
    ctx.restore();
  }

  /** The upright axis of these values: where all of them are one number, it stands in the middle. */
  function upright(u, min, max) {
    if (max > min) return uPlot.rangeNum(min, max, 0.1, true);
    const air = Math.abs(max) * 0.05 || 1;
    return [min - air, max + air];
  }

  function draw(plot) {
    const { data, box } = plot;
    const axis = (more) => ({
      stroke: colour("--soft"),
      font: "12px system-ui, sans-serif",
      labelFont: "12px system-ui, sans-serif",
      labelSize: 20,
      grid: { stroke: colour("--grid"), width: 1 },
      ticks: { stroke: colour("--frame"), width: 1, size: 5 },
      ...more,
    });
    const options = {
      width: Math.max(260, box.clientWidth),
      height: data.height,
      cursor: { sync: { key: cursor.key }, drag: { x: true, y: false }, points: { size: 5 } },
      legend: { live: true },
      scales: {
        x: { time: false, range: (u, min, max) => [min, max] },
        y: data.log ? { distr: 3 } : { range: upright },
      },
      axes: [
        axis({ label: "test time (s)", size: 36, space: 70, values: (u, all) => all.map(moment) }),
        axis({
          label: data.axis,
          size: 58,
          values: (u, all) => all.map((v) => (v === null ? "" : rounded(v, 6))),
        }),
      ],
      series: [
        { label: "t (s)", value: (u, v) => moment(v) },
        ...data.series.map((s) => ({
          label: s.name,
          stroke: colour(s.ink),
          width: s.width,
          points: { show: false },
          value: (u, v) => (v === null || v === undefined || !data.unit ? digits(v) : `${digits(v)} ${data.unit}`),
        })),
      ],
      hooks: {
        setScale: [(u, key) => { if (key === "x" && u.status) spread(u, u.scales.x.min, u.scales.x.max); }],
        draw: [(u) => marks(u, data.marks)],
      },
    };
    plot.uplot = new uPlot(options, plot.table, box);
    plot.uplot.status = 1;
    if (range) plot.uplot.setScale("x", { min: range[0], max: range[1] });
  }

  function again() {
    moving = true;
    for (const p of plots) { p.uplot.destroy(); draw(p); }
    moving = false;
  }

  for (const figure of document.querySelectorAll("figure.history")) {
    const block = figure.querySelector("script");
    if (!block) continue;
    const data = JSON.parse(block.textContent);
    const table = columns(data.series);
    const head = document.createElement("p");
    head.className = "title";
    head.textContent = data.title;
    const box = document.createElement("div");
    box.className = "plot";
    box.setAttribute("role", "img");
    box.setAttribute("aria-label", data.label);
    figure.append(head, box);
    // Only where the numbers are does the plot stand for the picture.
    figure.classList.add("drawn");
    const x = table[0];
    plots.push({ data, box, table, ends: [x[0], x[x.length - 1]], uplot: null });
  }
  if (plots.length === 0) return;
  root.classList.add("zoomable");
  moving = true;
  plots.forEach(draw);
  moving = false;
  document.body.append(whole);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", again);
  let width = innerWidth;
  addEventListener("resize", () => {
    if (innerWidth === width) return;
    width = innerWidth;
    for (const p of plots) p.uplot.setSize({ width: Math.max(260, p.box.clientWidth), height: p.data.height + 16 });
  });
})();
