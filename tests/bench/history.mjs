// What a run leaves for the next: ratios only, since times of another machine, or of a busy one, mean little.
import { readdirSync, readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';

const worthNaming = 0.1;

/** How many times as fast as its peer each measured work was, two decimals: {work: peer / ours} of [{work, ours, peer}]. */
export function ratios(measured) {
  return Object.fromEntries(measured.map(({ work, ours, peer }) => [work, Number((peer / ours).toFixed(2))]));
}

/** The newest ratios of a folder of `YYYY-MM-DD.json`; nothing where it has none. */
export function newestOf(folder) {
  const name = readdirSync(folder)
    .filter((file) => /^\d{4}-\d{2}-\d{2}\.json$/.test(file))
    .sort()
    .at(-1);
  return name && { name, ratios: JSON.parse(readFileSync(join(folder, name), 'utf8')) };
}

/** Works that lost a tenth or more of their ratio: [{work, before, now}]. What one of the two lacks says nothing. */
export function drops(before, now) {
  return Object.keys(now)
    .filter((work) => work in before && now[work] <= before[work] * (1 - worthNaming))
    .map((work) => ({ work, before: before[work], now: now[work] }));
}

/** Keeps ratios beside those of works that were not measured this time. */
export function keep(folder, day, now) {
  const all = { ...newestOf(folder)?.ratios, ...now };
  const sorted = Object.fromEntries(Object.entries(all).sort(([a], [b]) => (a < b ? -1 : 1)));
  writeFileSync(join(folder, `${day}.json`), JSON.stringify(sorted, null, 2) + '\n');
}
