/// Stored flights: which there are, handing one over, deleting one, and getting it back.
import { useEffect, useState } from 'preact/hooks';
import { flight_bundle_url } from '../../api/bundles';
import { error_text } from '../../api/client';
import {
  delete_flight,
  deleted_flights,
  handover_url,
  restore_flight,
  stored_flights,
  type StoredFlight,
} from '../../api/missions';
import { may } from '../../state/session';
import { load_missions } from '../../state/archive';
import { events, link, say, when_back } from '../../state/store';
import { Empty } from '../../ui/empty';
import { date, grouped } from '../../ui/format';
import { Problem } from '../../ui/problem';
import { useStable } from '../../ui/use_stable';
import { finish } from '../flight/finish';
import { FlightForm } from './flight_form';
import { NewFlight } from './new_flight';

const days = (seconds: number): string =>
  seconds < 172_800 ? `${Math.ceil(seconds / 3600)} h` : `${Math.floor(seconds / 86_400)} days`;

/// `beginning`: the page was opened to start one.
export function FlightsPanel({ beginning }: { beginning: boolean }) {
  const [begun, set_begun] = useState(beginning),
    [all, set_all] = useState<readonly StoredFlight[] | null>(null),
    [bin, set_bin] = useState<readonly StoredFlight[]>([]),
    [problem, set_problem] = useState(''),
    [sure, set_sure] = useState(''),
    [corrected, set_corrected] = useState<StoredFlight | null>(null);
  const load = useStable((): void => {
    Promise.all([stored_flights(), deleted_flights()]).then(
      ([a, b]) => {
        set_all(a);
        set_bin(b);
        set_problem('');
      },
      (e: unknown) => set_problem(error_text(e)),
    );
  });
  const newest = events.value.filter((e) => e.code.startsWith('mission.')).length;
  useEffect(load, [newest, load]);
  useEffect(() => when_back(load), [load]);
  const guarded = async (work: () => Promise<unknown>, done: string): Promise<void> => {
    set_problem('');
    set_sure('');
    try {
      await work();
      say(done);
    } catch (e) {
      set_problem(error_text(e));
    }
    load();
  };
  const remove = (f: StoredFlight): void => {
    if (sure !== f.id) set_sure(f.id);
    else void guarded(() => delete_flight(f.id, may()), `${f.name} is in the bin`);
  };
  const end = (f: StoredFlight): void => {
    if (sure !== f.id) set_sure(f.id);
    else void guarded(() => finish(f.id), `${f.name || 'The flight'} is finished`);
  };
  const restore = (f: StoredFlight): void =>
    void guarded(async () => {
      await restore_flight(f.id);
      await load_missions();
    }, `${f.name} is back`);
  const operator = may('operator');
  useEffect(() => set_begun(beginning), [beginning]);
  return (
    <section class="sys-p" data-testid="flights">
      <div class="hd">
        <h2>Flights</h2>
        {operator && (
          <button class="btn small" data-testid="open-new-flight" onClick={() => set_begun(true)}>
            New flight
          </button>
        )}
        {operator && (
          <a class="btn small" href="#/import" data-testid="to-import">
            Import a flight
          </a>
        )}
      </div>
      {operator && begun && <NewFlight close={() => set_begun(false)} />}
      <Problem text={problem} />
      <div class="scrollx">
        <table class="tbl">
          <caption class="sr">The newest stored flights</caption>
          <thead>
            <tr>
              <th scope="col">Flight</th>
              <th scope="col">State</th>
              <th scope="col">Ranges</th>
              <th scope="col">Fixes</th>
              <th scope="col">Hand over</th>
              {operator && (
                <th scope="col">
                  <span class="sr">Correct or delete</span>
                </th>
              )}
            </tr>
          </thead>
          <tbody>
            {all?.map((f) => (
              <tr key={f.id}>
                <th scope="row">
                  {f.name || f.id.slice(-8)}
                  <span class="mut block">{date(f.created_at)}</span>
                </th>
                <td>{f.state.toUpperCase()}</td>
                <td>{grouped(f.n_ranges)}</td>
                <td>{grouped(f.n_fixes)}</td>
                <td>
                  {f.state !== 'recording' && (
                    <a
                      class="btn small"
                      href={handover_url(f.id)}
                      download
                      aria-label={`Download the hand-over pack of ${f.name || f.id.slice(-8)}`}
                      data-testid="handover-flight"
                    >
                      Download
                    </a>
                  )}
                  {f.state !== 'recording' && (
                    <a
                      class="btn small"
                      href={flight_bundle_url(f.id)}
                      download
                      aria-label={`Bundle of ${f.name || f.id.slice(-8)}, for another anchord server`}
                      title="All that is stored of it, for another anchord server (Import)"
                      data-testid="bundle-flight"
                    >
                      Bundle
                    </a>
                  )}
                </td>
                {operator && (
                  <td class="acts">
                    {f.state === 'recording' ? (
                      <button
                        class="btn small"
                        data-testid="finish-flight"
                        disabled={link.value === 'lost'}
                        aria-label={`${sure === f.id ? 'Press again to finish' : 'Finish'} ${f.name || f.id.slice(-8)}`}
                        onClick={() => end(f)}
                      >
                        {sure === f.id ? 'Press again to finish' : 'Finish'}
                      </button>
                    ) : (
                      <>
                        <button
                          class="btn small"
                          data-testid="correct-flight"
                          aria-label={`Correct ${f.name || f.id.slice(-8)}`}
                          onClick={() => set_corrected(f)}
                        >
                          Correct
                        </button>
                        <button class="btn small" data-testid="delete-flight" onClick={() => remove(f)}>
                          {sure === f.id ? 'Press again to delete' : 'Delete'}
                        </button>
                      </>
                    )}
                  </td>
                )}
              </tr>
            ))}
          </tbody>
        </table>
      </div>
      {corrected && (
        <FlightForm
          key={corrected.id}
          flight={corrected}
          close={(changed) => {
            set_corrected(null);
            if (changed) void guarded(load_missions, `${corrected.name} is corrected`);
          }}
        />
      )}
      {!all?.length && (
        <Empty loaded={all !== null} failed={problem !== ''}>
          No flight is stored.
        </Empty>
      )}
      {bin.length > 0 && (
        <div class="scrollx">
          {' '}
          <table class="tbl" data-testid="bin">
            <caption>Deleted flights</caption>
            <thead>
              <tr>
                <th scope="col">Flight</th>
                <th scope="col">Deleted</th>
                <th scope="col">Kept for</th>
                {operator && (
                  <th scope="col">
                    <span class="sr">Restore</span>
                  </th>
                )}
              </tr>
            </thead>
            <tbody>
              {bin.map((f) => (
                <tr key={f.id}>
                  <th scope="row">
                    {f.name || f.id.slice(-8)}
                    <span class="mut block">{grouped(f.n_ranges)} ranges</span>
                  </th>
                  <td>
                    {date(f.deleted_at)}
                    <span class="mut block">by {f.deleted_by}</span>
                  </td>
                  <td>{f.emptying ? 'being removed' : `${days(f.kept_for_s ?? 0)} of running`}</td>
                  {operator && (
                    <td class="acts">
                      {!f.emptying && (
                        <button class="btn small" data-testid="restore-flight" onClick={() => restore(f)}>
                          Restore
                        </button>
                      )}
                    </td>
                  )}
                </tr>
              ))}
            </tbody>
          </table>
        </div>
      )}
    </section>
  );
}
