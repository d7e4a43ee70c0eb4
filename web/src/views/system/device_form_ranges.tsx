/// The settings of tags of other makers: a DWM1001, messages of an MQTT broker, lines of JSON. What the server rejects of a field is shown at it.
import { useRef, useState } from 'preact/hooks';
import { MOST_FILE_BYTES } from './device_mapping';
import { forgets_password, type Rejected, type Setup } from './device_setup';

export type Change = (part: Partial<Setup>) => void;
interface Part {
  readonly s: Setup;
  readonly change: Change;
  readonly rejected: Rejected | null;
}

const EXAMPLE = `{
  "array": "/r",
  "tag": "#/id",
  "anchor": "/to",
  "id_format": "hex",
  "distance": {"pointer": "/mm", "unit": "mm"}
}`;

const fault_id = (field: Rejected['field']): string => `device-${field}-fault`;
const marked = (rejected: Rejected | null, field: Rejected['field']): object =>
  rejected?.field === field ? { 'aria-invalid': true, 'aria-describedby': fault_id(field) } : {};
function Faults({ rejected, field }: { rejected: Rejected | null; field: Rejected['field'] }) {
  if (rejected?.field !== field) return null;
  return (
    <div class="problem hint" role="alert" id={fault_id(field)} data-testid={`rejected-${field}`}>
      <b>The server rejected this:</b>
      {rejected.faults.map((f) => (
        <span key={f} class="block">
          {f}
        </span>
      ))}
    </div>
  );
}

export function Module({ s, change, rejected }: Part) {
  return (
    <>
      <label>
        <span class="lab">How it is read</span>
        <select value={s.mode} data-testid="device-mode" onChange={(e) => change({ mode: e.currentTarget.value })}>
          <option value="shell">its shell (les)</option>
          <option value="tlv">binary (TLV), 10 Hz</option>
        </select>
      </label>
      <label class="grow">
        <span class="lab">{s.mode === 'tlv' ? 'Id of the tag' : 'Id of the tag; empty: its own'}</span>
        <input
          value={s.tag}
          data-testid="device-tag"
          placeholder="0x6e01"
          {...marked(rejected, 'tag')}
          onInput={(e) => change({ tag: e.currentTarget.value })}
        />
      </label>
      <Faults rejected={rejected} field="tag" />
      {s.mode === 'tlv' && <p class="mut hint">Switch the module off and on if its shell was used before.</p>}
    </>
  );
}

export function Broker({ s, change, rejected }: Part) {
  return (
    <>
      <label>
        <span class="lab">Messages</span>
        <select
          value={s.payload}
          data-testid="device-payload"
          onChange={(e) => change({ payload: e.currentTarget.value })}
        >
          <option value="mapping">ranges, by a mapping</option>
          <option value="pozyx">positions of a Pozyx gateway</option>
        </select>
      </label>
      <label class="grow">
        <span class="lab">{s.payload === 'pozyx' ? 'Topic; empty: tags/#' : 'Topic; empty: that of the mapping'}</span>
        <input
          value={s.topic}
          data-testid="device-topic"
          placeholder={s.payload === 'pozyx' ? 'tags/#' : 'uwb/+/ranges'}
          {...marked(rejected, 'topic')}
          onInput={(e) => change({ topic: e.currentTarget.value })}
        />
      </label>
      <Faults rejected={rejected} field="topic" />
      <label>
        <span class="lab">User; empty: none</span>
        <input
          value={s.user}
          maxLength={1000}
          autocomplete="off"
          data-testid="device-user"
          {...marked(rejected, 'user')}
          onInput={(e) => change({ user: e.currentTarget.value })}
        />
      </label>
      <Faults rejected={rejected} field="user" />
      <label>
        <span class="lab">Password; after a reload to be typed again</span>
        <input
          type="password"
          value={s.password}
          autocomplete="new-password"
          placeholder={forgets_password(s) ? 'forgotten with the user' : s.password_of ? 'kept on the server' : 'none'}
          data-testid="device-password"
          {...marked(rejected, 'password')}
          onInput={(e) => change({ password: e.currentTarget.value })}
        />
      </label>
      <Faults rejected={rejected} field="password" />
      <p class="mut hint">
        MQTT 3.1.1 over plain TCP, without TLS: user and password can be read on the way. For a broker with TLS, let a
        Mosquitto on this server's computer bridge to it, and give that one's address.
        {s.payload === 'pozyx' && ' From positions no ranges are stored; they are only for comparison.'}
      </p>
      {s.payload === 'mapping' && <MappingField s={s} change={change} rejected={rejected} />}
    </>
  );
}

export function Lines({ s, change, rejected }: Part) {
  return (
    <>
      <p class="mut hint">One JSON message a line, ending in a line feed; over UDP also one a datagram.</p>
      <MappingField s={s} change={change} rejected={rejected} />
    </>
  );
}

function MappingField({ s, change, rejected }: Part) {
  const file = useRef<HTMLInputElement>(null),
    [unread, set_unread] = useState('');
  const read = async (f: File): Promise<void> => {
    set_unread('');
    if (f.size > MOST_FILE_BYTES) {
      set_unread(`${f.name} has ${Math.round(f.size / 1000)} kB, a mapping less than 10 kB: choose another file.`);
      return;
    }
    try {
      change({ mapping: await f.text() });
    } catch {
      set_unread(`${f.name} cannot be read: choose it again, or paste its text.`);
    }
  };
  return (
    <div class="mapping">
      <label>
        <span class="lab">Mapping: place and unit of each value in a message (JSON)</span>
        <textarea
          rows={8}
          value={s.mapping}
          spellcheck={false}
          placeholder={EXAMPLE}
          data-testid="device-mapping"
          {...marked(rejected, 'mapping')}
          onInput={(e) => change({ mapping: e.currentTarget.value })}
        />
      </label>
      <Faults rejected={rejected} field="mapping" />
      {unread && (
        <div class="problem" role="alert">
          {unread}
        </div>
      )}
      <button type="button" class="btn small" onClick={() => file.current?.click()}>
        Choose a file
      </button>
      <input
        ref={file}
        type="file"
        accept=".json,application/json"
        hidden
        aria-label="Mapping file"
        data-testid="device-mapping-file"
        onChange={(e) => {
          const f = e.currentTarget.files?.[0];
          if (f) void read(f);
          e.currentTarget.value = '';
        }}
      />
    </div>
  );
}
