// Visits a comparison, an identification or a verification as tests/pages/browser/sections.rs wants it seen.
import { overlaps } from "./labels.mjs";
import { visit } from "./stage.mjs";

const [address, scheme, shot] = process.argv.slice(2);

/** Title and names of the axes of each picture; the name of an axis ends with its unit: "displacement (mm)", "gain (–)". */
const plots = (page) =>
  page.$$eval("figure svg.chart", (pictures) =>
    pictures.map((picture) => {
      const texts = [...picture.querySelectorAll("text")];
      const words = (text) => text.textContent.trim();
      const axes = texts.filter((text) => /\S \([^()]+\)$/.test(words(text)));
      const isTurned = (text) => (text.getAttribute("transform") ?? "").includes("rotate");
      return {
        title: texts.filter((text) => text.getAttribute("font-weight") === "bold").map(words),
        across: axes.filter((text) => !isTurned(text)).map(words),
        up: axes.filter(isTurned).map(words),
      };
    }),
  );

await visit(address, { colorScheme: scheme, viewport: { width: 1280, height: 720 } }, async (page, found) => {
  await page.waitForTimeout(300);
  found.wide = await page.evaluate(() => document.documentElement.scrollWidth > innerWidth);
  // From top to bottom, with the place of each part.
  found.parts = await page.$$eval("h1, .headline, .tiles, main > section > h2", (all) =>
    all.map((one) => [one.matches("h2") ? one.textContent : one.className || "title", one.getBoundingClientRect().top]),
  );
  found.colours = await page.evaluate(() => ["--paper", "--text", "--s0"].map((name) => getComputedStyle(document.documentElement).getPropertyValue(name)));
  found.open = await page.$$eval("details", (all) => all.filter((one) => one.open).length);
  found.folded = await page.$$eval("details > summary", (all) => all.length);
  found.borders = await page.$$eval(".wide", (all) => all.filter((one) => getComputedStyle(one).backgroundImage !== "none").length);
  found.sheet = await page.$$eval("style", (all) => all.map((one) => one.textContent).join("\n").includes(".tiles div { border: 1px solid var(--edge)"));
  if (shot) await page.screenshot({ path: shot, fullPage: true });
  await page.emulateMedia({ media: "print" });
  found.plots = await plots(page);
  await page.$$eval("details", (all) => all.forEach((one) => (one.open = true)));
  found.overlaps = await overlaps(page);
});
