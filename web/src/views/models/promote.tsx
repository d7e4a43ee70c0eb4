/// Promotion: what the gate says first; past a gate that does not pass only with a typed reason, which is kept.
import { useEffect, useRef, useState } from 'preact/hooks';
import { idempotency_key, error_text } from '../../api/client';
import { gate_of, promote, type Gate } from '../../api/learning';
import { say } from '../../state/store';
import { fixed } from '../../ui/format';
import { Chip, Icon, Mark } from '../../ui/marks';
import { Problem } from '../../ui/problem';
import { useDialog } from '../../ui/use_dialog';

export function Promote({
  model,
  name,
  done,
  close,
}: {
  model: string;
  name: string;
  done: () => void;
  close: () => void;
}) {
  const [gate, set_gate] = useState<Gate | null>(null),
    [problem, set_problem] = useState(''),
    [reason, set_reason] = useState(''),
    [busy, set_busy] = useState(false),
    key = useRef(idempotency_key()),
    box = useDialog<HTMLElement>(close, 'promote');
  useEffect(() => {
    gate_of(model).then(set_gate, (e: unknown) => set_problem(error_text(e)));
  }, [model]);
  const send = async (): Promise<void> => {
    set_busy(true);
    try {
      await promote(model, reason.trim(), key.current);
      say('Promoted: from the next range on');
      done();
    } catch (e) {
      set_problem(error_text(e));
      key.current = idempotency_key();
    }
    set_busy(false);
  };
  return (
    <section class="drawer" {...box} aria-labelledby="promote-title" data-testid="promote-dialog">
      <div class="hd big">
        <h2 id="promote-title">Promote {name}</h2>
        <span class="grow" />
        <button class="btn quiet" aria-label="Close" onClick={close}>
          <Icon name="close" />
        </button>
      </div>
      <p class="why">
        It classifies and corrects every range from the next one on. Flights that are already solved keep their models.
      </p>
      <Problem text={problem} />
      {gate && (
        <>
          <p>
            {gate.passed ? (
              <Chip shape="ok" tone="ok" word="GATE PASSED" />
            ) : (
              <Chip shape="bad" tone="bad" word="GATE NOT PASSED" />
            )}{' '}
            {gate.why}
          </p>
          {gate.checks.length > 0 && (
            <table class="tbl">
              <caption class="sr">Checks of the gate</caption>
              <thead>
                <tr>
                  <th scope="col">Check</th>
                  <th scope="col" class="num">
                    This model
                  </th>
                  <th scope="col" class="num">
                    Active model
                  </th>
                  <th scope="col">Result</th>
                </tr>
              </thead>
              <tbody>
                {gate.checks.map((c) => (
                  <tr key={c.name}>
                    <th scope="row">{c.name.replaceAll('_', ' ')}</th>
                    <td class="num">{fixed(c.candidate, 4)}</td>
                    <td class="num">{fixed(c.current, 4)}</td>
                    <td>
                      <Mark shape={c.passed ? 'ok' : 'bad'} tone={c.passed ? 'ok' : 'bad'} />{' '}
                      {c.passed ? 'passed' : 'worse'}
                    </td>
                  </tr>
                ))}
              </tbody>
            </table>
          )}
          {!gate.passed && (
            <>
              <label class="lab" for="reason">
                Reason, kept in the audit log
              </label>
              <input
                id="reason"
                value={reason}
                maxLength={500}
                data-testid="reason"
                onInput={(e) => set_reason(e.currentTarget.value)}
              />
            </>
          )}
          <div class="actions">
            <button class="btn" onClick={close}>
              Not now
            </button>
            <button
              class="btn primary"
              data-testid="promote-now"
              disabled={busy || (!gate.passed && reason.trim() === '')}
              onClick={() => void send()}
            >
              Promote
            </button>
          </div>
        </>
      )}
    </section>
  );
}
