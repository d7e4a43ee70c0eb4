/// Measurements: what one flight or campaign measured, filtered by the server, plotted and listed; a row opens its impulse response.
import { useEffect, useMemo, useRef, useState } from 'preact/hooks';
import '../desk.css';
import './measurements.css';
import { settings_of } from '../../api/campaign';
import { said } from '../../api/client';
import {
  campaigns as fetch_campaigns,
  count_of,
  download_url,
  EVERYTHING,
  page_of,
  type Filter,
  type Sample,
  type Source,
} from '../../api/measurements';
import { mission_id, ordered_missions } from '../../state/store';
import { grouped } from '../../ui/format';
import { keys_on } from '../../ui/help';
import { Icon } from '../../ui/marks';
import { may } from '../../state/session';
import { CampaignMode } from './campaign_mode';
import { DRAWN_MAX, every_of } from './choice';
import { ExcludePanel } from './exclude';
import { Filters, type Who } from './filters';
import { ImpulsePanel } from './impulse';
import { HistogramPanel, LevelPanel, TruthPanel } from './plots';
import { RowList } from './row_list';
import { arrived, at_end, index_of, known, lacking, nothing, PAGE_ROWS, row, type Rows } from './window';
import { useStable } from '../../ui/use_stable';

/// What is asked: another source or filter is another question, and late answers to the last one are dropped.
interface Asked {
  readonly key: string;
  readonly rows: Rows<Sample>;
  readonly total: number | null;
  readonly drawn: readonly Sample[] | null;
  readonly every: number;
}

const SCANNED = 20_000; ///< rows the server looks through for one page of a class
const everything = (f: Filter): boolean => JSON.stringify(f) === JSON.stringify(EVERYTHING);

export function Measurements() {
  const [campaigns, set_campaigns] = useState<readonly Source[]>([]),
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
    [labelling, set_labelling] = useState(false),
    [excluding, set_excluding] = useState(false),
    [opened, set_opened] = useState(0);
  useEffect(() => {
    document.title = 'Measurements - anchord';
  }, []);
  useEffect(() => {
    fetch_campaigns().then(set_campaigns, () => undefined);
  }, [again]);
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
  const failed = (e: unknown): void => set_problem(said(e));
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
          n = settings.reduce((sum, s) => sum + s.n, 0),
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
      if (e.key === 'Escape') set_sample(null);
    };
    addEventListener('keydown', on_key);
    return () => removeEventListener('keydown', on_key);
  });
  const count = !current
    ? ''
    : current.total !== null
      ? `${grouped(current.total)}${who.of === of && who.n !== null && who.n !== current.total ? ` of ${grouped(who.n)}` : ''}`
      : `${grouped(n_known)}${at_end(rows) ? '' : ' and more'}${who.of === of && who.n !== null ? ` of ${grouped(who.n)}` : ''}`;
  return (
    <div class="desk measurements" data-testid="measurements">
      <div class="toolbar">
        <h1>Measurements</h1>
        <select
          class="input"
          aria-label="Flight or campaign"
          data-testid="source"
          value={source?.id ?? ''}
          onChange={(e) => set_wanted(e.currentTarget.value)}
        >
          <optgroup label="Flights">
            {missions.map((s) => (
              <option key={s.id} value={s.id}>
                {s.name}
              </option>
            ))}
          </optgroup>
          {campaigns.length > 0 && (
            <optgroup label="Campaigns">
              {campaigns.map((s) => (
                <option key={s.id} value={s.id}>
                  {s.name}
                </option>
              ))}
            </optgroup>
          )}
        </select>
        <span class="mut" data-testid="counts" role="status">
          {count}
        </span>
        <span class="tools">
          {may('engineer', 'gateway') && (
            <button
              class="btn"
              data-testid="label-field"
              aria-expanded={labelling}
              onClick={() => set_labelling(!labelling)}
            >
              Label in the field
            </button>
          )}
          {source?.kind === 'mission' && (
            <button
              class="btn"
              data-testid="exclude"
              aria-expanded={excluding}
              onClick={() => set_excluding(!excluding)}
            >
              Out of use
            </button>
          )}
          {source &&
            (['csv', 'ndjson'] as const).map((format) => (
              <a
                key={format}
                class="btn"
                data-testid={`download-${format}`}
                href={download_url(source, filter, format)}
                download={`${source.kind === 'mission' ? 'ranges' : 'samples'}-${source.id}.${format}`}
              >
                <Icon name="download" />
                {format.toUpperCase()}
              </a>
            ))}
        </span>
      </div>
      {problem && (
        <div class="problem" role="status">
          <b>The measurements could not be read.</b> {problem}{' '}
          <button class="btn small" onClick={() => set_again(again + 1)}>
            Try again
          </button>
        </div>
      )}
      <div class="page" tabIndex={0} role="region" aria-label="Measurements">
        {source && (
          <Filters
            source={source}
            filter={filter}
            who={who.of === of ? who.list : []}
            set={(f) => set_filters({ of, filter: f })}
          />
        )}
        {labelling && (
          <CampaignMode campaigns={campaigns} close={() => set_labelling(false)} taken={() => set_again(again + 1)} />
        )}
        {excluding && source?.kind === 'mission' && (
          <ExcludePanel mission={source.id} filter={filter} sample={sample} close={() => set_excluding(false)} />
        )}
        {!source && (
          <div class="empty small">
            <p>Nothing has been measured yet. Fly, import a flight folder, or import a campaign with ground truth.</p>
          </div>
        )}
        {source && !current && !problem && (
          <p class="pad" role="status">
            Loading the measurements.
          </p>
        )}
        {current && n_known === 0 && !at_end(rows) && rows.sizes.length > 0 && !problem && (
          <p class="pad" role="status">
            Looking further: none in the first {grouped(rows.sizes.length * SCANNED)}.
          </p>
        )}
        {current && at_end(rows) && n_known === 0 && (
          <div class="empty small">
            <p>
              {everything(filter)
                ? `${source!.name} has no measurements.`
                : 'Nothing passes this filter. Show all takes it away.'}
            </p>
          </div>
        )}
        {sample && source && (
          <ImpulsePanel
            source={source}
            sample={sample}
            opened={opened}
            all={whole.of === of ? whole.samples : drawn}
            close={() => set_sample(null)}
            step={step}
          />
        )}
        {drawn.length > 0 && (
          <>
            <div class="plots">
              <LevelPanel samples={drawn} selected={selected} select={open} />
              <TruthPanel samples={drawn} selected={selected} select={open} />
              <HistogramPanel samples={drawn} />
            </div>
            {current!.every > 1 && (
              <p class="sub thinned" data-testid="thinned">
                The plots are made of {grouped(drawn.length)} of them, about one in {grouped(current!.every)}.
              </p>
            )}
          </>
        )}
        {n_known > 0 && (
          <RowList
            source={source!}
            rows={rows}
            selected={selected}
            at={at}
            oldest_first={oldest_first}
            select={open}
            look={look}
            turn={() => set_oldest(!oldest_first)}
          />
        )}
      </div>
    </div>
  );
}
