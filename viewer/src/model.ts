/** The articulated object: one node per link, moved by its joint. */

import { Box3, Group, Quaternion, Vector3 } from "three";
import type { JointData, LinkData } from "./scene";

/** Nodes and state of a link; the exploded view shifts `shell`. */
export class Link {
  readonly node = new Group();
  readonly moved = new Group();
  readonly shell = new Group();
  value = 0;
  /** Extent of what is drawn, link frame. */
  readonly box = new Box3();

  constructor(
    readonly index: number,
    readonly data: LinkData,
    readonly parent: Link | null,
  ) {
    this.node.name = data.name;
    this.node.position.fromArray(data.origin);
    if (parent) this.node.position.sub(new Vector3().fromArray(parent.data.origin));
    this.node.add(this.moved);
    this.moved.add(this.shell);
    parent?.moved.add(this.node);
  }

  /** The nearest joint that moves this link. */
  mover(): (Link & { data: { joint: JointData } }) | null {
    let link: Link | null = this;
    while (link && !link.data.joint) link = link.parent;
    return link as (Link & { data: { joint: JointData } }) | null;
  }
}

const turn = new Quaternion();

/** Position and rotation of a link relative to its zero pose. */
export function motion(joint: JointData, value: number, position: Vector3, rotation: Quaternion): void {
  const axis = new Vector3().fromArray(joint.axis);
  const angle = joint.kind === "prismatic" ? 0 : value;
  const slide = joint.kind === "prismatic" ? value : joint.pitch * value;
  rotation.copy(turn.setFromAxisAngle(axis, angle));
  position.copy(axis).multiplyScalar(slide);
}

export class Model {
  readonly root = new Group();
  readonly links: Link[] = [];
  private readonly listeners: ((link: Link) => void)[] = [];

  constructor(links: LinkData[]) {
    links.forEach((data, i) => {
      const link = new Link(i, data, data.parent === null ? null : this.links[data.parent]);
      this.links.push(link);
      if (!link.parent) this.root.add(link.node);
    });
  }

  /** Links that have a joint. */
  movable(): Link[] {
    return this.links.filter((l) => l.data.joint);
  }

  find(key: string | number): Link {
    const link = typeof key === "number" ? this.links[key] : this.links.find((l) => l.data.name === key);
    if (!link) throw new Error(`there is no link ${key}`);
    return link;
  }

  /** Moves a joint within its limits; returns the new value. */
  set(link: Link, value: number): number {
    const joint = link.data.joint;
    if (!joint || !Number.isFinite(value)) return link.value;
    const [lower, upper] = joint.limits;
    link.value = Math.min(upper, Math.max(lower, value));
    motion(joint, link.value, link.moved.position, link.moved.quaternion);
    this.listeners.forEach((f) => f(link));
    return link.value;
  }

  /** Moves all joints to an observed state. */
  setState(state: number): void {
    for (const link of this.movable()) this.set(link, link.data.joint!.observed[state]);
  }

  onMove(listener: (link: Link) => void): void {
    this.listeners.push(listener);
  }

  /** Extent at the zero pose, object's frame. */
  extent(): Box3 {
    const all = new Box3();
    for (const link of this.links) {
      if (link.box.isEmpty()) continue;
      all.union(link.box.clone().translate(new Vector3().fromArray(link.data.origin)));
    }
    return all;
  }

  /** Exploded view: shifts the drawn content of each link away from the middle by a share of the distance. */
  explode(share: number): void {
    const extent = this.extent();
    if (extent.isEmpty()) return;
    const middle = extent.getCenter(new Vector3());
    const size = extent.getSize(new Vector3()).length();
    for (const link of this.movable()) {
      if (link.box.isEmpty()) continue;
      const away = link.box.getCenter(new Vector3()).add(new Vector3().fromArray(link.data.origin)).sub(middle);
      // A link in the middle moves along its axis.
      if (away.length() < 0.02 * size) away.fromArray(link.data.joint!.axis);
      link.shell.position.copy(away.normalize().multiplyScalar(share * 0.3 * size));
    }
  }

  /** Extent at the current joint values, object's frame. */
  present(): Box3 {
    this.root.updateMatrixWorld(true);
    const all = new Box3();
    for (const { box, shell } of this.links) if (!box.isEmpty()) all.union(box.clone().applyMatrix4(shell.matrixWorld));
    return all;
  }
}
