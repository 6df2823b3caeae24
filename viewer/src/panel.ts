/** The controls beside the canvas. */

import { doubt } from "./doubt";
import { button, check, make, section } from "./dom";
import { EVIDENCE_COLOURS, MODES, type Mode } from "./looks";
import type { Link, Model } from "./model";
import { EVIDENCE } from "./obj";
import { type AlternativeData, hasBothStates, isFound, readable, type SceneData, STATES } from "./scene";
import { rows, table } from "./scores";

/** What the controls do. */
export interface Actions {
  mode(mode: Mode): void;
  axes(on: boolean): void;
  explode(share: number): void;
  home(): void;
  turntable(on: boolean): void;
  picture(): void;
  state(state: number): void;
  play(on: boolean): void;
  frustums(on: boolean): void;
  look(camera: number | null): void;
  wipe(share: number): void;
  mask(on: boolean): void;
  moved(on: boolean): void;
}

const NAMES: Record<Mode, string> = {
  splats: "Splats",
  textured: "Textured",
  mesh: "Mesh",
  parts: "Parts",
  evidence: "Evidence",
  collision: "Collision",
  points: "Points",
};

const RESTS_ON: Record<(typeof EVIDENCE)[number], string> = {
  seen: "measured by the sensor",
  derived: "derived from photos and from surfaces that continue",
  invented: "not recorded: closes the surface",
};

export class Panel {
  private readonly modes = new Map<Mode, HTMLInputElement>();
  /** What the colours of the evidence mean. */
  private readonly legend = make("ul", { className: "legend", hidden: true });
  private readonly sliders = new Map<Link, { box: HTMLElement; input: HTMLInputElement; value: HTMLOutputElement }>();
  /** Entries of other joints that parts could have. */
  readonly alternatives: { link: Link; data: AlternativeData; item: HTMLElement }[] = [];
  private readonly apart = make("input", { type: "range", min: "0", max: "1", step: "0.01", value: "0", id: "explode" });
  private readonly share = make("input", { type: "range", min: "0", max: "1", step: "0.005", value: "0.5", id: "wipe" });
  private readonly axesShown = check("Joint axes and limits", (on) => this.act.axes(on));
  private readonly playing = button("Play", () => this.act.play(this.playing.getAttribute("aria-pressed") !== "true"));

  private readonly turning = button("Turntable", () => this.act.turntable(this.turning.getAttribute("aria-pressed") !== "true"));

  constructor(
    private readonly root: HTMLElement,
    private readonly scene: SceneData,
    private readonly model: Model,
    private readonly act: Actions,
  ) {
    root.replaceChildren(make("h1", {}, scene.name.replaceAll("_", " ")), make("p", { className: "facts", id: "facts" }));
    if (model.movable().length > 0) root.append(this.joints());
    root.append(this.show());
    if (scene.cameras?.length) root.append(this.cameras());
    const found = rows(scene.scores);
    if (found.length > 0) root.append(section("Scores", table(found)));
    model.onMove((link) => this.moved(link));
    model.movable().forEach((link) => this.moved(link));
  }

  append(part: HTMLElement): void {
    this.root.append(part);
  }

  /** Adds a section before all others. */
  lead(part: HTMLElement): void {
    this.root.querySelector("#facts")!.after(part);
  }

  private show(): HTMLElement {
    const choices = make("div", { className: "choices" });
    for (const mode of MODES) {
      const input = make("input", { type: "radio", name: "mode", value: mode });
      input.addEventListener("change", () => this.act.mode(mode));
      this.modes.set(mode, input);
      choices.append(make("label", {}, input, make("span", {}, NAMES[mode])));
    }
    this.apart.addEventListener("input", () => this.act.explode(this.apart.valueAsNumber));
    const group = make("fieldset", { ariaLabel: "What is drawn" }, choices);
    for (const kind of EVIDENCE) {
      const dot = make("span", { className: "dot" });
      dot.style.background = `#${EVIDENCE_COLOURS[kind].toString(16)}`;
      this.legend.append(make("li", {}, dot, RESTS_ON[kind]));
    }
    const out = section("Show", group, this.legend);
    if (this.model.movable().length > 0) {
      out.append(
        make("label", { className: "slider" }, make("span", { className: "head" }, "Exploded view"), this.apart),
        this.axesShown,
      );
    }
    if (this.scene.clouds?.length && hasBothStates(this.scene)) {
      const found = isFound(this.scene);
      const marks = check(found ? "Colour points by part" : "Mark points that moved", (on) => this.act.moved(on));
      marks.querySelector("input")!.checked = found;
      out.append(marks);
    }
    if (this.scene.clouds?.length && hasBothStates(this.scene) && this.model.movable().length === 0) out.append(make("div", { className: "row" }, ...this.states()));
    this.turning.setAttribute("aria-pressed", "false");
    const [reset, save] = [button("Reset view", () => this.act.home()), button("Save picture", () => this.act.picture())];
    const keys: [HTMLElement, string][] = [[reset, "R"], [this.turning, "T"], [save, "S"], [this.playing, "space"]];
    for (const [control, key] of keys) control.title = `Key: ${key}`;
    out.append(make("div", { className: "row" }, reset, this.turning, save));
    return out;
  }

  private joints(): HTMLElement {
    const out = section("Joints");
    for (const link of this.model.movable()) out.append(this.slider(link));
    this.playing.setAttribute("aria-pressed", "false");
    out.append(make("div", { className: "row" }, ...this.states(), this.playing));
    return out;
  }

  private states(): HTMLElement[] {
    return STATES.map((name, s) => {
      const out = button(name, () => this.act.state(s));
      out.title = `As recorded in the ${name.toLowerCase()} state`;
      return out;
    });
  }

  private slider(link: Link): HTMLElement {
    const joint = link.data.joint!;
    const [lower, upper] = joint.limits;
    const input = make("input", { type: "range", min: `${lower}`, max: `${upper}`, step: `${(upper - lower) / 500}` });
    input.dataset.link = link.data.name;
    input.setAttribute("aria-label", `${link.data.name}, ${joint.kind}`);
    input.addEventListener("input", () => {
      this.act.play(false);
      this.model.set(link, input.valueAsNumber);
    });
    const dot = make("span", { className: "dot" });
    dot.style.background = `rgb(${link.data.colour.join(" ")})`;
    const value = make("output");
    const kind = make("span", { className: "kind" }, joint.kind);
    if (joint.confidence !== undefined) {
      // Rounded down, so that only a confidence of 1 is shown as 100 %.
      kind.append(`, confidence ${Math.floor(joint.confidence * 100 + 1e-9)} %`);
      kind.title = "Probability that the joint is correct: its type, its axis to 5 degrees, its place to 5 % of the part's size, its motion to 5 % of the true motion or of the part's size";
    }
    if (joint.axis_within !== undefined) {
      // Smaller angles cannot be seen.
      kind.append(`, ±${Math.max(joint.axis_within, 0.1).toFixed(1)}°`);
      kind.title += ". If its type is right, its axis is within this angle in 95 of 100 cases";
    }
    const head = make("span", { className: "head" }, dot, link.data.name.replaceAll("_", " "), kind, value);
    const ends = make("span", { className: "ends" }, ...joint.limits.map((v) => make("span", {}, readable(joint, v))));
    const box = make("label", { className: "slider" }, head, input, ends);
    this.sliders.set(link, { box, input, value });
    return joint.alternatives?.length ? make("div", {}, box, this.others(link, joint.alternatives)) : box;
  }

  /** What else the joint of a link could be. */
  private others(link: Link, alternatives: AlternativeData[]): HTMLElement {
    const list = make("ul", { className: "others" });
    for (const data of alternatives) {
      const [what, advised] = [data.what, data.advice].map((sentence) => sentence.replace(/\.$/, ""));
      const advice = advised === "" ? "" : ` ${advised}.`;
      const text = make("span", {}, make("b", {}, doubt(link.data.joint!, data, this.scene.placement)), advice);
      text.title = `${data.kind}: ${what}. It explains ${Math.round(100 * data.cost)} % of what was seen of the part worse`;
      const item = make("li", {}, text);
      list.append(item);
      this.alternatives.push({ link, data, item });
    }
    return list;
  }

  private cameras(): HTMLElement {
    const views = this.scene.cameras!;
    const choice = make("select", { id: "camera", ariaLabel: "Camera to look through" }, make("option", { value: "" }, "Free view"));
    views.forEach((v, i) => choice.append(make("option", { value: `${i}` }, v.name)));
    const wipe = this.share;
    const bar = make("label", { className: "slider", hidden: true }, make("span", { className: "ends" }, make("span", {}, this.scene.links.length > 0 ? "Replica" : "Points"), make("span", {}, "Photo")), wipe);
    wipe.addEventListener("input", () => this.act.wipe(wipe.valueAsNumber));
    choice.addEventListener("change", () => {
      bar.hidden = choice.value === "";
      this.act.look(choice.value === "" ? null : Number(choice.value));
    });
    const out = section("Cameras", check("Show cameras", (on) => this.act.frustums(on)), choice, bar);
    if (views.some((v) => v.mask)) out.append(check("Show mask", (on) => this.act.mask(on)));
    return out;
  }

  private moved(link: Link): void {
    const slider = this.sliders.get(link)!;
    slider.input.valueAsNumber = link.value;
    slider.value.textContent = readable(link.data.joint!, link.value);
  }

  /** Marks the joint that is being dragged. */
  hold(link: Link | null): void {
    for (const [l, { box }] of this.sliders) box.classList.toggle("held", l === link);
  }

  /** Marks the joint of the part under the pointer. */
  point(link: Link | null): void {
    for (const [l, { box }] of this.sliders) box.classList.toggle("over", l === link);
  }

  mode(mode: Mode): void {
    this.modes.get(mode)!.checked = true;
    this.legend.hidden = mode !== "evidence";
  }

  /** Modes without content have no control; `later`: their content is not loaded yet. */
  allow(mode: Mode, on: boolean | "later"): void {
    const input = this.modes.get(mode)!;
    input.disabled = on !== true;
    input.parentElement!.hidden = on === false;
  }

  play(on: boolean): void {
    this.playing.setAttribute("aria-pressed", `${on}`);
    this.playing.textContent = on ? "Pause" : "Play";
  }

  turntable(on: boolean): void {
    this.turning.setAttribute("aria-pressed", `${on}`);
  }

  /** Does what the control of a key does; false if the key has none. */
  key(key: string): boolean {
    const controls: Record<string, () => void> = {
      " ": () => this.playing.isConnected && this.playing.click(),
      r: () => this.act.home(),
      t: () => this.turning.click(),
      s: () => this.act.picture(),
      a: () => this.axesShown.isConnected && this.axesShown.querySelector("input")!.click(),
    };
    controls[key]?.();
    return key in controls;
  }

  /** The share of the picture that shows the photo. */
  wipe(share: number): void {
    this.share.valueAsNumber = share;
  }

  explode(share: number): void {
    this.apart.valueAsNumber = share;
  }

  axes(on: boolean): void {
    this.axesShown.querySelector("input")!.checked = on;
  }

  /** Returns from a camera of the capture to the free view. */
  free(): void {
    const choice = this.root.querySelector<HTMLSelectElement>("#camera");
    if (choice && choice.value !== "") {
      choice.value = "";
      choice.dispatchEvent(new Event("change"));
    }
  }

  facts(text: string): void {
    this.root.querySelector("#facts")!.textContent = text;
  }
}
