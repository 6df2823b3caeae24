import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { browse, colour, difference, drawn, open, sample, shot } from "./page.mjs";

let browser;
before(async () => (browser = await browse()));
after(() => browser?.close());

/** Waits until `artgs.live()` has these values. */
const until = (page, wanted) => page.waitForFunction((w) => Object.entries(w).every(([k, v]) => artgs.live()[k] === v), wanted);

test("the page follows a run: Gaussians are replaced, curves grow, parts get colours, and the end is shown", async () => {
  const run = await sample("--live");
  try {
    const { page, complaints, requests } = await open(browser, run.url);
    await page.getByText("Waiting for the first Gaussians").waitFor();
    assert.equal(drawn(await shot(page)), 0);
    await run.send("steps single 1 200");
    await run.send("splats 1");
    await until(page, { shown: "splats 1", points: 200 });
    await page.getByText("step 200 of 400").waitFor();
    assert.ok(await page.locator("input[name=tint][value=parts]").isDisabled());
    const walls = await shot(page);
    assert.ok(drawn(walls) > 0.02 * walls.width * walls.height, `${drawn(walls)} pixels`);

    await run.send("steps articulate 1 100");
    await run.send("splats 3");
    await until(page, { shown: "splats 2", points: 300, parts: 3 });
    const closed = await shot(page);
    assert.ok(difference(walls, closed).count > 3000, `${difference(walls, closed).count} pixels changed`);
    const reds = (picture) => {
      // In the middle of the door, which is red in photos and orange in part colours.
      const [r, g, b] = colour(picture, [0.47 * picture.width, 0.4 * picture.height], 6);
      return [r, g, b].map(Math.round);
    };
    const [r, g, b] = reds(closed);
    assert.ok(r > 150 && g < 110 && b < 100, `door ${[r, g, b]}`);
    await page.locator("input[name=tint][value=parts]").check({ force: true });
    await until(page, { shown: "parts 2" });
    const tinted = reds(await shot(page));
    assert.ok(tinted[0] > 200 && tinted[1] > 130 && tinted[2] < 60, `door ${tinted}`);
    if (process.env.SHOTS) await page.screenshot({ path: `${process.env.SHOTS}/live.png` });

    const curve = (k) => page.locator("polyline.curve").nth(k).getAttribute("points");
    const heights = (points) => points.split(" ").map((p) => Number(p.split(",")[1]));
    const [psnr, loss] = [heights(await curve(0)), heights(await curve(1))];
    assert.ok(psnr.length > 100 && loss.length === psnr.length, `${psnr.length} points`);
    assert.ok(psnr[0] > psnr[50] && loss[0] < loss[50], "PSNR rises, loss falls");
    // The value is 28 at the last step; the plot shows the mean of the last few.
    assert.match(await page.locator(".plot output").first().textContent(), /^27\.[89] dB$/);

    await run.send("finish");
    await page.getByText("The run is finished").waitFor();
    const asked = requests.length;
    await page.waitForTimeout(1500);
    assert.equal(requests.length, asked, "requests continue after the end of the run");
    const origin = new URL(run.url).origin;
    assert.deepEqual(requests.filter((r) => !r.startsWith(origin) && !r.startsWith("data:") && !r.startsWith("blob:")), []);
    assert.deepEqual(complaints, []);
    await page.close();
  } finally {
    await run.close();
  }
});

test("the page shows why a run failed, and that a server does not answer", async () => {
  const failing = await sample("--live");
  const failed = await open(browser, failing.url);
  await failing.send("fail no depth in the end state");
  await failed.page.getByText("The run failed: no depth in the end state").waitFor();
  await failed.page.close();
  await failing.close();

  const leaving = await sample("--live");
  const { page } = await open(browser, leaving.url);
  await leaving.send("steps single 1 20");
  await until(page, { points: 20 });
  await leaving.close();
  await page.getByText("The server does not answer").waitFor();
  assert.equal(await page.evaluate(() => artgs.live().points), 20);
  await page.close();
});
