// Attends a running test on its live page: argument 1 is the address, 2 the control token, 3 a folder for screenshots.
import { painted, visit } from "./stage.mjs";

const [address, token, shots] = process.argv.slice(2);

const phase = (page) => page.locator("#phase").getAttribute("data-phase");
const until = (page, word) => page.waitForFunction((word) => document.querySelector("#phase").dataset.phase === word, word);
const command = (page) => page.locator("#bars .bar .value").first().textContent();
const time = (page) => page.locator("#time").textContent();
const count = (page, script) => page.evaluate(script);

/** What is painted in every canvas of the page; a busy machine has some seconds for it. */
async function plots(page) {
  for (let look = 0; ; look += 1) {
    const shares = [];
    for (let at = 0; at < (await page.locator("canvas").count()); at += 1) {
      shares.push(await painted(page, `canvas >> nth=${at}`));
    }
    if (look === 20 || (shares.length > 0 && shares.every((share) => share > 0.01))) return shares;
    await page.waitForTimeout(500);
  }
}

/** Elements that stick out of the page, or whose text is cut off. */
const clipped = (page) => page.evaluate(() => {
  const wide = document.documentElement.clientWidth;
  const found = [];
  for (const element of document.querySelectorAll("body *")) {
    const box = element.getBoundingClientRect();
    if (box.width === 0 || box.height === 0) continue;
    if (box.right > wide + 1 || box.left < -1) found.push(`${element.tagName}#${element.id}.${element.className} sticks out`);
    const style = getComputedStyle(element);
    const cut = element.scrollWidth > element.clientWidth + 1 && style.overflowX === "hidden" && style.textOverflow !== "ellipsis";
    if (cut && !element.closest(".track")) found.push(`${element.tagName}#${element.id}.${element.className} is cut`);
  }
  return found;
});

await visit(address, { viewport: { width: 1920, height: 1080 } }, async (page, found, context) => {
  await until(page, "running");
  await page.waitForTimeout(3000);
  found.title = await page.title();
  found.plots = await plots(page);
  found.bars = await page.locator(".bar").count();
  found.value = await command(page);
  found.clipped = await clipped(page);
  await page.screenshot({ path: `${shots}/live-light.png` });

  // Without a token, and with a wrong one.
  await page.click("#hold");
  found.tokenless = await page.locator("#answer").textContent();
  await page.fill("#token", "abcd-efgh-jkmn-pqrs-tuvw");
  const refused = page.waitForResponse("**/control/hold");
  await page.click("#hold");
  found.wrong = (await refused).status();
  await page.waitForFunction(() => document.querySelector("#answer").textContent.includes("REFUSED"));
  found.refusal = await page.locator("#answer").textContent();
  found.after_refusal = await phase(page);
  // A refused request is told in the console by the browser itself: that one line is expected, and no other.
  found.expected = found.console.splice(0);

  await page.fill("#token", token);
  await page.click("#hold");
  await until(page, "holding");
  await page.waitForTimeout(500);
  const held = [await time(page), await command(page)];
  await page.waitForTimeout(1200);
  found.held = [held, [await time(page), await command(page)]];
  await page.screenshot({ path: `${shots}/live-hold.png` });

  // A second viewer, dark and narrow, finds the past, and what is held.
  const other = await context.browser().newContext({ viewport: { width: 420, height: 900 }, colorScheme: "dark" });
  const second = await other.newPage();
  second.on("console", (message) => found.console.push(`second: ${message.text()}`));
  second.on("pageerror", (error) => found.errors.push(`second: ${error}`));
  await second.goto(address);
  await until(second, "holding");
  await second.waitForTimeout(800);
  found.second = { plots: await plots(second), clipped: await clipped(second), bins: await count(second, "whole.x.length") };
  await second.screenshot({ path: `${shots}/live-narrow-dark.png`, fullPage: true });
  await second.setViewportSize({ width: 1920, height: 1080 });
  await second.waitForTimeout(800);
  await second.screenshot({ path: `${shots}/live-dark.png` });

  // A reload keeps the token and the past.
  await page.reload();
  await until(page, "holding");
  await page.waitForTimeout(800);
  found.reloaded = { plots: await plots(page), token: (await page.inputValue("#token")).length, bins: await count(page, "whole.x.length") };
  found.in_address = page.url();

  await page.click("#continue");
  await until(page, "running");
  await page.waitForFunction((old) => document.querySelector("#time").textContent !== old, held[0]);
  found.went_on = (await time(page)) !== held[0];

  // A connection that is lost is said at once and does not look alive; it comes back by itself.
  await other.setOffline(true);
  await second.evaluate("window.fetch = () => Promise.reject(new Error('offline')); reading?.cancel()");
  await second.waitForFunction(() => document.querySelector("#alarm").textContent.startsWith("NO DATA SINCE"));
  found.lost = { alarm: await second.locator("#alarm").textContent(), phase: await second.locator("#phase").getAttribute("class"), dead: await second.locator("body").getAttribute("class") };
  await second.screenshot({ path: `${shots}/live-lost.png` });
  await other.setOffline(false);
  await second.reload();
  await until(second, "running");
  await second.waitForFunction(() => document.querySelector("#alarm").hidden);

  // A wrong token is told before the question.
  await page.fill("#token", "abcd-efgh-jkmn-pqrs-tuvw");
  await page.click("#stop");
  await page.waitForFunction(() => document.querySelector("#answer").textContent.includes("STOP REFUSED"));
  found.unasked = await page.locator("#sure").evaluate((dialog) => !dialog.open);
  // As above, the browser tells of one refused request.
  found.expected.push(...found.console.splice(-1));
  await page.fill("#token", token);

  // STOP asks first.
  await page.click("#stop");
  await page.locator("#sure").waitFor();
  found.asked = await page.locator("#sure-then").textContent();
  await page.locator("#sure button[value=no]").click();
  await page.waitForTimeout(300);
  found.kept_running = await phase(page);
  await page.click("#stop");
  await page.click("#sure-stop");
  await page.waitForFunction(() => !document.querySelector("#outcome").hidden);
  await second.waitForFunction(() => !document.querySelector("#outcome").hidden);
  found.outcome = await page.locator("#outcome").textContent();
  found.second_outcome = await second.locator("#outcome").getAttribute("class");
  await page.screenshot({ path: `${shots}/live-end.png` });
  await page.waitForTimeout(2500);
  found.alarm_after = await page.locator("#alarm").isVisible();
});
