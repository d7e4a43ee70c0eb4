/// Icons and state marks. A state is always colour + shape + word; the shapes here are those of map/symbols.ts.
import type { ComponentChildren } from 'preact';
import type { AnchorStatus } from '../live/messages';
import type { RangeClass } from '../state/scene';

const ICONS = {
  live: () => (
    <>
      <circle cx="10" cy="10" r="4.4" />
      <path d="M10 2.8v14.4M2.8 10h14.4" />
    </>
  ),
  anchors: () => (
    <>
      <path d="M10 9.6V17.2M6.2 17.2h7.6" />
      <circle cx="10" cy="7.5" r="1.9" />
      <path d="M5.5 11.7a6 6 0 0 1 0-8.4M14.5 11.7a6 6 0 0 0 0-8.4" />
    </>
  ),
  plan: () => (
    <>
      <circle cx="4.6" cy="15.4" r="1.9" />
      <circle cx="15.4" cy="4.6" r="1.9" />
      <path d="M6.6 15.4h6a2.7 2.7 0 0 0 0-5.4H7.4a2.7 2.7 0 0 1 0-5.4h6" />
    </>
  ),
  measurements: () => <path d="M2.6 12.2c1.4 0 1.6-6.6 3-6.6s1.8 10 3.2 10 1.8-12.4 3.2-12.4 1.6 9 3 9h2.4" />,
  models: () => <path d="M3.4 3.2v13.4h13.4M5.6 13.8c5.4 0 4.2-8.4 10.6-9.2" />,
  replay: () => (
    <>
      <path d="M3.6 6.2A7.4 7.4 0 1 1 2.7 11M3.2 2.8v3.9h3.9" />
      <path d="M8.4 7.2v5.6l4.4-2.8z" fill="currentColor" />
    </>
  ),
  system: () => <path d="M3.2 6h6.2M13 6h3.8M3.2 14h2.6M9.4 14h7.4M11.2 3.9v4.2M7.6 11.9v4.2" />,
  auto: () => (
    <>
      <circle cx="10" cy="10" r="6.8" />
      <path d="M10 3.2a6.8 6.8 0 0 1 0 13.6z" fill="currentColor" />
    </>
  ),
  light: () => (
    <>
      <circle cx="10" cy="10" r="3.4" />
      <path d="M10 2.4v1.8M10 15.8v1.8M2.4 10h1.8M15.8 10h1.8M4.6 4.6l1.3 1.3M14.1 14.1l1.3 1.3M4.6 15.4l1.3-1.3M14.1 5.9l1.3-1.3" />
    </>
  ),
  dark: () => <path d="M15.8 12.1A6.6 6.6 0 0 1 7.9 4.2a6.6 6.6 0 1 0 7.9 7.9z" />,
  sun: () => (
    <>
      <circle cx="10" cy="10" r="4" fill="currentColor" />
      <path
        d="M10 1.8v2.4M10 15.8v2.4M1.8 10h2.4M15.8 10h2.4M4.2 4.2l1.7 1.7M14.1 14.1l1.7 1.7M4.2 15.8l1.7-1.7M14.1 5.9l1.7-1.7"
        stroke-width="2.2"
      />
    </>
  ),
  sound: () => (
    <>
      <path d="M3.2 7.8v4.4h2.6l4 3.4V4.4l-4 3.4z" />
      <path d="M12.8 7.4a3.8 3.8 0 0 1 0 5.2M15 5.2a7 7 0 0 1 0 9.6" />
    </>
  ),
  mute: () => (
    <>
      <path d="M3.2 7.8v4.4h2.6l4 3.4V4.4l-4 3.4z" />
      <path d="M13 7.8l4.2 4.4M17.2 7.8L13 12.2" />
    </>
  ),
  user: () => (
    <>
      <circle cx="10" cy="6.8" r="3.1" />
      <path d="M3.8 16.8c.9-3.2 3.2-4.7 6.2-4.7s5.3 1.5 6.2 4.7" />
    </>
  ),
  plus: () => <path d="M10 4.2v11.6M4.2 10h11.6" />,
  minus: () => <path d="M4.2 10h11.6" />,
  centre: () => (
    <>
      <circle cx="10" cy="10" r="2.5" />
      <path d="M10 2.6v3.5M10 13.9v3.5M2.6 10h3.5M13.9 10h3.5" />
    </>
  ),
  fit: () => <path d="M3.2 7.2v-4h4M12.8 3.2h4v4M16.8 12.8v4h-4M7.2 16.8h-4v-4" />,
  side: () => <path d="M3 16.5h14M5.5 16.5v-6h9v6M3 6.5c3-4 6 2 9 0s3-3 5-2.5" />,
  download: () => <path d="M10 3v9.4M6.2 8.8l3.8 3.8 3.8-3.8M3.6 16.6h12.8" />,
  copy: () => (
    <>
      <rect x="7.2" y="7.2" width="9" height="9" rx="1" />
      <path d="M4.4 12.6H3.8V3.8h8.8v.6" />
    </>
  ),
  close: () => <path d="M5 5l10 10M15 5L5 15" />,
  help: () => (
    <>
      <circle cx="10" cy="10" r="7.2" />
      <path d="M7.8 8a2.3 2.3 0 1 1 3.3 2.1c-.8.4-1.1.9-1.1 1.7M10 14.2v.2" />
    </>
  ),
  menu: () => <path d="M3.5 5.5h13M3.5 10h13M3.5 14.5h13" />,
};
export type IconName = keyof typeof ICONS;
export const Icon = ({ name }: { name: IconName }) => (
  <svg class="ico" viewBox="0 0 20 20" aria-hidden="true">
    {ICONS[name]()}
  </svg>
);

const SHAPES = {
  ok: () => (
    <>
      <circle cx="8" cy="8" r="7" class="fill" />
      <path d="M4.7 8.4l2.3 2.3 4.3-5" class="cut" />
    </>
  ),
  ring: () => (
    <>
      <circle cx="8" cy="8" r="6" class="line" />
      <path d="M5.1 8.3l2 2 3.8-4.4" class="line" />
    </>
  ),
  caution: () => (
    <>
      <path d="M8 1l7.3 13.4H.7z" class="fill" />
      <path d="M8 5.4v4.4M8 11.6v1.2" class="cut" />
    </>
  ),
  bad: () => (
    <>
      <path d="M5 .7h6L15.3 5v6L11 15.3H5L.7 11V5z" class="fill" />
      <path d="M5.3 5.3l5.4 5.4M10.7 5.3l-5.4 5.4" class="cut" />
    </>
  ),
  info: () => (
    <>
      <rect x="1" y="1" width="14" height="14" rx="1.5" class="fill" />
      <path d="M8 7.8V12M8 4.2v.3" class="cut" />
    </>
  ),
  off: () => (
    <>
      <circle cx="8" cy="8" r="6" class="line" />
      <path d="M5.2 8h5.6" class="line" />
    </>
  ),
  estimating: () => (
    <>
      <circle cx="8" cy="8" r="6" class="line" />
      <circle cx="8" cy="8" r="2.6" class="fill" />
    </>
  ),
  found: () => (
    <>
      <circle cx="8" cy="8" r="6" class="line dash" />
      <circle cx="8" cy="8" r="2" class="fill" />
    </>
  ),
  half: () => (
    <>
      <circle cx="8" cy="8" r="6.2" class="line" />
      <path d="M8 1.8a6.2 6.2 0 0 1 0 12.4z" class="fill" />
    </>
  ),
};
export type Shape = keyof typeof SHAPES;
export type Tone = 'ok' | 'caution' | 'bad' | 'info' | 'off' | 'ink';

export const Mark = ({ shape, tone }: { shape: Shape; tone?: Tone }) => (
  <svg class={`mark ${tone ?? ''}`} viewBox="0 0 16 16" aria-hidden="true">
    {SHAPES[shape]()}
  </svg>
);
export const Chip = ({
  shape,
  tone,
  word,
  children,
}: {
  shape: Shape;
  tone: Tone;
  word: string;
  children?: ComponentChildren;
}) => (
  <span class={`chip ${tone}`}>
    <Mark shape={shape} />
    <b>{word}</b>
    {children}
  </span>
);

export const STATUS_LOOK: Record<AnchorStatus | 'unseen', [Shape, Tone]> = {
  unseen: ['off', 'off'],
  found: ['found', 'info'],
  estimating: ['estimating', 'info'],
  converged: ['ring', 'ok'],
  accepted: ['ok', 'ok'],
  ambiguous: ['half', 'caution'],
  moved: ['bad', 'bad'],
  gave_up: ['off', 'caution'],
  withheld: ['off', 'off'],
  passes: ['ring', 'info'],
  within_goal: ['ok', 'ok'],
  over_goal: ['caution', 'caution'],
};
/// Within the goal or over it is for mark and colour: the report's word is the same.
const status_word = (s: AnchorStatus): string =>
  s === 'within_goal' || s === 'over_goal' ? 'PASSES' : s.replace('_', ' ').toUpperCase();
export const StatusChip = ({ status }: { status: AnchorStatus }) => (
  <Chip shape={STATUS_LOOK[status][0]} tone={STATUS_LOOK[status][1]} word={status_word(status)} />
);
export const CLASS_LOOK: Record<RangeClass, [Shape, Tone, string]> = {
  los: ['ok', 'ok', 'LOS'],
  nlos: ['caution', 'caution', 'NLOS'],
  unclear: ['off', 'off', 'unclear'],
};

/// A number with its unit glued to it.
export const Q = ({ v, u }: { v: string; u: string }) => (
  <span class="q">
    <span class="n">{v}</span>
    <span class="u">{u}</span>
  </span>
);
