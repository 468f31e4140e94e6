"use strict";
// The cards that tell numbers: limits, timing, λ, critical delays, links. Each is built for a subject and then shown as the
// rows come; knows nothing of the connection.

/* exported $, make, buildLimits, showLimits, buildTiming, showTiming, showLambda, showMargins, showLinks */

const $ = (id) => document.getElementById(id);
const make = (kind, classes = "", text = "") => {
  const element = document.createElement(kind);
  if (classes) element.className = classes;
  if (text) element.textContent = text;
  return element;
};

/** The bars of the limits that are shown. */
let bars = [];

function buildLimits(subject) {
  bars = [];
  const all = [];
  const finite = (level) => level !== null && Number.isFinite(level);
  const row = (name, key, unit, warn, trip, size, values, whose) => {
    const element = make("div", "bar");
    const label = make("span", "name", name);
    label.title = key;
    const value = make("span", "value", "–");
    const track = make("div", "track");
    const levels = [...warn, ...trip].filter(finite).map(Math.abs);
    const end = 1.12 * Math.max(...levels, 1e-300);
    const start = size ? 0 : -end;
    const at = (x) => `${100 * Math.min(1, Math.max(0, (x - start) / (end - start)))}%`;
    const mark = (kind, x) => {
      const line = make("div", kind);
      line.style.left = at(x);
      track.append(line);
      return line;
    };
    const soFar = make("div", "so-far");
    track.append(soFar);
    if (!size) mark("zero", 0);
    warn.filter(finite).forEach((x) => mark("mark-warn", x));
    trip.filter(finite).forEach((x) => mark("mark-trip", x));
    const present = mark("present", size ? 0 : (start + end) / 2);
    element.append(label, value, track);
    const isOf = (told) => told.limit === key && told.specimen === whose[0] && told.axis === whose[1];
    bars.push({ element, value, soFar, present, at, unit, warn, trip, size, values, isOf });
    return element;
  };
  let axis = 0;
  subject.specimens.forEach((specimen, s) => {
    specimen.axes.forEach(({ marks }, a) => {
      const heading = make("h3", "", specimen.axes.length > 1 ? `${specimen.name}, axis ${a + 1}` : specimen.name);
      all.push(heading);
      if (marks.length === 0) all.push(make("p", "silent", "no limits"));
      const own = axis;
      marks.forEach((m, place) => all.push(row(m.words, m.key, m.unit, m.warn, m.trip, m.size, (now) => now.axes[own]?.limits[place], [s, a])));
      axis += 1;
    });
  });
  const whole = subject.test.filter((m) => finite(m.warn) || finite(m.trip));
  if (whole.length > 0) all.push(make("h3", "", "the test as a whole"));
  subject.test.forEach((m, place) => {
    if (!finite(m.warn) && !finite(m.trip)) return;
    all.push(row(m.words, m.key, "1", [null, m.warn], [null, m.trip], true, (now) => {
      const [value, most] = now.test[place] ?? [null, null];
      return [value, 0, most];
    }, [null, null]));
  });
  $("bars").replaceChildren(...all);
}

function showLimits(now) {
  for (const bar of bars) {
    const [value, low, high] = bar.values(now) ?? [null, null, null];
    bar.value.textContent = nice(value, bar.unit);
    bar.present.hidden = value === null;
    if (value !== null) bar.present.style.left = bar.at(value);
    // What tripped before it could stand in a row has, too.
    const beyond = (levels) => (levels[1] !== null && high > levels[1]) || (levels[0] !== null && !bar.size && low < levels[0]);
    const tripped = now.trips.some(bar.isOf) || (high !== null && beyond(bar.trip));
    bar.element.classList.toggle("tripped", tripped);
    bar.element.classList.toggle("warned", !tripped && high !== null && beyond(bar.warn));
    // What has been stays, also where there is no present value.
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
  for (const id of ["histogram", "percentiles", "quantity"]) $(id).hidden = !real;
  $("untimed").hidden = real;
  const chosen = $("quantity").value;
  $("quantity").replaceChildren(...Object.entries(NAMES).map(([key, name]) => {
    const option = make("option", "", name);
    option.value = key;
    return option;
  }));
  if (chosen) $("quantity").value = chosen;
}

function showTiming(now) {
  const { misses } = now;
  const total = misses.ours + misses.preempted + misses.taken_away + misses.late_reply;
  const count = make("b", "", String(total));
  const classes = make("span", "", ` missed: `);
  const ours = make("span", misses.ours > 0 ? "ours" : "", `ours ${misses.ours}`);
  const rest = make("span", "", ` · preempted ${misses.preempted} · hypervisor or interrupt ${misses.taken_away} · late reply ${misses.late_reply} · grid moved by ${now.stretched ?? 0} ticks`);
  $("misses").replaceChildren(count, classes, ours, rest);
  const body = $("percentiles").tBodies[0];
  body.replaceChildren(...now.timing.map((view) => {
    const row = make("tr");
    row.append(make("td", "", NAMES[view.key] ?? view.key), ...["p50", "p99", "p99_9", "max"].map((key) => make("td", "", nice(view[key], "s"))));
    return row;
  }));
}

function showLambda(known, lambda) {
  if (!known) return;
  const place = $("lambda");
  const number = (value, else_) => (value === null || value === undefined ? else_ : Number(value.toPrecision(4)).toString());
  const used = number(known.used, "∞");
  const limit = known.declared_limit === 0 ? "no λ is stable at the declared bounds" : `limit at the declared bounds: ${number(known.declared_limit, "none, every λ is stable")}`;
  const declared = known.proven ? limit : "no proof: a tangent has no declared bound";
  const lines = [];
  place.classList.remove("bad");
  if (lambda) {
    const margin = known.used === null || lambda.limit === null ? null : lambda.limit / known.used;
    place.classList.toggle("bad", (margin !== null && margin < 1) || (known.used === null && lambda.limit !== null));
    lines.push(make("p", "big", lambda.limit === null ? `λ ${used}: every λ is stable` : `λ ${used} of ${number(lambda.limit)} (${margin === null ? "no room" : `${margin.toFixed(2)} ×`})`));
    lines.push(make("p", "", `largest stable λ with the tangents of the last seconds; the smallest so far: ${number(lambda.lowest, "none, every λ was stable")}`));
  } else {
    place.classList.toggle("bad", known.declared_limit === 0);
    lines.push(make("p", "big", `λ ${used}`));
  }
  lines.push(make("p", "", declared));
  place.replaceChildren(...lines);
}

function showMargins(subject, now) {
  if ($("delays").hidden) return;
  const lines = [];
  let axis = 0;
  let bad = false;
  for (const specimen of subject.specimens) {
    specimen.axes.forEach(({ has_margin }, a) => {
      const [present, lowest] = now.axes[axis]?.margin ?? [null, null];
      axis += 1;
      if (!has_margin) return;
      bad = bad || (present !== null && present < 0);
      const name = specimen.axes.length > 1 ? `${specimen.name}, axis ${a + 1}` : specimen.name;
      const words = present === null ? "none: every delay is stable, or nothing is known yet" : nice(present, "s");
      lines.push(make("p", "big", `${name}: ${words}`));
      lines.push(make("p", "", `the smallest so far: ${lowest === null ? "–" : nice(lowest, "s")}`));
    });
  }
  lines.push(make("p", "", "critical delay at the stiffness of the last seconds less their lag; below zero the test grows"));
  $("margins").classList.toggle("bad", bad);
  $("margins").replaceChildren(...lines);
}

function showLinks({ subject, flags }, now, viewers) {
  const rows = subject.specimens.map((specimen, s) => {
    const view = now.specimens[s];
    const row = make("div", "link-row");
    row.append(make("b", "", specimen.name), make("span", "", specimen.remote ? "behind a link" : "in this process"));
    if (!view) return row;
    row.append(make("span", "", `${view.exchanges} exchanges, ${view.stale} stale`));
    for (const [flag, word] of flags) {
      if (view.status & flag) row.append(make("span", ["holding", "stale", "unsent"].includes(word) ? "flag mild" : "flag", word));
    }
    return row;
  });
  $("link-rows").replaceChildren(...rows);
  const lost = now.rows_lost > 0;
  $("recording").classList.toggle("bad", lost);
  $("recording").textContent = `${now.rows_written} rows written, ${lost ? `${now.rows_lost} ROWS LOST` : "none lost"}, ${now.events} events · ${viewers} ${viewers === 1 ? "viewer" : "viewers"}`;
}
