/// One device in full: where it is, what it is, what was not used and why, its clock; and what can be asked of it.
import { useState } from 'preact/hooks';
import { act_on_device, change_device, forget_device, type Device } from '../../api/devices';
import { obj, str } from '../../live/messages';
import { age, bytes, fixed, grouped } from '../../ui/format';
import { Q } from '../../ui/marks';
import type { Run } from './run';
import type { Row } from './use_devices';
import { by_count, dropped_words } from './standing';

interface Props {
  readonly row: Row;
  readonly radios: readonly Device[];
  readonly operator: boolean;
  readonly busy: boolean;
  readonly run: Run;
  readonly edit: () => void;
  readonly tune: () => void;
  readonly gone: () => void;
}

export function DeviceDetail({ row: { d, recent }, radios, operator, busy, run, edit, tune, gone }: Props) {
  const [sure, set_sure] = useState(false),
    talks = d.state === 'talking',
    drops = by_count(d.dropped),
    n = d.counters;
  return (
    <div class="dd" data-testid="device-detail">
      <dl class="kv s">
        <div class="grow">
          <dt>Address</dt>
          <dd>
            <code>{d.address}</code>
          </dd>
        </div>
        <div>
          <dt>Id of this device (permanent)</dt>
          <dd>
            <code>{d.id}</code>
          </dd>
        </div>
        <div>
          <dt>Model, firmware</dt>
          <dd>{[d.model, d.firmware].filter(Boolean).join(', ') || '–'}</dd>
        </div>
        {d.serial && (
          <div>
            <dt>{d.kind === 'ntrip' ? 'Mount point' : 'Serial number'}</dt>
            <dd>{d.serial}</dd>
          </div>
        )}
        <div>
          <dt>In this state for</dt>
          <dd>{d.in_state_s === null ? '–' : age(d.in_state_s * 1000)}</dd>
        </div>
        <div>
          <dt>Link opened, lost</dt>
          <dd>
            {grouped(n.opened ?? 0)}, {grouped(n.lost ?? 0)}
          </dd>
        </div>
        <div>
          <dt>Received, sent</dt>
          <dd>
            {bytes(n.bytes_in ?? 0)}, {bytes(n.bytes_out ?? 0)}
          </dd>
        </div>
        <div>
          <dt>Valid frames</dt>
          <dd>{grouped(n.frames ?? 0)}</dd>
        </div>
        {d.clock && (
          <div>
            <dt>Its clock</dt>
            <dd>
              {d.clock.settled ? (
                <>
                  <Q v={fixed(d.clock.drift_ppm, 1)} u="ppm" />, σ{' '}
                  <Q v={fixed(d.clock.sigma_s === null ? null : d.clock.sigma_s * 1000, 2)} u="ms" />
                </>
              ) : (
                'being measured'
              )}
            </dd>
          </div>
        )}
        {d.kind === 'pozyx' && (
          <div>
            <dt>Battery</dt>
            <dd>tags do not report it</dd>
          </div>
        )}
      </dl>
      <div class="cols">
        <div>
          <h3>Not used</h3>
          {drops.length === 0 ? (
            <p class="mut">Everything it sent was used.</p>
          ) : (
            <table class="reads drops" data-testid="drops">
              <thead>
                <tr>
                  <th scope="col">Why</th>
                  <th scope="col" class="num">
                    Last {Math.round(recent.span_s)} s
                  </th>
                  <th scope="col" class="num">
                    Since it was added
                  </th>
                </tr>
              </thead>
              <tbody>
                {drops.map(([why, count]) => (
                  <tr key={why}>
                    <th scope="row">{dropped_words(why)}</th>
                    <td class="num">{grouped(recent.dropped[why] ?? 0)}</td>
                    <td class="num">{grouped(count)}</td>
                  </tr>
                ))}
              </tbody>
            </table>
          )}
        </div>
        {d.kind === 'pozyx' && <Anchors d={d} radios={radios} may_ask={operator && talks && !busy} run={run} />}
      </div>
      {operator && (
        <div class="actions">
          {d.kind === 'pozyx' && (
            <button
              class="btn narrow"
              disabled={busy || !talks}
              onClick={() =>
                void run('identify', () => act_on_device(d.id!, 'identify'), `The lights of ${d.name} blink`)
              }
            >
              Identify
            </button>
          )}
          {d.kind === 'pozyx' && (
            <button class="btn narrow" disabled={busy || !talks} onClick={tune}>
              Radio
            </button>
          )}
          {d.kind === 'pozyx' && (
            <button
              class="btn"
              disabled={busy || !talks}
              onClick={() => void run('reboot', () => act_on_device(d.id!, 'reboot'), `${d.name} was restarted`)}
            >
              Reboot
            </button>
          )}
          <button
            class="btn"
            disabled={busy}
            onClick={() =>
              void run(
                'enable',
                () => change_device(d.id!, { enabled: !d.enabled }),
                d.enabled ? 'Switched off' : 'Switched on',
              )
            }
          >
            {d.enabled ? 'Switch off' : 'Switch on'}
          </button>
          <button
            class="btn"
            disabled={busy}
            data-testid="forget"
            onClick={() => {
              if (sure)
                void run(
                  'forget',
                  async () => {
                    await forget_device(d.id!);
                    gone();
                  },
                  'Removed; its measurements stay',
                );
              else set_sure(true);
            }}
          >
            {sure ? 'Press again to remove it' : 'Remove'}
          </button>
          <button class="btn primary" disabled={busy} data-testid="edit-device" onClick={edit}>
            Edit
          </button>
        </div>
      )}
    </div>
  );
}

/// Anchors in the reach of a tag: who answers now, and which one on the wall is which.
function Anchors({ d, radios, may_ask, run }: { d: Device; radios: readonly Device[]; may_ask: boolean; run: Run }) {
  const [seen, set_seen] = useState<readonly string[] | null>(null),
    [blinking, set_blinking] = useState('');
  const known =
    seen ??
    [...new Set(radios.filter((h) => h.kind === 'anchor' && h.network_id).map((h) => h.network_id!))].slice(0, 24);
  const look = (): void =>
    void run(
      'look',
      async () => {
        const list = obj(await act_on_device(d.id!, 'discover'))?.devices;
        set_seen((Array.isArray(list) ? list : []).map(str).filter(Boolean).sort());
      },
      '',
    );
  const blink = (id: string): void =>
    void run(
      'blink',
      async () => {
        await act_on_device(d.id!, 'identify', { network_id: id });
        set_blinking(id);
      },
      `The lights of ${id} blink`,
    );
  return (
    <div data-testid="reach">
      <h3>{seen ? `${seen.length} in its range now` : 'Anchors'}</h3>
      <p class="mut">{known.length ? 'Press one: its lights blink.' : 'None is known yet.'}</p>
      <div class="ids">
        {known.map((id) => (
          <button
            key={id}
            class="btn small"
            disabled={!may_ask}
            aria-pressed={blinking === id}
            onClick={() => blink(id)}
          >
            {id}
          </button>
        ))}
      </div>
      <button class="btn small" disabled={!may_ask} data-testid="look-around" onClick={look}>
        Search
      </button>
    </div>
  );
}
