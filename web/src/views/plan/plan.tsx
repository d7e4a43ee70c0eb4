/// Plan: outline, areas and waypoints, drawn or typed; generated from the outline; judged while it is edited; saved by revision.
import { useEffect, useLayoutEffect, useRef, useState } from 'preact/hooks';
import '../desk.css';
import './plan.css';
import { published, type AnchorRow } from '../../api/anchors';
import { ApiError, said } from '../../api/client';
import {
  check as fetch_check,
  check_drawn,
  EMPTY,
  export_url,
  generate,
  import_file,
  plans as fetch_plans,
  read,
  remove,
  save,
  type Check,
  type Plan as PlanDoc,
} from '../../api/plans';
import type { Geodetic } from '../../map/enu';
import { may } from '../../state/session';
import { draft_of, drop_draft, keep_draft, newest_draft } from '../../state/drafts';
import { current_mission, say } from '../../state/store';
import { age } from '../../ui/format';
import { Icon } from '../../ui/marks';
import { CheckPanel, Profile } from './check_panel';
import { Conflict } from './conflict';
import {
  begun,
  changed,
  draft_key,
  origin_of,
  plan_from_draft,
  redone,
  undone,
  type History,
  type Picked,
  type Shape,
} from './draft';
import { Expected, placed } from './expected';
import { PlanMap } from './plan_map';
import { Corners, SettingFields, Waypoints } from './points';
import { cells, PredictedPanel, type Shown } from './predicted_panel';
import { WayTools } from './way_tools';
import { useStable } from '../../ui/use_stable';

const JUDGED_AFTER_MS = 500; ///< of no change: a drag is not judged at every step

export function Plan({ id }: { id: string | null }) {
  const [all, set_all] = useState<readonly PlanDoc[] | null>(null),
    [history, set_history] = useState<History>(begun(EMPTY)),
    [saved, set_saved] = useState<PlanDoc>(EMPTY),
    [drawing, set_drawing] = useState<Shape>('outline'),
    [picked, pick] = useState<Picked | null>(null);
  const [judged, set_judged] = useState<{ readonly of: string; readonly check: Check } | null>(null),
    [problem, set_problem] = useState(''),
    [theirs, set_theirs] = useState<PlanDoc | null>(null),
    [notes, set_notes] = useState<readonly string[]>([]),
    [busy, set_busy] = useState(''),
    [origin, set_origin] = useState<Geodetic | null>(null),
    [back_ms, set_back] = useState<number | null>(null),
    [snap, set_snap] = useState(true),
    [shown, show] = useState<Shown>({ of: 'gdop', up: null }),
    [known, set_known] = useState<ReadonlyMap<string, AnchorRow>>(new Map());
  const file = useRef<HTMLInputElement>(null),
    plan = history.now,
    dirty = plan !== saved,
    engineer = may('engineer', 'operator');
  // Metres are about one origin for as long as a plan is open: a map that moves while it is drawn on cannot be used.
  const open = (p: PlanDoc): void => {
    set_origin(origin_of(p, current_mission.peek()?.origin ?? null));
    set_history(begun(p));
    set_saved(p);
    pick(null);
    set_judged(null);
    set_theirs(null);
    set_notes([]);
    set_back(null);
  };
  /// What was not saved when the page went away is on the drawing again, as one change that can be undone.
  const open_with_draft = (p: PlanDoc): void => {
    const draft = draft_of(draft_key(p.id)),
      kept = plan_from_draft(draft?.value);
    open(p);
    if (!draft || !kept || kept.id !== p.id) return;
    set_origin(origin_of(kept, origin_of(p, current_mission.peek()?.origin ?? null)));
    set_history(changed(begun(p), kept));
    set_back(draft.at_ms);
  };
  const guarded = async (what: string, work: () => Promise<void>): Promise<void> => {
    set_busy(what);
    set_problem('');
    try {
      await work();
    } catch (e) {
      set_problem(said(e));
    }
    set_busy('');
  };
  const begin = useStable((): void => {
    document.title = 'Plan - anchord';
    fetch_plans().then(
      (list) => {
        set_all(list);
        const last = id ? null : newest_draft('plan/')?.key,
          wanted =
            list.find((p) => p.id === id) ??
            list.find((p) => draft_key(p.id) === last) ??
            (last === draft_key(null) ? EMPTY : list[0]);
        open_with_draft(wanted ?? EMPTY);
      },
      (e: unknown) => set_problem(said(e)),
    );
  });
  useEffect(begin, [id, begin]);
  useEffect(() => {
    published().then(
      ({ rows }) => set_known(new Map(rows.map((r) => [r.anchor, r]))),
      () => undefined,
    );
  }, []);
  // Judged while it is drawn; whoever may only look sees what is saved judged. The last judgement stays, grey, until the next comes.
  const drawn = JSON.stringify({ ...plan, name: '', revision: 0, id: null }),
    check = judged?.check ?? null;
  const judge = useStable((): Promise<Check> | null => {
    if (!dirty) return saved.id ? fetch_check(saved.id) : null;
    return engineer && (plan.waypoints.length > 0 || plan.outline.length > 2) ? check_drawn(plan) : null;
  });
  useEffect(() => {
    let gone = false;
    const timer = setTimeout(
      () =>
        void judge()?.then(
          (c) => {
            if (!gone) set_judged({ of: drawn, check: c });
          },
          () => undefined,
        ),
      dirty ? JUDGED_AFTER_MS : 0,
    );
    return () => {
      gone = true;
      clearTimeout(timer);
    };
  }, [drawn, dirty, saved.id, judge]);
  // With the change itself, not after the next picture: the page may be gone by then.
  const listed = all !== null;
  useLayoutEffect(() => {
    if (!listed) return;
    if (dirty) keep_draft(draft_key(plan.id), plan);
    else drop_draft(draft_key(plan.id));
  }, [plan, saved, dirty, listed]);
  const change = (p: PlanDoc): void => set_history(changed(history, p));
  const keep = (): void =>
    void guarded('save', async () => {
      try {
        const kept = await save(plan);
        drop_draft(draft_key(plan.id));
        set_history(begun(kept));
        set_saved(kept);
        set_theirs(null);
        set_all([kept, ...(all ?? []).filter((p) => p.id !== kept.id)]);
        say(`Saved, revision ${kept.revision}`);
      } catch (e) {
        // Somebody else saved meanwhile: both versions are shown, nothing is overwritten in silence.
        if (e instanceof ApiError && e.problem.status === 412 && plan.id) set_theirs(await read(plan.id));
        else throw e;
      }
    });
  const propose = (): void =>
    void guarded('generate', async () => {
      const made = await generate(plan);
      set_history(changed(history, made.plan));
      say(`${made.plan.waypoints.length} waypoints proposed`);
    });
  const bring = (f: File): void =>
    void guarded('import', async () => {
      const made = await import_file(f.name.replace(/\.\w+$/, ''), await f.text());
      set_history(
        changed(history, { ...made.plan, id: plan.id, revision: plan.revision, name: plan.name || made.plan.name }),
      );
      set_notes(made.notes);
      set_origin(origin_of(made.plan, origin));
    });
  const no_flies = plan.no_fly.map((_, i): [Shape, string] => [`no_fly/${i}`, `No-fly ${i + 1}`]);
  const areas: readonly (readonly [Shape, string])[] = [
    ['outline', 'Outline'],
    ['fence', 'Fence'],
    ...no_flies,
    [`no_fly/${plan.no_fly.length}`, 'New no-fly'],
    ['waypoints', 'Waypoints'],
  ];
  return (
    <div class="plan" data-testid="plan">
      <div class="toolbar">
        <h1>Plan</h1>
        {all && all.length > 0 && (
          <select
            aria-label="Plan"
            data-testid="plan-choice"
            value={plan.id ?? ''}
            disabled={dirty}
            onChange={(e) => {
              const p = all.find((x) => x.id === e.currentTarget.value);
              if (p) open_with_draft(p);
            }}
          >
            {!plan.id && <option value="">new plan</option>}
            {all.map((p) => (
              <option key={p.id} value={p.id!}>
                {p.name}
              </option>
            ))}
          </select>
        )}
        <input
          class="planname"
          aria-label="Name of the plan"
          placeholder="Name"
          value={plan.name}
          data-testid="plan-name"
          maxLength={200}
          onInput={(e) => set_history({ ...history, now: { ...plan, name: e.currentTarget.value } })}
        />
        <span class="mut">{plan.id ? `revision ${plan.revision}${dirty ? ', changed' : ''}` : 'not saved'}</span>
        <span class="grow" />
        <button class="btn" disabled={!history.before.length} onClick={() => set_history(undone(history))}>
          Undo
        </button>
        <button class="btn" disabled={!history.after.length} onClick={() => set_history(redone(history))}>
          Redo
        </button>
        {engineer && (
          <button class="btn" onClick={() => open(EMPTY)} disabled={dirty}>
            New
          </button>
        )}
        <button class="btn" onClick={() => file.current?.click()}>
          Import
        </button>
        <input
          ref={file}
          type="file"
          accept=".plan,.json,.geojson,.kml"
          hidden
          aria-label="Plan file"
          onChange={(e) => {
            const f = e.currentTarget.files?.[0];
            if (f) bring(f);
            e.currentTarget.value = '';
          }}
        />
        {plan.id && !dirty && (
          <>
            <a class="btn" href={export_url(plan.id, 'plan')} download={`${plan.name}.plan`}>
              <Icon name="download" />
              .plan
            </a>
            <a class="btn" href={export_url(plan.id, 'geojson')} download={`${plan.name}.geojson`}>
              <Icon name="download" />
              GeoJSON
            </a>
          </>
        )}
        {engineer && (
          <button
            class="btn"
            data-testid="generate"
            disabled={plan.outline.length < 3 || busy !== ''}
            onClick={propose}
          >
            {busy === 'generate' ? 'Planning' : 'Generate'}
          </button>
        )}
        {engineer && (
          <button class="btn primary" data-testid="save" disabled={!dirty || busy !== ''} onClick={keep}>
            Save
          </button>
        )}
      </div>
      {problem && (
        <div class="problem" role="status">
          <b>That did not work.</b> {problem}
        </div>
      )}
      {back_ms !== null && dirty && !theirs && (
        <div class="callout" role="status" data-testid="brought-back">
          <b>Your changes of {age(Date.now() - back_ms)} ago are back.</b> They were not saved when the page was closed.{' '}
          <button class="btn small" onClick={() => open(saved)}>
            Discard them
          </button>
        </div>
      )}
      {theirs && (
        <Conflict
          mine={plan}
          theirs={theirs}
          origin={origin}
          keep_mine={() => {
            set_history(changed(history, { ...plan, revision: theirs.revision }));
            set_theirs(null);
          }}
          take_theirs={() => open(theirs)}
        />
      )}
      <div class="planbody">
        <div class="planleft">
          <div class="drawrow">
            <div class="drawbar seg" role="group" aria-label="What a tap adds">
              {areas.map(([shape, words]) => (
                <button
                  key={words}
                  class={drawing === shape ? 'on' : ''}
                  aria-pressed={drawing === shape}
                  data-testid={`draw-${words.toLowerCase().replace(' ', '-')}`}
                  onClick={() => set_drawing(shape)}
                >
                  {words}
                </button>
              ))}
            </div>
            <button
              class="btn"
              aria-pressed={snap}
              data-testid="snap"
              title="To right angles and half metres"
              onClick={() => set_snap(!snap)}
            >
              {snap ? 'Snap on' : 'Snap off'}
            </button>
          </div>
          {origin ? (
            <PlanMap
              plan={plan}
              origin={origin}
              drawing={drawing}
              picked={picked}
              snap={snap}
              cells={cells(check, shown, plan, origin)}
              anchors={placed(plan, known, origin)}
              pick={pick}
              change={change}
            />
          ) : (
            <Where set={set_origin} />
          )}
        </div>
        <div class="planside" tabIndex={0} role="region" aria-label="Plan in numbers">
          <CheckPanel
            check={check}
            old={judged !== null && judged.of !== drawn}
            plan={plan}
            waits={dirty && !engineer ? 'Save to have it checked.' : 'Checking.'}
          />
          {origin && <Profile plan={plan} origin={origin} picked={picked} pick={pick} />}
          <PredictedPanel check={check} shown={shown} set={show} />
          {notes.length > 0 && (
            <div class="callout">
              <b>Imported.</b>
              <ul>
                {notes.map((n) => (
                  <li key={n}>{n}</li>
                ))}
              </ul>
            </div>
          )}
          <section class="sec-p">
            <div class="hd">
              <h2>Waypoints</h2>
              <span class="meta">{plan.waypoints.length}</span>
            </div>
            {engineer && <WayTools plan={plan} origin={origin} picked={picked} change={change} />}
            <Waypoints plan={plan} picked={picked} pick={pick} change={change} />
          </section>
          <section class="sec-p">
            <h2>Areas</h2>
            {plan.outline.length === 0 && (
              <p class="why">The outline of the building comes first: tap its corners, or import a GeoJSON.</p>
            )}
            <Corners plan={plan} shape="outline" name="Outline" picked={picked} pick={pick} change={change} />
            <Corners plan={plan} shape="fence" name="Fence" picked={picked} pick={pick} change={change} />
            {plan.no_fly.map((_, i) => (
              <Corners
                key={i}
                plan={plan}
                shape={`no_fly/${i}`}
                name={`No-fly ${i + 1}`}
                picked={picked}
                pick={pick}
                change={change}
              />
            ))}
          </section>
          <Expected plan={plan} known={known} origin={origin} change={change} />
          <section class="sec-p">
            <h2>Settings</h2>
            <SettingFields plan={plan} change={change} />
          </section>
          {engineer && plan.id && !dirty && (
            <section class="sec-p">
              <button
                class="btn"
                onClick={() =>
                  void guarded('remove', async () => {
                    await remove(plan);
                    set_all((all ?? []).filter((p) => p.id !== plan.id));
                    open(EMPTY);
                    say('Plan removed');
                  })
                }
              >
                Remove this plan
              </button>
            </section>
          )}
        </div>
      </div>
    </div>
  );
}

/// Without a flight and without a drawing nobody knows where on the globe to draw.
function Where({ set }: { set: (o: Geodetic) => void }) {
  const [text, set_text] = useState(''),
    parts = text.split(/[,;\s]+/).map(Number),
    good =
      parts.length === 2 && parts.every(Number.isFinite) && Math.abs(parts[0]!) <= 90 && Math.abs(parts[1]!) <= 180;
  return (
    <div class="empty">
      <p>Where is the building? Type the latitude and longitude of its middle, or import an outline.</p>
      <form
        class="addform"
        onSubmit={(e) => {
          e.preventDefault();
          if (good) set({ lat: parts[0]!, lon: parts[1]!, h_m: 0 });
        }}
      >
        <input
          aria-label="Latitude, longitude"
          data-testid="where"
          placeholder="51.0232, 3.7133"
          value={text}
          onInput={(e) => set_text(e.currentTarget.value)}
        />
        <button class="btn primary" disabled={!good}>
          Draw here
        </button>
      </form>
    </div>
  );
}
