"use strict";
// The charts of a test: its strip charts with their legends, and one hysteresis loop per axis.

/* exported strips, loops, running, buildCharts */

let strips = [];
let loops = [];
/** The store whose time span the charts show. */
let shown = () => null;
/** Lines that the user has hidden. */
const hidden = new Set();

/** Whether a bin belongs to the test itself: running, or between two steps. */
function running(code) {
  return code === 3 || code > 10.5;
}

/** Builds the charts of a test; `store` returns the store to show. */
function buildCharts(subject, store) {
  shown = store;
  strips.forEach((strip) => strip.chart.remove());
  strips = [];
  loops = [];
  const channels = subject.channels.map((channel, place) => ({ ...channel, place }));
  const dofs = channels.filter((channel) => channel.kind === "dof");
  // The last DOF is behind the others, which are thinner and dashed: lines that coincide all remain visible.
  const lines = dofs.map((channel, at) => ({ ...channel, colour: `--c${at % 8}` }));
  const entries = [];
  // Lengths and angles do not share an axis.
  for (const [id, unit] of [["response-chart", "m"], ["rotation-chart", "rad"]]) {
    const drawn = lines.filter((line) => line.unit === unit).reverse().map((line, at) => ({ ...line, ...pen(at) }));
    $(id).hidden = drawn.length === 0;
    if (drawn.length === 0) continue;
    const chart = strip($(id), drawn, [unit === "m" ? "displacement" : "rotation", unit], `response: ${drawn.map((line) => line.label).reverse().join(", ")} over time`);
    entries.push(...drawn.map((line, at) => ({ ...line, chart, at })).reverse());
  }
  legend($("response-legend"), entries);
  const ground = channels.filter((channel) => channel.kind === "ground");
  $("ground-chart").hidden = ground.length === 0;
  if (ground.length > 0) {
    const drawn = ground.map((channel, at) => ({ ...channel, colour: `--c${(7 + at) % 8}` }));
    strip($("ground-chart"), drawn, ["ground", ground[0].unit], `${drawn.map((line) => line.label).join(", ")} over time`);
  }
  buildAxes(subject, channels);
}

/** Width and dash of a line: number 0 is behind all others. */
function pen(number) {
  return { weight: Math.max(1.3, 3.2 - 0.7 * number), dash: number === 0 ? undefined : [[9, 4], [3, 3], [10, 3, 2, 3]][(number - 1) % 3] };
}

/** The hysteresis of every axis; its histories beside it where it is the only one, else below. */
function buildAxes(subject, channels) {
  const all = subject.specimens.flatMap((specimen, s) => specimen.axes.map((_, a) => ({ specimen, s, a, name: axisName(specimen, a) })));
  const single = all.length === 1;
  $("axes").replaceChildren();
  $("only-axis").replaceChildren();
  $("loops").replaceChildren();
  document.querySelector(".lower").classList.toggle("single", single);
  $("loops").style.gridTemplateColumns = `repeat(${all.length > 4 ? Math.ceil(all.length / 2) : Math.max(1, all.length)}, minmax(0, 1fr))`;
  $("hysteresis").hidden = all.length === 0;
  for (const axis of all) {
    axisCard(axis, single ? $("only-axis") : $("axes"), channels);
    const box = make("div", "loop-box");
    const canvas = make("canvas", "loop");
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `hysteresis of ${axis.name}: force over displacement`);
    if (!single) box.append(make("h3", "", axis.name));
    box.append(canvas);
    $("loops").append(box);
    loops.push(canvas);
  }
}

/** A chart with its lines, the first one behind, and its caption: quantity and SI unit. */
function strip(place, lines, caption, name) {
  place.setAttribute("role", "img");
  place.setAttribute("aria-label", name);
  const chart = new Strip(place, lines, caption, () => [shown().x, shown().runs]);
  lines.forEach((line, at) => { if (hidden.has(line.label)) chart.show(at, false); });
  strips.push({ chart, places: lines.map((line) => line.place) });
  return chart;
}

/** A sample of a line and its name. */
function entryOf({ label, colour, weight, dash }, kind = "span") {
  const entry = make(kind);
  const [svg, line] = ["svg", "line"].map((name) => document.createElementNS("http://www.w3.org/2000/svg", name));
  svg.setAttribute("aria-hidden", "true");
  svg.setAttribute("viewBox", "0 0 28 10");
  for (const [key, value] of Object.entries({ x1: 0, x2: 28, y1: 5, y2: 5, stroke: css(colour), "stroke-width": weight ?? 2 })) line.setAttribute(key, value);
  if (dash) line.setAttribute("stroke-dasharray", dash.join(" "));
  svg.append(line);
  entry.append(svg, label);
  return entry;
}

/** Names of lines; a button shows or hides its line. */
function legend(place, entries) {
  place.replaceChildren(...entries.map((entry) => {
    const button = entryOf(entry, "button");
    button.type = "button";
    button.setAttribute("aria-pressed", String(!hidden.has(entry.label)));
    button.addEventListener("click", () => {
      const show = hidden.delete(entry.label);
      if (!show) hidden.add(entry.label);
      button.setAttribute("aria-pressed", String(show));
      entry.chart.show(entry.at, show);
    });
    return button;
  }));
}

function axisCard({ s, a, name }, place, channels) {
  const card = make("section", "card axis-card");
  const head = make("div", "head");
  head.append(make("h2", "", name));
  const own = (kind, colour) => ({ ...channels.find((c) => c.kind === kind && c.axis?.[0] === s && c.axis?.[1] === a), colour });
  // The command is drawn broad, so that it shows behind a measurement that follows it well.
  const [command, measured, error, force] = [{ ...own("command", "--c0"), weight: 4 }, own("measured", "--c1"), own("error", "--c3"), own("force", "--c2")];
  const key = make("div", "legend");
  key.append(entryOf(command), entryOf(measured));
  head.append(key);
  const [disp, following, pull] = [make("div", "chart"), make("div", "chart low"), make("div", "chart low")];
  card.append(head, disp, following, pull);
  place.append(card);
  strip(disp, [command, measured], ["displacement", "m"], `${name}: command and measured displacement over time`);
  strip(following, [error], ["measured − command", "m"], `${name}: measured displacement − command over time`);
  strip(pull, [force], ["force", "N"], `${name}: force over time`);
}
