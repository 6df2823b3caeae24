import assert from "node:assert/strict";
import { readFileSync, rmSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { browse, colour, difference, drawn, open, sample, shot } from "./page.mjs";

let browser;
before(async () => (browser = await browse()));
after(() => browser?.close());

/** Waits until the page shows a finished scene of that name. */
const shows = (page, name) => page.waitForFunction((n) => document.querySelector("h1")?.textContent === n && globalThis.artgs?.setMode, name);

test("corrections start a run: the page shows its progress and then its result", async () => {
  const served = await sample();
  try {
    const { page, complaints } = await open(browser, served.url);
    await page.evaluate(() => artgs.setMode("parts"));
    const at = await page.evaluate(() => artgs.onPage("door", [0.7, -0.02, 0.1]));
    const before = colour(await shot(page), at);
    assert.ok(before[1] > 60, `the door is orange: ${before}`);
    await page.getByLabel("Type of door").selectOption("revolute");
    const hold = join(served.folder, "hold");
    writeFileSync(hold, "");
    await page.getByRole("button", { name: "Save and run again" }).click();
    await page.getByText(/Running.*articulate, step \d+ of 20/).waitFor();
    assert.equal(await page.getByText("reused from the earlier run").count(), 1);
    // A page opened during the run follows it, too.
    const other = await open(browser, served.url);
    await other.page.getByText(/Running.*articulate/).waitFor();
    rmSync(hold);
    const saved = JSON.parse(readFileSync(join(served.folder, "corrections.json"), "utf8"));
    assert.deepEqual(saved.joints, [{ part: 1, type: "revolute" }]);
    for (const p of [page, other.page]) await shows(p, "cabinet again");
    await other.page.close();
    await page.evaluate(() => artgs.ready);
    await page.evaluate(() => artgs.setMode("parts"));
    const after = colour(await shot(page), await page.evaluate(() => artgs.onPage("door", [0.7, -0.02, 0.1])));
    assert.ok(after[0] > 100 && after[1] < 30 && after[2] < 30, `the door is red: ${after}`);
    assert.deepEqual(complaints, []);
    await page.close();
  } finally {
    await served.close();
  }
});

test("the page shows why a run failed and can return", async () => {
  const served = await sample();
  try {
    const { page } = await open(browser, served.url);
    await page.getByLabel("Centre of knob").selectOption("delete");
    await page.getByRole("button", { name: "Save and run again" }).click();
    await page.getByText("The run failed: the knob is required").waitFor();
    await page.getByRole("button", { name: "Back" }).click();
    await shows(page, "cabinet");
    assert.ok(drawn(await shot(page)) > 3000);
    // The corrections are kept.
    assert.equal(await page.getByLabel("Centre of knob").inputValue(), "delete");
    await page.getByText("Corrections were saved earlier and are not applied yet.").waitFor();
    await page.close();
  } finally {
    await served.close();
  }
});

test("saved corrections are loaded with the page and stay when saved again", async () => {
  const served = await sample();
  const file = join(served.folder, "corrections.json");
  const read = () => JSON.parse(readFileSync(file, "utf8"));
  try {
    const { page, complaints } = await open(browser, served.url);
    const values = () => page.locator(".edit select:not([aria-label^=Class])").evaluateAll((all) => all.map((s) => s.value));
    const again = async () => {
      await page.reload();
      await page.evaluate(() => artgs.ready);
    };
    const save = async () => {
      // The message of an earlier save may still be shown.
      const stored = page.waitForResponse((answer) => answer.request().method() === "POST");
      await page.getByRole("button", { name: "Save corrections" }).click();
      await stored;
      await page.getByText("Saved. The next artgs reconstruct --resume").waitFor();
    };
    assert.equal(await page.getByText("--resume").count(), 0);
    await page.getByLabel("Type of door").selectOption("screw");
    await page.getByLabel("Class of door").selectOption("sliding_door");
    await page.getByLabel("Centre of door").selectOption("move");
    await page.getByLabel("Centre of drawer").selectOption("delete");
    await page.getByLabel("Centre of knob").selectOption("1");
    await page.getByRole("button", { name: "Add a centre" }).click();
    await save();
    const first = read();
    assert.deepEqual(first.centres.map((c) => c.action), ["move", "merge", "delete", "add"]);
    assert.deepEqual(first.joints, [{ part: 1, type: "screw" }]);
    assert.deepEqual(first.classes, [{ part: 1, class: "sliding_door" }]);
    const middle = [-0.005, -0.27, 0.75];
    assert.ok(middle.every((x, k) => Math.abs(x - first.centres[0].position[k]) < 1e-6), `${first.centres[0].position}`);
    // Positions other than the default ones of the page.
    for (const c of first.centres) if (c.position) c.position = c.position.map((x) => x + 0.125);
    writeFileSync(file, JSON.stringify(first));
    await again();
    assert.deepEqual(await values(), ["move", "screw", "delete", "", "1", ""]);
    assert.equal(await page.getByLabel("Class of door").inputValue(), "sliding_door");
    assert.ok(await page.getByLabel("Type of drawer").isDisabled());
    await page.getByText("Corrections were saved earlier and are not applied yet.").waitFor();
    await page.getByLabel("Show part centres").check();
    if (process.env.SHOTS) await page.screenshot({ path: `${process.env.SHOTS}/again.png` });
    await save();
    const second = read();
    for (const [i, c] of second.centres.entries()) {
      c.position?.forEach((x, k) => assert.ok(Math.abs(x - first.centres[i].position[k]) < 1e-9, `${x}`));
      if (c.position) c.position = first.centres[i].position;
    }
    assert.deepEqual(second, first);
    assert.deepEqual(complaints, []);

    // Corrections that the controls cannot express, and unreadable files, are reported and stay until the next save.
    writeFileSync(file, JSON.stringify({ ...first, joints: [{ part: 9, type: "screw" }] }));
    await again();
    await page.getByText('cannot be shown here: {"part":9,"type":"screw"}. Saving replaces them.').waitFor();
    writeFileSync(file, "{");
    await again();
    await page.getByText(/cannot be shown here: .*corrections\.json.*Saving replaces them\./).waitFor();
    assert.deepEqual(await values(), ["", "", "", "", "", ""]);
    assert.equal(readFileSync(file, "utf8"), "{");
    await save();
    assert.deepEqual(read().centres, []);
    await page.close();
  } finally {
    await served.close();
  }
});

test("a part is split by a plane, and another joint is used for a part", async () => {
  const served = await sample();
  const file = join(served.folder, "corrections.json");
  const read = () => JSON.parse(readFileSync(file, "utf8"));
  try {
    const { page, complaints } = await open(browser, served.url);
    const save = async () => {
      // The message of an earlier save may still be shown.
      const stored = page.waitForResponse((answer) => answer.request().method() === "POST");
      await page.getByRole("button", { name: "Save corrections" }).click();
      await stored;
      await page.getByText("Saved. The next artgs reconstruct --resume").waitFor();
    };
    const first = await shot(page);
    await page.getByLabel("Centre of drawer").selectOption("split");
    const shown = await shot(page);
    assert.ok(difference(first, shown).count > 300, "the plane is drawn");
    await page.getByLabel("Cutting plane of drawer: direction").selectOption("z");
    await page.getByLabel("Cutting plane of drawer: position").fill("0.75");
    assert.ok(difference(shown, await shot(page)).count > 300, "the plane moves");
    await page.getByText(/^It may slide, by \d+ mm\. Open it further\.$/).waitFor();
    await page.getByRole("button", { name: "use this" }).click();
    assert.equal(await page.getByLabel("Type of door").inputValue(), "prismatic");
    await save();
    const { centres, joints } = read();
    assert.equal(centres.length, 1);
    const { action, part, plane } = centres[0];
    assert.deepEqual([action, part, plane.normal], ["split", 2, [0, 0, 1]]);
    assert.ok(plane.point[2] > 0.2 && plane.point[2] < 0.5, `${plane.point}`);
    const slide = { axis: [1, 0, 0], origin: [0, 0, 0], value: 0.25 };
    assert.deepEqual(joints, [{ part: 1, type: "prismatic", joint: slide }]);

    // A plane across no axis comes back, too.
    const slanted = { point: [0, -0.2, 0.3], normal: [0, 0.6, -0.8] };
    writeFileSync(file, JSON.stringify({ ...read(), centres: [{ action: "split", part: 2, plane: slanted }] }));
    await page.reload();
    await page.evaluate(() => artgs.ready);
    assert.equal(await page.getByRole("button", { name: "use this" }).getAttribute("aria-pressed"), "true");
    await save();
    const again = read().centres[0].plane;
    const along = (p) => p.reduce((sum, x, k) => sum + x * slanted.normal[k], 0);
    assert.ok(slanted.normal.every((x, k) => Math.abs(x - again.normal[k]) < 1e-9), `${again.normal}`);
    assert.ok(Math.abs(along(again.point) - along(slanted.point)) < 1e-9, `${again.point}`);
    // Another type takes the joint away.
    await page.getByLabel("Type of door").selectOption("revolute");
    await save();
    assert.deepEqual(read().joints, [{ part: 1, type: "revolute" }]);
    assert.deepEqual(complaints, []);
    await page.close();
  } finally {
    await served.close();
  }
});

test("if no run can be started, the page says why", async () => {
  const served = await sample("--unable");
  try {
    const { page } = await open(browser, served.url);
    assert.ok(await page.getByRole("button", { name: "Save and run again" }).isDisabled());
    await page.getByText("A run cannot be started here: there are no photos.").waitFor();
    await page.close();
  } finally {
    await served.close();
  }
});

test("discovered parts can be shown, moved and corrected before training, and then the run continues", async () => {
  const served = await sample("--found");
  try {
    const { page, complaints } = await open(browser, served.url);
    await page.getByText("Discovered parts, before training").waitFor();
    const enabled = await page.locator("input[name=mode]:enabled").evaluateAll((inputs) => inputs.map((i) => i.value));
    assert.deepEqual(enabled, ["points"]);
    assert.ok((await page.locator(".slider .kind").first().textContent()).includes("confidence 87 %"));
    const first = await shot(page);
    assert.ok(drawn(first) > 2000, `${drawn(first)} pixels`);
    if (process.env.SHOTS) await page.screenshot({ path: `${process.env.SHOTS}/found.png` });
    // Points of the door move with its slider, those of the drawer stay.
    await page.locator("input[data-link=part_1]").fill("1.2");
    const opened = await shot(page);
    assert.ok(difference(first, opened).count > 1000);
    const still = await page.evaluate(() => artgs.onPage("part_2", [0.2, -0.02, -0.1]));
    assert.ok(colour(first, still, 6).every((c, k) => Math.abs(c - colour(opened, still, 6)[k]) < 2));
    // In the end state the joints move the points of the start onto those of the end.
    await page.getByRole("button", { name: "End", exact: true }).click();
    const second = await shot(page);
    await page.getByLabel("Colour points by part").uncheck();
    assert.ok(difference(second, await shot(page)).count > 500);
    await page.getByLabel("Show part centres").check();
    await page.getByRole("button", { name: "Add a centre" }).click();
    await page.getByRole("button", { name: "Save and continue" }).click();
    await shows(page, "cabinet again");
    const saved = JSON.parse(readFileSync(join(served.folder, "corrections.json"), "utf8"));
    assert.deepEqual(saved.centres.map((c) => c.action), ["add"]);
    assert.deepEqual(complaints, []);
    await page.close();
  } finally {
    await served.close();
  }
});
