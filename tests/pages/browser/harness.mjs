// Visits the page of tests/pages/browser/harness.rs.
import { painted, visit } from "./stage.mjs";

await visit(process.argv[2], {}, async (page, found) => {
  found.title = await page.title();
  found.painted = await painted(page, "canvas");
  await page.waitForTimeout(200);
});
