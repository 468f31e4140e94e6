"use strict";
// The live page: the state of the test as the server sends it, and the operator commands.

/** The first message of the server: the test and its past. */
let test = null;
/** The latest state. */
let state = null;
let recent = null;
let whole = null;
/** Seconds that the charts show; 0 for the whole test. */
let span = 60;
/** Whether the charts must be drawn again. */
let stale = true;

// Display -------------------------------------------------------------------------------------------------------------

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
  if (before) facts.unshift(`continues ${before.run} after step ${before.after}`);
  $("facts").textContent = facts.join(", ");
  $("facts").title = facts.join("\n");
  $("duration").textContent = `of ${(subject.steps * subject.dt).toFixed(2)} s`;
  $("outcome").hidden = true;
  document.body.classList.remove("ended");
  build();
}

function build() {
  buildCharts(test.subject, () => (span > 0 ? recent : whole));
  buildLimits(test.subject);
  buildTiming(test.subject);
}

function count(id, value, bad) {
  $(id).firstElementChild.textContent = value === null ? "–" : String(value);
  $(id).classList.toggle("bad", bad);
}

/** Phases as the page names them, where their word in files is another. */
const PHASES = { settling: "static load", probing: "wiring check", ramping: "ramp", holding: "hold", leaving: "shutdown", safe: "ended", armed: "warm-up" };

/** The phase in words, with a step that waits for a confirmation and a hold in another phase; at the end the status. */
function named({ phase, hold, stands, unconfirmed, ended }) {
  if (ended) return ended.status;
  const words = [PHASES[phase] ?? phase];
  if (unconfirmed) words.push(phase === "zeroing" ? "to be confirmed" : "unload every axis, then confirm");
  if (hold && phase !== "holding") words.push(stands ? "held" : "hold requested");
  return words.join(", ");
}

/** The class of the phase. The shutdown after a trip looks like the trip. */
function dressed({ phase, now, ended }) {
  if (ended) return ended.status;
  return now.trips.length > 0 ? "tripped" : phase;
}

function showPhase(text, kind) {
  put("phase", text);
  $("phase").className = `${kind}${text.length > 10 ? " long" : ""}`;
}

function showState() {
  const { now, phase, ended } = state;
  showPhase(named(state), dressed(state));
  $("phase").dataset.phase = ended ? "ended" : phase;
  $("time").textContent = now.rows > 0 && now.time !== null ? `${now.time.toFixed(2)} s` : "–";
  const share = test.subject.steps > 0 ? now.time / (test.subject.steps * test.subject.dt) : 0;
  $("progress").style.width = `${100 * Math.min(1, Math.max(0, share || 0))}%`;
  $("progress").parentElement.setAttribute("aria-valuenow", Math.round(100 * share) || 0);
  const real = test.subject.real_clock;
  count("recent", real ? now.recent_misses : null, now.recent_misses > 0);
  count("missed", real ? missed(now) : null, now.misses.ours > 0);
  count("lost", now.rows_lost, now.rows_lost > 0);
  showLimits(now);
  showTiming(now);
  showMargins(test.subject, now, state.lambda);
  showLinks(test, now, state.viewers);
  const over = Boolean(ended) || phase === "safe";
  // The shutdown is neither held nor continued.
  const deaf = over || phase === "leaving" || phase === "tripped";
  const holds = state.hold || phase === "holding";
  $("hold").disabled = deaf || holds;
  // The button sends the command of its label at the moment of the press, even if the state changes before it arrives.
  const asks = state.unconfirmed && !holds;
  $("continue").textContent = asks ? "CONFIRM" : "CONTINUE";
  $("continue").disabled = !asks && (deaf || !holds);
  $("stop").disabled = over;
  if ($("sure").open && (over || asked !== stopMeans())) {
    $("sure").close("no");
    say(over ? "The test has ended." : "The shutdown has begun. STOP would now freeze the specimens.", true);
  }
  if (ended) showEnd(ended);
}

/** The end of the test: status, reason, and the report, which the page loads before the server closes. */
function showEnd(ended) {
  document.body.classList.add("ended");
  $("outcome").className = ended.status;
  put("verdict", `Test ${ended.status}`);
  put("reason", ended.reason);
  put("path", ended.report ?? ended.data);
  $("outcome").hidden = false;
  if (!state.report || document.querySelector("#report iframe")) return;
  const frame = make("iframe");
  frame.title = "report of the test";
  frame.src = state.report;
  frame.addEventListener("load", () => { $("open-report").hidden = false; });
  $("report").append(frame);
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

/** Time in s of the last message on this machine's clock; smallest delay of a message so far. */
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
      // The alarm shows how long no message has come.
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

/** Waits for a viewing token from the user. */
function ask(wrong) {
  $("looking").hidden = false;
  $("refused").textContent = wrong ? "This viewing token is wrong." : "";
  return new Promise((done) => {
    $("looking").onsubmit = (event) => {
      event.preventDefault();
      viewToken = $("view").value.trim();
      sessionStorage.setItem("view", viewToken);
      done();
    };
  });
}

/** Sets the alarm. The age changes every second and is not read aloud. */
function alarm(text, { age = "", mild = false } = {}) {
  const trips = over ? [] : state?.now.trips ?? [];
  const tripped = trips.length > 0 ? `TRIPPED: ${trips.map((trip) => trip.words).join("; ")}` : "";
  const all = [tripped, text].filter(Boolean).join(". ");
  put("alarm-text", all);
  put("alarm-age", age);
  $("alarm").hidden = !all;
  $("alarm").classList.toggle("mild", mild && !tripped);
}

function showDead(dead) {
  document.body.classList.toggle("dead", dead);
  if (dead) showPhase("no data", "dead");
  else if (state) showPhase(named(state), dressed(state));
}

/** Says when what the page shows is old. */
function watch() {
  document.body.classList.toggle("waiting", !state);
  if (over) {
    showDead(false);
    return alarm("");
  }
  const now = performance.now() / 1000;
  if (heard === null) return alarm(now > 2 && $("looking").hidden ? "No connection to the test yet. The page tries again." : "");
  const quiet = now - heard;
  if (quiet > 1.5) {
    const since = new Date(Date.now() - 1000 * quiet).toLocaleTimeString();
    showDead(true);
    return alarm(`NO DATA SINCE ${since}: the connection is lost and the page shows old data`, { age: `(${Math.round(quiet)} s)` });
  }
  const tick = test?.subject.tick_s ?? 0;
  if (state && state.age !== null && state.age > Math.max(2, 3 * tick) && state.phase !== "safe") {
    showDead(true);
    return alarm("NO ROWS FROM THE LOOP: the page shows old data", { age: `(${Math.round(state.age)} s)` });
  }
  showDead(false);
  const behind = state ? heard - state.sent - nearest : 0;
  return behind > 1.5 ? alarm("The connection is slow: the page is late", { age: `by ${behind.toFixed(1)} s`, mild: true }) : alarm("");
}

// The operator -------------------------------------------------------------------------------------------------------

function say(text, bad) {
  $("answer").textContent = text;
  $("answer").classList.toggle("bad", Boolean(bad));
}

/** The effect of STOP now: it ends the test, and in the shutdown it freezes the specimens. */
function stopMeans() {
  return state?.phase === "leaving" || state?.phase === "tripped" ? "freeze" : "end";
}

/** The effect that the open dialog asks about. */
let asked = null;

/** Asks whether to stop, once the server has accepted the token: a wrong one is told before the question. */
async function askToStop() {
  if (!(await send("check", "stop")) || $("sure").open) return;
  say("");
  asked = stopMeans();
  const specimens = test?.subject.specimens ?? [];
  // Before the zero is known, no specimen moves to an end position.
  const stays = ["connected", "probing", "zeroing"].includes(state?.phase);
  const ends = specimens.map((specimen) => (stays ? "stays where it is" : specimen.at_end));
  const each = new Set(ends).size === 1 ? `Every specimen ${ends[0]}. ` : specimens.map((specimen, s) => `${specimen.name} ${ends[s]}. `).join("");
  const [what, then, not, stop] = asked === "freeze"
    ? ["Freeze the specimens where they are?", "The test has ended and the specimens move to their end position. STOP interrupts this: each specimen stays where it is now, under its present force.", "Continue the shutdown", "FREEZE"]
    : ["Stop the test?", `The controller ends the test in an orderly way. ${each}This page cannot continue the test afterwards.`, "Keep running", "STOP THE TEST"];
  $("sure-what").textContent = what;
  $("sure-then").textContent = then;
  $("sure-not").textContent = not;
  $("sure-stop").textContent = stop;
  $("sure").showModal();
}

/** Longest wait for an answer, ms. After it the request is withdrawn, so that it cannot take effect later. */
const PATIENCE = 5000;

async function order(what) {
  if (await send(what, what)) say(`${what.toUpperCase()} accepted at ${new Date().toLocaleTimeString()}`);
}

/** Sends a request on the way to `what`; true if the server has accepted it. Everything else is told. */
async function send(request, what) {
  const token = $("token").value.trim();
  if (!token) {
    $("token").focus();
    say(`${what.toUpperCase()} needs the control token. The terminal shows it where the test was started.`, true);
    return false;
  }
  say(`${what.toUpperCase()} …`);
  try {
    const headers = { Authorization: `Bearer ${token}` };
    // The command ends the hold that the page shows, and no later one.
    const which = request === "continue" ? `?hold=${state?.hold_number ?? 0}` : "";
    const signal = request === "stop" ? undefined : AbortSignal.timeout(PATIENCE);
    const answer = await fetch(`/control/${request}${which}`, { method: "POST", headers, cache: "no-store", signal });
    if (answer.status === 202) {
      sessionStorage.setItem("control", token);
      return true;
    }
    const text = answer.status === 503 ? "the queue of requests is full; try again" : (await answer.text()).trim();
    say(`${what.toUpperCase()} REFUSED: ${text}`, true);
    if (answer.status === 401) $("token").focus();
  } catch (error) {
    // A slow answer does not keep STOP back.
    if (request === "check" && error.name === "TimeoutError") return true;
    if (error.name === "TimeoutError") say(`${what.toUpperCase()} WITHDRAWN: no answer for ${PATIENCE / 1000} s. Check the test and press the button again.`, true);
    else {
      const there = what === "confirm" ? "continue" : what;
      say(`${what.toUpperCase()} NOT SENT: no connection. Use \`gusset ${there} ${test?.subject.run ?? "RUN_DIR"}\` on the controller.`, true);
    }
  }
  return false;
}

$("token").value = secret("control");
$("operate").addEventListener("submit", (event) => event.preventDefault());
$("hold").addEventListener("click", () => order("hold"));
// The second click of a double click does not count: the first may have ended a hold, and then the label is another one.
$("continue").addEventListener("click", (event) => {
  if (event.detail < 2) order($("continue").textContent.toLowerCase());
});
$("stop").addEventListener("click", askToStop);
$("sure").addEventListener("close", () => {
  if ($("sure").returnValue === "yes") order("stop");
  $("sure").returnValue = "";
});
/** Shows the report over the page, or the page again. The address stays as it is. */
function showReport(event, open) {
  event.preventDefault();
  $("report").hidden = !open;
  $(open ? "close-report" : "open-report").focus();
}

$("open-report").addEventListener("click", (event) => showReport(event, true));
$("close-report").addEventListener("click", (event) => showReport(event, false));
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

// At the rate of the screen, for at most half of the time; twice a second for users who want reduced motion.
const reducedMotion = window.matchMedia("(prefers-reduced-motion: reduce)");
let rest = 0;
function frame(at) {
  if (at >= rest) {
    const began = performance.now();
    drawAll();
    rest = performance.now() + (reducedMotion.matches ? 500 : performance.now() - began);
  }
  requestAnimationFrame(frame);
}
requestAnimationFrame(frame);
setInterval(watch, 250);
listen();
