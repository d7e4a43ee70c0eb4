import { expect, it } from 'vitest';
import { came_of } from '../src/views/start/came_of';

const rest = { digest: 'sha256:', rows: {}, added: {}, left_out: [] };
it('says of a flight whether it is new, and where to see it', () => {
  const came = came_of({ ...rest, mission: 'm1', already: false, left_out: [{ what: 'revision 3', why: 'others' }] });
  expect(came.words).toMatch(/on this server, with its calibrations/);
  expect(came.flights).toEqual([{ mission: 'm1', name: 'Replay', already: false }]);
  expect(came.left_out).toEqual([{ what: 'revision 3', why: 'others' }]);
  expect(came_of({ ...rest, mission: 'm1', already: true }).words).toMatch(/already/);
});
it('says of a site how many of its flights are new, and names what stayed out of each', () => {
  const flight = (mission: string, name: string, already: boolean, why: string[] = []) => ({
    mission,
    name,
    already,
    rows: {},
    added: {},
    left_out: why.map((w) => ({ what: 'plan', why: w })),
  });
  const came = came_of({
    ...rest,
    site: 's',
    already: false,
    flights: [flight('m1', 'north', true, ['edited here']), flight('m2', '', false)],
  });
  expect(came.words).toBe('The site is on this server: 1 flight of 2 new.');
  expect(came.flights.map((f) => f.name)).toEqual(['north', 'm2']);
  expect(came.left_out).toEqual([{ what: 'plan', why: 'edited here' }]);
  expect(came_of({ ...rest, site: 's', already: true, flights: [flight('m1', 'n', true)] }).words).toBe(
    'This site was already on this server with its 1 flight.',
  );
});
