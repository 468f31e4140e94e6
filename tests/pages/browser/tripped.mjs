// Looks at a test that trips and takes long on its way out, and freezes it: arguments as of live.mjs.
import { visit } from "./stage.mjs";

const [address, token, shots] = process.argv.slice(2);

await visit(address, { viewport: { width: 1920, height: 1080 } }, async (page, found) => {
  const text = (selector) => page.locator(selector).textContent();
  await page.waitForFunction(() => document.querySelector("#phase").dataset.phase === "leaving" && !document.querySelector("#alarm").hidden);
  found.phase = await page.locator("#phase").getAttribute("class");
  // The longest word of a phase has one line.
  found.lines = await page.evaluate(() => {
    const range = document.createRange();
    range.selectNodeContents(document.querySelector("#phase"));
    return range.getClientRects().length;
  });
  found.alarm = await text("#alarm");
  found.bars = await page.locator("#bars .bar.tripped .name").allTextContents();
  found.warned = await page.locator("#bars .bar.warned").count();
  await page.screenshot({ path: `${shots}/live-tripped.png` });
  await page.fill("#token", token);
  await page.click("#stop");
  await page.locator("#sure").waitFor();
  found.asked = await text("#sure-stop");
  await page.screenshot({ path: `${shots}/live-freeze.png` });
  await page.click("#sure-stop");
  await page.waitForFunction(() => !document.querySelector("#outcome").hidden);
  found.outcome = await text("#outcome");
  found.tripped_after = await page.locator("#bars .bar.tripped").count();
});
