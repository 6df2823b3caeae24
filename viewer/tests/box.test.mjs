import assert from "node:assert/strict";
import { existsSync, readFileSync } from "node:fs";
import { join } from "node:path";
import { pathToFileURL } from "node:url";
import { after, before, test } from "node:test";
import { browse, difference, drawn, open, sample, shot } from "./page.mjs";

let served, browser, view;
before(async () => {
  served = await sample("--recording");
  browser = await browse();
  view = await open(browser, served.url, { viewport: { width: 1000, height: 700 } });
});
after(async () => {
  await browser?.close();
  await served?.close();
});

const value = (page = view.page) => page.evaluate(() => artgs.box.value);
const handle = (axis, side, page = view.page) => page.evaluate(([a, s]) => { const p = artgs.box.handle(a, s); return [p.x, p.y]; }, [axis, side]);
const option = (page = view.page) => page.locator("#box-option").textContent();
const inside = async () => Number((await view.page.getByText("points inside").textContent()).replace(/\D/g, ""));

test("a recording shows its points and offers a box, which highlights the points inside", async () => {
  const first = await shot(view.page);
  assert.ok(drawn(first) > 3000, `${drawn(first)} pixels`);
  assert.equal(await view.page.getByRole("button", { name: "End", exact: true }).count(), 0);
  assert.equal(await value(), null);
  await view.page.getByRole("button", { name: "Place a box" }).click();
  assert.equal(await option(), "--box -0.6,-0.1,-0.4,0.6,1.1,0.4");
  assert.ok(difference(first, await shot(view.page)).count > 3000);
  assert.ok((await inside()) > 1000);
  assert.deepEqual(view.complaints, []);
});

test("fields set the bounds, and wrong ones cannot be used", async () => {
  const before = await inside();
  await view.page.getByLabel("Highest y").fill("0.4");
  assert.deepEqual((await value()).upper, [0.6, 0.4, 0.4]);
  assert.equal(await option(), "--box -0.6,-0.1,-0.4,0.6,0.4,0.4");
  assert.ok((await inside()) < 0.8 * before, `${await inside()} of ${before} points`);
  for (const [text, words] of [["-0.2", "The highest y must be above the lowest."], ["", "y needs two numbers."]]) {
    await view.page.getByLabel("Highest y").fill(text);
    await view.page.getByText(words).waitFor();
    assert.ok(await view.page.getByRole("button", { name: "Save box" }).isDisabled());
    assert.deepEqual((await value()).upper, [0.6, 0.4, 0.4]);
  }
  await view.page.getByLabel("Highest y").fill("1.1");
  assert.ok(await view.page.getByRole("button", { name: "Save box" }).isEnabled());
});

test("a face follows the mouse along its axis, not beyond the opposite face", async () => {
  // Recording's frame with +Y up, so that the highest y is the top of the box.
  const [x, y] = await handle(1, "upper");
  const bottom = await handle(1, "lower");
  await view.page.mouse.move(x, y);
  await view.page.mouse.down();
  await view.page.mouse.move(x, (y + bottom[1]) / 2, { steps: 6 });
  const half = await value();
  assert.deepEqual([half.lower, half.upper[0], half.upper[2]], [[-0.6, -0.1, -0.4], 0.6, 0.4]);
  assert.ok(Math.abs(half.upper[1] - 0.5) < 0.12, `${half.upper[1]}`);
  assert.equal(await view.page.getByLabel("Highest y").inputValue(), `${half.upper[1]}`);
  const moved = await handle(1, "upper");
  assert.ok(Math.abs(moved[1] - (y + bottom[1]) / 2) < 4, `${moved} follows the pointer`);
  await view.page.mouse.move(x, bottom[1] + 120, { steps: 6 });
  await view.page.mouse.up();
  const { lower, upper } = await value();
  assert.ok(upper[1] > lower[1] && upper[1] < 0.1, `${upper[1]}`);
  // The view did not turn, and turns again beside the box.
  const before = await shot(view.page);
  await view.page.mouse.move(20, 650);
  await view.page.mouse.down();
  await view.page.mouse.move(140, 640, { steps: 4 });
  await view.page.mouse.up();
  assert.ok(difference(before, await shot(view.page)).count > 1000);
  assert.deepEqual(await value(), { lower, upper });
});

test("a finger moves a face", async () => {
  const { page, complaints } = await open(browser, served.url, { viewport: { width: 390, height: 780 }, hasTouch: true, isMobile: true, deviceScaleFactor: 2 });
  await page.getByRole("button", { name: "Place a box" }).click();
  const from = await handle(1, "upper", page);
  const client = await page.context().newCDPSession(page);
  const touch = (type, [x, y]) => client.send("Input.dispatchTouchEvent", { type, touchPoints: type === "touchEnd" ? [] : [{ x, y }] });
  // A finger is less exact than the mouse.
  await touch("touchStart", [from[0] + 12, from[1] - 8]);
  for (let i = 1; i <= 5; i++) await touch("touchMove", [from[0] + 12, from[1] - 8 - 6 * i]);
  await touch("touchEnd", from);
  const { lower, upper } = await value(page);
  assert.ok(upper[1] > 1.13 && upper[1] < 1.6, `${upper[1]}`);
  assert.deepEqual([lower, upper[0], upper[2]], [[-0.6, -0.1, -0.4], 0.6, 0.4]);
  assert.deepEqual(complaints, []);
  await page.close();
});

test("the option is copied, the file is saved and loaded again", async () => {
  const fields = { "Lowest x": "-0.55", "Highest x": "0.55", "Lowest y": "-0.02", "Highest y": "1.05", "Lowest z": "-0.3", "Highest z": "0.3" };
  for (const [name, text] of Object.entries(fields)) await view.page.getByLabel(name).fill(text);
  await view.page.context().grantPermissions(["clipboard-read", "clipboard-write"]);
  await view.page.getByRole("button", { name: "Copy" }).click();
  await view.page.getByText("Copied.").waitFor();
  assert.equal(await view.page.evaluate(() => navigator.clipboard.readText()), "--box -0.55,-0.02,-0.3,0.55,1.05,0.3");
  const file = join(served.folder, "object_box.json");
  assert.ok(!existsSync(file));
  await view.page.getByRole("button", { name: "Save box" }).click();
  await view.page.getByText("Saved in").waitFor();
  assert.deepEqual(JSON.parse(readFileSync(file, "utf8")), { format: "artgs-box", version: 1, lower: [-0.55, -0.02, -0.3], upper: [0.55, 1.05, 0.3] });
  const again = await open(browser, served.url);
  assert.equal(await option(again.page), "--box -0.55,-0.02,-0.3,0.55,1.05,0.3");
  await again.page.getByRole("button", { name: "Remove the box" }).click();
  assert.equal(await value(again.page), null);
  assert.deepEqual([...again.complaints, ...view.complaints], []);
  await again.page.close();
});

test("where nothing can be saved, the page says why and the option is copied", async () => {
  const other = await sample("--recording", "--unable");
  try {
    const { page } = await open(browser, other.url);
    await page.getByRole("button", { name: "Place a box" }).click();
    await page.getByText("The box cannot be saved: the folder is read-only. Copy the option instead.").waitFor();
    assert.equal(await page.getByRole("button", { name: "Save box" }).count(), 0);
    assert.ok(await page.getByRole("button", { name: "Copy" }).isEnabled());
    await page.goto(`${pathToFileURL(join(other.folder, "page.html")).href}?test`);
    await page.waitForFunction(() => globalThis.artgs);
    await page.evaluate(() => artgs.ready);
    await page.getByRole("button", { name: "Place a box" }).click();
    await page.getByText("This page cannot save files: copy the option.").waitFor();
    assert.equal(await option(page), "--box -0.6,-0.1,-0.4,0.6,1.1,0.4");
    await page.close();
  } finally {
    await other.close();
  }
});
