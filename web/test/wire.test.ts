import { readFileSync, readdirSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import { describe, expect, it } from 'vitest';
import { calibration_of, rows_of_collection } from '../src/api/anchors';
import { problem_of } from '../src/api/client';
import * as f from '../src/live/flight_messages';
import * as m from '../src/live/messages';

const folder = fileURLToPath(new URL('../../tests/data/wire/', import.meta.url));
const wire = <T = unknown>(name: string): T => JSON.parse(readFileSync(`${folder}${name}.json`, 'utf8')) as T;

describe('guards of the stream', () => {
  const guards: Record<string, (v: unknown) => unknown> = {
    'drone.pose': m.pose,
    'rtk.status': m.rtk,
    ranges: m.range,
    'anchors.estimates': m.estimate,
    'mission.state': m.mission,
    devices: m.device,
    system: m.system,
    events: m.event,
    alarms: m.alarm,
    revisions: m.revision,
  };
  // The flight's own topics are renamed on the way in; what they say is looked at below.
  const flight: Record<string, (v: unknown) => unknown> = {
    procedure: f.procedure,
    'mission.grid': f.grid,
    'mission.turn': f.turn,
    'mission.height': f.height,
  };
  // What the page does not read.
  const unread: Record<string, readonly string[]> = { ranges: ['tag_enu_m', 'residual_m'], alarms: ['mission'] },
    topics = readdirSync(folder).filter((name) => /^topic\.(?!jobs|fixes)/.test(name)),
    of_flight = (name: string): string | undefined => Object.keys(flight).find((t) => name === `topic.${t}.json`);
  it.each(topics.filter(of_flight))('let %s through, nothing of it unknown', (file) => {
    const seen = flight[of_flight(file)!]!(wire(file.replace('.json', ''))) as Record<string, unknown>,
      given = wire<Record<string, unknown>>(file.replace('.json', ''));
    expect(seen).toMatchObject({ mission: given.mission, t_us: given.t_us });
    for (const [key, v] of Object.entries(given))
      if (v !== null && key in seen) expect([key, seen[key]]).not.toEqual([key, null]);
    for (const list of ['candidates', 'samples', 'commands', 'anchors'])
      if (Array.isArray(given[list])) expect(seen[list]).toHaveLength((given[list] as unknown[]).length);
  });
  it.each(topics.filter((name) => !of_flight(name)))('let %s through with every field that the page reads', (file) => {
    const topic = Object.keys(guards).find((t) => file.startsWith(`topic.${t}.`) || file === `topic.${t}.json`)!;
    const given = wire(file.replace('.json', ''));
    for (const one of Array.isArray(given) ? given : [given]) {
      const read = Object.entries(one as object).filter(([key]) => !unread[topic]?.includes(key));
      expect(guards[topic]!(one)).toMatchObject(Object.fromEntries(read));
    }
  });
  it('make a missing or wrong field unknown instead of a number', () => {
    const e = m.estimate({
      anchor: '0x6a2f',
      h95_m: 'wide',
      enu_m: [1, 2],
      cov_enu_m2: [1, 2, 3, 4, 5, null],
      gdop: NaN,
    })!;
    expect([e.h95_m, e.enu_m, e.cov_enu_m2, e.gdop, e.verdict]).toEqual([null, null, null, null, 'too_few']);
  });
  it('drop a message without its key, and keep the others of its batch', () => {
    expect(m.all([{ distance_m: 3 }, null, 'x', { t_us: 1, anchor: '0x1', distance_m: 3 }], m.range)).toHaveLength(1);
  });
  it('tolerate enum values they do not know yet', () => {
    expect(m.estimate({ anchor: '0x1', status: 'levitating' })!.status).toBe('estimating');
    expect(m.pose({ t_us: 1, fix: 'quantum' })!.fix).toBe('none');
  });
});

describe('REST answers', () => {
  it('read a published anchor with both accuracies and its frame', () => {
    const { rows, revision } = rows_of_collection(wire('rest.anchors.published'));
    expect(revision).toBe(7);
    expect(rows[0]).toMatchObject({
      anchor: '0x6a2f',
      name: 'Hall A north-west',
      status: 'accepted',
      lat: 51.023123457,
      lon: 3.713123457,
      h95_m: 0.054,
      absolute_h95_m: 0.057,
      n_ranges: 412,
    });
    expect(rows[0]!.crs).toBe('ETRS89, epoch 2026.34, base known point σ 8 mm');
  });
  it('read an empty collection before the first publication', () => {
    expect(rows_of_collection({ type: 'FeatureCollection', features: [], revision: null })).toEqual({
      rows: [],
      revision: null,
    });
  });
  it('read a calibration with its ambiguous anchor and the twin', () => {
    const c = calibration_of(wire('rest.calibration'))!;
    expect(c.rows.map((r) => [r.anchor, r.verdict])).toEqual([
      ['0x6a2f', 'ok'],
      ['0x6a3c', 'ambiguous'],
    ]);
    expect(c.rows[1]!.mirror).toMatchObject({ lat: 51.023251457, probability: 0.12 });
    expect(c.rows[1]!.probability).toBeCloseTo(0.88, 12);
  });
  it('take a job for what it is: not a calibration yet', () => expect(calibration_of(wire('topic.jobs'))).toBeNull());
  it('turn any failure into a problem with a title', () => {
    expect(problem_of(wire('rest.problem'), 422).errors).toHaveLength(2);
    expect(problem_of(null, 502).title).toBe('The server answered 502');
    expect(problem_of('<html>', 0).title).toBe('No answer from anchord');
  });
});

describe('missions of REST', () => {
  it('become what the stream would have said of them', async () => {
    const { mission_of_rest } = await import('../src/state/archive');
    expect(mission_of_rest(wire('rest.mission'))).toMatchObject({
      mission: '0197a3b0-5d10-7b1e-9c55-0a1b2c3d4e5f',
      name: 'Demonstration flight',
      state: 'recording',
      frame: 'wgs84',
      n_ranges: 4120,
      started_us: Date.UTC(2026, 4, 4, 10, 9, 12, 345) * 1000,
    });
  });
});
