// The table at the end of ./dev torture cluster: a line for each kind of fault.
const median = (list) => [...list].sort((a, b) => a - b)[list.length >> 1];
const both = (list) => (list.length > 0 ? `${median(list).toFixed(1)}, ${Math.max(...list).toFixed(1)} s` : '-');

/** `round`: {taken_s, served_s, gap_s (null where there is none), rows, lost, doubled, late, accepted, calls, histories, skipped}. */
export class Report {
  constructor() {
    this.kinds = new Map();
  }
  add(kind, round) {
    this.kinds.set(kind, [...(this.kinds.get(kind) ?? []), round]);
  }
  /** Of one round, in a few words. */
  static words({ taken_s, served_s, gap_s, rows, skipped }) {
    if (skipped) return `SKIPPED: ${skipped}`;
    const words = [];
    if (taken_s !== null) words.push(`taken over after ${taken_s.toFixed(1)} s`);
    if (served_s !== null) words.push(`its first row acknowledged after ${served_s.toFixed(1)} s`);
    words.push(`no row acknowledged for ${gap_s.toFixed(1)} s`, `${rows} rows acknowledged`);
    return words.join(', ');
  }
  lines() {
    const head = ['fault', 'rounds', 'taken over: median, worst', 'first row of the other one: median, worst'];
    head.push('no row acknowledged for: median, worst', 'rows acknowledged', 'lost', 'twice');
    head.push('sent late to the old owner', 'taken by it', 'calls in histories', 'not linearizable');
    const lines = [...this.kinds].map(([kind, rounds]) => {
      const all = (name) => rounds.map((round) => round[name]).filter((value) => typeof value === 'number'),
        sum = (name) => all(name).reduce((total, one) => total + one, 0),
        skipped = rounds.find((round) => round.skipped)?.skipped,
        cells = [skipped ? `${kind} (SKIPPED: ${skipped})` : kind, rounds.length];
      cells.push(both(all('taken_s')), both(all('served_s')), both(all('gap_s')));
      for (const name of ['rows', 'lost', 'doubled', 'late', 'accepted', 'calls', 'histories']) cells.push(sum(name));
      return cells;
    });
    return [head, head.map(() => '---'), ...lines].map((cells) => `| ${cells.join(' | ')} |`);
  }
}
