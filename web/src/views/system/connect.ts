/// Connecting devices as steps, each with what is there and what to do next. No DOM.
import type { Device, Found, Radio } from '../../api/devices';
import { of_ranges, type Standing } from './standing';

export interface Step {
  readonly id: 'find' | 'tag' | 'rover' | 'corrections' | 'radio';
  readonly title: string;
  readonly state: 'done' | 'now' | 'later';
  readonly what: string;
  readonly todo: string;
  readonly device: string | null; // whose step it is
}
interface Driven {
  readonly d: Device;
  readonly s: Standing;
}

const FIX: Readonly<Record<string, string>> = {
  none: 'no fix',
  single: 'SINGLE',
  dgps: 'DGPS',
  float: 'FLOAT',
  fixed: 'FIX',
};

type Checked = Omit<Step, 'state'> & { readonly done: boolean };

/// One of them, the one that is well first.
const best = (rows: readonly Driven[], wanted: (d: Device) => boolean): Driven | undefined =>
  [...rows.filter((r) => wanted(r.d) && r.d.enabled)].sort(
    (a, b) => Number(b.s.tone === 'ok') - Number(a.s.tone === 'ok'),
  )[0];

function of_device(id: 'tag' | 'rover', title: string, row: Driven | undefined, missing: string): Checked {
  return {
    id,
    title,
    done: row?.s.tone === 'ok',
    what: row ? `${row.d.name}: ${row.s.what || row.s.word}` : missing,
    todo: row ? row.s.todo : 'Choose it among what was found, or press Add a device.',
    device: row?.d.id ?? null,
  };
}

export function connect_steps(
  rows: readonly Driven[],
  found: readonly Found[] | null,
  radios: Readonly<Record<string, Radio>>,
): Step[] {
  const of_kind = (kind: string): Driven | undefined => best(rows, (d) => d.kind === kind),
    tag = best(rows, of_ranges),
    pozyx = of_kind('pozyx'), // the one kind whose radio can be read
    rover = of_kind('gnss'),
    caster = of_kind('ntrip'),
    fix = rover?.d.rover?.fix ?? null,
    radio = pozyx?.d.id ? radios[pozyx.d.id] : undefined,
    asked = radio?.devices.length ?? 0,
    alike = radio?.devices.filter((p) => p.done).length ?? 0,
    corrected = fix === 'float' || fix === 'fixed';
  const checked: Checked[] = [
    {
      id: 'find',
      title: 'Find the devices',
      done: rows.length > 0,
      what: rows.length
        ? `${rows.length} device${rows.length === 1 ? '' : 's'} set up`
        : found
          ? `${found.length} port${found.length === 1 ? '' : 's'} answered`
          : 'No discovery has been run yet',
      todo: found ? 'Choose each device in the list, and add it.' : 'Plug in tag and receiver, then press Discover.',
      device: null,
    },
    of_device('tag', 'The tag measures', tag, 'No UWB tag is set up'),
    of_device('rover', 'The RTK receiver has a position', rover, 'No RTK receiver is set up'),
    {
      id: 'corrections',
      title: 'Corrections arrive',
      done: corrected,
      what: rover
        ? `${rover.d.name}: ${fix === null ? 'no position yet' : FIX[fix]}${caster ? `; ${caster.d.name}: ${caster.s.word}` : ''}`
        : 'Corrections need a receiver',
      todo: corrected
        ? ''
        : caster
          ? caster.s.todo || 'Give the receiver a clear sky: FLOAT comes within a minute, FIX within a few.'
          : 'Add an NTRIP caster, or let the receiver take corrections of its own base by radio.',
      device: caster?.d.id ?? rover?.d.id ?? null,
    },
    {
      id: 'radio',
      title: 'Tag and anchors share their radio settings',
      done: asked > 0 && alike === asked,
      what: asked ? `${alike} of ${asked} anchors have the settings of the tag` : 'Not compared yet',
      todo: asked
        ? 'Open Radio: it sets all of them, verifies the settings, and restores the old ones if that fails.'
        : 'Open Radio, and compare with the anchors: it takes up to 15 s.',
      device: pozyx?.d.id ?? null,
    },
  ];
  if (tag && !pozyx) checked.pop();
  const first = checked.findIndex((s) => !s.done);
  return checked.map(({ done, ...s }, i) => ({ ...s, state: done ? 'done' : i === first ? 'now' : 'later' }));
}
