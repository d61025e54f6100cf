/** Pictures on a canvas: one, two side by side, by a wipe, or their difference. */

export type Compare = "alone" | "beside" | "wipe" | "difference";

export interface Layout {
  /** Of the canvas, pixels of the page. */
  width: number;
  height: number;
  /** Rows and columns of the picture. */
  shape: [number, number];
  /** Pixels of the page for one of the picture. */
  unit: number;
  /** Where the picture begins in its pane. */
  corner: { x: number; y: number };
  paneWidth: number;
  /** Where the wipe stands, as a share of the width. */
  wipe: number;
  moving: boolean;
}

/** From so many pixels of the page for one of the picture on, single pixels are seen as they are. */
export const PIXELS_SEEN = 3;

const scratch = document.createElement("canvas");

export function drawPictures(context: CanvasRenderingContext2D, mode: Compare, now: ImageBitmap, other: ImageBitmap | null, layout: Layout): void {
  const { width, height, paneWidth, wipe } = layout;
  if (mode === "alone" || !other) put(context, now, 0, width, layout);
  else if (mode === "beside") {
    put(context, other, 0, paneWidth - 1, layout);
    put(context, now, paneWidth, paneWidth, layout);
  } else if (mode === "wipe") {
    const line = wipe * width;
    put(context, other, 0, line, layout, 0);
    put(context, now, line, width - line, layout, 0);
    context.fillStyle = "rgb(0 0 0 / 50%)";
    context.fillRect(line - 2, 0, 4, height);
    context.fillStyle = "#fff";
    context.fillRect(line - 1, 0, 2, height);
    context.beginPath();
    context.roundRect(line - 4, height / 2 - 16, 8, 32, 4);
    context.fill();
    context.strokeStyle = "rgb(0 0 0 / 50%)";
    context.stroke();
  } else put(context, difference(now, other, layout.shape), 0, width, layout);
}

/** One picture within a piece of the canvas from `left` on; its origin there unless another is given. */
function put(context: CanvasRenderingContext2D, image: ImageBitmap | HTMLCanvasElement, left: number, width: number, layout: Layout, origin = left): void {
  const { shape: [rows, columns], unit, corner } = layout;
  context.save();
  context.beginPath();
  context.rect(left, 0, width, layout.height);
  context.clip();
  // What has fewer pixels than the sensor is interpolated: its pixels are not those of the sensor.
  context.imageSmoothingEnabled = unit < PIXELS_SEEN || image.width < columns;
  context.imageSmoothingQuality = layout.moving && 2 * image.width >= columns ? "low" : "high";
  context.drawImage(image, origin + corner.x, corner.y, columns * unit, rows * unit);
  context.restore();
}

/** |one − other|, four times as bright: no difference is black. */
function difference(one: ImageBitmap, other: ImageBitmap, [rows, columns]: [number, number]): HTMLCanvasElement {
  [scratch.width, scratch.height] = [columns, rows];
  const context = scratch.getContext("2d")!;
  context.drawImage(one, 0, 0, columns, rows);
  context.globalCompositeOperation = "difference";
  context.drawImage(other, 0, 0, columns, rows);
  context.globalCompositeOperation = "lighter";
  for (let doubled = 0; doubled < 2; doubled++) context.drawImage(scratch, 0, 0);
  context.globalCompositeOperation = "source-over";
  return scratch;
}
