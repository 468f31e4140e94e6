"use strict";
// The cards with numbers: limits, margins, timing, links. Each is built for a test and then updated with each state.
// They know nothing of the connection.

/* exported $, make, put, axisName, buildLimits, showLimits, buildTiming, showTiming, missed, showMargins, showLinks */

const $ = (id) => document.getElementById(id);
const make = (kind, classes = "", text = "") => {
  const element = document.createElement(kind);
  if (classes) element.className = classes;
  if (text) element.textContent = text;
  return element;
};

/** Sets a text only where it changes: a screen reader reads each change. */
const put = (id, text) => {
  if ($(id).textContent !== text) $(id).textContent = text;
};

/** Names of limits that are too long for one line. */
const SHORT = {
  command_step_m: "command change per tick",
  force_step_n: "force change per reply",
  sensor_disp_m: "displacement sensor",
  sensor_force_n: "load cell",
  stuck_ticks: "ticks with unchanged sensors",
  alternating_ticks: "ticks of a command sawtooth",
  stiffness_ratio: "stiffness over its bound",
  damping_ratio: "damping over its bound",
  added_energy_j: "energy of tracking errors",
  lag_s: "lag behind the target",
  gain_error: "gain error",
  delay_used: "share of critical delay",
  step_audit: "energy error of steps",
  added_energy_share: "energy share of tracking errors",
  static_unbalance: "unbalance without mass",
  max_consecutive_misses: "deadline misses in a row",
  max_misses_in_window: "deadline misses in the window",
  max_total_misses: "deadline misses in total",
};

/** Limits that are margins. */
const MARGINS = ["stability_used", "delay_used"];

/** Limits that are shares, shown in per cent. */
const SHARES = [...MARGINS, "step_audit", "added_energy_share", "static_unbalance"];

/** The bars of limits and margins. */
let bars = [];

const finite = (level) => level !== null && Number.isFinite(level);

/** A bar of `mark`: its name, its range with levels, its value. */
function bar(mark, values, whose) {
  const { key, unit, warn, trip, size, end } = mark;
  const name = `${SHORT[key] ?? mark.words}${finite(end) ? ` ±${nice(end, unit)}` : ""}`;
  const element = make("div", "bar");
  const label = make("span", "name", name);
  const value = make("span", "value", "–");
  const track = make("div", "track");
  track.setAttribute("role", "meter");
  track.setAttribute("aria-label", [whose.name, name].filter(Boolean).join(", "));
  const levels = [...warn, ...trip].filter(finite);
  label.title = `${mark.words} (${key})`;
  for (const [word, pair] of [["warning", warn], ["trip", trip]]) {
    const known = pair.filter(finite);
    if (known.length > 0) label.title += `; ${word} at ${known.map((level) => nice(level, unit)).join(", ")}`;
  }
  const most = finite(end) ? end : 1.12 * Math.max(...levels.map(Math.abs), mark.most ?? 1e-300);
  const least = size ? 0 : -most;
  track.setAttribute("aria-valuemin", least);
  track.setAttribute("aria-valuemax", most);
  const at = (x) => `${100 * Math.min(1, Math.max(0, (x - least) / (most - least)))}%`;
  const line = (kind, x) => {
    const element = make("div", kind);
    element.style.left = at(x);
    track.append(element);
    return element;
  };
  const soFar = make("div", "so-far");
  track.append(soFar);
  if (!size) line("zero", 0);
  warn.filter(finite).forEach((x) => line("mark-warn", x));
  trip.filter(finite).forEach((x) => line("mark-trip", x));
  if (finite(end)) [-end, end].forEach((x) => line("mark-end", x));
  const present = line("present", size ? 0 : (least + most) / 2);
  element.append(label, track, value);
  const isOf = (told) => told.limit === key && told.specimen === whose.specimen && told.axis === whose.axis;
  bars.push({ element, track, value, soFar, present, at, unit, warn, trip, size, values, isOf, percent: SHARES.includes(key) });
  return element;
}

const testValues = (place) => (now) => {
  const [value, most] = now.test[place] ?? [null, null];
  return [value, 0, most];
};

const axisName = (specimen, a) => (specimen.axes.length > 1 ? `${specimen.name}, axis ${a + 1}` : specimen.name);

function buildLimits(subject) {
  bars = [];
  const all = [];
  let axis = 0;
  subject.specimens.forEach((specimen, s) => specimen.axes.forEach(({ marks }, a) => {
    const name = axisName(specimen, a);
    const own = axis;
    axis += 1;
    all.push(make("h3", "", name));
    if (marks.length === 0) all.push(make("p", "silent", "no limits set (only NaN or infinity stops the test)"));
    marks.forEach((mark, place) => all.push(bar(mark, (now) => now.axes[own]?.limits[place], { name, specimen: s, axis: a })));
  }));
  const whole = { name: "", specimen: null, axis: null };
  const margins = [];
  const rest = [];
  subject.test.forEach((mark, place) => {
    const isMargin = MARGINS.includes(mark.key);
    // The end of a bar without levels is the whole margin.
    if (isMargin) margins.push(bar({ ...mark, most: 1 / 1.12 }, testValues(place), whole));
    else if ([...mark.warn, ...mark.trip].some(finite)) rest.push(bar(mark, testValues(place), whole));
  });
  if (rest.length > 0) all.push(make("h3", "", "whole test"), ...rest);
  $("margin-bars").replaceChildren(...margins);
  $("bars").replaceChildren(...all);
}

function showLimits(now) {
  for (const bar of bars) {
    const [value, low, high] = bar.values(now) ?? [null, null, null];
    const text = bar.percent && finite(value) ? `${Number((100 * value).toFixed(1))} %` : nice(value, bar.unit);
    bar.value.textContent = text;
    bar.track.setAttribute("aria-valuenow", value ?? 0);
    bar.track.setAttribute("aria-valuetext", text);
    bar.present.hidden = value === null;
    if (value !== null) bar.present.style.left = bar.at(value);
    // A command that was refused is in no row, but it has tripped.
    const beyond = (levels) => (levels[1] !== null && high > levels[1]) || (levels[0] !== null && !bar.size && low < levels[0]);
    const tripped = now.trips.some(bar.isOf) || (high !== null && beyond(bar.trip));
    bar.element.classList.toggle("tripped", tripped);
    bar.element.classList.toggle("warned", !tripped && high !== null && beyond(bar.warn));
    // The range so far remains where there is no present value.
    bar.soFar.hidden = high === null;
    if (high === null) continue;
    const from = bar.size ? 0 : low;
    bar.soFar.style.left = bar.at(from);
    bar.soFar.style.width = `calc(${bar.at(high)} - ${bar.at(from)})`;
  }
}

const NAMES = { wakeup_lateness: "wake-up lateness", command_lateness: "command lateness", round_trip: "round trip", compute: "compute" };

function buildTiming(subject) {
  const real = subject.real_clock;
  for (const id of ["timing", "percentiles", "misses"]) $(id).hidden = !real;
  $("untimed").hidden = real;
  const chosen = $("quantity").value;
  $("quantity").replaceChildren(...Object.entries(NAMES).map(([key, name]) => {
    const option = make("option", "", name);
    option.value = key;
    return option;
  }));
  if (chosen) $("quantity").value = chosen;
}

/** All deadline misses of a state. */
const missed = ({ misses }) => Object.values(misses).reduce((sum, count) => sum + count, 0);

function showTiming(now) {
  const { misses } = now;
  const own = make("span", misses.ours > 0 ? "own" : "", `own ${misses.ours}`);
  const rest = `, preempted ${misses.preempted}, hypervisor ${misses.taken_away}, stopped ${misses.stopped}, late reply ${misses.late_reply}, not known ${misses.unknown}; grid moved by ${now.stretched ?? 0} ticks`;
  $("misses").replaceChildren("deadline misses: ", own, rest);
  $("percentiles").tBodies[0].replaceChildren(...now.timing.map((view) => {
    const row = make("tr");
    row.append(make("td", "", NAMES[view.key] ?? view.key), ...["p50", "p99", "p99_9", "max"].map((key) => make("td", "", nice(view[key], "s"))));
    return row;
  }));
}

/** λ against its limit, and the delay margin of the specimen that is closest to it. */
function showMargins(subject, now, lambda) {
  const lines = [];
  let bad = false;
  const number = (value, none) => (value === null || value === undefined ? none : Number(value.toPrecision(4)).toString());
  const known = subject.lambda;
  if (known) {
    const used = number(known.used, "∞");
    const limit = lambda ? lambda.limit : known.declared_limit;
    const lowest = lambda && lambda.lowest !== null ? `, smallest so far ${number(lambda.lowest)}` : "";
    bad = limit !== null && (known.used === null || known.used > limit) && (lambda !== null || known.proven);
    if (!known.proven) lines.push(`λ = ${used}; no proof of stability: a tangent has no declared bound`);
    else if (limit === null) lines.push(`λ = ${used}; every λ is stable`);
    else lines.push(`λ = ${used}, largest stable λ ${number(limit)}${lowest}`);
  }
  const axes = subject.specimens.flatMap((specimen) => specimen.axes.map((axis, a) => ({ ...axis, name: axisName(specimen, a) })));
  const delays = axes.map(({ has_margin, name }, place) => ({ has_margin, name, margin: now.axes[place]?.margin ?? [null, null] }));
  const smallest = delays.filter(({ has_margin, margin }) => has_margin && margin[0] !== null).sort((a, b) => a.margin[0] - b.margin[0])[0];
  if (smallest) {
    const [present, lowest] = smallest.margin;
    bad = bad || present < 0;
    lines.push(`critical delay − lag, ${smallest.name}: ${nice(present, "s")}, smallest so far ${nice(lowest, "s")}`);
  }
  if (lines.length === 0 && !$("margin-bars").hasChildNodes()) lines.push("no stability margin is known for this test");
  $("margin-notes").classList.toggle("bad", bad);
  $("margin-notes").replaceChildren(...lines.map((line) => make("span", "", line)));
}

function showLinks({ subject, flags }, now, viewers) {
  const rows = subject.specimens.map((specimen, s) => {
    const view = now.specimens[s];
    const row = make("div", "link-row");
    row.append(make("b", "", specimen.name), make("span", "", specimen.remote ? "behind a link" : "simulated in this process"));
    if (!view) return row;
    row.append(make("span", "", `${view.exchanges} exchanges, ${view.stale} stale replies`));
    for (const [flag, word] of flags) {
      if (view.status & flag) row.append(make("span", ["holding", "stale", "unsent"].includes(word) ? "flag mild" : "flag", word));
    }
    return row;
  });
  $("link-rows").replaceChildren(...rows);
  const lost = now.rows_lost > 0;
  $("recording").classList.toggle("bad", lost);
  $("recording").textContent = `${now.rows_written} rows written, ${lost ? `${now.rows_lost} ROWS LOST` : "none lost"}, ${now.events} events; ${viewers} ${viewers === 1 ? "viewer" : "viewers"}`;
}
