/// Import a flight: a folder, tables or an archive is dropped; columns whose names say nothing are given by a person; the flight opens.
import { useEffect, useRef, useState } from 'preact/hooks';
import './start.css';
import { Bundle } from './bundle';
import { guessed_ranges, guessed_track, missing_ranges, missing_track } from './fields';
import { declared_of } from './flight_files';
import { Mapping, type Found } from './mapping';
import { decoded, no_table, table_of, type Table } from './table_file';
import { entries_of, inflated } from './unzip';

async function texts_of(files: readonly File[]): Promise<{ name: string; read: () => Promise<string> }[]> {
  const out: { name: string; read: () => Promise<string> }[] = [];
  for (const f of files) {
    if (/\.zip$/i.test(f.name)) out.push(...entries_of(new Uint8Array(await f.arrayBuffer())));
    else out.push({ name: f.name, read: async () => decoded(new Uint8Array(await f.arrayBuffer())) });
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
  for (const t of texts.filter((x) => /\.(csv|tsv|txt|pos|llh)$/.test(base(x.name)) && !base(x.name).includes('truth')))
    tables.push(table_of(base(t.name), await t.read()));
  const other = tables.length ? undefined : texts.find((t) => /\.(gpx|kml|nmea|jsonl)$/.test(base(t.name)));
  if (other) throw new Error(`${other.name}: ${no_table(await other.read())}`);
  if (!tables.length)
    throw new Error('It contains no table: a flight is flight.json, track.csv and ranges.csv, or only tables.');
  const named = (what: RegExp): Table | undefined => tables.find((t) => what.test(t.name)),
    likeliest = (of: readonly Table[], missing: (t: Table) => number): Table | undefined =>
      [...of].sort((a, b) => missing(a) - missing(b))[0],
    ranges = named(/(^|[^a-z])(range|distance)/) ?? likeliest(tables, (t) => missing_ranges(guessed_ranges(t)).length)!,
    others = tables.filter((t) => t !== ranges),
    track =
      others.find((t) => /(^|[^a-z])(track|gnss|gps|pos|rover|fix)|\.(pos|llh)$/.test(t.name)) ??
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
    [bundle, set_bundle] = useState<File | null>(null),
    [problem, set_problem] = useState(''),
    [over, set_over] = useState(false),
    files = useRef<HTMLInputElement>(null),
    folder = useRef<HTMLInputElement>(null);
  useEffect(() => {
    document.title = 'Import a flight - anchord';
    folder.current?.setAttribute('webkitdirectory', '');
  }, []);
  const refused = (e: unknown): void => set_problem(e instanceof Error ? e.message : String(e));
  const take = (list: readonly File[]): void => {
    if (!list.length) return;
    set_problem('');
    const whole = list.find((f) => /\.anchord$/i.test(f.name));
    if (whole) {
      set_bundle(whole);
      return;
    }
    found_in(list).then(set_found, refused);
  };
  const picked = (e: Event): void => {
    const input = e.currentTarget as HTMLInputElement;
    take([...(input.files ?? [])]);
    input.value = '';
  };
  return (
    <div class="firstrun import" data-help="import" data-testid="import">
      <div>
        <h1>Import a flight</h1>
        <p class="lead">
          A flight folder (flight.json, track.csv, ranges.csv), only the two tables as a logger wrote them, or either as
          .zip. The track may be a .pos file of RTKLIB, and its positions of a map. Or a flight or site of another
          anchord server (.anchord). Nothing leaves this server.
        </p>
        {!found && !bundle && (
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
              if (e.dataTransfer) void dropped(e.dataTransfer.items).then(take, (x: unknown) => refused(x));
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
              accept=".csv,.tsv,.txt,.pos,.llh,.json,.zip,.gz,.anchord"
              hidden
              aria-label="Flight files"
              onChange={picked}
            />
            <input ref={folder} type="file" multiple hidden aria-label="Flight folder" onChange={picked} />
          </div>
        )}
        {problem && (
          <div class="problem" role="alert" data-testid="import-problem">
            <b>This is not a flight.</b> {problem}
          </div>
        )}
        {bundle && <Bundle file={bundle} back={() => set_bundle(null)} />}
        {found && <Mapping found={found} back={() => set_found(null)} />}
      </div>
    </div>
  );
}
