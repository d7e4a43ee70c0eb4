/// Every radio that was in range in any flight, with how it stands while one is recorded.
import type { Device } from '../../api/devices';
import { mission_list, now_ms, scenes, server_now_us, tick } from '../../state/store';
import { age } from '../../ui/format';
import { Chip, type Shape, type Tone } from '../../ui/marks';
import { last_seen_of_each, radio_state } from './radio_state';

const LOOK: Record<string, [Shape, Tone]> = { live: ['ok', 'ok'], late: ['caution', 'caution'], lost: ['bad', 'bad'] };

export function RadiosInRange({ radios }: { radios: readonly Device[] }) {
  tick.value;
  const recording = mission_list.value
    .filter((m) => m.state === 'recording')
    .flatMap((m) => scenes.get(m.mission) ?? []);
  return (
    <>
      <h3>Radios in range</h3>
      <table class="tbl" data-testid="radios-in-range">
        <caption class="sr">Radios that were in range in any flight</caption>
        <thead>
          <tr>
            <th scope="col">Radio</th>
            <th scope="col">Kind</th>
            <th scope="col">State</th>
            <th scope="col">Last seen</th>
          </tr>
        </thead>
        <tbody>
          {last_seen_of_each(radios)
            .slice(0, 100)
            .map((d) => {
              // Silence is news only while a flight is recorded.
              const now = radio_state(d.network_id ?? '', recording, now_ms()),
                [shape, tone] = LOOK[now] ?? ['off', 'off'];
              return (
                <tr key={d.network_id}>
                  <th scope="row" class="whole">
                    {d.network_id ?? '–'}
                  </th>
                  <td>{d.kind}</td>
                  <td>
                    <Chip shape={shape} tone={tone} word={now.toUpperCase()} />
                  </td>
                  <td>{d.last_seen_us === null ? '–' : `${age((server_now_us() - d.last_seen_us) / 1000)} ago`}</td>
                </tr>
              );
            })}
        </tbody>
      </table>
    </>
  );
}
