/** What the page shows: `scene.json`, see README.md. Object's frame: +Z up, metres; link frames parallel to it at zero. */

export type Triple = [number, number, number];

/** Another joint that explains a part nearly as well. */
export interface AlternativeData {
  kind: "revolute" | "prismatic" | "screw";
  /** As corrections name it: capture's frame and unit. */
  joint: MarkedJoint;
  cost: number;
  what: string;
  advice: string;
}

/** A joint in `corrections.json`. */
export interface MarkedJoint {
  axis: Triple;
  origin: Triple;
  value?: number;
  pitch?: number;
}

export interface JointData {
  kind: "revolute" | "prismatic" | "screw";
  /** Unit axis, link frame. */
  axis: Triple;
  /** Metres along the axis per radian. */
  pitch: number;
  /** Radians or metres. */
  limits: [number, number];
  /** Values in the two observed states. */
  observed: [number, number];
  effort: number;
  confidence?: number;
  /** Half width of the 95 % interval of the direction of the axis, degrees. */
  axis_within?: number;
  alternatives?: AlternativeData[];
}

export interface LinkData {
  name: string;
  parent: number | null;
  /** Object's frame, zero pose. */
  origin: Triple;
  joint: JointData | null;
  mesh: { file: string; texture: string | null; closed: boolean } | null;
  collision: string[];
  splats: string | null;
  /** What the link is; missing if unknown. */
  semantics?: { class: string; confidence: number; given: boolean };
  colour: Triple;
}

/** Classes of moving parts. */
export const CLASSES = [
  "drawer",
  "door",
  "sliding_door",
  "flap",
  "lid",
  "seat",
  "knob",
  "wheel",
  "cap",
  "button",
  "slider",
  "arm",
  "part",
];

export interface CameraData {
  name: string;
  state: number;
  /** Camera to object, rows; OpenCV axes. */
  pose: [number, number, number, number][];
  /** fx fy cx cy, pixels. */
  intrinsics: [number, number, number, number];
  size: [number, number];
  photo: string | null;
  rendering: string | null;
  mask?: string;
}

export interface CloudData {
  state: number;
  count: number;
  file: string;
}

export interface SceneData {
  format: string;
  version: number;
  name: string;
  links: LinkData[];
  cameras?: CameraData[];
  clouds?: CloudData[];
  scores?: unknown;
  /** `object = rotation * (scale * capture) + translation`. */
  placement?: { scale: number; rotation: [number, number, number, number]; translation: Triple };
  corrections: boolean;
  /** The page follows a run. */
  live?: boolean;
  /** After the run the server shows another page. */
  returns?: boolean;
  /** Why a run cannot be started; null if it can. Missing if the server starts no runs. */
  rerun?: { refused: string | null };
  /** The box of the object to begin with, capture's frame; `file`: where the server saves it, null if it does not. */
  object_box?: { lower: Triple; upper: Triple; saved: boolean; file: string | null; refused?: string };
}

/** Throws if another version of the program wrote the scene. */
export function checkScene(scene: SceneData): SceneData {
  if (scene.format !== "artgs-scene" || scene.version !== 1) {
    throw new Error(`scene.json is ${scene.format} version ${scene.version}; this page reads artgs-scene version 1`);
  }
  return scene;
}

/** True for discovered parts before training: links without meshes and Gaussians. */
export function isFound(scene: SceneData): boolean {
  return scene.links.length > 0 && scene.links.every((l) => !l.mesh && !l.splats && l.collision.length === 0);
}

/** A joint value with its unit. */
export function readable(joint: JointData, value: number): string {
  if (joint.kind === "prismatic") return `${(value * 1000).toFixed(0)} mm`;
  return `${((value * 180) / Math.PI).toFixed(1)}°`;
}

/** Names of the observed states. */
export const STATES = ["Start", "End"] as const;

/** True if both states were observed; a recording has one of them. */
export function hasBothStates(scene: SceneData): boolean {
  return new Set([...(scene.clouds ?? []), ...(scene.cameras ?? [])].map((c) => c.state)).size > 1;
}
