/// Measurements: what one flight or campaign measured, filtered, plotted and listed; a row opens its impulse response.
import { useEffect, useMemo, useState } from 'preact/hooks';
import '../desk.css';
import './measurements.css';
import { said } from '../../api/client';
import { campaigns as fetch_campaigns, download_url, page_of, type Sample, type Source } from '../../api/measurements';
import { mission_id, ordered_missions } from '../../state/store';
import { fixed, grouped } from '../../ui/format';
import { keys_on } from '../../ui/help';
import { Icon } from '../../ui/marks';
import { may } from '../../state/session';
import { CampaignMode } from './campaign_mode';
import { chosen, CLASS_FILTERS, EVERYTHING, type Choice } from './choice';
import { ImpulsePanel } from './impulse';
import { HistogramPanel, LevelPanel, TruthPanel } from './plots';

const ROWS_SHOWN = 200;
interface Loaded { readonly of: string; readonly samples: readonly Sample[]; readonly next: string | null }

export function Measurements() {
  const [campaigns, set_campaigns] = useState<readonly Source[]>([]), [wanted, set_wanted] = useState<string | null>(null), [loaded, set_loaded] = useState<Loaded | null>(null);
  const [problem, set_problem] = useState(''), [again, set_again] = useState(0), [choice, set_choice] = useState<Choice>(EVERYTHING), [selected, set_selected] = useState<number | null>(null), [labelling, set_labelling] = useState(false), [opened, set_opened] = useState(0);
  useEffect(() => { document.title = 'Measurements - anchord'; }, []);
  useEffect(() => { fetch_campaigns().then(set_campaigns, () => undefined); }, [again]);
  const missions: Source[] = ordered_missions.value.map((m) => ({ kind: 'mission', id: m.mission, name: m.name || m.mission.slice(0, 8) })), sources = [...missions, ...campaigns];
  const source = sources.find((s) => s.id === (wanted ?? mission_id.value)) ?? sources[0] ?? null, key = source ? `${source.kind}/${source.id}` : '';
  const failed = (e: unknown): void => set_problem(said(e));
  useEffect(() => {
    let gone = false;
    if (!source) return;
    set_problem('');
    set_selected(null);
    page_of(source, null, '').then((p) => { if (!gone) set_loaded({ of: key, samples: p.samples, next: p.next }); }, (e: unknown) => { if (!gone) failed(e); });
    return () => { gone = true; };
  }, [key, again]);
  const current = loaded?.of === key ? loaded : null, all = current?.samples ?? [], shown = useMemo(() => chosen(all, choice), [all, choice]);
  const who = useMemo(() => [...new Set(all.map((s) => s.who))].sort(), [all]), sample = all.find((s) => s.id === selected) ?? null;
  const more = async (): Promise<void> => {
    if (!source || !current?.next) return;
    try { const page = await page_of(source, current.next, ''); set_loaded({ of: key, samples: [...current.samples, ...page.samples], next: page.next }); } catch (e) { failed(e); }
  };
  /// Chosen by a press, not stepped to: the panel comes into sight.
  const open = (id: number): void => { set_selected(id); set_opened((n) => n + 1); };
  const step = (by: number): void => {
    const at = shown.findIndex((s) => s.id === selected), next = shown[Math.max(0, Math.min(shown.length - 1, at + by))];
    if (next) set_selected(next.id);
  };
  useEffect(() => {
    const on_key = (e: KeyboardEvent): void => {
      if (e.ctrlKey || e.metaKey || e.altKey || (e.target instanceof HTMLElement && e.target.closest('input, select, textarea'))) return;
      if (keys_on.value && (e.key === 'j' || e.key === 'k')) step(e.key === 'j' ? 1 : -1);
      if (e.key === 'Escape') set_selected(null);
    };
    addEventListener('keydown', on_key);
    return () => removeEventListener('keydown', on_key);
  });
  return (
    <div class="desk measurements" data-testid="measurements">
      <div class="toolbar">
        <h1>Measurements</h1>
        <select class="input" aria-label="Flight or campaign" data-testid="source" value={source?.id ?? ''} onChange={(e) => set_wanted(e.currentTarget.value)}>
          <optgroup label="Flights">{missions.map((s) => <option key={s.id} value={s.id}>{s.name}</option>)}</optgroup>
          {campaigns.length > 0 && <optgroup label="Campaigns">{campaigns.map((s) => <option key={s.id} value={s.id}>{s.name}</option>)}</optgroup>}
        </select>
        <select class="input" aria-label={source?.kind === 'campaign' ? 'Place' : 'Anchor'} data-testid="who" value={choice.who} onChange={(e) => set_choice({ ...choice, who: e.currentTarget.value })}><option value="">{source?.kind === 'campaign' ? 'Every place' : 'Every anchor'}</option>{who.map((w) => <option key={w} value={w}>{w}</option>)}</select>
        <div class="seg" role="group" aria-label="Label">{CLASS_FILTERS.map(([id, words]) => <button key={id} class={choice.label === id ? 'on' : ''} aria-pressed={choice.label === id} onClick={() => set_choice({ ...choice, label: id })}>{words}</button>)}</div>
        <Limit name="From" value={choice.min_m} set={(v) => set_choice({ ...choice, min_m: v })} /><Limit name="to" value={choice.max_m} set={(v) => set_choice({ ...choice, max_m: v })} />
        <span class="tools"><span class="mut" data-testid="counts" role="status">{grouped(shown.length)} of {grouped(all.length)} loaded</span>
        {current?.next && <button class="btn" data-testid="more" onClick={() => void more()}>{source?.kind === 'campaign' ? 'Load more' : 'Load older'}</button>}
        {may('engineer', 'gateway') && <button class="btn" data-testid="label-field" aria-expanded={labelling} onClick={() => set_labelling(!labelling)}>Label in the field</button>}
        {source && download_url(source, choice.who, 'csv') && <a class="btn" href={download_url(source, choice.who, 'csv')!} download={`ranges-${source.id}.csv`}><Icon name="download" />CSV</a>}</span>
      </div>
      {problem && <div class="problem" role="status"><b>The measurements could not be read.</b> {problem} <button class="btn small" onClick={() => set_again(again + 1)}>Try again</button></div>}
      <div class="page" tabIndex={0} role="region" aria-label="Measurements">
        {labelling && <CampaignMode campaigns={campaigns} close={() => set_labelling(false)} taken={() => set_again(again + 1)} />}
        {!source && <div class="empty small"><p>Nothing has been measured yet. Fly, import a flight folder, or import a campaign with ground truth.</p></div>}
        {source && !current && !problem && <p class="pad" role="status">Loading the measurements.</p>}
        {current && all.length === 0 && <div class="empty small"><p>{source!.name} has no measurements.</p></div>}
        {sample && source && <ImpulsePanel source={source} sample={sample} opened={opened} all={all} close={() => set_selected(null)} step={step} />}
        {all.length > 0 && <><div class="plots"><LevelPanel samples={shown} selected={selected} select={open} /><TruthPanel samples={shown} selected={selected} select={open} /><HistogramPanel samples={shown} /></div><Rows source={source!} samples={shown} selected={selected} select={open} /></>}
      </div>
    </div>
  );
}

const Limit = ({ name, value, set }: { name: string; value: number | null; set: (v: number | null) => void }) => (
  <label class="limit">{name} <input class="input" type="number" min="0" step="0.5" inputMode="decimal" value={value ?? ''} aria-label={`Distance ${name.toLowerCase()}, metres`} onChange={(e) => set(e.currentTarget.value === '' ? null : Number(e.currentTarget.value))} /> m</label>
);

function Rows({ source, samples, selected, select }: { source: Source; samples: readonly Sample[]; selected: number | null; select: (id: number) => void }) {
  const time = (t: number | null): string => (t === null ? '–' : new Date(t / 1000).toISOString().slice(11, 23));
  return (
    <section class="cell-p wide">
      <table class="tbl" data-testid="rows">
        <caption class="sr">Measurements that pass the filter</caption>
        <thead><tr><th scope="col">{source.kind === 'campaign' ? 'Place' : 'Anchor'}</th><th scope="col">Time, UTC</th><th scope="col">Label</th><th scope="col" class="num">Distance, m</th><th scope="col" class="num">True, m</th><th scope="col" class="num">Bias, mm</th><th scope="col" class="num">Level, dBm</th><th scope="col">Response</th></tr></thead>
        <tbody>{samples.slice(0, ROWS_SHOWN).map((s) => (
          <tr key={s.id} class={s.id === selected ? 'sel' : ''} onClick={() => select(s.id)}>
            <th scope="row"><button class="id" aria-pressed={s.id === selected} onClick={() => select(s.id)}>{s.who}</button></th>
            <td>{time(s.t_us)}</td><td>{s.los === null ? <span class="mut">none</span> : s.los ? 'LOS' : 'NLOS'}</td><td class="num">{fixed(s.distance_m, 3)}</td><td class="num">{fixed(s.truth_m, 3)}</td>
            <td class="num">{s.truth_m === null ? '–' : fixed((s.distance_m - s.truth_m) * 1000, 0)}</td><td class="num">{fixed(s.rx_dbm, 1)}</td><td>{s.has_cir ? 'kept' : <span class="mut">none</span>}</td>
          </tr>))}
        </tbody>
      </table>
      {samples.length > ROWS_SHOWN && <p class="sub">The first {ROWS_SHOWN} of {grouped(samples.length)} are listed; narrow the filter, or download all.</p>}
    </section>
  );
}
