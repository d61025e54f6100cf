/** The whole bench: what is opened and kept above, the side and its parts, the picture. */

import { html, css, nothing } from "lit";

import { AskingView } from "./asking";
import { DecodedView } from "./decoded";
import { EditorView } from "./editor";
import { LevelsView } from "./levels";
import { MenusView } from "./menus";
import { Part, controls, named } from "./part";
import { PictureView } from "./picture";
import { PinsView } from "./pins";
import type { Where } from "./protocol";
import { SideView } from "./side";
import { sign } from "./signs";
import { theme } from "./theme";

export class BenchView extends Part {
  override connectedCallback(): void {
    super.connectedCallback();
    this.addEventListener("keydown", this.key);
    // On a page of its own the bench undoes wherever the focus is.
    if (this.bench.options.address) window.addEventListener("keydown", this.keyOutside);
    this.addEventListener("type-place", () => this.asking?.typePlace());
    this.addEventListener("show-notes", () => this.asking?.showParts());
  }

  override disconnectedCallback(): void {
    super.disconnectedCallback();
    window.removeEventListener("keydown", this.keyOutside);
  }

  protected override watched() {
    const { canUndo, canRedo, open, absent, waiting, picture, without, refused, remark, progress, side, selected } = this.bench;
    return [canUndo, canRedo, open, absent, waiting, picture === null, without, refused, remark, progress, side === null, selected];
  }

  private get asking(): AskingView | null {
    return this.renderRoot.querySelector("vcc-bench-asking");
  }

  private readonly keyOutside = (event: KeyboardEvent) => {
    if (event.target === document.body) this.key(event);
  };

  private readonly key = (event: KeyboardEvent) => {
    if (!(event.ctrlKey || event.metaKey) || event.altKey) return;
    const letter = event.key.toLowerCase();
    // In a field in which one is typing the browser's own undo is meant.
    const typing = event.composedPath().some((each) => each instanceof HTMLElement && each.matches("[data-edited]"));
    if (typing || (letter !== "z" && letter !== "y")) return;
    event.preventDefault();
    event.stopPropagation();
    this.bench.act({ do: letter === "y" || event.shiftKey ? "redo" : "undo" });
  };

  override render() {
    const { bench } = this;
    return html`
      <header>
        <h1>vcc bench</h1>
        <div class="group">
          <button class="icon" title="Undo (Ctrl+Z)" aria-label="Undo" ?disabled=${!bench.canUndo} @click=${() => bench.act({ do: "undo" })}>${sign("undo")}</button>
          <button class="icon" title="Redo (Ctrl+Shift+Z)" aria-label="Redo" ?disabled=${!bench.canRedo} @click=${() => bench.act({ do: "redo" })}>${sign("redo")}</button>
        </div>
        <span class="spring"></span>
        <vcc-bench-menus .bench=${bench}></vcc-bench-menus>
      </header>
      ${bench.open ? nothing : html`<div class="banner" role="alert">${bench.absent}</div>`}
      <section class="bench" aria-label="Optical bench">
        <vcc-bench-side .bench=${bench}></vcc-bench-side>
        ${bench.side && !bench.canUndo && !bench.canRedo ? html`<p class="quiet hint">Drag the sensor to where other rays meet, and see what becomes sharp.</p>` : nothing}
      </section>
      <section class="picture" aria-label="Picture" aria-busy=${bench.waiting || (!bench.picture && bench.without === null)}><vcc-bench-picture .bench=${bench}></vcc-bench-picture></section>
      <section class="beside" aria-label="Parts and answers"><vcc-bench-asking .bench=${bench}></vcc-bench-asking></section>
      <div class="toasts" role="status" aria-live="polite">${this.toasts()}</div>`;
  }

  private toasts() {
    const { bench } = this;
    const { progress, refused, remark } = bench;
    const close = html`<button @click=${() => bench.forgive()}>Close</button>`;
    return html`
      ${refused.filter((each) => !this.saidAtField(each.where)).map((each) => html`<div class="toast error"><span>${each.words}</span>${close}</div>`)}
      ${remark ? html`<div class="toast"><span>${remark}</span>${close}</div>` : nothing}
      ${progress ? html`<div class="toast"><span>${progress.words}</span><progress aria-label=${progress.words} max=${progress.total} value=${progress.done}></progress></div>` : nothing}`;
  }

  /** Whether the field that was refused is shown, and says so itself. */
  private saidAtField(where: Where | null): boolean {
    const { selected } = this.bench;
    if (!where || this.asking?.beside !== "parts") return false;
    const whole = this.bench.whereOf(selected);
    return whole.every((step, at) => where[at] === step) && where.length > whole.length;
  }

  static override styles = [
    controls,
    theme,
    css`
      :host { display: grid; position: relative; width: 100%; height: 100%; min-height: 0; background: var(--ground); text-align: start; }
      header { grid-area: header; display: flex; align-items: center; gap: 10px; padding: 0 8px 0 14px; height: 44px; border-bottom: 1px solid var(--line); position: relative; z-index: 3; }
      h1 { margin: 0; font-size: 13px; font-weight: 600; letter-spacing: -0.01em; }
      .group { display: flex; }
      .spring { flex: 1; }
      .bench { grid-area: bench; min-height: 0; min-width: 0; display: grid; border-bottom: 1px solid var(--line); position: relative; }
      .hint { position: absolute; left: 12px; top: 6px; right: 150px; margin: 0; line-height: 1.25; pointer-events: none; }
      @container (max-width: 639px) { .hint { font-size: 12px; } }
      .picture { grid-area: picture; min-height: 0; min-width: 0; display: grid; border-left: var(--aside-border, 1px) solid var(--line); }
      .beside { grid-area: beside; min-height: 0; min-width: 0; display: flex; flex-direction: column; }
      .banner { grid-area: banner; padding: 7px 14px; background: var(--warn-ground); border-bottom: 1px solid var(--line); }
      .toasts { position: absolute; left: 50%; bottom: 36px; translate: -50%; display: grid; gap: 8px; width: min(560px, 92%); pointer-events: none; z-index: 4; }
      .toast { display: flex; align-items: center; justify-content: space-between; gap: 12px; padding: 8px 8px 8px 14px; border-radius: 8px; border: 1px solid var(--line); background: var(--well); box-shadow: 0 6px 24px rgb(0 0 0 / 14%); pointer-events: auto; overflow-wrap: anywhere; }
      .toast.error { background: var(--error-ground); }
    `,
  ];
}

/** The frame in which a bench stands; its grid follows the width that it has, in a page or a cell. */
export class BenchFrame extends Part {
  override render() {
    return html`<vcc-bench-view .bench=${this.bench}></vcc-bench-view>`;
  }

  static override styles = css`
    /* Nothing of the page's type is inherited: a notebook's cell may have any. */
    :host { all: initial; display: block; width: 100%; height: 100%; container-type: size; overflow: auto; }
    vcc-bench-view { grid-template: "header header" auto "banner banner" auto "bench picture" minmax(180px, 44fr) "beside picture" 56fr / minmax(0, 46fr) minmax(0, 54fr); }
    @container (max-width: 639px) {
      vcc-bench-view { --aside-border: 0px; height: auto; min-height: 100%; grid-template: "header" auto "banner" auto "picture" min(112cqw, 480px) "bench" 230px "beside" minmax(320px, 1fr) / minmax(0, 1fr); }
    }
  `;
}

export function register(): void {
  named("vcc-bench-side", SideView);
  named("vcc-bench-levels", LevelsView);
  named("vcc-bench-pins", PinsView);
  named("vcc-bench-picture", PictureView);
  named("vcc-bench-editor", EditorView);
  named("vcc-bench-decoded", DecodedView);
  named("vcc-bench-menus", MenusView);
  named("vcc-bench-asking", AskingView);
  named("vcc-bench-view", BenchView);
  named("vcc-bench", BenchFrame);
}
