import { describe, expect, it } from 'vitest';
import { row_of } from '../src/api/anchors';
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
