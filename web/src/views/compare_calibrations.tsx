/// Two calibrations side by side: how far each anchor is from where the other has it, and whether that is more than both covariances allow.
import { useEffect, useState } from 'preact/hooks';
import { error_text } from '../api/client';
import { common_shift, shifts, solves, type Shift, type Solve } from '../api/residuals';
import { mission_list, revision } from '../state/store';
import { NotLoaded, useLoad } from '../ui/empty';
import { bearing, date, fixed, millimetres } from '../ui/format';
import { Chip, Icon, type Shape, type Tone } from '../ui/marks';
import { useDialog } from '../ui/use_dialog';
import { compare_open } from './dialogs';

const LOOK: Record<Shift['change'], readonly [Shape, Tone, string]> = {
  agrees: ['ok', 'ok', 'AGREES'],
  moved: ['bad', 'bad', 'MOVED'],
  added: ['info', 'info', 'NEW'],
  removed: ['off', 'off', 'MISSING'],
  not_comparable: ['off', 'off', 'NOT COMPARABLE'],
};

export function CompareCalibrations() {
  const [list, set_list] = useState<readonly Solve[] | null>(null),
    [of, set_of] = useState(''),
    [against, set_against] = useState('published'),
    [rows, set_rows] = useState<readonly Shift[] | null>(null),
    [problem, set_problem] = useState(''),
    box = useDialog<HTMLElement>(() => (compare_open.value = false), 'compare');
  useLoad(() => {
    if (list) return;
    solves().then(
      (all) => {
        set_list(all);
        set_of(all[0]?.id ?? '');
        set_problem('');
        if (revision.peek() === null && all[1]) set_against(all[1].id);
      },
      (e: unknown) => set_problem(error_text(e)),
    );
  });
  useEffect(() => {
    let gone = false;
    set_rows(null);
    set_problem('');
    if (of && of !== against)
      shifts(of, against).then(
        (r) => {
          if (!gone) set_rows(r);
        },
        (e: unknown) => {
          if (!gone) set_problem(error_text(e));
        },
      );
    return () => {
      gone = true;
    };
  }, [of, against]);
  const name = (s: Solve): string =>
    `${date(s.created_at)}, ` +
    `${s.missions.map((m) => mission_list.value.find((x) => x.mission === m)?.name ?? 'a flight').join(' + ') || 'no flight'}, ` +
    `${s.verdicts?.ok ?? 0} of ${s.n_anchors ?? 0} well determined`;
  const moved = rows?.filter((r) => r.change === 'moved').length ?? 0,
    both = rows?.filter((r) => r.delta_m !== null) ?? [],
    alike = common_shift(both);
  return (
    <section class="drawer" {...box} aria-labelledby="compare-title" data-testid="compare-calibrations">
      <div class="hd big">
        <h2 id="compare-title">Compare two calibrations</h2>
        <span class="grow" />
        <button class="btn quiet" aria-label="Close" onClick={() => (compare_open.value = false)}>
          <Icon name="close" />
        </button>
      </div>
      {!list && <NotLoaded failed={problem !== ''} />}
      {list?.length === 0 ? (
        <p class="why">No flight is calibrated yet: Review and publish makes the first calibration.</p>
      ) : (
        list && (
          <div class="comparing">
            <label>
              <span class="lab">This one</span>
              <select value={of} data-testid="compare-of" onChange={(e) => set_of(e.currentTarget.value)}>
                {list.map((s) => (
                  <option key={s.id} value={s.id}>
                    {name(s)}
                  </option>
                ))}
              </select>
            </label>
            <label>
              <span class="lab">Against</span>
              <select
                value={against}
                data-testid="compare-against"
                onChange={(e) => set_against(e.currentTarget.value)}
              >
                <option value="published">
                  {revision.value === null
                    ? 'what is published: nothing yet'
                    : `what is published now, revision ${revision.value}`}
                </option>
                {list.map((s) => (
                  <option key={s.id} value={s.id}>
                    {name(s)}
                  </option>
                ))}
              </select>
            </label>
          </div>
        )
      )}
      {problem && (
        <div class="problem" role="status">
          <b>The calibrations could not be compared.</b> {problem}
        </div>
      )}
      {of !== '' && of === against && (
        <p class="why" role="status">
          These are the same calibration: choose another one.
        </p>
      )}
      {rows && (
        <>
          <p role="status" data-testid="compare-verdict">
            {both.length === 0 ? (
              against === 'published' && revision.value === null ? (
                'Nothing is published yet, so every anchor is new.'
              ) : (
                'They have no anchor in common.'
              )
            ) : moved === 0 ? (
              <>
                <Chip shape="ok" tone="ok" word="NONE MOVED" /> All {both.length} anchors are at the same position in
                both, within their covariances.
              </>
            ) : (
              <>
                <Chip shape="bad" tone="bad" word={`${moved} OF ${both.length} MOVED`} /> Further than both covariances
                allow (99.9 %): the anchor was moved, or one of the two positions is wrong.
              </>
            )}
          </p>
          {alike && (
            <div class="callout caution" data-testid="alike">
              <b>All of them are shifted by the same amount</b>, by {fixed(alike.size_m * 1000, 0)} mm towards{' '}
              {bearing(alike.bearing_deg)}°: probably the position of the base changed, not the anchors.
            </div>
          )}
          <div class="scroll" tabIndex={0} aria-label="Shift of each anchor">
            <table class="tbl" data-testid="shifts">
              <caption class="sr">Shift of each anchor</caption>
              <thead>
                <tr>
                  <th scope="col">Anchor</th>
                  <th scope="col">Moved?</th>
                  <th scope="col">
                    <span class="sr">Direction</span>
                  </th>
                  <th scope="col" class="num">
                    East, mm
                  </th>
                  <th scope="col" class="num">
                    North, mm
                  </th>
                  <th scope="col" class="num">
                    Up, mm
                  </th>
                  <th scope="col" class="num">
                    In the plane, mm
                  </th>
                  <th scope="col" class="num">
                    χ², limit
                  </th>
                </tr>
              </thead>
              <tbody>
                {rows.map((r) => (
                  <tr key={r.anchor}>
                    <th scope="row">{r.anchor}</th>
                    <td>
                      <Chip shape={LOOK[r.change][0]} tone={LOOK[r.change][1]} word={LOOK[r.change][2]} />
                    </td>
                    <td>
                      <Arrow r={r} />
                    </td>
                    {[0, 1, 2].map((i) => (
                      <td key={i} class="num">
                        {millimetres(r.delta_m?.[i])}
                      </td>
                    ))}
                    <td class="num">{millimetres(r.horizontal_m)}</td>
                    <td class="num">{r.chi2 === null ? '–' : `${fixed(r.chi2, 1)}, ≤ ${fixed(r.chi2_limit, 1)}`}</td>
                  </tr>
                ))}
              </tbody>
            </table>
          </div>
        </>
      )}
      <div class="actions">
        <button class="btn" onClick={() => (compare_open.value = false)}>
          Close
        </button>
      </div>
    </section>
  );
}

function Arrow({ r }: { r: Shift }) {
  if (!r.delta_m || r.horizontal_m === null || r.horizontal_m < 0.001) return null;
  const deg = (Math.atan2(r.delta_m[0], r.delta_m[1]) * 180) / Math.PI,
    long = Math.min(11, 4 + 2.4 * Math.log10(r.horizontal_m * 1000));
  return (
    <svg
      class="shiftarrow"
      width="28"
      height="28"
      viewBox="-14 -14 28 28"
      role="img"
      aria-label={`towards ${bearing(deg)}°`}
    >
      <g transform={`rotate(${deg})`}>
        <path d={`M0 ${long}V${-long}M-4 ${-long + 5}L0 ${-long}L4 ${-long + 5}`} />
      </g>
    </svg>
  );
}
