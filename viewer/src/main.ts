/** Entry point: loads and draws the scene and connects controls, pointer and test functions. */

import "./style.css";
import { Box3, Quaternion, Vector3 } from "three";
import { ObjectBox } from "./box";
import { Frustums, Wipe } from "./cameras";
import { Clouds } from "./clouds";
import { Corrections } from "./corrections";
import { enableDrag } from "./drag";
import { exported, text } from "./files";
import { Glyphs } from "./glyphs";
import { Hover } from "./hover";
import { Appearance, MODES, type Mode } from "./looks";
import { startLive } from "./live";
import { Model, motion } from "./model";
import { Panel } from "./panel";
import { Player } from "./player";
import { checkScene, hasBothStates, isFound, type SceneData } from "./scene";
import { Stage } from "./stage";

const message = document.querySelector<HTMLElement>("#message")!;

function say(words: string, wrong = false): void {
  message.textContent = words;
  message.classList.toggle("wrong", wrong);
}

/**
 * Horizontal direction in which the object opens: the sum of the motions of the part centres. Before training it is
 * unknown whether joints open or close from the start to the end state; then the direction that points out of the object counts.
 */
function frontOf(model: Model, found: boolean): Vector3 {
  const front = new Vector3();
  const centre = model.extent().getCenter(new Vector3());
  for (const link of model.movable()) {
    const joint = link.data.joint!;
    const middle = link.box.isEmpty() ? new Vector3() : link.box.getCenter(new Vector3());
    const at = (value: number) => {
      const [position, rotation] = [new Vector3(), new Quaternion()];
      motion(joint, value, position, rotation);
      return middle.clone().applyQuaternion(rotation).add(position);
    };
    const way = at(joint.limits[0] + 0.3 * (joint.limits[1] - joint.limits[0])).sub(at(joint.limits[0])).setZ(0).normalize();
    const out = at(joint.limits[0]).add(new Vector3().fromArray(link.data.origin)).sub(centre);
    front.addScaledVector(way, found && way.dot(out) < 0 ? -1 : 1);
  }
  return front;
}

/** Shows a recording: the box of the object, seen from where the cameras were. */
function frameBox(stage: Stage, box: ObjectBox, scene: SceneData): void {
  const extent = new Box3().setFromObject(box.group);
  const centre = extent.getCenter(new Vector3());
  const eyes = (scene.cameras ?? []).map(({ pose }) => new Vector3(pose[0][3], pose[1][3], pose[2][3]));
  const front = eyes.reduce((sum, eye) => sum.add(eye).sub(centre), new Vector3()).setZ(0);
  // The surroundings are in view, too.
  stage.frameObject(extent.expandByVector(extent.getSize(new Vector3()).multiplyScalar(0.25)), front);
}

/** Offers what the canvas shows as a file. */
async function savePicture(stage: Stage, name: string): Promise<void> {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(await stage.picture());
  link.download = `${name}.png`;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

/** What the address asks for: `?embed` leaves out the controls and plays, `?play` only plays, `?test` is for tests. */
const asked = new URLSearchParams(location.search);

function openStage(scene: SceneData): Stage {
  document.title = `${scene.name} – artgs`;
  document.documentElement.classList.toggle("embed", asked.has("embed"));
  const test = asked.has("test");
  return new Stage(document.querySelector("canvas")!, test);
}

async function start(scene: SceneData) {
  const stage = openStage(scene);
  const model = new Model(scene.links);
  const looks = new Appearance(model, stage.plain);
  // Discovered parts before training have points but no meshes.
  const found = isFound(scene);
  const clouds = new Clouds(scene.clouds ?? [], model, found);
  stage.add(model.root);
  stage.add(clouds.group);
  await looks.loadMeshes();
  if (found) await clouds.load();
  const glyphs = new Glyphs(model);
  const extent = model.extent();
  const views = scene.cameras ?? [];
  const frustums = new Frustums(views, 0.1 * (extent.getSize(new Vector3()).length() || 1), stage);
  const wipe = new Wipe(stage, (share) => panel.wipe(share));
  stage.add(frustums.group);

  let state = 0;
  let marked = found;
  const player = new Player(stage, model, (on) => panel.play(on));
  const setMode = (mode: Mode) => {
    looks.show(mode);
    clouds.visible = mode === "points";
    stage.drawSplats(mode === "splats");
    panel.mode(mode);
    stage.changed();
  };
  const setState = (next: number) => {
    state = next;
    player.set(false);
    model.setState(state);
    clouds.show(state, marked);
    stage.invalidate();
  };
  const explode = (share: number) => {
    model.explode(share);
    panel.explode(share);
    stage.requestMotionFrame();
    if (share > 0) stage.include(model.present());
  };
  const setAxes = (on: boolean) => {
    glyphs.visible = on;
    panel.axes(on);
    stage.changed();
  };
  const look = async (index: number | null) => {
    if (index === null) {
      stage.leave();
      stage.home();
      return wipe.show(null);
    }
    setState(views[index].state);
    stage.look(views[index]);
    await wipe.show(views[index]);
  };
  const panel: Panel = new Panel(document.querySelector("#panel")!, scene, model, {
    mode: setMode,
    axes: setAxes,
    explode,
    home: () => (panel.free(), stage.home()),
    turntable: (on) => (stage.turntable(on), panel.turntable(on)),
    picture: () => void savePicture(stage, scene.name).catch(fail),
    state: setState,
    play: (on) => player.set(on),
    frustums: (on) => void frustums.show(on),
    look: (index) => void look(index).catch(fail),
    wipe: (share) => wipe.set(share),
    mask: (on) => wipe.showMask(on),
    moved: (on) => ((marked = on), clouds.show(state, on), stage.invalidate()),
  });
  document.addEventListener("keydown", (event) => {
    // Space also presses the button that has the focus, and letters choose entries of lists.
    const busy = event.target instanceof HTMLElement && event.target.closest("input, select, textarea, button, a, summary");
    if (busy || event.ctrlKey || event.metaKey || event.altKey || event.repeat) return;
    if (panel.key(event.key.toLowerCase())) event.preventDefault();
  });
  model.onMove(() => stage.requestMotionFrame());
  stage.onCoarsen((triangles) => looks.coarsen(triangles));
  const has = (kind: (l: SceneData["links"][number]) => boolean) => scene.links.some(kind);
  panel.allow("textured", has((l) => !!l.mesh));
  panel.allow("mesh", has((l) => !!l.mesh));
  panel.allow("parts", has((l) => !!l.mesh));
  panel.allow("evidence", looks.hasEvidence());
  panel.allow("collision", has((l) => l.collision.length > 0));
  panel.allow("points", clouds.any);
  panel.allow("splats", has((l) => !!l.splats) && "later");
  stage.frameObject(extent, frontOf(model, found));
  if (has((l) => !!l.mesh)) stage.ground(extent);
  setState(0);
  setMode(has((l) => !!l.mesh) ? "textured" : "points");
  if (scene.corrections && model.movable().length > 0) {
    const corrections = new Corrections(scene, stage, model, () => setState(0));
    for (const { link, data, item } of panel.alternatives) corrections.offer(link, data, item);
    await corrections.load();
    stage.add(corrections.group);
    panel.append(corrections.element);
  }
  enableDrag(stage, model, looks, new Hover(stage, glyphs, panel), (link) => (player.set(false), panel.hold(link)));

  // The object can be moved already; large files follow.
  await Promise.all([looks.loadSplats(), found ? undefined : clouds.load()]);
  clouds.show(state, marked);
  if (extent.isEmpty()) stage.frameObject(clouds.extent(), new Vector3());
  const box = scene.object_box && scene.placement ? new ObjectBox(scene, stage, clouds) : null;
  if (box) {
    stage.add(box.group);
    panel.lead(box.element);
    frameBox(stage, box, scene);
  }
  const counts = looks.count();
  panel.allow("splats", counts.splats > 0);
  const facts = [`${scene.links.length} links`, `${counts.triangles.toLocaleString("en")} triangles`];
  if (counts.splats > 0) facts.push(`${counts.splats.toLocaleString("en")} Gaussians`);
  panel.facts(found ? "Discovered parts, before training" : scene.links.length > 0 ? facts.join(" · ") : hasBothStates(scene) ? "Capture before reconstruction" : "Recording of one state");
  if (found) say("Check the parts and their motions. Correct what is wrong, then save and continue.");
  else say(exported || !model.movable().length ? "" : "Drag a part to move it. Drag the background to turn the view.");
  setTimeout(() => message.classList.contains("wrong") || say(""), 6000);
  const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
  if ((asked.has("embed") || asked.has("play")) && !still) player.set(true);

  return {
    model,
    stage,
    setMode,
    setState,
    /** Moves a joint; returns its value, clamped to the limits. */
    setJoint: (link: string | number, value: number) => model.set(model.find(link), value),
    joint: (link: string | number) => model.find(link).value,
    setExploded: explode,
    setAxes,
    setFrustums: (on: boolean) => frustums.show(on),
    look,
    setWipe: (share: number) => wipe.set(share),
    play: (on: boolean) => player.set(on),
    settled: () => stage.settled(),
    /** See [`Stage.coarseness`]. */
    coarseness: () => stage.coarseness,
    /** Page coordinates of a point of a link's frame. */
    onPage: (link: string | number, point: [number, number, number]) => {
      model.root.updateMatrixWorld(true);
      const p = stage.onPage(model.find(link).shell.localToWorld(new Vector3(...point)));
      return [p.x, p.y];
    },
    counts,
    /** The box of the object; null on pages without one. */
    box,
    /** Frames per second while a joint moves. */
    fps: (seconds: number, moving = true) =>
      new Promise<number>((done) => {
        const link = model.movable()[0];
        const began = performance.now();
        const first = stage.frames;
        stage.animate(() => {
          const passed = (performance.now() - began) / 1000;
          if (moving && link) model.set(link, link.data.joint!.limits[0] + (0.5 + 0.5 * Math.sin(4 * passed)) * (link.data.joint!.limits[1] - link.data.joint!.limits[0]));
          if (passed < seconds) return true;
          done((stage.frames - first) / passed);
          return false;
        });
      }),
  };
}

function fail(error: unknown): never {
  say(error instanceof Error ? error.message : String(error), true);
  throw error;
}

type Hooks = Awaited<ReturnType<typeof start>> | ReturnType<typeof startLive>;

declare global {
  interface Window {
    /** For tests and the console: `await artgs.ready`, then everything that `start` or `startLive` returns. */
    artgs: { ready: Promise<void>; modes: readonly string[] } & Partial<Hooks>;
  }
}

const ready = text("scene.json")
  .then((json): Hooks | Promise<Hooks> => {
    const scene = checkScene(JSON.parse(json) as SceneData);
    return scene.live ? startLive(scene, openStage(scene), say) : start(scene);
  })
  .then((hooks) => void Object.assign(window.artgs, hooks))
  .catch(fail);
window.artgs = { ready, modes: MODES };
