/// Measurements out of use: the chosen rows, or what the time and anchor of the filter say, with a reason; the list of them, each to be used again.
import { useEffect, useRef, useState } from 'preact/hooks';
import { idempotency_key, error_text } from '../../api/client';
import {
  exclude,
  exclusions_of,
  include,
  selection_of,
  words_of,
  type Exclusion,
  type Kind,
} from '../../api/exclusions';
import type { Filter, Sample } from '../../api/measurements';
import { may } from '../../state/session';
import { say, when_back } from '../../state/store';
import { NotLoaded } from '../../ui/empty';
import { grouped } from '../../ui/format';
import { Icon } from '../../ui/marks';
import { Problem } from '../../ui/problem';
import { useStable } from '../../ui/use_stable';

export function ExcludePanel({
  mission,
  filter,
  sample,
  close,
}: {
  mission: string;
  filter: Filter;
  sample: Sample | null;
  close: () => void;
}) {
  const [list, set_list] = useState<readonly Exclusion[] | null>(null),
    [problem, set_problem] = useState(''),
    [kind, set_kind] = useState<Kind>('ranges'),
    [by_rows, set_by_rows] = useState(sample !== null),
    [picked, set_picked] = useState<readonly number[]>(sample ? [sample.id] : []),
    [reason, set_reason] = useState(''),
    [busy, set_busy] = useState(false),
    key = useRef(idempotency_key());
  const read = (): void => {
    exclusions_of(mission).then(
      (found) => {
        set_list(found);
        set_problem('');
      },
      (e: unknown) => set_problem(error_text(e)),
    );
  };
  const read_again = useStable(read);
  useEffect(() => when_back(read_again), [read_again]);
  const begin = useStable((): void => {
    set_list(null);
    set_picked(sample ? [sample.id] : []);
    read();
  });
  useEffect(begin, [mission, begin]);
  const what = selection_of(kind, kind === 'ranges' && by_rows ? picked : null, filter),
    able = may('operator', 'op', 'engineer');
  const act = async (work: () => Promise<unknown>, words: string): Promise<void> => {
    set_busy(true);
    set_problem('');
    try {
      await work();
      say(words);
      read();
    } catch (e) {
      set_problem(error_text(e));
    }
    key.current = idempotency_key();
    set_busy(false);
  };
  const send = (): Promise<void> =>
    act(async () => {
      if (what) await exclude(mission, { ...what, reason: reason.trim() }, key.current);
      set_reason('');
      set_picked([]);
    }, 'Excluded: the live flight is solved without them');
  const add = (): void => {
    if (sample && !picked.includes(sample.id)) set_picked([...picked, sample.id]);
  };
  return (
    <section
      class="cell-p wide exclude"
      data-help="measurements"
      aria-label="Measurements out of use"
      data-testid="exclusions"
    >
      <div class="hd">
        <h2>Out of use</h2>
        <span class="grow" />
        <button class="btn quiet" aria-label="Close" onClick={close}>
          <Icon name="close" />
        </button>
      </div>
      <Problem text={problem} />
      {able && (
        <div class="filters">
          <label>
            <span class="lab">What</span>
            <select
              class="input"
              data-testid="exclude-kind"
              value={kind}
              onChange={(e) => set_kind(e.currentTarget.value as Kind)}
            >
              <option value="ranges">Ranges</option>
              <option value="fixes">Positions</option>
            </select>
          </label>
          {kind === 'ranges' && (
            <label>
              <span class="lab">Which</span>
              <select
                class="input"
                data-testid="exclude-which"
                value={by_rows ? 'rows' : 'span'}
                onChange={(e) => set_by_rows(e.currentTarget.value === 'rows')}
              >
                <option value="rows">Rows chosen below</option>
                <option value="span">Time and anchor of the filter</option>
              </select>
            </label>
          )}
          {kind === 'ranges' && by_rows && (
            <div>
              <span class="lab">Rows</span>
              <span class="ends">
                <span role="status" data-testid="exclude-picked">
                  {grouped(picked.length)}
                </span>
                <button
                  class="btn"
                  data-testid="exclude-add"
                  disabled={!sample || picked.includes(sample.id)}
                  onClick={add}
                >
                  Add the chosen row
                </button>
              </span>
            </div>
          )}
          <label>
            <span class="lab">Reason, kept in the record</span>
            <input
              class="input"
              data-testid="exclude-reason"
              value={reason}
              maxLength={500}
              onInput={(e) => set_reason(e.currentTarget.value)}
            />
          </label>
          <button
            class="btn primary"
            data-testid="exclude-now"
            disabled={busy || !what || reason.trim() === ''}
            onClick={() => void send()}
          >
            Exclude
          </button>
        </div>
      )}
      {!what && able && (
        <p class="sub">
          {kind === 'ranges' && by_rows
            ? 'Choose a row in the list or a plot.'
            : 'Set a time span in the filter above: the rows in it are excluded.'}
        </p>
      )}
      {!list && <NotLoaded cls="pad" failed={problem !== ''} />}
      {list && list.length === 0 && <p class="pad">Every measurement of this flight is in use.</p>}
      {list && list.length > 0 && (
        <table class="tbl" data-testid="exclusion-list">
          <caption class="sr">What was taken out of use</caption>
          <thead>
            <tr>
              <th scope="col">What</th>
              <th scope="col">Which</th>
              <th scope="col" class="num">
                Rows
              </th>
              <th scope="col">Reason</th>
              <th scope="col">By</th>
              <th scope="col">State</th>
            </tr>
          </thead>
          <tbody>
            {list.map((e) => (
              <tr key={e.id}>
                <th scope="row">{e.kind === 'ranges' ? 'Ranges' : 'Positions'}</th>
                <td>{words_of(e)}</td>
                <td class="num">{grouped(e.n_rows)}</td>
                <td>{e.reason}</td>
                <td>{e.by}</td>
                <td>
                  {e.included ? (
                    `used again, by ${e.included.by}`
                  ) : able ? (
                    <button
                      class="btn small"
                      data-testid="include"
                      disabled={busy}
                      onClick={() => void act(() => include(mission, e.id, key.current), 'Used again')}
                    >
                      Use again
                    </button>
                  ) : (
                    'out of use'
                  )}
                </td>
              </tr>
            ))}
          </tbody>
        </table>
      )}
    </section>
  );
}
