import { expect, it } from 'vitest';
import { device_of, type Radio } from '../src/api/devices';
import { connect_steps } from '../src/views/system/connect';
import type { Standing } from '../src/views/system/standing';

const well: Standing = { shape: 'ok', tone: 'ok', word: 'LIVE', what: '12 ranges a second', todo: '', command: '' };
const ill: Standing = {
  shape: 'bad',
  tone: 'bad',
  word: 'NO RANGES',
  what: 'no range for 8 s',
  todo: 'Move nearer.',
  command: '',
};
const row = (kind: string, s: Standing, more: object = {}) => ({
  d: device_of({ id: kind, kind, name: `my ${kind}`, ...more }),
  s,
});
const states = (...given: Parameters<typeof connect_steps>): string[] =>
  connect_steps(...given).map((s) => `${s.id} ${s.state}`);

it('begins with looking for devices, and only one step is next', () => {
  expect(states([], null, {})).toEqual(['find now', 'tag later', 'rover later', 'corrections later', 'radio later']);
  expect(connect_steps([], null, {})[0]!.todo).toMatch(/press Discover/);
  expect(connect_steps([], [], {})[0]!.what).toBe('0 ports answered');
});
it('shows what a device that is connected lacks, and what to do', () => {
  const steps = connect_steps([row('pozyx', ill)], null, {});
  expect(steps[1]).toMatchObject({ state: 'now', what: 'my pozyx: no range for 8 s', todo: 'Move nearer.' });
});
it('is over when tag, position, corrections and radio settings are good', () => {
  const rover = { t_us: 1, fix: 'fixed' as const, satellites: 20, age_s: 1, sigma_h_m: 0.01, sigma_v_m: 0.02 },
    rows = [row('pozyx', well), row('gnss', well, { rover })],
    radio = (done: boolean) => ({ pozyx: { devices: [{ network_id: '0x1', done, why: '' }] } as unknown as Radio });
  expect(states(rows, null, {}).at(-1)).toBe('radio now');
  expect(states(rows, null, radio(false)).at(-1)).toBe('radio now');
  expect(states(rows, null, radio(true)).every((s) => s.endsWith(' done'))).toBe(true);
  const single = [row('pozyx', well), row('gnss', well, { rover: { ...rover, fix: 'single' as const } })];
  expect(connect_steps(single, null, {})[3]).toMatchObject({ state: 'now', what: 'my gnss: SINGLE' });
});
it('takes a tag of another maker for the tag, and compares no radio that it cannot read', () => {
  const steps = connect_steps([row('dwm1001', well)], null, {});
  expect(steps[1]).toMatchObject({ id: 'tag', state: 'done' });
  expect(steps.map((s) => s.id)).not.toContain('radio');
  expect(states([row('dwm1001', well), row('pozyx', ill)], null, {}).at(-1)).toBe('radio later');
});
