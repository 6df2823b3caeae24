/** Correcting what was found: part centres moved, added, deleted or merged, joint types marked; saved by the server. */

import { Group, Mesh, MeshBasicMaterial, Plane, Quaternion, SphereGeometry, SRGBColorSpace, Vector3 } from "three";
import { button, check, make, section } from "./dom";
import type { Link, Model } from "./model";
import { isFound, type SceneData, type Triple } from "./scene";
import type { Stage } from "./stage";

const SAVED = "Saved. The next artgs reconstruct --resume makes again what depends on them.";

interface Centre {
  /** Part, or null for one that was added. */
  part: number | null;
  ball: Mesh<SphereGeometry, MeshBasicMaterial>;
  moved: boolean;
  /** What is done with a part that was found: "", "move", "delete" or the number of the part it goes into. */
  choice: HTMLSelectElement | null;
  type: HTMLSelectElement | null;
}

type Edit =
  | { action: "add"; position: Triple }
  | { action: "move"; part: number; position: Triple }
  | { action: "delete"; part: number }
  | { action: "merge"; part: number; into: number };

/** What the file says, as far as it matters here. */
interface Saved {
  centres: Edit[];
  joints: { part: number; type: string }[];
}

export class Corrections {
  readonly group = new Group();
  readonly element: HTMLElement;
  private readonly centres: Centre[] = [];
  private readonly list = make("div");
  private readonly told = make("p", { className: "note", role: "status" });
  private held: { centre: Centre; plane: Plane } | null = null;

  constructor(
    private readonly scene: SceneData,
    private readonly stage: Stage,
    private readonly model: Model,
    /** Moves every joint to state A, to which centres belong. */
    private readonly begin: () => void,
  ) {
    this.group.visible = false;
    const parts = model.movable();
    parts.forEach((link) => this.found(link, parts));
    const show = check("Show part centres", (on) => this.show(on));
    this.element = section("Corrections", show, this.list);
    if (scene.placement) this.element.append(make("div", { className: "row" }, button("Add a centre", () => (this.add(), this.show(true)))));
    const row = make("div", { className: "row" }, button("Save corrections", () => void this.save()));
    this.element.append(row, this.told);
    if (scene.rerun) {
      const go = button(isFound(scene) ? "Save and go on" : "Save and run again", () => void this.run());
      go.disabled = scene.rerun.refused !== null;
      row.append(go);
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
    if (this.scene.placement) choice.append(option("move", "moved"));
    choice.append(option("delete", "delete"));
    for (const other of parts) {
      if (other !== link) choice.append(option(`${other.index}`, `merge into ${other.data.name.replaceAll("_", " ")}`));
    }
    const type = make("select", { ariaLabel: `Type of ${name}` }, option("", "as found"));
    for (const kind of ["revolute", "prismatic", "screw"]) type.append(option(kind, kind));
    const centre: Centre = { part: link.index, ball: this.ball(link.data.colour), moved: false, choice, type };
    choice.addEventListener("change", () => {
      // A centre that is to be moved begins where the part is.
      this.show(true);
      chosen(centre);
      this.show(true);
    });
    this.centres.push(centre);
    const dot = make("span", { className: "dot" });
    dot.style.background = `rgb(${link.data.colour.join(" ")})`;
    this.list.append(make("div", { className: "edit" }, make("span", {}, dot, name), choice, type));
  }

  /** A new part, in the middle of the object or where it was put before. */
  private add(at = this.model.extent().getCenter(new Vector3())): void {
    const centre: Centre = { part: null, ball: this.ball([120, 60, 200]), moved: true, choice: null, type: null };
    centre.ball.position.copy(at);
    this.centres.push(centre);
    const row = make("div", { className: "edit" }, make("span", {}, "New part"), make("span", { className: "kind" }, "drag its ball"));
    row.append(
      button("Remove", () => {
        this.centres.splice(this.centres.indexOf(centre), 1);
        this.group.remove(centre.ball);
        row.remove();
        this.stage.invalidate();
      }),
    );
    this.list.append(row);
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
    };
    canvas.addEventListener("pointerdown", grab, { capture: true });
    canvas.addEventListener("pointermove", move);
    canvas.addEventListener("pointerup", release);
    canvas.addEventListener("pointercancel", release);
  }

  /** A point of the object's frame in the capture's. */
  private captured(point: Vector3): Triple {
    const { scale, rotation } = this.scene.placement!;
    return point.clone().applyQuaternion(new Quaternion(...rotation).invert()).divideScalar(scale).toArray() as Triple;
  }

  /** A point of the capture's frame in the object's. */
  private placed(point: Triple): Vector3 {
    const { scale, rotation } = this.scene.placement!;
    return new Vector3(...point).multiplyScalar(scale).applyQuaternion(new Quaternion(...rotation));
  }

  /** Begins with what was saved before and is not in what is shown. */
  async load(): Promise<void> {
    const unshown = (words: string) => `Corrections that were saved before are not shown here: ${words}. Saving replaces them.`;
    try {
      const answer = await fetch("corrections");
      if (!answer.ok) throw new Error((await answer.text()).trim());
      const { centres, joints } = (await answer.json()) as Saved;
      const strange = [...centres.filter((edit) => !this.edit(edit)), ...joints.filter((mark) => !this.mark(mark))];
      if (strange.length > 0) this.told.textContent = unshown(strange.map((s) => JSON.stringify(s)).join(", "));
      else if (centres.length + joints.length > 0) this.told.textContent = "Saved before, and not yet in what is shown.";
    } catch (error) {
      this.told.textContent = unshown(error instanceof Error ? error.message : String(error));
    }
  }

  /** False if the controls cannot say that: there is one choice for each part that was found. */
  private edit(edit: Edit): boolean {
    if (!this.scene.placement && "position" in edit) return false;
    if (edit.action === "add") return (this.add(this.placed(edit.position)), true);
    const centre = this.centres.find((c) => c.part === edit.part);
    const value = edit.action === "merge" ? `${edit.into}` : edit.action;
    if (!centre?.choice || centre.choice.value !== "" || ![...centre.choice.options].some((o) => o.value === value)) return false;
    centre.choice.value = value;
    chosen(centre);
    if (edit.action === "move") centre.ball.position.copy(this.placed(edit.position));
    return true;
  }

  private mark({ part, type }: Saved["joints"][number]): boolean {
    const select = this.centres.find((c) => c.part === part)?.type;
    if (!select || select.disabled) return false;
    select.value = type;
    return true;
  }

  /** What the file will say. A part is moved before another is merged into it, and merged before that one goes. */
  edits(): Saved {
    const order = { move: 0, merge: 1, delete: 2, add: 3 };
    const centres = this.centres.flatMap(({ part, ball, choice }): Edit[] => {
      if (part === null) return [{ action: "add", position: this.captured(ball.position) }];
      if (choice!.value === "move") return [{ action: "move", part, position: this.captured(ball.position) }];
      if (choice!.value === "delete") return [{ action: "delete", part }];
      return choice!.value === "" ? [] : [{ action: "merge", part, into: Number(choice!.value) }];
    });
    centres.sort((a, b) => order[a.action] - order[b.action]);
    const joints = this.centres.flatMap(({ part, type }) =>
      part !== null && type!.value !== "" && !type!.disabled ? [{ part, type: type!.value }] : [],
    );
    return { centres, joints };
  }

  private async save(): Promise<boolean> {
    const refused = await post("corrections", { format: "artgs-corrections", version: 1, ...this.edits() });
    this.told.textContent = refused === null ? SAVED : `Not saved: ${refused}`;
    return refused === null;
  }

  /** Makes again what depends on the corrections; the page follows that, and shows then what was made. */
  private async run(): Promise<void> {
    if (!(await this.save())) return;
    const refused = await post("rerun", {});
    if (refused === null) location.reload();
    else this.told.textContent = `Saved, but not started: ${refused}`;
  }
}

/** What goes with the choice for a part that was found. */
function chosen(centre: Centre): void {
  const value = centre.choice!.value;
  centre.moved = value === "move";
  centre.ball.visible = value === "" || centre.moved;
  centre.type!.disabled = !centre.ball.visible;
}

/** Why the server refuses it, if it does. */
async function post(path: string, data: object): Promise<string | null> {
  const headers = { "Content-Type": "application/json" };
  try {
    const answer = await fetch(path, { method: "POST", headers, body: JSON.stringify(data) });
    // All of it is read: a page that leaves before would break the answer off.
    const words = (await answer.text()).trim();
    return answer.ok ? null : words;
  } catch (error) {
    return error instanceof Error ? error.message : String(error);
  }
}

function middle(link: Link): Vector3 {
  const centre = link.box.isEmpty() ? new Vector3() : link.box.getCenter(new Vector3());
  return link.moved.localToWorld(centre);
}
