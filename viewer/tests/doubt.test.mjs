/** Words for other joints of a part. */

import assert from "node:assert/strict";
import { test } from "node:test";
import { build } from "esbuild";

const { outputFiles } = await build({ entryPoints: ["src/doubt.ts"], bundle: true, format: "esm", write: false });
const { doubt } = await import(`data:text/javascript;base64,${Buffer.from(outputFiles[0].contents).toString("base64")}`);

const door = { kind: "revolute", axis: [0, 0, 1], observed: [0, 1] };
const drawer = { kind: "prismatic", axis: [0, -1, 0], observed: [0, 0.25] };
const other = (kind, axis, value) => ({ kind, joint: { axis, origin: [0, 0, 0], value } });

test("doubts are said in degrees and millimetres of the object, not of the capture", () => {
  const rad = (degrees) => (degrees * Math.PI) / 180;
  const tilted = [Math.sin(rad(5)), 0, Math.cos(rad(5))];
  assert.equal(doubt(door, other("revolute", tilted, 1), undefined), "Its hinge may be tilted by 5°.");
  assert.equal(doubt(door, other("revolute", tilted.map((x) => -x), -1.2), undefined), "Its hinge may be tilted by 5°, and it may have moved by 69°.");
  assert.equal(doubt(door, other("revolute", [0, 0, 1], 1), undefined), "Its hinge may be elsewhere.");
  // The capture has y up, and a unit of 10 cm.
  const placement = { scale: 0.1, rotation: [Math.SQRT1_2, 0, 0, Math.SQRT1_2], translation: [0, 0, 0] };
  assert.equal(doubt(door, other("revolute", [0, 1, 0], 1), placement), "Its hinge may be elsewhere.");
  assert.equal(doubt(drawer, other("prismatic", [0, 0, 1], 3), placement), "It may have moved by 300 mm.");
  assert.equal(doubt(drawer, other("prismatic", [0, Math.sin(rad(8)), Math.cos(rad(8))], 2.5), placement), "Its direction may be off by 8°.");
  assert.equal(doubt(door, other("prismatic", [1, 0, 0], 2), placement), "It may slide, by 200 mm.");
  assert.equal(doubt(drawer, other("revolute", [1, 0, 0], rad(30)), placement), "It may turn, by 30°.");
});
