/** Meshes with fewer triangles, made when they are first wanted. */

import { BufferAttribute, BufferGeometry } from "three";
import { toCreasedNormals } from "three/addons/utils/BufferGeometryUtils.js";
import { MeshoptSimplifier } from "three/addons/libs/meshopt_simplifier.module.js";

/** Share of a mesh's extent by which a coarse one may be off. */
const MOST_ERROR = 0.2;
/** Edges sharper than this, radians, are seen as edges. */
const CREASE = 0.6;
/** Fewer triangles than this cost nothing. */
const LEAST = 300;

let able = false;
/** Resolves once meshes can be made coarse; where the browser cannot, they stay as they are. */
export const ready: Promise<void> = MeshoptSimplifier.supported ? MeshoptSimplifier.ready.then(() => void (able = true)) : Promise.resolve();

/**
 * The same mesh with about a share of its triangles. `textured`: vertices are shared and borders of texture charts stay,
 * which keeps the texture in its place and many triangles; otherwise only positions are left, and normals to light them.
 */
export function coarser(geometry: BufferGeometry, share: number, textured: boolean): BufferGeometry {
  const positions = geometry.getAttribute("position") as BufferAttribute;
  const count = geometry.index ? geometry.index.count : positions.count;
  const wanted = Math.max(LEAST, Math.floor((count / 3) * share)) * 3;
  if (!able || wanted >= count) return geometry;
  const corners = geometry.index ? Uint32Array.from(geometry.index.array) : Uint32Array.from({ length: count }, (_, i) => i);
  const [kept] = MeshoptSimplifier.simplify(corners, positions.array as Float32Array, 3, wanted, MOST_ERROR, textured ? [] : ["Permissive"]);
  let out = new BufferGeometry().setIndex(new BufferAttribute(kept, 1));
  for (const [name, attribute] of Object.entries(geometry.attributes)) {
    if (textured || name === "position") out.setAttribute(name, attribute);
  }
  if (!textured) out = toCreasedNormals(out, CREASE);
  out.boundingBox = geometry.boundingBox;
  out.boundingSphere = geometry.boundingSphere;
  return out;
}
