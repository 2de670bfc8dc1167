// The 3D view with its controls: paint, ghosts, the photograph, the camera.

import { viridisGradient } from "./colour_map";
import { Latest } from "./connection";
import { button, fill, h, number, select } from "./dom";
import { ErrorBox, isWithoutScene } from "./errors";
import type { Mesh } from "./protocol";
import { Scene3D } from "./scene3d";
import type { Paint } from "./scene_geometry";
import type { ViewerData } from "./viewer";
import { evenly, Spread } from "./uncertainty";

const GHOSTS = 12;
const DRAWS_FOR_SPREAD = 48;

/** Shows one frame's mesh, and what the posterior's draws say about it. */
export class SpaceView {
  readonly element = h("div", { class: "space" });
  readonly tools: HTMLElement;
  /** Called when the view was turned. */
  onTurn: () => void = () => {};

  private scene: Scene3D | null = null;
  private data: ViewerData | null = null;
  private frame = 0;
  private mesh: Mesh | null = null;
  private photoOf: string | null = null;
  private ghostsOf = "";
  private spread: Spread | null = null;
  private readonly error = new ErrorBox();
  private readonly legend = h("div", { class: "legend", hidden: true });
  private readonly home: HTMLButtonElement;
  private readonly ghostToggle: HTMLButtonElement;
  private readonly photoToggle: HTMLButtonElement;
  private readonly paint: HTMLSelectElement;
  private readonly meshes = new Latest<void>(() => this.loadMesh(), (e) => this.fail(e));
  private readonly photos = new Latest<void>(() => this.loadPhoto(), (e) => this.fail(e));
  private readonly ghosts = new Latest<void>(() => this.loadGhosts(), (e) => this.fail(e));
  private readonly spreads = new Latest<void>(() => this.loadSpread(), (e) => this.fail(e));

  constructor() {
    this.home = button("From the camera", () => this.scene?.fromCamera(), {
      title: "Look exactly from where the photograph was taken",
      "aria-pressed": "false",
    });
    this.ghostToggle = this.toggle("Ghosts", "Draws of the posterior, translucent", (on) => {
      this.look({ ghosts: on });
      if (on) this.ghosts.call();
    });
    const paints: [Paint, string][] = [
      ["plain", "Plain"],
      ["parts", "Parts"],
      ["uncertainty", "Uncertainty"],
    ];
    this.paint = select(paints, "plain", (value) => this.setPaint(value as Paint), {
      "aria-label": "Colours of the surface",
    });
    const opacity = h("input", {
      type: "range",
      class: "small",
      min: "0.1",
      max: "1",
      step: "0.05",
      value: "1",
      "aria-label": "Opacity of the surface",
      title: "Opacity of the surface",
    });
    opacity.addEventListener("input", () => this.look({ opacity: Number(opacity.value) }));
    const showPhoto = (on: boolean) => this.look({ photo: on });
    this.photoToggle = this.toggle("Photo", "The photograph behind the scene", showPhoto, true);
    this.tools = h(
      "div",
      { class: "tools" },
      this.home,
      button("Whole", () => this.scene?.reset(), { title: "Look at the whole scene" }),
      this.paint,
      this.ghostToggle,
      this.toggle("Wire", "The triangles' edges only", (on) => this.look({ wireframe: on })),
      this.photoToggle,
      opacity,
    );
    this.element.append(this.legend, this.error.element);
    try {
      this.scene = new Scene3D(this.element);
      this.scene.onViewpoint = (at) => {
        this.home.setAttribute("aria-pressed", String(at));
        if (!at) this.onTurn();
      };
    } catch (error) {
      this.element.append(
        h("div", { class: "empty" }, "This browser offers no WebGL: there is no 3D view."),
      );
      console.warn(error);
    }
  }

  /** Shows frames of other data. */
  setData(data: ViewerData | null): void {
    const other = data?.key !== this.data?.key;
    this.data = data;
    this.ghostToggle.disabled = !data?.drawCount;
    this.ghostToggle.hidden = this.paint.hidden = data?.drawCount === null;
    this.photoToggle.hidden = data?.photoKey === null;
    if (!other) return;
    this.spread = null;
    this.legend.hidden = true;
    this.scene?.setDeviations(null);
    this.scene?.setGhosts([]);
    this.ghostsOf = "";
    if (data && data.frames.length > 0) return;
    this.scene?.clear();
    this.photoOf = null;
  }

  /** Asks for a frame's mesh. */
  ask(frame: number): void {
    this.frame = frame;
    const visible = this.element.offsetParent && document.visibilityState === "visible";
    if (this.scene && this.data && visible) this.meshes.call();
  }

  /** False if the browser offers no WebGL. */
  get works(): boolean {
    return this.scene !== null;
  }

  /** Gives the view's context for drawing back to the browser. */
  dispose(): void {
    this.scene?.dispose();
    this.scene = null;
  }

  /** The present camera of the view. */
  viewpoint() {
    return this.scene?.viewpoint() ?? null;
  }

  private toggle(text: string, title: string, change: (on: boolean) => void, on = false) {
    const element = button(text, () => {
      const pressed = element.getAttribute("aria-pressed") !== "true";
      element.setAttribute("aria-pressed", String(pressed));
      change(pressed);
    }, { title, "aria-pressed": String(on) });
    return element;
  }

  private look(change: Partial<Scene3D["look"]>): void {
    if (!this.scene) return;
    Object.assign(this.scene.look, change);
    this.scene.update();
  }

  private setPaint(paint: Paint): void {
    this.look({ paint });
    this.legend.hidden = true;
    if (paint === "uncertainty") this.spreads.call();
    if (paint === "parts") this.showParts();
  }

  private async loadMesh(): Promise<void> {
    const { data, scene, frame } = this;
    if (!data || !scene || frame >= data.frames.length) return;
    const [mesh, camera] = await Promise.all([data.mesh(frame), data.camera(frame)]);
    if (data.key !== this.data?.key) return;
    this.error.clear();
    this.mesh = mesh;
    this.photos.call();
    this.home.hidden = camera === null;
    scene.setCamera(camera);
    scene.setMesh(mesh);
    if (scene.look.paint === "parts") this.showParts();
    if (scene.look.paint === "uncertainty" && this.spread?.topology !== mesh.topology) {
      this.spreads.call();
    }
    if (scene.look.ghosts) this.ghosts.call();
  }

  /** Loads the photograph beside the meshes, which do not wait for it. */
  private async loadPhoto(): Promise<void> {
    const { data, scene } = this;
    if (!data || !scene || this.photoOf === data.photoKey) return;
    const key = data.photoKey;
    const picture = key === null ? null : await data.photo();
    if (key !== this.data?.photoKey) return;
    this.photoOf = key;
    if (!picture) {
      scene.setPhoto(null);
      return;
    }
    const image = new Image();
    image.src = picture.url;
    await image.decode();
    if (picture.owned) URL.revokeObjectURL(picture.url);
    scene.setPhoto(image);
  }

  private async loadGhosts(): Promise<void> {
    const { data, scene } = this;
    if (!data?.drawCount || !scene) return;
    // Some draws more than before do not change the sample enough to load it again.
    const key = `${data.key} ${Math.floor(Math.log2(data.drawCount + 1) * 2)}`;
    if (key === this.ghostsOf) return;
    const meshes: Mesh[] = [];
    for (const draw of evenly(data.drawCount, GHOSTS)) {
      meshes.push(await data.drawMesh(draw));
      if (data.key !== this.data?.key) return;
    }
    this.ghostsOf = key;
    scene.setGhosts(meshes);
  }

  private async loadSpread(): Promise<void> {
    const { data, scene, mesh } = this;
    if (!data || !scene || !mesh) return;
    if (!data.drawCount || data.drawCount < 2) {
      this.showLegend("The uncertainty needs draws: look at a run that has some.");
      return;
    }
    const spread = new Spread(mesh.topology, mesh.positions.length);
    const draws = evenly(data.drawCount, DRAWS_FOR_SPREAD);
    for (const [i, draw] of draws.entries()) {
      this.showLegend(`Loading draw ${i + 1} of ${draws.length} …`);
      spread.add(await data.drawMesh(draw));
      if (data.key !== this.data?.key || scene.look.paint !== "uncertainty") return;
    }
    this.spread = spread;
    if (spread.draws < 2) {
      this.showLegend("No two draws have the triangles of this one: nothing can be compared.");
      return;
    }
    const values = spread.deviations();
    const top = Float32Array.from(values).sort()[Math.floor(0.99 * (values.length - 1))] || 1e-9;
    scene.setDeviations({ values, top });
    this.showScale(top, spread.draws);
  }

  private showScale(top: number, draws: number): void {
    const bar = h("div", { class: "bar" });
    bar.style.background = viridisGradient();
    this.showLegend(
      h("div", {}, `Standard deviation over ${draws} draws, in scene units`),
      bar,
      h(
        "div",
        { class: "ticks" },
        h("span", {}, "0"),
        h("span", {}, number(top / 2, 2)),
        h("span", {}, number(top, 2)),
      ),
    );
  }

  private showParts(): void {
    const parts = this.mesh?.parts ?? [];
    if (parts.length < 2) this.legend.hidden = true;
    else this.showLegend(`${parts.length} parts: ${parts.slice(0, 24).join(", ")}`);
  }

  private showLegend(...content: (string | HTMLElement)[]): void {
    fill(this.legend, ...content);
    this.legend.hidden = false;
  }

  private fail(error: unknown): void {
    if (isWithoutScene(error)) this.scene?.clear();
    else this.error.show(error);
  }
}
