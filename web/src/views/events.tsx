import { events, server_now_us, tick } from '../state/store';
import { age } from '../ui/format';
import { Mark, type Tone } from '../ui/marks';

const TONE: Record<'info' | 'warning' | 'critical', Tone & ('info' | 'caution' | 'bad')> = {
  info: 'info',
  warning: 'caution',
  critical: 'bad',
};

/// The last 50 events, newest first; closed by default, since alarms say what needs doing.
export function Events() {
  tick.value;
  const list = [...events.value].reverse();
  if (!list.length) return null;
  return (
    <details class="sec-p events" data-testid="events">
      <summary>
        <h2>Events</h2>
        <span class="meta">
          {list.length}, newest {age((server_now_us() - list[0]!.t_us) / 1000)} ago
        </span>
      </summary>
      <ul>
        {list.map((e) => (
          <li key={e.id}>
            <Mark shape={TONE[e.level]} tone={TONE[e.level]} />
            <span>
              <span class="sr">{e.level}: </span>
              {e.text || e.code}
            </span>
            <span class="mut">{age((server_now_us() - e.t_us) / 1000)}</span>
          </li>
        ))}
      </ul>
    </details>
  );
}
