import { Box3, Color, NeutralToneMapping, Ray, Scene, Vector3, VSMShadowMap, WebGLRenderer } from 'three';
import type { Pose } from '../twin/pose.ts';
import { BuiltRobot } from './built_robot.ts';
import { Download, fetchManifest, type RawManifest, readRawManifest } from './bundle.ts';
import { CameraRig, type ViewName } from './camera.ts';
import { Environment } from './environment.ts';
import type { Figure, Stage } from './figure.ts';
import { readManifest } from './manifest.ts';
import { wantsStillness } from './motion.ts';
import { Placeholders } from './placeholder.ts';
import type { RawFiles } from './raw_robot.ts';
import type { ModelReport } from './report.ts';
import { ShadowCaster } from './shadow.ts';
import { Skeleton } from './skeleton.ts';
import type { LinkLook, SkinTones } from './skin.ts';
import { Drain } from './stale.ts';
import { THEMES, type ThemeName } from './theme.ts';

const MAX_PIXEL_RATIO = 2;
/** A tick after a pause must not count the pause. */
const MAX_STEP_SECONDS = 0.1;
const PLACEHOLDER_REACHES = 0.12;

/**
 * One robot in three dimensions, in a world whose Z is up. It draws only when something has changed: a pose, the
 * camera, the size, the theme, a mesh that came. An unchanged robot costs no frames.
 */
export class RobotScene {
  /** Pictures drawn so far. */
  renderedFrames = 0;
  readonly #host: HTMLElement;
  readonly #renderer: WebGLRenderer;
  readonly #scene = new Scene();
  readonly #camera: CameraRig;
  readonly #environment = new Environment();
  readonly #drain: Drain;
  readonly #placeholders = new Placeholders();
  readonly #resizes: ResizeObserver;
  readonly #bounds = new Box3();
  #theme: ThemeName;
  readonly #tones: SkinTones = { accent: { value: new Color() }, caution: { value: new Color() } };
  #figure: Figure | null = null;
  #built: BuiltRobot | null = null;
  #skeleton: Skeleton | null = null;
  #caster: ShadowCaster | null = null;
  #loading: AbortController | null = null;
  #pose: Pose | null = null;
  /** The newest base that made sense; null while the robot reports none. */
  #base: NonNullable<Pose['base']> | null = null;
  #greyAsked = false;
  #live = false;
  #tickRequested = false;
  #lastTick = 0;

  /** Throws an Error with a sentence for people when the browser has no WebGL. */
  constructor(host: HTMLElement, options: { theme: ThemeName }) {
    this.#host = host;
    const canvas = document.createElement('canvas');
    const context = canvas.getContext('webgl2', { antialias: true, alpha: false });
    if (context === null)
      throw new Error('This browser has no 3D. The table shows everything the robot says.');
    this.#renderer = new WebGLRenderer({ canvas, context });
    this.#renderer.toneMapping = NeutralToneMapping; // keeps the colours of the URDF, rolls off highlights only
    this.#renderer.shadowMap.enabled = true;
    this.#renderer.shadowMap.type = VSMShadowMap;
    this.#renderer.shadowMap.autoUpdate = false; // shadows change with the pose, not with the camera
    canvas.setAttribute('role', 'img');
    canvas.setAttribute('aria-label', '3D view of the robot');
    canvas.style.display = 'block';
    canvas.style.touchAction = 'none';
    host.append(canvas);
    canvas.addEventListener('webglcontextlost', this.#onContextLost);
    canvas.addEventListener('webglcontextrestored', this.#onContextRestored);

    this.#theme = options.theme;
    this.#drain = new Drain(new Color());
    this.#drain.advance(Number.POSITIVE_INFINITY);
    this.#camera = new CameraRig(canvas, () => this.#requestTick());
    this.#scene.add(this.#environment.group);
    this.setTheme(options.theme);
    this.#resizes = new ResizeObserver(() => this.#resize());
    this.#resizes.observe(host);
    this.#resize();
  }

  /** Draw calls of the newest picture, shadows included when they were drawn anew. */
  get drawCalls(): number {
    return this.#renderer.info.render.calls;
  }

  /** Triangles of the newest picture. */
  get triangles(): number {
    return this.#renderer.info.render.triangles;
  }

  /** Loads the robot that a bundle's manifest describes. Never rejects: what is wrong stands in the report. A later
   *  call supersedes an earlier one. */
  load(
    manifestUrl: string,
    onProgress: (receivedBytes: number, totalBytes: number) => void,
  ): Promise<ModelReport> {
    return this.#supersede((signal, report) => this.#load(manifestUrl, onProgress, signal, report));
  }

  /** The same for raw files that this browser has already, by the URIs of their URDF. */
  loadLocal(manifest: RawManifest, files: RawFiles): Promise<ModelReport> {
    return this.#supersede(async (signal, report) => {
      const { showRaw } = await import('./raw_robot.ts');
      await showRaw(manifest, files, this.#stage(signal), this.#drain, report, () => {});
      this.#frame(true);
    });
  }

  async #supersede(work: (signal: AbortSignal, report: ModelReport) => Promise<void>): Promise<ModelReport> {
    this.#loading?.abort();
    const loading = new AbortController();
    this.#loading = loading;
    const report: ModelReport = { missing: [], joints: [], ignored: [], problems: [] };
    try {
      await work(loading.signal, report);
    } catch (cause) {
      report.error = cause instanceof Error ? cause.message : String(cause);
      if (!loading.signal.aborted) this.#clear(); // the model before is not this robot's any more
    }
    if (loading.signal.aborted) report.error = 'superseded by a newer model';
    return report;
  }

  /** Shows the newest pose; `live` false marks it as one that is not the robot's present. */
  setPose(pose: Pose, live: boolean): void {
    this.#pose = pose;
    this.#live = live;
    this.#updateGrey();
    this.#show(pose);
  }

  /** Lets the colour drain to grey: stale or offline. */
  setGrey(grey: boolean): void {
    this.#greyAsked = grey;
    this.#updateGrey();
  }

  setTheme(name: ThemeName): void {
    this.#theme = name;
    const theme = THEMES[name];
    this.#scene.background = theme.page;
    this.#renderer.toneMappingExposure = theme.exposure;
    this.#environment.setTheme(theme);
    this.#placeholders.setColor(theme.caution);
    this.#tones.accent.value = theme.accent;
    this.#tones.caution.value = theme.caution;
    this.#drain.setTone(theme.stale);
    this.#requestTick();
  }

  /** Turns the camera to a named view; `home` is the one that a robot is first seen from. */
  look(view: ViewName): void {
    this.#camera.look(view);
    this.#requestTick();
  }

  /** Bytes that `refine` would fetch; null when there is nothing finer, or nothing that this device should carry. */
  get finerBytes(): number | null {
    return this.#built?.finestBytes ?? null;
  }

  /** Shows the finest level there is; the one before stays until then. Rejects with one line when it can't be had. */
  async refine(onProgress: (receivedBytes: number, totalBytes: number) => void): Promise<void> {
    await this.#built?.refine(onProgress);
  }

  /** The link under a point of the window (CSS pixels), or null. */
  pick(clientX: number, clientY: number): string | null {
    const { left, top, width, height } = this.#renderer.domElement.getBoundingClientRect();
    POINT.set((2 * (clientX - left)) / width - 1, 1 - (2 * (clientY - top)) / height, 0.5);
    const { camera } = this.#camera;
    RAY.origin.setFromMatrixPosition(camera.matrixWorld);
    RAY.direction.copy(POINT).unproject(camera).sub(RAY.origin).normalize();
    return this.#figure?.pick(RAY) ?? null;
  }

  /** How a link is shown from now on; `{}` as at first. */
  setLinkLook(link: string, look: LinkLook): void {
    this.#figure?.setLook(link, look);
    this.#requestTick();
  }

  /** world_from_link of the newest pose for every link: 4×4, row after row, metres, world Z up. */
  linkPoses(): Record<string, number[]> {
    const figure = this.#figure;
    if (figure === null) return {};
    return Object.fromEntries(
      figure.linkNames.map((name) => [name, figure.linkMatrix(name)!.clone().transpose().toArray()]),
    );
  }

  dispose(): void {
    this.#loading?.abort();
    this.#resizes.disconnect();
    this.#camera.dispose();
    this.#clear();
    this.#placeholders.dispose();
    this.#environment.dispose();
    const canvas = this.#renderer.domElement;
    canvas.removeEventListener('webglcontextlost', this.#onContextLost);
    canvas.removeEventListener('webglcontextrestored', this.#onContextRestored);
    this.#renderer.dispose();
    this.#renderer.forceContextLoss(); // a page may hold few contexts; don't wait for the garbage collector
    canvas.remove();
  }

  async #load(
    manifestUrl: string,
    onProgress: (receivedBytes: number, totalBytes: number) => void,
    signal: AbortSignal,
    report: ModelReport,
  ): Promise<void> {
    const raw = await fetchManifest(manifestUrl, signal);
    const stage = this.#stage(signal);
    if (raw.v === 2) {
      const built = new BuiltRobot(readManifest(raw), manifestUrl, stage, this.#drain, this.#tones);
      this.#built = built;
      await built.dress(report, onProgress);
    } else {
      const { showRaw } = await import('./raw_robot.ts');
      const manifest = readRawManifest(raw);
      // Until the URDF is read nobody knows which files it draws.
      let total = [...manifest.files.values()].reduce((sum, file) => sum + file.size, 0);
      const files = new Download(manifestUrl, signal, (received) => onProgress(received, total));
      await showRaw(manifest, files, stage, this.#drain, report, (needed) => {
        total = needed;
      });
    }
    report.ignored = [...(this.#pose?.joints.keys() ?? [])].filter((name) => !report.joints.includes(name));
    this.#frame(true);
  }

  #stage(signal: AbortSignal): Stage {
    return {
      signal,
      show: (figure) => {
        signal.throwIfAborted();
        this.#adopt(figure);
      },
      skinned: () => {
        this.#skeleton?.dispose();
        this.#skeleton = null;
        this.#place();
      },
      changed: () => this.#place(),
      placeholder: () => this.#placeholders.make(this.#camera.reach * PLACEHOLDER_REACHES),
    };
  }

  #adopt(figure: Figure): void {
    this.#clear();
    this.#figure = figure;
    this.#scene.add(figure.root);
    this.#skeleton = new Skeleton(figure, THEMES[this.#theme].muted);
    this.#caster = new ShadowCaster(figure.linkNames.length);
    this.#scene.add(this.#skeleton.lines, this.#caster.blocks);
    if (this.#pose !== null) figure.setJoints(this.#pose.joints);
    this.#place();
    this.#frame(false);
  }

  #clear(): void {
    this.#caster?.dispose();
    this.#skeleton?.dispose();
    this.#figure?.dispose();
    this.#caster = this.#skeleton = this.#figure = this.#built = null;
    this.#renderer.shadowMap.needsUpdate = true;
    this.#requestTick();
  }

  /** Shows a pose at once. Interpolation, when it comes, calls this from the tick with poses in between. */
  #show(pose: Pose): void {
    const based = this.#takeBase(pose.base);
    const turned = this.#figure?.setJoints(pose.joints) ?? false;
    if (turned || based) this.#place();
  }

  /** True when the base is another than before. A base that is not numbers is no base report: the last one stays. */
  #takeBase(base: Pose['base']): boolean {
    const old = this.#base;
    if (base === null) {
      this.#base = null;
      return old !== null;
    }
    const now = [...base.xyz, ...base.quat_wxyz];
    if (!now.every(Number.isFinite) || Math.hypot(...base.quat_wxyz) < 1e-6) return false;
    if (old !== null && [...old.xyz, ...old.quat_wxyz].every((value, i) => value === now[i])) return false;
    this.#base = base;
    return true;
  }

  /** Computes where every link is, and asks for a picture of it. */
  #place(): void {
    const figure = this.#figure;
    if (figure === null) return;
    if (this.#base === null) figure.ground();
    else figure.place(this.#base.xyz, this.#base.quat_wxyz);
    const { x, y } = figure.root.position;
    this.#camera.follow(x, y);
    this.#environment.follow(x, y);
    this.#skeleton?.follow(figure);
    this.#caster?.follow(figure.boxes);
    this.#renderer.shadowMap.needsUpdate = true;
    this.#requestTick();
  }

  #frame(eased: boolean): void {
    if (this.#figure === null) return;
    this.#camera.frame(this.#figure.bounds(this.#bounds), eased);
    this.#environment.resize(this.#camera.reach);
    this.#renderer.shadowMap.needsUpdate = true;
    this.#requestTick();
  }

  #updateGrey(): void {
    const grey = this.#greyAsked || !this.#live;
    if (grey === this.#drain.grey) return;
    this.#drain.grey = grey;
    this.#requestTick();
  }

  #resize(): void {
    const { clientWidth, clientHeight } = this.#host;
    if (clientWidth === 0 || clientHeight === 0) return;
    const ratio = Math.min(window.devicePixelRatio, MAX_PIXEL_RATIO);
    this.#renderer.setPixelRatio(ratio);
    this.#renderer.setSize(clientWidth, clientHeight);
    this.#drain.setPixelRatio(ratio);
    this.#camera.resize(clientWidth, clientHeight);
    this.#draw(); // at once: a resized canvas is blank until it is drawn
  }

  #requestTick(): void {
    if (this.#tickRequested) return;
    this.#tickRequested = true;
    requestAnimationFrame(this.#tick);
  }

  readonly #tick = (nowMs: number): void => {
    this.#tickRequested = false;
    const seconds = Math.min((nowMs - this.#lastTick) / 1000, MAX_STEP_SECONDS);
    this.#lastTick = nowMs;
    const moving = this.#camera.advance(seconds);
    const draining = this.#drain.advance(wantsStillness() ? Number.POSITIVE_INFINITY : seconds);
    this.#draw();
    if (moving || draining) this.#requestTick();
  };

  #draw(): void {
    if (this.#renderer.getContext().isContextLost()) return;
    this.#renderer.render(this.#scene, this.#camera.camera);
    this.renderedFrames += 1;
  }

  readonly #onContextLost = (event: Event): void => {
    event.preventDefault(); // or the browser never gives it back
    // Forget what lay in the lost context: three.js would later delete it in the new one, with a warning for each.
    this.#scene.traverse((object) => {
      if (!('geometry' in object && 'material' in object)) return;
      for (const held of [object.geometry, object.material].flat()) (held as { dispose(): void }).dispose();
    });
    this.#environment.forgetShadow();
  };

  readonly #onContextRestored = (): void => {
    this.#renderer.shadowMap.needsUpdate = true;
    this.#requestTick();
  };
}

const POINT = new Vector3();
const RAY = new Ray();
