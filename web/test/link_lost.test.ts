/// While the link is lost no live value is shown as current: whoever reads live state stands in this table, with what strikes it.
import { readdirSync, readFileSync } from 'node:fs';
import { describe, expect, it } from 'vitest';

/// `frame`: in a view that the frame strikes as a whole (`.lost` in style/shell.css; AGES in ui/app.tsx). `asks`: strikes its own values, since the
/// frame does not, or not all of them. `none`: shows no value of it.
const STRUCK_BY: Readonly<Record<string, 'frame' | 'asks' | 'none'>> = {
  'ui/alarms.tsx': 'asks',
  'ui/app.tsx': 'none', // whether the aircraft is in the air
  'ui/keyboard.ts': 'none',
  'ui/strip.tsx': 'asks',
  'views/anchor_card.tsx': 'asks',
  'views/anchor_detail.tsx': 'frame',
  'views/anchors.tsx': 'asks',
  'views/compare_calibrations.tsx': 'frame',
  'views/convergence.tsx': 'frame',
  'views/events.tsx': 'frame',
  'views/flight/after_landing.tsx': 'frame',
  'views/flight/commands.tsx': 'asks',
  'views/flight/devices_note.tsx': 'asks',
  'views/flight/lease.ts': 'none',
  'views/flight/picture.ts': 'none', // drawn by the maps, which ask `Content.link_lost`
  'views/flight/procedure.tsx': 'asks',
  'views/flight/recording.tsx': 'asks',
  'views/live.tsx': 'asks',
  'views/measurements/use_take.ts': 'frame',
  'views/plan/on_ground.tsx': 'asks',
  'views/plan/plan.tsx': 'asks',
  'views/plan/use_plan.ts': 'none', // where to draw, and whether a plan is flown
  'views/publish.tsx': 'frame',
  'views/range_list.tsx': 'asks',
  'views/system/flights.tsx': 'frame',
  'views/system/radio.tsx': 'frame',
  'views/system/radios_in_range.tsx': 'frame',
  'views/system/system.tsx': 'frame',
};
const src = new URL('../src/', import.meta.url),
  files = readdirSync(src, { recursive: true, encoding: 'utf8' }).filter((f) => /\.tsx?$/.test(f)),
  read = (f: string): string => readFileSync(new URL(f, src), 'utf8'),
  imported = (text: string): string => [...text.matchAll(/import[^;]*?from '[^']*state\/store';/g)].join(' ');
const LIVE =
  /\b(current_scene|watched_scene|scenes|current_mission|watched_mission|mission_list|system|devices|events|server_alarms)\b/;
const ASKS = /watched_lost\(\)|link\.(value|peek\(\)) === 'lost'/;

describe('a link that is lost', () => {
  it('is known to everything outside of the state that reads live values', () => {
    const readers = files.filter((f) => !/^(state|live)\//.test(f) && LIVE.test(imported(read(f))));
    expect(readers.sort()).toEqual(Object.keys(STRUCK_BY).sort());
  });
  it('is asked for by whoever strikes its own values', () => {
    for (const [file, by] of Object.entries(STRUCK_BY))
      if (by === 'asks') expect(ASKS.test(read(file)), file).toBe(true);
  });
  it('is given to every map and elevation as it is, never as a constant', () => {
    for (const file of files) expect(/link_lost: (false|true)/.test(read(file)), file).toBe(false);
  });
  it('strikes by the frame every view that has components which leave it to the frame', () => {
    const ages = /const AGES[^;]*/.exec(read('ui/app.tsx'))![0];
    for (const view of ['live', 'anchors', 'measurements', 'models', 'system']) expect(ages).toContain(`'${view}'`);
    // The other two strike what they have of now themselves.
    for (const view of ['plan/', 'replay/'])
      for (const [file, by] of Object.entries(STRUCK_BY))
        if (file.startsWith(`views/${view}`)) expect(by, file).not.toBe('frame');
  });
});
