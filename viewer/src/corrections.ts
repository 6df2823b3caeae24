/** Corrections: moves, adds, deletes, merges or splits parts and sets joints; the server saves them. */

import { Group, Mesh, MeshBasicMaterial, Plane, Quaternion, SphereGeometry, SRGBColorSpace, Vector3 } from "three";
import { Cut } from "./cut";
import { button, check, make, section } from "./dom";
import { post } from "./files";
import type { Link, Model } from "./model";
import { type AlternativeData, CLASSES, isFound, type MarkedJoint, type SceneData, type Triple } from "./scene";
import type { Stage } from "./stage";

const SAVED = "Saved. The next artgs reconstruct --resume recomputes what depends on them; the next artgs export uses the classes.";

interface Centre {
  /** Index of the part; null for an added part. */
  part: number | null;
  ball: Mesh<SphereGeometry, MeshBasicMaterial>;
  moved: boolean;
  /** Correction of a part: "" (keep), "move", "split", "delete" or the number of the part to merge into; null for an added
   * part. */
  choice: HTMLSelectElement | null;
  type: HTMLSelectElement | null;
  /** What the part is; "" for what was found; null for an added part. */
  kind: HTMLSelectElement | null;
  /** Where a part is split; null for an added part. */
  cut: Cut | null;
  /** The joint to begin with; null if only its type is given. */
  joint: MarkedJoint | null;
  /** Buttons that set it. */
  offers: { data: AlternativeData; use: HTMLButtonElement }[];
  /** The controls of an added part. */
  row: HTMLElement | null;
}

type Edit =
  | { action: "add"; position: Triple }
  | { action: "move"; part: number; position: Triple }
  | { action: "delete"; part: number }
  | { action: "merge"; part: number; into: number }
  | { action: "split"; part: number; plane?: { point: Triple; normal: Triple }; points?: Triple[] };

/** The fields of `corrections.json` that this page uses. */
interface Saved {
  centres: Edit[];
  joints: { part: number; type: string; joint?: MarkedJoint }[];
  classes?: { part: number; class: string }[];
}

export class Corrections {
  readonly group = new Group();
  readonly element: HTMLElement;
  private readonly centres: Centre[] = [];
  private readonly list = make("div");
  private readonly status = make("p", { className: "note", role: "status" });
  private held: { centre: Centre; plane: Plane } | null = null;
  /** The corrections after each change, the last one as they are. */
  private readonly history: string[] = [];
  private readonly undoing = button("Undo", () => this.undo());

  constructor(
    private readonly scene: SceneData,
    private readonly stage: Stage,
    private readonly model: Model,
    /** Moves every joint to the start state; centres are given in that state. */
    private readonly begin: () => void,
  ) {
    this.group.visible = false;
    const parts = model.movable();
    parts.forEach((link) => this.found(link, parts));
    const show = check("Show part centres", (on) => this.show(on));
    this.element = section("Corrections", show, this.list);
    const added = () => (this.add(), this.show(true), this.remember());
    const changes = scene.placement ? [button("Add a centre", added), this.undoing] : [this.undoing];
    this.element.append(make("div", { className: "row" }, ...changes));
    this.list.addEventListener("change", () => this.remember());
    const row = make("div", { className: "row" }, button("Save corrections", () => void this.save()));
    this.element.append(row, this.status);
    if (scene.rerun) {
      const start = button(isFound(scene) ? "Save and continue" : "Save and run again", () => void this.run());
      start.disabled = scene.rerun.refused !== null;
      row.append(start);
    }
    if (scene.rerun?.refused) {
      this.element.append(make("p", { className: "note" }, `A run cannot be started here: ${scene.rerun.refused}.`));
    }
    this.listen();
  }

  private show(on: boolean): void {
    if (on) {
      this.begin();
      this.model.root.updateMatrixWorld(true);
      for (const c of this.centres) {
        if (c.part !== null && !c.moved) c.ball.position.copy(middle(this.model.links[c.part]));
      }
    }
    this.element.querySelector("input")!.checked = on;
    this.group.visible = on;
    this.stage.invalidate();
  }

  private ball(colour: Triple): Centre["ball"] {
    const size = this.model.extent().getSize(new Vector3()).length() || 1;
    const paint = new MeshBasicMaterial({ depthTest: false, transparent: true, opacity: 0.9 });
    paint.color.setRGB(colour[0] / 255, colour[1] / 255, colour[2] / 255, SRGBColorSpace);
    const ball = new Mesh(new SphereGeometry(0.015 * size, 24, 16), paint);
    ball.renderOrder = 20;
    this.group.add(ball);
    return ball;
  }

  private found(link: Link, parts: Link[]): void {
    const name = link.data.name.replaceAll("_", " ");
    const option = (value: string, text: string) => make("option", { value }, text);
    const choice = make("select", { ariaLabel: `Centre of ${name}` }, option("", "keep"));
    if (this.scene.placement) choice.append(option("move", "moved"), option("split", "split"));
    choice.append(option("delete", "delete"));
    for (const other of parts) {
      if (other !== link) choice.append(option(`${other.index}`, `merge into ${other.data.name.replaceAll("_", " ")}`));
    }
    const type = make("select", { ariaLabel: `Type of ${name}` }, option("", "as found"));
    for (const kind of ["revolute", "prismatic", "screw"]) type.append(option(kind, kind));
    const kind = make("select", { ariaLabel: `Class of ${name}` }, option("", "class as found"));
    for (const word of CLASSES) kind.append(option(word, word.replaceAll("_", " ")));
    if (link.data.semantics?.given) kind.value = link.data.semantics.class;
    const cut = new Cut(link, this.group, () => this.stage.invalidate());
    const ball = this.ball(link.data.colour);
    const centre: Centre = { part: link.index, ball, moved: false, choice, type, kind, cut, joint: null, offers: [], row: null };
    type.addEventListener("change", () => give(centre, null));
    choice.addEventListener("change", () => {
      // A centre to be moved starts at the middle of the part.
      this.show(true);
      chosen(centre);
      this.show(true);
    });
    this.centres.push(centre);
    const dot = make("span", { className: "dot" });
    dot.style.background = `rgb(${link.data.colour.join(" ")})`;
    this.list.append(make("div", { className: "edit" }, make("span", {}, dot, name), choice, type, kind), cut.element);
  }

  /** Adds a button that gives a part another joint. */
  offer(link: Link, data: AlternativeData, item: HTMLElement): void {
    const centre = this.centres.find((c) => c.part === link.index);
    if (!centre) return;
    const use = button("use this", () => {
      const used = use.getAttribute("aria-pressed") === "true";
      centre.type!.value = used ? "" : data.kind;
      give(centre, used ? null : data.joint);
      this.remember();
    });
    use.setAttribute("aria-pressed", "false");
    centre.offers.push({ data, use });
    item.append(use);
  }

  /** Adds a part at `at`, by default in the middle of the object. */
  private add(at = this.model.extent().getCenter(new Vector3())): void {
    const ball = this.ball([120, 60, 200]);
    const centre: Centre = { part: null, ball, moved: true, choice: null, type: null, kind: null, cut: null, joint: null, offers: [], row: null };
    centre.ball.position.copy(at);
    this.centres.push(centre);
    const row = make("div", { className: "edit" }, make("span", {}, "New part"), make("span", { className: "kind" }, "drag its ball"));
    row.append(
      button("Remove", () => {
        this.remove(centre);
        this.remember();
      }),
    );
    centre.row = row;
    this.list.append(row);
  }

  /** Removes a part that was added. */
  private remove(centre: Centre): void {
    this.centres.splice(this.centres.indexOf(centre), 1);
    this.group.remove(centre.ball);
    centre.row?.remove();
    this.stage.invalidate();
  }

  /** Keeps what the controls say, so that the next change can be undone. */
  private remember(): void {
    const now = JSON.stringify(this.edits());
    if (now !== this.history.at(-1)) this.history.push(now);
    this.undoing.disabled = this.history.length < 2;
  }

  private undo(): void {
    this.history.pop();
    const before = JSON.parse(this.history.at(-1)!) as Saved;
    for (const centre of [...this.centres]) {
      if (centre.part === null) {
        this.remove(centre);
        continue;
      }
      const { semantics } = this.model.links[centre.part].data;
      centre.choice!.value = centre.type!.value = "";
      centre.kind!.value = semantics?.given ? semantics.class : "";
      chosen(centre);
      give(centre, null);
    }
    before.centres.forEach((edit) => this.edit(edit));
    before.joints.forEach((mark) => this.mark(mark));
    before.classes?.forEach((mark) => this.classed(mark));
    this.show(this.group.visible);
    this.remember();
  }

  /** Balls are dragged in the plane that faces the camera. */
  private listen(): void {
    const { canvas, controls, camera } = this.stage;
    const grab = (event: PointerEvent) => {
      if (!this.group.visible || !this.scene.placement || event.button !== 0 || !event.isPrimary || !controls.enabled) return;
      const balls = this.centres.filter((c) => c.ball.visible);
      const hit = this.stage.ray(event.clientX, event.clientY).intersectObjects(balls.map((c) => c.ball))[0];
      const centre = balls.find((c) => c.ball === hit?.object);
      if (!centre) return;
      const facing = camera.getWorldDirection(new Vector3());
      this.held = { centre, plane: new Plane().setFromNormalAndCoplanarPoint(facing, centre.ball.position) };
      controls.enabled = false;
      canvas.setPointerCapture(event.pointerId);
      event.stopImmediatePropagation();
    };
    const move = (event: PointerEvent) => {
      if (!this.held || !event.isPrimary) return;
      const { centre, plane } = this.held;
      if (!this.stage.ray(event.clientX, event.clientY).ray.intersectPlane(plane, centre.ball.position)) return;
      centre.moved = true;
      if (centre.choice) centre.choice.value = "move";
      this.stage.invalidate();
    };
    const release = (event: PointerEvent) => {
      if (!this.held || !event.isPrimary) return;
      this.held = null;
      controls.enabled = true;
      this.remember();
    };
    canvas.addEventListener("pointerdown", grab, { capture: true });
    canvas.addEventListener("pointermove", move);
    canvas.addEventListener("pointerup", release);
    canvas.addEventListener("pointercancel", release);
  }

  /** From the object's frame to the capture's frame. */
  private inCapture(point: Vector3): Triple {
    const { scale, rotation, translation } = this.scene.placement!;
    return point.clone().sub(new Vector3(...translation)).applyQuaternion(new Quaternion(...rotation).invert()).divideScalar(scale).toArray() as Triple;
  }

  /** From the capture's frame to the object's frame. */
  private inObject(point: Triple): Vector3 {
    const { scale, rotation, translation } = this.scene.placement!;
    return new Vector3(...point).multiplyScalar(scale).applyQuaternion(new Quaternion(...rotation)).add(new Vector3(...translation));
  }

  /** Directions from the capture's frame to the object's frame, and back. */
  private turned(direction: Triple): Vector3 {
    return new Vector3(...direction).applyQuaternion(new Quaternion(...this.scene.placement!.rotation));
  }

  private turnedBack(direction: Vector3): Triple {
    return direction.clone().applyQuaternion(new Quaternion(...this.scene.placement!.rotation).invert()).toArray() as Triple;
  }

  /** Loads saved corrections that are not applied yet into the controls. */
  async load(): Promise<void> {
    const notShown = (words: string) => `Saved corrections that cannot be shown here: ${words}. Saving replaces them.`;
    try {
      const answer = await fetch("corrections");
      if (!answer.ok) throw new Error((await answer.text()).trim());
      const { centres, joints, classes = [] } = (await answer.json()) as Saved;
      const unknown = [
        ...centres.filter((edit) => !this.edit(edit)),
        ...joints.filter((mark) => !this.mark(mark)),
        ...classes.filter((mark) => !this.classed(mark)),
      ];
      if (unknown.length > 0) this.status.textContent = notShown(unknown.map((s) => JSON.stringify(s)).join(", "));
      else if (centres.length + joints.length > 0) this.status.textContent = "Corrections were saved earlier and are not applied yet.";
    } catch (error) {
      this.status.textContent = notShown(error instanceof Error ? error.message : String(error));
    }
    this.remember();
  }

  /** Sets the controls to an edit. False if they cannot express it: each part has one choice. */
  private edit(edit: Edit): boolean {
    if (!this.scene.placement && ("position" in edit || edit.action === "split")) return false;
    if (edit.action === "split" && !edit.plane) return false;
    if (edit.action === "add") return (this.add(this.inObject(edit.position)), true);
    const centre = this.centres.find((c) => c.part === edit.part);
    const value = edit.action === "merge" ? `${edit.into}` : edit.action;
    if (!centre?.choice || centre.choice.value !== "" || ![...centre.choice.options].some((o) => o.value === value)) return false;
    centre.choice.value = value;
    chosen(centre);
    if (edit.action === "split") centre.cut!.set(this.inObject(edit.plane!.point), this.turned(edit.plane!.normal));
    if (edit.action === "move") centre.ball.position.copy(this.inObject(edit.position));
    return true;
  }

  private mark({ part, type, joint }: Saved["joints"][number]): boolean {
    const centre = this.centres.find((c) => c.part === part);
    if (!centre?.type || centre.type.disabled) return false;
    centre.type.value = type;
    give(centre, joint ?? null);
    return true;
  }

  private classed(mark: { part: number; class: string }): boolean {
    const kind = this.centres.find((c) => c.part === mark.part)?.kind;
    if (!kind) return false;
    kind.value = mark.class;
    return kind.value === mark.class;
  }

  /**
   * The corrections to save. Order: a part is moved before others are merged into it, merged before it is split, and all
   * precede deletions.
   */
  edits(): Saved {
    const order = { move: 0, merge: 1, split: 2, delete: 3, add: 4 };
    const centres = this.centres.flatMap(({ part, ball, choice, cut }): Edit[] => {
      if (part === null) return [{ action: "add", position: this.inCapture(ball.position) }];
      if (choice!.value === "move") return [{ action: "move", part, position: this.inCapture(ball.position) }];
      if (choice!.value === "delete") return [{ action: "delete", part }];
      if (choice!.value === "split") {
        const { point, normal } = cut!.get();
        return [{ action: "split", part, plane: { point: this.inCapture(point), normal: this.turnedBack(normal) } }];
      }
      return choice!.value === "" ? [] : [{ action: "merge", part, into: Number(choice!.value) }];
    });
    centres.sort((a, b) => order[a.action] - order[b.action]);
    const joints = this.centres.flatMap(({ part, type, joint }) =>
      part !== null && type!.value !== "" && !type!.disabled ? [{ part, type: type!.value, ...(joint && { joint }) }] : [],
    );
    const kept = ({ part, kind, choice }: Centre) => part !== null && kind!.value !== "" && (choice!.value === "" || choice!.value === "move");
    const classes = this.centres.filter(kept).map(({ part, kind }) => ({ part: part!, class: kind!.value }));
    return { centres, joints, ...(classes.length > 0 && { classes }) };
  }

  private async save(): Promise<boolean> {
    const refused = await post("corrections", { format: "artgs-corrections", version: 1, ...this.edits() });
    this.status.textContent = refused === null ? SAVED : `Not saved: ${refused}`;
    return refused === null;
  }

  /** Saves and starts a run that applies the corrections; the page follows the run and then shows its result. */
  private async run(): Promise<void> {
    if (!(await this.save())) return;
    const refused = await post("rerun", {});
    if (refused === null) location.reload();
    else this.status.textContent = `Saved, but not started: ${refused}`;
  }
}

/** Updates the ball and the type after the choice of a part changed. */
function chosen(centre: Centre): void {
  const value = centre.choice!.value;
  centre.moved = value === "move";
  const split = value === "split";
  centre.ball.visible = value === "" || centre.moved;
  centre.cut!.visible = split;
  centre.type!.disabled = !centre.ball.visible && !split;
}

/** Gives a part a joint to begin with, or takes it away. */
function give(centre: Centre, joint: MarkedJoint | null): void {
  centre.joint = joint;
  const same = (other: MarkedJoint) => joint !== null && JSON.stringify([joint.axis, joint.origin]) === JSON.stringify([other.axis, other.origin]);
  for (const { data, use } of centre.offers) {
    use.setAttribute("aria-pressed", `${data.kind === centre.type!.value && same(data.joint)}`);
  }
}

function middle(link: Link): Vector3 {
  const centre = link.box.isEmpty() ? new Vector3() : link.box.getCenter(new Vector3());
  return link.moved.localToWorld(centre);
}
