// The 3D view: the mesh, the photograph at the far end of its camera's frustum, ghosts.

import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import type { Camera, Mesh, Vec3 } from "./protocol";
import { PhotoPlane } from "./photo_plane";
import { meshGeometry, ghostGeometry, type Paint } from "./scene_geometry";

export interface Look {
  paint: Paint;
  wireframe: boolean;
  photo: boolean;
  ghosts: boolean;
  opacity: number;
}

/** A scene that is rendered only when something changed. */
export class Scene3D {
  look: Look = { paint: "plain", wireframe: false, photo: true, ghosts: false, opacity: 1 };
  /** Called when the user turns the view away from the photograph's camera, or back. */
  onViewpoint: (fromCamera: boolean) => void = () => {};

  private readonly renderer: THREE.WebGLRenderer;
  private readonly scene = new THREE.Scene();
  private readonly perspective = new THREE.PerspectiveCamera(35, 1, 0.01, 1000);
  private readonly orthographic = new THREE.OrthographicCamera(-1, 1, 1, -1, 0.01, 1000);
  private camera: THREE.PerspectiveCamera | THREE.OrthographicCamera = this.perspective;
  private controls: OrbitControls;
  private readonly light = new THREE.DirectionalLight(0xffffff, 2.4);
  private readonly material = new THREE.MeshStandardMaterial({
    roughness: 0.75,
    metalness: 0,
    side: THREE.DoubleSide,
  });
  private readonly ghostMaterial = new THREE.MeshBasicMaterial({
    color: 0x4aa3ff,
    transparent: true,
    opacity: 0.09,
    depthWrite: false,
    side: THREE.DoubleSide,
  });
  private readonly surface = new THREE.Mesh(new THREE.BufferGeometry(), this.material);
  private readonly ghosts = new THREE.Group();
  private readonly photo = new PhotoPlane();
  private mesh: Mesh | null = null;
  private deviations: { values: Float32Array; top: number } | null = null;
  private given: Camera | null = null;
  private atCamera = false;
  private pending = false;
  private framed = false;
  /** The user chose the view: it stays as it is. */
  private touched = false;

  constructor(private readonly container: HTMLElement) {
    this.renderer = new THREE.WebGLRenderer({ antialias: true, alpha: true });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    const canvas = this.renderer.domElement;
    canvas.tabIndex = 0;
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", "3D view; arrow keys turn it, plus and minus zoom");
    canvas.addEventListener("keydown", (event) => this.key(event));
    canvas.addEventListener("dblclick", () => this.reset());
    container.append(canvas);
    this.light.position.set(1.5, 2.5, 3);
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0x8a8f98, 1.3), this.light);
    this.scene.add(this.photo.object, this.ghosts, this.surface);
    this.controls = this.makeControls();
    this.perspective.position.set(2, 1.5, 4);
    new ResizeObserver(() => this.resize()).observe(container);
    this.resize();
  }

  /** Shows a mesh. */
  setMesh(mesh: Mesh | null): void {
    const before = this.bounds().clone();
    this.mesh = mesh;
    this.rebuild();
    if (mesh && (!this.framed || (!this.touched && this.isElsewhere(before)))) this.reset();
    this.placePhoto();
  }

  /** Gives the context for drawing back to the browser. */
  dispose(): void {
    this.controls.dispose();
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }

  /** Shows nothing. */
  clear(): void {
    this.setMesh(null);
    this.setGhosts([]);
    this.setCamera(null);
    this.setPhoto(null);
  }

  /** The camera of the photograph: the first one also becomes the view's. */
  setCamera(camera: Camera | null): void {
    const same = JSON.stringify(camera) === JSON.stringify(this.given);
    this.given = camera;
    if (same) return;
    this.placePhoto();
    if (camera && this.atCamera) this.fromCamera();
  }

  /** The photograph behind the scene. */
  setPhoto(image: HTMLImageElement | null): void {
    this.photo.setImage(image);
    this.placePhoto();
    if (this.atCamera) this.fromCamera();
  }

  /** Shows draws as translucent shapes. */
  setGhosts(meshes: Mesh[]): void {
    for (const child of this.ghosts.children) (child as THREE.Mesh).geometry.dispose();
    this.ghosts.clear();
    this.ghostMaterial.opacity = Math.min(0.15, 0.5 / Math.max(1, meshes.length));
    for (const mesh of meshes) {
      this.ghosts.add(new THREE.Mesh(ghostGeometry(mesh), this.ghostMaterial));
    }
    this.render();
  }

  /** The standard deviations that the paint `uncertainty` shows, and the value at its top. */
  setDeviations(deviations: { values: Float32Array; top: number } | null): void {
    this.deviations = deviations;
    if (this.look.paint === "uncertainty") this.rebuild();
  }

  /** Applies a changed look. */
  update(): void {
    this.rebuild();
    this.placePhoto();
  }

  /** Puts the view exactly where the photograph's camera was. */
  fromCamera(): void {
    const given = this.given;
    if (!given) return;
    const { width, height } = this.size();
    const aspect = width / height;
    const shape = this.photo.aspect(given);
    if (given.height) {
      const half = (given.height / 2) * Math.max(1, shape / aspect);
      this.camera = this.orthographic;
      Object.assign(this.orthographic, { top: half, bottom: -half, zoom: 1 });
      Object.assign(this.orthographic, { left: -half * aspect, right: half * aspect });
    } else {
      // The whole photograph is visible: if the view is narrower, its width decides.
      const half = Math.tan((((given.fov_y ?? 35) / 2) * Math.PI) / 180);
      this.camera = this.perspective;
      const angle = Math.atan(half * Math.max(1, shape / aspect));
      this.perspective.fov = (2 * angle * 180) / Math.PI;
      this.perspective.aspect = aspect;
    }
    this.shiftView(given, width, height, shape);
    this.place(given);
    this.atCamera = true;
    this.touched = true;
    this.framed = true;
    this.onViewpoint(true);
    this.render();
  }

  /** Looks at the whole mesh from a little beside the photograph's camera, and above. */
  reset(): void {
    if (!this.mesh) return;
    const { center, radius } = this.bounds();
    const { given } = this;
    const toEye = given
      ? new THREE.Vector3(...given.eye).sub(center).normalize()
      : new THREE.Vector3(0, 0, 1);
    const polar = new THREE.Spherical().setFromVector3(toEye);
    polar.theta += 0.5;
    polar.phi = Math.max(0.3, polar.phi - 0.22);
    const { width, height } = this.size();
    const room = Math.min(1, width / height);
    polar.radius = (1.15 * radius) / Math.sin((17.5 * Math.PI) / 180) / room;
    const eye = new THREE.Vector3().setFromSpherical(polar).add(center);
    this.camera = this.perspective;
    this.perspective.clearViewOffset();
    this.perspective.fov = 35;
    this.place({ eye: eye.toArray() as Vec3, target: center.toArray() as Vec3, up: [0, 1, 0] });
    this.atCamera = false;
    this.touched = false;
    this.framed = true;
    this.onViewpoint(false);
    this.resize();
  }

  /** The view's present camera, as the protocol writes one. */
  viewpoint(): Camera {
    const { position, up } = this.camera;
    return {
      eye: position.toArray() as Vec3,
      target: this.controls.target.toArray() as Vec3,
      up: up.toArray() as Vec3,
      fov_y: this.camera instanceof THREE.PerspectiveCamera ? this.camera.fov : 35,
    };
  }

  /** Moves the view's window so that a photograph off the camera's axis is in its middle. */
  private shiftView(given: Camera, width: number, height: number, shape: number): void {
    const [x, y] = given.shift ?? [0, 0];
    if (x === 0 && y === 0) {
      this.camera.clearViewOffset();
      return;
    }
    const tall = Math.min(height, width / shape);
    this.camera.setViewOffset(width, height, -x * tall * shape, -y * tall, width, height);
  }

  private place(camera: Camera): void {
    const { center, radius } = this.bounds();
    this.camera.up.set(...camera.up).normalize();
    this.camera.position.set(...camera.eye);
    // The point that the view turns about is on the camera's axis, beside the mesh: turning
    // about a far target would throw the mesh out of the view.
    const axis = new THREE.Vector3(...camera.target).sub(this.camera.position).normalize();
    const depth = center.clone().sub(this.camera.position).dot(axis);
    const far = depth > 0.1 * radius ? depth : radius;
    this.controls.dispose();
    this.controls = this.makeControls();
    this.controls.target.copy(this.camera.position).addScaledVector(axis, far);
    this.camera.lookAt(this.controls.target);
    this.clip();
  }

  private makeControls(): OrbitControls {
    const controls = new OrbitControls(this.camera, this.renderer.domElement);
    controls.enableDamping = false;
    controls.addEventListener("start", () => {
      this.atCamera = false;
      this.touched = true;
      this.onViewpoint(false);
    });
    controls.addEventListener("change", () => {
      this.clip();
      this.render();
    });
    return controls;
  }

  private key(event: KeyboardEvent): void {
    const steps: Record<string, [number, number, number]> = {
      ArrowLeft: [-0.1, 0, 1],
      ArrowRight: [0.1, 0, 1],
      ArrowUp: [0, -0.1, 1],
      ArrowDown: [0, 0.1, 1],
      "+": [0, 0, 0.9],
      "=": [0, 0, 0.9],
      "-": [0, 0, 1.1],
    };
    const step = steps[event.key];
    if (!step || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    event.stopPropagation();
    const away = this.camera.position.clone().sub(this.controls.target);
    const polar = new THREE.Spherical().setFromVector3(away);
    polar.theta += step[0];
    polar.phi = Math.min(Math.PI - 0.01, Math.max(0.01, polar.phi + step[1]));
    polar.radius *= step[2];
    if (this.camera instanceof THREE.OrthographicCamera) this.camera.zoom /= step[2];
    this.camera.position.setFromSpherical(polar).add(this.controls.target);
    this.camera.updateProjectionMatrix();
    this.atCamera = false;
    this.touched = true;
    this.onViewpoint(false);
    this.controls.update();
    this.clip();
    this.render();
  }

  /** True if the mesh has left the view that was framed for another. */
  private isElsewhere(before: THREE.Sphere): boolean {
    const { center, radius } = this.bounds();
    const far = center.distanceTo(before.center) > 0.5 * before.radius;
    return far || radius > 1.4 * before.radius || radius < 0.6 * before.radius;
  }

  private bounds(): THREE.Sphere {
    const sphere = this.surface.geometry.boundingSphere;
    return sphere && sphere.radius > 0 ? sphere : new THREE.Sphere(new THREE.Vector3(), 1);
  }

  private rebuild(): void {
    this.surface.geometry.dispose();
    const { paint, wireframe, ghosts, opacity } = this.look;
    this.surface.visible = this.mesh !== null;
    this.ghosts.visible = ghosts;
    if (this.mesh) {
      this.surface.geometry = meshGeometry(this.mesh, paint, this.deviations);
      const coloured = this.surface.geometry.hasAttribute("color");
      this.material.vertexColors = coloured;
      this.material.color.set(coloured ? 0xffffff : 0xc9b79c);
      this.material.wireframe = wireframe;
      this.material.transparent = opacity < 1;
      this.material.opacity = opacity;
      this.material.needsUpdate = true;
    }
    this.clip();
    this.render();
  }

  private placePhoto(): void {
    this.photo.show(this.given, this.bounds(), this.look.photo);
    this.clip();
    this.render();
  }

  private clip(): void {
    const { center, radius } = this.bounds();
    const distance = this.camera.position.distanceTo(center);
    this.camera.near = Math.max((distance - 40 * radius) / 10, 0.002 * distance, 1e-4);
    this.camera.far = distance + 60 * radius;
    this.camera.updateProjectionMatrix();
  }

  private size(): { width: number; height: number } {
    const { clientWidth, clientHeight } = this.container;
    return { width: Math.max(1, clientWidth), height: Math.max(1, clientHeight) };
  }

  private resize(): void {
    const { width, height } = this.size();
    this.renderer.setSize(width, height);
    if (this.atCamera) {
      this.fromCamera();
      return;
    }
    this.perspective.aspect = width / height;
    const { top } = this.orthographic;
    Object.assign(this.orthographic, { left: (-top * width) / height });
    Object.assign(this.orthographic, { right: (top * width) / height });
    this.camera.updateProjectionMatrix();
    this.render();
  }

  private render(): void {
    if (this.pending) return;
    this.pending = true;
    requestAnimationFrame(() => {
      this.pending = false;
      this.photo.showFrustum(!this.atCamera);
      // A wide view would otherwise be lit from the side that the user does not see.
      this.light.position.copy(this.camera.position).add(new THREE.Vector3(1, 2, 0.5));
      this.renderer.render(this.scene, this.camera);
    });
  }
}
