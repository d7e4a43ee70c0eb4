/// Radio settings of a tag and of everything in its reach: read from it now, set everywhere and verified, or set back everywhere.
import { useEffect, useState } from 'preact/hooks';
import { said } from '../../api/client';
import { read_radio, set_radio, type Device, type Radio } from '../../api/system';
import { Mark } from '../../ui/marks';

const CHOICES: readonly (readonly [Exclude<keyof Radio, 'gain_db' | 'devices'>, string, string, readonly number[]])[] = [
  ['channel', 'Channel', '', [1, 2, 3, 4, 5, 7]], ['rate_kbps', 'Bit rate', 'kbit/s', [110, 850, 6810]], ['prf_mhz', 'PRF', 'MHz', [16, 64]], ['preamble_symbols', 'Preamble', 'symbols', [64, 128, 256, 512, 1024, 1536, 2048, 4096]],
];

export function RadioPanel({ device, may_change, close }: { device: Device; may_change: boolean; close: () => void }) {
  const [radio, set] = useState<Radio | null>(null), [problem, set_problem] = useState(''), [busy, set_busy] = useState(false);
  useEffect(() => { set(null); set_problem(''); read_radio(device.id!).then(set, (e: unknown) => set_problem(said(e))); }, [device.id]);
  const apply = async (wanted: Radio): Promise<void> => {
    set_busy(true);
    set_problem('');
    try { set(await set_radio(device.id!, wanted)); } catch (e) {
      set_problem(said(e));
      await read_radio(device.id!).then(set, () => undefined);  // what it has now, not what was wanted
    }
    set_busy(false);
  };
  return (
    <form class="callout" data-testid="radio" onSubmit={(e) => { e.preventDefault(); if (radio) void apply(radio); }}>
      <b>Radio of {device.name || device.network_id}.</b> <span class="mut">Tag and anchors hear each other only with the same channel, rate, PRF and preamble.</span>
      {problem && <div class="problem" role="status"><b>That did not work.</b> {problem}</div>}
      {!radio && !problem && <p role="status">Asking the tag.</p>}
      {radio && <div class="addform">
        {CHOICES.map(([key, name, unit, values]) => (
          <label key={key}><span class="lab">{name}{unit && `, ${unit}`}</span><select value={radio[key]} disabled={!may_change || busy} data-testid={`radio-${key}`} onChange={(e) => set({ ...radio, [key]: Number(e.currentTarget.value), devices: [] })}>{values.map((v) => <option key={v} value={v}>{v}</option>)}</select></label>
        ))}
        <label><span class="lab">Gain, dB</span><input type="number" min="0" max="33.5" step="0.5" value={radio.gain_db ?? ''} disabled={!may_change || busy} onInput={(e) => set({ ...radio, gain_db: e.currentTarget.value === '' ? null : Number(e.currentTarget.value), devices: [] })} /></label>
        <span class="actions"><button type="button" class="btn" onClick={close}>Close</button>{may_change && <button class="btn primary" data-testid="radio-apply" disabled={busy}>{busy ? 'Setting and verifying each' : 'Apply to all and verify'}</button>}</span>
      </div>}
      {radio && radio.devices.length > 0 && <p role="status" data-testid="radio-done"><Mark shape="ok" tone="ok" /> Set and verified: {radio.devices.map((d) => d.network_id).join(', ')}.</p>}
    </form>
  );
}
