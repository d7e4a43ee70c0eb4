/// Devices: those this server drives, with how each stands and why, then every radio that was heard. Discovery and set-up for who may.
import { useEffect, useState } from 'preact/hooks';
import { said } from '../../api/client';
import { act_on_device, add_device, change_device, devices as fetch_devices, discover, forget_device, type Device, type Found } from '../../api/system';
import { may } from '../../state/session';
import { devices as live_devices, mission_list, say, server_now_us } from '../../state/store';
import { age, fixed, grouped } from '../../ui/format';
import { Chip, Q, type Shape, type Tone } from '../../ui/marks';
import { RadioPanel } from './radio';

const LOOK: Record<string, [Shape, Tone]> = { talking: ['ok', 'ok'], live: ['ok', 'ok'], open: ['estimating', 'info'], found: ['found', 'info'], silent: ['caution', 'caution'], late: ['caution', 'caution'], lost: ['bad', 'bad'], off: ['off', 'off'] };
const KINDS: readonly (readonly [string, string, string])[] = [['pozyx', 'Pozyx tag', 'serial:/dev/serial/by-id/...'], ['gnss', 'RTK rover', 'tcp://192.168.2.15:9001'], ['ntrip', 'NTRIP corrections', 'ntrip://caster.example:2101/MOUNT']];
const kind_words = (kind: string): string => KINDS.find(([id]) => id === kind)?.[1] ?? kind;

export function DevicesPanel() {
  const [all, set_all] = useState<readonly Device[] | null>(null), [problem, set_problem] = useState(''), [found, set_found] = useState<readonly Found[] | null>(null), [busy, set_busy] = useState(''), [adding, set_adding] = useState<{ kind: string; address: string } | null>(null), [radio, set_radio] = useState<string | null>(null);
  const load = (): void => { fetch_devices().then((d) => { set_all(d); set_problem(''); }, (e: unknown) => set_problem(said(e))); };
  useEffect(() => { load(); const timer = setInterval(load, 3000); return () => clearInterval(timer); }, []);
  const operator = may('operator', 'engineer');
  const run = async (what: string, work: () => Promise<unknown>, done: string): Promise<void> => {
    set_busy(what);
    try { await work(); if (done) say(done); load(); } catch (e) { set_problem(said(e)); }
    set_busy('');
  };
  const driven = all?.filter((d) => d.id !== null) ?? [], heard = all?.filter((d) => d.id === null) ?? [];
  const tuned = driven.find((d) => d.id === radio);
  return (
    <section class="sys-p wide" data-testid="devices">
      <div class="hd">
        <h2>Devices</h2>
        {operator && <button class="btn" data-testid="discover" disabled={busy !== ''} onClick={() => void run('discover', async () => set_found(await discover()), '')}>{busy === 'discover' ? 'Listening at every port' : 'Discover'}</button>}
        {operator && <button class="btn" data-testid="add-device" onClick={() => set_adding({ kind: 'pozyx', address: '' })}>Add a device</button>}
      </div>
      {problem && <div class="problem" role="status"><b>That did not work.</b> {problem}</div>}
      {adding && <AddDevice start={adding} close={() => set_adding(null)} add={(kind, address, name) => void run('add', async () => { await add_device(kind, address, name); set_adding(null); }, 'Set up; its link is being opened')} />}
      {found && <FoundList found={found} pick={operator ? (f) => set_adding({ kind: f.kind ?? 'gnss', address: f.address }) : null} close={() => set_found(null)} />}
      {all && driven.length === 0 && <p class="why">This server drives no device itself. Measurements may still come over REST, or by importing a flight. {operator ? 'Discover listens at every serial port for a Pozyx tag and an RTK rover.' : ''}</p>}
      {driven.length > 0 && <div class="scrollx"><table class="tbl" data-testid="driven">
        <caption class="sr">Devices that this server drives</caption>
        <thead><tr><th scope="col">Device</th><th scope="col">State</th><th scope="col">Address</th><th scope="col" class="num">Rate</th><th scope="col" class="num">Frames</th><th scope="col" class="num">Not used</th><th scope="col">Firmware</th>{operator && <th scope="col">Actions</th>}</tr></thead>
        <tbody>{driven.map((d) => <DrivenRow key={d.id} d={d} operator={operator} busy={busy !== ''} run={run} tune={() => set_radio(d.id)} />)}</tbody>
      </table></div>}
      {tuned && <RadioPanel device={tuned} may_change={operator} close={() => set_radio(null)} />}
      {heard.length > 0 && <Heard heard={heard} />}
    </section>
  );
}

function DrivenRow({ d, operator, busy, run, tune }: { d: Device; operator: boolean; busy: boolean; tune: () => void; run: (what: string, work: () => Promise<unknown>, done: string) => Promise<void> }) {
  const state = d.enabled ? (d.state ?? 'off') : 'off', [shape, tone] = LOOK[state] ?? ['off', 'off'], dropped = Object.entries(d.dropped).filter(([, n]) => n > 0), total = dropped.reduce((a, [, n]) => a + n, 0);
  return (
    <tr>
      <th scope="row">{d.name || kind_words(d.kind)}<span class="mut block">{kind_words(d.kind)}{d.network_id ? `, ${d.network_id}` : ''}</span></th>
      <td class="wrap"><Chip shape={shape} tone={tone} word={state.toUpperCase()} />{(d.conflict || d.reason) && <span class="block why">{d.conflict || d.reason}</span>}</td>
      <td class="wrap"><code>{d.address}</code></td>
      <td class="num">{d.rate_hz === null ? '–' : <Q v={fixed(d.rate_hz, 1)} u="Hz" />}</td><td class="num">{grouped(d.counters.frames ?? null)}</td>
      <td class="num" title={dropped.map(([why, n]) => `${why.replaceAll('_', ' ')}: ${n}`).join('\n')}>{grouped(total)}</td>
      <td>{[d.model, d.firmware].filter(Boolean).join(' ') || <span class="mut">–</span>}</td>
      {operator && <td class="acts">
        {d.kind === 'pozyx' && <button class="btn small" disabled={busy || state !== 'talking'} onClick={() => void run('identify', () => act_on_device(d.id!, 'identify'), 'Its lights blink')}>Identify</button>}
        {d.kind === 'pozyx' && <button class="btn small" data-testid="radio-open" disabled={busy || state !== 'talking'} onClick={tune}>Radio</button>}
        <button class="btn small" disabled={busy} onClick={() => void run('enable', () => change_device(d.id!, { enabled: !d.enabled }), d.enabled ? 'Switched off' : 'Switched on')}>{d.enabled ? 'Switch off' : 'Switch on'}</button>
        {!d.enabled && <button class="btn small" disabled={busy} onClick={() => void run('forget', () => forget_device(d.id!), 'Forgotten')}>Forget</button>}
      </td>}
    </tr>
  );
}

function Heard({ heard }: { heard: readonly Device[] }) {
  const flying = mission_list.value.some((m) => m.state === 'recording'), live = new Map(live_devices.value.map((d) => [d.network_id, d]));
  return (
    <>
      <h3>Radios heard</h3>
      <table class="tbl" data-testid="heard">
        <caption class="sr">Radios that were heard in any flight</caption>
        <thead><tr><th scope="col">Radio</th><th scope="col">Kind</th><th scope="col">State</th><th scope="col">Last heard</th></tr></thead>
        <tbody>{heard.slice(0, 100).map((d, i) => {
          // Silence is news only while a flight is recorded.
          const now = flying ? live.get(d.network_id ?? '')?.state : undefined, [shape, tone] = LOOK[now ?? ''] ?? ['off', 'off'];
          return <tr key={`${d.network_id}${i}`}><th scope="row">{d.network_id ?? '–'}</th><td>{d.kind}</td><td><Chip shape={shape} tone={tone} word={(now ?? 'no flight').toUpperCase()} /></td><td>{d.last_seen_us === null ? '–' : `${age((server_now_us() - d.last_seen_us) / 1000)} ago`}</td></tr>;
        })}</tbody>
      </table>
    </>
  );
}

function FoundList({ found, pick, close }: { found: readonly Found[]; pick: ((f: Found) => void) | null; close: () => void }) {
  return (
    <div class="callout" data-testid="found">
      <b>{found.length ? `${found.length} port${found.length === 1 ? '' : 's'} looked at.` : 'No serial port was found.'}</b> {found.length === 0 && 'Plug the device in; on Linux its user must be in the group dialout.'}
      <ul class="found">{found.map((f) => <li key={f.address}><code>{f.address}</code> {f.kind ? kind_words(f.kind) : 'nothing known spoke'}{f.evidence && `: ${f.evidence}`} {f.configured ? <span class="mut">in use</span> : pick && <button class="btn small" onClick={() => pick(f)}>Set up</button>}</li>)}</ul>
      <button class="btn small" onClick={close}>Close</button>
    </div>
  );
}

function AddDevice({ start, add, close }: { start: { kind: string; address: string }; add: (kind: string, address: string, name: string) => void; close: () => void }) {
  const [kind, set_kind] = useState(start.kind), [address, set_address] = useState(start.address), [name, set_name] = useState('');
  return (
    <form class="callout addform" onSubmit={(e) => { e.preventDefault(); add(kind, address.trim(), name.trim()); }}>
      <label><span class="lab">Kind</span><select value={kind} onChange={(e) => set_kind(e.currentTarget.value)}>{KINDS.map(([id, words]) => <option key={id} value={id}>{words}</option>)}</select></label>
      <label class="grow"><span class="lab">Address</span><input required value={address} placeholder={KINDS.find(([id]) => id === kind)?.[2]} onInput={(e) => set_address(e.currentTarget.value)} /></label>
      <label><span class="lab">Name</span><input value={name} placeholder="as on its label" onInput={(e) => set_name(e.currentTarget.value)} /></label>
      <span class="actions"><button type="button" class="btn" onClick={close}>Not now</button><button class="btn primary" disabled={!address.trim()}>Set up</button></span>
    </form>
  );
}
