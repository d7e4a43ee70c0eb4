/// The filters in one band: each is a field of the server's own query, so that what is listed, drawn and downloaded is the same.
import { useState } from 'preact/hooks';
import { EVERYTHING, type Filter, type Source } from '../../api/measurements';
import { typed_number } from '../../ui/typed_number';
import { LABELS, time_text, typed_time } from './choice';

/// An anchor of a flight, or a place of a campaign: its environments, or its settings where it names none.
export interface Who {
  readonly name: string;
  readonly by: Filter['by'];
}
interface Props {
  source: Source;
  filter: Filter;
  who: readonly Who[];
  set: (f: Filter) => void;
}
export function Filters({ source, filter: f, who, set }: Props) {
  const flight = source.kind === 'mission',
    put = (part: Partial<Filter>): void => set({ ...f, ...part });
  const band = (name: string, unit: string, low: 'min_m' | 'min_dbm', high: 'max_m' | 'max_dbm') => (
    <div class="limits" role="group" aria-label={`${name}, ${unit}`}>
      <span class="lab">
        {name}, {unit}
      </span>
      <span class="ends">
        <End name={`${name} from`} value={f[low]} set={(v) => put({ [low]: v })} />
        <span aria-hidden="true">–</span>
        <End name={`${name} to`} value={f[high]} set={(v) => put({ [high]: v })} />
      </span>
    </div>
  );
  const time = (name: string, key: 'since_us' | 'until_us') => (
    <label>
      <span class="lab">{name}, UTC</span>
      <input
        type="datetime-local"
        step="1"
        data-testid={key}
        value={time_text(f[key])}
        onChange={(e) => put({ [key]: typed_time(e.currentTarget.value) })}
      />
    </label>
  );
  return (
    <section class="cell-p wide filters" aria-label="Filters" data-testid="filters">
      <label>
        <span class="lab">{flight ? 'Anchor' : 'Place'}</span>
        <select
          data-testid="who"
          value={f.who}
          onChange={(e) =>
            put({
              who: e.currentTarget.value,
              by: who.find((w) => w.name === e.currentTarget.value)?.by ?? 'environment',
            })
          }
        >
          <option value="">{flight ? 'Every anchor' : 'Every place'}</option>
          {who.map((w) => (
            <option key={w.name} value={w.name}>
              {w.name}
            </option>
          ))}
        </select>
      </label>
      <div>
        <span class="lab" id="by-label">
          Label
        </span>
        <div class="seg" role="group" aria-labelledby="by-label">
          {LABELS.map(([id, words]) => (
            <button
              key={id}
              class={f.label === id ? 'on' : ''}
              aria-pressed={f.label === id}
              onClick={() => put({ label: id })}
            >
              {words}
            </button>
          ))}
        </div>
      </div>
      <label>
        <span class="lab">Predicted</span>
        <select
          data-testid="predicted"
          value={f.cls}
          onChange={(e) => put({ cls: e.currentTarget.value as Filter['cls'] })}
        >
          <option value="">Every class</option>
          <option value="los">LOS</option>
          <option value="nlos">NLOS</option>
          <option value="unclear">unclear</option>
        </select>
      </label>
      {band('Distance', 'm', 'min_m', 'max_m')}
      {band('RSS', 'dBm', 'min_dbm', 'max_dbm')}
      {flight && (
        <label>
          <span class="lab">Fix</span>
          <select
            data-testid="fix"
            value={f.fix}
            onChange={(e) => put({ fix: e.currentTarget.value as Filter['fix'] })}
          >
            <option value="">Every fix</option>
            <option value="fixed">FIX</option>
            <option value="float">FLOAT</option>
            <option value="dgps">DGPS</option>
            <option value="single">SINGLE</option>
            <option value="none">none within 2 s</option>
          </select>
        </label>
      )}
      {flight && time('From', 'since_us')}
      {flight && time('Before', 'until_us')}
      {Object.entries(EVERYTHING).some(([k, v]) => f[k as keyof Filter] !== v && k !== 'by') && (
        <button class="btn" data-testid="reset" onClick={() => set(EVERYTHING)}>
          Show all
        </button>
      )}
    </section>
  );
}

/// What is being typed is the field's own until it is done: the page is drawn anew whenever something arrives.
function End({ name, value, set }: { name: string; value: number | null; set: (v: number | null) => void }) {
  const [typed, type] = useState<string | null>(null);
  const wrong = typed !== null && Number.isNaN(typed_number(typed)) && !/^[+−–-]?$/.test(typed.trim());
  const done = (v: string): void => {
    const number = typed_number(v);
    if (Number.isNaN(number)) return; // it stays, marked; the filter is what it was
    type(null);
    set(number);
  };
  return (
    <input
      inputMode="decimal"
      value={typed ?? value ?? ''}
      aria-invalid={wrong}
      aria-label={name}
      data-testid={name.toLowerCase().replace(' ', '-')}
      onInput={(e) => type(e.currentTarget.value)}
      onChange={(e) => done(e.currentTarget.value)}
    />
  );
}
