/// Anchors: table and map linked, live estimates or the published revision, and the detail of the selected one.
import { effect, signal } from '@preact/signals';
import { useEffect, useMemo, useRef } from 'preact/hooks';
import { ApiError } from '../api/client';
import { anchors_url, published, row_of_estimate, type AnchorRow } from '../api/anchors';
import { enu_from_geodetic, type Geodetic } from '../map/enu';
import type { FlightPicture } from '../map/flight_layer';
import { MapBox } from '../map/map_box';
import { done_count, shown_estimates } from '../state/done';
import { backdrops } from '../state/floors';
import { may, me, may_publish } from '../state/session';
import {
  chosen_anchor,
  current_mission,
  current_scene,
  link,
  revision,
  synced,
  tick,
  watched_lost,
  when_back,
} from '../state/store';
import type { MissionMsg } from '../live/messages';
import { Empty, not_loaded_words } from '../ui/empty';
import { Unknown } from '../ui/unknown';
import { useLater } from '../ui/use_later';
import { ColumnPicker } from './anchor_columns';
import { Exports } from './pop_list';
import { AnchorTable, sorted_rows } from './anchor_table';
import { AnchorDetail } from './anchor_detail';
import { flight_picture } from './flight/picture';
import { load_compare, load_publish } from './dialog_chunks';
import { compare_open, publish_open } from './dialogs';

export const source = signal<'live' | 'published'>('live');
export const filter = signal('');
const loaded = signal<{ rows: readonly AnchorRow[]; revision: number | null } | null>(null);
const problem = signal<string | null>(null);

export async function load_published(): Promise<void> {
  try {
    loaded.value = await published();
    problem.value = null;
    if (loaded.value.revision !== null) revision.value = Math.max(revision.value ?? 0, loaded.value.revision);
  } catch (e) {
    problem.value = e instanceof ApiError ? e.message : String(e);
  }
}
let followed = false;
function follow_revisions(): void {
  if (followed) return;
  followed = true;
  effect(() => {
    revision.value;
    if (me.value) void load_published();
  });
}

/// Of the metres of what is published.
function origin_of(rows: readonly AnchorRow[]): Geodetic | null {
  const first = rows.find((r) => r.lon !== null && r.lat !== null);
  return first ? { lon: first.lon!, lat: first.lat!, h_m: first.h_m ?? 0 } : null;
}
/// Metres for the map: an anchor's own ENU, or its place on the globe about the first one where the revision mixes sites or flights.
function on_the_ground(rows: readonly AnchorRow[]): AnchorRow[] {
  const origin = origin_of(rows);
  if (!origin) return [...rows];
  return rows.map((r) =>
    r.lon === null || r.lat === null
      ? r
      : {
          ...r,
          enu_m: enu_from_geodetic({ lon: r.lon, lat: r.lat, h_m: r.h_m ?? 0 }, origin),
          mirror:
            r.mirror?.lon == null || r.mirror.lat == null
              ? null
              : {
                  ...r.mirror,
                  enu_m: enu_from_geodetic({ lon: r.mirror.lon, lat: r.mirror.lat, h_m: r.mirror.h_m ?? 0 }, origin),
                },
        },
  );
}

/// Of the flight that is on, what stands there: where anchors are, not how they were measured.
function building(): FlightPicture | null {
  const f = flight_picture();
  return (
    f && {
      ...f,
      waypoints: [],
      candidates: [],
      visited: [],
      target: null,
      heights: f.heights && { ...f.heights, waypoints: [], target: null },
    }
  );
}
function Compare() {
  const { part: Dialog } = useLater(load_compare);
  return Dialog ? <Dialog /> : null;
}
function Review({ mission }: { mission: MissionMsg }) {
  const { part: Dialog } = useLater(load_publish);
  return Dialog ? <Dialog mission={mission} /> : null;
}

export function Anchors({ anchor }: { anchor: string | null }) {
  tick.value;
  useEffect(() => {
    document.title = 'Anchors - anchord';
    follow_revisions();
  }, []);
  useEffect(() => when_back(() => void load_published()), []);
  const answered = useRef<string | null>(null),
    known = loaded.value;
  useEffect(() => {
    if (!anchor) {
      answered.current = null;
      return;
    }
    if (answered.current !== anchor) chosen_anchor.value = anchor;
    // A link means the published position, where there is one; asked once, since the reader may choose otherwise after it.
    if (known && answered.current !== anchor) {
      answered.current = anchor;
      source.value = known.rows.some((r) => r.anchor === anchor) ? 'published' : 'live';
    }
  }, [anchor, known]);
  const scene = current_scene(),
    live = source.value === 'live',
    mission = current_mission.value;
  const all = live ? shown_estimates(scene).map(row_of_estimate) : (loaded.value?.rows ?? []);
  const wanted = filter.value.trim().toLowerCase();
  const rows = sorted_rows(
    all.filter((r) => !wanted || `${r.anchor} ${r.name} ${r.status} ${r.verdict}`.toLowerCase().includes(wanted)),
  );
  const on_map = live ? rows : on_the_ground(rows);
  const linked = anchor !== null && chosen_anchor.value === anchor ? anchor : null,
    found = rows.find((r) => r.anchor === chosen_anchor.value) ?? null,
    // The first one stands in for no choice; never for an anchor that somebody sent a link to.
    selected = found ?? (linked ? null : (rows[0] ?? null)),
    looking = linked !== null && !found && !wanted;
  const search = useRef<HTMLInputElement>(null);
  const ready = done_count(live ? scene : null, live ? mission : null);
  const of = mission?.mission ?? null;
  const estimates = live ? scene?.estimates_version : loaded.value,
    marked = selected?.anchor;
  const version = useMemo(() => ({ live, estimates, wanted, marked }), [live, estimates, wanted, marked]);
  return (
    <div class="anchors" data-testid="anchors">
      <div class="toolbar">
        <h1>Anchors</h1>
        <div class="seg" role="group" aria-label="Which positions">
          <button
            aria-pressed={live}
            class={live ? 'on' : ''}
            data-testid="show-live"
            onClick={() => (source.value = 'live')}
          >
            Live<span class="roomy"> estimates</span>
          </button>
          <button
            aria-pressed={!live}
            class={live ? '' : 'on'}
            data-testid="show-published"
            onClick={() => {
              source.value = 'published';
              void load_published();
            }}
          >
            Published{revision.value === null ? '' : `, rev ${revision.value}`}
          </button>
        </div>
        <label class="search">
          <span class="sr">Filter anchors</span>
          <input
            id="filter"
            ref={search}
            value={filter.value}
            placeholder={`Filter ${all.length} anchor${all.length === 1 ? '' : 's'}`}
            data-testid="filter"
            onInput={(e) => (filter.value = e.currentTarget.value)}
          />
          <kbd aria-hidden="true">/</kbd>
        </label>
        <span class="grow" />
        <ColumnPicker live={live} />
        <button
          class="btn"
          data-testid="compare"
          disabled={link.value === 'lost'}
          onClick={() => {
            publish_open.value = false;
            compare_open.value = true;
          }}
        >
          Compare
        </button>
        <Exports
          help="anchors"
          files={[
            ['CSV', anchors_url('csv', live, of), 'anchors.csv'],
            ['GeoJSON', anchors_url('geojson', live, of), 'anchors.geojson'],
          ]}
        />
        {may_publish.value && (
          <button
            class="btn primary"
            data-testid="review"
            disabled={!mission || !all.length || link.value === 'lost'}
            onClick={() => {
              compare_open.value = false;
              publish_open.value = true;
            }}
          >
            <span>
              Review and publish
              {live && all.length > 0 && <span class="roomy">{`, ${ready.done} of ${ready.total}`}</span>}
            </span>
          </button>
        )}
      </div>
      <section class="tablebox" aria-label="Anchor table" tabIndex={0}>
        {problem.value && !live && (
          <div class="problem" role="status">
            <b>The published positions could not be read.</b> {problem.value}{' '}
            <button class="btn small" onClick={() => void load_published()}>
              Try again
            </button>
          </div>
        )}
        {rows.length ? (
          <AnchorTable rows={rows} selected={selected?.anchor ?? null} live={live} />
        ) : (
          <Nothing live={live} filtered={all.length > 0} />
        )}
      </section>
      <MapBox
        content={() => ({
          anchors: on_map,
          selected: selected?.anchor ?? null,
          scene: live ? current_scene() : null,
          link_lost: watched_lost(),
          running: mission?.state === 'recording',
          flight: live ? building() : null,
          backdrops: backdrops(live ? mission?.origin : origin_of(rows)),
        })}
        zero={live ? undefined : 'the first anchor'}
        onSelect={(a) => (chosen_anchor.value = a)}
        label="Map of the anchors in the table"
        follow={false}
        version={version}
      />
      <aside class="detailbox" aria-label="Selected anchor" tabIndex={0}>
        {selected ? (
          <AnchorDetail row={selected} live={live} changed={() => void load_published()} />
        ) : (
          <Missing anchor={looking ? linked : null} asked={known !== null || problem.value !== null} />
        )}
      </aside>
      {compare_open.value && <Compare />}
      {publish_open.value && mission && <Review mission={mission} />}
    </div>
  );
}

/// Beside the table where no anchor is shown; `anchor`: that an address names, `asked`: what is published has been asked for.
function Missing({ anchor, asked }: { anchor: string | null; asked: boolean }) {
  if (anchor !== null && asked && synced.value && !(link.value === 'lost' && loaded.value === null))
    return (
      <Unknown what="anchor" id={anchor} where="is published or in range in this flight">
        or choose one from the table.
      </Unknown>
    );
  return (
    <p class="why pad" role={anchor === null ? undefined : 'status'}>
      {anchor === null
        ? 'Nothing is selected.'
        : link.value === 'lost' && loaded.value === null
          ? not_loaded_words('lost')
          : `Looking for anchor ${anchor}.`}
    </p>
  );
}

function Nothing({ live, filtered }: { live: boolean; filtered: boolean }) {
  if (filtered)
    return (
      <div class="empty small">
        <p>No anchor matches the filter.</p>
        <button class="btn" onClick={() => (filter.value = '')}>
          Clear the filter
        </button>
      </div>
    );
  if (live)
    return (
      <div class="empty small">
        <Empty cls="" loaded={synced.value && link.value !== 'lost'}>
          {current_mission.value
            ? 'No anchor has been in range in this flight. Is the tag powered, and are anchors in range? Live shows what arrives.'
            : 'No flight yet, so no anchor has a position. Fly the first one, or import one.'}
        </Empty>
        <span class="ways">
          <a class="btn" href="#/live">
            Go to Live
          </a>
          {!current_mission.value && may('operator') && (
            <a class="btn" href="#/import">
              Import a flight
            </a>
          )}
        </span>
      </div>
    );
  return (
    <div class="empty small">
      <Empty cls="" loaded={loaded.value !== null} failed={problem.value !== null}>
        Nothing is published yet, and facility tools see an empty list. After a flight, Review and publish makes the
        first revision.
      </Empty>
      <button class="btn" onClick={() => (source.value = 'live')}>
        Show live estimates
      </button>
    </div>
  );
}
