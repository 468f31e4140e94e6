"use strict";
// What is drawn: strip charts (uPlot), hysteresis loops and histograms (plain canvas), and numbers as text. Knows nothing
// of the connection.

/* exported css, scaled, nice, Strip, drawLoop, drawHistogram */

const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const FONT = '12px system-ui, "Segoe UI", "DejaVu Sans", sans-serif';

const PREFIXES = [[1e9, "G"], [1e6, "M"], [1e3, "k"], [1, ""], [1e-3, "m"], [1e-6, "µ"], [1e-9, "n"]];

/** Factor and unit in which values up to `size` are short: [1e-3, "mm"]. */
function scaled(size, unit) {
  if (unit === "m/s2") unit = "m/s²";
  if (unit === "1" || unit === "×" || unit === "ticks" || unit === "") return [1, unit === "1" ? "" : unit];
  if (!(size > 0) || !Number.isFinite(size)) return [1, unit];
  const [factor, prefix] = PREFIXES.find(([factor]) => size >= factor) ?? PREFIXES[PREFIXES.length - 1];
  return [factor, prefix + unit];
}

/** A number with its unit, three or four digits; a dash where there is none. */
function nice(value, unit = "") {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if ((unit === "1" || unit === "ticks") && Number.isInteger(value)) return `${value} ${unit === "1" ? "" : unit}`.trim();
  if (unit === "1" && Math.abs(value) < 1e-3) return value.toExponential(1);
  const [factor, shown] = scaled(Math.abs(value), unit);
  const number = value / factor;
  const size = Math.abs(number);
  const digits = size >= 100 ? 0 : size >= 10 ? 1 : size === 0 ? 0 : 2;
  return `${number.toFixed(digits)} ${shown}`.trim();
}

/** One strip chart: every line is a pair of arrays, smallest and largest of each bin, and what lies between. */
class Strip {
  /** `lines` are [{label, colour, weight, dash}], the first one behind the others; `states` has the times at which the test runs. */
  constructor(place, lines, [quantity, unit], states) {
    this.place = place;
    this.quantity = quantity;
    this.unit = unit;
    this.caption = document.createElement("div");
    this.caption.className = "unit";
    this.factor = 1;
    const axis = { stroke: css("--soft"), font: FONT, grid: { stroke: css("--line"), width: 1 }, ticks: { stroke: css("--line"), width: 1, size: 4 } };
    const series = [{}];
    const bands = [];
    for (const { colour, weight, dash } of lines) {
      const stroke = css(colour);
      const line = { stroke, width: weight ?? 1.5, dash, points: { show: false } };
      series.push({ ...line }, { ...line });
      // Lines behind remain visible through the band between smallest and largest.
      bands.push({ series: [series.length - 1, series.length - 2], fill: `${stroke}99` });
    }
    const number = (value) => String(Number((value / this.factor).toPrecision(6)));
    this.plot = new uPlot({
      ...this.size(),
      padding: [18, 12, 0, 0],
      legend: { show: false },
      cursor: { show: false },
      scales: { x: { time: false, range: (_, min, max) => [min, max] }, y: { range: (_, min, max) => around(min, max) } },
      axes: [
        { ...axis, size: 22, gap: 1, space: 60, values: (_, at) => at.map((t) => `${Number(t.toPrecision(6))}`) },
        { ...axis, size: 52, gap: 4, space: 20, values: (_, at) => at.map(number) },
      ],
      series,
      bands,
      hooks: { drawClear: [(plot) => shade(plot, states)] },
    }, [[], ...series.slice(1).map(() => [])], place);
    place.append(this.caption);
    this.observer = new ResizeObserver(() => this.plot.setSize(this.size()));
    this.observer.observe(place);
  }

  size() {
    return { width: Math.max(80, this.place.clientWidth), height: Math.max(60, this.place.clientHeight) };
  }

  /** `columns` are x, then smallest and largest of each line. */
  draw(columns, from, to) {
    this.plot.setData(columns, false);
    let size = 0;
    const x = columns[0];
    for (let at = x.length - 1; at >= 0 && x[at] >= from; at -= 1) {
      for (let line = 1; line < columns.length; line += 1) {
        const value = Math.abs(columns[line][at]);
        if (value > size) size = value;
      }
    }
    const [factor, unit] = scaled(size, this.unit);
    this.factor = factor;
    const caption = `${this.quantity}, ${unit}`;
    if (this.caption.textContent !== caption) this.caption.textContent = caption;
    this.plot.setScale("x", { min: from, max: to });
  }

  /** Shows or hides a line. */
  show(line, shown) {
    for (const series of [2 * line + 1, 2 * line + 2]) this.plot.setSeries(series, { show: shown });
  }

  remove() {
    this.observer.disconnect();
    this.plot.destroy();
    this.caption.remove();
  }
}

/** A range round the values, with some air; round 0 where there is nothing. */
function around(min, max) {
  if (min === null || max === null || !Number.isFinite(min) || !Number.isFinite(max)) return [-1, 1];
  if (min === max) {
    const half = Math.abs(min) > 0 ? 0.5 * Math.abs(min) : 1;
    return [min - half, max + half];
  }
  const air = 0.06 * (max - min);
  return [min - air, max + air];
}

/** Shades the time in which the test did not run. */
function shade(plot, states) {
  const [x, runs] = states();
  const { ctx, bbox } = plot;
  ctx.save();
  ctx.fillStyle = css("--shade");
  let start = null;
  const close = (end) => {
    if (start === null) return;
    const left = Math.max(bbox.left, plot.valToPos(start, "x", true));
    const right = Math.min(bbox.left + bbox.width, plot.valToPos(end, "x", true));
    if (right > left) ctx.fillRect(left, bbox.top, right - left, bbox.height);
    start = null;
  };
  for (let at = 0; at < x.length; at += 1) {
    if (runs[at]) close(x[at]);
    else if (start === null) start = at > 0 ? x[at - 1] : x[at];
  }
  if (x.length > 0) close(x[x.length - 1]);
  ctx.restore();
}

/** A canvas ready to draw on in CSS pixels: its context, width and height. */
function sheet(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const width = canvas.clientWidth;
  const height = canvas.clientHeight;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const ctx = canvas.getContext("2d");
  ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
  ctx.clearRect(0, 0, width, height);
  ctx.font = FONT;
  return [ctx, width, height];
}

/** Round numbers in a range: about `count` of them. */
function ticks(min, max, count) {
  const raw = (max - min) / count;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((m) => m * power).find((step) => step >= raw) ?? raw;
  const all = [];
  for (let at = Math.ceil(min / step) * step; at <= max; at += step) all.push(Math.abs(at) < step * 1e-9 ? 0 : at);
  return all;
}

/** Force over displacement: the whole test faintly, the last seconds strongly, the present point. Bins are lists of points. */
function drawLoop(canvas, whole, recent) {
  const [ctx, width, height] = sheet(canvas);
  if (width < 60 || height < 60) return;
  let [d0, d1, f0, f1] = [Infinity, -Infinity, Infinity, -Infinity];
  for (const bin of [...whole, ...recent]) {
    for (let at = 0; at < bin.length; at += 2) {
      [d0, d1] = [Math.min(d0, bin[at]), Math.max(d1, bin[at])];
      [f0, f1] = [Math.min(f0, bin[at + 1]), Math.max(f1, bin[at + 1])];
    }
  }
  [d0, d1] = d0 <= d1 ? around(d0, d1) : [-1, 1];
  [f0, f1] = f0 <= f1 ? around(f0, f1) : [-1, 1];
  const box = { left: 48, top: 18, right: width - 8, bottom: height - 34 };
  const x = (d) => box.left + (d - d0) / (d1 - d0) * (box.right - box.left);
  const y = (f) => box.bottom - (f - f0) / (f1 - f0) * (box.bottom - box.top);
  loopAxes(ctx, box, [d0, d1, f0, f1], x, y);
  const line = (bins, colour, strength, weight) => {
    ctx.strokeStyle = css(colour);
    ctx.globalAlpha = strength;
    ctx.lineWidth = weight;
    ctx.lineJoin = "round";
    ctx.beginPath();
    let down = false;
    for (const bin of bins) {
      for (let at = 0; at < bin.length; at += 2) {
        if (down) ctx.lineTo(x(bin[at]), y(bin[at + 1]));
        else ctx.moveTo(x(bin[at]), y(bin[at + 1]));
        down = true;
      }
    }
    ctx.stroke();
    ctx.globalAlpha = 1;
  };
  line(whole, "--c0", 0.5, 1);
  line(recent, "--c1", 1, 2);
  const last = recent.findLast((bin) => bin.length > 0);
  if (last) {
    ctx.fillStyle = css("--ink");
    ctx.beginPath();
    ctx.arc(x(last[last.length - 2]), y(last[last.length - 1]), 4, 0, 2 * Math.PI);
    ctx.fill();
  }
}

/** Grid, numbers and names of the axes of a loop. */
function loopAxes(ctx, box, [d0, d1, f0, f1], x, y) {
  const [ds, dUnit] = scaled(Math.max(Math.abs(d0), Math.abs(d1)), "m");
  const [fs, fUnit] = scaled(Math.max(Math.abs(f0), Math.abs(f1)), "N");
  ctx.strokeStyle = css("--line");
  ctx.fillStyle = css("--soft");
  ctx.lineWidth = 1;
  ctx.textAlign = "center";
  ctx.textBaseline = "top";
  for (const d of ticks(d0, d1, Math.max(2, (box.right - box.left) / 70))) {
    const at = Math.round(x(d)) + 0.5;
    ctx.beginPath(); ctx.moveTo(at, box.top); ctx.lineTo(at, box.bottom); ctx.stroke();
    ctx.fillText(String(Number((d / ds).toPrecision(4))), at, box.bottom + 4);
  }
  ctx.fillText(`displacement, ${dUnit}`, (box.left + box.right) / 2, box.bottom + 19);
  ctx.textAlign = "right";
  ctx.textBaseline = "middle";
  for (const f of ticks(f0, f1, Math.max(2, (box.bottom - box.top) / 40))) {
    const at = Math.round(y(f)) + 0.5;
    ctx.beginPath(); ctx.moveTo(box.left, at); ctx.lineTo(box.right, at); ctx.stroke();
    ctx.fillText(String(Number((f / fs).toPrecision(4))), box.left - 5, at);
  }
  ctx.textBaseline = "alphabetic";
  ctx.textAlign = "left";
  ctx.fillText(`force, ${fUnit}`, 2, 12);
}

/** Counts over logarithmic buckets, on a logarithmic scale; percentiles as marks. */
function drawHistogram(canvas, bounds, view) {
  const [ctx, width, height] = sheet(canvas);
  if (width < 60 || height < 60) return;
  const box = { left: 44, top: 8, right: width - 8, bottom: height - 22 };
  const counts = view ? view.buckets : bounds.map(() => 0).concat(0);
  const most = Math.max(10, ...counts);
  const decades = Math.ceil(Math.log10(most));
  const y = (count) => box.bottom - (count > 0 ? (Math.log10(count) + 0.3) / (decades + 0.3) : 0) * (box.bottom - box.top);
  const wide = (box.right - box.left) / counts.length;
  ctx.lineWidth = 1;
  ctx.strokeStyle = css("--line");
  ctx.fillStyle = css("--soft");
  ctx.textAlign = "right";
  ctx.textBaseline = "middle";
  for (let power = 0; power <= decades; power += decades > 4 ? 2 : 1) {
    const at = Math.round(y(10 ** power)) + 0.5;
    ctx.beginPath(); ctx.moveTo(box.left, at); ctx.lineTo(box.right, at); ctx.stroke();
    ctx.fillText(power < 3 ? String(10 ** power) : `1e${power}`, box.left - 5, at);
  }
  ctx.fillStyle = css("--c0");
  counts.forEach((count, place) => {
    if (count > 0) ctx.fillRect(box.left + place * wide + 1, y(count), Math.max(1, wide - 2), box.bottom - y(count));
  });
  ctx.fillStyle = css("--soft");
  ctx.textAlign = "center";
  ctx.textBaseline = "top";
  bounds.forEach((bound, place) => {
    // One label a decade: 1 µs, 10 µs, …; where it is narrow, every second.
    if (place % (width < 420 ? 6 : 3) !== 0) return;
    const at = box.left + (place + 1) * wide;
    ctx.fillText(nice(bound, "s").replace(/\.0+(?= )/, ""), Math.min(at, box.right - 14), box.bottom + 5);
  });
  const place = (seconds) => {
    const above = bounds.findIndex((bound) => bound >= seconds);
    if (above < 0) return box.right;
    const low = above > 0 ? bounds[above - 1] : bounds[0] / 2;
    const share = Math.min(1, Math.max(0, Math.log(seconds / low) / Math.log(bounds[above] / low)));
    return box.left + (above + share) * wide;
  };
  for (const [key, colour] of [["p99", "--hold"], ["p99_9", "--c3"], ["max", "--bad"]]) {
    const value = view?.[key];
    if (!(value > 0)) continue;
    ctx.strokeStyle = css(colour);
    ctx.lineWidth = 2;
    ctx.beginPath(); ctx.moveTo(place(value), box.top); ctx.lineTo(place(value), box.bottom); ctx.stroke();
  }
}
