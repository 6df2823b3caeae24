/** Points of the observed states; points that moved can be marked. */

import { Box3, BufferAttribute, BufferGeometry, Color, Group, type Matrix4, Object3D, Points, PointsMaterial, SRGBColorSpace, Vector3 } from "three";
import { bytes } from "./files";
import type { Model } from "./model";
import type { CloudData } from "./scene";

/** Moved points, sRGB. */
const MOVED = new Color("#d4366a");

/** The grey, linear, that points outside of a box get, and its share in their colour. */
const FADED = 0.4;
const FADE = 0.8;

/** An axis-aligned box in a frame, which a matrix leads to from that of the object. */
export interface Highlight {
  toBox: Matrix4;
  lower: Vector3;
  upper: Vector3;
}

/** Some of the points of a state. */
interface Piece {
  state: number;
  points: Points;
  photo: Float32Array;
  marked: Float32Array;
}

export class Clouds {
  readonly group = new Group();
  private readonly pieces: Piece[] = [];
  private on = false;
  private state = 0;
  private marks = false;
  private highlighted: Highlight | null = null;

  /** `carried`: the points of both states are children of their links and move with them. */
  constructor(
    private readonly data: CloudData[],
    private readonly model: Model,
    private readonly carried: boolean,
  ) {}

  set visible(on: boolean) {
    this.on = on;
    this.place();
  }

  get any(): boolean {
    return this.data.length > 0;
  }

  async load(): Promise<void> {
    for (const cloud of this.data) {
      const source = await bytes(cloud.file);
      if (source.length !== cloud.count * 16) throw new Error(`${cloud.file}: ${source.length} bytes for ${cloud.count} points`);
      const positions = new Float32Array(source.buffer, source.byteOffset, cloud.count * 3);
      const marks = Uint8Array.from({ length: cloud.count }, (_, i) => source[cloud.count * 12 + 4 * i + 3]);
      const all = Uint32Array.from({ length: cloud.count }, (_, i) => i);
      if (!this.carried) {
        this.add(cloud.state, source, positions, marks, all, this.group, null);
        continue;
      }
      this.model.setState(cloud.state);
      this.model.root.updateMatrixWorld(true);
      for (const link of this.model.links) {
        const own = all.filter((i) => marks[i] === link.index);
        const toLink = link.shell.matrixWorld.clone().invert();
        const points = this.add(cloud.state, source, positions, marks, own, link.shell, toLink);
        if (cloud.state === 0 && own.length > 0) link.box.copy(points.geometry.boundingBox!);
      }
    }
    this.place();
  }

  private add(state: number, source: Uint8Array, positions: Float32Array, marks: Uint8Array, own: Uint32Array, on: Object3D, move: Matrix4 | null): Points {
    const [places, photo, marked] = [0, 0, 0].map(() => new Float32Array(own.length * 3));
    const colour = new Color();
    own.forEach((i, k) => {
      places.set(positions.subarray(3 * i, 3 * i + 3), 3 * k);
      const at = marks.length * 12 + 4 * i;
      colour.setRGB(source[at] / 255, source[at + 1] / 255, source[at + 2] / 255, SRGBColorSpace).toArray(photo, 3 * k);
      if (marks[i]) colour.copy(this.markOf(marks[i]));
      else colour.lerp(new Color(0.35, 0.35, 0.35), 0.6);
      colour.toArray(marked, 3 * k);
    });
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(places, 3));
    if (move) geometry.applyMatrix4(move);
    geometry.setAttribute("color", new BufferAttribute(photo.slice(), 3));
    geometry.computeBoundingBox();
    const points = new Points(geometry, new PointsMaterial({ size: 3, sizeAttenuation: false, vertexColors: true }));
    this.pieces.push({ state, points, photo, marked });
    on.add(points);
    return points;
  }

  /** The colour of the part; before parts are known, the colour of moved points. */
  private markOf(mark: number): Color {
    const link = this.model.links[mark];
    if (!link) return MOVED;
    const [r, g, b] = link.data.colour;
    return new Color().setRGB(r / 255, g / 255, b / 255, SRGBColorSpace);
  }

  private place(): void {
    for (const { state, points } of this.pieces) points.visible = this.on && state === this.state;
  }

  /** Extent of both states, object's frame. */
  extent(): Box3 {
    return new Box3().setFromObject(this.group);
  }

  /** Shows one state, in the colours of the photos or with what moved marked. */
  show(state: number, moved: boolean): void {
    this.state = state;
    this.marks = moved;
    this.place();
    this.paint();
  }

  /** Fades points outside of a box, or none; returns the number of points inside. */
  highlight(box: Highlight | null): number {
    this.highlighted = box;
    return this.paint();
  }

  private paint(): number {
    let inside = 0;
    const at = new Vector3();
    for (const { points, photo, marked } of this.pieces) {
      const colours = points.geometry.getAttribute("color") as BufferAttribute;
      const out = colours.array as Float32Array;
      out.set(this.marks ? marked : photo);
      colours.needsUpdate = true;
      if (!this.highlighted) continue;
      const { toBox, lower, upper } = this.highlighted;
      const places = points.geometry.getAttribute("position") as BufferAttribute;
      for (let i = 0; i < places.count; i++) {
        at.fromBufferAttribute(places, i).applyMatrix4(toBox);
        if (at.x >= lower.x && at.y >= lower.y && at.z >= lower.z && at.x <= upper.x && at.y <= upper.y && at.z <= upper.z) {
          inside++;
          continue;
        }
        for (let c = 0; c < 3; c++) out[3 * i + c] += FADE * (FADED - out[3 * i + c]);
      }
    }
    return inside;
  }
}
