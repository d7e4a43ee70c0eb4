/// One open plan: its drawing with undo, what is saved of it, the check of it, and the requests that change it. No DOM but the title.
import { useEffect, useLayoutEffect, useRef, useState } from 'preact/hooks';
import { published, type AnchorRow } from '../../api/anchors';
import { ApiError, error_text } from '../../api/client';
import {
  check as fetch_check,
  check_drawn,
  EMPTY,
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
import { current_mission, current_scene, say, tick, when_back } from '../../state/store';
import { useLoad } from '../../ui/empty';
import { useStable } from '../../ui/use_stable';
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
} from './draft';

const CHECKED_AFTER_MS = 500; ///< of no change: a drag is not checked at every step

/// Where nothing is drawn yet: at the flight, or where the aircraft stands.
function flown_at(): Geodetic | null {
  const pose = current_scene()?.pose?.value;
  return (
    current_mission.peek()?.origin ??
    (pose && pose.lon !== null && pose.lat !== null ? { lon: pose.lon, lat: pose.lat, h_m: 0 } : null)
  );
}

export type Desk = ReturnType<typeof usePlan>;

/// `id`: of the plan in the address; null opens the one with the newest draft, else the first.
export function usePlan(id: string | null) {
  const [all, set_all] = useState<readonly PlanDoc[] | null>(null),
    [history, set_history] = useState<History>(begun(EMPTY)),
    [saved, set_saved] = useState<PlanDoc>(EMPTY),
    [picked, pick] = useState<Picked | null>(null);
  const [checked, set_checked] = useState<{ readonly of: string; readonly check: Check } | null>(null),
    [problem, set_problem] = useState(''),
    [theirs, set_theirs] = useState<PlanDoc | null>(null),
    [notes, set_notes] = useState<readonly string[]>([]),
    [busy, set_busy] = useState(''),
    [origin, set_origin] = useState<Geodetic | null>(null),
    [back_ms, set_back] = useState<number | null>(null),
    [ready, set_ready] = useState(false),
    [unknown, set_unknown] = useState<string | null>(null),
    [known, set_known] = useState<ReadonlyMap<string, AnchorRow>>(new Map());
  const plan = history.now,
    dirty = plan !== saved,
    // Until the plans are there nothing can be drawn: it would be thrown away when one of them opens.
    able = ready && may('operator');
  // Metres are about one origin for as long as a plan is open: a map that moves while it is drawn on cannot be used.
  const open = (p: PlanDoc): void => {
    set_origin(origin_of(p, flown_at()));
    set_history(begun(p));
    set_saved(p);
    pick(null);
    set_checked(null);
    set_theirs(null);
    set_notes([]);
    set_back(null);
    set_unknown(null);
  };
  /// What was not saved when the page went away is on the drawing again, as one change that can be undone.
  const open_with_draft = (p: PlanDoc): void => {
    const draft = draft_of(draft_key(p.id)),
      kept = plan_from_draft(draft?.value);
    open(p);
    if (!draft || !kept || kept.id !== p.id) return;
    set_origin(origin_of(kept, origin_of(p, flown_at())));
    set_history(changed(begun(p), kept));
    set_back(draft.at_ms);
  };
  const now = tick.value;
  // Of what is kept now: effects come late on a busy page, and a place that was typed since must not be taken back.
  useEffect(() => {
    if (origin === null) set_origin((kept) => kept ?? origin_of(plan, flown_at()));
  }, [now, origin, plan]);
  const guarded = async (what: string, work: () => Promise<void>): Promise<void> => {
    set_busy(what);
    set_problem('');
    try {
      await work();
    } catch (e) {
      set_problem(error_text(e));
    }
    set_busy('');
  };
  const questions = useRef(0),
    answered = useRef(false); // known before `ready` is drawn, which a page that is busy does much later
  const begin = useStable((): void => {
    document.title = 'Plan - anchord';
    set_ready(false);
    answered.current = false;
    // Asked again, as when the link came back meanwhile, only the last answer counts: an earlier one must not take away what was drawn since.
    const question = ++questions.current;
    fetch_plans().then(
      (list) => {
        if (question !== questions.current) return;
        set_all(list);
        const last = id ? null : newest_draft('plan/')?.key,
          wanted =
            list.find((p) => p.id === id) ??
            list.find((p) => draft_key(p.id) === last) ??
            (last === draft_key(null) ? EMPTY : list[0]);
        open_with_draft(wanted ?? EMPTY);
        if (id && !list.some((p) => p.id === id)) set_unknown(id);
        set_problem('');
        set_ready(true);
        answered.current = true;
      },
      (e: unknown) => {
        if (question === questions.current) set_problem(error_text(e));
      },
    );
  });
  useEffect(begin, [id, begin]);
  // What is drawn stays: only where the plans could not be read are they asked for again.
  useEffect(() => when_back(() => answered.current || begin()), [begin]);
  useLoad(() => {
    published().then(
      ({ rows }) => set_known(new Map(rows.map((r) => [r.anchor, r]))),
      () => undefined,
    );
  });
  // Checked while it is drawn; whoever may only look sees what is saved checked. The last check stays, grey, until the next comes.
  const drawn = JSON.stringify({ ...plan, name: '', revision: 0, id: null }),
    check = checked?.check ?? null;
  const run_check = useStable((): Promise<Check> | null => {
    if (!dirty) return saved.id ? fetch_check(saved.id) : null;
    return able && (plan.waypoints.length > 0 || plan.outline.length > 2) ? check_drawn(plan) : null;
  });
  useEffect(() => {
    let gone = false;
    const timer = setTimeout(
      () =>
        void run_check()?.then(
          (c) => {
            if (!gone) set_checked({ of: drawn, check: c });
          },
          () => undefined,
        ),
      dirty ? CHECKED_AFTER_MS : 0,
    );
    return () => {
      gone = true;
      clearTimeout(timer);
    };
  }, [drawn, dirty, saved.id, run_check]);
  // With the change itself, not after the next picture: the page may be gone by then.
  const listed = all !== null;
  useLayoutEffect(() => {
    if (!listed) return;
    if (dirty) keep_draft(draft_key(plan.id), plan);
    else drop_draft(draft_key(plan.id));
  }, [plan, saved, dirty, listed]);
  const change = (p: PlanDoc): void => set_history(changed(history, p));
  /// Typing a name is no step to go back to.
  const rename = (name: string): void => set_history({ ...history, now: { ...plan, name } });
  const undo = (): void => set_history(undone(history));
  const redo = (): void => set_history(redone(history));
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
  /// The version of somebody else is known and given up.
  const keep_mine = (): void => {
    if (!theirs) return;
    set_history(changed(history, { ...plan, revision: theirs.revision }));
    set_theirs(null);
  };
  const take_away = (): void =>
    void guarded('remove', async () => {
      await remove(plan);
      set_all((all ?? []).filter((p) => p.id !== plan.id));
      open(EMPTY);
      say('Plan removed');
    });
  return {
    all,
    plan,
    saved,
    dirty,
    ready,
    unknown,
    able,
    can_undo: history.before.length > 0,
    can_redo: history.after.length > 0,
    picked,
    pick,
    check,
    check_is_old: checked !== null && checked.of !== drawn,
    problem,
    theirs,
    notes,
    busy,
    origin,
    set_origin,
    back_ms,
    known,
    open,
    open_with_draft,
    change,
    rename,
    undo,
    redo,
    keep,
    keep_mine,
    decide_later: (): void => set_theirs(null),
    propose,
    bring,
    take_away,
  };
}
