/// Labelling in the field: the truth of a place is typed, one press records the next n ranges of an anchor, and they join the campaign with it.
import { type Setting } from '../../api/campaign';
import type { Source } from '../../api/measurements';
import { fixed, grouped } from '../../ui/format';
import { Icon, Mark, Q } from '../../ui/marks';
import { useTake, type Take } from './use_take';
import { setting_of, spread, typed_number } from './take';

const NUMBERS: readonly (readonly ['distance_m' | 'heading_deg' | 'height_difference_m' | 'thickness_m', string])[] = [
  ['distance_m', 'True distance, m'],
  ['heading_deg', 'Heading, °'],
  ['height_difference_m', 'Height difference, m'],
  ['thickness_m', 'Thickness, m'],
];

export function CampaignMode({
  campaigns,
  close,
  taken,
}: {
  campaigns: readonly Source[];
  close: () => void;
  taken: (campaign: string) => void;
}) {
  const { mission, place, change, anchors, wanted, lacks, take, done, problem, settings, record, stop } = useTake(
    campaigns,
    taken,
  );
  const text = (key: 'campaign' | 'environment' | 'setting' | 'material', words: string, hint: string) => (
    <label>
      <span class="lab">{words}</span>
      <input
        value={place[key]}
        placeholder={hint}
        list={key === 'campaign' ? 'campaign-names' : undefined}
        maxLength={200}
        disabled={take !== null}
        data-testid={`take-${key}`}
        onInput={(e) => change({ [key]: e.currentTarget.value })}
      />
    </label>
  );
  return (
    <section class="cell-p wide take" data-help="campaign" data-testid="campaign-mode" aria-label="Label in the field">
      <div class="hd">
        <h2>Label in the field</h2>
        <span class="meta">
          {mission
            ? `from ${mission.name || 'the flight'}${mission.state === 'recording' ? '' : ', which has ended'}`
            : 'no flight'}
        </span>
        <button class="btn quiet" aria-label="Close labelling" onClick={close}>
          <Icon name="close" />
        </button>
      </div>
      <p class="why">
        Stand still, type the distance that the laser metre shows, press Record. The next ranges of the anchor join the
        campaign with this truth. The form stays filled in for the next place.
      </p>
      <datalist id="campaign-names">
        {campaigns.map((c) => (
          <option key={c.id} value={c.name} />
        ))}
      </datalist>
      <form
        onSubmit={(e) => {
          e.preventDefault();
          void record();
        }}
      >
        <div class="takeform">
          {text('campaign', 'Campaign', 'new or known')}
          {text('environment', 'Environment', 'room 1')}
          {text('setting', 'Name of the place', setting_of({ ...place, setting: '' }) || 'from its truth')}
          <label>
            <span class="lab">Anchor</span>
            <select
              value={place.anchor}
              disabled={take !== null}
              data-testid="take-anchor"
              onChange={(e) => change({ anchor: e.currentTarget.value })}
            >
              <option value="">{anchors.length ? 'choose' : 'none is in range'}</option>
              {anchors.map((a) => (
                <option key={a} value={a}>
                  {a}
                </option>
              ))}
            </select>
          </label>
          {NUMBERS.map(([key, words]) => (
            <label key={key}>
              <span class="lab">{words}</span>
              <input
                inputMode="decimal"
                value={place[key]}
                disabled={take !== null}
                data-testid={`take-${key}`}
                onInput={(e) => change({ [key]: e.currentTarget.value })}
              />
            </label>
          ))}
          {text('material', 'Material between', 'brick')}
          <label>
            <span class="lab">Measurements</span>
            <input
              inputMode="numeric"
              value={place.wanted}
              disabled={take !== null}
              data-testid="take-wanted"
              onInput={(e) => change({ wanted: e.currentTarget.value })}
            />
          </label>
          <div>
            <span class="lab" id="take-los">
              Line of sight
            </span>
            <div class="seg" role="group" aria-labelledby="take-los">
              {(['los', 'nlos'] as const).map((v) => (
                <button
                  type="button"
                  key={v}
                  class={place.los === v ? 'on' : ''}
                  aria-pressed={place.los === v}
                  disabled={take !== null}
                  onClick={() => change({ los: v })}
                >
                  {v.toUpperCase()}
                </button>
              ))}
            </div>
          </div>
        </div>
        <div class="takebar">
          {take ? (
            <button type="button" class="btn big" data-testid="take-stop" onClick={stop}>
              Stop and discard
            </button>
          ) : (
            <button
              class="btn primary big"
              data-testid="take-record"
              disabled={lacks.length > 0 || mission?.state !== 'recording'}
            >
              Record {grouped(wanted)}
            </button>
          )}
          {take ? (
            <Running take={take} wanted={wanted} truth={typed_number(place.distance_m) ?? null} anchor={place.anchor} />
          ) : (
            <p class="why" role="status" data-testid="take-done">
              {done ? (
                <>
                  <Mark shape="ok" tone="ok" /> {done}
                </>
              ) : mission?.state !== 'recording' ? (
                'Records while a flight is recorded.'
              ) : lacks.length ? (
                `Still needed: ${lacks.join(', ')}.`
              ) : (
                ''
              )}
            </p>
          )}
        </div>
      </form>
      {problem && (
        <div class="problem" role="status">
          <b>Nothing was stored.</b> {problem}
        </div>
      )}
      {settings.length > 0 && <Taken settings={settings} />}
    </section>
  );
}

function Running({
  take,
  wanted,
  truth,
  anchor,
}: {
  take: Take;
  wanted: number;
  truth: number | null;
  anchor: string;
}) {
  const { n, mean, sd } = spread(take.values);
  return (
    <div class="takenow" data-testid="take-now">
      <progress max={wanted} value={n} aria-label={`Measurements of ${anchor}`} />
      <dl class="kv">
        <div>
          <dt>Measured</dt>
          <dd>
            {n} of {wanted}
          </dd>
        </div>
        <div>
          <dt>Mean</dt>
          <dd>
            <Q v={fixed(mean, 3)} u="m" />
          </dd>
        </div>
        <div>
          <dt>Standard deviation</dt>
          <dd>
            <Q v={fixed(sd === null ? null : sd * 1000, 0)} u="mm" />
          </dd>
        </div>
        <div>
          <dt>Bias</dt>
          <dd>
            <Q v={fixed(mean === null || truth === null ? null : (mean - truth) * 1000, 0)} u="mm" />
          </dd>
        </div>
      </dl>
      {take.silent && (
        <p class="why" role="status">
          <Mark shape="caution" tone="caution" /> No range of {anchor} for more than 10 s.
        </p>
      )}
    </div>
  );
}

function Taken({ settings }: { settings: readonly Setting[] }) {
  return (
    <div class="scrollx takenbox" tabIndex={0} role="region" aria-label="Places of this campaign">
      <table class="tbl" data-testid="taken">
        <caption class="sr">Places of this campaign, the newest first</caption>
        <thead>
          <tr>
            <th scope="col">Place</th>
            <th scope="col">Environment</th>
            <th scope="col">Label</th>
            <th scope="col" class="num">
              True, m
            </th>
            <th scope="col" class="num">
              Measured
            </th>
            <th scope="col" class="num">
              Mean, m
            </th>
            <th scope="col" class="num">
              SD, mm
            </th>
          </tr>
        </thead>
        <tbody>
          {[...settings]
            .reverse()
            .slice(0, 50)
            .map((s, i) => (
              <tr key={`${s.setting}${i}`}>
                <th scope="row">{s.setting || '–'}</th>
                <td>{s.environment || '–'}</td>
                <td>{s.los === null ? '–' : s.los ? 'LOS' : 'NLOS'}</td>
                <td class="num">{fixed(s.distance_m, 3)}</td>
                <td class="num">{grouped(s.n_samples)}</td>
                <td class="num">{fixed(s.mean_range_m, 3)}</td>
                <td class="num">{fixed(s.sd_range_m === null ? null : s.sd_range_m * 1000, 0)}</td>
              </tr>
            ))}
        </tbody>
      </table>
    </div>
  );
}
