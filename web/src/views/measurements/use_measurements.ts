/// What the Measurements view looks at: source and filter, the pages of the list, what the plots are made of, and the row that is open.
import { useEffect, useMemo, useRef, useState } from 'preact/hooks';
import { settings_of } from '../../api/campaign';
import { error_text } from '../../api/client';
import {
  campaigns as fetch_campaigns,
  count_of,
  EVERYTHING,
  page_of,
  type Filter,
  type Sample,
  type Source,
} from '../../api/measurements';
import { mission_id, ordered_missions, when_back } from '../../state/store';
import { grouped } from '../../ui/format';
import { keys_on } from '../../ui/help_state';
import { useStable } from '../../ui/use_stable';
import { DRAWN_MAX, every_of } from './choice';
import type { Who } from './filters';
import { arrived, at_end, index_of, known, lacking, nothing, PAGE_ROWS, row, type Rows } from './window';

/// What is asked: another source or filter is another question, and late answers to the last one are dropped.
interface Asked {
  readonly key: string;
  readonly rows: Rows<Sample>;
  readonly total: number | null;
  readonly drawn: readonly Sample[] | null;
  readonly every: number;
}

export const everything = (f: Filter): boolean => JSON.stringify(f) === JSON.stringify(EVERYTHING);

export type Desk = ReturnType<typeof useMeasurements>;

export function useMeasurements() {
  const [loaded_campaigns, set_campaigns] = useState<readonly Source[] | null>(null),
    [wanted, set_wanted] = useState<string | null>(null),
    [filters, set_filters] = useState<{ of: string; filter: Filter }>({ of: '', filter: EVERYTHING }),
    [oldest_first, set_oldest] = useState(false);
  const [asked, set_asked] = useState<Asked | null>(null),
    [who, set_who] = useState<{ of: string; list: readonly Who[]; n: number | null }>({ of: '', list: [], n: null }),
    busy = useRef(new Set<string>()),
    [whole, set_whole] = useState<{ of: string; samples: readonly Sample[] }>({ of: '', samples: [] });
  const [problem, set_problem] = useState(''),
    [again, set_again] = useState(0),
    [sample, set_sample] = useState<Sample | null>(null),
    [opened, set_opened] = useState(0);
  useEffect(() => {
    document.title = 'Measurements - anchord';
  }, []);
  useEffect(() => {
    fetch_campaigns().then(set_campaigns, () => undefined);
  }, [again]);
  const read_anew = useStable((): void => {
    if (problem || !loaded_campaigns) set_again((n) => n + 1);
  });
  useEffect(() => when_back(read_anew), [read_anew]);
  const campaigns = loaded_campaigns ?? [];
  const missions: Source[] = ordered_missions.value.map((m) => ({
      kind: 'mission',
      id: m.mission,
      name: m.name || m.mission.slice(0, 8),
    })),
    sources = [...missions, ...campaigns];
  const source = sources.find((s) => s.id === (wanted ?? mission_id.value)) ?? sources[0] ?? null,
    of = source ? `${source.kind}/${source.id}` : '',
    filter = filters.of === of ? filters.filter : EVERYTHING;
  const key = `${of} ${JSON.stringify(filter)} ${oldest_first} ${again}`,
    now = useRef(key),
    current = asked?.key === key ? asked : null;
  now.current = key;
  const failed = (e: unknown): void => set_problem(error_text(e));
  /// Into the question it was asked for, if that is still what is looked at.
  const put = (part: (a: Asked) => Partial<Asked>): void =>
    set_asked((a) => {
      const base = a?.key === key ? a : { key, rows: nothing<Sample>(), total: null, drawn: null, every: 1 };
      return now.current === key ? { ...base, ...part(base) } : a;
    });
  const load = (page: number, cursor: string | null): void => {
    const name = `${key} ${page}`;
    if (!source || busy.current.has(name)) return;
    busy.current.add(name);
    page_of(source, filter, { limit: PAGE_ROWS, cursor, oldest_first, every: 1 })
      .then((p) => put((a) => ({ rows: arrived(a.rows, page, p.samples, p.next) })), failed)
      .finally(() => busy.current.delete(name));
  };
  const begin = useStable((): void => {
    if (!source) return;
    set_problem('');
    load(0, null);
    void (async () => {
      try {
        const settings = source.kind === 'campaign' ? await settings_of(source.id) : [],
          n = settings.reduce((sum, s) => sum + s.n_samples, 0),
          total = await count_of(source, filter),
          every = every_of(total ?? n);
        if (source.kind === 'campaign' && now.current === key)
          set_who({
            of,
            n,
            list: [
              ...new Map(
                settings.map((s) => {
                  const w: Who = s.environment
                    ? { name: s.environment, by: 'environment' }
                    : { name: s.setting, by: 'setting' };
                  return [w.name, w];
                }),
              ).values(),
            ],
          });
        const drawn = (
          await page_of(source, filter, { limit: Math.ceil(DRAWN_MAX * 1.1), cursor: null, oldest_first, every })
        ).samples;
        // What a feature is ranked among is not what happens to be filtered.
        if (everything(filter) && now.current === key) set_whole({ of, samples: drawn });
        put(() => ({ drawn, every, total: filter.cls ? null : total }));
        if (source.kind === 'mission' && now.current === key)
          set_who((w) => ({
            of,
            n: everything(filter) ? total : w.of === of ? w.n : null,
            list: [...new Set([...(w.of === of ? w.list.map((x) => x.name) : []), ...drawn.map((s) => s.who)])]
              .sort()
              .map((name) => ({ name, by: 'environment' })),
          }));
      } catch (e) {
        failed(e);
      }
    })();
  });
  useEffect(begin, [key, begin]);
  useEffect(() => set_sample(null), [of]);
  const drawn = current?.drawn ?? [],
    rows = current?.rows ?? nothing<Sample>(),
    n_known = known(rows),
    selected = sample?.id ?? null,
    at = useMemo(() => (selected === null ? -1 : index_of(rows, (s) => s.id === selected)), [rows, selected]);
  const look = useStable((first: number, last: number): void => {
    const page = current && current.rows.sizes.length ? lacking(current.rows, first, last) : null;
    if (page !== null) load(page, current!.rows.cursors[page] ?? null);
  });
  // Pages of a rare class may be empty for long: then there is no list yet whose end could ask for the next.
  useEffect(() => {
    if (n_known === 0 && !at_end(rows)) look(0, 0);
  }, [rows, n_known, look]);
  /// Chosen by a press, not stepped to: the panel comes into sight.
  const open = (s: Sample): void => {
    set_sample(s);
    set_opened((n) => n + 1);
  };
  const step = (by: number): void => {
    // Chosen in a plot, it may be far from the rows that are kept: then the steps are along what is drawn.
    const place = drawn.findIndex((s) => s.id === selected),
      next =
        at >= 0 || selected === null
          ? row(rows, Math.max(0, Math.min(n_known - 1, at + by)))
          : drawn[Math.max(0, Math.min(drawn.length - 1, place + by))];
    if (next) set_sample(next);
  };
  useEffect(() => {
    const on_key = (e: KeyboardEvent): void => {
      if (
        e.ctrlKey ||
        e.metaKey ||
        e.altKey ||
        (e.target instanceof HTMLElement && e.target.closest('input, select, textarea'))
      )
        return;
      if (keys_on.value && (e.key === 'j' || e.key === 'k')) step(e.key === 'j' ? 1 : -1);
      if (e.key === 'Escape' && !e.defaultPrevented) set_sample(null);
    };
    addEventListener('keydown', on_key);
    return () => removeEventListener('keydown', on_key);
  });
  const count = !current
    ? ''
    : current.total !== null
      ? `${grouped(current.total)}${who.of === of && who.n !== null && who.n !== current.total ? ` of ${grouped(who.n)}` : ''}`
      : `${grouped(n_known)}${at_end(rows) ? '' : ' and more'}${who.of === of && who.n !== null ? ` of ${grouped(who.n)}` : ''}`;
  return {
    missions,
    campaigns,
    campaigns_loaded: loaded_campaigns !== null,
    source,
    choose: set_wanted,
    filter,
    set_filter: (f: Filter): void => set_filters({ of, filter: f }),
    who: who.of === of ? who.list : [],
    oldest_first,
    turn: (): void => set_oldest(!oldest_first),
    problem,
    read_again: (): void => set_again(again + 1),
    count,
    current,
    rows,
    n_known,
    drawn,
    whole: whole.of === of ? whole.samples : drawn,
    sample,
    selected,
    at,
    opened,
    open,
    close: (): void => set_sample(null),
    step,
    look,
  };
}
