/** Joint axes with limits: an arc for rotation, a rail for translation, a needle at the current value. */

import {
  BufferGeometry,
  Color,
  ConeGeometry,
  CylinderGeometry,
  Float32BufferAttribute,
  Group,
  Mesh,
  MeshBasicMaterial,
  Object3D,
  Quaternion,
  SphereGeometry,
  SRGBColorSpace,
  TubeGeometry,
  CatmullRomCurve3,
  Vector3,
  DoubleSide,
} from "three";
import type { Link, Model } from "./model";
import type { JointData } from "./scene";

/** Drawn over everything: most of an axis is inside the object. */
function paint(colour: Color, opacity: number): MeshBasicMaterial {
  return new MeshBasicMaterial({ color: colour, transparent: true, opacity, depthTest: false, depthWrite: false, side: DoubleSide });
}

function rod(from: Vector3, to: Vector3, radius: number, material: MeshBasicMaterial): Mesh {
  const along = to.clone().sub(from);
  const mesh = new Mesh(new CylinderGeometry(radius, radius, along.length(), 12), material);
  mesh.position.copy(from).addScaledVector(along, 0.5);
  mesh.quaternion.copy(upTo(along));
  return mesh;
}

function upTo(direction: Vector3): Quaternion {
  return new Quaternion().setFromUnitVectors(new Vector3(0, 1, 0), direction.clone().normalize());
}

/** Axes of all joints of a model, children of its nodes: all of them if `visible`, else that of the part under the pointer. */
export class Glyphs {
  private readonly all = new Map<Link, Object3D[]>();
  private on = false;
  private hovered: Link | null = null;

  constructor(model: Model) {
    const size = model.extent().getSize(new Vector3()).length() || 1;
    for (const link of model.movable()) {
      const [still, needle] = glyph(link, link.data.joint!, size);
      link.node.add(still);
      link.moved.add(needle);
      for (const part of [still, needle]) part.traverse((m) => (m.renderOrder = 10));
      this.all.set(link, [still, needle]);
    }
    this.update();
  }

  set visible(on: boolean) {
    this.on = on;
    this.update();
  }

  /** Shows the axis of this part, too; `null` shows none of its own. */
  hover(link: Link | null): void {
    this.hovered = link;
    this.update();
  }

  private update(): void {
    for (const [link, parts] of this.all) for (const part of parts) part.visible = this.on || link === this.hovered;
  }
}

/** The fixed part of the glyph and the part that moves with the link. */
function glyph(link: Link, joint: JointData, size: number): [Group, Group] {
  const [r, g, b] = link.data.colour;
  const colour = new Color().setRGB(r / 255, g / 255, b / 255, SRGBColorSpace);
  const [strong, faint] = [paint(colour, 0.95), paint(colour, 0.3)];
  const axis = new Vector3().fromArray(joint.axis);
  const middle = link.box.isEmpty() ? new Vector3() : link.box.getCenter(new Vector3());
  const along = axis.clone().multiplyScalar(middle.dot(axis));
  const half = link.box.isEmpty() ? 0.2 * size : reach(link, axis);
  const thick = 0.004 * size;
  const [still, needle] = [new Group(), new Group()];
  if (joint.kind === "prismatic") {
    const at = (value: number) => middle.clone().addScaledVector(axis, value);
    const [from, to] = [at(joint.limits[0]), at(joint.limits[1])];
    still.add(rod(from, to, thick, faint));
    for (const stop of [from, to]) {
      const plate = new Mesh(new CylinderGeometry(4 * thick, 4 * thick, thick, 24), strong);
      plate.position.copy(stop);
      plate.quaternion.copy(upTo(axis));
      still.add(plate);
    }
    const bead = new Mesh(new SphereGeometry(2.5 * thick, 24, 12), strong);
    bead.position.copy(middle);
    needle.add(bead);
    still.add(tip(to, axis, thick, strong, 3));
    return [still, needle];
  }
  const [bottom, top] = [-1.15, 1.15].map((s) => along.clone().addScaledVector(axis, s * half));
  still.add(rod(bottom, top, thick, strong), tip(top, axis, thick, strong, 1));
  const arm = middle.clone().sub(along);
  if (arm.length() < 0.02 * size) arm.copy(sideways(axis)).multiplyScalar(0.12 * size);
  const pitch = joint.kind === "screw" ? joint.pitch : 0;
  still.add(fan(along, axis, arm, joint.limits, pitch, faint), rim(along, axis, arm, joint.limits, pitch, thick, strong));
  needle.add(rod(along, along.clone().add(arm), 0.7 * thick, strong));
  return [still, needle];
}

function tip(at: Vector3, axis: Vector3, thick: number, material: MeshBasicMaterial, off: number): Mesh {
  const cone = new Mesh(new ConeGeometry(3 * thick, 8 * thick, 20), material);
  cone.position.copy(at).addScaledVector(axis, (3 + off) * thick);
  cone.quaternion.copy(upTo(axis));
  return cone;
}

/** Half the extent of a link along an axis. */
function reach(link: Link, axis: Vector3): number {
  const size = link.box.getSize(new Vector3()).multiplyScalar(0.5);
  const half = Math.abs(axis.x) * size.x + Math.abs(axis.y) * size.y + Math.abs(axis.z) * size.z;
  return Math.max(half, 0.25 * size.length(), 1e-3);
}

function sideways(axis: Vector3): Vector3 {
  const other = Math.abs(axis.z) < 0.9 ? new Vector3(0, 0, 1) : new Vector3(1, 0, 0);
  return other.cross(axis).normalize();
}

function arc(along: Vector3, axis: Vector3, arm: Vector3, limits: [number, number], pitch: number): Vector3[] {
  const steps = Math.max(8, Math.ceil(Math.abs(limits[1] - limits[0]) * 12));
  return Array.from({ length: steps + 1 }, (_, i) => {
    const value = limits[0] + ((limits[1] - limits[0]) * i) / steps;
    return arm.clone().applyAxisAngle(axis, value).add(along).addScaledVector(axis, pitch * value);
  });
}

function rim(along: Vector3, axis: Vector3, arm: Vector3, limits: [number, number], pitch: number, thick: number, paint: MeshBasicMaterial): Mesh {
  const points = arc(along, axis, arm, limits, pitch);
  return new Mesh(new TubeGeometry(new CatmullRomCurve3(points), points.length * 2, 0.7 * thick, 8), paint);
}

function fan(along: Vector3, axis: Vector3, arm: Vector3, limits: [number, number], pitch: number, paint: MeshBasicMaterial): Mesh {
  const points = arc(along, axis, arm, limits, pitch);
  const corners = points.slice(1).flatMap((p, i) => [along, points[i], p].flatMap((v) => v.toArray()));
  const geometry = new BufferGeometry().setAttribute("position", new Float32BufferAttribute(corners, 3));
  return new Mesh(geometry, paint);
}
