/// Review and publish: a fresh calibration of the whole flight, the result of every anchor against the live estimate, then one revision for facility tools.
import { useEffect, useRef, useState } from 'preact/hooks';
import { idempotency_key, error_text } from '../api/client';
import {
  calibrate,
  moved_since_published,
  newest_calibration,
  note_of,
  over_goal_words,
  publish,
  report_url,
  type AnchorRow,
  type Calibration,
  type Moved,
} from '../api/anchors';
import { handover_url } from '../api/missions';
import type { EstimateMsg, MissionMsg } from '../live/messages';
import { enu_from_geodetic } from '../map/enu';
import { may } from '../state/session';
import { keep_draft } from '../state/drafts';
import { current_scene, revision, say } from '../state/store';
import { accuracy, date, fixed } from '../ui/format';
import { Icon, Mark, StatusChip, STATUS_LOOK } from '../ui/marks';
import { Problem } from '../ui/problem';
import { useDraft } from '../ui/use_draft';
import { gate_line } from '../ui/gates';
import { VERDICT_WORDS } from '../ui/words';
import { useDialog } from '../ui/use_dialog';
import { useStable } from '../ui/use_stable';
import { publish_open } from './dialogs';
import { plan_again } from './plan_again';
import { draft_key } from './plan/draft';
import { ReviewAnchor } from './review_anchor';
import { FlightTime } from './flight/flight_time';
import { flying } from './flight/words';
import { LeverArmSigma } from './lever_arm_sigma';
import { largest_part } from './largest_part';

interface Form {
  readonly note: string;
  readonly reasons: Readonly<Record<string, string>>; ///< of overrides, by anchor
  readonly left: Readonly<Record<string, string>>; ///< why an anchor that passes is left out
}

export function Publish({ mission }: { mission: MissionMsg }) {
  const [draft, set_draft] = useState<Calibration | null>(null),
    [moved, set_moved] = useState<ReadonlyMap<string, Moved>>(new Map()),
    [problem, set_problem] = useState(''),
    [busy, set_busy] = useState<'' | 'calibrating' | 'publishing' | 'planning'>('calibrating'),
    [solving, set_solving] = useState(false),
    [picked, pick] = useState<string | null>(null);
  const solves = may('engineer');
  const keys = useRef({ calibrate: idempotency_key(), publish: idempotency_key() }),
    [form, change, forget] = useDraft<Form>(`publish/${mission.mission}`, { note: '', reasons: {}, left: {} }),
    { note, reasons, left } = form,
    box = useDialog<HTMLElement>(() => (publish_open.value = false), 'landed');
  const guarded = async (what: 'calibrating' | 'publishing' | 'planning', work: () => Promise<void>): Promise<void> => {
    set_busy(what);
    set_problem('');
    try {
      await work();
    } catch (e) {
      set_problem(error_text(e));
    }
    set_busy('');
  };
  const solve = useStable(
    (anew: boolean, arm_sigma_m: number | null = null): void =>
      void guarded('calibrating', async () => {
        // After landing the server has solved the flight by itself: that is what waits for review.
        const there = solves && anew ? null : await newest_calibration(mission.mission);
        const waits = there && (!solves || (there.after_landing && !in_air()));
        set_solving(solves && !waits);
        const solved = waits
          ? there
          : solves
            ? await calibrate(mission.mission, keys.current.calibrate, arm_sigma_m)
            : null;
        if (!solved) throw new Error('This flight is not solved yet: an engineer has to calibrate it first.');
        set_moved(await moved_since_published(solved.id).catch(() => new Map<string, Moved>()));
        set_draft(solved);
      }),
  );
  useEffect(() => {
    solve(false);
  }, [solve]);
  const out = Object.entries(left).filter(([id]) => draft?.rows.some((r) => r.anchor === id && passes(r))),
    good = draft?.rows.filter((r) => passes(r) && left[r.anchor] === undefined) ?? [],
    overrides = Object.entries(reasons)
      .filter(([id, reason]) => reason.trim() !== '' && draft?.rows.some((r) => r.anchor === id && may_override(r)))
      .map(([network_id, reason]) => ({ network_id, reason: reason.trim() }));
  const going = good.length + overrides.length,
    n_over = good.filter((r) => r.status === 'over_goal').length;
  const send = (): void =>
    void guarded('publishing', async () => {
      const n = await publish(
        draft!.id,
        note_of(note, out),
        overrides,
        keys.current.publish,
        out.length ? [...good.map((r) => r.anchor), ...overrides.map((o) => o.network_id)] : null,
      );
      if (n !== null) revision.value = Math.max(revision.value ?? 0, n);
      say(`Published${n === null ? '' : ` as revision ${n}`}`);
      forget();
      publish_open.value = false;
    });
  const unseen = draft?.rows.filter((r) => r.gates.some((g) => g.name === 'unseen_arm' && !g.passed)).length ?? 0;
  const solve_again = (arm_sigma_m: number | null): void => {
    keys.current.calibrate = idempotency_key();
    solve(true, arm_sigma_m);
  };
  const reviewed = draft?.rows.find((r) => r.anchor === picked) ?? null,
    lacking = draft?.rows.filter((r) => !passes(r) || r.status === 'over_goal' || left[r.anchor] !== undefined) ?? [];
  const fly_again = (): void =>
    void guarded('planning', async () => {
      const made = await plan_again(mission.mission, lacking);
      keep_draft(draft_key(null), made);
      say(`A plan for ${lacking.length} anchor${lacking.length === 1 ? '' : 's'}: check it, then save it`);
      publish_open.value = false;
      location.hash = '#/plan';
    });
  return (
    <section class={reviewed ? 'drawer wide' : 'drawer'} {...box} aria-labelledby="publish-title" data-testid="publish">
      <div class="hd big">
        <h2 id="publish-title">Review and publish</h2>
        <span class="grow" />
        <button class="btn quiet" aria-label="Close" onClick={() => (publish_open.value = false)}>
          <Icon name="close" />
        </button>
      </div>
      <p class="why">
        {mission.name}:{' '}
        {draft?.after_landing
          ? `all ranges were solved together after landing, ${date(draft.created_at)}.`
          : solves
            ? !draft && !solving
              ? 'its newest calibration is loading.'
              : 'all stored ranges are solved again, together.'
            : 'the newest calibration by an engineer.'}{' '}
        {solves && draft?.after_landing && (
          <button class="btn small" data-testid="solve-again" disabled={busy !== ''} onClick={() => solve_again(null)}>
            Solve again
          </button>
        )}{' '}
        What is published is what facility tools read; the running estimates are not.
      </p>
      <FlightTime mission={mission.mission} />
      {solves && draft && (unseen > 0 || draft.lever_arm_sigma_m !== null) && (
        <LeverArmSigma
          key={draft.id}
          withheld={unseen}
          held_m={draft.lever_arm_sigma_m}
          busy={busy !== ''}
          solve={solve_again}
        />
      )}
      {busy === 'calibrating' && solving && <p role="status">Solving {mission.n_ranges} ranges.</p>}
      <Problem text={problem}>
        {!draft && (
          <button
            class="btn small"
            onClick={() => {
              keys.current.calibrate = idempotency_key();
              solve(false);
            }}
          >
            Try again
          </button>
        )}
      </Problem>
      {draft && (
        <>
          <div class="scroll" tabIndex={0} aria-label="Result of the calibration">
            <table class="tbl" data-testid="draft">
              <caption class="sr">Result of the calibration for each anchor</caption>
              <thead>
                <tr>
                  <th scope="col">Anchor</th>
                  <th scope="col">Result</th>
                  <th scope="col" class="num">
                    95 % h
                  </th>
                  <th scope="col" class="num">
                    95 % v
                  </th>
                  <th scope="col" class="num">
                    From live, m
                  </th>
                  <th scope="col" class="num">
                    From published, m
                  </th>
                  <th scope="col">Goes out</th>
                </tr>
              </thead>
              <tbody>
                {draft.rows.map((r) => (
                  <DraftRow
                    key={r.anchor}
                    picked={r.anchor === picked}
                    pick={() => pick(r.anchor === picked ? null : r.anchor)}
                    r={r}
                    moved={moved.get(r.anchor)}
                    over={r.status === 'over_goal' ? over_goal_words(r) : ''}
                    reason={reasons[r.anchor]}
                    set_reason={(reason) => change({ reasons: { ...reasons, [r.anchor]: reason } })}
                    left={left[r.anchor]}
                    leave={(why) =>
                      change({
                        left:
                          why === null
                            ? Object.fromEntries(Object.entries(left).filter(([id]) => id !== r.anchor))
                            : { ...left, [r.anchor]: why },
                      })
                    }
                  />
                ))}
              </tbody>
            </table>
          </div>
          {reviewed && <ReviewAnchor row={reviewed} rows={draft.rows} pick={pick} />}
          <label class="lab" for="note">
            Note
          </label>
          <input
            id="note"
            value={note}
            onInput={(e) => change({ note: e.currentTarget.value })}
            placeholder="What this revision is about"
            maxLength={200}
          />
          <div class="actions">
            <a class="btn" href={report_url(draft.id)} target="_blank" rel="noreferrer" data-testid="report">
              Report to print
            </a>
            {mission.state !== 'recording' && (
              <a
                class="btn"
                href={handover_url(mission.mission)}
                download
                data-testid="handover"
                title="One zip file: the flight, the report of the newest published calibration and the published anchors, signed"
              >
                <Icon name="download" />
                Hand-over pack
              </a>
            )}
            {lacking.length > 0 && may('operator') && (
              <button class="btn" data-testid="fly-again" disabled={busy !== ''} onClick={fly_again}>
                {busy === 'planning' ? 'Planning' : `Fly again for ${lacking.length}`}
              </button>
            )}
            <span class="grow" />
            <button class="btn" onClick={() => (publish_open.value = false)}>
              Not now
            </button>
            {n_over > 0 && (
              <span class="caution" data-testid="over-goal">
                {n_over} over the accuracy goal
              </span>
            )}
            <button class="btn primary" data-testid="publish-now" disabled={busy !== '' || going === 0} onClick={send}>
              {busy === 'publishing' ? 'Publishing' : `Publish ${going} of ${draft.rows.length} anchors`}
            </button>
          </div>
        </>
      )}
    </section>
  );
}

const in_air = (): boolean => {
  const p = current_scene()?.procedure?.value;
  return p !== undefined && flying(p);
};
/// Metres between two places of an anchor. On the globe, where both have one: metres of a calibration and of a flight count from other origins.
function apart_m(a: EstimateMsg, b: EstimateMsg): number | null {
  if (a.lon !== null && a.lat !== null && b.lon !== null && b.lat !== null)
    return Math.hypot(
      ...enu_from_geodetic({ lon: a.lon, lat: a.lat, h_m: a.h_m ?? 0 }, { lon: b.lon, lat: b.lat, h_m: b.h_m ?? 0 }),
    );
  return a.enu_m && b.enu_m
    ? Math.hypot(a.enu_m[0] - b.enu_m[0], a.enu_m[1] - b.enu_m[1], a.enu_m[2] - b.enu_m[2])
    : null;
}
/// What may go out without a person: the server says so; a server without gates is taken at its verdict.
const passes = (r: AnchorRow): boolean => r.acceptable ?? r.verdict === 'ok';
/// Two places that fit cannot be talked into one; anything else a person may answer for.
const may_override = (r: AnchorRow): boolean => !passes(r) && r.verdict !== 'ambiguous' && r.enu_m !== null;

function DraftRow({
  r,
  moved,
  over,
  picked,
  pick,
  reason,
  set_reason,
  left,
  leave,
}: {
  r: AnchorRow;
  picked: boolean;
  pick: () => void;
  moved: Moved | undefined;
  over: string; ///< which accuracy goal it is over
  reason: string | undefined;
  set_reason: (reason: string) => void;
  left: string | undefined;
  leave: (why: string | null) => void;
}) {
  const live = current_scene()?.anchors.get(r.anchor)?.value,
    failed = r.gates.filter((g) => !g.passed);
  const shift = live ? apart_m(r, live) : null;
  const from = moved?.horizontal_m == null ? null : Math.hypot(moved.horizontal_m, moved.vertical_m ?? 0);
  return (
    <tr aria-selected={picked}>
      <th scope="row">
        <button class="id" aria-expanded={picked} data-testid={`why-${r.anchor}`} onClick={pick}>
          {r.anchor}
        </button>
      </th>
      <td>
        <StatusChip status={r.status} />
        {over && <span class="caution block wrap">{over}</span>}
        {over && <span class="mut block wrap">{largest_part(r.budget)}</span>}
        <span class="mut block wrap">
          {passes(r) ? '' : r.reason || (r.verdict === 'ok' ? '' : VERDICT_WORDS[r.verdict])}
        </span>
      </td>
      <td class="num">{accuracy(r.h95_m)}</td>
      <td class="num">{accuracy(r.v95_m)}</td>
      <td class="num">{fixed(shift, 3)}</td>
      <td class="num">
        {from === null ? <span class="mut">new</span> : fixed(from, 3)}
        {moved?.change === 'moved' && (
          <span class="bad block">
            <Mark shape="bad" tone="bad" /> moved
          </span>
        )}
      </td>
      <td class="wrap">
        {passes(r) && left !== undefined ? (
          <>
            <Mark shape="off" tone="off" /> rejected{' '}
            <button class="btn small" data-testid={`accept-${r.anchor}`} onClick={() => leave(null)}>
              Accept
            </button>
            <input
              class="reason"
              aria-label={`Why ${r.anchor} is rejected`}
              placeholder="reason, stored in the note"
              maxLength={120}
              value={left}
              onInput={(e) => leave(e.currentTarget.value)}
            />
          </>
        ) : passes(r) ? (
          <>
            <Mark shape={STATUS_LOOK[r.status][0]} tone={STATUS_LOOK[r.status][1]} /> accepted{' '}
            <button class="btn small" data-testid={`leave-${r.anchor}`} onClick={() => leave('')}>
              Reject
            </button>
          </>
        ) : (
          <>
            <Mark shape="off" tone="off" /> withheld
            {failed.length ? `. ${failed.map((g) => `${gate_line(g)}.`).join(' ')}` : `, ${VERDICT_WORDS[r.verdict]}`}
          </>
        )}
        {may_override(r) &&
          (reason === undefined ? (
            <button class="btn small" onClick={() => set_reason('')}>
              Accept anyway
            </button>
          ) : (
            <input
              class="reason"
              aria-label={`Reason to accept ${r.anchor}`}
              placeholder="reason, stored with the revision"
              maxLength={500}
              value={reason}
              onInput={(e) => set_reason(e.currentTarget.value)}
            />
          ))}
      </td>
    </tr>
  );
}
