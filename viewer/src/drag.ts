/** Moves a part with mouse or finger: the joint takes the value at which the grabbed point is nearest to the pointer. */

import { Matrix4, Quaternion, Vector2, Vector3 } from "three";
import type { Appearance } from "./looks";
import type { Hover } from "./hover";
import { motion, type Link, type Model } from "./model";
import type { JointData } from "./scene";
import type { Stage } from "./stage";

/** Joints whose range is shorter than this on the page, CSS pixels, are moved by vertical pointer motion. */
const SHORT = 40;

interface Grip {
  link: Link;
  joint: JointData;
  /** Frame of the joint at value 0, object's frame. */
  frame: Matrix4;
  /** The grabbed point, in the moving frame. */
  point: Vector3;
  start: { value: number; y: number };
  short: boolean;
}

/** The part under a point of the page and where it is hit. */
export function pick(stage: Stage, looks: Appearance, x: number, y: number): { link: Link; point: Vector3 } | null {
  const ray = stage.ray(x, y);
  let best: { link: Link; point: Vector3; distance: number } | null = null;
  for (const { link, mesh } of looks.targets()) {
    const hit = ray.intersectObject(mesh, false)[0];
    if (hit && (!best || hit.distance < best.distance)) best = { link, point: hit.point, distance: hit.distance };
  }
  return best;
}

function place(grip: Grip, value: number): Vector3 {
  const [position, rotation] = [new Vector3(), new Quaternion()];
  motion(grip.joint, value, position, rotation);
  return grip.point.clone().applyQuaternion(rotation).add(position).applyMatrix4(grip.frame);
}

/** Gauss-Newton on the distance on the page. It starts at the current value, so the joint never jumps by a full turn. */
export function follow(stage: Stage, grip: Grip, pointer: Vector2): number {
  const [lower, upper] = grip.joint.limits;
  const range = upper - lower;
  if (grip.short) return grip.start.value + ((pointer.y - grip.start.y) / (0.4 * stage.canvas.clientHeight)) * range;
  const step = 1e-3 * range;
  let value = grip.link.value;
  for (let i = 0; i < 12; i++) {
    const miss = stage.onPage(place(grip, value)).sub(pointer);
    const slope = stage.onPage(place(grip, value + step)).sub(stage.onPage(place(grip, value - step))).divideScalar(2 * step);
    const damping = (SHORT / range) ** 2;
    const change = -miss.dot(slope) / (slope.lengthSq() + 0.05 * damping);
    const next = value + Math.max(-0.1 * range, Math.min(0.1 * range, change));
    value = Math.max(lower, Math.min(upper, next));
  }
  return value;
}

function travel(stage: Stage, grip: Grip): number {
  const [lower, upper] = grip.joint.limits;
  let length = 0;
  for (let i = 0; i < 8; i++) {
    const at = (k: number) => stage.onPage(place(grip, lower + ((upper - lower) * k) / 8));
    length += at(i).distanceTo(at(i + 1));
  }
  return length;
}

/** Lets parts be dragged; `busy` receives the grabbed link, or null when it is released, and `hover` the part under the mouse or held by it. */
export function enableDrag(stage: Stage, model: Model, looks: Appearance, hover: Hover, busy: (link: Link | null) => void): void {
  let grip: Grip | null = null;
  const { canvas, controls } = stage;
  const grab = (event: PointerEvent) => {
    if (event.button !== 0 || !event.isPrimary || !controls.enabled) return;
    const hit = pick(stage, looks, event.clientX, event.clientY);
    const link = hit?.link.mover();
    if (!hit || !link) return;
    model.root.updateMatrixWorld(true);
    grip = {
      link,
      joint: link.data.joint,
      frame: link.node.matrixWorld.clone(),
      point: link.moved.worldToLocal(hit.point.clone()),
      start: { value: link.value, y: event.clientY },
      short: false,
    };
    grip.short = travel(stage, grip) < SHORT;
    controls.enabled = false;
    canvas.setPointerCapture(event.pointerId);
    canvas.classList.add("holding");
    busy(link);
    // The orbit controls must not receive this event.
    event.stopImmediatePropagation();
  };
  const move = (event: PointerEvent) => {
    if (!event.isPrimary) return;
    if (grip) {
      model.set(grip.link, follow(stage, grip, new Vector2(event.clientX, event.clientY)));
      hover.show(grip.link, event.clientX, event.clientY);
    } else if (event.pointerType === "mouse" && event.buttons === 0) {
      const over = controls.enabled ? (pick(stage, looks, event.clientX, event.clientY)?.link.mover() ?? null) : null;
      canvas.classList.toggle("over", !!over);
      hover.show(over, event.clientX, event.clientY);
    }
  };
  const release = (event: PointerEvent) => {
    if (!grip || !event.isPrimary) return;
    grip = null;
    controls.enabled = true;
    canvas.classList.remove("holding");
    hover.show(null, 0, 0);
    busy(null);
  };
  canvas.addEventListener("pointerdown", grab, { capture: true });
  canvas.addEventListener("pointermove", move);
  canvas.addEventListener("pointerup", release);
  canvas.addEventListener("pointercancel", release);
}
