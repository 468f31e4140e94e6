// Visits a run's report as tests/pages/browser/report.rs wants it seen: light, dark, printed, without scripts, its layout, or looked at only.
import { overlaps } from "./labels.mjs";
import { visit } from "./stage.mjs";

const [address, how, shot] = process.argv.slice(2);
const options = { colorScheme: how.endsWith("dark") ? "dark" : "light", javaScriptEnabled: how !== "noscript" };

/** What stands on the canvases: share of inked pixels and a digest of each. */
const canvases = (page) =>
  page.$$eval(".plot canvas", (all) =>
    all.map((canvas) => {
      // A copy: reading the page's own canvas again and again would be remarked upon in the console.
      const copy = new OffscreenCanvas(canvas.width, canvas.height).getContext("2d", { willReadFrequently: true });
      copy.drawImage(canvas, 0, 0);
      const { data } = copy.getImageData(0, 0, canvas.width, canvas.height);
      let inked = 0;
      let digest = 0;
      for (let at = 0; at < data.length; at += 4) {
        if (data[at + 3] === 0) continue;
        inked += 1;
        digest = (digest * 31 + at + data[at] * 7 + data[at + 1] * 3 + data[at + 2]) % 4294967291;
      }
      return { inked: (4 * inked) / data.length, digest };
    }),
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
  found.pictures = await page.$$eval("figure svg", (all) => all.filter((svg) => svg.getBoundingClientRect().height > 50).length);
  found.unfolded = await page.$$eval("figure svg", (all) => all.filter((svg) => !svg.closest("details") && svg.getBoundingClientRect().height > 50).length);
  found.unnamed = await page.$$eval("figure svg, .plot", (all) => all.filter((one) => !one.getAttribute("aria-label")).length);
  found.background = await page.evaluate(() => getComputedStyle(document.body).backgroundColor);
  // With a picture or with a plot: a frame round nothing tells nobody anything.
  found.empty = await page.$$eval("figure", (all) => {
    const isSeen = (one) => one.getBoundingClientRect().height > 50;
    return all.filter((figure) => ![...figure.querySelectorAll("svg, .plot")].some(isSeen)).length;
  });
  if (shot) await page.screenshot({ path: shot, fullPage: true });
  if (how.startsWith("layout")) return layout(page, found);
  if (how === "noscript" || how === "look") return;
  if (how === "print") {
    await page.emulateMedia({ media: "print" });
    found.printed = {
      canvases: await page.$$eval(".plot", (all) => all.filter((plot) => plot.getBoundingClientRect().height > 0).length),
      pictures: await page.$$eval("figure svg", (all) => all.filter((svg) => svg.getBoundingClientRect().height > 50).length),
    };
    return;
  }
  found.before = await canvases(page);
  const over = page.locator(".plot .u-over").nth(1);
  await over.scrollIntoViewIfNeeded();
  const box = await over.boundingBox();
  const y = box.y + box.height / 2;
  await page.mouse.move(box.x + box.width * 0.3, y);
  found.legend = await page.locator(".plot").nth(2).locator(".u-value").nth(1).textContent();
  await page.mouse.down();
  await page.mouse.move(box.x + box.width * 0.6, y, { steps: 6 });
  await page.mouse.up();
  await page.waitForTimeout(200);
  found.zoomed = await canvases(page);
  found.button = await page.locator(".whole").isVisible();
  await page.locator(".whole").click();
  await page.mouse.move(2, 2);
  await page.waitForTimeout(200);
  found.after = await canvases(page);
  found.hidden = await page.locator(".whole").isHidden();
});
