/// What two versions of a plan differ in, in words a person can decide by. No DOM.
import { SETTINGS, type Corner, type Plan, type Settings, type Waypoint } from '../../api/plans';
import { fixed } from '../../ui/format';
import { to_m } from './draft';

export interface Difference {
  readonly name: string;
  readonly mine: string;
  readonly theirs: string;
}
const SHOWN_MAX = 15;
const same = (a: unknown, b: unknown): boolean => JSON.stringify(a) === JSON.stringify(b);

function moved_words(a: Corner, b: Corner): string {
  const [e, n] = to_m(a, { lon: b.lon, lat: b.lat, h_m: 0 });
  return Math.hypot(e, n) < 0.005
    ? ''
    : [
        Math.abs(n) < 0.005 ? '' : `${fixed(Math.abs(n), 2)} m further ${n > 0 ? 'north' : 'south'}`,
        Math.abs(e) < 0.005 ? '' : `${fixed(Math.abs(e), 2)} m further ${e > 0 ? 'east' : 'west'}`,
      ]
        .filter(Boolean)
        .join(', ');
}
const flags = (w: Waypoint): string =>
  [w.measure ? '' : 'only on the way', w.turn ? 'turn' : '', w.height_search ? 'height search' : '']
    .filter(Boolean)
    .join(', ') || 'measures only';
function waypoint_words(w: Waypoint, other: Waypoint): string {
  return (
    [
      moved_words(w, other),
      w.height_above_ground_m === other.height_above_ground_m ? '' : `${fixed(w.height_above_ground_m, 1)} m high`,
      w.heading_deg === other.heading_deg
        ? ''
        : w.heading_deg === null
          ? 'facing the building'
          : `facing ${fixed(w.heading_deg, 0)}°`,
      w.dwell_s === other.dwell_s ? '' : w.dwell_s === null ? 'usual dwell' : `dwells ${fixed(w.dwell_s, 1)} s`,
      flags(w) === flags(other) ? '' : flags(w),
    ]
      .filter(Boolean)
      .join('; ') || 'here'
  );
}
const corners_words = (mine: readonly Corner[], theirs: readonly Corner[]): readonly [string, string] => {
  const own = (a: readonly Corner[], b: readonly Corner[]): number =>
      a.filter((c) => !b.some((d) => !moved_words(c, d))).length,
    words = (a: readonly Corner[], b: readonly Corner[]): string =>
      a.length ? `${a.length} corners, ${own(a, b)} of them only here` : 'none';
  return [words(mine, theirs), words(theirs, mine)];
};

const target_word = (sigma_m: number | undefined): string =>
  sigma_m === undefined ? 'that of the plan' : `${sigma_m}`;

/// At most fifteen lines; the last says how many more there are.
export function differences(mine: Plan, theirs: Plan): Difference[] {
  const out: Difference[] = [],
    put = (name: string, a: string, b: string): void => {
      if (a !== b) out.push({ name, mine: a, theirs: b });
    };
  put('Name', mine.name, theirs.name);
  put('Building height', `${fixed(mine.building_height_m, 1)} m`, `${fixed(theirs.building_height_m, 1)} m`);
  for (const [name, a, b] of [
    ['Outline', mine.outline, theirs.outline],
    ['Fence', mine.fence, theirs.fence],
  ] as const)
    if (!same(a, b)) out.push({ name, mine: corners_words(a, b)[0], theirs: corners_words(a, b)[1] });
  for (let i = 0; i < Math.max(mine.no_fly.length, theirs.no_fly.length); i++) {
    const [a, b] = [mine.no_fly[i] ?? [], theirs.no_fly[i] ?? []];
    if (!same(a, b))
      out.push({ name: `No-fly ${i + 1}`, mine: corners_words(a, b)[0], theirs: corners_words(a, b)[1] });
  }
  const word = (v: Settings[keyof Settings]): string =>
    v === null ? 'none' : typeof v === 'number' ? String(Number(v.toFixed(3))) : String(v);
  const keys = [...new Set([...Object.keys(mine.settings), ...Object.keys(theirs.settings)])] as (keyof Settings)[];
  for (const key of keys.sort())
    put(
      key
        .replace(/_(m|s|mps)$/, (_, u: string) => `, ${u === 'mps' ? 'm/s' : u}`)
        .replaceAll('_', ' ')
        .replace(/^./, (c) => c.toUpperCase()),
      word(mine.settings[key] ?? SETTINGS[key].default),
      word(theirs.settings[key] ?? SETTINGS[key].default),
    );
  put('Expected anchors', mine.expected.join(', ') || 'none', theirs.expected.join(', ') || 'none');
  for (const id of Object.keys({ ...mine.targets, ...theirs.targets }).sort())
    put(`Target sigma of ${id}, m`, target_word(mine.targets[id]), target_word(theirs.targets[id]));
  put('Waypoints', String(mine.waypoints.length), String(theirs.waypoints.length));
  for (let i = 0; i < Math.max(mine.waypoints.length, theirs.waypoints.length); i++) {
    const [a, b] = [mine.waypoints[i], theirs.waypoints[i]];
    if (!same(a, b))
      out.push({
        name: `Waypoint ${i + 1}`,
        mine: a ? (b ? waypoint_words(a, b) : 'only here') : 'not there',
        theirs: b ? (a ? waypoint_words(b, a) : 'only here') : 'not there',
      });
  }
  return out.length <= SHOWN_MAX
    ? out
    : [...out.slice(0, SHOWN_MAX - 1), { name: `And ${out.length - SHOWN_MAX + 1} more`, mine: '', theirs: '' }];
}
