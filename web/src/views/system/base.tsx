/// What every position rests on: where the base stands, in which datum and epoch, how well that is known.
import { useEffect, useState } from 'preact/hooks';
import { error_text } from '../../api/client';
import { site_bundle_url } from '../../api/bundles';
import { devices as fetch_devices, type Device } from '../../api/devices';
import { change_site, create_site, sites as fetch_sites, type BaseSource, type Site } from '../../api/site';
import { may } from '../../state/session';
import { say } from '../../state/store';
import { accuracy, fixed, latlon, plain } from '../../ui/format';
import { Empty, NotLoaded } from '../../ui/empty';
import { CopyBox } from '../../ui/copy_box';
import { Chip, Q } from '../../ui/marks';
import { Problem } from '../../ui/problem';
import { typed_number } from '../../ui/typed_number';

const SOURCES: readonly (readonly [BaseSource, string])[] = [
  ['', 'not known'],
  ['known_point', 'a known point'],
  ['survey_in', 'survey-in of the base'],
  ['network', 'a network of stations'],
];
/// How far absolute positions can be trusted, in a line.
export function base_words(s: Pick<Site, 'source' | 'sigma_m' | 'frame'>): {
  readonly tone: 'ok' | 'caution';
  readonly word: string;
  readonly text: string;
} {
  if (!s.source)
    return {
      tone: 'caution',
      word: 'NOT KNOWN',
      text: 'It is not stated how the position of the base is known: anchors are accurate relative to it, but no absolute accuracy can be given.',
    };
  if (s.source === 'survey_in')
    return {
      tone: 'caution',
      word: 'SURVEYED IN',
      text:
        'The base averaged its own ' +
        `place${s.sigma_m === null ? ', which can be metres off' : `, good to ${accuracy(s.sigma_m)} (1σ)`}: all ` +
        'anchors are shifted by the same amount. For better accuracy, set up the base on a known point or use a network.',
    };
  return {
    tone: 'ok',
    word: s.source === 'network' ? 'NETWORK' : 'KNOWN POINT',
    text:
      s.sigma_m === null
        ? 'Its accuracy is not stated.'
        : `Known to ${accuracy(s.sigma_m)} (1σ), which is part of every absolute accuracy.`,
  };
}

export function BasePanel() {
  const [list, set_list] = useState<readonly Site[] | null>(null),
    [chosen, set_chosen] = useState(''),
    [bases, set_bases] = useState<readonly Device[] | null>(null),
    [editing, set_editing] = useState(false),
    [problem, set_problem] = useState('');
  const load = (): void => {
    fetch_sites().then(
      (sites) => {
        set_list(sites);
        set_problem('');
      },
      (e: unknown) => set_problem(error_text(e)),
    );
    fetch_devices().then(
      (all) => set_bases(all.filter((d) => d.kind === 'ntrip' && d.enabled)),
      () => undefined,
    );
  };
  useEffect(() => {
    load();
    const timer = setInterval(load, 3000);
    return () => clearInterval(timer);
  }, []);
  const site = list?.find((s) => s.id === chosen) ?? list?.[0] ?? null,
    words = site && base_words(site),
    reported = bases?.find((d) => d.base)?.base ?? null,
    admin = may('admin');
  return (
    <section class="sys-p" data-help-part="base" data-testid="base">
      <div class="hd">
        <h2>Base</h2>
        {list && list.length > 1 && (
          <label>
            <span class="sr">Site</span>
            <select
              value={site?.id}
              onChange={(e) => {
                set_chosen(e.currentTarget.value);
                set_editing(false);
              }}
            >
              {list.map((s) => (
                <option key={s.id} value={s.id}>
                  {s.name}
                </option>
              ))}
            </select>
          </label>
        )}
      </div>
      {problem && (
        <div class="problem" role="status">
          {problem}
        </div>
      )}
      {words && (
        <div>
          <Chip shape={words.tone === 'ok' ? 'ok' : 'caution'} tone={words.tone} word={words.word} />{' '}
          <span class="why">{words.text}</span>
        </div>
      )}
      {list === null && <NotLoaded failed={problem !== ''} />}
      {list?.length === 0 && (
        <p class="why">
          No site yet, so the datum of the positions is not known.{' '}
          {admin ? 'Name it and say where its coordinates come from.' : 'An administrator names it.'}
        </p>
      )}
      {site && !editing && (
        <dl class="kv s">
          <div>
            <dt>Site</dt>
            <dd>
              {site.name}
              <a
                class="btn small"
                href={site_bundle_url(site.id)}
                download
                data-testid="site-bundle"
                title="The site with its plans, floors, anchors and finished flights, for another anchord server or as a copy"
              >
                Download all of it
              </a>
            </dd>
          </div>
          <div>
            <dt>Datum</dt>
            <dd>{site.frame || <span class="caution">not known</span>}</dd>
          </div>
          <div>
            <dt>Epoch</dt>
            <dd>{site.epoch === null ? <span class="mut">not known</span> : fixed(site.epoch, 2)}</dd>
          </div>
          <div>
            <dt>Source</dt>
            <dd>{SOURCES.find(([id]) => id === site.source)?.[1]}</dd>
          </div>
          <div>
            <dt>σ of the base</dt>
            <dd>{site.sigma_m === null ? '–' : <Q v={fixed(site.sigma_m * 1000, 0)} u="mm" />}</dd>
          </div>
          <div>
            <dt>Map of drawings and survey files</dt>
            <dd data-testid="site-epsg">
              {site.projected_epsg === null ? <span class="mut">none</span> : `EPSG:${site.projected_epsg}`}
            </dd>
          </div>
        </dl>
      )}
      <h3>Where corrections come from</h3>
      {reported ? (
        <>
          <dl class="kv s" data-testid="base-place">
            <div>
              <dt>Latitude</dt>
              <dd>
                <Q v={latlon(reported.lat)} u="°" />
              </dd>
            </div>
            <div>
              <dt>Longitude</dt>
              <dd>
                <Q v={latlon(reported.lon)} u="°" />
              </dd>
            </div>
            <div>
              <dt>Height, ellipsoidal</dt>
              <dd>
                <Q v={fixed(reported.h_m, 3)} u="m" />
              </dd>
            </div>
            <div>
              <dt>Station</dt>
              <dd>{reported.station ?? '–'}</dd>
            </div>
            {reported.antenna_height_m !== null && (
              <div>
                <dt>Antenna above its marker</dt>
                <dd>
                  <Q v={fixed(reported.antenna_height_m, 3)} u="m" />
                </dd>
              </div>
            )}
          </dl>
          <CopyBox
            label="Copy the position of the base"
            text={`${plain(reported.lat, 9)}, ${plain(reported.lon, 9)}, ${plain(reported.h_m, 3)}`}
          />
        </>
      ) : (
        <Empty loaded={bases !== null} failed={problem !== ''}>
          {bases?.length
            ? 'The caster has not sent the position of the base yet (RTCM 1005 or 1006, sent every few seconds).'
            : 'They reach the rover by its own radio, so this server does not know the position of the base; with an NTRIP device it would.'}
        </Empty>
      )}
      {admin &&
        (editing || list?.length === 0 ? (
          <DatumForm
            site={site}
            done={() => {
              set_editing(false);
              load();
            }}
            close={() => set_editing(false)}
          />
        ) : (
          site && (
            <div class="actions">
              <button class="btn" data-testid="edit-base" onClick={() => set_editing(true)}>
                Edit
              </button>
            </div>
          )
        ))}
    </section>
  );
}

/// `EPSG:31370` is how it is written elsewhere.
const epsg_digits = (typed: string): string => typed.replace(/^\s*epsg\s*:/i, '');

function DatumForm({ site, done, close }: { site: Site | null; done: () => void; close: () => void }) {
  const [name, set_name] = useState(site?.name ?? ''),
    [frame, set_frame] = useState(site?.frame ?? ''),
    [epoch, set_epoch] = useState(site?.epoch == null ? '' : String(site.epoch)),
    [source, set_source] = useState<BaseSource>(site?.source ?? ''),
    [sigma, set_sigma] = useState(site?.sigma_m == null ? '' : String(site.sigma_m * 1000)),
    [epsg, set_epsg] = useState(site?.projected_epsg == null ? '' : String(site.projected_epsg)),
    [problem, set_problem] = useState('');
  const send = async (): Promise<void> => {
    const wrong = [
      ['Epoch', epoch, '2026.34'],
      ['σ of its position', sigma, '8'],
      ['EPSG code of the map', epsg_digits(epsg), '31370'],
    ].find(([, typed]) => Number.isNaN(typed_number(typed!)));
    if (wrong)
      return set_problem(`${wrong[0]}: “${wrong[1]}” is not a number. Write it without a unit, like ${wrong[2]}.`);
    const mm = typed_number(sigma),
      d = {
        frame: frame.trim(),
        epoch: typed_number(epoch),
        source,
        sigma_m: mm === null ? null : mm / 1000,
        projected_epsg: typed_number(epsg_digits(epsg)),
      };
    try {
      await (site ? change_site(site.id, d) : create_site(name.trim(), d));
      say('Saved: included in every position from now on');
      done();
    } catch (e) {
      set_problem(error_text(e));
    }
  };
  return (
    <form
      class="callout"
      data-testid="base-form"
      onSubmit={(e) => {
        e.preventDefault();
        void send();
      }}
    >
      <div class="addform">
        {!site && (
          <label class="grow">
            <span class="lab">Name of the site</span>
            <input required maxLength={200} value={name} onInput={(e) => set_name(e.currentTarget.value)} />
          </label>
        )}
        <label>
          <span class="lab">Datum of its coordinates</span>
          <input value={frame} placeholder="ETRS89" list="datums" onInput={(e) => set_frame(e.currentTarget.value)} />
          <datalist id="datums">
            {['ETRS89', 'ETRF2000', 'ITRF2020', 'ITRF2014', 'WGS 84 (G2296)', 'NAD83(2011)', 'GDA2020'].map((f) => (
              <option key={f} value={f} />
            ))}
          </datalist>
        </label>
        <label>
          <span class="lab">Epoch, year</span>
          <input
            value={epoch}
            inputMode="decimal"
            placeholder="2026.34"
            onInput={(e) => set_epoch(e.currentTarget.value)}
          />
        </label>
        <label>
          <span class="lab">Source of the base position</span>
          <select
            value={source}
            data-testid="base-source"
            onChange={(e) => set_source(e.currentTarget.value as BaseSource)}
          >
            {SOURCES.map(([id, words]) => (
              <option key={id} value={id} disabled={id === '' && !!site?.source}>
                {words}
              </option>
            ))}
          </select>
        </label>
        <label>
          <span class="lab">σ of its position, mm</span>
          <input value={sigma} inputMode="decimal" placeholder="8" onInput={(e) => set_sigma(e.currentTarget.value)} />
        </label>
        <label>
          <span class="lab">Map of drawings and survey files, EPSG code</span>
          <input
            value={epsg}
            inputMode="numeric"
            placeholder="31370"
            data-testid="base-epsg"
            onInput={(e) => set_epsg(e.currentTarget.value)}
          />
        </label>
      </div>
      <Problem text={problem} />
      <div class="actions">
        {site && (
          <button type="button" class="btn" onClick={close}>
            Not now
          </button>
        )}
        <button class="btn primary" data-testid="base-send" disabled={!site && !name.trim()}>
          Save
        </button>
      </div>
    </form>
  );
}
