/// Every radio that was in range in any flight, with how it stands while one is recorded.
import type { Device } from '../../api/devices';
import { devices as live_devices, mission_list, server_now_us } from '../../state/store';
import { age } from '../../ui/format';
import { Chip, type Shape, type Tone } from '../../ui/marks';

const LOOK: Record<string, [Shape, Tone]> = { live: ['ok', 'ok'], late: ['caution', 'caution'], lost: ['bad', 'bad'] };

export function RadiosInRange({ radios }: { radios: readonly Device[] }) {
  const flying = mission_list.value.some((m) => m.state === 'recording'),
    live = new Map(live_devices.value.map((d) => [d.network_id, d]));
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
          {radios.slice(0, 100).map((d, i) => {
            // Silence is news only while a flight is recorded.
            const now = flying ? live.get(d.network_id ?? '')?.state : undefined,
              [shape, tone] = LOOK[now ?? ''] ?? ['off', 'off'];
            return (
              <tr key={`${d.network_id}${i}`}>
                <th scope="row">{d.network_id ?? '–'}</th>
                <td>{d.kind}</td>
                <td>
                  <Chip shape={shape} tone={tone} word={(now ?? 'no flight').toUpperCase()} />
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
