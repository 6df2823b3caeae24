import assert from "node:assert/strict";
import { existsSync, readFileSync, rmSync } from "node:fs";
import { createServer } from "node:http";
import { join } from "node:path";
import { pathToFileURL } from "node:url";
import { after, before, test } from "node:test";
import { PNG } from "pngjs";
import { browse, colour, difference, drawn, open, sample, shot } from "./page.mjs";

let served, browser, view;
before(async () => {
  served = await sample();
  browser = await browse();
  view = await open(browser, served.url);
});
after(async () => {
  await browser?.close();
  await served?.close();
});

/** Canvas coordinates of a point of a link; the canvas starts at the corner of the page. */
const onPage = (link, point) => view.page.evaluate(([l, p]) => artgs.onPage(l, p), [link, point]);
const joint = (link) => view.page.evaluate((l) => artgs.joint(l), link);
const call = (name, ...args) => view.page.evaluate(([n, a]) => artgs[n](...a), [name, args]);

async function rest() {
  await view.page.evaluate(() => artgs.stage.home());
  await call("setState", 0);
  await call("setExploded", 0);
  await call("setMode", "textured");
}

test("loads without errors and without requests to other hosts", async () => {
  const origin = new URL(served.url).origin;
  const foreign = view.requests.filter((r) => !r.startsWith(origin) && !r.startsWith("data:") && !r.startsWith("blob:"));
  assert.deepEqual(foreign, []);
  assert.deepEqual(view.complaints, []);
  const counts = await view.page.evaluate(() => artgs.counts);
  assert.equal(counts.triangles, 108);
  assert.ok(counts.splats > 5000, `${counts.splats} Gaussians`);
});

test("every mode draws a different picture", async () => {
  await rest();
  const pictures = [];
  for (const mode of ["splats", "textured", "mesh", "parts", "evidence", "collision", "points"]) {
    await view.page.locator(`input[name=mode][value=${mode}]`).check({ force: true });
    const picture = await shot(view.page);
    assert.ok(drawn(picture) > 0.02 * picture.width * picture.height, `${mode} draws ${drawn(picture)} pixels`);
    for (const [other, earlier] of pictures) {
      const { count } = difference(picture, earlier);
      assert.ok(count > 1500, `${mode} and ${other} differ in ${count} pixels`);
    }
    pictures.push([mode, picture]);
  }
});

test("Gaussians, texture and part colours are drawn at the door", async () => {
  await rest();
  const at = await onPage("door", [0.7, -0.02, 0.1]);
  await call("setMode", "splats");
  const [r, g, b] = colour(await shot(view.page), at);
  // The Gaussians of the door have colours around 180, 70, 50.
  assert.ok(Math.abs(r - 180) < 25 && Math.abs(g - 70) < 25 && Math.abs(b - 50) < 25, `splats ${[r, g, b]}`);
  await call("setMode", "textured");
  const [tr, tg, tb] = colour(await shot(view.page), at, 12);
  assert.ok(tr > 1.8 * tg && tr > 1.8 * tb, `texture ${[tr, tg, tb]}`);
  await call("setMode", "parts");
  const [pr, pg, pb] = colour(await shot(view.page), at);
  assert.ok(pr > pg && pg > 3 * pb, `parts ${[pr, pg, pb]}`);
});

test("evidence has a colour for each kind, and its legend is there in this mode only", async () => {
  await rest();
  const legend = view.page.locator(".legend");
  assert.equal(await legend.isVisible(), false);
  await view.page.locator("input[name=mode][value=evidence]").check({ force: true });
  assert.match(await legend.innerText(), /measured by the sensor[^]*derived[^]*not recorded/);
  const picture = await shot(view.page);
  // The door is invented, the drawer was seen, the body does not say.
  const [dr, dg] = colour(picture, await onPage("door", [0.7, -0.02, 0.1]));
  assert.ok(dr > 1.6 * dg, `door ${[dr, dg]}`);
  const [wr, wg] = colour(picture, await onPage("drawer", [0.2, -0.02, -0.15]));
  assert.ok(wg > 1.1 * wr, `drawer ${[wr, wg]}`);
  await rest();
  assert.equal(await legend.isVisible(), false);
});

test("moving a slider moves the door's pixels and only those", async () => {
  for (const mode of ["textured", "splats"]) {
    await rest();
    await call("setMode", mode);
    const corners = [];
    const outline = async () => {
      for (const x of [0, 0.99]) for (const y of [-0.08, 0]) for (const z of [-0.24, 0.24]) corners.push(await onPage("door", [x, y, z]));
    };
    await outline();
    const before = await shot(view.page);
    const slider = view.page.locator("input[data-link=door]");
    await slider.fill("0.8");
    assert.ok(Math.abs((await joint("door")) - 0.8) < 0.01);
    const after = await shot(view.page);
    await outline();
    const box = difference(before, after);
    const [xs, ys] = [0, 1].map((k) => corners.map((c) => c[k]));
    // Gaussians extend beyond the corners of the mesh.
    const margin = mode === "splats" ? 24 : 3;
    assert.ok(box.count > 2000, `${mode}: ${box.count} pixels changed`);
    assert.ok(box.left >= Math.min(...xs) - margin && box.right <= Math.max(...xs) + margin, `${mode}: ${JSON.stringify(box)} ${xs}`);
    assert.ok(box.top >= Math.min(...ys) - margin && box.bottom <= Math.max(...ys) + margin, `${mode}: ${JSON.stringify(box)} ${ys}`);
    const still = await onPage("drawer", [0.2, -0.02, -0.15]);
    const change = colour(before, still).map((c, k) => Math.abs(c - colour(after, still)[k]));
    assert.ok(Math.max(...change) < 3, `${mode}: the drawer changed by ${change}`);
  }
});

test("keys move a slider", async () => {
  await rest();
  await view.page.locator("input[data-link=drawer]").focus();
  const from = await joint("drawer");
  await view.page.keyboard.press("ArrowRight");
  assert.ok((await joint("drawer")) > from);
  await view.page.keyboard.press("End");
  assert.ok(Math.abs((await joint("drawer")) - 0.42) < 1e-6);
});

async function drag(from, to, steps = 8) {
  await view.page.mouse.move(...from);
  await view.page.mouse.down();
  for (let i = 1; i <= steps; i++) {
    await view.page.mouse.move(from[0] + ((to[0] - from[0]) * i) / steps, from[1] + ((to[1] - from[1]) * i) / steps);
  }
  await view.page.mouse.up();
}

test("dragging a part moves its joint so that the grabbed point follows, within the limits", async () => {
  for (const mode of ["mesh", "splats"]) {
    await rest();
    await call("setMode", mode);
    const held = [0.4, -0.02, 0.1];
    const from = await onPage("drawer", held);
    await call("setJoint", "drawer", 0.1);
    const to = await onPage("drawer", held);
    await call("setJoint", "drawer", 0.3);
    await drag(from, to);
    const value = await joint("drawer");
    assert.ok(Math.abs(value - 0.1) < 0.02, `${mode}: dragged to ${value}`);
    const slider = await view.page.locator("input[data-link=drawer]").inputValue();
    assert.ok(Math.abs(Number(slider) - value) < 2e-3, `the slider says ${slider}`);
    const at = await onPage("drawer", held);
    await drag(at, [at[0] + 8 * (from[0] - to[0]), at[1] + 8 * (from[1] - to[1])]);
    assert.equal(await joint("drawer"), 0.42);
  }
  await rest();
  const edge = [0.95, -0.02, 0.1];
  const from = await onPage("door", edge);
  await call("setJoint", "door", 0.7);
  const to = await onPage("door", edge);
  await call("setJoint", "door", 0);
  await drag(from, to, 20);
  assert.ok(Math.abs((await joint("door")) - 0.7) < 0.05, `the door is at ${await joint("door")}`);
  const others = [await joint("drawer"), await joint("knob")];
  assert.deepEqual(others, [0.3, 0]);
});

test("the pointer shows the name, the value and the axis of the part under it", async () => {
  await rest();
  await call("setMode", "mesh");
  const label = view.page.locator("#hover");
  await view.page.mouse.move(5, 5);
  await view.page.evaluate(() => artgs.settled());
  const before = await shot(view.page);
  const at = await onPage("door", [0.7, -0.02, 0.1]);
  await view.page.mouse.move(...at, { steps: 2 });
  assert.equal(await label.innerText(), "door · 0.0°");
  assert.ok(await view.page.locator(".slider.over input[data-link=door]").count(), "the slider of the door is marked");
  const over = await shot(view.page);
  assert.ok(difference(before, over).count > 200, "the axis is drawn");
  await view.page.mouse.move(5, 5);
  assert.equal(await label.isVisible(), false);
  assert.equal(difference(before, await shot(view.page)).count, 0);
});

test("dragging beside the object turns the view, not a joint", async () => {
  await rest();
  const [before, values] = [await shot(view.page), await Promise.all(["door", "drawer", "knob"].map(joint))];
  await drag([8, 300], [120, 280]);
  assert.ok(difference(before, await shot(view.page)).count > 3000);
  assert.deepEqual(await Promise.all(["door", "drawer", "knob"].map(joint)), values);
});

test("states, play, exploded view and axes", async () => {
  await rest();
  await view.page.getByRole("button", { name: "End", exact: true }).click();
  assert.deepEqual(await Promise.all(["door", "drawer", "knob"].map(joint)), [1.2, 0, 3]);
  await view.page.getByRole("button", { name: "Start", exact: true }).click();
  assert.deepEqual(await Promise.all(["door", "drawer", "knob"].map(joint)), [0, 0.3, 0]);
  const before = await shot(view.page);
  const axes = view.page.getByLabel("Joint axes and limits");
  await axes.check();
  const changed = difference(before, await shot(view.page)).count;
  assert.ok(changed > 300, `axes change ${changed} pixels`);
  await axes.uncheck();
  assert.equal(difference(before, await shot(view.page)).count, 0);
  await view.page.locator("#explode").fill("1");
  assert.ok(difference(before, await shot(view.page)).count > 2000);
  await view.page.locator("#explode").fill("0");
  await view.page.getByRole("button", { name: "Reset view" }).click();
  assert.equal(difference(before, await shot(view.page)).count, 0);
  await view.page.getByRole("button", { name: "Play" }).click();
  await view.page.waitForFunction(() => artgs.joint("door") > 0.5);
  await view.page.getByRole("button", { name: "Pause" }).click();
  const paused = await joint("door");
  await view.page.waitForTimeout(200);
  assert.equal(await joint("door"), paused);
});

test("the console and the controls agree", async () => {
  await rest();
  await call("setExploded", 0.4);
  assert.equal(await view.page.locator("#explode").inputValue(), "0.4");
  await call("setAxes", true);
  assert.ok(await view.page.getByLabel("Joint axes and limits").isChecked());
  await call("setAxes", false);
  assert.ok(!(await view.page.getByLabel("Joint axes and limits").isChecked()));
  await call("setExploded", 0);
});

test("a slow machine draws motions at a coarse level, then the finest, then nothing", async () => {
  await rest();
  await call("setMode", "mesh");
  const before = await shot(view.page);
  const frames = () => view.page.evaluate(() => artgs.stage.frames);
  const drawnBefore = await frames();
  await view.page.waitForTimeout(400);
  assert.equal(await frames(), drawnBefore, "it draws although nothing changes");
  // A machine that is slow at all levels but the coarsest.
  const moving = await view.page.evaluate(async () => {
    const { stage } = artgs;
    const draw = stage.draw;
    stage.draw = function () {
      const end = performance.now() + (stage.coarseness.drawn < 4 ? 70 : 0);
      while (performance.now() < end);
      draw.call(stage);
    };
    await artgs.fps(4);
    const found = { ...stage.coarseness, width: stage.canvas.width };
    delete stage.draw;
    artgs.setState(0);
    return found;
  });
  assert.equal(moving.level, 4, JSON.stringify(moving));
  assert.ok(moving.width < 0.6 * before.width, `${moving.width} of ${before.width} pixels`);
  const began = Date.now();
  await view.page.waitForFunction(() => artgs.stage.coarseness.drawn === 0);
  assert.ok(Date.now() - began < 1000);
  assert.equal(difference(before, await shot(view.page)).count, 0);
});

test("the wipe shows a camera's photo over a part of the replica", async () => {
  await rest();
  await view.page.locator("#camera").selectOption("0");
  await view.page.locator("#wipe").fill("0.25");
  await view.page.evaluate(() => artgs.settled());
  const canvas = await shot(view.page);
  // The pose was computed by hand: the object's point (0, 0, 0.5) is at the principal point (84, 60) of 160 x 120.
  const at = await onPage("base", [0, 0, 0.5]);
  const scale = Math.min(canvas.width / 160, canvas.height / 120);
  const left = (canvas.width - 160 * scale) / 2;
  const top = (canvas.height - 120 * scale) / 2;
  assert.ok(Math.abs(at[0] - (left + 84 * scale)) < 0.5 && Math.abs(at[1] - (top + 60 * scale)) < 0.5, `${at}`);
  const page = PNG.sync.read(await view.page.screenshot());
  const seen = (u) => colour(page, [left + u * 160 * scale, top + 0.1 * 120 * scale]);
  assert.ok(seen(0.2).every((c, k) => Math.abs(c - [220, 120, 20][k]) < 4), `photo ${seen(0.2)}`);
  assert.ok(seen(0.35).some((c, k) => Math.abs(c - [220, 120, 20][k]) > 30), `replica ${seen(0.35)}`);
  assert.ok(drawn(canvas) > 3000);
  const edge = (share) => [left + share * 160 * scale, top + 0.5 * 120 * scale];
  await drag(edge(0.25), edge(0.75));
  assert.ok(Math.abs(Number(await view.page.locator("#wipe").inputValue()) - 0.75) < 0.01, "the slider follows the edge");
  const wiped = PNG.sync.read(await view.page.screenshot());
  const photo = colour(wiped, [left + 0.35 * 160 * scale, top + 0.1 * 120 * scale]);
  assert.ok(photo.every((c, k) => Math.abs(c - [220, 120, 20][k]) < 4), `photo ${photo}`);
  await view.page.getByLabel("Show mask").check();
  const masked = PNG.sync.read(await view.page.screenshot());
  const under = colour(masked, [left + 0.1 * 160 * scale, top + 0.1 * 120 * scale]);
  assert.ok(under[0] < 0.5 * 220, `left out, so dark: ${under}`);
  await view.page.getByLabel("Show mask").uncheck();
  await view.page.locator("#camera").selectOption("");
  assert.ok(await view.page.locator("#photo").isHidden());
  const before = await shot(view.page);
  await view.page.getByLabel("Show cameras").check();
  assert.ok(difference(before, await shot(view.page)).count > 100);
  await view.page.getByLabel("Show cameras").uncheck();
});

test("undo takes back the last change of the corrections, one by one", async () => {
  await rest();
  const undo = view.page.getByRole("button", { name: "Undo" });
  const drawer = view.page.getByLabel("Centre of drawer");
  assert.ok(await undo.isDisabled(), "nothing was changed");
  await view.page.getByLabel("Type of door").selectOption("screw");
  await drawer.selectOption("delete");
  await view.page.getByRole("button", { name: "Add a centre" }).click();
  const added = view.page.getByText("New part");
  const left = async () => [await added.count(), await drawer.inputValue(), await view.page.getByLabel("Type of door").inputValue()];
  assert.deepEqual(await left(), [1, "delete", "screw"]);
  for (const expected of [[0, "delete", "screw"], [0, "", "screw"], [0, "", ""]]) {
    await undo.click();
    assert.deepEqual(await left(), expected);
  }
  assert.ok(await undo.isDisabled());
  await view.page.getByLabel("Show part centres").uncheck();
});

test("corrections are saved, and invalid ones are refused", async () => {
  await rest();
  await view.page.getByLabel("Type of door").selectOption("prismatic");
  await view.page.getByLabel("Centre of drawer").selectOption("delete");
  await view.page.getByRole("button", { name: "Add a centre" }).click();
  await view.page.getByRole("button", { name: "Save corrections" }).click();
  await view.page.getByText("Saved.").waitFor();
  const saved = JSON.parse(readFileSync(join(served.folder, "corrections.json"), "utf8"));
  assert.deepEqual(saved.joints, [{ part: 1, type: "prismatic" }]);
  assert.deepEqual(saved.centres.map((c) => c.action), ["delete", "add"]);
  assert.deepEqual(saved.centres[0], { action: "delete", part: 2 });
  assert.ok(saved.centres[1].position.every(Number.isFinite));
  const status = await view.page.evaluate(async () => {
    const body = JSON.stringify({ format: "artgs-corrections", version: 1, centres: [{ action: "delete", part: 0 }] });
    return (await fetch("corrections", { method: "POST", headers: { "Content-Type": "application/json" }, body })).status;
  });
  assert.equal(status, 400);
});

test("another origin can neither read nor write", async () => {
  const hostile = createServer((_, answer) => answer.setHeader("Content-Type", "text/html").end("<title>evil</title>"));
  await new Promise((done) => hostile.listen(0, "127.0.0.1", done));
  const file = join(served.folder, "corrections.json");
  rmSync(file, { force: true });
  const page = await browser.newPage();
  const answers = [];
  page.on("response", (r) => r.url().startsWith(served.url) && answers.push(r.status()));
  try {
    await page.goto(`http://127.0.0.1:${hostile.address().port}/`);
    const outcome = await page.evaluate(async (url) => {
      const body = JSON.stringify({ format: "artgs-corrections", version: 1 });
      const attempts = [
        fetch(`${url}scene.json`).then((r) => r.text()),
        fetch(`${url}corrections`, { method: "POST", headers: { "Content-Type": "application/json" }, body }).then((r) => r.text()),
        // This one is sent without a preflight request, like that of a form.
        fetch(`${url}corrections`, { method: "POST", mode: "no-cors", body }),
      ];
      return (await Promise.allSettled(attempts)).map((a) => a.status);
    }, served.url);
    assert.deepEqual(outcome, ["rejected", "rejected", "rejected"]);
    assert.ok(answers.every((s) => s === 403), `${answers}`);
    assert.ok(!existsSync(file));
  } finally {
    await page.close();
    hostile.close();
  }
});

test("on a phone the canvas keeps its place and a finger moves a part", async () => {
  const phone = await open(browser, served.url, { viewport: { width: 390, height: 780 }, hasTouch: true, isMobile: true, deviceScaleFactor: 2 });
  const { page } = phone;
  const canvas = await page.locator("canvas").boundingBox();
  const panel = await page.locator("#panel").boundingBox();
  assert.ok(canvas.width === 390 && canvas.height > 380 && panel.y >= canvas.y + canvas.height - 1, JSON.stringify([canvas, panel]));
  assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth));
  const held = [0.4, -0.02, 0.1];
  const place = () => page.evaluate((p) => artgs.onPage("drawer", p), held);
  const from = await place();
  await page.evaluate(() => artgs.setJoint("drawer", 0.1));
  const to = await place();
  await page.evaluate(() => artgs.setJoint("drawer", 0.3));
  const client = await page.context().newCDPSession(page);
  const touch = (type, [x, y]) => client.send("Input.dispatchTouchEvent", { type, touchPoints: type === "touchEnd" ? [] : [{ x, y }] });
  await touch("touchStart", from);
  for (let i = 1; i <= 6; i++) await touch("touchMove", [0, 1].map((k) => from[k] + ((to[k] - from[k]) * i) / 6));
  await touch("touchEnd", to);
  const value = await page.evaluate(() => artgs.joint("drawer"));
  assert.ok(Math.abs(value - 0.1) < 0.03, `dragged to ${value}`);
  assert.deepEqual(phone.complaints, []);
  await page.close();
});

test("an embedded page shows no controls and plays", async () => {
  const file = pathToFileURL(join(served.folder, "page.html")).href;
  const { page, complaints } = await open(browser, `${file}?embed`);
  assert.equal(await page.locator("#panel").isVisible(), false);
  const [canvas, window_] = await page.evaluate(() => [document.querySelector("canvas").clientWidth, innerWidth]);
  assert.equal(canvas, window_);
  const values = () => page.evaluate(() => [1, 2].map((link) => artgs.joint(link)));
  const before = await values();
  await page.waitForFunction((b) => [1, 2].some((link, i) => Math.abs(artgs.joint(link) - b[i]) > 0.02), before);
  assert.deepEqual(complaints, []);
  await page.close();
});

test("keys play, turn the view and save a picture of what is drawn, and controls keep their own keys", async () => {
  await rest();
  const { page } = view;
  const pressed = (name) => page.getByRole("button", { name }).getAttribute("aria-pressed");
  await page.locator("canvas").focus();
  const place = () => page.evaluate(() => artgs.stage.camera.position.toArray());
  const before = await place();
  await page.keyboard.press("t");
  assert.equal(await pressed("Turntable"), "true");
  await page.waitForFunction((b) => artgs.stage.camera.position.distanceTo({ x: b[0], y: b[1], z: b[2] }) > 0.05, before);
  await page.keyboard.press("t");
  const [a, b] = [await place(), await place()];
  assert.deepEqual(a, b, "it stops");
  assert.ok(Math.abs(a[2] - before[2]) < 1e-6, "about the upright axis");
  const [download] = await Promise.all([page.waitForEvent("download"), page.keyboard.press("s")]);
  assert.match(download.suggestedFilename(), /\.png$/);
  const saved = PNG.sync.read(readFileSync(await download.path()));
  const { count } = difference(saved, await shot(page));
  assert.ok(drawn(saved) > 3000 && count < 0.002 * saved.width * saved.height, `${count} pixels differ`);
  await page.keyboard.press("r");
  assert.ok(Math.hypot(...(await place()).map((x, i) => x - before[i])) < 1e-3, "the view is reset");
  await page.keyboard.press(" ");
  assert.equal(await pressed("Pause"), "true");
  await page.keyboard.press(" ");
  // With the focus on a control, the key is that of the control.
  await page.getByRole("button", { name: "Turntable" }).focus();
  await page.keyboard.press("t");
  assert.equal(await pressed("Turntable"), "false");
  await rest();
});

test("the exported page works from disk and shows the same picture", async () => {
  await rest();
  const file = pathToFileURL(join(served.folder, "page.html")).href;
  const single = await open(browser, file);
  assert.deepEqual(single.complaints, []);
  const foreign = single.requests.filter((r) => r !== `${file}?test` && !r.startsWith("data:") && !r.startsWith("blob:"));
  assert.deepEqual(foreign, []);
  for (const mode of ["textured", "splats"]) {
    await call("setMode", mode);
    await single.page.evaluate((m) => artgs.setMode(m), mode);
    const [a, b] = [await shot(view.page), await shot(single.page)];
    assert.deepEqual([a.width, a.height], [b.width, b.height]);
    const { count } = difference(a, b);
    assert.ok(drawn(b) > 3000 && count < 0.002 * a.width * a.height, `${mode}: ${count} pixels differ`);
  }
  await single.page.evaluate(() => artgs.setJoint("door", 1.5));
  assert.ok(difference(await shot(view.page), await shot(single.page)).count > 2000);
  assert.equal(await single.page.getByRole("button", { name: "Save corrections" }).count(), 0);
  await single.page.close();
  assert.deepEqual(view.complaints.filter((c) => !c.includes("400")), []);
});

test("a capture before reconstruction shows the points of both states and marks moved ones", async () => {
  const { page, complaints } = await open(browser, pathToFileURL(join(served.folder, "capture.html")).href);
  const first = await shot(page);
  assert.ok(drawn(first) > 2000, `${drawn(first)} pixels`);
  await page.getByRole("button", { name: "End", exact: true }).click();
  const second = await shot(page);
  assert.ok(difference(first, second).count > 1000);
  await page.getByLabel("Mark points that moved").check();
  assert.ok(difference(second, await shot(page)).count > 1000);
  assert.deepEqual(complaints, []);
  await page.close();
});
