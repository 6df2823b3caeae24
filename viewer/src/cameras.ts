/** Cameras of the capture: frustums with their photos, and a wipe between the photo and the replica at one camera. */

import {
  Box3,
  BufferGeometry,
  Color,
  DoubleSide,
  Float32BufferAttribute,
  Group,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  MeshBasicMaterial,
  SRGBColorSpace,
  Texture,
  Vector3,
} from "three";
import { address, bytes } from "./files";
import type { CameraData } from "./scene";
import type { Stage } from "./stage";

/** Frustums; small pictures are loaded when frustums are first shown. */
export class Frustums {
  readonly group = new Group();
  private readonly panes: { mesh: Mesh<BufferGeometry, MeshBasicMaterial>; view: CameraData }[] = [];
  private loaded = false;

  constructor(
    views: CameraData[],
    depth: number,
    private readonly stage: Stage,
  ) {
    this.group.visible = false;
    for (const view of views) {
      const colour = new Color(view.state === 0 ? "#3f7fbf" : "#c8702a");
      const corner = (u: number, v: number) => point(view, u, v, depth);
      const [w, h] = view.size;
      const [a, b, c, d] = [corner(0, 0), corner(w, 0), corner(w, h), corner(0, h)];
      const eye = new Vector3(view.pose[0][3], view.pose[1][3], view.pose[2][3]);
      const lines = [a, b, b, c, c, d, d, a, eye, a, eye, b, eye, c, eye, d].flatMap((p) => p.toArray());
      const wire = new BufferGeometry().setAttribute("position", new Float32BufferAttribute(lines, 3));
      this.group.add(new LineSegments(wire, new LineBasicMaterial({ color: colour })));
      const pane = new BufferGeometry();
      pane.setAttribute("position", new Float32BufferAttribute([a, b, c, d].flatMap((p) => p.toArray()), 3));
      pane.setAttribute("uv", new Float32BufferAttribute([0, 1, 1, 1, 1, 0, 0, 0], 2));
      pane.setIndex([0, 1, 2, 0, 2, 3]);
      const mesh = new Mesh(pane, new MeshBasicMaterial({ color: colour, side: DoubleSide, transparent: true, opacity: 0.35 }));
      this.panes.push({ mesh, view });
      this.group.add(mesh);
    }
  }

  async show(on: boolean): Promise<void> {
    this.group.visible = on;
    this.stage.invalidate();
    if (on) this.stage.include(new Box3().setFromObject(this.group));
    if (!on || this.loaded) return;
    this.loaded = true;
    for (const { mesh, view } of this.panes) {
      if (!view.photo) continue;
      const options: ImageBitmapOptions = { resizeWidth: 128, resizeQuality: "medium", imageOrientation: "flipY" };
      const map = new Texture(await createImageBitmap(new Blob([await bytes(view.photo)]), options));
      map.flipY = false;
      map.colorSpace = SRGBColorSpace;
      map.needsUpdate = true;
      mesh.material.setValues({ map, color: 0xffffff, opacity: 0.9 });
      mesh.material.needsUpdate = true;
      this.stage.invalidate();
    }
  }
}

/** Point of the object's frame that pixel (u, v) sees at a planar depth. */
function point(view: CameraData, u: number, v: number, depth: number): Vector3 {
  const [fx, fy, cx, cy] = view.intrinsics;
  const p = [((u - cx) / fx) * depth, ((v - cy) / fy) * depth, depth, 1];
  const row = (r: number[]) => r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + r[3];
  return new Vector3(row(view.pose[0]), row(view.pose[1]), row(view.pose[2]));
}

/** Photo over replica, cut off at a share of its width. */
export class Wipe {
  private readonly frame = document.querySelector<HTMLElement>("#photo")!;
  private readonly photo = this.frame.querySelector<HTMLImageElement>("img.photo")!;
  private readonly rendering = this.frame.querySelector<HTMLImageElement>("img.rendering")!;
  private readonly mask = this.frame.querySelector<HTMLImageElement>("img.mask")!;
  private readonly edge = this.frame.querySelector<HTMLElement>(".edge")!;
  private view: CameraData | null = null;
  private share = 0.5;

  /** `moved` receives the share after the edge was dragged. */
  constructor(
    private readonly stage: Stage,
    moved: (share: number) => void,
  ) {
    stage.onResize(() => this.place());
    this.edge.addEventListener("pointerdown", (event) => {
      this.edge.setPointerCapture(event.pointerId);
      event.preventDefault();
    });
    this.edge.addEventListener("pointermove", (event) => {
      if (!this.edge.hasPointerCapture(event.pointerId)) return;
      const { left, width } = this.frame.getBoundingClientRect();
      this.set(Math.max(0, Math.min(1, (event.clientX - left) / width)));
      moved(this.share);
    });
  }

  async show(view: CameraData | null): Promise<void> {
    this.view = view;
    this.frame.hidden = !view;
    if (!view) return;
    this.place();
    await Promise.all([this.load(this.photo, view.photo), this.load(this.rendering, view.rendering), this.load(this.mask, view.mask ?? null)]);
  }

  /** Darkens pixels outside the mask. */
  showMask(on: boolean): void {
    this.mask.classList.toggle("on", on);
  }

  private async load(image: HTMLImageElement, file: string | null): Promise<void> {
    if (image.src.startsWith("blob:")) URL.revokeObjectURL(image.src);
    image.hidden = !file;
    if (!file) return image.removeAttribute("src");
    image.src = await address(file);
    await image.decode();
  }

  /** Share of the width, from the left, in which the photo is seen. */
  set(share: number): void {
    this.share = share;
    this.place();
  }

  private place(): void {
    if (!this.view) return;
    const { x, y, width, height } = this.stage.photoPlace(this.view);
    Object.assign(this.frame.style, { left: `${x}px`, top: `${y}px`, width: `${width}px`, height: `${height}px` });
    this.photo.style.clipPath = `inset(0 ${(1 - this.share) * 100}% 0 0)`;
    this.edge.style.left = `${this.share * 100}%`;
  }
}
