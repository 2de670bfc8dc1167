// How far each vertex moves over the posterior's draws.

import type { Mesh } from "./protocol";

/** Sums over meshes of one topology, from which standard deviations follow. */
export class Spread {
  private count = 0;
  private mean: Float64Array;
  private squares: Float64Array;

  constructor(
    readonly topology: string,
    coordinates: number,
  ) {
    this.mean = new Float64Array(coordinates);
    this.squares = new Float64Array(coordinates);
  }

  /** Adds a draw; one of another topology is left out. */
  add(mesh: Mesh): boolean {
    if (mesh.topology !== this.topology || mesh.positions.length !== this.mean.length) return false;
    this.count++;
    for (let i = 0; i < this.mean.length; i++) {
      // Welford's recurrence keeps precision for meshes far from the origin.
      const x = mesh.positions[i]!;
      const before = x - this.mean[i]!;
      this.mean[i]! += before / this.count;
      this.squares[i]! += before * (x - this.mean[i]!);
    }
    return true;
  }

  get draws(): number {
    return this.count;
  }

  /** The standard deviation of each vertex's position: the root of the summed variances. */
  deviations(): Float32Array {
    const n = this.mean.length / 3;
    const result = new Float32Array(n);
    if (this.count < 2) return result;
    for (let i = 0; i < n; i++) {
      const sum = this.squares[3 * i]! + this.squares[3 * i + 1]! + this.squares[3 * i + 2]!;
      result[i] = Math.sqrt(sum / (this.count - 1));
    }
    return result;
  }
}

/** Up to `count` of `total` things, evenly spaced. */
export function evenly(total: number, count: number): number[] {
  const n = Math.min(total, count);
  return Array.from({ length: n }, (_, i) => Math.floor(((i + 0.5) * total) / n));
}
