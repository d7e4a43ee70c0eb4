import { describe, expect, it } from 'vitest';
import { event } from '../src/live/messages';
import {
  AlarmLimiter,
  by_urgency,
  Conditions,
  merged,
  newest_refusal,
  type Alarm,
  type Situation,
} from '../src/ui/alarm_rules';

const calm: Situation = {
  now_ms: 0,
  link: 'live',
  silence_ms: 0,
  data_age_ms: 0,
  slow: false,
  recording: true,
  fix: 'fixed',
  correction_age_s: 1,
  range_silence_ms: 0,
  refused: null,
};
const ids = (list: readonly Alarm[]): string[] => list.map((a) => a.id);

const screen = { mission: 'm', name: (id: string): string => id };
describe('Conditions', () => {
  it('say nothing while all is well', () => expect(new Conditions().standing(calm)).toEqual([]));
  it('raise rtk.lost after 2 s below FLOAT and rtk.float after 5 s of FLOAT', () => {
    const c = new Conditions();
    expect(ids(c.standing({ ...calm, fix: 'single' }))).toEqual([]);
    expect(ids(c.standing({ ...calm, fix: 'single', now_ms: 2000 }))).toEqual(['rtk.lost']);
    expect(ids(c.standing({ ...calm, fix: 'float', now_ms: 3000 }))).toEqual([]);
    expect(ids(c.standing({ ...calm, fix: 'float', now_ms: 8000 }))).toEqual(['rtk.float']);
    expect(ids(c.standing({ ...calm, now_ms: 8100 }))).toEqual([]);
  });
  it('raise cmd.refused for a minute, of the flight that is shown', () => {
    const said = { id: 'e1', t_us: 1_000_000, level: 'warning', code: 'cmd.refused', mission: 'm' },
      refused = newest_refusal([event({ ...said, text: 'start refused: not armed' })!], 'm', 3_000_000);
    expect(newest_refusal([event({ ...said, text: 'start refused: not armed' })!], 'other', 3_000_000)).toBeNull();
    const [a] = new Conditions().standing({ ...calm, now_ms: 9000, refused });
    expect([a!.id, a!.title, a!.since_ms]).toEqual(['cmd.refused', 'Command refused: start: not armed', 7000]);
    expect(ids(new Conditions().standing({ ...calm, refused: { ...refused!, age_ms: 60_000 } }))).toEqual([]);
  });
  it('raise uwb.none after 5 s without a range, but not before the first one', () => {
    const c = new Conditions();
    expect(ids(c.standing({ ...calm, range_silence_ms: Infinity }))).toEqual([]);
    expect(ids(c.standing({ ...calm, range_silence_ms: 5001 }))).toEqual(['uwb.none']);
  });
  it('raise link.lost only while a flight is recorded, and keep the rest as last heard', () => {
    const c = new Conditions();
    c.standing({ ...calm, fix: 'none' });
    c.standing({ ...calm, fix: 'none', now_ms: 2500 });
    const lost = c.standing({ ...calm, fix: 'none', link: 'lost', silence_ms: 6000, data_age_ms: 6000, now_ms: 9000 });
    expect(ids(lost)).toEqual(['link.lost', 'rtk.lost']);
    expect(lost[0]!.since_ms).toBe(3000);
    expect(lost[1]!.title).toContain('when last seen');
    expect(new Conditions().standing({ ...calm, link: 'lost', recording: false })).toEqual([]);
  });
  it('do not blame the tag for a silence of the link, neither during an outage nor right after it', () => {
    const c = new Conditions();
    expect(c.standing(calm)).toEqual([]);
    expect(ids(c.standing({ ...calm, link: 'late', silence_ms: 4000, range_silence_ms: 5100, now_ms: 4000 }))).toEqual(
      [],
    );
    expect(
      ids(
        c.standing({
          ...calm,
          link: 'lost',
          silence_ms: 20_000,
          data_age_ms: 20_000,
          range_silence_ms: 20_100,
          now_ms: 20_000,
        }),
      ),
    ).toEqual(['link.lost']);
    expect(ids(c.standing({ ...calm, range_silence_ms: 20_600, now_ms: 20_500 }))).toEqual([]);
    expect(ids(c.standing({ ...calm, range_silence_ms: 25_600, now_ms: 25_500 }))).toEqual(['uwb.none']);
  });
  it('call a link too slow by its name, and list it as advisory while the server helps itself', () => {
    const lost = new Conditions().standing({ ...calm, link: 'lost', silence_ms: 300, data_age_ms: 8000, now_ms: 9000 });
    expect(lost[0]).toMatchObject({ id: 'link.lost', title: 'Link too slow: data arrives late', since_ms: 1000 });
    const c = new Conditions();
    c.standing({ ...calm, slow: true });
    expect(c.standing({ ...calm, slow: true, now_ms: 2000 })[0]).toMatchObject({ id: 'ws.slow', priority: 'advisory' });
  });
  it('do not count the time of an outage as time of a poor fix', () => {
    const c = new Conditions();
    c.standing({ ...calm, fix: 'float', now_ms: 1000 });
    c.standing({ ...calm, fix: 'float', link: 'lost', silence_ms: 19_000, data_age_ms: 19_000, now_ms: 20_000 });
    expect(ids(c.standing({ ...calm, fix: 'float', now_ms: 21_000 }))).toEqual([]);
    expect(ids(c.standing({ ...calm, fix: 'float', now_ms: 26_100 }))).toEqual(['rtk.float']);
  });
  it('of the server stay in the list while the link is lost, as they were when last seen', () => {
    const server = [
      {
        id: 'disk.low',
        priority: 'warning' as const,
        since_us: 0,
        text: 'Disk is low',
        acknowledged: false,
        mission: null,
      },
    ];
    const [a] = merged([], server, 1, 1, true, screen);
    expect([a!.title, a!.acknowledged]).toEqual(['Disk is low, when last seen', true]);
  });
  it('that name their flight already are left as they are, its name written as it was given', () => {
    const of = (mission: string, text: string) => ({
      id: 'rtk.lost',
      priority: 'critical' as const,
      since_us: 0,
      text,
      acknowledged: false,
      mission,
    });
    const list = merged([], [of('m1', 'east: no position'), of('m2', 'west: no position')], 1, 1, false, {
      mission: 'm1',
      name: (id) => (id === 'm1' ? 'east' : 'west'),
    });
    expect(list.map((a) => a.title)).toEqual(['east: no position', 'west: no position']);
  });
  it('of another flight stand beside those of the flight on the screen, with its name', () => {
    const of = (mission: string | null, id: string, text: string) => ({
      id,
      priority: 'critical' as const,
      since_us: 0,
      text,
      acknowledged: false,
      mission,
    });
    const list = merged(
      [],
      [
        of('m2', 'drone.link', 'aircraft silent'),
        of('m1', 'drone.link', 'aircraft silent for 4 s'),
        of(null, 'disk.low', 'disk is low'),
      ],
      1,
      1,
      false,
      { mission: 'm1', name: (id) => `number ${id}` },
    );
    expect(list.map((a) => [a.id, a.title])).toEqual([
      ['drone.link of m2', 'Flight number m2: Aircraft silent'],
      ['drone.link', 'Aircraft silent for 4 s'],
      ['disk.low', 'Disk is low'],
    ]);
  });
  it('are listed once per id with the word of the server, critical first', () => {
    const own = new Conditions();
    own.standing({ ...calm, fix: 'none' });
    const list = merged(
      own.standing({ ...calm, fix: 'none', now_ms: 3000 }),
      [
        { id: 'disk.low', priority: 'warning', since_us: 0, text: 'Disk is low', acknowledged: false, mission: null },
        {
          id: 'rtk.lost',
          priority: 'critical',
          since_us: 1_000_000,
          text: 'RTK lost at the server',
          acknowledged: true,
          mission: null,
        },
      ],
      3_000_000,
      3000,
      false,
      screen,
    );
    expect(list.map((a) => [a.id, a.title, a.acknowledged])).toEqual([
      ['rtk.lost', 'RTK lost at the server', true],
      ['disk.low', 'Disk is low', false],
    ]);
    expect(list[0]!.since_ms).toBe(1000);
  });
});

describe('the alarm that stands in the line', () => {
  const alarm = (id: string, priority: Alarm['priority'], acknowledged = false, since_ms = 0): Alarm => ({
    id,
    priority,
    title: id,
    advice: '',
    since_ms,
    acknowledged,
  });
  const order = (...list: Alarm[]): string[] => list.sort(by_urgency).map((a) => a.id);
  it('is the gravest that nobody has acknowledged, the oldest of them', () =>
    expect(
      order(
        alarm('uwb.none', 'warning'),
        alarm('rtk.lost', 'critical', true),
        alarm('drone.link', 'critical', false, 5),
        alarm('fence.breach', 'critical', false, 4),
      ),
    ).toEqual(['fence.breach', 'drone.link', 'uwb.none', 'rtk.lost']));
  it('is never advice while an alarm stands, acknowledged or not', () =>
    expect(order(alarm('ws.slow', 'advisory'), alarm('rtk.float', 'warning', true))).toEqual(['rtk.float', 'ws.slow']));
  it('is the lost link whatever else stood: that was seen before', () =>
    expect(order(alarm('drone.link', 'critical'), alarm('link.lost', 'critical', true, 9))).toEqual([
      'link.lost',
      'drone.link',
    ]));
});

describe('AlarmLimiter', () => {
  const alarm = (id: string, priority: Alarm['priority'], acknowledged = false): Alarm => ({
    id,
    priority,
    title: id,
    advice: '',
    since_ms: 0,
    acknowledged,
  });
  const [critical, warning] = [alarm('link.lost', 'critical'), alarm('rtk.float', 'warning')];
  it('repeats a critical alarm every 10 s and a warning never while it stands', () => {
    const l = new AlarmLimiter();
    expect(l.due([critical], 0)).toBe(critical);
    expect(l.due([critical], 9999)).toBeNull();
    expect(l.due([critical], 10_000)).toBe(critical);
    const w = new AlarmLimiter();
    expect(w.due([warning], 0)).toBe(warning);
    expect(w.due([warning], 60_000)).toBeNull();
  });
  it('keeps a flickering warning to once in 30 s', () => {
    const l = new AlarmLimiter();
    expect(l.due([warning], 0)).toBe(warning);
    l.due([], 1000);
    expect(l.due([warning], 2000)).toBeNull();
    l.due([], 29_000);
    expect(l.due([warning], 30_000)).toBe(warning);
  });
  it('sounds one at a time, the most urgent', () =>
    expect(new AlarmLimiter().due([warning, critical], 0)).toBe(critical));
  it('is quiet for advisories and for what was acknowledged', () => {
    expect(new AlarmLimiter().due([alarm('ws.slow', 'advisory'), alarm('x', 'critical', true)], 0)).toBeNull();
  });
  it('is quiet while muted, and until the next critical when asked so', () => {
    const l = new AlarmLimiter();
    l.mute(120_000);
    expect(l.due([critical], 0)).toBeNull();
    expect(l.due([critical], 120_000)).toBe(critical);
    const u = new AlarmLimiter();
    u.mute_until_critical();
    expect(u.due([warning], 0)).toBeNull();
    expect(u.due([warning, critical], 1000)).toBe(critical);
  });
});
