"use strict";
// The live page: what it shows of the test that the server tells it of, and the operator's buttons.

/** What the server said first, and what follows from it. */
let test = null;
/** The latest state. */
let state = null;
let recent = null;
let whole = null;
let strips = [];
let loops = [];
let span = 60;
let stale = true;

// What is shown ------------------------------------------------------------------------------------------------------

function greet({ hello, whole: past, bins }) {
  test = hello;
  const { subject } = hello;
  const channels = subject.channels.length;
  const axes = subject.specimens.reduce((sum, specimen) => sum + specimen.axes.length, 0);
  recent = new Store(channels, axes, 4000, false);
  whole = new Store(channels, axes, 4096, true);
  for (const bin of past) whole.push(bin, running);
  for (const bin of bins) {
    recent.push(bin, running);
    whole.push(bin, running);
  }
  document.title = `${subject.title} · Gusset`;
  $("title").textContent = subject.title;
  $("title").title = subject.title;
  const facts = [`${nice(1 / subject.tick_s, "Hz")}`, `Δt ${nice(subject.dt, "s")}`, `${subject.real_clock ? "real" : "simulated"} clock`, subject.run];
  const { goes_on: before } = subject;
  if (before) facts.unshift(`goes on from ${before.run} after step ${before.after}`);
  $("facts").textContent = facts.join(" · ");
  $("facts").title = facts.join("\n");
  $("duration").textContent = `of ${(subject.steps * subject.dt).toFixed(2)} s`;
  $("outcome").hidden = true;
  build();
}

/** Whether a bin belongs to the test itself: running, or between two steps. */
function running(code) {
  return code === 3 || code > 10.5;
}

function build() {
  strips.forEach((strip) => strip.chart.remove());
  strips = [];
  loops = [];
  const { subject } = test;
  const channels = subject.channels.map((channel, place) => ({ ...channel, place }));
  const dofs = channels.filter((channel) => channel.kind === "dof");
  const lines = dofs.map((channel, at) => ({ ...channel, colour: `--c${at % 8}` }));
  // Lengths and angles do not share an axis.
  for (const [id, unit] of [["response-chart", "m"], ["rotation-chart", "rad"]]) {
    const drawn = lines.filter((line) => line.unit === unit);
    $(id).hidden = drawn.length === 0;
    if (drawn.length > 0) strip($(id), drawn, unit);
  }
  legend($("response-legend"), lines);
  const ground = channels.filter((channel) => channel.kind === "ground");
  $("ground-chart").hidden = ground.length === 0;
  if (ground.length > 0) strip($("ground-chart"), [{ ...ground[0], colour: "--c7" }], ground[0].unit);
  $("axes").replaceChildren();
  subject.specimens.forEach((specimen, s) => specimen.axes.forEach((_, a) => axisCard(specimen, s, a, channels)));
  buildLimits(subject);
  buildTiming(subject);
  $("stability").hidden = !subject.lambda;
  $("delays").hidden = !subject.specimens.some((specimen) => specimen.axes.some((axis) => axis.has_margin));
}

function strip(place, lines, unit) {
  const shown = () => (span > 0 ? recent : whole);
  const chart = new Strip(place, lines, unit, () => [shown().x, shown().runs]);
  strips.push({ chart, places: lines.map((line) => line.place) });
}

function legend(place, lines) {
  place.replaceChildren(...lines.map(({ label, colour }) => {
    const entry = make("span", "", label);
    entry.style.color = css(colour);
    return entry;
  }));
}

function axisCard(specimen, s, a, channels) {
  const card = make("section", "card axis-card");
  const head = make("div", "head");
  head.append(make("h2", "", specimen.axes.length > 1 ? `${specimen.name}, axis ${a + 1}` : specimen.name));
  const own = (kind, colour) => ({ ...channels.find((c) => c.kind === kind && c.axis?.[0] === s && c.axis?.[1] === a), colour });
  // The command is drawn broad, so that it shows behind a measurement that follows it well.
  const [command, measured, error, force] = [{ ...own("command", "--c0"), weight: 4 }, own("measured", "--c1"), own("error", "--c3"), own("force", "--c2")];
  const key = make("div", "legend");
  legend(key, [command, measured, error, force]);
  head.append(key);
  const plots = make("div", "plots");
  const [first, second, third] = [make("div"), make("div"), make("div", "loop-box")];
  const [disp, following, pull] = [make("div", "chart"), make("div", "chart low"), make("div", "chart tall")];
  first.append(disp, following);
  second.append(pull);
  const canvas = make("canvas", "loop");
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", `hysteresis of ${specimen.name}, axis ${a + 1}`);
  third.append(canvas);
  plots.append(first, second, third);
  card.append(head, plots);
  $("axes").append(card);
  strip(disp, [command, measured], "m");
  strip(following, [error], "m");
  strip(pull, [force], "N");
  loops.push(canvas);
}

function count(id, value, bad) {
  $(id).firstElementChild.textContent = value === null ? "–" : String(value);
  $(id).classList.toggle("bad", bad);
}

/** The phase; what is to be confirmed in it, and a hold that has no phase of its own beside it. */
function named({ phase, hold, stands, unconfirmed }) {
  const words = unconfirmed ? [phase, "to be confirmed"] : [phase];
  if (hold && phase !== "holding") words.push(stands ? "held" : "to be held");
  return words.join(", ");
}

/** The way out after a trip looks like the trip. The word stays short: a longer one would move the buttons away from a hand. */
function dressed({ phase, now }) {
  return now.trips.length > 0 ? "tripped" : phase;
}

function showState() {
  const { now, phase, ended } = state;
  $("phase").textContent = named(state);
  $("phase").className = dressed(state);
  $("time").textContent = now.rows > 0 && now.time !== null ? `${now.time.toFixed(2)} s` : "–";
  const share = test.subject.steps > 0 ? now.time / (test.subject.steps * test.subject.dt) : 0;
  $("progress").style.width = `${100 * Math.min(1, Math.max(0, share || 0))}%`;
  const total = Object.values(now.misses).reduce((sum, count) => sum + count, 0);
  count("missed", test.subject.real_clock ? total : null, now.misses.ours > 0);
  count("lost", now.rows_lost, now.rows_lost > 0);
  showLimits(now);
  showTiming(now);
  showLambda(test.subject.lambda, state.lambda);
  showMargins(test.subject, now);
  showLinks(test, now, state.viewers);
  const over = Boolean(ended) || phase === "safe";
  // The way out is neither held nor gone on with.
  const deaf = over || phase === "leaving" || phase === "tripped";
  const holds = state.hold || phase === "holding";
  $("hold").disabled = deaf || holds;
  // One button, never two things at once: it does what it says when it is pressed, whatever is the case when that is heard.
  const asks = state.unconfirmed && !holds;
  $("continue").textContent = asks ? "CONFIRM" : "CONTINUE";
  $("continue").disabled = deaf || !(holds || asks);
  $("stop").disabled = over;
  if ($("sure").open && (over || asked !== stopMeans())) {
    $("sure").close("no");
    say(over ? "The test has ended by itself." : "The test has ended and is on its way out: STOP would freeze it now.", true);
  }
  if (ended) {
    $("outcome").className = ended.status;
    $("verdict").textContent = ended.status.toUpperCase();
    $("reason").textContent = ended.reason;
    $("where").textContent = ended.report ? `report: ${ended.report}` : `data: ${ended.data}`;
    $("outcome").hidden = false;
  }
}

function drawAll() {
  if (!stale || !recent || document.hidden) return;
  stale = false;
  const shown = span > 0 ? recent : whole;
  const to = shown.x.length > 0 ? shown.x[shown.x.length - 1] : 1;
  const from = span > 0 ? Math.max(0, to - span) : 0;
  for (const { chart, places } of strips) chart.draw(shown.columns(places), from, Math.max(to, from + 0.5));
  loops.forEach((canvas, index) => drawLoop(canvas, whole.loop(index, 0), recent.loop(index, to - 5)));
  const chosen = $("quantity").value;
  drawHistogram($("histogram"), test.buckets, state?.now.timing.find((view) => view.key === chosen));
}

// The connection -----------------------------------------------------------------------------------------------------

/** Time in s at which the last word came, on this machine's clock; the least way from there to here. */
let heard = null;
let nearest = Infinity;
let over = false;
let viewToken = secret("view");

/** A token from behind the `#` or from this tab's memory; it does not stay in the address. */
function secret(name) {
  const given = new URLSearchParams(location.hash.slice(1));
  const found = given.get(name);
  if (found) {
    sessionStorage.setItem(name, found);
    given.delete(name);
    history.replaceState(null, "", given.size > 0 ? `#${given}` : location.pathname);
  }
  return sessionStorage.getItem(name) ?? "";
}

function take(message) {
  heard = performance.now() / 1000;
  if (message.hello) {
    nearest = Infinity;
    greet(message);
  } else if (test) {
    for (const bin of message.bins) {
      recent.push(bin, running);
      whole.push(bin, running);
    }
  } else {
    return;
  }
  if (message.state) {
    state = message.state;
    nearest = Math.min(nearest, heard - state.sent);
    over = Boolean(state.ended);
    showState();
  }
  stale = true;
  watch();
}

/** The stream that is read now. */
let reading = null;

async function listen() {
  for (;;) {
    try {
      const headers = viewToken ? { Authorization: `Bearer ${viewToken}` } : {};
      const answer = await fetch("/stream", { headers, cache: "no-store" });
      if (answer.status === 401) {
        await ask(viewToken !== "");
        continue;
      }
      if (!answer.ok) throw new Error(String(answer.status));
      $("looking").hidden = true;
      reading = answer.body.getReader();
      await read(reading);
    } catch {
      // Whatever it was, the alarm says how long nothing has come.
    }
    watch();
    if (over) return;
    await new Promise((done) => setTimeout(done, heard === null ? 3000 : 1000));
  }
}

async function read(reader) {
  const decoder = new TextDecoder();
  let rest = "";
  for (;;) {
    const { value, done } = await reader.read();
    if (done) return;
    rest += decoder.decode(value, { stream: true });
    const events = rest.split("\n\n");
    rest = events.pop();
    for (const event of events) {
      if (event.startsWith("data: ")) take(JSON.parse(event.slice(6)));
    }
  }
}

/** Waits until somebody has typed a viewing token. */
function ask(wrong) {
  $("looking").hidden = false;
  $("refused").textContent = wrong ? "This token is not the right one." : "";
  return new Promise((done) => {
    $("looking").onsubmit = (event) => {
      event.preventDefault();
      viewToken = $("view").value.trim();
      sessionStorage.setItem("view", viewToken);
      done();
    };
  });
}

/** A picture that stands still must not look alive: says what is wrong with it. */
function watch() {
  const trips = over ? [] : state?.now.trips ?? [];
  const tripped = trips.length > 0 ? `TRIPPED: ${trips.map((trip) => trip.words).join("; ")}` : "";
  const alarm = (text, mild) => {
    const all = [tripped, text].filter(Boolean).join(" · ");
    $("alarm").hidden = !all;
    $("alarm").textContent = all;
    $("alarm").classList.toggle("mild", Boolean(mild) && !tripped);
  };
  const dead = (is) => {
    document.body.classList.toggle("dead", is);
    if (is) $("phase").className = "dead";
    else if (state) $("phase").className = dressed(state);
    if (state) $("phase").textContent = is ? "no data" : named(state);
  };
  document.body.classList.toggle("waiting", !state);
  if (over) {
    dead(false);
    return alarm("");
  }
  const now = performance.now() / 1000;
  if (heard === null) return alarm(now > 2 && $("looking").hidden ? "No connection to the test yet; trying again." : "");
  const quiet = now - heard;
  if (quiet > 1.5) {
    const since = new Date(Date.now() - 1000 * quiet).toLocaleTimeString();
    dead(true);
    return alarm(`NO DATA SINCE ${since} (${Math.round(quiet)} s): the connection is lost, what you see is old`);
  }
  const tick = test?.subject.tick_s ?? 0;
  if (state && state.age !== null && state.age > Math.max(2, 3 * tick) && state.phase !== "safe") {
    dead(true);
    return alarm(`NO ROWS FROM THE LOOP FOR ${Math.round(state.age)} s: what you see is old`);
  }
  dead(false);
  const behind = state ? heard - state.sent - nearest : 0;
  if (behind > 1.5) return alarm(`This picture is ${behind.toFixed(1)} s behind: the connection is slow`, true);
  return alarm("");
}

// The operator -------------------------------------------------------------------------------------------------------

function say(text, bad) {
  $("answer").textContent = text;
  $("answer").classList.toggle("bad", Boolean(bad));
}

/** What STOP does to the test where it stands: on the way out it freezes it. */
function stopMeans() {
  return state?.phase === "leaving" || state?.phase === "tripped" ? "freeze" : "end";
}

/** What the open question is about. */
let asked = null;

function askToStop() {
  asked = stopMeans();
  const ways = test?.subject.specimens ?? [];
  // Where nobody knows yet where they stand nobody is led anywhere.
  const stays = ["connected", "probing", "zeroing"].includes(state?.phase);
  const all = new Set(ways.map((specimen) => (stays ? "stays where it is" : specimen.at_end)));
  const each = all.size === 1 ? `every specimen ${[...all][0]}` : ways.map((specimen) => `${specimen.name} ${specimen.at_end}`).join(", ");
  const [what, then, not, stop] = asked === "freeze"
    ? ["Freeze the specimens where they are?", "The test has ended and its specimens are on their way out. STOP cuts that short: each stays where it is now, with the force that it has there.", "Let it go on", "FREEZE"]
    : ["Stop the test?", `It ends in an orderly way${each ? `: ${each}` : ""}. It cannot be continued from here.`, "Keep running", "STOP THE TEST"];
  $("sure-what").textContent = what;
  $("sure-then").textContent = then;
  $("sure-not").textContent = not;
  $("sure-stop").textContent = stop;
  $("sure").showModal();
}

/** So long an answer is waited for, ms. Then the request is taken back: what waits somewhere must not take effect later. */
const PATIENCE = 5000;

async function order(what) {
  const token = $("token").value.trim();
  if (!token) {
    $("token").focus();
    return say(`${what.toUpperCase()} needs the control token that was printed where the test was started.`, true);
  }
  say(`${what.toUpperCase()} …`);
  try {
    const headers = { Authorization: `Bearer ${token}` };
    // The hold that is on the screen, and no other one, ends.
    const which = what === "continue" ? `?hold=${state?.hold_number ?? 0}` : "";
    const signal = what === "stop" ? undefined : AbortSignal.timeout(PATIENCE);
    const answer = await fetch(`/control/${what}${which}`, { method: "POST", headers, cache: "no-store", signal });
    if (answer.status === 202) {
      sessionStorage.setItem("control", token);
      return say(`${what.toUpperCase()} accepted ${new Date().toLocaleTimeString()}`);
    }
    const text = answer.status === 503 ? "the queue of requests is full; try again" : (await answer.text()).trim();
    return say(`${what.toUpperCase()} REFUSED: ${text}`, true);
  } catch (error) {
    if (error.name === "TimeoutError") return say(`${what.toUpperCase()} TAKEN BACK: no answer for ${PATIENCE / 1000} s. Look at the test, and say it again.`, true);
    const there = what === "confirm" ? "continue" : what;
    return say(`${what.toUpperCase()} NOT SENT: no connection. Use \`gusset ${there} ${test?.subject.run ?? "RUN_DIR"}\` where the test runs.`, true);
  }
}

$("token").value = secret("control");
$("operate").addEventListener("submit", (event) => event.preventDefault());
$("hold").addEventListener("click", () => order("hold"));
// The second half of a double click is none: the first may have ended a hold, and the button asks for something else by now.
$("continue").addEventListener("click", (event) => {
  if (event.detail < 2) order($("continue").textContent.toLowerCase());
});
$("stop").addEventListener("click", askToStop);
$("sure").addEventListener("close", () => {
  if ($("sure").returnValue === "yes") order("stop");
  $("sure").returnValue = "";
});
$("quantity").addEventListener("change", () => { stale = true; });
for (const button of document.querySelectorAll("[data-window]")) {
  button.addEventListener("click", () => {
    span = Number(button.dataset.window);
    document.querySelectorAll("[data-window]").forEach((other) => other.setAttribute("aria-pressed", String(other === button)));
    stale = true;
  });
}
window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  if (!test) return;
  build();
  if (state) showState();
  stale = true;
});
document.addEventListener("visibilitychange", () => { stale = true; });
window.addEventListener("resize", () => { stale = true; });

// As often as the screen wants, but never more than half of the time.
let rest = 0;
function frame(at) {
  if (at >= rest) {
    const began = performance.now();
    drawAll();
    rest = performance.now() + (performance.now() - began);
  }
  requestAnimationFrame(frame);
}
requestAnimationFrame(frame);
setInterval(watch, 250);
listen();
