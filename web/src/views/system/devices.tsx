/// Devices: those this server drives, each with what is wrong and what to do, then every radio that was in range. Discovery and set-up for who may.
import { Fragment } from 'preact';
import { useState } from 'preact/hooks';
import { error_text } from '../../api/client';
import { act_on_device, discover, type Found, type Radio } from '../../api/devices';
import { may } from '../../state/session';
import { say, server_now_us } from '../../state/store';
import { NotLoaded } from '../../ui/empty';
import { CopyBox } from '../../ui/copy_box';
import { age, fixed } from '../../ui/format';
import { Chip, Mark, Q } from '../../ui/marks';
import { Problem } from '../../ui/problem';
import { ConnectSteps } from './connect_steps';
import { DeviceDetail } from './device_detail';
import { DeviceForm } from './device_form';
import { kind_words, parts_of, type Setup } from './device_setup';
import { RadiosInRange } from './radios_in_range';
import { RadioPanel, RadioWarning } from './radio';
import type { Run } from './run';
import { useDevices, type Row } from './use_devices';
import { by_count, doing, dropped_words, lost_messages, summary } from './standing';

export function DevicesPanel({ guided }: { guided: boolean }) {
  const { all, rows, problem, load } = useDevices(),
    [failed, set_failed] = useState(''),
    [found, set_found] = useState<readonly Found[] | null>(null),
    [busy, set_busy] = useState('');
  const [adding, set_adding] = useState<Partial<Setup> | null>(null),
    [editing, set_editing] = useState<string | null>(null),
    [open, set_open] = useState<string | null>(null),
    [radio, set_radio] = useState<string | null>(null),
    [compared, set_compared] = useState<Readonly<Record<string, Radio>>>({});
  const operator = may('operator', 'op'),
    radios = all?.filter((d) => d.id === null) ?? [],
    edited = rows.find((r) => r.d.id === editing)?.d ?? null,
    tuned = rows.find((r) => r.d.id === radio)?.d ?? null;
  const run: Run = async (what, work, done) => {
    set_busy(what);
    set_failed('');
    try {
      await work();
      if (done) say(done);
      load();
    } catch (e) {
      set_failed(error_text(e));
    }
    set_busy('');
  };
  const finished = (): void => {
    set_adding(null);
    set_editing(null);
    load();
  };
  return (
    <section class="sys-p wide" data-testid="devices">
      <div class="hd">
        <h2>Devices</h2>
        <Summary rows={rows} />
        {operator && (
          <button
            class="btn"
            data-testid="discover"
            disabled={busy !== ''}
            onClick={() => void run('discover', async () => set_found(await discover()), '')}
          >
            {busy === 'discover' ? 'Listening on every port' : 'Discover'}
          </button>
        )}
        {operator && (
          <button class="btn" data-testid="add-device" onClick={() => set_adding({})}>
            Add a device
          </button>
        )}
      </div>
      {guided && (
        <ConnectSteps
          rows={rows}
          found={found}
          radios={compared}
          discover={
            operator && busy === '' ? () => void run('discover', async () => set_found(await discover()), '') : null
          }
          tune={operator ? set_radio : null}
        />
      )}
      <Problem text={failed || problem} />
      {found && (
        <FoundList
          found={found}
          pick={operator ? (f) => set_adding({ kind: f.kind ?? 'gnss', ...parts_of(f.address) }) : null}
          close={() => set_found(null)}
        />
      )}
      {adding && (
        <DeviceForm
          key={adding.path}
          device={null}
          start={adding}
          ports={found ?? []}
          close={() => set_adding(null)}
          done={finished}
        />
      )}
      {!all && <NotLoaded failed={problem !== ''} />}
      {all && rows.length === 0 && (
        <p class="why">
          This server has no devices. Measurements can still be sent over REST or imported with a flight.{' '}
          {operator ? 'Discover listens on every serial port for a Pozyx tag and an RTK rover.' : ''}
        </p>
      )}
      <RadioWarning
        devices={rows.filter((r) => r.s.tone === 'ok').map((r) => r.d)}
        compared={compared}
        look={operator ? (id) => set_radio(id) : null}
      />
      {rows.length > 0 && (
        <div class="scrollx">
          <table class="tbl devs" data-testid="driven">
            <caption class="sr">Devices of this server</caption>
            <thead>
              <tr>
                <th scope="col">Device</th>
                <th scope="col">State</th>
                <th scope="col">State, or what to do</th>
                <th scope="col" class="num">
                  Last seen
                </th>
                <th scope="col" class="num wide">
                  Rate
                </th>
                <th scope="col" class="num wide">
                  Not used
                </th>
                <th scope="col">
                  <span class="sr">Actions</span>
                </th>
              </tr>
            </thead>
            <tbody>
              {rows.map((r) => (
                <Fragment key={r.d.id}>
                  <DrivenRow
                    row={r}
                    operator={operator}
                    busy={busy !== ''}
                    run={run}
                    tune={() => set_radio(radio === r.d.id ? null : r.d.id)}
                    open={open === r.d.id}
                    toggle={() => set_open(open === r.d.id ? null : r.d.id)}
                  />
                  {(open === r.d.id || editing === r.d.id || radio === r.d.id) && (
                    <tr class="detail">
                      <td colSpan={7}>
                        <div class="stack">
                          {tuned && radio === r.d.id && (
                            <RadioPanel
                              key={radio}
                              device={tuned}
                              may_change={operator}
                              reported={(now) => set_compared({ ...compared, [radio!]: now })}
                              close={() => set_radio(null)}
                            />
                          )}
                          {edited && editing === r.d.id && (
                            <DeviceForm
                              key={editing}
                              device={edited}
                              ports={found ?? []}
                              close={() => set_editing(null)}
                              done={finished}
                            />
                          )}
                          {open === r.d.id && (
                            <DeviceDetail
                              row={r}
                              radios={radios}
                              operator={operator}
                              busy={busy !== ''}
                              run={run}
                              edit={() => set_editing(r.d.id)}
                              tune={() => set_radio(r.d.id)}
                              gone={() => set_open(null)}
                            />
                          )}
                        </div>
                      </td>
                    </tr>
                  )}
                </Fragment>
              ))}
            </tbody>
          </table>
        </div>
      )}
      {radios.length > 0 && <RadiosInRange radios={radios} />}
    </section>
  );
}

function Summary({ rows }: { rows: readonly Row[] }) {
  const n = summary(rows.map((r) => r.s));
  if (rows.length === 0) return <span class="grow" />;
  return (
    <span class="grow sum" role="status" data-testid="device-summary">
      {n.wrong > 0 && (
        <span class="bad">
          <Mark shape="bad" />{' '}
          <b>
            {n.wrong} {n.wrong === 1 ? 'needs' : 'need'} you
          </b>
        </span>
      )}
      {n.look > 0 && (
        <span class="caution">
          <Mark shape="caution" /> <b>{n.look} to watch</b>
        </span>
      )}
      {n.working > 0 && (
        <span class="ok">
          <Mark shape="ok" /> <b>{n.working} working</b>
        </span>
      )}
      {n.off > 0 && (
        <span class="off">
          <Mark shape="off" /> {n.off} off
        </span>
      )}
    </span>
  );
}

function DrivenRow({
  row: { d, s, recent },
  operator,
  busy,
  run,
  tune,
  open,
  toggle,
}: {
  row: Row;
  operator: boolean;
  busy: boolean;
  run: Run;
  tune: () => void;
  open: boolean;
  toggle: () => void;
}) {
  const drops = by_count(recent.dropped),
    lost = lost_messages(recent.dropped),
    talks = d.state === 'talking';
  return (
    <tr class={s.tone === 'bad' || s.tone === 'caution' ? `needs ${s.tone}-row` : ''} data-testid={`device-${d.id}`}>
      <th scope="row" class="wrap">
        {d.name || kind_words(d.kind)}
        <span class="mut block">
          {kind_words(d.kind)}
          {d.network_id ? `, ${d.network_id}` : ''}
        </span>
      </th>
      <td>
        <Chip shape={s.shape} tone={s.tone} word={s.word} />
      </td>
      <td class="wrap say">
        {s.what && <b>{s.what}</b>} {s.todo}
        {s.command && <CopyBox label="Copy the command" text={s.command} />}
        {!s.what && <span class="sec">{doing(d)}</span>}
      </td>
      <td class="num">
        {d.last_seen_us === null ? (
          <span class="mut">never</span>
        ) : (
          <span class={talks ? '' : 'bad'}>{age((server_now_us() - d.last_seen_us) / 1000)} ago</span>
        )}
      </td>
      <td class="num wide">
        {d.rate_hz === null || !d.enabled || d.kind === 'ntrip' ? '–' : <Q v={fixed(d.rate_hz, 1)} u="Hz" />}
      </td>
      <td class="num wide" title={drops.map(([why, n]) => `${dropped_words(why)}: ${n}`).join('\n')}>
        {recent.span_s < 2 ? (
          '–'
        ) : lost === 0 ? (
          '0'
        ) : (
          <Q v={fixed((100 * lost) / Math.max(1, lost + recent.rows), 0)} u="%" />
        )}
      </td>
      <td class="acts">
        {operator && d.kind === 'pozyx' && (
          <button
            class="btn small wide"
            disabled={busy || !talks}
            aria-label={`Identify ${d.name}`}
            onClick={() =>
              void run('identify', () => act_on_device(d.id!, 'identify'), `The lights of ${d.name} blink`)
            }
          >
            Identify
          </button>
        )}
        {d.kind === 'pozyx' && (
          <button class="btn small wide" data-testid="radio-open" disabled={busy || !talks} onClick={tune}>
            Radio
          </button>
        )}
        <button
          class="btn small"
          data-testid="details"
          aria-expanded={open}
          aria-label={`Details of ${d.name}`}
          onClick={toggle}
        >
          Details
        </button>
      </td>
    </tr>
  );
}

/// The line of a port that may not be opened carries its own cure.
const command_in = (text: string): string =>
  /permission denied/.test(text) ? (/"([^"]+)"/.exec(text)?.[1] ?? '') : '';
function FoundList({
  found,
  pick,
  close,
}: {
  found: readonly Found[];
  pick: ((f: Found) => void) | null;
  close: () => void;
}) {
  const barred = found.map((f) => command_in(f.evidence)).find((c) => c !== '');
  return (
    <div class="callout" data-testid="found">
      <b>
        {found.length ? `${found.length} port${found.length === 1 ? '' : 's'} looked at.` : 'No serial port was found.'}
      </b>{' '}
      {found.length === 0 &&
        'Plug the device in: a Pozyx or a receiver on USB appears within two seconds. Receivers on the network are not found: add them by address.'}
      <ul class="found">
        {found.map((f) => (
          <li key={f.address}>
            <code>{f.address}</code>{' '}
            <b>
              {f.kind
                ? kind_words(f.kind)
                : command_in(f.evidence)
                  ? 'not allowed'
                  : f.configured
                    ? ''
                    : 'no known device answered'}
            </b>
            {f.evidence && !command_in(f.evidence) && ` ${f.evidence}`}{' '}
            {f.configured
              ? ''
              : pick && (
                  <button class="btn small" onClick={() => pick(f)}>
                    Set up
                  </button>
                )}
          </li>
        ))}
      </ul>
      {barred && (
        <div>
          <p>
            The server may not open this port. Run this as the user that runs it, log in again and start the server
            again:
          </p>
          <CopyBox label="Copy the command" text={barred} />
        </div>
      )}
      <button class="btn small" onClick={close}>
        Close
      </button>
    </div>
  );
}
