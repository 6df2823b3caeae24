import assert from "node:assert/strict";
import { test } from "node:test";
import { build } from "esbuild";

const { outputFiles } = await build({ entryPoints: ["src/pace.ts"], bundle: true, format: "esm", write: false });
const { Pace } = await import(`data:text/javascript;base64,${Buffer.from(outputFiles[0].contents).toString("base64")}`);

/** Draws frames of a motion; `cost(level)` is the time of one, and the display shows frames at fixed intervals. */
function move(pace, clock, frames, cost, beat = 1000 / 60) {
  let level = pace.level;
  const levels = [];
  for (let i = 0; i < frames; i++) {
    clock.now += Math.max(1, Math.ceil(cost(level) / beat - 1e-9)) * beat;
    levels.push((level = pace.step(clock.now)));
  }
  pace.rest();
  return levels;
}

test("a fast machine draws the finest level", () => {
  const levels = move(new Pace(5), { now: 0 }, 300, () => 9);
  assert.ok(levels.every((l) => l === 0));
});

test("a slow machine uses the finest level that is fast enough", () => {
  const levels = move(new Pace(5), { now: 0 }, 120, (l) => [60, 30, 12, 11, 8][l]);
  assert.ok(levels.slice(40).every((l) => l === 2), `${levels}`);
});

test("if no level is fast enough, the finest of the fastest is used", () => {
  const levels = move(new Pace(5), { now: 0 }, 200, (l) => [90, 60, 31, 30, 29][l]);
  assert.ok(levels.slice(80).every((l) => l === 2), `${levels}`);
});

test("a display with 30 frames per second uses the finest level", () => {
  const levels = move(new Pace(5), { now: 0 }, 200, () => 5, 1000 / 30);
  assert.ok(levels.slice(60).every((l) => l === 0), `${levels}`);
});

test("very slow frames change the level at once, and a machine that becomes faster is detected", () => {
  const [pace, clock] = [new Pace(5), { now: 0 }];
  const slow = move(pace, clock, 30, (l) => [600, 500, 300, 100, 14][l]);
  assert.equal(slow.at(-1), 4);
  let last;
  for (let i = 0; i < 8; i++) {
    clock.now += 21_000;
    last = move(pace, clock, 40, () => 5).at(-1);
  }
  assert.equal(last, 0);
});

test("measured times are discarded when other content is drawn", () => {
  const [pace, clock] = [new Pace(5), { now: 0 }];
  assert.equal(move(pace, clock, 120, (l) => [60, 12, 12, 12, 12][l]).at(-1), 1);
  pace.forget();
  assert.equal(pace.level, 0);
});
