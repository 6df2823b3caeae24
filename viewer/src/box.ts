/** The box of the object in a recording: drawn in 3D, dragged by its faces or set by numbers, then copied or saved. */

import {
  BoxGeometry,
  BufferAttribute,
  BufferGeometry,
  CanvasTexture,
  Color,
  EdgesGeometry,
  Group,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  MeshBasicMaterial,
  Points,
  PointsMaterial,
  Quaternion,
  type Ray,
  SRGBColorSpace,
  Vector2,
  Vector3,
} from "three";
import type { Clouds } from "./clouds";
import { button, make, section } from "./dom";
import { exported, post } from "./files";
import { hasBothStates, type SceneData, type Triple } from "./scene";
import type { Stage } from "./stage";

const AXES = ["x", "y", "z"] as const;
/** Colours of the axes; those of the Okabe and Ito palette that differ from the box. */
const COLOURS: Triple[] = [
  [213, 94, 0],
  [0, 158, 115],
  [0, 114, 178],
];
/** Distance from a handle at which it is grabbed, CSS pixels. */
const REACH = { mouse: 14, other: 28 };

export interface Bounds {
  lower: Triple;
  upper: Triple;
}

/** A bound in decimal steps between a thousandth and a ten-thousandth of the longest edge. */
export function short(value: number, { lower, upper }: Bounds): number {
  const longest = Math.max(...upper.map((v, k) => v - lower[k]));
  const digits = Math.min(100, Math.max(0, 3 - Math.floor(Math.log10(longest))));
  // Without the sign of a negative zero.
  return Number(value.toFixed(digits)) + 0;
}

/** What is wrong with a box; null if it can be used. */
export function fault({ lower, upper }: Bounds): string | null {
  for (const [k, axis] of AXES.entries()) {
    if (!Number.isFinite(lower[k]) || !Number.isFinite(upper[k])) return `${axis} needs two numbers.`;
    if (lower[k] >= upper[k]) return `The highest ${axis} must be above the lowest.`;
  }
  return null;
}

/** The option of `artgs reconstruct`. */
export function option({ lower, upper }: Bounds): string {
  return `--box ${[...lower, ...upper].join(",")}`;
}

/** Position on the line through `point` along axis `axis` that is nearest to a ray; null if the ray is along the axis. */
export function along(ray: Ray, point: Vector3, axis: number): number | null {
  const unit = new Vector3().setComponent(axis, 1);
  const direction = ray.direction.clone().normalize();
  const slope = unit.dot(direction);
  const across = 1 - slope * slope;
  if (across < 1e-3) return null;
  const offset = ray.origin.clone().sub(point);
  return point.getComponent(axis) + (unit.dot(offset) - slope * direction.dot(offset)) / across;
}

/** A round dot, so that handles look like handles. */
function disc(): CanvasTexture {
  const canvas = make("canvas", { width: 64, height: 64 });
  const pen = canvas.getContext("2d")!;
  pen.fillStyle = "#fff";
  pen.arc(32, 32, 30, 0, 2 * Math.PI);
  pen.fill();
  return new CanvasTexture(canvas);
}

export class ObjectBox {
  readonly element: HTMLElement;
  /** In the frame and unit of the recording. */
  readonly group = new Group();
  private bounds: Bounds;
  private held: { axis: number; side: "lower" | "upper"; from: Vector3; grabbed: number; value: number } | null = null;
  private readonly edges: LineSegments;
  private readonly body: Mesh;
  private readonly handles: Points<BufferGeometry, PointsMaterial>;
  private readonly fields: { axis: number; side: "lower" | "upper"; input: HTMLInputElement }[] = [];
  private readonly editor = make("div", { hidden: true });
  private readonly text = make("code", { id: "box-option" });
  private readonly inside = make("p", { className: "note" });
  private readonly status = make("p", { className: "note" });
  private readonly copying = button("Copy", () => void this.copy());
  private readonly saving = button("Save box", () => void this.save());
  private readonly placing = button("Place a box", () => this.show(!this.group.visible));

  constructor(
    private readonly scene: SceneData,
    private readonly stage: Stage,
    private readonly clouds: Clouds,
  ) {
    const { lower, upper, saved } = scene.object_box!;
    this.bounds = { lower: [...lower], upper: [...upper] };
    const { scale, rotation, translation } = scene.placement!;
    this.group.scale.setScalar(scale);
    this.group.quaternion.copy(new Quaternion(...rotation));
    this.group.position.set(...translation);
    const cube = new BoxGeometry(1, 1, 1);
    const accent = "#e0402a";
    this.edges = new LineSegments(new EdgesGeometry(cube), new LineBasicMaterial({ color: accent }));
    this.body = new Mesh(cube, new MeshBasicMaterial({ color: accent, transparent: true, opacity: 0.06, depthWrite: false }));
    this.handles = new Points(
      new BufferGeometry(),
      new PointsMaterial({ size: 17, sizeAttenuation: false, vertexColors: true, map: disc(), alphaTest: 0.5, depthTest: false, transparent: true }),
    );
    const colours = COLOURS.flatMap(([r, g, b]) => {
      const linear = new Color().setRGB(r / 255, g / 255, b / 255, SRGBColorSpace).toArray();
      return [...linear, ...linear];
    });
    this.handles.geometry.setAttribute("position", new BufferAttribute(new Float32Array(18), 3));
    this.handles.geometry.setAttribute("color", new BufferAttribute(Float32Array.from(colours), 3));
    this.handles.frustumCulled = false;
    this.handles.renderOrder = 20;
    this.group.add(this.edges, this.body, this.handles);
    this.element = this.panel();
    this.listen();
    this.show(saved);
  }

  private panel(): HTMLElement {
    const table = make("div", { className: "bounds" }, make("span"), make("span", { className: "kind" }, "lowest"), make("span", { className: "kind" }, "highest"));
    for (const [axis, name] of AXES.entries()) {
      const dot = make("span", { className: "dot" });
      dot.style.background = `rgb(${COLOURS[axis].join(" ")})`;
      table.append(make("span", {}, dot, name));
      for (const side of ["lower", "upper"] as const) {
        const input = make("input", { type: "number", step: "any", ariaLabel: `${side === "lower" ? "Lowest" : "Highest"} ${name}` });
        input.addEventListener("input", () => this.typed());
        this.fields.push({ axis, side, input });
        table.append(input);
      }
    }
    const { file, refused } = this.scene.object_box!;
    const buttons = make("div", { className: "row" }, this.copying);
    if (file) buttons.append(this.saving);
    this.editor.append(table, this.inside, make("p", { className: "option" }, this.text), buttons);
    if (!file) this.editor.append(make("p", { className: "note" }, exported ? "This page cannot save files: copy the option." : `The box cannot be saved: ${refused}. Copy the option instead.`));
    this.editor.append(this.status);
    const frame = hasBothStates(this.scene) ? "the first recording." : "this recording; give it to artgs reconstruct as the first one.";
    const about = `The object is what is in the box, in both states: include open doors and drawers. Without a box, it is what the cameras look at. Frame and unit are those of ${frame}`;
    return section("Object box", make("div", { className: "row" }, this.placing), this.editor, make("p", { className: "note" }, about));
  }

  /** Bounds of the box, recording's frame; null if none is placed. */
  get value(): Bounds | null {
    return this.group.visible ? this.bounds : null;
  }

  /** Page coordinates of the handle of a face. */
  handle(axis: number, side: "lower" | "upper"): Vector2 {
    this.group.updateMatrixWorld(true);
    return this.stage.onPage(this.group.localToWorld(this.middle(axis, side)));
  }

  private show(on: boolean): void {
    this.group.visible = on;
    this.editor.hidden = !on;
    this.placing.textContent = on ? "Remove the box" : "Place a box";
    this.update(true);
  }

  private middle(axis: number, side: "lower" | "upper"): Vector3 {
    const { lower, upper } = this.bounds;
    const middle = new Vector3(...lower).add(new Vector3(...upper)).multiplyScalar(0.5);
    return middle.setComponent(axis, this.bounds[side][axis]);
  }

  /** Draws the box; `fields`: sets the fields, too. */
  private update(fields: boolean): void {
    const [lower, upper] = [new Vector3(...this.bounds.lower), new Vector3(...this.bounds.upper)];
    for (const object of [this.edges, this.body]) {
      object.position.copy(lower).add(upper).multiplyScalar(0.5);
      object.scale.copy(upper).sub(lower);
    }
    const places = this.handles.geometry.getAttribute("position") as BufferAttribute;
    this.fields.forEach(({ axis, side }, i) => places.setXYZ(i, ...(this.middle(axis, side).toArray() as Triple)));
    places.needsUpdate = true;
    if (fields) for (const { axis, side, input } of this.fields) input.value = `${this.bounds[side][axis]}`;
    this.group.updateMatrixWorld(true);
    const count = this.clouds.highlight(this.group.visible ? { toBox: this.group.matrixWorld.clone().invert(), lower, upper } : null);
    this.inside.textContent = this.clouds.any ? `${count.toLocaleString("en")} points inside` : "";
    this.text.textContent = option(this.bounds);
    this.allow(null);
    this.stage.invalidate();
  }

  /** Lets the box be used, unless something is wrong. */
  private allow(wrong: string | null): void {
    this.status.textContent = wrong ?? "";
    this.copying.disabled = this.saving.disabled = wrong !== null;
  }

  private typed(): void {
    const next: Bounds = { lower: [...this.bounds.lower], upper: [...this.bounds.upper] };
    for (const { axis, side, input } of this.fields) next[side][axis] = input.valueAsNumber;
    const wrong = fault(next);
    if (wrong !== null) return this.allow(wrong);
    this.bounds = next;
    this.update(false);
  }

  private pointed(event: PointerEvent): (typeof this.fields)[number] | null {
    if (!this.group.visible || !this.stage.controls.enabled) return null;
    const at = new Vector2(event.clientX, event.clientY);
    const near = this.fields.map((field) => ({ field, distance: this.handle(field.axis, field.side).distanceTo(at) }));
    near.sort((a, b) => a.distance - b.distance);
    return near[0].distance <= (event.pointerType === "mouse" ? REACH.mouse : REACH.other) ? near[0].field : null;
  }

  /** Where the pointer is on the line along which a face moves. */
  private placeOf(event: PointerEvent, axis: number, from: Vector3): number | null {
    const ray = this.stage.ray(event.clientX, event.clientY).ray.clone();
    return along(ray.applyMatrix4(this.group.matrixWorld.clone().invert()), from, axis);
  }

  private listen(): void {
    const { canvas, controls } = this.stage;
    const grab = (event: PointerEvent) => {
      if (event.button !== 0 || !event.isPrimary) return;
      const field = this.pointed(event);
      if (!field) return;
      const from = this.middle(field.axis, field.side);
      const grabbed = this.placeOf(event, field.axis, from);
      const value = this.bounds[field.side][field.axis];
      this.held = { axis: field.axis, side: field.side, from, grabbed: grabbed ?? value, value };
      controls.enabled = false;
      canvas.setPointerCapture(event.pointerId);
      canvas.classList.add("holding");
      // The orbit controls must not receive this event.
      event.stopImmediatePropagation();
    };
    const move = (event: PointerEvent) => {
      if (!event.isPrimary) return;
      if (this.held) this.drag(event, this.held);
      else if (event.pointerType === "mouse" && event.buttons === 0) canvas.classList.toggle("over", this.pointed(event) !== null);
    };
    const release = (event: PointerEvent) => {
      if (!this.held || !event.isPrimary) return;
      this.held = null;
      controls.enabled = true;
      canvas.classList.remove("holding");
    };
    canvas.addEventListener("pointerdown", grab, { capture: true });
    canvas.addEventListener("pointermove", move);
    canvas.addEventListener("pointerup", release);
    canvas.addEventListener("pointercancel", release);
  }

  private drag(event: PointerEvent, { axis, side, from, grabbed, value }: NonNullable<typeof this.held>): void {
    const place = this.placeOf(event, axis, from);
    if (place === null) return;
    const { lower, upper } = this.bounds;
    const least = 0.01 * Math.max(...upper.map((v, k) => v - lower[k]));
    const next = short(value + place - grabbed, this.bounds);
    // A face stops before it meets the opposite one.
    if (side === "lower" ? next > upper[axis] - least : next < lower[axis] + least) return;
    this.bounds[side][axis] = next;
    this.update(true);
  }

  private async copy(): Promise<void> {
    try {
      await navigator.clipboard.writeText(this.text.textContent!);
      this.status.textContent = "Copied.";
    } catch {
      getSelection()!.selectAllChildren(this.text);
      this.status.textContent = "The browser does not allow copying: the option is selected, copy it with the keyboard.";
    }
  }

  private async save(): Promise<void> {
    const { file } = this.scene.object_box!;
    const refused = await post("box", { format: "artgs-box", version: 1, ...this.bounds });
    this.status.textContent = refused === null ? `Saved in ${file}. Give this file to artgs reconstruct with --box.` : `Not saved: ${refused}`;
  }
}
