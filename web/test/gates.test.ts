import { readFileSync } from 'node:fs';
import { describe, expect, it } from 'vitest';
import { row_of, row_of_estimate } from '../src/api/anchors';
import { estimate } from '../src/live/messages';
import { gate_limit, gate_line, gate_sentence, gate_value } from '../src/ui/gates';
import { why_not_done } from '../src/ui/words';
import { STATUS_LOOK } from '../src/ui/marks';

const gate = (name: string, value: number | null, limit: number, passed: boolean) => ({
  name,
  value,
  limit,
  passed,
  why: '',
});

describe('a gate is a sentence that is true as it stands', () => {
  it('with value, sign, limit and unit', () => {
    expect(gate_line(gate('halves', 21.34, 16.27, false))).toBe(
      'The two halves of the flight disagree: χ² 21.3 (limit ≤ χ² 16.3)',
    );
    expect(gate_line(gate('halves', 3.2, 16.27, true))).toMatch(/^The two halves of the flight agree: /);
    expect(gate_line(gate('goal_h95_m', 0.31, 0.2, false))).toBe(
      'Accuracy goal not reached, 95 % horizontal: 0.31 m (limit ≤ 0.20 m)',
    );
  });
  it('in percent where it is a share, with the sign of a lower limit', () => {
    expect(gate_line(gate('side', 0.93, 0.99, false))).toBe('The mirror solution is not excluded: 93 % (limit ≥ 99 %)');
    expect(gate_line(gate('rejected', 0.0667, 0.5, true))).toBe('Few ranges are rejected: 6.7 % (limit ≤ 50 %)');
    expect(gate_line(gate('redundancy', 12, 30, false))).toBe('Too few ranges for the unknowns: 12 (limit ≥ 30)');
  });
  it('for every gate that the report has words for', () => {
    const report = readFileSync(new URL('../../api/formats/report_sections.cpp', import.meta.url), 'utf8'),
      names = [...report.matchAll(/GateWords\{"([a-z_0-9]+)"/g)].map(([, name]) => name!);
    expect(names.length).toBeGreaterThan(20);
    expect(names.filter((name) => gate_sentence(gate(name, 1, 2, true)).endsWith(': passed'))).toEqual([]);
  });
  it('with as many digits as keep a failed value from its limit', () => {
    const close = gate('goal_h95_m', 0.2004, 0.2, false);
    expect(gate_value(close)).not.toBe(gate_limit(close).replace('≤ ', ''));
  });
  it('that says when nothing was measured, or what it does not know', () => {
    expect(gate_value(gate('halves', null, 16.27, false))).toBe('not measured');
    expect(gate_line(gate('new_check', 2, 1, false))).toBe('New check: failed: 2 (limit ≤ 1)');
  });
});

describe('the gates of a running estimate', () => {
  const running = estimate({
    mission: 'm',
    anchor: '0x1',
    t_us: 1,
    status: 'estimating',
    verdict: 'ok',
    reason: '',
    gates: [gate('redundancy', 300, 30, true), gate('goal_h95_m', 0.31, 0.2, false), { nothing: 1 }],
  })!;
  it('are those of the server, and say why it is not done', () => {
    expect(row_of_estimate(running).gates.map((g) => g.name)).toEqual(['redundancy', 'goal_h95_m']);
    expect(why_not_done(running)!.text).toContain('0.31 m (limit ≤ 0.20 m)');
  });
  it('say what holds an accurate answer back, and what to do', () => {
    const why = 'the two halves of the flight place it 1.80 m apart';
    const held = {
      ...running,
      gates: [gate('goal_h95_m', 0.31, 0.2, false), { ...gate('halves', 40, 16, false), why }],
    };
    expect(why_not_done(held)).toEqual({
      title: 'Why not done: it fails an acceptance gate',
      text: 'The two halves of the flight disagree: χ² 40.0 (limit ≤ χ² 16.0). The two halves of the flight place it 1.80 m apart.',
    });
  });
  it('name what the ranges contradict, also of an anchor that is done', () => {
    const reason =
      'the height 8.00 m above the origin (of a height search, or given) disagrees with the ranges, 5.10 m (5.8 sigma)';
    expect(why_not_done({ ...running, gates: [], reason })!.text).toContain('8.00 m above the origin');
    expect(why_not_done({ ...running, gates: [], status: 'converged', reason })!.text).toContain(
      'disagrees with the ranges, 5.10 m',
    );
    expect(why_not_done({ ...running, gates: [], status: 'converged' })).toBeNull();
  });
  it('of a calibration decide whether it is green', () => {
    const row = (acceptable: boolean) =>
      row_of({ network_id: '0x1', quality: { verdict: 'ok', acceptable, gates: [] } }, null)!.status;
    expect(row(true)).toBe('passes'); // green only when held against the goal
    expect(STATUS_LOOK[row(true)][1]).not.toBe('ok');
    expect(row(false)).toBe('withheld');
  });
});
