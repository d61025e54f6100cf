/** What part of the bench a drawing shows: all of it, or a piece that was zoomed to; from metres to pixels and back. */

import type { Side } from "./protocol";
import type { Scale } from "./shapes";

export const MARGIN = { left: 14, right: 30, top: 70, bottom: 40 };
/** A longer drawing than needed is kept up to this ratio, so that it does not jump with every small move. */
const LOOSE = 1.35;
/** Behind the sensor, as a share of the drawing: there is room to drag it to. */
const ROOM = 0.06;
export const MOST_ZOOM = 400;

interface Range {
  start: number;
  end: number;
  half: number;
}

export interface Mapping extends Scale {
  z(x: number): number;
  height(y: number): number;
  left: number;
  right: number;
}

export class Frame {
  /** All that is drawn, metres. */
  range: Range | null = null;
  zoom = 1;
  /** The middle of what is shown, metres; of no use while all is shown. */
  private middle = { z: 0, height: 0 };

  /** Take over what is to be drawn. It stays while something is dragged, and changes only where it must. */
  follow(side: Side, dragging: boolean): void {
    const wanted = { start: side.start, end: side.end + ROOM * (side.end - side.start), half: side.half };
    const old = this.range;
    if (old && dragging) return;
    if (
      old && wanted.start >= old.start && wanted.end <= old.end && wanted.half <= old.half &&
      (wanted.end - wanted.start) * LOOSE > old.end - old.start && wanted.half * LOOSE > old.half
    )
      return;
    this.range = wanted;
  }

  get length(): number {
    return this.range ? this.range.end - this.range.start : 0;
  }

  mapping(width: number, height: number): Mapping {
    const { start, end, half } = this.range!;
    const inner = { width: width - MARGIN.left - MARGIN.right, height: height - MARGIN.top - MARGIN.bottom };
    const across = (inner.width / (end - start)) * this.zoom;
    const up = (inner.height / 2 / half) * this.zoom;
    const middle = this.zoom > 1 ? this.middle : { z: (start + end) / 2, height: 0 };
    const [x0, y0] = [MARGIN.left + inner.width / 2, MARGIN.top + inner.height / 2];
    return {
      x: (z) => x0 + (z - middle.z) * across,
      z: (x) => middle.z + (x - x0) / across,
      y: (metres) => y0 - (metres - middle.height) * up,
      height: (y) => middle.height + (y0 - y) / up,
      left: MARGIN.left,
      right: width - MARGIN.right / 2,
      top: MARGIN.top,
      bottom: height - MARGIN.bottom,
      thick: Math.min(Math.max(0.016 * inner.width * Math.sqrt(this.zoom), 4), 22),
    };
  }

  /** Zoom so that what is at a place of the drawing stays there. */
  zoomTo(zoom: number, width: number, height: number, x = width / 2, y = height / 2): void {
    const before = this.mapping(width, height);
    const [z, metres] = [before.z(x), before.height(y)];
    this.middle = { z: before.z(width / 2), height: before.height(height / 2) };
    this.zoom = Math.min(Math.max(zoom, 1), MOST_ZOOM);
    const after = this.mapping(width, height);
    this.middle = { z: this.middle.z + z - after.z(x), height: this.middle.height + metres - after.height(y) };
    this.keepWithin();
  }

  pan(dx: number, dy: number, width: number, height: number): void {
    const { z, height: up } = this.mapping(width, height);
    this.middle = { z: this.middle.z + z(0) - z(dx), height: this.middle.height + up(0) - up(dy) };
    this.keepWithin();
  }

  /** Keep a place of the axis in sight: the drawing follows what is dragged over its end. */
  reach(z: number, width: number, height: number): void {
    if (!this.range) return;
    const spare = 0.02 * this.length / this.zoom;
    if (this.zoom > 1) {
      const map = this.mapping(width, height);
      const [from, to] = [map.z(MARGIN.left), map.z(width - MARGIN.right)];
      if (z < from) this.middle.z -= from - z + spare;
      else if (z > to) this.middle.z += z - to + spare;
    }
    if (z > this.range.end) this.range = { ...this.range, end: z + spare };
    if (z < this.range.start) this.range = { ...this.range, start: z - spare };
  }

  private keepWithin(): void {
    const { start, end, half } = this.range!;
    this.middle.z = Math.min(Math.max(this.middle.z, start), end);
    this.middle.height = Math.min(Math.max(this.middle.height, -half), half);
  }
}
