import type { ComponentChildren } from 'preact';
import { useState } from 'preact/hooks';
import { events, server_now_us, tick } from '../state/store';
import { age } from '../ui/format';
import { Mark, type Tone } from '../ui/marks';

const TONE: Readonly<Record<string, Tone & ('info' | 'caution' | 'bad')>> = {
  info: 'info',
  warning: 'caution',
  critical: 'bad',
};

/// One event of a list: live, with its age; of a stored flight, with the way to its moment.
export function EventRow({
  e,
  here = false,
  children,
}: {
  e: { readonly level: string; readonly text: string; readonly code: string };
  here?: boolean; ///< the last one before the moment that is shown
  children: ComponentChildren;
}) {
  const look = TONE[e.level] ?? 'info';
  return (
    <li aria-current={here ? 'step' : undefined}>
      <Mark shape={look} tone={look} />
      <span>
        <span class="sr">{e.level}: </span>
        {e.text || e.code}
      </span>
      {children}
    </li>
  );
}

/// The last 50 events, newest first; closed by default, since alarms say what needs doing.
export function Events() {
  const [open, set_open] = useState(false);
  tick.value;
  const list = [...events.value].reverse();
  if (!list.length) return null;
  return (
    <details class="sec-p events" data-testid="events" onToggle={(e) => set_open(e.currentTarget.open)}>
      <summary>
        <h2>Events</h2>
        <span class="meta">
          {list.length}, newest {age((server_now_us() - list[0]!.t_us) / 1000)} ago
        </span>
      </summary>
      {/* Fifty ages that nobody sees are most of what changes each second. */}
      {open && (
        <ul>
          {list.map((e) => (
            <EventRow key={e.id} e={e}>
              <span class="mut">{age((server_now_us() - e.t_us) / 1000)}</span>
            </EventRow>
          ))}
        </ul>
      )}
    </details>
  );
}
