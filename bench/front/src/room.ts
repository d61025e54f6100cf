/** The room of a bench in a notebook's cell: its size, light or dark as around it, and its keys kept in. */

/** Pixels: of a bench whose picture stands beside its parts, and of one whose parts stand below one another. */
const HEIGHT = 520;
const NARROW = 640;
/**
 * Notebooks have themes of their own, which need not be the system's, and say so each in its own way; but text inherits its
 * colour in all of them, and is light where the ground is dark. So often one looks, milliseconds.
 */
const LOOKS = 500;
/** Letters that edit, with Ctrl, what is in the bench; others are commands of what is around it. */
const EDITING = new Set(["a", "c", "v", "x", "y", "z"]);
const RUN = "Enter";

/** Make an element a room; what it returns ends that. */
export function settled(room: HTMLElement): () => void {
  Object.assign(room.style, { width: "100%", height: `${HEIGHT}px`, border: "1px solid rgb(128 128 128 / 30%)", boxSizing: "border-box" });
  const look = () => {
    const scheme = isLight(getComputedStyle(room).color) ? "dark" : "light";
    if (room.isConnected && room.style.getPropertyValue("--bench-scheme") !== scheme) room.style.setProperty("--bench-scheme", scheme);
  };
  const timer = window.setInterval(look, LOOKS);
  const watch = new ResizeObserver(([entry]) => {
    const width = entry!.contentRect.width;
    if (width) room.style.height = `${width < NARROW ? Math.min(1.12 * width, 480) + 596 : HEIGHT}px`;
    look();
  });
  watch.observe(room);
  for (const kind of ["keydown", "keyup", "keypress"] as const) room.addEventListener(kind, keepIn);
  return () => {
    window.clearInterval(timer);
    watch.disconnect();
  };
}

/** Letters and arrows pressed on the bench mean nothing to the notebook, where they delete cells; its commands go through. */
function keepIn(event: KeyboardEvent): void {
  const command = (event.ctrlKey || event.metaKey) && event.key.length === 1 && !EDITING.has(event.key.toLowerCase());
  const run = event.key === RUN && (event.shiftKey || event.ctrlKey || event.metaKey || event.altKey);
  const leaves = event.key === "Escape" || /^F\d+$/.test(event.key);
  if (event.defaultPrevented || !(command || run || leaves)) event.stopPropagation();
}

/** A colour may be written in many ways; a canvas knows them all. */
const brush = document.createElement("canvas").getContext("2d", { willReadFrequently: true })!;

function isLight(colour: string): boolean {
  brush.clearRect(0, 0, 1, 1);
  brush.fillStyle = colour;
  brush.fillRect(0, 0, 1, 1);
  const [red, green, blue] = brush.getImageData(0, 0, 1, 1).data as unknown as [number, number, number];
  return 0.3 * red + 0.59 * green + 0.11 * blue > 128;
}
