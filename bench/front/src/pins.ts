/** Pinned states as a strip of thumbnails: click one to return to it, or compare with it. */

import { html, css } from "lit";

import { plain } from "./numbers";
import { Part, controls } from "./part";
import { sign } from "./signs";

export class PinsView extends Part {
  protected override watched() {
    return [this.bench.pins];
  }

  override render() {
    const { bench } = this;
    return html`<ul aria-label="Pinned states">
      ${bench.pins.map(({ about, thumbnail }) => html`<li class=${about.compared ? "compared" : ""}>
        <button class="state" title="Return to ${about.words}" aria-label="Return to pinned state ${about.number}: ${about.words}" @click=${() => bench.act({ do: "return", number: about.number })}><img src=${thumbnail} alt=""></button>
        <span class="words" title=${about.words}>${about.number}. ${about.words}</span>
        <span class="verbs"><button aria-pressed=${about.compared} title="Compare with this state" @click=${() => bench.compareWith(about.compared ? null : about.number)}>${about.compared ? "compared" : this.against(about.psnr, about.same)}</button>
        <button class="icon" aria-label="Unpin ${about.number}" title="Unpin" @click=${() => bench.unpin(about.number)}>${sign("away")}</button></span></li>`)}
    </ul>`;
  }

  /** Its PSNR against the state that is compared with. */
  private against(psnr: number | null, same: boolean): string {
    return same ? "the same" : psnr === null ? "compare" : `${plain(psnr, 3)} dB`;
  }

  static override styles = [
    controls,
    css`
      :host { display: block; flex: none; border-top: 1px solid var(--line); }
      ul { display: flex; gap: 6px; margin: 0; padding: 5px 8px; list-style: none; overflow-x: auto; scrollbar-width: thin; }
      li { display: grid; grid-template-columns: auto 112px; grid-template-rows: auto auto; column-gap: 6px; align-items: center; flex: none; padding: 3px; border-radius: 7px; border: 1px solid transparent; font-size: 11.5px; }
      li.compared { border-color: var(--accent); }
      .state { grid-row: 1 / 3; padding: 0; height: auto; }
      img { display: block; height: 44px; max-width: 66px; border-radius: 4px; }
      .words { overflow: hidden; display: -webkit-box; -webkit-box-orient: vertical; -webkit-line-clamp: 2; line-height: 1.2; overflow-wrap: anywhere; }
      .verbs { display: flex; justify-content: space-between; }
      .verbs button { height: 20px; padding: 0 5px; font-size: 11px; }
      .verbs .icon { width: 20px; padding: 0; }
    `,
  ];
}
