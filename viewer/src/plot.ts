/** A small line plot over the steps of a run. */

import { make } from "./dom";

/** Size of the SVG view box; the page scales it. */
const [WIDTH, HEIGHT] = [280, 72];
/** Points of the line. Each is the mean of adjacent steps, because loss varies between views. */
const BINS = 140;

const NAMESPACE = "http://www.w3.org/2000/svg";

function shape<K extends keyof SVGElementTagNameMap>(tag: K, fields: Record<string, string>): SVGElementTagNameMap[K] {
  const element = document.createElementNS(NAMESPACE, tag);
  for (const [key, value] of Object.entries(fields)) element.setAttribute(key, value);
  return element;
}

/** Means of adjacent steps as [x, y]; steps without a value are skipped. */
export function binned(xs: number[], ys: (number | null)[]): [number, number][] {
  const last = Math.max(1, ...xs.slice(-1));
  const bins: { x: number; y: number; n: number }[] = [];
  xs.forEach((x, i) => {
    const y = ys[i];
    if (y === null) return;
    const bin = (bins[Math.min(BINS - 1, Math.floor((x / last) * BINS))] ??= { x: 0, y: 0, n: 0 });
    bin.x += x;
    bin.y += y;
    bin.n++;
  });
  return bins.filter(Boolean).map(({ x, y, n }) => [x / n, y / n]);
}

export class Plot {
  readonly element: HTMLElement;
  private readonly value = make("output");
  private readonly line = shape("polyline", { class: "curve", fill: "none", "vector-effect": "non-scaling-stroke" });
  private readonly stages = shape("path", { class: "stages", fill: "none", "vector-effect": "non-scaling-stroke" });
  private readonly low = make("span");
  private readonly high = make("span");

  /** `logarithmic`: the y axis is logarithmic. */
  constructor(
    name: string,
    private readonly unit: string,
    private readonly digits: number,
    private readonly logarithmic: boolean,
  ) {
    const svg = shape("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, preserveAspectRatio: "none", role: "img", "aria-label": `${name} by step` });
    svg.append(this.stages, this.line);
    const head = make("p", { className: "head" }, make("span", {}, name), this.value);
    this.element = make("div", { className: "plot" }, head, svg, make("p", { className: "ends" }, this.low, this.high));
  }

  /** Draws values at steps counted over all stages, ascending; `starts` are the first steps of stages. */
  draw(xs: number[], ys: (number | null)[], starts: number[]): void {
    const means = binned(xs, ys);
    if (means.length === 0) return;
    const scale = (y: number) => (this.logarithmic ? Math.log(Math.max(y, 1e-6)) : y);
    const values = means.map(([, y]) => scale(y));
    const [least, most] = [Math.min(...values), Math.max(...values)];
    const across = (x: number) => (x / Math.max(1, xs[xs.length - 1])) * WIDTH;
    const up = (y: number) => HEIGHT - 3 - ((y - least) / (most - least || 1)) * (HEIGHT - 6);
    this.line.setAttribute("points", means.map(([x], i) => `${across(x).toFixed(1)},${up(values[i]).toFixed(1)}`).join(" "));
    this.stages.setAttribute("d", starts.map((x) => `M${across(x).toFixed(1)} 0V${HEIGHT}`).join(""));
    const words = (y: number) => `${y.toFixed(this.digits)}${this.unit}`;
    const plain = means.map(([, y]) => y);
    this.value.textContent = words(plain[plain.length - 1]);
    this.low.textContent = `lowest ${words(Math.min(...plain))}`;
    this.high.textContent = `highest ${words(Math.max(...plain))}`;
  }
}
