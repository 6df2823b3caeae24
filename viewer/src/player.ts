/** Plays all joints: moves each one through its range and back, one after another. */

import type { Link, Model } from "./model";
import type { Stage } from "./stage";

/** Seconds per joint. */
const TURN = 3.2;

export class Player {
  private on = false;
  private joint = 0;
  private time = 0;
  private from = 0;

  constructor(
    private readonly stage: Stage,
    private readonly model: Model,
    private readonly changed: (on: boolean) => void,
  ) {}

  set(on: boolean): void {
    const links = this.model.movable();
    if (on === this.on || links.length === 0) return;
    this.on = on;
    this.changed(on);
    if (!on) return;
    this.time = 0;
    this.from = links[this.joint % links.length].value;
    this.stage.animate((seconds) => this.on && this.tick(links, seconds));
  }

  private tick(links: Link[], seconds: number): boolean {
    this.time += seconds;
    if (this.time >= TURN) {
      this.model.set(links[this.joint % links.length], this.from);
      this.joint = (this.joint + 1) % links.length;
      this.time -= TURN;
      this.from = links[this.joint].value;
    }
    const link = links[this.joint % links.length];
    this.model.set(link, sweep(link.data.joint!.limits, this.from, this.time / TURN));
    return true;
  }
}

/** Eased motion from a value to the lower limit, to the upper limit and back; `t` in [0, 1]. */
export function sweep([lower, upper]: [number, number], from: number, t: number): number {
  const path = [from, lower, upper, from];
  const lengths = [from - lower, upper - lower, upper - from];
  const total = lengths.reduce((a, b) => a + b, 0) || 1;
  let along = Math.min(1, Math.max(0, t)) * total;
  let leg = 0;
  while (leg < 2 && along > lengths[leg]) along -= lengths[leg++];
  const share = lengths[leg] > 0 ? Math.min(1, along / lengths[leg]) : 1;
  return path[leg] + (path[leg + 1] - path[leg]) * share * share * (3 - 2 * share);
}
