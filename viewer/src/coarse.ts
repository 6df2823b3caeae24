/** Meshes with fewer triangles, computed when first needed. */

import { BufferAttribute, BufferGeometry } from "three";
import { toCreasedNormals } from "three/addons/utils/BufferGeometryUtils.js";
import { MeshoptSimplifier } from "three/addons/libs/meshopt_simplifier.module.js";

/** Largest error of a coarse mesh, relative to the extent of the mesh. */
const MOST_ERROR = 0.2;
/** Edges sharper than this, radians, get split normals. */
const CREASE = 0.6;
/** Meshes with fewer triangles are not simplified: drawing them is fast. */
const LEAST = 300;

let able = false;
/** Resolves once meshes can be simplified. If the browser cannot run the simplifier, meshes stay as they are. */
export const ready: Promise<void> = MeshoptSimplifier.supported ? MeshoptSimplifier.ready.then(() => void (able = true)) : Promise.resolve();

/**
 * The same mesh with about this share of its triangles. `textured`: vertices are shared and borders of texture charts stay,
 * which keeps texture coordinates but also many triangles; otherwise only positions and normals are kept.
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
