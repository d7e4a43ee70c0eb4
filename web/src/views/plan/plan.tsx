/// Plan: outline, areas and waypoints, drawn or typed; generated from the outline; checked while it is edited; saved by revision.
import { signal } from '@preact/signals';
import { useRef, useState } from 'preact/hooks';
import '../desk.css';
import './plan.css';
import { EMPTY, export_url } from '../../api/plans';
import { Elevation } from '../../map/elevation_box';
import { elevation_shown } from '../../map/elevation_shown';
import type { Geodetic } from '../../map/enu';
import { may } from '../../state/session';
import { current_mission, current_scene, now_ms, tick, watched_lost } from '../../state/store';
import { NotLoaded } from '../../ui/empty';
import { age } from '../../ui/format';
import { Problem } from '../../ui/problem';
import { Exports } from '../pop_list';
import { Unknown } from '../../ui/unknown';
import { useLater } from '../../ui/use_later';
import { PlanNotice } from '../flight/plan_notice';
import { CheckPanel, Profile } from './check_panel';
import { Conflict } from './conflict';
import type { Shape } from './draft';
import { Expected, placed } from './expected';
import { around, plan_content, rover_of } from './ground';
import { RoverTools, useBase } from './on_ground';
import { PlanMap } from './plan_map';
import { Corners, SettingFields, Waypoints } from './points';
import { cells, PredictedPanel, type Shown } from './predicted_panel';
import { usePlan, type Desk } from './use_plan';
import { WayTools } from './way_tools';

export function Plan({ id }: { id: string | null }) {
  const desk = usePlan(id),
    [shown, show] = useState<Shown>({ of: 'gdop', up: null }),
    { plan, origin, problem, back_ms, theirs } = desk,
    flown = current_scene()?.procedure?.value;
  return (
    <div class="plan" data-testid="plan">
      <Toolbar desk={desk} />
      <Problem text={problem} />
      {desk.unknown && (
        <Unknown what="plan" id={desk.unknown}>
          another plan is shown.
        </Unknown>
      )}
      {back_ms !== null && desk.dirty && !theirs && (
        <div class="callout" role="status" data-testid="brought-back">
          <b>Changes of {age(Date.now() - back_ms)} ago, not saved yet.</b> They are kept on this device until then.{' '}
          <button class="btn small" onClick={() => desk.open(desk.saved)}>
            Discard them
          </button>
        </div>
      )}
      {theirs && (
        <Conflict
          mine={plan}
          theirs={theirs}
          origin={origin}
          keep_mine={desk.keep_mine}
          take_theirs={() => desk.open(theirs)}
          later={desk.decide_later}
        />
      )}
      {flown && flown.plan === plan.id && (
        <div class={watched_lost() ? 'lost' : ''}>
          <PlanNotice p={flown} />
        </div>
      )}
      {floor_plan_open.value && <FloorPlan desk={desk} />}
      <div class="planbody">
        <Drawn desk={desk} shown={shown} />
        {desk.ready && <Side desk={desk} shown={shown} show={show} />}
      </div>
    </div>
  );
}

const floor_plan_open = signal(false);
const load_floor_plan = () => import('./floor_plan').then((m) => m.FloorPlanDialog);
function FloorPlan({ desk }: { desk: Desk }) {
  const { part: Dialog } = useLater(load_floor_plan);
  return Dialog ? (
    <Dialog
      corners={desk.plan.outline}
      close={() => (floor_plan_open.value = false)}
      use_outline={(outline) => desk.change({ ...desk.plan, outline: [...outline] })}
    />
  ) : null;
}

function Toolbar({ desk }: { desk: Desk }) {
  const { all, plan, dirty, able, busy } = desk,
    file = useRef<HTMLInputElement>(null);
  return (
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
            if (p) desk.open_with_draft(p);
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
        readOnly={!able}
        onInput={(e) => desk.rename(e.currentTarget.value)}
      />
      <span class="mut">
        {!desk.ready ? '' : plan.id ? `revision ${plan.revision}${dirty ? ', changed' : ''}` : 'not saved'}
      </span>
      <span class="grow" />
      {may('integrator') && (
        <button class="btn" data-testid="open-floor-plan" onClick={() => (floor_plan_open.value = true)}>
          Floor plan
        </button>
      )}
      {able && (
        <>
          <button class="btn" disabled={!desk.can_undo} onClick={desk.undo}>
            Undo
          </button>
          <button class="btn" disabled={!desk.can_redo} onClick={desk.redo}>
            Redo
          </button>
          <button class="btn" onClick={() => desk.open(EMPTY)} disabled={dirty}>
            New
          </button>
          <button class="btn" onClick={() => file.current?.click()}>
            Import
          </button>
        </>
      )}
      <input
        ref={file}
        type="file"
        accept=".plan,.json,.geojson,.kml"
        hidden
        aria-label="Plan file"
        onChange={(e) => {
          const f = e.currentTarget.files?.[0];
          if (f) desk.bring(f);
          e.currentTarget.value = '';
        }}
      />
      {plan.id && !dirty && (
        <Exports
          help="plan"
          files={[
            ['.plan', export_url(plan.id, 'plan'), `${plan.name}.plan`],
            ['GeoJSON', export_url(plan.id, 'geojson'), `${plan.name}.geojson`],
          ]}
        />
      )}
      {able && (
        <button
          class="btn"
          data-testid="generate"
          disabled={plan.outline.length < 3 || busy !== ''}
          onClick={desk.propose}
        >
          {busy === 'generate' ? 'Planning' : 'Generate'}
        </button>
      )}
      {able && (
        <button class="btn primary" data-testid="save" disabled={!dirty || busy !== ''} onClick={desk.keep}>
          Save
        </button>
      )}
    </div>
  );
}

const nothing = (): void => undefined; // a plan that one may only look at does not change under the finger

/// The map, and what a tap on it adds.
function Drawn({ desk, shown }: { desk: Desk; shown: Shown }) {
  const { plan, origin, picked, pick, change, check, known, able } = desk,
    [drawing, set_drawing] = useState<Shape>('outline'),
    [snap, set_snap] = useState(true),
    [walk, set_walk] = useState<number | null>(null),
    base = useBase(origin),
    sided = elevation_shown.value ?? plan.waypoints.length > 1;
  const no_flies = plan.no_fly.map((_, i): [Shape, string] => [`no_fly/${i}`, `No-fly ${i + 1}`]);
  const areas: readonly (readonly [Shape, string])[] = [
    ['outline', 'Outline'],
    ['fence', 'Fence'],
    ...no_flies,
    [`no_fly/${plan.no_fly.length}`, 'New no-fly'],
    ['waypoints', 'Waypoints'],
  ];
  return (
    <div class="planleft">
      {able && (
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
            title="Snap to right angles and half metres"
            onClick={() => set_snap(!snap)}
          >
            {snap ? 'Snap on' : 'Snap off'}
          </button>
          {origin && (
            <RoverTools plan={plan} origin={origin} drawing={drawing} change={change} walk={walk} set_walk={set_walk} />
          )}
        </div>
      )}
      {!desk.ready ? (
        <NotLoaded cls="why pad" failed={desk.problem !== ''} />
      ) : origin ? (
        <PlanMap
          plan={plan}
          origin={origin}
          drawing={drawing}
          picked={picked}
          snap={snap}
          cells={cells(check, shown, plan, origin)}
          anchors={placed(plan, known, origin)}
          base={base}
          rover={rover_of(current_scene(), origin, now_ms(), watched_lost())?.m ?? null}
          walk={walk}
          sided={sided}
          set_sided={(on) => (elevation_shown.value = on)}
          pick={pick}
          change={able ? change : nothing}
        />
      ) : able ? (
        <Where set={desk.set_origin} />
      ) : (
        <p class="why pad">There is no plan yet. An operator draws one.</p>
      )}
      {origin && sided && <PlanElevation desk={desk} origin={origin} />}
    </div>
  );
}

/// The plan from the side: waypoints between lowest and highest, the roof, and what is known of the place.
function PlanElevation({ desk, origin }: { desk: Desk; origin: Geodetic }) {
  const { plan, known, picked } = desk,
    waypoint = picked?.shape === 'waypoints' ? picked.index : null,
    content = () => {
      const mission = current_mission.peek(),
        scene = current_scene();
      return plan_content(
        plan,
        origin,
        scene,
        around(plan, origin, mission, scene),
        known,
        { running: mission?.state === 'recording', link_lost: watched_lost() },
        waypoint,
      );
    };
  tick.value;
  return <Elevation content={content} onSelect={nothing} version={picked ?? plan} zero="the ground" />;
}

/// The plan in numbers: its check, and everything drawn as fields.
function Side({ desk, shown, show }: { desk: Desk; shown: Shown; show: (s: Shown) => void }) {
  const { plan, origin, picked, pick, change, check, known, able, dirty } = desk;
  return (
    <div class="planside" tabIndex={0} role="region" aria-label="Plan in numbers">
      <CheckPanel
        check={check}
        old={desk.check_is_old}
        plan={plan}
        waits={dirty && !able ? 'Save to have it checked.' : 'Checking.'}
      />
      {origin && <Profile plan={plan} origin={origin} picked={picked} pick={pick} />}
      <PredictedPanel check={check} shown={shown} set={show} />
      {desk.notes.length > 0 && (
        <div class="callout">
          <b>Imported.</b>
          <ul>
            {desk.notes.map((n) => (
              <li key={n}>{n}</li>
            ))}
          </ul>
        </div>
      )}
      <fieldset class="readable" disabled={!able}>
        <section class="sec-p">
          <div class="hd">
            <h2>Waypoints</h2>
            <span class="meta">{plan.waypoints.length}</span>
          </div>
          {able && <WayTools plan={plan} origin={origin} picked={picked} change={change} />}
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
      </fieldset>
      {able && plan.id && !dirty && (
        <section class="sec-p">
          <button class="btn" onClick={desk.take_away}>
            Remove this plan
          </button>
        </section>
      )}
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
