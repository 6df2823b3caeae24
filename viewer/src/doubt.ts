/** What another joint of a part would mean, in words. */

import type { AlternativeData, JointData, SceneData, Triple } from "./scene";

/** Axes that differ by less than this count as the same, degrees. */
const ALIKE = 1;

/** A vector turned by a unit quaternion (x, y, z, w). */
function turned([x, y, z]: Triple, [qx, qy, qz, qw]: [number, number, number, number]): Triple {
  // v + 2 q x (q x v + w v)
  const [cx, cy, cz] = [qy * z - qz * y + qw * x, qz * x - qx * z + qw * y, qx * y - qy * x + qw * z];
  return [x + 2 * (qy * cz - qz * cy), y + 2 * (qz * cx - qx * cz), z + 2 * (qx * cy - qy * cx)];
}

/** One sentence: how another joint differs from the one that is shown. Link frames are parallel to that of the object. */
export function doubt(joint: JointData, other: AlternativeData, placement: SceneData["placement"]): string {
  const { rotation, scale } = placement ?? { rotation: [0, 0, 0, 1] as [number, number, number, number], scale: 1 };
  const value = Math.abs(other.joint.value ?? 0);
  const way = other.kind === "prismatic" ? `${Math.round(1000 * scale * value)} mm` : `${Math.round((180 / Math.PI) * value)}°`;
  if (other.kind !== joint.kind) {
    const does = { prismatic: "slide, by", revolute: "turn, by", screw: "turn and slide as a screw, by" }[other.kind];
    return `It may ${does} ${way}.`;
  }
  const [a, b] = [joint.axis, turned(other.joint.axis, rotation)];
  const cosine = Math.abs(a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) / (Math.hypot(...a) * Math.hypot(...b));
  const degrees = Math.round((180 / Math.PI) * Math.acos(Math.min(1, cosine)));
  const [start, end] = joint.observed;
  const seen = Math.abs(end - start);
  const same = Math.abs(seen - value * (joint.kind === "prismatic" ? scale : 1)) < 0.05 * seen;
  const by = same ? "" : `, and it may have moved by ${way}`;
  if (degrees >= ALIKE) {
    return `${joint.kind === "prismatic" ? `Its direction may be off by ${degrees}°` : `Its hinge may be tilted by ${degrees}°`}${by}.`;
  }
  return joint.kind === "prismatic" ? `It may have moved by ${way}.` : `Its hinge may be elsewhere${by}.`;
}
