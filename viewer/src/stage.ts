/** Canvas, camera and lights; draws only after changes. */

import {
  AmbientLight,
  Box3,
  CanvasTexture,
  Color,
  DirectionalLight,
  Matrix4,
  Mesh,
  MeshBasicMaterial,
  Object3D,
  PerspectiveCamera,
  PlaneGeometry,
  Raycaster,
  Scene,
  Spherical,
  Vector2,
  Vector3,
  WebGLRenderer,
} from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { SparkRenderer } from "@sparkjsdev/spark";
import { drawInBatches } from "./batches";
import { Pace } from "./pace";
import type { CameraData } from "./scene";

/** Milliseconds without motion after which the finest level is drawn. */
const REST = 120;

/** Levels of detail during motions, finest first: share of triangles, and of pixels in each direction. */
const LEVELS = [
  { triangles: 1, pixels: 1 },
  { triangles: 1 / 4, pixels: 1 },
  { triangles: 1 / 16, pixels: 1 },
  { triangles: 1 / 16, pixels: 0.7 },
  { triangles: 1 / 64, pixels: 0.5 },
];

/** Seconds in which the turntable turns the view around the object. */
const TURN = 16;

const UP_TO_Z = new Matrix4().makeRotationX(Math.PI / 2);

/** True if the browser reports a software renderer. */
function drawnInSoftware(): boolean {
  const gl = document.createElement("canvas").getContext("webgl2");
  if (!gl) throw new Error("This page needs WebGL 2; turn on hardware acceleration, or use a recent browser.");
  const name = String(gl.getParameter(gl.getExtension("WEBGL_debug_renderer_info")?.UNMASKED_RENDERER_WEBGL ?? gl.RENDERER));
  gl.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|softpipe|software/i.test(name);
}

export class Stage {
  readonly scene = new Scene();
  readonly camera = new PerspectiveCamera(40, 1, 0.01, 100);
  readonly renderer: WebGLRenderer;
  readonly controls: OrbitControls;
  /** Frames drawn so far. */
  frames = 0;
  private readonly spark: SparkRenderer;
  private wanted = false;
  private readonly ticks = new Set<(seconds: number) => boolean>();
  private last = 0;
  private extent = new Box3(new Vector3(-1, -1, -1), new Vector3(1, 1, 1));
  private front = new Vector3(0, -1, 0);
  private looking: CameraData | null = null;
  private readonly resized: (() => void)[] = [];
  private readonly pace = new Pace(LEVELS.length);
  private readonly density: number;
  /** Index into `LEVELS` of what is drawn. */
  private drawn = 0;
  /** Timer that runs during motions. */
  private waking: ReturnType<typeof setTimeout> | null = null;
  private coarsen: (triangles: number) => void = () => {};
  private turning = false;
  /** Drawn without a graphics card. */
  readonly plain: boolean;

  constructor(
    readonly canvas: HTMLCanvasElement,
    test: boolean,
  ) {
    // Antialiasing and high pixel densities are too slow without a graphics card.
    const plain = test || drawnInSoftware();
    this.renderer = new WebGLRenderer({ canvas, antialias: !plain, preserveDrawingBuffer: test, powerPreference: "high-performance" });
    this.density = plain ? 1 : Math.min(devicePixelRatio, 2);
    this.plain = plain;
    this.renderer.setPixelRatio(this.density);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.addEventListener("change", () => this.requestMotionFrame());
    this.controls.enableDamping = false;
    this.spark = new SparkRenderer({ renderer: this.renderer, onDirty: () => this.invalidate() });
    drawInBatches(this.spark);
    this.scene.add(this.spark);
    this.light();
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement!);
    const dark = matchMedia("(prefers-color-scheme: dark)");
    dark.addEventListener("change", () => this.paint());
    canvas.addEventListener("keydown", (event) => this.key(event));
    this.paint();
    this.resize();
  }

  private light(): void {
    const key = new DirectionalLight(0xffffff, 2.2);
    key.position.set(-0.6, 0.9, 1);
    key.target.position.set(0, 0, -1);
    this.camera.add(key, key.target, new AmbientLight(0xffffff, 1.1));
    this.scene.add(this.camera);
  }

  private paint(): void {
    const colour = getComputedStyle(document.documentElement).getPropertyValue("--stage").trim();
    this.scene.background = new Color(colour || "#f4f4f2");
    this.invalidate();
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement!;
    if (width === 0 || height === 0) return;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    if (this.looking) this.project(this.looking);
    this.resized.forEach((f) => f());
    this.pace.forget();
    // At once, since resizing has cleared the canvas.
    this.draw();
  }

  onResize(listener: () => void): void {
    this.resized.push(listener);
  }

  /** Requests a frame. */
  invalidate(): void {
    if (this.wanted) return;
    this.wanted = true;
    requestAnimationFrame((now) => this.frame(now));
  }

  /** Requests a frame of a motion; it may be drawn at a coarser level. */
  requestMotionFrame(): void {
    this.wake();
    this.invalidate();
  }

  private wake(): void {
    if (this.waking !== null) clearTimeout(this.waking);
    this.waking = setTimeout(() => {
      // A frame of the motion is still pending, so the motion has not ended.
      if (this.wanted) return this.wake();
      this.waking = null;
      this.pace.rest();
      this.invalidate();
    }, REST);
  }

  /** Registers the function that receives the share of triangles to draw. */
  onCoarsen(listener: (triangles: number) => void): void {
    this.coarsen = listener;
  }

  /** Call when other content is drawn. */
  changed(): void {
    this.pace.forget();
    this.invalidate();
  }

  /** Drawn level, level chosen for motions, and measured milliseconds per frame of each level. */
  get coarseness(): { drawn: number; level: number; known: readonly (number | undefined)[] } {
    return { drawn: this.drawn, level: this.pace.level, known: this.pace.known };
  }

  /** Calls `tick` with the seconds passed before every frame until it returns false. */
  animate(tick: (seconds: number) => boolean): void {
    this.ticks.add(tick);
    this.last = performance.now();
    this.invalidate();
  }

  private frame(now: number): void {
    this.wanted = false;
    const seconds = Math.min(0.25, Math.max(0, now - this.last) / 1000);
    this.last = now;
    for (const tick of [...this.ticks]) if (!tick(seconds)) this.ticks.delete(tick);
    if (this.ticks.size > 0) this.requestMotionFrame();
    this.refine(this.waking === null ? 0 : this.pace.step(now));
    this.draw();
  }

  private refine(level: number): void {
    if (level === this.drawn) return;
    this.drawn = level;
    const { triangles, pixels } = LEVELS[level];
    if (this.renderer.getPixelRatio() !== this.density * pixels) this.renderer.setPixelRatio(this.density * pixels);
    this.coarsen(triangles);
  }

  private draw(): void {
    this.renderer.render(this.scene, this.camera);
    this.frames++;
  }

  /** Waits until no more frames are requested. */
  async settled(): Promise<void> {
    const pause = (ms: number) => new Promise((done) => setTimeout(done, ms));
    this.invalidate();
    for (let quiet = 0, seen = -1; quiet < 4; ) {
      await pause(60);
      const ordering = this.spark.visible && (this.spark.sorting || this.spark.sortDirty);
      quiet = this.frames === seen && !this.wanted && this.waking === null && !ordering ? quiet + 1 : 0;
      seen = this.frames;
    }
  }

  /** Shows or hides Gaussians; hidden, they cost no time. */
  drawSplats(on: boolean): void {
    this.spark.visible = on;
    this.changed();
  }

  /** A soft shadow on the floor below the object. */
  ground(extent: Box3): void {
    if (extent.isEmpty()) return;
    const picture = document.createElement("canvas");
    picture.width = picture.height = 128;
    const draw = picture.getContext("2d")!;
    const fade = draw.createRadialGradient(64, 64, 0, 64, 64, 64);
    for (const [at, dark] of [[0, 0.34], [0.45, 0.26], [0.75, 0.07], [1, 0]] as const) fade.addColorStop(at, `rgba(0,0,0,${dark})`);
    draw.fillStyle = fade;
    draw.fillRect(0, 0, 128, 128);
    const material = new MeshBasicMaterial({ map: new CanvasTexture(picture), transparent: true, depthWrite: false });
    const floor = new Mesh(new PlaneGeometry(1, 1), material);
    const [middle, size] = [extent.getCenter(new Vector3()), extent.getSize(new Vector3())];
    floor.position.set(middle.x, middle.y, extent.min.z - 1e-3 * size.length());
    floor.scale.set(1.7 * size.x + 0.2 * size.z, 1.7 * size.y + 0.2 * size.z, 1);
    floor.renderOrder = -1;
    this.scene.add(floor);
  }

  /** Sets the extent of the object and the direction in which it opens, and resets the view. */
  frameObject(extent: Box3, front: Vector3): void {
    if (!extent.isEmpty()) this.extent = extent;
    if (front.lengthSq() > 1e-6) this.front = front.clone().normalize();
    this.home();
  }

  /** Resets the view: the front of the object, from slightly above and aside. */
  home(): void {
    this.leave();
    const middle = this.extent.getCenter(new Vector3());
    const size = this.extent.getSize(new Vector3()).length();
    const away = this.front.clone().applyAxisAngle(this.camera.up, -0.55).add(new Vector3(0, 0, 0.38)).normalize();
    const angle = (this.camera.fov * Math.PI) / 360;
    const narrow = Math.min(1, this.camera.aspect);
    this.controls.target.copy(middle);
    this.camera.position.copy(middle).addScaledVector(away, (0.62 * size) / Math.sin(angle) / narrow);
    this.camera.near = size / 200;
    this.camera.far = size * 50;
    this.camera.updateProjectionMatrix();
    this.controls.update();
    this.invalidate();
  }

  /** Moves the camera back until the box is in view. */
  include(box: Box3): void {
    if (this.looking || box.isEmpty()) return;
    const away = this.camera.position.clone().sub(this.controls.target);
    const radius = box.getSize(new Vector3()).length() / 2 + box.getCenter(new Vector3()).distanceTo(this.controls.target);
    const angle = (this.camera.fov * Math.PI) / 360;
    const distance = radius / Math.sin(angle) / Math.min(1, this.camera.aspect);
    if (distance > away.length()) this.camera.position.copy(this.controls.target).addScaledVector(away.normalize(), distance);
    this.controls.update();
    this.invalidate();
  }

  /** Looks through a camera of the capture, with its photo in the middle of the canvas. */
  look(view: CameraData): void {
    this.looking = view;
    this.controls.enabled = false;
    const p = view.pose;
    // OpenCV cameras look along +z with y down, those of three.js along -z with y up.
    const pose = new Matrix4().set(
      p[0][0], -p[0][1], -p[0][2], p[0][3],
      p[1][0], -p[1][1], -p[1][2], p[1][3],
      p[2][0], -p[2][1], -p[2][2], p[2][3],
      0, 0, 0, 1,
    );
    pose.decompose(this.camera.position, this.camera.quaternion, this.camera.scale);
    this.project(view);
    this.invalidate();
  }

  /** Place of a camera's photo on the canvas, CSS pixels. */
  photoPlace(view: CameraData): { x: number; y: number; width: number; height: number; scale: number } {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const [w, h] = view.size;
    const scale = Math.min(width / w, height / h);
    return { x: (width - w * scale) / 2, y: (height - h * scale) / 2, width: w * scale, height: h * scale, scale };
  }

  private project(view: CameraData): void {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const { x, y, scale } = this.photoPlace(view);
    const [fx, fy, cx, cy] = view.intrinsics.map((v) => v * scale);
    const { near, far } = this.camera;
    const edge = (pixels: number, focal: number) => (pixels / focal) * near;
    const [left, right] = [edge(-x - cx, fx), edge(width - x - cx, fx)];
    const [top, bottom] = [edge(y + cy, fy), edge(y + cy - height, fy)];
    this.camera.projectionMatrix.makePerspective(left, right, top, bottom, near, far);
    this.camera.projectionMatrixInverse.copy(this.camera.projectionMatrix).invert();
  }

  /** Makes the camera movable again, at its current position. */
  leave(): void {
    if (!this.looking) return;
    this.looking = null;
    this.controls.enabled = true;
    this.camera.scale.set(1, 1, 1);
    this.camera.updateProjectionMatrix();
    this.controls.update();
    this.invalidate();
  }

  /** Ray through a point of the page. */
  ray(x: number, y: number): Raycaster {
    const box = this.canvas.getBoundingClientRect();
    const at = new Vector2(((x - box.left) / box.width) * 2 - 1, 1 - ((y - box.top) / box.height) * 2);
    const ray = new Raycaster();
    ray.setFromCamera(at, this.camera);
    return ray;
  }

  /** Where a point of the object is on the page. */
  onPage(point: Vector3): Vector2 {
    const box = this.canvas.getBoundingClientRect();
    const p = point.clone().project(this.camera);
    return new Vector2(box.left + ((p.x + 1) / 2) * box.width, box.top + ((1 - p.y) / 2) * box.height);
  }

  add(object: Object3D): void {
    this.scene.add(object);
    this.invalidate();
  }

  private key(event: KeyboardEvent): void {
    const turns: Record<string, [number, number, number]> = {
      ArrowLeft: [-0.1, 0, 1],
      ArrowRight: [0.1, 0, 1],
      ArrowUp: [0, -0.1, 1],
      ArrowDown: [0, 0.1, 1],
      "+": [0, 0, 0.9],
      "=": [0, 0, 0.9],
      "-": [0, 0, 1.1],
    };
    const turn = turns[event.key];
    if (!turn || this.looking || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    this.orbit(turn);
  }

  /** Turns the view around the object, or stops. */
  turntable(on: boolean): void {
    if (on === this.turning) return;
    this.turning = on;
    if (!on) return;
    this.animate((seconds) => {
      if (this.turning && !this.looking) this.orbit([(2 * Math.PI * seconds) / TURN, 0, 1]);
      return this.turning;
    });
  }

  /** What the canvas shows, drawn at the finest level, as PNG. */
  picture(): Promise<Blob> {
    this.refine(0);
    this.draw();
    const wrong = new Error("The browser cannot make a picture of the view.");
    return new Promise((done, fail) => this.canvas.toBlob((blob) => (blob ? done(blob) : fail(wrong)), "image/png"));
  }

  /** Moves the camera around the object by two angles, and to a multiple of its distance. */
  private orbit([theta, phi, radius]: [number, number, number]): void {
    const inverse = UP_TO_Z.clone().invert();
    const away = this.camera.position.clone().sub(this.controls.target).applyMatrix4(inverse);
    const s = new Spherical().setFromVector3(away);
    s.theta += theta;
    s.phi += phi;
    s.radius *= radius;
    s.makeSafe();
    this.camera.position.setFromSpherical(s).applyMatrix4(UP_TO_Z).add(this.controls.target);
    this.controls.update();
    this.requestMotionFrame();
  }
}
