import { describe, expect, it } from 'vitest';
import { grid, procedure, STEPS, turn } from '../src/live/flight_messages';
import { ranks } from '../src/views/flight/picture';
import { missed_words, next_step, stage_of, STEP_WORDS, TRACK } from '../src/views/flight/words';

describe('a message of the procedure', () => {
  it('needs its mission only, the rest is unknown', () => {
    expect(procedure({})).toBeNull();
    expect(procedure({ mission: 'm' })).toMatchObject({
      step: 'ready',
      status: 'ready',
      target: null,
      drone: null,
      control: null,
      commands: [],
    });
  });
  it('never takes an unknown word for a state', () =>
    expect(procedure({ mission: 'm', step: 'loop', status: '<b>', commands: [{ state: 'maybe' }] })).toMatchObject({
      step: 'ready',
      status: 'ready',
      commands: [{ state: 'sent' }],
    }));
  it('says whose height lies at an edge, and who is too far for a height search', () => {
    const p = procedure({
      mission: 'm',
      anchors: [
        { network_id: '0x1', height_at_edge: true, no_lobe: false },
        { network_id: '0x2', height_at_edge: null, no_lobe: true },
        { network_id: '0x3' },
      ],
    })!;
    expect(p.anchors.map((a) => [a.at_edge, a.no_lobe])).toEqual([
      [true, false],
      [false, true],
      [false, false],
    ]);
  });
  it('shows the telemetry that the autopilot refuses', () =>
    expect(
      procedure({ mission: 'm', drone: { streams_refused: ['SYS_STATUS: unsupported'] } })!.drone!.streams_refused,
    ).toEqual(['SYS_STATUS: unsupported']));
  it('shows why nobody is followed on the link', () =>
    expect(procedure({ mission: 'm', drone: { link_trouble: 'two autopilots' } })!.drone!.link_trouble).toBe(
      'two autopilots',
    ));
  it('drops the choice of a decision whose candidates did not all arrive whole', () => {
    const c = { lon: 1, lat: 2, value: 3 };
    expect(grid({ mission: 'm', candidates: [c, c], chosen: 1 })!.chosen).toBe(1);
    expect(grid({ mission: 'm', candidates: [{ lat: 2 }, c], chosen: 1 })!.chosen).toBeNull();
  });
  it('keeps the samples of a turn that are pairs of numbers', () =>
    expect(turn({ mission: 'm', anchor: '0x1', samples: [[1, -80], [2], 'x', [3, null]] })!.samples).toEqual([
      [1, -80],
    ]));
});

describe('the track of the procedure', () => {
  it('has eleven stages, and every step but hold has one', () => {
    expect(TRACK).toHaveLength(11);
    expect(STEPS.filter((s) => stage_of(s) < 0)).toEqual(['hold']);
  });
  it('has words for every step, and an end', () => {
    for (const s of STEPS) expect(STEP_WORDS[s]).toMatch(/^\w/);
    expect(next_step('done')).toBeNull();
  });
});

describe('ranks of candidates', () => {
  it('are 0 for the best, 5 for the worst, none where refused', () =>
    expect(
      ranks([
        { value: 1, refused: null },
        { value: 7, refused: null },
        { value: 4, refused: null },
        { value: 2, refused: 'visited' },
      ]),
    ).toEqual([0, 5, 3, null]));
  it('are all best where all are equal', () =>
    expect(
      ranks([
        { value: 2, refused: null },
        { value: 2, refused: null },
      ]),
    ).toEqual([0, 0]));
});

describe('a flight that is done', () => {
  it('says so where anchors did not reach what was wanted: a plan flown to its end is not yet its goal', () => {
    expect(missed_words('done', { done: 6, gave_up: 0, total: 6 })).toBe('');
    expect(missed_words('done', { done: 4, gave_up: 2, total: 6 })).toBe(
      'The plan is flown, but 2 of 6 anchors did not reach the accuracy that was wanted.',
    );
    expect(missed_words('done', { done: 0, gave_up: 6, total: 6 })).toMatch(/no anchor reached .*: 6 of 6 given up/);
    expect(missed_words('running', { done: 0, gave_up: 5, total: 6 })).toBe('');
    expect(missed_words('aborted', { done: 0, gave_up: 5, total: 6 })).toBe('');
  });
});
