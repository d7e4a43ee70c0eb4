/// What the columns of an imported flight are, how their values are written, and what no table says; asked for where the names do not say it, open to
/// change where they do.
import { useMemo, useState } from 'preact/hooks';
import { error_text } from '../../api/client';
import { on_globe, send_flight } from '../../api/imports';
import { load_missions } from '../../state/archive';
import { chosen_mission, say } from '../../state/store';
import { fixed, grouped } from '../../ui/format';
import { is_east, TRACK_AXES } from './axes';
import { guessed_ranges, guessed_track, is_local, missing_ranges, missing_track } from './fields';
import { FIELD_WORDS, RANGE_FIELDS, TRACK_FIELDS, type Columns, type Field } from './names';
import {
  flight_of,
  guessed_reading,
  heights_matter,
  needs_of,
  overlap_of,
  place_of,
  same_time,
  type About,
  type Declared,
  type Flight,
  type Overlap,
  type Reading,
} from './flight_files';
import { ADDRESS_KINDS, HEADING_KINDS, unused_columns } from './meaning';
import { arms_of, LeverArms } from './lever_arms';
import { typed_number } from '../../ui/typed_number';
import { HEIGHT_WORDS, place_kind } from './places';
import { anchor_columns, sample_of, with_a_row_for_each_range, type Table } from './table_file';
import { tags_of } from './tags';
import { FIX_NUMBERS, LENGTH_UNITS, TIME_UNITS, type TimeReading } from './values';

export interface Found {
  readonly track: Table;
  readonly ranges: Table;
  readonly declared: Declared | null;
  readonly name: string;
}
const field_words = (f: Field | 'time of the ranges'): string =>
  f === 'time of the ranges'
    ? 'the time of the ranges'
    : f === 'time'
      ? 'the time of the track'
      : FIELD_WORDS[f as keyof typeof FIELD_WORDS].toLowerCase();
const NEED_WORDS = {
  'tag address': 'the tag',
  'fix numbers': 'the meaning of the numbers of the fix class',
  heading: 'unit and direction of the heading',
  addresses: 'how addresses are written',
  axes: 'whether z of the track counts upwards',
  'unit of the track times': 'the unit of the times of the track',
  'unit of the range times': 'the unit of the times of the ranges',
  degrees:
    'latitude and longitude in decimal degrees (degrees and minutes, or one for the other?), or x and y of a map',
  crs: 'the coordinate system of x, y, z',
  heights: 'what the heights are above',
};
const MOST_ANCHORS = 64; ///< columns; a table of more numbers is none of one column for each anchor

export function Mapping({ found, back }: { found: Found; back: () => void }) {
  const { track, declared } = found,
    [ranges, set_ranges] = useState<Table>(found.ranges),
    [tc, set_tc] = useState<Columns>(() => guessed_track(track)),
    [rc, set_rc] = useState<Columns>(() => guessed_ranges(ranges)),
    [given, set_given] = useState<Partial<Reading>>({}),
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
  // A few seconds of work for a flight of hours: only where what it rests on changes.
  const asked = useMemo(() => guessed_reading(track, tc, ranges, rc, declared), [track, tc, ranges, rc, declared]),
    reading = useMemo<Reading>(() => ({ ...asked, ...given }), [asked, given]),
    kind = useMemo(() => place_kind(track, tc), [track, tc]),
    above_something = heights_matter(tc, reading.crs),
    needs = needs_of(track, tc, rc, reading, about.tag),
    one_time = same_time(track, tc, ranges, rc),
    complete =
      !needs.some((n) => !(n in NEED_WORDS)) && ![reading.track_time.unit, reading.range_time.unit].includes(null),
    missing = needs.map(
      (n) => NEED_WORDS[n as keyof typeof NEED_WORDS] ?? field_words(n as Field | 'time of the ranges'),
    ),
    overlap = useMemo(
      () => (complete ? overlap_of(track, tc, ranges, rc, reading, about.epoch_ms) : null),
      [complete, track, tc, ranges, rc, reading, about.epoch_ms],
    ),
    unused = useMemo(
      () =>
        track === ranges
          ? unused_columns(track, [tc, rc])
          : [...unused_columns(track, [tc]), ...unused_columns(ranges, [rc])],
      [track, tc, ranges, rc],
    ),
    [tags, both] = useMemo(() => tags_of(ranges, rc), [ranges, rc]),
    wide =
      !rc.anchor && !rc.range ? anchor_columns(ranges, Object.values({ ...rc, ...(track === ranges ? tc : {}) })) : [];
  const sigma_m = typed_number(arm_sigma),
    bad_arm = arms_of(tags, about).some((arm) => arm.some(Number.isNaN)),
    bad_sigma = sigma_m !== null && !(sigma_m > 0); // how much is too much the server says
  const send = async (): Promise<void> => {
    set_problem('');
    try {
      const flight = flight_of(track, tc, ranges, rc, reading, { ...about, lever_arm_sigma_m: sigma_m }, declared);
      if (!flight.fixes.length || !flight.ranges.length)
        throw new Error(flight.refused[0] ?? 'It does not contain a position and a range.');
      set_share(0);
      const [fixes, moved] = await placed(flight);
      const sent = await send_flight(flight.mission, fixes, flight.ranges, flight.names, set_share);
      await load_missions();
      chosen_mission.value = sent.mission;
      const not = sent.rejected + flight.refused.length,
        [odd] = flight.unknown_fix;
      say(
        [
          `${grouped(sent.accepted)} rows are in`,
          moved,
          not ? `${grouped(not)} rejected (first: ${flight.refused[0] ?? sent.first_reason})` : '',
          odd
            ? `${grouped(odd[1])} positions have the fix class "${odd[0]}", which is unknown: they count as no fix`
            : '',
          sent.unnamed ? `${sent.unnamed} names of anchors could not be kept` : '',
        ]
          .filter(Boolean)
          .join('; '),
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
          ? `${ranges.name}: ${grouped(ranges.rows.length)} rows, each with a position.`
          : `${track.name}: ${grouped(track.rows.length)} positions. ${ranges.name}: ${grouped(ranges.rows.length)} ranges.`}{' '}
        {missing.length === 0 ? 'All columns are known.' : `Still needed: ${missing.join('; ')}.`}
      </p>
      {wide.length > 1 && wide.length <= MOST_ANCHORS && (
        <p>
          No column is the range. Is each of {wide.slice(0, 4).join(', ')}
          {wide.length > 4 ? ` and ${wide.length - 4} more` : ''} an anchor?{' '}
          <button
            type="button"
            class="btn"
            data-testid="import-wide"
            onClick={() => {
              const long = with_a_row_for_each_range(ranges, wide);
              set_ranges(long);
              set_rc(guessed_ranges(long));
            }}
          >
            One column for each anchor
          </button>
        </p>
      )}
      <details open={!complete || needs.includes('degrees')}>
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
      </details>
      {unused.length > 0 && (
        <p class="mut" data-testid="import-unused">
          Columns that are not used: {unused.slice(0, 20).join(', ')}
          {unused.length > 20 ? ` and ${unused.length - 20} more` : ''}.
        </p>
      )}
      <div class="fields">
        <TimeFields
          label="Times of the track"
          of="track-time"
          value={reading.track_time}
          set={(track_time) => set_given({ ...given, track_time, ...(one_time ? { range_time: track_time } : {}) })}
        />
        <TimeFields
          label="Times of the ranges"
          of="range-time"
          value={reading.range_time}
          set={(range_time) => set_given({ ...given, range_time, ...(one_time ? { track_time: range_time } : {}) })}
        />
        <Choice
          label="Ranges are in"
          id="range-unit"
          value={reading.range}
          words={LENGTH_UNITS}
          set={(range) => set_given({ ...given, range })}
        />
        {tc.fix !== undefined && asked.fix !== 'words' && (
          <Choice
            label="Numbers of the fix class"
            id="fix-numbers"
            value={reading.fix}
            words={FIX_NUMBERS}
            set={(fix) => set_given({ ...given, fix })}
          />
        )}
        {asked.heading === null && (
          <Choice
            label={`Heading, column ${tc.heading}`}
            id="import-heading"
            value={reading.heading}
            words={HEADING_KINDS}
            set={(heading) => set_given({ ...given, heading })}
          />
        )}
        {is_local(tc) && asked.axes !== 'enu' && (
          <Choice
            label={is_east(tc.x) ? `Heights, column ${tc.z}, are of` : 'x, y, z of the track are'}
            id="import-axes"
            value={reading.axes ?? null}
            words={TRACK_AXES}
            set={(axes) => set_given({ ...given, axes })}
          />
        )}
        {asked.addresses === null && (
          <Choice
            label="Addresses are"
            id="import-addresses"
            value={reading.addresses}
            words={ADDRESS_KINDS}
            set={(addresses) => set_given({ ...given, addresses })}
          />
        )}
      </div>
      <div class="fields">
        {is_local(tc) && (
          <label>
            <span class="lab">Coordinate system of x, y, z</span>
            <input
              value={reading.crs ?? ''}
              placeholder={kind === 'map' ? 'EPSG:25832, UTM 32N' : 'a local frame'}
              aria-invalid={reading.crs === null}
              data-testid="import-crs"
              onInput={(e) => {
                const crs = e.currentTarget.value.trim();
                set_given({ ...given, crs: crs === '' && kind !== 'local' ? null : crs });
              }}
            />
          </label>
        )}
        {above_something && (
          <HeightsField
            value={reading.heights}
            has_column={tc.separation !== undefined}
            set={(heights) => set_given({ ...given, heights })}
          />
        )}
        {above_something && (
          <Choice
            label="Heights are in"
            id="height-unit"
            value={reading.height}
            words={LENGTH_UNITS}
            set={(height) => set_given({ ...given, height })}
          />
        )}
      </div>
      {kind === 'map' && !reading.crs && (
        <p class="caution" data-testid="import-map">
          x, y, z are more than 100 km from zero: coordinates of a map or a national grid. Name its EPSG code or zone;
          the server makes longitude and latitude of them.
        </p>
      )}
      {above_something && reading.heights === null && (
        <p class="caution" data-testid="import-heights">
          Nothing says what the heights are above. Anchors get heights above the ellipsoid; sea level is up to 100 m
          away from it.
        </p>
      )}
      {tc.fix === undefined && !(is_local(tc) && reading.crs === '') && (
        <p class="caution" data-testid="import-all-fixed">
          No column has the fix class: every position counts as RTK fixed. If some were float or single, anchors are
          wrong and nothing shows it.
        </p>
      )}
      {overlap && overlap.share < 0.5 && (
        <p class="caution" data-testid="import-apart">
          {apart_words(overlap)}
        </p>
      )}
      {both.length > 0 && (
        <p class="caution" data-testid="import-both">
          {both.slice(0, 8).join(', ')} {both.length === 1 ? 'is' : 'are'} tag of some ranges and anchor of others.
          Where the anchor began the exchange, tag and anchor are exchanged: write the tag first in each row; ranges
          between anchors have kind anchor_anchor.
        </p>
      )}
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
            {about.point !== 'tag_antenna' && <LeverArms tags={tags} about={about} set={set_about} />}
          </>
        )}
        {about.point !== 'tag_antenna' && (
          <label>
            <span class="lab">Accuracy of that measurement, one sigma, m</span>
            <input
              value={arm_sigma}
              inputMode="decimal"
              placeholder="not stated"
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
          disabled={missing.length > 0 || bad_arm || bad_sigma || share !== null}
        >
          {share === null ? 'Import' : `Importing, ${fixed(share * 100, 0)} %`}
        </button>
      </div>
    </form>
  );
}

/// The positions as the server takes them, and what was done to them, in words.
async function placed({ fixes, source }: Flight): Promise<readonly [readonly object[], string]> {
  if (!source) return [fixes, ''];
  const { places, what } = await on_globe(fixes.map(place_of), source);
  return [
    fixes.map((f, i) => {
      const { local_m: _, ...rest } = f,
        [lon, lat, h_m] = places[i]!;
      return { ...rest, lon, lat, h_m };
    }),
    what,
  ];
}

/// Above what heights are: one of those that are usual, or as the server reads it.
function HeightsField({
  value,
  has_column,
  set,
}: {
  value: string | null;
  has_column: boolean;
  set: (heights: string | null) => void;
}) {
  const { column: _, ...others } = HEIGHT_WORDS,
    words = has_column ? HEIGHT_WORDS : others,
    [other, set_other] = useState(value !== null && !(value in HEIGHT_WORDS));
  return (
    <>
      <Choice
        label="Heights are above"
        id="import-heights-above"
        value={other ? 'other' : (value as keyof typeof HEIGHT_WORDS | null)}
        words={words as typeof HEIGHT_WORDS}
        set={(w) => {
          set_other(w === 'other');
          set(w === 'other' ? null : w);
        }}
      />
      {other && (
        <label>
          <span class="lab">EPSG code of the heights, or height of the geoid there, m</span>
          <input
            value={value ?? ''}
            placeholder="EPSG:7837, 47.3"
            data-testid="import-heights-other"
            onInput={(e) => set(e.currentTarget.value.trim().replace(',', '.') || null)}
          />
        </label>
      )}
    </>
  );
}

/// Why ranges would stand without a position, with both spans: what is apart by hours or by 18 s is a zone or GPS time.
function apart_words({ share, track_us, ranges_us }: Overlap): string {
  const clock = (us: number): string => new Date(us / 1000).toISOString().replace('T', ' ').slice(0, 19),
    span = ([from, to]: readonly [number, number]): string => `${clock(from)} to ${clock(to)}`,
    apart_s = (ranges_us[0] - track_us[0]) / 1e6;
  return (
    `${fixed(share * 100, 0)} % of the ranges lie within the time of the track. Track: ${span(track_us)} UTC. ` +
    `Ranges: ${span(ranges_us)} UTC, ${grouped(Math.round(Math.abs(apart_s)))} s ${apart_s < 0 ? 'earlier' : 'later'}. ` +
    (Math.abs(Math.abs(apart_s) - 18) < 3
      ? 'That looks like GPS time in one of them.'
      : 'Ranges outside it get no position: check units and clocks under Times of the track and of the ranges.')
  );
}

function Choice<T extends string>({
  label,
  id,
  value,
  words,
  set,
}: {
  label: string;
  id: string;
  value: T | null;
  words: Readonly<Record<T, string>>;
  set: (value: T) => void;
}) {
  return (
    <label>
      <span class="lab">{label}</span>
      <select value={value ?? ''} data-testid={id} onChange={(e) => set(e.currentTarget.value as T)}>
        {value === null && <option value="">to be chosen</option>}
        {(Object.keys(words) as T[]).map((w) => (
          <option key={w} value={w}>
            {words[w]}
          </option>
        ))}
      </select>
    </label>
  );
}
function TimeFields({
  label,
  of,
  value,
  set,
}: {
  label: string;
  of: string;
  value: TimeReading;
  set: (value: TimeReading) => void;
}) {
  return (
    <>
      <Choice
        label={label}
        id={`${of}-unit`}
        value={value.unit}
        words={TIME_UNITS}
        set={(unit) => set({ ...value, unit })}
      />
      <Choice
        label={`${label}, clock`}
        id={`${of}-scale`}
        value={value.scale}
        words={{ utc: 'UTC', gps: 'GPS time' }}
        set={(scale) => set({ ...value, scale })}
      />
    </>
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
  const samples = (column: string): string => sample_of(table, column).slice(0, 3).join(', ');
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
