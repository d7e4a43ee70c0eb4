/// Import a flight: a folder, tables or an archive is dropped; columns whose names say nothing are told by a person; the flight opens.
import { useEffect, useRef, useState } from 'preact/hooks';
import './start.css';
import { error_text } from '../../api/client';
import { send_flight } from '../../api/imports';
import { load_missions } from '../../state/archive';
import { chosen_mission, say } from '../../state/store';
import { fixed, grouped } from '../../ui/format';
import {
  declared_of,
  FIELD_WORDS,
  flight_of,
  guessed_ranges,
  guessed_track,
  missing_ranges,
  missing_track,
  RANGE_FIELDS,
  range_unit,
  table_of,
  time_unit,
  TRACK_FIELDS,
  type About,
  type Columns,
  type Declared,
  type Field,
  type Table,
} from './flight_files';
import { entries_of, inflated } from './unzip';

interface Found {
  readonly track: Table;
  readonly ranges: Table;
  readonly declared: Declared | null;
  readonly name: string;
}

async function texts_of(files: readonly File[]): Promise<{ name: string; read: () => Promise<string> }[]> {
  const out: { name: string; read: () => Promise<string> }[] = [];
  for (const f of files) {
    if (/\.zip$/i.test(f.name)) out.push(...entries_of(new Uint8Array(await f.arrayBuffer())));
    else out.push({ name: f.name, read: () => f.text() });
    if (/\.csv\.gz$/i.test(f.name)) {
      const bytes = new Uint8Array(await f.arrayBuffer());
      out[out.length - 1] = { name: f.name.replace(/\.gz$/i, ''), read: () => inflated(bytes, 'gzip') };
    }
  }
  return out;
}
/// Which table is which: by its name, else by its columns. One table may be both: a pose in each range.
async function found_in(files: readonly File[]): Promise<Found> {
  const texts = await texts_of(files),
    base = (n: string): string => n.split('/').pop()!.toLowerCase(),
    declared_file = texts.find((t) => base(t.name) === 'flight.json'),
    tables: Table[] = [];
  for (const t of texts.filter((x) => /\.(csv|tsv|txt)$/.test(base(x.name)) && !base(x.name).includes('truth')))
    tables.push(table_of(base(t.name), await t.read()));
  if (!tables.length)
    throw new Error('There is no table in it: a flight is flight.json, track.csv and ranges.csv, or tables alone.');
  const named = (what: RegExp): Table | undefined => tables.find((t) => what.test(t.name)),
    likeliest = (of: readonly Table[], missing: (t: Table) => number): Table | undefined =>
      [...of].sort((a, b) => missing(a) - missing(b))[0],
    ranges = named(/(^|[^a-z])(range|distance)/) ?? likeliest(tables, (t) => missing_ranges(guessed_ranges(t)).length)!,
    others = tables.filter((t) => t !== ranges),
    track =
      others.find((t) => /(^|[^a-z])(track|gnss|gps|pos|rover|fix)/.test(t.name)) ??
      likeliest(others, (t) => missing_track(guessed_track(t)).length) ??
      ranges;
  return {
    track,
    ranges,
    declared: declared_file ? declared_of(await declared_file.read()) : null,
    name: files[0]!.webkitRelativePath.split('/')[0] || files[0]!.name.replace(/\.\w+$/, ''),
  };
}
/// Of a drop: files, and those of folders.
async function dropped(list: DataTransferItemList): Promise<File[]> {
  const out: File[] = [],
    walk = async (e: FileSystemEntry): Promise<void> => {
      if (e.isFile) out.push(await new Promise<File>((done, fail) => (e as FileSystemFileEntry).file(done, fail)));
      else {
        const reader = (e as FileSystemDirectoryEntry).createReader();
        for (;;) {
          const some = await new Promise<FileSystemEntry[]>((done, fail) => reader.readEntries(done, fail));
          if (!some.length) break;
          for (const x of some) await walk(x);
        }
      }
    };
  for (const e of [...list].map((i) => i.webkitGetAsEntry()).filter((e) => e !== null)) await walk(e);
  return out;
}

export function Import() {
  const [found, set_found] = useState<Found | null>(null),
    [problem, set_problem] = useState(''),
    [over, set_over] = useState(false),
    files = useRef<HTMLInputElement>(null),
    folder = useRef<HTMLInputElement>(null);
  useEffect(() => {
    document.title = 'Import a flight - anchord';
    folder.current?.setAttribute('webkitdirectory', '');
  }, []);
  const take = (list: readonly File[]): void => {
    if (!list.length) return;
    set_problem('');
    found_in(list).then(set_found, (e: unknown) => set_problem(e instanceof Error ? e.message : String(e)));
  };
  const picked = (e: Event): void => {
    const input = e.currentTarget as HTMLInputElement;
    take([...(input.files ?? [])]);
    input.value = '';
  };
  return (
    <div class="firstrun import" data-testid="import">
      <div>
        <h1>Import a flight</h1>
        <p class="lead">
          A flight folder (flight.json, track.csv, ranges.csv), the two tables alone, or either as .zip. Nothing leaves
          this server.
        </p>
        {!found && (
          <div
            class={over ? 'dropzone over' : 'dropzone'}
            data-testid="dropzone"
            onDragOver={(e) => {
              e.preventDefault();
              set_over(true);
            }}
            onDragLeave={() => set_over(false)}
            onDrop={(e) => {
              e.preventDefault();
              set_over(false);
              if (e.dataTransfer) void dropped(e.dataTransfer.items).then(take, () => undefined);
            }}
          >
            <p>Drop it here, or</p>
            <button class="btn primary" onClick={() => files.current?.click()}>
              Choose files
            </button>
            <button class="btn" onClick={() => folder.current?.click()}>
              Choose a folder
            </button>
            <input
              ref={files}
              type="file"
              multiple
              accept=".csv,.tsv,.txt,.json,.zip,.gz"
              hidden
              aria-label="Flight files"
              onChange={picked}
            />
            <input ref={folder} type="file" multiple hidden aria-label="Flight folder" onChange={picked} />
          </div>
        )}
        {problem && (
          <div class="problem" role="alert" data-testid="import-problem">
            <b>That is no flight.</b> {problem}
          </div>
        )}
        {found && <Mapping found={found} back={() => set_found(null)} />}
      </div>
    </div>
  );
}

/// What each column is, and what no table says; asked for where the names do not say it, open to change where they do.
function Mapping({ found, back }: { found: Found; back: () => void }) {
  const { track, ranges, declared } = found,
    [tc, set_tc] = useState<Columns>(() => guessed_track(track)),
    [rc, set_rc] = useState<Columns>(() => guessed_ranges(ranges)),
    [about, set_about] = useState<About>(() => ({
      name: found.name,
      kit: '',
      epoch_ms: Date.now(),
      point: 'gnss_antenna',
      lever_arm_m: [0, 0, 0],
      lever_arm_sigma_m: null,
      tag: '',
      ...declared?.about,
    })),
    [arm_sigma, set_arm_sigma] = useState(about.lever_arm_sigma_m?.toString() ?? ''),
    [share, set_share] = useState<number | null>(null),
    [problem, set_problem] = useState('');
  const missing = [...missing_track(tc), ...missing_ranges(rc)],
    sigma_m = arm_sigma.trim() === '' ? null : Number(arm_sigma.replace(',', '.')),
    bad_sigma = sigma_m !== null && !(sigma_m > 0), // how much is too much the server says
    needs_tag = !rc.tag && !/^(0x[0-9a-f]+|[0-9]+)$/i.test(about.tag),
    units = {
      track: time_unit(track, tc.time),
      ranges: time_unit(ranges, rc.time),
      range: range_unit(ranges, rc.range),
    };
  const send = async (): Promise<void> => {
    set_problem('');
    try {
      const flight = flight_of(track, tc, ranges, rc, units, { ...about, lever_arm_sigma_m: sigma_m }, declared);
      if (!flight.fixes.length || !flight.ranges.length)
        throw new Error(flight.refused[0] ?? 'There is not one position and one range in it.');
      set_share(0);
      const sent = await send_flight(flight.mission, flight.fixes, flight.ranges, set_share);
      await load_missions();
      chosen_mission.value = sent.mission;
      const not = sent.rejected + flight.refused.length;
      say(
        `${grouped(sent.accepted)} rows are in${not ? `, ${grouped(not)} rejected (first: ${flight.refused[0] ?? sent.first_reason})` : ''}`,
      );
      location.hash = '#/anchors';
    } catch (e) {
      set_problem(error_text(e));
      set_share(null);
    }
  };
  return (
    <form
      class="mapping"
      data-testid="mapping"
      onSubmit={(e) => {
        e.preventDefault();
        void send();
      }}
    >
      <p role="status">
        {track === ranges
          ? `${ranges.name}: ${grouped(ranges.rows.length)} rows with a place each.`
          : `${track.name}: ${grouped(track.rows.length)} positions. ${ranges.name}: ${grouped(ranges.rows.length)} ranges.`}{' '}
        {missing.length === 0 && !needs_tag
          ? 'All columns are known.'
          : `Say what is ${[...missing.map((f) => FIELD_WORDS[f as keyof typeof FIELD_WORDS].toLowerCase()), ...(needs_tag ? ['the tag'] : [])].join(', ')}.`}
      </p>
      <details open={missing.length > 0 || needs_tag}>
        <summary>Columns</summary>
        <div class="cols">
          <ColumnTable
            title={`Track, ${track.name}`}
            table={track}
            fields={TRACK_FIELDS}
            columns={tc}
            set={set_tc}
            missing={missing_track(tc)}
          />
          <ColumnTable
            title={`Ranges, ${ranges.name}`}
            table={ranges}
            fields={RANGE_FIELDS}
            columns={rc}
            set={set_rc}
            missing={missing_ranges(rc)}
          />
        </div>
        <p class="mut">
          Times are {{ s: 'seconds', ms: 'milliseconds', us: 'microseconds', utc: 'dates' }[units.ranges]}, ranges{' '}
          {units.range === 'mm' ? 'millimetres' : 'metres'}: as the names and the first values say.
        </p>
      </details>
      <div class="fields">
        <label>
          <span class="lab">Name</span>
          <input
            value={about.name}
            maxLength={200}
            data-testid="import-name"
            onInput={(e) => set_about({ ...about, name: e.currentTarget.value })}
          />
        </label>
        {!rc.tag && !declared?.tags && (
          <label>
            <span class="lab">Radio address of the tag</span>
            <input
              value={about.tag}
              placeholder="0x6e01"
              data-testid="import-tag"
              onInput={(e) => set_about({ ...about, tag: e.currentTarget.value.trim() })}
            />
          </label>
        )}
        {!declared && (
          <>
            <label>
              <span class="lab">The track is of</span>
              <select
                value={about.point}
                onChange={(e) => set_about({ ...about, point: e.currentTarget.value as About['point'] })}
              >
                <option value="gnss_antenna">the GNSS antenna</option>
                <option value="body">the aircraft's middle</option>
                <option value="tag_antenna">the tag's antenna</option>
              </select>
            </label>
            {about.point !== 'tag_antenna' && (
              <fieldset class="arm">
                <legend class="lab">From there to the tag: forward, left, up, m</legend>
                {[0, 1, 2].map((i) => (
                  <input
                    key={i}
                    class="cell"
                    inputMode="decimal"
                    aria-label={['Forward, m', 'Left, m', 'Up, m'][i]}
                    value={about.lever_arm_m[i]}
                    onChange={(e) => {
                      const arm = [...about.lever_arm_m] as [number, number, number];
                      arm[i] = Number(e.currentTarget.value.replace(',', '.')) || 0;
                      set_about({ ...about, lever_arm_m: arm });
                    }}
                  />
                ))}
              </fieldset>
            )}
          </>
        )}
        {about.point !== 'tag_antenna' && (
          <label>
            <span class="lab">How well that was measured, one sigma, m</span>
            <input
              value={arm_sigma}
              inputMode="decimal"
              placeholder="not said"
              aria-invalid={bad_sigma}
              data-testid="import-arm-sigma"
              onInput={(e) => set_arm_sigma(e.currentTarget.value)}
            />
          </label>
        )}
      </div>
      {problem && (
        <div class="problem" role="alert" data-testid="import-problem">
          <b>That did not work.</b> {problem}
        </div>
      )}
      {share !== null && <progress value={share} max={1} aria-label={`Sent ${fixed(share * 100, 0)} %`} />}
      <div class="actions">
        <button type="button" class="btn" disabled={share !== null} onClick={back}>
          Other files
        </button>
        <button
          class="btn primary"
          data-testid="import-send"
          disabled={missing.length > 0 || needs_tag || bad_sigma || share !== null}
        >
          {share === null ? 'Import' : `Importing, ${fixed(share * 100, 0)} %`}
        </button>
      </div>
    </form>
  );
}

function ColumnTable({
  title,
  table,
  fields,
  columns,
  set,
  missing,
}: {
  title: string;
  table: Table;
  fields: readonly (keyof typeof FIELD_WORDS)[];
  columns: Columns;
  set: (c: Columns) => void;
  missing: readonly Field[];
}) {
  const samples = (column: string): string =>
    table.rows
      .slice(0, 3)
      .map((r) => r[table.columns.indexOf(column)])
      .join(', ');
  return (
    <table class="tbl">
      <caption>{title}</caption>
      <thead>
        <tr>
          <th scope="col">What</th>
          <th scope="col">Column</th>
          <th scope="col">First values</th>
        </tr>
      </thead>
      <tbody>
        {fields.map((f) => (
          <tr key={f}>
            <th scope="row" class={missing.includes(f) ? 'bad' : ''}>
              {FIELD_WORDS[f]}
              {missing.includes(f) && <span class="sr"> is needed</span>}
            </th>
            <td>
              <select
                aria-label={`Column of ${FIELD_WORDS[f]}`}
                data-testid={`column-of-${f}`}
                value={columns[f] ?? ''}
                onChange={(e) => {
                  const { [f]: _, ...rest } = columns;
                  set(e.currentTarget.value ? { ...rest, [f]: e.currentTarget.value } : rest);
                }}
              >
                <option value="">none</option>
                {table.columns.map((c) => (
                  <option key={c} value={c}>
                    {c}
                  </option>
                ))}
              </select>
            </td>
            <td class="mut n">{columns[f] ? samples(columns[f]) : ''}</td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}
