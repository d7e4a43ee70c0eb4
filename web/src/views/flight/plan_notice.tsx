/// In flight: the plan that is flown is not the one that is saved, or was changed and can be changed back. What the change would do is a panel
/// of its own, fetched when it is asked for.
import { signal } from '@preact/signals';
import type { ProcedureMsg } from '../../live/flight_messages';
import { may } from '../../state/session';
import { useLater } from '../../ui/use_later';
import { flying } from './words';

/// Which difference is shown: to what was saved, or back to what was flown before.
export const shown_change = signal<'saved' | 'undo' | null>(null);
const load_panel = () => import('./plan_change').then((m) => m.PlanChange);

export function PlanNotice({ p }: { p: ProcedureMsg }) {
  const { part: Panel } = useLater(load_panel);
  if (!flying(p)) return null;
  const waits = p.plan_saved_revision !== null && p.plan_saved_revision !== p.plan_revision,
    open = shown_change.value;
  return (
    <>
      {waits && open !== 'saved' && (
        <p class="callout" role="status" data-testid="plan-waits">
          <b class="says">
            Revision {p.plan_saved_revision} of {p.plan_name} is saved, revision {p.plan_revision} is flown.
          </b>{' '}
          <button class="btn small" data-testid="plan-review" onClick={() => (shown_change.value = 'saved')}>
            Review the change
          </button>
        </p>
      )}
      {p.plan_undo_revision !== null && may('operator') && open !== 'undo' && (
        <p class="callout">
          The plan was changed in flight.{' '}
          <button class="btn small" data-testid="plan-undo" onClick={() => (shown_change.value = 'undo')}>
            Undo: back to revision {p.plan_undo_revision}
          </button>
        </p>
      )}
      {open && Panel && <Panel p={p} undo={open === 'undo'} close={() => (shown_change.value = null)} />}
    </>
  );
}
