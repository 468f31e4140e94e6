// Looks at one test on screens of two sizes and operates it with the keyboard only: argument 1 is the address, 2 the control
// token, 3 a folder for screenshots, 4 "look" for a test with several axes that is only looked at and stopped.
import { visit } from "./stage.mjs";

const [address, token, shots, how] = process.argv.slice(2);

const SIZES = [[1280, 720], [1920, 1080]];
const NAMED = ["#phase", "#time", "#recent", "#missed", "#lost", "#token", "#hold", "#continue", "#stop", "#response-chart", "#ground-chart", "#loops canvas",
  "#margins", "#limits", "#late", "#percentiles"];
/** What is gone after the end, and what is new. */
const OPERATE = ["#token", "#hold", "#continue", "#stop"];
const END = ["#verdict", "#reason", "#open-report", "#path"];

const until = (page, phase) => page.waitForFunction((phase) => document.querySelector("#phase").dataset.phase === phase, phase);
const focused = (page) => page.evaluate(() => document.activeElement.id);

/** Named elements that are missing, outside the screen, too small, cut, or over another one. */
const faults = (page, names) => page.evaluate((names) => {
  const found = [];
  const boxes = names.flatMap((name) => {
    const all = [...document.querySelectorAll(name)];
    if (all.length === 0) found.push(`${name} is missing`);
    return all.map((element, at) => ({ element, name: `${name} ${at}`, box: element.getBoundingClientRect() }));
  });
  for (const { element, name, box } of boxes) {
    if (box.width < 8 || box.height < 8) found.push(`${name} is hidden`);
    if (box.left < 0 || box.top < 0 || box.right > innerWidth || box.bottom > innerHeight) found.push(`${name} is outside the screen`);
    if (element.matches("canvas, .chart") && (box.width < 150 || box.height < 60)) found.push(`${name} is too small`);
  }
  boxes.forEach((one, at) => boxes.slice(at + 1).forEach((other) => {
    if (one.element.contains(other.element) || other.element.contains(one.element)) return;
    const wide = Math.min(one.box.right, other.box.right) - Math.max(one.box.left, other.box.left);
    const high = Math.min(one.box.bottom, other.box.bottom) - Math.max(one.box.top, other.box.top);
    if (wide > 0 && high > 0) found.push(`${one.name} is over ${other.name}`);
  }));
  for (const element of document.querySelectorAll("td, th, .bar .name, .bar .value, .counts span, #phase, button")) {
    if (element.scrollWidth > element.clientWidth + 1) found.push(`${element.textContent} is cut`);
    const card = element.closest(".card")?.getBoundingClientRect();
    if (card && element.getBoundingClientRect().right > card.right) found.push(`${element.textContent} sticks out of its card`);
  }
  return found;
}, names);

/** The faults on both sizes, light and dark. */
async function onScreens(page, names) {
  const found = [];
  for (const [width, height] of SIZES) {
    await page.setViewportSize({ width, height });
    await page.waitForTimeout(600);
    found.push(...(await faults(page, names)).map((fault) => `${width}: ${fault}`));
  }
  await page.setViewportSize({ width: SIZES[0][0], height: SIZES[0][1] });
  return found;
}

/** Pixels of the response in the colour of each line. */
const inked = (page) => page.evaluate(() => {
  const canvas = document.querySelector("#response-chart canvas");
  // A copy: reading the canvas of the page again and again puts a warning into the console.
  const copy = new OffscreenCanvas(canvas.width, canvas.height).getContext("2d", { willReadFrequently: true });
  copy.drawImage(canvas, 0, 0);
  const { data } = copy.getImageData(0, 0, canvas.width, canvas.height);
  return [...document.querySelectorAll("#response-legend line")].map((line) => {
    const [r, g, b] = line.getAttribute("stroke").match(/\w\w/g).map((part) => parseInt(part, 16));
    let count = 0;
    for (let at = 0; at < data.length; at += 4) {
      if (Math.abs(data[at] - r) + Math.abs(data[at + 1] - g) + Math.abs(data[at + 2] - b) < 12 && data[at + 3] > 200) count += 1;
    }
    return count;
  });
});

/** What a screen reader is told: elements without a name, and roles. */
const told = (page) => page.evaluate(() => {
  const name = (one) => one.getAttribute("aria-label") || one.labels?.[0]?.textContent || (one.matches("button, a") && one.textContent.trim());
  const all = [...document.querySelectorAll("button, input, select, [role=img], [role=meter], [role=progressbar], iframe")];
  const seen = all.filter((one) => one.getClientRects().length > 0);
  return {
    unnamed: seen.filter((one) => !name(one)).map((one) => one.outerHTML.slice(0, 80)),
    phase: document.querySelector("#phase").getAttribute("aria-live"),
    alarm: document.querySelector("#alarm").getAttribute("role"),
    meters: [...document.querySelectorAll("[role=meter]")].filter((one) => !one.getAttribute("aria-valuetext")).length,
  };
});

await visit(address, { viewport: { width: 1280, height: 720 } }, async (page, found) => {
  const state = async () => [await page.locator("#phase").getAttribute("data-phase"), await page.locator("#phase").getAttribute("class")];
  if (how !== "look") {
    // Before the first state; a browser of its own, because the console tells of the request that fails.
    const waiting = await (await page.context().browser().newContext()).newPage();
    await waiting.route("**/stream", (route) => route.abort());
    await waiting.goto(address);
    await waiting.waitForFunction(() => !document.querySelector("#alarm").hidden);
    found.before = [await waiting.locator("body").getAttribute("class"), await waiting.locator("#outcome").isVisible()];
    await waiting.close();
  }
  await until(page, "running");
  await page.waitForTimeout(4000);
  found.running = await state();
  found.faults = await onScreens(page, NAMED);
  found.inked = await inked(page);
  found.told = await told(page);
  // Elastic to (1, 1), then yielding to (3, 1.2): the page keeps the corner when it thins.
  found.corners = await page.evaluate(() => corners([0, 0, 0.5, 0.5, 1, 1, 2, 1.1, 3, 1.2]));
  found.labels = await page.evaluate(() => [...document.querySelectorAll(".bar .name, .counts span, h2, h3")].map((one) => one.textContent));
  found.loops = await page.locator("#loops canvas").count();
  await page.screenshot({ path: `${shots}/screen-${how ?? "keys"}.png` });
  if (how !== "look") {
    // A line is hidden and shown from its legend.
    const first = page.locator("#response-legend button").first();
    await first.focus();
    await page.keyboard.press("Space");
    await page.waitForTimeout(600);
    found.without = [await first.getAttribute("aria-pressed"), (await inked(page))[0]];
    await page.keyboard.press("Space");
    // Reduced motion: how often the charts are drawn.
    const drawn = () => page.evaluate(async () => {
      let count = 0;
      const draw = Strip.prototype.draw;
      Strip.prototype.draw = function (...all) { count += 1; return draw.apply(this, all); };
      await new Promise((done) => setTimeout(done, 3000));
      Strip.prototype.draw = draw;
      return count / strips.length;
    });
    await page.emulateMedia({ reducedMotion: "reduce" });
    await page.waitForTimeout(600);
    found.reduced = await drawn();
    await page.emulateMedia({ reducedMotion: "no-preference" });

    // The keyboard alone from here on.
    await page.reload();
    await until(page, "running");
    await page.keyboard.press("Tab");
    found.order = [await focused(page)];
    await page.keyboard.type(token);
    await page.keyboard.press("Tab");
    found.order.push(await focused(page));
    found.outline = await page.evaluate(() => getComputedStyle(document.activeElement).outlineStyle);
    await page.keyboard.press("Enter");
    await until(page, "holding");
    found.held = await state();
    found.faults.push(...(await onScreens(page, NAMED)));
    await page.keyboard.press("Tab");
    found.order.push(await focused(page));
    await page.keyboard.press("Enter");
    await until(page, "running");
    await page.keyboard.press("Tab");
    found.order.push(await focused(page));
    await page.keyboard.press("Enter");
  } else {
    await page.fill("#token", token);
    await page.click("#stop");
  }
  await page.locator("#sure").waitFor();
  found.dialog = [await page.locator("#sure").isVisible(), await focused(page)];
  await page.keyboard.press("Tab");
  found.dialog.push(await focused(page));
  await page.keyboard.press("Enter");
  await until(page, "ended");
  await page.locator("#open-report").waitFor();
  found.ended = await state();
  found.faults.push(...(await onScreens(page, [...NAMED.filter((name) => !OPERATE.includes(name)), ...END])));
  found.after = { operate: await page.locator("#operate").isVisible(), alarm: await page.locator("#alarm").isVisible() };
  found.path = await page.locator("#path").textContent();
  await page.screenshot({ path: `${shots}/screen-${how ?? "keys"}-end.png` });
  // The server is gone by now, and the report is still there.
  await page.waitForTimeout(6000);
  await page.locator("#open-report").focus();
  await page.keyboard.press("Enter");
  const heading = page.frameLocator("#report iframe").locator("h1");
  found.report = [await page.locator("#report iframe").isVisible(), await heading.textContent()];
  await page.locator("#close-report").click();
  found.closed = await page.locator("#report").isVisible();
});
