/// Review and publish: a fresh calibration of the whole flight, the result of every anchor against the live estimate, then one revision for facility tools.
import { signal } from '@preact/signals';
import { useEffect, useRef, useState } from 'preact/hooks';
import { ApiError, idempotency_key } from '../api/client';
import { calibrate, publish, type AnchorRow, type Calibration } from '../api/anchors';
import type { MissionMsg } from '../live/messages';
import { current_scene, revision, say } from '../state/store';
import { accuracy, fixed } from '../ui/format';
import { Icon, Mark, StatusChip } from '../ui/marks';
import { VERDICT_WORDS } from '../ui/words';

export const publish_open = signal(false);

export function Publish({ mission }: { mission: MissionMsg }) {
  const [draft, set_draft] = useState<Calibration | null>(null), [problem, set_problem] = useState(''), [busy, set_busy] = useState<'' | 'calibrating' | 'publishing'>('calibrating');
  const keys = useRef({ calibrate: idempotency_key(), publish: idempotency_key() }), note = useRef<HTMLInputElement>(null), box = useRef<HTMLElement>(null);
  const guarded = async (what: 'calibrating' | 'publishing', work: () => Promise<void>): Promise<void> => {
    set_busy(what);
    set_problem('');
    try { await work(); } catch (e) { set_problem(e instanceof ApiError ? `${e.message}${e.problem.request_id ? ` (request ${e.problem.request_id})` : ''}` : e instanceof Error ? e.message : String(e)); }
    set_busy('');
  };
  const solve = (): void => void guarded('calibrating', async () => set_draft(await calibrate(mission.mission, keys.current.calibrate)));
  useEffect(() => { box.current?.focus(); solve(); }, []);
  const send = (): void => void guarded('publishing', async () => {
    const n = await publish(draft!.id, note.current?.value.trim() ?? '', keys.current.publish);
    if (n !== null) revision.value = Math.max(revision.value ?? 0, n);
    say(`Published${n === null ? '' : ` as revision ${n}`}`);
    publish_open.value = false;
  });
  const good = draft?.rows.filter((r) => r.verdict === 'ok') ?? [];
  return (
    <section class="drawer" role="dialog" aria-modal="false" aria-labelledby="publish-title" tabIndex={-1} ref={box} data-testid="publish">
      <div class="hd big"><h2 id="publish-title">Review and publish</h2><span class="grow" /><button class="btn quiet" aria-label="Close" onClick={() => (publish_open.value = false)}><Icon name="close" /></button></div>
      <p class="why">{mission.name}: all stored ranges are solved again, together. What is published is what facility tools read; the running estimates are not.</p>
      {busy === 'calibrating' && <p role="status">Solving {mission.n_ranges} ranges.</p>}
      {problem && <div class="problem" role="status"><b>That did not work.</b> {problem}{!draft && <button class="btn small" onClick={() => { keys.current.calibrate = idempotency_key(); solve(); }}>Try again</button>}</div>}
      {draft && (
        <>
          <div class="scroll" tabIndex={0} aria-label="Result of the calibration">
            <table class="tbl" data-testid="draft">
              <caption class="sr">Result of the calibration for each anchor</caption>
              <thead><tr><th scope="col">Anchor</th><th scope="col">Result</th><th scope="col" class="num">95 % h</th><th scope="col" class="num">95 % v</th><th scope="col" class="num">From live, m</th><th scope="col">Published</th></tr></thead>
              <tbody>{draft.rows.map((r) => <DraftRow key={r.anchor} r={r} />)}</tbody>
            </table>
          </div>
          <label class="lab" for="note">Note</label>
          <input id="note" ref={note} placeholder="What this revision is about" maxLength={200} />
          <div class="actions"><button class="btn" onClick={() => (publish_open.value = false)}>Not now</button><button class="btn primary" data-testid="publish-now" disabled={busy !== '' || good.length === 0} onClick={send}>{busy === 'publishing' ? 'Publishing' : `Publish ${good.length} of ${draft.rows.length} anchors`}</button></div>
        </>
      )}
    </section>
  );
}

function DraftRow({ r }: { r: AnchorRow }) {
  const live = current_scene()?.anchors.get(r.anchor)?.value;
  const shift = live?.enu_m && r.enu_m ? Math.hypot(r.enu_m[0] - live.enu_m[0], r.enu_m[1] - live.enu_m[1], r.enu_m[2] - live.enu_m[2]) : null;
  return (
    <tr>
      <th scope="row">{r.anchor}</th>
      <td><StatusChip status={r.status} /><span class="mut block wrap">{r.verdict === 'ok' ? '' : r.reason || VERDICT_WORDS[r.verdict]}</span></td>
      <td class="num">{accuracy(r.h95_m)}</td><td class="num">{accuracy(r.v95_m)}</td><td class="num">{fixed(shift, 3)}</td>
      <td>{r.verdict === 'ok' ? <><Mark shape="ok" tone="ok" /> yes</> : <><Mark shape="off" tone="off" /> no, {VERDICT_WORDS[r.verdict]}</>}</td>
    </tr>
  );
}
