/// The plan of a floor: sent, placed by three or more clicked points, traced, and its outline taken over.
import { useEffect, useState } from 'preact/hooks';
import { error_text } from '../../api/client';
import {
  accept_trace,
  create_floor,
  floor as fetch_floor,
  floors as fetch_floors,
  georeference,
  MATERIALS,
  preview_url,
  send_plan,
  trace as fetch_trace,
  type Click,
  type Floor,
  type Georeference,
  type Held,
  type Material,
  type Trace,
} from '../../api/floors';
import { sites as fetch_sites, type Site } from '../../api/site';
import { follow_floors } from '../../state/floors';
import { say } from '../../state/store';
import { Empty, useLoad } from '../../ui/empty';
import { fixed } from '../../ui/format';
import { Icon } from '../../ui/marks';
import { Problem } from '../../ui/problem';
import { typed_number } from '../../ui/typed_number';
import { useDialog } from '../../ui/use_dialog';
import { useDraft } from '../../ui/use_draft';

type Corner = { readonly lon: number; readonly lat: number };
interface Row {
  readonly pixel: readonly [number, number];
  readonly place: string; ///< latitude, longitude, as typed
}
interface Props {
  corners: readonly Corner[]; ///< of the flight plan's outline: places that are known already
  close: () => void;
  use_outline: (corners: readonly Corner[]) => void;
}

export function place_of(text: string): Corner | null {
  // With decimal commas, "51,0232, 3,7133": what parts the two is then a comma with a space, a semicolon or a space alone.
  const parts = (/\d,\d+\s*[;,\s]\s*-?\d+,\d/.test(text) ? text.replace(/(\d),(?=\d)/g, '$1.') : text)
    .trim()
    .split(/[,;\s]+/)
    .map(Number);
  if (parts.length !== 2 || !parts.every(Number.isFinite)) return null;
  const [lat, lon] = parts as [number, number];
  return Math.abs(lat) <= 90 && Math.abs(lon) <= 180 ? { lat, lon } : null;
}
export const clicks_of = (rows: readonly Row[]): Click[] =>
  rows.flatMap((r) => {
    const at = place_of(r.place);
    return at ? [{ pixel: r.pixel, ...at }] : [];
  });

export function FloorPlanDialog({ corners, close, use_outline }: Props) {
  const [all, set_all] = useState<readonly Floor[]>([]),
    [sites, set_sites] = useState<readonly Site[] | null>(null),
    [held, set_held] = useState<Held | null>(null),
    [problem, set_problem] = useState(''),
    [busy, set_busy] = useState(''),
    box = useDialog<HTMLElement>(close, 'floor-plan');
  const work = (what: string, job: () => Promise<void>): void => {
    set_busy(what);
    set_problem('');
    void job()
      .catch((e: unknown) => set_problem(error_text(e)))
      .then(() => set_busy(''));
  };
  useLoad(() => {
    if (sites) return;
    Promise.all([fetch_floors(), fetch_sites()]).then(
      ([f, s]) => {
        set_all(f);
        set_sites(s);
        set_problem('');
      },
      (e: unknown) => set_problem(error_text(e)),
    );
  });
  return (
    <section class="drawer floorplan" {...box} aria-labelledby="floorplan-title" data-testid="floor-plan">
      <div class="hd big">
        <h2 id="floorplan-title">Floor plan{held && `: ${held.floor.name}, level ${held.floor.level}`}</h2>
        <span class="grow" />
        <button class="btn quiet" aria-label="Close" onClick={close}>
          <Icon name="close" />
        </button>
      </div>
      <Problem text={problem} />
      {!held && (
        <>
          {all.map((f) => (
            <button
              key={f.id}
              class="btn"
              disabled={busy !== ''}
              onClick={() => work('open', async () => set_held(await fetch_floor(f.id)))}
            >
              {f.name} (level {f.level}){f.plan ? '' : ', no plan'}
            </button>
          ))}
          <NewFloor
            sites={sites}
            busy={busy !== ''}
            make={(...of) => work('make', async () => set_held(await create_floor(...of)))}
          />
        </>
      )}
      {held && (
        <Sent
          held={held}
          busy={busy}
          send={(file) => work('send', async () => set_held(await send_plan(held, file)))}
        />
      )}
      {held?.floor.plan && (
        <Placed
          key={held.floor.plan.sha256}
          held={held}
          corners={corners}
          busy={busy}
          keep={(points, length_m) =>
            work('place', async () => {
              set_held(await georeference(held, points, length_m, true));
              follow_floors(true);
              say(`${held.floor.name}: the plan is placed`);
            })
          }
        />
      )}
      {held?.floor.backdrop && <Traced held={held} busy={busy} work={work} use_outline={use_outline} />}
    </section>
  );
}

function NewFloor({
  sites,
  busy,
  make,
}: {
  sites: readonly Site[] | null;
  busy: boolean;
  make: (site: string, building: string, name: string, level: number) => void;
}) {
  const [form, set_form] = useState({ site: '', building: '', name: '', level: '0' }),
    site = form.site || sites?.[0]?.id,
    text = (key: 'building' | 'name' | 'level', words: string) => (
      <label>
        <span class="lab">{words}</span>
        <input
          required
          maxLength={200}
          value={form[key]}
          data-testid={`floor-${key}`}
          onInput={(e) => set_form({ ...form, [key]: e.currentTarget.value })}
        />
      </label>
    );
  if (!sites?.length)
    return <Empty loaded={sites !== null}>There is no site yet: an admin creates one in System.</Empty>;
  return (
    <form
      class="facility"
      onSubmit={(e) => {
        e.preventDefault();
        if (site) make(site, form.building.trim(), form.name.trim(), Number(form.level) || 0);
      }}
    >
      {sites.length > 1 && (
        <label>
          <span class="lab">Site</span>
          <select value={site} onChange={(e) => set_form({ ...form, site: e.currentTarget.value })}>
            {sites.map((s) => (
              <option key={s.id} value={s.id}>
                {s.name}
              </option>
            ))}
          </select>
        </label>
      )}
      {text('building', 'Building')}
      {text('name', 'Floor')}
      {text('level', 'Level (0 is the ground)')}
      <span class="actions">
        <button class="btn primary" data-testid="make-floor" disabled={busy}>
          Create floor
        </button>
      </span>
    </form>
  );
}

function Sent({ held, busy, send }: { held: Held; busy: string; send: (file: File) => void }) {
  return (
    <label class="btn">
      {busy === 'send'
        ? 'Sending'
        : held.floor.plan
          ? 'Replace the plan'
          : 'Send a plan (PNG, JPEG, GeoTIFF, PDF, DXF)'}
      <input
        type="file"
        accept=".png,.jpg,.jpeg,.tif,.tiff,.pdf,.dxf"
        hidden
        aria-label="Plan of the floor"
        data-testid="plan-file"
        onChange={(e) => {
          const file = e.currentTarget.files?.[0];
          if (file) send(file);
          e.currentTarget.value = '';
        }}
      />
    </label>
  );
}

/// Null where nothing is given, undefined where it is no length.
function length_of(text: string): number | null | undefined {
  const m = typed_number(text);
  return m === null ? null : m >= 0.1 && m <= 10_000 ? m : undefined;
}

/// Clicks on the picture, a place for each, and how well they agree.
function Placed({
  held,
  corners,
  busy,
  keep,
}: {
  held: Held;
  corners: readonly Corner[];
  busy: string;
  keep: (points: Click[], length_m: number | null) => void;
}) {
  const plan = held.floor.plan!,
    // Clicked with care: there again after Escape, and after a reload.
    [{ rows, measured }, change_draft] = useDraft<{ rows: readonly Row[]; measured: string }>(
      `floor-plan/${held.floor.id}/${plan.sha256}`,
      { rows: [], measured: '' },
    ),
    [fit, set_fit] = useState<Georeference | null>(held.floor.georeference),
    [problem, set_problem] = useState('');
  const points = clicks_of(rows),
    complete = points.length === rows.length && rows.length >= 2,
    length_m = length_of(measured),
    asked = complete && length_m !== undefined ? JSON.stringify({ points, length_m }) : '';
  useEffect(() => {
    set_problem('');
    if (!asked) return;
    let gone = false;
    const { points: clicked, length_m: length } = JSON.parse(asked) as { points: Click[]; length_m: number | null };
    georeference(held, clicked, length, false).then(
      (tried) => {
        if (!gone) set_fit(tried.floor.georeference);
      },
      (e: unknown) => {
        if (!gone) set_problem(error_text(e));
      },
    );
    return () => {
      gone = true;
    };
  }, [asked, held]);
  const set_rows = (next: readonly Row[]): void => change_draft({ rows: next }),
    change = (i: number, place: string): void => set_rows(rows.map((r, k) => (k === i ? { ...r, place } : r)));
  return (
    <>
      <p class="why">
        Tap or click three or more corners on the plan, far apart, and give the place of each. A fourth, or the measured
        length between the first two, shows which one is wrong.
      </p>
      <div class="clickplan">
        <img
          src={preview_url(held.floor.id)}
          alt={`Plan of ${held.floor.name}`}
          data-testid="plan-picture"
          onClick={(e) => {
            const r = e.currentTarget.getBoundingClientRect();
            const pixel: [number, number] = [
              ((e.clientX - r.left) / r.width) * plan.width_px,
              ((e.clientY - r.top) / r.height) * plan.height_px,
            ];
            const next = corners[rows.length];
            set_rows([...rows, { pixel, place: next ? `${fixed(next.lat, 8)}, ${fixed(next.lon, 8)}` : '' }]);
          }}
        />
        {rows.map((r, i) => (
          <span
            key={i}
            class={fit?.wrong === i ? 'mark bad' : 'mark'}
            style={{ left: `${(r.pixel[0] / plan.width_px) * 100}%`, top: `${(r.pixel[1] / plan.height_px) * 100}%` }}
          >
            {i + 1}
          </span>
        ))}
      </div>
      {rows.length > 0 && (
        <table class="tbl">
          <thead>
            <tr>
              <th>Point</th>
              <th>Latitude, longitude</th>
              <th>Residual</th>
              <td />
            </tr>
          </thead>
          <tbody>
            {rows.map((r, i) => {
              const off = complete ? fit?.points?.[i]?.residual_m : undefined;
              return (
                <tr key={i}>
                  <td>{i + 1}</td>
                  <td>
                    <input
                      aria-label={`Place of point ${i + 1}`}
                      placeholder="51.0232, 3.7133"
                      value={r.place}
                      aria-invalid={r.place.trim() !== '' && place_of(r.place) === null}
                      data-testid={`place-${i + 1}`}
                      onInput={(e) => change(i, e.currentTarget.value)}
                    />
                    {r.place.trim() !== '' && place_of(r.place) === null && (
                      <span class="bad"> is not a latitude and a longitude in degrees</span>
                    )}
                  </td>
                  <td data-testid={`residual-${i + 1}`}>
                    {off ? `${fixed(Math.hypot(off[0]!, off[1]!), 2)} m` : ''}
                    {complete && fit?.wrong === i ? ', wrong' : ''}
                  </td>
                  <td>
                    <button
                      class="btn small"
                      aria-label={`Remove point ${i + 1}`}
                      onClick={() => set_rows(rows.filter((_, k) => k !== i))}
                    >
                      Remove
                    </button>
                  </td>
                </tr>
              );
            })}
          </tbody>
        </table>
      )}
      {rows.length > 1 && (
        <label>
          Measured between 1 and 2, m (optional){' '}
          <input
            inputMode="decimal"
            size={8}
            value={measured}
            data-testid="known-length"
            aria-invalid={length_m === undefined}
            onInput={(e) => change_draft({ measured: e.currentTarget.value })}
          />
          {length_m === undefined && <span class="bad"> is not a length in metres</span>}
        </label>
      )}
      {problem && (
        <p class="why" role="status">
          {problem}
        </p>
      )}
      {fit && (
        <p data-testid="fit">
          {fixed(fit.scale_m_per_px, 4)} m a pixel, turned {fixed(fit.turn_deg, 1)}°, residual {fixed(fit.rms_m, 2)} m.{' '}
          {fit.notes.join('. ')}
        </p>
      )}
      <span class="actions">
        <button
          class="btn primary"
          data-testid="place-plan"
          disabled={!complete || length_m === undefined || busy !== ''}
          onClick={() => keep(points, length_m ?? null)}
        >
          {busy === 'place' ? 'Placing' : 'Place the plan'}
        </button>
      </span>
    </>
  );
}

function Traced({
  held,
  busy,
  work,
  use_outline,
}: {
  held: Held;
  busy: string;
  work: (what: string, job: () => Promise<void>) => void;
  use_outline: (corners: readonly Corner[]) => void;
}) {
  const [found, set_found] = useState<Trace | null>(null),
    [material, set_material] = useState<Material>('unknown');
  const outline = (found?.outline as { coordinates?: [number, number][][] } | undefined)?.coordinates?.[0] ?? [];
  return (
    <>
      <span class="actions">
        <button
          class="btn"
          data-testid="trace"
          disabled={busy !== ''}
          onClick={() => work('trace', async () => set_found(await fetch_trace(held)))}
        >
          {busy === 'trace' ? 'Tracing' : 'Trace outline and walls'}
        </button>
      </span>
      {found && (
        <>
          <p data-testid="traced">
            {Math.max(0, outline.length - 1)} corners and {found.walls.length} walls. {found.notes.join('. ')}
          </p>
          <span class="actions">
            <select
              aria-label="Material of the walls"
              value={material}
              onChange={(e) => set_material(e.currentTarget.value as Material)}
            >
              {MATERIALS.map((m) => (
                <option key={m}>{m}</option>
              ))}
            </select>
            <button
              class="btn"
              disabled={busy !== ''}
              onClick={() =>
                work('accept', async () => {
                  await accept_trace(held, material);
                  say(`${found.walls.length} walls accepted`);
                })
              }
            >
              Accept walls
            </button>
            <button
              class="btn primary"
              data-testid="use-outline"
              onClick={() => use_outline(outline.slice(0, -1).map(([lon, lat]) => ({ lon, lat })))}
            >
              Use as outline
            </button>
          </span>
        </>
      )}
    </>
  );
}
