/// Setting a device up, or changing one: where it is, and what its kind can be told. Restored after a reload until it is sent.
import { useState } from 'preact/hooks';
import { error_text } from '../../api/client';
import { add_device, device_at, edit_device, type Device, type Found } from '../../api/devices';
import { say } from '../../state/store';
import { Problem } from '../../ui/problem';
import { useDraft } from '../../ui/use_draft';
import { Broker, Lines, Module, type Change } from './device_form_ranges';
import {
  BAUDS,
  config_of,
  EMPTY,
  is_service,
  KINDS,
  LINKS,
  missing,
  of_kind,
  patch_of,
  rejected_of,
  setup_of,
  type Rejected,
  type Setup,
} from './device_setup';

/// `device`: null for a new one; `ports`: what the last discovery found.
export function DeviceForm({
  device,
  start,
  ports,
  close,
  done,
}: {
  device: Device | null;
  start?: Partial<Setup>;
  ports: readonly Found[];
  close: () => void;
  done: () => void;
}) {
  const [s, change, forget] = useDraft<Setup>(
    `device/${device?.id ?? start?.path ?? 'new'}`,
    device ? setup_of(device) : { ...EMPTY, ...start },
  );
  const [problem, set_problem] = useState(''),
    [rejected, set_rejected] = useState<Rejected | null>(null),
    [busy, set_busy] = useState(false),
    lack = missing(s);
  const send = async (): Promise<void> => {
    set_busy(true);
    set_problem('');
    set_rejected(null);
    try {
      if (!device) await add_device(config_of(s));
      else {
        // Against what the server has now: the device becomes what the form shows.
        const { device: now, etag } = await device_at(device.id!),
          patch = patch_of(now, s);
        if (patch) await edit_device(device.id!, etag, patch);
      }
      forget();
      say(device ? 'Changed; its link is being opened again' : 'Set up; its link is being opened');
      done();
    } catch (e) {
      const at_field = rejected_of(e, s.kind);
      set_rejected(at_field);
      if (!at_field) set_problem(error_text(e));
    }
    set_busy(false);
  };
  return (
    <form
      class="callout device-form"
      data-help="connect"
      data-testid="device-form"
      aria-label={device ? `Settings of ${device.name}` : 'A new device'}
      onSubmit={(e) => {
        e.preventDefault();
        void send();
      }}
    >
      <b>{device ? `Settings of ${device.name}` : 'A new device'}</b>
      <div class="addform">
        {!device && (
          <label>
            <span class="lab">Kind</span>
            <select
              value={s.kind}
              data-testid="device-kind"
              onChange={(e) => change(of_kind(s, e.currentTarget.value))}
            >
              {KINDS.map(([id, words]) => (
                <option key={id} value={id}>
                  {words}
                </option>
              ))}
            </select>
          </label>
        )}
        <label>
          <span class="lab">Name</span>
          <input
            value={s.name}
            maxLength={200}
            placeholder="as on its label"
            onInput={(e) => change({ name: e.currentTarget.value })}
          />
        </label>
        <Where s={s} change={change} ports={ports} />
      </div>
      <div class="addform">
        {s.kind === 'gnss' ? (
          <Rover s={s} change={change} />
        ) : s.kind === 'pozyx' ? (
          <Tag s={s} change={change} />
        ) : s.kind === 'dwm1001' ? (
          <Module s={s} change={change} rejected={rejected} />
        ) : s.kind === 'mqtt' ? (
          <Broker s={s} change={change} rejected={rejected} />
        ) : s.kind === 'ndjson' ? (
          <Lines s={s} change={change} rejected={rejected} />
        ) : (
          <Caster s={s} change={change} />
        )}
      </div>
      <Problem text={problem} />
      <div class="actions">
        {lack && <span class="mut">{lack}</span>}
        <button
          type="button"
          class="btn"
          onClick={() => {
            forget();
            close();
          }}
        >
          Not now
        </button>
        <button class="btn primary" data-testid="device-send" disabled={busy || lack !== ''}>
          {device ? 'Save' : 'Set up'}
        </button>
      </div>
    </form>
  );
}

function Where({ s, change, ports }: { s: Setup; change: Change; ports: readonly Found[] }) {
  const link = (
    <label>
      <span class="lab">Link</span>
      <select value={s.link} disabled={is_service(s.kind)} onChange={(e) => change({ link: e.currentTarget.value })}>
        {LINKS.map(([id, words]) => (
          <option key={id} value={id}>
            {words}
          </option>
        ))}
      </select>
    </label>
  );
  if (s.link === 'serial')
    return (
      <>
        {link}
        <label class="grow">
          <span class="lab">Port; a name under by-id stays when the plug moves</span>
          <input
            list="ports"
            value={s.path}
            data-testid="device-path"
            placeholder="/dev/serial/by-id/..."
            onInput={(e) => change({ path: e.currentTarget.value })}
          />
          <datalist id="ports">
            {ports
              .filter((p) => p.address.startsWith('serial:') && !p.configured)
              .map((p) => (
                <option key={p.address} value={p.address.slice(7)}>
                  {p.evidence}
                </option>
              ))}
          </datalist>
        </label>
        {(s.kind === 'gnss' || s.kind === 'ndjson') && (
          <label>
            <span class="lab">Baud rate</span>
            <select value={s.baud} onChange={(e) => change({ baud: e.currentTarget.value })}>
              {[...new Set([...BAUDS.map(String), s.baud])].map((b) => (
                <option key={b} value={b}>
                  {b}
                </option>
              ))}
            </select>
          </label>
        )}
      </>
    );
  return (
    <>
      {link}
      <label class="grow">
        <span class="lab">
          {s.link === 'tcp'
            ? 'Computer: name or address'
            : s.link === 'udp'
              ? 'Address; empty: this computer, from loopback'
              : 'Address to listen at; empty: this computer only'}
        </span>
        <input
          value={s.host}
          data-testid="device-host"
          placeholder={s.kind === 'ntrip' ? 'caster.example' : s.link === 'tcp' ? '192.168.2.15' : '0.0.0.0'}
          onInput={(e) => change({ host: e.currentTarget.value })}
        />
      </label>
      <label>
        <span class="lab">Port</span>
        <input
          value={s.port}
          inputMode="numeric"
          data-testid="device-port"
          placeholder={s.kind === 'ntrip' ? '2101' : s.kind === 'mqtt' ? '1883' : '9001'}
          onInput={(e) => change({ port: e.currentTarget.value })}
        />
      </label>
    </>
  );
}
function Rover({ s, change }: { s: Setup; change: Change }) {
  return (
    <>
      <label>
        <span class="lab">Format</span>
        <select value={s.format} onChange={(e) => change({ format: e.currentTarget.value })}>
          {['auto', 'nmea', 'ubx', 'erb', 'llh', 'gpsd'].map((f) => (
            <option key={f} value={f}>
              {f === 'auto' ? 'found by itself' : f === 'gpsd' ? 'gpsd' : f.toUpperCase()}
            </option>
          ))}
        </select>
      </label>
      <label>
        <span class="lab">Corrections</span>
        <select
          value={s.corrections}
          data-testid="device-corrections"
          onChange={(e) => change({ corrections: e.currentTarget.value })}
        >
          <option value="own">it has its own</option>
          <option value="ntrip">from an NTRIP device here</option>
        </select>
      </label>
      <label>
        <span class="lab">Latency of receiver and link, ms</span>
        <input
          value={s.latency_ms}
          inputMode="decimal"
          placeholder="50"
          onInput={(e) => change({ latency_ms: e.currentTarget.value })}
        />
      </label>
      {s.format === 'gpsd' && (
        <label class="grow">
          <span class="lab">Device of gpsd; empty: all</span>
          <input
            value={s.gpsd_device}
            placeholder="/dev/ttyACM0"
            onInput={(e) => change({ gpsd_device: e.currentTarget.value })}
          />
        </label>
      )}
    </>
  );
}
function Tag({ s, change }: { s: Setup; change: Change }) {
  return (
    <>
      <label class="grow">
        <span class="lab">Anchors to range to; empty: all it discovers</span>
        <input
          value={s.anchors}
          placeholder="0x6a21 0x6a22"
          onInput={(e) => change({ anchors: e.currentTarget.value })}
        />
      </label>
      <label>
        <span class="lab">Impulse response</span>
        <select value={s.cir} onChange={(e) => change({ cir: e.currentTarget.value })}>
          <option value="none">none: fastest</option>
          <option value="window">its first path: all features</option>
          <option value="whole">whole: slowest</option>
        </select>
      </label>
      <label>
        <span class="lab">Seconds between ranges from anchor to anchor</span>
        <input
          value={s.anchor_anchor_s}
          inputMode="decimal"
          placeholder="never"
          onInput={(e) => change({ anchor_anchor_s: e.currentTarget.value })}
        />
      </label>
      <label class="tick">
        <input type="checkbox" checked={s.heading} onChange={(e) => change({ heading: e.currentTarget.checked })} />{' '}
        Heading from its compass
      </label>
    </>
  );
}
function Caster({ s, change }: { s: Setup; change: Change }) {
  return (
    <>
      <label>
        <span class="lab">Mount point</span>
        <input value={s.mount} data-testid="device-mount" onInput={(e) => change({ mount: e.currentTarget.value })} />
      </label>
      <label>
        <span class="lab">User</span>
        <input value={s.user} autocomplete="off" onInput={(e) => change({ user: e.currentTarget.value })} />
      </label>
      <label class="grow">
        <span class="lab">Password; after a reload to be typed again</span>
        <input
          type="password"
          value={s.password}
          autocomplete="new-password"
          placeholder={s.password_of ? 'kept on the server' : 'none'}
          data-testid="device-password"
          onInput={(e) => change({ password: e.currentTarget.value })}
        />
      </label>
      <label>
        <span class="lab">NTRIP version</span>
        <select value={s.version} onChange={(e) => change({ version: e.currentTarget.value })}>
          <option value="2">2</option>
          <option value="1">1</option>
        </select>
      </label>
      <label class="tick">
        <input type="checkbox" checked={s.send_gga} onChange={(e) => change({ send_gga: e.currentTarget.checked })} />{' '}
        Send the position of the rover to the caster
      </label>
    </>
  );
}
