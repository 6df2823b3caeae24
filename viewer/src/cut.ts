/** The plane that splits a part: a direction, a position along it and a side, drawn in 3D. */

import { DoubleSide, Group, Mesh, MeshBasicMaterial, PlaneGeometry, Quaternion, SRGBColorSpace, Vector3 } from "three";
import { check, make } from "./dom";
import type { Link } from "./model";
import type { Triple } from "./scene";

const AXES: [string, Triple][] = [
  ["x", [1, 0, 0]],
  ["y", [0, 1, 0]],
  ["z", [0, 0, 1]],
];

export class Cut {
  /** Controls; hidden while the part is not split. */
  readonly element = make("div", { className: "cut", hidden: true });
  private readonly plane: Mesh<PlaneGeometry, MeshBasicMaterial>;
  private readonly axis = make("select");
  private readonly offset = make("input", { type: "range", min: "0", max: "1", step: "0.002", value: "0.5" });
  private readonly side: HTMLLabelElement;
  /** A saved direction that is none of the axes. */
  private saved: Vector3 | null = null;

  /** `group` has the object's frame; `changed` draws. */
  constructor(
    private readonly link: Link,
    group: Group,
    private readonly changed: () => void,
  ) {
    const name = link.data.name.replaceAll("_", " ");
    this.axis.ariaLabel = `Cutting plane of ${name}: direction`;
    this.offset.ariaLabel = `Cutting plane of ${name}: position`;
    for (const [text] of AXES) this.axis.append(make("option", { value: text }, `across ${text}`));
    this.axis.append(make("option", { value: "joint" }, "across the axis"));
    this.side = check("swap", () => this.update());
    this.side.title = "The new part is on the other side of the plane";
    for (const control of [this.axis, this.offset]) control.addEventListener("input", () => this.update());
    this.element.append(this.axis, this.offset, this.side);
    const paint = new MeshBasicMaterial({ transparent: true, opacity: 0.45, depthWrite: false, side: DoubleSide });
    const [r, g, b] = link.data.colour;
    paint.color.setRGB(r / 255, g / 255, b / 255, SRGBColorSpace);
    this.plane = new Mesh(new PlaneGeometry(1, 1), paint);
    this.plane.renderOrder = 15;
    this.plane.visible = false;
    group.add(this.plane);
  }

  set visible(on: boolean) {
    this.element.hidden = !on;
    this.plane.visible = on;
    if (on) this.update();
  }

  /** A point of the plane and its normal, object's frame, at the start state; the new part is where the normal points. */
  get(): { point: Vector3; normal: Vector3 } {
    const normal = this.direction();
    const corners = this.corners();
    const along = corners.map((p) => p.dot(normal));
    const [low, high] = [Math.min(...along), Math.max(...along)];
    const middle = corners.reduce((sum, p) => sum.add(p), new Vector3()).divideScalar(corners.length);
    const at = low + this.offset.valueAsNumber * (high - low);
    const point = middle.addScaledVector(normal, at - middle.dot(normal));
    return { point, normal: this.swapped() ? normal.negate() : normal };
  }

  /** Sets the controls to a plane in the object's frame. */
  set(point: Vector3, normal: Vector3): void {
    const unit = normal.clone().normalize();
    const known = [...this.axis.options].find((o) => o.value !== "saved" && Math.abs(this.named(o.value).dot(unit)) > 1 - 1e-9);
    if (!known) {
      if (!this.saved) this.axis.append(make("option", { value: "saved" }, "as saved"));
      this.saved = unit;
    }
    this.axis.value = known?.value ?? "saved";
    const direction = this.direction();
    this.side.querySelector("input")!.checked = direction.dot(unit) < 0;
    const along = this.corners().map((p) => p.dot(direction));
    const [low, high] = [Math.min(...along), Math.max(...along)];
    // As exact as the plane was saved; the slider moves it in steps.
    this.offset.step = "any";
    this.offset.valueAsNumber = high > low ? (point.dot(direction) - low) / (high - low) : 0.5;
    this.update();
  }

  private named(axis: string): Vector3 {
    if (axis === "saved" && this.saved) return this.saved.clone();
    const triple = AXES.find(([name]) => name === axis)?.[1];
    if (triple) return new Vector3(...triple);
    const turn = this.link.shell.getWorldQuaternion(new Quaternion());
    return new Vector3(...this.link.data.joint!.axis).applyQuaternion(turn).normalize();
  }

  private direction(): Vector3 {
    return this.named(this.axis.value);
  }

  private swapped(): boolean {
    return this.side.querySelector("input")!.checked;
  }

  /** Corners of the part, object's frame. */
  private corners(): Vector3[] {
    const { min, max } = this.link.box.isEmpty() ? { min: new Vector3(), max: new Vector3() } : this.link.box;
    return Array.from({ length: 8 }, (_, i) => {
      const corner = new Vector3(i & 1 ? max.x : min.x, i & 2 ? max.y : min.y, i & 4 ? max.z : min.z);
      return this.link.moved.localToWorld(corner);
    });
  }

  private update(): void {
    const { point, normal } = this.get();
    const size = 1.1 * this.link.box.getSize(new Vector3()).length();
    this.plane.position.copy(point);
    this.plane.quaternion.setFromUnitVectors(new Vector3(0, 0, 1), normal);
    this.plane.scale.set(size, size, 1);
    this.changed();
  }
}
