/** Starts the sample server and a browser, and measures pictures. */

import { spawn } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { chromium } from "playwright-core";
import { PNG } from "pngjs";

/** Debian's Chromium draws WebGL in software only with these flags. */
const FLAGS = [
  "--headless=new",
  "--no-sandbox",
  "--use-angle=swiftshader",
  "--use-gl=angle",
  "--enable-unsafe-swiftshader",
  "--disable-quic",
  "--no-first-run",
  "--disable-background-networking",
  "--disable-component-update",
  "--disable-sync",
];

/** Serves the sample until `close` is called; `send` writes a line to its input and waits for its answer. */
export async function sample(...options) {
  const folder = mkdtempSync(join(tmpdir(), "artgs-view-"));
  const program = process.env.ARTGS_VIEW_SAMPLE ?? "../target/debug/examples/view_sample";
  const child = spawn(program, [folder, ...options], { stdio: ["pipe", "pipe", "inherit"] });
  const url = await new Promise((done, fail) => {
    child.stdout.once("data", (text) => done(String(text).trim()));
    child.once("error", (e) => fail(new Error(`${program}: ${e.message}; cargo build -p artgs-view --example view_sample`)));
    child.once("exit", (code) => fail(new Error(`${program} ended with ${code}`)));
  });
  const close = async () => {
    const ended = new Promise((done) => child.once("exit", done));
    child.stdin.end();
    await ended;
    rmSync(folder, { recursive: true });
  };
  const send = (line) => {
    const answered = new Promise((done) => child.stdout.once("data", done));
    child.stdin.write(`${line}\n`);
    return answered;
  };
  return { folder, url, close, send };
}

export function browse() {
  return chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args: FLAGS });
}

/** Opens a page, waits until it is ready, and records errors, warnings and requests. */
export async function open(browser, address, options = {}) {
  const page = await browser.newPage({ viewport: { width: 800, height: 480 }, ...options });
  page.setDefaultTimeout(60_000);
  const complaints = [];
  const requests = [];
  page.on("console", (m) => ["error", "warning"].includes(m.type()) && complaints.push(m.text()));
  page.on("pageerror", (e) => complaints.push(e.message));
  page.on("requestfailed", (r) => complaints.push(`${r.url().slice(0, 80)} ${r.failure()?.errorText}`));
  page.on("response", (r) => r.status() >= 400 && complaints.push(`${r.status()} ${r.url().slice(0, 80)}`));
  page.on("request", (r) => requests.push(r.url()));
  await page.goto(`${address}${address.includes("?") ? "&" : "?"}test`);
  // An exported page unpacks its script first.
  await page.waitForFunction(() => globalThis.artgs);
  await page.evaluate(() => globalThis.artgs.ready);
  return { page, complaints, requests };
}

/** The picture on the canvas once drawing has stopped. */
export async function shot(page) {
  await page.evaluate(() => globalThis.artgs.settled());
  const data = await page.evaluate(() => document.querySelector("canvas").toDataURL("image/png"));
  return PNG.sync.read(Buffer.from(data.split(",")[1], "base64"));
}

/** Number and bounding box of the pixels that differ. */
export function difference(a, b, threshold = 24) {
  const box = { count: 0, left: a.width, top: a.height, right: -1, bottom: -1 };
  for (let i = 0; i < a.width * a.height; i++) {
    const off = [0, 1, 2].some((c) => Math.abs(a.data[4 * i + c] - b.data[4 * i + c]) > threshold);
    if (!off) continue;
    const [x, y] = [i % a.width, Math.floor(i / a.width)];
    box.count++;
    box.left = Math.min(box.left, x);
    box.right = Math.max(box.right, x);
    box.top = Math.min(box.top, y);
    box.bottom = Math.max(box.bottom, y);
  }
  return box;
}

/** Mean colour about a pixel. */
export function colour(picture, [x, y], radius = 3) {
  const sum = [0, 0, 0];
  let n = 0;
  for (let v = Math.round(y) - radius; v <= Math.round(y) + radius; v++) {
    for (let u = Math.round(x) - radius; u <= Math.round(x) + radius; u++, n++) {
      for (let c = 0; c < 3; c++) sum[c] += picture.data[4 * (v * picture.width + u) + c];
    }
  }
  return sum.map((s) => s / n);
}

/** Number of pixels that differ from the background, which is the colour of the corner. */
export function drawn(picture) {
  const corner = [...picture.data.subarray(0, 3)];
  let count = 0;
  for (let i = 0; i < picture.width * picture.height; i++) {
    if (corner.some((c, k) => Math.abs(picture.data[4 * i + k] - c) > 12)) count++;
  }
  return count;
}
