// One browser for one visit: opens a page in headless Chromium, lets `act` look and click as a person would, and says
// what went wrong behind the scenes: console messages, page errors, requests that would have left the machine.
//
// The last line on stdout is a JSON document; tests/pages/browser/mod.rs reads it.

import { createRequire } from "node:module";
import process from "node:process";

const { chromium } = createRequire(process.env.GUSSET_BROWSER_MODULES + "/")("playwright-core");

const QUIET = [
  "--no-sandbox",
  "--disable-gpu",
  "--disable-quic",
  "--no-first-run",
  "--disable-background-networking",
  "--disable-component-update",
  "--disable-sync",
];

/** Whether a request stays on this machine. */
function stays(address) {
  const { protocol, hostname } = new URL(address);
  return ["file:", "data:", "blob:"].includes(protocol) || ["127.0.0.1", "localhost", "[::1]"].includes(hostname);
}

/**
 * Opens `address` and calls `act(page, found, context)`; whatever `act` writes into `found` is reported beside `console`,
 * `errors` and `left` (addresses off this machine). `options` are those of a Playwright context (viewport, colorScheme, …).
 */
export async function visit(address, options, act) {
  const browser = await chromium.launch({ executablePath: process.env.GUSSET_BROWSER, args: QUIET });
  const found = { console: [], errors: [], left: [] };
  try {
    const context = await browser.newContext({ viewport: { width: 1280, height: 900 }, ...options });
    await context.route("**/*", (route) => {
      const to = route.request().url();
      if (stays(to)) return route.continue();
      found.left.push(to);
      return route.abort();
    });
    context.on("console", (message) => found.console.push(`${message.type()}: ${message.text()}`));
    context.on("weberror", (error) => found.errors.push(String(error.error())));
    const page = await context.newPage();
    page.setDefaultTimeout(20_000);
    await page.goto(address, { waitUntil: "load" });
    await act(page, found, context);
  } catch (error) {
    found.errors.push(String(error?.stack ?? error));
  } finally {
    await browser.close();
  }
  console.log(JSON.stringify(found));
}

/** Pixels of a canvas that are not its background, as a share of all: 0 for a plot that is empty. */
export async function painted(page, selector) {
  return page.locator(selector).first().evaluate((canvas) => {
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    let inked = 0;
    for (let at = 3; at < data.length; at += 4) if (data[at] > 0) inked += 1;
    return (4 * inked) / data.length;
  });
}
