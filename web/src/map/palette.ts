/// Colours and weights of the theme that is on, read once per theme change: getComputedStyle in every frame would cost more than the drawing.
import type { AnchorStatus, FixClass } from '../live/messages';
import type { RangeClass } from '../state/scene';
import { css } from '../ui/theme';

export interface Palette {
  readonly ink: string;
  readonly ink2: string;
  readonly ink3: string;
  readonly ok: string;
  readonly caution: string;
  readonly bad: string;
  readonly info: string;
  readonly off: string;
  readonly panel: string;
  readonly map: string;
  readonly grid: string;
  readonly halo: string;
  readonly fine: number;
  readonly data: number;
  readonly strong: number;
  readonly casing: number;
  readonly rem: number;
  readonly font: string;
  readonly old: boolean; ///< values are the last known: grey and struck
}
/// With the link lost nothing on the map is current: no colour of a state, every value struck.
export const palette_of = (p: Palette, link_lost: boolean): Palette =>
  link_lost ? { ...p, ok: p.ink3, caution: p.ink3, bad: p.ink3, info: p.ink3, off: p.ink3, old: true } : p;
export function read_palette(): Palette {
  const n = (name: string): number => Number(css(name)) || 1;
  return {
    ink: css('--ink'),
    ink2: css('--ink-2'),
    ink3: css('--ink-3'),
    ok: css('--ok'),
    caution: css('--caution'),
    bad: css('--bad'),
    info: css('--info'),
    off: css('--off'),
    panel: css('--panel'),
    map: css('--map'),
    grid: css('--map-grid'),
    halo: css('--halo'),
    fine: n('--lw-fine'),
    data: n('--lw-data'),
    strong: n('--lw-strong'),
    casing: n('--lw-halo'),
    rem: parseFloat(getComputedStyle(document.documentElement).fontSize) || 16,
    font: css('--font'),
    old: false,
  };
}
export const status_colour = (p: Palette, s: AnchorStatus): string =>
  ({
    found: p.info,
    estimating: p.info,
    converged: p.ok,
    ambiguous: p.caution,
    accepted: p.ok,
    moved: p.bad,
    gave_up: p.caution,
    withheld: p.off,
    passes: p.info,
    within_goal: p.ok,
    over_goal: p.caution,
  })[s];
export const range_colour = (p: Palette, c: RangeClass): string => ({ los: p.ok, nlos: p.caution, unclear: p.off })[c];
export const trail_style = (p: Palette, fix: FixClass): { colour: string; dash: number[]; width: number } => {
  if (fix === 'fixed') return { colour: p.ok, dash: [], width: p.strong };
  if (fix === 'float') return { colour: p.caution, dash: [7, 6], width: p.strong };
  if (fix === 'dgps') return { colour: p.info, dash: [2, 5], width: p.strong };
  return { colour: fix === 'single' ? p.bad : p.off, dash: [0.1, 7], width: p.strong * 1.4 };
};
