// The photograph in space: a plane across its camera's frustum, behind the scene, so that from
// the camera the scene lies over it.

import * as THREE from "three";
import type { Camera } from "./protocol";

/** The photograph's plane and the frustum's edges. */
export class PhotoPlane {
  readonly object = new THREE.Group();
  private readonly plane = new THREE.Mesh(
    new THREE.PlaneGeometry(1, 1),
    new THREE.MeshBasicMaterial({ side: THREE.DoubleSide, toneMapped: false }),
  );
  private readonly frustum = new THREE.LineSegments(
    new THREE.BufferGeometry(),
    new THREE.LineBasicMaterial({ color: 0x8894a3, transparent: true, opacity: 0.6 }),
  );
  private imageAspect = 1;

  constructor() {
    this.plane.visible = false;
    this.object.add(this.plane, this.frustum);
  }

  /** The photograph; null: none. */
  setImage(image: HTMLImageElement | null): void {
    const { material } = this.plane;
    material.map?.dispose();
    material.map = null;
    if (image) {
      const texture = new THREE.Texture(image);
      texture.colorSpace = THREE.SRGBColorSpace;
      texture.needsUpdate = true;
      material.map = texture;
      this.imageAspect = image.naturalWidth / Math.max(1, image.naturalHeight);
    }
    material.needsUpdate = true;
  }

  /** Width over height of a camera's picture. */
  aspect({ width_px, height_px }: Camera): number {
    return width_px && height_px ? width_px / height_px : this.imageAspect;
  }

  /** Places the plane behind a scene within the bounds. */
  show(camera: Camera | null, { center, radius }: THREE.Sphere, wanted: boolean): void {
    this.plane.visible = wanted && camera !== null && this.plane.material.map !== null;
    if (!camera || !this.plane.visible) return;
    const eye = new THREE.Vector3(...camera.eye);
    const axis = new THREE.Vector3(...camera.target).sub(eye).normalize();
    const depth = Math.max(center.clone().sub(eye).dot(axis), 0) + 1.3 * radius;
    const half = Math.tan((((camera.fov_y ?? 35) / 2) * Math.PI) / 180);
    const tall = camera.height ? camera.height : 2 * depth * half;
    const wide = tall * this.aspect(camera);
    this.plane.position.copy(eye).addScaledVector(axis, depth);
    this.plane.up.set(...camera.up);
    // A plane faces +z, and lookAt turns +z of a thing that is no camera to the target.
    this.plane.lookAt(eye);
    this.plane.scale.set(wide, tall, 1);
    const [right, down] = camera.shift ?? [0, 0];
    // Pictures count downwards, and a plane that faces the camera has its x to the right.
    this.plane.translateX(-right * wide);
    this.plane.translateY(down * tall);
    this.plane.updateMatrixWorld();
    this.drawFrustum(eye, !camera.height);
  }

  /** Shows the frustum's edges: from its own camera they would only be in the way. */
  showFrustum(wanted: boolean): void {
    this.frustum.visible = wanted && this.plane.visible;
  }

  private drawFrustum(eye: THREE.Vector3, hasApex: boolean): void {
    const corners = [
      [-0.5, -0.5],
      [0.5, -0.5],
      [0.5, 0.5],
      [-0.5, 0.5],
    ].map(([x, y]) => this.plane.localToWorld(new THREE.Vector3(x, y, 0)));
    const lines: THREE.Vector3[] = [];
    corners.forEach((corner, i) => {
      lines.push(corner, corners[(i + 1) % 4]!);
      if (hasApex) lines.push(eye, corner);
    });
    this.frustum.geometry.dispose();
    this.frustum.geometry = new THREE.BufferGeometry().setFromPoints(lines);
  }
}
