// Visits a run's report as tests/pages/browser/report.rs wants it seen: light, dark, printed, without scripts, its layout, or looked at only.
import { overlaps } from "./labels.mjs";
import { visit } from "./stage.mjs";

const [address, how, shot] = process.argv.slice(2);
const options = { colorScheme: how.endsWith("dark") ? "dark" : "light", javaScriptEnabled: how !== "noscript" };

/** What each open history shows: its part of the lines, and the share of its lines that are seen. */
const shown = (page) =>
  page.$$eval("figure.history svg.lines", (all) =>
    all
      .filter((lines) => !lines.closest("details"))
      .map((lines) => ({ part: lines.getAttribute("viewBox"), inked: [...lines.querySelectorAll("path")].some((path) => path.getTotalLength() > 10) })),
  );

/** Order, sizes, folded parts and colours of a page, and the number of its pages on paper. */
async function layout(page, found) {
  found.sections = await page.$$eval("main > section > h2", (all) => all.map((one) => one.textContent));
  found.tops = await page.$$eval("main > section", (all) => all.map((one) => one.getBoundingClientRect().top));
  found.headline = await page.$eval(".headline", (one) => one.getBoundingClientRect().bottom);
  found.open = await page.$$eval("details", (all) => all.filter((one) => one.open).length);
  found.folded = await page.$$eval("details summary", (all) => all.length);
  found.hidden = await page.$$eval("details table", (all) => all.filter((one) => one.checkVisibility()).length);
  const pictures = await page.$$eval("svg.chart", (all) => all.map((one) => [...one.querySelectorAll("text")].map((text) => text.textContent.trim())));
  found.bare = pictures.filter((texts) => texts.length < 3).length;
  // What the style sheet makes of the inks.
  found.inks = await page.evaluate(() => {
    const root = getComputedStyle(document.documentElement);
    return ["--paper", "--text", "--s0", "--s1", "--s2", "--s3", "--s4", "--s5"].map((name) => root.getPropertyValue(name).trim());
  });
  found.borders = await page.$$eval(".wide", (all) => all.filter((one) => getComputedStyle(one).backgroundImage !== "none").length);
  found.printed = (await page.pdf({ format: "A4", preferCSSPageSize: true })).toString("latin1").match(/\/Type\s*\/Page\b/g).length;
  await page.emulateMedia({ media: "print" });
  found.overlaps = await overlaps(page);
  await page.$$eval("details", (all) => all.forEach((one) => (one.open = true)));
  found.overlaps.push(...(await overlaps(page)));
}

await visit(address, options, async (page, found) => {
  await page.waitForTimeout(300);
  found.title = await page.title();
  found.scripts = await page.$$eval("script:not([type])", (all) => all.length);
  found.wide = await page.evaluate(() => document.documentElement.scrollWidth > innerWidth);
  found.pictures = await page.$$eval("figure svg.chart", (all) => all.filter((svg) => svg.getBoundingClientRect().height > 50).length);
  found.unfolded = await page.$$eval("figure svg.chart", (all) => all.filter((svg) => !svg.closest("details") && svg.getBoundingClientRect().height > 50).length);
  found.unnamed = await page.$$eval("figure svg.chart", (all) => all.filter((one) => !one.getAttribute("aria-label")).length);
  found.background = await page.evaluate(() => getComputedStyle(document.body).backgroundColor);
  found.empty = await page.$$eval("figure", (all) => {
    const isSeen = (one) => one.getBoundingClientRect().height > 50;
    return all.filter((figure) => ![...figure.querySelectorAll("svg")].some(isSeen)).length;
  });
  if (shot) await page.screenshot({ path: shot, fullPage: true });
  if (how.startsWith("layout")) return layout(page, found);
  if (how === "noscript" || how === "look") return;
  if (how === "print") {
    await page.emulateMedia({ media: "print" });
    found.printed = {
      tools: await page.$$eval(".tools, .read", (all) => all.filter((one) => one.getBoundingClientRect().height > 0).length),
      pictures: await page.$$eval("figure svg.chart", (all) => all.filter((svg) => svg.getBoundingClientRect().height > 50).length),
    };
    return;
  }
  found.before = await shown(page);
  const history = page.locator("figure.history").nth(1);
  const read = page.locator("figure.history").nth(2).locator(".read");
  await history.scrollIntoViewIfNeeded();
  const svg = await history.locator("svg.chart").boundingBox();
  const y = svg.y + svg.height / 2;
  const at = (share) => svg.x + svg.width * share;
  await page.mouse.move(at(0.3), y);
  found.value = await read.textContent();
  for (const share of [0.4, 0.5]) {
    await page.mouse.click(at(share), y);
    await page.waitForTimeout(400);
  }
  found.cursors = await read.textContent();
  await page.mouse.move(at(0.3), y);
  await page.mouse.down();
  await page.mouse.move(at(0.6), y, { steps: 6 });
  await page.mouse.up();
  found.zoomed = await shown(page);
  await history.locator("button", { hasText: "Whole" }).click();
  found.after = await shown(page);
  await history.locator("svg.chart").focus();
  await page.keyboard.press("+");
  found.nearer = await shown(page);
  await page.keyboard.press("ArrowRight");
  found.moved = await shown(page);
  await page.keyboard.press("0");
  found.again = await shown(page);
  const loop = page.locator("figure:not(.history)", { has: page.locator("svg.lines") }).first();
  await loop.scrollIntoViewIfNeeded();
  const part = () => loop.locator("svg.lines").getAttribute("viewBox");
  found.loop = [await part()];
  const place = await loop.locator("svg.chart").boundingBox();
  await page.mouse.move(place.x + 0.4 * place.width, place.y + 0.4 * place.height);
  await page.mouse.down();
  await page.mouse.move(place.x + 0.6 * place.width, place.y + 0.6 * place.height, { steps: 4 });
  await page.mouse.up();
  found.loop.push(await part());
  const [saved] = await Promise.all([page.waitForEvent("download"), history.locator("button", { hasText: "CSV" }).click()]);
  const chunks = [];
  for await (const chunk of await saved.createReadStream()) chunks.push(chunk);
  found.csv = Buffer.concat(chunks).toString("utf8").split("\n");
});
