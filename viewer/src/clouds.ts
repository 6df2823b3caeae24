/** Points of the observed states; those that moved stand out. */

import { Box3, BufferAttribute, BufferGeometry, Color, Group, Points, PointsMaterial, SRGBColorSpace } from "three";
import { bytes } from "./files";
import type { CloudData } from "./scene";

/** Moved points, sRGB. */
const MOVED = new Color("#d4366a");

export class Clouds {
  readonly group = new Group();
  private readonly states: { state: number; points: Points; photo: Float32Array; marked: Float32Array }[] = [];

  constructor(private readonly data: CloudData[]) {
    this.group.visible = false;
  }

  get any(): boolean {
    return this.data.length > 0;
  }

  async load(): Promise<void> {
    for (const cloud of this.data) {
      const source = await bytes(cloud.file);
      if (source.length !== cloud.count * 16) throw new Error(`${cloud.file}: ${source.length} bytes for ${cloud.count} points`);
      const positions = new Float32Array(source.buffer, source.byteOffset, cloud.count * 3);
      const photo = new Float32Array(cloud.count * 3);
      const colour = new Color();
      const marked = new Float32Array(cloud.count * 3);
      for (let i = 0, k = cloud.count * 12; i < cloud.count; i++, k += 4) {
        colour.setRGB(source[k] / 255, source[k + 1] / 255, source[k + 2] / 255, SRGBColorSpace).toArray(photo, 3 * i);
        if (source[k + 3]) colour.copy(MOVED);
        else colour.lerp(new Color(0.35, 0.35, 0.35), 0.6);
        colour.toArray(marked, 3 * i);
      }
      const geometry = new BufferGeometry();
      geometry.setAttribute("position", new BufferAttribute(positions, 3));
      geometry.setAttribute("color", new BufferAttribute(photo.slice(), 3));
      const material = new PointsMaterial({ size: 3, sizeAttenuation: false, vertexColors: true });
      const points = new Points(geometry, material);
      this.states.push({ state: cloud.state, points, photo, marked });
      this.group.add(points);
    }
  }

  /** Extent of both states, object's frame. */
  extent(): Box3 {
    return new Box3().setFromObject(this.group);
  }

  /** Shows one state, in the colours of the photos or with what moved marked. */
  show(state: number, moved: boolean): void {
    for (const cloud of this.states) {
      cloud.points.visible = cloud.state === state;
      const colours = cloud.points.geometry.getAttribute("color") as BufferAttribute;
      (colours.array as Float32Array).set(moved ? cloud.marked : cloud.photo);
      colours.needsUpdate = true;
    }
  }
}
