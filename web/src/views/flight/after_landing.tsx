/// What happens with a flight that has landed: it is solved by itself, and a person reviews the result.
import { useEffect, useState } from 'preact/hooks';
import { newest_summary } from '../../api/calibrations';
import type { Wire } from '../../api/contract';
import { may_publish } from '../../state/session';
import { events, jobs_version } from '../../state/store';
import { publish_open } from '../dialogs';

export function AfterLanding({ mission }: { mission: string }) {
  const [made, set_made] = useState<Wire<'CalibrationSummary'> | null>(null),
    version = jobs_version.value;
  useEffect(() => {
    let gone = false;
    newest_summary(mission).then(
      (c) => {
        if (!gone) set_made(c);
      },
      () => undefined,
    );
    return () => {
      gone = true;
    };
  }, [mission, version]);
  const begun = events.value.filter((e) => e.mission === mission && e.code === 'calibration.after_landing').at(-1),
    there = made?.settings?.after_landing === true && (!begun || Date.parse(made.created_at) * 1000 >= begun.t_us);
  if (!begun && !there) return null;
  const n = made?.n_anchors ?? 0,
    good = made?.verdicts?.ok ?? 0;
  return (
    <section class="sec-p">
      <div class={there ? 'callout info' : 'callout'} role="status" data-testid="after-landing">
        {there ? (
          <>
            <b>The flight is calibrated.</b>{' '}
            <span class="says">
              {good} of {n} anchors have a position; nothing is published yet.
            </span>{' '}
            {may_publish.value && (
              <button
                class="btn small primary"
                data-testid="review-landed"
                onClick={() => {
                  publish_open.value = true;
                  location.hash = '#/anchors';
                }}
              >
                Review
              </button>
            )}
          </>
        ) : (
          <>
            <b>Calibrating.</b> All ranges of the flight are being solved together.
          </>
        )}
      </div>
    </section>
  );
}
