/** Follows a running reconstruction: replaces the Gaussians when new ones arrive and plots loss and PSNR. */

import { Box3, Group, Quaternion, Vector3 } from "three";
import { SplatFileType, SplatMesh } from "@sparkjsdev/spark";
import { button, make, section } from "./dom";
import { Plot } from "./plot";
import type { SceneData } from "./scene";
import type { Stage } from "./stage";

/** Milliseconds between requests; the same of a hidden page; failed requests after which the run counts as lost. */
const BEAT = 1000;
const SLOW = 4000;
const PATIENCE = 4;

/** `live.json`. */
interface LiveData {
  format: string;
  version: number;
  state: "running" | "finished" | "failed";
  message: string | null;
  /** Since the start of the run. */
  seconds: number;
  stages: { name: string; seconds: number | null; reused: boolean }[];
  progress: { step: number; total: number; gaussians: number | null };
  /** Value of `since` for the next request. */
  since: number;
  /** Since then: index of the stage, step, loss, PSNR (dB). */
  points: [number, number, number | null, number | null][];
  /** Version of the Gaussians; 0: none yet. */
  splats: number;
  /** Number of parts; 0: not known yet. */
  parts: number;
}

type Tint = "splats" | "parts";

function clock(seconds: number): string {
  const whole = Math.round(seconds);
  const [h, m, s] = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60, whole % 60];
  const two = (n: number) => `${n}`.padStart(2, "0");
  return h > 0 ? `${h}:${two(m)}:${two(s)}` : `${m}:${two(s)}`;
}

/** The latest Gaussians of the run. */
class Swapped {
  readonly group = new Group();
  private mesh: SplatMesh | null = null;
  private shown = "";
  private loading = false;

  constructor(
    private readonly stage: Stage,
    { scale, rotation, translation }: NonNullable<SceneData["placement"]>,
  ) {
    this.group.scale.setScalar(scale);
    this.group.quaternion.copy(new Quaternion().fromArray(rotation));
    this.group.position.set(...translation);
    stage.add(this.group);
    stage.drawSplats(true);
  }

  get count(): number {
    return this.mesh?.packedSplats?.numSplats ?? 0;
  }

  get state(): string {
    return this.shown;
  }

  /** Fetches a version that is not shown yet and replaces the previous one. */
  async show(version: number, tint: Tint): Promise<void> {
    const wanted = `${tint} ${version}`;
    if (this.loading || version === 0 || this.shown === wanted) return;
    this.loading = true;
    try {
      const answer = await fetch(`live/${tint}.spz`);
      // A later version may load.
      if (!answer.ok) return;
      const fileBytes = new Uint8Array(await answer.arrayBuffer());
      const next = new SplatMesh({ fileBytes, fileType: SplatFileType.SPZ, raycastable: false });
      await next.initialized;
      const first = !this.mesh;
      this.group.add(next);
      if (this.mesh) {
        this.group.remove(this.mesh);
        this.mesh.dispose();
      }
      this.mesh = next;
      this.shown = wanted;
      if (first) {
        this.group.updateMatrixWorld(true);
        const box: Box3 = next.getBoundingBox(true).applyMatrix4(next.matrixWorld);
        this.stage.frameObject(box, new Vector3());
      }
      this.stage.invalidate();
    } finally {
      this.loading = false;
    }
  }
}

/** Loss and quality over all stages. */
class Numbers {
  readonly element: HTMLElement;
  private readonly psnr = new Plot("PSNR, training views", " dB", 1, false);
  private readonly loss = new Plot("Loss", "", 4, true);
  private points: LiveData["points"] = [];
  since = 0;

  constructor() {
    this.element = section("Progress", this.psnr.element, this.loss.element);
  }

  get length(): number {
    return this.points.length;
  }

  add(data: LiveData): void {
    // Fewer steps than before: another run started.
    if (data.since < this.since) this.points = [];
    this.points.push(...data.points);
    this.since = data.since;
    if (data.points.length === 0) return;
    const [xs, starts]: [number[], number[]] = [[], []];
    let [offset, last] = [0, 0];
    this.points.forEach(([stage, step], i) => {
      if (i > 0 && stage !== this.points[i - 1][0]) starts.push((offset = last));
      xs.push((last = offset + step));
    });
    this.psnr.draw(xs, this.points.map((p) => p[3]), starts);
    this.loss.draw(xs, this.points.map((p) => p[2]), starts);
  }
}

/** State, progress bar and stages of the run. */
class Words {
  readonly facts = make("p", { className: "facts", id: "facts" });
  readonly bar = make("progress", { max: 1, ariaLabel: "Steps of this stage" });
  readonly stages = make("ol", { className: "done" });

  update(data: LiveData): void {
    const { step, total, gaussians } = data.progress;
    const running = data.state === "running";
    const stage = data.stages[data.stages.length - 1];
    const facts = [`${running ? "Running" : data.state === "finished" ? "Finished" : "Failed"}, ${clock(data.seconds)}`];
    if (running && stage) facts.push(stage.name + (step > 0 ? `, step ${step}${total > 0 ? ` of ${total}` : ""}` : ""));
    if (gaussians) facts.push(`${gaussians.toLocaleString("en")} Gaussians`);
    this.facts.textContent = facts.join(" · ");
    this.bar.hidden = !running;
    if (total > 0) this.bar.value = step / total;
    else this.bar.removeAttribute("value");
    const items = data.stages.map((s) => {
      const state = s.reused ? "reused from the earlier run" : s.seconds === null ? (running ? "…" : "") : clock(s.seconds);
      return make("li", {}, s.name, make("span", { className: "kind" }, state));
    });
    this.stages.replaceChildren(...items);
  }
}

/** Follows the run until it ends. `say` shows a message; an empty text hides it. */
export function startLive(scene: SceneData, stage: Stage, say: (words: string, wrong?: boolean) => void) {
  const placement: NonNullable<SceneData["placement"]> = scene.placement ?? { scale: 1, rotation: [0, 0, 0, 1], translation: [0, 0, 0] };
  const [swapped, numbers, words] = [new Swapped(stage, placement), new Numbers(), new Words()];
  let tint: Tint = "splats";
  let latest: LiveData | null = null;

  const choices = make("div", { className: "choices" });
  const parts = make("input", { type: "radio", name: "tint", value: "parts", disabled: true });
  const photo = make("input", { type: "radio", name: "tint", value: "splats", checked: true });
  const choose = (next: Tint) => {
    tint = next;
    (next === "parts" ? parts : photo).checked = true;
    return swapped.show(latest?.splats ?? 0, tint);
  };
  for (const [input, name] of [[photo, "Splats"], [parts, "Parts"]] as const) {
    input.addEventListener("change", () => void choose(input.value as Tint));
    choices.append(make("label", {}, input, make("span", {}, name)));
  }
  const show = section("Show", make("fieldset", { ariaLabel: "Colours" }, choices), make("div", { className: "row" }, button("Reset view", () => stage.home())));
  const panel = document.querySelector("#panel")!;
  panel.replaceChildren(make("h1", {}, scene.name.replaceAll("_", " ")), words.facts, words.bar, show, numbers.element, section("Stages", words.stages));
  say("Waiting for the first Gaussians…");

  const ask = async () => {
    const answer = await fetch(`live.json?since=${numbers.since}`);
    if (!answer.ok) throw new Error(`live.json: ${(await answer.text()).trim()}`);
    const data = (await answer.json()) as LiveData;
    if (data.format !== "artgs-live" || data.version !== 1) throw new Error(`live.json is ${data.format} version ${data.version}`);
    latest = data;
    numbers.add(data);
    words.update(data);
    parts.disabled = data.parts === 0;
    if (data.parts === 0 && tint === "parts") void choose("splats");
    // A hidden page does not request Gaussians, so that training does not wait for it.
    if (!document.hidden || data.state !== "running") await swapped.show(data.splats, tint);
    if (data.state === "failed") {
      say(`The run failed: ${data.message ?? ""}`, true);
      if (scene.returns) words.facts.after(make("div", { className: "row" }, button("Back", () => location.reload())));
    } else if (data.state === "finished" && scene.returns) location.reload();
    else if (data.state === "finished") say("The run is finished. “artgs view” shows the result.");
    else if (swapped.count > 0) say("");
  };
  const follow = async () => {
    for (let missed = 0; latest?.state !== "finished" && latest?.state !== "failed"; ) {
      try {
        await ask();
        missed = 0;
      } catch (error) {
        missed++;
        if (missed === PATIENCE) say("The server does not answer: the run ended or was stopped. The page shows the last data received.", true);
        else if (!(error instanceof TypeError)) say(error instanceof Error ? error.message : String(error), true);
      }
      await new Promise((done) => setTimeout(done, document.hidden || missed >= PATIENCE ? SLOW : BEAT));
    }
  };
  void follow();

  return {
    stage,
    settled: () => stage.settled(),
    /** Colours of the Gaussians. */
    setTint: choose,
    /** State of the page, for tests. */
    live: () => ({ shown: swapped.state, splats: swapped.count, points: numbers.length, state: latest?.state, parts: latest?.parts ?? 0 }),
  };
}
