/// An address that names something which is not there: every view says so in one way, with what is shown instead and what to do.
import type { ComponentChildren } from 'preact';

export const Unknown = ({
  what,
  id,
  where = 'is stored here',
  children,
}: {
  what: 'page' | 'flight' | 'plan' | 'anchor' | 'training run';
  id: string;
  where?: string;
  children: ComponentChildren; ///< what is shown instead, or what else to do
}) => (
  <div class="problem" role="status" data-testid={`unknown-${what.split(' ').pop()!}`}>
    <b>
      No {what} {id} {where}.
    </b>{' '}
    Check the address; {children}
  </div>
);
