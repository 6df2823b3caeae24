/** What the pointer is over: the name of the part beside it, its joint axis, and its slider. */

import { make } from "./dom";
import type { Glyphs } from "./glyphs";
import type { Link } from "./model";
import type { Panel } from "./panel";
import { readable } from "./scene";
import type { Stage } from "./stage";

/** The label is this far from the pointer, CSS pixels. */
const BESIDE = 14;

export class Hover {
  private readonly label = make("div", { id: "hover", hidden: true });
  private link: Link | null = null;

  constructor(
    private readonly stage: Stage,
    private readonly glyphs: Glyphs,
    private readonly panel: Panel,
  ) {
    stage.canvas.after(this.label);
    stage.canvas.addEventListener("pointerleave", () => this.show(null, 0, 0));
  }

  /** Shows the part that would move, at a point of the page; `null` shows nothing. */
  show(link: Link | null, x: number, y: number): void {
    this.label.hidden = !link;
    if (link) {
      this.label.textContent = `${link.data.name.replaceAll("_", " ")} · ${readable(link.data.joint!, link.value)}`;
      const { left, top, width } = this.stage.canvas.getBoundingClientRect();
      const flip = x - left > width / 2;
      const at = x - left + (flip ? -BESIDE : BESIDE);
      Object.assign(this.label.style, { left: `${at}px`, top: `${y - top + BESIDE}px`, transform: flip ? "translateX(-100%)" : "" });
    }
    if (link === this.link) return;
    this.link = link;
    this.glyphs.hover(link);
    this.panel.point(link);
    this.stage.changed();
  }
}
