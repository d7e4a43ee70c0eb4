/// What a change of plan does, in sentences. No DOM.
import type { PlanDifference } from '../../api/plans';
import { fixed } from '../../ui/format';

type Waypoint = PlanDifference['waypoints'][number];
type Area = PlanDifference['areas'][number];
type Target = PlanDifference['anchor_targets'][number];
type Setting = PlanDifference['settings'][number];

const AREA: Record<Area['area'], string> = { outline: 'Outline', fence: 'Fence', no_fly: 'No-fly area' };
const CHANGED: Record<Area['change'], string> = {
  added: 'added',
  removed: 'removed',
  moved: 'changed',
  altered: 'changed',
};

function waypoint_words({ change, before, after, moved_m, passed }: Waypoint): string {
  const late = passed ? ', already passed: not flown' : '';
  switch (change) {
    case 'added':
      return `Waypoint ${after} added${late}`;
    case 'removed':
      return `Waypoint ${before} of the flown plan removed`;
    case 'moved':
      return `Waypoint ${after} moved by ${fixed(moved_m, 2)} m${late}`;
    case 'altered':
      return `Waypoint ${after}: heading, dwell or what is done there differs${late}`;
  }
}
const area_words = ({ area, change, before, after }: Area): string => {
  const n = after ?? before;
  return `${AREA[area]}${n === null ? '' : ` ${n}`} ${CHANGED[change]}`;
};
const UNITS: readonly (readonly [string, string])[] = [
  ['_mps', 'm/s'],
  ['_deg', '°'],
  ['_m', 'm'],
  ['_s', 's'],
];
/// "target_sigma_m" from 0.05 to 0.02 is "Target sigma 0.05 m, now 0.02 m".
function setting_words({ name, before, after }: Setting): string {
  const [suffix, unit] = UNITS.find(([end]) => name.endsWith(end)) ?? ['', ''],
    plain = name.slice(0, name.length - suffix.length).replaceAll('_', ' ');
  const word = (v: Setting['before']): string =>
    v === null
      ? 'none'
      : typeof v === 'boolean'
        ? v
          ? 'on'
          : 'off'
        : typeof v === 'number' && name === 'min_battery'
          ? `${fixed(v * 100, 0)} %`
          : `${v}${unit && ` ${unit}`}`;
  return `${plain.charAt(0).toUpperCase()}${plain.slice(1)} ${word(before)}, now ${word(after)}`;
}

const target_words = ({ network_id, before, after }: Target): string => {
  const word = (v: number | null): string => (v === null ? 'that of the plan' : `${v} m`);
  return `Target sigma of ${network_id}: ${word(before)}, now ${word(after)}`;
};

export const difference_lines = (d: PlanDifference): string[] => [
  ...d.waypoints.map(waypoint_words),
  ...d.areas.map(area_words),
  ...(d.anchors_added.length ? [`Expected as well: ${d.anchors_added.join(', ')}`] : []),
  ...(d.anchors_removed.length ? [`No longer expected: ${d.anchors_removed.join(', ')}`] : []),
  ...d.anchor_targets.map(target_words),
  ...d.settings.map(setting_words),
];
export const next_words = (d: PlanDifference): string =>
  d.next_waypoint > d.n_waypoints
    ? 'No waypoint is left: it returns after this one'
    : `From waypoint ${d.next_waypoint} of ${d.n_waypoints} on`;
