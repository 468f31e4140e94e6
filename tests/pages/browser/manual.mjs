// Visits the web pages of the guide as tests/pages/browser/manual.rs wants them seen: light, dark, narrow, or printed.
import { visit } from "./stage.mjs";

const [address, how, shot] = process.argv.slice(2);
const options = { colorScheme: how === "dark" ? "dark" : "light" };
if (how === "narrow") {
  options.viewport = { width: 400, height: 800 };
}

await visit(address, options, async (page, found) => {
  found.title = await page.title();
  found.wide = await page.evaluate(() => document.documentElement.scrollWidth > innerWidth);
  found.background = await page.evaluate(() => getComputedStyle(document.body).backgroundColor);
  found.links = await page.$$eval("nav a", (all) => all.length);
  if (how === "print") {
    await page.emulateMedia({ media: "print" });
    found.navigation = await page.locator("nav").isVisible();
    return;
  }
  if (shot) await page.screenshot({ path: shot });
  await page.fill("#search", "command_disp_m");
  found.results = await page.$$eval("#found a", (all) => all.map((link) => link.getAttribute("href")));
  found.marked = await page.$$eval("#found mark", (all) => all.length);
  found.article = await page.locator("article").isVisible();
  if (shot) await page.screenshot({ path: shot.replace(".png", "-found.png") });
  await page.fill("#search", "no such words anywhere");
  found.nothing = await page.$$eval("#found a", (all) => all.length);
  await page.press("#search", "Escape");
  found.back = await page.locator("article").isVisible();
  await page.fill("#search", "command_disp_m");
  await page.press("#search", "Enter");
  await page.waitForURL(/configuration\.html#/);
  found.target = await page.locator(":target").innerText();
});
