/** Small signs on buttons, drawn on a square of 16. */

import { svg, html } from "lit";

const PATHS = {
  undo: "M6.5 3.5 3 7l3.5 3.5M3.5 7H10a3 3 0 0 1 0 6H8",
  redo: "M9.5 3.5 13 7l-3.5 3.5M12.5 7H6a3 3 0 0 0 0 6h2",
  plus: "M8 3.5v9M3.5 8h9",
  minus: "M3.5 8h9",
  whole: "M3 6V3h3M10 3h3v3M13 10v3h-3M6 13H3v-3",
  earlier: "M10 3.5 5.5 8l4.5 4.5",
  later: "M6 3.5 10.5 8 6 12.5",
  twice: "M5.5 5.5h7v7h-7zM10.5 3.5h-7v7",
  away: "M3.5 5h9M6.5 5V3.5h3V5M5 5l.5 8h5l.5-8",
  down: "M4 6.5 8 10.5 12 6.5",
  aim: "M8 1.5v4M8 10.5v4M1.5 8h4M10.5 8h4",
  lens: "M7 2.5a4.5 4.5 0 1 0 0 9a4.5 4.5 0 1 0 0-9M10.2 10.2l3.3 3.3",
  line: "M3 13 13 3M2 12l2 2M12 2l2 2",
  bars: "M2.5 13h11M4 13V9M6.7 13V4M9.4 13V6M12 13v-2",
  save: "M8 2.5v7M5 7l3 3 3-3M3 13h10",
  pin: "M6 2.5h4l-.5 5 2 2h-7l2-2zM8 9.5v4.5",
} as const;

export function sign(name: keyof typeof PATHS) {
  return html`<svg class="sign" viewBox="0 0 16 16" aria-hidden="true">${svg`<path d=${PATHS[name]}></path>`}</svg>`;
}
