import { describe, expect, it } from 'vitest';
import { over_goal_words, row_of } from '../src/api/anchors';
import { STATUS_LOOK } from '../src/ui/marks';
import { largest_part } from '../src/views/largest_part';
import { why_not_done } from '../src/ui/words';

const published = (more: object) =>
  row_of(
    {
      network_id: '0x6a21',
      name: 'Hall A',
      status: 'accepted',
      quality: { verdict: 'ok', reason: '', acceptable: true, gates: [] },
      ...more,
    },
    { type: 'Point', coordinates: [4.7, 50.88, 80] },
  )!;

describe('a published anchor', () => {
  it('is accepted where nothing contradicts it', () => {
    expect(published({}).status).toBe('accepted');
    expect(published({}).contradiction).toBe('');
    expect(why_not_done(published({}))).toBeNull();
  });
  it('has moved where a later flight found it elsewhere, and says how far', () => {
    const text = '0x6a21: the flight of 2026-01-08 found it 30.00 m from its published position';
    const row = published({ status: 'contradicted', contradiction: { text } });
    expect(row.status).toBe('moved');
    expect(why_not_done(row)?.text).toContain('30.00 m from its published position');
  });
  it('has the sources of its error budget, the largest first, without those nobody stated', () => {
    const budget = {
      sources: { ranging: { share: 0.2 }, geometry: { share: 0.5 }, lever_arm: { share: 0.3 }, base: null },
      help_text: 'points at another height',
    };
    expect(published({ budget }).budget).toEqual({
      shares: [
        { source: 'geometry', share: 0.5 },
        { source: 'lever_arm', share: 0.3 },
        { source: 'ranging', share: 0.2 },
      ],
      help: 'points at another height',
    });
    expect(published({ budget: null }).budget).toBeNull();
    expect(largest_part(published({ budget }).budget)).toBe(
      'The largest part of its uncertainty is the geometry of the flight (50 %). What would help most: points at another height.',
    );
    expect(largest_part(null)).toBe('');
  });
  it('is told once what would help, by the server where it knows', () => {
    const reason =
      'not within the accuracy goal: 95 % horizontal 0.51 m (goal 0.30 m); the largest part of its uncertainty is the lever arm (80 %),' +
      ' and what would help most: measure the lever arm';
    const text = why_not_done({
      ...published({ quality: { verdict: 'ok', reason, gates: [] } }),
      status: 'found',
    })?.text;
    expect(text).toBe(`N${reason.slice(1)}.`);
  });
});

describe('an anchor of a calibration', () => {
  const limit = (name: string, value: number, limit: number) => ({
      name,
      value,
      limit,
      passed: value <= limit,
      why: '',
    }),
    target = (sigma_m: number) => ({
      source: 'anchor_target',
      words: 'target of the anchor in the flown plan, sigma of the position 3 m',
      reached: sigma_m <= 3,
      limits: [limit('target_sigma_m', sigma_m, 3)],
    }),
    of = (goal: object | null, acceptable = true) =>
      published({ status: undefined, goal, quality: { verdict: 'ok', acceptable } }),
    look = (goal: object | null) => STATUS_LOOK[of(goal).status][1];
  it('is green within the goal that the server names, amber over it', () => {
    expect(of(target(2.9)).status).toBe('within_goal');
    expect(look(target(2.9))).toBe('ok');
    expect(over_goal_words(of(target(2.9)))).toBe('');
    expect(of(target(3.21)).status).toBe('over_goal');
    expect(look(target(3.21))).toBe('caution');
    expect(over_goal_words(of(target(3.21)))).toBe(
      'over the target of the anchor in the flown plan, sigma of the position 3 m: 3.21 m',
    );
  });
  it('names every limit of the site that it is over', () => {
    const site = {
      source: 'site',
      words: 'goal of the site, 95 % 0.2 m horizontal and 0.4 m vertical',
      reached: false,
      limits: [limit('goal_h95_m', 0.21, 0.2), limit('goal_v95_m', 0.3, 0.4)],
    };
    expect(over_goal_words(of(site))).toBe(
      'over the goal of the site, 95 % 0.2 m horizontal and 0.4 m vertical: 0.21 m',
    );
  });
  it('is never green where nobody named a goal, and withheld whatever its accuracy', () => {
    expect(look(null)).not.toBe('ok');
    expect(of(target(0.01), false).status).toBe('withheld');
  });
});
