/// Radio settings of a tag and of everything in its reach: read from it now, compared with every anchor, set everywhere and verified, or set back everywhere.
import { useEffect, useState } from 'preact/hooks';
import { error_text } from '../../api/client';
import { compare_radio, read_radio, set_radio, type Device, type Radio } from '../../api/devices';
import { mission_list } from '../../state/store';
import { Mark } from '../../ui/marks';
import { Problem } from '../../ui/problem';
import { radio_differences } from './radio_words';
import { typed_number } from '../../ui/typed_number';
import { useStable } from '../../ui/use_stable';

const CHOICES: readonly (readonly [Exclude<keyof Radio, 'gain_db' | 'devices'>, string, string, readonly number[]])[] =
  [
    ['channel', 'Channel', '', [1, 2, 3, 4, 5, 7]],
    ['rate_kbps', 'Bit rate', 'kbit/s', [110, 850, 6810]],
    ['prf_mhz', 'PRF', 'MHz', [16, 64]],
    ['preamble_symbols', 'Preamble', 'symbols', [64, 128, 256, 512, 1024, 1536, 2048, 4096]],
  ];

export function RadioPanel({
  device,
  may_change,
  reported,
  close,
}: {
  device: Device;
  may_change: boolean;
  reported: (radio: Radio) => void;
  close: () => void;
}) {
  const [radio, set] = useState<Radio | null>(null),
    [gain, set_gain] = useState<string | null>(null), // as it is typed
    [now, set_now] = useState<Radio | null>(null),
    [problem, set_problem] = useState(''),
    [busy, set_busy] = useState(''),
    [done, set_done] = useState<Radio | null>(null);
  const flying = mission_list.value.some((m) => m.state === 'recording');
  const take = (r: Radio): void => {
    set(r);
    set_gain(null);
    set_now(r);
    reported(r);
  };
  const work = async (what: string, ask: () => Promise<Radio>): Promise<Radio | null> => {
    set_busy(what);
    set_problem('');
    set_done(null);
    let answer: Radio | null = null;
    try {
      take((answer = await ask()));
    } catch (e) {
      set_problem(error_text(e));
    }
    set_busy('');
    return answer;
  };
  // Asking the anchors stops ranging for some seconds: by itself only while nothing is recorded.
  const look = (): Promise<Radio | null> => work('look', () => compare_radio(device.id!));
  const begin = useStable((): void => {
    void work('read', () => read_radio(device.id!)).then((r) => {
      if (r && may_change && !flying) void look();
    });
  });
  useEffect(begin, [device.id, begin]);
  const apply = async (wanted: Radio): Promise<void> => {
    const answer = await work('set', () => set_radio(device.id!, wanted));
    if (answer) set_done(answer);
    else await read_radio(device.id!).then(take, () => undefined); // what it has now, not what was wanted
  };
  const bad_gain = Number.isNaN(radio?.gain_db ?? 0),
    changed =
      radio !== null &&
      now !== null &&
      (radio.gain_db !== now.gain_db || CHOICES.some(([key]) => radio[key] !== now[key])),
    apart = now?.devices.filter((p) => !p.done) ?? [];
  return (
    <form
      class="callout"
      data-help="radio"
      data-testid="radio"
      aria-label={`Radio of ${device.name}`}
      onSubmit={(e) => {
        e.preventDefault();
        if (radio && !bad_gain) void apply(radio);
      }}
    >
      <b>Radio of {device.name || device.network_id}.</b>{' '}
      <span class="mut">Tag and anchors receive each other only with the same channel, rate, PRF and preamble.</span>
      <Problem text={problem} />
      {busy === 'read' && <p role="status">Reading from the tag.</p>}
      {radio && (
        <div class="addform">
          {CHOICES.map(([key, name, unit, values]) => (
            <label key={key}>
              <span class="lab">
                {name}
                {unit && `, ${unit}`}
              </span>
              <select
                value={radio[key]}
                disabled={!may_change || busy !== ''}
                data-testid={`radio-${key}`}
                onChange={(e) => set({ ...radio, [key]: Number(e.currentTarget.value) })}
              >
                {values.map((v) => (
                  <option key={v} value={v}>
                    {v}
                  </option>
                ))}
              </select>
            </label>
          ))}
          <label>
            <span class="lab">Gain, dB</span>
            <input
              inputMode="decimal"
              value={gain ?? radio.gain_db ?? ''}
              aria-invalid={bad_gain}
              disabled={!may_change || busy !== ''}
              data-testid="radio-gain"
              onInput={(e) => {
                set_gain(e.currentTarget.value);
                set({ ...radio, gain_db: typed_number(e.currentTarget.value) });
              }}
            />
          </label>
        </div>
      )}
      {busy === 'look' && <p role="status">Asking every anchor by radio; no ranges for some seconds.</p>}
      {now && now.devices.length > 0 && !done && (
        <div data-testid="radio-compared">
          {apart.length === 0 ? (
            <p role="status">
              <Mark shape="ok" tone="ok" /> All {now.devices.length} anchors it knows have the same settings.
            </p>
          ) : (
            <>
              <p role="status">
                <Mark shape="caution" tone="caution" />{' '}
                <b>
                  {apart.length} of {now.devices.length} anchors could not be verified to have the settings of the tag:
                </b>
              </p>
              <ul>
                {apart.map((p) => (
                  <li key={p.network_id}>
                    {p.network_id}: {p.why.replace(`${p.network_id} `, '').replaceAll('_', ' ')}
                  </li>
                ))}
              </ul>
              <p class="mut">
                One that does not answer is switched off, out of range, or on other settings: bring the tag to those
                settings, or the anchor to the tag by cable.
              </p>
            </>
          )}
        </div>
      )}
      {done && (
        <p role="status" data-testid="radio-done">
          <Mark shape="ok" tone="ok" /> Set and verified:{' '}
          {[device.network_id, ...done.devices.map((d) => d.network_id)].filter(Boolean).join(', ')}.
        </p>
      )}
      <div class="actions">
        <button type="button" class="btn" onClick={close}>
          Close
        </button>
        {may_change && (
          <button
            type="button"
            class="btn"
            data-testid="radio-compare"
            disabled={busy !== ''}
            onClick={() => void look()}
          >
            {flying ? 'Compare with the anchors (stops ranging)' : 'Compare with the anchors'}
          </button>
        )}
        {may_change && (
          <button class="btn primary" data-testid="radio-apply" disabled={busy !== '' || !radio || bad_gain}>
            {busy === 'set' ? 'Setting and verifying each' : changed ? 'Apply to all and verify' : 'Apply to all again'}
          </button>
        )}
      </div>
      {changed && busy === '' && (
        <p class="mut">If one device does not accept them, all return to their present settings.</p>
      )}
    </form>
  );
}

/// Tags that differ from each other, or anchors that were seen to differ from their tag, reported until it is mended.
/// Reads the tags once and whenever one begins to talk.
export function RadioWarning({
  devices,
  compared,
  look,
}: {
  devices: readonly Device[];
  compared: Readonly<Record<string, Radio>>;
  look: ((id: string) => void) | null;
}) {
  const [read, set_read] = useState<Readonly<Record<string, Radio>>>({}),
    tags = devices.filter((d) => d.kind === 'pozyx' && d.enabled && d.state === 'talking'),
    who = tags
      .map((d) => d.id!)
      .sort()
      .join();
  useEffect(() => {
    let gone = false;
    for (const id of who.split(',').filter(Boolean))
      read_radio(id).then(
        (r) => {
          if (!gone) set_read((all) => ({ ...all, [id]: r }));
        },
        () => undefined,
      );
    return () => {
      gone = true;
    };
  }, [who]);
  const lines = radio_differences(
    tags.map((d) => ({ id: d.id!, name: d.name, radio: compared[d.id!] ?? read[d.id!] ?? null, options: d.options })),
  );
  return (
    <>
      {lines.map((l) => (
        <div key={l.text} class="callout caution" role="status" data-testid="radio-differs">
          <b>{l.title}</b> {l.text}{' '}
          {look && (
            <button class="btn small" onClick={() => look(l.id)}>
              Radio
            </button>
          )}
        </div>
      ))}
    </>
  );
}
