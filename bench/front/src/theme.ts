/** Colours of the bench, light and dark. */

import { css } from "lit";

export const theme = css`
  :host {
    color-scheme: var(--bench-scheme, light dark);
    --ground: light-dark(#fbfbf9, #17191b);
    --well: light-dark(#ffffff, #101213);
    --stage: light-dark(#ecece8, #0d0e0f);
    --line: light-dark(#e2e2dd, #2c3034);
    --edge: light-dark(#b5b5ae, #555b61);
    --ink: light-dark(#1c1e20, #e9e8e4);
    --quiet: light-dark(#5f6469, #a0a6ab);
    --faint: light-dark(#a9abad, #5e6469);
    --accent: light-dark(#005f99, #6cc0f5);
    --hover: light-dark(rgb(0 0 0 / 5%), rgb(255 255 255 / 7%));
    --chosen: light-dark(#e1eef7, #17354a);
    --warn: light-dark(#e0a100, #e6b422);
    --on-warn: #1c1e20;
    --warn-ink: light-dark(#7a5600, #e6b422);
    --warn-ground: light-dark(#fdf3d8, #36301c);
    --error: light-dark(#b3261e, #ff9d94);
    --error-ground: light-dark(#fdeceb, #3d1f1d);
    --red: light-dark(#c0392b, #ff7b6b);
    --green: light-dark(#2e8b57, #5fd38d);
    --blue: light-dark(#2b6cb0, #6ea8ff);
    --glass: light-dark(#cfe6f5, #29475b);
    --glass-edge: light-dark(#4a7a9c, #7fb2d3);
    --frost: light-dark(#e4e4dd, #4b4d4b);
    --frost-edge: light-dark(#8a8a80, #a9a99c);
    --focused: light-dark(#0072b2, #56b4e9);
    --near: light-dark(#d55e00, #f0883e);
    --far: light-dark(#a5457f, #d98bb9);
    --aside: light-dark(#00805c, #2fc394);
    --arrow: url("data:image/svg+xml,%3Csvg xmlns='http://www.w3.org/2000/svg' width='8' height='6' fill='none' stroke='%23808588' stroke-width='1.5'%3E%3Cpath d='m1 1 3 3 3-3'/%3E%3C/svg%3E");
  }
`;
