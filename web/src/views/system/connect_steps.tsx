/// The first set-up as steps: what is done, what is next, and the button that does it.
import type { Found, Radio } from '../../api/devices';
import { Mark } from '../../ui/marks';
import { connect_steps, type Step } from './connect';
import type { Row } from './use_devices';

const LOOK: Record<Step['state'], readonly ['ok' | 'info' | 'off', string]> = {
  done: ['ok', 'done'],
  now: ['info', 'next'],
  later: ['off', 'later'],
};

export function ConnectSteps({
  rows,
  found,
  radios,
  discover,
  tune,
}: {
  rows: readonly Row[];
  found: readonly Found[] | null;
  radios: Readonly<Record<string, Radio>>;
  discover: (() => void) | null;
  tune: ((id: string) => void) | null;
}) {
  const steps = connect_steps(rows, found, radios),
    left = steps.filter((s) => s.state !== 'done').length;
  return (
    <section class="callout connect" data-help="connect" aria-label="Connect my devices" data-testid="connect-steps">
      <h3>Connect my devices</h3>
      <ol>
        {steps.map((s) => {
          const [look, word] = LOOK[s.state];
          return (
            <li
              key={s.id}
              data-testid={`step-${s.id}`}
              data-state={s.state}
              aria-current={s.state === 'now' ? 'step' : undefined}
            >
              <Mark shape={look} tone={look} /> <b>{s.title}</b> <span class="sr">({word})</span>
              <span class="mut block">
                {s.what}.{s.state === 'now' && s.todo && <b> {s.todo}</b>}
              </span>
              {s.state === 'now' && s.id === 'find' && discover && (
                <button class="btn small" onClick={discover}>
                  Discover
                </button>
              )}
              {s.state === 'now' && s.id === 'radio' && s.device && tune && (
                <button class="btn small" onClick={() => tune(s.device!)}>
                  Radio
                </button>
              )}
            </li>
          );
        })}
      </ol>
      <p role="status">
        {left ? (
          `${left} of ${steps.length} steps left.`
        ) : (
          <>
            Everything measures. <a href="#/plan">Plan the flight</a>, or{' '}
            <a href="#/system/flight" data-testid="to-new-flight">
              start recording
            </a>
            .
          </>
        )}{' '}
        <a href="#/guide/mounting">How to mount them</a>
      </p>
    </section>
  );
}
