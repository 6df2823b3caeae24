/** Scores as a table: one row per metric, one column per state for metrics of both states. */

import { make } from "./dom";

const LABELS: Record<string, string> = {
  "test.psnr": "PSNR, held-out views (dB)",
  "test.ssim": "SSIM, held-out views",
  "test.lpips": "LPIPS, held-out views",
  "test.flip": "FLIP, held-out views",
  "test.depth": "Depth error, held-out views",
  "train.psnr": "PSNR, training views (dB)",
  "train.ssim": "SSIM, training views",
  gaussians: "Gaussians",
  parts: "Parts",
  total_seconds: "Time (s)",
  peak_memory_mib: "Memory (MiB)",
};

type Row = { label: string; cells: number[] };

/** Rows of a `metrics.json`: numbers, and pairs of objects (one per state) with numbers. */
export function rows(scores: unknown): Row[] {
  if (typeof scores !== "object" || scores === null) return [];
  const out: Row[] = [];
  for (const [key, value] of Object.entries(scores)) {
    if (typeof value === "number") out.push({ label: LABELS[key] ?? key, cells: [value] });
    if (!Array.isArray(value) || value.length !== 2 || value.some((v) => typeof v !== "object" || v === null || Array.isArray(v))) continue;
    for (const name of Object.keys(value[0])) {
      const cells = value.map((v) => v[name]);
      const label = LABELS[`${key}.${name}`];
      if (label && cells.every((c) => typeof c === "number")) out.push({ label, cells });
    }
  }
  const place = (row: Row) => {
    const at = Object.values(LABELS).indexOf(row.label);
    return at < 0 ? Infinity : at;
  };
  return out.sort((a, b) => (place(a) === place(b) ? 0 : place(a) - place(b)));
}

function shown(value: number, counted: boolean): string {
  if (counted && Number.isInteger(value)) return value.toLocaleString("en");
  return Math.abs(value) >= 1000 ? value.toFixed(0) : Math.abs(value) < 1 ? value.toFixed(3) : value.toFixed(2);
}

export function table(found: Row[]): HTMLTableElement {
  const head = make("thead", {}, make("tr", {}, make("th", { scope: "col" }), make("th", { scope: "col" }, "Start"), make("th", { scope: "col" }, "End")));
  const body = make("tbody");
  for (const { label, cells } of found) {
    const row = make("tr", {}, make("th", { scope: "row" }, label));
    for (const cell of cells) row.append(make("td", { colSpan: cells.length === 1 ? 2 : 1 }, shown(cell, cells.length === 1)));
    body.append(row);
  }
  return make("table", {}, head, body);
}
