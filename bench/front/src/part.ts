/** What all views of a bench share: they show its state again whenever it changed; their styles; their names. */

import { LitElement, css } from "lit";

import type { Bench } from "./bench";

export class Part extends LitElement {
  static override properties: Record<string, object> = { bench: { attribute: false } };
  declare bench: Bench;
  private seen: unknown[] | null = null;
  private readonly follow = () => {
    const now = this.watched();
    const same = now !== null && this.seen !== null && now.every((each, at) => each === this.seen![at]);
    this.seen = now;
    if (!same) this.requestUpdate();
  };

  /** What of the bench this view shows: it is drawn again where something of that has changed; null for any change. */
  protected watched(): unknown[] | null {
    return null;
  }

  protected override scheduleUpdate(): void | Promise<unknown> {
    const { together } = this.bench;
    return together ? together.then(() => super.scheduleUpdate()) : super.scheduleUpdate();
  }

  override connectedCallback(): void {
    super.connectedCallback();
    this.bench.addEventListener("change", this.follow);
    // A notebook takes cells out of the page and puts them back; meanwhile much may have changed.
    this.seen = null;
    this.requestUpdate();
  }

  override disconnectedCallback(): void {
    super.disconnectedCallback();
    this.bench.removeEventListener("change", this.follow);
  }
}

/** Two cells of a notebook load the module twice; names are given once. */
export function named(name: string, kind: CustomElementConstructor): void {
  if (!customElements.get(name)) customElements.define(name, kind);
}

export const controls = css`
  :host {
    font: 400 13px/1.4 system-ui, -apple-system, "Segoe UI", Roboto, "Noto Sans", sans-serif;
    font-variant-numeric: tabular-nums;
    color: var(--ink);
    box-sizing: border-box;
  }
  *, *::before, *::after { box-sizing: border-box; }
  button, select, input, textarea, summary {
    font: inherit;
    font-variant-numeric: tabular-nums;
    color: inherit;
  }
  button, select, summary {
    height: 28px;
    padding: 0 9px;
    border: 1px solid transparent;
    border-radius: 6px;
    background: transparent;
    cursor: pointer;
    white-space: nowrap;
    display: inline-flex;
    align-items: center;
    justify-content: center;
    gap: 6px;
    list-style: none;
  }
  summary::-webkit-details-marker { display: none; }
  select { appearance: none; padding-right: 22px; background: var(--arrow) no-repeat right 8px center; }
  button:hover:not(:disabled), select:hover, summary:hover { background-color: var(--hover); }
  button:disabled { color: var(--faint); cursor: default; }
  button[aria-pressed="true"], button[aria-selected="true"] { background: var(--chosen); color: var(--accent); }
  .icon { padding: 0; width: 28px; }
  svg.sign { width: 16px; height: 16px; fill: none; stroke: currentColor; stroke-width: 1.5; stroke-linecap: round; stroke-linejoin: round; flex: none; }
  input[type="text"], input[type="number"], textarea, .field select {
    height: 28px;
    min-width: 0;
    padding: 0 8px;
    border: 1px solid var(--line);
    border-radius: 6px;
    background-color: var(--well);
  }
  .field select { padding-right: 22px; }
  textarea { height: auto; padding: 6px 8px; resize: vertical; }
  input:hover, textarea:hover { border-color: var(--edge); }
  input[type="checkbox"] { width: 16px; height: 16px; margin: 0; accent-color: var(--accent); }
  :focus { outline: none; }
  :focus-visible { outline: 2px solid var(--accent); outline-offset: 1px; }
  label.check { display: inline-flex; align-items: center; gap: 7px; height: 28px; cursor: pointer; white-space: nowrap; }
  .quiet { color: var(--quiet); }
  .hidden { position: absolute; width: 1px; height: 1px; overflow: hidden; clip-path: inset(50%); white-space: nowrap; }
`;
