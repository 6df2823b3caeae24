/** What is drawn for each link in each mode. */

import {
  BufferGeometry,
  Color,
  DoubleSide,
  FrontSide,
  EdgesGeometry,
  Material,
  LineBasicMaterial,
  LineSegments,
  LinearFilter,
  LinearMipmapLinearFilter,
  LinearMipmapNearestFilter,
  Mesh,
  MeshBasicMaterial,
  NearestFilter,
  NearestMipmapNearestFilter,
  MeshLambertMaterial,
  SRGBColorSpace,
  Texture,
} from "three";
import { SplatFileType, SplatMesh } from "@sparkjsdev/spark";
import { coarser, ready } from "./coarse";
import { bytes } from "./files";
import type { Link, Model } from "./model";
import { EVIDENCE, parseObj } from "./obj";

export const MODES = ["splats", "textured", "mesh", "parts", "evidence", "collision", "points"] as const;
export type Mode = (typeof MODES)[number];

/** If less than this share of the triangles is drawn, textures are not filtered. */
const UNFILTERED = 0.1;

/** Everything drawn for one link. */
interface Looks {
  mesh?: Mesh;
  /** The full mesh, and simplified ones by share of triangles and whether colours are drawn. */
  fine?: BufferGeometry;
  coarse: Map<string, BufferGeometry>;
  painted?: MeshBasicMaterial;
  /** The texture, and the same texture without filtering. */
  picture?: Texture;
  rough?: Texture;
  hulls: Mesh[];
  splats?: SplatMesh;
}

const clay = [FrontSide, DoubleSide].map((side) => new MeshLambertMaterial({ color: 0xc9c6c0, side }));

/** Colours of faces that rest on each kind of evidence. */
export const EVIDENCE_COLOURS: Record<(typeof EVIDENCE)[number], number> = { seen: 0x8fae8b, derived: 0xe0b040, invented: 0xc8553d };
const evidence = EVIDENCE.map((kind) => new MeshLambertMaterial({ color: EVIDENCE_COLOURS[kind], side: DoubleSide }));

/** Visible sides of a mesh: drawing both sides takes 1.5 times as long. */
function sideOf(link: Link): typeof FrontSide | typeof DoubleSide {
  return link.data.mesh?.closed ? FrontSide : DoubleSide;
}

export class Appearance {
  private readonly looks = new Map<Link, Looks>();
  private readonly coloured = new Map<Link, MeshLambertMaterial>();
  mode: Mode = "textured";

  constructor(
    private readonly model: Model,
    /** True without a graphics card: texture filtering is slow there. */
    private readonly plain: boolean,
  ) {}

  /** Loads meshes, textures and hulls; Gaussians follow with `loadSplats`. */
  async loadMeshes(): Promise<void> {
    await Promise.all([ready, ...this.model.links.map((link) => this.loadLink(link))]);
  }

  private async loadLink(link: Link): Promise<void> {
    const looks: Looks = { hulls: [], coarse: new Map() };
    this.looks.set(link, looks);
    const { mesh, collision, colour } = link.data;
    const tint = new Color().setRGB(colour[0] / 255, colour[1] / 255, colour[2] / 255, SRGBColorSpace);
    this.coloured.set(link, new MeshLambertMaterial({ color: tint, side: sideOf(link) }));
    if (mesh) {
      const [geometry, map] = await Promise.all([
        bytes(mesh.file).then(parseObj),
        mesh.texture ? picture(mesh.texture, this.plain) : Promise.resolve(null),
      ]);
      // The texture already contains the light of the scene.
      looks.painted = new MeshBasicMaterial({ map, vertexColors: !map && geometry.hasAttribute("color"), side: sideOf(link) });
      looks.mesh = new Mesh(geometry, looks.painted);
      looks.fine = geometry;
      if (map) looks.picture = map;
      link.shell.add(looks.mesh);
      link.box.copy(geometry.boundingBox!);
    }
    const hulls = await Promise.all(collision.map((file) => bytes(file).then(parseObj)));
    hulls.forEach((geometry, i) => {
      const shade = tint.clone().offsetHSL(0, 0, (((i * 0.381966) % 1) - 0.5) * 0.25);
      const hull = new Mesh(
        geometry,
        new MeshLambertMaterial({ color: shade, transparent: true, opacity: 0.75, flatShading: true }),
      );
      hull.add(new LineSegments(new EdgesGeometry(geometry, 20), new LineBasicMaterial({ color: shade.clone().multiplyScalar(0.3) })));
      looks.hulls.push(hull);
      link.shell.add(hull);
      if (!mesh) link.box.union(geometry.boundingBox!);
    });
  }

  /** Loads the Gaussians and waits for them. */
  async loadSplats(): Promise<void> {
    const load = async (link: Link, file: string) => {
      const fileType = file.endsWith(".spz") ? SplatFileType.SPZ : SplatFileType.PLY;
      const splats = new SplatMesh({ fileBytes: await bytes(file), fileType, raycastable: false });
      await splats.initialized;
      splats.visible = false;
      this.looks.get(link)!.splats = splats;
      link.shell.add(splats);
      if (link.box.isEmpty()) link.box.copy(splats.getBoundingBox(true));
    };
    await Promise.all(this.model.links.flatMap((l) => (l.data.splats ? [load(l, l.data.splats)] : [])));
  }

  show(mode: Mode): void {
    this.mode = mode;
    for (const [link, { mesh, hulls, splats }] of this.looks) {
      if (mesh) {
        mesh.visible = mode === "textured" || mode === "mesh" || mode === "parts" || mode === "evidence";
        mesh.material = this.material(link, mode);
      }
      for (const hull of hulls) hull.visible = mode === "collision";
      if (splats) splats.visible = mode === "splats";
    }
  }

  private material(link: Link, mode: Mode): Material | Material[] {
    const { painted, fine } = this.looks.get(link)!;
    if (mode === "textured") return painted!;
    if (mode === "parts") return this.coloured.get(link)!;
    // Meshes that do not say what their faces rest on stay grey.
    if (mode === "evidence" && fine!.groups.length > 0) return evidence;
    return clay[sideOf(link) === FrontSide ? 0 : 1];
  }

  /** True if some mesh says what its faces rest on. */
  hasEvidence(): boolean {
    return [...this.looks.values()].some(({ fine }) => fine !== undefined && fine.groups.length > 0);
  }

  /** Draws meshes with a share of their triangles, without slow details (edges of hulls, filtering of textures). */
  coarsen(share: number): void {
    const textured = this.mode === "textured";
    for (const looks of this.looks.values()) {
      for (const hull of looks.hulls) hull.children.forEach((edges) => (edges.visible = share === 1));
      if (looks.picture) {
        const rough = share < UNFILTERED;
        if (rough) looks.rough ??= unfiltered(looks.picture);
        looks.painted!.map = rough ? looks.rough! : looks.picture;
      }
      if (!looks.mesh?.visible) continue;
      const key = `${share} ${textured}`;
      // Coarse meshes do not say what their faces rest on.
      let geometry = share === 1 || this.mode === "evidence" ? looks.fine! : looks.coarse.get(key);
      if (!geometry) looks.coarse.set(key, (geometry = coarser(looks.fine!, share, textured)));
      looks.mesh.geometry = geometry;
    }
  }

  /** Meshes for hit tests: hulls, which have few triangles, else the drawn meshes. */
  targets(): { link: Link; mesh: Mesh }[] {
    return [...this.looks].flatMap(([link, { mesh, hulls }]) =>
      (hulls.length > 0 ? hulls : mesh ? [mesh] : []).map((m) => ({ link, mesh: m })),
    );
  }

  count(): { triangles: number; splats: number } {
    const all = [...this.looks.values()];
    const triangles = (g: BufferGeometry) => (g.index ? g.index.count : g.getAttribute("position").count) / 3;
    return {
      triangles: all.reduce((n, l) => n + (l.fine ? triangles(l.fine) : 0), 0),
      splats: all.reduce((n, l) => n + (l.splats?.packedSplats?.numSplats ?? 0), 0),
    };
  }
}

/** The same texture without filtering. */
function unfiltered(texture: Texture): Texture {
  const out = texture.clone();
  out.magFilter = NearestFilter;
  out.minFilter = NearestMipmapNearestFilter;
  out.anisotropy = 1;
  out.needsUpdate = true;
  return out;
}

async function picture(file: string, plain: boolean): Promise<Texture> {
  const blob = new Blob([await bytes(file)], { type: "image/png" });
  // OBJ counts v from below; the bitmap is flipped here because WebGL does not flip bitmaps.
  const texture = new Texture(await createImageBitmap(blob, { imageOrientation: "flipY" }));
  texture.flipY = false;
  texture.colorSpace = SRGBColorSpace;
  texture.magFilter = LinearFilter;
  texture.minFilter = plain ? LinearMipmapNearestFilter : LinearMipmapLinearFilter;
  texture.anisotropy = plain ? 1 : 4;
  texture.needsUpdate = true;
  return texture;
}

