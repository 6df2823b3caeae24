/** What another joint of a part would mean, in words. */

import { Quaternion, Vector3 } from "three";
import type { AlternativeData, JointData, SceneData } from "./scene";

/** Axes that differ by less than this count as the same, degrees. */
const ALIKE = 1;

/** One sentence: how another joint differs from the one that is shown. Link frames are parallel to that of the object. */
export function doubt(joint: JointData, other: AlternativeData, placement: SceneData["placement"]): string {
  const { rotation, scale } = placement ?? { rotation: [0, 0, 0, 1] as [number, number, number, number], scale: 1 };
  const value = Math.abs(other.joint.value ?? 0);
  const way = other.kind === "prismatic" ? `${Math.round(1000 * scale * value)} mm` : `${Math.round((180 / Math.PI) * value)}°`;
  if (other.kind !== joint.kind) {
    const does = { prismatic: "slide, by", revolute: "turn, by", screw: "turn and slide as a screw, by" }[other.kind];
    return `It may ${does} ${way}.`;
  }
  const [own, axis] = [joint.axis, other.joint.axis].map((direction) => new Vector3(...direction).normalize());
  const cosine = Math.abs(own.dot(axis.applyQuaternion(new Quaternion(...rotation))));
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
