/// One alarm of a list: of those that stand now, and of those that stood at a moment of a stored flight.
import type { ComponentChildren } from 'preact';
import type { Alarm } from './alarm_rules';
import { Mark } from './marks';

export const shape_of = (a: Alarm) =>
  a.priority === 'critical' ? 'bad' : a.priority === 'warning' ? 'caution' : 'info';

export function AlarmRow({
  a,
  stood,
  over = false,
  children,
}: {
  a: Alarm;
  stood: string; ///< for how long
  over?: boolean;
  children?: ComponentChildren;
}) {
  const look = over ? 'off' : shape_of(a);
  return (
    <li data-testid={`listed-${a.id}`}>
      <Mark shape={look} tone={look} />
      <div class="grow">
        <h2>{a.title}</h2>
        {a.advice && <p>{a.advice}</p>}
        <p class="mut">{over ? 'over' : `${a.priority}, for ${stood}${a.acknowledged ? ', acknowledged' : ''}`}</p>
      </div>
      {children}
    </li>
  );
}
